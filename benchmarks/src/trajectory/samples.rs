//! Sampling: one flat buffer of `[x | ẋ]` per scenario, of which every control step sees a part.

use super::targets::{Trajectory, row_name};
use crate::error::InputError;
use ik_core::problem::Problem;
use ik_core::spatial::{rpy, so3};
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Track};
use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Where target rates come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rates {
    /// The derivative of the trajectory at t_k.
    #[default]
    Analytic,
    /// Backward difference of the samples; the target stands still before t = 0.
    Difference,
    /// No rates are supplied.
    Zero,
}

impl Rates {
    /// All of them by the words of suites and commands.
    pub const WORDS: [(&'static str, Self); 3] = [
        ("analytic", Self::Analytic),
        ("difference", Self::Difference),
        ("zero", Self::Zero),
    ];

    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Analytic => "analytic",
            Self::Difference => "difference",
            Self::Zero => "zero",
        }
    }
}

/// Most control steps of a run: beyond this a time step is taken for a slip.
const MOST_STEPS: f64 = 1e6;
/// Relative slack when the duration is divided by the time step, so that 3 s / 0.005 s are 600 steps.
const STEP_SLACK: f64 = 1e-9;

/// The sampled targets of a scenario: k = 0 … N, then the preview.
#[derive(Clone, Debug)]
pub struct Samples {
    data: Vec<f64>,
    nx: usize,
    nxdot: usize,
    steps: usize,
    preview: usize,
}

/// The time grid of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Δt (s).
    pub dt_s: f64,
    /// N.
    pub steps: usize,
    /// Samples known beyond the current step.
    pub preview: usize,
}

impl Grid {
    /// The whole steps that fit into `duration_s`.
    ///
    /// # Errors
    /// A time step that is not a positive number or leaves no step, or too many.
    pub fn new(dt_s: f64, duration_s: f64, preview_s: f64, place: &str) -> Result<Self, InputError> {
        crate::error::positive(place, "dt_s", dt_s)?;
        crate::error::positive(place, "duration_s", duration_s)?;
        if !(preview_s.is_finite() && preview_s >= 0.0) {
            return Err(InputError::value(
                place,
                "preview_s",
                preview_s,
                "a finite number, not negative",
            ));
        }
        let steps = (duration_s / dt_s * (1.0 + STEP_SLACK)).floor();
        let preview = (preview_s / dt_s * (1.0 + STEP_SLACK)).floor();
        if !(1.0..=MOST_STEPS).contains(&(steps + preview)) || steps < 1.0 {
            let allowed = format!("at most duration_s = {duration_s}, and at most {MOST_STEPS} steps in all");
            return Err(InputError::value(place, "dt_s", dt_s, &allowed));
        }
        #[allow(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked to be 0 .. 1e6"
        )]
        Ok(Self {
            dt_s,
            steps: steps as usize,
            preview: preview as usize,
        })
    }

    /// Time of sample k (s).
    pub fn time(&self, k: usize) -> f64 {
        #[allow(clippy::cast_precision_loss, reason = "at most 1e6 samples")]
        let k = k as f64;
        k * self.dt_s
    }
}

impl Samples {
    /// Samples a trajectory on a grid.
    ///
    /// # Errors
    /// A target that is not finite, with its task, component and time.
    pub fn new(
        problem: &Problem,
        trajectory: &Trajectory,
        grid: Grid,
        rates: Rates,
        place: &str,
    ) -> Result<Self, InputError> {
        let (nx, nxdot) = (problem.nx(), problem.nxdot());
        let count = grid.steps + grid.preview + 1;
        let mut data = vec![0.0; count * (nx + nxdot)];
        let (mut value, mut rate) = (vec![0.0; nxdot], vec![0.0; nxdot]);
        for k in 0..count {
            trajectory.value_into(grid.time(k), &mut value);
            trajectory.rate_into(grid.time(k), &mut rate);
            check_finite(problem, grid.time(k), &value, &rate, place)?;
            let (before, rest) = data.split_at_mut(k * (nx + nxdot));
            let (x, xdot) = rest[..nx + nxdot].split_at_mut(nx);
            encode(problem, &value, &rate, x, xdot);
            match rates {
                Rates::Analytic => {}
                Rates::Zero => xdot.fill(0.0),
                Rates::Difference if k == 0 => xdot.fill(0.0),
                Rates::Difference => {
                    let previous = &before[(k - 1) * (nx + nxdot)..][..nx];
                    difference(problem, previous, x, grid.dt_s, xdot);
                }
            }
        }
        Ok(Self {
            data,
            nx,
            nxdot,
            steps: grid.steps,
            preview: grid.preview,
        })
    }

