//! Robots that come with the library, so that every experiment runs from the program alone.
//!
//! The numbers and where they come from: `robots/SOURCES.md`.

use super::error::RobotError;
use super::model::{Limits, Robot, Root};
use super::urdf::UrdfOptions;

/// An embedded robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EmbeddedRobot {
    /// What [`embedded`] takes.
    pub id: &'static str,
    /// What it is, in one line.
    pub summary: &'static str,
}

/// All embedded robots.
pub const EMBEDDED: &[EmbeddedRobot] = &[
    EmbeddedRobot {
        id: "coman",
        summary: "COMAN humanoid, free flyer and 29 revolute joints, 32 kg",
    },
    EmbeddedRobot {
        id: "coman-legs",
        summary: "COMAN with waist, arms and wrists locked at zero: free flyer and 12 leg joints, knees from 0 rad",
    },
    EmbeddedRobot {
        id: "coman-legs-hyperextension",
        summary: "coman-legs with the knees of the hardware, from -0.1745 rad, which pass through the straight leg",
    },
    EmbeddedRobot {
        id: "bioloid",
        summary: "Bioloid-type humanoid of point masses, free flyer and 18 revolute joints without limits, 1.7 kg",
    },
    EmbeddedRobot {
        id: "melson",
        summary: "Melson-type humanoid of point masses, free flyer and 19 revolute joints with a torso twist, 2.6 kg",
    },
    EmbeddedRobot {
        id: "hubo",
        summary: "Hubo humanoid by its D-H table, free flyer and 24 revolute joints, legs and arms of six, 55 kg",
    },
    EmbeddedRobot {
        id: "hoap2",
        summary: "HOAP-2 humanoid by its D-H table, free flyer and 20 revolute joints, arms of four, 7 kg",
    },
    EmbeddedRobot {
        id: "hrp2",
        summary: "HRP-2 humanoid by its D-H table, free flyer and 24 revolute joints, thighs with an offset, 58 kg",
    },
    EmbeddedRobot {
        id: "asimo",
        summary: "ASIMO humanoid by its D-H table, free flyer and 24 revolute joints, tilted shoulders, 54 kg",
    },
    EmbeddedRobot {
        id: "arm6",
        summary: "generic arm, fixed base, 6 revolute joints, spherical wrist",
    },
    EmbeddedRobot {
        id: "arm7",
        summary: "generic arm, fixed tilted base, 7 revolute joints, spherical-revolute-spherical",
    },
    EmbeddedRobot {
        id: "slider-arm",
        summary: "generic arm, fixed base, an oblique prismatic and 5 revolute joints",
    },
    EmbeddedRobot {
        id: "pendulum",
        summary: "one revolute joint, hanging down at zero",
    },
];

const COMAN: &str = include_str!("../../robots/coman.urdf");
const BIOLOID: &str = include_str!("../../robots/bioloid.urdf");
const MELSON: &str = include_str!("../../robots/melson.urdf");
const HUBO: &str = include_str!("../../robots/hubo.urdf");
const HOAP2: &str = include_str!("../../robots/hoap2.urdf");
const HRP2: &str = include_str!("../../robots/hrp2.urdf");
const ASIMO: &str = include_str!("../../robots/asimo.urdf");
const ARM6: &str = include_str!("../../robots/arm6.urdf");
const ARM7: &str = include_str!("../../robots/arm7.urdf");
const SLIDER_ARM: &str = include_str!("../../robots/slider-arm.urdf");
const PENDULUM: &str = include_str!("../../robots/pendulum.urdf");

/// Joints of COMAN that are not in the legs.
const COMAN_UPPER_BODY: [&str; 17] = [
    "WaistLat",
    "WaistSag",
    "WaistYaw",
    "LShSag",
    "LShLat",
    "LShYaw",
    "LElbj",
    "LForearmPlate",
    "LWrj1",
    "LWrj2",
    "RShSag",
    "RShLat",
    "RShYaw",
    "RElbj",
    "RForearmPlate",
    "RWrj1",
    "RWrj2",
];

/// The embedded robot of that id; its name is the id.
///
/// # Errors
/// [`RobotError::UnknownRobot`], which lists the ids there are.
pub fn embedded(id: &str) -> Result<Robot, RobotError> {
    match id {
        "coman" => read(COMAN, "robots/coman.urdf", Root::Floating),
        "coman-legs" => straight_knee_limit(&coman_legs()?.renamed(id)),
        "coman-legs-hyperextension" => Ok(coman_legs()?.renamed(id)),
        "bioloid" => read(BIOLOID, "robots/bioloid.urdf", Root::Floating),
        "melson" => read(MELSON, "robots/melson.urdf", Root::Floating),
        "hubo" => read(HUBO, "robots/hubo.urdf", Root::Floating),
        "hoap2" => read(HOAP2, "robots/hoap2.urdf", Root::Floating),
        "hrp2" => read(HRP2, "robots/hrp2.urdf", Root::Floating),
        "asimo" => read(ASIMO, "robots/asimo.urdf", Root::Floating),
        "arm6" => read(ARM6, "robots/arm6.urdf", Root::Fixed),
        "arm7" => read(ARM7, "robots/arm7.urdf", Root::Fixed),
        "slider-arm" => read(SLIDER_ARM, "robots/slider-arm.urdf", Root::Fixed),
        "pendulum" => read(PENDULUM, "robots/pendulum.urdf", Root::Fixed),
        _ => Err(RobotError::UnknownRobot {
            id: id.to_owned(),
            known: EMBEDDED.iter().map(|robot| robot.id.to_owned()).collect(),
        }),
    }
}

fn read(text: &str, source_name: &str, root: Root) -> Result<Robot, RobotError> {
    Robot::from_urdf_str(text, source_name, &UrdfOptions { root })
}

fn coman_legs() -> Result<Robot, RobotError> {
    read(COMAN, "robots/coman.urdf", Root::Floating)?.with_locked(&COMAN_UPPER_BODY.map(|joint| (joint, 0.0)))
}

/// Puts the knee limit at the singularity, the straight leg.
fn straight_knee_limit(legs: &Robot) -> Result<Robot, RobotError> {
    let mut robot = legs.clone();
    for knee in ["LKneeSag", "RKneeSag"] {
        let limits = robot.coordinates()[robot.coordinate(knee)?].limits;
        robot = robot.with_limits(knee, Limits { lower: 0.0, ..limits })?;
    }
    Ok(robot)
}
