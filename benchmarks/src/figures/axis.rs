//! Axes: range, scale and ticks.

/// Below this a logarithmic axis never goes: rounding of metre-sized coordinates.
const LOG_FLOOR: f64 = 1e-16;
/// Part of the points of a curve that a logarithmic axis may leave below its lower edge, where they are then drawn. A
/// curve that passes through zero, as every error norm does, would otherwise stretch the axis to rounding level.
const LOG_CUT: f64 = 0.02;
/// Part of the range added on either side of a linear axis.
const PADDING: f64 = 0.05;

/// Scale of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scale {
    Linear,
    Log,
}

/// What an axis should show.
#[derive(Clone, Debug)]
pub(super) struct Axis {
    /// Quantity with its unit; empty to leave it out.
    pub(super) label: String,
    pub(super) scale: Scale,
    /// Fixed range instead of that of the data.
    pub(super) range: Option<(f64, f64)>,
    /// Named places instead of numbers.
    pub(super) names: Vec<(f64, String)>,
}

impl Axis {
    pub(super) fn new(label: &str, scale: Scale) -> Self {
        Self {
            label: label.to_owned(),
            scale,
            range: None,
            names: Vec::new(),
        }
    }

    pub(super) fn linear(label: &str) -> Self {
        Self::new(label, Scale::Linear)
    }

    pub(super) fn log(label: &str) -> Self {
        Self::new(label, Scale::Log)
    }

    pub(super) fn with_range(mut self, low: f64, high: f64) -> Self {
        self.range = Some((low, high));
        self
    }

    pub(super) fn with_names(mut self, names: Vec<(f64, String)>) -> Self {
        self.names = names;
        self
    }

    /// Fixes range and ticks for the values of the curves. At most about `max_ticks` ticks.
    pub(super) fn fit(&self, curves: &[Vec<f64>], max_ticks: usize) -> FittedAxis {
        let (low, high) = self.range.unwrap_or_else(|| match self.scale {
            Scale::Linear => padded(linear_range(curves)),
            Scale::Log => log_range(curves),
        });
        let is_below = |v: &f64| self.scale == Scale::Log && v.is_finite() && *v < low;
        let cut = curves.iter().flatten().any(is_below);
        let ticks = match self.scale {
            _ if !self.names.is_empty() => self.names.clone(),
            Scale::Linear => linear_ticks(low, high, max_ticks),
            Scale::Log => log_ticks(low, high, max_ticks),
        };
        FittedAxis {
            scale: self.scale,
            low,
            high,
            ticks,
            cut_below: cut.then_some(low),
        }
    }
}

/// An axis ready to draw.
#[derive(Clone, Debug)]
pub(super) struct FittedAxis {
    scale: Scale,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) ticks: Vec<(f64, String)>,
    /// Lower edge, if values below it were put on it.
    pub(super) cut_below: Option<f64>,
}

impl FittedAxis {
    /// Values between which a line is drawn; a logarithmic axis puts what is outside on its edge instead.
    pub(super) fn shown(&self) -> (f64, f64) {
        match self.scale {
            Scale::Linear => (self.low, self.high),
            Scale::Log => (f64::NEG_INFINITY, f64::INFINITY),
        }
    }

    /// Place of a value as part of the length of the axis, 0…1; values outside are put on the edge.
    pub(super) fn place(&self, value: f64) -> f64 {
        let inside = value.clamp(self.low, self.high);
        match self.scale {
            Scale::Linear => (inside - self.low) / (self.high - self.low),
            Scale::Log => (inside / self.low).ln() / (self.high / self.low).ln(),
        }
    }
}

fn linear_range(curves: &[Vec<f64>]) -> (f64, f64) {
    let finite = curves.iter().flatten().filter(|v| v.is_finite());
    let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| {
        (l.min(*v), h.max(*v))
    });
    if low <= high { (low, high) } else { (0.0, 1.0) }
}

fn padded((low, high): (f64, f64)) -> (f64, f64) {
    // A constant curve still needs an axis around it.
    let size = (high - low).max(1e-9 * high.abs().max(low.abs())).max(1e-12);
    (low - PADDING * size, high + PADDING * size)
}

fn log_range(curves: &[Vec<f64>]) -> (f64, f64) {
    let positive = |curve: &Vec<f64>| -> Vec<f64> {
        curve
            .iter()
            .copied()
            .filter(|v| v.is_finite() && *v > LOG_FLOOR)
            .collect()
    };
    let lowest_shown = |curve: &Vec<f64>| {
        let mut values = positive(curve);
        values.sort_by(f64::total_cmp);
        values.get((LOG_CUT * values.len() as f64) as usize).copied()
    };
    let low = curves
        .iter()
        .filter_map(lowest_shown)
        .fold(f64::INFINITY, f64::min);
    let high = curves
        .iter()
        .flatten()
        .copied()
        .filter(|v| v.is_finite())
        .fold(LOG_FLOOR, f64::max);
    if !low.is_finite() {
        // Nothing positive: one decade, so that zeros have an edge to lie on.
        return (LOG_FLOOR, 10.0 * LOG_FLOOR);
    }
    let (low, high) = (round_125(low, f64::floor), round_125(high * 1.05, f64::ceil));
    if high > low {
        (low, high)
    } else {
        (low / 2.0, low * 2.0)
    }
}

