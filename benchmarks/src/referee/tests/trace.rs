//! The table over time.

use super::*;
use crate::referee::{Run, StepEfforts};
use ik_core::problem::PhaseId;

#[test]
fn columns_and_rows_of_the_shoot_out() {
    let problem = shoot_out(Boundary::Positions);
    let soles = ["l_sole", "r_sole"].map(|name| frame(problem.robot(), name));
    let spec = JudgeSpec {
        torque_supports: soles.to_vec(),
        ..plain_spec()
    };
    let referee = Referee::new(&problem, spec).unwrap();
    let mut draw = Draw(11);
    let q: Vec<_> = (0..3).map(|_| draw.configuration(problem.robot())).collect();
    let width = problem.nx() + problem.nxdot();
    let targets: Vec<f64> = (0..3 * width).map(|_| draw.next()).collect();
    let run = Run {
        dt_s: 0.005,
        q: &q,
        targets: &targets,
        phases: &[PhaseId(0)],
        support: &[],
        walk: None,
    };
    let efforts = StepEfforts {
        step_us: &[7.5, 8.5],
        majors: &[3, 4],
        minors: &[5],
    };
    let trace = referee.trace(&run, &efforts);

    let fixed = [
        "t", "base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw",
    ];
    assert_eq!(trace.columns[..8], fixed);
    assert_eq!(trace.columns[8], "LHipSag");
    // Time, root, joints, com (3 + 3 + 2), two soles (6 + 3 + 2), torso (3 + 1), three efforts, torques.
    assert_eq!(trace.columns.len(), 1 + 7 + 12 + 8 + 2 * 11 + 4 + 3 + 12);
    assert!(trace.rows.iter().all(|row| row.len() == trace.columns.len()));
    let column = |name: &str| trace.column(name).unwrap_or_else(|| panic!("no column {name}"));
    assert_eq!(column("t"), [0.0, 0.005, 0.01]);
    assert_eq!(column("RKneeSag")[2], q[2][7 + 9]);
    assert_eq!(column("base_qw")[1], q[1][6]);
    assert_eq!(column("com_target_y")[1], targets[width + 1]);
    assert_eq!(column("left_target_yaw")[2], targets[2 * width + 8]);
    assert_eq!(column("step_us"), [0.0, 7.5, 8.5]);
    assert_eq!(column("majors"), [0.0, 3.0, 4.0]);
    assert_eq!(column("minors"), [0.0, 5.0, 0.0]);
    assert_eq!(column("com_rate_error_m_s")[0], 0.0);

    let quality = referee.judge(&run);
    let rms = |name: &str, from: usize| {
        let values = &column(name)[from..];
        (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
    };
    let most = |name: &str| column(name).into_iter().fold(0.0, f64::max);
    assert!((rms("com_error_m", 0) - quality.com_error_rms_m.unwrap()).abs() < 1e-15);
    assert!((rms("com_rate_error_m_s", 1) / quality.com_rate_error_rms_m_s.unwrap() - 1.0).abs() < 1e-14);
    assert_eq!(most("torso_error_rad"), quality.hard_error_max["torso_rad"]);
    assert!(most("left_error_m") >= quality.hard_error_max["left_m"]);
    let mut page = ik_core::kinematics::Page::new(problem.robot());
    ik_core::kinematics::forward(problem.robot(), &q[1], &mut page);
    let mut torques = [0.0; 12];
    ik_core::kinematics::gravity::static_torques_into(problem.robot(), &page, &soles, &mut torques).unwrap();
    assert!((column("torque_LKneeSag")[1] - torques[3]).abs() < 1e-9);
}

#[test]
fn rows_stop_where_the_run_cannot_be_read() {
    let problem = problem(
        slides(),
        vec![("com", Track::CentreOfMass, soft())],
        Boundary::None,
    );
    let q = [
        vec![0.0, 0.0],
        vec![1.0, 0.0],
        vec![f64::NAN, 0.0],
        vec![0.0, 0.0],
    ];
    let run = Run {
        dt_s: 0.1,
        q: &q,
        targets: &[0.0; 24],
        phases: &[PhaseId(0)],
        support: &[],
        walk: None,
    };
    let trace = referee(&problem).trace(&run, &StepEfforts::default());
    assert_eq!(trace.column("com_error_m").unwrap(), [0.0, 1.0]);
    assert_eq!(trace.column("com_rate_error_m_s").unwrap(), [0.0, 10.0]);
    let names = [
        "t",
        "to_beam",
        "to_tip",
        "com_target_x",
        "com_target_y",
        "com_target_z",
        "com_x",
        "com_y",
        "com_z",
        "com_error_m",
        "com_rate_error_m_s",
        "step_us",
        "majors",
        "minors",
    ];
    assert_eq!(trace.columns, names);
}

#[test]
fn quaternion_and_posture_targets_have_columns() {
    let robot = two_links();
    let tip = frame(&robot, "tip");
    let tasks = vec![
        ("tool", Track::Pose(tip), Priority::Hard),
        ("rest", Track::Posture, soft()),
    ];
    let parts = parts(robot, tasks, Boundary::None);
    let problem = Problem::new(ProblemParts {
        orientation: OrientationCoordinates::Log,
        ..parts
    })
    .unwrap();
    let x = [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.5, 0.25];
    let targets: Vec<f64> = x.into_iter().chain([0.0; 8]).collect();
    let q = [vec![0.0, 0.0]];
    let run = Run {
        dt_s: 0.1,
        q: &q,
        targets: &targets,
        phases: &[PhaseId(0)],
        support: &[],
        walk: None,
    };
    let trace = referee(&Arc::new(problem)).trace(&run, &StepEfforts::default());
    let value = |name: &str| trace.column(name).unwrap_or_else(|| panic!("no column {name}"))[0];
    assert_eq!(
        (value("tool_target_qw"), value("rest_target_to_lower")),
        (1.0, 0.25)
    );
    assert_eq!((value("tool_error_m"), value("tool_error_rad")), (0.0, 0.0));
    assert_eq!(
        (value("tool_x"), value("tool_y"), value("tool_z")),
        (2.0, 0.0, 0.0)
    );
    assert!((value("rest_error_rad") - 0.5_f64.hypot(0.25)).abs() < 1e-16);
}
