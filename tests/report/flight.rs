//! The report as a file: what a page of a synthetic flight holds, with input made to break it.

use std::path::Path;

use crate::report_synthetic;
use greylag::logs::{Flight, Sample};
use greylag::report::{
    Cycle, Difficulty, EnvelopeFlown, Event, EventKind, Figure, FlightReport, Outcome, Page, Panel,
    Section, Segment, Series, Style, TimeFigure, WriteError, write_new, write_over,
};
use serde_json::Value;

/// The page without the vendored library, whose licence comments name its home.
fn without_uplot(html: &str) -> String {
    let script = include_str!("../../src/report/kit/assets/uPlot.iife.min.js");
    assert!(html.contains(script), "uPlot is embedded as it was published");
    html.replace(script, "")
}

/// The data of the plots, as a browser would read it.
fn figures(html: &str) -> Value {
    let (_, rest) = html.split_once("id=\"figures\">").expect("the page has data");
    let (json, _) = rest.split_once("</script>").expect("the data ends");
    serde_json::from_str(json).expect("the data is JSON")
}

/// Checks that every element is closed in order, with the bodies of script and style skipped.
fn assert_well_formed(html: &str) {
    const VOID: [&str; 3] = ["meta", "link", "br"];
    let mut open: Vec<String> = Vec::new();
    let mut rest = html.strip_prefix("<!DOCTYPE html>").expect("a doctype");
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("a tag ends");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop().as_deref(), Some(name), "closed in order");
            continue;
        }
        let name = tag.split_whitespace().next().expect("a tag has a name").to_string();
        assert!(name.chars().all(|c| c.is_ascii_alphanumeric()), "{name} is no element");
        assert_eq!(tag.matches('"').count() % 2, 0, "the quotes of <{tag}> are paired");
        if name == "script" || name == "style" {
            let close = format!("</{name}>");
            rest = &rest[rest.find(&close).expect("the body ends") + close.len()..];
        } else if !VOID.contains(&name.as_str()) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

