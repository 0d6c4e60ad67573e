//! Figure 5 of the paper: the knee in the position–velocity plane under an ellipse, a polygon, and without regulator.

use super::axis::Axis;
use super::figure::{Figure, PanelRow};
use super::labels::Labelled;
use super::panel::{Curve, Markers, Panel, time_axis};
use super::style::{BLACK, BLUE, Dash, GREEN, GREY, Marker, Style, VERMILLION};
use super::tracking::reference_curve;
use super::{DrawnLimits, Obstacle, Points, Studio, Traced, milliseconds, over_time, rate_over_time};
use std::f64::consts::TAU;

const SUITE: &str = "coman/boundary";
const REGULATOR: &str = "coman/regulator";
const BOUNDARY_POINTS: usize = 400;
/// Methods of the suite, the first one in full.
const METHODS: [&str; 2] = ["ik4", "ik5"];

/// A variant compared, with its look: colours mean variants here, not methods.
struct Variant<'a> {
    name: &'static str,
    style: Style,
    traced: Traced<'a>,
}

/// Figure 5.
pub(super) fn boundary(studio: &mut Studio<'_>) -> Result<String, Obstacle> {
    let first = variants(studio, METHODS[0])?;
    let second = variants(studio, METHODS[1])?;
    let (main, other) = if first.is_empty() {
        (second, first)
    } else {
        (first, second)
    };
    let Some(run) = main.first().map(|v| v.traced.run.clone()) else {
        return Err(Obstacle::NoData(format!(
            "no run of ik4 or ik5 with a trace on {SUITE}"
        )));
    };
    let limits = studio.limits;
    let planes = [&main, &other]
        .into_iter()
        .filter(|v| !v.is_empty())
        .map(|v| plane(v, &limits))
        .collect();
    let rows = vec![
        PanelRow::new(400.0, planes),
        PanelRow::new(250.0, vec![height(&main), knee(&main)]),
    ];
    let dt = milliseconds(run.row.dt_s);
    let title = format!("Fig. 5  Boundary and regulator: {SUITE} and {REGULATOR} with γ = 0, Δt = {dt} ms");
    Ok(Figure::new(title, rows)
        .with_remarks(vec![meaning(&limits)])
        .render()?)
}

fn meaning(limits: &DrawnLimits) -> String {
    let DrawnLimits {
        knee_rad: (low, high),
        velocity_rad_s: speed,
        ..
    } = limits;
    let (slope, exit) = (limits.polygon_slope_per_s, limits.polygon_exit_velocity_rad_s);
    format!(
        "Ellipse: {low} … {high} rad, {speed} rad/s. Polygon: κ = {slope} 1/s, v₀ = {exit} rad/s. Velocity: Δq/Δt of the left \
         knee, drawn at the angle after the step, where eq. (6) bounds it."
    )
}

fn variants<'a>(studio: &mut Studio<'a>, method: &str) -> Result<Vec<Variant<'a>>, Obstacle> {
    let is_meant = |l: &Labelled<'a>| l.row.method == method && !l.label.contains("literal");
    let ellipse = studio.runs_of(SUITE, "ellipse").into_iter().find(is_meant);
    let polygon = studio.runs_of(SUITE, "polygon").into_iter().find(is_meant);
    let free = studio
        .runs_of_suite(REGULATOR)
        .into_iter()
        .find(|l| is_meant(l) && l.gamma() == Some(0.0));
    let look = |colour, dash, marker| Style { colour, dash, marker };
    let wanted = [
        ("ellipse", look(BLUE, Dash::Solid, Marker::Diamond), ellipse),
        ("polygon", look(VERMILLION, Dash::Long, Marker::Square), polygon),
        ("ellipse, γ = 0", look(GREEN, Dash::Short, Marker::Circle), free),
    ];
    let mut found = Vec::new();
    for (name, style, run) in wanted {
        let traced = studio.with_traces(run.into_iter().collect())?;
        studio.require("com_z", &traced);
        found.extend(traced.into_iter().map(|traced| Variant { name, style, traced }));
    }
    Ok(found)
}

fn variant_curve(variant: &Variant<'_>, points: Points, rank: usize) -> Curve {
    let markers = Markers::Sparse { rank };
    Curve {
        name: variant.name.to_owned(),
        points,
        style: variant.style,
        width: 1.6,
        markers,
    }
}

