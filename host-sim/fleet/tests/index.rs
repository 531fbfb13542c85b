//! What is read, what is kept, and that nothing is read twice.

mod common;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{asked, craft, flight, index, text, truth, updated};
use diagnosis::workflow::{Observer, Progress, Silent};
use fleet::{Fleet, FleetError, PassOptions, Question, pass};
use flights::Column;
use model::Effect;

fn fleet_of(flights: u64) -> tempfile::TempDir {
    let root = tempfile::tempdir().unwrap();
    let folder = craft(root.path(), "quad-1");
    (1..=flights).for_each(|day| flight(&folder, &truth(), day, day, 8.0));
    root
}

const OPTIONS: PassOptions = PassOptions { verify: false, refresh: false, forget: false };

/// The logs are gone after the first pass: every question has the answer that it had while they were there.
#[test]
fn no_question_reads_a_log() {
    let root = fleet_of(5);
    let (fleet, indexed) = updated(root.path(), OPTIONS, &Silent);
    assert_eq!((indexed.read, indexed.index.rows.len()), (5, 5));
    let questions = [
        Question::default(),
        Question { effects: Some(vec![Effect::QuadraticDrag]), ..Question::default() },
        Question { without: vec![Effect::AngularDamping], ..Question::default() },
        Question { leave_out: vec!["quad-1/2026-03-02.csv".into()], ..Question::default() },
    ];
    let before: Vec<String> = questions.iter().map(|own| text(&asked(&fleet, &indexed, own))).collect();
    for k in 1..questions.len() {
        assert_ne!(before[0], before[k], "question {k} asks for something else");
    }
    for day in 1..=5 {
        std::fs::remove_file(root.path().join(format!("quad-1/2026-03-{day:02}.csv"))).unwrap();
    }
    let (fleet, indexed) = updated(root.path(), OPTIONS, &Silent);
    assert_eq!((indexed.read, indexed.gone.len()), (0, 5));
    for (question, before) in questions.iter().zip(&before) {
        assert!(text(&asked(&fleet, &indexed, question)) == *before, "{question:?}");
    }
    let (_, forgotten) = updated(root.path(), PassOptions { forget: true, ..OPTIONS }, &Silent);
    assert!(forgotten.index.rows.is_empty());
}

#[test]
fn only_what_is_new_is_read() {
    let root = fleet_of(3);
    let folder = root.path().join("quad-1");
    assert_eq!(updated(root.path(), OPTIONS, &Silent).1.read, 3);
    assert_eq!(updated(root.path(), OPTIONS, &Silent).1.read, 0);
    flight(&folder, &truth(), 4, 4, 8.0);
    let (_, indexed) = updated(root.path(), OPTIONS, &Silent);
    assert_eq!((indexed.read, indexed.index.rows.len()), (1, 4));
    // Moved and touched files have the content that is known.
    std::fs::rename(folder.join("2026-03-04.csv"), folder.join("2026-03-05.csv")).unwrap();
    let touched = std::fs::read(folder.join("2026-03-01.csv")).unwrap();
    std::fs::write(folder.join("2026-03-01.csv"), touched).unwrap();
    let (_, indexed) = updated(root.path(), PassOptions { verify: true, ..OPTIONS }, &Silent);
    assert_eq!((indexed.read, indexed.gone.len(), indexed.index.rows.len()), (0, 0, 4));
    assert_eq!(indexed.index.rows[3].name, "2026-03-05.csv");
    // What says how to read a flight is part of what its row depends on; so is the vehicle file, of all.
    std::fs::write(folder.join("2026-03-02.use.toml"), "use = [[1.0, 6.0]]").unwrap();
    let (_, indexed) = updated(root.path(), OPTIONS, &Silent);
    assert_eq!(indexed.read, 1);
    assert!((indexed.index.rows[1].airborne_s - 5.0).abs() < 0.1);
    let mut vehicle = truth().vehicle;
    vehicle.mass *= 1.01;
    std::fs::write(folder.join("vehicle.toml"), toml::to_string(&vehicle).unwrap()).unwrap();
    assert_eq!(updated(root.path(), OPTIONS, &Silent).1.read, 4);
}

