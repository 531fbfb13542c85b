//! What a campaign says: how often the craft was lost, which gains are safer, and what drives it.
//!
//! Everything is counted in draws: flights of one draw, in several scenarios or under several gains, are not independent.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::Serialize;

use crate::drivers::{Driver, drivers};
use crate::flown::{FLYING, SEPARATOR};
use crate::part::INPUT;
use crate::plan::{Campaign, Plan};
use crate::statistics::{Interval, exact_interval, mcnemar_p_value, paired_interval};
use crate::truncation::Truncation;
use table::Table;

/// Worst cases that are named for each gains.
const WORST: usize = 5;

/// What a campaign says.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Summary {
    /// Name of the campaign.
    pub campaign: String,
    /// Seed of everything that was drawn.
    pub seed: u64,
    /// Flights.
    pub cases: u64,
    /// Draws, each flown in every scenario under all gains.
    pub draws: u64,
    /// Draws in which no gains could have flown: the craft cannot hover in that air. They count nowhere else.
    pub impossible: u64,
    /// Normal distributions that were truncated, because they reach beyond what can be simulated.
    pub truncations: Vec<Truncation>,
    /// For each gains, in any of the scenarios and in each.
    pub rates: Vec<Rate>,
    /// For each two gains on the same draws.
    pub pairs: Vec<Pair>,
    /// For each gains and each fault that was drawn.
    pub faults: Vec<FaultRate>,
    /// For each gains that lost a craft: what drives it, the strongest first.
    pub drivers: BTreeMap<String, Vec<Driver>>,
    /// For each gains, the flights that were lost first.
    pub worst: BTreeMap<String, Vec<Worst>>,
}

/// How often the craft was lost.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Rate {
    /// Under which gains.
    pub gains: String,
    /// In which scenario; absent for any of several.
    pub scenario: Option<String>,
    /// Draws.
    pub draws: u64,
    /// Of them lost.
    pub lost: u64,
    /// Not lost, but the supervisor held or landed the craft before the end.
    pub aborted: u64,
    /// Flown as commanded to the end.
    pub completed: u64,
    /// Share that was lost, percent.
    pub lost_percent: f64,
    /// Exact 95 % interval of that share, percent.
    pub lost_interval_percent: [f64; 2],
    /// How the craft was lost, and in how many flights.
    pub lost_by: BTreeMap<String, u64>,
    /// Flights of scenarios with requirements, and those of them that keep all of them; one that is lost keeps none.
    pub judged: u64,
    /// See `judged`.
    pub requirements_hold: u64,
    /// Of flights that were not lost, median and 95th percentile of the overshoot of steps, percent; absent without steps.
    pub overshoot_percent: Option<[f64; 2]>,
    /// The same of the greatest tilt of a flight, deg.
    pub tilt_deg: Option<[f64; 2]>,
    /// The same of the root mean square error of height, m.
    pub height_error_m: Option<[f64; 2]>,
    /// Conditions that the supervisor saw, and in how many flights.
    pub events: BTreeMap<String, u64>,
}

/// Whether as few draws are lost as are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Answer {
    /// The upper end of the interval is below what is allowed.
    Shown,
    /// What is allowed lies in the interval: more draws may tell.
    Open,
    /// The lower end of the interval is not below it.
    Refuted,
}

impl Rate {
    /// Whether less than this share of the draws is lost, percent.
    pub fn is_below(&self, allowed_percent: f64) -> Answer {
        match self.lost_interval_percent {
            [_, high] if high < allowed_percent => Answer::Shown,
            [low, _] if low >= allowed_percent => Answer::Refuted,
            _ => Answer::Open,
        }
    }
}

/// Two gains on the same draws.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Pair {
    /// One.
    pub first: String,
    /// The other.
    pub second: String,
    /// Draws that only the first lost, and only the second.
    pub only_first: u64,
    /// See `only_first`.
    pub only_second: u64,
    /// Draws that both lost.
    pub both: u64,
    /// Chance of such a difference between gains that lose the craft equally often (McNemar's exact test), times the number of pairs.
    pub p_value: f64,
    /// By how much more often the first loses the craft than the second, percent of the draws.
    pub difference_percent: f64,
    /// Its 95 % score interval.
    pub difference_interval_percent: [f64; 2],
}

/// Losses of draws with a fault.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FaultRate {
    /// Under which gains.
    pub gains: String,
    /// Kind of the fault; empty without one.
    pub fault: String,
    /// Draws with it.
    pub draws: u64,
    /// Of them lost, in any scenario.
    pub lost: u64,
}

/// A flight that was lost.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Worst {
    /// Its case.
    pub case: u64,
    /// Its scenario.
    pub scenario: String,
    /// How it was lost.
    pub lost_by: String,
    /// After how many s.
    pub after_s: f64,
}

