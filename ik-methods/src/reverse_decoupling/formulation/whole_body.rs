//! A configuration of the whole robot, limb by limb, for a position of the waist, and how good it is.

use super::plan::{LimbPlan, Plan, Target, Waist};
use super::region::Region;
use crate::reverse_decoupling::{Unsolved, wrap};
use ik_core::configuration::root_pose;
use ik_core::evaluator::Evaluator;
use ik_core::formulation::Termination;
use ik_core::kinematics::Page;
use ik_core::robot::{Robot, Root};
use ik_core::step::{Bounds, ControlStep};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// Joints this far (rad) outside their interval are within rounding of it and clamped.
pub(super) const OUTSIDE_RAD: f64 = 1e-9;
/// q⁻ within this (m, rad) of all targets is the answer: beyond rounding, a closed form at a double root is not better.
const THERE: f64 = 1e-13;

/// A configuration with the root at `origin`.
#[derive(Debug)]
pub(super) struct Candidate {
    pub(super) origin: Vector3<f64>,
    pub(super) q: Vec<f64>,
    pub(super) page: Page,
    pub(super) merit: Merit,
}

/// What joints do that a singularity leaves free.
#[derive(Clone, Copy, Debug)]
pub(super) enum Free {
    /// They rest.
    Rests,
    /// They rest, unless another joint of the limb would leave its interval.
    GivesWay,
}

/// How good a candidate is.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Merit {
    /// What hard limbs miss (m): if any, there is no configuration.
    pub(super) missing_m: f64,
    /// What compromised limbs miss (m): they rest.
    pub(super) left_m: f64,
    /// Greatest excess over an interval (rad), and the joint coordinate.
    pub(super) outside: (f64, usize),
    /// From the target of the centre of mass (m).
    pub(super) away: Vector3<f64>,
}

impl Merit {
    /// Whether hard limbs reach and all joints are inside.
    pub(super) fn stands(&self) -> bool {
        self.missing_m == 0.0 && self.outside.0 <= OUTSIDE_RAD
    }

    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        self.rank() < other.rank()
    }

    /// What is missing first, then what is outside, then the centre of mass.
    fn rank(&self) -> (f64, f64, f64) {
        let outside = self.outside.0.max(OUTSIDE_RAD);
        (self.missing_m, outside, self.away.norm_squared())
    }
}

impl Candidate {
    pub(super) fn new(robot: &Robot) -> Self {
        Self {
            origin: Vector3::zeros(),
            q: robot.neutral(),
            page: Page::new(robot),
            merit: Merit::default(),
        }
    }
}

/// Room for one step; sized once.
#[derive(Debug)]
pub(super) struct Work {
    /// Pose of the last body of each limb in the world.
    pub(super) targets: Vec<Isometry3<f64>>,
    pub(super) region: Region,
    pub(super) trial: Candidate,
    pub(super) best: Candidate,
}

impl Work {
    pub(super) fn new(robot: &Robot, limbs: usize) -> Self {
        Self {
            targets: vec![Isometry3::identity(); limbs],
            region: Region::new(limbs),
            trial: Candidate::new(robot),
            best: Candidate::new(robot),
        }
    }
}

/// What stays the same while one step is solved.
pub(super) struct Step<'a> {
    pub(super) robot: &'a Robot,
    pub(super) plan: &'a Plan,
    pub(super) step: &'a ControlStep<'a>,
    pub(super) x: &'a [f64],
    pub(super) rotation: UnitQuaternion<f64>,
}

impl<'a> Step<'a> {
    pub(super) fn new(robot: &'a Robot, plan: &'a Plan, step: &'a ControlStep<'a>) -> Self {
        let x = step.targets.now().x;
        let rotation = match plan.waist {
            Waist::Fixed => UnitQuaternion::identity(),
            Waist::Prescribed(attitude, _) | Waist::Balanced(attitude, _) => attitude.of_body(x),
        };
        Self {
            robot,
            plan,
            step,
            x,
            rotation,
        }
    }

    /// The best configuration, as `work.best`, and how it ends.
    pub(super) fn solve(&self, work: &mut Work, eval: &mut Evaluator) -> Termination {
        for (target, limb) in work.targets.iter_mut().zip(&self.plan.limbs) {
            *target = limb.target.pose(self.x);
        }
        eval.pass(self.step.q_prev, &mut work.best.page);
        let centre = match self.plan.waist {
            Waist::Balanced(_, slot) => Some(Vector3::new(self.x[slot], self.x[slot + 1], self.x[slot + 2])),
            Waist::Fixed | Waist::Prescribed(..) => None,
        };
        if self.is_there(&work.best.page, &work.targets, centre) {
            work.best.q.copy_from_slice(self.step.q_prev);
            work.best.merit = Merit::default();
            return Termination::Converged;
        }
        let Some(centre) = centre else {
            let origin = match self.plan.waist {
                Waist::Prescribed(_, place) => place.point(self.x) - self.rotation * place.in_body.coords,
                Waist::Fixed | Waist::Balanced(..) => Vector3::zeros(),
            };
            self.limbs(origin, &work.targets, Free::GivesWay, &mut work.best);
            return conclude(&work.best.merit);
        };
        self.balance(&centre, work, eval)
    }

