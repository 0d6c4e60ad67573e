//! Where the root may stand: in the shells that limbs span, where an arm's hand keeps its attitude, and on the right side of cuts
//! along the limits of other joints.

use nalgebra::{Matrix3, Vector3};

/// A shell in the world: a point of the root stays between two distances from a centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reach {
    /// The point relative to the origin of the root (m, world axes).
    pub(super) arm: Vector3<f64>,
    /// Centre (m, world).
    pub(super) centre: Vector3<f64>,
    /// Least distance (m).
    pub(super) least_m: f64,
    /// Largest distance (m).
    pub(super) largest_m: f64,
}

/// Where an arm whose hand is held has its elbow: on a circle about the wrist, across the last axis. The shoulder is one upper
/// arm away from a point of it. This is `|p'z| ≤ l2 |S4|` of the source, in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ring {
    /// The shoulder relative to the origin of the root (m, world axes).
    pub(super) arm: Vector3<f64>,
    /// Wrist (m, world).
    pub(super) wrist: Vector3<f64>,
    /// Last axis (unit, world).
    pub(super) axis: Vector3<f64>,
    /// Length of the forearm (m).
    pub(super) forearm_m: f64,
    /// Length of the upper arm (m).
    pub(super) upper_arm_m: f64,
}

impl Ring {
    /// Where the origin of the root would be with the shoulder in the point of the circle nearest to it, and in the farthest one.
    fn nearest_and_farthest(&self, x: &Vector3<f64>) -> [Vector3<f64>; 2] {
        let middle = self.wrist - self.arm;
        let away = x - middle;
        let across = away - self.axis * self.axis.dot(&away);
        let length = across.norm();
        let direction = if length > 0.0 {
            across / length
        } else {
            any_across(&self.axis)
        };
        [
            middle + direction * self.forearm_m,
            middle - direction * self.forearm_m,
        ]
    }
}

/// `n · x ≤ h`, |n| = 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Halfspace {
    n: Vector3<f64>,
    h: f64,
}

impl Halfspace {
    /// Where something with gradient `rate` at `origin` is less by `excess` than there; none if it does not change.
    pub(super) fn below(origin: &Vector3<f64>, rate: &Vector3<f64>, excess: f64) -> Option<Self> {
        let norm = rate.norm();
        (norm > 0.0).then(|| Self {
            n: rate / norm,
            h: (rate.dot(origin) - excess) / norm,
        })
    }
}

/// One condition on a point.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Condition {
    Within { centre: Vector3<f64>, radius: f64 },
    Beyond { centre: Vector3<f64>, radius: f64 },
    Below(Halfspace),
}

impl Condition {
    /// By how much a point misses it (m); negative inside.
    fn missed(&self, x: &Vector3<f64>) -> f64 {
        match self {
            Self::Within { centre, radius } => (x - centre).norm() - radius,
            Self::Beyond { centre, radius } => radius - (x - centre).norm(),
            Self::Below(plane) => plane.n.dot(x) - plane.h,
        }
    }

    /// The halfspace that touches it where `origin` is nearest to its border.
    fn linearised(&self, origin: &Vector3<f64>) -> Halfspace {
        let outwards = |centre: &Vector3<f64>| {
            let away = origin - centre;
            let distance = away.norm();
            if distance > 0.0 {
                away / distance
            } else {
                Vector3::z()
            }
        };
        match self {
            Self::Within { centre, radius } => {
                let n = outwards(centre);
                Halfspace {
                    n,
                    h: n.dot(centre) + radius,
                }
            }
            Self::Beyond { centre, radius } => {
                let n = -outwards(centre);
                Halfspace {
                    n,
                    h: n.dot(centre) - radius,
                }
            }
            Self::Below(plane) => *plane,
        }
    }
}

/// Most cuts; beyond them the oldest goes.
const MOST_CUTS: usize = 8;
/// Conditions a projection keeps in mind.
const MOST_KEPT: usize = 6;
/// Most rounds of a projection, each with the condition that was missed most.
const ROUNDS: usize = 16;
/// Gram determinants below this, of unit normals, are those of dependent planes.
const DEPENDENT: f64 = 1e-12;
/// Conditions missed by less than this (m) hold.
const SLACK_M: f64 = 1e-12;

