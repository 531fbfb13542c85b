//! Which folder of a crate may use which: the levels inside a crate.
//!
//! `.` stands for the files beside the crate's root file; what the root re-exports is no arrow. One of
//! those files can have a row of its own, by its name: what all folders stand on lies beside what joins
//! them. A crate whose files all lie side by side needs no row. A folder inside a folder is one of its
//! own.

use std::collections::{BTreeMap, BTreeSet};

use super::crates::Crate;
use super::known::{Entry, Kind, Violation};
use crate::source::SourceFile;

/// What the files of one folder may use of the crate's other folders, and why.
struct Folder {
    of: &'static str,
    folder: &'static str,
    to: &'static [&'static str],
    why: &'static str,
}

/// Shorter to write.
const fn row(
    of: &'static str,
    folder: &'static str,
    to: &'static [&'static str],
    why: &'static str,
) -> Folder {
    Folder { of, folder, to, why }
}

/// Every folder of every crate that has any.
const FOLDERS: &[Folder] = &[
    row("control", "dsp", &[], "a filter knows nothing of flight"),
    row("control", "config", &["dsp"], "gains and limits name the filters that they set"),
    row("control", "allocation", &["config", "dsp"], "motors are given forces, whoever asks"),
    row("control", "inputs", &["config", "dsp"], "what comes in is checked before the law sees it"),
    row(
        "control",
        "law",
        &["config", "dsp", "allocation", "inputs"],
        "the law turns checked inputs into motor commands",
    ),
    row(
        "control",
        "safety",
        &["config", "dsp", "inputs"],
        "the supervisor decides without the law that it watches",
    ),
    row(
        "control",
        ".",
        &["config", "dsp", "inputs", "law", "safety", "allocation"],
        "the autopilot joins law and supervisor",
    ),
    row("model", ".", &[], "quantities, samples and the parts of a model know no single effect"),
    row("model", "user_effects", &["."], "a user's effect is an effect like any other"),
    row("model", "effects", &[".", "user_effects"], "the catalogue holds ours and the user's"),
    row("model", "plant", &[".", "effects", "user_effects"], "the equations of motion add up the effects"),
    row("model", "model_file.rs", &[".", "effects", "user_effects"], "a file names effects of the catalogue"),
    row("design", "error.rs", &[], "what can go wrong is the same on every level"),
    row("design", "plant", &["error.rs"], "the linear model knows no loop"),
    row("design", "loops", &["error.rs", "plant"], "a loop is closed around the linear model"),
    row("design", "analysis", &["error.rs", "plant", "loops"], "margins and responses are those of loops"),
    row(
        "design",
        "synthesis",
        &["error.rs", "plant", "loops", "analysis"],
        "gains are chosen by what analysis says",
    ),
    row(
        "design",
        "check",
        &["error.rs", "plant", "loops", "analysis"],
        "gains are judged without knowing who chose them",
    ),
    row(
        "design",
        ".",
        &["error.rs", "plant", "loops", "analysis", "synthesis", "check"],
        "the thesis' values are compared with all that is computed",
    ),
    row("report", ".", &[], "what a figure shows and how it looks is said before it is drawn"),
    row("report", "draw", &["."], "figures are drawn as described"),
    row("report", "page.rs", &[".", "draw"], "a page holds drawn figures"),
    row("sil", "craft", &[], "a simulated craft does not know who flies it"),
    row("sil", "flight_computer", &[], "the flight computer does not see the plant"),
    row("sil", "flight", &["craft", "flight_computer"], "a flight joins a craft and its computer"),
    row(
        "sil",
        "scenarios",
        &["craft", "flight", "flight_computer"],
        "a scenario is a flight and what is required of it",
    ),
    row(
        "sil",
        "experiments",
        &["craft", "flight", "flight_computer"],
        "an experiment is flown to learn a model from it",
    ),
    row(
        "sil",
        "failsafe",
        &["craft", "flight", "flight_computer", "scenarios"],
        "a drill is a flight in which something fails",
    ),
    row(
        "sil",
        "laboratory.rs",
        &["craft", "flight", "flight_computer"],
        "a craft that boots, in a room with a floor, is flown by whoever speaks to it",
    ),
    row(
        "sil",
        "endurance",
        &["craft", "flight", "flight_computer", "laboratory.rs"],
        "long runs are many flights, and judged by how they end",
    ),
    row(
        "sil",
        ".",
        &[
            "craft",
            "flight",
            "flight_computer",
            "scenarios",
            "experiments",
            "failsafe",
            "endurance",
            "laboratory.rs",
        ],
        "programs and the laboratory join flights",
    ),
    row("ground", "link", &[], "packets go to a craft whatever they hold"),
    row("ground", "mission", &[], "what is asked of a craft does not depend on how it hears of it"),
    row("ground", "mocap", &[], "a tracker does not know what is done with its poses"),
    row("ground", "recording", &["link"], "what was said over the link is written down"),
    row(
        "ground",
        "station",
        &["link", "mission", "mocap", "recording"],
        "the station joins tracker, link and mission",
    ),
    row(
        "ground",
        ".",
        &["link", "mission", "mocap", "recording", "station"],
        "the program runs a station and shows it",
    ),
    row("logs", "format.rs", &[], "what a file is can be told before it is read"),
    row("logs", "error.rs", &[], "why a log is refused does not depend on who refuses it"),
    row("logs", "log.rs", &["format.rs"], "tables are what every format comes to"),
    row("logs", "recording.rs", &[], "quantities do not know which log they are from"),
    row("logs", "statistics.rs", &[], "the middle of values is the same of all quantities"),
    row(
        "logs",
        "spans.rs",
        &["recording.rs", "statistics.rs"],
        "stretches of time are joined and met the same way everywhere",
    ),
    row("logs", "progress.rs", &[], "how far something is does not depend on what it is"),
    row(
        "logs",
        "decode/common",
        &["error.rs"],
        "bytes are read and damage is told the same way in every format",
    ),
    row(
        "logs",
        "decode/crazyflie",
        &["decode/common", "format.rs", "error.rs", "log.rs"],
        "a format is decoded without knowing the others",
    ),
    row(
        "logs",
        "decode/parquet",
        &["decode/common", "format.rs", "error.rs", "log.rs"],
        "a format is decoded without knowing the others",
    ),
    row(
        "logs",
        "decode/ros_messages",
        &["decode/common", "log.rs"],
        "messages are the same in all kinds of bags",
    ),
    row(
        "logs",
        "decode/blackbox",
        &["decode/common", "format.rs", "error.rs", "log.rs", "progress.rs"],
        "a format is decoded without knowing the others",
    ),
    row(
        "logs",
        "decode/dataflash",
        &["decode/common", "format.rs", "error.rs", "log.rs", "progress.rs"],
        "a format is decoded without knowing the others",
    ),
    row(
        "logs",
        "decode/ulog",
        &["decode/common", "format.rs", "error.rs", "log.rs", "progress.rs"],
        "a format is decoded without knowing the others",
    ),
    row(
        "logs",
        "decode",
        &[
            "decode/common",
            "decode/blackbox",
            "decode/dataflash",
            "decode/ulog",
            "decode/crazyflie",
            "decode/parquet",
            "decode/ros_messages",
            "format.rs",
            "error.rs",
            "log.rs",
            "progress.rs",
        ],
        "decoding interprets nothing",
    ),
    row(
        "logs",
        "sources/common",
        &["error.rs", "recording.rs"],
        "times, rotations and names are the same for every program",
    ),
    row(
        "logs",
        "sources/crazyflie",
        &["sources/common", "format.rs", "error.rs", "log.rs", "recording.rs", "spans.rs", "statistics.rs"],
        "a program's tables are understood without knowing the others",
    ),
    row(
        "logs",
        "sources/ros",
        &["sources/common", "format.rs", "error.rs", "log.rs", "recording.rs", "spans.rs", "statistics.rs"],
        "a program's tables are understood without knowing the others",
    ),
    row(
        "logs",
        "sources/ardupilot",
        &["sources/common", "format.rs", "error.rs", "log.rs", "recording.rs", "spans.rs", "statistics.rs"],
        "a program's tables are understood without knowing the others",
    ),
    row(
        "logs",
        "sources/blackbox",
        &["sources/common", "format.rs", "error.rs", "log.rs", "recording.rs", "spans.rs"],
        "a program's tables are understood without knowing the others",
    ),
    row(
        "logs",
        "sources/px4",
        &["sources/common", "format.rs", "error.rs", "log.rs", "recording.rs", "spans.rs", "statistics.rs"],
        "a program's tables are understood without knowing the others",
    ),
    row(
        "logs",
        "sources",
        &[
            "sources/common",
            "sources/ardupilot",
            "sources/blackbox",
            "sources/px4",
            "sources/crazyflie",
            "sources/ros",
            "format.rs",
            "error.rs",
            "log.rs",
            "recording.rs",
            "spans.rs",
        ],
        "which table is which quantity depends on the program, not on the bytes of its log",
    ),
    row(
        "logs",
        "conversion",
        &["error.rs", "recording.rs", "spans.rs", "sources"],
        "flights are cut from quantities, whichever program logged them",
    ),
    row(
        "logs",
        ".",
        &[
            "format.rs",
            "error.rs",
            "log.rs",
            "progress.rs",
            "recording.rs",
            "spans.rs",
            "decode",
            "sources",
            "conversion",
        ],
        "the library joins the three steps",
    ),
    row("sysid", "statistics.rs", &[], "numbers in, numbers out"),
    row("sysid", "filter.rs", &[], "a filter takes a signal, wherever it is from"),
    row("sysid", "prepare", &["statistics.rs", "filter.rs"], "samples are made from a flight alone"),
    row("sysid", "fit", &["statistics.rs", "filter.rs", "prepare"], "a fit is made of prepared samples"),
    row(
        "sysid",
        "fit/output_error",
        &["statistics.rs", "filter.rs", "prepare", "fit"],
        "a refinement starts from a fit",
    ),
    row(
        "sysid",
        "checks",
        &["statistics.rs", "filter.rs", "prepare", "fit"],
        "a check looks at a flight through what a fit leaves of it",
    ),
    row(
        "sysid",
        ".",
        &["statistics.rs", "filter.rs", "prepare", "fit", "checks"],
        "a comparison joins samples, fits and checks",
    ),
    row("diagnosis", "columns.rs", &[], "columns of effects are formed without knowing what they are for"),
    row(
        "diagnosis",
        "planning",
        &["columns.rs"],
        "what a flight would tell does not depend on what was found",
    ),
    row("diagnosis", ".", &["columns.rs", "planning"], "findings come before plans for the next flight"),
    row("diagnosis", "discovery", &["columns.rs", "."], "forms are searched in what the known effects leave"),
    row("diagnosis", "workflow", &[".", "planning", "discovery"], "what the commands do joins all steps"),
    row("motor-stand", ".", &[], "logs of the stand are read without knowing what they say together"),
    row("motor-stand", "motor_map", &["."], "map, lag and clocks are fitted to logs"),
    row("quadlab", "cli", &[], "arguments, progress and files are the same for every command"),
    row("quadlab", "render", &["cli"], "tables, pages and figures are drawn from results"),
    row("quadlab", "lab", &["cli", "render"], "the page in the browser calls the libraries as commands do"),
    row(
        "quadlab",
        "demo",
        &["cli", "render", "lab"],
        "the demonstration is built without the other commands too",
    ),
    row(
        "quadlab",
        "commands",
        &["cli", "render", "lab", "demo"],
        "a command parses, calls a library and shows the result",
    ),
    row("quadlab", ".", &["cli", "render", "lab", "demo", "commands"], "the program joins its commands"),
    row("stories", "world", &[], "worlds share no equation with what is tested in them"),
    row("stories", ".", &["world"], "a story plays in a world"),
    row("xtask", "base", &[], "what every command stands on knows no command"),
    row("xtask", "source", &[], "reading Rust sources needs nothing but the sources"),
    row("xtask", "checks", &["base", "source"], "a check looks at the tree and runs nothing"),
    row("xtask", "bench", &["base"], "benches are run and counted apart from checks"),
    row("xtask", "arm", &["base"], "the craft's programs are built without knowing what becomes of them"),
    row(
        "xtask",
        "book",
        &["base"],
        "the book is built from its pages and from what the user's program writes",
    ),
    row("xtask", "flash", &["base", "arm"], "what is flashed is built first"),
    row(
        "xtask",
        ".",
        &["base", "source", "checks", "arm", "bench", "book", "flash"],
        "each file is a command that joins what the folders hold",
    ),
];