/// The columns that a summary looks at. Rows are in the order of the cases: by draw, by scenario, by gains.
struct Columns<'a> {
    campaign: &'a Campaign,
    table: &'a Table,
    lost: &'a [bool],
    ended: &'a [String],
    lost_by: &'a [String],
    fault: &'a [String],
    /// Draws that somebody could have flown.
    draws: Vec<usize>,
}

impl Summary {
    /// Of the table of all cases; nothing where it is not one.
    pub fn new(plan: &Plan, table: &Table) -> Option<Self> {
        let campaign = &plan.campaign;
        let impossible = table.flag("impossible")?;
        let of_draw = campaign.scenarios.len() * campaign.gains.len();
        let chunks = impossible.chunks(of_draw.max(1)).enumerate();
        let draws: Vec<usize> =
            chunks.filter(|(_, rows)| !rows.contains(&true)).map(|(draw, _)| draw).collect();
        let columns = Columns {
            campaign,
            table,
            lost: table.flag("lost")?,
            ended: table.text("ended")?,
            lost_by: table.text("lost_by")?,
            fault: table.text("fault")?,
            draws,
        };
        let all = 0..campaign.gains.len();
        let pairs = all.clone().flat_map(|k| (k + 1..campaign.gains.len()).map(move |other| [k, other]));
        let pairs: Vec<[usize; 2]> = pairs.collect();
        let name = |k: usize| campaign.gains[k].name.clone();
        let with_name = |k: usize| (name(k), columns.drivers(k));
        Some(Self {
            campaign: campaign.name.clone(),
            seed: campaign.seed,
            cases: plan.cases(),
            draws: campaign.draws,
            impossible: campaign.draws - columns.draws.len() as u64,
            truncations: plan.truncations(),
            rates: all.clone().flat_map(|k| columns.rates(k)).collect(),
            pairs: pairs.iter().map(|pair| columns.pair(*pair, pairs.len())).collect(),
            faults: all.clone().flat_map(|k| columns.faults(k)).collect(),
            drivers: all.clone().map(with_name).filter(|(_, drivers)| !drivers.is_empty()).collect(),
            worst: all.map(|k| (name(k), columns.worst(k))).filter(|(_, worst)| !worst.is_empty()).collect(),
        })
    }
}

