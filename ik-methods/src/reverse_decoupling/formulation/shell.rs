//! The shell in which the base of a limb can be: where the axes at both ends of a limb meet in points, the distance of the
//! two points depends on the joint between them alone, the knee or elbow.
//!
//! `d² = one + c cos q + s sin q`, a law of cosines in the joint value of the robot. Both signs of the joint give the same
//! distance; which of them a limb takes is decided by its branches. The orientation-dependent reach of an arm is no matter
//! of the distance and not in here.

use crate::reverse_decoupling::analyser::{DenavitHartenberg, End, limb_axes, meeting};
use ik_core::robot::Robot;
use nalgebra::Point3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Axes with a miss up to this (m) meet.
const MEETS_M: f64 = 1e-6;

/// Two points of a limb and the joint that sets their distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shell {
    /// Where the first axes meet, in the base body (m).
    pub(super) base_point: Point3<f64>,
    /// Where the last axes meet, in the tip body (m).
    pub(super) tip_point: Point3<f64>,
    /// Index in the limb of the joint between them.
    pub(super) hinge: usize,
    one: f64,
    cosine: f64,
    sine: f64,
}

impl Shell {
    /// The shell of a limb of six joints with the given rows, whose triple is at `triple`; none if the two axes at its
    /// other end miss.
    pub(super) fn of(
        robot: &Robot,
        joints: &[usize],
        table: &DenavitHartenberg,
        triple: End,
    ) -> Option<Self> {
        let (lines, tip) = limb_axes(robot, joints);
        let (first, second, hinge) = match triple {
            End::Base => (0..3, 4..6, 3),
            End::Tip => (0..2, 3..6, 2),
        };
        let (base, end) = (meeting(&lines[first]), meeting(&lines[second]));
        let meets = base.miss_m.max(end.miss_m) <= MEETS_M;
        let tip_point = tip.inverse_transform_point(&Point3::from(end.point));
        meets.then(|| Self::between(table, base.point.into(), tip_point, hinge))
    }

    /// The shell of three joints that place `point` (m, in the last body), `table` being theirs with a virtual wrist.
    pub(super) fn of_point(
        robot: &Robot,
        joints: &[usize],
        table: &DenavitHartenberg,
        point: &Point3<f64>,
    ) -> Option<Self> {
        let (lines, _) = limb_axes(robot, joints);
        let base = meeting(&lines[..2]);
        // The rows end in the virtual wrist, whose origin is the point.
        let wrist = Self::between(table, base.point.into(), Point3::origin(), 2);
        (base.miss_m <= MEETS_M).then_some(Self {
            tip_point: *point,
            ..wrist
        })
    }

    fn between(
        table: &DenavitHartenberg,
        base_point: Point3<f64>,
        tip_point: Point3<f64>,
        hinge: usize,
    ) -> Self {
        let square = |q: f64| {
            let mut joints = vec![0.0; table.rows.len()];
            joints[hinge] = q;
            (table.tip_pose(&joints) * tip_point - base_point).norm_squared()
        };
        let (zero, quarter, half) = (square(0.0), square(FRAC_PI_2), square(PI));
        let one = 0.5 * (zero + half);
        Self {
            base_point,
            tip_point,
            hinge,
            one,
            cosine: 0.5 * (zero - half),
            sine: quarter - one,
        }
    }

    /// Least and largest distance (m) while the joint is between `lo` and `hi` (rad).
    pub(super) fn distances(&self, lo: f64, hi: f64) -> (f64, f64) {
        let root = |square: f64| square.max(0.0).sqrt();
        let swing = self.cosine.hypot(self.sine);
        let (least, largest) = (self.one - swing, self.one + swing);
        if hi - lo >= 2.0 * PI {
            return (root(least), root(largest));
        }
        let at = |q: f64| self.one + self.cosine * q.cos() + self.sine * q.sin();
        let peak = self.sine.atan2(self.cosine);
        // Whether the joint passes `angle`, modulo turns.
        let passes = |angle: f64| lo + (angle - lo).rem_euclid(2.0 * PI) <= hi;
        let (a, b) = (at(lo), at(hi));
        (
            root(if passes(peak + PI) { least } else { a.min(b) }),
            root(if passes(peak) { largest } else { a.max(b) }),
        )
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]

    use super::*;
    use crate::generic_posture::generic_postures;
    use crate::reverse_decoupling::analyser::{Verdict, denavit_hartenberg, limbs, with_virtual_wrist};
    use ik_core::kinematics::{Page, forward};
    use ik_core::robot::{FrameId, embedded};
    use nalgebra::Isometry3;

    /// Pose of a body in the world.
    fn body(robot: &Robot, page: &Page, body: usize) -> Isometry3<f64> {
        let id = robot
            .frames()
            .iter()
            .position(|frame| frame.body == body)
            .unwrap();
        page.frame_pose(robot, FrameId(id)) * robot.frames()[id].x_body_frame.inverse()
    }

    #[test]
    fn the_hinge_alone_sets_the_distance_and_its_interval_the_shell() {
        let mut checked = 0;
        for id in ["hubo", "hrp2", "asimo", "bioloid", "coman-legs", "arm6"] {
            let robot = embedded(id).unwrap();
            for limb in limbs(&robot) {
                let shell = match (&limb.verdict, limb.joints.len()) {
                    (Verdict::ClosedForm(family), 6) => {
                        let table = denavit_hartenberg(&robot, &limb).unwrap();
                        Shell::of(&robot, &limb.joints, &table, family.triple())
                    }
                    (_, 3) => {
                        let point = Point3::new(0.01, 0.02, 0.1);
                        let table = with_virtual_wrist(&robot, &limb, &point).unwrap();
                        Shell::of_point(&robot, &limb.joints, &table, &point)
                    }
                    _ => None,
                };
                let Some(shell) = shell else {
                    continue;
                };
                let coordinate = |k: usize| robot.root().nq() + robot.joints()[limb.joints[k]].coordinate;
                let mut page = Page::new(&robot);
                for mut q in generic_postures(&robot) {
                    let hinge = coordinate(shell.hinge);
                    let (lo, hi) = (q[hinge] - 0.7, q[hinge] + 1.9);
                    let (mut least, mut largest) = (f64::INFINITY, 0.0_f64);
                    const SAMPLES: i32 = 2600;
                    for i in 0..=SAMPLES {
                        q[hinge] = lo + (hi - lo) * f64::from(i) / f64::from(SAMPLES);
                        forward(&robot, &q, &mut page);
                        let base = body(&robot, &page, limb.base) * shell.base_point;
                        let tip = body(&robot, &page, limb.tip) * shell.tip_point;
                        let distance = (tip - base).norm();
                        let (a, b) = shell.distances(q[hinge], q[hinge]);
                        assert!((a - distance).abs() < 1e-9 && (b - distance).abs() < 1e-9, "{id}");
                        (least, largest) = (least.min(distance), largest.max(distance));
                    }
                    // Extremes between samples are off by the square of half a step.
                    let (a, b) = shell.distances(lo, hi);
                    assert!(
                        a <= least + 1e-12 && least - a < 1e-6,
                        "{id}: {a}, sampled {least}"
                    );
                    assert!(
                        b >= largest - 1e-12 && b - largest < 1e-6,
                        "{id}: {b}, sampled {largest}"
                    );
                    checked += 1;
                }
            }
        }
        assert!(checked >= 3 * 12, "{checked}");
    }
}