const TABLE: &str = "xtask/src/checks/folders.rs";

/// Arrows between folders that the table does not allow, folders that it lacks, and rows that stand for
/// nothing.
pub(crate) fn violations(crates: &[Crate]) -> Vec<Violation> {
    against(FOLDERS, crates)
}

fn against(table: &[Folder], crates: &[Crate]) -> Vec<Violation> {
    let mut there: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for one in crates {
        let rooms = one.tree.files.iter().map(|file| room(table, &one.package, file));
        there.entry(&one.package).or_default().extend(rooms);
    }
    let mut found = Vec::new();
    for (of, folders) in there.iter().filter(|(_, folders)| folders.len() > 1) {
        let lacks = |folder: &&&str| !table.iter().any(|row| row.of == *of && row.folder == **folder);
        found.extend(folders.iter().filter(lacks).map(|folder| without_row(of, folder)));
    }
    for row in
        table.iter().filter(|row| !there.get(row.of).is_some_and(|folders| folders.contains(row.folder)))
    {
        found.push(without_folder(row));
    }
    for one in crates {
        found.extend(refused_arrows(table, one));
    }
    found
}

fn violation(kind: Kind, subject: &[&str], message: String) -> Violation {
    let subject = subject.iter().map(ToString::to_string).collect();
    Violation { entry: Entry { kind, subject, lines: 0 }, message }
}

