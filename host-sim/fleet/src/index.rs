//! The index: a Parquet file with a row for each flight, and the reference model of each craft.
//!
//! Triangles are lists of numbers, column by column; the names of their columns stand beside them. Units and the version of the
//! schema are in the file's metadata.

use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};
use table::{ParquetError, Table, Values};

use crate::equations::{AxisEquations, Equations};
use crate::error::FleetError;
use crate::fit::axis_names;
use crate::reference::Reference;
use crate::row::Row;
use crate::words::{of_word, word};

/// Version of the schema: another one is read again from the logs.
const VERSION: &str = "1";

/// What is kept of a fleet.
#[derive(Debug, Clone, Default)]
pub struct Index {
    /// Flights in the order of craft, file and part.
    pub rows: Vec<Row>,
    /// Text of each craft's reference model, or why it has none; and of what these were made.
    pub(crate) references: BTreeMap<String, KeptReference>,
    /// Causes of changes that were looked up in the logs, by what was asked.
    pub(crate) causes: BTreeMap<String, Value>,
    /// The flights for which it was last seen that no reference is from both sides of a change ([`crate::sides`]).
    pub(crate) judged: String,
}

/// A craft's reference as it is kept.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct KeptReference {
    /// The model's text; empty where there is none.
    pub(crate) model: String,
    /// Why there is none.
    pub(crate) why: String,
    /// SHA-256 of the vehicle file.
    pub(crate) vehicle_sha256: String,
    /// Whether it is the user's own model file.
    pub(crate) is_given: bool,
}

/// The lists of an axis.
#[derive(Clone, Copy)]
enum List {
    Triangle,
    Scores,
    Timing,
}

const LISTS: [List; 3] = [List::Triangle, List::Scores, List::Timing];

impl List {
    const fn name(self) -> &'static str {
        match self {
            Self::Triangle => "triangle",
            Self::Scores => "scores",
            Self::Timing => "timing",
        }
    }

    const fn of(self, own: &AxisEquations) -> &Arc<[f64]> {
        match self {
            Self::Triangle => &own.triangle,
            Self::Scores => &own.scores,
            Self::Timing => &own.timing,
        }
    }
}

/// Names of a craft's columns and where they are.
pub(crate) type Places = HashMap<String, HashMap<String, usize>>;

impl Index {
    /// As a Parquet file, with more causes than its own: equal indexes give equal bytes.
    pub(crate) fn encode(
        &self,
        references: &BTreeMap<String, Reference>,
        more_causes: &BTreeMap<String, Value>,
    ) -> Result<Vec<u8>, ParquetError> {
        let mut table = self.plain_table(more_causes);
        for (axis, name) in axis_names().into_iter().enumerate() {
            let names = |row: &Row| {
                let Some(reference) = references.get(&row.craft) else { return String::new() };
                let own = row.equations.axes[axis].parameters.iter();
                own.map(|k| reference.columns.parameters[*k].name()).collect::<Vec<_>>().join(" ")
            };
            table.push(format!("columns_{name}"), Values::Text(self.rows.iter().map(names).collect()));
            let sigma = self.rows.iter().map(|row| row.equations.axes[axis].sigma).collect();
            table.push(format!("sigma_{name}"), Values::Real(sigma));
            for list in LISTS {
                let lists = self.rows.iter().map(|row| list.of(&row.equations.axes[axis]).clone()).collect();
                table.push(format!("{}_{name}", list.name()), Values::Lists(lists));
            }
        }
        table.to_parquet()
    }

