//! The plant: one aircraft flown by JSBSim in this process, 100 steps a second of its own time.

mod nodes;

use std::path::PathBuf;

use jsbsim::Fdm;

pub use crate::aircraft::AircraftError;
use crate::aircraft;
use crate::air::{Air, AirError};
use crate::hidden::Hidden;
use nodes::Nodes;

/// Length of one step, s.
pub const DT_S: f64 = 0.01;

/// Which aircraft to fly, in what air, with what hidden in it.
#[derive(Clone, Debug)]
pub struct PlantOptions {
    /// Folder that holds `NAME/NAME.xml`; `None` is the X8 built into the program.
    pub aircraft_dir: Option<PathBuf>,
    /// The aircraft's name.
    pub aircraft: String,
    /// The properties through which the aircraft is flown.
    pub properties: Properties,
    /// Wind, turbulence, gusts.
    pub air: Air,
    /// Effects hidden in the aircraft; empty flies the aircraft's file as it is.
    pub hidden: Vec<Hidden>,
    /// Seed of the turbulence: the same seed gives the same flight.
    pub seed: u32,
    /// Geodetic latitude of the start, deg. The default, 46.8, is where JSBSim's gravity less the
    /// earth's centrifugal acceleration is 9.806 m/s² at 600 m.
    pub latitude_deg: f64,
    /// Longitude of the start, deg.
    pub longitude_deg: f64,
}

impl Default for PlantOptions {
    fn default() -> Self {
        PlantOptions {
            aircraft_dir: None,
            aircraft: aircraft::BUILT_IN_NAME.to_owned(),
            properties: Properties::default(),
            air: Air::default(),
            hidden: Vec::new(),
            seed: 1,
            latitude_deg: 46.8,
            longitude_deg: 0.0,
        }
    }
}

/// Names of the JSBSim properties through which an aircraft is flown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Properties {
    /// Aileron command, −1..1.
    pub aileron_command: String,
    /// Elevator command, −1..1.
    pub elevator_command: String,
    /// Throttle command, 0..1.
    pub throttle_command: String,
    /// Aileron position, rad.
    pub aileron_position: String,
    /// Elevator position, rad.
    pub elevator_position: String,
    /// Throttle position, 0..1.
    pub throttle_position: String,
}

impl Default for Properties {
    fn default() -> Self {
        Properties {
            aileron_command: "fcs/aileron-cmd-norm".into(),
            elevator_command: "fcs/elevator-cmd-norm".into(),
            throttle_command: "fcs/throttle-cmd-norm".into(),
            aileron_position: "fcs/effective-aileron-pos".into(),
            elevator_position: "fcs/elevator-pos-rad".into(),
            throttle_position: "fcs/throttle-pos-norm".into(),
        }
    }
}

/// The state at which an episode starts; velocities are relative to the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Start {
    /// Roll angle φ, rad.
    pub roll_rad: f64,
    /// Pitch angle θ, rad.
    pub pitch_rad: f64,
    /// Yaw angle ψ from true north, rad.
    pub yaw_rad: f64,
    /// True airspeed, m/s, positive.
    pub airspeed_mps: f64,
    /// Angle of attack, rad.
    pub alpha_rad: f64,
    /// Sideslip angle, rad; the airspeed vector from the right is positive.
    pub beta_rad: f64,
    /// Roll rate, body axes, rad/s.
    pub p_radps: f64,
    /// Pitch rate, body axes, rad/s.
    pub q_radps: f64,
    /// Yaw rate, body axes, rad/s.
    pub r_radps: f64,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
}

impl Start {
    /// The start of an episode: wings level, no incidence, 16.67 m/s, 600 m, not trimmed
    /// (section V-A of \[GSFM26\]).
    pub const NEUTRAL: Start = Start {
        roll_rad: 0.0,
        pitch_rad: 0.0,
        yaw_rad: 0.0,
        airspeed_mps: 16.67,
        alpha_rad: 0.0,
        beta_rad: 0.0,
        p_radps: 0.0,
        q_radps: 0.0,
        r_radps: 0.0,
        altitude_m: 600.0,
    };

