//! Support polygon, projected centre of mass and zero-moment points.

use super::*;
use crate::records::{Quality, Trace};
use crate::referee::balance::{PointMass, cart_zero_moment_point, zero_moment_point};
use crate::referee::hull::Hull;
use crate::referee::torque::STANDARD_GRAVITY_M_S2 as G;
use crate::referee::{Foot, RefereeError, Run, Sole, StepEfforts};
use crate::trajectory::Support;
use ik_core::problem::PhaseId;
use nalgebra::Vector2;

fn close(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-12 * expected.abs().max(1.0),
        "{found} instead of {expected}"
    );
}

fn hull(points: &[(f64, f64)]) -> Hull {
    Hull::new(points.iter().map(|&(x, y)| Vector2::new(x, y)).collect())
}

#[test]
fn distances_to_a_rectangle_and_a_triangle() {
    // Corners twice, points on the border and inside do no harm.
    let rectangle = hull(&[
        (0.0, 0.0),
        (4.0, 2.0),
        (4.0, 0.0),
        (0.0, 2.0),
        (2.0, 0.0),
        (4.0, 1.0),
        (1.0, 1.0),
        (4.0, 2.0),
        (0.0, 0.0),
    ]);
    let expected = [
        ((2.0, 1.0), 1.0),
        ((0.25, 1.5), 0.25),
        ((4.0, 1.5), 0.0),
        ((2.0, 3.0), -1.0),
        ((-0.5, 1.0), -0.5),
        ((7.0, 6.0), -5.0),
    ];
    for ((x, y), distance) in expected {
        assert_eq!(
            rectangle.signed_distance(&Vector2::new(x, y)),
            distance,
            "({x}, {y})"
        );
    }
    assert_eq!(
        rectangle.bounds(),
        (Vector2::new(0.0, 0.0), Vector2::new(4.0, 2.0))
    );
    let triangle = hull(&[(0.0, 0.0), (3.0, 0.0), (0.0, 4.0)]);
    // The incircle of a 3-4-5 triangle has the radius 1; (3, 4) lies 12/5 beyond the hypotenuse.
    close(triangle.signed_distance(&Vector2::new(1.0, 1.0)), 1.0);
    close(triangle.signed_distance(&Vector2::new(3.0, 4.0)), -2.4);
}

#[test]
fn a_hull_without_area_has_no_inside() {
    let line = hull(&[(0.0, 0.0), (1.0, 1.0), (3.0, 3.0), (2.0, 2.0)]);
    assert_eq!(line.signed_distance(&Vector2::new(1.5, 1.5)), 0.0);
    close(line.signed_distance(&Vector2::new(2.0, 0.0)), -(2.0_f64.sqrt()));
    assert_eq!(line.signed_distance(&Vector2::new(6.0, 7.0)), -5.0);
    let point = hull(&[(1.0, 1.0); 4]);
    assert_eq!(point.signed_distance(&Vector2::new(4.0, 5.0)), -5.0);
}

/// The signed distance is the least distance over all unit directions u of the half-plane u·x ≤ max u·pᵢ from p. It
/// is taken at the normal of an edge or in the direction from a corner to p, so these are tried for all pairs and
/// points, whether they belong to the hull or not.
fn distance_by_half_planes(points: &[Vector2<f64>], p: &Vector2<f64>) -> f64 {
    let mut directions: Vec<Vector2<f64>> = points.iter().map(|corner| p - corner).collect();
    for a in points {
        directions.extend(points.iter().map(|b| Vector2::new(a.y - b.y, b.x - a.x)));
    }
    let room = |direction: &Vector2<f64>| {
        let u = direction.normalize();
        let reach = points.iter().map(|corner| u.dot(corner)).fold(f64::MIN, f64::max);
        reach - u.dot(p)
    };
    directions
        .iter()
        .filter(|d| d.norm() > 1e-9)
        .map(room)
        .fold(f64::MAX, f64::min)
}

#[test]
fn signed_distances_agree_with_half_planes() {
    let mut draw = Draw(5);
    let (mut inside, mut outside) = (0, 0);
    for count in 3..12 {
        for _ in 0..40 {
            let mut point = || Vector2::new(draw.next(), 0.3 * draw.next());
            let points: Vec<_> = (0..count).map(|_| point()).collect();
            let p = point();
            let found = Hull::new(points.clone()).signed_distance(&p);
            let expected = distance_by_half_planes(&points, &p);
            assert!((found - expected).abs() < 1e-13, "{found} instead of {expected}");
            *if found > 0.0 { &mut inside } else { &mut outside } += 1;
        }
    }
    assert!(
        inside > 100 && outside > 100,
        "{inside} inside, {outside} outside"
    );
}

