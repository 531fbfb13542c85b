//! Has a value changed from some flight on?
//!
//! Steps are looked for before every flight, the largest one first, then on either side of it. The means before and after each are
//! compared by Student's t, with a scatter between flights that is that about the means between the steps; flights that are like the one
//! before them count as fewer. The chance is multiplied by the places that were tried and by the series that were looked at
//! (Bonferroni): a fleet in which nothing changed is said to have changed as seldom as [`SIGNIFICANCE`] says. A value that drifts is no
//! step: where a straight line leaves less than the step, that is said.

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::fit::Estimate;
use crate::scatter::{Mean, between_variance, mean_under, weight};

/// Largest chance that anything is said to have changed in a fleet where nothing has.
pub const SIGNIFICANCE: f64 = 0.01;
/// Fewest flights that say anything.
const FEWEST: usize = 4;
/// 95 % point of chi squared with one degree of freedom: how much worse a place may be and still be a likely one.
const LIKELY: f64 = 3.841;
/// Square of a step, in standard errors by how neighbours differ, from which on it is looked at; and most steps that are.
const CANDIDATE: f64 = 12.0;
const MOST_STEPS: usize = 20;
/// Largest correlation between neighbours that flights are taken to have.
const MOST_ALIKE: f64 = 0.9;

/// A step of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Step {
    /// First value after it.
    pub(crate) at: usize,
    /// First and last place where it may as well be (95 %).
    pub(crate) likely: [usize; 2],
    /// Mean before, from the step before this one on.
    pub(crate) before: Mean,
    /// Mean after, up to the next step.
    pub(crate) after: Mean,
    /// Standard error of the difference.
    pub(crate) std_error: f64,
    /// Chance of as large a step anywhere in any series where nothing changed.
    pub(crate) p_value: f64,
    /// Whether a straight line leaves less than the step.
    pub(crate) drifts: bool,
}

/// The steps of a series in its order, where the chance of each is multiplied by `tests`. `others` are of the same flights and sum to a
/// constant with it; there may be none. They change where it changes, and are taken to scatter by as much.
pub(crate) fn steps(series: &[Estimate], others: &[&[Estimate]], tests: f64) -> Vec<Step> {
    if series.len() < FEWEST {
        return Vec::new();
    }
    let variance = neighbours_variance(series);
    let mut places = Vec::new();
    candidates(series, 0, variance, &mut places);
    places.sort_unstable();
    // What looks like a step beside its neighbours need not be one beside all flights: the least sure goes first.
    while !places.is_empty() {
        let tested = tested((series, others), &places, tests);
        let p_value = |k: &usize| tested[*k].map_or(1.0, |step| step.p_value);
        let Some(worst) = (0..places.len()).max_by(|a, b| p_value(a).total_cmp(&p_value(b))) else { break };
        if p_value(&worst) < SIGNIFICANCE {
            return tested.into_iter().flatten().collect();
        }
        places.remove(worst);
    }
    Vec::new()
}

/// Places of steps that are large beside how neighbours differ: the largest one, then those on either side of it.
fn candidates(series: &[Estimate], first: usize, variance: f64, places: &mut Vec<usize>) {
    if series.len() < 2 || places.len() >= MOST_STEPS {
        return;
    }
    let scan = Scan::new(series, variance);
    let largest = (1..series.len()).max_by(|a, b| scan.square(*a).total_cmp(&scan.square(*b)));
    let Some(at) = largest.filter(|at| scan.square(*at) > CANDIDATE) else { return };
    places.push(first + at);
    candidates(&series[..at], first, variance, places);
    candidates(&series[at..], first + at, variance, places);
}

/// A series in parts that begin at some places.
fn parts<'a>(series: &'a [Estimate], bounds: &[usize]) -> Vec<&'a [Estimate]> {
    bounds.windows(2).map(|pair| &series[pair[0]..pair[1]]).collect()
}

/// How values scatter about the means of parts.
struct Scatter {
    /// Between flights.
    variance: f64,
    /// By how much variances of means grow since a flight is like the one before it, and by how much fewer flights count.
    inflated: f64,
    /// Degrees of freedom that this is known with.
    freedom: f64,
}

impl Scatter {
    /// Of the parts of series that sum to a constant: of so many, one follows from the others.
    fn of(series: &[Vec<&[Estimate]>]) -> Option<Self> {
        let groups: Vec<&[Estimate]> = series.iter().flatten().copied().collect();
        let variance = between_variance(&groups);
        let [first, ..] = series else { return None };
        let (flights, parts) =
            (first.iter().map(|part| part.len()).sum::<usize>() as f64, first.len() as f64);
        let independent = (series.len() - 1).max(1) as f64;
        let alike: Option<Vec<f64>> = series.iter().map(|parts| alike(parts, variance)).collect();
        let shown = alike?.iter().sum::<f64>() / series.len() as f64;
        // One standard error above what they show: a step that is fitted makes what it leaves look less alike than it is.
        let alike = (shown + 1.0 / (flights * independent).sqrt()).clamp(0.0, MOST_ALIKE);
        let inflated = (1.0 + alike) / (1.0 - alike);
        Some(Self { variance, inflated, freedom: independent * (flights / inflated - parts) })
    }
}

