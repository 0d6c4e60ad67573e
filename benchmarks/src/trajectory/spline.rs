//! Cubic splines with given end rates (clamped), as in de Boor, *A Practical Guide to Splines* (1978), chapter IV: the
//! slopes at the knots make the second derivative continuous and solve one tridiagonal, diagonally dominant system.

/// A clamped cubic spline through knots; constant outside of them.
#[derive(Clone, Debug, PartialEq)]
pub struct CubicSpline {
    knots: Vec<(f64, f64)>,
    slopes: Vec<f64>,
}

/// Knots that no spline passes through.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum KnotError {
    /// None at all.
    #[error("a spline needs a knot")]
    Empty,
    /// A number that is not finite.
    #[error("the knot ({t}, {value}) is not finite")]
    NotFinite {
        /// Its time (s).
        t: f64,
        /// Its value.
        value: f64,
    },
    /// Times that do not ascend.
    #[error("the knot at t = {t} s is not later than the one before it, at {before} s")]
    Order {
        /// The later one in the list (s).
        t: f64,
        /// The one before it (s).
        before: f64,
    },
}

impl CubicSpline {
    /// The spline through `knots` (time in s, value), at rest at both ends. A single knot is a constant.
    ///
    /// # Errors
    /// No knot, a number that is not finite, times that do not ascend.
    pub fn at_rest(knots: Vec<(f64, f64)>) -> Result<Self, KnotError> {
        Self::clamped(knots, [0.0, 0.0])
    }

    /// The spline through `knots` (time in s, value) that has the rates `ends` (per s) at the first and the last knot.
    ///
    /// # Errors
    /// As [`CubicSpline::at_rest`].
    pub fn clamped(knots: Vec<(f64, f64)>, ends: [f64; 2]) -> Result<Self, KnotError> {
        if knots.is_empty() {
            return Err(KnotError::Empty);
        }
        if let Some(&(t, value)) = knots.iter().find(|(t, y)| !(t.is_finite() && y.is_finite())) {
            return Err(KnotError::NotFinite { t, value });
        }
        if let Some(pair) = knots.windows(2).find(|pair| pair[1].0 <= pair[0].0) {
            let (before, t) = (pair[0].0, pair[1].0);
            return Err(KnotError::Order { t, before });
        }
        let slopes = slopes(&knots, ends);
        Ok(Self { knots, slopes })
    }

    /// The knots (time in s, value), ascending.
    pub fn knots(&self) -> &[(f64, f64)] {
        &self.knots
    }

    /// Value at `t` (s).
    pub fn value(&self, t: f64) -> f64 {
        let Some((i, h, u)) = self.interval(t) else {
            let first = self.knots[0];
            let last = self.knots[self.knots.len() - 1];
            return if t < first.0 { first.1 } else { last.1 };
        };
        let (y0, y1) = (self.knots[i].1, self.knots[i + 1].1);
        let (m0, m1) = (h * self.slopes[i], h * self.slopes[i + 1]);
        let w = 1.0 - u;
        w * w * ((1.0 + 2.0 * u) * y0 + u * m0) + u * u * ((1.0 + 2.0 * w) * y1 - w * m1)
    }

    /// First derivative at `t` (s).
    pub fn rate(&self, t: f64) -> f64 {
        let Some((i, h, u)) = self.interval(t) else {
            return 0.0;
        };
        let chord = (self.knots[i + 1].1 - self.knots[i].1) / h;
        let (m0, m1) = (self.slopes[i], self.slopes[i + 1]);
        let w = 1.0 - u;
        6.0 * u * w * chord + w * (1.0 - 3.0 * u) * m0 + u * (3.0 * u - 2.0) * m1
    }

    /// Second derivative at `t` (s); at a knot that of the interval that begins there, or ends there at the last.
    pub fn acceleration(&self, t: f64) -> f64 {
        let Some((i, h, u)) = self.interval(t) else {
            return 0.0;
        };
        let chord = (self.knots[i + 1].1 - self.knots[i].1) / h;
        let (m0, m1) = (self.slopes[i], self.slopes[i + 1]);
        ((6.0 - 12.0 * u) * chord + (6.0 * u - 4.0) * m0 + (6.0 * u - 2.0) * m1) / h
    }

