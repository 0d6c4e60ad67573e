//! How many orientations can be reached at which distance.

use super::numbers::Numbers;
use super::record::ReachFindings;
use super::subject::{Answers, Kinematics, SNAPPED, Solve, Subject};
use super::suite::{ReachCounts, ReachSpec};
use ik_methods::reverse_decoupling::analyser::Family;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rayon::prelude::*;

/// Poses this near (m) to the boundary may be decided either way.
const BOUNDARY_M: f64 = 1e-9;
/// Where both sides of the boundary are tried (m): just outside what may be decided either way.
const BESIDE_M: f64 = 1.1e-9;
/// Halvings of an interval of distances: to the last bit.
const BISECTIONS: usize = 60;

/// The two links of a limb, and what its orientation depends on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Geometry {
    /// Thigh, shank, hip offset (m).
    Leg(f64, f64, f64),
    /// Upper arm, forearm (m).
    Arm(f64, f64),
    /// No formula.
    Other,
}

impl Geometry {
    fn of(subject: &Subject) -> Self {
        let rows = &subject.table.rows;
        match subject.family {
            Family::Leg => Self::Leg(rows[2].a, rows[3].a, rows[2].d.abs()),
            Family::Arm => Self::Arm(rows[2].d.abs(), rows[4].d.abs()),
            Family::FourJointArm | Family::General { .. } => Self::Other,
        }
    }

    /// How far inside its reach (m) a limb is, negative outside: `distance` from the common point to the end, `along` the
    /// part of it along the axis of joint 6 (p'z). An arm has |p'z| ≤ l2 |S4|; a leg with an offset d3 has
    /// hypot(p'x, p'y) ≥ d3.
    fn inside_m(self, distance: f64, along: f64) -> Option<f64> {
        match self {
            Self::Leg(thigh, shank, offset) => {
                let across = (distance * distance - along * along).max(0.0).sqrt();
                let hinge = (distance * distance - offset * offset).max(0.0).sqrt();
                let shell = (thigh + shank - hinge).min(hinge - (thigh - shank).abs());
                Some(shell.min(if offset > 0.0 { across - offset } else { shell }))
            }
            Self::Arm(upper, fore) => {
                let shell = (upper + fore - distance).min(distance - (upper - fore).abs());
                Some(shell.min(upper * sine(upper, fore, distance) - along.abs()))
            }
            Self::Other => None,
        }
    }

    /// Part of all orientations that is within reach: p'z is uniform between ± the distance (Archimedes' hat box).
    fn expected(self, distance: f64) -> Option<f64> {
        let within = self.inside_m(distance, 0.0)? >= -BOUNDARY_M;
        let part = match self {
            // Both ends of links of equal lengths in one point: any orientation.
            _ if distance < BOUNDARY_M => 1.0,
            Self::Leg(_, _, offset) => (1.0 - (offset / distance).powi(2)).max(0.0).sqrt(),
            Self::Arm(upper, fore) => (upper * sine(upper, fore, distance) / distance).min(1.0),
            Self::Other => 0.0,
        };
        Some(if within { part } else { 0.0 })
    }
}

/// |S4| of a hinge between two links whose ends are `distance` apart; 0 out of reach.
fn sine(a: f64, b: f64, distance: f64) -> f64 {
    let (sum, difference) = (a + b, (a - b).abs());
    let product = (sum - distance) * (sum + distance) * (distance - difference) * (distance + difference);
    product.max(0.0).sqrt() / (2.0 * a * b)
}

/// Length of the limb from the common point on (m).
pub(super) fn stretched_m(subject: &Subject) -> f64 {
    match Geometry::of(subject) {
        Geometry::Leg(thigh, shank, offset) => (thigh + shank).hypot(offset),
        Geometry::Arm(upper, fore) => upper + fore,
        Geometry::Other => subject
            .table
            .rows
            .iter()
            .map(|row| row.a.abs() + row.d.abs())
            .sum(),
    }
}

/// What became of some poses.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    tried: u64,
    reachable: u64,
    disagreements: u64,
    error_max: f64,
}

/// Solves poses and judges them by the geometry.
struct Judge<'a> {
    subject: &'a Subject,
    geometry: Geometry,
    solve: &'a Solve<'a>,
    kinematics: Kinematics<'a>,
    answers: Answers,
    tally: Tally,
}

/// An orientation of the end, and the direction in which it is.
type Draw = (UnitQuaternion<f64>, Vector3<f64>);

impl<'a> Judge<'a> {
    fn new(subject: &'a Subject, solve: &'a Solve<'a>) -> Self {
        Self {
            subject,
            geometry: Geometry::of(subject),
            solve,
            kinematics: subject.kinematics(),
            answers: Answers::new(),
            tally: Tally::default(),
        }
    }

    fn inside_m(&self, (rotation, direction): &Draw, distance: f64) -> Option<f64> {
        let along = distance * (rotation.inverse() * direction).z;
        self.geometry.inside_m(distance, along)
    }

