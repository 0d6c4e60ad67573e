//! The equation for t4 when axes 5 and 6 neither meet nor run parallel: both t5 equations enter, squared and summed.

use super::REACH_TOLERANCE_M;
use super::angle::{Angle, Harmonic};

/// Newton steps on the trigonometric equation after the quartic.
const POLISHING_STEPS: usize = 2;

/// s² F² + a² G² − a² s² (|u|² − u_z²) = 0 with a = a5, s = sin α5.
pub(super) struct TrigonometricEquation {
    /// a5 and sin α5.
    pub(super) a: f64,
    pub(super) s: f64,
    /// F and G.
    pub(super) f: Harmonic,
    pub(super) g: Harmonic,
    /// |u|² and u_z.
    pub(super) square: Harmonic,
    pub(super) u_z: Harmonic,
}

impl TrigonometricEquation {
    fn value(&self, cos: f64, sin: f64) -> f64 {
        let (f, g) = (self.s * self.f.at(cos, sin), self.a * self.g.at(cos, sin));
        let u_z = self.u_z.at(cos, sin);
        let scale = self.a * self.s;
        f * f + g * g - scale * scale * (self.square.at(cos, sin) - u_z * u_z)
    }

    fn slope(&self, cos: f64, sin: f64) -> f64 {
        let (a, s) = (self.a * self.a, self.s * self.s);
        2.0 * s * self.f.at(cos, sin) * self.f.slope(cos, sin)
            + 2.0 * a * self.g.at(cos, sin) * self.g.slope(cos, sin)
            - a * s * self.square.slope(cos, sin)
            + 2.0 * a * s * self.u_z.at(cos, sin) * self.u_z.slope(cos, sin)
    }

    /// Bound of the change of the equation where it has a solution (|F| ≤ |a| |m|, |G| ≤ |s| |m|) when w moves by the
    /// tolerance of reach.
    pub(super) fn slack(&self, distance: f64, size: f64) -> f64 {
        let (a, s) = (self.a.abs(), self.s.abs());
        2.0 * REACH_TOLERANCE_M * a * s * size * (s * distance + a)
    }

    /// Cosine and sine of an angle τ₀, and the quartic in tan((τ − τ₀)/2), which has no root at infinity.
    ///
    /// Half-angle tangents lose a root at τ₀ + π and digits next to it, so τ₀ is opposite to the place among five where
    /// the equation is farthest from zero: five values determine it, so the largest is never small.
    pub(super) fn half_angle_quartic(&self) -> ((f64, f64), [f64; 5]) {
        let mut start = (1.0, 0.0);
        let mut largest = 0.0;
        for (cos, sin) in FIFTHS {
            let value = self.value(cos, sin).abs();
            if value > largest {
                (start, largest) = ((-cos, -sin), value);
            }
        }
        let turned = |h: &Harmonic| Harmonic {
            one: h.one,
            cos: h.cos * start.0 + h.sin * start.1,
            sin: h.sin * start.0 - h.cos * start.1,
        };
        let (f, g, square, z) = (
            turned(&self.f),
            turned(&self.g),
            turned(&self.square),
            turned(&self.u_z),
        );
        let (aa, ss) = (self.a * self.a, self.s * self.s);
        // Coefficients of 1, cos, sin, cos², cos sin, sin².
        let both = aa * ss;
        let one = ss * f.one * f.one + aa * g.one * g.one - both * (square.one - z.one * z.one);
        let cos = 2.0 * (ss * f.one * f.cos + aa * g.one * g.cos + both * (z.one * z.cos - 0.5 * square.cos));
        let sin = 2.0 * (ss * f.one * f.sin + aa * g.one * g.sin + both * (z.one * z.sin - 0.5 * square.sin));
        let cos2 = ss * f.cos * f.cos + aa * g.cos * g.cos + both * z.cos * z.cos;
        let mixed = 2.0 * (ss * f.cos * f.sin + aa * g.cos * g.sin + both * z.cos * z.sin);
        let sin2 = ss * f.sin * f.sin + aa * g.sin * g.sin + both * z.sin * z.sin;
        let coefficients = [
            one + cos + cos2,
            2.0 * (sin + mixed),
            2.0 * (one - cos2) + 4.0 * sin2,
            2.0 * (sin - mixed),
            one - cos + cos2,
        ];
        (start, coefficients)
    }

    fn curvature(&self, cos: f64, sin: f64) -> f64 {
        let (a, s) = (self.a * self.a, self.s * self.s);
        let squares = |h: &Harmonic| h.slope(cos, sin).powi(2) - h.at(cos, sin) * (h.at(cos, sin) - h.one);
        2.0 * s * squares(&self.f)
            + 2.0 * a * squares(&self.g)
            + a * s * (self.square.at(cos, sin) - self.square.one)
            + 2.0 * a * s * squares(&self.u_z)
    }

    /// Two angles in place of a root of the quartic that is in truth an extremum beyond the axis: with small a5 or sin α5
    /// pairs of roots come so close that the expanded polynomial cannot tell them apart, but this equation can.
    pub(super) fn split(&self, root: Angle) -> (Angle, Option<Angle>) {
        let value = self.value(root.cos, root.sin);
        let slope = self.slope(root.cos, root.sin);
        let curvature = self.curvature(root.cos, root.sin);
        let product = value * curvature;
        let beyond = product < 0.0 && slope * slope < -2.0 * product;
        if !beyond {
            return (root, None);
        }
        let half = (slope * slope - 2.0 * product).sqrt() / curvature.abs();
        let middle = root.value - slope / curvature;
        (Angle::new(middle + half), Some(Angle::new(middle - half)))
    }

    /// Newton steps on the equation itself, as long as they bring it closer to zero.
    pub(super) fn polished(&self, mut tau: Angle) -> Angle {
        let mut value = self.value(tau.cos, tau.sin);
        for _ in 0..POLISHING_STEPS {
            let step = -value / self.slope(tau.cos, tau.sin);
            let next = Angle::new(tau.value + step);
            let next_value = self.value(next.cos, next.sin);
            // Also false for NaN, at a double root.
            let closer = next_value.abs() < value.abs();
            if !closer {
                break;
            }
            (tau, value) = (next, next_value);
        }
        tau
    }
}

/// Cosines and sines of the multiples of 72°.
const FIFTHS: [(f64, f64); 5] = [
    (1.0, 0.0),
    (0.309_016_994_374_947_45, 0.951_056_516_295_153_5),
    (-0.809_016_994_374_947_5, 0.587_785_252_292_473_1),
    (-0.809_016_994_374_947_5, -0.587_785_252_292_473_1),
    (0.309_016_994_374_947_45, -0.951_056_516_295_153_5),
];
