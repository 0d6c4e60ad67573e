//! One control step as a file: everything a method may use for it, so that it can be solved again, bit for bit, by
//! anyone.

use crate::error::InputError;
use crate::runner::{Played, recorded};
use crate::suite::{Case, ProblemSpec, build, known_method};
use crate::trajectory::task_values;
use ik_core::configuration::difference;
use ik_core::driver::{Driver, StepInput};
use ik_core::formulation::Termination;
use ik_core::problem::{PhaseId, Problem};
use ik_core::spatial::{rpy, so3};
use ik_core::step::Window;
use ik_core::task::{OrientationCoordinates, Priority, Track};
use ik_methods::registry::Contestant;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Version of the layout.
pub const SCHEMA: &str = "ik-bench/instance/1";

/// A control step with its problem and its method.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Instance {
    /// [`SCHEMA`].
    pub schema: String,
    /// Where it comes from, for the reader.
    #[serde(default)]
    pub origin: String,
    /// The problem.
    pub problem: ProblemSpec,
    /// Δt (s).
    pub dt_s: f64,
    /// Previous configuration (length nq).
    pub q_prev: Vec<f64>,
    /// Velocity that led to it (length nv).
    pub v_prev: Vec<f64>,
    /// Targets k−1, k and the preview.
    pub samples: Vec<TargetSample>,
    /// Phase.
    #[serde(default)]
    pub phase: usize,
    /// Gains of the problem's objectives.
    #[serde(default)]
    pub gains: Vec<f64>,
    /// The method.
    pub method: String,
    /// Its parameters; those not given have their defaults.
    #[serde(default)]
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// Budget of majors.
    pub majors: u32,
}

/// One target sample in the problem's coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetSample {
    /// Targets.
    pub x: Vec<f64>,
    /// Their rates.
    pub xdot: Vec<f64>,
}

/// What a method answered.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// The method.
    pub method: String,
    /// Its parameters, defaults resolved.
    pub parameters: BTreeMap<String, serde_json::Value>,
    /// How the step ended.
    pub termination: String,
    /// More about it, where there is more.
    pub detail: String,
    /// New configuration.
    pub q: Vec<f64>,
    /// Velocity that goes with it.
    pub v: Vec<f64>,
    /// Task errors `f(q) − x` at the new configuration, not weighted.
    pub residuals: Vec<Residual>,
    /// Joints at an end of their interval.
    pub active_bounds: Vec<ActiveBound>,
    /// Outer iterations.
    pub majors: u32,
    /// Inner iterations.
    pub minors: u32,
    /// Passes over the kinematic tree.
    pub passes: u32,
    /// Remarks of the method.
    pub notes: Vec<String>,
}

/// Error of one task: metres, radians; orientations as differences of rpy or as a rotation vector, as the problem has it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Residual {
    /// Name of the task.
    pub task: String,
    /// `hard` or `compromised`.
    pub priority: &'static str,
    /// One number per row.
    pub error: Vec<f64>,
}

/// A joint whose increment is at an end of its interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ActiveBound {
    /// The joint.
    pub joint: String,
    /// `lower`, `upper`, or `pinned` where both ends meet.
    pub side: &'static str,
    /// Its increment Δq (rad or m).
    pub increment: f64,
}

/// An increment this close to an end of its interval is at it: rounding of `q⁻ + Δq − q⁻` for angles of a few radians is
/// a thousand times less.
const AT_BOUND: f64 = 1e-12;

impl Instance {
    /// Step `k` (from 1) of a run.
    pub fn of_run(case: &Case, contestant: &Contestant, played: &Played, majors: u32, k: usize) -> Self {
        let robot = case.problem.robot();
        let v_prev = match k {
            1 => vec![0.0; robot.nv()],
            _ => difference(robot, &played.q[k - 2], &played.q[k - 1])
                .iter()
                .map(|d| d / case.dt_s)
                .collect(),
        };
        let width = case.problem.nx() + case.problem.nxdot();
        let samples = case.samples.seen(k).chunks_exact(width).map(|sample| {
            let (x, xdot) = sample.split_at(case.problem.nx());
            TargetSample {
                x: x.to_vec(),
                xdot: xdot.to_vec(),
            }
        });
        Self {
            schema: SCHEMA.to_owned(),
            origin: format!("{}/{}, step {k} of {}", case.suite, case.scenario, contestant.id),
            problem: case.spec.clone(),
            dt_s: case.dt_s,
            q_prev: played.q[k - 1].clone(),
            v_prev,
            samples: samples.collect(),
            phase: case.phases[k - 1].0,
            gains: case.gains_of(k).to_vec(),
            method: contestant.id.clone(),
            parameters: recorded(&contestant.parameters),
            majors,
        }
    }