/// The steps at some places, each by the means before and after it up to the next one.
fn tested(
    (series, others): (&[Estimate], &[&[Estimate]]),
    places: &[usize],
    tests: f64,
) -> Vec<Option<Step>> {
    let bounds: Vec<usize> = std::iter::once(0).chain(places.iter().copied()).chain([series.len()]).collect();
    let sides = parts(series, &bounds);
    let none = || vec![None; places.len()];
    let Some(own) = Scatter::of(std::slice::from_ref(&sides)) else { return none() };
    let all =
        || std::iter::once(&series).chain(others).map(|series| parts(series, &bounds)).collect::<Vec<_>>();
    // One that scatters by more than the others together has its own scatter, which is known less well.
    let together = (!others.is_empty()).then(|| Scatter::of(&all())).flatten();
    let together = together.filter(|together| together.variance >= own.variance);
    let Scatter { variance, inflated, freedom } = together.unwrap_or(own);
    let means: Option<Vec<Mean>> = sides.iter().map(|side| mean_under(side, variance)).collect();
    let Some(means) = means else { return none() };
    let tries = (series.len() as f64 - 1.0) * tests;
    let step = |k: usize| {
        let (before, after) = (means[k], means[k + 1]);
        let std_error = before.std_error.hypot(after.std_error) * inflated.sqrt();
        if !(std_error > 0.0) || freedom < 1.0 {
            return None;
        }
        let p_value = (two_sided((after.value - before.value) / std_error, freedom) * tries).min(1.0);
        let both = Scan::new(&series[bounds[k]..bounds[k + 2]], variance);
        let at = bounds[k + 1] - bounds[k];
        let best = both.square(at);
        let likely: Vec<usize> =
            (1..both.len()).filter(|other| best - both.square(*other) < LIKELY * inflated).collect();
        let likely = [*likely.first()?, *likely.last()?].map(|place| place + bounds[k]);
        let drifts = both.left_by_line() < both.left_by_step(at);
        Some(Step { at: bounds[k + 1], likely, before, after, std_error, p_value, drifts })
    };
    (0..places.len()).map(step).collect()
}

/// Chance of as large a value of Student's t on either side.
pub(crate) fn two_sided(t: f64, freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom.max(1.0)).map_or(1.0, |student| 2.0 * student.sf(t.abs()))
}

/// Variance between flights from how neighbours differ, which steps hardly touch.
fn neighbours_variance(series: &[Estimate]) -> f64 {
    let mut beyond: Vec<f64> = series
        .windows(2)
        .map(|pair| {
            let errors = pair[0].std_error.powi(2) + pair[1].std_error.powi(2);
            // The median of a squared normal deviate is 0.455.
            0.5 * ((pair[1].value - pair[0].value).powi(2) / 0.455 - errors)
        })
        .collect();
    sysid::statistics::median(&mut beyond).unwrap_or(0.0).max(0.0)
}

/// Correlation of each flight with the one before it about the means of parts.
fn alike(parts: &[&[Estimate]], variance: f64) -> Option<f64> {
    let (mut products, mut squares) = (0.0, 0.0);
    for part in parts {
        let mean = mean_under(part, variance)?;
        let scaled: Vec<f64> =
            part.iter().map(|e| (e.value - mean.value) * weight(e, variance).sqrt()).collect();
        squares += scaled.iter().map(|r| r * r).sum::<f64>();
        products += scaled.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
    }
    Some(if squares > 0.0 { products / squares } else { 0.0 })
}

/// Weighted sums up to each place.
struct Scan {
    /// Of weights, weights times values, values squared, and those of places.
    sums: Vec<[f64; 5]>,
    squares: f64,
}

impl Scan {
    fn new(series: &[Estimate], variance: f64) -> Self {
        let mean = series.iter().map(|e| e.value).sum::<f64>() / series.len().max(1) as f64;
        let (mut sums, mut squares) = (vec![[0.0; 5]], 0.0);
        let mut total = [0.0; 5];
        for (k, estimate) in series.iter().enumerate() {
            let weight = weight(estimate, variance);
            let (y, x) = (estimate.value - mean, k as f64);
            for (sum, more) in total.iter_mut().zip([1.0, y, x, x * x, x * y]) {
                *sum += weight * more;
            }
            squares += weight * y * y;
            sums.push(total);
        }
        Self { sums, squares }
    }