/// Shells, rings and cuts of one control step; sized once.
#[derive(Debug)]
pub(super) struct Region {
    shells: Vec<Reach>,
    rings: Vec<Ring>,
    /// Cuts with the joint coordinate they belong to.
    cuts: Vec<(usize, Halfspace)>,
}

impl Region {
    /// Room for `limbs` limbs.
    pub(super) fn new(limbs: usize) -> Self {
        Self {
            shells: Vec::with_capacity(limbs),
            rings: Vec::with_capacity(limbs),
            cuts: Vec::with_capacity(MOST_CUTS),
        }
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.shells.clear();
        self.rings.clear();
        self.cuts.clear();
    }

    /// Adds a shell.
    pub(super) fn add(&mut self, shell: Reach) {
        self.shells.push(shell);
    }

    /// Adds a ring.
    pub(super) fn add_ring(&mut self, ring: Ring) {
        self.rings.push(ring);
    }

    /// Adds a cut along the limit of a joint coordinate, in place of an older one.
    pub(super) fn cut(&mut self, coordinate: usize, cut: Halfspace) {
        self.cuts.retain(|(other, _)| *other != coordinate);
        if self.cuts.len() == MOST_CUTS {
            self.cuts.remove(0);
        }
        self.cuts.push((coordinate, cut));
    }

    /// Whether a point is in the region.
    pub(super) fn contains(&self, x: &Vector3<f64>) -> bool {
        self.conditions(*x)
            .all(|condition| condition.missed(x) <= SLACK_M)
    }

    /// All conditions; those of rings are spheres that touch them as seen from `x`.
    fn conditions(&self, x: Vector3<f64>) -> impl Iterator<Item = Condition> {
        let shells = self.shells.iter().flat_map(|shell| {
            let centre = shell.centre - shell.arm;
            let (largest, least) = (shell.largest_m, shell.least_m);
            [
                Condition::Within {
                    centre,
                    radius: largest,
                },
                Condition::Beyond {
                    centre,
                    radius: least,
                },
            ]
        });
        let rings = self.rings.iter().flat_map(move |ring| {
            let [nearest, farthest] = ring.nearest_and_farthest(&x);
            let radius = ring.upper_arm_m;
            [
                Condition::Within {
                    centre: nearest,
                    radius,
                },
                Condition::Beyond {
                    centre: farthest,
                    radius,
                },
            ]
        });
        let cuts = self.cuts.iter().map(|(_, cut)| Condition::Below(*cut));
        shells.chain(rings).chain(cuts)
    }

    /// The motion dx from `origin` that comes nearest to `D dx = wanted` within cuts, and shells and rings in linear
    /// approximation; `inverse` is that of D.
    pub(super) fn best_motion(
        &self,
        wanted: &Vector3<f64>,
        origin: &Vector3<f64>,
        inverse: &Matrix3<f64>,
    ) -> Vector3<f64> {
        let caused = |condition: Condition| {
            let plane = condition.linearised(origin);
            // n · dx = (D⁻ᵀ n) · (D dx)
            let n = inverse.tr_mul(&plane.n);
            let norm = n.norm();
            Condition::Below(Halfspace {
                n: n / norm,
                h: (plane.h - plane.n.dot(origin)) / norm,
            })
        };
        inverse * project(wanted, |_| self.conditions(*origin).map(caused))
    }

    /// The point nearest to `target` in the region, as far as the rounds of [`project`] lead; best effort where it is empty.
    pub(super) fn nearest(&self, target: &Vector3<f64>) -> Vector3<f64> {
        project(target, |x| self.conditions(x))
    }
}

