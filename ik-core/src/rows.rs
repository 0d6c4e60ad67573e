//! Task rows: errors, Jacobians and second-order terms of the hard and the compromised tasks, stacked and padded.
//!
//! Rows of compromised tasks come multiplied by the square root of their weight matrix Q, so a method minimises plain
//! squares: `δᵀ Q δ = ‖rows‖²`. Matrices are column-major with a leading dimension padded to a multiple of four; the
//! padding is zero, so kernels may run over whole columns.

use crate::kinematics::Page;
use crate::kinematics::jacobian::for_each_column;
use crate::kinematics::second_order::SecondOrder;
use crate::problem::{Phase, ProblemParts, Slot};
use crate::robot::{Robot, Root};
use crate::spatial::lane::{self, Lane};
use crate::spatial::{rpy, so3};
use crate::step::Sample;
use crate::task::{OrientationCoordinates, Priority, Track};
use crate::weights::WeightFactor;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Rows of one phase.
#[derive(Clone, Debug)]
pub struct RowLayout {
    /// Rows that must hold.
    pub hard: RowSet,
    /// Rows that may be compromised.
    pub soft: RowSet,
}

/// A stack of task rows.
#[derive(Clone, Debug)]
pub struct RowSet {
    blocks: Vec<Block>,
    weights: Vec<(usize, WeightFactor)>,
    groups: Vec<RowGroup>,
    rows: usize,
    coordinates: OrientationCoordinates,
}

/// The rows of one task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RowGroup {
    /// Index of the task in the problem.
    pub task: usize,
    /// First row.
    pub row: usize,
    /// Number of rows.
    pub rows: usize,
}

/// First row, first number of x, first number of ẋ.
#[derive(Clone, Copy, Debug)]
struct At {
    row: usize,
    x: usize,
    xdot: usize,
}

#[derive(Clone, Debug)]
enum Block {
    Frame {
        body: usize,
        p: Vector3<f64>,
        r: Matrix3<f64>,
        position: Option<At>,
        orientation: Option<At>,
    },
    CentreOfMass(At),
    Posture(At),
}

impl RowLayout {
    pub(crate) fn new(parts: &ProblemParts, phase: &Phase, slots: &[Slot]) -> Self {
        let empty = || RowSet {
            blocks: Vec::new(),
            weights: Vec::new(),
            groups: Vec::new(),
            rows: 0,
            coordinates: parts.orientation,
        };
        let (mut hard, mut soft) = (empty(), empty());
        for (task, priority) in &phase.tasks {
            let track = parts.tasks[*task].track;
            match priority {
                Priority::Hard => hard.push(parts, *task, track, slots[*task]),
                Priority::Compromised(weights) => {
                    let rows = track.rows(&parts.robot);
                    if let Some(root) = WeightFactor::new(weights, rows) {
                        soft.weights.push((soft.rows, root));
                    }
                    soft.push(parts, *task, track, slots[*task]);
                }
            }
        }
        Self { hard, soft }
    }
}

impl RowSet {
    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Which rows belong to which task.
    pub fn groups(&self) -> &[RowGroup] {
        &self.groups
    }

    fn push(&mut self, parts: &ProblemParts, task: usize, track: Track, slot: Slot) {
        let rows = track.rows(&parts.robot);
        let at = |offset: usize| At {
            row: self.rows + offset,
            x: slot.x + offset,
            xdot: slot.xdot + offset,
        };
        let frame = |f: crate::robot::FrameId, position, orientation| {
            let (body, r, p) = &parts.robot.aligned_frames[f.0];
            Block::Frame {
                body: *body,
                p: *p,
                r: *r,
                position,
                orientation,
            }
        };
        let block = match track {
            Track::Position(f) => frame(f, Some(at(0)), None),
            Track::Orientation(f) => frame(f, None, Some(at(0))),
            Track::Pose(f) => frame(f, Some(at(0)), Some(at(3))),
            Track::CentreOfMass => Block::CentreOfMass(at(0)),
            Track::Posture => Block::Posture(at(0)),
        };
        self.blocks.push(block);
        self.groups.push(RowGroup {
            task,
            row: self.rows,
            rows,
        });
        self.rows += rows;
    }

    /// Writes error and rate of every row at the page's configuration `q`.
    pub(crate) fn fill_residual(
        &self,
        robot: &Robot,
        q: &[f64],
        page: &Page,
        target: Sample<'_>,
        rows: &mut Rows,
    ) {
        rows.set_height(self.rows);
        for block in &self.blocks {
            match block {
                Block::Frame {
                    body,
                    p,
                    r,
                    position,
                    orientation,
                } => {
                    let pose = &page.bodies[*body];
                    if let Some(at) = position {
                        rows.set_difference(*at, &pose.point(p)[..3], target);
                    }
                    if let Some(at) = orientation {
                        self.orientation_residual(&pose.rotation(r), *at, target, rows);
                    }
                }
                Block::CentreOfMass(at) => rows.set_difference(*at, &page.com[..3], target),
                Block::Posture(at) => rows.set_difference(*at, &q[robot.root().nq()..], target),
            }
        }
        self.weigh(rows, Part::Residual);
    }

