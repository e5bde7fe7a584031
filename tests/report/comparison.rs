//! The report of a comparison as a file: what it holds, how large it is, with input made to break it.

use crate::report_comparison;
use greylag::report::{ComparisonReport, Figure};
use greylag::sysid::compare::{Comparison, ModelTrace};
use serde_json::Value;

fn report(comparison: &Comparison) -> ComparisonReport<'_> {
    ComparisonReport {
        title: "Models against flights".into(),
        comparison,
        model_files: vec!["a.toml".into(), "b.toml".into()],
        log_files: vec!["flight-a.csv".into(), "flight-b.ulg".into()],
        command_line: "greylag compare".into(),
        versions: Vec::new(),
    }
}

/// The data of the plots, as a browser would read it.
fn figures(html: &str) -> Vec<Value> {
    let (_, rest) = html.split_once("id=\"figures\">").expect("the page has data");
    let (json, _) = rest.split_once("</script>").expect("the data ends");
    serde_json::from_str(json).expect("the data is JSON")
}

fn of_kind<'a>(figures: &'a [Value], kind: &str) -> Vec<&'a Value> {
    figures.iter().filter(|f| f["kind"] == kind).map(|f| &f["data"]).collect()
}

#[test]
fn ten_minutes_of_flight_make_a_page_under_three_megabytes() {
    let comparison = report_comparison::comparison(300.0);
    let html = report(&comparison).page().render();
    let own = html.replace(include_str!("../../src/report/kit/assets/uPlot.iife.min.js"), "");
    for foreign in ["http:", "https:", "src=", "@import", "url(", "fetch(", "XMLHttpRequest"] {
        assert!(!own.contains(foreign), "the page holds {foreign}");
    }
    // Two flights of 300 s, two models: 60,000 rows of 24 values would be 10 MB.
    assert!(html.len() < 3_000_000, "the page has {} bytes", html.len());
    let figures = figures(&html);
    // Worst, typical and best stretch, and each flight as a whole.
    assert_eq!(of_kind(&figures, "time").len(), 5);
    // Six channels; a map for each of two models; root mean square and median.
    assert_eq!(of_kind(&figures, "intervals").len(), 6);
    assert_eq!(of_kind(&figures, "heat").len(), 12);
    assert_eq!(of_kind(&figures, "curves").len(), 2);
}

#[test]
fn the_leading_sentence_is_first_and_leads_to_its_channel() {
    let comparison = report_comparison::comparison(60.0);
    let page = report(&comparison).page();
    // of two models the difference is said first, then where each fails
    let Figure::Answer(answer) = &page.sections[0].figures[0] else {
        panic!("the page starts with {:?}", page.sections[0].figures[0]);
    };
    assert_eq!(answer.answer.error, comparison.answer.error);
    assert!(answer.answer.error.contains("falls from"), "{}", answer.answer.error);
    let mut all = page.sections.iter().flat_map(|s| &s.figures).rev();
    let found = all.find_map(|f| match f {
        Figure::Findings(found) => Some(found),
        _ => None,
    });
    let found = found.unwrap();
    // every sentence names its model, and those of the last model come first
    assert_eq!(found.lead[0].sentence, format!("amended: {}", comparison.models[1].sentences[0]));
    let link = found.lead[1].link.as_ref().expect("the sentence on lift has a figure");
    assert_eq!(link.option, "L lift");
    let html = page.render();
    let anchor = format!("id=\"{}\"", link.anchor);
    assert!(html.contains(&anchor), "the link leads nowhere");
    assert!(html.contains("<div class=\"option\" data-option=\"L lift\">"));
    assert!(
        found.rest.iter().any(|f| f.sentence.starts_with("prior-as-printed: ")),
        "the first model has its say"
    );
    let names = ["amended: ", "prior-as-printed: "];
    let all = || found.lead.iter().chain(&found.rest);
    assert!(all().all(|f| names.iter().any(|name| f.sentence.starts_with(name))));
}

