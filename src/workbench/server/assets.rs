//! The page of the workbench and its files, which are embedded in the program.

use axum::extract::Path;
use axum::http::header::CONTENT_TYPE;
use axum::response::{Html, IntoResponse, Response};

use super::routes;

const PAGE: &str = include_str!("../assets/page.html");
/// Name, media type and content of each file that the page loads.
const FILES: [(&str, &str, &str); 13] = [
    ("workbench.css", CSS, include_str!("../assets/workbench.css")),
    ("uplot.css", CSS, include_str!("../../report/kit/assets/uPlot.min.css")),
    ("uplot.js", JS, include_str!("../../report/kit/assets/uPlot.iife.min.js")),
    ("main.js", JS, include_str!("../assets/main.js")),
    ("kit.js", JS, include_str!("../assets/kit.js")),
    ("flights.js", JS, include_str!("../assets/flights.js")),
    ("failing.js", JS, include_str!("../assets/failing.js")),
    ("fly.js", JS, include_str!("../assets/fly.js")),
    ("text.js", JS, include_str!("../assets/text.js")),
    ("suspects.js", JS, include_str!("../assets/suspects.js")),
    ("model.js", JS, include_str!("../assets/model.js")),
    ("failsafes.css", CSS, include_str!("../assets/failsafes.css")),
    ("failsafes.js", JS, include_str!("../assets/failsafes.js")),
];
const CSS: &str = "text/css; charset=utf-8";
const JS: &str = "text/javascript; charset=utf-8";

/// The main page of the workbench.
pub async fn page() -> Html<&'static str> {
    Html(PAGE)
}

/// The file `name` of the page, or the status 404 if there is no such file.
pub async fn asset(Path(name): Path<String>) -> Response {
    match FILES.iter().find(|(own, ..)| *own == name) {
        Some((_, kind, text)) => ([(CONTENT_TYPE, *kind)], *text).into_response(),
        None => routes::nothing().await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The page without data must stay below 300 kB.
    #[test]
    fn the_page_is_light_and_names_only_its_own_files() {
        let weight: usize = PAGE.len() + FILES.iter().map(|(.., text)| text.len()).sum::<usize>();
        assert!(weight < 300_000, "{weight} bytes");
        for (name, _, text) in FILES.iter().filter(|(name, ..)| !name.starts_with("uplot")) {
            // the name of the SVG namespace is not fetched
            let text = text.replace("http://www.w3.org/2000/svg", "");
            assert!(!text.contains("http://") && !text.contains("https://"), "{name}");
            assert!(!text.contains("innerHTML"), "{name} writes text of logs as HTML");
        }
    }
}
