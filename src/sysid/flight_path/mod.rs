//! Flight-path reconstruction (data compatibility check): estimates states, sensor errors and wind of a logged flight. The sensor
//! errors and the steady wind are called the constants of the flight.
//!
//! It uses only kinematic equations, which contain no aerodynamics. No aerodynamic model of the aircraft is therefore needed.

pub mod impossible;
pub mod installation;
pub mod measurement_effects;
pub mod reconstruction;

mod actuator_skew;
mod band;
mod calibration;
mod channel;
mod equations;
mod gusts;
mod intake;
mod kinematics;
mod levels;
mod lever_arm;
mod manoeuvres;
mod measurement;
mod noise;
pub(crate) mod nuisance;
mod outcome;
mod path;
mod rotation;
mod sampling;
mod smoother;

pub use manoeuvres::{Manoeuvre, ManoeuvreKind, manoeuvres};

use std::borrow::Borrow;

use equations::Problem;
use sampling::Chosen;

use crate::flight_path::reconstruction::Reconstruction;
use greylag_logs::phases::Flying;
use greylag_logs::{Flight, Sampling};
use greylag_model::GreyBox;
use greylag_physics::Sensors;
use greylag_physics::airframe::ActuatorFigures;
use greylag_physics::inputs::{Acts, Kind};

/// Time base of the reconstructed deflections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActuatorClock {
    /// The time base of the gyros: the recorded deflections are shifted by their delay if it is significant. The estimated
    /// delay also contains any delay or lag of the surfaces that the record does not show. The shift removes both.
    Estimated,
    /// The time base of the log: deflections stay as recorded. A later search for missing effects can then separate errors of
    /// the time base from physical delays. The delay `skew_actuators` is estimated for information only.
    AsRecorded,
}

impl ActuatorClock {
    /// Time base for free runs (open-loop simulations) of a model that has, or lacks, the effects `ids`. It is that of the gyros,
    /// unless one of the effects can delay both surfaces (a lag, a delay): it, not the log's clock, then explains why the recorded
    /// deflections come late.
    pub fn beside<'a>(mut ids: impl Iterator<Item = &'a str>) -> ActuatorClock {
        let delays =
            |id: &str| Kind::from_id(id).is_some_and(|kind| kind.acts() == Acts::OnSurfaces);
        match ids.any(delays) {
            true => ActuatorClock::AsRecorded,
            false => ActuatorClock::Estimated,
        }
    }
}

/// Options of a reconstruction.
#[derive(Clone, Debug)]
pub struct Options {
    /// Name of the flight in reports, from its file.
    pub name: String,
    /// Actuator model of the airframe. It converts commands to deflections if the log has no deflections.
    pub actuators: ActuatorFigures,
    /// Gravity at the site, m/s².
    pub gravity: f64,
    /// Meaning of a sample of the body rates: the value at an instant, or a value held until the next sample. If it is `None`,
    /// the log's column `rate_hold_s` states it, or it is inferred from the data. Delays of other sensors are relative to
    /// the body rates in this meaning.
    pub sampling: Option<Sampling>,
    /// Time base of the reconstructed deflections.
    pub actuators_clock: ActuatorClock,
    /// Time between reconstructed samples, s. If the log has a longer median sample period, that period is used.
    pub step_s: f64,
    /// Longest time between rows that does not count as a gap, s.
    pub gap_s: f64,
    /// Shortest segment that is reconstructed, s.
    pub shortest_s: f64,
    /// Airspeed below which the aircraft counts as not flying, m/s.
    pub airspeed_min_mps: f64,
    /// Properties of the aircraft's sensors from its airframe file. Properties that the log states take precedence.
    pub sensors: Sensors,
}

impl Options {
    /// Default options for the flight `name` of an aircraft with `actuators`.
    pub fn new(name: impl Into<String>, actuators: ActuatorFigures) -> Options {
        Options {
            name: name.into(),
            actuators,
            gravity: 9.80665,
            sampling: None,
            actuators_clock: ActuatorClock::Estimated,
            step_s: 0.01,
            gap_s: 0.1,
            shortest_s: 2.0,
            airspeed_min_mps: 5.0,
            sensors: Sensors::default(),
        }
    }

