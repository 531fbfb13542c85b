//! What is read, what is kept, and that nothing is read twice.

mod common;

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{asked, craft, flight, index, text, truth, updated};
use diagnosis::workflow::{Observer, Progress, Silent};
use fleet::{Fleet, FleetError, PassOptions, Question, pass};
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
