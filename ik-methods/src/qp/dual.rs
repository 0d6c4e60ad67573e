//! # Dual active-set method for a box
//!
//! Goldfarb & Idnani, A numerically stable dual method for solving strictly convex quadratic programs,
//! Math. Programming 27 (1983), algorithm of section 3, in the least-distance unknowns of
//! [`Reduced`]. The point is at all times the minimiser on its working set with
//! multipliers of the right sign; a violated bound is added, members whose multiplier would change sign
//! leave, and every added bound raises the dual objective, so the method ends without cycling even at
//! degenerate vertices (in exact arithmetic; a limit on the changes guards the rest).
//!
//! Deviation: two-sided bounds are one constraint with a side; bounds that coincide never leave; dependent
//! normals are recognised by a threshold on the part outside the span of the working set.

use super::QpStatus;
use super::kernels::{LANES, add_scaled, max_abs, padded};
use super::reduced::Reduced;
use super::working_set::{Member, WorkingSet};

/// A bound counts as violated beyond this fraction of the box or of the terms its unknown is the sum of.
///
/// Rounding of an eliminated unknown is about 2.2e-16 times the condition of the pivot block; this leaves
/// three to four digits for it. Task rows and bounds themselves come with errors of 1e-16.
const VIOLATION: f64 = 1e-12;

/// Bounds beyond this size do not raise the scale of the box: in SI units and radians a tolerance above
/// 1e-12 would be visible.
const LARGEST_BOUND_SCALE: f64 = 1.0;

/// A member limits the dual step only if its rate exceeds this fraction of the largest rate.
const RATE_NOISE: f64 = 1e-13;

/// A multiplier is wrong-signed below minus this fraction of the largest.
const MULTIPLIER_NOISE: f64 = 1e-14;

/// State of the method; vectors over unknowns are in the positions of [`Reduced`].
#[derive(Clone, Debug)]
pub(super) struct Dual {
    n: usize,
    /// Point, padded to whole blocks with zeros.
    pub(super) x: Vec<f64>,
    lo: Vec<f64>,
    hi: Vec<f64>,
    pub(super) set: WorkingSet,
    /// Changes of the working set so far.
    pub(super) minors: u32,
    minor_limit: u32,
    bound_scale: f64,
    normal: Vec<f64>,
    inside: Vec<f64>,
    outside: Vec<f64>,
    rates: Vec<f64>,
    dx: Vec<f64>,
}

/// What limits a step.
#[derive(Clone, Copy)]
struct Blocking {
    member: usize,
    step: f64,
}

impl Dual {
    pub(super) fn new(n: usize) -> Self {
        let zeros = || vec![0.0; padded(n)];
        Self {
            n: 0,
            x: zeros(),
            lo: zeros(),
            hi: zeros(),
            set: WorkingSet::new(n),
            minors: 0,
            minor_limit: 0,
            bound_scale: 0.0,
            normal: zeros(),
            inside: zeros(),
            outside: zeros(),
            rates: zeros(),
            dx: zeros(),
        }
    }

    /// Starts at x_N = 0 with an empty working set.
    pub(super) fn load(&mut self, reduced: &Reduced, lo: &[f64], hi: &[f64]) {
        let n = reduced.order.len();
        self.n = n;
        self.minors = 0;
        // Empirical: real problems need about as many changes as bounds are active, at worst a few n.
        self.minor_limit = u32::try_from(100 + 20 * n).unwrap_or(u32::MAX);
        self.set.clear(reduced.unknowns());
        let mut largest = 0.0_f64;
        for (p, &unknown) in reduced.order.iter().enumerate() {
            // A lower bound above the upper one by rounding is the point between.
            let crossed = lo[unknown] > hi[unknown];
            let middle = 0.5 * (lo[unknown] + hi[unknown]);
            self.lo[p] = if crossed { middle } else { lo[unknown] };
            self.hi[p] = if crossed { middle } else { hi[unknown] };
            for bound in [self.lo[p].abs(), self.hi[p].abs()] {
                largest = if bound < f64::INFINITY {
                    largest.max(bound)
                } else {
                    largest
                };
            }
        }
        self.bound_scale = largest.min(LARGEST_BOUND_SCALE);
        self.x.fill(0.0);
        self.lo[n..].fill(f64::NEG_INFINITY);
        self.hi[n..].fill(f64::INFINITY);
        reduced.complete(&mut self.x);
    }

    /// Size of the box: largest finite bound, at most 1.
    pub(super) fn bound_scale(&self) -> f64 {
        self.bound_scale
    }

    /// Bound of `position` on the side of `sign`.
    fn bound(&self, position: usize, sign: f64) -> f64 {
        if sign > 0.0 {
            self.lo[position]
        } else {
            self.hi[position]
        }
    }