    /// Writes the Jacobian of every row at the page's configuration, `target` being the x of a sample.
    pub(crate) fn fill_jacobian(&self, robot: &Robot, page: &Page, target: &[f64], rows: &mut Rows) {
        rows.jacobian.fill(0.0);
        for block in &self.blocks {
            match block {
                Block::Frame {
                    body,
                    p,
                    r,
                    position,
                    orientation,
                } => {
                    let pose = &page.bodies[*body];
                    let point = (*body, pose.point(p));
                    match orientation {
                        Some(at) => {
                            let map = self.row_map(&pose.rotation(r), *at, target);
                            rows.fill_pose(robot, page, point, *position, (at.row, map));
                        }
                        None => rows.fill_position(robot, page, point, *position),
                    }
                }
                Block::CentreOfMass(at) => {
                    for (v, column) in page.com_jacobian.iter().enumerate() {
                        rows.add3(v, at.row, column);
                    }
                }
                Block::Posture(at) => {
                    let first = robot.root().nv();
                    for j in 0..robot.coordinates().len() {
                        let ld = rows.ld;
                        rows.jacobian[(first + j) * ld + at.row + j] = 1.0;
                    }
                }
            }
        }
        self.weigh(rows, Part::Jacobian);
    }

    /// Error and rate of orientation rows.
    fn orientation_residual(&self, r: &Matrix3<f64>, at: At, target: Sample<'_>, rows: &mut Rows) {
        match self.coordinates {
            OrientationCoordinates::RollPitchYaw => {
                let now = rpy::from_matrix(r);
                for k in 0..3 {
                    rows.error[at.row + k] = wrap(now[k] - target.x[at.x + k]);
                    rows.rate[at.row + k] = target.xdot[at.xdot + k];
                }
            }
            OrientationCoordinates::Log => {
                let error = log_error(r, at, target.x);
                let omega = Vector3::from_column_slice(&target.xdot[at.xdot..at.xdot + 3]);
                // log(exp(e) exp(−δ)) = e − J_r⁻¹(e) δ and J_r⁻¹ is the transpose of J_l⁻¹.
                let rate = so3::left_jacobian_inverse(&error).transpose() * omega;
                rows.error[at.row..at.row + 3].copy_from_slice(error.as_slice());
                rows.rate[at.row..at.row + 3].copy_from_slice(rate.as_slice());
            }
        }
    }

    /// Writes into `rows.second` how `J(q) u` changes along each velocity coordinate.
    pub(crate) fn fill_second(
        &self,
        robot: &Robot,
        page: &Page,
        second: &mut SecondOrder,
        target: &[f64],
        u: &[f64],
        rows: &mut Rows,
    ) {
        rows.second.fill(0.0);
        for block in &self.blocks {
            match block {
                Block::Frame {
                    body,
                    p,
                    r,
                    position,
                    orientation,
                } => {
                    let pose = &page.bodies[*body];
                    let point = (*body, pose.point(p));
                    let map = orientation.map(|at| (at.row, self.row_map(&pose.rotation(r), at, target)));
                    rows.fill_frame_second(robot, page, second, point, u, *position, map);
                }
                Block::CentreOfMass(at) => {
                    let (ld, out) = (rows.ld, &mut rows.second);
                    second.centre_of_mass(robot, page, u, |v, change| add3(out, v * ld + at.row, &change));
                }
                Block::Posture(_) => {}
            }
        }
        self.weigh(rows, Part::Second);
    }

    fn row_map(&self, r: &Matrix3<f64>, at: At, target: &[f64]) -> RowMap {
        match self.coordinates {
            OrientationCoordinates::RollPitchYaw => RowMap::RollPitchYaw(rpy::RateMap::from_matrix(r)),
            OrientationCoordinates::Log => {
                let error = log_error(r, at, target);
                RowMap::Log(error, so3::left_jacobian_inverse(&error))
            }
        }
    }

