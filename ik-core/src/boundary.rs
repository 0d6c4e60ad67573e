//! Joint boundaries: which positions *and* velocities a joint may have, as one exact interval per joint and step.
//!
//! With q = q⁻ + Δq and q̇ = Δq/Δt every boundary of Faraji & Ijspeert (2017) is a condition on the single number Δq_j, so
//! it is solved once per control step and handed to the methods as `lo ≤ Δq ≤ hi`. No nonlinear inequality ever
//! reaches a solver. Root coordinates are never bounded.

use crate::robot::{Limits, Robot};
use serde::{Deserialize, Serialize};

/// A boundary that all bounded joints of a problem share; position and velocity limits come from the robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Boundary {
    /// Nothing is bounded.
    None,
    /// Position limits only.
    Positions,
    /// Position limits and |q̇| ≤ q̇max.
    Box,
    /// Faraji & Ijspeert (2017), eq. (6): full speed in the middle of the range, none at its ends.
    Ellipse {
        /// Safety margin q_s (rad or m) taken off both ends of the range.
        margin: f64,
    },
    /// |q̇| ≤ q̇max, approach no faster than κ·distance, leave no faster than κ·distance + v0 (notes, table 1 row 17:
    /// the source cites a polygon without giving its numbers).
    Polygon {
        /// κ (1/s).
        approach_per_s: f64,
        /// v0 (rad/s or m/s), above 0: with 0 a joint on its limit could never leave it.
        exit_speed: f64,
    },
}

/// What is wrong with a boundary.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BoundaryError {
    /// A parameter out of range.
    #[error("boundary {field} = {value}: {allowed}")]
    Parameter {
        /// Name of the field.
        field: &'static str,
        /// What it holds.
        value: f64,
        /// What it may hold.
        allowed: &'static str,
    },
    /// The margin leaves nothing of a joint's range.
    #[error(
        "boundary margin = {margin} leaves no range for joint `{joint}`: its limits are {lower} .. {upper}"
    )]
    Margin {
        /// Name of the joint.
        joint: String,
        /// The margin.
        margin: f64,
        /// Lower position limit.
        lower: f64,
        /// Upper position limit.
        upper: f64,
    },
}

/// The admissible increments of one joint in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// Least admissible Δq.
    pub lo: f64,
    /// Largest admissible Δq.
    pub hi: f64,
    /// The previous position admits no increment at all: the interval is the recovery rule's single point.
    pub outside: bool,
}

impl Boundary {
    /// Checks the parameters against a robot.
    pub fn validate(&self, robot: &Robot) -> Result<(), BoundaryError> {
        let check = |field, value: f64, good: bool, allowed| {
            if good {
                Ok(())
            } else {
                Err(BoundaryError::Parameter {
                    field,
                    value,
                    allowed,
                })
            }
        };
        match *self {
            Self::None | Self::Positions | Self::Box => Ok(()),
            Self::Ellipse { margin } => {
                check(
                    "margin",
                    margin,
                    margin.is_finite() && margin >= 0.0,
                    "finite and not negative",
                )?;
                for c in robot.coordinates() {
                    if c.limits.upper - c.limits.lower - 2.0 * margin <= 0.0 {
                        return Err(BoundaryError::Margin {
                            joint: c.name.clone(),
                            margin,
                            lower: c.limits.lower,
                            upper: c.limits.upper,
                        });
                    }
                }
                Ok(())
            }
            Self::Polygon {
                approach_per_s,
                exit_speed,
            } => {
                let good = approach_per_s.is_finite() && approach_per_s > 0.0;
                check("approach_per_s", approach_per_s, good, "finite and above 0")?;
                let good = exit_speed.is_finite() && exit_speed > 0.0;
                check("exit_speed", exit_speed, good, "finite and above 0")
            }
        }
    }

    /// The exact interval of a joint at `q_prev` for a step of `dt_s` seconds.
    pub fn interval(&self, limits: &Limits, q_prev: f64, dt_s: f64) -> Interval {
        let reach = limits.velocity * dt_s;
        match *self {
            Self::None => Interval {
                lo: f64::NEG_INFINITY,
                hi: f64::INFINITY,
                outside: false,
            },
            Self::Positions => position_interval(limits, q_prev, f64::INFINITY),
            Self::Box => position_interval(limits, q_prev, reach),
            Self::Ellipse { margin } => ellipse_interval(limits, margin, q_prev, reach),
            Self::Polygon {
                approach_per_s,
                exit_speed,
            } => polygon_interval(limits, approach_per_s * dt_s, exit_speed * dt_s, q_prev, reach),
        }
    }

