//! Which limb of a robot solves which task, and what places the waist: decided once per phase.

use super::shell::Shell;
use crate::reverse_decoupling::Limb;
use crate::reverse_decoupling::analyser::{
    End, Family, LimbReport, Verdict, denavit_hartenberg, limb_axes, limbs, meeting, with_virtual_wrist,
};
use ik_core::formulation::Declined;
use ik_core::kinematics::Page;
use ik_core::problem::{Phase, Problem};
use ik_core::robot::{FrameId, Robot, Root};
use ik_core::spatial::{rpy, so3};
use ik_core::task::{OrientationCoordinates, Priority, Track};
use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3};

/// Quaternions of targets further from unit length than this are no rotations.
const UNIT_TOLERANCE: f64 = 1e-6;

/// Where an orientation target stands, and how its frame is turned in its body.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attitude {
    x: usize,
    coordinates: OrientationCoordinates,
    frame_to_body: UnitQuaternion<f64>,
}

impl Attitude {
    /// Whether the numbers are a rotation, up to the length of a quaternion.
    fn is_rotation(&self, x: &[f64]) -> bool {
        let length = || {
            x[self.x..self.x + 4]
                .iter()
                .fold(0.0, |length: f64, c| length.hypot(*c))
        };
        match self.coordinates {
            OrientationCoordinates::RollPitchYaw => true,
            OrientationCoordinates::Log => (length() - 1.0).abs() < UNIT_TOLERANCE,
        }
    }

    /// Rotation of the body.
    pub(super) fn of_body(&self, x: &[f64]) -> UnitQuaternion<f64> {
        let numbers = &x[self.x..];
        let frame = match self.coordinates {
            OrientationCoordinates::RollPitchYaw => {
                so3::quaternion(&rpy::to_matrix(&Vector3::new(numbers[0], numbers[1], numbers[2])))
            }
            OrientationCoordinates::Log => {
                UnitQuaternion::new_normalize(Quaternion::new(numbers[3], numbers[0], numbers[1], numbers[2]))
            }
        };
        frame * self.frame_to_body
    }
}

/// Where a position target stands, and where its frame is in its body (m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    x: usize,
    pub(super) in_body: Point3<f64>,
}

impl Place {
    /// The target (m, world).
    pub(super) fn point(&self, x: &[f64]) -> Vector3<f64> {
        Vector3::new(x[self.x], x[self.x + 1], x[self.x + 2])
    }

    /// Pose of the body, turned by `rotation`.
    fn pose(&self, x: &[f64], rotation: UnitQuaternion<f64>) -> Isometry3<f64> {
        let position = self.point(x) - rotation * self.in_body.coords;
        Isometry3::from_parts(Translation3::from(position), rotation)
    }
}

/// What places the root.
#[derive(Clone, Copy, Debug)]
pub(super) enum Waist {
    /// Nothing: it is fixed.
    Fixed,
    /// Its tasks.
    Prescribed(Attitude, Place),
    /// Its orientation and the centre of mass: an outer iteration on its position.
    Balanced(Attitude, usize),
}

/// What a limb is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target {
    /// Pose of its last body.
    Pose(Attitude, Place),
    /// A point of its last body.
    Point(Place),
}

impl Target {
    /// Pose the last body shall have in the world; of a point the rotation is any.
    pub(super) fn pose(&self, x: &[f64]) -> Isometry3<f64> {
        match self {
            Self::Pose(attitude, place) => place.pose(x, attitude.of_body(x)),
            Self::Point(place) => Isometry3::from_parts(place.point(x).into(), UnitQuaternion::identity()),
        }
    }
}

/// One limb with its task.
#[derive(Clone, Debug)]
pub(super) struct LimbPlan {
    pub(super) limb: Limb,
    pub(super) target: Target,
    /// Last body.
    pub(super) tip: usize,
    /// A frame fixed in it, and the body seen from this frame.
    frame: FrameId,
    body_to_frame: Isometry3<f64>,
    /// Joint coordinates, base to tip.
    pub(super) coordinates: Vec<usize>,
    /// The three axes that meet, of a limb that takes a pose: at which end, and where, in the root or in the last body (m).
    pub(super) triple: (End, Point3<f64>),
    pub(super) shell: Option<Shell>,
    /// Of an arm of the paper: its last axis in the last body (unit), and the lengths of forearm and upper arm (m).
    pub(super) ring: Option<(Vector3<f64>, f64, f64)>,
    pub(super) is_hard: bool,
}

impl LimbPlan {
    /// Pose of the last body in the world.
    pub(super) fn tip_pose(&self, robot: &Robot, page: &Page) -> Isometry3<f64> {
        page.frame_pose(robot, self.frame) * self.body_to_frame
    }
}

