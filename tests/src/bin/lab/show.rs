//! The counts as text and as a page.

use std::fmt::Write as _;

use report::{Cell, Column, Page, Provenance, Section, Table, Verdict};
use stories::world::Size;

use crate::judge::{Class, ConditionScore};
use crate::plan::{Hidden, Plan, Trial};
use crate::score::{Coverage, Failure, Far, Scores, Share};
use crate::trial::Distance;

/// A coefficient whose intervals hold the truth less often than this is shown in the text, percent.
const POOR_COVERAGE_PERCENT: f64 = 85.0;
/// Wrong answers listed in the text; the page and lab.json have all.
const MOST_FAILURES: usize = 40;

pub(crate) fn text(scores: &Scores) -> String {
    let mut text = String::new();
    let _ = writeln!(text, "{}\n", lead(scores));
    effects(&mut text, scores);
    confusion(&mut text, scores);
    conditions(&mut text, scores);
    coverage(&mut text, scores);
    far(&mut text, scores);
    failures(&mut text, scores);
    text
}

fn lead(scores: &Scores) -> String {
    let share = |share: Share| format!("{share} ({:.0} %)", share.percent());
    let mut parts = Vec::new();
    let mut say = |what: &str, s: Share| {
        if s.of > 0 {
            parts.push(format!("{what} {}", share(s)));
        }
    };
    say("hidden effect named first:", scores.named);
    say("nothing hidden and nothing found:", scores.nothing_right);
    say("change named:", scores.changes_right);
    say("nothing changed and nothing found:", scores.unchanged_right);
    say("both of a pair and nothing else:", scores.pairs_right);
    say("both of a pair among those found:", scores.pairs_both);
    say("all of three and nothing else:", scores.triples_right);
    say("all of three among those found:", scores.triples_all);
    say("one known beside one unknown, named alone and something left:", scores.beside_right);
    say("one known beside one unknown, named:", scores.beside_found);
    say("one known beside one unknown, and something else named:", scores.beside_misnamed);
    say("outside the catalogue and unexplained:", scores.outside_unexplained);
    say("outside the catalogue and misnamed:", scores.outside_misnamed);
    say("coefficients within their 95 % interval:", scores.covered);
    format!("{} trials; {}", scores.trials, parts.join("; "))
}

fn headings(scores: &Scores) -> Vec<String> {
    let strengths = scores.strengths.iter().map(|s| format!("strength {s}"));
    let noises = scores.noises.iter().map(|n| format!("noise {n}"));
    let sizes = Size::ALL.iter().map(|size| size.name().to_owned());
    strengths.chain(noises).chain(sizes).chain(["all".into(), "clean".into()]).collect()
}

fn effects(text: &mut String, scores: &Scores) {
    if scores.effects.is_empty() {
        return;
    }
    let _ = writeln!(text, "Named first, of all trials that hide it (clean: and nothing else after it)");
    let _ = write!(text, "{:<36}", "effect");
    for heading in headings(scores) {
        let _ = write!(text, "{:>13}", heading);
    }
    text.push('\n');
    for effect in &scores.effects {
        let _ = write!(text, "{:<36}", effect.effect);
        let shares = effect.by_strength.iter().chain(&effect.by_noise).chain(&effect.by_size);
        for share in shares.chain([&effect.all, &effect.clean]) {
            let _ = write!(text, "{share:>13}");
        }
        text.push('\n');
    }
    if !scores.without_world.is_empty() {
        let _ = writeln!(text, "not hidden by any world: {}", scores.without_world.join(", "));
    }
    text.push('\n');
}

fn confusion(text: &mut String, scores: &Scores) {
    if scores.confusion.is_empty() {
        return;
    }
    let _ = writeln!(text, "Hidden -> first answer");
    for (hidden, answers) in &scores.confusion {
        let mut sorted: Vec<_> = answers.iter().collect();
        sorted.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
        let answers: Vec<String> = sorted.into_iter().map(|(answer, n)| format!("{n} {answer}")).collect();
        let _ = writeln!(text, "{hidden:<36}{}", answers.join(", "));
    }
    text.push('\n');
}

fn conditions(text: &mut String, scores: &Scores) {
    if scores.conditions.is_empty() {
        return;
    }
    let _ = writeln!(text, "Difficult flights and logs: first answers");
    let _ = write!(text, "{:<28}{:>8}", "condition", "trials");
    for class in Class::ALL {
        let _ = write!(text, "{:>14}", class.name());
    }
    let _ = writeln!(text, "   which names and refusals");
    for score in &scores.conditions {
        let _ = write!(text, "{:<28}{:>8}", score.condition, score.trials);
        for class in Class::ALL {
            let _ = write!(text, "{:>14}", score.of(class));
        }
        let _ = writeln!(text, "   {}", wrong_answers(score));
    }
    text.push('\n');
}