    /// True if velocities matter, so that an interval depends on the time step.
    pub fn bounds_velocity(&self) -> bool {
        !matches!(self, Self::None | Self::Positions)
    }
}

/// Where q⁻ admits no increment: move to the nearest admissible position, at most `reach` per step (notes §2).
///
/// No increment satisfies eq. (6) there, this one included: on the way back g is up to 1 (and more while still outside),
/// so such a run reports a positive boundary value although it follows the rule.
fn recover(q_prev: f64, nearest: f64, reach: f64) -> Interval {
    let dq = (nearest - q_prev).clamp(-reach, reach);
    Interval {
        lo: dq,
        hi: dq,
        outside: true,
    }
}

fn position_interval(limits: &Limits, q_prev: f64, reach: f64) -> Interval {
    let lo = (limits.lower - q_prev).max(-reach);
    let hi = (limits.upper - q_prev).min(reach);
    if lo > hi {
        return recover(q_prev, q_prev.clamp(limits.lower, limits.upper), reach);
    }
    Interval {
        lo,
        hi,
        outside: false,
    }
}

/// Faraji & Ijspeert (2017), eq. (6) with q̇ = Δq/Δt: `(u/h)² + ((u − u⁻)/v)² ≤ 1` in u = q − (ql + qu)/2, h the half range
/// less the margin, v = q̇max Δt, a quadratic whose roots are taken relative to u⁻ to keep Δq accurate:
/// `Δu = (∓ h v s − u⁻ v²) / (h² + v²)`, `s² = h² + v² − u⁻²`.
fn ellipse_interval(limits: &Limits, margin: f64, q_prev: f64, reach: f64) -> Interval {
    if !(limits.lower.is_finite() && limits.upper.is_finite()) {
        // Eq. (6) has no meaning without a range; what there is of one still keeps its margin.
        let inner = Limits {
            lower: limits.lower + margin,
            upper: limits.upper - margin,
            ..*limits
        };
        return position_interval(&inner, q_prev, reach);
    }
    let middle = 0.5 * (limits.lower + limits.upper);
    let h = 0.5 * (limits.upper - limits.lower) - margin;
    let u = q_prev - middle;
    if reach.is_infinite() {
        return position_interval(
            &Limits {
                lower: middle - h,
                upper: middle + h,
                ..*limits
            },
            q_prev,
            reach,
        );
    }
    let sum = h * h + reach * reach;
    let discriminant = sum - u * u;
    if discriminant < 0.0 {
        return recover(q_prev, middle + h.copysign(u), reach);
    }
    let (centre, half) = (-u * reach * reach / sum, h * reach * discriminant.sqrt() / sum);
    // Rounding must not let a joint on its limit pass it: the ends are cut to |u| ≤ h.
    let lo = (centre - half).max(-h - u);
    let hi = (centre + half).min(h - u);
    Interval {
        lo: lo.min(hi),
        hi: hi.max(lo),
        outside: false,
    }
}