/// One phase.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) waist: Waist,
    pub(super) limbs: Vec<LimbPlan>,
    /// Joint coordinates that no task asks for.
    pub(super) idle: Vec<usize>,
}

/// Targets gathered for one body.
#[derive(Clone, Debug, Default)]
struct Asked {
    orientation: Option<Attitude>,
    position: Option<Place>,
    is_hard: bool,
    /// Name of the last task.
    task: String,
}

fn shape<T>(reason: String) -> Result<T, Declined> {
    Err(Declined::Shape(reason))
}

impl Plan {
    /// Assigns the tasks of a phase.
    ///
    /// # Errors
    /// The first task that no limb with a closed form takes, or why the waist is not placed.
    pub(super) fn new(problem: &Problem, phase: &Phase) -> Result<Self, Declined> {
        let robot = problem.robot();
        let (asked, centre_of_mass) = gather(problem, phase)?;
        let waist = waist(robot, &asked[0], centre_of_mass)?;
        let reports = limbs(robot);
        let mut plans = Vec::new();
        for (body, asked) in asked.iter().enumerate().skip(1) {
            if asked.orientation.is_some() || asked.position.is_some() {
                plans.push(limb_plan(robot, &reports, body, asked)?);
            }
        }
        if let (Waist::Balanced(..), Some(arm)) =
            (waist, plans.iter().find(|plan| plan.coordinates.len() == 4))
        {
            return shape(format!(
                "limb at `{}` has four joints: it cannot hold a pose while the waist moves for the centre of mass",
                robot.bodies()[arm.tip].name
            ));
        }
        let busy = |c: &usize| plans.iter().any(|plan| plan.coordinates.contains(c));
        let idle = (0..robot.coordinates().len()).filter(|c| !busy(c)).collect();
        Ok(Self {
            waist,
            limbs: plans,
            idle,
        })
    }

    /// Whether all orientation targets are rotations.
    pub(super) fn has_rotations(&self, x: &[f64]) -> bool {
        let waist = match &self.waist {
            Waist::Fixed => true,
            Waist::Prescribed(attitude, _) | Waist::Balanced(attitude, _) => attitude.is_rotation(x),
        };
        let of_limb = |limb: &LimbPlan| match &limb.target {
            Target::Pose(attitude, _) => attitude.is_rotation(x),
            Target::Point(_) => true,
        };
        waist && self.limbs.iter().all(of_limb)
    }

    /// Remarks on what is left out.
    pub(super) fn notes(&self, robot: &Robot) -> Vec<String> {
        let mut notes = Vec::new();
        if !self.idle.is_empty() {
            let names: Vec<_> = self
                .idle
                .iter()
                .map(|&c| robot.coordinates()[c].name.as_str())
                .collect();
            notes.push(format!(
                "no task asks for these joints, they stay: {}",
                names.join(", ")
            ));
        }
        if matches!(self.waist, Waist::Balanced(..)) {
            notes.push(
                "the centre of mass is met by an outer Newton iteration on the waist position".to_owned(),
            );
        }
        notes
    }
}

/// What each body is asked for, and the slot of the centre of mass.
fn gather(problem: &Problem, phase: &Phase) -> Result<(Vec<Asked>, Option<usize>), Declined> {
    let robot = problem.robot();
    let mut asked = vec![Asked::default(); robot.bodies().len()];
    let mut centre_of_mass = None;
    for (index, priority) in &phase.tasks {
        let (task, slot) = (&problem.tasks()[*index], problem.slots()[*index]);
        let (frame, position, orientation) = match task.track {
            Track::Position(frame) => (frame, Some(slot.x), None),
            Track::Orientation(frame) => (frame, None, Some(slot.x)),
            Track::Pose(frame) => (frame, Some(slot.x), Some(slot.x + 3)),
            Track::CentreOfMass => {
                if centre_of_mass.replace(slot.x).is_some() {
                    return shape(format!(
                        "task `{}` tracks the centre of mass a second time",
                        task.name
                    ));
                }
                continue;
            }
            Track::Posture => {
                return shape(format!(
                    "task `{}` tracks joints, and a closed form leaves none to choose",
                    task.name
                ));
            }
        };
        let FrameId(id) = frame;
        let frame = &robot.frames()[id];
        let body = &mut asked[frame.body];
        let attitude = orientation.map(|x| Attitude {
            x,
            coordinates: problem.orientation(),
            frame_to_body: frame.x_body_frame.rotation.inverse(),
        });
        let place = position.map(|x| Place {
            x,
            in_body: Point3::from(frame.x_body_frame.translation.vector),
        });
        if (attitude.is_some() && body.orientation.is_some()) || (place.is_some() && body.position.is_some())
        {
            return shape(format!(
                "tasks `{}` and `{}` both move body `{}`",
                body.task,
                task.name,
                robot.bodies()[frame.body].name
            ));
        }
        body.orientation = body.orientation.or(attitude);
        body.position = body.position.or(place);
        body.is_hard |= *priority == Priority::Hard;
        body.task.clone_from(&task.name);
    }
    Ok((asked, centre_of_mass))
}