    fn is_flyable(&self) -> bool {
        let Start { roll_rad, pitch_rad, yaw_rad, alpha_rad, beta_rad, p_radps, q_radps, .. } = *self;
        [roll_rad, pitch_rad, yaw_rad, alpha_rad, beta_rad, p_radps, q_radps, self.r_radps]
            .iter()
            .all(|x| x.is_finite() && x.abs() < 100.0)
            && (0.1..=1000.0).contains(&self.airspeed_mps)
            && (-400.0..=80_000.0).contains(&self.altitude_m)
    }
}

impl Default for Start {
    fn default() -> Self {
        Start::NEUTRAL
    }
}

/// Normalised commands for one step.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Inputs {
    /// Aileron, −1..1; positive rolls right.
    pub aileron: f64,
    /// Elevator, −1..1; positive pitches down.
    pub elevator: f64,
    /// Throttle, 0..1.
    pub throttle: f64,
}

impl Inputs {
    /// The inputs limited to their ranges.
    pub fn clamped(self) -> Self {
        Inputs {
            aileron: self.aileron.clamp(-1.0, 1.0),
            elevator: self.elevator.clamp(-1.0, 1.0),
            throttle: self.throttle.clamp(0.0, 1.0),
        }
    }

    fn is_finite(&self) -> bool {
        self.aileron.is_finite() && self.elevator.is_finite() && self.throttle.is_finite()
    }
}

/// Everything the plant shows of itself after a step, without sensor errors.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Truth {
    /// Time since the reset, s.
    pub time_s: f64,
    /// Roll angle φ, rad.
    pub roll_rad: f64,
    /// Pitch angle θ, rad.
    pub pitch_rad: f64,
    /// Yaw angle ψ from true north, rad.
    pub yaw_rad: f64,
    /// Roll rate over the ground, body axes, rad/s.
    pub p_radps: f64,
    /// Pitch rate over the ground, body axes, rad/s.
    pub q_radps: f64,
    /// Yaw rate over the ground, body axes, rad/s.
    pub r_radps: f64,
    /// True airspeed, relative to the air with its turbulence, m/s.
    pub airspeed_mps: f64,
    /// Angle of attack relative to the air, rad.
    pub alpha_rad: f64,
    /// Sideslip angle relative to the air, rad.
    pub beta_rad: f64,
    /// Specific force at the centre of gravity, forward-right-down, m/s²; −9.81 on z in level flight.
    pub specific_force_mps2: [f64; 3],
    /// Velocity over the ground, north-east-down, m/s.
    pub velocity_ned_mps: [f64; 3],
    /// Velocity of the air over the ground with gusts and turbulence, north-east-down, m/s.
    pub wind_ned_mps: [f64; 3],
    /// Geodetic latitude, deg.
    pub latitude_deg: f64,
    /// Longitude, deg.
    pub longitude_deg: f64,
    /// Altitude above mean sea level, m.
    pub altitude_m: f64,
    /// Air density, kg/m³.
    pub air_density_kgpm3: f64,
    /// Static pressure, Pa.
    pub static_pressure_pa: f64,
    /// Aileron deflection, rad.
    pub aileron_rad: f64,
    /// Aileron rate, rad/s: the deflection's change over the last step by the step.
    pub aileron_rate_radps: f64,
    /// Elevator deflection, rad.
    pub elevator_rad: f64,
    /// Elevator rate, rad/s: the deflection's change over the last step by the step.
    pub elevator_rate_radps: f64,
    /// Throttle position, 0..1.
    pub throttle: f64,
    /// Thrust along the body x axis, N, hidden effects on it included.
    pub thrust_n: f64,
}

