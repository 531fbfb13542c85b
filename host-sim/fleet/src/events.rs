//! What changed of a craft, and when: steps of its series, put together, and what explains them.

use diagnosis::{AS_GOOD, rank_of_change};
use model::Effect;
use schemars::JsonSchema;
use serde::Serialize;

use crate::cause::CauseInLogs;
use crate::changes::{Base, Candidate, Shown, Size};
use crate::fit::{Estimate, of_many};
use crate::history::{Flown, Kind, Series, Tests};
use crate::scatter::{Mean, between_variance, mean_under};
use crate::steps::{SIGNIFICANCE, Step, outliers, steps, two_sided};
use crate::when::{When, WhenFrom};

/// Changes that are told of a step.
const TOLD: usize = 5;
/// Flights between steps of two series that are one change of the craft.
const APART: usize = 1;

/// A moment in a fleet's life.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Moment {
    /// The flight.
    pub flight: String,
    /// Its date, UTC.
    pub date: String,
    /// Where the date is from.
    pub date_from: WhenFrom,
}

/// A series that moved with a change.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Moved {
    /// "thrust.C_T", "mass-change.extra_mass", "share of motor 1 in the mean command".
    pub series: String,
    /// What it shows.
    pub kind: Kind,
    /// Unit of the values.
    pub unit: String,
    /// Before.
    pub before: Mean,
    /// After.
    pub after: Mean,
    /// Standard error of the difference, scatter between flights included.
    pub std_error: f64,
    /// Chance of as large a step anywhere in the fleet where nothing changed.
    pub p_value: f64,
    /// Whether a straight line over the flights leaves less than the step: it drifts.
    pub drifts: bool,
}

/// What a change may have been.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Explanation {
    /// The effect.
    pub effect: Effect,
    /// The motor, for a change of one motor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motor: Option<u8>,
    /// Its coefficients, to first order about the craft's reference (an extra mass is exact): `in_logs` has them without linearisation.
    pub coefficients: Vec<Size>,
    /// Part of what the model of the flights before leaves of the flights after that it takes away, on the axes where it acts, percent.
    pub drop_percent: f64,
    /// Chance of as large a difference between the flights before and after, times the changes that were tried.
    pub p_value: f64,
    /// Whether it explains the flights after as well as the best does.
    pub as_good_as_the_best: bool,
    #[serde(skip)]
    gain: f64,
}

/// The plainest statistic beside a change: each motor's share of the mean command.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MotorShares {
    /// Before.
    pub before: [f64; 4],
    /// After.
    pub after: [f64; 4],
    /// Student's t (pooled variance) of each, not corrected for anything.
    pub p_value: [f64; 4],
}

/// A change of a craft.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Event {
    /// The first flight after it.
    pub from: Moment,
    /// The last flight before it.
    pub last_before: Moment,
    /// The first and the last flight that may as well be the first after it (95 %).
    pub likely: [String; 2],
    /// Flights before, since the change before this one, and after, until the next one.
    pub flights: [usize; 2],
    /// What moved, the surest first; of the motors' shares, which sum to one, the one that moved most.
    pub moved: Vec<Moved>,
    /// What explains it, from what is kept of the flights, the best first; empty where no known change does.
    pub explanations: Vec<Explanation>,
    /// What `quadlab diagnose --changed` says of the logs before and after, where it was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_logs: Option<CauseInLogs>,
    /// Whether the logs say otherwise than what is kept of the flights: then the cause cannot be told.
    pub causes_disagree: bool,
    /// The plainest statistic beside it.
    pub motor_shares: MotorShares,
    /// Place of the first flight after it among the craft's.
    #[serde(skip)]
    pub at: usize,
}

impl Event {
    /// The best explanation, then those that explain as much.
    pub fn best_explanations(&self) -> impl Iterator<Item = &Explanation> {
        best(&self.explanations)
    }

    /// Puts in what the logs say.
    pub(crate) fn put_logs(&mut self, in_logs: Option<CauseInLogs>) {
        self.causes_disagree = in_logs.as_ref().is_some_and(|logs| disagree(&self.explanations, logs));
        self.in_logs = in_logs;
    }
}

/// The best explanation, then those that explain as much.
fn best(explanations: &[Explanation]) -> impl Iterator<Item = &Explanation> {
    let (first, others) = explanations.split_at(explanations.len().min(1));
    first.iter().chain(others.iter().filter(|own| own.as_good_as_the_best))
}

