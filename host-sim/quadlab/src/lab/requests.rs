//! What requests carry, and how they are answered.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use axum::Json;
use axum::extract::{FromRequest, FromRequestParts, Query, Request, State};
use axum::http::request::Parts;
use axum::response::Response;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::refused::{Refused, refusal};
use super::session::Session;

pub(super) type Shared = State<Arc<Session>>;
pub(super) type Answer = Result<Json<Value>, Refused>;

/// What stands behind the question mark; a mistake in it is told as every other one.
pub(super) struct Asked<T>(pub(super) T);

impl<T: DeserializeOwned, S: Sync> FromRequestParts<S> for Asked<T> {
    type Rejection = Refused;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Refused> {
        let asked = Query::try_from_uri(&parts.uri);
        asked.map(|Query(asked)| Self(asked)).map_err(|error| {
            Refused::new(format!("the address is not one of the page's: {}", error.body_text()))
        })
    }
}

/// What a request carries; a mistake in it is told as every other one.
pub(super) struct Sent<T>(pub(super) T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Sent<T> {
    type Rejection = Response;

    async fn from_request(request: Request, state: &S) -> Result<Self, Response> {
        let sent = Json::from_request(request, state).await;
        sent.map(|Json(sent)| Self(sent)).map_err(|error| {
            refusal(error.status(), &format!("the request is not one of the page's: {}", error.body_text()))
        })
    }
}

/// Work that takes longer than a moment, beside the server's own thread.
pub(super) async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refused> + Send + 'static,
) -> Result<T, Refused> {
    let done = tokio::task::spawn_blocking(work).await;
    done.unwrap_or_else(|_| Err(Refused::new("this could not be computed: a bug of quadlab")))
}

/// Stops work when nobody waits for it any longer: it is dropped with the request.
pub(super) struct StopOnDrop(Arc<AtomicBool>);

impl StopOnDrop {
    /// With what the work is told by.
    pub(super) fn new() -> (Self, Arc<AtomicBool>) {
        let cancel = Arc::new(AtomicBool::new(false));
        (Self(cancel.clone()), cancel)
    }
}

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}
