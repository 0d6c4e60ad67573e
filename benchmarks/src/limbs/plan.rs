//! What a limb suite is going to do, checked before anything is written: one job per robot, limb and set of poses.

use super::continuity::{self, Kind, Singular};
use super::grid::{self, Set};
use super::numbers::Numbers;
use super::record::{Findings, LimbRow, SCHEMA};
use super::store::LimbKey;
use super::subject::{Answers, Joints, Solve, Subject};
use super::suite::{ContinuitySpec, LimbSuite, ReachSpec, SliceSpec, Study};
use super::{reach, workspace};
use crate::error::InputError;
use crate::records::Trace;
use crate::runner::Session;
use ik_methods::reverse_decoupling::Unsolved;
use nalgebra::Isometry3;
use std::collections::BTreeMap;

/// How many poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Amount {
    /// All the suite asks for.
    Full,
    /// Its reduction for a quick look.
    Quick,
}

impl Amount {
    fn of<T>(self, full: T, quick: T) -> T {
        match self {
            Self::Full => full,
            Self::Quick => quick,
        }
    }
}

/// A checked limb suite with its limbs.
#[derive(Debug)]
pub struct Plan {
    suite: LimbSuite,
    amount: Amount,
    subjects: Vec<Subject>,
    jobs: Vec<Job>,
}

/// One row to be made.
#[derive(Clone, Debug)]
pub struct Job {
    subject: usize,
    what: What,
    set: String,
}

#[derive(Clone, Copy, Debug)]
enum What {
    Grid(Set),
    Continuity(Singular, Kind),
    Reach,
    /// Index of the slice.
    Slice(usize),
    /// Index of the posture.
    Postures(usize),
}

impl Job {
    /// Whether another job is about the same limb.
    pub fn is_of_limb(&self, other: &Self) -> bool {
        self.subject == other.subject
    }
}

/// A row that was made, and the trace that belongs to it.
#[derive(Debug)]
pub struct Made {
    /// The row; its trace is not written yet.
    pub row: LimbRow,
    /// Joints over a path.
    pub trace: Option<Trace>,
}

impl Plan {
    /// Finds the limbs of the robots and lists what is to be done with them.
    ///
    /// # Errors
    /// A robot that cannot be built, a limb or frame the suite names and no robot of it has, a suite without any limb.
    pub fn new(suite: &LimbSuite, amount: Amount) -> Result<Self, InputError> {
        let mut subjects: Vec<Subject> = Vec::new();
        for (i, spec) in suite.robots.iter().enumerate() {
            let robot = spec.build(&format!("{}: robots[{i}]", suite.source))?;
            if subjects.iter().any(|s| s.robot.name() == robot.name()) {
                let field = format!("robots[{i}]");
                return Err(InputError::value(
                    &suite.source,
                    &field,
                    robot.name(),
                    "each robot once",
                ));
            }
            let limbs = Subject::of(&robot, &suite.source)?;
            if limbs.is_empty() {
                let field = format!("robots[{i}]");
                let allowed = format!(
                    "a robot with a limb in closed form; `ik-bench explain closed-form --robot {}` says why it has none",
                    spec.argument()
                );
                return Err(InputError::value(&suite.source, &field, robot.name(), &allowed));
            }
            subjects.extend(limbs);
        }
        let mut plan = Self {
            suite: suite.clone(),
            amount,
            subjects,
            jobs: Vec::new(),
        };
        plan.jobs = plan.list()?;
        if plan.jobs.is_empty() {
            let allowed = "at least one with a limb this study can take";
            return Err(InputError::value(
                &suite.source,
                "robots",
                "no such limb",
                allowed,
            ));
        }
        Ok(plan)
    }

    /// The suite.
    pub fn suite(&self) -> &LimbSuite {
        &self.suite
    }

    /// What is to be done, limb by limb.
    pub fn jobs(&self) -> &[Job] {
        &self.jobs
    }

    /// What the rows do not say: robots without any.
    pub fn notes(&self) -> Vec<String> {
        let mut without: Vec<&str> = Vec::new();
        for (subject, limb) in self.subjects.iter().enumerate() {
            let of_robot = |job: &&Job| self.subjects[job.subject].robot.name() == limb.robot.name();
            let is_first = subject == 0 || self.subjects[subject - 1].robot.name() != limb.robot.name();
            if is_first && !self.jobs.iter().any(|job| of_robot(&job)) {
                without.push(limb.robot.name());
            }
        }
        let note = |robot: &str| {
            format!(
                "{}: no rows of {robot}: all its limbs are of general families, whose singular sets have no names",
                self.suite.id
            )
        };
        without.into_iter().map(note).collect()
    }