/// Whether what the logs say is none of the best explanations, nor any of these among what the logs take for the same.
fn disagree(explanations: &[Explanation], logs: &CauseInLogs) -> bool {
    if !logs.is_answer() {
        return false;
    }
    let is_same = |own: &Explanation| {
        let effect = own.effect.id();
        logs.effect.as_deref() == Some(effect) && logs.motor == own.motor
            || logs.confounded_with.iter().any(|other| other == effect)
    };
    match logs.effect {
        Some(_) => !best(explanations).any(is_same),
        None => !explanations.is_empty(),
    }
}

/// A single flight that stands out.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct OddFlight {
    /// The flight.
    pub flight: Moment,
    /// The series that shows it most.
    pub series: String,
    /// Unit of the values.
    pub unit: String,
    /// Its value there.
    pub value: f64,
    /// Mean of the craft's other flights since the last change.
    pub others: Mean,
    /// Chance of as far a value anywhere in the fleet.
    pub p_value: f64,
}

/// The steps of all series put together: the flights before which the craft changed, each with what moved there.
pub(crate) fn events(all: &[Series], tests: Tests) -> Vec<(usize, [usize; 2], Vec<Moved>)> {
    struct Found<'a> {
        series: &'a Series,
        step: Step,
        at: usize,
        likely: [usize; 2],
    }
    let mut found: Vec<Found<'_>> = Vec::new();
    for series in all {
        let sums_up = |other: &&Series| {
            series.is_share && other.is_share && other.name != series.name && other.at == series.at
        };
        let others: Vec<&[Estimate]> = all.iter().filter(sums_up).map(|other| &other.values[..]).collect();
        for step in steps(&series.values, &others, tests.of_series(series)) {
            let (at, likely) = (series.at[step.at], step.likely.map(|place| series.at[place]));
            found.push(Found { series, step, at, likely });
        }
    }
    found.sort_by(|a, b| a.step.p_value.total_cmp(&b.step.p_value));
    let is_share = |name: &str| all.iter().any(|series| series.is_share && series.name == name);
    let mut events: Vec<(usize, [usize; 2], Vec<Moved>)> = Vec::new();
    for Found { series, step, at, likely } in found {
        let moved = Moved {
            series: series.name.clone(),
            kind: series.kind,
            unit: series.unit.clone(),
            before: step.before,
            after: step.after,
            std_error: step.std_error,
            p_value: step.p_value,
            drifts: step.drifts,
        };
        let is_same = |own: usize, range: [usize; 2]| {
            at + APART >= range[0] && at <= range[1] + APART
                || own + APART >= likely[0] && own <= likely[1] + APART
        };
        match events.iter_mut().find(|(own, range, _)| is_same(*own, *range)) {
            Some((_, _, all)) => all.push(moved),
            None => events.push((at, likely, vec![moved])),
        }
    }
    events.sort_by_key(|(at, ..)| *at);
    events.iter_mut().for_each(|(.., moved)| most_moved_first(moved, is_share));
    events
}

/// Puts the motors' shares, where they stand among what moved, in the order of how far they moved: as they sum to one, that of one motor
/// moves those of the others, and these may scatter less.
fn most_moved_first(moved: &mut [Moved], is_share: impl Fn(&str) -> bool) {
    let places: Vec<usize> = (0..moved.len()).filter(|k| is_share(&moved[*k].series)).collect();
    let mut shares: Vec<Moved> = places.iter().map(|k| moved[*k].clone()).collect();
    let by = |own: &Moved| (own.after.value - own.before.value).abs();
    shares.sort_by(|a, b| by(b).total_cmp(&by(a)));
    places.into_iter().zip(shares).for_each(|(k, share)| moved[k] = share);
}

/// What explains a change, from the normal equations of the flights before and after.
pub(crate) fn explanations(
    flown: &Flown<'_>,
    candidates: &[Candidate],
    split: [usize; 3],
) -> Vec<Explanation> {
    let [from, at, to] = split;
    let all = flown.equations();
    let (before, after) = (&all[from..at], &all[at..to]);
    let fit = of_many(before, flown.asked);
    let base = Base::new(flown.columns, &flown.asked.parameters, &fit);
    let shown = |flights: &[&crate::equations::Equations]| -> Vec<Vec<Shown>> {
        flights.iter().map(|flight| base.shown(flight, candidates)).collect()
    };
    let (before, after) = (shown(before), shown(after));
    let of = |(place, candidate): (usize, &Candidate)| {
        explanation(flown, candidate, (place, candidates.len()), (&before, &after))
    };
    let mut found: Vec<Explanation> = candidates.iter().enumerate().filter_map(of).collect();
    found.retain(|one| one.p_value < SIGNIFICANCE);
    let rank = |one: &Explanation| rank_of_change(one.gain, one.coefficients.len());
    found.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
    let best = found.first().map_or(0.0, |one| one.gain);
    found.iter_mut().skip(1).for_each(|one| one.as_good_as_the_best = one.gain > AS_GOOD * best);
    found.truncate(TOLD);
    found
}

