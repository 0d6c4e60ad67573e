//! Joints 4, 5, 6 from the place of the meeting point of axes 1, 2, 3 seen from the last frame.
//!
//! In frame 3 the meeting point is c3; seen after joint 4 it is u, after joint 5 m, before and after joint 6 v and w:
//!
//! ```text
//! u = Rx(−α4)[Rz(−t4) c3 − (a4, 0, d4)]    m = Rz(−t5) u    v = Rx(−α5)[m − (a5, 0, d5)]    w = Rz(−t6) v
//! |v| = |w|:    a5 m_x = F(t4)          v_z = w_z:    sin α5 m_y = G(t4)          m_x² + m_y² = |u|² − u_z²
//! ```
//!
//! With (c3x, c3y) = ρ (cos φ, sin φ) and τ = t4 − φ, Rz(−t4) c3 = (ρ cos τ, −ρ sin τ, c3z), so all of F, G, |u|², u_z are
//! linear in (cos τ, sin τ). Which equation is left without t5 depends on how axes 5 and 6 lie.

use super::angle::{Angle, Harmonic};
use super::skew::TrigonometricEquation;
use super::{DhRow, FarAxes, MEETING_TOLERANCE_M, Misfit, PARALLEL_TOLERANCE, REACH_TOLERANCE_M, wrap};
use crate::reverse_decoupling::quartic::real_roots;
use nalgebra::Vector3;

/// a5 (m) and sin α5 up to this count as zero when it is decided which equation gives t4, which costs as much accuracy.
/// Smaller ones bring pairs of roots of the quartic together beyond what doubles can part; Empirical: 2e-7 works to
/// full accuracy, 1e-8 does not.
const STRUCTURAL_ZERO: f64 = 1e-7;
/// A meeting point closer to axis 5 than this share of the farthest it can be is on it. An exactly stretched elbow leaves
/// sqrt(ε) of distance after rounding, some 1e-7.
const ON_AXIS_5: f64 = 1e-6;
/// The same for axis 6, whose distance is read from the pose and not from a square root.
const ON_AXIS_6: f64 = 1e-7;
/// Branches of t4 closer than this (rad) to their double root are merged into it; the error is second order, 1e-12.
const DOUBLE_T4: f64 = 1e-6;
/// Branches ±m_x of the circle m_x² = r² − v_y² are merged where m_x² is below this times r and the size of the chain: r is
/// known to a few ε of that size. The circle is missed by half as much.
const DOUBLE_T5: f64 = 1e-13;
/// Roots of the quartic with cosines and sines of all three angles closer than this are one.
const SAME_ELBOW: f64 = 1e-6;

/// One solution of joints 4, 5, 6.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Elbow {
    pub(super) t4: Angle,
    pub(super) t5: Angle,
    pub(super) t6: Angle,
}

impl Elbow {
    fn is_close(&self, other: &Self) -> bool {
        let close = |one: &Angle, other: &Angle| {
            (one.cos - other.cos).abs() < SAME_ELBOW && (one.sin - other.sin).abs() < SAME_ELBOW
        };
        close(&self.t4, &other.t4) && close(&self.t5, &other.t5) && close(&self.t6, &other.t6)
    }
}

/// Up to four of them, and the least miss of the branches that were refused.
#[derive(Debug, Default)]
pub(super) struct Elbows {
    list: [Elbow; 4],
    len: usize,
    excess_m: Option<f64>,
}

impl Elbows {
    pub(super) fn as_slice(&self) -> &[Elbow] {
        &self.list[..self.len]
    }

    fn push(&mut self, elbow: Elbow) {
        self.list[self.len] = elbow;
        self.len += 1;
    }

    fn missed_by(&mut self, excess: f64) {
        self.excess_m = Some(self.excess_m.map_or(excess, |least| least.min(excess)));
    }
}

/// The part of a chain after its triple.
#[derive(Clone, Debug)]
pub(super) struct ElbowFamily {
    far_axes: FarAxes,
    /// Twists 5 and 6.
    twist5: Angle,
    twist6: Angle,
    a5: f64,
    d5: f64,
    a6: f64,
    d6: f64,
    /// Direction φ of c3 across axis 4.
    phi: Angle,
    /// u_x, u_y, u_z.
    u: [Harmonic; 3],
    /// |u|².
    square: Harmonic,
    /// F but for −|w|²/2 and G but for −w_z.
    f: Harmonic,
    g: Harmonic,
    /// Meeting far axes: least and largest |w|, and the angle τ of the least.
    nearest: f64,
    farthest: f64,
    psi: Angle,
    /// Largest |u|, with which distances from axes are compared.
    size: f64,
}

