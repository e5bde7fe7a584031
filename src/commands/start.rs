//! Initial state of an episode (one simulated flight) in JSBSim, and notes about the simulated aircraft.

use anyhow::{Result, bail};
use greylag_sitl::plant::{Plant, PlantOptions, Start};

use crate::model::GreyBox;
use crate::physics::servos::Travels;
use crate::sim::described::describe as describe_aircraft;

/// The aircraft that starts at the paper's airspeed (T. Guerin et al., 2026).
const X8: &str = "x8";
/// Largest relative difference between the travel of a surface in the airframe file and in the simulator that is not reported.
/// Numbers in files have four digits.
const TRAVEL_TOLERANCE: f64 = 1e-3;

/// Options for the initial state of an episode.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Start")]
pub struct StartArguments {
    /// True airspeed at the start, which is also the commanded airspeed [default: 16.67 for the X8,
    /// else the cruise airspeed of the model's airframe].
    #[arg(long, value_name = "MPS")]
    start_airspeed_mps: Option<f64>,
    /// Altitude at the start, above mean sea level.
    #[arg(long, value_name = "M", default_value_t = Start::NEUTRAL.altitude_m, allow_negative_numbers = true)]
    start_altitude_m: f64,
}

impl StartArguments {
    /// The initial state of `aircraft`. The controllers that fly it are designed from `models`.
    ///
    /// # Errors
    /// If neither the option nor a model gives an airspeed, if the airspeed or the altitude is not finite, or if the airspeed
    /// is below the smallest airspeed of a model.
    pub fn start(&self, aircraft: &str, models: &[GreyBox]) -> Result<Start> {
        let cruise = models.first().map(|m| m.airframe.envelope.airspeed_cruise_mps);
        let default = if aircraft == X8 { Some(Start::NEUTRAL.airspeed_mps) } else { cruise };
        let Some(airspeed_mps) = self.start_airspeed_mps.or(default) else {
            bail!(
                "no model says how fast the aircraft '{aircraft}' flies: give --start-airspeed-mps"
            );
        };
        if !(airspeed_mps.is_finite() && self.start_altitude_m.is_finite()) {
            bail!("--start-airspeed-mps and --start-altitude-m: give finite numbers");
        }
        for model in models {
            let slowest = model.airframe.envelope.airspeed_min_mps;
            if airspeed_mps < slowest {
                bail!(
                    "cannot start at {airspeed_mps} m/s: the airframe of model {} flies no slower than \
                     {slowest} m/s (airspeed_min_mps); give a larger --start-airspeed-mps",
                    model.name
                );
            }
        }
        Ok(Start { airspeed_mps, altitude_m: self.start_altitude_m, ..Start::NEUTRAL })
    }
}

/// The default initial state of `aircraft`. The controllers that fly it are designed from `models`.
///
/// # Errors
/// The same as [`StartArguments::start`].
pub fn usual(aircraft: &str, models: &[GreyBox]) -> Result<Start> {
    let start_altitude_m = Start::NEUTRAL.altitude_m;
    StartArguments { start_airspeed_mps: None, start_altitude_m }.start(aircraft, models)
}

/// Applies surfaces, motors and conditions of the airframe of the first of `models` to the simulator's aircraft.
///
/// # Errors
/// If the airframe gives the JSBSim position property for some surfaces and not for others, or its mixer cannot be simulated.
pub fn describe(plant: &mut PlantOptions, models: &[GreyBox]) -> Result<()> {
    let Some(model) = models.first() else { return Ok(()) };
    describe_aircraft(plant, &model.airframe)
        .map_err(|why| anyhow::anyhow!("the airframe of model {}: {why}", model.name))
}

/// Prints on standard error the simulator's notes about the aircraft, and the differences between its surface travel and the
/// travel in the airframes of `models`.
pub fn introduce(options: &PlantOptions, models: &[GreyBox]) -> Result<()> {
    let mut plant = Plant::new(options)?;
    plant.notes().iter().for_each(|note| eprintln!("note: {note}"));
    let Ok(travel) = plant.travel() else { return Ok(()) };
    for model in models {
        let Travels { aileron, elevator, rudder } = model.airframe.actuators.travels();
        let rudders = rudder.zip(travel.rudder);
        let surfaces = [
            Some(("aileron", aileron, travel.aileron)),
            Some(("elevator", elevator, travel.elevator)),
            rudders.map(|(said, measured)| ("rudder", said, measured)),
        ];
        for (surface, said, measured) in surfaces.into_iter().flatten() {
            let close = |a: f64, b: f64| (a - b).abs() <= TRAVEL_TOLERANCE * b.abs();
            if !(close(measured.least_rad, said.least) && close(measured.most_rad, said.most)) {
                eprintln!(
                    "note: the {surface} of the aircraft goes from {:.4} to {:.4} rad, the airframe of model \
                     {} says {:.4} to {:.4}: its controllers take a command for another deflection",
                    measured.least_rad, measured.most_rad, model.name, said.least, said.most
                );
            }
        }
        if rudder.is_some() && travel.rudder.is_none() {
            eprintln!("note: the airframe of model {} has a rudder, the aircraft none", model.name);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn x8() -> Vec<GreyBox> {
        vec![GreyBox::load("params/x8/jsbsim.toml".as_ref()).unwrap()]
    }

    fn start(airspeed: Option<f64>, aircraft: &str, models: &[GreyBox]) -> Result<Start> {
        let arguments = StartArguments { start_airspeed_mps: airspeed, start_altitude_m: 600.0 };
        arguments.start(aircraft, models)
    }

    #[test]
    fn the_x8_starts_as_in_the_paper_and_another_aircraft_at_its_cruise() {
        let models = x8();
        assert_eq!(start(None, "x8", &models).unwrap(), Start::NEUTRAL);
        let cruise = models[0].airframe.envelope.airspeed_cruise_mps;
        assert_eq!(start(None, "other", &models).unwrap().airspeed_mps, cruise);
        assert_eq!(start(Some(25.0), "other", &models).unwrap().airspeed_mps, 25.0);
    }

    #[test]
    fn a_start_without_an_airspeed_or_below_the_models_is_refused() {
        let models = x8();
        let slow = 0.9 * models[0].airframe.envelope.airspeed_min_mps;
        let message = start(Some(slow), "x8", &models).unwrap_err().to_string();
        assert!(message.contains("airspeed_min_mps"), "{message}");
        let message = start(Some(f64::NAN), "x8", &models).unwrap_err().to_string();
        assert!(message.contains("--start-airspeed-mps"), "{message}");
        let message = start(None, "other", &[]).unwrap_err().to_string();
        assert!(message.contains("--start-airspeed-mps"), "{message}");
    }
}