fn explanation(
    flown: &Flown<'_>,
    candidate: &Candidate,
    (place, count): (usize, usize),
    (before, after): (&[Vec<Shown>], &[Vec<Shown>]),
) -> Option<Explanation> {
    let model = flown.model;
    let together = |flights: &[Vec<Shown>]| flights.iter().map(|f| f[place].clone()).reduce(|a, b| a.and(&b));
    let (gain, part) = together(after)?.gain();
    let of = |flights: &[Vec<Shown>], k: usize| -> Vec<Estimate> {
        flights.iter().filter_map(|flight| flight[place].estimates()[k]).collect()
    };
    let (mut coefficients, mut p_value) = (Vec::new(), 1.0_f64);
    for k in 0..candidate.parameters.len() {
        let (early, late) = (of(before, k), of(after, k));
        let Some(mut step) = difference(&early, &late) else { continue };
        if candidate.change.effect == Effect::MassChange {
            step = step.of_mass(model.vehicle.mass)?;
        }
        let info = candidate.coefficient(flown.columns, k);
        let (low, high) = info.possible_for(model.vehicle.arm_length);
        if model.vehicle.has_rotor_map() && !(low..=high).contains(&step.value) {
            return None;
        }
        p_value = p_value.min(step.p_value * (candidate.parameters.len() * count) as f64);
        coefficients.push(Size {
            name: info.name.into(),
            value: step.value,
            std_error: step.std_error,
            unit: info.unit_for(model.rotor_quantity()).into(),
        });
    }
    Some(Explanation {
        effect: candidate.change.effect,
        motor: candidate.change.motor,
        coefficients,
        drop_percent: 100.0 * part,
        p_value: p_value.min(1.0),
        as_good_as_the_best: false,
        gain,
    })
}

/// The means of two groups of flights against each other, the scatter between flights common to both.
pub(crate) struct Difference {
    pub(crate) value: f64,
    pub(crate) std_error: f64,
    /// Not corrected for anything.
    pub(crate) p_value: f64,
}

impl Difference {
    /// An extra mass, where this is what the first order says: all accelerations are divided by 1 + d/m, and a first order that holds d
    /// for small finds d/(1 + d/m) in them. Nothing where no mass does that.
    fn of_mass(self, mass_kg: f64) -> Option<Self> {
        let left = 1.0 - self.value / mass_kg;
        (left > 0.0).then(|| Self {
            value: self.value / left,
            std_error: self.std_error / (left * left),
            p_value: self.p_value,
        })
    }
}

pub(crate) fn difference(early: &[Estimate], late: &[Estimate]) -> Option<Difference> {
    let freedom = (early.len() + late.len()) as f64 - 2.0;
    if freedom < 1.0 {
        return None;
    }
    let variance = between_variance(&[early, late]);
    let (before, after) = (mean_under(early, variance)?, mean_under(late, variance)?);
    let (value, std_error) = (after.value - before.value, before.std_error.hypot(after.std_error));
    let is_told = std_error > 0.0 && std_error.is_finite();
    is_told.then(|| Difference { value, std_error, p_value: two_sided(value / std_error, freedom) })
}

/// The motors' shares before and after.
pub(crate) fn motor_shares(flown: &Flown<'_>, [from, at, to]: [usize; 3]) -> MotorShares {
    let of = |range: std::ops::Range<usize>, motor: usize| -> Vec<Estimate> {
        let shares = flown.rows[range].iter().map(|row| row.motor_shares[motor]);
        let told = shares.filter(|share| share.is_finite());
        told.map(|value| Estimate { value, std_error: 0.0 }).collect()
    };
    let mean = |values: Vec<Estimate>| values.iter().map(|e| e.value).sum::<f64>() / values.len() as f64;
    MotorShares {
        before: [0, 1, 2, 3].map(|motor| mean(of(from..at, motor))),
        after: [0, 1, 2, 3].map(|motor| mean(of(at..to, motor))),
        p_value: [0, 1, 2, 3].map(|motor| {
            difference(&of(from..at, motor), &of(at..to, motor)).map_or(1.0, |step| step.p_value)
        }),
    }
}

