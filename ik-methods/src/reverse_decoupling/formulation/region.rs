//! Where the root may stand: in the shells that limbs span, and on the right side of cuts along the limits of other joints.

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

impl Reach {
    /// Where the origin of the root would be if the point were in the centre (m, world).
    fn middle(&self) -> Vector3<f64> {
        self.centre - self.arm
    }
}

/// `n · x ≤ h`, |n| = 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Halfspace {
    n: Vector3<f64>,
    h: f64,
}

impl Halfspace {
    /// The nearer side of a shell, linearised at `origin`.
    fn of(shell: &Reach, origin: &Vector3<f64>) -> Self {
        let away = origin - shell.middle();
        let distance = away.norm();
        let n = if distance > 0.0 {
            away / distance
        } else {
            Vector3::z()
        };
        let offset = n.dot(origin) - distance;
        if distance > 0.5 * (shell.least_m + shell.largest_m) {
            Self {
                n,
                h: offset + shell.largest_m,
            }
        } else {
            Self {
                n: -n,
                h: -(offset + shell.least_m),
            }
        }
    }

    /// Where something with gradient `rate` at `origin` is less by `excess` than there; none if it does not change.
    pub(super) fn below(origin: &Vector3<f64>, rate: &Vector3<f64>, excess: f64) -> Option<Self> {
        let norm = rate.norm();
        (norm > 0.0).then(|| Self {
            n: rate / norm,
            h: (rate.dot(origin) - excess) / norm,
        })
    }
}

/// Most halfspaces that are taken into account at once: those of four limbs and as many cuts.
const MOST: usize = 8;
/// Most surfaces: both sides of the shells of four limbs, and cuts.
const MOST_SURFACES: usize = 12;
/// Gram determinants below this, of unit normals, are those of dependent planes.
const DEPENDENT: f64 = 1e-12;
/// Conditions missed by less than this (m) hold.
const SLACK_M: f64 = 1e-12;

/// What bounds the region.
#[derive(Clone, Copy, Debug)]
enum Surface {
    Sphere { centre: Vector3<f64>, radius: f64 },
    Plane(Halfspace),
}

/// Shells and cuts of one control step; sized once.
#[derive(Debug)]
pub(super) struct Region {
    shells: Vec<Reach>,
    /// Cuts with the joint coordinate they belong to.
    cuts: Vec<(usize, Halfspace)>,
}

impl Region {
    /// Room for the shells of `limbs` limbs.
    pub(super) fn new(limbs: usize) -> Self {
        Self {
            shells: Vec::with_capacity(limbs),
            cuts: Vec::with_capacity(MOST),
        }
    }

    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        self.shells.clear();
        self.cuts.clear();
    }

    /// Adds a shell.
    pub(super) fn add(&mut self, shell: Reach) {
        self.shells.push(shell);
    }

    /// Adds a cut along the limit of a joint coordinate, in place of an older one; beyond [`MOST`] the oldest goes.
    pub(super) fn cut(&mut self, coordinate: usize, cut: Halfspace) {
        self.cuts.retain(|(other, _)| *other != coordinate);
        if self.cuts.len() == self.cuts.capacity() {
            self.cuts.remove(0);
        }
        self.cuts.push((coordinate, cut));
    }

    /// Whether a point is in the region.
    pub(super) fn contains(&self, x: &Vector3<f64>) -> bool {
        self.missed(x) <= SLACK_M
    }

    /// By how much a point misses the region (m): the greatest of all conditions, 0 inside.
    fn missed(&self, x: &Vector3<f64>) -> f64 {
        let of_shell = |shell: &Reach| {
            let distance = (x - shell.middle()).norm();
            (distance - shell.largest_m).max(shell.least_m - distance)
        };
        let shells = self.shells.iter().map(of_shell);
        let cuts = self.cuts.iter().map(|(_, cut)| cut.n.dot(x) - cut.h);
        shells.chain(cuts).fold(0.0, f64::max)
    }

    /// The motion dx from `origin` that comes nearest to `D dx = wanted` within cuts, and shells in linear approximation;
    /// `inverse` is that of D.
    pub(super) fn best_motion(
        &self,
        wanted: &Vector3<f64>,
        origin: &Vector3<f64>,
        inverse: &Matrix3<f64>,
    ) -> Vector3<f64> {
        let (mut spaces, count) = self.linearised(origin);
        for space in &mut spaces[..count] {
            // n · dx = (D⁻ᵀ n) · (D dx)
            let n = inverse.tr_mul(&space.n);
            let norm = n.norm();
            *space = Halfspace {
                n: n / norm,
                h: (space.h - space.n.dot(origin)) / norm,
            };
        }
        inverse * nearest_in(wanted, &spaces[..count])
    }

    /// The point nearest to `target` in the region; where it is empty, one of those that miss least.
    ///
    /// It is the nearest point of one, two or three of the surfaces, and all of these are tried: the region need not be convex.
    pub(super) fn nearest(&self, target: &Vector3<f64>) -> Vector3<f64> {
        let (surfaces, count) = self.surfaces();
        let surfaces = &surfaces[..count];
        let rank = |x: &Vector3<f64>| (self.missed(x).max(SLACK_M), (x - target).norm_squared());
        let mut best = (rank(target), *target);
        if best.0.0 <= SLACK_M {
            return *target;
        }
        for subset in 1_u32..1 << count {
            if subset.count_ones() > 3 {
                continue;
            }
            let chosen = (0..count).filter(|i| subset & (1 << i) != 0);
            for candidate in nearest_on(target, chosen.map(|i| &surfaces[i]))
                .into_iter()
                .flatten()
            {
                let rank = rank(&candidate);
                if rank < best.0 {
                    best = (rank, candidate);
                }
            }
        }
        best.1
    }

    fn surfaces(&self) -> ([Surface; MOST_SURFACES], usize) {
        let mut surfaces = [Surface::Plane(Halfspace::default()); MOST_SURFACES];
        let spheres = self.shells.iter().flat_map(|shell| {
            let sphere = |radius| Surface::Sphere {
                centre: shell.middle(),
                radius,
            };
            [sphere(shell.largest_m), sphere(shell.least_m)]
        });
        let spheres =
            spheres.filter(|sphere| !matches!(sphere, Surface::Sphere { radius, .. } if *radius <= SLACK_M));
        let planes = self.cuts.iter().rev().map(|(_, cut)| Surface::Plane(*cut));
        let mut count = 0;
        for (to, surface) in surfaces.iter_mut().zip(spheres.chain(planes)) {
            *to = surface;
            count += 1;
        }
        (surfaces, count)
    }

    /// Halfspaces that touch the nearer sides of all shells as seen from `origin`, and the cuts.
    fn linearised(&self, origin: &Vector3<f64>) -> ([Halfspace; MOST], usize) {
        let mut spaces = [Halfspace::default(); MOST];
        let shells = self.shells.iter().map(|shell| Halfspace::of(shell, origin));
        let all = shells.chain(self.cuts.iter().rev().map(|(_, cut)| *cut));
        let mut count = 0;
        for (to, space) in spaces.iter_mut().zip(all) {
            *to = space;
            count += 1;
        }
        (spaces, count)
    }
}

