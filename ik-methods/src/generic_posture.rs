//! Postures without symmetry, at which rows have the rank they have nearly everywhere.

use ik_core::configuration::integrate;
use ik_core::robot::Robot;

/// Postures at which ranks are counted; the largest rank is the generic one.
const GENERIC_POSTURES: usize = 3;

/// The postures (length nq each).
pub(crate) fn generic_postures(robot: &Robot) -> Vec<Vec<f64>> {
    (0..GENERIC_POSTURES).map(|k| generic_posture(robot, k)).collect()
}

/// A posture without symmetry: multiples of the golden ratio, joints within ±1.
fn generic_posture(robot: &Robot, k: usize) -> Vec<f64> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    #[allow(clippy::cast_precision_loss, reason = "small counts")]
    let number = |i: usize| 2.0 * ((1 + i + 97 * k) as f64 * GOLDEN).fract() - 1.0;
    let dq: Vec<f64> = (0..robot.nv()).map(number).collect();
    integrate(robot, &robot.neutral(), &dq)
}