    fn list(&self) -> Result<Vec<Job>, InputError> {
        let mut jobs = Vec::new();
        let mut add = |subject: usize, what: What, set: String| jobs.push(Job { subject, what, set });
        match &self.suite.study {
            Study::Grid(spec) => {
                for subject in 0..self.subjects.len() {
                    Set::all(spec)
                        .into_iter()
                        .for_each(|set| add(subject, What::Grid(set), set.id()));
                }
            }
            Study::Continuity(spec) => {
                self.check_traced(spec)?;
                for (subject, limb) in self.subjects.iter().enumerate() {
                    for (set, kind) in continuity::sets(limb) {
                        add(
                            subject,
                            What::Continuity(set, kind),
                            format!("{}-{}", set.id, kind.word()),
                        );
                    }
                }
            }
            Study::Reach(spec) => {
                for subject in 0..self.subjects.len() {
                    add(subject, What::Reach, "orientations".to_owned());
                }
                for (i, slice) in spec.slices.iter().enumerate() {
                    add(
                        self.with_frame(i, slice)?,
                        What::Slice(i),
                        format!("slice-{i}-{}", slice.frame),
                    );
                }
                for (i, posture) in spec.postures.iter().enumerate() {
                    add(
                        self.with_posture(spec, i)?,
                        What::Postures(i),
                        format!("postures-{i}-{}", posture.limb),
                    );
                }
            }
        }
        Ok(jobs)
    }

    /// Every limb that shall be traced is one of the suite.
    fn check_traced(&self, spec: &ContinuitySpec) -> Result<(), InputError> {
        let known: Vec<String> = self.subjects.iter().map(Subject::path).collect();
        for (i, name) in spec.traced.iter().enumerate() {
            if !known.contains(name) {
                let place = format!("{}: study.continuity.traced[{i}]", self.suite.source);
                return Err(InputError::unknown(&place, "limb", name, &known));
            }
        }
        Ok(())
    }

    fn with_frame(&self, i: usize, slice: &SliceSpec) -> Result<usize, InputError> {
        let ends = |s: &Subject, frame: &str| s.report.frames.iter().any(|f| s.robot.frame_name(*f) == frame);
        let found = |s: &Subject| s.robot.name() == slice.robot && ends(s, &slice.frame);
        self.subjects.iter().position(found).ok_or_else(|| {
            let place = format!("{}: study.reach.slices[{i}]", self.suite.source);
            let name = format!("{}/{}", slice.robot, slice.frame);
            let frames = |s: &Subject| -> Vec<String> {
                let names = s.report.frames.iter().map(|f| s.robot.frame_name(*f));
                names.map(|frame| format!("{}/{frame}", s.robot.name())).collect()
            };
            InputError::unknown(
                &place,
                "frame at the end of a limb",
                &name,
                self.subjects.iter().flat_map(frames),
            )
        })
    }

    fn with_posture(&self, spec: &ReachSpec, i: usize) -> Result<usize, InputError> {
        let posture = &spec.postures[i];
        let place = format!("{}: study.reach.postures[{i}]", self.suite.source);
        let name = format!("{}/{}", posture.robot, posture.limb);
        let found = self.subjects.iter().position(|s| s.path() == name);
        let subject = found.ok_or_else(|| {
            InputError::unknown(&place, "limb", &name, self.subjects.iter().map(Subject::path))
        })?;
        let joints = self.subjects[subject].joints();
        if posture.joints_deg.len() != joints {
            let found = format!("{} numbers", posture.joints_deg.len());
            return Err(InputError::value(
                &place,
                "joints_deg",
                found,
                &format!("{joints} numbers"),
            ));
        }
        Ok(subject)
    }

    /// What tells the row of a job from all others.
    pub fn key(&self, job: &Job, revision: &str) -> LimbKey {
        let subject = &self.subjects[job.subject];
        LimbKey::new(
            [
                &self.suite.id,
                subject.robot.name(),
                &subject.report.tip_name,
                &job.set,
            ],
            self.suite.seed,
            &self.parameters(job),
            revision,
        )
    }

    /// Limb and set, for a progress bar.
    pub fn label(&self, job: &Job) -> String {
        format!(
            "{} {} {}",
            self.suite.id,
            self.subjects[job.subject].path(),
            job.set
        )
    }

    /// Whether the row of the job is to have a trace.
    pub fn is_traced(&self, job: &Job) -> bool {
        let Study::Continuity(spec) = &self.suite.study else {
            return false;
        };
        spec.traced.contains(&self.subjects[job.subject].path())
    }