    /// The one sample `[x | ẋ]` at `t` (s), with exact rates.
    ///
    /// # Errors
    /// As [`Samples::new`].
    pub(crate) fn at(
        problem: &Problem,
        trajectory: &Trajectory,
        t: f64,
        place: &str,
    ) -> Result<Vec<f64>, InputError> {
        let (mut value, mut rate) = (vec![0.0; problem.nxdot()], vec![0.0; problem.nxdot()]);
        trajectory.value_into(t, &mut value);
        trajectory.rate_into(t, &mut rate);
        check_finite(problem, t, &value, &rate, place)?;
        let mut sample = vec![0.0; problem.nx() + problem.nxdot()];
        let (x, xdot) = sample.split_at_mut(problem.nx());
        encode(problem, &value, &rate, x, xdot);
        Ok(sample)
    }

    /// N, the number of control steps.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// What step k (from 1) may see: samples k−1, k, and the preview.
    pub fn window(&self, k: usize) -> Window<'_> {
        Window::new(self.seen(k), self.nx, self.nxdot).expect("the buffer holds whole samples, two at least")
    }

    /// The numbers behind [`Samples::window`].
    pub fn seen(&self, k: usize) -> &[f64] {
        let width = self.nx + self.nxdot;
        &self.data[(k - 1) * width..(k + 1 + self.preview) * width]
    }

    /// Samples k = 0 … N, each `[x | ẋ]`.
    pub fn judged(&self) -> &[f64] {
        &self.data[..(self.steps + 1) * (self.nx + self.nxdot)]
    }
}

fn check_finite(
    problem: &Problem,
    t: f64,
    value: &[f64],
    rate: &[f64],
    place: &str,
) -> Result<(), InputError> {
    let Some(row) = (0..value.len()).find(|&i| !(value[i].is_finite() && rate[i].is_finite())) else {
        return Ok(());
    };
    let field = format!("target {} at t = {t} s", row_name(problem, row));
    let found = format!("{} with rate {}", value[row], rate[row]);
    Err(InputError::value(place, &field, found, "finite numbers"))
}

/// Writes a target in the problem's coordinates from plain ones (orientations as roll, pitch, yaw).
fn encode(problem: &Problem, value: &[f64], rate: &[f64], x: &mut [f64], xdot: &mut [f64]) {
    for (task, slot) in problem.tasks().iter().zip(problem.slots()) {
        let rows = task.track.rows(problem.robot());
        let (value, rate) = (
            &value[slot.xdot..slot.xdot + rows],
            &rate[slot.xdot..slot.xdot + rows],
        );
        let plain = turn_at(problem, &task.track).unwrap_or(rows);
        x[slot.x..slot.x + plain].copy_from_slice(&value[..plain]);
        xdot[slot.xdot..slot.xdot + plain].copy_from_slice(&rate[..plain]);
        if plain < rows {
            let angles = Vector3::from_column_slice(&value[plain..]);
            let speeds = Vector3::from_column_slice(&rate[plain..]);
            let turn = UnitQuaternion::from_euler_angles(angles.x, angles.y, angles.z);
            let omega = rpy::rates_to_angular_velocity(&angles, &speeds);
            x[slot.x + plain..slot.x + plain + 4].copy_from_slice(turn.coords.as_slice());
            xdot[slot.xdot + plain..slot.xdot + rows].copy_from_slice(omega.as_slice());
        }
    }
}

/// Writes `(x_k ⊖ x_{k−1}) / Δt`.
fn difference(problem: &Problem, before: &[f64], now: &[f64], dt_s: f64, xdot: &mut [f64]) {
    for (task, slot) in problem.tasks().iter().zip(problem.slots()) {
        let rows = task.track.rows(problem.robot());
        let plain = turn_at(problem, &task.track).unwrap_or(rows);
        for i in 0..plain {
            xdot[slot.xdot + i] = (now[slot.x + i] - before[slot.x + i]) / dt_s;
        }
        if plain < rows {
            let turn = |x: &[f64]| {
                let c = &x[slot.x + plain..slot.x + plain + 4];
                UnitQuaternion::new_normalize(nalgebra::Quaternion::new(c[3], c[0], c[1], c[2]))
            };
            let step = so3::log_quaternion(&(turn(now) * turn(before).inverse())) / dt_s;
            xdot[slot.xdot + plain..slot.xdot + rows].copy_from_slice(step.as_slice());
        }
    }
}

/// First row of a task that is written as a quaternion, if any is.
fn turn_at(problem: &Problem, track: &Track) -> Option<usize> {
    match (track, problem.orientation()) {
        (_, OrientationCoordinates::RollPitchYaw) => None,
        (Track::Orientation(_), OrientationCoordinates::Log) => Some(0),
        (Track::Pose(_), OrientationCoordinates::Log) => Some(3),
        _ => None,
    }
}
