//! What a fleet's flights say, as text and as a page.

use std::fmt::Write as _;

use fleet::{
    Answer, Answered, BatteryDifference, CraftAnswer, CraftDifference, CraftHistory, Event, Explanation,
    Moment, Size,
};
use report::number::{p_value, with_error};
use report::{Page, Section, significant};
use sysid::Severity;

use crate::render::counted;
use crate::render::fleet_figures::{histories, timeline};
use crate::render::grid::{Grid, number, paragraph, text};

/// Rows of a table that are shown; the tables of `--out` have all.
const ROWS: usize = 25;
/// Seconds of a minute.
const MINUTE_S: f64 = 60.0;

/// For a terminal.
pub(crate) fn to_text(answered: &Answered<'_>) -> String {
    let answer = &answered.answer;
    let mut all = paragraph(&conclusion(answer));
    for grid in grids(answer) {
        let _ = write!(all, "\n{}", grid.to_text());
    }
    all
}

/// What the user should know of before anything else.
pub(crate) fn warnings(answer: &Answer) -> Vec<String> {
    let mut all = Vec::new();
    if let Some(first) = answer.gone.first() {
        let count = answer.gone.len();
        all.push(format!(
            "{}: gone{}; what was kept of {} still counts (--forget drops it)",
            first,
            more(count),
            if count == 1 { "it" } else { "them" }
        ));
    }
    all.extend(answer.unclaimed.iter().map(|folder| {
        format!("{folder}: has flights and no vehicle.toml, so it is not looked at (quadlab init makes one from logs)")
    }));
    all.extend(answer.unmatched.iter().cloned());
    all.extend(answer.crafts.iter().filter_map(|craft| {
        let why = craft.no_model.as_ref()?;
        Some(format!("{}: no model, so only its loggers are looked at: {why}", craft.craft))
    }));
    all
}

fn more(count: usize) -> String {
    if count > 1 { format!(" (and {} more files)", count - 1) } else { String::new() }
}

/// For a browser.
pub(crate) fn page(answered: &Answered<'_>) -> Page {
    let answer = &answered.answer;
    let summary =
        grids(answer).iter().fold(Section::new("Summary"), |section, grid| section.table(grid.to_table()));
    let mut page = Page::new("Fleet", conclusion(answer)).section(summary);
    page = page.section(
        Section::new("Flights").figure(timeline(answered), "Each flight at its date; changes are marked."),
    );
    for (craft, history) in answer.crafts.iter().zip(&answered.histories) {
        page = page.section(of_craft(craft, history));
    }
    page
}

/// The one thing to know.
fn conclusion(answer: &Answer) -> String {
    let flights: usize = answer.crafts.iter().map(|craft| craft.flights).sum();
    let hours = answer.crafts.iter().map(|craft| craft.airborne_s).sum::<f64>() / 3600.0;
    let mut all = vec![format!(
        "{} of {} craft, {} h in the air; {} read now.",
        counted(flights, "flight"),
        answer.crafts.len(),
        significant(hours, 2),
        counted(answer.read_now, "file")
    )];
    all.extend(answer.crafts.iter().flat_map(|craft| craft.changes.iter().map(|event| told(craft, event))));
    let steady = answer.crafts.iter().filter(|craft| craft.changes.is_empty() && craft.flights > 0).count();
    if steady > 0 {
        let of = if steady == answer.crafts.len() { String::new() } else { format!(" in {steady} craft") };
        all.push(format!("No change is shown{of}."));
    }
    all.join(" ")
}

/// A change as a sentence.
fn told(craft: &CraftAnswer, event: &Event) -> String {
    let Some(moved) = event.moved.first() else { return String::new() };
    let way = if moved.drifts { "drifts about" } else { "changed with" };
    format!(
        "{} {way} flight {} ({}): {}.",
        craft.craft,
        event.from.flight,
        dated(&event.from),
        explained(event)
    )
}