#[test]
fn the_curves_of_growth_end_with_most_of_the_runs() {
    let mut comparison = report_comparison::comparison(60.0);
    for model in &mut comparison.models {
        // 38 runs at first; the error of the 7 that are left after 3 s is small
        for point in model.growth.iter_mut().filter(|p| p.time_s > 3.05) {
            (point.runs, point.rmse_scaled) = (7, 1e-3);
        }
    }
    let figures = figures(&report(&comparison).page().render());
    let curve = of_kind(&figures, "curves")[0];
    let last = curve["x"].as_array().unwrap().last().unwrap().as_f64().unwrap();
    assert!((last - 3.0).abs() < 1e-6, "the curve ends at {last} s");
}

#[test]
fn thin_bins_are_marked_and_set_no_scale() {
    let mut comparison = report_comparison::comparison(60.0);
    // A thin cell that is off by chance, ten times what any other is.
    // the channels begin with the yawing moment, which the answer box names
    let map = &mut comparison.models[0].channels[5].map;
    let strongest = |supported: bool| {
        let all = report_comparison::comparison(60.0);
        let cells = all.models[0].channels[5].map.cells.clone();
        cells.iter().filter(|c| c.supported || !supported).map(|c| c.mean.abs()).fold(0.0, f64::max)
    };
    let thin = map.cells.iter_mut().find(|c| !c.supported).expect("the sample has thin cells");
    thin.mean = 10.0 * strongest(false);
    let figures = figures(&report(&comparison).page().render());
    let limit = of_kind(&figures, "heat")[0]["limit"].as_f64().unwrap();
    assert!((limit - strongest(true)).abs() < 1e-9, "the scale ends at {limit}");
    // Six and nine samples, of the first and last bin, are under the twenty of the settings.
    let bins = &of_kind(&figures, "intervals")[0]["panels"][0]["lines"][0];
    let supported: Vec<bool> =
        bins["supported"].as_array().unwrap().iter().map(|v| v.as_bool().unwrap()).collect();
    assert_eq!(supported, [false, true, true, true, true, true, false]);
    assert!(bins["from"][0].is_null(), "an open edge is no number");
}

#[test]
fn what_is_predicted_stands_beside_what_was_measured() {
    let comparison = report_comparison::comparison(60.0);
    let figures = figures(&report(&comparison).page().render());
    let track = &of_kind(&figures, "time")[0]["tracks"][0];
    let panel = &track["panels"][2];
    assert_eq!(panel["title"], "Airspeed V");
    let labels: Vec<&str> =
        panel["series"].as_array().unwrap().iter().map(|s| s["label"].as_str().unwrap()).collect();
    assert_eq!(labels, ["measured", "prior-as-printed", "amended"]);
    // Drawn values are those of the trace at the drawn time.
    let time = track["time_s"].as_array().unwrap();
    let worst = comparison
        .flights
        .iter()
        .position(|f| {
            f.trace.time_s[0] <= time[0].as_f64().unwrap()
                && time[0].as_f64().unwrap() <= *f.trace.time_s.last().unwrap()
        })
        .unwrap();
    let trace = &comparison.flights[worst].trace;
    for i in [0, 10, 100] {
        let t = time[i].as_f64().unwrap();
        let row = trace.time_s.iter().position(|x| (x - t).abs() < 1e-6).unwrap();
        let drawn = panel["series"][1]["values"][i].as_f64().unwrap();
        let flown = comparison.models[0].traces[worst].states[2][row];
        // Six digits of 18 m/s.
        assert!((drawn - flown).abs() < 1e-3, "at {t} s {drawn} is drawn for {flown}");
    }
}