    /// Whether q⁻ meets all targets and may stay.
    fn is_there(&self, page: &Page, targets: &[Isometry3<f64>], centre: Option<Vector3<f64>>) -> bool {
        let Bounds { lo, hi, .. } = self.step.bounds;
        let may_stay = lo.iter().zip(hi).all(|(lo, hi)| *lo <= 0.0 && *hi >= 0.0);
        let near = |a: &Isometry3<f64>, b: &Isometry3<f64>| {
            (a.translation.vector - b.translation.vector).amax() <= THERE
                && a.rotation.angle_to(&b.rotation) <= THERE
        };
        let root = root_pose(self.robot, self.step.q_prev);
        let root_is_there = match self.plan.waist {
            Waist::Fixed => true,
            Waist::Prescribed(_, place) => {
                let origin = place.point(self.x) - self.rotation * place.in_body.coords;
                near(&root, &Isometry3::from_parts(origin.into(), self.rotation))
            }
            Waist::Balanced(..) => root.rotation.angle_to(&self.rotation) <= THERE,
        };
        let limb_is_there = |(plan, target): (&LimbPlan, &Isometry3<f64>)| {
            let body = plan.tip_pose(self.robot, page);
            match plan.target {
                Target::Pose(..) => near(&body, target),
                Target::Point(place) => {
                    ((body * place.in_body).coords - target.translation.vector).amax() <= THERE
                }
            }
        };
        may_stay
            && root_is_there
            && centre.is_none_or(|centre| (centre - page.centre_of_mass()).amax() <= THERE)
            && self.plan.limbs.iter().zip(targets).all(limb_is_there)
    }

    /// Solves all limbs with the root at `origin`.
    pub(super) fn limbs(
        &self,
        origin: Vector3<f64>,
        targets: &[Isometry3<f64>],
        free: Free,
        out: &mut Candidate,
    ) {
        out.origin = origin;
        out.merit = Merit::default();
        out.q.copy_from_slice(self.step.q_prev);
        if self.robot.root() == Root::Floating {
            out.q[..3].copy_from_slice(origin.as_slice());
            let quaternion = self.rotation.coords;
            let before = &self.step.q_prev[3..7];
            let same_side = quaternion.iter().zip(before).map(|(a, b)| a * b).sum::<f64>() >= 0.0;
            for (to, c) in out.q[3..7].iter_mut().zip(quaternion.iter()) {
                *to = if same_side { *c } else { -c };
            }
        }
        // Joints that rest still move into their intervals, and the centre of mass with them.
        let (root_nq, root_nv) = (self.robot.root().nq(), self.robot.root().nv());
        let Bounds { lo, hi, .. } = self.step.bounds;
        for (i, q) in out.q[root_nq..].iter_mut().enumerate() {
            *q += 0.0_f64.clamp(lo[root_nv + i], hi[root_nv + i]);
        }
        let root = Isometry3::from_parts(Translation3::from(origin), self.rotation);
        for (plan, target) in self.plan.limbs.iter().zip(targets) {
            self.limb(plan, &root.inv_mul(target), free, out);
        }
    }

    /// Solves one limb for the pose of its last body in the root.
    fn limb(&self, plan: &LimbPlan, pose: &Isometry3<f64>, free: Free, out: &mut Candidate) {
        let root = self.robot.root();
        let joints = plan.coordinates.len();
        let mut before = [0.0; MOST_JOINTS];
        for (to, c) in before.iter_mut().zip(&plan.coordinates) {
            *to = self.step.q_prev[root.nq() + c];
        }
        let before = &before[..joints];
        let mut nearest = Nearest::default();
        let solved = self.solutions(plan, pose, before, before, &mut nearest);
        if solved.is_ok() && nearest.outside.0 > OUTSIDE_RAD && matches!(free, Free::GivesWay) {
            self.give_way(plan, pose, before, &mut nearest);
        }
        match solved {
            Ok(_) => {
                for ((c, before), motion) in plan.coordinates.iter().zip(before).zip(nearest.motion) {
                    out.q[root.nq() + c] = before + motion;
                }
                if nearest.outside.0 > out.merit.outside.0 {
                    out.merit.outside = nearest.outside;
                }
            }
            Err(unsolved) if plan.is_hard => {
                out.merit.missing_m = out.merit.missing_m.max(missing(&unsolved));
            }
            Err(unsolved) => out.merit.left_m = out.merit.left_m.max(missing(&unsolved)),
        }
    }

