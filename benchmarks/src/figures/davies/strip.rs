//! Figure 10: the robot while walking, from the side and from the front.

use super::super::axis::Axis;
use super::super::figure::{Figure, PanelRow};
use super::super::panel::{Aspect, Level, Panel};
use super::super::skeleton::{Skeleton, View};
use super::super::{Obstacle, Studio, place_of};
use super::{Walked, walked};
use nalgebra::Point3;

/// Postures, at equal intervals.
const POSTURES: usize = 11;
/// Room between neighbouring postures (m): from the side in addition to what the robot went.
const SIDE_GAP_M: f64 = 0.17;
const FRONT_GAP_M: f64 = 0.30;

/// Figure 10.
pub(in super::super) fn strip(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio)?;
    let robot = walked.case.problem.robot();
    let q = &walked.q;
    let skeleton = bioloid(&walked);
    let last = q.len() - 1;
    let chosen: Vec<usize> = (0..POSTURES).map(|i| i * last / (POSTURES - 1)).collect();
    let rows = [
        (View::Side, "from the right", SIDE_GAP_M, 185.0),
        (View::Front, "from the front", FRONT_GAP_M, 165.0),
    ]
    .map(|(view, title, gap_m, height)| {
        let mut panel = Panel::new(title, Axis::linear(""), Axis::linear("z (m)"));
        let mut names = Vec::new();
        for (place, &k) in chosen.iter().enumerate() {
            let aside_m = place as f64 * gap_m;
            panel.curves.extend(skeleton.curves(robot, &q[k], view, aside_m));
            let root = view.point(&Point3::new(q[k][0], q[k][1], q[k][2])).0 + aside_m;
            names.push((root, format!("{:.1} s", k as f64 * walked.case.dt_s)));
        }
        panel.x.names = names;
        panel.aspect = Aspect::Equal;
        panel.levels.push(Level {
            name: "floor".to_owned(),
            value: 0.0,
        });
        PanelRow::new(height, vec![panel])
    });
    let title = format!("Fig. 10  Walk: {}, {}", walked.run.label, place_of(&walked.run));
    let remark = format!(
        "Both axes have one scale. Each posture stands {SIDE_GAP_M} m (from the side, besides the way it went) or {FRONT_GAP_M} m \
         (from the front) beside the one before; ticks are where the waist is."
    );
    Ok(Figure::new(title, rows.to_vec())
        .with_remarks(vec![remark])
        .render()?)
}

/// Limbs to the hands and soles.
fn bioloid(walked: &Walked<'_>) -> Skeleton {
    let robot = walked.case.problem.robot();
    let mut skeleton = Skeleton::new(robot);
    for hand in ["r_hand", "l_hand"] {
        skeleton.end(robot, hand);
    }
    for sole in &walked.soles {
        skeleton.sole(robot, &sole.frame, [sole.half_length_m, sole.half_width_m]);
    }
    skeleton
}