fn mass(mass_kg: f64, at: [f64; 3], acceleration: [f64; 3]) -> PointMass {
    PointMass {
        mass_kg,
        at: at.into(),
        acceleration: acceleration.into(),
    }
}

#[test]
fn the_zero_moment_point_of_two_masses_by_hand() {
    let masses = [
        mass(1.0, [0.0, 0.0, 1.0], [G, -2.0 * G, 0.0]),
        mass(3.0, [1.0, 2.0, 5.0], [0.0, 0.0, G]),
    ];
    // Forces g and 6 g: x = (−g + 6 g) / 7 g, y = (2 g + 12 g) / 7 g.
    let zmp = zero_moment_point(&masses).unwrap();
    close(zmp.x, 5.0 / 7.0);
    close(zmp.y, 2.0);
    // The cart: centre of mass (3/4, 3/2, 4), accelerated by (g/4, −g/2).
    let cart = cart_zero_moment_point(&masses);
    close(cart.x, 0.75 - 1.0);
    close(cart.y, 1.5 + 2.0);
    let falling = mass(1.0, [1.0, 0.0, 1.0], [0.0, 0.0, -G]);
    assert_eq!(zero_moment_point(&[falling]), None);
    assert_eq!(zero_moment_point(&[]), None);
}

#[test]
fn the_cart_is_exact_for_masses_at_one_height_that_accelerate_alike() {
    let mut draw = Draw(6);
    for _ in 0..20 {
        let (height, acceleration) = (1.0 + draw.next(), [9.0 * draw.next(), 9.0 * draw.next(), 0.0]);
        let masses: Vec<_> = (0..7)
            .map(|_| {
                mass(
                    1.1 + draw.next(),
                    [draw.next(), draw.next(), height],
                    acceleration,
                )
            })
            .collect();
        let (zmp, cart) = (
            zero_moment_point(&masses).unwrap(),
            cart_zero_moment_point(&masses),
        );
        assert!((zmp - cart).norm() < 1e-13, "{zmp} {cart}");
    }
}

/// A mass of 3 kg that slides up and forwards, at `(q1, 0, 2 + q0)`.
fn rider() -> Robot {
    RobotBuilder::new("rider")
        .link(link("base", 7.0, Vector3::x()))
        .link(link("lift", 0.0, Vector3::zeros()))
        .link(link("rider", 3.0, Vector3::zeros()))
        .joint(joint(
            JointKind::Prismatic,
            ("base", "lift"),
            [0.0, 0.0, 2.0],
            [0.0, 0.0, 1.0],
        ))
        .joint(joint(
            JointKind::Prismatic,
            ("lift", "rider"),
            [0.0; 3],
            [1.0, 0.0, 0.0],
        ))
        .build()
        .unwrap()
}

fn sole(frame: FrameId, foot: Foot) -> Sole {
    Sole {
        frame,
        half_length_m: 0.5,
        half_width_m: 0.25,
        foot,
    }
}

/// Judges and tabulates a run; targets are 0, and the only task is the centre of mass.
fn judged(
    robot: Robot,
    soles: Vec<Sole>,
    q: &[Vec<f64>],
    dt_s: f64,
    support: &[Support],
) -> (Quality, Trace) {
    let problem = problem(robot, vec![("com", Track::CentreOfMass, soft())], Boundary::None);
    let referee = Referee::new(
        &problem,
        JudgeSpec {
            soles,
            ..plain_spec()
        },
    )
    .unwrap();
    let run = Run {
        dt_s,
        q,
        targets: &vec![0.0; 6 * q.len()],
        phases: &[PhaseId(0)],
        support,
        walk: None,
    };
    (referee.judge(&run), referee.trace(&run, &StepEfforts::default()))
}

/// The rider on two soles around the origin.
fn judged_rider(q: &[Vec<f64>], dt_s: f64) -> (Quality, Trace) {
    let robot = rider();
    let base = frame(&robot, "base");
    judged(
        robot,
        vec![sole(base, Foot::Right), sole(base, Foot::Left)],
        q,
        dt_s,
        &[],
    )
}

