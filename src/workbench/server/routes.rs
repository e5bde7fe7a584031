//! Handlers of the HTTP routes.

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

/// An answer with an error message as JSON.
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

/// Runs `work` on a separate thread, because other requests must be answered meanwhile.
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

/// The state of the session as JSON, without curves.
pub async fn state(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| bench.state()).await
}

/// Errors of the models by channel and regime, as JSON.
pub async fn failing(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| bench.failing()).await
}

/// The diagnosis as JSON; `null` without one.
pub async fn diagnosis(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| Ok(bench.diagnosis())).await
}

/// Result of the search for a formula, as JSON; `null` without a search.
pub async fn proposal(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| Ok(bench.proposal())).await
}

/// Names that an effect file may use, as JSON.
pub async fn grammar() -> Response {
    Json(crate::grammar()).into_response()
}

/// Body of a request to check an effect file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Text {
    text: String,
}

/// Description of an effect file or its error, as JSON.
pub async fn check(Json(Text { text }): Json<Text>) -> Response {
    match crate::check(&text) {
        Ok(checked) => Json(checked).into_response(),
        // a text that the user still edits is not an error of the request
        Err(error) => Json(json!({ "error": error.to_string() })).into_response(),
    }
}

/// The curve of an accepted effect, as JSON.
pub async fn curve(State(shared): State<Shared>, Path(effect): Path<String>) -> Response {
    aside(shared, move |bench| bench.curve(&effect)).await
}

/// The present flight, or else the last flight, as JSON; `null` without a flight.
pub async fn flying(State(shared): State<Shared>) -> Response {
    aside(shared, |bench| Ok(bench.flying())).await
}

/// One flight over time, as JSON.
pub async fn flight(State(shared): State<Shared>, Path(place): Path<usize>) -> Response {
    aside(shared, move |bench| bench.flight(place)).await
}

/// Free runs from a time of a flight, as JSON.
pub async fn free_run(State(shared): State<Shared>, Json(request): Json<RunRequest>) -> Response {
    aside(shared, move |bench| bench.free_run(request)).await
}

/// Executes a request and answers with the new state of the session.
pub async fn act(State(shared): State<Shared>, Json(request): Json<Request>) -> Response {
    aside(shared, move |bench| {
        bench.act(request)?;
        bench.state()
    })
    .await
}

/// Query of an upload: name of the log, and revision on which the upload is based.
#[derive(Deserialize)]
pub struct Sent {
    name: String,
    revision: u64,
}

/// Adds an uploaded log and answers with the new state of the session.
pub async fn take(
    State(shared): State<Shared>,
    Query(sent): Query<Sent>,
    headers: HeaderMap,
    body: Body,
) -> Response {
    let announced = headers.get(CONTENT_LENGTH).and_then(|v| v.to_str().ok()?.parse().ok());
    // a log with a too large declared length is refused before its body is read
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

/// An event after which a page reads the state again; without a revision, it does so in any case.
fn changed(revision: Option<u64>) -> Arc<str> {
    json!({ "event": "changed", "revision": revision }).to_string().into()
}

/// Stream of events for an open page.
pub async fn events(
    State(shared): State<Shared>,
) -> Sse<impl Stream<Item = Result<sse::Event, Infallible>>> {
    let later = BroadcastStream::new(shared.events.subscribe());
    // another request may hold the lock of the session; this thread must not block meanwhile
    let revision = tokio::task::spawn_blocking(move || shared.bench.revision()).await;
    let first = tokio_stream::once(changed(revision.ok()));
    // a page that lags may have missed a change
    let later = later.map(|event| event.unwrap_or_else(|_| changed(None)));
    let all = first.chain(later).map(|text: Arc<str>| Ok(sse::Event::default().data(&*text)));
    Sse::new(all).keep_alive(KeepAlive::default())
}

/// Answer to a request for an unknown address.
pub async fn nothing() -> Response {
    let body: Value = json!({ "error": "there is nothing of that name" });
    (StatusCode::NOT_FOUND, Json(body)).into_response()
}
