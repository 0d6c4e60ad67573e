//! The plan of a walk: when which foot swings, from where to where, which foot carries, and where the zero-moment point is
//! meant to be.
//!
//! Feet stand at x = 0 and y = ± half of their spacing. Every swing lands one step length ahead of the other foot, so that the
//! first goes one length and the others two; the last one closes the feet, except where it is the only one. Phases alternate,
//! double support first and last. The robot hangs on the foot that landed last, the one that stands through the next swing: its
//! base changes at every touchdown.

use super::spec::WalkSpec;
use crate::referee::Foot;
use crate::trajectory::gait::Support;
use crate::trajectory::shape::{smooth_step, smooth_step_slope};

/// Slack of a time at the ends of a phase (s), so that a sample at a touchdown counts as landed whatever it was rounded to.
const TIME_SLACK_S: f64 = 1e-9;

/// One step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// The foot that swings.
    pub swing: Foot,
    /// Where along x it lifts off (m).
    pub from_m: f64,
    /// Where it touches down (m).
    pub to_m: f64,
    /// When it lifts off (s).
    pub lift_off_s: f64,
    /// When it touches down (s).
    pub touch_down_s: f64,
}

/// A walk step by step.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The steps.
    pub steps: Vec<Step>,
    /// End of the last double support (s).
    pub duration_s: f64,
    half_spacing_m: f64,
    lift_m: f64,
    /// Corners (s, (x, y) in m) between which the reference of the zero-moment point is linear.
    zmp: Vec<(f64, [f64; 2])>,
}

/// Position of a foot and its rate: along x and upwards (m, m/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FootMotion {
    pub(super) x: f64,
    pub(super) z: f64,
    pub(super) x_rate: f64,
    pub(super) z_rate: f64,
}

impl Plan {
    /// The plan of a checked specification.
    pub fn new(spec: &WalkSpec) -> Self {
        let mut plan = Self {
            steps: Vec::new(),
            duration_s: 0.0,
            half_spacing_m: 0.5 * spec.foot_spacing_m,
            lift_m: spec.lift_m,
            zmp: vec![(0.0, [0.0, 0.0]), (spec.initial_hold_s, [0.0, 0.0])],
        };
        let (mut standing_m, mut swinging_m) = (0.0, 0.0);
        let mut swing = spec.first_swing;
        let mut t = spec.initial_hold_s;
        for n in 1..=spec.steps {
            let closes = n > 1 && n == spec.steps;
            let to_m = if closes {
                standing_m
            } else {
                standing_m + spec.step_m
            };
            let step = Step {
                swing,
                from_m: swinging_m,
                to_m,
                lift_off_s: t + spec.double_support_s,
                touch_down_s: t + spec.double_support_s + spec.single_support_s,
            };
            let under_standing = [standing_m, plan.y_m(swing.other())];
            plan.zmp.push((step.lift_off_s, under_standing));
            plan.zmp.push((step.touch_down_s, under_standing));
            plan.steps.push(step);
            t = step.touch_down_s;
            (standing_m, swinging_m) = (to_m, standing_m);
            swing = swing.other();
        }
        plan.duration_s = t + spec.double_support_s;
        plan.zmp
            .push((plan.duration_s, [0.5 * (standing_m + swinging_m), 0.0]));
        plan
    }

    /// y of a foot, which it keeps (m).
    pub(super) fn y_m(&self, foot: Foot) -> f64 {
        match foot {
            Foot::Right => -self.half_spacing_m,
            Foot::Left => self.half_spacing_m,
        }
    }

    /// Which feet are on the ground at `t` (s).
    pub fn support(&self, t: f64) -> Support {
        let swinging = self
            .steps
            .iter()
            .find(|step| t > step.lift_off_s + TIME_SLACK_S && t < step.touch_down_s - TIME_SLACK_S);
        match swinging.map(|step| step.swing) {
            None => Support::Both,
            Some(Foot::Right) => Support::Left,
            Some(Foot::Left) => Support::Right,
        }
    }

    /// The foot that the robot hangs on at `t` (s): the one that landed last, before the first touchdown the one that
    /// stands through the first swing.
    pub fn carrier(&self, t: f64) -> Foot {
        let landed = self
            .steps
            .iter()
            .rev()
            .find(|step| t >= step.touch_down_s - TIME_SLACK_S);
        match (landed, self.steps.first()) {
            (Some(step), _) => step.swing,
            (None, Some(first)) => first.swing.other(),
            (None, None) => Foot::Right,
        }
    }

    /// Duration of the shortest swing (s); infinite without a step.
    pub fn shortest_swing_s(&self) -> f64 {
        let swings = self.steps.iter().map(|step| step.touch_down_s - step.lift_off_s);
        swings.fold(f64::INFINITY, f64::min)
    }

    /// How far `t` (s) is inside a single support: 0 in double support, from 0 to 1 in `ramp_s` after lift-off and back
    /// before touchdown.
    pub fn single_support_ramp(&self, t: f64, ramp_s: f64) -> f64 {
        let inside = |step: &Step| {
            let depth_s = (t - step.lift_off_s).min(step.touch_down_s - t);
            if ramp_s > 0.0 {
                (depth_s / ramp_s).clamp(0.0, 1.0)
            } else {
                f64::from(u8::from(depth_s > TIME_SLACK_S))
            }
        };
        self.steps.iter().map(inside).fold(0.0, f64::max)
    }

    /// The reference of the zero-moment point at `t` (s): x, y (m).
    pub fn zmp_m(&self, t: f64) -> [f64; 2] {
        let next = self.zmp.partition_point(|(time, _)| *time <= t);
        let (Some(&(end, to)), Some(&(begin, from))) =
            (self.zmp.get(next), self.zmp.get(next.wrapping_sub(1)))
        else {
            return self.zmp.last().map_or([0.0; 2], |(_, last)| *last);
        };
        let part = (t - begin) / (end - begin);
        [0, 1].map(|i| from[i] + part * (to[i] - from[i]))
    }

    /// Where a foot is at `t` (s).
    pub(super) fn foot(&self, foot: Foot, t: f64) -> FootMotion {
        let own = || self.steps.iter().filter(|step| step.swing == foot);
        let Some(step) = own().rev().find(|step| t >= step.lift_off_s) else {
            return FootMotion {
                x: own().next().map_or(0.0, |step| step.from_m),
                z: 0.0,
                x_rate: 0.0,
                z_rate: 0.0,
            };
        };
        // Minimum jerk (Flash & Hogan 1985) along the way; the height is 16 h u² (1 − u)² of the same u, h in the middle.
        let duration_s = step.touch_down_s - step.lift_off_s;
        let s = (t - step.lift_off_s) / duration_s;
        let (u, u_rate) = (smooth_step(s), smooth_step_slope(s) / duration_s);
        let length_m = step.to_m - step.from_m;
        let height = 16.0 * self.lift_m;
        FootMotion {
            x: step.from_m + length_m * u,
            z: height * u * u * (1.0 - u) * (1.0 - u),
            x_rate: length_m * u_rate,
            z_rate: height * 2.0 * u * (1.0 - u) * (1.0 - 2.0 * u) * u_rate,
        }
    }

    /// Times at which two steps have been made since the one before (s): touchdowns of every second step but the closing one, at
    /// which a walk that repeats itself repeats itself.
    pub fn cycle_ends_s(&self) -> Vec<f64> {
        let repeating = self.steps.iter().rev().skip(1).rev();
        repeating
            .skip(1)
            .step_by(2)
            .map(|step| step.touch_down_s)
            .collect()
    }
}
