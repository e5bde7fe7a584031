//! The plant: one aircraft that JSBSim simulates in this process, step by step in simulated time.

pub mod discovery;
mod linked;
mod loads;
mod lookup;
mod mixing;
mod nodes;
mod options;
mod settling;
mod spin_up;
mod state;
mod steering;
mod travel;

use jsbsim::Fdm;

use crate::air::AirError;
use crate::aircraft;
pub use crate::aircraft::AircraftError;
pub use loads::{Loads, MassProperties};
pub use mixing::{Mixing, Moved};
use nodes::Nodes;
pub(crate) use nodes::to_body;
pub use options::{PlantOptions, Properties};
pub use state::{FULL_DEFLECTION_RAD, Inputs, Start, Truth};
pub use travel::{Stops, Travel};

/// Default length of one step, s.
pub const DT_S: f64 = 0.01;

/// Range of step lengths, s, in which the integrators and filters are known to be stable.
const STEPS_S: std::ops::RangeInclusive<f64> = 0.001..=DT_S;

/// Why the plant cannot be loaded, started or stepped.
#[derive(Debug, thiserror::Error)]
pub enum PlantError {
    /// The aircraft could not be loaded.
    #[error(transparent)]
    Aircraft(#[from] AircraftError),
    /// JSBSim cannot simulate this air.
    #[error(transparent)]
    Air(#[from] AirError),
    /// The aircraft has no property of that name.
    #[error(
        "the aircraft '{aircraft}' has no property '{property}', which the plant needs; add it to the aircraft's XML or name the aircraft's own with --property"
    )]
    Property {
        /// Name of the aircraft.
        aircraft: String,
        /// Name of the missing property.
        property: String,
    },
    /// An engine does not run after its start.
    #[error(
        "engine {engine} of the aircraft '{aircraft}' does not run after its start: see that the aircraft's XML fills its tanks, feeds it from them and leaves its ignition on"
    )]
    Engine {
        /// Name of the aircraft.
        aircraft: String,
        /// Index of the engine, from 0.
        engine: usize,
    },
    /// A surface does not follow its command, so its travel is unknown.
    #[error(
        "the aircraft '{aircraft}' does not move '{property}' at full command, so the travel of that surface is unknown; name the property that holds its deflection in rad with --property"
    )]
    Travel {
        /// Name of the aircraft.
        aircraft: String,
        /// The property that does not move.
        property: String,
    },
    /// No command moves the aircraft about an axis.
    #[error(
        "no command of the aircraft '{aircraft}' {does} it: {tried}; either ailerons and an elevator do not steer it, or its own names must be \
         given with --property (as KEY=NAME, KEY=-NAME*SCALE or KEY=NAME,-NAME)"
    )]
    Unmoved {
        /// Name of the aircraft.
        aircraft: String,
        /// Motion that no command causes, such as rolling.
        does: &'static str,
        /// Properties that were tried.
        tried: String,
    },
    /// A file of the aircraft reads a property that nothing defines.
    #[error(
        "the aircraft '{aircraft}' reads {property} ({place}), which no file of it defines; the program that it was written for does: \
         give its value with --set {property}=0"
    )]
    Undefined {
        /// Name of the aircraft.
        aircraft: String,
        /// Property that is not defined.
        property: String,
        /// JSBSim's description of where the property is read.
        place: String,
    },
    /// The aircraft cannot fly from this start.
    #[error(
        "cannot start at {0:?}: give finite angles and rates, an airspeed from 0.1 to 1000 m/s and an altitude from -400 to 80000 m"
    )]
    Start(Start),
    /// The step is too long or too short.
    #[error("cannot fly in steps of {step_s} s: give 0.001 to 0.01 s")]
    Step {
        /// The step as given, s.
        step_s: f64,
    },
    /// A command is not finite; the plant did not step.
    #[error("command {0:?} is not finite: nothing was stepped; send finite commands")]
    Inputs(Inputs),
    /// A quantity of JSBSim's state is no longer finite.
    #[error(
        "the state became non-finite at {time_s:.2} s ({quantity}): reset the plant or restore a snapshot"
    )]
    NonFinite {
        /// Time of the step, s.
        time_s: f64,
        /// The first quantity that is not finite.
        quantity: &'static str,
    },
    /// A call to JSBSim failed.
    #[error("JSBSim failed while {doing}: {source}")]
    Jsbsim {
        /// Operation that failed.
        doing: &'static str,
        /// Error that JSBSim returned.
        source: jsbsim::Error,
    },
}

/// A saved state of a [`Plant`]; a plant with the same options can restore it.
#[derive(Clone, Debug)]
pub struct Snapshot {
    fdm: jsbsim::Snapshot,
    truth: Truth,
    steps: u64,
    next_gust: usize,
}

