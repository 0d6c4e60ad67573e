//! A limb of a robot with its closed form: the analyser's rows bound to the solver of their family, in joint values of the
//! robot and poses of its bodies.

use super::analyser::{
    DenavitHartenberg, DhRow, Family, LimbReport, NoRows, denavit_hartenberg, with_virtual_wrist,
};
use super::general::{self, GeneralLimb, Outcome};
use super::{Arm, ElbowArm, Leg, LimbPose, Solutions, Unsolved, wrap};
use ik_core::robot::Robot;
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// Most joints a limb with a closed form has.
const MOST_JOINTS: usize = 6;

/// The solver of one limb.
#[derive(Clone, Debug)]
pub struct Limb {
    solver: Solver,
    /// Frame 0 seen from the base body, inverted.
    base_inverse: Isometry3<f64>,
    /// The tip body seen from the last frame, inverted.
    tool_inverse: Isometry3<f64>,
    /// θ = sign q + offset, per joint.
    angles: Vec<(f64, f64)>,
    /// Joints that are the robot's; the others are those of a virtual wrist.
    joints: usize,
}

#[derive(Clone, Debug)]
enum Solver {
    Leg(Leg),
    Arm(Arm),
    ElbowArm(ElbowArm),
    General(Box<GeneralLimb>),
}

/// Why a limb cannot be bound.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unbound {
    /// It has no closed form, or is not of this robot.
    #[error(transparent)]
    NoRows(#[from] NoRows),
    /// To place a point it needs three revolute joints of its own; name of its last body.
    #[error("limb at `{0}`: only three revolute, independent joints place a point in closed form")]
    NotThree(String),
    /// The general solver does not take its rows.
    #[error("limb at `{tip}`: {source}")]
    Rows {
        /// Name of its last body.
        tip: String,
        /// Why.
        source: general::LimbError,
    },
}

