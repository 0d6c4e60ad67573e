//! Preview control of the zero-moment point of a cart on a table: which way the centre of mass has to go so that the
//! zero-moment point is where the feet will be.
//!
//! The whole mass moves in the plane z = z_c; along each horizontal axis its state is `x = (position, velocity,
//! acceleration)`, the input u its jerk, constant over a period T, and the output the zero-moment point (Kajita et al. 2003,
//! *Biped walking pattern generation by using preview control of zero-moment point*, eqs. (6), (9) and (10)):
//!
//! ```text
//! x⁺ = A x + B u,   p = C x,   A = [1 T T²/2; 0 1 T; 0 0 1],   B = (T³/6, T²/2, T),   C = (1, 0, −z_c/g).
//! ```
//!
//! With the error e = p − p_ref the controller minimises `Σ Q_e e² + Q_x |Δx|² + R Δu²`, eq. (11), where Δ is the difference to
//! the period before. The state (e, Δx) obeys `Ã = [1 CA; 0 A]`, `B̃ = (CB, B)`; with the solution P of its discrete algebraic
//! Riccati equation the optimal increment is (Katayama et al. 1985)
//!
//! ```text
//! Δu_k = −G_i e_k − G_x Δx_k − Σ_{i=1..N} G_i^d Δp_ref,k+i,
//! ```
//!
//! and the reference stands still beyond the N samples that are known.
//!
//! Deviation: Kajita's eq. (12) is the sum of this over k, `u_k = −G_i Σe − G_x x_k − Σ G_i^d p_ref,k+i`. Both are equal if the
//! reference rests for the first N samples. If it moves at once the sum, which then counts a past that never was, throws the
//! zero-moment point off by up to 35 mm at the beginning of a walk of the small humanoid, the increments by 7 mm; and the sum
//! depends on where the origin is, because N gains do not add up to `−G_x` of the position.

use ik_core::kinematics::gravity::GRAVITY_M_S2;
use nalgebra::{Matrix3, Matrix4, RowVector3, RowVector4, Vector3, Vector4};

/// Relative change of P at which the recursion has settled: rounding of a few products of 4 × 4 matrices.
const SETTLED: f64 = 1e-13;
/// Recursions tried. Weights of walks need a few hundred.
const MOST_RECURSIONS: u32 = 200_000;

/// The cart, and what its controller is weighed by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CartTable {
    /// Period T (s).
    pub dt_s: f64,
    /// Height of the centre of mass, z_c (m).
    pub height_m: f64,
    /// Weight of the error of the zero-moment point, Q_e (1/m²).
    pub zmp_error_weight: f64,
    /// Weight of the increments of position, velocity and acceleration, Q_x.
    pub state_weight: f64,
    /// Weight of the increment of the jerk, R (s⁶/m²).
    pub jerk_weight: f64,
}

/// The Riccati recursion gave no gains.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum NoGains {
    /// It did not settle.
    #[error(
        "no gains: the Riccati recursion did not settle in {MOST_RECURSIONS} steps, its last change was {change:e}"
    )]
    Unsettled {
        /// Relative change in the last recursion.
        change: f64,
    },
    /// It settled where the cart runs away. Without a weight on the jerk `P = Q̃` is a solution, which zeroes the next error
    /// whatever becomes of the cart; a weight too small to be seen beside `B̃ᵀPB̃` does not lead away from it.
    #[error("no gains: with them the cart runs away, its largest eigenvalue being {eigenvalue}")]
    Unstable {
        /// Largest magnitude of an eigenvalue of the closed loop.
        eigenvalue: f64,
    },
}

/// Gains, made once per walk.
#[derive(Clone, Debug, PartialEq)]
pub struct PreviewControl {
    cart: CartTable,
    /// G_i, on the error.
    pub error_gain: f64,
    /// G_x, on the increment of the state.
    pub state_gain: RowVector3<f64>,
    /// G_i^d for i = 1 … N, on the increments of the reference.
    pub preview_gains: Vec<f64>,
}

