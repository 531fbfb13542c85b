//! What the page is told where something cannot be done: a sentence, with what to do.

use axum::Json;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// A sentence for the user: of any error, so that `?` makes it.
#[derive(Debug)]
pub(super) struct Refused(pub(super) String);

impl<E: std::error::Error> From<E> for Refused {
    fn from(error: E) -> Self {
        Self(error.to_string())
    }
}

/// A refusal as the page shows it.
pub(super) fn refusal(status: StatusCode, sentence: &str) -> Response {
    (status, Json(json!({ "error": sentence }))).into_response()
}

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let status =
            if self.0.contains("is running") { StatusCode::CONFLICT } else { StatusCode::BAD_REQUEST };
        refusal(status, &self.0)
    }
}