impl Columns<'_> {
    /// Row of a draw in a scenario under gains.
    fn row(&self, draw: usize, scenario: usize, gains: usize) -> usize {
        (draw * self.campaign.scenarios.len() + scenario) * self.campaign.gains.len() + gains
    }

    /// Rows of a draw in these scenarios.
    fn rows(&self, draw: usize, scenarios: &[usize], gains: usize) -> impl Iterator<Item = usize> {
        scenarios.iter().map(move |scenario| self.row(draw, *scenario, gains)).collect::<Vec<_>>().into_iter()
    }

    fn every_scenario(&self) -> Vec<usize> {
        (0..self.campaign.scenarios.len()).collect()
    }

    fn is_lost(&self, draw: usize, gains: usize) -> bool {
        self.rows(draw, &self.every_scenario(), gains).any(|row| self.lost[row])
    }

    /// In any scenario, and in each where there are several.
    fn rates(&self, gains: usize) -> Vec<Rate> {
        let every = self.every_scenario();
        let [only] = every[..] else {
            let each = every.iter().map(|scenario| self.rate(gains, &[*scenario]));
            return std::iter::once(self.rate(gains, &every)).chain(each).collect();
        };
        vec![self.rate(gains, &[only])]
    }

    fn rate(&self, gains: usize, scenarios: &[usize]) -> Rate {
        let (mut lost, mut aborted) = (0, 0);
        let mut flights = Vec::new();
        for draw in &self.draws {
            let rows: Vec<usize> = self.rows(*draw, scenarios, gains).collect();
            if rows.iter().any(|row| self.lost[*row]) {
                lost += 1;
            } else if rows.iter().any(|row| self.ended[*row] != FLYING) {
                aborted += 1;
            }
            flights.extend(rows);
        }
        let draws = self.draws.len() as u64;
        let interval = exact_interval(lost, draws);
        let (lost_flights, kept): (Vec<usize>, Vec<usize>) = flights.iter().partition(|row| self.lost[**row]);
        let requirements = self.table.text("requirements_hold").unwrap_or_default();
        let holds = kept.iter().filter(|row| requirements[**row] == "yes").count() as u64;
        // A craft that is lost keeps no requirement.
        let judged = flights.iter().filter(|row| !requirements[**row].is_empty()).count() as u64;
        let scenario = match scenarios {
            [only] => Some(self.campaign.scenarios[*only].clone()),
            _ => None,
        };
        Rate {
            gains: self.campaign.gains[gains].name.clone(),
            scenario,
            draws,
            lost,
            aborted,
            completed: draws - lost - aborted,
            lost_percent: 100.0 * lost as f64 / draws.max(1) as f64,
            lost_interval_percent: [100.0 * interval.low, 100.0 * interval.high],
            lost_by: counted(lost_flights.iter().map(|row| self.lost_by[*row].as_str())),
            judged,
            requirements_hold: holds,
            overshoot_percent: self.spread("overshoot_percent", &kept),
            tilt_deg: self.spread("tilt_deg", &kept),
            height_error_m: self.spread("height_error_m", &kept),
            events: self.events(&flights),
        }
    }

    fn events(&self, flights: &[usize]) -> BTreeMap<String, u64> {
        let seen = self.table.text("events").unwrap_or_default();
        counted(flights.iter().flat_map(|row| seen[*row].split(SEPARATOR)).filter(|event| !event.is_empty()))
    }

    /// Median and 95th percentile.
    fn spread(&self, name: &str, rows: &[usize]) -> Option<[f64; 2]> {
        let values = self.table.real(name)?;
        let mut known: Vec<f64> =
            rows.iter().map(|row| values[*row]).filter(|value| value.is_finite()).collect();
        known.sort_by(f64::total_cmp);
        let at = |share: f64| known[(share * (known.len() - 1) as f64).round() as usize];
        (!known.is_empty()).then(|| [at(0.5), at(0.95)])
    }

    fn pair(&self, [first, second]: [usize; 2], pairs: usize) -> Pair {
        let (mut only_first, mut only_second, mut both) = (0, 0, 0);
        for draw in &self.draws {
            match (self.is_lost(*draw, first), self.is_lost(*draw, second)) {
                (true, true) => both += 1,
                (true, false) => only_first += 1,
                (false, true) => only_second += 1,
                (false, false) => (),
            }
        }
        let [first, second] = [first, second].map(|gains| self.campaign.gains[gains].name.clone());
        let p_value = (mcnemar_p_value(only_first, only_second) * pairs as f64).min(1.0);
        let count = self.draws.len() as u64;
        let Interval { low, high } = paired_interval(only_first, only_second, count);
        let difference_percent = 100.0 * (only_first as f64 - only_second as f64) / (count as f64).max(1.0);
        let difference_interval_percent = [low, high].map(|end| 100.0 * end);
        Pair {
            first,
            second,
            only_first,
            only_second,
            both,
            p_value,
            difference_percent,
            difference_interval_percent,
        }
    }

    fn faults(&self, gains: usize) -> Vec<FaultRate> {
        let mut of: BTreeMap<&str, [u64; 2]> = BTreeMap::new();
        for draw in &self.draws {
            let [draws, lost] = of.entry(&self.fault[self.row(*draw, 0, gains)]).or_default();
            *draws += 1;
            *lost += u64::from(self.is_lost(*draw, gains));
        }
        let gains = &self.campaign.gains[gains].name;
        let one = |(fault, [draws, lost]): (&str, [u64; 2])| FaultRate {
            gains: gains.clone(),
            fault: fault.to_owned(),
            draws,
            lost,
        };
        // Where no draw has a fault there is nothing to compare.
        let any = of.keys().any(|fault| !fault.is_empty());
        of.into_iter().filter(|_| any).map(one).collect()
    }

    /// A draw counts as lost where any of its flights was.
    fn drivers(&self, gains: usize) -> Vec<Driver> {
        let lost: Vec<bool> = self.draws.iter().map(|draw| self.is_lost(*draw, gains)).collect();
        let rows: Vec<usize> = self.draws.iter().map(|draw| self.row(*draw, 0, gains)).collect();
        let mut inputs: Vec<(&str, Vec<f64>)> = Vec::new();
        for column in &self.table.columns {
            if let (Some(name), Some(values)) =
                (column.name.strip_prefix(INPUT), self.table.real(&column.name))
            {
                inputs.push((name, rows.iter().map(|row| values[*row]).collect()));
            }
        }
        let is_faulty = |row: &usize| f64::from(u8::from(!self.fault[*row].is_empty()));
        inputs.push(("fault", rows.iter().map(is_faulty).collect()));
        drivers(&inputs, &lost)
    }

    fn worst(&self, gains: usize) -> Vec<Worst> {
        let after = self.table.real("lost_after_s").unwrap_or_default();
        let every = self.every_scenario();
        let mut lost: Vec<(usize, usize)> = Vec::new();
        for draw in &self.draws {
            let of_draw = every.iter().map(|scenario| (self.row(*draw, *scenario, gains), *scenario));
            lost.extend(of_draw.filter(|(row, _)| self.lost[*row]));
        }
        lost.sort_by(|one, other| after[one.0].total_cmp(&after[other.0]));
        let told = |(row, scenario): (usize, usize)| Worst {
            case: row as u64,
            scenario: self.campaign.scenarios[scenario].clone(),
            lost_by: self.lost_by[row].clone(),
            after_s: after[row],
        };
        lost.into_iter().take(WORST).map(told).collect()
    }
}

fn counted<'a>(words: impl Iterator<Item = &'a str>) -> BTreeMap<String, u64> {
    let mut all = BTreeMap::new();
    words.for_each(|word| *all.entry(word.to_owned()).or_insert(0) += 1);
    all
}
