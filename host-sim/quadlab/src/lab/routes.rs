//! What the page can ask for.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{DefaultBodyLimit, FromRequest, FromRequestParts, Path, Query, Request, State};
use axum::http::request::Parts;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use diagnosis::workflow;
use model::{AXES, Axis, Model};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use sysid::Comparison;

use super::flights::Use;
use super::jobs::{self, Task};
use super::numbers::Window;
use super::refused::{Refused, refusal};
use super::session::{Session, Telling};
use super::views::{Beside, Series};
use super::{assets, equations, next};
use crate::cli::effect_names::known_effect;
use crate::render::documents::coefficient_entries;

/// No request of the page is longer, bytes.
const LONGEST_BODY: usize = 1 << 20;

type Shared = State<Arc<Session>>;
type Answer = Result<Json<Value>, Refused>;

/// All addresses.
pub(super) fn router(session: Arc<Session>) -> Router {
    Router::new()
        .route("/", get(async || page("index.html")))
        .route("/page/{name}", get(async |Path(name): Path<String>| page(&name)))
        .route("/api/state", get(async |State(session): Shared| Json(session.document())))
        .route("/api/events", get(async |State(session): Shared| session.events.stream()))
        .route("/api/sets", post(choose))
        .route("/api/current", post(go_to))
        .route("/api/jobs", post(start))
        .route(
            "/api/cancel",
            post(async |State(session): Shared| {
                jobs::cancel(&session);
                Json(json!({}))
            }),
        )
        .route("/api/model", get(model))
        .route("/api/diagnosis", get(diagnosis))
        .route("/api/changes", get(changes))
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

/// What stands behind the question mark; a mistake in it is told as every other one.
struct Asked<T>(T);

impl<T: DeserializeOwned, S: Sync> FromRequestParts<S> for Asked<T> {
    type Rejection = Refused;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Refused> {
        let asked = Query::try_from_uri(&parts.uri);
        asked
            .map(|Query(asked)| Self(asked))
            .map_err(|error| Refused(format!("the address is not one of the page's: {}", error.body_text())))
    }
}

/// What a request carries; a mistake in it is told as every other one.
struct Sent<T>(T);

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
async fn aside<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Refused> + Send + 'static,
) -> Result<T, Refused> {
    let done = tokio::task::spawn_blocking(work).await;
    done.unwrap_or_else(|_| Err(Refused("this could not be computed: a bug of quadlab".into())))
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

#[derive(Deserialize)]
struct Id {
    id: u32,
}

async fn model(State(session): Shared, Asked(Id { id }): Asked<Id>) -> Answer {
    aside(move || Ok(Json(model_document(&session.node(id)?.model, session.view(id)?.comparison())))).await
}

fn model_document(model: &Model, comparison: &Comparison) -> Value {
    json!({
        "coefficients": coefficient_entries(model),
        "equations": model.effects().into_iter().map(equations::of).collect::<Vec<_>>(),
        "physical": equations::physical(model),
        "comparison": comparison,
        "toml": model.to_toml(),
    })
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
        let why =
            workflow::why(&node.model, effect, &[], &mut sets, &diagnosis::Options::default(), &telling);
        let why = why?;
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
    /// A flight whose start its own goes to.
    beside: Option<String>,
    /// So much later, s.
    shift: Option<f64>,
}

async fn series(State(session): Shared, Asked(asked): Asked<OfSeries>) -> Result<Json<Series>, Refused> {
    const WIDEST: usize = 8000;
    aside(move || {
        let view = session.view(asked.model)?;
        let window = Window {
            from_s: asked.from.unwrap_or(f64::NEG_INFINITY),
            to_s: asked.to.unwrap_or(f64::INFINITY),
            width: asked.width.unwrap_or(1200).clamp(10, WIDEST),
        };
        Ok(Json(match &asked.beside {
            Some(flight) => {
                let beside = Beside { flight, shift_s: asked.shift.filter(|s| s.is_finite()).unwrap_or(0.0) };
                view.series_beside(&asked.flight, &beside, asked.ahead, window)?
            }
            None => view.series(&asked.flight, asked.ahead, window)?,
        }))
    })
    .await
}

async fn quantities(State(session): Shared) -> Answer {
    let current = session.lock().current;
    let Some(id) = current else { return Ok(Json(json!([]))) };
    aside(move || Ok(Json(session.view(id)?.quantities()))).await
}

/// The axis of a name.
fn axis(name: &str) -> Result<Axis, Refused> {
    let found = AXES.into_iter().find(|axis| axis.name() == name);
    found.ok_or_else(|| Refused(format!("{name}: is none of the axes u, v, w, p, q and r")))
}

#[derive(Deserialize)]
struct OfResidual {
    model: u32,
    axis: String,
    quantity: String,
    flight: Option<String>,
}

async fn residual(State(session): Shared, Asked(asked): Asked<OfResidual>) -> Answer {
    aside(move || {
        let view = session.view(asked.model)?;
        Ok(Json(view.residual(axis(&asked.axis)?, &asked.quantity, asked.flight.as_deref())?))
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
    aside(move || Ok(Json(session.view(asked.model)?.spectrum(&asked.flight, axis(&asked.axis)?)?))).await
}

async fn path(State(session): Shared, Asked(asked): Asked<OfAxis>) -> Answer {
    aside(move || Ok(Json(session.view(asked.model)?.path(&asked.flight, axis(&asked.axis)?)?))).await
}

#[derive(Deserialize)]
struct OfRoom {
    model: u32,
    axis: String,
    flight: Option<String>,
}

async fn room(State(session): Shared, Asked(asked): Asked<OfRoom>) -> Answer {
    aside(move || Ok(Json(session.view(asked.model)?.room(axis(&asked.axis)?, asked.flight.as_deref())?)))
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
    aside(move || Ok(Json(session.view(model)?.timeline().clone()))).await
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
        let text = session.view(id)?.report();
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
        let table = session.view(of.model)?.table(&of.flight)?;
        Ok(download(&of.file("csv"), "text/csv; charset=utf-8", table.to_csv()))
    })
    .await
}

async fn series_parquet(State(session): Shared, Asked(of): Asked<OfFlight>) -> Result<Response, Refused> {
    aside(move || {
        let table = session.view(of.model)?.table(&of.flight)?;
        let about = [("model", of.model.to_string()), ("flight", of.flight.clone())];
        Ok(download(&of.file("parquet"), "application/vnd.apache.parquet", table.to_parquet(&about)?))
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