    /// The columns but for the equations'.
    fn plain_table(&self, more_causes: &BTreeMap<String, Value>) -> Table {
        let rows = &self.rows;
        let text = |of: &dyn Fn(&Row) -> String| Values::Text(rows.iter().map(of).collect());
        let real = |of: &dyn Fn(&Row) -> f64| Values::Real(rows.iter().map(of).collect());
        let whole = |of: &dyn Fn(&Row) -> i64| Values::Whole(rows.iter().map(of).collect());
        let lists =
            |of: &dyn Fn(&Row) -> &[f64]| Values::Lists(rows.iter().map(|row| of(row).into()).collect());
        let mut table = Table { about: self.about(more_causes), ..Table::default() };
        table.push("craft", text(&|row| row.craft.clone()));
        table.push("file", text(&|row| row.file.clone()));
        table.push("part", whole(&|row| row.part as i64));
        table.push("name", text(&|row| row.name.clone()));
        table.push("bytes", whole(&|row| row.bytes as i64));
        table.push("changed_ns", whole(&|row| row.changed_ns));
        table.push("sha256", text(&|row| row.sha256.clone()));
        table.push("context", text(&|row| row.context.clone()));
        table.push("state", text(&|row| word(&row.state)));
        table.push("why", text(&|row| row.why.clone()));
        table.push("logged_unix_s", real(&|row| row.logged_unix_s.unwrap_or(f64::NAN)));
        table.push("airborne_s", real(&|row| row.airborne_s));
        table.push("parts_s", lists(&|row| &row.parts_s));
        table.push("period_s", real(&|row| row.period_s));
        table.push("mean_v", real(&|row| row.mean_v));
        table.push("lowest_v", real(&|row| row.lowest_v));
        table.push("late_s", real(&|row| row.late_s));
        table.push("motor_shares", lists(&|row| &row.motor_shares));
        table.push("mean_command", real(&|row| row.mean_command));
        table.push("faults", text(&|row| serde_json::to_string(&row.faults).unwrap_or_default()));
        table.push("rows", whole(&|row| row.equations.rows as i64));
        table.push("record_s", real(&|row| row.equations.record_s));
        table
    }

    fn about(&self, more_causes: &BTreeMap<String, Value>) -> Vec<(String, String)> {
        let causes: BTreeMap<&String, &Value> = self.causes.iter().chain(more_causes).collect();
        let units = json!({
            "bytes": "bytes", "changed_ns": "ns since 1970", "logged_unix_s": "s since 1970", "airborne_s": "s", "parts_s": "s",
            "period_s": "s", "mean_v": "V", "lowest_v": "V", "late_s": "s", "record_s": "s",
            "motor_shares": "1", "mean_command": "the vehicle file's command_unit",
            "triangle_u v w": "upper triangle R of [columns | target], column by column; target in m/s^2, columns in that per unit of the coefficient",
            "triangle_p q r": "the same in rad/s^2",
            "scores_": "upper triangle of the covariance of X'e, column by column",
            "timing_": "change of X'e by the log's jitter",
            "sigma_": "m/s^2 for u v w, rad/s^2 for p q r",
        });
        vec![
            ("quadlab".into(), "fleet index".into()),
            ("version".into(), VERSION.into()),
            ("units".into(), units.to_string()),
            ("references".into(), serde_json::to_string(&self.references).unwrap_or_default()),
            ("causes".into(), serde_json::to_string(&causes).unwrap_or_default()),
            ("judged".into(), self.judged.clone()),
        ]
    }

    /// Reads an index; nothing where the file is none, or of another version.
    pub(crate) fn read(path: &Path) -> Result<Option<Self>, FleetError> {
        let file = match std::fs::File::open(path) {
            Ok(file) => file,
            Err(why) if why.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(why) => return Err(FleetError::Read { path: path.into(), why }),
        };
        let Ok(table) = Table::from_file(file) else {
            return Err(FleetError::content(
                path,
                "is no index of a fleet; remove it, or give another --index",
            ));
        };
        if table.says("quadlab") != Some("fleet index") {
            return Err(FleetError::content(path, "is no index of a fleet; give another --index"));
        }
        if table.says("version") != Some(VERSION) {
            return Ok(None);
        }
        let damaged = || FleetError::content(path, "is damaged; remove it, and the flights are read again");
        Self::of_table(&table).map(Some).ok_or_else(damaged)
    }

