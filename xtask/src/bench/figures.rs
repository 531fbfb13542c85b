//! What benches measured: read from what divan, gungraun and the throughput benches print, shown as one table.
//!
//! A row is a function of a bench. `tick_instructions` counts what `tick` times, so both fill the row `tick` if the
//! function has the same name in both.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A count, and what it was on the last run on this machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Instructions {
    pub(crate) now: u64,
    pub(crate) before: Option<u64>,
}

impl Instructions {
    /// By how many percent there are more than before.
    pub(crate) fn percent(self) -> Option<f64> {
        let before = self.before.filter(|&before| before > 0)?;
        Some(100.0 * (self.now as f64 / before as f64 - 1.0))
    }
}

/// Work done in a time of the processor.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Throughput {
    /// What is counted: "closed-loop steps".
    pub(crate) work: String,
    pub(crate) amount: f64,
    pub(crate) cpu_s: f64,
}

impl Throughput {
    /// Work in a second of processor time.
    pub(crate) fn rate(&self) -> f64 {
        self.amount / self.cpu_s
    }

    /// "3,210,000 closed-loop steps".
    pub(crate) fn shown(&self) -> String {
        format!("{} {}", rounded(self.rate()), self.work)
    }

    /// Reads the line of a throughput bench.
    pub(crate) fn from_line(line: &str) -> Option<Self> {
        let value: Value = serde_json::from_str(line).ok()?;
        let work = value.get("work")?.as_str()?.to_owned();
        Some(Self { work, amount: value.get("amount")?.as_f64()?, cpu_s: value.get("cpu_s")?.as_f64()? })
    }
}

/// The function's name and the count in a line of gungraun's JSON.
pub(crate) fn counted(line: &str) -> Option<(String, Instructions)> {
    let value: Value = serde_json::from_str(line).ok()?;
    let values = value.pointer("/profiles/0/data/total/metrics/Ir/values")?;
    let count = |key: &str| values.get(key).and_then(Value::as_u64);
    let function = value.get("function_name")?.as_str()?.to_owned();
    Some((function, Instructions { now: count("new")?, before: count("old") }))
}

/// Reads the table that divan prints, line by line.
#[derive(Default)]
pub(crate) struct TimesReader {
    /// Names from the top of the tree to the last line.
    path: Vec<String>,
}

impl TimesReader {
    /// The function's name and its median time, if the line has them.
    pub(crate) fn line(&mut self, line: &str) -> Option<(String, String)> {
        let branch = line.find(['├', '╰'])?;
        let depth = line[..branch].chars().count() / 3;
        let rest = line[branch..].trim_start_matches(['├', '╰', '─', ' ']);
        self.path.truncate(depth);
        self.path.push(rest.split_whitespace().next()?.to_owned());
        let median = rest.split('│').nth(2)?.trim();
        (!median.is_empty()).then(|| (self.path.join(" "), median.to_owned()))
    }
}

/// A line of the table.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) bench: String,
    pub(crate) function: String,
    median: Option<String>,
    pub(crate) instructions: Option<Instructions>,
    /// Work in a second of processor time, and what the work is.
    pub(crate) rate: Option<(f64, String)>,
}

/// Another program beside ours.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Comparison {
    pub(crate) work: String,
    pub(crate) ours: f64,
    pub(crate) peer: String,
    pub(crate) theirs: f64,
    /// Ours over theirs, of pairs of runs made one after the other.
    pub(crate) ratio: f64,
}

/// All that was measured.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Figures {
    pub(crate) rows: Vec<Row>,
    pub(crate) comparisons: Vec<Comparison>,
}

impl Figures {
    /// Notes a median as divan writes it.
    pub(crate) fn add_median(&mut self, bench: &str, function: String, median: String) {
        self.row(bench, function).median = Some(median);
    }

    /// Notes a count.
    pub(crate) fn add_instructions(&mut self, bench: &str, function: String, count: Instructions) {
        self.row(bench.trim_end_matches("_instructions"), function).instructions = Some(count);
    }

    /// Notes the median over runs in fresh processes.
    pub(crate) fn add_throughput(&mut self, bench: &str, runs: &[Throughput]) {
        let Some(first) = runs.first() else { return };
        let rate = median(runs.iter().map(Throughput::rate).collect());
        self.row(bench, String::new()).rate = Some((rate, first.work.clone()));
    }