/// The point nearest to `target` that meets all conditions: in every round the one that is missed most is kept in mind, and the
/// nearest point is sought on one, two or three borders of those kept. Where none is found, the point met that missed least.
fn project<I: Iterator<Item = Condition>>(
    target: &Vector3<f64>,
    conditions: impl Fn(Vector3<f64>) -> I,
) -> Vector3<f64> {
    let mut kept = [(0, Condition::Below(Halfspace::default())); MOST_KEPT];
    let mut count = 0;
    let mut x = *target;
    let mut best = (f64::INFINITY, x);
    for round in 0..ROUNDS {
        let missed = |(_, condition): &(usize, Condition)| condition.missed(&x);
        let Some(worst) = conditions(x)
            .enumerate()
            .max_by(|a, b| missed(a).total_cmp(&missed(b)))
        else {
            return x;
        };
        let excess = missed(&worst);
        if excess <= SLACK_M {
            return x;
        }
        if excess < best.0 {
            best = (excess, x);
        }
        let known = kept[..count].iter().position(|(number, _)| *number == worst.0);
        if known.is_some_and(|known| kept[known] == worst) {
            // Rounding, or an empty region.
            break;
        }
        // A sphere that touches a ring replaces the one of a round before.
        let place = known.unwrap_or(if count < MOST_KEPT {
            count
        } else {
            round % MOST_KEPT
        });
        kept[place] = worst;
        count = count.max(place + 1);
        x = nearest_of(target, &kept[..count]);
    }
    best.1
}

/// The point nearest to `target` that meets all of a few conditions, or misses them least: of the points nearest to it on
/// every one, two and three of their borders.
fn nearest_of(target: &Vector3<f64>, conditions: &[(usize, Condition)]) -> Vector3<f64> {
    let rank = |x: &Vector3<f64>| {
        let missed = conditions.iter().map(|(_, condition)| condition.missed(x));
        (missed.fold(SLACK_M, f64::max), (x - target).norm_squared())
    };
    let mut best = (rank(target), *target);
    for subset in 1_u32..1 << conditions.len() {
        if subset.count_ones() > 3 {
            continue;
        }
        let chosen = conditions.iter().enumerate();
        let chosen = chosen
            .filter(|(i, _)| subset & (1 << i) != 0)
            .map(|(_, (_, condition))| condition);
        for candidate in nearest_on(target, chosen).into_iter().flatten() {
            let rank = rank(&candidate);
            if rank < best.0 {
                best = (rank, candidate);
            }
        }
    }
    best.1
}

/// The points nearest to `target` on up to three borders: two where a line pierces a sphere, none where planes are parallel.
/// Where spheres and planes do not meet, the points of the planes nearest to the sphere.
fn nearest_on<'a>(
    target: &Vector3<f64>,
    borders: impl Iterator<Item = &'a Condition>,
) -> [Option<Vector3<f64>>; 2] {
    let mut sphere = None;
    let (mut planes, mut count) = ([Halfspace::default(); 3], 0);
    for border in borders {
        let plane = match (border, sphere) {
            (Condition::Below(plane), _) => *plane,
            (Condition::Within { centre, radius } | Condition::Beyond { centre, radius }, None) => {
                sphere = Some((*centre, *radius));
                continue;
            }
            // Where two spheres meet is where a sphere meets the plane of equal powers.
            (
                Condition::Within { centre, radius } | Condition::Beyond { centre, radius },
                Some((first, first_radius)),
            ) => {
                let between = centre - first;
                let distance = between.norm();
                if distance <= SLACK_M {
                    return [None; 2];
                }
                let n = between / distance;
                let along = 0.5 * (distance + (first_radius - radius) * (first_radius + radius) / distance);
                Halfspace {
                    n,
                    h: n.dot(&first) + along,
                }
            }
        };
        planes[count] = plane;
        count += 1;
    }
    let planes = &planes[..count];
    let Some((centre, radius)) = sphere else {
        return [on_all(target, planes), None];
    };
    let (Some(target), Some(middle)) = (on_all(target, planes), on_all(&centre, planes)) else {
        return [None; 2];
    };
    // On the planes the sphere is a sphere, a circle or two points about `middle`.
    let distance = (middle - centre).norm();
    let radius = ((radius - distance) * (radius + distance)).max(0.0).sqrt();
    let away = target - middle;
    let length = away.norm();
    let direction = match planes {
        _ if length > 0.0 => away / length,
        [] => Vector3::z(),
        [plane] => any_across(&plane.n),
        [first, second, ..] => first.n.cross(&second.n).normalize(),
    };
    let point = |sign: f64| Some(middle + direction * (sign * radius));
    [point(1.0), if planes.len() == 2 { point(-1.0) } else { None }]
}

