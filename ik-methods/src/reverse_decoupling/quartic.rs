//! Real roots of polynomials up to degree four.
//!
//! Between two neighbouring extrema a polynomial is monotone, so it has exactly one root there if its sign changes and none
//! if it does not. The extrema are the roots of the derivative, found the same way; the recursion ends at the quadratic
//! formula. Each root is isolated by its bracket and polished by Newton steps that may not leave it. Unlike Ferrari's formula
//! this needs no complex numbers, loses no digits where the resolvent cubic nearly degenerates, and sees multiple roots as
//! what they are: extrema on the axis.

/// Coefficients smaller than this share of the largest one count as zero, so the degree drops: the lost root lies beyond
/// 1/ε, where a double cannot hold it against the others.
const VANISHING: f64 = f64::EPSILON;

/// Rounding of one evaluation by Horner's rule, in units of ε Σ|aᵢ xⁱ|: 2n for degree n = 4 (Higham 2002, section 5.1), and
/// one more unit for coefficients that were themselves rounded.
const EVALUATION_ROUNDING: f64 = 9.0 * f64::EPSILON;

/// Bisection alone ends here: 52 bits of mantissa plus the binary digits of the bracket against the smallest root worth
/// telling from zero.
const MOST_ITERATIONS: usize = 128;

/// Up to four distinct real roots, in ascending order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Roots {
    values: [f64; 4],
    len: usize,
}

impl Roots {
    /// The roots; a multiple root is listed once.
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.len]
    }

    fn push(&mut self, root: f64) {
        self.values[self.len] = root;
        self.len += 1;
    }
}

/// Real roots of `c[0] + c[1] x + … + c[4] x⁴`; leading coefficients may vanish.
///
/// A multiple root is returned once. An extremum that misses the axis by no more than `slack (1 + x²)²` counts as a root:
/// with x = tan(θ/2) that is a miss of `slack` in the trigonometric equation behind the polynomial. With `slack` 0 only
/// rounding is forgiven. The zero polynomial and anything not finite have no roots.
pub fn real_roots(c: &[f64; 5], slack: f64) -> Roots {
    roots_of(c, slack)
}

fn roots_of(coefficients: &[f64], slack: f64) -> Roots {
    let mut roots = Roots::default();
    let largest = coefficients.iter().fold(0.0f64, |most, c| most.max(c.abs()));
    if largest == 0.0 || !coefficients.iter().all(|c| c.is_finite()) {
        return roots;
    }
    let vanishing = VANISHING * largest;
    let terms = coefficients
        .iter()
        .rposition(|c| c.abs() > vanishing)
        .map_or(0, |last| last + 1);
    match coefficients[..terms] {
        [a, b] => roots.push(-a / b),
        [a, b, c] => quadratic(a, b, c, slack, &mut roots),
        ref more if terms > 3 => between_extrema(more, slack, &mut roots),
        _ => {}
    }
    roots
}

/// Roots of `a + b x + c x²` without cancellation (Kahan): the larger one from the formula, the other from their product.
fn quadratic(a: f64, b: f64, c: f64, slack: f64, roots: &mut Roots) {
    let extremum = -0.5 * b / c;
    let (value, rounding) = evaluate(&[a, b, c], extremum);
    let discriminant = b * b - 4.0 * a * c;
    if value.abs() <= rounding {
        roots.push(extremum);
    } else if discriminant > 0.0 {
        let q = -0.5 * (b + discriminant.sqrt().copysign(b));
        let (one, other) = (q / c, a / q);
        roots.push(one.min(other));
        roots.push(one.max(other));
    } else if value.abs() <= allowed(slack, extremum) {
        roots.push(extremum);
    }
}

/// An extremum or an end of the range that holds all roots.
#[derive(Clone, Copy, Default)]
struct Station {
    x: f64,
    value: f64,
    /// 0 where the value drowns in rounding.
    sign: f64,
}

impl Station {
    fn new(p: &[f64], x: f64) -> Self {
        let (value, rounding) = evaluate(p, x);
        let sign = if value.abs() <= rounding {
            0.0
        } else {
            value.signum()
        };
        Self { x, value, sign }
    }
}

/// Roots of a cubic or quartic: one per change of sign between stations, one per extremum on the axis.
fn between_extrema(p: &[f64], slack: f64, roots: &mut Roots) {
    let degree = p.len() - 1;
    let mut slope = [0.0; 4];
    for (power, entry) in slope.iter_mut().enumerate().take(degree) {
        *entry = (power + 1) as f64 * p[power + 1];
    }
    let extrema = roots_of(&slope[..degree], 0.0);
    let bound = root_bound(p);
    let mut stations = [Station::default(); 5];
    let mut count = 0;
    let inside = extrema.as_slice().iter().copied().filter(|x| x.abs() < bound);
    for x in std::iter::once(-bound)
        .chain(inside)
        .chain(std::iter::once(bound))
    {
        stations[count] = Station::new(p, x);
        count += 1;
    }
    for i in 1..count {
        let (left, here) = (stations[i - 1], stations[i]);
        if left.sign * here.sign < 0.0 {
            roots.push(in_bracket(p, left, here));
        }
        if i + 1 < count && touches(left, here, stations[i + 1], slack) {
            roots.push(here.x);
        }
    }
}

