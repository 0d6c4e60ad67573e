//! SO(3): exponential, logarithm and their Jacobians.
//!
//! Source: Chirikjian (2012), Stochastic Models, Information Theory, and Lie Groups, vol. 2, eq. (10.86); Solà,
//! Deray, Atchuthan (2018), A micro Lie theory, eqs. (143)–(146). All increments act from the left.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Below this squared angle (rad²) the coefficients are taken from their Taylor series. With three terms the series is
/// exact to rounding up to θ² ≈ (1e-16 · 8!)^(1/3), and at θ² = 1e-4 the closed forms lose about 1e-16/θ² · θ² of the
/// result, so both branches are accurate where they meet.
const SMALL_ANGLE_SQUARED: f64 = 1e-4;

/// The matrix `[a]ₓ` with `[a]ₓ b = a × b`.
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// The unit quaternion of a rotation vector `phi` (rad).
pub fn exp_quaternion(phi: &Vector3<f64>) -> UnitQuaternion<f64> {
    let angle_squared = phi.norm_squared();
    let (half_sinc, cosine) = if angle_squared < SMALL_ANGLE_SQUARED {
        let t = angle_squared;
        (0.5 - t / 48.0 + t * t / 3840.0, 1.0 - t / 8.0 + t * t / 384.0)
    } else {
        let angle = angle_squared.sqrt();
        let (sine, cosine) = (0.5 * angle).sin_cos();
        (sine / angle, cosine)
    };
    UnitQuaternion::new_normalize(Quaternion::from_parts(cosine, phi * half_sinc))
}

/// The rotation matrix `exp([phi]ₓ)` of a rotation vector (rad).
pub fn exp(phi: &Vector3<f64>) -> Matrix3<f64> {
    exp_quaternion(phi).to_rotation_matrix().into_inner()
}

/// The rotation vector (rad, norm in [0, π]) of a unit quaternion; `q` and `−q` give the same vector.
pub fn log_quaternion(q: &UnitQuaternion<f64>) -> Vector3<f64> {
    let (imaginary, real) = if q.w < 0.0 {
        (-q.imag(), -q.w)
    } else {
        (q.imag(), q.w)
    };
    let norm_squared = imaginary.norm_squared();
    if norm_squared < SMALL_ANGLE_SQUARED {
        // atan(s/w)/s with s = |imaginary|, w² = 1 − s²: series of asin(s)/s.
        let t = norm_squared;
        imaginary
            * (2.0 * (1.0 + t * (1.0 / 6.0 + t * (3.0 / 40.0 + t * (15.0 / 336.0 + t * 105.0 / 3456.0)))))
    } else {
        let norm = norm_squared.sqrt();
        imaginary * (2.0 * norm.atan2(real) / norm)
    }
}

/// The rotation vector (rad, norm in [0, π]) of a rotation matrix, accurate at every angle including π.
pub fn log(r: &Matrix3<f64>) -> Vector3<f64> {
    log_quaternion(&quaternion(r))
}

/// The unit quaternion of a rotation matrix (Shepperd 1978: the largest of the four squares is the divisor).
pub fn quaternion(r: &Matrix3<f64>) -> UnitQuaternion<f64> {
    let (a, b, c) = (r[(0, 0)], r[(1, 1)], r[(2, 2)]);
    let (w, i, j, k) = if a + b + c >= a.max(b).max(c) {
        (
            1.0 + a + b + c,
            r[(2, 1)] - r[(1, 2)],
            r[(0, 2)] - r[(2, 0)],
            r[(1, 0)] - r[(0, 1)],
        )
    } else if a >= b && a >= c {
        (
            r[(2, 1)] - r[(1, 2)],
            1.0 + a - b - c,
            r[(1, 0)] + r[(0, 1)],
            r[(0, 2)] + r[(2, 0)],
        )
    } else if b >= c {
        (
            r[(0, 2)] - r[(2, 0)],
            r[(1, 0)] + r[(0, 1)],
            1.0 - a + b - c,
            r[(2, 1)] + r[(1, 2)],
        )
    } else {
        (
            r[(1, 0)] - r[(0, 1)],
            r[(0, 2)] + r[(2, 0)],
            r[(2, 1)] + r[(1, 2)],
            1.0 - a - b + c,
        )
    };
    UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k))
}

/// `(1 − (θ/2) cot(θ/2)) / θ²` and its derivative with respect to θ².
fn inverse_jacobian_coefficient(angle_squared: f64) -> (f64, f64) {
    let t = angle_squared;
    if t < SMALL_ANGLE_SQUARED {
        return (
            1.0 / 12.0 + t * (1.0 / 720.0 + t / 30240.0),
            1.0 / 720.0 + t * (1.0 / 15120.0 + t / 403_200.0),
        );
    }
    let angle = t.sqrt();
    let (sine, cosine) = (0.5 * angle).sin_cos();
    let half_cotangent = 0.5 * angle * cosine / sine;
    let coefficient = (1.0 - half_cotangent) / t;
    // d(½θ cot ½θ)/dθ² = (cot(½θ)/(4θ) − 1/(8 sin²(½θ))).
    let slope = cosine / (4.0 * angle * sine) - 1.0 / (8.0 * sine * sine);
    (coefficient, (-slope - coefficient) / t)
}

