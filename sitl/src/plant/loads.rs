//! Loads: aerodynamic forces and moments on an aircraft that is held in a state.

use super::settling::STILL_S;
use super::{Inputs, Plant, PlantError, Start, Truth, jsbsim};

/// Newtons per pound of force, and newton metres per foot pound.
const LBF: f64 = 4.448_221_615_260_5;
const FT_LBF: f64 = LBF * 0.3048;

/// Aerodynamic force and moment on an aircraft in a given state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loads {
    /// Aerodynamic force, body axes, N.
    pub force_n: [f64; 3],
    /// Aerodynamic moment about the centre of gravity, body axes, N m.
    pub moment_nm: [f64; 3],
    /// State and deflections at which force and moment act.
    pub truth: Truth,
}

/// Mass properties that JSBSim holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MassProperties {
    /// Mass of aircraft, fuel and payload, kg.
    pub mass_kg: f64,
    /// Jx, Jy, Jz and Jxz, body axes, kg m²; the inertia matrix holds −Jxz.
    pub inertia_kgm2: [f64; 4],
}

/// JSBSim's integrators. With all of them off, the state is constant while engines and filters run.
const INTEGRATORS: [&str; 4] = [
    "simulation/integrator/rate/rotational",
    "simulation/integrator/rate/translational",
    "simulation/integrator/position/rotational",
    "simulation/integrator/position/translational",
];
/// Longest time for engines to settle, s.
const SETTLING_S: f64 = 60.0;
/// Largest change of the thrust within 1 s that counts as settled, as a fraction of the thrust (or of 1 N if that is larger).
const SETTLED: f64 = 1e-4;

impl Plant {
    /// Thrust along body x, N, and the state after the engines have settled at `throttle` (0..1).
    ///
    /// The aircraft is held in `start`. Engines that have not settled after 60 s give their values at that time. Reset the plant
    /// before it is stepped.
    ///
    /// # Errors
    /// [`PlantError`] if `start` is out of range, or the aircraft cannot be simulated there.
    pub fn settled_thrust(
        &mut self,
        start: &Start,
        throttle: f64,
    ) -> Result<(f64, Truth), PlantError> {
        self.held_in(start, |plant| plant.settle_engines(&Inputs { throttle, ..Inputs::default() }))
    }

    /// Response of the engines to a sequence of throttle commands: thrust along body x, N, and throttle position, 0..1.
    ///
    /// The first element is the response after the engines have settled at the first of the `throttles` (0..1). Each further
    /// element is the response after one step at the next of them. The aircraft is held in `start`. Reset the plant before it is
    /// stepped.
    ///
    /// # Errors
    /// [`PlantError`] if `start` is out of range, or the aircraft cannot be simulated there.
    pub fn thrust_response(
        &mut self,
        start: &Start,
        throttles: &[f64],
    ) -> Result<Vec<[f64; 2]>, PlantError> {
        self.held_in(start, |plant| {
            let Some((first, rest)) = throttles.split_first() else { return Ok(Vec::new()) };
            let at_first = Inputs { throttle: *first, ..Inputs::default() };
            let (thrust, truth) = plant.settle_engines(&at_first)?;
            let mass = plant.mass_properties()?.mass_kg;
            let mut response = vec![[thrust, truth.throttle]];
            for throttle in rest {
                plant.step(Inputs { throttle: *throttle, ..Inputs::default() })?;
                response.push([plant.thrust(mass)?, plant.truth.throttle]);
            }
            Ok(response)
        })
    }

    /// Loads and thrust along body x (N) after the engines have settled at `inputs`, with the surfaces at their commands.
    ///
    /// The aircraft is held in `start`. Reset the plant before it is stepped.
    ///
    /// # Errors
    /// [`PlantError`] if `start` is out of range, or the aircraft cannot be simulated there.
    pub fn powered_loads(
        &mut self,
        start: &Start,
        inputs: &Inputs,
    ) -> Result<(Loads, f64), PlantError> {
        self.held_in(start, |plant| {
            let (thrust, _) = plant.settle_engines(inputs)?;
            Ok((plant.loads_now()?, thrust))
        })
    }

    /// Runs `work` while the aircraft is held in `start`, where only its systems and engines run, and returns its
    /// result.
    fn held_in<T>(
        &mut self,
        start: &Start,
        work: impl FnOnce(&mut Plant) -> Result<T, PlantError>,
    ) -> Result<T, PlantError> {
        self.reset(start)?;
        self.held(work)
    }