    /// Index, length and the part gone (0 … 1) of the interval around `t`; none outside the knots.
    fn interval(&self, t: f64) -> Option<(usize, f64, f64)> {
        let last = self.knots.len() - 1;
        if last == 0 || !(self.knots[0].0..=self.knots[last].0).contains(&t) {
            return None;
        }
        let after = self.knots.partition_point(|(knot, _)| *knot <= t);
        let i = (after - 1).min(last - 1);
        let h = self.knots[i + 1].0 - self.knots[i].0;
        Some((i, h, (t - self.knots[i].0) / h))
    }
}

/// The slopes m at the knots with continuous second derivative: with intervals h and chords d,
/// `m_{i−1} / h_{i−1} + 2 m_i (1/h_{i−1} + 1/h_i) + m_{i+1} / h_i = 3 (d_{i−1} / h_{i−1} + d_i / h_i)`,
/// by elimination without pivoting (the rows are diagonally dominant).
fn slopes(knots: &[(f64, f64)], ends: [f64; 2]) -> Vec<f64> {
    let n = knots.len();
    let mut m = vec![ends[0]; n];
    m[n - 1] = ends[1];
    let inverse = |i: usize| 1.0 / (knots[i + 1].0 - knots[i].0);
    let chord = |i: usize| (knots[i + 1].1 - knots[i].1) * inverse(i);
    let mut upper = vec![0.0; n];
    for i in 1..n.saturating_sub(1) {
        let (a, c) = (inverse(i - 1), inverse(i));
        let pivot = 2.0 * (a + c) - a * upper[i - 1];
        upper[i] = c / pivot;
        m[i] = (3.0 * (chord(i - 1) * a + chord(i) * c) - a * m[i - 1]) / pivot;
    }
    for i in (1..n.saturating_sub(1)).rev() {
        m[i] -= upper[i] * m[i + 1];
    }
    m
}

/// Splines one after the other, each constant outside its knots: the last one that has begun counts.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    first: CubicSpline,
    later: Vec<CubicSpline>,
}

impl Curve {
    /// `first`, then `later` in the order of their times.
    pub fn new(first: CubicSpline, later: Vec<CubicSpline>) -> Self {
        Self { first, later }
    }

    /// The splines, in the order of their times.
    pub fn splines(&self) -> impl Iterator<Item = &CubicSpline> {
        std::iter::once(&self.first).chain(&self.later)
    }

    /// Value at `t` (s).
    pub fn value(&self, t: f64) -> f64 {
        self.at(t).value(t)
    }

    /// First derivative at `t` (s).
    pub fn rate(&self, t: f64) -> f64 {
        self.at(t).rate(t)
    }