impl ElbowFamily {
    pub(super) fn new(rows: &[DhRow; 6]) -> Result<Self, Misfit> {
        let [.., third, fourth, fifth, sixth] = rows;
        let twist4 = Angle::new(fourth.alpha);
        let mut twist5 = Angle::new(fifth.alpha);
        let (c4, s4) = (twist4.cos, twist4.sin);
        let c3 = -Angle::new(third.alpha).untwisted(Vector3::new(third.a, 0.0, third.d));
        let rho = c3.x.hypot(c3.y);
        if rho <= MEETING_TOLERANCE_M {
            return Err(Misfit::FourAxesMeet { row: 3 });
        }
        let meeting = fifth.a.abs() <= STRUCTURAL_ZERO;
        let parallel = twist5.sin.abs() <= STRUCTURAL_ZERO;
        let (a4, d5) = (fourth.a, fifth.d);
        // u_z but for the term in τ, before and after the twist.
        let rise = c3.z - fourth.d;
        let reach = a4.hypot(d5 * s4);
        let (far_axes, thin) = match (meeting, parallel) {
            (true, true) => return Err(Misfit::FarAxesCoincide { row: 5 }),
            (true, false) => (FarAxes::Meeting, reach <= MEETING_TOLERANCE_M),
            (false, true) => (FarAxes::Parallel, s4.abs() <= PARALLEL_TOLERANCE),
            (false, false) => (
                FarAxes::Skew,
                a4.abs() <= MEETING_TOLERANCE_M && s4.abs() <= PARALLEL_TOLERANCE,
            ),
        };
        if thin {
            return Err(Misfit::NoElbow { row: 4 });
        }
        let a5 = if meeting { 0.0 } else { fifth.a };
        if parallel {
            (twist5.cos, twist5.sin) = (twist5.cos.signum(), 0.0);
        }
        let u = [
            Harmonic {
                one: -a4,
                cos: rho,
                sin: 0.0,
            },
            Harmonic {
                one: s4 * rise,
                cos: 0.0,
                sin: -c4 * rho,
            },
            Harmonic {
                one: c4 * rise,
                cos: 0.0,
                sin: s4 * rho,
            },
        ];
        let square = Harmonic {
            one: rho * rho + a4 * a4 + rise * rise,
            cos: -2.0 * a4 * rho,
            sin: 0.0,
        };
        let f = Harmonic {
            one: 0.5 * (square.one + a5 * a5 + d5 * d5) - d5 * u[2].one,
            cos: 0.5 * square.cos,
            sin: -d5 * u[2].sin,
        };
        let g = Harmonic {
            one: twist5.cos * (u[2].one - d5),
            cos: 0.0,
            sin: twist5.cos * u[2].sin,
        };
        // |w|² = 2 F + |w|² with a5 = 0 is nearest² at τ = ψ and farthest² opposite, both sums of squares.
        let along = rise - d5 * c4;
        Ok(Self {
            far_axes,
            twist5,
            twist6: Angle::new(sixth.alpha),
            a5,
            d5,
            a6: sixth.a,
            d6: sixth.d,
            phi: Angle::new(c3.y.atan2(c3.x)),
            u,
            square,
            f,
            g,
            nearest: (rho - reach).hypot(along),
            farthest: (rho + reach).hypot(along),
            psi: Angle::new((-f.sin).atan2(-f.cos)),
            size: (rho + a4.abs()).hypot(rise),
        })
    }

    pub(super) fn far_axes(&self) -> FarAxes {
        self.far_axes
    }

    /// All t4, t5, t6 that see the meeting point at `centre` (m) in frame 6; the excess (m) if there are none and it is
    /// known. Joints of `previous` are used where they are free.
    pub(super) fn solve(&self, centre: &Vector3<f64>, previous: &[f64; 6]) -> Result<Elbows, Option<f64>> {
        // w = Rx(α6) p' + (a6, 0, d6)
        let (c6, s6) = (self.twist6.cos, self.twist6.sin);
        let w = Vector3::new(
            centre.x + self.a6,
            c6 * centre.y - s6 * centre.z,
            s6 * centre.y + c6 * centre.z + self.d6,
        );
        if !w.iter().all(|entry| entry.is_finite()) {
            return Err(None);
        }
        let point = Seen {
            w,
            radius: w.x.hypot(w.y),
            distance: w.norm(),
            previous,
        };
        let mut found = Elbows::default();
        match self.far_axes {
            FarAxes::Meeting => self.by_distance(&point, &mut found),
            FarAxes::Parallel => self.by_height(&point, &mut found),
            FarAxes::Skew => self.by_quartic(&point, &mut found),
        }
        if found.len == 0 {
            Err(found.excess_m)
        } else {
            Ok(found)
        }
    }

