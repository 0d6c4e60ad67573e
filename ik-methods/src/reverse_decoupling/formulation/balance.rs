//! The outer iteration on the position of the waist for a centre of mass.

use super::plan::Target;
use super::rates::{centre_of_mass_rate, is_regular, joint_rates};
use super::region::{Halfspace, Reach, Region, Ring};
use super::whole_body::{Candidate, Free, OUTSIDE_RAD, Step, Work, conclude};
use ik_core::configuration::root_pose;
use ik_core::evaluator::Evaluator;
use ik_core::formulation::Termination;
use nalgebra::{Matrix3, Vector3};

/// A centre of mass this near (m) is met.
const MET_M: f64 = 1e-11;
/// The waist rests where a step is predicted to bring the centre of mass nearer by a smaller part than this.
const LEAST_GAIN: f64 = 1e-6;
/// Step lengths along a direction.
const LENGTHS: [f64; 2] = [1.0, 0.25];
/// The waist first takes Newton's step from q⁻; where it fails, these parts of the way the centre of mass has to go.
const FIRST_LENGTHS: [Option<f64>; 5] = [None, Some(1.0), Some(0.5), Some(0.25), Some(0.0)];
/// Most rounds of cuts per step of the waist.
const MOST_CUTS: usize = 2;

/// How the waist moves where Newton's step leads out of the region.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// With the centre of mass, to the nearest point of the region.
    Along,
    /// To the point of the linearised region with the best predicted centre of mass.
    Best,
}

/// The centre of mass as a linear function of the root's position, about a candidate.
struct Linear {
    origin: Vector3<f64>,
    /// From the target of the centre of mass (m).
    away: Vector3<f64>,
    /// D, and its inverse if it is well conditioned.
    rate: Matrix3<f64>,
    inverse: Option<Matrix3<f64>>,
}

impl Linear {
    /// Where the root may go next, and the centre of mass that is predicted to be left there (m).
    ///
    /// Heuristic: next to a straight leg D is dominated by how fast its knee bends, and Newton steps that lead out of the
    /// region throw the waist about (measured, they lose coman/asymmetric). There the waist first tries to go with the centre
    /// of mass to the nearest point of the region.
    fn next(&self, way: Way, region: &Region) -> (Vector3<f64>, Vector3<f64>) {
        let (origin, away) = (self.origin, self.away);
        let along = || {
            let target = region.nearest(&(origin + away));
            (target, away - (target - origin))
        };
        let Some(inverse) = &self.inverse else {
            return along();
        };
        let newton = origin + inverse * away;
        match way {
            _ if region.contains(&newton) => (newton, Vector3::zeros()),
            Way::Along => along(),
            Way::Best => {
                let best = origin + region.best_motion(&away, &origin, inverse);
                let target = region.nearest(&best);
                (target, away - self.rate * (target - origin))
            }
        }
    }
}

