use super::*;

/// A leg of 0.4 m and 0.3 m whose joint `j1` has these limits; the others go once around.
fn leg(lower: f64, upper: f64) -> String {
    let joint = |name: &str, z: f64, axis: &str, (lower, upper): (f64, f64)| {
        let number: usize = name[1..].parse().unwrap();
        format!(
            "<link name='l{number}'/><joint name='{name}' type='revolute'><parent link='l{}'/><child link='l{number}'/>\
             <origin xyz='0 0 {z}'/><axis xyz='{axis}'/>\
             <limit lower='{lower}' upper='{upper}' velocity='1' effort='1'/></joint>",
            number - 1
        )
    };
    let around = (-3.2, 3.2);
    let joints = [
        joint("j1", 0.0, "0 0 1", (lower, upper)),
        joint("j2", 0.0, "1 0 0", around),
        joint("j3", 0.0, "0 1 0", around),
        joint("j4", -0.4, "0 1 0", around),
        joint("j5", -0.3, "0 1 0", around),
        joint("j6", 0.0, "1 0 0", around),
    ];
    format!("<robot name='leg'><link name='l0'/>{}</robot>", joints.concat())
}

/// The solutions of a foot 0.6 m below the hip, joint 1 having been at `previous`.
fn solved(lower: f64, upper: f64, previous: f64) -> LimbAnswer {
    let text = serde_json::json!({
        "schema": SCHEMA,
        "robot": { "urdf": { "name": "leg.urdf", "text": leg(lower, upper) } },
        "frame": "l6",
        "position_m": [0.05, 0.02, -0.6],
        "rotation_xyzw": [0.0, 0.0, 0.0, 1.0],
        "previous": { "j1": previous },
    });
    let file = LimbPoseFile::parse(&text.to_string(), "pose.json").unwrap();
    let answer = file.solve("pose.json").unwrap();
    assert_eq!((answer.outcome.as_str(), answer.solutions.len()), ("solved", 8));
    assert!(
        answer
            .solutions
            .iter()
            .all(|s| s.error_m < 1e-12 && s.error_rad < 1e-12)
    );
    answer
}

#[test]
fn an_angle_is_given_in_the_turn_that_the_limits_allow() {
    let limits = |lower, upper| Limits {
        lower,
        upper,
        ..Limits::UNLIMITED
    };
    let close = |found: f64, expected: f64| assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    close(in_turn(0.0, &limits(1.0, 7.0), 6.2), TAU);
    // Two turns are inside: the nearer to where the joint was.
    close(in_turn(0.1, &limits(-7.0, 7.0), 5.0), 0.1 + TAU);
    close(in_turn(0.1, &limits(-7.0, 7.0), 3.0), 0.1);
    // The nearest turn is outside, another one is not.
    close(in_turn(3.1, &limits(-3.12, 3.12), -3.1), 3.1);
    close(in_turn(0.0, &limits(1.0, 7.0), 40.0), TAU);
    // No turn is inside.
    close(in_turn(0.0, &limits(1.0, 2.0), 6.0), TAU);
    close(in_turn(0.5, &Limits::UNLIMITED, 13.0), 0.5 + 2.0 * TAU);
}

#[test]
fn full_turns_are_added_to_stay_within_limits() {
    let first = &solved(1.0, 7.0, 6.2).solutions[0];
    assert!(first.within_limits, "{first:?}");
    assert!(
        (first.joints["j1"] - 6.2).abs() < 0.5 && first.away_rad < 1.5,
        "{first:?}"
    );
}

#[test]
fn one_solution_is_the_nearest_within_the_limits_if_there_is_one() {
    // Joint 1 near 0 is nearest to where it was, but only half a turn from there is allowed.
    let all = solved(2.0, 4.0, 0.0);
    assert!(!all.solutions[0].within_limits, "{all:?}");
    let expected = all.solutions.iter().find(|s| s.within_limits).unwrap().clone();
    assert_eq!(all.nearest().solutions, [expected]);
    let none = solved(1.4, 1.6, 0.0);
    assert!(none.solutions.iter().all(|s| !s.within_limits));
    let first = none.solutions[0].clone();
    assert_eq!(none.nearest().solutions, [first]);
}
