//! How joints and the centre of mass move with the waist while the ends of all limbs are held.

use super::plan::{LimbPlan, Plan, Target};
use super::whole_body::Candidate;
use crate::reverse_decoupling::analyser::End;
use ik_core::configuration::root_pose;
use ik_core::kinematics::Page;
use ik_core::kinematics::screws::for_each_screw;
use ik_core::robot::Robot;
use nalgebra::{Isometry3, Matrix3, Vector3};

/// Determinants below this, of columns scaled to one, are singular.
const SINGULAR: f64 = 1e-6;
/// Damping of a singular system, in parts of its longest column.
const DAMPING: f64 = 1e-2;

/// `∂com/∂p`: p the position of the root, its rotation and the ends of all limbs held.
pub(super) fn centre_of_mass_rate(robot: &Robot, plan: &Plan, at: &Candidate) -> Matrix3<f64> {
    let first = robot.root().nv();
    let mut rate = Matrix3::identity();
    let pose = root_pose(robot, &at.q);
    for limb in &plan.limbs {
        let rates = joint_rates(robot, limb, &pose, &at.page);
        for (c, joint) in limb.coordinates.iter().zip(rates) {
            rate += at.page.centre_of_mass_column(first + c) * joint.transpose();
        }
    }
    rate
}

/// `∂q/∂p` of each joint of a limb (rad/m): p the position of the root, whose pose is `root`, the end of the limb held.
pub(super) fn joint_rates(
    robot: &Robot,
    limb: &LimbPlan,
    root: &Isometry3<f64>,
    page: &Page,
) -> [Vector3<f64>; 6] {
    let point = match limb.triple {
        (End::Base, point) => root * point,
        (End::Tip, point) => limb.tip_pose(robot, page) * point,
    };
    let (mut linear, mut angular) = ([Vector3::zeros(); 6], [Vector3::zeros(); 6]);
    let mut joints = linear.iter_mut().zip(&mut angular);
    for_each_screw(robot, page, limb.tip, &point.coords, |_, screw| {
        if let Some((linear, angular)) = joints.next() {
            (*linear, *angular) = (screw.linear, screw.angular);
        }
    });
    let block = |columns: &[Vector3<f64>; 6], first: usize| {
        Matrix3::from_columns(&[columns[first], columns[first + 1], columns[first + 2]])
    };
    // The joints that move the meeting point of the others, and the others.
    let (far, triple) = match limb.triple.0 {
        End::Base => (3, 0),
        End::Tip => (0, 3),
    };
    let moved = -inverse(&block(&linear, far));
    let mut rates = [Vector3::zeros(); 6];
    let mut write = |first: usize, block: Matrix3<f64>| {
        for k in 0..3 {
            rates[first + k] = block.row(k).transpose();
        }
    };
    write(far, moved);
    if matches!(limb.target, Target::Pose(..)) {
        write(
            triple,
            -inverse(&block(&angular, triple)) * block(&angular, far) * moved,
        );
    }
    rates
}

/// The inverse, damped where the columns are nearly dependent.
fn inverse(m: &Matrix3<f64>) -> Matrix3<f64> {
    if let Some(inverse) = m.try_inverse().filter(|_| is_regular(m)) {
        return inverse;
    }
    let longest = m.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
    let damping = Matrix3::from_diagonal_element((DAMPING * longest).powi(2).max(f64::MIN_POSITIVE));
    let normal = m.tr_mul(m) + damping;
    normal
        .try_inverse()
        .map_or_else(Matrix3::zeros, |inverse| inverse * m.transpose())
}