fn waist(robot: &Robot, asked: &Asked, centre_of_mass: Option<usize>) -> Result<Waist, Declined> {
    let name = &robot.bodies()[0].name;
    if robot.root() == Root::Fixed {
        return match (asked.task.is_empty(), centre_of_mass) {
            (true, None) => Ok(Waist::Fixed),
            (false, _) => shape(format!("task `{}` moves `{name}`, which is fixed", asked.task)),
            (true, Some(_)) => shape(format!("a centre of mass needs `{name}` to move, which is fixed")),
        };
    }
    let Some(orientation) = asked.orientation else {
        return shape(format!(
            "limbs are solved from the root: a pose or orientation task on a frame of `{name}` is needed"
        ));
    };
    match (asked.position, centre_of_mass) {
        (Some(place), None) => Ok(Waist::Prescribed(orientation, place)),
        (None, Some(slot)) => Ok(Waist::Balanced(orientation, slot)),
        (Some(_), Some(_)) => shape(format!(
            "task `{}` and the centre of mass both place `{name}`",
            asked.task
        )),
        (None, None) => shape(format!(
            "neither a position task nor the centre of mass places `{name}`"
        )),
    }
}

fn limb_plan(
    robot: &Robot,
    reports: &[LimbReport],
    body: usize,
    asked: &Asked,
) -> Result<LimbPlan, Declined> {
    let name = &robot.bodies()[body].name;
    let Some(report) = reports.iter().find(|report| report.tip == body) else {
        return shape(format!(
            "task `{}` moves `{name}`, which is the end of no limb",
            asked.task
        ));
    };
    if report.base != 0 {
        return shape(format!(
            "task `{}` moves the limb at `{name}`, whose base `{}` is moved by other joints",
            asked.task, report.base_name
        ));
    }
    let joints = report.joints.iter();
    let coordinates = joints.map(|&j| robot.joints()[j].coordinate).collect();
    let declined = |reason: String| Declined::Shape(format!("task `{}`: {reason}", asked.task));
    let Some(place) = asked.position else {
        return Err(declined(format!(
            "an orientation alone does not fix the joints of the limb at `{name}`"
        )));
    };
    let plan = |limb, target, triple, shell, ring| LimbPlan {
        limb,
        target,
        tip: body,
        frame: report.frames[0],
        body_to_frame: robot.frames()[report.frames[0].0].x_body_frame.inverse(),
        coordinates,
        triple,
        shell,
        ring,
        is_hard: asked.is_hard,
    };
    if let Some(attitude) = asked.orientation {
        let limb = Limb::new(robot, report).map_err(|e| declined(e.to_string()))?;
        let table = denavit_hartenberg(robot, report).map_err(|e| declined(e.to_string()))?;
        let Verdict::ClosedForm(family) = report.verdict else {
            return Err(declined(format!("the limb at `{name}` has no closed form")));
        };
        let end = family.triple();
        let (lines, tip) = limb_axes(robot, &report.joints);
        let triple = match end {
            End::Base => meeting(&lines[..3]).point.into(),
            End::Tip => tip.inverse_transform_point(&meeting(&lines[lines.len() - 3..]).point.into()),
        };
        let shell = match family {
            Family::FourJointArm => None,
            _ => Shell::of(robot, &report.joints, &table, end),
        };
        let last_axis = tip.inverse_transform_vector(&lines[lines.len() - 1].axis);
        let ring = match family {
            Family::Arm => Some((last_axis, table.rows[4].d.abs(), table.rows[2].d.abs())),
            _ => None,
        };
        Ok(plan(
            limb,
            Target::Pose(attitude, place),
            (end, triple),
            shell,
            ring,
        ))
    } else {
        let point = place.in_body;
        let limb = Limb::placing(robot, report, &point).map_err(|e| declined(e.to_string()))?;
        let table = with_virtual_wrist(robot, report, &point);
        let shell = table.and_then(|table| Shell::of_point(robot, &report.joints, &table, &point));
        Ok(plan(limb, Target::Point(place), (End::Tip, point), shell, None))
    }
}
