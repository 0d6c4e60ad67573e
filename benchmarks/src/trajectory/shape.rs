//! The shapes trajectories are made of, each with its exact derivative.
//!
//! The functions are those of the Coman experiments (`bump` and `ss`) and a plain sine; units are those of the component they act on.

use crate::error::{InputError, finite, positive};
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// One term of a trajectory as a function of time t (s) since the term began.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shape {
    /// `A (1 − cos(2πt/T)) / 2`: up and down again in T.
    Bump {
        /// A (m or rad).
        amplitude: f64,
        /// T (s).
        period_s: f64,
    },
    /// `A ss(t/r)`, ss the quintic from 0 to 1 with vanishing first and second derivatives at both ends.
    SmoothStep {
        /// A (m or rad).
        amplitude: f64,
        /// r (s).
        rise_s: f64,
    },
    /// `A ss(t/r) sin(2πt/T)`: an oscillation that fades in.
    SmoothSine {
        /// A (m or rad).
        amplitude: f64,
        /// r (s).
        rise_s: f64,
        /// T (s).
        period_s: f64,
    },
    /// `A sin(2πt/T)`: an oscillation that begins at full speed.
    Sine {
        /// A (m or rad).
        amplitude: f64,
        /// T (s).
        period_s: f64,
    },
    /// A constant added to the value at the start.
    Offset {
        /// The constant (m or rad).
        value: f64,
    },
    /// A constant in place of the value at the start: other terms add to it.
    Hold {
        /// The constant (m or rad).
        value: f64,
    },
}

impl Shape {
    /// Value at time t (s) since the term began; that of [`Shape::Hold`] is its constant.
    pub fn value(&self, t: f64) -> f64 {
        match *self {
            Self::Bump { amplitude, period_s } => amplitude * (1.0 - (TAU * t / period_s).cos()) / 2.0,
            Self::SmoothStep { amplitude, rise_s } => amplitude * smooth_step(t / rise_s),
            Self::SmoothSine {
                amplitude,
                rise_s,
                period_s,
            } => amplitude * smooth_step(t / rise_s) * (TAU * t / period_s).sin(),
            Self::Sine { amplitude, period_s } => amplitude * (TAU * t / period_s).sin(),
            Self::Offset { value } | Self::Hold { value } => value,
        }
    }

    /// Derivative with respect to t.
    pub fn rate(&self, t: f64) -> f64 {
        match *self {
            Self::Bump { amplitude, period_s } => amplitude * PI / period_s * (TAU * t / period_s).sin(),
            Self::SmoothStep { amplitude, rise_s } => amplitude * smooth_step_slope(t / rise_s) / rise_s,
            Self::SmoothSine {
                amplitude,
                rise_s,
                period_s,
            } => {
                let (sine, cosine) = (TAU * t / period_s).sin_cos();
                let fading = smooth_step_slope(t / rise_s) / rise_s * sine;
                amplitude * (fading + smooth_step(t / rise_s) * TAU / period_s * cosine)
            }
            Self::Sine { amplitude, period_s } => amplitude * TAU / period_s * (TAU * t / period_s).cos(),
            Self::Offset { .. } | Self::Hold { .. } => 0.0,
        }
    }

    /// Checks every number; `place` and `field` go into the message.
    ///
    /// # Errors
    /// A number that is not finite, or a time that is not above zero.
    pub(crate) fn check(&self, place: &str, field: &str) -> Result<(), InputError> {
        let number = |name: &str, value| finite(place, &format!("{field}.{name}"), value);
        let time = |name: &str, value| positive(place, &format!("{field}.{name}"), value);
        match *self {
            Self::Bump { amplitude, period_s } => {
                number("bump.amplitude", amplitude)?;
                time("bump.period_s", period_s)
            }
            Self::SmoothStep { amplitude, rise_s } => {
                number("smooth-step.amplitude", amplitude)?;
                time("smooth-step.rise_s", rise_s)
            }
            Self::SmoothSine {
                amplitude,
                rise_s,
                period_s,
            } => {
                number("smooth-sine.amplitude", amplitude)?;
                time("smooth-sine.rise_s", rise_s)?;
                time("smooth-sine.period_s", period_s)
            }
            Self::Sine { amplitude, period_s } => {
                number("sine.amplitude", amplitude)?;
                time("sine.period_s", period_s)
            }
            Self::Offset { value } => number("offset.value", value),
            Self::Hold { value } => number("hold.value", value),
        }
    }
}

/// `10u³ − 15u⁴ + 6u⁵`, 0 before and 1 after.
pub(super) fn smooth_step(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (10.0 + u * (-15.0 + u * 6.0))
}

pub(super) fn smooth_step_slope(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    30.0 * u * u * (1.0 - u) * (1.0 - u)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [Shape; 6] = [
        Shape::Bump {
            amplitude: 0.08,
            period_s: 2.0,
        },
        Shape::SmoothStep {
            amplitude: 0.065,
            rise_s: 1.5,
        },
        Shape::SmoothSine {
            amplitude: -0.2,
            rise_s: 1.0,
            period_s: 3.0,
        },
        Shape::Offset { value: 0.3 },
        Shape::Hold { value: -0.7 },
        Shape::Sine {
            amplitude: 0.03,
            period_s: 2.0,
        },
    ];

    #[test]
    fn rates_are_the_derivatives_of_values() {
        // The central difference errs by h²/6 · f''' plus rounding, below 1e-9 for these amplitudes.
        let h = 1e-5;
        for shape in SHAPES {
            for t in [0.0, 0.1, 0.49, 0.77, 1.0, 1.31, 1.5, 2.2, 5.9] {
                let difference = (shape.value(t + h) - shape.value(t - h)) / (2.0 * h);
                assert!((shape.rate(t) - difference).abs() < 1e-8, "{shape:?} at {t}");
            }
        }
    }

    #[test]
    fn shapes_have_the_advertised_values() {
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        near(SHAPES[0].value(0.0), 0.0);
        near(SHAPES[0].value(1.0), 0.08);
        near(SHAPES[1].value(-1.0), 0.0);
        near(SHAPES[1].value(0.75), 0.0325);
        near(SHAPES[1].value(9.0), 0.065);
        near(SHAPES[2].value(0.75), -0.2 * 0.896_484_375);
        near(SHAPES[5].value(0.0), 0.0);
        near(SHAPES[5].value(0.5), 0.03);
        near(SHAPES[5].value(1.5), -0.03);
    }

    #[test]
    fn numbers_that_cannot_be_are_refused_by_name() {
        let bad = Shape::Bump {
            amplitude: f64::NAN,
            period_s: 1.0,
        };
        let message = bad
            .check("s.toml", "scenarios[0].motion[1].shape")
            .unwrap_err()
            .to_string();
        assert_eq!(
            message,
            "s.toml: scenarios[0].motion[1].shape.bump.amplitude = NaN; allowed: a finite number"
        );
        assert!(
            Shape::SmoothStep {
                amplitude: 1.0,
                rise_s: 0.0
            }
            .check("", "")
            .is_err()
        );
        assert!(Shape::Offset { value: f64::INFINITY }.check("", "").is_err());
        let still = Shape::Sine {
            amplitude: 1.0,
            period_s: 0.0,
        };
        let message = still.check("s.toml", "shape").unwrap_err().to_string();
        assert!(message.contains("shape.sine.period_s = 0"), "{message}");
    }
}