impl CartTable {
    fn a(&self) -> Matrix3<f64> {
        let t = self.dt_s;
        Matrix3::new(1.0, t, t * t / 2.0, 0.0, 1.0, t, 0.0, 0.0, 1.0)
    }

    fn b(&self) -> Vector3<f64> {
        let t = self.dt_s;
        Vector3::new(t * t * t / 6.0, t * t / 2.0, t)
    }

    fn c(&self) -> RowVector3<f64> {
        RowVector3::new(1.0, 0.0, -self.height_m / GRAVITY_M_S2)
    }

    /// Zero-moment point of a state (m).
    pub fn zmp_m(&self, state: &Vector3<f64>) -> f64 {
        (self.c() * state).x
    }

    /// The state after `tau_s` of constant jerk (m/s³).
    pub fn after(&self, state: &Vector3<f64>, jerk: f64, tau_s: f64) -> Vector3<f64> {
        let part = Self { dt_s: tau_s, ..*self };
        part.a() * state + part.b() * jerk
    }

    /// Ã, B̃ and the diagonal of Q̃ of the state (e, Δx).
    fn with_error(&self) -> (Matrix4<f64>, Vector4<f64>, Vector4<f64>) {
        let (ca, cb) = (self.c() * self.a(), (self.c() * self.b()).x);
        let mut a = Matrix4::zeros();
        a[(0, 0)] = 1.0;
        a.fixed_view_mut::<1, 3>(0, 1).copy_from(&ca);
        a.fixed_view_mut::<3, 3>(1, 1).copy_from(&self.a());
        let b = self.b();
        let b = Vector4::new(cb, b.x, b.y, b.z);
        let q = self.state_weight;
        (a, b, Vector4::new(self.zmp_error_weight, q, q, q))
    }
}

/// `Ã − B̃ K` with the gain K of one step of the recursion, `K = (R + B̃ᵀPB̃)⁻¹ B̃ᵀPÃ`.
fn gain(p: &Matrix4<f64>, a: &Matrix4<f64>, b: &Vector4<f64>, r: f64) -> RowVector4<f64> {
    b.transpose() * p * a / (r + (b.transpose() * p * b).x)
}

/// The solution P of `P = Q̃ + ÃᵀP(Ã − B̃K)`, as the limit of that recursion from Q̃ (value iteration).
fn riccati(a: &Matrix4<f64>, b: &Vector4<f64>, q: &Vector4<f64>, r: f64) -> Result<Matrix4<f64>, NoGains> {
    let q = Matrix4::from_diagonal(q);
    let (mut p, mut change) = (q, f64::INFINITY);
    for _ in 0..MOST_RECURSIONS {
        let next = q + a.transpose() * p * (a - b * gain(&p, a, b, r));
        // Rounding must not break the symmetry.
        let next = (next + next.transpose()) * 0.5;
        change = (next - p).amax() / next.amax();
        p = next;
        if change < SETTLED {
            return Ok(p);
        }
    }
    Err(NoGains::Unsettled { change })
}

impl PreviewControl {
    /// The gains for a preview of `samples` periods.
    ///
    /// # Errors
    /// Weights so far apart that the Riccati recursion does not settle, or not on gains that hold the cart.
    pub fn new(cart: CartTable, samples: usize) -> Result<Self, NoGains> {
        let (a, b, q) = cart.with_error();
        let r = cart.jerk_weight;
        let p = riccati(&a, &b, &q, r)?;
        let k = gain(&p, &a, &b, r);
        let scale = 1.0 / (r + (b.transpose() * p * b).x);
        let closed = (a - b * k).transpose();
        let eigenvalue = closed.complex_eigenvalues().map(|z| z.norm()).amax();
        if eigenvalue.is_nan() || eigenvalue >= 1.0 {
            return Err(NoGains::Unstable { eigenvalue });
        }
        let mut preview_gains = Vec::with_capacity(samples);
        // An increment of the reference i periods ahead is one of the error with the opposite sign: it acts through
        // P (−1, 0, 0, 0) now, and through (Ã − B̃K)ᵀ once per period in between.
        let mut costate = p * Vector4::new(-1.0, 0.0, 0.0, 0.0);
        for _ in 0..samples {
            preview_gains.push(scale * b.dot(&costate));
            costate = closed * costate;
        }
        Ok(Self {
            cart,
            error_gain: k.x,
            state_gain: k.fixed_columns::<3>(1).into_owned(),
            preview_gains,
        })
    }

