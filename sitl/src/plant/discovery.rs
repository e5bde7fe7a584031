//! Finds which property of an aircraft commands which surface by trying all candidates.
//!
//! Candidates are the properties that the aircraft's systems read and do not write. The aircraft is held in its state while a
//! candidate is set to full command, until lags, delays and hysteresis have settled. Both signs are tried if both give finite
//! values (a negative flap command may give NaN).
//!
//! The aileron is the command, or the pair of a left and a right command, that rolls the aircraft most with the least pitching
//! and yawing moment. Usual names score higher. Elevator and rudder are selected by pitching and yawing moment in the same way.
//! The position of a surface is a property that the aerodynamics read and that the command moves.

mod document;
mod roles;

use std::path::Path;

use jsbsim::{Fdm, NodeId, Snapshot};

use super::lookup::look;
use super::settling::STILL_S;
use super::{PlantError, PlantOptions, Properties, jsbsim};
use crate::aircraft;
use document::Names;
use roles::{Tried, choose};

/// Longest time for surfaces to come to rest after a command, in frames: 20 s in frames of 10 ms.
const FRAMES: usize = 2000;
/// Frames without movement after which the surfaces count as at rest; no actuator delay may be longer.
const AT_REST: usize = 60;
/// Movement per frame below which a surface counts as at rest, as a fraction of the largest movement so far, or of 1 if
/// that is larger.
const STILL: f64 = 1e-9;
/// Airspeed at which commands are tried, ft/s. Its only purpose is a nonzero dynamic pressure.
const AIRSPEED_FPS: f64 = 150.0;
/// Aerodynamic moments, body axes, lbf ft.
const MOMENTS: [&str; 3] = ["moments/l-aero-lbsft", "moments/m-aero-lbsft", "moments/n-aero-lbsft"];
/// Properties of the reference lengths, ft, by which moments are divided to make them comparable.
const LENGTHS: [&str; 3] = ["metrics/bw-ft", "metrics/cbarw-ft", "metrics/bw-ft"];

/// Result of the discovery of an aircraft's properties.
#[derive(Clone, Debug)]
pub struct Found {
    /// The properties through which the aircraft flies.
    pub properties: Properties,
    /// Assumptions made, one sentence each.
    pub notes: Vec<String>,
}

impl Found {
    /// The properties that differ from the defaults, written as arguments of `--property`.
    pub fn arguments(&self) -> Vec<String> {
        let (mut own, mut usual) = (self.properties.clone(), Properties::default());
        let named = |key: &&str| {
            let name = own.name_mut(key).map(|n| n.clone())?;
            let differs = usual.name_mut(key).is_some_and(|n| *n != name);
            differs.then(|| format!("--property '{key}={name}'"))
        };
        Properties::KEYS.iter().filter_map(named).collect()
    }
}

/// Finds the commands and surfaces of the aircraft of `options`.
///
/// # Errors
/// If the aircraft cannot be loaded or simulated, or no command rolls or pitches it; the error then names that axis.
pub fn discover(options: &PlantOptions) -> Result<Found, PlantError> {
    let names =
        Names::read(options.aircraft_dir.as_deref().unwrap_or(Path::new("")), &options.aircraft);
    let mut bench = Bench::new(options, &names)?;
    let mut tried = Vec::new();
    for command in &names.commands {
        if let Some(found) = bench.attempt(command)? {
            tried.push(found);
        }
    }
    let throttle = bench.throttle(&names)?;
    choose(&tried, &names, &options.aircraft).map(|mut found| {
        if let Some(command) = throttle {
            found.properties.throttle_command = command;
        }
        found
    })
}

/// A loaded aircraft that is held in a constant state in the air.
struct Bench {
    fdm: Fdm,
    start: Snapshot,
    /// Properties that the aerodynamics read, which may be positions.
    positions: Vec<(String, NodeId)>,
    lengths: [f64; 3],
}

