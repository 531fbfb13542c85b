//! Figures that summarise many samples: histograms, and a residual against the condition it depends on.

use crate::axis::Axis;
use crate::figure::{Figure, Mark, Series};
use crate::style::Style;

/// One named set of values for [`histogram`].
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// Legend entry.
    pub name: &'a str,
    /// Role of the set.
    pub style: Style,
    /// Values in the unit of the x axis; those not finite are left out.
    pub values: &'a [f64],
}

/// Distribution of one or several sets over common bins, as the share of each set's own values in %.
///
/// One set is drawn as bars, several as outlines over each other. `bins` is kept between 1 and 500. Bins are equally wide and cover
/// all finite values; the upper edge of the last belongs to it.
#[must_use]
pub fn histogram(title: &str, x: Axis, samples: &[Sample<'_>], bins: usize) -> Figure {
    let mut figure = Figure::new(title, x, Axis::new("share of samples", "%"));
    let bins = bins.clamp(1, 500);
    let drawable =
        |values: &[f64]| -> Vec<f64> { values.iter().copied().filter(|v| figure.x.can_draw(*v)).collect() };
    let sets: Vec<Vec<f64>> = samples.iter().map(|sample| drawable(sample.values)).collect();
    let (low, width) = common_bins(sets.iter().flatten().copied(), bins);
    for (sample, values) in samples.iter().zip(sets) {
        let shares = shares_percent(&values, low, width, bins);
        let series = if samples.len() == 1 {
            bars(sample, low, width, &shares)
        } else {
            outline(sample, low, width, &shares)
        };
        figure.series.push(series);
    }
    figure
}

/// Lower edge of the first bin and the width of all; one unit wide, or a little of the value, when all values agree.
fn common_bins(values: impl Iterator<Item = f64>, bins: usize) -> (f64, f64) {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if low > high {
        return (0.0, 1.0);
    }
    let width = (high - low) / bins as f64;
    // Narrower bins would lie between neighbouring floating-point numbers.
    let narrowest = 1e-12 * low.abs().max(high.abs());
    if width > narrowest {
        return (low, width);
    }
    let width = if low == 0.0 { 1.0 } else { 0.01 * low.abs() };
    (low - 0.5 * width * bins as f64, width)
}

fn shares_percent(values: &[f64], low: f64, width: f64, bins: usize) -> Vec<f64> {
    let mut counts = vec![0_u64; bins];
    for value in values {
        // The cast saturates, so rounding below the first edge falls into the first bin.
        counts[(((value - low) / width) as usize).min(bins - 1)] += 1;
    }
    counts.into_iter().map(|count| 100.0 * count as f64 / values.len().max(1) as f64).collect()
}

fn bars(sample: &Sample<'_>, low: f64, width: f64, shares: &[f64]) -> Series {
    let centres = shares.iter().enumerate().map(|(i, share)| (low + (i as f64 + 0.5) * width, *share));
    let any = shares.iter().any(|share| *share > 0.0);
    Series::bars(sample.name, sample.style, centres.filter(|_| any).collect::<Vec<_>>())
}

fn outline(sample: &Sample<'_>, low: f64, width: f64, shares: &[f64]) -> Series {
    if shares.iter().all(|share| *share == 0.0) {
        return Series::step(sample.name, sample.style, vec![]);
    }
    let edges = shares.iter().chain([&0.0]).enumerate().map(|(i, share)| (low + i as f64 * width, *share));
    Series::step(sample.name, sample.style, [(low, 0.0)].into_iter().chain(edges).collect::<Vec<_>>())
}

/// Mean and spread of y over a range of x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// Mean of x, in its unit.
    pub x: f64,
    /// Mean of y, in its unit.
    pub mean: f64,
    /// Sample standard deviation of y (divisor n - 1), in its unit; NaN for a single point.
    pub standard_deviation: f64,
    /// Number of points.
    pub count: usize,
}

/// Mean and standard deviation of y in at most `bins` ranges of x that hold equally many points, ascending in x.
///
/// Equally many rather than equally wide: each mean is then equally sure, and a lone outlier in x does not get a bin of its own.
/// Points of equal x share a bin. Points with a value that is not finite are left out.
#[must_use]
pub fn bin_statistics(points: &[(f64, f64)], bins: usize) -> Vec<Bin> {
    let linear = Axis::new("", "");
    let mut points: Vec<_> =
        points.iter().copied().filter(|(x, y)| linear.can_draw(*x) && linear.can_draw(*y)).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let bins = bins.clamp(1, points.len().max(1));
    let mut result = vec![];
    let mut start = 0;
    for bin in 1..=bins {
        let mut end = (points.len() * bin / bins).max(start);
        while end > start && end < points.len() && points[end].0 == points[end - 1].0 {
            end += 1;
        }
        if end > start {
            result.push(summarise(&points[start..end]));
            start = end;
        }
    }
    result
}