/// Left Jacobian `J_l(phi)`: a rotation `exp(phi)` whose rotation vector changes at `phi_dot` turns at the world angular
/// velocity `J_l(phi) phi_dot`.
pub fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let t = phi.norm_squared();
    let (a, b) = if t < SMALL_ANGLE_SQUARED {
        (
            0.5 - t * (1.0 / 24.0 - t / 720.0),
            1.0 / 6.0 - t * (1.0 / 120.0 - t / 5040.0),
        )
    } else {
        let angle = t.sqrt();
        ((1.0 - angle.cos()) / t, (angle - angle.sin()) / (t * angle))
    };
    let s = skew(phi);
    Matrix3::identity() + s * a + s * s * b
}

/// Inverse left Jacobian `J_l⁻¹(phi)`: `log(exp(δ) exp(phi)) = phi + J_l⁻¹(phi) δ + O(δ²)`.
///
/// Its transpose is the inverse right Jacobian. Singular at |phi| = 2π, which `log` never returns.
pub fn left_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let (coefficient, _) = inverse_jacobian_coefficient(phi.norm_squared());
    let s = skew(phi);
    Matrix3::identity() - s * 0.5 + s * s * coefficient
}

/// Derivative of [`left_jacobian_inverse`] at `phi` in direction `phi_dot`.
pub fn left_jacobian_inverse_derivative(phi: &Vector3<f64>, phi_dot: &Vector3<f64>) -> Matrix3<f64> {
    let (coefficient, slope) = inverse_jacobian_coefficient(phi.norm_squared());
    let (s, s_dot) = (skew(phi), skew(phi_dot));
    let coefficient_dot = 2.0 * slope * phi.dot(phi_dot);
    s_dot * -0.5 + s * s * coefficient_dot + (s_dot * s + s * s_dot) * coefficient
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0, -12.0..0.0).prop_map(move |(x, y, z, e): (f64, f64, f64, f64)| {
            let v = Vector3::new(x, y, z);
            v * (limit * 10f64.powf(0.5 * e) / v.norm().max(1e-3)).min(limit)
        })
    }

    proptest! {
        #[test]
        fn log_inverts_exp_at_every_scale(phi in vector(std::f64::consts::PI)) {
            prop_assert!((log(&exp(&phi)) - phi).norm() <= 1e-14 + 1e-13 * phi.norm() || phi.norm() > 3.1);
            prop_assert!((exp(&log(&exp(&phi))) - exp(&phi)).norm() < 1e-13);
        }

        #[test]
        fn the_left_jacobian_is_the_inverse_of_its_inverse(phi in vector(3.0)) {
            let product = left_jacobian(&phi) * left_jacobian_inverse(&phi);
            prop_assert!((product - Matrix3::identity()).norm() < 1e-13);
        }

        #[test]
        fn exp_agrees_with_rodrigues(phi in vector(3.0)) {
            let angle = phi.norm();
            let s = skew(&phi);
            let rodrigues = if angle < 1e-6 {
                Matrix3::identity() + s + s * s * 0.5
            } else {
                Matrix3::identity() + s * (angle.sin() / angle) + s * s * ((1.0 - angle.cos()) / (angle * angle))
            };
            prop_assert!((exp(&phi) - rodrigues).norm() < 1e-14);
        }

        #[test]
        fn inverse_jacobian_is_the_derivative_of_log(phi in vector(3.0), d in vector(1.0)) {
            let h = 1e-5;
            let d = d.normalize();
            let plus = log(&(exp(&(d * h)) * exp(&phi)));
            let minus = log(&(exp(&(d * -h)) * exp(&phi)));
            let numeric = (plus - minus) / (2.0 * h);
            prop_assert!((left_jacobian_inverse(&phi) * d - numeric).norm() < 1e-8);
        }

        #[test]
        fn inverse_jacobian_derivative_matches_differences(phi in vector(3.0), d in vector(1.0)) {
            let h = 1e-5;
            let numeric = (left_jacobian_inverse(&(phi + d * h)) - left_jacobian_inverse(&(phi - d * h))) / (2.0 * h);
            prop_assert!((left_jacobian_inverse_derivative(&phi, &d) - numeric).norm() < 1e-8);
        }
    }

    #[test]
    fn log_is_exact_at_half_a_turn_and_at_zero() {
        for axis in [
            Vector3::x(),
            Vector3::y(),
            Vector3::z(),
            Vector3::new(1.0, 2.0, -2.0) / 3.0,
        ] {
            let phi = axis * std::f64::consts::PI;
            assert!((log(&exp(&phi)).norm() - std::f64::consts::PI).abs() < 1e-14);
            assert!((exp(&log(&exp(&phi))) - exp(&phi)).norm() < 1e-14);
        }
        assert_eq!(log(&Matrix3::identity()), Vector3::zeros());
        assert_eq!(left_jacobian_inverse(&Vector3::zeros()), Matrix3::identity());
    }
}