    fn len(&self) -> usize {
        self.sums.len() - 1
    }

    fn total(&self) -> [f64; 5] {
        self.sums[self.sums.len() - 1]
    }

    /// Square of the difference of the means before and after a place, in standard errors.
    fn square(&self, at: usize) -> f64 {
        let (early, all) = (self.sums[at], self.total());
        let late = [all[0] - early[0], all[1] - early[1]];
        let difference = late[1] / late[0] - early[1] / early[0];
        difference * difference / (1.0 / early[0] + 1.0 / late[0])
    }

    fn left_by_step(&self, at: usize) -> f64 {
        let (early, all) = (self.sums[at], self.total());
        let late = [all[0] - early[0], all[1] - early[1]];
        self.squares - early[1] * early[1] / early[0] - late[1] * late[1] / late[0]
    }

    fn left_by_line(&self) -> f64 {
        let [w, y, x, xx, xy] = self.total();
        let (sxx, sxy) = (xx - x * x / w, xy - x * y / w);
        self.squares - y * y / w - if sxx > 0.0 { sxy * sxy / sxx } else { 0.0 }
    }
}

/// A value that stands out of its series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outlier {
    /// Which.
    pub(crate) at: usize,
    /// Mean of the others.
    pub(crate) others: Mean,
    /// Chance of as far a value anywhere in any series.
    pub(crate) p_value: f64,
}

/// Most values that stand out of a stretch of a series: more of them are no exception.
const MOST_OUTLIERS: usize = 10;

