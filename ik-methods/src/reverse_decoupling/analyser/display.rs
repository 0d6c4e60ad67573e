//! The words of a report.

use super::{Elimination, End, Family, Reason, Side, Verdict};
use std::fmt;

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Left => "left",
            Self::Right => "right",
            Self::Centre => "centre",
        })
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (triple, elimination) = match self {
            Self::Leg => return f.write_str("leg of the paper"),
            Self::Arm => return f.write_str("arm of the paper"),
            Self::FourJointArm => return f.write_str("arm of four joints"),
            Self::General { triple, elimination } => (triple, elimination),
        };
        let axes = match triple {
            End::Base => "1-2-3",
            End::Tip => "4-5-6",
        };
        let how = match elimination {
            Elimination::IntersectingLastAxes => "a5 = 0",
            Elimination::ParallelLastAxes => "sin alpha5 = 0",
            Elimination::Quartic => "quartic",
        };
        write!(f, "general, axes {axes} meet, {how}")
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Prismatic(joint) => write!(f, "joint `{joint}` slides"),
            Self::Mimic(joint) => write!(f, "joint `{joint}` follows another"),
            Self::TooFewJoints => f.write_str("fewer than six joints"),
            Self::TooManyJoints => f.write_str("more than six joints"),
            Self::SameAxis(a, b) => write!(f, "joints `{a}` and `{b}` turn about the same axis"),
            Self::MiddleTriple(joint) => write!(f, "axes meet in the middle only, from joint `{joint}` on"),
            Self::AxesMiss { base_m, tip_m } => {
                write!(
                    f,
                    "axes 1-2-3 miss by {base_m:.1e} m, axes 4-5-6 by {tip_m:.1e} m"
                )
            }
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ClosedForm(family) => write!(f, "closed form: {family}"),
            Self::NotCovered(reason) => write!(f, "no: {reason}"),
        }
    }
}