#[test]
fn a_flight_page_is_whole_and_loads_nothing() {
    let flight = report_synthetic::flight();
    let html = report_synthetic::report(&flight).page().render();
    assert_well_formed(&html);
    let own = without_uplot(&html);
    for foreign in ["http:", "https:", "src=", "@import", "url(", "fetch(", "XMLHttpRequest"] {
        assert!(!own.contains(foreign), "the page holds {foreign}");
    }
    assert!(html.contains("Copyright (c) 2022 Leon Sorokin"), "uPlot's licence travels with it");
    for heading in
        ["Attitude", "Air data", "Surfaces", "Loop timing", "Targets", "Events", "Provenance"]
    {
        assert!(html.contains(&format!("<h2>{heading}</h2>")), "no section {heading}");
    }
    // Four time figures, a histogram, the plane; 5970 samples with one pause are 5971 rows.
    let figures = figures(&html);
    let kinds: Vec<&str> =
        figures.as_array().unwrap().iter().map(|f| f["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["time", "time", "time", "time", "histogram", "xy"]);
    assert_eq!(figures[0]["data"]["tracks"][0]["time_s"].as_array().unwrap().len(), 5971);
}

#[test]
fn gaps_and_missing_values_are_null() {
    let flight = report_synthetic::flight();
    let html = report_synthetic::report(&flight).page().render();
    let figures = figures(&html);
    let nulls = |figure: usize, panel: usize, series: usize| {
        let panel = &figures[figure]["data"]["tracks"][0]["panels"][panel];
        let values = panel["series"][series]["values"].as_array().unwrap();
        values.iter().filter(|v| v.is_null()).count()
    };
    assert_eq!(nulls(0, 0, 0), 1, "roll is missing in the pause alone");
    assert_eq!(nulls(1, 1, 0), 1, "so is the angle of attack");
    assert_eq!(nulls(1, 1, 1), 1 + 50, "sideslip also in its half second at 100 Hz");
}

#[test]
fn hostile_text_stays_text() {
    let hostile = "</script><script>alert(1)</script><!-- \"' & <b>\u{0}";
    let flight = report_synthetic::flight();
    let mut report = report_synthetic::report(&flight);
    for field in [&mut report.title, &mut report.controller, &mut report.model] {
        *field = hostile.into();
    }
    report.command_line = hostile.into();
    report.versions.push((hostile.into(), hostile.into()));
    report.timing.as_mut().unwrap().measure = hostile.into();
    report.events.push(Event { time_s: 1.0, kind: EventKind::Text, text: hostile.into() });
    let mut page = report.page();
    // Labels reach the browser through the data as well as through the markup.
    let mut figure = TimeFigure::default();
    let series = Series::new(hostile, Style::Third, vec![1.0, 2.0]);
    figure.add_track(&[0.0, 1.0], 10.0, vec![Panel::new(hostile, hostile, vec![series])]);
    page.sections.push(Section::new(hostile, hostile, vec![Figure::Time(figure)]));
    let html = page.render();
    assert_well_formed(&html);
    assert!(!html.contains("<script>alert"));
    assert!(!html.contains("<b>"));
    let figures = figures(&html);
    let last = figures.as_array().unwrap().last().unwrap();
    assert_eq!(last["data"]["tracks"][0]["panels"][0]["series"][0]["label"], hostile);
}

fn verdict(report: &FlightReport) -> (Outcome, String) {
    match &report.page().sections[0].figures[0] {
        Figure::Verdict(v) => (v.outcome, v.sentence.clone()),
        other => panic!("the page starts with {other:?}"),
    }
}

/// A segment of `difficulty` that settled at `error_deg`.
fn settled(difficulty: Difficulty, error_deg: f64) -> Segment {
    Segment {
        start_s: 0.0,
        end_s: 5.0,
        roll_target_rad: 0.1,
        pitch_target_rad: 0.0,
        difficulty,
        settled_error_rad: error_deg.to_radians(),
    }
}

/// The page leads with what the flight did to the aircraft: a flight within its limits, then one beyond the load factor.
#[test]
fn the_first_sentence_says_how_the_envelope_was_kept() {
    let mut flight = report_synthetic::flight();
    for (k, sample) in flight.samples.iter_mut().enumerate() {
        let load_factor = if (1000..1050).contains(&k) { 3.0 } else { 1.5 };
        sample.specific_force_mps2 = [0.0, 0.0, -load_factor * 9.80665];
    }
    let airframe = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/airframe.toml");
    let airframe = greylag::physics::Airframe::load(&airframe).unwrap();
    let mut limits = greylag::control::quality::Limits::of(&airframe);
    // the made-up flight is slow, and its commands tremble
    (limits.airspeed_mps, limits.slew_per_s) = ([5.0, 45.0], 1e3);
    let mut report = report_synthetic::report(&flight);
    report.envelope = Some(EnvelopeFlown { limits, flying_from_mps: 6.0 });
    let (outcome, first) = verdict(&report);
    assert_eq!(outcome, Outcome::Missed);
    let outside = "Outside limits for 0.500 s (load factor 3.0, limit 2.2)";
    assert!(first.starts_with(&format!("{outside}; ")), "{first}");
    // a line each on the page, all of them in the one line of a terminal
    let (line, html) = (report.page_sentence(), report.page().render());
    let load = "oad factor 1.50 to 3.00 (at most 2.20, no lower limit stated)";
    for part in [format!("L{load}"), "Latency".to_owned()] {
        assert!(html.contains(&format!("<li>{part}")), "{part}");
    }
    // beside the word, why; and what to do next
    let why = html.split("Missed: ").nth(1).and_then(|rest| rest.split('<').next());
    assert!(why.is_some_and(|why| why.contains("load factor or angle of attack")), "{why:?}");
    assert!(
        html.contains(
            "<code>greylag compare --model params/x8/jsbsim.toml --log flight.csv</code>"
        )
    );
    let sentence = line;
    for part in [outside, load, "latency"] {
        assert!(sentence.contains(part), "{part}: {sentence}");
    }
    report.envelope = Some(EnvelopeFlown {
        limits: greylag::control::quality::Limits { load_factor: [-1.0, 2.9], ..limits },
        flying_from_mps: 6.0,
    });
    // 3.0 is beyond 2.9 by less than a twentieth: outside for as long, and yet kept
    let all = report.segments.len();
    let (outcome, sentence) = verdict(&report);
    assert!(
        sentence.contains(&format!(" {} of {all} targets; slowest to roll ", report.tracked())),
        "{sentence}"
    );
    assert_eq!(outcome == Outcome::Missed, report.tracked() < all);
    let html = report.page().render();
    assert!(html.contains("Integral of error (° s)") && html.contains("2.90"));

    // all targets are reached, outside a limit that the outcome does not count: one line says both
    report.segments = vec![settled(Difficulty::Easy, 0.02); 3];
    report.envelope = Some(EnvelopeFlown {
        limits: greylag::control::quality::Limits {
            load_factor: [-1.0, 3.5],
            pitch_deg: [-90.0, -89.0],
            ..limits
        },
        flying_from_mps: 6.0,
    });
    let (outcome, sentence) = verdict(&report);
    assert_eq!(outcome, Outcome::Reached);
    assert!(sentence.starts_with("Reached all 3 targets; outside limits for "), "{sentence}");
    let html = report.page().render();
    assert!(html.contains(">Reached all 3 targets; outside the limit of pitch for "), "{sentence}");
}

#[test]
fn the_first_sentence_says_what_happened() {
    let flight = report_synthetic::flight();
    let mut report = report_synthetic::report(&flight);
    report.segments = vec![
        settled(Difficulty::Easy, 0.02),
        settled(Difficulty::Easy, 0.04),
        settled(Difficulty::Hard, 0.05),
    ];
    // a target of 0.1 rad in roll; the tolerance is 0.5°, the longest cycle 1 ms
    let worst = "largest settled error 0.05°, at roll +6°, pitch 0°.";
    let sentence = format!("Flew as commanded: 3 of 3 targets; {worst}");
    assert_eq!(verdict(&report), (Outcome::Reached, sentence));
    // means: (0.02 + 0.04) / 2 easy, 0.05 hard
    let line = report.page_sentence();
    let beside =
        ["; mean settled error 0.03° easy, 0.05° hard", "; no late cycle of the companion"];
    assert!(beside.iter().all(|part| line.contains(part)), "{line}");

    report.segments[2].settled_error_rad = f64::NAN;
    let sentence = format!("Tracked 2 of 3 targets; {}", worst.replace("0.05", "0.04"));
    assert_eq!(verdict(&report), (Outcome::Missed, sentence));

    report.segments.truncate(2);
    // One cycle just over the budget of 10 ms, one exactly at it.
    let cycles = &mut report.timing.as_mut().unwrap().cycles;
    cycles.push(Cycle { time_s: 60.0, duration_us: 10_000.1 });
    cycles.push(Cycle { time_s: 60.01, duration_us: 10_000.0 });
    let sentence = format!("Flew as commanded: 2 of 2 targets; {}", worst.replace("0.05", "0.04"));
    assert_eq!(verdict(&report), (Outcome::Late, sentence));
    let cycles = report.timing.as_ref().unwrap().cycles.len();
    let said = format!("Reached, but this computer was late in 1 of {cycles} cycles");
    assert!(report.page().render().contains(&said));
    assert!(report.page_sentence().contains("; 1 late cycle of the companion"));

    report.timing = None;
    assert_eq!(verdict(&report).0, Outcome::Open, "a loop that was not timed may have been late");
}

#[test]
fn a_flight_without_samples_is_still_a_page() {
    let empty = Flight::default();
    let mut report = report_synthetic::report(&empty);
    report.timing.as_mut().unwrap().cycles.clear();
    let html = report.page().render();
    assert_well_formed(&html);
    // no cycle was timed: the page must not say that none was late
    assert!(html.contains("Loop timing was not recorded") && !html.contains("no late cycle"));
    assert!(!html.contains("NaN ms"));

    let broken = Flight::from(vec![Sample::default(); 3]);
    let mut report = report_synthetic::report(&broken);
    report.tolerance_rad = f64::NAN;
    report.segments = vec![settled(Difficulty::Easy, f64::INFINITY)];
    report.events[0].time_s = f64::NAN;
    let html = report.page().render();
    assert_well_formed(&html);
    assert!(html.contains("Not in this log: Roll (actual)"));
}

#[test]
fn a_long_flight_is_thinned_and_says_so() {
    // 50,000 samples with one spike: at two values for every five, 20,000 rows.
    let samples = (0..50_000).map(|i| Sample {
        time_s: f64::from(i) * 0.01,
        attitude_rad: [if i == 31_234 { 1.0 } else { 0.0 }, 0.0, 0.0],
        ..Sample::default()
    });
    let flight = Flight::from(samples.collect::<Vec<_>>());
    let html = report_synthetic::report(&flight).page().render();
    assert!(html.contains("smallest and largest of every 5 samples"));
    let figures = figures(&html);
    let track = &figures[0]["data"]["tracks"][0];
    assert_eq!(track["time_s"].as_array().unwrap().len(), 20_000);
    let roll = track["panels"][0]["series"][0]["values"].as_array().unwrap();
    let highest = roll.iter().filter_map(Value::as_f64).fold(f64::MIN, f64::max);
    // One radian in degrees, at the six digits of the page.
    assert!((highest - 57.2958).abs() < 1e-5, "the spike of one sample is {highest}");
}

#[test]
fn a_file_is_never_overwritten_unasked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    write_new(&path, "first").unwrap();
    let refused = write_new(&path, "second").unwrap_err();
    assert!(matches!(&refused, WriteError::Exists { path: p } if *p == path), "{refused}");
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "first");
    write_over(&path, "third").unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "third");

    let nowhere = folder.path().join("absent").join("report.html");
    let refused = write_new(&nowhere, "text").unwrap_err();
    assert!(matches!(refused, WriteError::Io { .. }), "{refused}");
    // No temporary file is left beside the report.
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_its_target_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let [target, link] = ["target.html", "link.html"].map(|name| folder.path().join(name));
    std::os::unix::fs::symlink("target.html", &link).unwrap();
    // at first the target does not exist
    for text in ["made", "replaced"] {
        write_over(&link, text).unwrap();
        assert!(link.is_symlink() && !target.is_symlink());
        assert_eq!(std::fs::read_to_string(&target).unwrap(), text);
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
}

#[cfg(unix)]
#[test]
fn a_named_pipe_is_written_and_stays() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let reader = pipe.clone();
    let reader = std::thread::spawn(move || std::fs::read_to_string(reader).unwrap());
    write_over(&pipe, "text").unwrap();
    // checked before the reader is waited for: it never ends if the pipe was replaced
    assert!(std::fs::metadata(&pipe).unwrap().file_type().is_fifo());
    assert_eq!(reader.join().unwrap(), "text");
}

#[test]
fn an_empty_page_is_a_page() {
    assert_well_formed(&Page::default().render());
}
