//! What a campaign says, as text and as a page.

use std::fmt::Write as _;

use campaign::{Driver, FaultRate, Found, Group, Pair, Plan, Rate, Summary, Truncation, Worst};
use report::number::p_value;
use report::{Axis, Figure, Mark, Page, Section, Series, Style, significant};

use crate::render::grid::{Grid, number, paragraph, text};

/// Reasons that are named for each gains.
const REASONS: usize = 5;
/// Drivers that are named for each gains.
const DRIVERS: usize = 6;
/// Drivers with a picture for each gains.
const PICTURES: usize = 3;
/// Chance below which a driver is named.
const SIGNIFICANT: f64 = 0.01;

/// For a terminal.
pub(crate) fn to_text(summary: &Summary, plan_file: &str) -> String {
    let mut all = paragraph(&conclusion(summary));
    for grid in grids(summary) {
        let _ = write!(all, "\n{}", grid.to_text());
    }
    for truncation in &summary.truncations {
        let _ = write!(all, "\n{}", paragraph(&truncated(truncation)));
    }
    if let Some(Worst { case, .. }) = summary.worst.values().flatten().next() {
        let _ = write!(
            all,
            "\nTo fly one again: quadlab campaign replay {plan_file} {case}\nTo see what lost it: quadlab campaign why {plan_file} {case}\n"
        );
    }
    all
}

/// For a browser.
pub(crate) fn page(summary: &Summary, plan: &Plan) -> Page {
    let section =
        grids(summary).iter().fold(Section::new("Outcome"), |section, grid| section.table(grid.to_table()));
    let page = Page::new(format!("Campaign: {}", summary.campaign), conclusion(summary)).section(section);
    let drivers = summary.drivers.iter().flat_map(|(gains, drivers)| {
        drivers
            .iter()
            .filter(|driver| driver.p_value < SIGNIFICANT)
            .take(PICTURES)
            .map(move |driver| (gains, driver))
    });
    let section = drivers.fold(Section::new("Where the craft is lost"), |section, (gains, driver)| {
        section.figure(
            lost_over(gains, driver),
            "Share of the draws lost, and its 95 % interval, in groups of about equal size.",
        )
    });
    page.section(section).section(conditions(plan))
}

/// That a normal distribution was truncated, as a sentence.
pub(crate) fn truncated(truncation: &Truncation) -> String {
    let Truncation { quantity, mean, deviation, ends, beyond_percent } = truncation;
    let [low, high] = ends.map(|end| significant(end, 3));
    format!(
        "{quantity}: {} % of the normal distribution with mean {mean} and deviation {deviation} lies outside {low} to {high}, which cannot be \
         simulated; values there are drawn again (truncated normal distribution).",
        significant(*beyond_percent, 2)
    )
}

/// What was flown, what was not known, and what counts as lost.
fn conditions(plan: &Plan) -> Section {
    let campaign = &plan.campaign;
    let mut grid = Grid::new("What was not known", [text("name"), text("range, or mean and deviation")]);
    let unknown = serde_json::to_value(&campaign.unknown).unwrap_or_default();
    for (name, spread) in unknown.as_object().into_iter().flatten() {
        let told = match (&spread["mean"], &spread["deviation"]) {
            (serde_json::Value::Null, _) => spread.to_string(),
            (mean, deviation) => format!("{mean} +- {deviation}"),
        };
        grid.push([name.clone(), told]);
    }
    let gains = campaign.gains.iter().map(|gains| gains.name.as_str()).collect::<Vec<_>>().join(", ");
    let model = campaign.model.as_ref().map_or("the thesis' craft", |model| model.name.as_str());
    let section = Section::new("Conditions")
        .paragraph(format!(
            "{} draws of seed {} of {model}, in {} under {gains}. A draw is lost if in any of its scenarios the craft hit the floor at more \
             than 1 m/s, left the cage, turned upside down, had its motors cut or disarmed in the air, or its state \
             was not finite.",
            campaign.draws,
            campaign.seed,
            campaign.scenarios.join(", ")
        ))
        .table(grid.to_table());
    plan.truncations().iter().fold(section, |section, truncation| section.paragraph(truncated(truncation)))
}

/// The share of the draws lost over one of the numbers that were drawn.
fn lost_over(gains: &str, driver: &Driver) -> Figure {
    let step = |of: fn(&Group) -> f64| {
        let ends = driver.groups.iter().flat_map(|group| group.range.map(|end| (end, of(group))));
        ends.collect::<Vec<_>>()
    };
    let title = format!("{gains}: losses over {}", driver.input);
    Figure::new(title, Axis::new(driver.input.as_str(), ""), Axis::new("draws lost", "%"))
        .with(Series::line("lost", Style::PredictedAfter, step(|group| group.lost_percent)))
        .with(Series::line("lower end", Style::Muted, step(|group| group.interval_percent[0])))
        .with(Series::line("upper end", Style::Muted, step(|group| group.interval_percent[1])))
}