#[test]
fn damaged_files_are_rows_and_a_copy_counts_once() {
    let root = fleet_of(3);
    let folder = root.path().join("quad-1");
    std::fs::write(folder.join("a.csv"), "t,x\n0,1\nnothing\n").unwrap();
    std::fs::write(folder.join("b.ulg"), b"ULog\x01\x12\x35\x01 and then nothing").unwrap();
    std::fs::copy(folder.join("2026-03-02.csv"), folder.join("copy.csv")).unwrap();
    let (fleet, indexed) = updated(root.path(), OPTIONS, &Silent);
    let answer = asked(&fleet, &indexed, &Question::default());
    let own = &answer.crafts[0];
    assert_eq!((own.flights, own.unused.len()), (3, 3), "{:?}", own.unused);
    let why = |file: &str| &own.unused.iter().find(|one| one.file.ends_with(file)).unwrap().why;
    assert!(why("a.csv").starts_with("not readable: ") && why("b.ulg").starts_with("not readable: "));
    assert_eq!(why("copy.csv"), "is a copy of quad-1/2026-03-02.csv");
    assert_eq!(updated(root.path(), OPTIONS, &Silent).1.read, 0);
}

/// An exclusion is taken back: the file was there all the time, and is not read again.
#[test]
fn what_is_excluded_is_not_gone_and_not_forgotten() {
    let root = fleet_of(5);
    let settings = root.path().join("fleet.toml");
    let first = updated(root.path(), OPTIONS, &Silent).1;
    std::fs::write(&settings, "exclude = [\"quad-1/2026-03-0[45]*\"]").unwrap();
    let (fleet, indexed) = updated(root.path(), PassOptions { forget: true, ..OPTIONS }, &Silent);
    let answer = asked(&fleet, &indexed, &Question::default());
    assert_eq!((indexed.gone.len(), answer.crafts[0].flights, answer.unmatched.len()), (0, 3, 0));
    std::fs::remove_file(&settings).unwrap();
    let (_, again) = updated(root.path(), OPTIONS, &Silent);
    assert_eq!((again.read, again.index.rows.len()), (0, 5));
    assert!(again.index.rows == first.index.rows);
}

#[test]
fn what_no_flight_answers_is_said() {
    let root = fleet_of(3);
    let text = "[batteries]\nB7 = [\"quad-9/*\"]\n[dates]\n\"quad-1/1.csv\" = \"2026-03-04\"\n";
    std::fs::write(root.path().join("fleet.toml"), text).unwrap();
    let (fleet, indexed) = updated(root.path(), OPTIONS, &Silent);
    let unmatched = asked(&fleet, &indexed, &Question::default()).unmatched;
    assert!(unmatched.len() == 2 && unmatched[0].contains("B7: \"quad-9/*\""), "{unmatched:?}");
    let refused = |question: &Question| fleet::ask(&fleet, &indexed, question).err().unwrap().to_string();
    let load = Question { effects: Some(vec![Effect::SlungLoad]), ..Question::default() };
    assert!(
        refused(&load).starts_with("--effects slung-load: the index keeps nothing"),
        "{}",
        refused(&load)
    );
    let late = Question { span_s: [fleet::of_text("2027-01-01"), None], ..Question::default() };
    let said = "no flight is from 2027-01-01 00:00 on (--since); the flights are from 2026-03-01 00:00 to 2026-03-03 00:00";
    assert_eq!(refused(&late), said);
    let one = Question { span_s: [fleet::of_text("2026-03-03"), None], ..Question::default() };
    assert_eq!(asked(&fleet, &indexed, &one).crafts[0].flights, 1);
}

