//! Random numbers that depend on a seed and a name, and on nothing else.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};

/// SplitMix64 (Steele, Lea & Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
#[derive(Clone, Debug)]
pub(super) struct Numbers(u64);

impl Numbers {
    /// The stream of a seed for a name: rows draw from streams of their own, so none depends on what ran before it. Names
    /// enter by FNV-1a.
    pub(super) fn new(seed: u64, name: &str) -> Self {
        let start = 0xcbf2_9ce4_8422_2325_u64 ^ seed;
        let mix = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
        Self(name.bytes().fold(start, mix))
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [−π, π).
    pub(super) fn angle(&mut self) -> f64 {
        PI * (2.0 * self.unit() - 1.0)
    }

    /// Uniform among 0, …, `count` − 1.
    pub(super) fn below(&mut self, count: usize) -> usize {
        (self.unit() * count as f64) as usize
    }

    /// −1 or 1.
    pub(super) fn sign(&mut self) -> f64 {
        if self.unit() < 0.5 { -1.0 } else { 1.0 }
    }

    /// A direction, uniform on the sphere.
    pub(super) fn direction(&mut self) -> Vector3<f64> {
        let (z, turn) = (2.0 * self.unit() - 1.0, TAU * self.unit());
        let across = (1.0 - z * z).max(0.0).sqrt();
        Vector3::new(across * turn.cos(), across * turn.sin(), z)
    }

    /// A rotation, uniform over all (Shoemake, "Uniform random rotations", Graphics Gems III, 1992).
    pub(super) fn rotation(&mut self) -> UnitQuaternion<f64> {
        let (u, a, b) = (self.unit(), TAU * self.unit(), TAU * self.unit());
        let (near, far) = ((1.0 - u).sqrt(), u.sqrt());
        let quaternion = Quaternion::new(far * b.cos(), near * a.sin(), near * a.cos(), far * b.sin());
        UnitQuaternion::from_quaternion(quaternion)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_repeat_and_differ_by_seed_and_name() {
        let first = |seed, name| Numbers::new(seed, name).bits();
        assert_eq!(first(1, "hubo"), first(1, "hubo"));
        assert_ne!(first(1, "hubo"), first(2, "hubo"));
        assert_ne!(first(1, "hubo"), first(1, "asimo"));
    }

    #[test]
    fn rotations_are_uniform() {
        let mut numbers = Numbers::new(3, "rotations");
        let (mut sum, mut squares) = (Vector3::zeros(), 0.0);
        for _ in 0..20_000 {
            let axis = numbers.rotation() * numbers.direction();
            sum += axis;
            squares += axis.z * axis.z;
        }
        assert!(sum.norm() / 20_000.0 < 0.02, "{sum}");
        // The z of a point of the sphere is uniform: its square is 1/3 on average.
        assert!((squares / 20_000.0 - 1.0 / 3.0).abs() < 0.01, "{squares}");
    }
}