/// Whether the columns are well independent.
pub(super) fn is_regular(m: &Matrix3<f64>) -> bool {
    let scale = m.column_iter().map(|c| c.norm()).product::<f64>();
    m.determinant().abs() > SINGULAR * scale
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::*;
    use crate::generic_posture::generic_postures;
    use ik_core::boundary::Boundary;
    use ik_core::configuration::integrate;
    use ik_core::kinematics::forward;
    use ik_core::kinematics::jacobian::{Axes, frame_jacobian};
    use ik_core::problem::{Kind, Phase, Problem, ProblemParts, Supplies};
    use ik_core::robot::{FrameId, embedded};
    use ik_core::task::{OrientationCoordinates, Priority, Task, Track};
    use std::sync::Arc;

    fn plan(robot: &Robot, ends: &[Track]) -> Plan {
        let mut tracks = vec![
            Track::Orientation(robot.frame("waist").unwrap()),
            Track::CentreOfMass,
        ];
        tracks.extend(ends);
        let named = |(i, track): (usize, &Track)| Task {
            name: format!("task {i}"),
            track: *track,
        };
        let parts = ProblemParts {
            robot: Arc::new(robot.clone()),
            tasks: tracks.iter().enumerate().map(named).collect(),
            phases: vec![Phase {
                name: "whole".into(),
                support: None,
                tasks: (0..tracks.len()).map(|i| (i, Priority::Hard)).collect(),
            }],
            boundary: Boundary::None,
            objectives: vec![],
            kind: Kind::Tracking,
            supplies: Supplies {
                rates: true,
                preview_s: 0.0,
            },
            orientation: OrientationCoordinates::Log,
        };
        let problem = Problem::new(parts).unwrap();
        Plan::new(&problem, &problem.phases()[0]).unwrap()
    }

    /// The Jacobian of every end vanishes along the rates, and differences of the centre of mass are D.
    #[test]
    fn ends_rest_and_the_centre_of_mass_moves_with_the_rate() {
        let pose = |robot: &Robot, name: &str| Track::Pose(robot.frame(name).unwrap());
        let point = |robot: &Robot, name: &str| Track::Position(robot.frame(name).unwrap());
        let mut checked = 0;
        for (id, hands) in [
            ("hubo", "pose"),
            ("hrp2", "pose"),
            ("asimo", "none"),
            ("bioloid", "point"),
        ] {
            let robot = embedded(id).unwrap();
            let feet = if id == "bioloid" {
                ["r_foot", "l_foot"]
            } else {
                ["r_sole", "l_sole"]
            };
            let mut ends: Vec<Track> = feet.map(|name| pose(&robot, name)).to_vec();
            match hands {
                "pose" => ends.extend(["r_hand", "l_hand"].map(|name| pose(&robot, name))),
                "point" => ends.extend(["r_hand", "l_hand"].map(|name| point(&robot, name))),
                _ => {}
            }
            let plan = plan(&robot, &ends);
            assert_eq!(plan.limbs.len(), ends.len());
            let mut at = Candidate::new(&robot);
            for q in generic_postures(&robot) {
                at.q.copy_from_slice(&q);
                forward(&robot, &q, &mut at.page);
                let root = root_pose(&robot, &q);
                let rate = centre_of_mass_rate(&robot, &plan, &at);
                // Velocity for each direction of the root; the linear rates of the root are in world axes.
                let mut velocities = [0, 1, 2].map(|k| {
                    let mut v = vec![0.0; robot.nv()];
                    v[k] = 1.0;
                    v
                });
                for limb in &plan.limbs {
                    for (c, rate) in limb
                        .coordinates
                        .iter()
                        .zip(joint_rates(&robot, limb, &root, &at.page))
                    {
                        for (v, rate) in velocities.iter_mut().zip(rate.iter()) {
                            v[6 + c] = *rate;
                        }
                    }
                }
                for (k, v) in velocities.iter().enumerate() {
                    for (limb, track) in plan.limbs.iter().zip(ends_of(&plan, &ends, &robot)) {
                        let rows = if matches!(limb.target, Target::Pose(..)) {
                            6
                        } else {
                            3
                        };
                        let moved = frame_jacobian(&robot, &at.page, track, Axes::World)
                            * nalgebra::DVector::from_column_slice(v);
                        let worst = moved.rows(0, rows).amax();
                        assert!(worst < 1e-10, "{id}: an end moves by {worst:e}");
                    }
                    let fastest = v.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
                    let h = 1e-5 / fastest;
                    let centre = |sign: f64| {
                        let step: Vec<f64> = v.iter().map(|v| sign * h * v).collect();
                        let mut page = Page::new(&robot);
                        forward(&robot, &integrate(&robot, &q, &step), &mut page);
                        page.centre_of_mass()
                    };
                    let difference = (centre(1.0) - centre(-1.0)) / (2.0 * h);
                    let worst = (difference - rate.column(k)).amax();
                    assert!(worst < 1e-9 * fastest, "{id}: D is off by {worst:e}");
                    checked += 1;
                }
            }
        }
        assert_eq!(checked, 4 * 3 * 3);
    }

    /// Frames of the ends in the order of the limbs.
    fn ends_of(plan: &Plan, ends: &[Track], robot: &Robot) -> Vec<FrameId> {
        let frame = |track: &Track| match track {
            Track::Pose(frame) | Track::Position(frame) => *frame,
            _ => unreachable!("ends are poses and points"),
        };
        let of = |tip: usize| {
            let mut frames = ends.iter().map(frame);
            frames.find(|frame| robot.frames()[frame.0].body == tip).unwrap()
        };
        plan.limbs.iter().map(|limb| of(limb.tip)).collect()
    }
}