impl Step<'_> {
    /// Newton's method on the position of the root, kept where the limbs reach.
    pub(super) fn balance(
        &self,
        centre: &Vector3<f64>,
        work: &mut Work,
        eval: &mut Evaluator,
    ) -> Termination {
        self.fill_region(work);
        // A first guess from which all limbs reach: a Newton step from q⁻, or part of it.
        let before = Vector3::from_column_slice(&self.step.q_prev[..3]);
        let start = &mut work.best;
        start.origin = before;
        start.q.copy_from_slice(self.step.q_prev);
        start.merit.away = centre - start.page.centre_of_mass();
        let ahead = work.best.merit.away;
        let (newton, _) = self.linear(&work.best).next(Way::Along, &work.region);
        for length in FIRST_LENGTHS {
            let guess = length.map_or(newton, |part| work.region.nearest(&(before + ahead * part)));
            self.evaluate(guess, centre, Free::Rests, work, eval);
            if length.is_none() || work.trial.merit.is_better_than(&work.best.merit) {
                std::mem::swap(&mut work.trial, &mut work.best);
            }
            if work.best.merit.stands() {
                break;
            }
        }
        loop {
            let merit = work.best.merit;
            if merit.missing_m > 0.0 || (merit.stands() && merit.away.norm() < MET_M) {
                return conclude(&merit);
            }
            let left = match conclude(&merit) {
                Termination::Converged => None,
                otherwise => Some(otherwise),
            };
            if !eval.meter.next_major() {
                return left.unwrap_or(Termination::Budget);
            }
            if !self.improve(centre, work, eval) {
                if left.is_some() && self.improves_where_free(centre, work, eval) {
                    continue;
                }
                let missing_m = merit.away.norm();
                return left.unwrap_or(Termination::OutOfReach { missing_m });
            }
        }
    }

    /// Stays in place and lets free joints give way.
    fn improves_where_free(&self, centre: &Vector3<f64>, work: &mut Work, eval: &mut Evaluator) -> bool {
        self.evaluate(work.best.origin, centre, Free::GivesWay, work, eval);
        let improves = work.trial.merit.is_better_than(&work.best.merit);
        if improves {
            std::mem::swap(&mut work.trial, &mut work.best);
        }
        improves
    }

    /// How the centre of mass moves with the root near a candidate.
    fn linear(&self, at: &Candidate) -> Linear {
        let rate = centre_of_mass_rate(self.robot, self.plan, at);
        Linear {
            origin: at.origin,
            away: at.merit.away,
            rate,
            inverse: rate.try_inverse().filter(|_| is_regular(&rate)),
        }
    }

    /// One step of the waist, shortened as far as needed. A trial that leaves an interval is followed by one with a cut
    /// along it.
    fn improve(&self, centre: &Vector3<f64>, work: &mut Work, eval: &mut Evaluator) -> bool {
        let from = work.best.origin;
        let merit = work.best.merit;
        let linear = merit.stands().then(|| self.linear(&work.best));
        if linear.is_none() {
            self.cut(&work.best, &mut work.region);
        }
        for way in [Way::Along, Way::Best] {
            'cuts: for cuts in 0..=MOST_CUTS {
                let target = match &linear {
                    Some(linear) => {
                        let (target, left) = linear.next(way, &work.region);
                        let gains = left.norm() < (1.0 - LEAST_GAIN) * merit.away.norm();
                        if !gains {
                            break;
                        }
                        target
                    }
                    None => work.region.nearest(&from),
                };
                for length in LENGTHS {
                    self.evaluate(from + (target - from) * length, centre, Free::Rests, work, eval);
                    if work.trial.merit.is_better_than(&work.best.merit) {
                        std::mem::swap(&mut work.trial, &mut work.best);
                        return true;
                    }
                    let leaves = work.trial.merit.missing_m == 0.0 && !work.trial.merit.stands();
                    if leaves && cuts < MOST_CUTS {
                        self.cut(&work.trial, &mut work.region);
                        continue 'cuts;
                    }
                }
                break;
            }
        }
        false
    }

    /// Cuts the region along the intervals that a candidate leaves, to first order.
    fn cut(&self, at: &Candidate, region: &mut Region) {
        let root = self.robot.root();
        let pose = root_pose(self.robot, &at.q);
        for plan in &self.plan.limbs {
            let mut rates = None;
            for (k, &c) in plan.coordinates.iter().enumerate() {
                let motion = at.q[root.nq() + c] - self.step.q_prev[root.nq() + c];
                let (lo, hi) = (
                    self.step.bounds.lo[root.nv() + c],
                    self.step.bounds.hi[root.nv() + c],
                );
                let (excess, sign) = if motion > hi {
                    (motion - hi, 1.0)
                } else {
                    (lo - motion, -1.0)
                };
                let in_shell = plan.is_hard && plan.shell.is_some_and(|shell| shell.hinge == k);
                if excess <= OUTSIDE_RAD || in_shell {
                    continue;
                }
                let rates = rates.get_or_insert_with(|| joint_rates(self.robot, plan, &pose, &at.page));
                if let Some(cut) = Halfspace::below(&at.origin, &(rates[k] * sign), excess) {
                    region.cut(c, cut);
                }
            }
        }
    }

    /// The shells of hard limbs within the intervals of their hinges, and the rings of arms.
    fn fill_region(&self, work: &mut Work) {
        work.region.clear();
        let first = self.robot.root();
        for (plan, target) in self.plan.limbs.iter().zip(&work.targets) {
            let (Some(shell), true) = (plan.shell, plan.is_hard) else {
                continue;
            };
            let c = plan.coordinates[shell.hinge];
            let (q, v) = (self.step.q_prev[first.nq() + c], first.nv() + c);
            let (least_m, largest_m) =
                shell.distances(q + self.step.bounds.lo[v], q + self.step.bounds.hi[v]);
            let end = match plan.target {
                Target::Pose(..) => target * shell.tip_point,
                Target::Point(_) => target.translation.vector.into(),
            };
            let arm = self.rotation * shell.base_point.coords;
            work.region.add(Reach {
                arm,
                centre: end.coords,
                least_m,
                largest_m,
            });
            if let Some((axis, forearm_m, upper_arm_m)) = plan.ring {
                work.region.add_ring(Ring {
                    arm,
                    wrist: end.coords,
                    axis: target.rotation * axis,
                    forearm_m,
                    upper_arm_m,
                });
            }
        }
    }

    /// Solves all limbs with the root at `origin`, then the tree for the centre of mass: the trial.
    fn evaluate(
        &self,
        origin: Vector3<f64>,
        centre: &Vector3<f64>,
        free: Free,
        work: &mut Work,
        eval: &mut Evaluator,
    ) {
        let Work { targets, trial, .. } = work;
        self.limbs(origin, targets, free, trial);
        if trial.merit.missing_m == 0.0 {
            eval.pass(&trial.q, &mut trial.page);
            trial.merit.away = centre - trial.page.centre_of_mass();
        }
    }
}
