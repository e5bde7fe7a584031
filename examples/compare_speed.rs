//! Measures the time and the memory for the comparison and the diagnosis of a ten-minute log:
//! `cargo run --release --example compare_speed`. With `-- write FILE MINUTES` the example only writes such a log.

#[path = "../tests/support/compare.rs"]
mod compare_support;

use std::ops::ControlFlow;
use std::sync::Mutex;
use std::time::Instant;

use compare_support::{REALISTIC, fly, model};
use greylag::logs::{self, csv};
use greylag::report::{ComparisonReport, DiagnosisReport};
use greylag::sysid::compare::{Options, compare};
use greylag::sysid::diagnose::{self, diagnose};
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag::sysid::progress::Stage;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if let [command, path, minutes] = &words[..]
        && command == "write"
    {
        let minutes: f64 = minutes.parse().expect("minutes");
        let file = std::fs::File::create(path).expect("a file that can be written");
        let flight = fly(1, 60.0 * minutes, REALISTIC);
        return csv::write(&flight, std::io::BufWriter::new(file)).expect("space on the disk");
    }
    let mut text = Vec::new();
    csv::write(&fly(1, 600.0, REALISTIC), &mut text).expect("memory");
    println!("ten minutes at 100 Hz; {} MB resident before", status_mb("VmRSS:"));
    let start = Instant::now();
    let log = logs::parse(&text, "ten-minutes.csv".as_ref(), &logs::Options::default());
    let flight = log.expect("a log").flight;
    println!("{} samples read in {:.2} s", flight.samples.len(), start.elapsed().as_secs_f64());
    let start = Instant::now();
    let prior = model("prior-as-printed");
    let mut options = flight_path::Options::new("ten minutes", prior.airframe.actuators);
    options.actuators_clock = ActuatorClock::AsRecorded;
    let flight = reconstruct(&flight, &options).expect("a flight");
    println!("reconstructed in {:.2} s", start.elapsed().as_secs_f64());
    let flights = [flight];
    let start = Instant::now();
    let answer = diagnose(
        &model("jsbsim"),
        &flights,
        &diagnose::Options::default(),
        &greylag::sysid::progress::ignore_progress,
    );
    let answer = answer.expect("a diagnosis");
    println!(
        "diagnosed with {} nulls in {:.2} s: {:?}",
        answer.nulls.count,
        start.elapsed().as_secs_f64(),
        answer.verdict
    );
    let start = Instant::now();
    let found = compare(
        &[prior, model("jsbsim")],
        &flights,
        &Options::default(),
        &greylag::sysid::progress::ignore_progress,
    );
    let found = found.expect("a comparison");
    println!("two models compared in {:.2} s", start.elapsed().as_secs_f64());
    let start = Instant::now();
    let page = DiagnosisReport {
        title: "Ten minutes".into(),
        diagnosis: &answer,
        answer: None,
        failing: Some(&found),
        held_out: None,
        effect_files: std::collections::BTreeMap::new(),
        model_file: String::new(),
        log_files: Vec::new(),
        command_line: String::new(),
        versions: Vec::new(),
    };
    let page = page.page().render();
    let (size, seconds) = (page.len() / 1000, start.elapsed().as_secs_f64());
    println!("report of the diagnosis, {size} kB, in {seconds:.2} s");
    ranking();
    let start = Instant::now();
    let json = serde_json::to_string(&found.document()).expect("numbers");
    let report = ComparisonReport {
        title: "Ten minutes".into(),
        comparison: &found,
        model_files: Vec::new(),
        log_files: Vec::new(),
        command_line: String::new(),
        versions: Vec::new(),
    };
    let page = report.page().render();
    println!(
        "JSON of {} kB, report of {} kB in {:.2} s",
        json.len() / 1000,
        page.len() / 1000,
        start.elapsed().as_secs_f64()
    );
    println!("peak {} MB, the simulator and the log's text included", status_mb("VmHWM:"));
}

/// Prints how long the ranking of all candidates takes on a log of two minutes, with an effect missing from the model. The
/// time includes the 100 surrogate data sets without an effect (nulls) and the flexible model. It is taken between two
/// progress reports of the search.
fn ranking() {
    let log = fly(2, 120.0, REALISTIC);
    let mut model = model("jsbsim");
    let mut options = flight_path::Options::new("two minutes", model.airframe.actuators);
    options.actuators_clock = ActuatorClock::AsRecorded;
    let flight = reconstruct(&log, &options).expect("a flight");
    let thrust = model.coefficients().iter().position(|c| c.name == "thrust_linear.Cp_n");
    let values: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
    let wrong = |(k, x): (usize, &f64)| if Some(k) == thrust { 0.2 * x } else { *x };
    model.set_coefficients(&values.iter().enumerate().map(wrong).collect::<Vec<f64>>());
    let remarks = Mutex::new(Vec::new());
    let hear = |stage: Stage<'_>| {
        remarks.lock().expect("one").push((stage.doing.to_owned(), Instant::now()));
        ControlFlow::Continue(())
    };
    diagnose(&model, &[flight], &diagnose::Options::default(), &hear).expect("a diagnosis");
    let remarks = remarks.into_inner().expect("one");
    let at = remarks.iter().position(|(remark, _)| remark.starts_with("ranking")).expect("ranked");
    let seconds = remarks[at + 1].1.duration_since(remarks[at].1).as_secs_f64();
    println!("{} on two minutes, with 100 nulls, in {seconds:.2} s", remarks[at].0);
}

/// The value of the line `key` of `/proc/self/status`, MB; 0 if there is no such line.
fn status_mb(key: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = text.lines().find(|l| l.starts_with(key)).unwrap_or_default();
    line.split_whitespace().nth(1).and_then(|kb| kb.parse::<u64>().ok()).unwrap_or(0) / 1000
}