/// Nearest of 1, 2, 5 times a power of ten, downwards (`f64::floor`) or upwards (`f64::ceil`).
fn round_125(value: f64, direction: fn(f64) -> f64) -> f64 {
    let decade = 10_f64.powf(value.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|s| s * decade);
    // `ceil` moves 0.5 up, `floor` moves it down.
    if direction(0.5) > 0.5 {
        steps
            .into_iter()
            .find(|s| *s >= value * (1.0 - 1e-9))
            .unwrap_or(steps[3])
    } else {
        steps
            .into_iter()
            .rev()
            .find(|s| *s <= value * (1.0 + 1e-9))
            .unwrap_or(steps[0])
    }
}

fn linear_ticks(low: f64, high: f64, max_ticks: usize) -> Vec<(f64, String)> {
    let step = round_125((high - low) / max_ticks.max(1) as f64, f64::ceil);
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last)
        .map(|i| {
            let value = i as f64 * step;
            (value, format!("{value:.decimals$}").replace('-', "−"))
        })
        .collect()
}

fn log_ticks(low: f64, high: f64, max_ticks: usize) -> Vec<(f64, String)> {
    let (first, last) = (
        (low.log10() - 1e-9).floor() as i32,
        (high.log10() + 1e-9).ceil() as i32,
    );
    let inside = |v: f64| v >= low * (1.0 - 1e-9) && v <= high * (1.0 + 1e-9);
    let fine: Vec<(f64, String)> = (first..=last)
        .flat_map(|e| [1, 2, 5].map(|m| (f64::from(m) * 10_f64.powi(e), power_label(m, e))))
        .filter(|(v, _)| inside(*v))
        .collect();
    // These labels are short.
    if fine.len() <= max_ticks + 2 {
        return fine;
    }
    let decades = (last - first).max(1) as usize;
    let stride = decades.div_ceil(max_ticks.max(1)) as i32;
    (first..=last)
        .filter(|e| e.rem_euclid(stride) == 0)
        .map(|e| (10_f64.powi(e), power_label(1, e)))
        .filter(|(v, _)| inside(*v))
        .collect()
}

/// `m·10ᵉ`: as a plain number between 0.01 and 50 000, else with a superscript exponent.
fn power_label(mantissa: i32, exponent: i32) -> String {
    match exponent {
        0..=4 => format!("{mantissa}{}", "0".repeat(exponent as usize)),
        -2 | -1 => format!("0.{}{mantissa}", "0".repeat((-exponent - 1) as usize)),
        _ if mantissa == 1 => format!("10{}", superscript(exponent)),
        _ => format!("{mantissa}·10{}", superscript(exponent)),
    }
}

fn superscript(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    number.to_string().chars().map(digit).collect()
}

/// A value as a tick would show it, with one digit.
pub(super) fn rough(value: f64) -> String {
    let exponent = value.log10().floor() as i32;
    power_label((value / 10_f64.powi(exponent)).round() as i32, exponent)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &FittedAxis) -> Vec<&str> {
        axis.ticks.iter().map(|t| t.1.as_str()).collect()
    }

    #[test]
    fn linear_axis_has_round_ticks_around_the_data() {
        let axis = Axis::linear("x").fit(&[vec![0.0, 3.0], vec![f64::NAN]], 6);
        assert_eq!(texts(&axis), ["0", "1", "2", "3"]);
        assert!(axis.low < 0.0 && axis.high > 3.0);
        let negative = Axis::linear("x").with_range(-0.2, 0.4).fit(&[], 4);
        assert_eq!(texts(&negative), ["−0.2", "0.0", "0.2", "0.4"]);
    }

    #[test]
    fn a_constant_or_empty_curve_still_has_an_axis() {
        for curves in [
            vec![vec![2.0]],
            vec![vec![0.0, 0.0]],
            vec![],
            vec![vec![f64::INFINITY]],
        ] {
            for axis in [Axis::linear("x"), Axis::log("x")] {
                let fitted = axis.fit(&curves, 5);
                assert!(fitted.low < fitted.high, "{curves:?} {fitted:?}");
                assert!((0.0..=1.0).contains(&fitted.place(0.0)), "{curves:?}");
            }
        }
    }

    #[test]
    fn zeros_lie_on_the_lower_edge_of_a_log_axis_and_are_reported() {
        let axis = Axis::log("error").fit(&[vec![0.0, 1e-5, 1e-5, 2e-3]], 6);
        assert!(
            axis.cut_below.is_some_and(|c| c <= 1.1e-5 && c > 1e-6),
            "{axis:?}"
        );
        assert!(axis.place(0.0).abs() < 1e-12);
        assert!(Axis::log("error").fit(&[vec![1e-5, 1e-3]], 6).cut_below.is_none());
    }

    #[test]
    fn log_ticks_thin_out() {
        let wide = Axis::log("e").with_range(1e-12, 1.0).fit(&[], 5);
        assert_eq!(texts(&wide), ["10⁻¹²", "10⁻⁹", "10⁻⁶", "10⁻³", "1"]);
        let narrow = Axis::log("e").with_range(1.0, 10.0).fit(&[], 5);
        assert_eq!(texts(&narrow), ["1", "2", "5", "10"]);
        assert_eq!(power_label(2, -5), "2·10⁻⁵");
        assert_eq!(power_label(5, -2), "0.05");
        assert_eq!(rough(2.0e-9), "2·10⁻⁹");
    }
}