    /// Reads an instance; `source` stands for the file in messages.
    ///
    /// # Errors
    /// Text that is no instance, with line and column.
    pub fn parse(text: &str, source: &str) -> Result<Self, InputError> {
        let syntax = |e: serde_json::Error| InputError::Syntax {
            file: source.to_owned(),
            reason: e.to_string(),
        };
        let instance: Self = serde_json::from_str(text).map_err(syntax)?;
        if instance.schema != SCHEMA {
            return Err(InputError::value(source, "schema", &instance.schema, SCHEMA));
        }
        Ok(instance)
    }

    /// The contestant: the instance's own, or another `method`, with `set` in place of its parameters.
    ///
    /// # Errors
    /// An unknown method or parameter, a value out of range.
    pub fn contestant(
        &self,
        method: Option<&str>,
        set: &toml::Table,
        source: &str,
    ) -> Result<Contestant, InputError> {
        let own = method.is_none_or(|id| id == self.method);
        let place = if method.is_some() { "--method" } else { source };
        let entry = known_method(method.unwrap_or(&self.method), place)?;
        let mut parameters = toml::Table::new();
        for (key, value) in self.parameters.iter().filter(|_| own) {
            let value = toml::Value::try_from(value);
            let value = value.map_err(|e| {
                InputError::value(source, &format!("parameters.{key}"), e, "a number or a word")
            })?;
            parameters.insert(key.clone(), value);
        }
        parameters.extend(set.iter().map(|(k, v)| (k.clone(), v.clone())));
        build(entry, &parameters, source)
    }

    /// Solves the step. The budget is that of the instance for its own method and parameters, the method's otherwise.
    ///
    /// # Errors
    /// A fault of the problem or the step, or the method's refusal.
    pub fn solve(&self, contestant: &Contestant, source: &str) -> Result<Answer, InputError> {
        let problem = self.problem.build(&format!("{source}: problem"))?;
        let data = self.targets(&problem, source)?;
        let mut driver =
            Driver::new(contestant.formulation.as_ref(), &problem).map_err(|e| InputError::Declined {
                method: contestant.id.clone(),
                source: e,
            })?;
        let targets = Window::new(&data, problem.nx(), problem.nxdot());
        let targets =
            targets.map_err(|_| InputError::value(source, "samples", self.samples.len(), "at least 2"))?;
        let phase = PhaseId(self.phase);
        let (q_prev, v_prev) = (&self.q_prev[..], &self.v_prev[..]);
        let input = StepInput {
            q_prev,
            v_prev,
            dt_s: self.dt_s,
            phase,
            targets,
            gains: &self.gains,
        };
        driver.check(&input).map_err(|e| InputError::Syntax {
            file: source.to_owned(),
            reason: e.to_string(),
        })?;
        // The instance may leave parameters at their defaults: it is compared with them filled in.
        let recorded_own = self.contestant(None, &toml::Table::new(), source)?;
        let own = contestant.id == self.method && contestant.parameters == recorded_own.parameters;
        let majors = if own { self.majors } else { driver.majors() };
        let (termination, counts) = driver.step(&input, majors);
        let solution = driver.solution();
        let target = targets.now().x;
        Ok(Answer {
            method: contestant.id.clone(),
            parameters: recorded(&contestant.parameters),
            termination: termination.word().to_owned(),
            detail: detail(&termination),
            q: solution.q.clone(),
            v: solution.v.clone(),
            residuals: residuals(&problem, phase, &solution.q, target),
            active_bounds: active_bounds(&driver, &self.q_prev),
            majors: counts.majors,
            minors: counts.minors,
            passes: counts.passes,
            notes: driver.notes().to_vec(),
        })
    }

