//! Screws against the ordinary kinematics on every embedded robot, and against closed forms and other algorithms: the
//! conjugated 4 × 4 twist matrix, the matrix exponential, finite differences, invariance of power.

#![allow(clippy::unwrap_used, missing_docs, reason = "tests")]

#[allow(dead_code, reason = "shared by several tests, each of which uses a part")]
mod common;

use common::{Random, robots};
use ik_core::kinematics::jacobian::{Axes, frame_jacobian};
use ik_core::kinematics::screws::{for_each_screw, root_screws};
use ik_core::kinematics::successive::ZeroPose;
use ik_core::kinematics::{Page, forward};
use ik_core::robot::{FrameId, Motion, Robot, Root};
use ik_core::spatial::screw::{Screw, displacement, helical_displacement, transform_matrix};
use ik_core::spatial::so3;
use nalgebra::{Isometry3, Matrix3, Matrix4, Matrix6xX, Translation3, Vector3, Vector6};

const TOLERANCE: f64 = 1e-12;
const SAMPLES: usize = 50;

fn vector(random: &mut Random, scale: f64) -> Vector3<f64> {
    Vector3::from_iterator(random.vector(3, scale))
}

fn unit(random: &mut Random) -> Vector3<f64> {
    let v = vector(random, 1.0);
    if v.norm() > 0.1 {
        v.normalize()
    } else {
        unit(random)
    }
}

fn pose(random: &mut Random) -> Isometry3<f64> {
    let turn = so3::exp_quaternion(&vector(random, 1.7));
    Isometry3::from_parts(Translation3::from(vector(random, 2.0)), turn)
}

fn screw(random: &mut Random) -> Screw {
    Screw {
        angular: vector(random, 1.0),
        linear: vector(random, 1.0),
    }
}

/// Calls `check` for every robot at neutral and at random configurations, with a page filled there.
fn sweep(seed: u64, mut check: impl FnMut(&Robot, &[f64], &Page, &mut Random)) {
    let mut random = Random(seed);
    for robot in robots() {
        let mut page = Page::new(&robot);
        let mut configurations = vec![robot.neutral()];
        configurations.extend((0..6).map(|_| random.configuration(&robot, 1.5)));
        for q in configurations {
            forward(&robot, &q, &mut page);
            check(&robot, &q, &page, &mut random);
        }
    }
}

fn frames(robot: &Robot) -> impl Iterator<Item = FrameId> {
    (0..robot.frames().len()).map(FrameId)
}

/// A frame Jacobian has the linear rows first, a screw the angular part.
fn assert_same_columns(screws: &Matrix6xX<f64>, jacobian: &Matrix6xX<f64>, label: &str) {
    let angular = (screws.rows(0, 3) - jacobian.rows(3, 3)).amax();
    let linear = (screws.rows(3, 3) - jacobian.rows(0, 3)).amax();
    assert!(
        angular < TOLERANCE && linear < TOLERANCE,
        "{label}: {angular:e} {linear:e}"
    );
}

#[test]
fn successive_displacements_give_the_poses_of_the_tree_pass() {
    sweep(1, |robot, q, page, _| {
        let zero = ZeroPose::of(robot);
        let displacements = zero.displacements(q);
        for frame in frames(robot) {
            let found = zero.frame_pose(&displacements, frame);
            let turn = found.rotation.to_rotation_matrix().into_inner();
            let label = format!("{} {}", robot.name(), robot.frame_name(frame));
            assert!(
                (turn - page.frame_rotation(robot, frame)).amax() < TOLERANCE,
                "{label}"
            );
            let off = found.translation.vector - page.frame_position(robot, frame);
            assert!(off.amax() < TOLERANCE, "{label}: {:e}", off.amax());
        }
    });
}

/// Columns of the root, with angular part and linear part at `point`, from the definition of the velocity coordinates.
fn root_columns_by_hand(robot: &Robot, q: &[f64], point: &Vector3<f64>, out: &mut Matrix6xX<f64>) {
    if robot.root() == Root::Floating {
        let root = Vector3::new(q[0], q[1], q[2]);
        let axes = Matrix3::identity();
        for k in 0..3 {
            let axis: Vector3<f64> = axes.column(k).into();
            out.column_mut(k).fixed_rows_mut::<3>(3).copy_from(&axis);
            out.column_mut(3 + k)
                .copy_from(&Screw::revolute(&axis, &root).at(point).to_vector());
        }
    }
}

