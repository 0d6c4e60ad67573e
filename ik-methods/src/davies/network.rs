//! The network matrix N at one configuration: the circulation law `N q̇ = 0` written out, to be read, printed and compared
//! with (Davies 1981; the Bioloid paper, eqs. (8)-(11), (15)). The stepper works on the same circuits after
//! elimination and never forms it.

use super::OrientationRates;
use super::mechanism::{Mechanism, Role};
use super::virtual_chain::{euler_angles, euler_axes};
use ik_core::kinematics::screws::for_each_screw;
use ik_core::kinematics::{Page, forward};
use ik_core::problem::{PhaseId, Problem};
use ik_core::robot::{FrameId, Root};
use ik_core::spatial::screw::Screw;
use ik_core::task::Track;
use nalgebra::{DMatrix, Matrix3, Vector3};

/// Singular values below this part of the largest are zero: independent rows stay far above, rounding far below.
const RANK_TOLERANCE: f64 = 1e-9;

/// The point at which the rows of a circuit are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferencePoint {
    /// Its own task point: the condition number is the same wherever the robot stands.
    Task,
    /// The world origin, as the paper has it: the condition number grows with the square of the distance.
    Origin,
}

/// The network matrix of one phase at one configuration.
#[derive(Clone, Debug)]
pub struct Network {
    /// The graph it belongs to: circuits are its rows, joints its columns.
    pub mechanism: Mechanism,
    /// N: per circuit angular rows first.
    pub n: DMatrix<f64>,
}

impl Network {
    /// N of a phase at `q` (length nq).
    pub fn new(
        problem: &Problem,
        phase: PhaseId,
        q: &[f64],
        point: ReferencePoint,
        rates: OrientationRates,
    ) -> Self {
        let mechanism = Mechanism::new(problem, phase);
        let mut page = Page::new(problem.robot());
        forward(problem.robot(), q, &mut page);
        let mut writer = Writer {
            problem,
            page: &page,
            root_point: root_point(problem, &mechanism, &page, q),
            root_axes: Matrix3::identity(),
            point,
            rates,
            n: DMatrix::zeros(mechanism.rows(), mechanism.joints.len()),
        };
        writer.root_axes = writer.chain_axes(&root_rotation(problem, &mechanism, &page));
        let tasks = problem.phases()[phase.0].tasks.iter().map(|(task, _)| *task);
        let (mut row, mut chain) = (0, problem.robot().nv());
        for task in tasks.filter(|task| Some(*task) != mechanism.imposed_root) {
            let (rows, joints) = writer.task(task, row, chain);
            (row, chain) = (row + rows, chain + joints);
        }
        let n = writer.n;
        Self { mechanism, n }
    }

    /// Columns of the unknown rates, N_s.
    pub fn secondary(&self) -> DMatrix<f64> {
        self.n.select_columns(&self.mechanism.columns(Role::Secondary))
    }

    /// Columns of the given rates, N_p.
    pub fn primary(&self) -> DMatrix<f64> {
        self.n.select_columns(&self.mechanism.columns(Role::Imposed))
    }

    /// Number of singular values of `matrix` above 1e-9 of its largest.
    pub fn rank(matrix: &DMatrix<f64>) -> usize {
        if matrix.is_empty() {
            return 0;
        }
        let values = matrix.singular_values();
        values.iter().filter(|&&s| s > RANK_TOLERANCE * values[0]).count()
    }

    /// Largest over least singular value of N_s; infinite if it is singular, 1 if nothing is unknown.
    pub fn condition(&self) -> f64 {
        let secondary = self.secondary();
        if secondary.is_empty() {
            return 1.0;
        }
        let values = secondary.singular_values();
        values[0] / values[values.len() - 1]
    }
}

/// Point of the root chain: that of the frame whose task imposes the root, else the root's origin.
fn root_point(problem: &Problem, mechanism: &Mechanism, page: &Page, q: &[f64]) -> Vector3<f64> {
    match (mechanism.imposed_root, problem.robot().root()) {
        (Some(task), _) => page.frame_position(problem.robot(), frame_of(problem, task)),
        (None, Root::Floating) => Vector3::from_column_slice(&q[..3]),
        (None, Root::Fixed) => Vector3::zeros(),
    }
}

