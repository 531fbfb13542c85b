//! What the page is told where something cannot be done: a sentence, with what to do.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// A sentence for the user: of any error, so that `?` makes it. It is one short line, whatever a file's name or a field holds.
#[derive(Debug)]
pub(super) struct Refused(String);

impl Refused {
    pub(super) fn new(sentence: impl AsRef<str>) -> Self {
        Self(report::error_line(sentence.as_ref()))
    }

    pub(super) fn sentence(&self) -> &str {
        &self.0
    }

    pub(super) fn into_sentence(self) -> String {
        self.0
    }
}

impl<E: std::error::Error> From<E> for Refused {
    fn from(error: E) -> Self {
        Self::new(error.to_string())
    }
}

/// A refusal as the page shows it.
pub(super) fn refusal(status: StatusCode, sentence: &str) -> Response {
    (status, Json(json!({ "error": report::error_line(sentence) }))).into_response()
}

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let status =
            if self.0.contains("is running") { StatusCode::CONFLICT } else { StatusCode::BAD_REQUEST };
        refusal(status, &self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_in_an_error_steers_neither_page_nor_terminal() {
        let name = format!("fly\u{202e}vsc.csv\n\u{1b}[2J{}", "x".repeat(4000));
        let refused = Refused::new(format!("{name}: cannot be read"));
        let sentence = refused.sentence();
        assert!(sentence.chars().count() <= report::LONGEST_ERROR, "{sentence}");
        assert!(!sentence.contains(['\u{202e}', '\n', '\u{1b}']), "{sentence:?}");
        assert!(sentence.ends_with(": cannot be read"), "{sentence}");
    }
}