    /// Notes runs of ours and of a peer's, made in turn.
    pub(crate) fn add_comparison(&mut self, peer: &str, ours: &[Throughput], theirs: &[Throughput]) {
        let Some(first) = ours.first() else { return };
        self.comparisons.push(Comparison {
            work: first.work.clone(),
            ours: median(ours.iter().map(Throughput::rate).collect()),
            peer: peer.to_owned(),
            theirs: median(theirs.iter().map(Throughput::rate).collect()),
            ratio: median(ours.iter().zip(theirs).map(|(a, b)| a.rate() / b.rate()).collect()),
        });
    }

    fn row(&mut self, bench: &str, function: String) -> &mut Row {
        let same = |row: &Row| row.bench == bench && row.function == function;
        let at = self.rows.iter().position(same).unwrap_or_else(|| {
            self.rows.push(Row { bench: bench.to_owned(), function, ..Row::default() });
            self.rows.len() - 1
        });
        &mut self.rows[at]
    }
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.rows.is_empty() {
            writeln!(f, "{}", table(&RESULTS, &self.rows.iter().map(Row::cells).collect::<Vec<_>>()))?;
        }
        if !self.comparisons.is_empty() {
            let rows: Vec<_> = self.comparisons.iter().map(Comparison::cells).collect();
            writeln!(f, "{}", table(&AGAINST, &rows))?;
        }
        Ok(())
    }
}

const RESULTS: [&str; 5] = ["bench", "median time", "instructions", "since last run", "per CPU-second"];
const AGAINST: [&str; 5] = ["per CPU-second", "ours", "theirs", "ours / theirs", "they are"];

impl Row {
    /// The bench, and which of its functions.
    pub(crate) fn name(&self) -> String {
        format!("{} {}", self.bench, self.function).trim_end().to_owned()
    }

    fn cells(&self) -> [String; 5] {
        let rate = self.rate.as_ref().map(|(rate, work)| format!("{} {work}", rounded(*rate)));
        [
            self.name(),
            self.median.clone().unwrap_or_default(),
            self.instructions.map(|count| grouped(count.now as f64)).unwrap_or_default(),
            self.instructions.and_then(change).unwrap_or_default(),
            rate.unwrap_or_default(),
        ]
    }
}

impl Comparison {
    fn cells(&self) -> [String; 5] {
        [
            self.work.clone(),
            rounded(self.ours),
            rounded(self.theirs),
            format!("{:.2}", self.ratio),
            self.peer.clone(),
        ]
    }
}

fn change(count: Instructions) -> Option<String> {
    let percent = count.percent()?;
    Some(if count.before == Some(count.now) { "same".to_owned() } else { format!("{percent:+.2} %") })
}

/// To three significant digits, for people.
pub(crate) fn rounded(value: f64) -> String {
    grouped(significant(value))
}

/// To three significant digits: more would not repeat.
fn significant(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Tenths of a small number, groups of digits of a large one: 47.3, 3,210,000.
pub(crate) fn grouped(value: f64) -> String {
    if value < 100.0 {
        return format!("{value:.1}");
    }
    let digits = format!("{value:.0}");
    let first = (digits.len() - 1) % 3 + 1;
    let (head, tail) = digits.split_at(first);
    let groups = tail.as_bytes().chunks(3).map(|group| String::from_utf8_lossy(group).into_owned());
    std::iter::once(head.to_owned()).chain(groups).collect::<Vec<_>>().join(",")
}

/// Middle of the sorted values; of an even number of them, the mean of the two in the middle.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let half = values.len() / 2;
    match values.as_slice() {
        [] => f64::NAN,
        sorted if sorted.len() % 2 == 1 => sorted[half],
        sorted => 0.5 * (sorted[half - 1] + sorted[half]),
    }
}