/// Aerodynamic moments divided by their reference lengths, lbf, and positions in JSBSim's units.
#[derive(Clone)]
struct Seen {
    moments: [f64; 3],
    positions: Vec<f64>,
}

impl Bench {
    fn new(options: &PlantOptions, names: &Names) -> Result<Bench, PlantError> {
        let mut fdm = Fdm::new().map_err(jsbsim("starting"))?;
        fdm.set_dt(options.step_s);
        let PlantOptions { aircraft_dir, aircraft, properties, held, .. } = options;
        aircraft::load(&mut fdm, aircraft_dir.as_deref(), aircraft, properties, &[], held)?;
        let go = |fdm: &mut Fdm| -> Result<[f64; 3], jsbsim::Error> {
            for (name, value) in [("h-sl-ft", 2000.0), ("u-fps", AIRSPEED_FPS)] {
                fdm.set_property(&format!("ic/{name}"), value)?;
            }
            fdm.run_ic()?;
            fdm.set_dt(STILL_S);
            for (name, value) in held {
                fdm.set_property(name, *value)?;
            }
            let mut lengths = [1.0; 3];
            for (length, name) in lengths.iter_mut().zip(LENGTHS) {
                *length = fdm.get_property(name)?.max(1e-6);
            }
            Ok(lengths)
        };
        let lengths = go(&mut fdm).map_err(super::starting(aircraft))?;
        let positions =
            names.read.iter().filter_map(|n| Some((n.clone(), look(&fdm, n)?))).collect();
        let mut start = Snapshot::new();
        fdm.snapshot_into(&mut start).map_err(jsbsim("saving the loaded aircraft"))?;
        Ok(Bench { fdm, start, positions, lengths })
    }

    fn see(&mut self) -> Result<Seen, jsbsim::Error> {
        let mut moments = [0.0; 3];
        for ((moment, name), length) in moments.iter_mut().zip(MOMENTS).zip(self.lengths) {
            *moment = self.fdm.get_property(name)? / length;
        }
        let mut positions = Vec::with_capacity(self.positions.len());
        for (_, node) in &self.positions {
            positions.push(self.fdm.read_node(*node)?);
        }
        Ok(Seen { moments, positions })
    }

    /// Response after the aircraft has settled at `value` of `command`. `None` if JSBSim fails or a value is not finite.
    fn at(&mut self, command: Option<NodeId>, value: f64) -> Result<Option<Seen>, PlantError> {
        self.fdm.restore(&self.start).map_err(jsbsim("going back to the loaded aircraft"))?;
        self.fdm.set_dt(STILL_S);
        let (mut last, mut at_rest, mut moved) = (None::<Seen>, 0, 0.0_f64);
        for _ in 0..FRAMES {
            let frame = |bench: &mut Bench| -> Result<Seen, jsbsim::Error> {
                if let Some(node) = command {
                    bench.fdm.write_node(node, value)?;
                }
                bench.fdm.run()?;
                bench.see()
            };
            // JSBSim fails on a command outside the domain of the aircraft's functions
            let Ok(seen) = frame(self) else { return Ok(None) };
            if !seen.moments.iter().chain(&seen.positions).all(|x| x.is_finite()) {
                return Ok(None);
            }
            if let Some(last) = &last {
                let pairs = last.positions.iter().zip(&seen.positions);
                let step = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                moved = moved.max(step);
                at_rest = if step <= STILL * moved.max(1.0) { at_rest + 1 } else { 0 };
            }
            last = Some(seen);
            if at_rest >= AT_REST {
                break;
            }
        }
        Ok(last)
    }

