//! Figure 10: the robot while walking, from the side and from the front.

use super::super::figure::Figure;
use super::super::skeleton::View;
use super::super::strip::{Strip, remark};
use super::super::walked::walked;
use super::super::{Obstacle, Studio, place_of};
use super::PLACE;

const SIDE_GAP_M: f64 = 0.17;
const FRONT_GAP_M: f64 = 0.30;

/// Figure 10.
pub(in super::super) fn strip(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let walked = walked(studio, PLACE)?;
    let rows = [
        (View::Side, "from the right", SIDE_GAP_M, 185.0),
        (View::Front, "from the front", FRONT_GAP_M, 165.0),
    ]
    .map(|(view, title, gap_m, height)| {
        let strip = Strip {
            view,
            title: title.to_owned(),
            gap_m,
            height,
        };
        strip.row(&walked)
    });
    let title = format!("Fig. 10  Walk: {}, {}", walked.run.label, place_of(&walked.run));
    Ok(Figure::new(title, rows.to_vec())
        .with_remarks(vec![remark(SIDE_GAP_M, FRONT_GAP_M)])
        .render()?)
}