    /// Runs `work` while the integrators of the state are off, so that only systems and engines run, and returns its
    /// result.
    pub(super) fn held<T>(
        &mut self,
        work: impl FnOnce(&mut Plant) -> Result<T, PlantError>,
    ) -> Result<T, PlantError> {
        let mut schemes = [0.0; 4];
        for (scheme, name) in schemes.iter_mut().zip(INTEGRATORS) {
            *scheme = self.property(name)?;
            self.set_property(name, 0.0)?;
        }
        let found = work(self);
        for (scheme, name) in schemes.into_iter().zip(INTEGRATORS) {
            self.set_property(name, scheme)?;
        }
        found
    }

    /// Length of a step, s.
    pub fn step_s(&self) -> f64 {
        self.options.step_s
    }

    fn steps_of_a_second(&self) -> usize {
        (1.0 / self.options.step_s).round() as usize
    }

    /// Thrust along body x, N, from the specific force of an aircraft of `mass`, kg.
    fn thrust(&mut self, mass: f64) -> Result<f64, PlantError> {
        let aero = self.property("forces/fbx-aero-lbs")? * LBF;
        Ok(mass * self.truth.specific_force_mps2[0] - aero)
    }

    fn settle_engines(&mut self, inputs: &Inputs) -> Result<(f64, Truth), PlantError> {
        let second = self.steps_of_a_second();
        let mass = self.mass_properties()?.mass_kg;
        let (mut last, mut seconds) = (f64::INFINITY, 0.0);
        loop {
            for _ in 0..second {
                self.step(*inputs)?;
            }
            seconds += 1.0;
            let thrust = self.thrust(mass)?;
            // the thrust of a starting engine may remain zero for longer than a second
            let still = (thrust - last).abs() <= SETTLED * thrust.abs().max(1.0);
            if seconds >= SETTLING_S || (still && seconds >= 5.0) {
                return Ok((thrust, self.truth));
            }
            last = thrust;
        }
    }

    /// Loads in `start` with the surfaces at rest at the commands `inputs`. Reset the plant before it is stepped.
    ///
    /// # Errors
    /// [`PlantError`] if `start` is out of range, or the aircraft cannot be simulated there.
    pub fn loads(&mut self, start: &Start, inputs: &Inputs) -> Result<Loads, PlantError> {
        self.reset(start)?;
        // Filters keep the step for which they were discretised; the state does not move in a step this short.
        self.fdm.set_dt(STILL_S);
        let held = self.come_to_rest(inputs, "holding a state");
        let found = held.and_then(|_| self.loads_now());
        self.fdm.set_dt(self.options.step_s);
        found
    }

    fn loads_now(&mut self) -> Result<Loads, PlantError> {
        let three =
            |plant: &mut Plant, names: [&str; 3], unit: f64| -> Result<[f64; 3], PlantError> {
                let [a, b, c] = names.map(|name| plant.property(name));
                Ok([a? * unit, b? * unit, c? * unit])
            };
        let force = ["forces/fbx-aero-lbs", "forces/fby-aero-lbs", "forces/fbz-aero-lbs"];
        let moment = ["moments/l-aero-lbsft", "moments/m-aero-lbsft", "moments/n-aero-lbsft"];
        Ok(Loads {
            force_n: three(self, force, LBF)?,
            moment_nm: three(self, moment, FT_LBF)?,
            truth: self.nodes.truth(&mut self.fdm).map_err(jsbsim("reading the state"))?,
        })
    }

    /// Present mass and inertia, with fuel and payload.
    ///
    /// # Errors
    /// [`PlantError::Property`] if JSBSim lacks a property of the mass or inertia.
    pub fn mass_properties(&mut self) -> Result<MassProperties, PlantError> {
        const SLUG: f64 = LBF / 0.3048;
        const SLUG_FT2: f64 = SLUG * 0.3048 * 0.3048;
        let mut of = |name: &str| self.property(name);
        let mass_kg = of("inertia/mass-slugs")? * SLUG;
        let mut inertia = [0.0; 4];
        let names = ["ixx", "iyy", "izz", "ixz"];
        for (value, name) in inertia.iter_mut().zip(names) {
            *value = of(&format!("inertia/{name}-slugs_ft2"))? * SLUG_FT2;
        }
        // the JSBSim property is the element of the inertia matrix, which is -Jxz
        inertia[3] = -inertia[3];
        Ok(MassProperties { mass_kg, inertia_kgm2: inertia })
    }
}
