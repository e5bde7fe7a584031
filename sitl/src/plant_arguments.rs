//! Command-line options that choose an aircraft and its air.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;

use crate::air::{Air, Gust, Turbulence};
use crate::hidden::Hidden;
use crate::plant::{PlantOptions, Properties};

/// Options for the aircraft and its air, to be flattened into a program's options.
#[derive(Clone, Debug, Args)]
pub struct PlantArgs {
    #[command(flatten)]
    aircraft: AircraftArgs,
    #[command(flatten)]
    air: AirArgs,
}

/// Options that select the aircraft and its changes.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Aircraft")]
struct AircraftArgs {
    /// Folder that holds NAME/NAME.xml; without it one built into the program flies: x8, aerosonde, x8-elevons,
    /// c172p.
    #[arg(long, value_name = "DIR", requires = "aircraft")]
    aircraft_dir: Option<PathBuf>,
    /// Name of the aircraft.
    #[arg(long, value_name = "NAME")]
    aircraft: Option<String>,
    /// Name a property of the aircraft (may be repeated): KEY is aileron_command, elevator_command,
    /// throttle_command, rudder_command, or the same with _position. NAME may be several, with signs and scales:
    /// -NAME*SCALE,NAME.
    #[arg(long, value_name = "KEY=NAME", value_parser = property)]
    property: Vec<(String, String)>,
    /// Hold a property of the aircraft at a value (may be repeated), for example flaps:
    /// fcs/flap-cmd-norm=0.5.
    #[arg(long, value_name = "NAME=VALUE", value_parser = held)]
    set: Vec<(String, f64)>,
    /// Hide an effect in the aircraft (may be repeated); a wrong ID is answered with all that are known.
    #[arg(long, value_name = "ID=AMPLITUDE", allow_hyphen_values = true)]
    hide: Vec<Hidden>,
}

/// Options for wind, turbulence and gusts.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Air")]
struct AirArgs {
    /// Steady wind, the velocity of the air over the ground.
    #[arg(long, value_name = "N,E,D", default_value = "0,0,0", allow_hyphen_values = true)]
    wind_ned_mps: Numbers<3>,
    /// MIL-spec turbulence: 3 light, 4 moderate, 6 severe.
    #[arg(long, value_name = "1..7")]
    turbulence_severity: Option<u8>,
    /// Wind 20 ft above ground, which determines the turbulence near the ground; above 600 m the severity does.
    #[arg(
        long,
        value_name = "MPS",
        default_value_t = 15.0,
        requires = "turbulence_severity",
        allow_negative_numbers = true
    )]
    turbulence_wind_20ft_mps: f64,
    /// A one-minus-cosine gust (may be repeated): start s, velocity NED m/s, rise, hold, fall s.
    #[arg(long, value_name = "S,N,E,D,RISE,HOLD,FALL", allow_hyphen_values = true)]
    gust: Vec<Numbers<7>>,
}

/// Parses `KEY=NAME`; KEY is one of [`Properties::KEYS`], and NAME is not empty.
pub fn property(text: &str) -> Result<(String, String), String> {
    let (key, name) = text.split_once('=').ok_or("write it as KEY=NAME")?;
    match Properties::default().name_mut(key) {
        Some(_) if name.trim().is_empty() => {
            Err(format!("{key} has no name; write it as KEY=NAME"))
        }
        Some(_) => Ok((key.to_owned(), name.to_owned())),
        None => Err(format!("{key} is no key; the keys are {}", Properties::KEYS.join(", "))),
    }
}

/// Parses `NAME=VALUE` with a finite value.
pub fn held(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("write it as NAME=VALUE")?;
    match value.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok((name.trim().to_owned(), number)),
        _ => Err(format!("{value} is not a finite number")),
    }
}

/// Numbers separated by commas.
#[derive(Clone, Copy, Debug)]
pub struct Numbers<const N: usize>(pub [f64; N]);

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse()).collect();
        let parts = parts.map_err(|_| "it holds something that is not a number".to_owned())?;
        let count = parts.len();
        parts.try_into().map(Numbers).map_err(|_| format!("{N} numbers are needed, {count} given"))
    }
}

impl PlantArgs {
    /// Options of the plant with the turbulence seed `seed`.
    pub fn options(&self, seed: u32) -> PlantOptions {
        let mut plant = PlantOptions { seed, air: self.air.air(), ..Default::default() };
        plant.aircraft_dir = self.aircraft.aircraft_dir.clone();
        if let Some(name) = &self.aircraft.aircraft {
            plant.aircraft = name.clone();
        }
        for (key, name) in &self.aircraft.property {
            if let Some(property) = plant.properties.name_mut(key) {
                property.clone_from(name);
            }
        }
        plant.held.clone_from(&self.aircraft.set);
        plant.hidden = self.aircraft.hide.clone();
        plant
    }
}

impl AirArgs {
    fn air(&self) -> Air {
        let gust = |&Numbers([start_s, n, e, d, rise_s, hold_s, fall_s]): &Numbers<7>| Gust {
            start_s,
            velocity_ned_mps: [n, e, d],
            rise_s,
            hold_s,
            fall_s,
        };
        Air {
            wind_ned_mps: self.wind_ned_mps.0,
            turbulence: self.turbulence_severity.map(|severity| Turbulence {
                wind_20ft_mps: self.turbulence_wind_20ft_mps,
                severity,
            }),
            gusts: self.gust.iter().map(gust).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An empty name would be found everywhere in the aircraft's XML, and its replacement would never end.
    #[test]
    fn a_property_without_a_name_is_refused() {
        assert!(property("aileron_position=").unwrap_err().contains("has no name"));
        assert!(property("aileron_position= ").is_err());
        assert!(property("aileron_position=fcs/a").is_ok() && property("flap=fcs/a").is_err());
    }
}
