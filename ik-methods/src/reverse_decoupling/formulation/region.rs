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

/// `n · x ≤ h`, |n| = 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Halfspace {
    n: Vector3<f64>,
    h: f64,
}

impl Halfspace {
    /// The nearer side of a shell, linearised at `origin`.
    fn of(shell: &Reach, origin: &Vector3<f64>) -> Self {
        let away = origin + shell.arm - shell.centre;
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
/// Most linearisations of the shells for one projection. Each leaves an error of second order in the last move.
const LINEARISATIONS: usize = 20;
/// A projection that moves less than this (m) is at its end.
const SETTLED_M: f64 = 1e-13;
/// Gram determinants below this, of unit normals, are those of dependent planes.
const DEPENDENT: f64 = 1e-12;
/// Halfspaces missed by less than this (m) hold.
const SLACK_M: f64 = 1e-12;

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
        let (spaces, count) = self.linearised(x);
        spaces[..count]
            .iter()
            .all(|space| space.n.dot(x) - space.h <= SLACK_M)
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

    /// The point nearest to `target` in the region, found from `from` on; best effort where the region is empty.
    pub(super) fn nearest(&self, target: &Vector3<f64>, from: &Vector3<f64>) -> Vector3<f64> {
        let mut x = *from;
        for _ in 0..LINEARISATIONS {
            let (spaces, count) = self.linearised(&x);
            let next = nearest_in(target, &spaces[..count]);
            let moved = (next - x).norm();
            x = next;
            if moved < SETTLED_M {
                break;
            }
        }
        x
    }

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
        if let Some(candidate) = on_all(start, spaces, subset) {
            let missed = miss(&candidate);
            if missed < least {
                (best, least) = (candidate, missed);
            }
        }
    }
    best
}

/// The point nearest to `start` on all planes of the subset, if they are independent and all of them push.
fn on_all(start: &Vector3<f64>, spaces: &[Halfspace], subset: u32) -> Option<Vector3<f64>> {
    let (mut gram, mut right) = (Matrix3::identity(), Vector3::zeros());
    let mut members = [Halfspace::default(); 3];
    let mut size = 0;
    for (i, space) in spaces.iter().enumerate() {
        if subset & (1 << i) != 0 {
            members[size] = *space;
            size += 1;
        }
    }
    for i in 0..size {
        right[i] = members[i].n.dot(start) - members[i].h;
        for j in 0..size {
            gram[(i, j)] = members[i].n.dot(&members[j].n);
        }
    }
    if gram.determinant() < DEPENDENT {
        return None;
    }
    let push = gram.try_inverse()? * right;
    if push.iter().any(|&p| p < 0.0) {
        return None;
    }
    let moved = members.iter().zip(push.iter()).map(|(space, p)| space.n * *p);
    Some(start - moved.sum::<Vector3<f64>>())
}