    /// The motion of a cart that stands at the first reference, over the periods of `reference` (m): one state and the
    /// jerk that follows it for each sample.
    pub fn follow(&self, reference: &[f64]) -> Vec<(Vector3<f64>, f64)> {
        let at = |k: usize| reference.get(k).or(reference.last()).copied().unwrap_or(0.0);
        let mut state = Vector3::new(at(0), 0.0, 0.0);
        let (mut before, mut jerk) = (state, 0.0);
        let mut motion = Vec::with_capacity(reference.len());
        for k in 0..reference.len() {
            let ahead = self.preview_gains.iter().zip(k + 1..);
            let ahead: f64 = ahead.map(|(gain, i)| gain * (at(i) - at(i - 1))).sum();
            let error = self.cart.zmp_m(&state) - at(k);
            jerk -= self.error_gain * error + (self.state_gain * (state - before)).x + ahead;
            motion.push((state, jerk));
            before = state;
            state = self.cart.after(&state, jerk, self.cart.dt_s);
        }
        motion
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CART: CartTable = CartTable {
        dt_s: 0.01,
        height_m: 0.269_672,
        zmp_error_weight: 1.0,
        state_weight: 0.0,
        jerk_weight: 1e-6,
    };

    /// The doubling algorithm (Chu, Fan, Lin & Wang 2004), which squares the closed loop in every step, against value iteration.
    #[test]
    fn the_riccati_equation_is_solved() {
        for cart in [
            CART,
            CartTable {
                height_m: 0.8,
                state_weight: 1e-4,
                ..CART
            },
            CartTable { dt_s: 0.05, ..CART },
        ] {
            let (a, b, q) = cart.with_error();
            let r = cart.jerk_weight;
            let p = riccati(&a, &b, &q, r).unwrap();
            let residual = Matrix4::from_diagonal(&q) + a.transpose() * p * (a - b * gain(&p, &a, &b, r)) - p;
            assert!(
                residual.amax() < 1e-11 * p.amax(),
                "{}",
                residual.amax() / p.amax()
            );
            let (mut a, mut g, mut h) = (a, b * b.transpose() / r, Matrix4::from_diagonal(&q));
            for _ in 0..60 {
                let w = (Matrix4::identity() + g * h).try_inverse().unwrap();
                let next_g = g + a * w * g * a.transpose();
                let next_h = h + a.transpose() * h * w * a;
                (a, g, h) = (a * w * a, next_g, next_h);
            }
            // Doubling starts from B̃B̃ᵀ/R, 1e6 times larger than what is left of it: so many digits go.
            assert!((h - p).amax() < 1e-6 * p.amax(), "{}", (h - p).amax() / p.amax());
        }
    }

    #[test]
    fn gains_that_let_the_cart_run_away_are_refused() {
        for jerk_weight in [1e4, 1e-2, 1e-10, 1e-16] {
            assert!(PreviewControl::new(CartTable { jerk_weight, ..CART }, 10).is_ok());
        }
        for jerk_weight in [1e-18, 1e-24, 1e-300] {
            let Err(NoGains::Unstable { eigenvalue }) =
                PreviewControl::new(CartTable { jerk_weight, ..CART }, 10)
            else {
                panic!("{jerk_weight:e} is accepted");
            };
            // The zero of the cart outside the unit circle, exp(T √(g / z_c)) but for the sampling.
            assert!((eigenvalue - 1.062).abs() < 1e-3, "{eigenvalue}");
        }
    }
}
