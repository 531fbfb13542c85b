//! What the page can ask for of effects that the user writes on it.

use std::sync::Arc;

use axum::extract::State;
use axum::routing::{get, post};
use axum::{Json, Router};
use serde::Deserialize;

use super::numbers::Window;
use super::own_effect;
use super::refused::Refused;
use super::requests::{Answer, Sent, Shared, StopOnDrop, aside};
use super::session::Session;
use super::views::Contributions;

/// The addresses below `/api/effects`.
pub(super) fn router() -> Router<Arc<Session>> {
    Router::new()
        .route("/names", get(async || Json(own_effect::names())))
        .route("/check", post(check))
        .route("/preview", post(preview))
        .route("/try", post(try_out))
        .route("/keep", post(keep))
        .route("/remove", post(remove))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    text: String,
}

async fn check(State(session): Shared, Sent(Text { text }): Sent<Text>) -> Answer {
    aside(move || Ok(Json(session.check_effect(&text)))).await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfFlight {
    text: String,
    model: u32,
    flight: String,
    from: Option<f64>,
    to: Option<f64>,
    width: Option<usize>,
}

async fn preview(
    State(session): Shared,
    Sent(asked): Sent<OfFlight>,
) -> Result<Json<Contributions>, Refused> {
    aside(move || {
        let effect = session.draft(&asked.text)?;
        let window = Window::new(asked.from, asked.to, asked.width);
        Ok(Json(session.seen(asked.model, &asked.flight)?.contributions(effect, window)?))
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfModel {
    text: String,
    model: u32,
}

async fn try_out(State(session): Shared, Sent(asked): Sent<OfModel>) -> Answer {
    let (_stop, cancel) = StopOnDrop::new();
    aside(move || {
        let why = session.try_effect(asked.model, &asked.text, cancel)?;
        Ok(Json(serde_json::to_value(why).unwrap_or_default()))
    })
    .await
}

async fn keep(State(session): Shared, Sent(Text { text }): Sent<Text>) -> Answer {
    aside(move || {
        session.keep_effect(&text)?;
        Ok(Json(session.document()))
    })
    .await
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Id {
    id: String,
}

async fn remove(State(session): Shared, Sent(Id { id }): Sent<Id>) -> Answer {
    aside(move || {
        session.remove_effect(&id)?;
        Ok(Json(session.document()))
    })
    .await
}
