//! Sines and cosines of a whole array of joint angles.
//!
//! Optimisation: branch-free, so the compiler evaluates several angles at once. Reduction to [−π/4, π/4] by three parts of
//! π/2 (Cody & Waite 1980), then the minimax polynomials of FDLIBM (Sun Microsystems 1993, `k_sin.c`, `k_cos.c`).
//! Absolute error below 2.3e-16 for |angle| ≤ [`LARGEST_REDUCED_RAD`]; beyond that, and for anything not finite, the
//! standard library is used, so results are good everywhere.

/// The product of the quotient (20 bits here) with a 33-bit part of π/2 is exact up to this angle (rad).
const LARGEST_REDUCED_RAD: f64 = 1.0e6;

const HALF_PI: [f64; 3] = [
    1.570_796_326_734_125_6,
    6.077_100_506_303_966e-11,
    2.022_266_248_795_950_7e-21,
];
/// Adding and subtracting 1.5 · 2⁵² rounds to the nearest integer and leaves it in the low bits.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

const SINE: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_007e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
const COSINE: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

use crate::spatial::lane::mul_add;

/// Writes `sine[i] = sin(angle[i])` and `cosine[i] = cos(angle[i])`; the three slices have equal length.
#[inline(always)]
pub(crate) fn sin_cos_into<const FMA: bool>(angle: &[f64], sine: &mut [f64], cosine: &mut [f64]) {
    let mut largest = 0.0f64;
    for ((&x, s), c) in angle.iter().zip(sine.iter_mut()).zip(cosine.iter_mut()) {
        largest = largest.max(x.abs());
        let shifted = mul_add::<FMA>(x, std::f64::consts::FRAC_2_PI, ROUNDING);
        let quadrant = shifted.to_bits();
        let n = shifted - ROUNDING;
        let reduced = |r: f64, part: f64| mul_add::<FMA>(-n, part, r);
        let r = reduced(reduced(reduced(x, HALF_PI[0]), HALF_PI[1]), HALF_PI[2]);
        let z = r * r;
        let poly = |first: f64, rest: &[f64]| {
            rest.iter()
                .fold(first, |sum, coefficient| mul_add::<FMA>(sum, z, *coefficient))
        };
        let sin_poly = poly(SINE[5], &[SINE[4], SINE[3], SINE[2], SINE[1], SINE[0]]);
        let sin_r = mul_add::<FMA>(r * z, sin_poly, r);
        let cos_poly = poly(
            COSINE[5],
            &[COSINE[4], COSINE[3], COSINE[2], COSINE[1], COSINE[0]],
        );
        let cos_r = 1.0 - mul_add::<FMA>(-z * z, cos_poly, 0.5 * z);
        // Odd quadrants swap the two; sin changes sign in quadrants 2, 3 and cos in 1, 2.
        let swap = (quadrant & 1).wrapping_neg();
        let (sin_bits, cos_bits) = (sin_r.to_bits(), cos_r.to_bits());
        let sin_sign = (quadrant & 2) << 62;
        let cos_sign = (quadrant.wrapping_add(1) & 2) << 62;
        *s = f64::from_bits(((sin_bits & !swap) | (cos_bits & swap)) ^ sin_sign);
        *c = f64::from_bits(((cos_bits & !swap) | (sin_bits & swap)) ^ cos_sign);
    }
    // `max` drops NaN, whose sine and cosine above are NaN already.
    if largest > LARGEST_REDUCED_RAD {
        for ((&x, s), c) in angle.iter().zip(sine).zip(cosine) {
            (*s, *c) = x.sin_cos();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn check(angles: &[f64]) {
        let mut s = vec![0.0; angles.len()];
        let mut c = vec![0.0; angles.len()];
        // Fused products work on any machine, slowly where it lacks the instruction.
        for fused in [false, true] {
            if fused {
                sin_cos_into::<true>(angles, &mut s, &mut c);
            } else {
                sin_cos_into::<false>(angles, &mut s, &mut c);
            }
            compare(angles, &s, &c);
        }
    }

    fn compare(angles: &[f64], s: &[f64], c: &[f64]) {
        for ((x, s), c) in angles.iter().zip(s).zip(c) {
            assert!(
                (s - x.sin()).abs() <= 2.3e-16 && (c - x.cos()).abs() <= 2.3e-16,
                "at {x}: {s} {c}"
            );
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_standard_library(angles in prop::collection::vec(-1.0e4..1.0e4f64, 1..40)) {
            check(&angles);
            check(&angles.iter().map(|x| x * 1e-4).collect::<Vec<_>>());
        }
    }

    #[test]
    fn special_angles() {
        let quarter = std::f64::consts::FRAC_PI_4;
        check(&(-40..40).map(|k| f64::from(k) * quarter).collect::<Vec<_>>());
        check(&[0.0, -0.0, 1e-300, 9.9e5, 1e7, -1e15]);
        let (mut s, mut c) = ([0.0; 3], [0.0; 3]);
        sin_cos_into::<false>(&[f64::NAN, f64::INFINITY, 0.5], &mut s, &mut c);
        assert!(s[0].is_nan() && c[0].is_nan() && s[1].is_nan() && (s[2] - 0.5f64.sin()).abs() < 1e-15);
    }
}
