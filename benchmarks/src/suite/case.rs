//! A case: one scenario of a suite with everything built, checked and sampled. What can be wrong is found here, before
//! anything runs or is written.

use super::closure::close_loops;
use super::problem_spec::{LimitsSpec, ProblemSpec, frame};
use super::{Meet, ScenarioSpec, SoleSpec, StartSpec, Suite};
use crate::error::{InputError, finite};
use crate::referee::{JudgeSpec, Referee, Sole};
use crate::trajectory::{Gait, Grid, Rates, Samples, Support, Trajectory};
use ik_core::boundary::Boundary;
use ik_core::problem::Problem;
use ik_core::robot::{Robot, Root};
use nalgebra::UnitQuaternion;
use std::sync::Arc;

/// What a command changes in the scenarios it runs.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Variation {
    /// Time step (s).
    pub dt_s: Option<f64>,
    /// Largest speed of every joint (rad/s or m/s).
    pub velocity: Option<f64>,
    /// Safety margin q_s of the ellipse (rad or m).
    pub margin: Option<f64>,
    /// Where target rates come from.
    pub rates: Option<Rates>,
}

/// One scenario, ready to run.
#[derive(Clone, Debug)]
pub struct Case {
    /// Id of the suite.
    pub suite: String,
    /// Id of the scenario, with what a command changed in it: `A+velocity=2`.
    pub scenario: String,
    /// The problem as text, for instances.
    pub spec: ProblemSpec,
    /// The problem.
    pub problem: Arc<Problem>,
    /// Start configuration (length nq).
    pub q_start: Vec<f64>,
    /// Time step (s).
    pub dt_s: f64,
    /// The time step the suite asks for (s).
    pub suite_dt_s: f64,
    /// Targets.
    pub samples: Samples,
    /// Targets as functions of time.
    pub trajectory: Trajectory,
    /// Which feet carry the robot at the samples k = 0 … N: both, unless it walks.
    pub support: Vec<Support>,
    /// Judges the runs.
    pub referee: Referee,
    /// Remarks for the rows.
    pub notes: Vec<String>,
}

impl Case {
    /// Builds scenario `index` of a suite.
    ///
    /// # Errors
    /// The first fault of problem, start, motion or grid, naming field, value and what is allowed.
    pub fn new(suite: &Suite, index: usize, variation: &Variation) -> Result<Self, InputError> {
        let scenario = &suite.scenarios[index];
        let place = format!("{}: scenario `{}`", suite.source, scenario.id);
        let spec = varied_problem(suite, scenario, variation, &place)?;
        let problem = spec.build(&place)?;
        let Some(start) = suite.starts.get(&scenario.start) else {
            return Err(InputError::unknown(
                &place,
                "start",
                &scenario.start,
                suite.starts.keys(),
            ));
        };
        let start_place = format!("{}: starts.{}", suite.source, scenario.start);
        let guess = start.build(problem.robot(), &start_place)?;
        let dt_s = variation.dt_s.unwrap_or(suite.dt_s);
        let grid = Grid::new(dt_s, scenario.duration_s, spec.preview_s, &place)?;
        check_polygon(&spec.boundary, dt_s, &place)?;
        let trajectory = trajectory(suite, index, &problem, &guess, grid)?;
        let q_start = match start.meet {
            Meet::Nothing => guess,
            Meet::Targets => {
                let met = close_loops(&spec, &trajectory, &guess, &place, &start_place)?;
                check_limits(problem.robot(), &met, &start_place)?;
                met
            }
        };
        let samples = Samples::new(&problem, &trajectory, grid, spec.rates, &place)?;
        let referee = judge(suite, &problem)?;
        let notes = match spec.rates {
            Rates::Analytic => Vec::new(),
            other => vec![format!("target rates: {}", other.word())],
        };
        let scenario = variation.label(&scenario.id);
        let (suite, suite_dt_s) = (suite.id.clone(), suite.dt_s);
        Ok(Self {
            suite,
            scenario,
            spec,
            problem,
            q_start,
            dt_s,
            suite_dt_s,
            samples,
            support: trajectory.support(grid),
            trajectory,
            referee,
            notes,
        })
    }
}

/// The targets of scenario `index` for a robot that starts at `guess`.
fn trajectory(
    suite: &Suite,
    index: usize,
    problem: &Problem,
    guess: &[f64],
    grid: Grid,
) -> Result<Trajectory, InputError> {
    let (scenario, source) = (&suite.scenarios[index], &suite.source);
    let field = |name: &str| format!("scenarios[{index}].{name}");
    let gait = match &scenario.gait {
        Some(gait) => Some(Gait::new(gait, problem, source, &field("gait"))?),
        None => None,
    };
    let trajectory = Trajectory::new(problem, guess, gait, &scenario.motion, source, &field("motion"))?;
    trajectory.check_reach(grid, source, &field("gait"))?;
    Ok(trajectory)
}

impl Variation {
    /// The id of a scenario so changed; the time step is a field of its own in every record.
    fn label(&self, id: &str) -> String {
        let mut label = id.to_owned();
        if let Some(velocity) = self.velocity {
            label.push_str(&format!("+velocity={velocity}"));
        }
        if let Some(margin) = self.margin {
            label.push_str(&format!("+margin={margin}"));
        }
        if let Some(rates) = self.rates {
            label.push_str(&format!("+rates={}", rates.word()));
        }
        label
    }
}