/// "1 shard", "7 shards".
pub(crate) fn shards(count: u64) -> String {
    if count == 1 { "1 shard".into() } else { format!("{count} shards") }
}

/// The scenario of a rate, or any of them.
pub(crate) fn scenario_of(rate: &Rate) -> &str {
    rate.scenario.as_deref().unwrap_or("any scenario")
}

/// The rates over all scenarios, one for each gains.
fn overall(summary: &Summary) -> impl Iterator<Item = &Rate> {
    let several = summary.rates.iter().any(|rate| rate.scenario.is_none());
    summary.rates.iter().filter(move |rate| !several || rate.scenario.is_none())
}

/// The one thing to know.
fn conclusion(summary: &Summary) -> String {
    let rate = |rate: &Rate| {
        let [low, high] = rate.lost_interval_percent.map(|percent| significant(percent, 2));
        format!(
            "With {}, the craft was lost in {} of {} draws, {} % (95 % interval {low} to {high} %).",
            rate.gains,
            rate.lost,
            rate.draws,
            significant(rate.lost_percent, 2)
        )
    };
    let impossible = (summary.impossible > 0).then(|| {
        format!(
            "In {} further draws the craft cannot hover, whoever flies it: they are not counted.",
            summary.impossible
        )
    });
    let all = overall(summary).map(rate).chain(summary.pairs.iter().map(told));
    all.chain(impossible).collect::<Vec<_>>().join(" ")
}

fn told(pair: &Pair) -> String {
    let Pair { first, second, only_first, only_second, p_value: p, .. } = pair;
    let is_first_better = only_first < only_second;
    let (better, worse) = if is_first_better { (first, second) } else { (second, first) };
    let counts =
        format!("{only_first} draws were lost with {first} alone and {only_second} with {second} alone");
    let mut ends = pair.difference_interval_percent.map(|end| if is_first_better { -end } else { end });
    ends.sort_by(f64::total_cmp);
    let [low, high] = ends.map(|end| significant(end, 2));
    let difference = significant(pair.difference_percent.abs(), 2);
    let interval = format!(
        "{worse} loses {difference} percentage points more of the draws (95 % interval {low} to {high})"
    );
    if only_first == only_second {
        format!(
            "{first} and {second} lose equally many draws: {counts}; the difference is within {low} to {high} percentage points (95 %)."
        )
    } else if *p < SIGNIFICANT {
        format!("{better} is safer than {worse}: {counts} (p {}); {interval}.", p_value(*p))
    } else {
        format!(
            "No difference between {first} and {second} is shown at the 1 % level: {counts} (p {}); {interval}.",
            p_value(*p)
        )
    }
}

fn grids(summary: &Summary) -> Vec<Grid> {
    let all = [rates(summary), reasons(summary), drivers(summary), faults(summary), worst(summary)];
    all.into_iter().filter(Grid::has_rows).collect()
}

fn rates(summary: &Summary) -> Grid {
    let mut grid = Grid::new(
        "Draws by outcome, and the flights that were not lost (median, 95th percentile)",
        [
            text("gains"),
            text("scenario"),
            number("completed", ""),
            number("aborted", ""),
            number("lost", ""),
            number("lost", "%"),
            text("95 % interval"),
            text("requirements kept"),
            text("overshoot [%]"),
            text("tilt [deg]"),
            text("height rms [m]"),
        ],
    );
    let spread = |values: Option<[f64; 2]>| {
        values.map_or("-".into(), |[median, high]| {
            format!("{}, {}", significant(median, 2), significant(high, 2))
        })
    };
    for rate in &summary.rates {
        let [low, high] = rate.lost_interval_percent.map(|percent| significant(percent, 2));
        let kept = format!("{} of {}", rate.requirements_hold, rate.judged);
        // Flights of several scenarios are not of one kind.
        let is_one = rate.scenario.is_some();
        grid.push([
            rate.gains.clone(),
            scenario_of(rate).to_owned(),
            rate.completed.to_string(),
            rate.aborted.to_string(),
            rate.lost.to_string(),
            significant(rate.lost_percent, 2),
            format!("{low} to {high}"),
            if rate.judged > 0 { kept } else { "-".into() },
            spread(rate.overshoot_percent.filter(|_| is_one)),
            spread(rate.tilt_deg.filter(|_| is_one)),
            spread(rate.height_error_m.filter(|_| is_one)),
        ]);
    }
    grid
}

fn faults(summary: &Summary) -> Grid {
    let mut grid =
        Grid::new("Losses by fault", [text("gains"), text("fault"), number("draws", ""), number("lost", "")]);
    for FaultRate { gains, fault, draws, lost } in &summary.faults {
        let fault = if fault.is_empty() { "none" } else { fault };
        grid.push([gains.clone(), fault.to_owned(), draws.to_string(), lost.to_string()]);
    }
    grid
}

