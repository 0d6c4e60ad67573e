//! One control step as a method sees it: only slices and numbers.
//!
//! Law: memory only accelerates. Whatever of the past may influence an answer is in the step, so any step can be
//! replayed bit for bit from its record.

use crate::problem::PhaseId;

/// Input of one control step.
#[derive(Clone, Copy, Debug)]
pub struct ControlStep<'a> {
    /// Previous configuration q⁻ (length nq).
    pub q_prev: &'a [f64],
    /// Velocity that led to it, Δq⁻/Δt (length nv).
    pub v_prev: &'a [f64],
    /// Time step (s).
    pub dt_s: f64,
    /// Which tasks count, and how much.
    pub phase: PhaseId,
    /// Target samples around now.
    pub targets: Window<'a>,
    /// Admissible Δq.
    pub bounds: Bounds<'a>,
    /// One gain γ per objective of the problem, already ramped; the objective moves the joints by `−γ ∇H` per second.
    pub gains: &'a [f64],
}

/// The exact interval of each component of Δq; root components are unbounded.
#[derive(Clone, Copy, Debug)]
pub struct Bounds<'a> {
    /// Least increments (length nv).
    pub lo: &'a [f64],
    /// Largest increments (length nv).
    pub hi: &'a [f64],
    /// Number of joints whose previous position was outside the boundary.
    pub outside: usize,
}

/// One target sample: x and ẋ of all tasks, in the problem's slots.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Targets.
    pub x: &'a [f64],
    /// Target rates.
    pub xdot: &'a [f64],
}

/// Target samples k−1, k, k+1 … k+h on the control grid, each `[x | ẋ]`, in one flat slice.
#[derive(Clone, Copy, Debug)]
pub struct Window<'a> {
    data: &'a [f64],
    nx: usize,
    nxdot: usize,
}

impl<'a> Window<'a> {
    /// A window over `data`, whose length is at least two and a whole number of samples of `nx + nxdot` numbers.
    ///
    /// # Errors
    /// The number of values that would be right, if `data` has another length.
    pub fn new(data: &'a [f64], nx: usize, nxdot: usize) -> Result<Self, usize> {
        let width = nx + nxdot;
        if width == 0 || data.len() < 2 * width || !data.len().is_multiple_of(width) {
            return Err(2 * width);
        }
        Ok(Self { data, nx, nxdot })
    }

    fn sample(&self, index: usize) -> Sample<'a> {
        let width = self.nx + self.nxdot;
        let (x, xdot) = self.data[index * width..(index + 1) * width].split_at(self.nx);
        Sample { x, xdot }
    }

    /// The sample of this step, k.
    pub fn now(&self) -> Sample<'a> {
        self.sample(1)
    }

    /// The sample of the previous step, k−1.
    pub fn previous(&self) -> Sample<'a> {
        self.sample(0)
    }

    /// How many samples after this step are known.
    pub fn preview_len(&self) -> usize {
        self.data.len() / (self.nx + self.nxdot) - 2
    }

    /// The sample of step k+i, for i up to [`Window::preview_len`].
    pub fn ahead(&self, i: usize) -> Option<Sample<'a>> {
        (i <= self.preview_len()).then(|| self.sample(1 + i))
    }
}