/// "2026-03-04 15:30 by its name".
fn dated(moment: &Moment) -> String {
    let by = match moment.date_from {
        fleet::WhenFrom::Settings => "by fleet.toml",
        fleet::WhenFrom::Log => "by its log",
        fleet::WhenFrom::Name => "by its name",
        fleet::WhenFrom::File => "when the file was last changed",
    };
    format!("{} {by}", moment.date)
}

/// What explains a change: the logs' own answer with its size, else what is kept of the flights says.
fn explained(event: &Event) -> String {
    if event.causes_disagree {
        return format!(
            "the cause cannot be told: the flights' records point to {}, diagnose --changed says {}; look at what was done to the craft then",
            event.explanations.first().map_or_else(|| "no known change".into(), named),
            in_logs(event).unwrap_or_default()
        );
    }
    let logs = event.in_logs.as_ref();
    match logs.filter(|logs| logs.effect.is_some()) {
        // Its size is that of a fit without linearisation.
        Some(logs) => {
            let name = in_logs(event).unwrap_or_default();
            let mut others: Vec<String> = event.best_explanations().map(named).collect();
            others.extend(logs.confounded_with.iter().cloned());
            let sizes = sizes(&logs.coefficients);
            format!("{name}{sizes}{}; diagnose --changed says so too", besides(&name, others))
        }
        None => {
            let mut explanations = event.best_explanations();
            let kept = explanations.next().map_or_else(
                || "no known change explains it".into(),
                |best| {
                    let (name, sizes) = (named(best), sizes(&best.coefficients));
                    let others = besides(&name, explanations.map(named).collect());
                    format!("{name}{sizes}, to first order{others}")
                },
            );
            match logs {
                Some(logs) if logs.is_answer() => format!("{kept}; diagnose --changed says {}", logs.verdict),
                Some(logs) => format!("{kept}; the logs were not asked: {}", logs.summary),
                None => kept,
            }
        }
    }
}

/// What the logs say, where they were asked.
fn in_logs(event: &Event) -> Option<String> {
    let logs = event.in_logs.as_ref().filter(|logs| logs.is_answer())?;
    let effect = logs.effect.as_ref().unwrap_or(&logs.verdict);
    Some(format!("{effect}{}", of_motor(logs.motor)))
}

/// The cause of a change in a word or two.
fn cause(event: &Event) -> String {
    if event.causes_disagree {
        return "cannot be told".into();
    }
    let of_logs = event.in_logs.as_ref().is_some_and(|logs| logs.effect.is_some());
    let kept = || event.explanations.first().map_or("no known change".into(), named);
    in_logs(event).filter(|_| of_logs).unwrap_or_else(kept)
}

/// Other causes than `name` that explain a change as well.
fn besides(name: &str, mut others: Vec<String>) -> String {
    let mut seen = vec![name.to_owned()];
    others.retain(|other| {
        let is_new = !seen.contains(other);
        seen.push(other.clone());
        is_new
    });
    match others.is_empty() {
        true => String::new(),
        false => format!(" (or {}: these flights do not tell them apart)", others.join(", ")),
    }
}

fn named(own: &Explanation) -> String {
    format!("{}{}", own.effect, of_motor(own.motor))
}

fn of_motor(motor: Option<u8>) -> String {
    motor.map(|motor| format!(" of motor {motor}")).unwrap_or_default()
}

/// ", extra_mass by 0.1000 ± 0.0005 kg".
fn sizes(all: &[Size]) -> String {
    let told =
        |size: &Size| format!(", {} by {}", size.name, with_error(size.value, size.std_error, &size.unit));
    all.iter().map(told).collect()
}

fn grids(answer: &Answer) -> Vec<Grid> {
    let all = [
        crafts(answer),
        changes(answer),
        shares(answer),
        odd(answer),
        not_identified(answer),
        coefficients(answer),
        axes(answer),
        against_each_other(answer),
        batteries(answer),
        faults(answer),
        unused(answer),
    ];
    all.into_iter().filter(Grid::has_rows).collect()
}