    fn try_at(&mut self, draw: &Draw, distance: f64) {
        let (rotation, direction) = draw;
        let end = Isometry3::from_parts(Translation3::from(direction * distance), *rotation);
        let pose = self.subject.table.base * end * self.subject.table.tool;
        let solved = (self.solve)(&pose, &[0.0; 6], &mut self.answers);
        let reached = solved.is_ok() && !self.answers.is_empty();
        self.tally.tried += 1;
        self.tally.reachable += u64::from(reached);
        if let Some(inside) = self.inside_m(draw, distance) {
            let decided = inside.abs() > BOUNDARY_M;
            self.tally.disagreements += u64::from(decided && reached != (inside > 0.0));
        }
        if reached {
            for (solution, _) in &self.answers {
                self.tally.error_max = self.tally.error_max.max(self.kinematics.miss(&pose, solution));
            }
        }
    }

    /// Tries both sides of every boundary between two distances.
    fn try_boundaries(&mut self, draw: &Draw, distance_m: &[f64]) {
        for pair in distance_m.windows(2) {
            for level in [BESIDE_M, -BESIDE_M] {
                let above = |judge: &Self, distance| judge.inside_m(draw, distance).map(|m| m > level);
                let (mut near, mut far) = (pair[0], pair[1]);
                let first = above(self, near);
                if first.is_none() || first == above(self, far) {
                    continue;
                }
                for _ in 0..BISECTIONS {
                    let middle = 0.5 * (near + far);
                    let side = if above(self, middle) == first {
                        &mut near
                    } else {
                        &mut far
                    };
                    *side = middle;
                }
                self.try_at(draw, near);
            }
        }
    }
}

/// Tries random orientations in random directions at each distance, and both sides of the boundary of reach along each
/// direction. Directions and orientations are drawn once and used at every distance.
pub(super) fn reach(
    subject: &Subject,
    spec: &ReachSpec,
    counts: &ReachCounts,
    mut numbers: Numbers,
    solve: &Solve<'_>,
) -> ReachFindings {
    let geometry = Geometry::of(subject);
    let draws: Vec<Draw> = (0..counts.orientations)
        .map(|_| (numbers.rotation(), numbers.direction()))
        .collect();
    let far = spec.beyond * stretched_m(subject);
    let place = |i: usize| far * i as f64 / (counts.distances - 1) as f64;
    let distance_m: Vec<f64> = (0..counts.distances).map(place).collect();
    let at = |&distance: &f64| {
        let mut judge = Judge::new(subject, solve);
        draws.iter().for_each(|draw| judge.try_at(draw, distance));
        judge.tally
    };
    let beside = |draw: &Draw| {
        let mut judge = Judge::new(subject, solve);
        judge.try_boundaries(draw, &distance_m);
        judge.try_boundaries(&across_last_axis(draw), &distance_m);
        judge.tally
    };
    let all: Vec<Tally> = distance_m.par_iter().with_max_len(1).map(at).collect();
    let edges: Vec<Tally> = draws.par_iter().map(beside).collect();
    let both = || all.iter().chain(&edges);
    let known = geometry != Geometry::Other;
    let disagreements = known.then(|| both().map(|t| t.disagreements).sum());
    let error_max = both().map(|t| t.error_max).fold(0.0, f64::max);
    ReachFindings {
        orientations: counts.orientations as u64,
        reachable: all.iter().map(|t| t.reachable).collect(),
        expected: distance_m.iter().map(|d| geometry.expected(*d)).collect(),
        disagreements,
        at_boundary: known.then(|| edges.iter().map(|t| t.tried).sum()),
        error_max,
        held: disagreements.unwrap_or(0) == 0 && error_max < SNAPPED,
        distance_m,
    }
}

/// The same orientation, the direction turned across the last axis: then an arm ends at its shell, not before it.
fn across_last_axis((rotation, direction): &Draw) -> Draw {
    let axis = rotation * Vector3::z();
    let across = direction - axis * axis.dot(direction);
    // A direction along the axis has nothing across it; any other then serves.
    let across = across
        .try_normalize(1e-6)
        .unwrap_or_else(|| rotation * Vector3::x());
    (*rotation, across)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn expected_fractions_of_arm_and_leg() {
        // Both links 1 m, at the distance √2 the elbow is square: |p'z| ≤ 1 of √2.
        let arm = Geometry::Arm(1.0, 1.0);
        let part = arm.expected(2.0_f64.sqrt()).unwrap();
        assert!((part - 0.5_f64.sqrt()).abs() < 1e-12, "{part}");
        assert_eq!(arm.expected(2.1), Some(0.0));
        let leg = Geometry::Leg(1.0, 1.0, 0.0);
        assert_eq!(leg.expected(1.0), Some(1.0));
        let offset = Geometry::Leg(1.0, 1.0, 0.5).expected(1.0).unwrap();
        assert!((offset - 0.75_f64.sqrt()).abs() < 1e-12, "{offset}");
        assert_eq!(Geometry::Other.expected(1.0), None);
    }

    #[test]
    fn a_right_distance_is_not_enough_for_an_arm() {
        let arm = Geometry::Arm(1.0, 1.0);
        assert!(arm.inside_m(1.9, 0.0).unwrap() > 0.0);
        assert!(arm.inside_m(1.9, 1.5).unwrap() < 0.0);
    }
}