/// A unit vector across `n`.
fn any_across(n: &Vector3<f64>) -> Vector3<f64> {
    let axis = if n.x.abs() < 0.7 {
        Vector3::x()
    } else {
        Vector3::y()
    };
    n.cross(&axis).normalize()
}

/// The point nearest to `start` on all planes, up to three; none if they are dependent.
fn on_all(start: &Vector3<f64>, planes: &[Halfspace]) -> Option<Vector3<f64>> {
    let (mut gram, mut right) = (Matrix3::identity(), Vector3::zeros());
    for (i, plane) in planes.iter().enumerate() {
        right[i] = plane.n.dot(start) - plane.h;
        for (j, other) in planes.iter().enumerate() {
            gram[(i, j)] = plane.n.dot(&other.n);
        }
    }
    if gram.determinant() < DEPENDENT {
        return None;
    }
    let push = gram.try_inverse()? * right;
    let moved = planes.iter().zip(push.iter()).map(|(plane, p)| plane.n * *p);
    Some(start - moved.sum::<Vector3<f64>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in ±1 (SplitMix64).
    fn numbers(seed: u64) -> impl Iterator<Item = f64> {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        })
    }

    fn vector(numbers: &mut impl Iterator<Item = f64>) -> Vector3<f64> {
        Vector3::from_fn(|_, _| numbers.next().unwrap_or_default())
    }

    type Projection = Box<dyn Fn(&Vector3<f64>) -> Vector3<f64>>;

    /// Dykstra's alternating projections, a second algorithm for the same point.
    fn dykstra(target: &Vector3<f64>, sets: &[impl Fn(&Vector3<f64>) -> Vector3<f64>]) -> Vector3<f64> {
        let mut x = *target;
        let mut left = vec![Vector3::zeros(); sets.len()];
        for _ in 0..20_000 {
            for (project, left) in sets.iter().zip(&mut left) {
                let y = x + *left;
                x = project(&y);
                *left = y - x;
            }
        }
        x
    }

    fn below(space: Halfspace) -> impl Fn(&Vector3<f64>) -> Vector3<f64> {
        move |x| x - space.n * (space.n.dot(x) - space.h).max(0.0)
    }

    /// Two balls as of two legs and three cuts, all around a point.
    fn region(numbers: &mut impl Iterator<Item = f64>) -> Region {
        let mut region = Region::new(2);
        for _ in 0..2 {
            let centre = vector(numbers) * 0.3;
            region.add(Reach {
                arm: vector(numbers) * 0.1,
                centre,
                least_m: 0.0,
                largest_m: centre.norm() + 0.4,
            });
        }
        for c in 0..3 {
            let n = vector(numbers).normalize();
            region.cut(c, Halfspace { n, h: 0.05 });
        }
        region
    }

    #[test]
    fn the_nearest_point_is_that_of_alternating_projections() {
        let numbers = &mut numbers(7);
        for _ in 0..100 {
            let region = region(numbers);
            let target = vector(numbers);
            let balls = region.shells.clone();
            let mut sets: Vec<Projection> = Vec::new();
            for ball in balls {
                sets.push(Box::new(move |x| {
                    let away = x + ball.arm - ball.centre;
                    let size = away.norm();
                    x - away * (1.0 - ball.largest_m / size).max(0.0)
                }));
            }
            for (_, cut) in &region.cuts {
                sets.push(Box::new(below(*cut)));
            }
            let found = region.nearest(&target);
            let expected = dykstra(&target, &sets);
            assert!(
                (found - expected).norm() < 1e-7,
                "{:e}",
                (found - expected).norm()
            );
            assert!(region.contains(&found));
        }
    }

    #[test]
    fn the_best_motion_is_nearest_in_what_it_causes() {
        let numbers = &mut numbers(8);
        for _ in 0..100 {
            let region = region(numbers);
            let wanted = vector(numbers);
            let rate =
                Matrix3::identity() + Matrix3::from_fn(|_, _| 0.4 * numbers.next().unwrap_or_default());
            let Some(inverse) = rate.try_inverse() else {
                continue;
            };
            let origin = Vector3::zeros();
            let spaces: Vec<_> = region.conditions(origin).map(|c| c.linearised(&origin)).collect();
            // n · x ≤ h of the motion is (D⁻ᵀ n) · y ≤ h of what it causes.
            let sets: Vec<_> = spaces
                .iter()
                .map(|space| {
                    let n = inverse.tr_mul(&space.n);
                    below(Halfspace {
                        n: n.normalize(),
                        h: space.h / n.norm(),
                    })
                })
                .collect();
            let expected = inverse * dykstra(&wanted, &sets);
            let found = region.best_motion(&wanted, &origin, &inverse);
            assert!((found - expected).norm() < 1e-7, "{found} {expected}");
        }
    }

    #[test]
    fn a_point_too_near_is_pushed_out_of_the_shell() {
        let mut region = Region::new(1);
        region.add(Reach {
            arm: Vector3::new(0.0, 0.1, 0.0),
            centre: Vector3::zeros(),
            least_m: 0.5,
            largest_m: 1.0,
        });
        let found = region.nearest(&Vector3::new(0.2, -0.1, 0.0));
        assert!((found - Vector3::new(0.5, -0.1, 0.0)).norm() < 1e-12, "{found}");
    }

    #[test]
    fn a_cut_replaces_the_older_one_of_its_joint() {
        let mut region = Region::new(0);
        let cut = |h| Halfspace { n: Vector3::x(), h };
        region.cut(4, cut(0.1));
        region.cut(4, cut(0.3));
        let found = region.nearest(&Vector3::x());
        assert!((found - Vector3::new(0.3, 0.0, 0.0)).norm() < 1e-15, "{found}");
    }

    /// Shoulders of arms with random elbows and wrists are within the ring, those a little further are not.
    #[test]
    fn a_ring_is_where_the_shoulder_of_an_arm_can_be() {
        let numbers = &mut numbers(9);
        let ring = Ring {
            arm: Vector3::new(0.0, 0.2, 0.3),
            wrist: Vector3::new(0.3, 0.1, 0.2),
            axis: Vector3::new(1.0, 2.0, -1.0).normalize(),
            forearm_m: 0.25,
            upper_arm_m: 0.2,
        };
        let mut region = Region::new(1);
        region.add_ring(ring);
        let side = any_across(&ring.axis);
        for _ in 0..1000 {
            let turn = 4.0 * numbers.next().unwrap_or_default();
            let forearm = side * turn.cos() + ring.axis.cross(&side) * turn.sin();
            let elbow = ring.wrist + forearm * ring.forearm_m;
            let shoulder = elbow + vector(numbers).normalize() * ring.upper_arm_m;
            assert!(region.contains(&(shoulder - ring.arm)));
            let beyond = elbow + forearm * (ring.upper_arm_m + 1e-9) - ring.arm;
            assert!(!region.contains(&beyond));
            let target = beyond + vector(numbers) * 0.1;
            let found = region.nearest(&target);
            let [nearest, farthest] = ring.nearest_and_farthest(&found);
            assert!((found - nearest).norm() < ring.upper_arm_m + 1e-9);
            assert!((found - farthest).norm() > ring.upper_arm_m - 1e-9);
            // Beyond the circle's nearest point the foot of the target is on the line to that point.
            let [nearest, _] = ring.nearest_and_farthest(&target);
            let away = target - nearest;
            if away.norm() > ring.upper_arm_m {
                let expected = nearest + away * (ring.upper_arm_m / away.norm());
                assert!(
                    (found - expected).norm() < 1e-9,
                    "{:e}",
                    (found - expected).norm()
                );
            }
        }
    }
}
