//! Footsteps within reach: whether the robot can stand where a walk puts its feet.
//!
//! Legs are longest at lift-off and at touchdown. At both ends of every swing the loops are closed from the configuration at the
//! end before, so the check asks for all tasks at once and knows what the hips can give. Joint limits are not asked for: who
//! keeps them, and what it costs, is what the runs show.

use super::closure::{Closer, Miss};
use super::problem_spec::ProblemSpec;
use crate::error::InputError;
use crate::trajectory::{Trajectory, WalkSpec};

/// Halvings of the interval between a length that is within reach and one that is not: to a millionth of it.
const HALVINGS: u32 = 20;

/// A walk with other numbers, from its specification.
type Rebuilt<'a> = dyn Fn(&WalkSpec) -> Result<Trajectory, InputError> + 'a;

/// The end of a swing at which a task cannot be met.
struct OutOfReach {
    step: usize,
    t: f64,
    miss: Miss,
}

/// Checks the footsteps of `walk` for a robot that starts at `q_start`; `place` and `field` (the path of the table) go into
/// messages.
///
/// # Errors
/// The first step that cannot be made, what misses and by how much, and the longest step that can.
pub(super) fn check_footsteps(
    spec: &ProblemSpec,
    walk: &WalkSpec,
    rebuilt: &Rebuilt<'_>,
    q_start: &[f64],
    place: &str,
    field: &str,
) -> Result<(), InputError> {
    let closer = Closer::new(spec, place)?;
    let out_of_reach = |step_m: f64| {
        let walk = WalkSpec {
            step_m,
            ..walk.clone()
        };
        first_out_of_reach(&closer, &rebuilt(&walk)?, q_start, place)
    };
    let Some(out) = out_of_reach(walk.step_m)? else {
        return Ok(());
    };
    let (mut reached, mut missed) = (0.0, walk.step_m);
    let allowed = if out_of_reach(reached)?.is_some() {
        "within reach; without any step it is not: change foot_spacing_m, com_height_m or the start"
            .to_owned()
    } else {
        for _ in 0..HALVINGS {
            let middle = 0.5 * (reached + missed);
            match out_of_reach(middle)? {
                None => reached = middle,
                Some(_) => missed = middle,
            }
        }
        format!("at most {reached:.4} in size, with which all tasks can be met")
    };
    let field = format!("{field}.step_m");
    let found = format!(
        "{} ({} is missed by {:.3e} in step {} at t = {:.3} s)",
        walk.step_m, out.miss.component, out.miss.error, out.step, out.t
    );
    Err(InputError::value(place, &field, found, &allowed))
}

fn first_out_of_reach(
    closer: &Closer,
    trajectory: &Trajectory,
    q_start: &[f64],
    place: &str,
) -> Result<Option<OutOfReach>, InputError> {
    let Some(walk) = trajectory.walk() else {
        return Ok(None);
    };
    let mut q = q_start.to_vec();
    for (i, step) in walk.plan.steps.iter().enumerate() {
        // A motion that ends before the walk does asks for no more.
        let ends = [step.lift_off_s, step.touch_down_s].into_iter();
        for t in ends.filter(|t| *t <= walk.until_s) {
            let closed = closer.close(trajectory, t, &q, place)?;
            if let Some(miss) = closed.miss {
                let step = i + 1;
                return Ok(Some(OutOfReach { step, t, miss }));
            }
            q = closed.q;
        }
    }
    Ok(None)
}