    /// Makes the row of a job, with the solver of its limb.
    pub fn make(&self, job: &Job, session: &Session) -> Made {
        let subject = &self.subjects[job.subject];
        let solve = |pose: &Isometry3<f64>,
                     previous: &Joints,
                     answers: &mut Answers|
         -> Result<(), Unsolved> { subject.solve(pose, previous, answers) };
        let (found, trace) = self.found(job, &solve);
        let row = LimbRow {
            schema: SCHEMA.to_owned(),
            suite: self.suite.id.clone(),
            robot: subject.robot.name().to_owned(),
            limb: subject.report.tip_name.clone(),
            side: subject.report.side.to_string(),
            family: subject.family.to_string(),
            set: job.set.clone(),
            parameters: self.parameters(job),
            seed: self.suite.seed,
            revision: session.revision.clone(),
            machine: session.machine.clone(),
            notes: session.notes.clone(),
            found,
            trace: None,
        };
        Made {
            row,
            trace: trace.filter(|_| self.is_traced(job)),
        }
    }

    /// What a solver achieves on a job.
    pub(super) fn found(&self, job: &Job, solve: &Solve<'_>) -> (Findings, Option<Trace>) {
        let subject = &self.subjects[job.subject];
        let numbers = Numbers::new(self.suite.seed, &format!("{}/{}", subject.path(), job.set));
        let of = self.amount;
        match (&self.suite.study, job.what) {
            (Study::Grid(spec), What::Grid(set)) => {
                let counts = of.of(&spec.full, &spec.quick);
                let postures = grid::postures(subject, set, counts, numbers);
                let mut found = grid::judge(subject, set, &postures, solve);
                found.times = grid::times(subject, &postures, counts.timed);
                (Findings::Grid(found), None)
            }
            (Study::Continuity(spec), What::Continuity(set, kind)) => {
                let counts = of.of(&spec.full, &spec.quick);
                let (found, trace) = continuity::follow(subject, (set, kind), spec, counts, numbers, solve);
                (Findings::Continuity(found), trace)
            }
            (Study::Reach(spec), What::Reach) => {
                let counts = of.of(&spec.full, &spec.quick);
                let found = reach::reach(subject, spec, counts, numbers, solve);
                (Findings::Reach(found), None)
            }
            (Study::Reach(spec), What::Slice(i)) => {
                let cells = of.of(&spec.full, &spec.quick).cells;
                let found = workspace::slice(subject, &spec.slices[i], spec, cells, solve);
                (Findings::Slice(found), None)
            }
            (Study::Reach(spec), What::Postures(i)) => {
                let found = workspace::postures(subject, &spec.postures[i], solve);
                (Findings::Postures(found), None)
            }
            _ => unreachable!("a job belongs to the study that listed it"),
        }
    }

    fn parameters(&self, job: &Job) -> BTreeMap<String, serde_json::Value> {
        let of = self.amount;
        let of_counts = |counts: &[(&str, serde_json::Value)]| {
            counts
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value.clone()))
                .collect()
        };
        match (&self.suite.study, job.what) {
            (Study::Grid(spec), What::Grid(set)) => grid::parameters(set, of.of(&spec.full, &spec.quick)),
            (Study::Continuity(spec), _) => {
                let counts = of.of(&spec.full, &spec.quick);
                of_counts(&[
                    ("half_width_rad", spec.half_width_rad.into()),
                    ("turn_rad", spec.turn_rad.into()),
                    ("paths", counts.paths.into()),
                    ("steps", counts.steps.into()),
                ])
            }
            (Study::Reach(spec), What::Reach) => {
                let counts = of.of(&spec.full, &spec.quick);
                of_counts(&[
                    ("beyond", spec.beyond.into()),
                    ("distances", counts.distances.into()),
                    ("orientations", counts.orientations.into()),
                ])
            }
            (Study::Reach(spec), What::Slice(i)) => of_counts(&[
                ("beyond", spec.beyond.into()),
                ("cells", of.of(&spec.full, &spec.quick).cells.into()),
                (
                    "rotation_rpy_rad",
                    spec.slices[i].rotation_rpy_rad.to_vec().into(),
                ),
            ]),
            (Study::Reach(spec), What::Postures(i)) => {
                of_counts(&[("joints_deg", spec.postures[i].joints_deg.clone().into())])
            }
            _ => BTreeMap::new(),
        }
    }

    #[cfg(test)]
    pub(super) fn subject(&self, job: &Job) -> &Subject {
        &self.subjects[job.subject]
    }
}

impl Subject {
    /// `robot/last body`.
    pub(super) fn path(&self) -> String {
        format!("{}/{}", self.robot.name(), self.report.tip_name)
    }
}
