//! Intake of a log for flight-path reconstruction: resamples it to uniform time steps. Each stretch without gaps becomes a track.

mod channels;
mod stretches;
mod track;

use std::borrow::Borrow;

use crate::flight_path::channel::Channel;
use crate::flight_path::{Options, ReconstructError, lever_arm};
use channels::Channels;
use greylag_logs::rudder::RudderMotion;
use greylag_logs::{Flight, FlowAngles};
use greylag_physics::Sensors;
use stretches::{gap, step, stretches};
use track::track;

/// A stretch with fewer samples of attitude or airspeed is left out.
const FEWEST: usize = 10;

/// Largest number of left-out stretches that get their own note, because a log with many gaps can have thousands.
const NAMED: usize = 8;

/// Note on a log whose flow angles are estimates.
const ESTIMATED: &str = "α and β of this log are the flight controller's estimates, not measurements: left out. If the \
                         aircraft has vanes, map alpha_rad and beta_rad to them.";

/// A log after resampling.
#[derive(Clone, Debug)]
pub struct Log {
    /// Time between samples, s.
    pub step: f64,
    /// The stretches without gaps that are used.
    pub tracks: Vec<Track>,
    /// Optional sensors that the log contains.
    pub has: Present,
    /// Times between the measurements of the sensors.
    pub periods: Periods,
    /// Motion of the rudder, if it moves.
    pub rudder: Option<RudderMotion>,
    /// Errors and noise of the sensors, and the wind, as stated in the options or the log.
    pub sensors: Sensors,
    /// Notes on the log for the user, in sentences.
    pub notes: Vec<String>,
}

/// Optional sensors that a log contains.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Present {
    /// Whether the heading is logged.
    pub yaw: bool,
    /// Whether accelerometers are logged.
    pub force: bool,
    /// Whether a vane measures the angle of attack.
    pub alpha: bool,
    /// Whether a vane measures sideslip.
    pub beta: bool,
    /// Whether the velocity over ground is logged.
    pub velocity: bool,
    /// Whether the altitude is logged.
    pub altitude: bool,
}

/// Typical time between the measurements of a sensor, s; 0 if it is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Periods {
    /// Period of the attitude, s.
    pub attitude: f64,
    /// Period of the airspeed, s.
    pub airspeed: f64,
    /// Period of the vanes, s.
    pub vanes: f64,
    /// Period of the velocity over ground, s.
    pub velocity: f64,
}

/// Time interval of a flight, from the start of its first stretch to the end of its last.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// Middle of the flight on the log's clock, s.
    pub middle: f64,
    /// Length of the flight, s.
    pub length: f64,
}

/// The measurements in a stretch without gaps, resampled. A missing measurement is NaN. Units are those of
/// [`Sample`](greylag_logs::Sample).
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Time of the first sample, s.
    pub start: f64,
    /// Time interval of the whole flight.
    pub span: Span,
    /// Body rates p, q, r; never missing.
    pub rates: Vec<[f64; 3]>,
    /// Specific force, body axes; never missing if the log has accelerometers.
    pub force: Vec<[f64; 3]>,
    /// Roll, pitch, yaw, wrapped to ±π.
    pub attitude: Vec<[f64; 3]>,
    /// Measured true airspeed.
    pub airspeed: Vec<f64>,
    /// Measured angles of attack and sideslip.
    pub vanes: Vec<[f64; 2]>,
    /// Measured velocity over ground: north, east, down.
    pub velocity: Vec<[f64; 3]>,
    /// Altitude, interpolated; never missing if the stretch has any sample of the altitude.
    pub altitude: Vec<f64>,
    /// Air density; never missing.
    pub density: Vec<f64>,
    /// Last command at or before each sample: aileron, elevator, throttle, rudder.
    pub commands: Vec<[f64; 4]>,
    /// Deflections of aileron and elevator, throttle position and deflection of the rudder; never missing.
    pub controls: Vec<[f64; 4]>,
}

impl Track {
    /// Number of samples.
    pub fn len(&self) -> usize {
        self.rates.len()
    }

    /// Time of sample `k` on the log's clock, s. `step` is the time between samples, s.
    pub fn time(&self, k: usize, step: f64) -> f64 {
        self.start + k as f64 * step
    }
}