fn summarise(points: &[(f64, f64)]) -> Bin {
    let n = points.len() as f64;
    let x = points.iter().map(|p| p.0 / n).sum();
    let mean: f64 = points.iter().map(|p| p.1 / n).sum();
    // Second pass around the mean: the one-pass formula cancels when the mean is large against the spread.
    let squares: f64 = points.iter().map(|p| (p.1 - mean).powi(2)).sum();
    Bin { x, mean, standard_deviation: (squares / (n - 1.0)).sqrt(), count: points.len() }
}

/// Shows on which condition a residual depends: the points, and over them mean and standard deviation per bin of x.
///
/// With nothing left to explain the means lie on the zero line that is drawn. Bins as in [`bin_statistics`].
#[must_use]
pub fn binned_scatter(title: &str, x: Axis, y: Axis, points: &[(f64, f64)], bins: usize) -> Figure {
    let summary = bin_statistics(points, bins);
    let means: Vec<_> = summary.iter().map(|bin| (bin.x, bin.mean)).collect();
    let spread: Vec<_> = summary
        .iter()
        .flat_map(|bin| {
            let Bin { x, mean, standard_deviation, .. } = *bin;
            [(x, mean - standard_deviation), (x, mean + standard_deviation), (x, f64::NAN)]
        })
        .collect();
    Figure::new(title, x, y)
        .mark(Mark::Horizontal { name: String::new(), y: 0.0, style: Style::Reference })
        .with(Series::points("samples", Style::Muted, points))
        .with(Series::line("± 1 standard deviation", Style::Category(0), spread))
        .with(Series::line("", Style::Category(0), means.clone()))
        .with(Series::points("mean per bin", Style::Category(0), means))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bin_statistics_of_known_points() {
        let points =
            [(1.0, 2.0), (2.0, 4.0), (3.0, f64::NAN), (4.0, -1.0), (5.0, -1.0), (6.0, -1.0), (0.0, 3.0)];
        let bins = bin_statistics(&points, 2);
        assert_eq!(bins.len(), 2);
        assert_eq!((bins[0].count, bins[0].x, bins[0].mean, bins[0].standard_deviation), (3, 1.0, 3.0, 1.0));
        assert_eq!((bins[1].count, bins[1].standard_deviation), (3, 0.0));
        // -1/3 three times is -1 to the last bit or one off.
        assert!((bins[1].mean + 1.0).abs() < 1e-15 && (bins[1].x - 5.0).abs() < 1e-14);
    }

    #[test]
    fn equal_conditions_stay_together() {
        let points: Vec<_> = (0..400).map(|i| (f64::from(i % 4), f64::from(i % 4))).collect();
        let bins = bin_statistics(&points, 10);
        assert_eq!(bins.iter().map(|bin| bin.count).collect::<Vec<_>>(), [100; 4]);
    }

    #[test]
    fn histogram_counts_each_value_once() {
        let values = [0.0, 0.1, 0.9, 1.0, 1.9, 2.0, f64::NAN, 1.5];
        let figure = histogram(
            "h",
            Axis::new("x", ""),
            &[Sample { name: "a", style: Style::Measured, values: &values }],
            2,
        );
        // 0, 0.1, 0.9 below 1; 1.0, 1.5, 1.9, 2.0 from 1 on.
        let expected = [(0.5, 300.0 / 7.0), (1.5, 400.0 / 7.0)];
        assert_eq!(figure.series[0].data, expected);
    }

    proptest! {
        #[test]
        fn shares_add_up(values in prop::collection::vec(-1e3..1e3_f64, 1..200), bins in 1_usize..50) {
            let sample = Sample { name: "a", style: Style::Measured, values: &values };
            let total = |samples: &[Sample<'_>]| -> f64 {
                histogram("", Axis::new("", ""), samples, bins).series[0].data.iter().map(|p| p.1).sum()
            };
            // Sums of at most 50 shares of 100 %: rounding stays far below 1e-9.
            prop_assert!((total(&[sample]) - 100.0).abs() < 1e-9);
            prop_assert!((total(&[sample, sample]) - 100.0).abs() < 1e-9);
        }

        #[test]
        fn bins_cover_every_point_in_order(points in prop::collection::vec((-9.0..9.0_f64, -9.0..9.0_f64), 0..200), bins in 0_usize..30) {
            let result = bin_statistics(&points, bins);
            prop_assert_eq!(result.iter().map(|bin| bin.count).sum::<usize>(), points.len());
            prop_assert!(result.len() <= bins.max(1));
            prop_assert!(result.windows(2).all(|w| w[0].x < w[1].x));
        }
    }
}
