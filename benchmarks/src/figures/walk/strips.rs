//! Figures 6 to 8: Melson walking in the three scenarios, and Hubo, from the side and from the front.

use super::super::figure::Figure;
use super::super::skeleton::View;
use super::super::strip::{Strip, remark};
use super::super::walked::{Place, walked};
use super::super::{Obstacle, Studio, place_of};
use super::{SHORT, scenarios};

/// Room between postures of Melson (m), from the side and from the front.
const MELSON_GAPS_M: [f64; 2] = [0.26, 0.26];
/// The same for Hubo.
const HUBO_GAPS_M: [f64; 2] = [0.45, 0.72];

/// Figures 6 to 8.
pub(in super::super) fn melson(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let shown = scenarios(studio, SHORT)?;
    let mut rows = Vec::new();
    for (number, one) in (6..).zip(&shown) {
        for (view, from, gap_m) in views(MELSON_GAPS_M) {
            let strip = Strip {
                view,
                title: format!("Fig. {number}  {}, from {from}", one.scenario.name),
                gap_m,
                height: 185.0,
            };
            rows.push(strip.row(&one.walked));
        }
    }
    let title = format!("Figs. 6-8  Melson walking: {}", super::place_of(&shown));
    let [side_m, front_m] = MELSON_GAPS_M;
    Ok(Figure::new(title, rows)
        .with_remarks(vec![remark(side_m, front_m)])
        .render()?)
}

/// Hubo as the closed form walks it, or else as `clik` does.
pub(in super::super) fn hubo(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let place = |method| Place {
        suite: "walk/hubo",
        scenario: "walk",
        method,
    };
    let walked = match walked(studio, place("closed-form")) {
        Err(Obstacle::NoData(_)) => walked(studio, place(super::METHOD)),
        found => found,
    }?;
    let rows = views(HUBO_GAPS_M).map(|(view, from, gap_m)| {
        let strip = Strip {
            view,
            title: format!("from {from}"),
            gap_m,
            height: 215.0,
        };
        strip.row(&walked)
    });
    let title = format!("Hubo walking: {}, {}", walked.run.label, place_of(&walked.run));
    let [side_m, front_m] = HUBO_GAPS_M;
    Ok(Figure::new(title, rows.to_vec())
        .with_remarks(vec![remark(side_m, front_m)])
        .render()?)
}

fn views([side_m, front_m]: [f64; 2]) -> [(View, &'static str, f64); 2] {
    [
        (View::Side, "the right", side_m),
        (View::Front, "the front", front_m),
    ]
}
