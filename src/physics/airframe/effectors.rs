//! The effectors (surfaces and motors) of an airframe file, and the mixer that drives them. A mixer computes the command of
//! each effector from the commands of aileron, elevator, rudder and throttle.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::Sourced;
use super::controls::travel;
use crate::mixer::{Does, Effector, Mixer};
use crate::servos::{Travel, Travels};

/// Largest channel number of a flight controller's servo outputs.
const CHANNELS: u8 = 32;
/// Largest accepted |gain| from one of the four commands to an effector.
const GAIN: f64 = 2.0;

/// Section `[surfaces.NAME]` of an airframe file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SurfaceFile {
    travel_rad: Option<Sourced>,
    travel_min_rad: Option<Sourced>,
    travel_max_rad: Option<Sourced>,
    #[serde(default)]
    aileron: f64,
    #[serde(default)]
    elevator: f64,
    #[serde(default)]
    rudder: f64,
    channel: Option<u8>,
    command: Option<String>,
    position: Option<String>,
}

/// Section `[motors.NAME]` of an airframe file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotorFile {
    throttle: f64,
    #[serde(default)]
    rudder: f64,
    channel: Option<u8>,
    command: Option<String>,
    position: Option<String>,
}

/// The mixer of an airframe file. `None` if the file names neither surfaces nor motors.
///
/// If the file names only surfaces, one motor driven by the throttle is added. If the file names only motors, an aileron,
/// an elevator and, if `travels` has one, a rudder are added.
pub(super) fn mixer(
    surfaces: &BTreeMap<String, SurfaceFile>,
    motors: &BTreeMap<String, MotorFile>,
    travels: &Travels,
) -> Result<Option<Mixer>, String> {
    if surfaces.is_empty() && motors.is_empty() {
        return Ok(None);
    }
    let mut all = Vec::new();
    for (name, file) in surfaces {
        all.push(file.effector(name)?);
    }
    if surfaces.is_empty() {
        all.extend(plain_surfaces(travels));
    }
    for (name, file) in motors {
        if surfaces.contains_key(name) {
            return Err(format!("{name} is a surface and a motor: rename one"));
        }
        all.push(file.effector(name)?);
    }
    if motors.is_empty() {
        all.push(plain("throttle", Does::Pulls, [0.0, 0.0, 0.0, 1.0]));
    }
    check_channels(&all)?;
    let mixer = Mixer::new(all, travels.rudder.is_some()).map_err(|e| e.to_string())?;
    mixer.checked(travels).map(Some).map_err(|e| e.to_string())
}

fn plain(name: &str, does: Does, gains: [f64; 4]) -> Effector {
    Effector { name: name.into(), does, gains, channel: None, command: None, position: None }
}

fn plain_surfaces(travels: &Travels) -> impl Iterator<Item = Effector> {
    let surface = |(name, travel, j): (&str, Option<Travel>, usize)| {
        let gains = std::array::from_fn(|k| if k == j { 1.0 } else { 0.0 });
        travel.map(|travel| plain(name, Does::Deflects(travel), gains))
    };
    let Travels { aileron, elevator, rudder } = *travels;
    [("aileron", Some(aileron), 0), ("elevator", Some(elevator), 1), ("rudder", rudder, 2)]
        .into_iter()
        .filter_map(surface)
}

fn check_channels(all: &[Effector]) -> Result<(), String> {
    for (k, effector) in all.iter().enumerate() {
        let Some(channel) = effector.channel else { continue };
        if !(1..=CHANNELS).contains(&channel) {
            return Err(format!("{}: channel = {channel} must be 1 to {CHANNELS}", effector.name));
        }
        if let Some(other) = all[..k].iter().find(|o| o.channel == Some(channel)) {
            let [a, b] = [&other.name, &effector.name];
            return Err(format!("{a} and {b} have the channel {channel}: give one another"));
        }
    }
    Ok(())
}

fn gain(of: &str, key: &str, value: f64) -> Result<f64, String> {
    match value.is_finite() && value.abs() <= GAIN {
        true => Ok(value),
        false => Err(format!("{of}.{key} = {value} must lie between -{GAIN} and {GAIN}")),
    }
}

impl SurfaceFile {
    fn effector(&self, name: &str) -> Result<Effector, String> {
        let of = format!("surfaces.{name}");
        let travel = travel(&of, [&self.travel_rad, &self.travel_min_rad, &self.travel_max_rad])?;
        Ok(Effector {
            name: name.into(),
            does: Does::Deflects(travel),
            gains: [
                gain(&of, "aileron", self.aileron)?,
                gain(&of, "elevator", self.elevator)?,
                gain(&of, "rudder", self.rudder)?,
                0.0,
            ],
            channel: self.channel,
            command: self.command.clone(),
            position: self.position.clone(),
        })
    }
}

impl MotorFile {
    fn effector(&self, name: &str) -> Result<Effector, String> {
        let of = format!("motors.{name}");
        let (throttle, rudder) =
            (gain(&of, "throttle", self.throttle)?, gain(&of, "rudder", self.rudder)?);
        Ok(Effector {
            name: name.into(),
            does: Does::Pulls,
            gains: [0.0, 0.0, rudder, throttle],
            channel: self.channel,
            command: self.command.clone(),
            position: self.position.clone(),
        })
    }
}