    /// Options for the aircraft and the gravity of `model`. `clock` is the time base of the deflections.
    ///
    /// For a slow aircraft, the airspeed limit and the shortest segment are smaller than the defaults.
    pub fn of(name: &str, model: &GreyBox, clock: ActuatorClock) -> Options {
        let usual = Options::new(name, model.airframe.actuators);
        let flies = Flying::from(model.airframe.envelope.flying_from_mps());
        Options {
            gravity: model.atmosphere.gravity,
            actuators_clock: clock,
            shortest_s: usual.shortest_s.min(flies.sustained_s),
            airspeed_min_mps: usual.airspeed_min_mps.min(flies.from_mps),
            sensors: model.airframe.sensors.clone(),
            ..usual
        }
    }

    /// These options with `shortest_s` reduced to the argument if it is larger.
    pub fn down_to(self, shortest_s: f64) -> Options {
        Options { shortest_s: self.shortest_s.min(shortest_s), ..self }
    }
}

/// Error of a reconstruction.
#[derive(Debug, thiserror::Error)]
pub enum ReconstructError {
    /// A required channel is missing.
    #[error(
        "cannot reconstruct {flight}: it has no usable {channel}; log it, or map the message that \
         holds it to the column {column}"
    )]
    Missing {
        /// Name of the flight.
        flight: String,
        /// The missing channel, in words.
        channel: &'static str,
        /// Column of the log format for the channel.
        column: &'static str,
    },
    /// The log contains no flight.
    #[error(
        "cannot reconstruct {flight}: its airspeed never exceeds {fastest_mps:.1} m/s, so there is no \
         flight in it; check the unit of airspeed_mps, or give a log of a flight"
    )]
    NoFlight {
        /// Name of the flight.
        flight: String,
        /// Largest airspeed in the log, m/s.
        fastest_mps: f64,
    },
    /// No stretch of the flight without a gap is long enough.
    #[error(
        "cannot reconstruct {flight}: its longest stretch in flight without a gap is {longest_s:.1} s, \
         under {shortest_s:.1} s; give a longer log, or one with a steadier logging rate"
    )]
    TooShort {
        /// Name of the flight.
        flight: String,
        /// Length of the longest stretch, s.
        longest_s: f64,
        /// Shortest stretch that can be reconstructed, s.
        shortest_s: f64,
    },
    /// No path fits the sensors: the search has no finite result.
    #[error(
        "cannot reconstruct {flight}: no flight path fits its sensors ({why}); check the units and \
         signs of attitude, rates and accelerations"
    )]
    NoPath {
        /// Name of the flight.
        flight: String,
        /// The reason, in words.
        why: &'static str,
    },
}

/// Reconstructs `flight`: resamples each segment to uniform time steps, and estimates and removes sensor errors and wind. A
/// flight that is passed by value is dropped before the resampling, to free its memory.
///
/// # Errors
/// If a required channel is missing, the log contains no flight, no stretch of it is long enough, or no path fits the
/// sensors.
pub fn reconstruct(
    flight: impl Borrow<Flight>,
    options: &Options,
) -> Result<Reconstruction, ReconstructError> {
    let declared = options.sampling.or_else(|| flight.borrow().declared_sampling());
    let log = intake::take_in(flight, options)?;
    let (means, widths) = (nuisance::prior_means(&log), nuisance::prior_widths(&log));
    let problem = Problem { log: &log, options, sampling: Sampling::Instants, means, widths };
    let Chosen { sampling, found, note } = sampling::choose(&problem, declared)?;
    let installation = calibration::installed(&problem, &found);
    let widths = found.widths;
    let mut outcome = outcome::assemble(&Problem { sampling, widths, ..problem }, &found)?;
    outcome.notes.extend(note);
    outcome.installation = installation;
    Ok(outcome)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_of_the_surfaces_explains_late_deflections_and_a_lag_of_the_thrust_does_not() {
        let clock = |ids: &[&str]| ActuatorClock::beside(ids.iter().copied());
        assert_eq!(clock(&["drag_beta2", "actuator_lag"]), ActuatorClock::AsRecorded);
        assert_eq!(clock(&["drag_beta2", "thrust_lag"]), ActuatorClock::Estimated);
        assert_eq!(clock(&[]), ActuatorClock::Estimated);
    }
}
