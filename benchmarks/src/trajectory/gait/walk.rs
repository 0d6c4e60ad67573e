//! The curves of a walk: the knots of eqs. (16)–(24), and splines through them.
//!
//! Step n = 0, 1, … begins at n Tc; the right foot swings in even steps, the left one in odd steps. The source counts
//! pairs of steps by j, with j = ⌊n/2⌋ for both feet.

use super::GaitSpec;
use crate::trajectory::spline::{CubicSpline, Curve, KnotError};

/// Where the waist has its knots inside a step (parts of Tc). The feet land at 0.89 Tc, the waist has 0.9 Tc: as printed.
const WAIST_KNOTS: [f64; 3] = [0.1, 0.5, 0.9];

/// All curves of a walk.
#[derive(Clone, Debug, PartialEq)]
pub struct Walk {
    /// Right foot: x along the way and height (m, world).
    pub right_foot: Swing,
    /// Left foot.
    pub left_foot: Swing,
    /// x of the waist (m, world).
    pub waist_x: Curve,
    /// y of the waist (m, world).
    pub waist_y: Curve,
    /// Right hand, from the lowest point below its shoulder (m, world axes).
    pub right_hand: Swing,
    /// Left hand.
    pub left_hand: Swing,
}

/// A limb that swings forwards and up.
#[derive(Clone, Debug, PartialEq)]
pub struct Swing {
    /// Along the way (m).
    pub x: Curve,
    /// Up (m).
    pub z: Curve,
}

/// One of two limbs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Right,
    Left,
}

/// The side that swings in step n.
fn swinging(n: u32) -> Side {
    if n.is_multiple_of(2) {
        Side::Right
    } else {
        Side::Left
    }
}

impl Walk {
    /// The curves of a checked specification.
    ///
    /// # Errors
    /// Numbers so large or small that knots coincide or are not finite.
    pub fn new(spec: &GaitSpec) -> Result<Self, KnotError> {
        Ok(Self {
            right_foot: spec.foot(Side::Right)?,
            left_foot: spec.foot(Side::Left)?,
            waist_x: through(spec.waist_forward())?,
            waist_y: through(spec.waist_sideways())?,
            right_hand: spec.hand(Side::Right)?,
            left_hand: spec.hand(Side::Left)?,
        })
    }
}

impl GaitSpec {
    /// One spline per swing of this foot; a foot that never swings stays.
    fn foot(&self, side: Side) -> Result<Swing, KnotError> {
        let own = |n: &u32| swinging(*n) == side;
        let rest = match side {
            Side::Right => 0.0,
            Side::Left => self.initial_step_m,
        };
        let forward = (0..self.steps)
            .filter(own)
            .map(|n| self.foot_forward(n, rest))
            .collect();
        let height = (0..self.steps).filter(own).map(|n| self.foot_height(n)).collect();
        Ok(Swing {
            x: swings(forward, rest)?,
            z: swings(height, 0.0)?,
        })
    }

    fn hand(&self, side: Side) -> Result<Swing, KnotError> {
        let forward = (0..self.steps).map(|n| self.hand_forward(n, side)).collect();
        let height = (0..self.steps).map(|n| self.hand_height(n)).collect();
        Ok(Swing {
            x: swings(forward, 0.0)?,
            z: swings(height, 0.0)?,
        })
    }

    /// Time (s) at a part of step n.
    fn time(&self, n: u32, part: f64) -> f64 {
        (f64::from(n) + part) * self.step_period_s
    }

    /// Eqs. (19), right foot, and (20), left foot: from j Step to (j + 1) Step ahead of `rest`.
    ///
    /// Deviation: (19) prints 0 as lower limit of its first line for every j, where the step begins at 2j Tc. (20) prints
    /// j − 1, j − ½ and j in lines 2 to 4, one less than in line 1, and the lift at 1.01 where (22) has 1.1. The times of
    /// (19)–(22) are printed (j + …) Tc though a foot swings once in 2 Tc.
    fn foot_forward(&self, n: u32, rest: f64) -> Vec<(f64, f64)> {
        let j = f64::from(n / 2);
        vec![
            (self.time(n, self.lift_fraction), rest + j * self.step_m),
            (self.time(n, 0.5), rest + (j + 0.5) * self.step_m),
            (self.time(n, self.land_fraction), rest + (j + 1.0) * self.step_m),
        ]
    }