    /// Solutions in which one joint that a singularity leaves free has moved by as much as another one is outside. Any joint that
    /// rests may be such a one.
    fn give_way(&self, plan: &LimbPlan, pose: &Isometry3<f64>, before: &[f64], nearest: &mut Nearest) {
        let Nearest {
            motion,
            outside: (excess, _),
            ..
        } = *nearest;
        for free in (0..before.len()).filter(|&k| motion[k] == 0.0) {
            for sign in [1.0, -1.0] {
                let mut moved = [0.0; MOST_JOINTS];
                moved[..before.len()].copy_from_slice(before);
                moved[free] += sign * excess;
                let held = &moved[..before.len()];
                if self.solutions(plan, pose, before, held, nearest).is_err() {
                    return;
                }
            }
        }
    }

    /// Compares all solutions, free joints held at `held`, with the nearest to `before` so far.
    fn solutions(
        &self,
        plan: &LimbPlan,
        pose: &Isometry3<f64>,
        before: &[f64],
        held: &[f64],
        nearest: &mut Nearest,
    ) -> Result<usize, Unsolved> {
        let first = self.robot.root().nv();
        let Bounds { lo, hi, .. } = self.step.bounds;
        plan.limb.for_each_solution(pose, held, |solution, _| {
            let mut found = Nearest {
                most: 0.0,
                ..Nearest::default()
            };
            found.outside.0 = 0.0;
            for (k, c) in plan.coordinates.iter().enumerate() {
                let direct = wrap(solution[k] - before[k]);
                let (motion, excess) = turned_inside(direct, lo[first + c], hi[first + c]);
                found.motion[k] = motion;
                found.most = found.most.max(motion.abs());
                if excess > found.outside.0 {
                    found.outside = (excess, *c);
                }
            }
            if found.rank() < nearest.rank() {
                *nearest = found;
            }
        })
    }
}

/// Most joints of a limb.
const MOST_JOINTS: usize = 6;

/// The solution of a limb that is least outside its intervals, of those inside the one whose largest motion is least.
#[derive(Clone, Copy, Debug)]
struct Nearest {
    /// Motion of each joint from q⁻ (rad).
    motion: [f64; MOST_JOINTS],
    /// The largest (rad).
    most: f64,
    /// Greatest excess over an interval (rad), and the joint coordinate.
    outside: (f64, usize),
}

impl Default for Nearest {
    fn default() -> Self {
        Self {
            motion: [0.0; MOST_JOINTS],
            most: f64::INFINITY,
            outside: (f64::INFINITY, 0),
        }
    }
}

impl Nearest {
    fn rank(&self) -> (f64, f64) {
        (self.outside.0.max(OUTSIDE_RAD), self.most)
    }
}

/// How the step of a candidate ends whose centre of mass, if it has one, is met.
pub(super) fn conclude(merit: &Merit) -> Termination {
    let missing_m = merit.missing_m.max(merit.left_m);
    if merit.missing_m > 0.0 || (merit.stands() && merit.left_m > 0.0) {
        Termination::OutOfReach { missing_m }
    } else if !merit.stands() {
        Termination::OutsideLimits {
            joint: merit.outside.1,
            excess: merit.outside.0,
        }
    } else {
        Termination::Converged
    }
}

/// What is missing of a pose (m): never zero.
fn missing(unsolved: &Unsolved) -> f64 {
    let missing = match unsolved {
        Unsolved::Distance {
            distance_m,
            least_m,
            largest_m,
        } => (distance_m - largest_m).max(least_m - distance_m),
        Unsolved::Orientation { found_m, largest_m } => found_m - largest_m,
        Unsolved::General { excess_m } => excess_m.unwrap_or(f64::INFINITY),
        Unsolved::OffSet { position_m, .. } => *position_m,
        Unsolved::NotRigid { defect } => *defect,
    };
    missing.max(f64::MIN_POSITIVE)
}

/// The motion among those that differ by whole turns that is least outside an interval, and by how much.
fn turned_inside(motion: f64, lo: f64, hi: f64) -> (f64, f64) {
    let excess = |motion: f64| (lo - motion).max(motion - hi).max(0.0);
    let mut best = (motion, excess(motion));
    if best.1 > 0.0 {
        for other in [motion - TAU, motion + TAU] {
            if excess(other) < best.1 {
                best = (other, excess(other));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_takes_the_turn_that_is_inside() {
        // A joint at 3.1 rad that may go on to 7: the direction of −3 is half a turn less or more away.
        assert_eq!(turned_inside(0.2, -1.0, 1.0), (0.2, 0.0));
        let (motion, excess) = turned_inside(-3.0, 0.0, 4.0);
        assert!((motion - (TAU - 3.0)).abs() < 1e-15 && excess == 0.0);
        let (motion, excess) = turned_inside(3.0, -4.0, -1.0);
        assert!((motion - (3.0 - TAU)).abs() < 1e-15 && excess == 0.0);
        let (motion, excess) = turned_inside(0.5, -0.1, 0.1);
        assert!((motion - 0.5).abs() < 1e-15 && (excess - 0.4).abs() < 1e-15);
    }
}