#[test]
fn forces_and_moments_are_drawn_on_the_clock_of_the_states() {
    let comparison = report_comparison::comparison(60.0);
    let figures = figures(&report(&comparison).page().render());
    for figure in of_kind(&figures, "time") {
        let ends = |track: &Value| {
            let time = track["time_s"].as_array().unwrap();
            [time[0].as_f64().unwrap(), time[time.len() - 1].as_f64().unwrap()]
        };
        let (states, channels) = (&figure["tracks"][0], &figure["tracks"][1]);
        // Six channels of a force or a moment each; windows lie within the stretch.
        assert_eq!(channels["panels"].as_array().unwrap().len(), 6);
        assert!(ends(states)[0] <= ends(channels)[0] && ends(channels)[1] <= ends(states)[1]);
    }
    let lift = &of_kind(&figures, "time")[0]["tracks"][1]["panels"][1];
    assert_eq!((&lift["title"], &lift["unit"]), (&"L lift".into(), &"N".into()));
    // The first model of the sample predicts 70 % of what was measured.
    let at = |k: usize| lift["series"][k]["values"][40].as_f64().unwrap();
    assert!((at(1) / at(0) - 0.7).abs() < 1e-3, "{} {}", at(1), at(0));
}

#[test]
fn flights_that_are_not_drawn_are_named() {
    let mut comparison = report_comparison::comparison(60.0);
    for i in 0..6 {
        let mut more = comparison.flights[0].clone();
        more.name = format!("more-{i}.csv");
        comparison.flights.push(more);
        for model in &mut comparison.models {
            model.traces.push(model.traces[0].clone());
        }
    }
    let html = report(&comparison).page().render();
    // Eight flights, of which six are drawn.
    assert!(html.contains("Not drawn as a whole: more-4.csv, more-5.csv."));
}

#[test]
fn hostile_text_stays_text() {
    let hostile = "</script><script>alert(1)</script><!-- \"' & <b>\u{0}";
    let mut comparison = report_comparison::comparison(60.0);
    for model in &mut comparison.models {
        model.name = hostile.into();
        model.sentences[0] = hostile.into();
    }
    for flight in &mut comparison.flights {
        flight.name = hostile.into();
        flight.notes = vec![hostile.into()];
        flight.nuisances[0].name = hostile.into();
    }
    for channel in comparison.models.iter_mut().flat_map(|m| &mut m.channels) {
        for bin in channel.bins.iter_mut().flat_map(|b| &mut b.bins) {
            bin.label = hostile.into();
        }
    }
    comparison.notes = vec![hostile.into()];
    let mut report = report(&comparison);
    report.title = hostile.into();
    report.model_files = vec![hostile.into()];
    report.log_files = vec![hostile.into()];
    report.command_line = hostile.into();
    let html = report.page().render();
    assert!(!html.contains("<script>alert"));
    assert!(!html.contains("<b>"));
    assert_eq!(of_kind(&figures(&html), "curves")[0]["series"][0]["label"], hostile);
}

#[test]
fn a_comparison_that_found_nothing_is_still_a_page() {
    let mut comparison = report_comparison::comparison(60.0);
    for model in &mut comparison.models {
        model.channels.clear();
        model.sentences.clear();
        model.growth.clear();
        model.free_run.clear();
        model.traces = vec![ModelTrace::default()];
    }
    let html = report(&comparison).page().render();
    assert!(html.contains("No channel could be compared"));
    comparison.models.clear();
    comparison.flights.clear();
    figures(&report(&comparison).page().render());

    let mut broken = report_comparison::comparison(60.0);
    for model in &mut broken.models {
        for channel in &mut model.channels {
            channel.unexplained_fraction = f64::NAN;
            channel.map.cells.iter_mut().for_each(|c| c.mean = f64::NAN);
            for bin in channel.bins.iter_mut().flat_map(|b| &mut b.bins) {
                (bin.mean, bin.interval) = (f64::NAN, [f64::INFINITY; 2]);
            }
        }
        model.traces.iter_mut().flat_map(|t| &mut t.states).for_each(|s| s.fill(f64::NAN));
    }
    let html = report(&broken).page().render();
    assert!(html.contains("cannot be determined"));
    figures(&html);
}