/// Values that stand out of a stretch without a step.
pub(crate) fn outliers(series: &[Estimate], tests: f64) -> Vec<Outlier> {
    let mut rest: Vec<(usize, Estimate)> = series.iter().copied().enumerate().collect();
    let mut found = Vec::new();
    while rest.len() >= FEWEST && found.len() < MOST_OUTLIERS.min(series.len() / FEWEST) {
        let all: Vec<Estimate> = rest.iter().map(|(_, estimate)| *estimate).collect();
        let variance = between_variance(&[&all]);
        let Some(mean) = mean_under(&all, variance) else { break };
        let far =
            |e: &Estimate| (e.value - mean.value).powi(2) / (e.std_error.powi(2) + variance).max(1e-300);
        let Some(k) = (0..all.len()).max_by(|a, b| far(&all[*a]).total_cmp(&far(&all[*b]))) else { break };
        let (at, suspect) = rest.remove(k);
        let others: Vec<Estimate> = rest.iter().map(|(_, estimate)| *estimate).collect();
        let variance = between_variance(&[&others]);
        let Some(others) = mean_under(&others, variance) else { break };
        let deviation = (suspect.std_error.powi(2) + variance + others.std_error.powi(2)).sqrt();
        let freedom = others.flights as f64 - 1.0;
        let t = if deviation > 0.0 { (suspect.value - others.value) / deviation } else { 0.0 };
        let p_value = (two_sided(t, freedom) * (others.flights + 1) as f64 * tests).min(1.0);
        if p_value >= SIGNIFICANCE {
            break;
        }
        found.push(Outlier { at, others, p_value });
    }
    found
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    /// Normal deviates with errors of 0.3 and a scatter between flights of 1, each `alike` to the one before it.
    fn series(seed: u64, count: usize, alike: f64, mean: impl Fn(usize) -> f64) -> Vec<Estimate> {
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(seed);
        let mut gauss = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let mut state = gauss();
        (0..count)
            .map(|k| {
                state = alike * state + (1.0 - alike * alike).sqrt() * gauss();
                Estimate { value: mean(k) + state + 0.3 * gauss(), std_error: 0.3 }
            })
            .collect()
    }

    #[test]
    fn a_step_is_found_where_it_is() {
        let found = steps(&series(1, 60, 0.0, |k| if k < 37 { 10.0 } else { 13.0 }), &[], 50.0);
        let [step] = &found[..] else { panic!("{found:?}") };
        assert!(step.at.abs_diff(37) <= 1 && (step.likely[0]..=step.likely[1]).contains(&37), "{step:?}");
        assert!((step.after.value - step.before.value - 3.0).abs() < 1.0 && !step.drifts);
    }

    #[test]
    fn two_steps_are_found_and_a_drift_is_no_step() {
        let found = steps(
            &series(2, 90, 0.0, |k| match k {
                0..30 => 0.0,
                30..60 => 4.0,
                _ => 8.0,
            }),
            &[],
            50.0,
        );
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].at.abs_diff(30) <= 1 && found[1].at.abs_diff(60) <= 1);
        let drift = steps(&series(3, 90, 0.0, |k| 0.1 * k as f64), &[], 50.0);
        assert!(drift.iter().any(|step| step.drifts), "{drift:?}");
        let taken_back = |k: usize| if (30..60).contains(&k) { 4.0 } else { 0.0 };
        let found = steps(&series(4, 90, 0.0, taken_back), &[], 50.0);
        assert_eq!(found.len(), 2, "{found:?}");
    }

    /// Fifty series a fleet; the share of fleets with a false alarm. A thousand fleets know 1 % to 0.3 %. Flights that are half like the one
    /// before them in all series are told from a change in nine fleets of ten.
    #[test]
    fn fleets_in_which_nothing_changed_are_said_to_have_changed_in_one_of_a_hundred() {
        for (alike, count, allowed) in [(0.0, 12, 20), (0.0, 100, 20), (0.5, 40, 150)] {
            let alarms = (0..1000_u64)
                .filter(|fleet| {
                    (0..50).any(|k| {
                        let flown = series(50 * fleet + k, count, alike, |_| 0.0);
                        !steps(&flown, &[], 50.0).is_empty()
                    })
                })
                .count();
            println!("neighbours alike by {alike}, {count} flights: {alarms} of 1000 fleets");
            assert!(alarms <= allowed, "{alarms} of 1000 with {alike}, {count}");
        }
    }

    /// What four motors do, as parts of what they do together.
    fn shares(
        seed: u64,
        count: usize,
        scatter: [f64; 4],
        of_last: impl Fn(usize) -> f64,
    ) -> [Vec<Estimate>; 4] {
        let parts: [Vec<Estimate>; 4] =
            std::array::from_fn(|motor| series(4 * seed + motor as u64, count, 0.0, |_| 0.0));
        let of = |motor: usize, k: usize| {
            let moved = if motor == 3 { of_last(k) } else { 0.0 };
            100.0 + moved + scatter[motor] * parts[motor][k].value
        };
        std::array::from_fn(|motor| {
            let share = |k: usize| of(motor, k) / (0..4).map(|other| of(other, k)).sum::<f64>();
            (0..count).map(|k| Estimate { value: share(k), std_error: 0.0 }).collect()
        })
    }

    fn steps_of_shares(shares: &[Vec<Estimate>; 4]) -> [Vec<Step>; 4] {
        std::array::from_fn(|motor| {
            let others = (0..4).filter(|other| *other != motor).map(|other| &shares[other][..]);
            steps(&shares[motor], &others.collect::<Vec<_>>(), 10.0)
        })
    }

    /// Two flights after eight.
    #[test]
    fn shares_of_motors_are_judged_by_how_all_of_them_scatter() {
        let (mut together, mut alone) = (0, 0);
        for seed in 0..50 {
            let flown = shares(seed, 10, [1.0; 4], |k| if k < 8 { 0.0 } else { 10.0 });
            let at = |found: &[Step]| found.iter().any(|step| step.at == 8);
            together += usize::from(at(&steps_of_shares(&flown)[3]));
            alone += usize::from(at(&steps(&flown[3], &[], 10.0)));
        }
        println!("found in {together} of 50, by itself in {alone}");
        assert!(together >= alone + 8 && together >= 35, "{together} {alone}");
    }

    /// Half of the significance is theirs. One that scatters by twice as much as the others is seldom taken for a change.
    #[test]
    fn shares_that_only_scatter_have_not_changed() {
        for scatter in [[1.0; 4], [1.0, 1.0, 2.0, 1.0]] {
            for count in [8, 20, 60] {
                let changed = |seed: &u64| {
                    steps_of_shares(&shares(*seed, count, scatter, |_| 0.0)).iter().any(|s| !s.is_empty())
                };
                let alarms = (0..1000).filter(changed).count();
                println!("{count} flights, scatter {scatter:?}: {alarms} of 1000 craft");
                assert!(alarms <= 12, "{alarms} of 1000 with {count}, {scatter:?}");
            }
        }
    }

    #[test]
    fn a_flight_that_stands_out_is_named_and_others_are_not() {
        let mut flown = series(5, 40, 0.0, |_| 2.0);
        flown[17].value += 9.0;
        let found = outliers(&flown, 50.0);
        assert_eq!(found.iter().map(|o| o.at).collect::<Vec<_>>(), [17]);
        assert!(outliers(&series(6, 40, 0.0, |_| 2.0), 50.0).is_empty());
    }

    #[test]
    fn three_flights_say_nothing() {
        assert!(steps(&series(7, 3, 0.0, |k| 100.0 * k as f64), &[], 1.0).is_empty());
    }
}
