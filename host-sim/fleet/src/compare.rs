//! Craft against craft, and battery against battery: what differs by more than flights differ anyway.

use schemars::JsonSchema;
use serde::Serialize;

use crate::fit::Estimate;
use crate::history::{Kind, Series};
use crate::scatter::{Mean, between_variance, mean, weighted};
use crate::steps::{SIGNIFICANCE, two_sided};

/// Two craft that differ in a coefficient.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CraftDifference {
    /// The craft, in the order of their names.
    pub crafts: [String; 2],
    /// The coefficient: "thrust.C_T".
    pub coefficient: String,
    /// Unit.
    pub unit: String,
    /// Of each, since its last change.
    pub means: [Mean; 2],
    /// Value of the second less that of the first.
    pub difference: f64,
    /// Standard error, scatter between flights included.
    pub std_error: f64,
    /// Chance of as large a difference in any coefficient of any two craft.
    pub p_value: f64,
    /// Whether the vehicle files of the two say different things: mass and geometry go into the coefficients.
    pub vehicle_files_differ: bool,
}

/// A battery with which a craft flies otherwise.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct BatteryDifference {
    /// The battery.
    pub battery: String,
    /// What differs: a coefficient, a plain statistic or a voltage.
    pub series: String,
    /// Unit.
    pub unit: String,
    /// Flights with it, and of the same craft without it.
    pub flights: [usize; 2],
    /// With it less without it, on the same craft and between the same two changes.
    pub difference: f64,
    /// Standard error, scatter between flights included.
    pub std_error: f64,
    /// Chance of as large a difference of any battery in any series.
    pub p_value: f64,
}

/// How craft compare.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct CraftComparison {
    /// Coefficients of pairs that were compared.
    pub compared: usize,
    /// Those that differ, the surest first.
    pub differences: Vec<CraftDifference>,
}

/// How batteries compare.
#[derive(Debug, Clone, Default, PartialEq, Serialize, JsonSchema)]
pub struct BatteryComparison {
    /// Batteries with flights.
    pub batteries: Vec<String>,
    /// Series of batteries that were compared.
    pub compared: usize,
    /// Those that differ, the surest first.
    pub differences: Vec<BatteryDifference>,
}

/// A craft as it is now.
pub(crate) struct Current<'a> {
    pub(crate) craft: &'a str,
    pub(crate) vehicle: &'a [u8],
    pub(crate) series: &'a [Series],
    /// First flight after its last change.
    pub(crate) from: usize,
}

/// Compares all pairs of craft.
pub(crate) fn crafts(all: &[Current<'_>]) -> CraftComparison {
    let means: Vec<Vec<(&Series, Mean)>> = all.iter().map(means).collect();
    let mut found = CraftComparison::default();
    for (second, b) in all.iter().enumerate() {
        for (first, a) in all[..second].iter().enumerate() {
            for (series, one) in &means[first] {
                let same =
                    |(other, _): &&(&Series, Mean)| other.name == series.name && other.unit == series.unit;
                let Some((_, two)) = means[second].iter().find(same) else { continue };
                let (difference, std_error) = (two.value - one.value, one.std_error.hypot(two.std_error));
                found.differences.push(CraftDifference {
                    crafts: [a.craft.into(), b.craft.into()],
                    coefficient: series.name.clone(),
                    unit: series.unit.clone(),
                    means: [*one, *two],
                    difference,
                    std_error,
                    p_value: two_sided(difference / std_error, welch([one, two])),
                    vehicle_files_differ: a.vehicle != b.vehicle,
                });
            }
        }
    }
    found.compared = found.differences.len();
    found.differences = significant(found.differences, |own| &mut own.p_value);
    found
}

/// Corrects chances for how many differences were looked at (Bonferroni), and keeps those that are then sure, the surest first.
fn significant<T>(differences: Vec<T>, p_value: fn(&mut T) -> &mut f64) -> Vec<T> {
    let tests = differences.len() as f64;
    let corrected = |mut own: T| {
        let chance = p_value(&mut own);
        *chance = (*chance * tests).min(1.0);
        (*chance, own)
    };
    let mut kept: Vec<(f64, T)> = differences.into_iter().map(corrected).collect();
    kept.retain(|(chance, _)| *chance < SIGNIFICANCE);
    kept.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    kept.into_iter().map(|(_, own)| own).collect()
}

/// Coefficients of a craft since its last change, of two flights at least.
fn means<'a>(current: &Current<'a>) -> Vec<(&'a Series, Mean)> {
    let of = |series: &'a Series| {
        let first = series.at.partition_point(|at| *at < current.from);
        let mean = mean(&series.values[first..]).filter(|mean| mean.flights >= 2)?;
        Some((series, mean))
    };
    current.series.iter().filter(|series| series.kind == Kind::Coefficient).filter_map(of).collect()
}

