//! What `quadlab reference` writes, and documents against the schemas in it.
#![allow(dead_code, reason = "each test file uses a part of this module")]

use std::path::PathBuf;

use serde_json::Value;
use tempfile::TempDir;

use crate::common::done_in;

/// What `quadlab reference` wrote, once for each test; it goes when the test's thread ends (a static would stay).
pub(crate) fn reference() -> PathBuf {
    thread_local! {
        static FOLDER: TempDir = {
            let folder = tempfile::tempdir().expect("a temporary folder");
            done_in(folder.path(), &["reference", "--out", "."]);
            folder
        };
    }
    FOLDER.with(|folder| folder.path().to_owned())
}

/// A document against the schema of this name.
pub(crate) fn assert_valid(schema: &str, document: &Value) {
    let path = reference().join("schema").join(format!("{schema}.json"));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|why| panic!("{}: {why}", path.display()));
    let validator = jsonschema::validator_for(&serde_json::from_str(&text).unwrap()).unwrap();
    let problems: Vec<String> =
        validator.iter_errors(document).map(|e| format!("{}: {e}", e.instance_path())).collect();
    assert!(problems.is_empty(), "{schema}: {problems:#?}");
    // A schema that allows everything would show nothing.
    assert!(!validator.is_valid(&Value::Bool(true)), "{schema} allows anything");
    if let Value::Object(fields) = document {
        let mut fewer = fields.clone();
        fewer.remove(fields.keys().next().expect("a document has fields"));
        assert!(!validator.is_valid(&Value::Object(fewer)), "{schema} misses no field");
    }
}