    fn at(&self, t: f64) -> &CubicSpline {
        let begun = self.later.partition_point(|spline| spline.knots[0].0 <= t);
        self.later[..begun].last().unwrap_or(&self.first)
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::float_cmp,
        clippy::unwrap_used,
        reason = "constants are copied, not computed; tests want to stop at the first surprise"
    )]

    use super::*;

    const KNOTS: [(f64, f64); 6] = [
        (0.2, 1.0),
        (0.5, -2.0),
        (0.6, -1.5),
        (1.9, 4.0),
        (2.0, 4.5),
        (3.3, 0.25),
    ];

    fn uneven() -> CubicSpline {
        CubicSpline::clamped(KNOTS.to_vec(), [2.0, -1.0]).unwrap()
    }

    #[test]
    fn it_passes_through_its_knots_with_the_given_end_rates() {
        let spline = uneven();
        for (t, y) in KNOTS {
            assert!((spline.value(t) - y).abs() < 1e-14, "{t}");
        }
        assert!((spline.rate(0.2) - 2.0).abs() < 1e-13 && (spline.rate(3.3) + 1.0).abs() < 1e-13);
        let at_rest = CubicSpline::at_rest(KNOTS.to_vec()).unwrap();
        assert!(at_rest.rate(0.2).abs() < 1e-13 && at_rest.rate(3.3).abs() < 1e-13);
    }

    #[test]
    fn value_rate_and_acceleration_are_continuous_at_inner_knots() {
        let spline = uneven();
        // Third derivatives are below 2e3, so a step of 1e-9 changes the acceleration by less than 1e-5.
        for (t, _) in &KNOTS[1..5] {
            let jump = |f: &dyn Fn(f64) -> f64| (f(t + 1e-9) - f(t - 1e-9)).abs();
            assert!(jump(&|t| spline.value(t)) < 1e-6);
            assert!(jump(&|t| spline.rate(t)) < 1e-5);
            assert!(jump(&|t| spline.acceleration(t)) < 1e-4, "{t}");
        }
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let spline = uneven();
        let h = 1e-5;
        for i in 1..200 {
            // Off the knots, where the third derivative jumps.
            let t = 0.2 + 3.1 * f64::from(i) / 200.0 + 1e-4;
            let rate = (spline.value(t + h) - spline.value(t - h)) / (2.0 * h);
            assert!((spline.rate(t) - rate).abs() < 1e-6, "{t}");
            let acceleration = (spline.rate(t + h) - spline.rate(t - h)) / (2.0 * h);
            assert!((spline.acceleration(t) - acceleration).abs() < 1e-6, "{t}");
        }
    }

    #[test]
    fn a_cubic_is_reproduced() {
        let cubic = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t + 3.0 * t * t * t;
        let slope = |t: f64| -2.0 + t + 9.0 * t * t;
        let times = [-1.0, -0.7, 0.1, 0.2, 1.5];
        let knots = times.iter().map(|&t| (t, cubic(t))).collect();
        let spline = CubicSpline::clamped(knots, [slope(-1.0), slope(1.5)]).unwrap();
        for i in 0..=100 {
            let t = -1.0 + 2.5 * f64::from(i) / 100.0;
            assert!((spline.value(t) - cubic(t)).abs() < 1e-13, "{t}");
            assert!((spline.rate(t) - slope(t)).abs() < 1e-12, "{t}");
            assert!((spline.acceleration(t) - (1.0 + 18.0 * t)).abs() < 1e-11, "{t}");
        }
    }

    #[test]
    fn it_is_constant_outside_its_knots_and_with_a_single_one() {
        let spline = uneven();
        for (t, y) in [(-5.0, 1.0), (0.199_999, 1.0), (3.300_001, 0.25), (99.0, 0.25)] {
            assert_eq!(
                (spline.value(t), spline.rate(t), spline.acceleration(t)),
                (y, 0.0, 0.0)
            );
        }
        let constant = CubicSpline::at_rest(vec![(1.0, 7.0)]).unwrap();
        for t in [0.0, 1.0, 2.0] {
            assert_eq!((constant.value(t), constant.rate(t)), (7.0, 0.0));
        }
    }

    #[test]
    fn knots_that_cannot_be_are_refused() {
        assert_eq!(CubicSpline::at_rest(vec![]), Err(KnotError::Empty));
        let doubled = CubicSpline::at_rest(vec![(0.0, 1.0), (1.0, 2.0), (1.0, 3.0)]).unwrap_err();
        assert!(doubled.to_string().contains("t = 1 s"), "{doubled}");
        assert!(CubicSpline::at_rest(vec![(0.0, f64::NAN)]).is_err());
        assert!(CubicSpline::at_rest(vec![(f64::INFINITY, 1.0)]).is_err());
    }

    #[test]
    fn of_several_splines_the_last_begun_counts() {
        let spline = |a: f64, b: f64| CubicSpline::at_rest(vec![(a, a), (b, b)]).unwrap();
        let curve = Curve::new(spline(1.0, 2.0), vec![spline(3.0, 5.0), spline(6.0, 7.0)]);
        for (t, y) in [
            (0.0, 1.0),
            (1.5, 1.5),
            (2.9, 2.0),
            (3.0, 3.0),
            (4.0, 4.0),
            (5.5, 5.0),
            (9.0, 7.0),
        ] {
            assert_eq!(curve.value(t), y);
        }
        assert_eq!(curve.rate(2.5), 0.0);
        assert!(curve.rate(4.0) > 1.0);
        assert_eq!(curve.splines().count(), 3);
    }
}