/// Whether the extremum `here` lies on the axis, or misses it by no more than the slack.
fn touches(left: Station, here: Station, right: Station, slack: f64) -> bool {
    let level = here.value.abs();
    let nearest = here.sign * left.sign > 0.0
        && here.sign * right.sign > 0.0
        && level <= left.value.abs()
        && level <= right.value.abs();
    here.sign == 0.0 || (nearest && level <= allowed(slack, here.x))
}

fn allowed(slack: f64, x: f64) -> f64 {
    let square = 1.0 + x * x;
    slack * square * square
}

/// All roots lie within ± this (Fujiwara 1916), widened so that a root on the bound is inside.
fn root_bound(p: &[f64]) -> f64 {
    let degree = p.len() - 1;
    let mut bound = 0.0f64;
    for step in 1..=degree {
        let ratio = (p[degree - step] / p[degree]).abs();
        bound = bound.max(match step {
            1 => ratio,
            2 => ratio.sqrt(),
            3 => ratio.cbrt(),
            _ => ratio.sqrt().sqrt(),
        });
    }
    2.0 * bound * (1.0 + 1e-9) + f64::MIN_POSITIVE
}

/// The root between two stations of opposite sign: Newton's method, bisecting where it would leave the bracket or fails to
/// halve the step.
fn in_bracket(p: &[f64], left: Station, right: Station) -> f64 {
    let (mut low, mut high) = (left.x, right.x);
    let mut x = 0.5 * (low + high);
    let mut last_step = high - low;
    for _ in 0..MOST_ITERATIONS {
        let (value, slope) = value_and_slope(p, x);
        if value == 0.0 {
            return x;
        }
        if value.signum() * left.sign > 0.0 {
            low = x;
        } else {
            high = x;
        }
        let newton = x - value / slope;
        let stays = newton > low && newton < high;
        let next = if stays && (newton - x).abs() < 0.5 * last_step.abs() {
            newton
        } else {
            0.5 * (low + high)
        };
        last_step = next - x;
        x = next;
        if last_step.abs() <= f64::EPSILON * x.abs() {
            break;
        }
    }
    x
}

/// p(x) and the bound of its rounding error.
fn evaluate(p: &[f64], x: f64) -> (f64, f64) {
    let (mut value, mut size) = (0.0, 0.0);
    for c in p.iter().rev() {
        value = value * x + c;
        size = size * x.abs() + c.abs();
    }
    (value, EVALUATION_ROUNDING * size)
}

