//! Prints the results of `greylag link check` on latency, delay margin and parameters.

use std::io::Write;

use super::print_to;
use crate::link::vehicle::Real;
use crate::link::vehicle::real::parameters::Standing;

pub(super) fn latency(real: &Real, out: &mut dyn Write) {
    let trips = real.survey().round_trips();
    let at = |share: f64| {
        let index = ((trips.len() - 1) as f64 * share).round() as usize;
        trips[index].as_secs_f64() * 1e3
    };
    match trips.is_empty() {
        true => print_to!(out, "latency     TIMESYNC is not answered"),
        false => print_to!(
            out,
            "latency     TIMESYNC there and back: median {:.1}, 95 % {:.1}, longest {:.1} ms ({} trips)",
            at(0.5),
            at(0.95),
            at(1.0),
            trips.len()
        ),
    }
}

/// Prints the delay of the control loop and what it leaves of the controller's delay margin. If nothing is left, the reason
/// is added to `missing`.
pub(super) fn delay(real: &Real, missing: &mut Vec<String>, out: &mut dyn Write) {
    if let Some(words) = real.delay_words() {
        print_to!(out, "\ndelay       {words}");
    }
    missing.extend(real.delay_obstacle());
}

pub(super) fn parameters(real: &Real, missing: &mut Vec<String>, out: &mut dyn Write) {
    print_to!(out, "\nparameters");
    for (_, standing, words) in real.parameter_report() {
        print_to!(out, "  {words}");
        if !matches!(standing, Standing::Good(_) | Standing::Absent) {
            missing.push(words);
        }
    }
}