    #[expect(
        clippy::float_cmp,
        reason = "only bounds that are the same number leave no room"
    )]
    fn member(&self, position: usize, sign: f64) -> Member {
        let fixed = self.lo[position] == self.hi[position];
        Member {
            position,
            sign,
            multiplier: 0.0,
            fixed,
        }
    }

    /// Takes a bound into the working set without moving the point; dependent bounds are skipped.
    pub(super) fn hold(&mut self, reduced: &Reduced, position: usize, sign: f64) {
        let k = reduced.unknowns();
        if self.set.len() == k || !self.bound(position, sign).is_finite() {
            return;
        }
        let (normal, outside) = (&mut self.normal[..k], &mut self.outside[..k]);
        reduced.normal_into(position, sign, normal);
        let rest_sq = self.set.split(normal, &mut self.inside, outside);
        if rest_sq > 0.0 {
            let member = self.member(position, sign);
            self.set
                .push(member, &self.inside, &self.outside[..k], rest_sq.sqrt());
        }
    }

    /// Subtracts what the members contribute from a reduced gradient.
    pub(super) fn remove_multipliers(&mut self, reduced: &Reduced, gradient: &mut [f64]) {
        let row = &mut self.normal[..gradient.len()];
        for ((&position, sign), multiplier) in self
            .set
            .positions
            .iter()
            .zip(&self.set.signs)
            .zip(&self.set.multipliers)
        {
            reduced.bound_row_into(position, sign * multiplier, row);
            add_scaled(gradient, -1.0, row);
        }
    }

    /// Largest distance of a member from its bound in units of what is rounding there.
    pub(super) fn worst_member_gap(&self, reduced: &Reduced) -> f64 {
        let members = self.set.positions.iter().zip(&self.set.signs);
        let gaps = members.map(|(&p, &sign)| {
            let gap = (self.bound(p, sign) - self.x[p]).abs();
            if gap > 0.0 {
                gap / self.tolerance(reduced, p)
            } else {
                0.0
            }
        });
        gaps.fold(0.0, f64::max)
    }

    /// Moves to the minimiser on the working set, given the reduced gradient less the multipliers' part
    /// (destroyed), then removes members with the wrong sign until there are none.
    pub(super) fn correct(&mut self, reduced: &Reduced, residual: &mut [f64]) {
        let k = residual.len();
        let step = residual;
        reduced.solve_lower(step);
        step.iter_mut().for_each(|value| *value = -*value);
        for j in 0..self.set.len() {
            let (position, sign) = (self.set.positions[j], self.set.signs[j]);
            self.inside[j] = sign * (self.bound(position, sign) - self.x[position]);
        }
        self.set.solve_r_transposed(&mut self.inside);
        self.set.q_transposed_times(step, &mut self.rates);
        let w = self.set.len();
        add_scaled(&mut self.inside[..w], -1.0, &self.rates[..w]);
        self.set.add_q_times(&self.inside, step);
        self.set.solve_r(&mut self.inside);
        add_scaled(&mut self.set.multipliers, 1.0, &self.inside);

        while let Some(j) = self.wrong_signed() {
            self.release(reduced, j, step);
        }
        reduced.solve_upper(step);
        add_scaled(&mut self.x[reduced.rank()..][..k], 1.0, step);
        reduced.complete(&mut self.x);
    }

    /// Member with the most negative multiplier; multipliers negative by rounding become 0.
    fn wrong_signed(&mut self) -> Option<usize> {
        let floor = -MULTIPLIER_NOISE * max_abs(&self.set.multipliers);
        let mut worst = None;
        let mut least = floor;
        for (j, multiplier) in self.set.multipliers.iter_mut().enumerate() {
            if !self.set.fixed[j] && *multiplier < 0.0 {
                if *multiplier < least {
                    (worst, least) = (Some(j), *multiplier);
                } else if *multiplier >= floor {
                    *multiplier = 0.0;
                }
            }
        }
        worst
    }

    /// Removes member `j` and adds the move to the new minimiser to `step` (least-distance unknowns).
    fn release(&mut self, reduced: &Reduced, j: usize, step: &mut [f64]) {
        let k = step.len();
        self.minors += 1;
        let multiplier = self.set.multipliers[j];
        reduced.normal_into(self.set.positions[j], self.set.signs[j], &mut self.normal[..k]);
        self.set.remove(j);
        self.set
            .split(&self.normal[..k], &mut self.inside, &mut self.outside[..k]);
        add_scaled(step, -multiplier, &self.outside[..k]);
        self.set.solve_r(&mut self.inside);
        add_scaled(&mut self.set.multipliers, multiplier, &self.inside);
    }

    /// Adds violated bounds until there are none.
    pub(super) fn run(&mut self, reduced: &Reduced) -> QpStatus {
        while let Some((position, sign)) = self.most_violated(reduced) {
            let status = self.add(reduced, position, sign);
            if status != QpStatus::Solved {
                return status;
            }
        }
        QpStatus::Solved
    }

    /// Violation at `position` that is rounding.
    fn tolerance(&self, reduced: &Reduced, position: usize) -> f64 {
        VIOLATION * self.bound_scale.max(reduced.terms(&self.x, position))
    }

    /// True if no bound is violated by more than `factor` times what is rounding.
    pub(super) fn is_inside(&self, reduced: &Reduced, factor: f64) -> bool {
        let violation = |p: usize| (self.lo[p] - self.x[p]).max(self.x[p] - self.hi[p]);
        (0..self.n).all(|p| violation(p) <= factor * self.tolerance(reduced, p))
    }

    /// Largest violation of any bound.
    fn worst_violation(&self) -> f64 {
        let mut worst = [0.0; LANES];
        let blocks = self.x.as_chunks::<LANES>().0.iter();
        for ((x, lo), hi) in blocks
            .zip(self.lo.as_chunks::<LANES>().0)
            .zip(self.hi.as_chunks::<LANES>().0)
        {
            for lane in 0..LANES {
                let (below, above) = (lo[lane] - x[lane], x[lane] - hi[lane]);
                let violation = if below > above { below } else { above };
                worst[lane] = if violation > worst[lane] {
                    violation
                } else {
                    worst[lane]
                };
            }
        }
        max_abs(&worst)
    }

    /// Most violated bound outside the working set: position and sign.
    fn most_violated(&self, reduced: &Reduced) -> Option<(usize, f64)> {
        let mut largest = VIOLATION * self.bound_scale;
        if self.worst_violation() <= largest {
            return None;
        }
        let mut worst = None;
        for p in 0..self.n {
            let (below, above) = (self.lo[p] - self.x[p], self.x[p] - self.hi[p]);
            let (violation, sign) = if below > above {
                (below, 1.0)
            } else {
                (above, -1.0)
            };
            if violation > largest && !self.set.is_member[p] && violation > self.tolerance(reduced, p) {
                (worst, largest) = (Some((p, sign)), violation);
            }
        }
        worst
    }

    /// Adds one violated bound, letting members go as needed.
    fn add(&mut self, reduced: &Reduced, position: usize, sign: f64) -> QpStatus {
        let k = reduced.unknowns();
        let mut member = self.member(position, sign);
        reduced.normal_into(position, sign, &mut self.normal[..k]);
        while self.minors < self.minor_limit {
            self.minors += 1;
            let rest_sq = self
                .set
                .split(&self.normal[..k], &mut self.inside, &mut self.outside[..k]);
            let w = self.set.len();
            self.rates[..w].copy_from_slice(&self.inside[..w]);
            self.set.solve_r(&mut self.rates);
            let violation = (sign * (self.bound(position, sign) - self.x[position])).max(0.0);
            let full = if rest_sq > 0.0 {
                violation / rest_sq
            } else {
                f64::INFINITY
            };
            let blocking = self.blocking().filter(|blocking| blocking.step < full);
            let step = blocking.map_or(full, |blocking| blocking.step);
            if step == f64::INFINITY {
                return QpStatus::Infeasible;
            }
            self.shift_multipliers(step);
            member.multiplier += step;
            if rest_sq > 0.0 {
                self.advance(reduced, step, blocking.is_none(), member, rest_sq);
            }
            match blocking {
                Some(blocking) => self.set.remove(blocking.member),
                None => return QpStatus::Solved,
            }
        }
        QpStatus::MinorLimit
    }

    /// First member whose multiplier reaches zero, and the step at which it does.
    fn blocking(&self) -> Option<Blocking> {
        let rates = &self.rates[..self.set.len()];
        let floor = RATE_NOISE * max_abs(rates);
        let mut first: Option<Blocking> = None;
        for (member, rate) in rates.iter().enumerate() {
            if *rate > floor && !self.set.fixed[member] {
                let step = self.set.multipliers[member] / rate;
                if first.is_none_or(|first| step < first.step) {
                    first = Some(Blocking { member, step });
                }
            }
        }
        first
    }

    fn shift_multipliers(&mut self, step: f64) {
        let fixed = self.set.fixed.iter();
        for ((multiplier, rate), fixed) in self.set.multipliers.iter_mut().zip(&self.rates).zip(fixed) {
            let shifted = *multiplier - step * rate;
            *multiplier = if *fixed { shifted } else { shifted.max(0.0) };
        }
    }

    /// Moves the point by `step` along the direction in `outside`; a full step ends with the bound held.
    fn advance(&mut self, reduced: &Reduced, step: f64, is_full: bool, member: Member, rest_sq: f64) {
        let k = reduced.unknowns();
        if is_full {
            self.set
                .push(member, &self.inside, &self.outside[..k], rest_sq.sqrt());
        }
        let direction = &mut self.outside[..k];
        reduced.solve_upper(direction);
        reduced.direction_into(direction, &mut self.dx[..self.n]);
        add_scaled(&mut self.x[..self.n], step, &self.dx[..self.n]);
    }

    /// Puts members exactly on their bounds.
    pub(super) fn snap(&mut self) {
        for j in 0..self.set.len() {
            let position = self.set.positions[j];
            self.x[position] = self.bound(position, self.set.signs[j]);
        }
    }
}