    /// a5 = 0: F(t4) = 0 is a law of cosines, |w|² = nearest² cos²(δ/2) + farthest² sin²(δ/2) with δ = τ − ψ.
    fn by_distance(&self, point: &Seen<'_>, found: &mut Elbows) {
        let d = point.distance;
        let excess = (d - self.farthest).max(self.nearest - d);
        if excess > REACH_TOLERANCE_M {
            return found.missed_by(excess);
        }
        // Squares of sin(δ/2) and cos(δ/2), up to a common factor, without cancellation.
        let up = ((d - self.nearest) * (d + self.nearest)).max(0.0);
        let down = ((self.farthest - d) * (self.farthest + d)).max(0.0);
        let (sin_half, cos_half) = (up.sqrt(), down.sqrt());
        let double = 0.5 * DOUBLE_T4;
        let (mid, sides): (Angle, &[f64]) = if sin_half < double * cos_half {
            (Angle::new(0.0), &[1.0])
        } else if cos_half < double * sin_half {
            (Angle::new(std::f64::consts::PI), &[1.0])
        } else {
            let sum = up + down;
            let delta = Angle {
                value: 2.0 * sin_half.atan2(cos_half),
                cos: (down - up) / sum,
                sin: 2.0 * sin_half * cos_half / sum,
            };
            (delta, &[1.0, -1.0])
        };
        for side in sides {
            let delta = Angle {
                value: side * mid.value,
                cos: mid.cos,
                sin: side * mid.sin,
            };
            let tau = self.psi.plus(&delta);
            self.with_far_axes_meeting(&tau, point, found);
        }
    }

    /// v_z = w_z gives m_y, the distance from axis 6 gives |m_x|.
    fn with_far_axes_meeting(&self, tau: &Angle, point: &Seen<'_>, found: &mut Elbows) {
        let height = self.u[2].at(tau.cos, tau.sin) - self.d5;
        let m_y = (self.twist5.cos * height - point.w.z) / self.twist5.sin;
        let v_y = self.twist5.cos * m_y + self.twist5.sin * height;
        let excess = v_y.abs() - point.radius;
        if excess > REACH_TOLERANCE_M {
            return found.missed_by(excess);
        }
        let square = ((point.radius - v_y.abs()) * (point.radius + v_y.abs())).max(0.0);
        let t6_free = point.radius < ON_AXIS_6 * self.size;
        if t6_free || square <= DOUBLE_T5 * point.radius * self.size {
            found.push(self.elbow(tau, 0.0, m_y, point));
        } else {
            self.push_both(tau, (square.sqrt(), m_y), (-square.sqrt(), m_y), point, found);
        }
    }

    /// sin α5 = 0: G(t4) = 0 gives sin τ.
    fn by_height(&self, point: &Seen<'_>, found: &mut Elbows) {
        let level = self.g.one - point.w.z;
        let swing = self.g.sin;
        let excess = level.abs() - swing.abs();
        if excess > REACH_TOLERANCE_M {
            return found.missed_by(excess);
        }
        let sin = (-level / swing).clamp(-1.0, 1.0);
        let cos = ((swing.abs() - level.abs()) * (swing.abs() + level.abs()))
            .max(0.0)
            .sqrt()
            / swing.abs();
        let branches: &[f64] = if cos < DOUBLE_T4 { &[0.0] } else { &[cos, -cos] };
        for &cos in branches {
            self.with_far_axes_parallel(&Angle::of(cos, sin), point, found);
        }
    }

    /// The triangle of axes 5 and 6 and the meeting point, seen along them.
    fn with_far_axes_parallel(&self, tau: &Angle, point: &Seen<'_>, found: &mut Elbows) {
        let (radius, arm) = (point.radius, self.a5.abs());
        let length = self.u[0]
            .at(tau.cos, tau.sin)
            .hypot(self.u[1].at(tau.cos, tau.sin));
        let (most, least) = (length + arm, (length - arm).abs());
        let excess = (radius - most).max(least - radius);
        if excess > REACH_TOLERANCE_M {
            return found.missed_by(excess);
        }
        let m_x = (length * length + (self.a5 - radius) * (self.a5 + radius)) / (2.0 * self.a5);
        let heron = (most - radius) * (most + radius) * (radius - least) * (radius + least);
        let square = heron.max(0.0) / (4.0 * arm * arm);
        if square <= DOUBLE_T5 * length * self.size {
            found.push(self.elbow(tau, m_x, 0.0, point));
        } else {
            self.push_both(tau, (m_x, square.sqrt()), (m_x, -square.sqrt()), point, found);
        }
    }

    fn skew_equation(&self, point: &Seen<'_>) -> TrigonometricEquation {
        let (mut f, mut g) = (self.f, self.g);
        f.one -= 0.5 * point.distance * point.distance;
        g.one -= point.w.z;
        TrigonometricEquation {
            a: self.a5,
            s: self.twist5.sin,
            f,
            g,
            square: self.square,
            u_z: self.u[2],
        }
    }