    /// The samples in one flat slice.
    fn targets(&self, problem: &Problem, source: &str) -> Result<Vec<f64>, InputError> {
        let mut data = Vec::new();
        for (i, sample) in self.samples.iter().enumerate() {
            for (field, values, needed) in [
                ("x", &sample.x, problem.nx()),
                ("xdot", &sample.xdot, problem.nxdot()),
            ] {
                let field = format!("samples[{i}].{field}");
                if values.len() != needed {
                    let found = format!("{} numbers", values.len());
                    return Err(InputError::value(
                        source,
                        &field,
                        found,
                        &format!("{needed} numbers"),
                    ));
                }
                data.extend(values);
            }
        }
        Ok(data)
    }
}

fn detail(termination: &Termination) -> String {
    match termination {
        Termination::HardRowsRelaxed { residual } => {
            format!("linearised hard rows miss by {residual:e} (m, rad)")
        }
        Termination::Damped { residual } => {
            format!("the hard rows were damped; {residual} of them (m, rad) is left")
        }
        Termination::OutOfReach { missing_m } => format!("the target is {missing_m} m out of reach"),
        Termination::OutsideLimits { joint, excess } => {
            format!("every solution is outside the limits, the best by {excess} (rad or m) in joint {joint}")
        }
        Termination::Numerical(reason) => (*reason).to_owned(),
        Termination::Failed(failure) => format!("{failure:?}"),
        Termination::Converged | Termination::Stepped | Termination::Budget => String::new(),
    }
}

fn active_bounds(driver: &Driver, q_prev: &[f64]) -> Vec<ActiveBound> {
    let robot = driver.problem().robot();
    let mut increment = vec![0.0; robot.nv()];
    driver.increment_into(q_prev, &mut increment);
    let (lo, hi) = driver.bounds();
    let mut active = Vec::new();
    for (coordinate, v) in robot.coordinates().iter().zip(robot.root().nv()..) {
        let side = match (increment[v] - lo[v] <= AT_BOUND, hi[v] - increment[v] <= AT_BOUND) {
            (true, true) => "pinned",
            (true, false) => "lower",
            (false, true) => "upper",
            (false, false) => continue,
        };
        active.push(ActiveBound {
            joint: coordinate.name.clone(),
            side,
            increment: increment[v],
        });
    }
    active
}

fn residuals(problem: &Problem, phase: PhaseId, q: &[f64], target: &[f64]) -> Vec<Residual> {
    let values = task_values(problem, q);
    let tasks = problem.phases()[phase.0].tasks.iter();
    tasks
        .map(|(index, priority)| {
            let (task, slot) = (&problem.tasks()[*index], problem.slots()[*index]);
            let rows = task.track.rows(problem.robot());
            let priority = match priority {
                Priority::Hard => "hard",
                Priority::Compromised(_) => "compromised",
            };
            let error = task_error(
                problem,
                &task.track,
                &values[slot.xdot..slot.xdot + rows],
                &target[slot.x..],
            );
            Residual {
                task: task.name.clone(),
                priority,
                error,
            }
        })
        .collect()
}

/// `f(q) − x` of one task from its values in plain coordinates.
fn task_error(problem: &Problem, track: &Track, value: &[f64], target: &[f64]) -> Vec<f64> {
    let turn = match track {
        Track::Orientation(_) => 0,
        Track::Pose(_) => 3,
        Track::Position(_) | Track::CentreOfMass | Track::Posture => value.len(),
    };
    let mut error: Vec<f64> = value[..turn].iter().zip(target).map(|(f, x)| f - x).collect();
    if turn == value.len() {
        return error;
    }
    match problem.orientation() {
        OrientationCoordinates::RollPitchYaw => {
            let angles = value[turn..].iter().zip(&target[turn..]);
            error.extend(angles.map(|(f, x)| f - x - TAU * ((f - x) / TAU).round()));
        }
        OrientationCoordinates::Log => {
            let now = so3::quaternion(&rpy::to_matrix(&Vector3::from_column_slice(&value[turn..])));
            let t = &target[turn..turn + 4];
            let wanted = UnitQuaternion::new_normalize(Quaternion::new(t[3], t[0], t[1], t[2]));
            error.extend(so3::log_quaternion(&(now * wanted.inverse())).iter());
        }
    }
    error
}

#[cfg(test)]
mod tests;
