//! A case: one scenario of a suite with everything built, checked and sampled. What can be wrong is found here, before
//! anything runs or is written.

use super::closure::close_loops;
use super::problem_spec::{LimitsSpec, ProblemSpec, frame};
use super::reach::check_footsteps;
use super::{GainSpec, Meet, ScenarioSpec, SoleSpec, StartSpec, Suite};
use crate::error::{InputError, finite};
use crate::referee::{JudgeSpec, Referee, Sole, WalkReference};
use crate::trajectory::{
    Gait, Grid, Locomotion, PreviewWalk, Rates, Samples, Support, Trajectory, WalkSpec, task_values,
};
use ik_core::boundary::Boundary;
use ik_core::problem::{PhaseId, Problem};
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
    /// Phase of each step k = 1 … N.
    pub phases: Vec<PhaseId>,
    /// Gains of the objectives in the steps k = 1 … N, those of one step side by side.
    gains: Vec<f64>,
    /// What the runs are compared with where they walk by preview control.
    pub walk: Option<WalkReference>,
    /// Traces keep every so many samples.
    pub trace_every: usize,
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
        let trajectory = targets(suite, index, &problem, &guess, grid)?;
        let gains = gains(suite, index, &problem, &trajectory, grid)?;
        let q_start = match start.meet {
            Meet::Nothing => guess.clone(),
            Meet::Targets => {
                let met = close_loops(&spec, &trajectory, &guess, &place, &start_place)?;
                check_limits(problem.robot(), &met, &start_place)?;
                met
            }
        };
        if let Some(walk) = &scenario.walk {
            let field = format!("scenarios[{index}].walk");
            let rebuilt = |walk: &WalkSpec| {
                let mut suite = suite.clone();
                suite.scenarios[index].walk = Some(walk.clone());
                targets(&suite, index, &problem, &guess, grid)
            };
            check_footsteps(&spec, walk, &rebuilt, &q_start, &suite.source, &field)?;
        }
        let samples = Samples::new(&problem, &trajectory, grid, spec.rates, &place)?;
        let referee = judge(suite, &problem)?;
        let notes = match spec.rates {
            Rates::Analytic => Vec::new(),
            other => vec![format!("target rates: {}", other.word())],
        };
        let scenario = variation.label(&scenario.id);
        Ok(Self {
            suite: suite.id.clone(),
            scenario,
            spec,
            problem,
            q_start,
            dt_s,
            suite_dt_s: suite.dt_s,
            samples,
            support: trajectory.support(grid),
            phases: trajectory.phases(grid),
            gains,
            walk: trajectory.walk().map(|walk| reference(walk, grid)),
            trajectory,
            trace_every: suite.trace_every,
            referee,
            notes,
        })
    }

    /// Gains of the objectives in step k (from 1).
    pub fn gains_of(&self, k: usize) -> &[f64] {
        let count = self.problem.objectives().len();
        &self.gains[(k - 1) * count..k * count]
    }
}

/// What runs of a walk are compared with at the samples of a grid.
fn reference(walk: &PreviewWalk, grid: Grid) -> WalkReference {
    let times = || (0..=grid.steps).map(|k| grid.time(k));
    let ends = walk.plan.cycle_ends_s();
    // The sample nearest to each end, if the run gets there.
    let nearest = |end: f64| times().position(|t| t >= end - 0.5 * grid.dt_s);
    WalkReference {
        zmp_m: times().map(|t| walk.plan.zmp_m(t)).collect(),
        cycle_ends: ends.into_iter().filter_map(nearest).collect(),
    }
}

/// Gains of the objectives in all steps, each that of the sample the step begins at.
fn gains(
    suite: &Suite,
    index: usize,
    problem: &Problem,
    trajectory: &Trajectory,
    grid: Grid,
) -> Result<Vec<f64>, InputError> {
    let (scenario, source) = (&suite.scenarios[index], &suite.source);
    let (found, needed) = (scenario.gains.len(), problem.objectives().len());
    let field = format!("scenarios[{index}].gains");
    if found != needed {
        let allowed = format!("{needed}, one for each objective of the problem");
        return Err(InputError::value(
            source,
            &field,
            format!("{found} gains"),
            &allowed,
        ));
    }
    for (i, gain) in scenario.gains.iter().enumerate() {
        gain.check(trajectory, source, &format!("{field}[{i}]"))?;
    }
    let at = |t: f64| scenario.gains.iter().map(move |gain| gain.at(trajectory, t));
    Ok((0..grid.steps).flat_map(|k| at(grid.time(k))).collect())
}

impl GainSpec {
    fn check(&self, trajectory: &Trajectory, place: &str, field: &str) -> Result<(), InputError> {
        let not_negative = |name: &str, value: f64| {
            if value.is_finite() && value >= 0.0 {
                return Ok(());
            }
            let field = format!("{field}.{name}");
            Err(InputError::value(
                place,
                &field,
                value,
                "a finite number, not negative",
            ))
        };
        not_negative("value", self.value)?;
        let Some(ramp_s) = self.single_support_ramp_s else {
            return Ok(());
        };
        not_negative("single_support_ramp_s", ramp_s)?;
        let wrong = |allowed: &str| {
            let field = format!("{field}.single_support_ramp_s");
            Err(InputError::value(place, &field, ramp_s, allowed))
        };
        let Some(walk) = trajectory.walk() else {
            return wrong("nothing: the scenario has no walk");
        };
        // A longer ramp would never let the gain be reached.
        let largest_s = 0.5 * walk.plan.shortest_swing_s();
        if ramp_s > largest_s {
            return wrong(&format!("at most {largest_s}, half the shortest swing"));
        }
        Ok(())
    }

    /// The gain at `t` (s).
    fn at(&self, trajectory: &Trajectory, t: f64) -> f64 {
        match (self.single_support_ramp_s, trajectory.walk()) {
            (Some(ramp_s), Some(walk)) => self.value * walk.plan.single_support_ramp(t, ramp_s),
            _ => self.value,
        }
    }
}

/// The targets of scenario `index` for a robot that starts at `guess`.
fn targets(
    suite: &Suite,
    index: usize,
    problem: &Problem,
    guess: &[f64],
    grid: Grid,
) -> Result<Trajectory, InputError> {
    let (scenario, source) = (&suite.scenarios[index], &suite.source);
    let field = |name: &str| format!("scenarios[{index}].{name}");
    let locomotion = match (&scenario.gait, &scenario.walk) {
        (None, None) => None,
        (Some(gait), None) => {
            let gait = Gait::new(gait, problem, source, &field("gait"))?;
            Some(Locomotion::Gait(Box::new(gait)))
        }
        (None, Some(walk)) => {
            let values = task_values(problem, guess);
            let field = field("walk");
            let walk = PreviewWalk::new(walk, problem, &values, grid, source, &field)?;
            Some(Locomotion::Walk(Box::new(walk)))
        }
        (Some(_), Some(_)) => {
            let found = "a second source of the same targets";
            return Err(InputError::value(
                source,
                &field("walk"),
                found,
                "a gait or a walk",
            ));
        }
    };
    let motion = &scenario.motion;
    let trajectory = Trajectory::new(problem, guess, locomotion, motion, source, &field("motion"))?;
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