fn varied_problem(
    suite: &Suite,
    scenario: &ScenarioSpec,
    variation: &Variation,
    place: &str,
) -> Result<ProblemSpec, InputError> {
    let mut spec = suite.problem.clone();
    spec.boundary = scenario.boundary.unwrap_or(spec.boundary);
    spec.rates = variation.rates.unwrap_or(spec.rates);
    if variation.velocity.is_some() {
        spec.limits.push(LimitsSpec {
            velocity: variation.velocity,
            ..LimitsSpec::default()
        });
    }
    if let Some(margin) = variation.margin {
        let Boundary::Ellipse { .. } = spec.boundary else {
            return Err(InputError::value(
                place,
                "margin",
                margin,
                "no margin: the boundary is not an ellipse",
            ));
        };
        spec.boundary = Boundary::Ellipse { margin };
    }
    Ok(spec)
}

/// The polygon's conditions at the new position are linear in it only for κΔt < 1.
fn check_polygon(boundary: &Boundary, dt_s: f64, place: &str) -> Result<(), InputError> {
    match boundary {
        Boundary::Polygon { approach_per_s, .. } if approach_per_s * dt_s >= 1.0 => {
            let allowed = format!("below 1 / boundary.approach_per_s = {}", 1.0 / approach_per_s);
            Err(InputError::value(place, "dt_s", dt_s, &allowed))
        }
        _ => Ok(()),
    }
}

fn judge(suite: &Suite, problem: &Arc<Problem>) -> Result<Referee, InputError> {
    let robot = problem.robot();
    let supports = suite.torque_supports.iter();
    let place = format!("{}: torque_supports", suite.source);
    let spec = JudgeSpec {
        soft_tolerance_m: suite.soft_tolerance_m,
        exit_joints: suite.exit_joints.clone(),
        torque_supports: supports
            .map(|name| frame(robot, name, &place))
            .collect::<Result<_, _>>()?,
        soles: suite
            .soles
            .iter()
            .enumerate()
            .map(|(i, sole)| sole.build(robot, &format!("{}: soles[{i}]", suite.source)))
            .collect::<Result<_, _>>()?,
    };
    Referee::new(problem, spec).map_err(|e| InputError::Syntax {
        file: suite.source.clone(),
        reason: e.to_string(),
    })
}

impl SoleSpec {
    fn build(&self, robot: &Robot, place: &str) -> Result<Sole, InputError> {
        Ok(Sole {
            frame: frame(robot, &self.frame, place)?,
            half_length_m: self.half_length_m,
            half_width_m: self.half_width_m,
            foot: self.foot,
        })
    }
}

impl StartSpec {
    /// The configuration (length nq); `place` names this start.
    fn build(&self, robot: &Robot, place: &str) -> Result<Vec<f64>, InputError> {
        let mut q = robot.neutral();
        match robot.root() {
            Root::Floating => self.place_root(&mut q, place)?,
            Root::Fixed if self.base_position_m.is_some() || self.base_rpy_rad.is_some() => {
                let allowed = "nothing: the root of this robot is fixed";
                return Err(InputError::value(
                    place,
                    "base_position_m or base_rpy_rad",
                    "a pose",
                    allowed,
                ));
            }
            Root::Fixed => {}
        }
        for (name, &value) in &self.joints {
            let known = robot.coordinates().iter().map(|c| &c.name);
            let index = robot
                .coordinate(name)
                .map_err(|_| InputError::unknown(place, "joint", name, known))?;
            finite(place, &format!("joints.{name}"), value)?;
            q[robot.root().nq() + index] = value;
        }
        check_limits(robot, &q, place)?;
        Ok(q)
    }

    fn place_root(&self, q: &mut [f64], place: &str) -> Result<(), InputError> {
        let (position, rpy) = (
            self.base_position_m.unwrap_or_default(),
            self.base_rpy_rad.unwrap_or_default(),
        );
        for (field, values) in [("base_position_m", position), ("base_rpy_rad", rpy)] {
            for (i, value) in values.into_iter().enumerate() {
                finite(place, &format!("{field}[{i}]"), value)?;
            }
        }
        q[..3].copy_from_slice(&position);
        let turn = UnitQuaternion::from_euler_angles(rpy[0], rpy[1], rpy[2]);
        q[3..7].copy_from_slice(turn.coords.as_slice());
        Ok(())
    }
}

fn check_limits(robot: &Robot, q: &[f64], place: &str) -> Result<(), InputError> {
    for (c, &value) in robot.coordinates().iter().zip(&q[robot.root().nq()..]) {
        if !(c.limits.lower..=c.limits.upper).contains(&value) {
            let allowed = format!(
                "within the limits of the joint, {} .. {}",
                c.limits.lower, c.limits.upper
            );
            return Err(InputError::value(
                place,
                &format!("joints.{}", c.name),
                value,
                &allowed,
            ));
        }
    }
    Ok(())
}
