//! Finds the stretches of a log in which the aircraft flies and no gap occurs, and the time step for them.

use super::Present;
use crate::flight_path::{Options, ReconstructError};
use greylag_logs::{Flight, Sample};
use greylag_num::statistics::quantile;

/// The time between two rows is a gap if it exceeds both this number of median periods and `Options::gap_s`.
const GAP_PERIODS: f64 = 2.5;
/// Largest median period that is used to detect gaps, s. At a row rate below 5 Hz, the motion between rows is not known.
const SLOWEST_PERIOD: f64 = 0.2;
/// Length of the window around a row over which the airspeed is averaged to decide whether the aircraft flies, s.
const AIRBORNE_WINDOW: f64 = 1.0;

/// The times (s) of the usable rows of each stretch. Fails if the airspeed never reaches `Options::airspeed_min_mps`.
pub(super) fn stretches(
    flight: &Flight,
    has: &Present,
    options: &Options,
) -> Result<Vec<Vec<f64>>, ReconstructError> {
    let usable = |s: &&Sample| {
        s.time_s.is_finite()
            && s.rates_radps.iter().all(|x| x.is_finite())
            && (!has.force || s.specific_force_mps2.iter().all(|x| x.is_finite()))
    };
    let airborne = airborne(flight, options)?;
    let gap = gap(flight, options);
    let mut stretches: Vec<Vec<f64>> = Vec::new();
    for s in flight.samples.iter().filter(usable).filter(|s| airborne(s.time_s)) {
        match stretches.last_mut() {
            Some(times) if times.last().is_some_and(|t| s.time_s <= *t) => {}
            Some(times) if times.last().is_some_and(|t| s.time_s - t <= gap) => {
                times.push(s.time_s);
            }
            _ => stretches.push(vec![s.time_s]),
        }
    }
    Ok(stretches)
}

/// Longest time between two rows that does not count as a gap, s. It is longer in a log with a low row rate.
pub(super) fn gap(flight: &Flight, options: &Options) -> f64 {
    let times: Vec<f64> = flight.samples.iter().map(|s| s.time_s).collect();
    let periods: Vec<f64> =
        times.windows(2).map(|w| w[1] - w[0]).filter(|period| *period > 0.0).collect();
    let period = if periods.is_empty() { 0.0 } else { quantile(&periods, 0.5) };
    1.000_001 * options.gap_s.max(GAP_PERIODS * period.min(SLOWEST_PERIOD))
}

/// Returns a function that decides whether the aircraft flies at a time (s), from the mean airspeed around that time.
fn airborne(flight: &Flight, options: &Options) -> Result<impl Fn(f64) -> bool, ReconstructError> {
    let rows = flight.samples.iter().map(|s| (s.time_s, s.airspeed_mps));
    let (times, speeds): (Vec<f64>, Vec<f64>) =
        rows.filter(|(t, v)| t.is_finite() && v.is_finite()).unzip();
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    let slowest = options.airspeed_min_mps;
    if fastest < slowest {
        return Err(ReconstructError::NoFlight {
            flight: options.name.clone(),
            fastest_mps: fastest,
        });
    }
    let mut sums = vec![0.0];
    for v in &speeds {
        sums.push(sums[sums.len() - 1] + v);
    }
    Ok(move |t: f64| {
        let a = times.partition_point(|x| *x < t - AIRBORNE_WINDOW / 2.0);
        let b = times.partition_point(|x| *x <= t + AIRBORNE_WINDOW / 2.0);
        b > a && sums[b] - sums[a] >= slowest * (b - a) as f64
    })
}

pub(super) fn step(stretches: &[Vec<f64>], options: &Options) -> f64 {
    let periods: Vec<f64> =
        stretches.iter().flat_map(|t| t.windows(2).map(|w| w[1] - w[0])).collect();
    let median = quantile(&periods, 0.5);
    // the factor 1.02 ignores small deviations of the log's clock, which could give a step such as 0.010001 s
    if median.is_finite() && median > 1.02 * options.step_s { median } else { options.step_s }
}
