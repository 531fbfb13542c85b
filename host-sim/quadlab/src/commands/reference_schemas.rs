//! JSON Schemas of the documents that commands print with `--json`, from the types that they are made of.

use std::path::Path;

use ::design::check::CheckReport;
use diagnosis::{Diagnosis, Why, WhyChanged};
use schemars::generate::SchemaSettings;
use schemars::transform::{RecursiveTransform, Transform as _};
use schemars::{JsonSchema, Schema};
use serde_json::json;
use sysid::Comparison;

use crate::cli::faults::WithFaults;
use crate::commands::{
    add, campaign_documents, compare, design, design_report, effects, excite, explain, export, identify,
    import, linearize, motor_map, plan,
};
use crate::render::discovery;

/// Writes the schemas, one file a document.
pub(crate) fn write(folder: &Path) -> anyhow::Result<()> {
    for (name, command, schema) in schemas() {
        let mut schema = schema;
        schema.insert("title".to_owned(), json!(format!("quadlab {command} --json")));
        let text = serde_json::to_string_pretty(&schema)? + "\n";
        report::write_atomic(folder.join(format!("{name}.json")), text)?;
    }
    Ok(())
}

/// File name, command and schema of each document.
fn schemas() -> [(&'static str, &'static str, Schema); 25] {
    [
        ("import", "import", of::<import::Document>()),
        ("identify", "identify", of::<WithFaults<identify::Document>>()),
        ("compare", "compare", of::<WithFaults<Comparison>>()),
        ("compare-models", "compare with several models", of::<WithFaults<compare::SideBySide>>()),
        ("diagnose", "diagnose", of::<WithFaults<Diagnosis>>()),
        ("diagnose-why", "diagnose --why", of::<Why>()),
        ("diagnose-changed-why", "diagnose --changed --why", of::<WhyChanged>()),
        ("add", "add", of::<WithFaults<add::Document>>()),
        ("explain", "explain", of::<WithFaults<explain::Document>>()),
        ("discover", "discover", of::<WithFaults<discovery::Document>>()),
        ("effects", "effects", of::<Vec<effects::Entry>>()),
        ("linearize", "linearize", of::<linearize::Document>()),
        ("export", "export", of::<export::Document>()),
        ("design", "design", of::<design::Document>()),
        ("design-check", "design check", of::<CheckReport>()),
        ("design-report", "design report", of::<design_report::Document>()),
        ("motor-map", "motor-map", of::<motor_map::Document>()),
        ("excite", "excite", of::<excite::Document>()),
        ("plan", "plan", of::<plan::Document>()),
        ("fleet", "fleet", of::<fleet::Answer>()),
        ("campaign", "campaign report", of::<campaign::Summary>()),
        ("campaign-plan", "campaign plan", of::<campaign_documents::Planned>()),
        ("campaign-replay", "campaign replay", of::<campaign_documents::Replayed>()),
        ("campaign-why", "campaign why", of::<campaign::Causes>()),
        ("campaign-search", "campaign search", of::<campaign::Found>()),
    ]
}

/// The schema of what `T` is serialised to.
fn of<T: JsonSchema>() -> Schema {
    let generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let mut schema = generator.into_root_schema_for::<T>();
    RecursiveTransform(nullable_number).transform(&mut schema);
    schema
}

/// A figure that is not a number, such as the error of a row that the model does not have, is written as `null`.
fn nullable_number(schema: &mut Schema) {
    let is_float = schema.get("format").is_some_and(|format| format == "double" || format == "float");
    if is_float && schema.get("type").is_some_and(|kind| kind == "number") {
        schema.insert("type".to_owned(), json!(["number", "null"]));
    }
}
