//! The suites that judge closed-form limbs themselves: poses without control steps.
//!
//! A [`LimbSuite`] names robots and one [`Study`]; [`Plan`] turns it into jobs, one per robot, limb and set of poses; each
//! job ends as one [`LimbRow`] in a file of its own. What a solver returns is judged by the robot's ordinary kinematics
//! ([`ik_core::kinematics`]) and by quantities read off the joint angles, never by the solver's own formulas.
//!
//! Source of the tests on grids: Ali, Park & Lee, *Closed-form inverse kinematic joint solution for humanoid robots*,
//! section V.

mod continuity;
mod grid;
mod numbers;
mod plan;
mod reach;
mod record;
mod store;
mod subject;
mod suite;
mod tables;
mod workspace;

pub use plan::{Amount, Job, Made, Plan};
pub use record::{
    ContinuityFindings, Findings, GridFindings, LimbRow, PosturesFindings, ReachFindings, SCHEMA,
    ShownPosture, SliceFindings, Times,
};
pub use store::{LIMBS_FILE, LimbKey, LimbStore, read_limbs};
pub use suite::{
    ContinuityCounts, ContinuitySpec, EMBEDDED, GridCounts, GridSpec, LimbSuite, OffAxis, PostureSpec,
    ReachCounts, ReachSpec, SliceSpec, Study, is_limb_suite,
};
pub use tables::{
    CLOSED_FORM_BEGIN, CLOSED_FORM_END, limbs_markdown, limbs_terminal, readme_limbs, replace_readme_limbs,
};

#[cfg(test)]
mod tests;