    fn weigh(&self, rows: &mut Rows, part: Part) {
        for (row, root) in &self.weights {
            let ld = rows.ld;
            match part {
                Part::Jacobian => rows
                    .jacobian
                    .chunks_exact_mut(ld)
                    .for_each(|c| root.multiply(&mut c[*row..])),
                Part::Residual => {
                    root.multiply(&mut rows.error[*row..]);
                    root.multiply(&mut rows.rate[*row..]);
                }
                Part::Second => rows
                    .second
                    .chunks_exact_mut(ld)
                    .for_each(|c| root.multiply(&mut c[*row..])),
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Part {
    Residual,
    Jacobian,
    Second,
}

/// Rotation vector (rad, world) from the target orientation to `r`.
fn log_error(r: &Matrix3<f64>, at: At, target: &[f64]) -> Vector3<f64> {
    let t = &target[at.x..at.x + 4];
    let target_rotation = UnitQuaternion::new_normalize(Quaternion::new(t[3], t[0], t[1], t[2]));
    so3::log_quaternion(&(so3::quaternion(r) * target_rotation.inverse()))
}

/// An angle difference brought into [−π, π].
fn wrap(angle: f64) -> f64 {
    angle - std::f64::consts::TAU * (angle / std::f64::consts::TAU).round()
}

/// The linear map from world angular velocity to the rates of orientation rows, and how it changes.
#[derive(Clone, Copy, Debug)]
enum RowMap {
    RollPitchYaw(rpy::RateMap),
    Log(Vector3<f64>, Matrix3<f64>),
}

impl RowMap {
    #[inline(always)]
    fn apply(&self, w: &Lane) -> Lane {
        match self {
            Self::RollPitchYaw(map) => {
                let [a, b, c] = map.apply([w[0], w[1], w[2]]);
                [a, b, c, 0.0]
            }
            Self::Log(_, m) => lane::from_slice((m * lane::to_vector(*w)).as_slice()),
        }
    }

    /// Change of `apply(w)` when the rows move at `rates`.
    fn derivative(&self, w: &Lane, rates: &Lane) -> Lane {
        match self {
            Self::RollPitchYaw(map) => {
                let [a, b, c] = map.derivative([w[0], w[1], w[2]], [rates[0], rates[1], rates[2]]);
                [a, b, c, 0.0]
            }
            Self::Log(e, _) => {
                let m = so3::left_jacobian_inverse_derivative(e, &lane::to_vector(*rates));
                lane::from_slice((m * lane::to_vector(*w)).as_slice())
            }
        }
    }
}

/// Numbers of a stack of rows at one configuration.
#[derive(Clone, Debug)]
pub struct Rows {
    rows: usize,
    cols: usize,
    ld: usize,
    /// `∂error/∂v`, entry (i, v) at `i + v ld`.
    pub jacobian: Vec<f64>,
    /// `f(q) − x`.
    pub error: Vec<f64>,
    /// Target rate in the coordinates of the rows: the rows stay at zero error if `J v = rate`.
    pub rate: Vec<f64>,
    /// Second-order terms, laid out as the Jacobian; what they hold is said by the call that filled them.
    pub second: Vec<f64>,
}

impl Rows {
    /// Room for `rows` rows in `cols` velocity coordinates.
    pub fn new(rows: usize, cols: usize) -> Self {
        let ld = rows.next_multiple_of(4).max(4);
        Self {
            rows,
            cols,
            ld,
            jacobian: vec![0.0; ld * cols],
            error: vec![0.0; ld],
            rate: vec![0.0; ld],
            second: vec![0.0; ld * cols],
        }
    }

    /// Number of rows in use.
    pub fn rows(&self) -> usize {
        self.rows
    }
    /// Number of velocity coordinates.
    pub fn cols(&self) -> usize {
        self.cols
    }
    /// Leading dimension, a multiple of four.
    pub fn ld(&self) -> usize {
        self.ld
    }
    /// Column `v` of the Jacobian with its zero padding.
    pub fn column(&self, v: usize) -> &[f64] {
        &self.jacobian[v * self.ld..(v + 1) * self.ld]
    }

    /// Writes `J u` (length ≥ ld).
    pub fn multiply_into(&self, u: &[f64], out: &mut [f64]) {
        out[..self.ld].fill(0.0);
        for (column, &u) in self.jacobian.chunks_exact(self.ld).zip(u) {
            for (o, c) in out.iter_mut().zip(column) {
                *o += c * u;
            }
        }
    }

    /// Adds `s Jᵀ y` to `out` (length cols).
    pub fn add_transposed(&self, y: &[f64], s: f64, out: &mut [f64]) {
        for (column, o) in self.jacobian.chunks_exact(self.ld).zip(out) {
            *o += s * column[..self.rows].iter().zip(y).map(|(c, y)| c * y).sum::<f64>();
        }
    }

    fn set_height(&mut self, rows: usize) {
        debug_assert!(rows <= self.ld);
        self.rows = rows;
        self.error[rows..].fill(0.0);
        self.rate[rows..].fill(0.0);
    }

    fn set_difference(&mut self, at: At, now: &[f64], target: Sample<'_>) {
        for (k, now) in now.iter().enumerate() {
            self.error[at.row + k] = now - target.x[at.x + k];
            self.rate[at.row + k] = target.xdot[at.xdot + k];
        }
    }

    #[inline(always)]
    fn add3(&mut self, v: usize, row: usize, value: &Lane) {
        add3(&mut self.jacobian, v * self.ld + row, value);
    }

    fn fill_position(
        &mut self,
        robot: &Robot,
        page: &Page,
        (body, point): (usize, Lane),
        position: Option<At>,
    ) {
        if let Some(at) = position {
            for_each_column(robot, page, body, point, |v, linear, _| {
                self.add3(v, at.row, &linear)
            });
        }
    }

    fn fill_pose(
        &mut self,
        robot: &Robot,
        page: &Page,
        (body, point): (usize, Lane),
        position: Option<At>,
        (row, map): (usize, RowMap),
    ) {
        for_each_column(robot, page, body, point, |v, linear, angular| {
            if let Some(at) = position {
                self.add3(v, at.row, &linear);
            }
            self.add3(v, row, &map.apply(&angular));
        });
    }

    #[allow(
        clippy::too_many_arguments,
        reason = "one call site; a struct would only rename them"
    )]
    fn fill_frame_second(
        &mut self,
        robot: &Robot,
        page: &Page,
        second: &mut SecondOrder,
        point: (usize, Lane),
        u: &[f64],
        position: Option<At>,
        orientation: Option<(usize, RowMap)>,
    ) {
        let ld = self.ld;
        let out = &mut self.second;
        second.frame(robot, page, point, u, |v, linear, angular| {
            if let Some(at) = position {
                add3(out, v * ld + at.row, &linear);
            }
            if let Some((row, map)) = &orientation {
                add3(out, v * ld + row, &map.apply(&angular));
            }
        });
        let Some((row, map)) = orientation else { return };
        let mut omega = lane::ZERO;
        for_each_column(robot, page, point.0, point.1, |v, _, angular| {
            omega = lane::add_scaled(omega, angular, u[v]);
        });
        for_each_column(robot, page, point.0, point.1, |v, _, angular| {
            add3(out, v * ld + row, &map.derivative(&omega, &map.apply(&angular)));
        });
    }

    /// Turns `∂(J u)/∂v` in `second` into the product of each row's symmetric Hessian with `u`.
    ///
    /// The three root rotations do not commute, so `∂_k J_i ≠ ∂_i J_k` among them; the second derivative of
    /// `error(q ⊕ d)` at d = 0 is their mean, which differs by `½ J_rotation (e_k × u_rotation)`.
    pub(crate) fn symmetrise_root(&mut self, robot: &Robot, u: &[f64]) {
        if robot.root() == Root::Fixed {
            return;
        }
        let half = [0.5 * u[3], 0.5 * u[4], 0.5 * u[5]];
        // Columns of [·]ₓ: e_k × u.
        let turned = [
            [0.0, -half[2], half[1]],
            [half[2], 0.0, -half[0]],
            [-half[1], half[0], 0.0],
        ];
        self.add_root_rotation(turned);
    }

    /// Adds to `second` the Jacobian times the derivative of `q ⊖ q⁻` along each coordinate, dq being its value.
    pub(crate) fn add_difference_derivative(&mut self, robot: &Robot, dq: &[f64]) {
        let first = robot.root().nv();
        let ld = self.ld;
        let plain = if robot.root() == Root::Floating { 3 } else { 0 };
        for (v, (out, column)) in self
            .second
            .chunks_exact_mut(ld)
            .zip(self.jacobian.chunks_exact(ld))
            .enumerate()
        {
            if v < plain || v >= first {
                out.iter_mut().zip(column).for_each(|(o, c)| *o += c);
            }
        }
        if robot.root() == Root::Floating {
            // log(exp(δ) exp(φ)) = φ + J_l⁻¹(φ) δ.
            let m = so3::left_jacobian_inverse(&Vector3::new(dq[3], dq[4], dq[5]));
            let column = |k: usize| [m[(0, k)], m[(1, k)], m[(2, k)]];
            self.add_root_rotation([column(0), column(1), column(2)]);
        }
    }

    /// `second[:, 3 + k] += J[:, 3..6] m[k]`.
    fn add_root_rotation(&mut self, m: [[f64; 3]; 3]) {
        let ld = self.ld;
        let jacobian = &self.jacobian[3 * ld..6 * ld];
        for (k, out) in self.second[3 * ld..6 * ld].chunks_exact_mut(ld).enumerate() {
            for (i, column) in jacobian.chunks_exact(ld).enumerate() {
                out.iter_mut().zip(column).for_each(|(o, c)| *o += m[k][i] * c);
            }
        }
    }
}

#[inline(always)]
fn add3(out: &mut [f64], at: usize, value: &Lane) {
    for (o, v) in out[at..at + 3].iter_mut().zip(value) {
        *o += v;
    }
}
