//! Pictures of a fleet: its flights over time, and what moved from flight to flight.

use fleet::{Answered, CraftAnswer, CraftHistory, Kind, Series as History};
use report::{Axis, Figure, Mark, Series, Style};

/// Pictures of each craft.
const PICTURES: usize = 8;
/// Seconds of a day.
const DAY_S: f64 = 86400.0;

/// All flights over time, a line for each craft.
pub(crate) fn timeline(answered: &Answered<'_>) -> Figure {
    let all = answered.histories.iter().flat_map(|history| &history.flights);
    let first_s = all.map(|flight| flight.when.unix_s).fold(f64::INFINITY, f64::min);
    let days = |unix_s: f64| (unix_s - first_s) / DAY_S;
    let label = match first_s.is_finite() {
        true => format!("days since {}", fleet::day_and_time(first_s)),
        false => "days".into(),
    };
    let mut figure = Figure::new("Flights", Axis::new(label, "d"), Axis::new("craft, from the first on", ""));
    for (place, (history, craft)) in answered.histories.iter().zip(&answered.answer.crafts).enumerate() {
        let points: Vec<(f64, f64)> =
            history.flights.iter().map(|flight| (days(flight.when.unix_s), (place + 1) as f64)).collect();
        figure = figure.with(Series::points(craft.craft.clone(), Style::Category(place), points));
        let changes: Vec<(f64, f64)> = craft
            .changes
            .iter()
            .map(|event| (days(history.flights[event.at].when.unix_s), (place + 1) as f64))
            .collect();
        if !changes.is_empty() {
            figure = figure.with(Series::points("", Style::PredictedBefore, changes));
        }
    }
    figure
}

/// What moved of a craft, over its flights; a coefficient where nothing did.
pub(crate) fn histories(craft: &CraftAnswer, history: &CraftHistory<'_>) -> Vec<Figure> {
    let moved = craft.changes.iter().flat_map(|event| &event.moved).map(|moved| moved.series.as_str());
    let mut shown: Vec<&History> = Vec::new();
    for name in moved {
        let own = history.series.iter().find(|series| series.name == name);
        if let Some(own) = own.filter(|own| shown.iter().all(|known| known.name != own.name)) {
            shown.push(own);
        }
    }
    if shown.is_empty() {
        shown.extend(history.series.iter().filter(|series| series.kind == Kind::Coefficient).take(1));
    }
    shown.into_iter().take(PICTURES).map(|series| over_flights(series, craft)).collect()
}

/// A series over the flights, with what changed.
fn over_flights(series: &History, craft: &CraftAnswer) -> Figure {
    let flight = |k: usize| (series.at[k] + 1) as f64;
    let points: Vec<(f64, f64)> =
        series.values.iter().enumerate().map(|(k, own)| (flight(k), own.value)).collect();
    let errors: Vec<(f64, f64)> = series
        .values
        .iter()
        .enumerate()
        .filter(|(_, own)| own.std_error > 0.0)
        .flat_map(|(k, own)| {
            let half = 1.96 * own.std_error;
            [(flight(k), own.value - half), (flight(k), own.value + half), (f64::NAN, f64::NAN)]
        })
        .collect();
    let axis = Axis::new("flight, in the order flown", "");
    let mut figure =
        Figure::new(series.name.clone(), axis, Axis::new(series.name.clone(), series.unit.clone()));
    if !errors.is_empty() {
        figure = figure.with(Series::line("95 % interval", Style::Muted, errors));
    }
    figure = figure.with(Series::points("flight", Style::PredictedAfter, points));
    for event in &craft.changes {
        figure = figure.mark(Mark::event(event.from.date.clone(), event.at as f64 + 0.5));
    }
    figure.with(Series::line("mean between changes", Style::Reference, means(series, craft)))
}

/// The mean between each two changes.
fn means(series: &History, craft: &CraftAnswer) -> Vec<(f64, f64)> {
    let ends = craft.changes.iter().map(|event| event.at).chain([usize::MAX]);
    let (mut points, mut from) = (Vec::new(), 0);
    for end in ends {
        let inside: Vec<usize> =
            (0..series.at.len()).filter(|k| (from..end).contains(&series.at[*k])).collect();
        let values: Vec<_> = inside.iter().map(|k| series.values[*k]).collect();
        if let (Some(mean), Some(first), Some(last)) = (fleet::mean(&values), inside.first(), inside.last()) {
            let place = |k: usize| (series.at[k] + 1) as f64;
            points.extend([
                (place(*first) - 0.4, mean.value),
                (place(*last) + 0.4, mean.value),
                (f64::NAN, f64::NAN),
            ]);
        }
        from = end;
    }
    points
}
