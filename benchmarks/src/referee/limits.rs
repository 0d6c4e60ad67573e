//! Joint boundaries as conditions on a position and the velocity that led to it, evaluated as printed; the
//! intervals that methods are given are solved from them elsewhere and are not used here.

use ik_core::boundary::Boundary;
use ik_core::robot::Limits;

/// Amount by which a position exceeds its limits (rad or m), 0 inside.
pub(super) fn position_violation(limits: &Limits, q: f64) -> f64 {
    (limits.lower - q).max(q - limits.upper).max(0.0)
}

/// Faraji & Ijspeert (2017), eq. (6):
/// `g = (2q − (ql + qu))² / (qu − ql − 2 qs)² + q̇² / q̇max² − 1`, at most 0 inside the ellipse.
///
/// The margin is that of the problem's ellipse, zero for other boundaries. None for a joint without finite
/// position or velocity limits.
pub(super) fn ellipse_value(boundary: &Boundary, limits: &Limits, q: f64, velocity: f64) -> Option<f64> {
    let margin = match *boundary {
        Boundary::Ellipse { margin } => margin,
        _ => 0.0,
    };
    let range = limits.upper - limits.lower - 2.0 * margin;
    // A joint without room or speed has no ellipse: the value would be infinite or undefined.
    let bounded = range.is_finite() && range > 0.0 && limits.velocity.is_finite() && limits.velocity > 0.0;
    bounded.then(|| {
        ((2.0 * q - (limits.lower + limits.upper)) / range).powi(2) + (velocity / limits.velocity).powi(2)
            - 1.0
    })
}

/// Amount (rad or m) by which `velocity · dt` leaves the polygon `q̇ ≤ min(κ r, κ s + v0)`, `−q̇ ≤ min(κ s, κ
/// r + v0)`, `|q̇| ≤ q̇max`, with s and r the distances of q from the lower and the upper limit. None for
/// other boundaries.
pub(super) fn polygon_excess(
    boundary: &Boundary,
    limits: &Limits,
    q: f64,
    velocity: f64,
    dt_s: f64,
) -> Option<f64> {
    let Boundary::Polygon {
        approach_per_s: kappa,
        exit_speed: v0,
    } = *boundary
    else {
        return None;
    };
    let (s, r) = (q - limits.lower, limits.upper - q);
    let up = (kappa * r).min(kappa * s + v0).min(limits.velocity);
    let down = (kappa * s).min(kappa * r + v0).min(limits.velocity);
    Some((velocity - up).max(-velocity - down).max(0.0) * dt_s)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::float_cmp, reason = "values chosen to be exact")]
    use super::*;

    const KNEE: Limits = Limits {
        lower: 0.0,
        upper: 2.0,
        velocity: 4.0,
        effort: 50.0,
    };

    #[test]
    fn the_ellipse_passes_through_the_points_read_off_its_equation() {
        let g = |q, v| ellipse_value(&Boundary::Box, &KNEE, q, v).unwrap();
        assert_eq!(g(1.0, 0.0), -1.0);
        assert_eq!(g(1.0, 4.0), 0.0);
        assert_eq!((g(0.0, 0.0), g(2.0, 0.0)), (0.0, 0.0));
        // (2·1.5 − 2)²/2² + (2/4)² − 1 = 1/4 + 1/4 − 1.
        assert_eq!(g(1.5, -2.0), -0.5);
        assert_eq!(g(2.0, 4.0), 1.0);
        assert_eq!(g(3.0, 0.0), 3.0);
    }

    #[test]
    fn a_margin_shortens_the_range() {
        let with = |q| ellipse_value(&Boundary::Ellipse { margin: 0.5 }, &KNEE, q, 0.0).unwrap();
        assert_eq!((with(0.5), with(1.5)), (0.0, 0.0));
        assert_eq!(with(0.0), 3.0);
    }

    #[test]
    fn a_joint_without_limits_has_no_ellipse() {
        assert_eq!(ellipse_value(&Boundary::Box, &Limits::UNLIMITED, 1.0, 1.0), None);
        let endless = Limits {
            velocity: f64::INFINITY,
            ..KNEE
        };
        assert_eq!(ellipse_value(&Boundary::Box, &endless, 1.0, 1.0), None);
    }

    #[test]
    fn polygon_excess_on_each_side() {
        let polygon = Boundary::Polygon {
            approach_per_s: 8.0,
            exit_speed: 0.25,
        };
        let excess = |q, v| polygon_excess(&polygon, &KNEE, q, v, 0.5).unwrap();
        assert_eq!(excess(1.0, 4.0), 0.0);
        assert_eq!(excess(1.0, 5.0), 0.5);
        // At s = 0.125 an approach of 1 rad/s is allowed, an exit of 1.25.
        assert_eq!((excess(0.125, -1.0), excess(0.125, -3.0)), (0.0, 1.0));
        assert_eq!((excess(0.125, 1.25), excess(0.125, 2.25)), (0.0, 0.5));
        assert_eq!((excess(1.875, 1.0), excess(1.875, 3.0)), (0.0, 1.0));
        assert_eq!((excess(1.875, -1.25), excess(1.875, -2.25)), (0.0, 0.5));
        assert_eq!(polygon_excess(&Boundary::Box, &KNEE, 1.0, 9.0, 0.5), None);
        assert_eq!(
            polygon_excess(&polygon, &Limits::UNLIMITED, 1.0, 9.0, 0.5),
            Some(0.0)
        );
    }

    #[test]
    fn position_violation_is_a_distance() {
        assert_eq!(position_violation(&KNEE, 1.0), 0.0);
        assert_eq!(position_violation(&KNEE, -0.25), 0.25);
        assert_eq!(position_violation(&KNEE, 2.5), 0.5);
        assert_eq!(position_violation(&Limits::UNLIMITED, 1e9), 0.0);
    }
}
