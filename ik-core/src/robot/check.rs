//! Checks of single links and joints: numbers, masses, axes, limits.

use super::error::{Place, RobotError};
use super::model::Limits;
use super::spec::{Inertial, JointKind, JointSpec, LinkSpec};
use nalgebra::Isometry3;

/// An axis this near to unit length is normalised, one further away is refused: files write six decimals or
/// more.
const AXIS_TOLERANCE: f64 = 1e-6;

/// Refuses a link whose mass is negative or whose numbers are not finite.
pub(super) fn link(link: &LinkSpec, place: &Place) -> Result<(), RobotError> {
    let Some(Inertial {
        mass_kg,
        com,
        inertia,
    }) = &link.inertial
    else {
        return Ok(());
    };
    let owner = format!("link `{}`", link.name);
    finite(place, &owner, "mass", [*mass_kg])?;
    finite(place, &owner, "centre of mass", com.iter().copied())?;
    finite(place, &owner, "inertia", inertia.iter().copied())?;
    if *mass_kg < 0.0 {
        return Err(RobotError::NegativeMass {
            place: place.clone(),
            link: link.name.clone(),
            mass_kg: *mass_kg,
        });
    }
    Ok(())
}

/// Refuses a joint whose numbers are not finite, whose axis is no unit vector or whose limits are missing or
/// no limits.
pub(super) fn joint(joint: &JointSpec, place: &Place) -> Result<(), RobotError> {
    let owner = format!("joint `{}`", joint.name);
    finite(place, &owner, "origin", not_finite_in(&joint.origin))?;
    if let Some(mimic) = &joint.mimic {
        finite(place, &owner, "mimic multiplier", [mimic.multiplier])?;
        finite(place, &owner, "mimic offset", [mimic.offset])?;
    }
    if joint.kind.moves() {
        axis(joint, place)?;
        joint_limits(joint, place)
    } else if joint.mimic.is_some() {
        let (joint, kind) = (joint.name.clone(), joint.kind.word());
        Err(RobotError::MimicNotMoving {
            place: place.clone(),
            joint,
            kind,
        })
    } else {
        Ok(())
    }
}

fn axis(joint: &JointSpec, place: &Place) -> Result<(), RobotError> {
    finite(
        place,
        &format!("joint `{}`", joint.name),
        "axis",
        joint.axis.iter().copied(),
    )?;
    let length = joint.axis.norm();
    if (length - 1.0).abs() > AXIS_TOLERANCE {
        return Err(RobotError::Axis {
            place: place.clone(),
            joint: joint.name.clone(),
            axis: joint.axis.into(),
            length,
            tolerance: AXIS_TOLERANCE,
        });
    }
    Ok(())
}

fn joint_limits(joint: &JointSpec, place: &Place) -> Result<(), RobotError> {
    match &joint.limits {
        Some(found) => limits(place, &joint.name, found),
        None if joint.kind == JointKind::Continuous => Ok(()),
        None => {
            let (joint, kind) = (joint.name.clone(), joint.kind.word());
            Err(RobotError::MissingLimits {
                place: place.clone(),
                joint,
                kind,
            })
        }
    }
}

fn finite(
    place: &Place,
    owner: &str,
    field: &str,
    values: impl IntoIterator<Item = f64>,
) -> Result<(), RobotError> {
    match values.into_iter().find(|value| !value.is_finite()) {
        Some(value) => {
            let (owner, field) = (owner.to_owned(), field.to_owned());
            Err(RobotError::NotFinite {
                place: place.clone(),
                owner,
                field,
                value,
            })
        }
        None => Ok(()),
    }
}

/// The first number of a pose that is not finite.
pub(super) fn not_finite_in(pose: &Isometry3<f64>) -> Option<f64> {
    let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
    numbers.copied().find(|x| !x.is_finite())
}

/// Refuses limits that are no interval, or NaN, or negative (velocity, effort).
pub(super) fn limits(place: &Place, joint: &str, limits: &Limits) -> Result<(), RobotError> {
    let Limits {
        lower,
        upper,
        velocity,
        effort,
    } = *limits;
    let fields = [
        ("lower", lower),
        ("upper", upper),
        ("velocity", velocity),
        ("effort", effort),
    ];
    if let Some((field, value)) = fields.into_iter().find(|(_, value)| value.is_nan()) {
        let (owner, field) = (format!("joint `{joint}`"), format!("{field} limit"));
        return Err(RobotError::NotFinite {
            place: place.clone(),
            owner,
            field,
            value,
        });
    }
    let empty_or_at_infinity = lower > upper || lower == f64::INFINITY || upper == f64::NEG_INFINITY;
    if empty_or_at_infinity {
        return Err(RobotError::LimitsReversed {
            place: place.clone(),
            joint: joint.to_owned(),
            lower,
            upper,
        });
    }
    match [("velocity", velocity), ("effort", effort)]
        .into_iter()
        .find(|(_, value)| *value < 0.0)
    {
        Some((field, value)) => Err(RobotError::NegativeLimit {
            place: place.clone(),
            joint: joint.to_owned(),
            field,
            value,
        }),
        None => Ok(()),
    }
}
