//! Fewer points, the same picture.
//!
//! A pixel column of a line shows one vertical stroke. Of each run of consecutive points in one column only the first, lowest, highest
//! and last are kept (the "M4" reduction: Jugel et al. 2014), in their order, so that every peak and every join survives.

use std::collections::HashSet;

/// Runs of consecutive drawable points, given as pixel positions, each reduced to at most four points per pixel column.
///
/// `None` is a gap and ends a run.
pub(crate) fn line(points: impl Iterator<Item = Option<(f64, f64)>>) -> Vec<Vec<(f64, f64)>> {
    let mut runs = vec![];
    let mut run = vec![];
    let mut column: Vec<(f64, f64)> = vec![];
    for point in points.map(Some).chain([None]) {
        let point = point.flatten();
        let same_column =
            matches!((point, column.first()), (Some(p), Some(first)) if p.0.floor() == first.0.floor());
        if !same_column {
            run.extend(outline(&column));
            column.clear();
        }
        match point {
            Some(point) => column.push(point),
            None if run.is_empty() => {}
            None => runs.push(std::mem::take(&mut run)),
        }
    }
    runs
}

/// First, lowest, highest and last point of a column, in their order.
fn outline(column: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let by_y = |a: &usize, b: &usize| column[*a].1.total_cmp(&column[*b].1);
    let (Some(lowest), Some(highest)) = ((0..column.len()).min_by(by_y), (0..column.len()).max_by(by_y))
    else {
        return vec![];
    };
    let mut kept = [0, lowest, highest, column.len() - 1];
    kept.sort_unstable();
    let mut last = None;
    kept.into_iter().filter(|i| last.replace(*i) != Some(*i)).map(|i| column[i]).collect()
}

/// At most `most` (plus four) of the points: one per square cell, and always the four extremes.
pub(crate) fn cloud(points: &[(f64, f64)], most: usize) -> Vec<(f64, f64)> {
    if points.len() <= most {
        return points.to_vec();
    }
    let mut cell = 1.0;
    loop {
        let mut taken = HashSet::new();
        let mut kept: Vec<_> = points
            .iter()
            .copied()
            .filter(|(x, y)| taken.insert(((x / cell).floor() as i64, (y / cell).floor() as i64)))
            .collect();
        if kept.len() <= most {
            kept.extend(points.iter().copied().min_by(|a, b| a.0.total_cmp(&b.0)));
            kept.extend(points.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)));
            kept.extend(points.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)));
            kept.extend(points.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)));
            return kept;
        }
        cell *= 1.5;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_gap_splits_the_line() {
        let points = [None, Some((0.0, 1.0)), Some((5.0, 2.0)), None, None, Some((9.0, 3.0)), None];
        assert_eq!(line(points.into_iter()), [vec![(0.0, 1.0), (5.0, 2.0)], vec![(9.0, 3.0)]]);
    }

    #[test]
    fn one_sample_spike_in_a_long_series_stays() {
        let points = (0..100_000).map(|i| Some((f64::from(i) * 0.005, if i == 54_321 { 80.0 } else { 0.0 })));
        let runs = line(points);
        assert_eq!(runs.len(), 1);
        assert!(runs[0].len() <= 4 * 501, "{}", runs[0].len());
        assert!(runs[0].contains(&(54_321.0 * 0.005, 80.0)));
    }

    fn point() -> impl Strategy<Value = (f64, f64)> {
        (0.0..30.0_f64, -50.0..50.0_f64)
    }

    proptest! {
        #[test]
        fn every_column_keeps_its_extremes(mut points in prop::collection::vec(point(), 1..400)) {
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let runs = line(points.iter().copied().map(Some));
            prop_assert_eq!(runs.len(), 1);
            for column in 0..30 {
                let range = |all: &[(f64, f64)]| {
                    all.iter().filter(|p| p.0.floor() == f64::from(column)).fold(None, |range, p| {
                        let (low, high) = range.unwrap_or((p.1, p.1));
                        Some((f64::min(low, p.1), f64::max(high, p.1)))
                    })
                };
                prop_assert_eq!(range(&points), range(&runs[0]), "column {}", column);
            }
        }

        #[test]
        fn a_cloud_keeps_its_bounds(points in prop::collection::vec(point(), 1..2000), most in 1_usize..300) {
            let kept = cloud(&points, most);
            prop_assert!(kept.len() <= most + 4);
            for pick in [|p: &(f64, f64)| p.0, |p: &(f64, f64)| -p.0, |p: &(f64, f64)| p.1, |p: &(f64, f64)| -p.1] {
                let largest = |all: &[(f64, f64)]| all.iter().map(pick).fold(f64::NEG_INFINITY, f64::max);
                prop_assert_eq!(largest(&points), largest(&kept));
            }
        }
    }
}