/// The point nearest to `start` in all halfspaces: of the faces, edges and corners the one that all of its planes push to
/// and that misses no other. Where there is none, the one that misses least.
fn nearest_in(start: &Vector3<f64>, spaces: &[Halfspace]) -> Vector3<f64> {
    let miss = |x: &Vector3<f64>| spaces.iter().map(|s| s.n.dot(x) - s.h).fold(0.0, f64::max);
    let (mut best, mut least) = (*start, miss(start));
    for subset in 1_u32..1 << spaces.len() {
        if least <= SLACK_M {
            break;
        }
        if subset.count_ones() > 3 {
            continue;
        }
        let (mut planes, mut count) = ([Halfspace::default(); 3], 0);
        for (_, space) in spaces.iter().enumerate().filter(|(i, _)| subset & (1 << i) != 0) {
            planes[count] = *space;
            count += 1;
        }
        if let Some((candidate, push)) = on_all(start, &planes[..count]) {
            if push.iter().any(|&p| p < 0.0) {
                continue;
            }
            let missed = miss(&candidate);
            if missed < least {
                (best, least) = (candidate, missed);
            }
        }
    }
    best
}

/// The points nearest to `target` on up to three surfaces: two where a line pierces a sphere, none where planes are parallel.
/// Where spheres and planes do not meet, the points of the planes nearest to the sphere.
fn nearest_on<'a>(
    target: &Vector3<f64>,
    surfaces: impl Iterator<Item = &'a Surface>,
) -> [Option<Vector3<f64>>; 2] {
    let mut sphere = None;
    let (mut planes, mut count) = ([Halfspace::default(); 3], 0);
    for surface in surfaces {
        let plane = match (surface, sphere) {
            (Surface::Plane(plane), _) => *plane,
            (Surface::Sphere { centre, radius }, None) => {
                sphere = Some((*centre, *radius));
                continue;
            }
            // Where two spheres meet is where a sphere meets the plane of equal powers.
            (Surface::Sphere { centre, radius }, Some((first, first_radius))) => {
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
        return [on_all(target, planes).map(|(point, _)| point), None];
    };
    let (Some((target, _)), Some((middle, _))) = (on_all(target, planes), on_all(&centre, planes)) else {
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

/// The point nearest to `start` on all planes, up to three, and how far each of them pushed; none if they are dependent.
fn on_all(start: &Vector3<f64>, planes: &[Halfspace]) -> Option<(Vector3<f64>, Vector3<f64>)> {
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
    Some((start - moved.sum::<Vector3<f64>>(), push))
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
            let (spaces, count) = region.linearised(&origin);
            // n · x ≤ h of the motion is (D⁻ᵀ n) · y ≤ h of what it causes.
            let sets: Vec<_> = spaces[..count]
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
}
