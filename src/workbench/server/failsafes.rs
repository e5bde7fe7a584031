//! HTTP handler of the page about failsafes, which simulates flights with faults.

use axum::extract::{Query, State};
use axum::response::Response;

use super::Shared;

/// The page for the form values in the query of the address. An invalid value gives status 422.
#[cfg(feature = "sitl")]
pub async fn page(
    State(shared): State<Shared>,
    Query(query): Query<Vec<(String, String)>>,
) -> Response {
    use axum::http::StatusCode;
    use axum::response::{Html, IntoResponse};

    let flown = tokio::task::spawn_blocking(move || shared.bench.failsafes.page(&query)).await;
    match flown {
        Ok(answer) => {
            let refused = StatusCode::UNPROCESSABLE_ENTITY;
            let status = if answer.refused { refused } else { StatusCode::OK };
            (status, Html(answer.html)).into_response()
        }
        Err(error) => super::routes::failure(
            StatusCode::INTERNAL_SERVER_ERROR,
            &format!("a fault of the program, please report it: {error}"),
        ),
    }
}

/// Error of a build without the simulator.
#[cfg(not(feature = "sitl"))]
pub async fn page(_: State<Shared>, _: Query<Vec<(String, String)>>) -> Response {
    use axum::response::IntoResponse;
    crate::WorkbenchError::NoSimulator.into_response()
}
