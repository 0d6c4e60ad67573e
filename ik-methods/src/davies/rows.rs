//! The rows of circuits at a configuration.
//!
//! Each circuit is written at its own task point: row shift `rows 3..6 −= [p]ₓ rows 0..3`, which changes no solution and
//! keeps the condition number the same wherever the robot stands. Written so, a 3P3R task chain reads `[ω; v]` directly,
//! and eliminating its monitored joints (the left null space of their columns) is dropping their rows. What is left is
//! `A x = y` in the real joints and, where no task imposes the root, the root.

use super::circuits::{Circuit, RootChain};
use super::virtual_chain::Instant;
use ik_core::kinematics::Page;
use ik_core::kinematics::screws::{for_each_screw, root_screws};
use ik_core::problem::Problem;
use ik_core::robot::Root;
use ik_core::spatial::screw::Screw;
use ik_core::task::Track;
use nalgebra::Vector3;

/// Everything rows are made of.
pub(super) struct Closing<'a> {
    pub(super) problem: &'a Problem,
    pub(super) q: &'a [f64],
    pub(super) page: &'a Page,
    pub(super) instant: &'a Instant<'a>,
}

impl Closing<'_> {
    /// Twist of the root that a pose task of one of its frames imposes: `linear` is the velocity of the root's origin.
    pub(super) fn root_twist(&self, task: usize) -> Screw {
        let robot = self.problem.robot();
        let imposed = self.instant.twist(self.problem, task, self.page);
        let Track::Pose(frame) = self.problem.tasks()[task].track else {
            unreachable!("only a pose imposes the root");
        };
        let point = self.page.frame_position(robot, frame);
        let origin = Vector3::from_column_slice(&self.q[..3]);
        Screw {
            angular: imposed.angular,
            linear: imposed.linear + imposed.angular.cross(&(origin - point)),
        }
    }

    /// Adds the rows `[root | joints | imposed]` of circuits to `rows`, which are zero.
    pub(super) fn fill(
        &self,
        circuits: &[Circuit],
        chain: RootChain,
        root: &Screw,
        place: &[usize],
        rows: &mut [f64],
    ) {
        let height: usize = circuits.iter().map(|c| c.rows).sum();
        let unknown = if chain.is_unknown() { 6 } else { 0 };
        let width = rows.len() / height.max(1);
        let mut begin = 0;
        for circuit in circuits {
            let rows = &mut rows[begin * width..(begin + circuit.rows) * width];
            let block = Block { rows, width, unknown };
            self.fill_circuit(circuit, chain, root, place, block);
            if let Some(weights) = &circuit.weights {
                weights.multiply_rows(rows, width);
            }
            begin += circuit.rows;
        }
    }

    /// Rate that objectives want of each joint coordinate, if they pull.
    pub(super) fn secondary_rate(&self) -> Option<impl Fn(usize) -> f64> {
        let first = self.problem.robot().root().nv();
        let (increment, dt_s) = (self.instant.secondary?, self.instant.dt_s);
        Some(move |joint: usize| increment[first + joint] / dt_s)
    }

    /// Takes the rates that objectives want of `joints` out of rows `[root | joints | imposed]` of that `width`: what is left
    /// to solve for is the difference from them.
    pub(super) fn lean(&self, joints: &[usize], width: usize, rows: &mut [f64]) {
        let Some(rate) = self.secondary_rate() else { return };
        for row in rows.chunks_exact_mut(width) {
            let (unknowns, imposed) = row.split_at_mut(width - 1);
            let columns = &unknowns[width - 1 - joints.len()..];
            imposed[0] -= joints.iter().zip(columns).map(|(&j, c)| c * rate(j)).sum::<f64>();
        }
    }

    fn fill_circuit(
        &self,
        circuit: &Circuit,
        chain: RootChain,
        root: &Screw,
        place: &[usize],
        mut block: Block<'_>,
    ) {
        let (problem, page) = (self.problem, self.page);
        let robot = problem.robot();
        let track = problem.tasks()[circuit.task].track;
        let (frame, linear, angular) = match track {
            Track::Position(f) => (f, Some(0), None),
            Track::Orientation(f) => (f, None, Some(0)),
            Track::Pose(f) => (f, Some(0), Some(3)),
            Track::CentreOfMass => return self.fill_mass(circuit, chain, root, place, block),
            Track::Posture => return self.fill_posture(circuit, place, block),
        };
        let point = page.frame_position(robot, frame);
        let mut imposed = self.instant.twist(problem, circuit.task, page);
        match (chain, robot.root()) {
            (RootChain::Free | RootChain::Costed, _) => {
                for (k, screw) in root_screws(robot, page, &point).iter().enumerate() {
                    block.add(k, screw, linear, angular);
                }
            }
            (RootChain::Known, Root::Floating) => {
                let carried = root.at(&(point - Vector3::from_column_slice(&self.q[..3])));
                imposed.linear -= carried.linear;
                imposed.angular -= carried.angular;
            }
            (RootChain::Known, Root::Fixed) => {}
        }
        let (unknown, first) = (block.unknown, robot.root().nv());
        for_each_screw(robot, page, robot.frames()[frame.0].body, &point, |v, screw| {
            block.add(unknown + place[v - first], screw, linear, angular);
        });
        let imposed = Screw {
            angular: imposed.angular,
            linear: imposed.linear,
        };
        block.add(block.width - 1, &imposed, linear, angular);
    }

    fn fill_mass(
        &self,
        circuit: &Circuit,
        chain: RootChain,
        root: &Screw,
        place: &[usize],
        mut block: Block<'_>,
    ) {
        let robot = self.problem.robot();
        let first = robot.root().nv();
        let mut imposed = self.instant.twist(self.problem, circuit.task, self.page).linear;
        for v in 0..first {
            let column = self.page.centre_of_mass_column(v);
            match chain {
                RootChain::Free | RootChain::Costed => block.add3(v, &column, 0),
                RootChain::Known => {
                    let rate = if v < 3 {
                        root.linear[v]
                    } else {
                        root.angular[v - 3]
                    };
                    imposed -= column * rate;
                }
            }
        }
        for (joint, &local) in place.iter().enumerate() {
            block.add3(
                block.unknown + local,
                &self.page.centre_of_mass_column(first + joint),
                0,
            );
        }
        block.add3(block.width - 1, &imposed, 0);
    }

    fn fill_posture(&self, circuit: &Circuit, place: &[usize], block: Block<'_>) {
        let slot = self.problem.slots()[circuit.task];
        let range = circuit.joint.map_or(0..circuit.rows, |j| j..j + 1);
        for (row, j) in range.enumerate() {
            let row = &mut block.rows[row * block.width..(row + 1) * block.width];
            row[block.unknown + place[j]] = 1.0;
            row[block.width - 1] = self.instant.joint_rate(slot, j);
        }
    }
}

/// Rows of one circuit within a stage.
struct Block<'a> {
    rows: &'a mut [f64],
    width: usize,
    unknown: usize,
}

impl Block<'_> {
    /// Adds a screw to a column; the linear and the angular part begin at these rows, if they are imposed.
    #[inline]
    fn add(&mut self, column: usize, screw: &Screw, linear: Option<usize>, angular: Option<usize>) {
        if let Some(row) = linear {
            self.add3(column, &screw.linear, row);
        }
        if let Some(row) = angular {
            self.add3(column, &screw.angular, row);
        }
    }

    #[inline]
    fn add3(&mut self, column: usize, value: &Vector3<f64>, row: usize) {
        for k in 0..3 {
            self.rows[(row + k) * self.width + column] += value[k];
        }
    }
}