#[test]
fn jacobians_from_displaced_axes_are_those_of_the_tree_pass() {
    sweep(2, |robot, q, page, _| {
        let zero = ZeroPose::of(robot);
        let displacements = zero.displacements(q);
        for frame in frames(robot) {
            let point = zero.frame_pose(&displacements, frame).translation.vector;
            let mut columns = Matrix6xX::zeros(robot.nv());
            root_columns_by_hand(robot, q, &point, &mut columns);
            for &i in robot.path(robot.frames()[frame.0].body) {
                let joint = &robot.joints()[i];
                let screw = zero.screw(&displacements, i).at(&point).scaled(joint.multiplier);
                let mut column = columns.column_mut(robot.root().nv() + joint.coordinate);
                column += screw.to_vector();
            }
            let jacobian = frame_jacobian(robot, page, frame, Axes::World);
            assert_same_columns(&columns, &jacobian, robot.name());
        }
    });
}

/// Screws of the page written at `written_at`, then moved to `point`.
fn columns_of_page(
    robot: &Robot,
    page: &Page,
    body: usize,
    written_at: &Vector3<f64>,
    point: &Vector3<f64>,
) -> Matrix6xX<f64> {
    let mut columns = Matrix6xX::zeros(robot.nv());
    let shift = point - written_at;
    if robot.root() == Root::Floating {
        for (v, screw) in root_screws(robot, page, written_at).iter().enumerate() {
            columns.set_column(v, &screw.at(&shift).to_vector());
        }
    } else {
        assert_eq!(root_screws(robot, page, written_at), [Screw::default(); 6]);
    }
    for_each_screw(robot, page, body, written_at, |v, screw| {
        let mut column = columns.column_mut(v);
        column += screw.at(&shift).to_vector();
    });
    columns
}

#[test]
fn screws_of_a_page_are_its_jacobian_wherever_they_are_written() {
    sweep(3, |robot, _, page, random| {
        for frame in frames(robot) {
            let body = robot.frames()[frame.0].body;
            let point = page.frame_position(robot, frame);
            let jacobian = frame_jacobian(robot, page, frame, Axes::World);
            for written_at in [point, Vector3::zeros(), vector(random, 2.0)] {
                let columns = columns_of_page(robot, page, body, &written_at, &point);
                assert_same_columns(&columns, &jacobian, robot.name());
            }
        }
    });
}

#[test]
fn joints_are_visited_from_the_root_outwards_and_only_on_the_path() {
    sweep(4, |robot, _, page, _| {
        for body in 0..robot.bodies().len() {
            let mut visited = Vec::new();
            for_each_screw(robot, page, body, &Vector3::zeros(), |v, _| visited.push(v));
            let joint = |i: &usize| robot.root().nv() + robot.joints()[*i].coordinate;
            let path: Vec<usize> = robot.path(body).iter().map(joint).collect();
            assert_eq!(visited, path);
        }
    });
}

#[test]
fn screws_of_simple_joints_are_those_found_by_hand() {
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    // About z through (1, 0, 0): the point at the origin moves along −y; with a pitch it also climbs.
    assert_eq!(
        Screw::revolute(&z, &x).to_vector(),
        Vector6::new(0.0, 0.0, 1.0, 0.0, -1.0, 0.0)
    );
    let climbing = Screw::helical(&z, &x, 0.25);
    assert_eq!(climbing.to_vector(), Vector6::new(0.0, 0.0, 1.0, 0.0, -1.0, 0.25));
    assert_eq!(
        Screw::prismatic(&y).to_vector(),
        Vector6::new(0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    );
    // On its axis a point only climbs, and (3, 0, 5) is two metres from the axis.
    assert_eq!(climbing.at(&x).linear, z * 0.25);
    assert_eq!(
        climbing.at(&Vector3::new(3.0, 0.0, 5.0)).linear,
        y * 2.0 + z * 0.25
    );
}

/// The 4 × 4 matrix `[[w]ₓ, v; 0, 0]` of a twist.
fn twist_matrix(twist: &Screw) -> Matrix4<f64> {
    let mut m = Matrix4::zeros();
    m.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&so3::skew(&twist.angular));
    m.fixed_view_mut::<3, 1>(0, 3).copy_from(&twist.linear);
    m
}