fn crafts(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "Craft",
        [
            text("craft"),
            number("flights", ""),
            number("in the air", "min"),
            text("first"),
            text("last"),
            number("changes", ""),
            number("stand out", ""),
            number("not used", ""),
        ],
    );
    for craft in &answer.crafts {
        let date = |place: usize| craft.span.as_ref().map_or("-".into(), |span| span[place].date.clone());
        grid.push([
            craft.craft.clone(),
            craft.flights.to_string(),
            significant(craft.airborne_s / MINUTE_S, 3),
            date(0),
            date(1),
            craft.changes.len().to_string(),
            craft.odd_flights.len().to_string(),
            craft.unused.len().to_string(),
        ]);
    }
    grid
}

fn changes(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "Changes: what moved most certainly (p: chance of as large a step anywhere in the fleet), and what explains it",
        [
            text("craft"),
            text("from flight"),
            text("what moved"),
            text("before"),
            text("after"),
            number("p", ""),
            text("explained by"),
        ],
    );
    for (craft, event) in events(answer).take(ROWS) {
        let Some(moved) = event.moved.first() else { continue };
        grid.push([
            craft.craft.clone(),
            event.from.flight.clone(),
            format!("{}{}", moved.series, if moved.drifts { " (drifts)" } else { "" }),
            with_error(moved.before.value, moved.before.std_error, &moved.unit),
            with_error(moved.after.value, moved.after.std_error, &moved.unit),
            p_value(moved.p_value),
            cause(event),
        ]);
    }
    grid
}

fn events(answer: &Answer) -> impl Iterator<Item = (&CraftAnswer, &Event)> {
    answer.crafts.iter().flat_map(|craft| craft.changes.iter().map(move |event| (craft, event)))
}

fn shares(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "The plainest statistic beside them: share of each motor in the mean command, before and after (p of Student's t)",
        [
            text("craft"),
            text("from flight"),
            text("motor 1"),
            text("motor 2"),
            text("motor 3"),
            text("motor 4"),
        ],
    );
    for (craft, event) in events(answer).take(ROWS) {
        let shares = &event.motor_shares;
        let of = |motor: usize| {
            let [before, after] = [shares.before, shares.after].map(|all| significant(all[motor], 4));
            format!("{before} to {after} (p {})", p_value(shares.p_value[motor]))
        };
        grid.push([craft.craft.clone(), event.from.flight.clone(), of(0), of(1), of(2), of(3)]);
    }
    grid
}

fn odd(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "Single flights that stand out",
        [text("flight"), text("date"), text("what"), text("value"), text("others"), number("p", "")],
    );
    let all = answer.crafts.iter().flat_map(|craft| &craft.odd_flights);
    for own in all.take(ROWS) {
        grid.push([
            own.flight.flight.clone(),
            own.flight.date.clone(),
            own.series.clone(),
            format!("{} {}", significant(own.value, 4), report::number::unit(&own.unit)),
            with_error(own.others.value, own.others.std_error, &own.unit),
            p_value(own.p_value),
        ]);
    }
    grid
}

fn not_identified(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "Not identified: coefficients of these axes are not listed and not compared",
        [text("craft"), text("axes"), text("why"), text("to determine it")],
    );
    for craft in &answer.crafts {
        for own in &craft.not_identified {
            let of_group = || own.group.axes().map(|axis| axis.name()).collect::<Vec<_>>().join(" ");
            let axes = own.axis.map_or_else(of_group, |axis| axis.name().to_owned());
            grid.push([craft.craft.clone(), axes, own.reason.clone(), own.fly.clone()]);
        }
    }
    grid
}

fn coefficients(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "Coefficients since the last change: of the flights together, and of the flights one by one with their scatter",
        [
            text("craft"),
            text("effect"),
            text("coefficient"),
            text("together"),
            text("one by one"),
            text("scatter"),
        ],
    );
    for craft in &answer.crafts {
        for own in &craft.coefficients {
            let all = own.value.zip(own.std_error);
            grid.push([
                craft.craft.clone(),
                own.effect.to_string(),
                own.name.clone(),
                all.map_or("not determined".into(), |(value, error)| with_error(value, error, &own.unit)),
                own.now.map_or("-".into(), |now| with_error(now.value, now.std_error, &own.unit)),
                own.now.map_or("-".into(), |now| significant(now.between, 2)),
            ]);
        }
    }
    grid
}

