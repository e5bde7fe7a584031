//! `greylag faults --monitor`: false-alarm rate and detection delay of the model monitor. The monitor compares measured
//! accelerations with those that the model predicts, and warns of failures such as a stuck surface.

use std::process::ExitCode;

use anyhow::Result;
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use rayon::prelude::*;

use crate::sim::faults::{ATTITUDE_DEG, CompanionFactory, FAILS_S, Failure, Watched};

/// Largest accepted fraction of healthy flights with a false alarm: one in forty.
const FALSE_ALARMS: f64 = 1.0 / 40.0;

/// Flies `flights` simulated flights with each failure and as many healthy ones (without a failure), and prints a table. The
/// exit status is 1 if too many healthy flights had a false alarm. `first` is the first random seed.
///
/// # Errors
/// If the aircraft cannot be built, or a seed would exceed 64 bits.
pub fn run(factory: &CompanionFactory, first: u64, flights: u64) -> Result<ExitCode> {
    let seeds = super::seeds(first, flights)?;
    let [roll, pitch, heading] = ATTITUDE_DEG;
    println!(
        "{flights} flights of 60 s each with a simulated ArduPlane, attitude off by up to {roll} deg in roll, {pitch} in pitch, \
         {heading} in heading; surfaces stick at {FAILS_S} s"
    );
    let mut table = Table::new();
    table.load_style(NOTHING);
    table.set_header(["aircraft", "engaged", "false alarms", "found", "delay, median", "90 %"]);
    let mut alarmed = 0;
    for failure in Failure::ALL {
        let watched: Result<Vec<Watched>, _> =
            seeds.clone().into_par_iter().map(|seed| factory.watched(seed, failure)).collect();
        let watched = watched?;
        let alarms: usize = watched.iter().map(|w| w.false_alarms(failure)).sum();
        if failure == Failure::None {
            alarmed = watched.iter().filter(|w| w.false_alarms(failure) > 0).count();
        }
        table.add_row(row(failure, &watched, alarms));
        for (seed, flight) in (first..).zip(&watched) {
            for (at, words) in flight.said.iter().filter(|_| flight.false_alarms(failure) > 0) {
                let [r, p, y] = flight.attitude_error_deg;
                println!(
                    "seed {seed}, {} ({r:+.1}, {p:+.1}, {y:+.1} deg off): {at:.1} s: {words}",
                    failure.name()
                );
            }
        }
    }
    println!("{table}");
    let bound = FALSE_ALARMS * flights as f64;
    println!("healthy flights with a false alarm: {alarmed} of {flights} (at most 1 in 40)");
    Ok(if alarmed as f64 <= bound.max(0.0) { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn row(failure: Failure, watched: &[Watched], alarms: usize) -> Vec<String> {
    let engaged = watched.iter().filter(|w| w.since_s.is_some()).count();
    let mut delays: Vec<f64> = watched.iter().filter_map(Watched::delay_s).collect();
    delays.sort_by(f64::total_cmp);
    let at = |share: f64| {
        // An engaged flight is one in which the companion had control. The quantile is taken over all engaged flights, so
        // undetected failures count as the longest delays.
        let index = (share * engaged.max(1) as f64).ceil() as usize;
        delays.get(index.saturating_sub(1)).map_or("-".into(), |s| format!("{s:.1} s"))
    };
    let found = |words: String| if failure == Failure::None { "-".into() } else { words };
    vec![
        failure.name().into(),
        engaged.to_string(),
        alarms.to_string(),
        found(format!("{} of {engaged}", delays.len())),
        found(at(0.5)),
        found(at(0.9)),
    ]
}