#[test]
fn change_of_frame_is_conjugation_of_the_twist_matrix() {
    let mut random = Random(5);
    for _ in 0..SAMPLES {
        let (x_i_j, twist) = (pose(&mut random), screw(&mut random));
        let moved = twist.transformed(&x_i_j);
        let matrix = x_i_j.to_homogeneous();
        let conjugated = matrix * twist_matrix(&twist) * x_i_j.inverse().to_homogeneous();
        assert!((twist_matrix(&moved) - conjugated).amax() < TOLERANCE);
        assert!((transform_matrix(&x_i_j) * twist.to_vector() - moved.to_vector()).amax() < TOLERANCE);
        // Frames compose, and without a turn only the reference point moves: j's origin is at p, i's at −p from it.
        let x_j_k = pose(&mut random);
        let composed = transform_matrix(&x_i_j) * transform_matrix(&x_j_k);
        assert!((transform_matrix(&(x_i_j * x_j_k)) - composed).amax() < TOLERANCE);
        let shift = Isometry3::from(x_i_j.translation.vector);
        let at = twist.at(&-x_i_j.translation.vector);
        assert!((twist.transformed(&shift).to_vector() - at.to_vector()).amax() < TOLERANCE);
    }
}

#[test]
fn a_joint_carried_into_another_frame_is_the_transformed_screw() {
    let mut random = Random(6);
    for _ in 0..SAMPLES {
        let (x_i_j, axis, point) = (pose(&mut random), unit(&mut random), vector(&mut random, 1.0));
        let (axis_i, point_i) = (
            x_i_j.rotation * axis,
            (x_i_j * nalgebra::Point3::from(point)).coords,
        );
        for (moved, made) in [
            (Screw::revolute(&axis, &point), Screw::revolute(&axis_i, &point_i)),
            (
                Screw::helical(&axis, &point, 0.3),
                Screw::helical(&axis_i, &point_i, 0.3),
            ),
            (Screw::prismatic(&axis), Screw::prismatic(&axis_i)),
        ] {
            assert!((moved.transformed(&x_i_j).to_vector() - made.to_vector()).amax() < TOLERANCE);
        }
    }
}

/// Twist times wrench is power, in whatever frame both are written.
#[test]
fn power_does_not_depend_on_the_frame() {
    let mut random = Random(7);
    for _ in 0..SAMPLES {
        let (x_i_j, twist) = (pose(&mut random), screw(&mut random));
        let (moment, force) = (vector(&mut random, 1.0), vector(&mut random, 1.0));
        let power = moment.dot(&twist.angular) + force.dot(&twist.linear);
        let force_i = x_i_j.rotation * force;
        let moment_i = x_i_j.rotation * moment + x_i_j.translation.vector.cross(&force_i);
        let moved = twist.transformed(&x_i_j);
        let power_i = moment_i.dot(&moved.angular) + force_i.dot(&moved.linear);
        assert!((power - power_i).abs() < TOLERANCE, "{power} {power_i}");
    }
}

#[test]
fn displacements_are_exponentials_of_their_screws() {
    let mut random = Random(8);
    for _ in 0..SAMPLES {
        let (axis, point) = (unit(&mut random), vector(&mut random, 1.0));
        let (value, pitch) = (random.between(-3.0, 3.0), random.between(-0.5, 0.5));
        for (found, screw) in [
            (
                displacement(Motion::Revolute, &axis, &point, value),
                Screw::revolute(&axis, &point),
            ),
            (
                displacement(Motion::Prismatic, &axis, &point, value),
                Screw::prismatic(&axis),
            ),
            (
                helical_displacement(&axis, &point, pitch, value),
                Screw::helical(&axis, &point, pitch),
            ),
        ] {
            let exponential = twist_matrix(&screw.scaled(value)).exp();
            let off = (found.to_homogeneous() - exponential).amax();
            assert!(off < TOLERANCE, "{off:e}");
        }
    }
}

/// Displacement at rate one: the velocity matrix `dA/dq A⁻¹` is the twist matrix of the screw, the pitch included.
#[test]
fn a_helical_screw_is_the_rate_of_its_displacement() {
    const H: f64 = 1e-5;
    let mut random = Random(9);
    for _ in 0..SAMPLES {
        let (axis, point) = (unit(&mut random), vector(&mut random, 1.0));
        let (angle, pitch) = (random.between(-3.0, 3.0), random.between(-0.5, 0.5));
        let at = |angle: f64| helical_displacement(&axis, &point, pitch, angle);
        let rate = (at(angle + H).to_homogeneous() - at(angle - H).to_homogeneous()) / (2.0 * H);
        let numeric = rate * at(angle).inverse().to_homogeneous();
        let off = (numeric - twist_matrix(&Screw::helical(&axis, &point, pitch))).amax();
        assert!(off < 1e-9, "{off:e}");
    }
}