fn value_and_slope(p: &[f64], x: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for c in p.iter().rev() {
        slope = slope * x + value;
        value = value * x + c;
    }
    (value, slope)
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact zeros are part of the contract")]
mod tests {
    use super::*;

    /// SplitMix64 (Steele, Lea & Flood 2014).
    struct Draw(u64);

    impl Draw {
        fn within(&mut self, size: f64) -> f64 {
            self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 * size - size
        }
    }

    /// Multiplies `p` by `factor` (both ascending, the product must fit).
    fn times(p: &[f64; 5], factor: &[f64]) -> [f64; 5] {
        let mut product = [0.0; 5];
        for (i, a) in p.iter().enumerate() {
            for (j, b) in factor.iter().enumerate().filter(|(j, _)| i + j < 5) {
                product[i + j] += a * b;
            }
        }
        product
    }

    fn with_roots(scale: f64, roots: &[f64]) -> [f64; 5] {
        roots
            .iter()
            .fold([scale, 0.0, 0.0, 0.0, 0.0], |p, r| times(&p, &[-r, 1.0]))
    }

    fn assert_roots(p: &[f64; 5], expected: &[f64], tolerance: f64) {
        let mut expected = expected.to_vec();
        expected.sort_by(f64::total_cmp);
        let found = real_roots(p, 0.0);
        assert_eq!(
            found.as_slice().len(),
            expected.len(),
            "{p:?}: {found:?} for {expected:?}"
        );
        for (f, e) in found.as_slice().iter().zip(&expected) {
            assert!((f - e).abs() <= tolerance, "{p:?}: {found:?} for {expected:?}");
        }
    }

    /// Sorted values in ±3 at least `gap` apart.
    fn apart(draw: &mut Draw, count: usize, gap: f64) -> Vec<f64> {
        loop {
            let mut values: Vec<f64> = (0..count).map(|_| draw.within(3.0)).collect();
            values.sort_by(f64::total_cmp);
            if values.windows(2).all(|pair| pair[1] - pair[0] > gap) {
                return values;
            }
        }
    }

    #[test]
    fn simple_roots_of_every_degree() {
        let mut draw = Draw(0x1916);
        for _ in 0..2000 {
            for degree in 1..=4 {
                let roots = apart(&mut draw, degree, 0.05);
                let scale = draw.within(1.0) + 1.5;
                assert_roots(&with_roots(scale, &roots), &roots, 1e-9);
            }
        }
    }

    #[test]
    fn complex_pairs_are_left_out() {
        let mut draw = Draw(0x2020);
        for _ in 0..2000 {
            let (re, im) = (draw.within(2.0), 0.05 + draw.within(1.0).abs());
            let pair = [re * re + im * im, -2.0 * re, 1.0];
            let roots = apart(&mut draw, 2, 0.05);
            assert_roots(&times(&with_roots(1.0, &roots), &pair), &roots, 1e-9);
            let (re, im) = (draw.within(2.0), 0.05 + draw.within(1.0).abs());
            let other = [re * re + im * im, -2.0 * re, 1.0];
            assert_roots(
                &times(&times(&[1.0, 0.0, 0.0, 0.0, 0.0], &pair), &other),
                &[],
                0.0,
            );
        }
    }

    #[test]
    fn double_roots_are_found_once_or_as_two_that_rounding_cannot_tell_apart() {
        let mut draw = Draw(0x0d0b);
        for _ in 0..2000 {
            let roots = apart(&mut draw, 3, 0.2);
            let p = with_roots(1.0, &[roots[0], roots[1], roots[1], roots[2]]);
            let found = real_roots(&p, 1e-14);
            for root in &roots {
                assert!(
                    found.as_slice().iter().any(|f| (f - root).abs() < 1e-6),
                    "{found:?} {roots:?}"
                );
            }
            for f in found.as_slice() {
                assert!(
                    roots.iter().any(|root| (f - root).abs() < 1e-6),
                    "{found:?} {roots:?}"
                );
            }
        }
    }

    #[test]
    fn multiple_roots_that_are_exact_are_found_once() {
        assert_roots(&with_roots(1.0, &[0.5, 0.5, -2.0, 1.0]), &[-2.0, 0.5, 1.0], 1e-7);
        assert_roots(&with_roots(2.0, &[-1.0, -1.0, 1.0, 1.0]), &[-1.0, 1.0], 1e-7);
        assert_roots(&with_roots(1.0, &[0.5, 0.5, 0.5, 2.0]), &[0.5, 2.0], 1e-5);
        assert_roots(&with_roots(1.0, &[0.0, 0.0, 0.0, 0.0]), &[0.0], 0.0);
        assert_roots(&with_roots(1.0, &[0.0, 0.0, 1.0]), &[0.0, 1.0], 1e-15);
    }

    #[test]
    fn slack_takes_extrema_that_miss_the_axis() {
        // (x² − 1)² + h touches at ±1 if h does not exceed slack (1 + 1)².
        let miss = |h: f64| [1.0 + h, 0.0, -2.0, 0.0, 1.0];
        assert_eq!(real_roots(&miss(1e-10), 0.0).as_slice().len(), 0);
        assert_eq!(real_roots(&miss(3.9e-10), 1e-10).as_slice().len(), 2);
        assert_eq!(real_roots(&miss(4.1e-10), 1e-10).as_slice().len(), 0);
        // Slack does not merge roots that exist.
        assert_eq!(real_roots(&miss(-1e-10), 1e-9).as_slice().len(), 4);
    }

    #[test]
    fn vanishing_leading_coefficients_lower_the_degree() {
        assert_roots(&[-6.0, 5.0, -1.0, 0.0, 0.0], &[2.0, 3.0], 1e-15);
        assert_roots(&[-6.0, 5.0, -1.0, 0.0, 1e-20], &[2.0, 3.0], 1e-15);
        assert_roots(&[3.0, -2.0, 0.0, 0.0, 0.0], &[1.5], 0.0);
        assert_roots(&[1.0, 0.0, 0.0, 0.0, 0.0], &[], 0.0);
        assert_roots(&[0.0; 5], &[], 0.0);
        assert_roots(&[1.0, f64::NAN, 0.0, 0.0, 1.0], &[], 0.0);
    }

    #[test]
    fn roots_of_very_different_size() {
        let roots = [-1e4, -1e-4, 1e-2, 1e3];
        let found = real_roots(&with_roots(1.0, &roots), 0.0);
        assert_eq!(found.as_slice().len(), 4);
        for (f, e) in found.as_slice().iter().zip(&roots) {
            assert!((f / e - 1.0).abs() < 1e-9, "{found:?}");
        }
    }
}