    fn of_table(table: &Table) -> Option<Self> {
        let references: BTreeMap<String, KeptReference> =
            serde_json::from_str(table.says("references")?).ok()?;
        let causes = serde_json::from_str(table.says("causes")?).ok()?;
        let mut places = Places::new();
        for (craft, kept) in &references {
            let model = model::Model::parse(&kept.model, Path::new(craft)).ok();
            let columns = model.map(|model| crate::equations::Columns::about(&model).parameters);
            let named = columns.into_iter().flatten().enumerate().map(|(k, own)| (own.name(), k));
            places.insert(craft.clone(), named.collect());
        }
        let mut rows = plain_rows(table)?;
        for (axis, name) in axis_names().into_iter().enumerate() {
            let mut all = of_axis(table, name, &rows, &places)?;
            for (row, own) in rows.iter_mut().zip(&mut all) {
                row.equations.axes[axis] = std::mem::take(own);
            }
        }
        // Indexes from before that was kept were not looked at for it.
        let judged = table.says("judged").unwrap_or_default().to_owned();
        Some(Self { rows, references, causes, judged })
    }
}

/// The rows but for their equations' axes.
fn plain_rows(table: &Table) -> Option<Vec<Row>> {
    let text = |name: &str| table.text(name);
    let (craft, file, name) = (text("craft")?, text("file")?, text("name")?);
    let (sha256, context, state, why) = (text("sha256")?, text("context")?, text("state")?, text("why")?);
    let faults = text("faults")?;
    let whole = |name: &str| table.whole(name);
    let (part, bytes, changed_ns, rows) =
        (whole("part")?, whole("bytes")?, whole("changed_ns")?, whole("rows")?);
    let real = |name: &str| table.real(name);
    let (logged, airborne, period) = (real("logged_unix_s")?, real("airborne_s")?, real("period_s")?);
    let (mean_v, lowest_v, late) = (real("mean_v")?, real("lowest_v")?, real("late_s")?);
    let (command, record) = (real("mean_command")?, real("record_s")?);
    let (parts, shares) = (table.lists("parts_s")?, table.lists("motor_shares")?);
    (0..table.rows())
        .map(|k| {
            Some(Row {
                craft: craft[k].clone(),
                file: file[k].clone(),
                part: usize::try_from(part[k]).ok()?,
                name: name[k].clone(),
                bytes: u64::try_from(bytes[k]).ok()?,
                changed_ns: changed_ns[k],
                sha256: sha256[k].clone(),
                context: context[k].clone(),
                state: of_word(&state[k])?,
                why: why[k].clone(),
                logged_unix_s: Some(logged[k]).filter(|time| time.is_finite()),
                airborne_s: airborne[k],
                parts_s: parts[k].to_vec(),
                period_s: period[k],
                mean_v: mean_v[k],
                lowest_v: lowest_v[k],
                late_s: late[k],
                motor_shares: shares[k][..].try_into().ok()?,
                mean_command: command[k],
                faults: serde_json::from_str(&faults[k]).ok()?,
                equations: Equations {
                    rows: usize::try_from(rows[k]).ok()?,
                    record_s: record[k],
                    ..Equations::default()
                },
            })
        })
        .collect()
}

/// The equations of all flights on an axis.
fn of_axis(table: &Table, axis: &str, rows: &[Row], places: &Places) -> Option<Vec<AxisEquations>> {
    let lists = |list: List| table.lists(&format!("{}_{axis}", list.name()));
    let (triangle, scores, timing) = (lists(List::Triangle)?, lists(List::Scores)?, lists(List::Timing)?);
    let (names, sigma) = (table.text(&format!("columns_{axis}"))?, table.real(&format!("sigma_{axis}"))?);
    // Flights of a craft mostly have the same columns.
    let mut known: HashMap<(&str, &str), Vec<usize>> = HashMap::new();
    (0..rows.len())
        .map(|k| {
            let key = (rows[k].craft.as_str(), names[k].as_str());
            let parameters = match known.entry(key) {
                Entry::Occupied(own) => own.into_mut(),
                Entry::Vacant(own) => {
                    let at = |name: &str| places.get(key.0)?.get(name).copied();
                    own.insert(key.1.split_whitespace().map(at).collect::<Option<Vec<usize>>>()?)
                }
            };
            Some(AxisEquations {
                parameters: parameters.clone(),
                triangle: triangle[k].clone(),
                scores: scores[k].clone(),
                timing: timing[k].clone(),
                sigma: sigma[k],
            })
        })
        .collect()
}
