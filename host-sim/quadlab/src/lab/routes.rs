//! What the page can ask for.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{DefaultBodyLimit, Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use diagnosis::workflow;
use model::{AXES, Axis, Model};
use serde::Deserialize;
use serde_json::{Value, json};

use super::flights::Use;
use super::jobs::{self, Task};
use super::notes::Noted;
use super::numbers::Window;
use super::refused::{Refused, refusal};
use super::requests::{Answer, Asked, Sent, Shared, StopOnDrop, aside};
use super::session::{Session, Telling};
use super::used_parts::UsedParts;
use super::vehicle::Measured;
use super::views::{self, Beside, Series};
use super::{assets, equations, next, own_routes, upload};
use crate::cli::effect_names::known_effect;
use crate::render::documents::coefficient_entries;

/// No request of the page is longer, bytes.
const LONGEST_BODY: usize = 1 << 20;

/// All addresses.
pub(super) fn router(session: Arc<Session>) -> Router {
    Router::new()
        .route("/", get(async || page("index.html")))
        .route("/page/{name}", get(async |Path(name): Path<String>| page(&name)))
        .route("/api/state", get(async |State(session): Shared| Json(session.document())))
        .route("/api/events", get(async |State(session): Shared| session.events.stream()))
        .route("/api/sets", post(choose))
        .route("/api/use", post(use_parts))
        .route("/api/notes", post(note))
        .route("/api/current", post(go_to))
        .route("/api/jobs", post(start))
        .route(
            "/api/cancel",
            post(async |State(session): Shared| {
                jobs::cancel(&session);
                Json(json!({}))
            }),
        )
        .route("/api/vehicle", get(vehicle).post(write_vehicle))
        .route("/api/upload", post(take_file).layer(DefaultBodyLimit::disable()))
        .route("/api/read", post(read_again))
        .route("/api/demo", post(fly_demo))
        .route("/api/model", get(model))
        .route("/api/comparison", get(comparison))
        .route("/api/diagnosis", get(diagnosis))
        .route("/api/changes", get(changes))
        .route("/api/discovery", get(discovery))
        .route("/api/why", get(why))
        .route("/api/series", get(series))
        .route("/api/quantities", get(quantities))
        .route("/api/residual", get(residual))
        .route("/api/spectrum", get(spectrum))
        .route("/api/path", get(path))
        .route("/api/room", get(room))
        .route("/api/timeline", get(timeline))
        .route("/api/next", get(next_flight))
        .route("/api/download/model.toml", get(model_file))
        .route("/api/download/series.csv", get(series_text))
        .route("/api/download/series.parquet", get(series_parquet))
        .route("/api/download/report.html", get(report))
        .nest("/api/effects", own_routes::router())
        .fallback(async || {
            refusal(StatusCode::NOT_FOUND, "there is nothing at this address: open the lab's first page")
        })
        .layer(DefaultBodyLimit::max(LONGEST_BODY))
        .with_state(session)
}