/// Single flights that stand out of the flights between two changes, each with the series that shows it most. Changes by themselves are
/// not looked at: of those that a flight hardly excites (tether, quadratic drag) errors have long tails, and in 7 of 100 fleets in which
/// nothing changed one flight stood out in them.
pub(crate) fn odd_flights(
    series: &[Series],
    bounds: &[usize],
    tests: Tests,
    moment: &dyn Fn(usize) -> Moment,
) -> Vec<OddFlight> {
    let mut found: Vec<(usize, OddFlight)> = Vec::new();
    for series in series.iter().filter(|series| series.kind != Kind::Change) {
        for bounds in bounds.windows(2) {
            let inside: Vec<usize> =
                (0..series.at.len()).filter(|k| (bounds[0]..bounds[1]).contains(&series.at[*k])).collect();
            let values: Vec<Estimate> = inside.iter().map(|k| series.values[*k]).collect();
            for outlier in outliers(&values, tests.of_series(series)) {
                let at = series.at[inside[outlier.at]];
                let odd = OddFlight {
                    flight: moment(at),
                    series: series.name.clone(),
                    unit: series.unit.clone(),
                    value: values[outlier.at].value,
                    others: outlier.others,
                    p_value: outlier.p_value,
                };
                match found.iter_mut().find(|(known, _)| *known == at) {
                    Some((_, known)) if known.p_value <= odd.p_value => {}
                    Some((_, known)) => *known = odd,
                    None => found.push((at, odd)),
                }
            }
        }
    }
    found.sort_by_key(|(at, _)| *at);
    found.into_iter().map(|(_, odd)| odd).collect()
}

impl Moment {
    pub(crate) fn new(flight: String, when: When) -> Self {
        Self { flight, date: when.to_string(), date_from: when.from }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn explanation(effect: Effect, motor: Option<u8>, as_good_as_the_best: bool) -> Explanation {
        Explanation {
            effect,
            motor,
            coefficients: Vec::new(),
            drop_percent: 50.0,
            p_value: 1e-6,
            as_good_as_the_best,
            gain: 1.0,
        }
    }

    fn logs(effect: Option<Effect>, motor: Option<u8>, confounded_with: &[Effect]) -> CauseInLogs {
        CauseInLogs {
            verdict: "missing-effect".into(),
            summary: String::new(),
            effect: effect.map(|effect| effect.id().into()),
            motor,
            coefficients: Vec::new(),
            confounded_with: confounded_with.iter().map(|effect| effect.id().into()).collect(),
            before: Vec::new(),
            after: Vec::new(),
        }
    }

    /// 0.1 kg more on 1.2187 kg: the first order is 0.1/(1 + 0.1/1.2187).
    #[test]
    fn an_extra_mass_is_told_beyond_the_first_order() {
        let first = 0.1 / (1.0 + 0.1 / 1.2187);
        let exact = Difference { value: first, std_error: 1e-4, p_value: 0.0 }.of_mass(1.2187).unwrap();
        assert!((exact.value - 0.1).abs() < 1e-12 && exact.std_error > 1.1e-4, "{}", exact.value);
        assert!(Difference { value: 2.0, std_error: 0.1, p_value: 0.0 }.of_mass(1.2187).is_none());
    }

    #[test]
    fn of_the_shares_the_one_that_moved_most_comes_first() {
        let mean = |value| Mean { value, std_error: 0.01, between: 0.0, flights: 5 };
        let moved = |series: &str, by: f64| Moved {
            series: series.into(),
            kind: Kind::Plain,
            unit: "1".into(),
            before: mean(1.0),
            after: mean(1.0 + by),
            std_error: 0.01,
            p_value: 1e-9,
            drifts: false,
        };
        let mut all = [moved("share 4", -0.009), moved("mass", 0.3), moved("share 2", 0.028)];
        most_moved_first(&mut all, |name| name.starts_with("share"));
        assert_eq!(all.each_ref().map(|own| own.series.as_str()), ["share 2", "mass", "share 4"]);
    }

    #[test]
    fn causes_disagree_unless_one_of_the_best_is_the_logs_own() {
        use Effect::{ComOffset, MassChange, MotorEfficiency};
        let best = [
            explanation(MotorEfficiency, Some(3), false),
            explanation(ComOffset, None, true),
            explanation(MassChange, None, false),
        ];
        let same = |effect, motor, others: &[Effect]| !disagree(&best, &logs(Some(effect), motor, others));
        assert!(same(MotorEfficiency, Some(3), &[]) && same(ComOffset, None, &[]));
        assert!(same(MassChange, None, &[ComOffset]), "the logs cannot tell it from one of the best");
        assert!(!same(MotorEfficiency, Some(2), &[]), "another motor is another cause");
        assert!(!same(MassChange, None, &[]), "not one of the best");
        assert!(disagree(&best, &logs(None, None, &[])), "the logs show nothing");
        assert!(!disagree(&[], &logs(None, None, &[])));
        let not_asked = CauseInLogs { verdict: "not-asked".into(), ..logs(None, None, &[]) };
        assert!(!disagree(&best, &not_asked), "logs that are gone say nothing");
    }
}
