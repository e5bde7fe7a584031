//! Handlers of the HTTP requests that the workbench's page makes.

use std::convert::Infallible;
use std::sync::Arc;

use axum::Json;
use axum::body::{Body, to_bytes};
use axum::extract::{Path, Query, State};
use axum::http::header::CONTENT_LENGTH;
use axum::http::{HeaderMap, StatusCode};
use axum::response::sse::{self, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use tokio_stream::wrappers::BroadcastStream;
use tokio_stream::{Stream, StreamExt};

use super::{LARGEST_LOG, Shared};
use crate::act::Request;
use crate::bench::Bench;
use crate::error::{Kind, WorkbenchError};
use crate::view::RunRequest;

/// A response with this status and the error message `why` as JSON.
pub fn failure(status: StatusCode, why: &str) -> Response {
    (status, Json(json!({ "error": why }))).into_response()
}

impl IntoResponse for WorkbenchError {
    fn into_response(self) -> Response {
        let status = match self.kind() {
            Kind::Bad => StatusCode::UNPROCESSABLE_ENTITY,
            Kind::Conflict => StatusCode::CONFLICT,
            Kind::Locked => StatusCode::LOCKED,
            Kind::Missing => StatusCode::NOT_FOUND,
            Kind::Failed => StatusCode::INTERNAL_SERVER_ERROR,
        };
        failure(status, &self.to_string())
    }
}

/// Runs `work` on a separate thread, so that other requests are answered meanwhile. Responds with its result or error as JSON.
async fn aside<T: Serialize + Send + 'static>(
    shared: Shared,
    work: impl FnOnce(&Arc<Bench>) -> Result<T, WorkbenchError> + Send + 'static,
) -> Response {
    match tokio::task::spawn_blocking(move || work(&shared.bench)).await {
        Ok(Ok(answer)) => Json(answer).into_response(),
        Ok(Err(error)) => error.into_response(),
        Err(error) => failure(
            StatusCode::INTERNAL_SERVER_ERROR,
            &format!("a fault of the program, please report it: {error}"),
        ),
    }
}

/// Responds with the state of the session as JSON, without the data of curves.
pub async fn state(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| bench.state()).await
}

/// Responds with the errors of the models by channel (force or moment) and flight condition, as JSON.
pub async fn failing(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| bench.failing()).await
}

/// Responds with the diagnosis as JSON; `null` if there is none.
pub async fn diagnosis(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| Ok(bench.diagnosis())).await
}

/// Responds with the result of the search for a formula, as JSON; `null` if there is none.
pub async fn proposal(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| Ok(bench.proposal())).await
}

/// Responds with the names that the formula in an effect file may use, as JSON.
pub async fn grammar() -> Response {
    Json(crate::grammar()).into_response()
}

/// Body of a request to check an effect file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    text: String,
}

/// Checks the text of an effect file. Responds with a description of the effect, or with the error, as JSON.
pub async fn check(Json(Text { text }): Json<Text>) -> Response {
    match crate::check(&text) {
        Ok(checked) => Json(checked).into_response(),
        // the user may still be editing the text, so that an error in it is no error of the request
        Err(error) => Json(json!({ "error": error.to_string() })).into_response(),
    }
}

/// Responds with the curve of the accepted effect `effect`, as JSON.
pub async fn curve(State(shared): State<Shared>, Path(effect): Path<String>) -> Response {
    aside(shared, move |bench| bench.curve(&effect)).await
}

/// Responds with the present simulated flight, or with the last one if none is in progress, as JSON; `null` without a flight.
pub async fn flying(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| Ok(bench.flying())).await
}

/// Responds with the time series of the flight with index `place`, as JSON.
pub async fn flight(State(shared): State<Shared>, Path(place): Path<usize>) -> Response {
    aside(shared, move |bench| bench.flight(place)).await
}

/// Responds with free runs (open-loop simulations) of the models from a time of a flight, as JSON.
pub async fn free_run(State(shared): State<Shared>, Json(request): Json<RunRequest>) -> Response {
    aside(shared, move |bench| bench.free_run(request)).await
}

/// Executes a request of the page and responds with the new state of the session.
pub async fn act(State(shared): State<Shared>, Json(request): Json<Request>) -> Response {
    aside(shared, move |bench| {
        bench.act(request)?;
        bench.state()
    })
    .await
}

/// Query of an upload: the name of the log, and the revision of the session that the page showed.
#[derive(Deserialize)]
pub struct Sent {
    name: String,
    revision: u64,
}

/// Adds an uploaded log to the session and responds with the session's new state.
pub async fn take(
    State(shared): State<Shared>,
    Query(sent): Query<Sent>,
    headers: HeaderMap,
    body: Body,
) -> Response {
    let announced = headers.get(CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse().ok());
    // if the declared length is too large, the log is refused before its content is read
    if announced.is_some_and(|bytes: usize| bytes > LARGEST_LOG) {
        return too_large(&sent.name);
    }
    let Ok(bytes) = to_bytes(body, LARGEST_LOG).await else { return too_large(&sent.name) };
    aside(shared, move |bench| {
        bench.take(sent.revision, &sent.name, &bytes)?;
        bench.state()
    })
    .await
}

fn too_large(name: &str) -> Response {
    let most = LARGEST_LOG >> 20;
    let why = format!(
        "{name} did not come whole, or is over {most} MB, which a page may not send; name its file: greylag workbench {name}"
    );
    failure(StatusCode::PAYLOAD_TOO_LARGE, &why)
}

/// An event that makes an open page read the state again. `revision` is the present revision of the session; `None` if unknown.
fn changed(revision: Option<u64>) -> Arc<str> {
    json!({ "event": "changed", "revision": revision }).to_string().into()
}

/// Responds with a stream of events for an open page. The first event has the present revision of the session.
pub async fn events(
    State(shared): State<Shared>,
) -> Sse<impl Stream<Item = Result<sse::Event, Infallible>>> {
    let later = BroadcastStream::new(shared.events.subscribe());
    // another request may hold the lock of the session, and this thread must not block meanwhile
    let revision = tokio::task::spawn_blocking(move || shared.bench.revision()).await;
    let first = tokio_stream::once(changed(revision.ok()));
    // if the stream is read too slowly, events are lost, and the page is told to read the state again
    let later = later.map(|event| event.unwrap_or_else(|_| changed(None)));
    let all = first.chain(later).map(|text: Arc<str>| Ok(sse::Event::default().data(&*text)));
    Sse::new(all).keep_alive(KeepAlive::default())
}

/// Responds to a request for an unknown address.
pub async fn nothing() -> Response {
    let body: Value = json!({ "error": "there is nothing of that name" });
    (StatusCode::NOT_FOUND, Json(body)).into_response()
}