fn reasons(summary: &Summary) -> Grid {
    let mut grid = Grid::new("How it was lost", [text("gains"), number("flights", ""), text("reason")]);
    for rate in overall(summary) {
        let mut reasons: Vec<_> = rate.lost_by.iter().map(|(why, count)| (*count, why.as_str())).collect();
        reasons.sort_by(|one, other| other.0.cmp(&one.0).then(one.1.cmp(other.1)));
        let others: u64 = reasons.iter().skip(REASONS).map(|(count, _)| count).sum();
        reasons.truncate(REASONS);
        reasons.extend((others > 0).then_some((others, "other reasons")));
        for (count, why) in reasons {
            grid.push([rate.gains.clone(), count.to_string(), why.to_owned()]);
        }
    }
    grid
}

fn drivers(summary: &Summary) -> Grid {
    let mut grid = Grid::new(
        "What drives the losses (p < 0.01): share of the variance, where most draws are lost, odds per standard deviation",
        [
            text("gains"),
            text("drawn"),
            number("variance", "%"),
            number("p", ""),
            text("worst range"),
            number("lost there", "%"),
            text("odds ratio"),
        ],
    );
    for (gains, drivers) in &summary.drivers {
        if drivers.iter().all(|driver| driver.p_value >= SIGNIFICANT) {
            let none = ["-"; 5].map(str::to_owned);
            grid.push([gains.clone(), "no influence shown".to_owned()].into_iter().chain(none));
        }
        for driver in drivers.iter().filter(|driver| driver.p_value < SIGNIFICANT).take(DRIVERS) {
            let [low, high] = driver.worst_range.map(|value| significant(value, 3));
            let odds = driver.odds_ratio.zip(driver.odds_interval).map(|(ratio, [low, high])| {
                format!("{} ({} to {})", significant(ratio, 2), significant(low, 2), significant(high, 2))
            });
            grid.push([
                gains.clone(),
                driver.input.clone(),
                significant(driver.variance_percent, 2),
                p_value(driver.p_value),
                format!("{low} to {high}"),
                significant(driver.worst_percent, 2),
                odds.unwrap_or_else(|| "-".into()),
            ]);
        }
    }
    grid
}

fn worst(summary: &Summary) -> Grid {
    let mut grid = Grid::new(
        "Earliest losses",
        [text("gains"), number("case", ""), text("scenario"), number("after", "s"), text("reason")],
    );
    for (gains, worst) in &summary.worst {
        for one in worst {
            grid.push([
                gains.clone(),
                one.case.to_string(),
                one.scenario.clone(),
                significant(one.after_s, 3),
                one.lost_by.clone(),
            ]);
        }
    }
    grid
}

/// What a search found.
pub(crate) fn search_page(found: &Found, sentence: &str) -> Page {
    let points =
        |all: &[f64]| all.iter().enumerate().map(|(k, worst)| ((k + 1) as f64, -worst)).collect::<Vec<_>>();
    let figure = Figure::new("The worst flight so far", Axis::new("flights", ""), Axis::new("how bad", ""))
        .with(Series::line("search", Style::PredictedAfter, points(&found.searched)))
        .with(Series::line("drawn", Style::Measured, points(&found.sampled)))
        .mark(Mark::limit("lost", 1.0));
    let mut worst = Grid::new(
        "The worst flight",
        [text("name"), number("value", ""), number("nominal", ""), text("needed")],
    );
    for one in &found.worst {
        let needed = found.needs(&one.name).map_or("-", |needed| if needed { "yes" } else { "no" });
        worst.push([
            one.name.clone(),
            significant(one.value, 4),
            significant(one.usual, 4),
            needed.to_owned(),
        ]);
    }
    let caption = "From 1 up the craft is lost, the higher the earlier. Below 1: half of the greatest tilt over 90 deg plus half of the \
                   height error in m.";
    let section = Section::new("Search").figure(figure, caption).table(worst.to_table());
    Page::new(format!("The worst of {} under {}", found.scenario, found.gains), sentence).section(section)
}

/// A case that was flown again, with its page.
pub(crate) fn case_page(plan: &Plan, flight: &campaign::CaseFlight, sentence: &str) -> Page {
    let case = flight.flown.case;
    let mut drawn = Grid::new("What was drawn", [text("name"), number("value", "")]);
    for input in &flight.flown.drawn.inputs {
        drawn.push([input.name.clone(), significant(input.value, 4)]);
    }
    let scenario = &plan.campaign.scenarios[case.scenario];
    let gains = &plan.campaign.gains[case.gains].name;
    let heading = format!("{scenario} under {gains}");
    Page::new(format!("Case {} of {}", case.number, plan.campaign.name), sentence)
        .section(sil::page::flight(heading, &flight.plan, &flight.recording))
        .section(Section::new("Conditions").table(drawn.to_table()))
}