/// Position–velocity plane with both boundaries.
fn plane(variants: &[Variant<'_>], limits: &DrawnLimits) -> Panel {
    let title = variants.first().map_or(String::new(), |v| v.traced.run.full());
    let mut panel = Panel::new(
        &title,
        Axis::linear("left knee (rad)"),
        Axis::linear("knee velocity (rad/s)"),
    );
    let look = |colour, dash| Style {
        colour,
        dash,
        marker: Marker::Circle,
    };
    let boundary = |name: &str, points, style| Curve {
        name: name.to_owned(),
        points,
        style,
        width: 1.2,
        markers: Markers::None,
    };
    panel.curves.push(boundary(
        "boundary: ellipse",
        ellipse(limits),
        look(BLACK, Dash::Solid),
    ));
    panel.curves.push(boundary(
        "boundary: polygon",
        polygon(limits),
        look(GREY, Dash::Short),
    ));
    for (rank, variant) in variants.iter().enumerate() {
        let trace = &variant.traced.trace;
        let angles = trace.column("LKneeSag").unwrap_or_default().into_iter().skip(1);
        let rates = rate_over_time(trace, "LKneeSag").unwrap_or_default();
        let points = angles
            .zip(rates)
            .map(|(angle, (_, rate))| (angle, rate))
            .collect();
        panel.curves.push(variant_curve(variant, points, rank));
    }
    panel
}

fn height(variants: &[Variant<'_>]) -> Panel {
    let title = variants
        .first()
        .map_or(String::new(), |v| format!("{}: CoM", v.traced.run.full()));
    let mut panel = Panel::new(&title, time_axis(), Axis::linear("CoM height (m)"));
    let target = variants
        .first()
        .and_then(|v| over_time(&v.traced.trace, "com_target_z"));
    panel.curves.extend(target.map(reference_curve));
    for (rank, variant) in variants.iter().enumerate() {
        let points = over_time(&variant.traced.trace, "com_z");
        panel
            .curves
            .extend(points.map(|p| variant_curve(variant, p, rank)));
    }
    panel
}

fn knee(variants: &[Variant<'_>]) -> Panel {
    let title = variants
        .first()
        .map_or(String::new(), |v| format!("{}: left knee", v.traced.run.full()));
    let mut panel = Panel::new(&title, time_axis(), Axis::linear("left knee (rad)"));
    for (rank, variant) in variants.iter().enumerate() {
        let points = over_time(&variant.traced.trace, "LKneeSag");
        panel
            .curves
            .extend(points.map(|p| variant_curve(variant, p, rank)));
    }
    panel
}

/// Eq. (6) with equality: ((q − m)/h)² + (q̇/q̇max)² = 1, m the middle of the limits, h half their distance less the margin.
fn ellipse(limits: &DrawnLimits) -> Points {
    let (low, high) = limits.knee_rad;
    let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0 - limits.margin_rad);
    let angle = |i: usize| TAU * i as f64 / BOUNDARY_POINTS as f64;
    (0..=BOUNDARY_POINTS)
        .map(|i| {
            (
                middle + half * angle(i).cos(),
                limits.velocity_rad_s * angle(i).sin(),
            )
        })
        .collect()
}

/// Towards a limit at distance s at most κ s, away from it at most κ s + v₀, never more than q̇max.
fn polygon(limits: &DrawnLimits) -> Points {
    let (low, high) = limits.knee_rad;
    let (slope, exit) = (limits.polygon_slope_per_s, limits.polygon_exit_velocity_rad_s);
    let angles: Vec<f64> = (0..=BOUNDARY_POINTS)
        .map(|i| low + (high - low) * i as f64 / BOUNDARY_POINTS as f64)
        .collect();
    let upper = |q: f64| {
        limits
            .velocity_rad_s
            .min(slope * (q - low) + exit)
            .min(slope * (high - q))
    };
    let lower = |q: f64| {
        -limits
            .velocity_rad_s
            .min(slope * (q - low))
            .min(slope * (high - q) + exit)
    };
    let there = angles.iter().map(|q| (*q, upper(*q)));
    let back = angles.iter().rev().map(|q| (*q, lower(*q)));
    there.chain(back).chain([(low, upper(low))]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boundaries_pass_through_their_corners() {
        let limits = DrawnLimits::COMAN;
        let extremes = |points: &[(f64, f64)]| {
            let fold = |f: fn((f64, f64)) -> f64| {
                let values: Vec<f64> = points.iter().map(|p| f(*p)).collect();
                (
                    values.iter().copied().fold(9.0, f64::min),
                    values.iter().copied().fold(-9.0, f64::max),
                )
            };
            (fold(|p| p.0), fold(|p| p.1))
        };
        for points in [ellipse(&limits), polygon(&limits)] {
            let ((q_low, q_high), (v_low, v_high)) = extremes(&points);
            assert!(q_low.abs() < 1e-12 && (q_high - 1.9199).abs() < 1e-12);
            assert!((v_low + 4.0).abs() < 1e-12 && (v_high - 4.0).abs() < 1e-12);
        }
        // Leaving the lower limit starts with v0, reaching it ends with 0.
        let points = polygon(&limits);
        assert!(points.contains(&(0.0, 0.02)));
        assert!(points.iter().any(|p| p.0 == 0.0 && p.1 == 0.0));
    }
}
