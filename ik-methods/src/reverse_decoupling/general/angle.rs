//! Angles that carry cosine and sine, and functions linear in them.

use super::wrap;
use nalgebra::Vector3;

/// An angle with its cosine and sine.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Angle {
    pub(super) value: f64,
    pub(super) cos: f64,
    pub(super) sin: f64,
}

impl Angle {
    pub(super) fn new(value: f64) -> Self {
        let (sin, cos) = value.sin_cos();
        Self { value, cos, sin }
    }

    /// Direction of (x, y), which must not be zero.
    pub(super) fn of(x: f64, y: f64) -> Self {
        let length = x.hypot(y);
        Self {
            value: wrap(y.atan2(x)),
            cos: x / length,
            sin: y / length,
        }
    }

    /// The matrix of these columns times Rz(−angle).
    pub(super) fn unturn(&self, [x, y, z]: [Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        [x * self.cos - y * self.sin, x * self.sin + y * self.cos, z]
    }

    /// The matrix of these columns times Rx(−angle).
    pub(super) fn untwist(&self, [x, y, z]: [Vector3<f64>; 3]) -> [Vector3<f64>; 3] {
        [x, y * self.cos - z * self.sin, y * self.sin + z * self.cos]
    }

    /// The vector times Rx(−angle).
    pub(super) fn untwisted(&self, v: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(
            v.x,
            self.cos * v.y + self.sin * v.z,
            self.cos * v.z - self.sin * v.y,
        )
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            value: wrap(self.value + other.value),
            cos: self.cos * other.cos - self.sin * other.sin,
            sin: self.sin * other.cos + self.cos * other.sin,
        }
    }
}

/// `one + cos · cos τ + sin · sin τ`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Harmonic {
    pub(super) one: f64,
    pub(super) cos: f64,
    pub(super) sin: f64,
}

impl Harmonic {
    pub(super) fn at(&self, cos: f64, sin: f64) -> f64 {
        self.one + self.cos * cos + self.sin * sin
    }

    pub(super) fn slope(&self, cos: f64, sin: f64) -> f64 {
        self.sin * cos - self.cos * sin
    }
}
