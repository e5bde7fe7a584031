//! Flight-path reconstruction: from a log to states without sensor errors.
//!
//! Kinematics hold no aerodynamics, so what the sensors do wrong, and what the wind does, is decided
//! here, before any model of the aircraft is looked at.

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

use equations::Problem;
use sampling::Chosen;

use crate::flight_path::reconstruction::Reconstruction;
use greylag_logs::phases::Flying;
use greylag_logs::{Flight, Sampling};
use greylag_model::GreyBox;
use greylag_physics::Sensors;
use greylag_physics::airframe::ActuatorFigures;

/// Which clock the deflections are handed out on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActuatorClock {
    /// The gyros': recorded deflections that came late beyond doubt are put right. A time delay or a lag
    /// of the surfaces that the record does not show looks the same, so it goes with the delay.
    Estimated,
    /// The log's: deflections stay as recorded, so that whoever looks for missing effects decides what
    /// is clock, what is physics. `skew_actuators` is estimated all the same, for information.
    AsRecorded,
}

/// What a reconstruction needs besides the log.
#[derive(Clone, Debug)]
pub struct Options {
    /// What the flight is called in reports: its file.
    pub name: String,
    /// The airframe's actuators: commands become deflections through them where the log has none.
    pub actuators: ActuatorFigures,
    /// Effective gravity, m/s².
    pub gravity: f64,
    /// What a rate sample stands for; `None` to take it from the log: from its
    /// column `rate_hold_s`, else from its clocks. Clock skews
    /// are relative to the gyros' samples so understood.
    pub sampling: Option<Sampling>,
    /// Which clock the deflections are handed out on.
    pub actuators_clock: ActuatorClock,
    /// Shortest time between reconstructed samples, s; a slower log keeps its own median period.
    pub step_s: f64,
    /// Longest time between rows that is no gap, s.
    pub gap_s: f64,
    /// Shortest segment worth reconstructing, s.
    pub shortest_s: f64,
    /// Airspeed under which the aircraft is taken not to fly, m/s.
    pub airspeed_min_mps: f64,
    /// What is known of the aircraft's sensors; what the flight itself says goes before it.
    pub sensors: Sensors,
}

impl Options {
    /// The usual figures for the flight `name` of an aircraft with `actuators`.
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

    /// The same for the aircraft and the gravity of `model`, deflections on `clock`.
    ///
    /// An aircraft that flies more slowly than usual is followed to a lower airspeed and in shorter
    /// stretches.
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

    /// The same for segments of `shortest_s` (s) too, where that is less.
    pub fn down_to(self, shortest_s: f64) -> Options {
        Options { shortest_s: self.shortest_s.min(shortest_s), ..self }
    }
}

/// Why a flight cannot be reconstructed.
#[derive(Debug, thiserror::Error)]
pub enum ReconstructError {
    /// A needed channel is missing altogether.
    #[error(
        "cannot reconstruct {flight}: it has no usable {channel}; log it, or map the message that \
         holds it to the column {column}"
    )]
    Missing {
        /// The flight.
        flight: String,
        /// What is missing.
        channel: &'static str,
        /// The column of the log format that would satisfy it.
        column: &'static str,
    },
    /// There is no flight in the log.
    #[error(
        "cannot reconstruct {flight}: its airspeed never exceeds {fastest_mps:.1} m/s, so there is no \
         flight in it; check the unit of airspeed_mps, or give a log of a flight"
    )]
    NoFlight {
        /// The flight.
        flight: String,
        /// The largest airspeed in it, m/s.
        fastest_mps: f64,
    },
    /// No stretch is long enough.
    #[error(
        "cannot reconstruct {flight}: its longest stretch in flight without a gap is {longest_s:.1} s, \
         under {shortest_s:.1} s; give a longer log, or one with a steadier logging rate"
    )]
    TooShort {
        /// The flight.
        flight: String,
        /// Its longest stretch, s.
        longest_s: f64,
        /// The shortest stretch worth reconstructing, s.
        shortest_s: f64,
    },
    /// The sensors contradict one another so that no path was found.
    #[error(
        "cannot reconstruct {flight}: no flight path fits its sensors ({why}); check the units and \
         signs of attitude, rates and accelerations"
    )]
    NoPath {
        /// The flight.
        flight: String,
        /// How the search ended.
        why: &'static str,
    },
}

/// Reconstructs `flight`: one uniform clock a segment, sensor errors and wind estimated and removed.
///
/// # Errors
/// A needed channel is missing, there is no flight in the log or no stretch of it is long enough, or
/// its sensors contradict one another.
pub fn reconstruct(flight: &Flight, options: &Options) -> Result<Reconstruction, ReconstructError> {
    let log = intake::take_in(flight, options)?;
    let (means, widths) = (nuisance::prior_means(&log), nuisance::prior_widths(&log));
    let declared = options.sampling.or_else(|| flight.declared_sampling());
    let problem = Problem { log: &log, options, sampling: Sampling::Instants, means, widths };
    let Chosen { sampling, found, note } = sampling::choose(&problem, declared)?;
    let widths = found.widths;
    let mut outcome = outcome::assemble(&Problem { sampling, widths, ..problem }, &found)?;
    outcome.notes.extend(note);
    Ok(outcome)
}