    /// Eqs. (21), right foot, and (22), left foot.
    ///
    /// Deviation: the times 0.03 and 0.08 stand outside the product with Tc and have no unit; read as seconds.
    fn foot_height(&self, n: u32) -> Vec<(f64, f64)> {
        let (lift, land) = (self.time(n, self.lift_fraction), self.time(n, self.land_fraction));
        let up = self
            .height_knots
            .iter()
            .map(|k| (lift + k.after_s, k.share * self.lift_m));
        let down = self
            .height_knots
            .iter()
            .rev()
            .map(|k| (land - k.after_s, k.share * self.lift_m));
        std::iter::once((lift, 0.0))
            .chain(up)
            .chain([(self.time(n, 0.5), self.lift_m)])
            .chain(down)
            .chain([(land, 0.0)])
            .collect()
    }

    /// Eqs. (16), right arm, and (17), left arm: against the foot of the same side, relative to the shoulder.
    ///
    /// Deviation: the sign g is left open; it is +1 where the right foot swings and alternates, so that a swing begins
    /// where the one before it ended.
    fn hand_forward(&self, n: u32, side: Side) -> Vec<(f64, f64)> {
        let front = if swinging(n) == side {
            self.hand_swing_m
        } else {
            -self.hand_swing_m
        };
        vec![
            (self.time(n, self.lift_fraction), front),
            (self.time(n, 0.5), 0.0),
            (self.time(n, self.land_fraction), -front),
        ]
    }

    /// Eq. (18), both arms: up at the ends of the swing.
    ///
    /// Deviation: Zmin = 0 is not the straight arm but `hand_drop_m` below the shoulder. The straight arm rises by
    /// 0.0038 m only when its hand is moved by Xmax, not by Zmax.
    fn hand_height(&self, n: u32) -> Vec<(f64, f64)> {
        vec![
            (self.time(n, self.lift_fraction), self.hand_lift_m),
            (self.time(n, 0.5), 0.0),
            (self.time(n, self.land_fraction), self.hand_lift_m),
        ]
    }

    /// Eq. (23): four increments per step, half of what a foot advances.
    ///
    /// Deviation: the knot at 0.5 Tc is not printed, so that the waist would advance by 0.075 m while the feet advance by
    /// 0.1 m.
    fn waist_forward(&self) -> Vec<(f64, f64)> {
        let mut x = self.waist_start_m();
        let mut knots = vec![(0.0, x)];
        for n in 0..self.steps {
            for part in WAIST_KNOTS.into_iter().chain([1.0]) {
                x += self.waist_increment_m();
                knots.push((self.time(n, part), x));
            }
        }
        knots
    }

    /// Eq. (24): over the standing foot, y to the left.
    ///
    /// Deviation: the sign s is printed as −1 for both feet; it is +1 where the left foot stands.
    fn waist_sideways(&self) -> Vec<(f64, f64)> {
        let [middle, shifted, over] = self.sway_m;
        let mut knots = vec![(0.0, middle)];
        for n in 0..self.steps {
            let s = match swinging(n) {
                Side::Right => 1.0,
                Side::Left => -1.0,
            };
            let inside = WAIST_KNOTS.into_iter().zip([shifted, over, shifted]);
            knots.extend(inside.map(|(part, y)| (self.time(n, part), s * y)));
            knots.push((self.time(n, 1.0), middle));
        }
        knots
    }
}

/// One spline through all knots.
fn through(knots: Vec<(f64, f64)>) -> Result<Curve, KnotError> {
    Ok(Curve::new(CubicSpline::at_rest(knots)?, Vec::new()))
}

/// One spline per swing; `rest` if there is none.
fn swings(knots: Vec<Vec<(f64, f64)>>, rest: f64) -> Result<Curve, KnotError> {
    let mut splines = knots.into_iter().map(CubicSpline::at_rest);
    let first = splines
        .next()
        .unwrap_or_else(|| CubicSpline::at_rest(vec![(0.0, rest)]))?;
    Ok(Curve::new(first, splines.collect::<Result<_, _>>()?))
}