#[test]
fn a_mass_that_accelerates_forwards_and_upwards() {
    let dt_s = 0.125;
    // ẍ = 1.5 m/s², z̈ = 0.5 m/s².
    let q: Vec<_> = (0..5)
        .map(|k| f64::from(k) * dt_s)
        .map(|t| vec![0.25 * t * t, 0.75 * t * t])
        .collect();
    let (quality, trace) = judged_rider(&q, dt_s);
    let column = |name: &str| trace.column(name).unwrap();
    for (k, q) in q.iter().enumerate() {
        // The ends have the accelerations of their neighbours, here the same.
        let (x, z) = (q[1], 2.0 + q[0]);
        close(column("gcom_x")[k], x);
        close(column("zmp_x")[k], x - 1.5 * z / (0.5 + G));
        close(column("cart_zmp_x")[k], x - 1.5 * z / G);
        for y in ["gcom_y", "zmp_y", "cart_zmp_y"] {
            assert_eq!(column(y)[k], 0.0);
        }
        close(column("gcom_margin")[k], 0.25_f64.min(0.5 - x));
        close(
            column("zmp_margin")[k],
            0.25_f64.min(0.5 - column("zmp_x")[k].abs()),
        );
    }
    // Forwards 0.75 · 0.5² at the end, less than the 0.25 to the sides.
    close(quality.gcom_margin_min_m.unwrap(), 0.25);
    let zmp = |k: usize| q[k][1] - 1.5 * (2.0 + q[k][0]) / (0.5 + G);
    close(quality.zmp_margin_min_m.unwrap(), 0.5 + zmp(1));
    close(
        quality.cart_zmp_margin_min_m.unwrap(),
        0.5 + q[1][1] - 1.5 * (2.0 + q[1][0]) / G,
    );
    let squares = (1..4).map(|k| (zmp(k) - q[k][1]).powi(2)).sum::<f64>();
    close(quality.zmp_gcom_distance_rms_m.unwrap(), (squares / 3.0).sqrt());
}

#[test]
fn the_ends_count_for_the_centre_of_mass_only_and_borrow_accelerations() {
    let at = |x: f64| vec![0.0, x];
    // Stands outside at k = 0 and k = 5; second differences are 0.7 and 0 at k = 1 and 2, 0 and -0.6 at 3 and 4.
    let q = [at(0.7), at(0.0), at(0.0), at(0.0), at(0.0), at(-0.6)];
    let (quality, trace) = judged_rider(&q, 1.0);
    close(quality.gcom_margin_min_m.unwrap(), -0.2);
    let (first, last) = (-0.7 * 2.0 / G, 0.6 * 2.0 / G);
    close(quality.zmp_margin_min_m.unwrap(), 0.25);
    close(
        quality.zmp_gcom_distance_rms_m.unwrap(),
        ((first * first + last * last) / 4.0).sqrt(),
    );
    let zmp = trace.column("zmp_x").unwrap();
    let expected = [0.7 + first, first, 0.0, 0.0, last, -0.6 + last];
    for (found, expected) in zmp.into_iter().zip(expected) {
        close(found, expected);
    }
    // No central difference at all: at rest.
    let (short, trace) = judged_rider(&q[..2], 1.0);
    close(short.gcom_margin_min_m.unwrap(), -0.2);
    assert_eq!(
        (short.zmp_margin_min_m, short.cart_zmp_margin_min_m),
        (None, None)
    );
    assert_eq!(short.zmp_gcom_distance_rms_m, None);
    for (zmp, x) in trace.column("zmp_x").unwrap().into_iter().zip([0.7, 0.0]) {
        close(zmp, x);
    }
}

#[test]
fn where_the_ground_would_have_to_pull_there_is_no_zero_moment_point() {
    let q: Vec<_> = [0.0, 0.0, 0.0, -2.0 * G].map(|z| vec![z, 0.0]).to_vec();
    let (quality, trace) = judged_rider(&q, 1.0);
    assert_eq!(
        (quality.zmp_margin_min_m, quality.zmp_gcom_distance_rms_m),
        (None, None)
    );
    assert_eq!(quality.cart_zmp_margin_min_m, Some(0.25));
    let missing: Vec<_> = trace
        .column("zmp_x")
        .unwrap()
        .iter()
        .map(|x| x.is_nan())
        .collect();
    assert_eq!(missing, [false, false, true, true]);
    assert!(trace.column("zmp_margin").unwrap()[2].is_nan());
}

#[test]
fn a_robot_at_rest_has_its_zero_moment_point_below_the_centre_of_mass() {
    let robot = embedded("coman").unwrap();
    let q = vec![Draw(8).configuration(&robot); 4];
    let soles =
        [("l_sole", Foot::Left), ("r_sole", Foot::Right)].map(|(n, foot)| sole(frame(&robot, n), foot));
    let (quality, trace) = judged(robot, soles.to_vec(), &q, 0.01, &[]);
    assert!(quality.zmp_gcom_distance_rms_m.unwrap() < 1e-14);
    assert_eq!(
        quality.zmp_margin_min_m.map(|m| (m * 1e12).round()),
        quality.gcom_margin_min_m.map(|m| (m * 1e12).round())
    );
    let column = |name: &str| trace.column(name).unwrap();
    for point in ["zmp", "cart_zmp"] {
        close(column(&format!("{point}_x"))[2], column("com_x")[2]);
        close(column(&format!("{point}_y"))[2], column("com_y")[2]);
    }
}