/// Degrees of freedom of the difference of two means (Welch 1947).
fn welch(means: [&Mean; 2]) -> f64 {
    let [a, b] = means.map(|mean| mean.std_error.powi(2));
    let known = |variance: f64, mean: &Mean| variance * variance / (mean.flights as f64 - 1.0).max(1.0);
    (a + b).powi(2) / (known(a, means[0]) + known(b, means[1]))
}

/// Flights of one craft between two changes.
pub(crate) struct Stratum<'a> {
    pub(crate) series: &'a [Series],
    /// First flight, and the one after the last.
    pub(crate) range: [usize; 2],
    /// Battery of each flight of the craft.
    pub(crate) batteries: &'a [Option<String>],
}

/// Compares each battery with the others on the same craft between the same changes.
pub(crate) fn batteries(strata: &[Stratum<'_>]) -> BatteryComparison {
    let in_range = |stratum: &Stratum<'_>| stratum.batteries[stratum.range[0]..stratum.range[1]].to_vec();
    let mut names: Vec<String> = strata.iter().flat_map(in_range).flatten().collect();
    names.sort();
    names.dedup();
    let mut found = BatteryComparison { batteries: names, ..BatteryComparison::default() };
    let mut kinds: Vec<&Series> = strata.iter().flat_map(|stratum| stratum.series).collect();
    kinds.sort_by(|a, b| (&a.name, &a.unit).cmp(&(&b.name, &b.unit)));
    kinds.dedup_by(|a, b| (&a.name, &a.unit) == (&b.name, &b.unit));
    for battery in &found.batteries {
        for kind in &kinds {
            let Some(difference) = against_others(strata, battery, kind) else { continue };
            found.differences.push(difference);
        }
    }
    found.compared = found.differences.len();
    found.differences = significant(found.differences, |own| &mut own.p_value);
    found
}

/// Weighted least squares on whether the battery flew, each stratum about a mean of its own.
fn against_others(strata: &[Stratum<'_>], battery: &str, kind: &Series) -> Option<BatteryDifference> {
    let (mut product, mut square, mut flights, mut groups) = (0.0, 0.0, [0_usize; 2], 0.0);
    for stratum in strata {
        let Some(series) = stratum.series.iter().find(|own| own.name == kind.name && own.unit == kind.unit)
        else {
            continue;
        };
        let inside: Vec<usize> = (0..series.at.len())
            .filter(|k| (stratum.range[0]..stratum.range[1]).contains(&series.at[*k]))
            .filter(|k| stratum.batteries[series.at[*k]].is_some())
            .collect();
        let is_own = |k: usize| stratum.batteries[series.at[k]].as_deref() == Some(battery);
        let (own, others): (Vec<usize>, Vec<usize>) = inside.iter().partition(|k| is_own(**k));
        if own.is_empty() || others.is_empty() {
            continue;
        }
        let values = |places: &[usize]| places.iter().map(|k| series.values[*k]).collect::<Vec<Estimate>>();
        let (with, without) = (values(&own), values(&others));
        let variance = between_variance(&[&with, &without]);
        let ((mean_a, a), (mean_b, b)) = (weighted(&with, variance), weighted(&without, variance));
        // The squares of the indicator about its weighted mean, and its product with the values.
        let own_square = a * b / (a + b);
        square += own_square;
        product += own_square * (mean_a - mean_b);
        flights = [flights[0] + own.len(), flights[1] + others.len()];
        groups += 1.0;
    }
    let freedom = (flights[0] + flights[1]) as f64 - 2.0 * groups;
    if !(square > 0.0) || freedom < 1.0 || flights[0] < 2 {
        return None;
    }
    let (difference, std_error) = (product / square, 1.0 / square.sqrt());
    Some(BatteryDifference {
        battery: battery.into(),
        series: kind.name.clone(),
        unit: kind.unit.clone(),
        flights,
        difference,
        std_error,
        p_value: two_sided(difference / std_error, freedom),
    })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    fn series(seed: u64, count: usize, mean: impl Fn(usize) -> f64) -> Series {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut gauss = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let values = (0..count).map(|k| Estimate { value: mean(k) + gauss(), std_error: 0.3 }).collect();
        Series {
            name: "thrust.C_T".into(),
            kind: Kind::Coefficient,
            unit: "1".into(),
            is_share: false,
            at: (0..count).collect(),
            values,
        }
    }

    fn current<'a>(craft: &'a str, series: &'a [Series]) -> Current<'a> {
        Current { craft, vehicle: b"same", series, from: 0 }
    }

    #[test]
    fn craft_that_differ_by_more_than_their_flights_do_are_told() {
        let all = [series(1, 20, |_| 0.0), series(2, 20, |_| 0.0), series(3, 20, |_| 3.0)];
        let all: Vec<Current<'_>> = ["a", "b", "c"]
            .iter()
            .zip(&all)
            .map(|(craft, own)| current(craft, std::slice::from_ref(own)))
            .collect();
        let found = crafts(&all);
        assert_eq!(found.compared, 3);
        let pairs: Vec<[&str; 2]> =
            found.differences.iter().map(|d| d.crafts.each_ref().map(String::as_str)).collect();
        assert!(pairs.len() == 2 && pairs.contains(&["a", "c"]) && pairs.contains(&["b", "c"]), "{pairs:?}");
        assert!(
            (found.differences[0].difference - 3.0).abs() < 1.0 && !found.differences[0].vehicle_files_differ
        );
    }

    /// Two craft that differ by 50, three batteries, one of which makes a difference of 3 on both.
    #[test]
    fn a_battery_is_compared_on_the_same_craft() {
        let batteries: Vec<Option<String>> = (0..24).map(|k| Some(format!("B{}", k % 3))).collect();
        let shift = |k: usize| if k % 3 == 1 { 3.0 } else { 0.0 };
        let (one, two) = ([series(4, 24, shift)], [series(5, 24, |k| 50.0 + shift(k))]);
        let stratum = |series| Stratum { series, range: [0, 24], batteries: &batteries };
        let found = super::batteries(&[stratum(&one), stratum(&two)]);
        assert_eq!((found.batteries.len(), found.compared), (3, 3));
        let best = &found.differences[0];
        assert!(best.battery == "B1" && (best.difference - 3.0).abs() < 1.2, "{best:?}");
        let null = [series(6, 24, |_| 0.0)];
        assert!(super::batteries(&[stratum(&null)]).differences.is_empty());
    }

    /// Welch's degrees of freedom of equal samples are those of both together.
    #[test]
    fn equal_samples_have_the_freedom_of_both() {
        let mean = Mean { value: 0.0, std_error: 0.1, between: 0.0, flights: 11 };
        assert!((welch([&mean, &mean]) - 20.0).abs() < 1e-9);
    }
}
