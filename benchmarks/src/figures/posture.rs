//! Figure 7 of the paper: static torque against knee angle, crouched to stretched, with a fitted line.

use super::axis::Axis;
use super::figure::{Figure, PanelRow};
use super::labels::by_method;
use super::panel::{Curve, Markers, Panel, common_y};
use super::style::{BLACK, Dash, Marker, Style, Styles};
use super::{AXES_OF_SURVIVORS, Obstacle, Points, Studio, Traced, milliseconds, survivors};
use crate::statistics::line_fit;

const SUITE: &str = "coman/posture";
/// Method and budget of the paper's experiment.
const MAIN: (&str, u64) = ("ik4", 3);

/// Figure 7.
pub(super) fn posture(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let runs = studio.runs_of_suite(SUITE);
    let traced = studio.with_traces(runs)?;
    let Some(first) = traced.iter().find(|t| knee_and_torque(t).is_some()) else {
        return Err(Obstacle::NoData(format!(
            "no run with a trace and a torque on {SUITE}"
        )));
    };
    let (main, others) = curves(&traced.iter().collect::<Vec<_>>(), &studio.styles);
    let fit_points = main.as_ref().map(|m| m.points.clone()).unwrap_or_default();
    let x = Axis::linear("left knee at the start (rad)");
    let mut panel = Panel::new("", x, Axis::linear("mean Στ² for t ≥ 1 s (N²m²)"));
    panel.curves = main
        .into_iter()
        .chain(others)
        .chain(fitted(&fit_points))
        .collect();
    let (main, others) = curves(&survivors(&traced), &studio.styles);
    let fitting = Panel {
        curves: main.into_iter().chain(others).collect(),
        ..panel.clone()
    };
    panel.y.range = common_y(&[fitting]);
    let dt = milliseconds(first.run.row.dt_s);
    let title =
        format!("Fig. 7  Static torque from stretched to crouched: {SUITE}, all scenarios, Δt = {dt} ms");
    let rows = vec![PanelRow::new(440.0, vec![panel])];
    Ok(Figure::new(title, rows)
        .with_remarks(remarks(&fit_points))
        .render()?)
}

/// The curve of the paper's method, and those of the others.
fn curves(traced: &[&Traced<'_>], styles: &Styles) -> (Option<Curve>, Vec<Curve>) {
    let (mut main, mut others) = (None, Vec::new());
    for group in by_method(traced.iter().map(|t| &t.run)) {
        let of_group = traced.iter().filter(|t| t.run.is_same_method(group[0]));
        let mut points: Points = of_group.filter_map(|t| knee_and_torque(t)).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (name, style) = (group[0].label.clone(), styles.of(&group[0].label));
        if (name.as_str(), group[0].n) == (MAIN.0, Some(MAIN.1)) {
            let name = format!("{}, fitted", group[0].full());
            main = Some(Curve {
                name,
                points,
                style,
                width: 3.0,
                markers: Markers::Every,
            });
        } else {
            others.push(Curve {
                name,
                points,
                style,
                width: 0.9,
                markers: Markers::Every,
            });
        }
    }
    (main, others)
}

fn knee_and_torque(one: &Traced<'_>) -> Option<(f64, f64)> {
    let knee = *one.trace.column("LKneeSag")?.first()?;
    Some((
        knee,
        one.run.row.metrics.as_ref()?.quality.torque_squared_mean_n2m2?,
    ))
}

/// The fitted line over the range of the points, which are in rising order.
fn fitted(points: &[(f64, f64)]) -> Option<Curve> {
    let (intercept, slope) = line_fit(points)?;
    let ends = [points.first()?.0, points.last()?.0];
    Some(Curve {
        name: format!("fit {intercept:.0} + {slope:.0} q").replace('-', "−"),
        points: ends.map(|x| (x, intercept + slope * x)).to_vec(),
        style: Style {
            colour: BLACK,
            dash: Dash::Short,
            marker: Marker::Circle,
        },
        width: 1.6,
        markers: Markers::None,
    })
}

/// How much more the crouched starts need than the most stretched one.
fn remarks(points: &[(f64, f64)]) -> Vec<String> {
    let meaning = "Στ²: sum over the leg joints of squared quasi-static torques, both soles loaded. Thin: other methods, \
                   both budgets.";
    let mut remarks = vec![meaning.to_owned(), AXES_OF_SURVIVORS.to_owned()];
    if let [first, rest @ ..] = points
        && !rest.is_empty()
    {
        let ratio = |p: &(f64, f64)| format!("{:.1} from {:.2} rad", p.1 / first.1, p.0);
        let ratios: Vec<String> = rest.iter().map(ratio).collect();
        let (method, n) = MAIN;
        remarks.push(format!(
            "{method} n={n}, Στ² relative to the start at {:.2} rad: {}.",
            first.0,
            ratios.join(", ")
        ));
    }
    remarks
}
