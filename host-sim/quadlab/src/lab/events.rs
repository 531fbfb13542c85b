//! What the page is told while it is open, as server-sent events.

use std::convert::Infallible;

use axum::response::sse::{Event, KeepAlive, Sse};
use futures_util::stream::{self, Stream};
use serde_json::Value;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::broadcast::{Receiver, Sender};

/// Events that a page may be behind before it is told to read the whole state again.
const BACKLOG: usize = 256;

/// Something that happened.
#[derive(Debug, Clone)]
struct Told {
    name: &'static str,
    data: Value,
}

/// Tells all open pages.
#[derive(Debug, Clone)]
pub(super) struct Events(Sender<Told>);

impl Events {
    pub(super) fn new() -> Self {
        Self(Sender::new(BACKLOG))
    }

    /// Tells every page that listens, if any does.
    pub(super) fn tell(&self, name: &'static str, data: Value) {
        let _ = self.0.send(Told { name, data });
    }

    /// The state has changed.
    pub(super) fn changed(&self) {
        self.tell("state", Value::Object(serde_json::Map::new()));
    }

    /// A stream for one page.
    pub(super) fn stream(&self) -> Sse<impl Stream<Item = Result<Event, Infallible>> + use<>> {
        Sse::new(stream::unfold(self.0.subscribe(), next)).keep_alive(KeepAlive::default())
    }
}

async fn next(mut receiver: Receiver<Told>) -> Option<(Result<Event, Infallible>, Receiver<Told>)> {
    let event = match receiver.recv().await {
        Ok(Told { name, data }) => Event::default().event(name).data(data.to_string()),
        // What was missed is in the state.
        Err(RecvError::Lagged(_)) => Event::default().event("state").data("{}"),
        Err(RecvError::Closed) => return None,
    };
    Some((Ok(event), receiver))
}