    /// Motion caused by full `command`. `None` if the command does not exist, moves nothing or gives values that are not finite.
    fn attempt(&mut self, command: &str) -> Result<Option<Tried>, PlantError> {
        let Some(node) = look(&self.fdm, command) else { return Ok(None) };
        let Some(none) = self.at(Some(node), 0.0)? else { return Ok(None) };
        let Some(full) = self.at(Some(node), 1.0)? else { return Ok(None) };
        let other = self.at(Some(node), -1.0)?;
        let moments = std::array::from_fn(|k| full.moments[k] - none.moments[k]);
        let moved: Vec<(String, [f64; 2])> = (0..self.positions.len())
            .map(|k| {
                let back = other.as_ref().map_or(0.0, |o| o.positions[k] - none.positions[k]);
                (self.positions[k].0.clone(), [back, full.positions[k] - none.positions[k]])
            })
            .filter(|(_, [back, ahead])| back.abs().max(ahead.abs()) > 1e-3)
            .collect();
        if moved.is_empty() && moments.iter().all(|m: &f64| m.abs() < 1e-9) {
            return Ok(None);
        }
        let full_at = self.full_at(node, &none, &full)?;
        Ok(Some(Tried {
            command: command.to_owned(),
            moments,
            moved,
            full_at,
            two_sided: other.is_some(),
        }))
    }

    /// The least command that gives the full deflection: an actuator may reach its stop before the command 1.
    fn full_at(&mut self, node: NodeId, none: &Seen, full: &Seen) -> Result<f64, PlantError> {
        let reach = |seen: &Seen| -> f64 {
            let pairs = seen.positions.iter().zip(&none.positions);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let whole = reach(full);
        let (mut least, mut most) = (0.0, 1.0);
        // bisect only if the command 0.9 already gives the full deflection
        match self.at(Some(node), 0.9)? {
            Some(seen) if reach(&seen) > (1.0 - 1e-6) * whole => {}
            _ => return Ok(1.0),
        }
        for _ in 0..14 {
            let middle = 0.5 * (least + most);
            match self.at(Some(node), middle)? {
                Some(seen) if reach(&seen) > (1.0 - 1e-6) * whole => most = middle,
                _ => least = middle,
            }
        }
        Ok(most)
    }

    /// The command that moves the throttle; `None` if the default command or no command moves it.
    fn throttle(&mut self, names: &Names) -> Result<Option<String>, PlantError> {
        let Some(place) = look(&self.fdm, "fcs/throttle-pos-norm") else { return Ok(None) };
        let usual = super::options::THROTTLE_COMMAND.to_owned();
        for command in std::iter::once(&usual).chain(&names.commands) {
            let Some(node) = look(&self.fdm, command) else { continue };
            if self.at(Some(node), 1.0)?.is_none() {
                continue;
            }
            let open = self.fdm.read_node(place).map_err(jsbsim("reading the throttle"))?;
            if open > 0.5 {
                return Ok((*command != usual).then(|| command.clone()));
            }
        }
        Ok(None)
    }
}

/// Loads the aircraft of `options` with its named or default properties.
///
/// If default properties are missing, move no surface, or deflect a surface to the wrong side, they are replaced by the
/// properties that `discover` finds. The plant is then returned with these. Properties named in `options` are never
/// replaced.
///
/// # Errors
/// If the aircraft cannot be loaded, or no command steers it.
pub fn steered(options: &PlantOptions) -> Result<(super::Plant, Option<Found>), PlantError> {
    let as_it_is = super::Plant::new(options).and_then(|mut plant| {
        let travel = plant.travel()?;
        let turned = |s: &super::Stops| s.least_rad >= 0.0 || s.most_rad <= 0.0;
        let all = [Some(travel.aileron), Some(travel.elevator), travel.rudder];
        Ok((plant, all.iter().flatten().any(turned)))
    });
    let is_own = options.properties != Properties::default() || options.mixing.is_some();
    match as_it_is {
        Ok((plant, turned)) if !turned || is_own => Ok((plant, None)),
        Err(PlantError::Property { .. } | PlantError::Travel { .. }) | Ok(_) if !is_own => {
            let found = discover(options)?;
            let options = PlantOptions { properties: found.properties.clone(), ..options.clone() };
            let mut plant = super::Plant::new(&options)?;
            plant.travel()?;
            Ok((plant, Some(found)))
        }
        Ok((plant, _)) => Ok((plant, None)),
        Err(error) => Err(error),
    }
}