impl Limb {
    /// The solver of a limb the analyser found on `robot`.
    ///
    /// # Errors
    /// A limb without closed form or of another robot.
    pub fn new(robot: &Robot, report: &LimbReport) -> Result<Self, Unbound> {
        let table = denavit_hartenberg(robot, report)?;
        let super::analyser::Verdict::ClosedForm(family) = report.verdict else {
            unreachable!("a limb with rows has a closed form");
        };
        let rows = &table.rows;
        let mut tool = table.tool;
        // What is beyond the last axis is in the tool.
        let solver = match family {
            Family::Leg => Solver::Leg(Leg {
                thigh_m: rows[2].a,
                shank_m: rows[3].a,
                ankle_m: 0.0,
                hip_offset_m: rows[2].d,
            }),
            Family::Arm => Solver::Arm(Arm {
                upper_arm_m: -rows[2].d,
                forearm_m: rows[4].d,
                hand_m: 0.0,
            }),
            Family::FourJointArm => {
                // The rows end with α4 = 0; the paper's arm goes on with α4 = 90°, θ5 = 0, α5 = 90°, θ6 = 90°.
                let rest = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI)
                    * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), FRAC_PI_2);
                tool = rest.inverse() * tool;
                Solver::ElbowArm(ElbowArm {
                    arm: Arm {
                        upper_arm_m: -rows[2].d,
                        forearm_m: 0.0,
                        hand_m: 0.0,
                    },
                })
            }
            Family::General { .. } => general_solver(rows, report)?,
        };
        Ok(Self::bound(solver, &table, tool))
    }

    /// The solver of a limb of three joints that place `point` (m, in the last body): a limb of six with a virtual wrist in
    /// the point. Our extension; the paper has no such limb.
    ///
    /// # Errors
    /// Another number of joints, joints that slide or follow others, axes that leave the point in a plane or on a sphere.
    pub fn placing(robot: &Robot, report: &LimbReport, point: &Point3<f64>) -> Result<Self, Unbound> {
        let Some(table) = with_virtual_wrist(robot, report, point) else {
            return Err(Unbound::NotThree(report.tip_name.clone()));
        };
        let solver = general_solver(&table.rows, report)?;
        Ok(Self {
            joints: report.joints.len(),
            ..Self::bound(solver, &table, table.tool)
        })
    }

    fn bound(solver: Solver, table: &DenavitHartenberg, tool: Isometry3<f64>) -> Self {
        Self {
            solver,
            base_inverse: table.base.inverse(),
            tool_inverse: tool.inverse(),
            angles: table.rows.iter().map(|row| (row.sign, row.offset)).collect(),
            joints: table.rows.len(),
        }
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints
    }

    /// Calls `found` with the joint values (rad, base to tip, each in [−π, π]) of every solution and its branch number, for
    /// a pose of the tip body in the base body; returns how many there are. Joints that the geometry leaves free stay at
    /// `previous` (one value per joint). Limits are the caller's affair. Solutions of the general family are numbered
    /// through.
    ///
    /// # Errors
    /// A pose that is not rigid or not within reach.
    pub fn for_each_solution(
        &self,
        pose: &Isometry3<f64>,
        previous: &[f64],
        mut found: impl FnMut(&[f64], u8),
    ) -> Result<usize, Unsolved> {
        let end = self.base_inverse * pose * self.tool_inverse;
        let pose = LimbPose {
            rotation: end.rotation.to_rotation_matrix().into_inner(),
            position: end.translation.vector,
        };
        let mut before = [0.0; MOST_JOINTS];
        for ((to, q), (sign, offset)) in before.iter_mut().zip(previous).zip(&self.angles) {
            *to = sign * q + offset;
        }
        let mut last: Option<[f64; MOST_JOINTS]> = None;
        let mut count = 0;
        let mut give = |angles: &[f64], branch: u8| {
            let mut q = [0.0; MOST_JOINTS];
            for ((q, theta), (sign, offset)) in q.iter_mut().zip(angles).zip(&self.angles) {
                *q = wrap(sign * (theta - offset));
            }
            // Both turns of a virtual wrist come one after the other and are one solution.
            q[self.joints..].fill(0.0);
            if self.joints == self.angles.len() || last != Some(q) {
                found(&q[..self.joints], branch);
                count += 1;
            }
            last = Some(q);
        };
        match &self.solver {
            Solver::Leg(leg) => {
                let mut all = Solutions::default();
                leg.solve_all(&pose, &before, &mut all)?;
                all.iter().for_each(|(angles, branch)| give(angles, branch));
            }
            Solver::Arm(arm) => {
                let mut all = Solutions::default();
                arm.solve_all(&pose, &before, &mut all)?;
                all.iter().for_each(|(angles, branch)| give(angles, branch));
            }
            Solver::ElbowArm(arm) => {
                let mut all = Solutions::default();
                arm.solve_all(&pose, &[before[0], before[1], before[2], before[3]], &mut all)?;
                all.iter().for_each(|(angles, branch)| give(angles, branch));
            }
            Solver::General(general) => general_solutions(general, &pose, &before, give)?,
        }
        Ok(count)
    }

    /// Writes the solution whose largest difference from `previous` is least.
    ///
    /// # Errors
    /// As [`Limb::for_each_solution`]; then `out` is not touched.
    pub fn solve_nearest(
        &self,
        pose: &Isometry3<f64>,
        previous: &[f64],
        out: &mut [f64],
    ) -> Result<(), Unsolved> {
        let mut least = f64::INFINITY;
        self.for_each_solution(pose, previous, |q, _| {
            let differences = q.iter().zip(previous).map(|(a, b)| wrap(a - b).abs());
            let away = differences.fold(0.0, f64::max);
            if away < least {
                least = away;
                out.copy_from_slice(q);
            }
        })?;
        Ok(())
    }
}

fn general_solver(rows: &[DhRow], report: &LimbReport) -> Result<Solver, Unbound> {
    let row = |k: usize| general::DhRow {
        alpha: rows[k].alpha,
        a: rows[k].a,
        d: rows[k].d,
    };
    let general = GeneralLimb::new(std::array::from_fn(row)).map_err(|source| Unbound::Rows {
        tip: report.tip_name.clone(),
        source,
    })?;
    Ok(Solver::General(Box::new(general)))
}

fn general_solutions(
    general: &GeneralLimb,
    pose: &LimbPose,
    before: &[f64; MOST_JOINTS],
    mut give: impl FnMut(&[f64], u8),
) -> Result<(), Unsolved> {
    pose.check()?;
    let mut all = general::Solutions::default();
    match general.solve_into(&pose.rotation, &pose.position, before, &mut all) {
        Outcome::Solved(_) => {
            for (angles, number) in all.as_slice().iter().zip(0..) {
                give(angles, number);
            }
            Ok(())
        }
        Outcome::OutOfReach { excess_m } => Err(Unsolved::General { excess_m }),
    }
}