/// Converts a log to tracks: splits it at gaps, interpolates the measurements, and holds each command until the next one. A flight
/// that is passed by value is dropped before the tracks are made.
///
/// # Errors
/// If a required channel is missing, the log contains no flight, or no stretch can be used.
pub fn take_in(log: impl Borrow<Flight>, options: &Options) -> Result<Log, ReconstructError> {
    let flight: &Flight = log.borrow();
    let channels = Channels::of(flight);
    channels.check(&options.name)?;
    let has = channels.sensors();
    let mut notes = Vec::new();
    declare(&channels, &has, options, &mut notes);
    if flight.flow_angles == FlowAngles::Estimated {
        notes.push(ESTIMATED.into());
    }
    let stretches = stretches(flight, &has, options)?;
    if !has.yaw && !has.velocity {
        notes.push(
            "The log has no heading and no velocity over ground: the heading is integrated from the \
             gyros, and the wind stays at its prior. Log one of them."
                .into(),
        );
    }
    let (step, gap) = (step(&stretches, options), gap(flight, options));
    let rudder = RudderMotion::of(&flight.samples);
    let periods = channels.periods();
    let sensors = options.sensors.overridden_by(&flight.sensors);
    drop(log);
    let mut log = Log { step, tracks: Vec::new(), has, periods, rudder, sensors, notes };
    let (mut longest, mut left_out) = (0.0_f64, Vec::new());
    for times in &stretches {
        let [start, end] = [times[0], times[times.len() - 1]];
        longest = longest.max(end - start);
        let sensed = |c: &Channel| c.count(start, end) >= FEWEST;
        let why = if end - start < options.shortest_s {
            Some("too short")
        } else if !channels.attitude[..2].iter().all(sensed) || !sensed(&channels.airspeed) {
            Some("without attitude or airspeed")
        } else {
            None
        };
        match why {
            Some(why) => left_out.push(([start, end], why)),
            None => {
                let mut track = track(&channels, &has, [start, end], [step, gap], options);
                if let Some(at) = log.sensors.accelerometer_at() {
                    lever_arm::to_the_centre(&mut track, at, step);
                }
                log.tracks.push(track);
            }
        }
    }
    log.notes.extend(unused(&left_out));
    if log.tracks.is_empty() {
        let (flight, shortest_s) = (options.name.clone(), options.shortest_s);
        return Err(ReconstructError::TooShort { flight, longest_s: longest, shortest_s });
    }
    let ends = log.tracks.iter().map(|t| t.time(t.len(), step));
    let (start, end) = (log.tracks[0].start, ends.fold(f64::NEG_INFINITY, f64::max));
    let span = Span { middle: 0.5 * (start + end), length: end - start };
    log.tracks.iter_mut().for_each(|track| track.span = span);
    Ok(log)
}

/// Notes on the stretches `left_out`. An entry has the start and end of a stretch, s, and the reason.
fn unused(left_out: &[([f64; 2], &str)]) -> Vec<String> {
    let note = |([start, end], why): &([f64; 2], &str)| {
        format!("The stretch from {start:.2} s to {end:.2} s is left out: {why}.")
    };
    let mut notes: Vec<String> = left_out.iter().take(NAMED).map(note).collect();
    let rest = left_out.get(NAMED..).unwrap_or_default();
    if !rest.is_empty() {
        let seconds: f64 = rest.iter().map(|([start, end], _)| end - start).sum();
        notes.push(format!(
            "{} further stretches of {seconds:.1} s in all are left out for such reasons.",
            rest.len()
        ));
    }
    notes
}

fn declare(channels: &Channels, has: &Present, options: &Options, notes: &mut Vec<String>) {
    let mut stuck = |channels: &[Channel], what: &str| {
        if channels.iter().any(|c| c.stuck) {
            notes.push(format!("The {what} shows one and the same value all the time: left out."));
        }
    };
    stuck(&channels.attitude[2..], "heading");
    stuck(&channels.force, "accelerometer on an axis");
    stuck(&channels.vanes[..1], "angle-of-attack vane");
    stuck(&channels.vanes[1..], "sideslip vane");
    stuck(&channels.velocity[..2], "velocity over ground");
    let steered = ["aileron", "elevator", "throttle"].into_iter();
    let rudder = options.actuators.rudder.filter(|_| !channels.commands[3].is_empty());
    let absent: Vec<_> = steered
        .chain(rudder.map(|_| "rudder"))
        .zip(&channels.positions)
        .filter(|(_, c)| c.is_empty())
        .map(|(name, _)| name)
        .collect();
    if !absent.is_empty() {
        notes.push(format!(
            "The positions of {} are not logged: reconstructed from the commands through the \
             airframe's actuators.",
            absent.join(", ")
        ));
    }
    notes.push(if !channels.density.is_empty() {
        "Air density: as logged.".into()
    } else if has.altitude {
        "Air density: standard atmosphere at the logged altitude.".into()
    } else {
        "Air density: standard atmosphere at sea level, for want of an altitude.".into()
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_of_gaps_has_few_notes() {
        let of = |count: usize| -> Vec<([f64; 2], &'static str)> {
            (0..count).map(|k| ([k as f64, k as f64 + 0.5], "too short")).collect()
        };
        assert_eq!(unused(&of(1)), ["The stretch from 0.00 s to 0.50 s is left out: too short."]);
        let many = unused(&of(5000));
        assert_eq!(many.len(), NAMED + 1);
        assert!(many[NAMED].starts_with("4992 further stretches of 2496.0 s in all"), "{many:?}");
    }
}