/// Notes §2, polygon: with s⁻, r⁻ the distances of q⁻ from the lower and upper limit and κ' = κΔt, v' = v0Δt, the
/// conditions at the new position are linear in it.
fn polygon_interval(limits: &Limits, kappa: f64, exit: f64, q_prev: f64, reach: f64) -> Interval {
    let (s, r) = (q_prev - limits.lower, limits.upper - q_prev);
    if s < 0.0 || r < 0.0 {
        return recover(q_prev, q_prev.clamp(limits.lower, limits.upper), reach);
    }
    let slow = 1.0 / (1.0 + kappa);
    // From κΔt = 1 on, the speed allowed at the new position grows faster than the position: no bound remains.
    let fast = if kappa < 1.0 {
        1.0 / (1.0 - kappa)
    } else {
        f64::INFINITY
    };
    let lo = (-reach).max(s * slow - s).max(r - (r + exit) * fast);
    let hi = reach.min(r - r * slow).min((s + exit) * fast - s);
    Interval {
        lo,
        hi,
        outside: false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const KNEE: Limits = Limits {
        lower: 0.0,
        upper: 1.9199,
        velocity: 4.0,
        effort: 50.0,
    };
    const DT: f64 = 0.005;

    /// Eq. (6) as printed.
    fn g(limits: &Limits, margin: f64, q: f64, velocity: f64) -> f64 {
        let range = limits.upper - limits.lower - 2.0 * margin;
        ((2.0 * q - (limits.lower + limits.upper)) / range).powi(2) + (velocity / limits.velocity).powi(2)
            - 1.0
    }

    /// Largest and least admissible increments by bisection on a fine grid.
    fn brute_force(admissible: impl Fn(f64) -> bool, reach: f64) -> Option<(f64, f64)> {
        let grid: Vec<f64> = (0..=40_000)
            .map(|k| reach * (f64::from(k) / 20_000.0 - 1.0))
            .collect();
        let inside: Vec<f64> = grid.into_iter().filter(|&d| admissible(d)).collect();
        Some((*inside.first()?, *inside.last()?))
    }

    proptest! {
        #[test]
        fn ellipse_is_the_set_of_admissible_increments(q in 0.0..1.9199, margin in 0.0..0.2) {
            let interval = Boundary::Ellipse { margin }.interval(&KNEE, q, DT);
            let reach = KNEE.velocity * DT;
            match brute_force(|d| g(&KNEE, margin, q + d, d / DT) <= 0.0, reach) {
                Some((lo, hi)) => {
                    prop_assert!(!interval.outside);
                    prop_assert!((interval.lo - lo).abs() <= 2e-6 && (interval.hi - hi).abs() <= 2e-6);
                }
                None => prop_assert!(interval.outside || interval.hi - interval.lo < 2e-6),
            }
            if !interval.outside {
                prop_assert!(g(&KNEE, margin, q + interval.lo, interval.lo / DT) < 1e-12);
                prop_assert!(g(&KNEE, margin, q + interval.hi, interval.hi / DT) < 1e-12);
            }
        }

        #[test]
        fn polygon_is_the_set_of_admissible_increments(q in 0.0..1.9199) {
            let (kappa, v0) = (8.0, 0.02);
            let interval = Boundary::Polygon { approach_per_s: kappa, exit_speed: v0 }.interval(&KNEE, q, DT);
            let reach = KNEE.velocity * DT;
            let admissible = |d: f64| {
                let (s, r, v) = (q + d - KNEE.lower, KNEE.upper - q - d, d / DT);
                let (up, down) = ((kappa * r).min(kappa * s + v0), (kappa * s).min(kappa * r + v0));
                s >= 0.0 && r >= 0.0 && v <= up && -v <= down
            };
            let (lo, hi) = brute_force(admissible, reach).expect("standing still is admissible");
            prop_assert!((interval.lo - lo).abs() <= 2e-6 && (interval.hi - hi).abs() <= 2e-6);
        }

        #[test]
        fn an_interval_is_never_empty_and_leads_back_inside(q in -1.0..3.0f64, margin in 0.0..0.2) {
            let mut q = q;
            let boundary = Boundary::Ellipse { margin };
            for _ in 0..200 {
                let interval = boundary.interval(&KNEE, q, DT);
                prop_assert!(interval.lo <= interval.hi);
                q += interval.hi.min(interval.lo.max(0.0));
            }
            prop_assert!(!boundary.interval(&KNEE, q, DT).outside);
        }
    }

    #[test]
    fn leaving_a_straight_knee_starts_slowly() {
        let interval = Boundary::Ellipse { margin: 0.0 }.interval(&KNEE, 0.0, DT);
        let (h, v) = (0.5 * KNEE.upper, KNEE.velocity * DT);
        assert!(interval.lo.abs() < 1e-16);
        assert!((interval.hi - 2.0 * h * v * v / (h * h + v * v)).abs() < 1e-15);
    }

    #[test]
    fn positions_and_box() {
        let i = Boundary::Positions.interval(&KNEE, 0.5, DT);
        assert_eq!((i.lo, i.hi), (-0.5, KNEE.upper - 0.5));
        let i = Boundary::Box.interval(&KNEE, 0.01, DT);
        assert_eq!((i.lo, i.hi), (-0.01, 0.02));
        let i = Boundary::Box.interval(&KNEE, -0.5, DT);
        assert_eq!((i.lo, i.hi, i.outside), (0.02, 0.02, true));
        let i = Boundary::None.interval(&KNEE, -0.5, DT);
        assert!(i.lo == f64::NEG_INFINITY && !i.outside);
    }
}