fn axes(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "What is left of each axis (root mean square; m/s^2 of u v w, rad/s^2 of p q r)",
        [
            text("craft"),
            text("axis"),
            number("fitted", ""),
            number("each flight by the others", ""),
            number("the same with the reference's effects", ""),
        ],
    );
    for craft in &answer.crafts {
        let Some(axes) = &craft.axes else { continue };
        for axis in model::AXES {
            let own = axes[axis];
            if own.rms.is_finite() {
                let all = [own.rms, own.held_out_rms, own.held_out_rms_of_reference];
                let [a, b, c] = all.map(|rms| significant(rms, 3));
                grid.push([craft.craft.clone(), axis.name().to_owned(), a, b, c]);
            }
        }
    }
    grid
}

fn against_each_other(answer: &Answer) -> Grid {
    let found = &answer.craft_against_craft;
    let mut grid = Grid::new(
        format!("Craft that differ by more than their flights do (of {} comparisons)", found.compared),
        [
            text("craft"),
            text("against"),
            text("coefficient"),
            text("first"),
            text("second"),
            number("p", ""),
            text("vehicle files"),
        ],
    );
    for own in found.differences.iter().take(ROWS) {
        let CraftDifference { crafts: [first, second], means, unit, vehicle_files_differ, .. } = own;
        let [a, b] = means.map(|mean| with_error(mean.value, mean.std_error, unit));
        let files = if *vehicle_files_differ { "differ" } else { "the same" };
        let p = p_value(own.p_value);
        grid.push([first.clone(), second.clone(), own.coefficient.clone(), a, b, p, files.into()]);
    }
    grid
}

fn batteries(answer: &Answer) -> Grid {
    let found = &answer.battery_against_battery;
    let mut grid = Grid::new(
        format!(
            "Batteries that differ from the others on the same craft (of {} comparisons)",
            found.compared
        ),
        [
            text("battery"),
            text("what"),
            number("flights", ""),
            number("without", ""),
            text("difference"),
            number("p", ""),
        ],
    );
    for own in found.differences.iter().take(ROWS) {
        let BatteryDifference { battery, series, unit, flights: [with, without], .. } = own;
        grid.push([
            battery.clone(),
            series.clone(),
            with.to_string(),
            without.to_string(),
            with_error(own.difference, own.std_error, unit),
            p_value(own.p_value),
        ]);
    }
    grid
}

fn faults(answer: &Answer) -> Grid {
    let mut grid = Grid::new(
        "What the checks of the logs found",
        [
            text("craft"),
            text("fault"),
            number("flights", ""),
            number("of", ""),
            text("first"),
            text("last"),
            text("in the last one"),
        ],
    );
    for craft in &answer.crafts {
        for own in craft.faults.iter().filter(|own| own.severity != Severity::Note) {
            let [flights, of] = own.flights.map(|count| count.to_string());
            let [first, last] = own.span.each_ref().map(|moment| moment.flight.clone());
            let sentence = own.sentence.clone();
            grid.push([craft.craft.clone(), own.kind.clone(), flights, of, first, last, sentence]);
        }
    }
    grid
}

fn unused(answer: &Answer) -> Grid {
    let mut grid = Grid::new("Not used", [text("file"), text("why")]);
    let all: Vec<_> = answer.crafts.iter().flat_map(|craft| &craft.unused).collect();
    for own in all.iter().take(ROWS) {
        grid.push([own.file.clone(), own.why.clone()]);
    }
    if all.len() > ROWS {
        grid.push([format!("and {} more", all.len() - ROWS), String::new()]);
    }
    grid
}

fn of_craft(craft: &CraftAnswer, history: &CraftHistory<'_>) -> Section {
    let section = Section::new(craft.craft.clone());
    let section = craft.changes.iter().fold(section, |section, event| section.paragraph(told(craft, event)));
    histories(craft, history).into_iter().fold(section, |section, figure| {
        let caption =
            "Each flight by itself, with the 95 % interval of its noise; means before and after each change.";
        section.figure(figure, caption)
    })
}