#[test]
fn the_polygon_is_that_of_the_feet_on_the_ground() {
    let robot = embedded("coman-legs").unwrap();
    let names = ["r_sole", "l_sole"].map(|name| frame(&robot, name));
    let posture = crate::referee::tree::Posture::new(&robot, &robot.neutral());
    let [right, left] = names.map(|f| posture.frame(&robot, f).translation.vector);
    let soles = vec![sole(names[0], Foot::Right), sole(names[1], Foot::Left)];
    let q = vec![robot.neutral(); 3];
    let support = [Support::Both, Support::Right, Support::Left];
    let (quality, trace) = judged(robot.clone(), soles.clone(), &q, 0.01, &support);
    let column = |name: &str| trace.column(name).unwrap();
    assert!(right.y < -0.01 && left.y > 0.01 && right.x == left.x);
    let (y_min, y_max) = (column("support_y_min"), column("support_y_max"));
    for (k, low, high) in [(0, right.y, left.y), (1, right.y, right.y), (2, left.y, left.y)] {
        close(y_min[k], low - 0.25);
        close(y_max[k], high + 0.25);
        close(column("support_x_min")[k], right.x - 0.5);
        close(column("support_x_max")[k], right.x + 0.5);
    }
    // The centre of mass is half-way between the feet: inside by the width of a sole less its distance.
    let (com_y, margin) = (column("com_y")[0], column("gcom_margin"));
    let ahead = 0.5 - (column("com_x")[0] - right.x).abs();
    close(margin[0], ahead.min(0.25 + left.y - com_y.abs()));
    close(margin[1], ahead.min(right.y + 0.25 - com_y));
    close(margin[2], ahead.min(com_y - (left.y - 0.25)));
    close(
        quality.gcom_margin_min_m.unwrap(),
        margin.into_iter().fold(1.0, f64::min),
    );
    // A sample without a support cannot be read.
    let (cut, trace) = judged(robot, soles, &q, 0.01, &support[..2]);
    assert!(!cut.survived && trace.rows.len() == 2);
}

#[test]
fn balance_is_judged_where_soles_are_named_and_does_not_decide_survival() {
    let q = vec![vec![0.0, 0.0]; 3];
    let (none, trace) = judged(rider(), Vec::new(), &q, 0.1, &[]);
    assert_eq!((none.gcom_margin_min_m, none.zmp_margin_min_m), (None, None));
    assert_eq!(trace.column("gcom_x"), None);
    let robot = rider();
    let base = frame(&robot, "base");
    let problem = problem(robot, vec![("rest", Track::Posture, soft())], Boundary::None);
    let soles = vec![sole(base, Foot::Right), sole(base, Foot::Left)];
    let referee = Referee::new(
        &problem,
        JudgeSpec {
            soles,
            ..plain_spec()
        },
    )
    .unwrap();
    let quality = referee.judge(&Run {
        dt_s: 0.1,
        q: &vec![vec![0.0, 0.9]; 3],
        targets: &[0.0; 12],
        phases: &[PhaseId(0)],
        support: &[],
        walk: None,
    });
    close(quality.gcom_margin_min_m.unwrap(), -0.4);
    close(quality.zmp_margin_min_m.unwrap(), -0.4);
    assert!(quality.survived);
}

#[test]
fn soles_are_checked() {
    let robot = rider();
    let base = frame(&robot, "base");
    let problem = problem(robot, vec![("com", Track::CentreOfMass, soft())], Boundary::None);
    let fails = |soles| {
        Referee::new(
            &problem,
            JudgeSpec {
                soles,
                ..plain_spec()
            },
        )
        .unwrap_err()
    };
    let (right, left) = (sole(base, Foot::Right), sole(base, Foot::Left));
    assert_eq!(fails(vec![right]), RefereeError::Foot("left"));
    assert_eq!(fails(vec![left, left]), RefereeError::Foot("right"));
    for extent in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let flat = Sole {
            half_width_m: extent,
            ..left
        };
        let message = fails(vec![right, flat]).to_string();
        assert!(message.contains("soles[1].half_width_m = "), "{message}");
    }
    let nowhere = Sole {
        frame: FrameId(99),
        ..left
    };
    let message = fails(vec![right, nowhere]).to_string();
    assert!(
        message.contains("soles: frame 99") && message.contains("3 frames"),
        "{message}"
    );
}