/// One aircraft that JSBSim simulates step by step.
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
    /// [`PlantError`] if the step is too short or too long, the aircraft cannot be loaded or started, a property is missing, or a
    /// hidden effect or the air is invalid.
    pub fn new(options: &PlantOptions) -> Result<Self, PlantError> {
        let mut options = options.clone();
        options.air = options.air.checked()?;
        if !(STEPS_S.contains(&options.step_s)) {
            return Err(PlantError::Step { step_s: options.step_s });
        }
        let mut fdm = Fdm::new().map_err(jsbsim("starting"))?;
        fdm.set_dt(options.step_s);
        let PlantOptions { aircraft_dir, aircraft, properties, hidden, held, .. } = &options;
        aircraft::load(&mut fdm, aircraft_dir.as_deref(), aircraft, properties, hidden, held)?;
        let nodes = Nodes::find(&fdm, &options)?;
        let mut loaded = jsbsim::Snapshot::new();
        fdm.snapshot_into(&mut loaded).map_err(jsbsim("saving the loaded aircraft"))?;
        let (truth, steps, next_gust) = (Truth::default(), 0, 0);
        let mut plant = Plant { fdm, nodes, options, loaded, truth, steps, next_gust };
        plant.reset(&Start::NEUTRAL)?;
        Ok(plant)
    }

    /// Puts the aircraft at `start` with centred surfaces and closed throttle, and sets its time to zero.
    ///
    /// # Errors
    /// [`PlantError::Start`] if `start` is outside the accepted range. `PlantError::Engine` if an engine does not run, and
    /// `PlantError::Undefined` if the aircraft reads an undefined property. [`PlantError::Jsbsim`] and [`PlantError::NonFinite`]
    /// if the aircraft cannot be evaluated at `start`.
    pub fn reset(&mut self, start: &Start) -> Result<Truth, PlantError> {
        if !start.is_flyable() {
            return Err(PlantError::Start(*start));
        }
        self.fdm.restore(&self.loaded).map_err(jsbsim("going back to the loaded aircraft"))?;
        self.nodes
            .start(&mut self.fdm, start, &self.options)
            .map_err(starting(&self.options.aircraft))?;
        self.start_engines()?;
        (self.steps, self.next_gust) = (0, 0);
        let truth = self.nodes.truth(&mut self.fdm).map_err(jsbsim("reading the start"))?;
        self.accept(truth)
    }

    fn start_engines(&mut self) -> Result<(), PlantError> {
        let started = self.nodes.start_engines(&mut self.fdm, self.options.step_s);
        match started.map_err(jsbsim("starting the engines"))? {
            None => self.spin_up(),
            Some(engine) => {
                Err(PlantError::Engine { aircraft: self.options.aircraft.clone(), engine })
            }
        }
    }

    /// Notes for the user about the aircraft, one sentence each; empty unless the aircraft is a glider.
    pub fn notes(&self) -> Vec<String> {
        let glider = format!(
            "the aircraft '{}' has no throttle: it flies as a glider, and throttle commands move nothing",
            self.options.aircraft
        );
        self.nodes.is_glider().then_some(glider).into_iter().collect()
    }

    /// Simulates one step of [`PlantOptions::step_s`] with `inputs`, limited to their ranges.
    ///
    /// # Errors
    /// [`PlantError::Inputs`] if a command is not finite; the plant then makes no step. [`PlantError::NonFinite`] if the state is
    /// no longer finite. [`PlantError::Jsbsim`] if JSBSim fails.
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
        let step_s = self.options.step_s;
        truth.time_s = self.steps as f64 * step_s;
        truth.aileron_rate_radps = (truth.aileron_rad - self.truth.aileron_rad) / step_s;
        truth.elevator_rate_radps = (truth.elevator_rad - self.truth.elevator_rad) / step_s;
        truth.rudder_rate_radps = (truth.rudder_rad - self.truth.rudder_rad) / step_s;
        self.accept(truth)
    }

    /// The state after the last step or reset.
    pub fn truth(&self) -> Truth {
        self.truth
    }

    /// Saves the whole state for [`Plant::restore`].
    ///
    /// # Errors
    /// [`PlantError::Jsbsim`] when JSBSim cannot save its state.
    pub fn snapshot(&mut self) -> Result<Snapshot, PlantError> {
        let mut fdm = jsbsim::Snapshot::new();
        self.fdm.snapshot_into(&mut fdm).map_err(jsbsim("saving a snapshot"))?;
        Ok(Snapshot { fdm, truth: self.truth, steps: self.steps, next_gust: self.next_gust })
    }

    /// Restores `snapshot`. The same inputs then repeat the same flight to the bit.
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

    /// Sets the seed of the turbulence, in force from the next reset.
    pub fn reseed(&mut self, seed: u32) {
        self.options.seed = seed;
    }

    /// Reads any property of the aircraft, in the unit in which JSBSim holds it.
    ///
    /// # Errors
    /// [`PlantError::Property`] when the aircraft has no such property.
    pub fn property(&mut self, name: &str) -> Result<f64, PlantError> {
        let node = self.node(name)?;
        self.fdm.read_node(node).map_err(jsbsim("reading a property"))
    }

    /// Writes any property of the aircraft, in the unit in which JSBSim holds it; the next reset restores the old value.
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
        let step_s = self.options.step_s;
        let now = self.steps as f64 * step_s;
        let Some(gust) = self.options.air.gusts.get(self.next_gust) else {
            return Ok(());
        };
        if now + 0.5 * step_s < gust.start_s {
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

/// Maps an error that JSBSim returned while `doing` to [`PlantError::Jsbsim`].
fn jsbsim(doing: &'static str) -> impl Fn(jsbsim::Error) -> PlantError {
    move |source| PlantError::Jsbsim { doing, source }
}

/// Maps an error of JSBSim's start to [`PlantError::Undefined`] if it names a missing property, otherwise to
/// [`PlantError::Jsbsim`].
fn starting(aircraft: &str) -> impl Fn(jsbsim::Error) -> PlantError {
    let aircraft = aircraft.to_owned();
    move |source| {
        let said = source.to_string();
        let place = said.split(": Property ").next().unwrap_or_default().to_owned();
        let missing =
            said.split("Property ").nth(1).and_then(|rest| rest.split_once(" does not exist"));
        match missing {
            Some((property, _)) => PlantError::Undefined {
                aircraft: aircraft.clone(),
                property: property.trim().to_owned(),
                place,
            },
            None => PlantError::Jsbsim { doing: "setting the start", source },
        }
    }
}
