//! HTTP server of the workbench. It listens on the loopback interface only, requires a token, and its pages load no external
//! files.

mod assets;
mod failsafes;
mod guard;
mod routes;

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::Arc;

use axum::Router;
use axum::extract::DefaultBodyLimit;
use axum::routing::{get, post};
use tokio::sync::broadcast::{self, Sender};

use super::bench::{Bench, Given};
use super::error::WorkbenchError;
use super::jobs::Event;

/// Largest size of an uploaded log, bytes.
pub const LARGEST_LOG: usize = 256 << 20;
/// Largest body of any other request, bytes.
const LARGEST_REQUEST: usize = 64 << 10;
/// Number of events by which a slow page may lag behind. Older events are dropped.
const LAG: usize = 256;

/// Reason why the workbench cannot be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The session cannot be opened.
    #[error(transparent)]
    Bench(#[from] WorkbenchError),
    /// The port is in use, or the operating system refused it.
    #[error(
        "cannot serve the workbench on 127.0.0.1 port {port}: {source}; give another --port, or 0 for any"
    )]
    Socket {
        /// The port that was requested.
        port: u16,
        /// Error of the operating system.
        source: io::Error,
    },
}

/// State that all requests share.
#[derive(Clone)]
struct Shared {
    bench: Arc<Bench>,
    events: Sender<Arc<str>>,
    token: Arc<str>,
    address: SocketAddr,
}

/// Serves the session of `given` on `port` of this computer (0 for any free port) until the program ends. Requests need `token`.
/// `ready` is called with the address of the page when the server listens.
///
/// # Errors
/// `ServeError::Bench` if the session cannot be opened, and `ServeError::Socket` if the port cannot be used.
pub fn serve(
    given: Given,
    port: u16,
    token: &str,
    ready: impl FnOnce(&str),
) -> Result<(), ServeError> {
    let socket = |source| ServeError::Socket { port, source };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    runtime.map_err(socket)?.block_on(async {
        let listener =
            tokio::net::TcpListener::bind((Ipv4Addr::LOCALHOST, port)).await.map_err(socket)?;
        let address = listener.local_addr().map_err(socket)?;
        let (events, _) = broadcast::channel(LAG);
        let shout = events.clone();
        let on_event = move |event: Event| {
            if let Ok(text) = serde_json::to_string(&event) {
                // sending fails if no page is open, because the channel then has no receiver
                let _ = shout.send(text.into());
            }
        };
        let bench = Bench::open(given, on_event)?;
        let shared = Shared { bench, events, token: token.into(), address };
        ready(&format!("http://{address}/?token={token}"));
        axum::serve(listener, router(shared)).await.map_err(socket)
    })
}

/// A random token of 32 hexadecimal digits.
///
/// # Errors
/// If the operating system provides no random numbers.
pub fn random_token() -> io::Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(io::Error::other)?;
    Ok(bytes.iter().map(|b| format!("{b:02x}")).collect())
}

fn router(shared: Shared) -> Router {
    Router::new()
        .route("/", get(assets::page))
        .route("/assets/{name}", get(assets::asset))
        .route("/failsafes", get(failsafes::page))
        .route("/api/state", get(routes::state))
        .route("/api/failing", get(routes::failing))
        .route("/api/diagnosis", get(routes::diagnosis))
        .route("/api/proposal", get(routes::proposal))
        .route("/api/grammar", get(routes::grammar))
        .route("/api/check", post(routes::check))
        .route("/api/curve/{effect}", get(routes::curve))
        .route("/api/flying", get(routes::flying))
        .route("/api/flight/{place}", get(routes::flight))
        .route("/api/free-run", post(routes::free_run))
        .route("/api/act", post(routes::act))
        .route("/api/events", get(routes::events))
        .fallback(routes::nothing)
        .layer(DefaultBodyLimit::max(LARGEST_REQUEST))
        .route("/api/logs", post(routes::take))
        .layer(axum::middleware::from_fn_with_state(shared.clone(), guard::guard))
        .with_state(shared)
}