/// One craft's commands are stamped 0 to 70 ms late, to and fro within each flight: the checks say that no rotation can be fitted to these.
#[test]
fn what_is_not_identified_is_neither_listed_nor_compared() {
    let root = tempfile::tempdir().unwrap();
    for (name, wanders) in [("quad-1", false), ("quad-2", true)] {
        let folder = craft(root.path(), name);
        for day in 1..=4 {
            let mut flown = common::fly(&truth(), day, 40.0, &common::ORDINARY);
            if wanders {
                wander(&mut flown);
            }
            std::fs::write(folder.join(format!("2026-03-{day:02}.csv")), flown.to_csv()).unwrap();
        }
    }
    let (fleet, indexed) = updated(root.path(), OPTIONS, &Silent);
    let wandering = |row: &fleet::Row| row.faults.iter().any(|fault| fault.kind == "wandering-clock");
    for row in &indexed.index.rows {
        assert_eq!(wandering(row), row.craft == "quad-2", "{} {:?}", row.label(), row.faults);
        let axes = &row.equations.axes;
        assert!(axes[..3].iter().all(|axis| !axis.triangle.is_empty()));
        assert!(axes[3..].iter().all(|axis| axis.triangle.is_empty() == wandering(row)));
    }
    let answer = asked(&fleet, &indexed, &Question::default());
    let rotates = |effect: Effect| effect.info().axes.iter().all(|axis| !axis.is_force());
    let told = |own: &fleet::CraftAnswer| {
        own.coefficients.iter().filter(|c| rotates(c.effect) && c.now.is_some()).count()
    };
    let [steady, wanders] = &answer.crafts[..] else { panic!("two craft") };
    assert!(told(steady) > 10 && steady.not_identified.is_empty(), "{:?}", steady.not_identified);
    assert!(told(wanders) == 0, "{:?}", wanders.coefficients);
    assert!(answer.craft_against_craft.compared <= 4, "{}", answer.craft_against_craft.compared);
}

/// Moves the commands to and fro in time, by 0 to 70 ms within 13 s.
fn wander(flown: &mut flights::Flight) {
    for column in [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4] {
        let own = flown.column(column).unwrap().to_vec();
        let late =
            |k: usize| (3.5 + 3.5 * (0.01 * k as f64 * std::f64::consts::TAU / 13.0).sin()).round() as usize;
        let moved = (0..own.len()).map(|k| own[k.saturating_sub(late(k))]).collect();
        flown.replace(column, moved);
    }
}

/// Stops once so many flights were read.
struct Impatient {
    after: usize,
    seen: AtomicUsize,
}

impl Observer for Impatient {
    fn progress(&self, progress: Progress<'_>) {
        if progress.activity == "reading flights" {
            self.seen.fetch_max(progress.steps.map_or(0, |steps| steps.0), Ordering::Relaxed);
        }
    }

    fn is_cancelled(&self) -> bool {
        self.seen.load(Ordering::Relaxed) >= self.after
    }
}

/// A hundred flights are four batches. The first pass is stopped in the third one, and the next goes on from there.
#[test]
fn a_stopped_pass_goes_on_and_ends_with_the_same_bytes() {
    let root = tempfile::tempdir().unwrap();
    let folder = craft(root.path(), "quad-1");
    let flown = common::fly(&truth(), 1, 12.0, &common::ORDINARY).to_csv();
    let (header, rows) = flown.split_once('\n').unwrap();
    let rows: Vec<&str> = rows.lines().collect();
    // Pieces of one flight that begin at different samples.
    for k in 0..100 {
        let piece = rows[k..k + 400].join("\n");
        std::fs::write(folder.join(format!("{k:03}.csv")), format!("{header}\n{piece}\n")).unwrap();
    }
    let whole = root.path().join(".whole.parquet");
    let fleet = Fleet::find(root.path(), &whole).unwrap();
    assert_eq!(pass(&fleet, &whole, OPTIONS, &Silent).unwrap().read, 100);
    let impatient = Impatient { after: 80, seen: AtomicUsize::new(0) };
    let again = index(root.path());
    let stopped = pass(&fleet, &again, OPTIONS, &impatient);
    assert!(matches!(stopped, Err(FleetError::Cancelled)) && !again.exists());
    let read = pass(&fleet, &again, OPTIONS, &Silent).unwrap().read;
    assert!(read < 40, "{read} were read again");
    let bytes = |path: &Path| std::fs::read(path).unwrap();
    assert!(bytes(&whole) == bytes(&again), "the same bytes");
    assert!(!again.with_extension("parts").exists());
}