/// Columns as wide as they need: the first and the last to the left, numbers to the right.
fn table(head: &[&str; 5], rows: &[[String; 5]]) -> String {
    let head = head.map(ToOwned::to_owned);
    let all: Vec<&[String; 5]> = std::iter::once(&head).chain(rows).collect();
    let width =
        |column: usize| all.iter().map(|cells| cells[column].chars().count()).max().unwrap_or_default();
    let [a, b, c, d] = [0, 1, 2, 3].map(width);
    let line = |cells: &[String; 5]| {
        let [first, second, third, fourth, last] = cells;
        format!("{first:a$}  {second:>b$}  {third:>c$}  {fourth:>d$}  {last}").trim_end().to_owned()
    };
    all.into_iter().map(|cells| line(cells) + "\n").collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As divan 0.1.21 prints it.
    const TIMES: &str = "\
Timer precision: 20 ns
tick               fastest       │ slowest       │ median        │ mean          │ samples │ iters
├─ flight          18.51 ms      │ 28.24 ms      │ 20.26 ms      │ 20.9 ms       │ 30      │ 30
│                  3.24 Mitem/s  │ 2.124 Mitem/s │ 2.961 Mitem/s │ 2.87 Mitem/s  │         │
├─ tick                          │               │               │               │         │
│  ├─ Attitude     84.67 ns      │ 99.87 ns      │ 85.12 ns      │ 85.53 ns      │ 100     │ 100000
│  ╰─ Position     101 ns        │ 121.3 ns      │ 101.7 ns      │ 102.1 ns      │ 100     │ 100000
╰─ last            458.9 ns      │ 8.539 µs      │ 464.2 ns      │ 927.8 ns      │ 100     │ 100000
";

    #[test]
    fn medians_are_read_with_the_names_above_them() {
        let mut reader = TimesReader::default();
        let found: Vec<(String, String)> = TIMES.lines().filter_map(|line| reader.line(line)).collect();
        let expected = [
            ("flight", "20.26 ms"),
            ("tick Attitude", "85.12 ns"),
            ("tick Position", "101.7 ns"),
            ("last", "464.2 ns"),
        ];
        assert_eq!(found, expected.map(|(name, median)| (name.to_owned(), median.to_owned())));
    }

    /// Shortened from what gungraun 0.20 prints.
    fn json(values: &str) -> String {
        format!(
            r#"{{"function_name":"one_substep","id":"of","profiles":[{{"data":{{"total":{{"metrics":
               {{"Dr":{{"values":{{"new":433}}}},"Ir":{{"values":{values}}}}}}}}},"tool":"Callgrind"}}]}}"#
        )
    }

    #[test]
    fn counts_are_read_with_those_of_the_last_run() {
        let read = |values: &str| counted(&json(values)).expect("it is JSON with a count");
        assert_eq!(read(r#"{"new":1763}"#).1, Instructions { now: 1763, before: None });
        let (function, count) = read(r#"{"new":1763,"old":1700}"#);
        assert_eq!(function, "one_substep");
        assert_eq!(change(count).as_deref(), Some("+3.71 %"));
        assert_eq!(counted("Gungraun result: Ok."), None);
    }

    #[test]
    fn a_time_and_a_count_of_the_same_function_share_a_row() {
        let mut figures = Figures::default();
        figures.add_median("plant", "one_substep".into(), "116 ns".into());
        figures.add_median("plant", "four_substeps".into(), "464 ns".into());
        let count = Instructions { now: 1763, before: Some(1763) };
        figures.add_instructions("plant_instructions", "one_substep".into(), count);
        let expected = "\
bench                median time  instructions  since last run  per CPU-second
plant one_substep         116 ns         1,763            same
plant four_substeps       464 ns

";
        assert_eq!(figures.to_string(), expected);
    }

    #[test]
    fn rates_are_medians_and_ratios_those_of_pairs() {
        let run = |cpu_s: f64| Throughput { work: "steps".into(), amount: 60.0, cpu_s };
        let (ours, theirs) = ([run(1.0), run(2.0), run(4.0)], [run(2.0), run(4.0), run(2.0)]);
        let mut figures = Figures::default();
        figures.add_throughput("flight_throughput", &ours);
        figures.add_comparison("C", &ours, &theirs);
        let text = figures.to_string();
        // Medians 30 and 30; pairs 2, 2 and 0.5.
        assert!(text.contains("30.0 steps") && text.contains("steps           30.0    30.0"), "{text}");
        assert!(text.contains("2.00  C"), "{text}");
        let line = r#"{"work":"steps","amount":60000,"cpu_s":0.015}"#;
        assert_eq!(Throughput::from_line(line).map(|read| read.rate()), Some(4e6));
    }

    #[test]
    fn numbers_are_grouped_by_thousands() {
        let cases = [(47.26, "47.3"), (100.0, "100"), (1763.0, "1,763"), (3_210_000.4, "3,210,000")];
        for (value, text) in cases {
            assert_eq!(grouped(value), text);
        }
        assert_eq!(grouped(significant(2_169_351.0)), "2,170,000");
        assert_eq!(median(vec![3.0, 1.0, 2.0, 10.0]), 2.5);
    }
}