fn page(name: &str) -> Response {
    match assets::file(name) {
        Some((bytes, kind)) => ([(header::CONTENT_TYPE, kind)], bytes).into_response(),
        None => refusal(StatusCode::NOT_FOUND, "the page has no such file"),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Choice {
    name: String,
    set: Use,
}

async fn choose(State(session): Shared, Sent(Choice { name, set }): Sent<Choice>) -> Answer {
    session.choose(&name, set)?;
    Ok(Json(session.document()))
}

async fn use_parts(State(session): Shared, Sent(asked): Sent<UsedParts>) -> Answer {
    aside(move || {
        session.use_parts(&asked)?;
        Ok(Json(session.document()))
    })
    .await
}

async fn note(State(session): Shared, Sent(noted): Sent<Noted>) -> Answer {
    session.note(noted)?;
    Ok(Json(session.document()))
}

#[derive(Deserialize)]
struct OfModel {
    model: u32,
}

async fn go_to(State(session): Shared, Sent(OfModel { model }): Sent<OfModel>) -> Answer {
    session.go_to(model)?;
    Ok(Json(session.document()))
}

async fn start(State(session): Shared, Sent(task): Sent<Task>) -> Answer {
    jobs::start(&session, task)?;
    Ok(Json(json!({})))
}

async fn vehicle(State(session): Shared) -> Answer {
    let craft = session.lock().craft.clone();
    let craft =
        craft.ok_or_else(|| Refused::new("no flight tells of a craft yet: drop flights on the page"))?;
    Ok(Json(craft.document()))
}

async fn write_vehicle(State(session): Shared, Sent(measured): Sent<Measured>) -> Answer {
    session.write_vehicle(&measured)?;
    Ok(Json(session.document()))
}

async fn read_again(State(session): Shared) -> Answer {
    session.read_again()?;
    Ok(Json(session.document()))
}

async fn fly_demo(State(session): Shared) -> Answer {
    session.fly_demo()?;
    Ok(Json(session.document()))
}

#[derive(Deserialize)]
struct Named {
    name: String,
}

async fn take_file(State(session): Shared, Asked(Named { name }): Asked<Named>, body: Body) -> Answer {
    upload::take(session, name, body).await?;
    Ok(Json(json!({})))
}

#[derive(Deserialize)]
struct Id {
    id: u32,
}

async fn model(State(session): Shared, Asked(Id { id }): Asked<Id>) -> Answer {
    let model = session.node(id)?.model;
    Ok(Json(model_document(&model)))
}

fn model_document(model: &Model) -> Value {
    json!({
        "coefficients": coefficient_entries(model),
        "equations": model.effects().into_iter().map(equations::of).collect::<Vec<_>>(),
        "physical": equations::physical(model),
        "toml": model.to_toml(),
    })
}

async fn comparison(State(session): Shared, Asked(Id { id }): Asked<Id>) -> Answer {
    aside(move || Ok(Json(serde_json::to_value(&*session.comparison(id)?)?))).await
}

async fn diagnosis(
    State(session): Shared,
    Asked(OfModel { model }): Asked<OfModel>,
) -> Result<Response, Refused> {
    Ok(match session.node(model)?.diagnosis {
        Some(diagnosis) => Json(diagnosis).into_response(),
        None => refusal(StatusCode::NOT_FOUND, "this model has not been diagnosed yet: press Diagnose"),
    })
}

async fn changes(
    State(session): Shared,
    Asked(OfModel { model }): Asked<OfModel>,
) -> Result<Response, Refused> {
    Ok(match session.node(model)?.changes {
        Some(changes) => Json(changes).into_response(),
        None => refusal(
            StatusCode::NOT_FOUND,
            "nobody has asked what changed since this model: mark flights as flown later, and press What changed?",
        ),
    })
}

async fn discovery(
    State(session): Shared,
    Asked(OfModel { model }): Asked<OfModel>,
) -> Result<Response, Refused> {
    Ok(match session.node(model)?.discovery {
        Some(discovery) => Json(discovery).into_response(),
        None => refusal(StatusCode::NOT_FOUND, "nobody has asked what this model lacks: press Discover"),
    })
}

#[derive(Deserialize)]
struct OfEffect {
    model: u32,
    effect: String,
}

async fn why(State(session): Shared, Asked(OfEffect { model, effect }): Asked<OfEffect>) -> Answer {
    aside(move || {
        let node = session.node(model)?;
        let effect = known_effect(&effect)?;
        let telling = Telling { session: &session, kind: "why", cancel: None };
        let mut sets = session.sets(&node.model.vehicle, &telling)?;
        let why = workflow::why(
            &node.model,
            effect,
            &session.own_effects(),
            &mut sets,
            &diagnosis::Options::default(),
            &telling,
        )?;
        Ok(Json(serde_json::to_value(&why).unwrap_or_default()))
    })
    .await
}

#[derive(Deserialize)]
struct OfSeries {
    model: u32,
    flight: String,
    from: Option<f64>,
    to: Option<f64>,
    width: Option<usize>,
    ahead: Option<usize>,
    /// One that the model has not, and is fitted with to be looked at.
    effect: Option<String>,
    /// A flight whose start its own goes to.
    beside: Option<String>,
    /// So much later, s.
    shift: Option<f64>,
}

async fn series(State(session): Shared, Asked(asked): Asked<OfSeries>) -> Result<Json<Series>, Refused> {
    let (_stop, cancel) = StopOnDrop::new();
    aside(move || {
        let look = |flight: &str| session.seen_with(asked.model, asked.effect.as_deref(), flight, &cancel);
        let (seen, other) = (look(&asked.flight)?, asked.beside.as_deref().map(look).transpose()?);
        let window = Window::new(asked.from, asked.to, asked.width);
        Ok(Json(match &other {
            Some(other) => {
                let shift_s = asked.shift.filter(|s| s.is_finite()).unwrap_or(0.0);
                seen.series_beside(&Beside { other, shift_s }, asked.ahead, window)
            }
            None => seen.series(asked.ahead, window),
        }))
    })
    .await
}

async fn quantities(State(session): Shared) -> Answer {
    let current = session.lock().current;
    let Some(id) = current else { return Ok(Json(json!([]))) };
    aside(move || {
        let (names, has_place) = session.flight_names();
        let Some(first) = names.first() else { return Ok(Json(json!([]))) };
        Ok(Json(session.seen(id, first)?.quantities(has_place)))
    })
    .await
}

/// The axis of a name.
fn axis(name: &str) -> Result<Axis, Refused> {
    let found = AXES.into_iter().find(|axis| axis.name() == name);
    found.ok_or_else(|| Refused::new(format!("{name}: is none of the axes u, v, w, p, q and r")))
}

#[derive(Deserialize)]
struct OfResidual {
    model: u32,
    axis: String,
    quantity: String,
    flight: Option<String>,
    /// As in a series.
    effect: Option<String>,
}

/// The flight that is asked for, or all.
fn one_or_all(session: &Session, flight: Option<String>) -> Vec<String> {
    flight.map_or_else(|| session.flight_names().0, |name| vec![name])
}

async fn residual(State(session): Shared, Asked(asked): Asked<OfResidual>) -> Answer {
    let (_stop, cancel) = StopOnDrop::new();
    aside(move || {
        let names = one_or_all(&session, asked.flight);
        let look = |name: &String| session.seen_with(asked.model, asked.effect.as_deref(), name, &cancel);
        let seen = names.iter().map(look);
        Ok(Json(views::residual(seen, axis(&asked.axis)?, &asked.quantity)?))
    })
    .await
}

#[derive(Deserialize)]
struct OfAxis {
    model: u32,
    flight: String,
    axis: String,
}

async fn spectrum(State(session): Shared, Asked(asked): Asked<OfAxis>) -> Answer {
    aside(move || Ok(Json(session.seen(asked.model, &asked.flight)?.spectrum(axis(&asked.axis)?)))).await
}

async fn path(State(session): Shared, Asked(asked): Asked<OfAxis>) -> Answer {
    aside(move || Ok(Json(session.seen(asked.model, &asked.flight)?.path(axis(&asked.axis)?)))).await
}

#[derive(Deserialize)]
struct OfRoom {
    model: u32,
    axis: String,
    flight: Option<String>,
}

async fn room(State(session): Shared, Asked(asked): Asked<OfRoom>) -> Answer {
    aside(move || {
        let names = one_or_all(&session, asked.flight);
        let seen = names.iter().map(|name| session.seen(asked.model, name));
        Ok(Json(views::room(seen, axis(&asked.axis)?)?))
    })
    .await
}

#[derive(Deserialize)]
struct OfTwo {
    model: u32,
    effect: String,
    other: String,
}

async fn next_flight(State(session): Shared, Asked(of): Asked<OfTwo>) -> Answer {
    aside(move || Ok(Json(next::flight(&session, of.model, [&of.effect, &of.other])?))).await
}

async fn timeline(State(session): Shared, Asked(OfModel { model }): Asked<OfModel>) -> Answer {
    aside(move || Ok(Json(session.timeline(model)?))).await
}

/// A file to keep.
fn download(name: &str, kind: &'static str, content: impl Into<Body>) -> Response {
    let safe: String =
        name.chars().map(|c| if c.is_ascii_alphanumeric() || "._-".contains(c) { c } else { '_' }).collect();
    let disposition = format!("attachment; filename=\"{safe}\"");
    ([(header::CONTENT_TYPE, kind.to_owned()), (header::CONTENT_DISPOSITION, disposition)], content.into())
        .into_response()
}

async fn model_file(State(session): Shared, Asked(Id { id }): Asked<Id>) -> Result<Response, Refused> {
    let model = session.node(id)?.model;
    Ok(download(&format!("model-{id}.toml"), "application/toml", model.to_toml()))
}

async fn report(State(session): Shared, Asked(Id { id }): Asked<Id>) -> Result<Response, Refused> {
    aside(move || {
        let text = session.report(id)?;
        Ok(download(&format!("model-{id}.html"), "text/html; charset=utf-8", text))
    })
    .await
}

#[derive(Deserialize)]
struct OfFlight {
    model: u32,
    flight: String,
}

async fn series_text(State(session): Shared, Asked(of): Asked<OfFlight>) -> Result<Response, Refused> {
    aside(move || {
        let table = session.seen(of.model, &of.flight)?.table();
        Ok(download(&of.file("csv"), "text/csv; charset=utf-8", table.to_csv()))
    })
    .await
}

async fn series_parquet(State(session): Shared, Asked(of): Asked<OfFlight>) -> Result<Response, Refused> {
    aside(move || {
        let mut table = session.seen(of.model, &of.flight)?.table();
        table.about = vec![("model".into(), of.model.to_string()), ("flight".into(), of.flight.clone())];
        Ok(download(&of.file("parquet"), "application/vnd.apache.parquet", table.to_parquet()?))
    })
    .await
}

impl OfFlight {
    /// What a file about it is called.
    fn file(&self, extension: &str) -> String {
        // Of a log's name all is kept: it may hold several flights.
        let name = self.flight.strip_suffix(".csv").unwrap_or(&self.flight);
        format!("model-{}-{name}.{extension}", self.model)
    }
}
