//! Intake: a log's rows on one uniform clock a segment.

mod channels;
mod stretches;
mod track;

use crate::flight_path::channel::Channel;
use crate::flight_path::{Options, ReconstructError, lever_arm};
use channels::Channels;
use greylag_logs::rudder::RudderMotion;
use greylag_logs::{Flight, FlowAngles};
use greylag_physics::{Command, Controls, Sensors};
use stretches::{gap, step, stretches};
use track::track;

/// Fewest samples of a sensor in a segment that are worth using.
const FEWEST: usize = 10;

/// What is said of a log without vanes.
const ESTIMATED: &str = "α and β of this log are the flight controller's estimates, not measurements: left out. If the \
                         aircraft has vanes, map alpha_rad and beta_rad to them.";

/// A log on uniform clocks.
#[derive(Clone, Debug)]
pub struct Log {
    /// Time between samples, s.
    pub step: f64,
    /// The stretches without gaps.
    pub tracks: Vec<Track>,
    /// Which sensors the log has.
    pub has: Present,
    /// How often they measure.
    pub periods: Periods,
    /// How the rudder moves, if it does.
    pub rudder: Option<RudderMotion>,
    /// What is known of its sensors and of the wind.
    pub sensors: Sensors,
    /// What the reader must know.
    pub notes: Vec<String>,
}

/// Which of the optional sensors a log has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Present {
    /// Heading.
    pub yaw: bool,
    /// Accelerometers.
    pub force: bool,
    /// Vane for the angle of attack.
    pub alpha: bool,
    /// Vane for sideslip.
    pub beta: bool,
    /// Velocity over ground.
    pub velocity: bool,
    /// Altitude.
    pub altitude: bool,
}

/// Mean time between the measurements of a sensor, s; zero where it is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Periods {
    /// Attitude.
    pub attitude: f64,
    /// Airspeed.
    pub airspeed: f64,
    /// Vanes.
    pub vanes: f64,
    /// Velocity over ground.
    pub velocity: f64,
}

/// The extent in time of a flight with all its stretches.
#[derive(Clone, Copy, Debug, Default)]
pub struct Span {
    /// Its middle on the log's clock, s.
    pub middle: f64,
    /// Its length, s.
    pub length: f64,
}

/// A stretch without gaps, as measured; a missing measurement is NaN. Units as in [`Sample`](greylag_logs::Sample).
#[derive(Clone, Debug, Default)]
pub struct Track {
    /// Time of the first sample, s.
    pub start: f64,
    /// The extent in time of the flight that it is a stretch of.
    pub span: Span,
    /// p, q, r: never missing.
    pub rates: Vec<[f64; 3]>,
    /// Specific force: never missing if the log has it.
    pub force: Vec<[f64; 3]>,
    /// Roll, pitch, yaw, within ±π.
    pub attitude: Vec<[f64; 3]>,
    /// True airspeed.
    pub airspeed: Vec<f64>,
    /// α, β.
    pub vanes: Vec<[f64; 2]>,
    /// Velocity over ground.
    pub velocity: Vec<[f64; 3]>,
    /// Altitude, interpolated; never missing if the segment has it at all.
    pub altitude: Vec<f64>,
    /// Air density: never missing.
    pub density: Vec<f64>,
    /// Commands.
    pub commands: Vec<Option<Command>>,
    /// Deflections: never missing.
    pub controls: Vec<Controls>,
}

impl Track {
    /// The number of samples.
    pub fn len(&self) -> usize {
        self.rates.len()
    }

    /// Time of sample `k`, s; samples `step` (s) apart.
    pub fn time(&self, k: usize, step: f64) -> f64 {
        self.start + k as f64 * step
    }
}

/// Takes a log in: one clock, gaps split, commands held.
///
/// # Errors
/// A needed channel is missing, the log holds no flight, or no stretch is long enough.
pub fn take_in(flight: &Flight, options: &Options) -> Result<Log, ReconstructError> {
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
    let mut log = Log { step, tracks: Vec::new(), has, periods, rudder, sensors, notes };
    let mut longest = 0.0_f64;
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
            Some(why) => log
                .notes
                .push(format!("The stretch from {start:.2} s to {end:.2} s is left out: {why}.")),
            None => {
                let mut track = track(&channels, &has, [start, end], [step, gap], options);
                if let Some(at) = log.sensors.accelerometer_at() {
                    lever_arm::to_the_centre(&mut track, at, step);
                }
                log.tracks.push(track);
            }
        }
    }
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