/// What was answered that is wrong, the most frequent first.
fn wrong_answers(score: &ConditionScore) -> String {
    let mut sorted: Vec<_> = score.wrong_answers.iter().collect();
    sorted.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
    sorted.into_iter().map(|(answer, n)| format!("{n} {answer}")).collect::<Vec<_>>().join(", ")
}

fn coverage(text: &mut String, scores: &Scores) {
    let poor: Vec<&Coverage> =
        scores.coverage.iter().filter(|c| c.inside.percent() < POOR_COVERAGE_PERCENT).collect();
    if poor.is_empty() {
        return;
    }
    let _ = writeln!(
        text,
        "Coefficients whose 95 % interval holds the truth in less than {POOR_COVERAGE_PERCENT} % of the trials"
    );
    let _ = writeln!(
        text,
        "{:<24}{:<16}{:<8}{:>10}{:>13}{:>13}{:>10}",
        "effect", "coefficient", "craft", "inside", "mean/error", "rms/error", "bias %"
    );
    for c in poor {
        let _ = writeln!(
            text,
            "{:<24}{:<16}{:<8}{:>10}{:>13.2}{:>13.2}{:>10.2}",
            c.effect, c.coefficient, c.size, c.inside, c.mean_errors, c.rms_errors, c.bias_percent
        );
    }
    text.push('\n');
}

fn far(text: &mut String, scores: &Scores) {
    if scores.far.is_empty() {
        return;
    }
    let _ =
        writeln!(text, "Far from the truth: the worst coefficient of a trial ({} trials)", scores.far.len());
    for far in scores.far.iter().take(MOST_FAILURES / 2) {
        let _ = writeln!(text, "  {}", far_sentence(far));
    }
    text.push('\n');
}

fn far_sentence(far: &Far) -> String {
    let Distance { effect, coefficient, value, truth, errors } = far.distance;
    format!(
        "{}: {effect} {coefficient} is {value:.5}, true {truth:.5}, {errors:.1} standard errors off",
        named(&far.trial)
    )
}

/// What it takes to see a trial again.
fn named(trial: &Trial) -> String {
    format!(
        "{} (strength {}, noise {}, {}, {}, {:?}, seed {})",
        trial.label(),
        trial.strength,
        trial.noise,
        trial.size.name(),
        match (trial.rough, trial.outliers) {
            (false, false) => "clean log",
            (true, false) => "rough log",
            (false, true) => "log with outliers",
            (true, true) => "rough log with outliers",
        },
        trial.style,
        trial.seed
    )
}

fn failures(text: &mut String, scores: &Scores) {
    if scores.failures.is_empty() {
        return;
    }
    let _ = writeln!(text, "Wrong answers ({})", scores.failures.len());
    for failure in scores.failures.iter().take(MOST_FAILURES) {
        let _ = writeln!(text, "  {}", sentence(failure));
    }
    if scores.failures.len() > MOST_FAILURES {
        let _ = writeln!(text, "  ... lab.json has all");
    }
}

fn sentence(failure: &Failure) -> String {
    let trial = &failure.trial;
    let found = match trial.hidden {
        Hidden::Together(_) | Hidden::Beside(_) => format!("found {}", listed(&failure.found)),
        _ => failure.answer.clone(),
    };
    let mut text = format!("{}: {found}", named(trial));
    for planted in failure.planted.iter().filter(|p| !p.supported) {
        let _ = write!(text, "; {} is number {}, {}", planted.effect, planted.rank, planted.reason);
    }
    if !failure.confounded_with.is_empty() {
        let _ = write!(text, "; confounded with {}", failure.confounded_with.join(", "));
    }
    if let Some(first) = failure.unexplained.first() {
        let _ = write!(text, "; left: {first}");
    }
    text
}

fn listed(ids: &[&str]) -> String {
    if ids.is_empty() { "nothing".into() } else { ids.join(", then ") }
}

