//! Order statistics and means of measured samples.
//!
//! Percentile p of N sorted values x₁ ≤ … ≤ x_N is the linear interpolation at rank h = (N − 1) p/100 + 1 (definition 7 of
//! Hyndman & Fan, "Sample quantiles in statistical packages", The American Statistician 50(4), 1996). The median is the
//! 50th percentile.

/// Percentile of values sorted in ascending order; none if there are none. `percent` is clamped to 0…100.
pub fn percentile_of_sorted(sorted: &[f64], percent: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let rank = last as f64 * percent.clamp(0.0, 100.0) / 100.0;
    let below = (rank.floor() as usize).min(last);
    let above = (below + 1).min(last);
    let fraction = rank - below as f64;
    Some(sorted[below] + fraction * (sorted[above] - sorted[below]))
}

/// Percentile of values in any order; sorts them.
pub fn percentile(values: &mut [f64], percent: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    percentile_of_sorted(values, percent)
}

/// Median of values in any order; sorts them.
pub fn median(values: &mut [f64]) -> Option<f64> {
    percentile(values, 50.0)
}

/// Arithmetic mean; none of nothing.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Geometric mean exp(mean ln x); none of nothing, or if a value is not positive.
pub fn geometric_mean(values: &[f64]) -> Option<f64> {
    let logarithms: Option<Vec<f64>> = values.iter().map(|v| (*v > 0.0).then(|| v.ln())).collect();
    mean(&logarithms?).map(f64::exp)
}

/// Each value replaced by the median of the window centred on it; the window is cut at the ends. `window` is odd, an even
/// one acts as the next larger.
pub fn median_filtered(values: &[f64], window: usize) -> Vec<f64> {
    let half = window / 2;
    let centre = |index: usize| {
        let end = (index + half + 1).min(values.len());
        let mut near = values[index.saturating_sub(half)..end].to_vec();
        median(&mut near).expect("the window holds its centre")
    };
    (0..values.len()).map(centre).collect()
}

/// Intercept a and slope b of the least-squares line a + b x; none for fewer than two different x.
pub fn line_fit(points: &[(f64, f64)]) -> Option<(f64, f64)> {
    let mean_x = mean(&points.iter().map(|p| p.0).collect::<Vec<_>>())?;
    let mean_y = mean(&points.iter().map(|p| p.1).collect::<Vec<_>>())?;
    let spread: f64 = points.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
    let product: f64 = points.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
    let slope = product / spread;
    slope.is_finite().then_some((mean_y - slope * mean_x, slope))
}

/// Distribution of the times of the steps of one run (µs).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StepTimes {
    /// Least.
    pub min: f64,
    /// Median.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
    /// Arithmetic mean.
    pub mean: f64,
}

impl StepTimes {
    /// From one time per step (µs), in any order; sorts them. None of no steps.
    pub fn from_us(times: &mut [f64]) -> Option<Self> {
        times.sort_by(f64::total_cmp);
        Some(Self {
            min: *times.first()?,
            median: percentile_of_sorted(times, 50.0)?,
            p95: percentile_of_sorted(times, 95.0)?,
            p99: percentile_of_sorted(times, 99.0)?,
            max: *times.last()?,
            mean: mean(times)?,
        })
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp, reason = "exact small numbers")]
mod tests {
    use super::*;

    #[test]
    fn percentiles_follow_definition_7() {
        // numpy.percentile([1, 2, 3, 4, 10], [0, 25, 50, 95, 100]) = 1, 2, 3, 8.8, 10
        let mut values = [10.0, 3.0, 1.0, 4.0, 2.0];
        let expected = [(0.0, 1.0), (25.0, 2.0), (50.0, 3.0), (95.0, 8.8), (100.0, 10.0)];
        for (percent, value) in expected {
            let found = percentile(&mut values, percent).unwrap();
            assert!(
                (found - value).abs() < 1e-12,
                "{percent}: {found} instead of {value}"
            );
        }
        assert_eq!(median(&mut [4.0, 1.0]), Some(2.5));
        assert_eq!(median(&mut []), None);
    }

    #[test]
    fn means() {
        assert_eq!(mean(&[1.0, 2.0, 6.0]), Some(3.0));
        assert_eq!(mean(&[]), None);
        assert!((geometric_mean(&[1.0, 10.0, 100.0]).unwrap() - 10.0).abs() < 1e-12);
        assert_eq!(geometric_mean(&[1.0, 0.0]), None);
        assert_eq!(geometric_mean(&[]), None);
    }

    #[test]
    fn median_filter_removes_a_spike_and_keeps_an_edge() {
        let values = [1.0, 1.0, 90.0, 1.0, 1.0, 5.0, 5.0, 5.0, 5.0];
        assert_eq!(
            median_filtered(&values, 3),
            [1.0, 1.0, 1.0, 1.0, 1.0, 5.0, 5.0, 5.0, 5.0]
        );
        assert_eq!(median_filtered(&[7.0], 11), [7.0]);
        assert!(median_filtered(&[], 11).is_empty());
    }

    #[test]
    fn line_fit_recovers_a_line_and_declines_a_point() {
        let points: Vec<(f64, f64)> = (0..5).map(|i| (f64::from(i), 3.0 - 2.0 * f64::from(i))).collect();
        let (intercept, slope) = line_fit(&points).unwrap();
        assert!((intercept - 3.0).abs() < 1e-12 && (slope + 2.0).abs() < 1e-12);
        assert_eq!(line_fit(&[(1.0, 2.0), (1.0, 3.0)]), None);
        assert_eq!(line_fit(&[]), None);
    }

    #[test]
    fn step_times_of_one_hundred_and_one_steps() {
        let mut times: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        let found = StepTimes::from_us(&mut times).unwrap();
        let expected = StepTimes {
            min: 0.0,
            median: 50.0,
            p95: 95.0,
            p99: 99.0,
            max: 100.0,
            mean: 50.0,
        };
        assert_eq!(found, expected);
        assert_eq!(StepTimes::from_us(&mut []), None);
    }
}
