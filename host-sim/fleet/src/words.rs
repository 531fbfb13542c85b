//! Values of a list of names, as the words that they have in JSON.

use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// The word for a value.
pub(crate) fn word(value: &impl Serialize) -> String {
    match serde_json::to_value(value) {
        Ok(Value::String(word)) => word,
        _ => String::new(),
    }
}

/// What a word stands for.
pub(crate) fn of_word<T: DeserializeOwned>(word: &str) -> Option<T> {
    serde_json::from_value(Value::String(word.into())).ok()
}
