//! Strips: a robot at equal intervals of a walk, posture beside posture.

use super::axis::Axis;
use super::figure::PanelRow;
use super::panel::{Aspect, Level, Panel};
use super::skeleton::View;
use super::walked::Walked;
use nalgebra::Point3;

/// Postures, at equal intervals.
const POSTURES: usize = 11;

/// How a strip is laid out.
pub(super) struct Strip {
    pub(super) view: View,
    pub(super) title: String,
    /// Room between neighbouring postures (m): from the side in addition to what the robot went.
    pub(super) gap_m: f64,
    pub(super) height: f64,
}

impl Strip {
    /// The panel of a walk.
    pub(super) fn row(&self, walked: &Walked<'_>) -> PanelRow {
        let robot = walked.case.problem.robot();
        let (q, times) = (&walked.q, walked.times());
        let skeleton = walked.skeleton();
        let last = q.len() - 1;
        let mut panel = Panel::new(&self.title, Axis::linear(""), Axis::linear("z (m)"));
        let mut names = Vec::new();
        for place in 0..POSTURES {
            let (k, aside_m) = (place * last / (POSTURES - 1), place as f64 * self.gap_m);
            panel
                .curves
                .extend(skeleton.curves(robot, &q[k], self.view, aside_m));
            let root = self.view.point(&Point3::new(q[k][0], q[k][1], q[k][2])).0 + aside_m;
            names.push((root, format!("{:.1} s", times[k])));
        }
        panel.x.names = names;
        panel.aspect = Aspect::Equal;
        panel.levels.push(Level {
            name: "floor".to_owned(),
            value: 0.0,
        });
        PanelRow::new(self.height, vec![panel])
    }
}

/// What stands below strips of these gaps.
pub(super) fn remark(side_gap_m: f64, front_gap_m: f64) -> String {
    format!(
        "Both axes have one scale. Each posture stands {side_gap_m} m (from the side, besides the way it went) or {front_gap_m} m \
         (from the front) beside the one before; ticks are where the waist is."
    )
}