    /// (F/a5)² + (G/sin α5)² = |u|² − u_z², cleared of denominators.
    fn by_quartic(&self, point: &Seen<'_>, found: &mut Elbows) {
        let equation = self.skew_equation(point);
        let (start, coefficients) = equation.half_angle_quartic();
        let slack = equation.slack(point.distance, self.size);
        for half in real_roots(&coefficients, slack).as_slice() {
            let sum = 1.0 + half * half;
            let turn = ((1.0 - half * half) / sum, 2.0 * half / sum);
            let root = Angle::of(
                start.0 * turn.0 - start.1 * turn.1,
                start.1 * turn.0 + start.0 * turn.1,
            );
            let (near, twin) = equation.split(root);
            self.take_root(&equation.polished(near), &equation, point, found);
            if let Some(twin) = twin {
                self.take_root(&equation.polished(twin), &equation, point, found);
            }
        }
    }

    /// The one t5 of a root of the quartic.
    fn take_root(&self, tau: &Angle, equation: &TrigonometricEquation, point: &Seen<'_>, found: &mut Elbows) {
        let (a, s) = (self.a5, self.twist5.sin);
        let m_x = equation.f.at(tau.cos, tau.sin) / a;
        let m_y = equation.g.at(tau.cos, tau.sin) / s;
        let length = self.u[0]
            .at(tau.cos, tau.sin)
            .hypot(self.u[1].at(tau.cos, tau.sin));
        // A small divisor magnifies rounding; then the circle of radius |m| tells that component better, unless it is small
        // itself. What a root that only touches the axis leaves over appears as the excess, in metres.
        let rest = |known: f64| ((length - known.abs()) * (length + known.abs())).max(0.0).sqrt();
        let (m_x, m_y, excess) = if s.abs() * self.size < a.abs() && m_y.abs() > s.abs() * self.size {
            let better = rest(m_x).copysign(m_y);
            (m_x, better, ((better - m_y) * s).abs())
        } else if a.abs() <= s.abs() * self.size && m_x.abs() > a.abs() {
            let better = rest(m_y).copysign(m_x);
            (better, m_y, ((better - m_x) * a / point.distance).abs())
        } else {
            (m_x, m_y, 0.0)
        };
        let excess = excess.max((m_x.hypot(m_y) - length).abs());
        if excess > REACH_TOLERANCE_M {
            return found.missed_by(excess);
        }
        let elbow = self.elbow(tau, m_x, m_y, point);
        let known = found.as_slice().iter().any(|known| known.is_close(&elbow));
        // Four roots are all there are; splitting one that rounding put beside its extremum may offer one more.
        if !known && found.len < found.list.len() {
            found.push(elbow);
        }
    }

    /// Whether a point at m is so close to axis 5 that t5 is free.
    fn on_axis_5(&self, m_x: f64, m_y: f64) -> bool {
        m_x.hypot(m_y) < ON_AXIS_5 * self.size
    }

    /// Two branches of t5, which are one where t5 is free.
    fn push_both(
        &self,
        tau: &Angle,
        one: (f64, f64),
        other: (f64, f64),
        point: &Seen<'_>,
        found: &mut Elbows,
    ) {
        found.push(self.elbow(tau, one.0, one.1, point));
        if !self.on_axis_5(one.0, one.1) {
            found.push(self.elbow(tau, other.0, other.1, point));
        }
    }

    /// t5 turns m into u, t6 turns w into v.
    fn elbow(&self, tau: &Angle, m_x: f64, m_y: f64, point: &Seen<'_>) -> Elbow {
        let [u_x, u_y, u_z] = self.u.map(|entry| entry.at(tau.cos, tau.sin));
        let t5 = if self.on_axis_5(m_x, m_y) {
            Angle::new(wrap(point.previous[4]))
        } else {
            Angle::of(m_x * u_x + m_y * u_y, m_x * u_y - m_y * u_x)
        };
        let t6 = if point.radius < ON_AXIS_6 * self.size {
            Angle::new(wrap(point.previous[5]))
        } else {
            let v_x = m_x - self.a5;
            let v_y = self.twist5.cos * m_y + self.twist5.sin * (u_z - self.d5);
            let w = &point.w;
            Angle::of(w.x * v_x + w.y * v_y, w.x * v_y - w.y * v_x)
        };
        Elbow {
            t4: self.phi.plus(tau),
            t5,
            t6,
        }
    }
}

/// The meeting point as seen from frame 6 after its constant part (w).
struct Seen<'a> {
    w: Vector3<f64>,
    /// Distance of w from axis 6 and from its origin.
    radius: f64,
    distance: f64,
    previous: &'a [f64; 6],
}