fn root_rotation(problem: &Problem, mechanism: &Mechanism, page: &Page) -> Matrix3<f64> {
    // The first frame of a robot is its root link.
    let frame = mechanism
        .imposed_root
        .map_or(FrameId(0), |task| frame_of(problem, task));
    page.frame_rotation(problem.robot(), frame)
}

fn frame_of(problem: &Problem, task: usize) -> FrameId {
    match problem.tasks()[task].track {
        Track::Position(f) | Track::Orientation(f) | Track::Pose(f) => f,
        Track::CentreOfMass | Track::Posture => FrameId(0),
    }
}

struct Writer<'a> {
    problem: &'a Problem,
    page: &'a Page,
    root_point: Vector3<f64>,
    root_axes: Matrix3<f64>,
    point: ReferencePoint,
    rates: OrientationRates,
    n: DMatrix<f64>,
}

impl Writer<'_> {
    /// Axes of the 3R part of a chain whose last link has rotation `r`.
    fn chain_axes(&self, r: &Matrix3<f64>) -> Matrix3<f64> {
        match self.rates {
            OrientationRates::AngularVelocity => Matrix3::identity(),
            OrientationRates::Euler => euler_axes(&euler_angles(r)),
        }
    }

    /// Writes the circuit of a task; returns its rows and the joints of its chain.
    fn task(&mut self, task: usize, row: usize, chain: usize) -> (usize, usize) {
        let robot = self.problem.robot();
        match self.problem.tasks()[task].track {
            Track::Position(f) | Track::Orientation(f) | Track::Pose(f) => {
                self.link_circuit(f, row, chain);
                (6, 6)
            }
            Track::CentreOfMass => {
                self.mass_circuit(row, chain);
                (3, 3)
            }
            Track::Posture => {
                let joints = robot.coordinates().len();
                for j in 0..joints {
                    self.n[(row + j, robot.root().nv() + j)] = 1.0;
                    self.n[(row + j, chain + j)] = -1.0;
                }
                (joints, joints)
            }
        }
    }

    fn link_circuit(&mut self, frame: FrameId, row: usize, chain: usize) {
        let (problem, page) = (self.problem, self.page);
        let robot = problem.robot();
        let p = page.frame_position(robot, frame);
        let shift = match self.point {
            ReferencePoint::Task => Vector3::zeros(),
            ReferencePoint::Origin => -p,
        };
        if robot.root() == Root::Floating {
            for (k, screw) in chain_screws(&(self.root_point - p), &self.root_axes)
                .iter()
                .enumerate()
            {
                self.add(row, k, &screw.at(&shift), 1.0);
            }
        }
        for_each_screw(robot, page, robot.frames()[frame.0].body, &p, |v, screw| {
            self.add(row, v, &screw.at(&shift), 1.0);
        });
        let axes = self.chain_axes(&page.frame_rotation(robot, frame));
        for (k, screw) in chain_screws(&Vector3::zeros(), &axes).iter().enumerate() {
            self.add(row, chain + k, &screw.at(&shift), -1.0);
        }
    }

    fn mass_circuit(&mut self, row: usize, chain: usize) {
        let robot = self.problem.robot();
        let mut write = |column: usize, value: &Vector3<f64>| {
            for k in 0..3 {
                self.n[(row + k, column)] += value[k];
            }
        };
        if robot.root() == Root::Floating {
            let arm = self.root_point - self.page.centre_of_mass();
            for (k, screw) in chain_screws(&arm, &self.root_axes).iter().enumerate() {
                write(k, &screw.linear);
            }
        }
        for v in robot.root().nv()..robot.nv() {
            write(v, &self.page.centre_of_mass_column(v));
        }
        for k in 0..3 {
            write(chain + k, &-Vector3::ith(k, 1.0));
        }
    }

    fn add(&mut self, row: usize, column: usize, screw: &Screw, sign: f64) {
        for (k, value) in screw.to_vector().iter().enumerate() {
            self.n[(row + k, column)] += sign * value;
        }
    }
}

/// Screws of a 3P3R chain through `point` (from the reference point), the axes of 3R being columns of `axes`.
fn chain_screws(point: &Vector3<f64>, axes: &Matrix3<f64>) -> [Screw; 6] {
    std::array::from_fn(|k| match k {
        0..3 => Screw::prismatic(&Vector3::ith(k, 1.0)),
        _ => Screw::revolute(&axes.column(k - 3).into_owned(), point),
    })
}