fn without_row(of: &str, folder: &str) -> Violation {
    let message = format!(
        "{of}: folder {folder} has no row in the table of {TABLE}: add which folders its files may use, and why"
    );
    violation(Kind::Folder, &[of, folder], message)
}

fn without_folder(row: &Folder) -> Violation {
    let message = format!("{TABLE}: crate {} has no folder {}: delete the row", row.of, row.folder);
    violation(Kind::Folder, &[row.of, row.folder], message)
}

/// Where a file belongs: a row of its own, or its folder.
fn room<'a>(table: &[Folder], of: &str, file: &'a SourceFile) -> &'a str {
    let name = file.path.rsplit('/').next().unwrap_or_default();
    let own = file.folder == "." && table.iter().any(|row| row.of == of && row.folder == name);
    if own { name } else { &file.folder }
}

/// Arrows of a crate between folders, each once, with the first file and line.
fn refused_arrows(table: &[Folder], one: &Crate) -> Vec<Violation> {
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for ((from, to), line) in &one.graph.arrows {
        let (user, used) = (&one.tree.files[*from], &one.tree.files[*to]);
        let (high, low) = (room(table, &one.package, user), room(table, &one.package, used));
        let Some(row) = table.iter().find(|row| row.of == one.package && row.folder == high) else {
            continue;
        };
        if high == low || row.to.contains(&low) || !seen.insert((high, low)) {
            continue;
        }
        let message = format!(
            "{}:{line}: {high} -> {low} ({}): in {}, {high} may use {} because {}; move the code, or change the table of {TABLE}",
            user.path,
            used.path,
            one.package,
            if row.to.is_empty() { "nothing else".to_owned() } else { row.to.join(", ") },
            row.why
        );
        found.push(violation(Kind::FolderArrow, &[&one.package, high, low], message));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A crate with a file in each of two folders, `high/a.rs` with this text and `low/b.rs` with that.
    fn crate_with(a: &str, b: &str) -> Vec<Crate> {
        crate_of(&[
            ("lib.rs", "mod high;\nmod low;"),
            ("high/mod.rs", "pub mod a;"),
            ("high/a.rs", a),
            ("low/mod.rs", "pub mod b;"),
            ("low/b.rs", b),
        ])
    }

    fn crate_of(files: &[(&str, &str)]) -> Vec<Crate> {
        let folder = tempfile::tempdir().unwrap();
        for (path, text) in files {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        vec![Crate::read("small", folder.path(), &folder.path().join("lib.rs")).unwrap()]
    }

    const SMALL: &[Folder] = &[
        row("small", ".", &["high", "low"], "the root joins all"),
        row("small", "high", &["low"], "high stands on low"),
        row("small", "low", &[], "low knows nothing above it"),
    ];

    #[test]
    fn an_arrow_the_wrong_way_is_named_with_file_line_and_reason() {
        let up = crate_with("pub fn a() {}", "\npub fn b() { crate::high::a::a() }");
        let found = against(SMALL, &up);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].entry.to_string(), "folder-arrow small low high");
        assert!(found[0].message.starts_with("low/b.rs:2: low -> high (high/a.rs): "), "{found:?}");
        assert!(found[0].message.contains("low knows nothing above it"), "{found:?}");
    }

    #[test]
    fn an_arrow_that_the_table_allows_passes() {
        let down = crate_with("pub fn a() { crate::low::b::b() }", "pub fn b() {}");
        assert!(against(SMALL, &down).is_empty());
    }

    #[test]
    fn a_file_beside_the_root_can_have_a_row_of_its_own() {
        let table = [
            row("small", ".", &[], "the root"),
            row("small", "b.rs", &[], "below"),
            row("small", "high", &["b.rs"], "high"),
        ];
        let small = crate_of(&[
            ("lib.rs", "mod high;\nmod b;"),
            ("high/mod.rs", "pub fn a() { crate::b::b() }"),
            ("b.rs", "pub fn b() {}"),
        ]);
        assert!(against(&table, &small).is_empty());
        let entries: Vec<String> =
            against(&[row("small", ".", &[], "the root"), row("small", "high", &["b.rs"], "high")], &small)
                .iter()
                .map(|found| found.entry.to_string())
                .collect();
        assert_eq!(entries, ["folder-arrow small high ."]);
    }

    #[test]
    fn folders_and_rows_belong_together() {
        let quiet = || crate_with("", "");
        let found = against(&SMALL[1..], &quiet());
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].entry.to_string(), "folder small .");
        let gone = [row("small", "gone", &[], "nobody knows")];
        let found = against(&gone, &quiet());
        assert!(found.iter().any(|violation| violation.message.contains("has no folder gone")), "{found:?}");
        assert_eq!(found.len(), 4);
    }

    /// The table itself: each folder once, only its crate's folders on the right, and no way back.
    #[test]
    fn the_table_has_no_circle() {
        let mut placed: BTreeSet<(&str, &str)> = BTreeSet::new();
        while placed.len() < FOLDERS.len() {
            let next = FOLDERS.iter().find(|row| {
                !placed.contains(&(row.of, row.folder))
                    && row.to.iter().all(|to| placed.contains(&(row.of, to)))
            });
            let next = next.expect("an order in which each folder comes after those that it uses");
            placed.insert((next.of, next.folder));
        }
    }
}