/// Why the plant cannot fly on.
#[derive(Debug, thiserror::Error)]
pub enum PlantError {
    /// The aircraft could not be loaded.
    #[error(transparent)]
    Aircraft(#[from] AircraftError),
    /// The air is not one that JSBSim can blow.
    #[error(transparent)]
    Air(#[from] AirError),
    /// The aircraft has no property of that name.
    #[error("the aircraft '{aircraft}' has no property '{property}', which the plant needs; add it to the aircraft's XML or name another")]
    Property {
        /// The aircraft's name.
        aircraft: String,
        /// The property's name.
        property: String,
    },
    /// The start of an episode is not one that can be flown from.
    #[error("cannot start at {0:?}: give finite angles and rates, an airspeed from 0.1 to 1000 m/s and an altitude from -400 to 80000 m")]
    Start(Start),
    /// A command is not a number; nothing was stepped.
    #[error("command {0:?} is not finite: nothing was stepped; send finite commands")]
    Inputs(Inputs),
    /// JSBSim's state is no longer a number.
    #[error("the state became non-finite at {time_s:.2} s ({quantity}): reset the plant or restore a snapshot")]
    NonFinite {
        /// Time of the step, s.
        time_s: f64,
        /// The first quantity that is not finite.
        quantity: &'static str,
    },
    /// JSBSim failed while doing something.
    #[error("JSBSim failed while {doing}: {source}")]
    Jsbsim {
        /// What was being done.
        doing: &'static str,
        /// What JSBSim said.
        source: jsbsim::Error,
    },
}

/// A saved state of a [`Plant`], to be restored onto a plant made from the same options.
#[derive(Clone, Debug)]
pub struct Snapshot {
    fdm: jsbsim::Snapshot,
    truth: Truth,
    steps: u64,
    next_gust: usize,
}

/// One aircraft in the air.
pub struct Plant {
    fdm: Fdm,
    nodes: Nodes,
    options: PlantOptions,
    loaded: jsbsim::Snapshot,
    truth: Truth,
    steps: u64,
    next_gust: usize,
}

impl Plant {
    /// Loads the aircraft and puts it at [`Start::NEUTRAL`].
    ///
    /// # Errors
    /// [`PlantError`] when the aircraft, a property, a hidden effect or the air is wrong.
    pub fn new(options: &PlantOptions) -> Result<Self, PlantError> {
        let mut options = options.clone();
        options.air = options.air.checked()?;
        let mut fdm = Fdm::new().map_err(jsbsim("starting"))?;
        fdm.set_dt(DT_S);
        aircraft::load(&mut fdm, options.aircraft_dir.as_deref(), &options.aircraft, &options.hidden)?;
        let nodes = Nodes::find(&fdm, &options)?;
        let mut loaded = jsbsim::Snapshot::new();
        fdm.snapshot_into(&mut loaded).map_err(jsbsim("saving the loaded aircraft"))?;
        let (truth, steps, next_gust) = (Truth::default(), 0, 0);
        let mut plant = Plant { fdm, nodes, options, loaded, truth, steps, next_gust };
        plant.reset(&Start::NEUTRAL)?;
        Ok(plant)
    }

    /// Puts the aircraft at `start` with centred surfaces and no throttle, and time at zero.
    ///
    /// # Errors
    /// [`PlantError::Start`] for a start that cannot be flown from, [`PlantError::Jsbsim`] and
    /// [`PlantError::NonFinite`] when the aircraft cannot be evaluated there.
    pub fn reset(&mut self, start: &Start) -> Result<Truth, PlantError> {
        if !start.is_flyable() {
            return Err(PlantError::Start(*start));
        }
        self.fdm.restore(&self.loaded).map_err(jsbsim("going back to the loaded aircraft"))?;
        self.nodes.start(&mut self.fdm, start, &self.options).map_err(jsbsim("setting the start"))?;
        (self.steps, self.next_gust) = (0, 0);
        let truth = self.nodes.truth(&mut self.fdm).map_err(jsbsim("reading the start"))?;
        self.accept(truth)
    }

    /// Flies one step of [`DT_S`] with `inputs`, limited to their ranges.
    ///
    /// # Errors
    /// [`PlantError::Inputs`] when a command is not finite: nothing is stepped.
    /// [`PlantError::NonFinite`] when the state is no longer a number.
    pub fn step(&mut self, inputs: Inputs) -> Result<Truth, PlantError> {
        if !inputs.is_finite() {
            return Err(PlantError::Inputs(inputs));
        }
        let inputs = inputs.clamped();
        self.nodes.command(&mut self.fdm, &inputs).map_err(jsbsim("writing the commands"))?;
        self.blow_due_gust().map_err(jsbsim("starting a gust"))?;
        self.fdm.run().map_err(jsbsim("stepping"))?;
        self.steps += 1;
        let mut truth = self.nodes.truth(&mut self.fdm).map_err(jsbsim("reading the state"))?;
        truth.time_s = self.steps as f64 * DT_S;
        truth.aileron_rate_radps = (truth.aileron_rad - self.truth.aileron_rad) / DT_S;
        truth.elevator_rate_radps = (truth.elevator_rad - self.truth.elevator_rad) / DT_S;
        self.accept(truth)
    }

    /// The state after the last step or reset.
    pub fn truth(&self) -> Truth {
        self.truth
    }

    /// The whole state, for [`Plant::restore`].
    ///
    /// # Errors
    /// [`PlantError::Jsbsim`] when JSBSim cannot save its state.
    pub fn snapshot(&mut self) -> Result<Snapshot, PlantError> {
        let mut fdm = jsbsim::Snapshot::new();
        self.fdm.snapshot_into(&mut fdm).map_err(jsbsim("saving a snapshot"))?;
        Ok(Snapshot { fdm, truth: self.truth, steps: self.steps, next_gust: self.next_gust })
    }

    /// Goes back to `snapshot`: what follows repeats to the bit.
    ///
    /// # Errors
    /// [`PlantError::Jsbsim`] when the snapshot is of another aircraft.
    pub fn restore(&mut self, snapshot: &Snapshot) -> Result<(), PlantError> {
        self.fdm.restore(&snapshot.fdm).map_err(jsbsim("restoring a snapshot"))?;
        self.truth = snapshot.truth;
        self.steps = snapshot.steps;
        self.next_gust = snapshot.next_gust;
        Ok(())
    }

    /// The seed of the turbulence from the next reset on.
    pub fn reseed(&mut self, seed: u32) {
        self.options.seed = seed;
    }

    /// Reads any property of the aircraft in JSBSim's own unit.
    ///
    /// # Errors
    /// [`PlantError::Property`] when the aircraft has no such property.
    pub fn property(&mut self, name: &str) -> Result<f64, PlantError> {
        let node = self.node(name)?;
        self.fdm.read_node(node).map_err(jsbsim("reading a property"))
    }

    /// Writes any property of the aircraft in JSBSim's own unit; the next reset undoes it.
    ///
    /// # Errors
    /// [`PlantError::Property`] when the aircraft has no such property.
    pub fn set_property(&mut self, name: &str, value: f64) -> Result<(), PlantError> {
        let node = self.node(name)?;
        self.fdm.write_node(node, value).map_err(jsbsim("writing a property"))?;
        Ok(())
    }

    fn node(&self, name: &str) -> Result<jsbsim::NodeId, PlantError> {
        self.fdm.node(name).ok().flatten().ok_or_else(|| PlantError::Property {
            aircraft: self.options.aircraft.clone(),
            property: name.to_owned(),
        })
    }

    fn blow_due_gust(&mut self) -> Result<(), jsbsim::Error> {
        let now = self.steps as f64 * DT_S;
        let Some(gust) = self.options.air.gusts.get(self.next_gust) else { return Ok(()) };
        if now + 0.5 * DT_S < gust.start_s {
            return Ok(());
        }
        self.next_gust += 1;
        self.nodes.gust(&mut self.fdm, gust)
    }

    fn accept(&mut self, truth: Truth) -> Result<Truth, PlantError> {
        self.truth = truth;
        match truth.first_non_finite() {
            None => Ok(truth),
            Some(quantity) => Err(PlantError::NonFinite { time_s: truth.time_s, quantity }),
        }
    }
}

impl Truth {
    fn first_non_finite(&self) -> Option<&'static str> {
        [
            ("attitude", self.roll_rad + self.pitch_rad + self.yaw_rad),
            ("rotation rate", self.p_radps + self.q_radps + self.r_radps),
            ("airspeed", self.airspeed_mps),
            ("flow angle", self.alpha_rad + self.beta_rad),
            ("specific force", self.specific_force_mps2.iter().sum()),
            ("velocity", self.velocity_ned_mps.iter().sum()),
            ("position", self.latitude_deg + self.longitude_deg + self.altitude_m),
            ("air", self.air_density_kgpm3 + self.static_pressure_pa),
            ("actuator", self.aileron_rad + self.elevator_rad + self.throttle),
            ("thrust", self.thrust_n),
        ]
        .into_iter()
        .find_map(|(name, value)| (!value.is_finite()).then_some(name))
    }
}

/// Turns what JSBSim says while `doing` into a [`PlantError`].
fn jsbsim(doing: &'static str) -> impl Fn(jsbsim::Error) -> PlantError {
    move |source| PlantError::Jsbsim { doing, source }
}