pub(crate) fn page(plan: &Plan, scores: &Scores) -> Page {
    let how = format!(
        "Five flights of {} s each, three to fit on and two to judge by, of worlds that share no equation with the \
         product's plant: a craft like the F330 and a small one, parameters drawn anew in every trial. {} repetitions \
         from seed {}.",
        plan.duration_s, plan.seeds, plan.first_seed
    );
    Page::new("How often is the laboratory right?", lead(scores))
        .section(
            Section::new("Named first").paragraph(how).paragraph(
                "A hidden effect counts as named when it is ranked first and supported. Clean: it was found, and nothing \
                 else after it joined the model.",
            )
            .table(effects_table(scores)),
        )
        .section(Section::new("Confusion").table(confusion_table(scores)))
        .section(
            Section::new("Difficult flights and logs")
                .paragraph(
                    "Half of the trials of a condition hide nothing, half an effect that can still be seen. Right: that \
                     effect is named first, or the model is called adequate with nothing hidden; where the condition is an \
                     effect itself, that may come first if what is hidden follows. Honest: not identified, or a refusal \
                     that names the difficulty. Missed: something is hidden and \
                     nothing is named, or only the condition itself.",
                )
                .table(conditions_table(scores)),
        )
        .section(
            Section::new("Coefficients against the truth")
                .paragraph(
                    "The model with the right structure is fitted to the training flights. An honest 95 % interval \
                     holds the truth in 95 of 100 trials; an honest standard error makes the root mean square distance 1.",
                )
                .table(coverage_table(scores)),
        )
        .section(
            Section::new("Far from the truth")
                .paragraph("The worst coefficient of every trial that has one beyond five standard errors.")
                .list(scores.far.iter().map(far_sentence)),
        )
        .section(Section::new("Wrong answers").list(scores.failures.iter().map(sentence)))
        .provenance(Provenance {
            command_line: "cargo xtask bench lab".into(),
            version: format!("quadlab {}", env!("CARGO_PKG_VERSION")),
            ..Provenance::default()
        })
}

fn share_cell(share: Share) -> Cell {
    let cell = Cell::from(share.to_string());
    match share {
        Share { of: 0, .. } => cell,
        Share { hits, of } if hits == of => cell.verdict(Verdict::Good),
        Share { hits, of } if 2 * hits < of => cell.verdict(Verdict::Bad),
        _ => cell.verdict(Verdict::Neutral),
    }
}

fn effects_table(scores: &Scores) -> Table {
    let columns = [Column::text("effect")]
        .into_iter()
        .chain(headings(scores).into_iter().map(|heading| Column::number(heading, "")));
    let mut table =
        Table::new("Trials in which the hidden effect was named first", columns.collect::<Vec<_>>());
    for effect in &scores.effects {
        let shares = effect.by_strength.iter().chain(&effect.by_noise).chain(&effect.by_size);
        let shares = shares.chain([&effect.all, &effect.clean]).map(|share| share_cell(*share));
        table.push([Cell::from(effect.effect.as_str())].into_iter().chain(shares));
    }
    table
}

fn confusion_table(scores: &Scores) -> Table {
    let mut answers: Vec<&String> = scores.confusion.values().flat_map(|row| row.keys()).collect();
    answers.sort();
    answers.dedup();
    let columns = [Column::text("hidden")]
        .into_iter()
        .chain(answers.iter().map(|answer| Column::number(answer.as_str(), "")));
    let mut table = Table::new("First answer to what was hidden", columns.collect::<Vec<_>>());
    for (hidden, row) in &scores.confusion {
        let counts = answers.iter().map(|answer| match row.get(*answer) {
            Some(count) if *answer == hidden => Cell::from(count.to_string()).verdict(Verdict::Good),
            Some(count) => Cell::from(count.to_string()),
            None => Cell::from(""),
        });
        table.push([Cell::from(hidden.as_str())].into_iter().chain(counts));
    }
    table
}

fn conditions_table(scores: &Scores) -> Table {
    let columns = [Column::text("condition"), Column::number("trials", "")]
        .into_iter()
        .chain(Class::ALL.map(|class| Column::number(class.name(), "")))
        .chain([Column::text("wrong names and refusals")]);
    let mut table = Table::new("First answers under each condition", columns.collect::<Vec<_>>());
    for score in &scores.conditions {
        let counts = Class::ALL.map(|class| Cell::from(score.of(class).to_string()));
        let names = [Cell::from(score.condition.as_str()), Cell::from(score.trials.to_string())];
        table.push(names.into_iter().chain(counts).chain([Cell::from(wrong_answers(score).as_str())]));
    }
    table
}

fn coverage_table(scores: &Scores) -> Table {
    let columns = [
        Column::text("effect"),
        Column::text("coefficient"),
        Column::text("craft"),
        Column::number("inside", ""),
        Column::number("mean distance", "standard errors"),
        Column::number("rms distance", "standard errors"),
        Column::number("bias", "%"),
    ];
    let mut table = Table::new("Distance from the truth", columns);
    for c in &scores.coverage {
        let poor = c.inside.percent() < POOR_COVERAGE_PERCENT;
        let verdict = if poor { Verdict::Bad } else { Verdict::Good };
        table.push([
            Cell::from(c.effect),
            Cell::from(c.coefficient),
            Cell::from(c.size),
            Cell::from(c.inside.to_string()).verdict(verdict),
            Cell::number(c.mean_errors, 3),
            Cell::number(c.rms_errors, 3),
            Cell::number(c.bias_percent, 3),
        ]);
    }
    table
}
