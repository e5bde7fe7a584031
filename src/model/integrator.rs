//! Time integration of a model by RK4 or by JSBSim's scheme, and a complete simulated aircraft.

use serde::{Deserialize, Serialize};

use crate::GreyBox;
use crate::calls::{Called, Forces, Inlined};
use greylag_num::{Real, each};
use greylag_physics::actuators::Actuators;
use greylag_physics::inputs::InputMemory;
use greylag_physics::rigid_body::{self, Vector};
use greylag_physics::{AirData, Command, Controls, State};

/// The time step of control and simulation, s.
pub const STEP: f64 = 0.01;

/// Scheme by which a model advances by one [`STEP`] with constant controls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Classical fourth-order Runge–Kutta, as in \[GSFM26\] (see `src/lib.rs`).
    Rk4,
    /// JSBSim's default (`FGPropagate`): body rates and attitude by explicit Euler, velocity by Adams–Bashforth 2 in earth axes.
    /// The scheme stores the last acceleration.
    Jsbsim,
}

/// Memory of [`Integrator::Jsbsim`]: the last acceleration in the horizon frame (m/s²), which is level and turns with the
/// heading. `None` at the start of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory<R = f64>(Option<Vector<R>>);

impl<R> Default for Memory<R> {
    /// The empty memory, for the start of a run.
    fn default() -> Self {
        Memory(None)
    }
}

impl<R: Real> Memory<R> {
    /// Merges two memories: takes `then` in the SIMD lanes in which `chosen` is above zero, and this memory in the other lanes.
    /// If one of the two memories is empty, the other one is taken in all lanes.
    #[inline(always)]
    pub fn replaced(&self, chosen: R, then: &Self) -> Self {
        let (Some(mut all), Some(then)) = (self.0, then.0) else {
            return if self.0.is_some() { *self } else { *then };
        };
        for (x, then) in all.iter_mut().zip(then) {
            *x = R::where_less(R::zero(), chosen, then, *x);
        }
        Memory(Some(all))
    }
}

impl<R: Copy> Memory<R> {
    /// Converts every number of the memory to another scalar type.
    #[inline(always)]
    pub fn map<S: Copy>(&self, f: impl FnMut(R) -> S) -> Memory<S> {
        match self.0 {
            Some(last) => Memory(Some(each(last, f))),
            None => Memory(None),
        }
    }
}

impl GreyBox {
    /// Returns the state one [`STEP`] later, with constant controls at `altitude` (m). `memory` is updated.
    pub fn step<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        memory: &mut Memory<R>,
    ) -> State<R> {
        self.step_from(state, controls, altitude, memory, Called)
    }

    /// [`step`](GreyBox::step) inlined into the caller, for kernels compiled for several instruction sets. In other functions
    /// it only increases the program's size.
    #[inline(always)]
    pub fn step_inlined<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        memory: &mut Memory<R>,
    ) -> State<R> {
        self.step_from(state, controls, altitude, memory, Inlined)
    }

    /// The same as `step`, with `forces` that are called or inlined.
    #[inline(always)]
    pub(crate) fn step_from<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        memory: &mut Memory<R>,
        forces: impl Forces<R>,
    ) -> State<R> {
        match self.integrator {
            Integrator::Rk4 => self.step_rk4(state, controls, altitude, forces),
            Integrator::Jsbsim => self.step_jsbsim(state, controls, altitude, memory, forces),
        }
    }

    #[inline(always)]
    fn step_rk4<R: Real>(
        &self,
        s: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        forces: impl Forces<R>,
    ) -> State<R> {
        let (mut at, mut next) = (*s, *s);
        // for each stage: step from `s` to the next stage, and weight of the slope in the sum, both in s
        let stages = [
            (STEP / 2.0, STEP / 6.0),
            (STEP / 2.0, STEP / 3.0),
            (STEP, STEP / 3.0),
            (0.0, STEP / 6.0),
        ];
        for (reach, weight) in stages {
            let slope = self.rate_from(&at, controls, altitude, forces);
            at = s.advance(&slope, reach);
            next = next.advance(&slope, weight);
        }
        next
    }

    #[inline(always)]
    fn step_jsbsim<R: Real>(
        &self,
        s: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        memory: &mut Memory<R>,
        forces: impl Forces<R>,
    ) -> State<R> {
        let air = self.air(s, altitude);
        let (mut acceleration, mut spin) = forces.accelerations(self, s, controls, &air);
        if let Some(residual) = &self.residual {
            // this scheme uses only accelerations, so the residual's φ̇ and θ̇ have no effect
            let learned = forces.learned(residual, s, controls);
            let push = rigid_body::acceleration_of(s, &air, &learned);
            for (sum, part) in acceleration.iter_mut().zip(push) {
                *sum += part;
            }
            for (sum, part) in spin.iter_mut().zip([learned.p, learned.q, learned.r]) {
                *sum += part;
            }
        }
        let (next, last) = advance_jsbsim(s, &air, acceleration, spin, memory.0);
        memory.0 = Some(last);
        next
    }
}

/// Advances by one [`STEP`] with [`Integrator::Jsbsim`]. The accelerations are in body axes (m/s², rad/s²). `last` is the
/// last acceleration in the horizon frame, `None` in the first step. Returns the state and the acceleration to be stored.
#[inline(always)]
pub fn advance_jsbsim<R: Real>(
    s: &State<R>,
    air: &AirData<R>,
    acceleration: Vector<R>,
    spin: Vector<R>,
    last: Option<Vector<R>>,
) -> (State<R>, Vector<R>) {
    let acceleration = rigid_body::body_to_horizon(s, acceleration);
    let velocity = rigid_body::body_to_horizon(s, rigid_body::air_velocity(s, air));
    let last = match last {
        Some(last) => last,
        None => acceleration,
    };
    let velocity = [
        adams_bashforth(velocity[0], acceleration[0], last[0]),
        adams_bashforth(velocity[1], acceleration[1], last[1]),
        adams_bashforth(velocity[2], acceleration[2], last[2]),
    ];
    let (roll, pitch, turn) = euler_step_attitude(s);
    let turning = turn.sin_cos();
    let turned = State { roll, pitch, ..*s };
    let [u, v, w] = rigid_body::horizon_to_body(&turned, to_heading(velocity, turning));
    let airspeed = (u * u + v * v + w * w).sqrt();
    let next = State {
        roll,
        pitch,
        airspeed,
        p: s.p + spin[0].scale(STEP),
        q: s.q + spin[1].scale(STEP),
        r: s.r + spin[2].scale(STEP),
        alpha: w.atan2(u),
        beta: (v / airspeed).asin(),
    };
    (next, to_heading(acceleration, turning))
}

/// One component of the velocity one step later, by Adams–Bashforth 2.
#[inline(always)]
fn adams_bashforth<R: Real>(velocity: R, acceleration: R, last: R) -> R {
    velocity + acceleration.scale(1.5 * STEP) - last.scale(0.5 * STEP)
}

/// Transforms a vector from the horizon frame of the old heading to that of the new heading. The heading changes by the
/// angle with the given sine and cosine.
#[inline(always)]
fn to_heading<R: Real>([n, e, d]: Vector<R>, (sin, cos): (R, R)) -> Vector<R> {
    [n * cos + e * sin, e * cos - n * sin, d]
}

/// Attitude after an explicit Euler step of the quaternion: roll, pitch, and the change of heading, rad.
#[inline(always)]
fn euler_step_attitude<R: Real>(s: &State<R>) -> (R, R, R) {
    let (sr, cr) = s.roll.scale(0.5).sin_cos();
    let (sp, cp) = s.pitch.scale(0.5).sin_cos();
    // quaternion of roll and pitch at zero heading
    let (w, x, y, z) = (cr * cp, sr * cp, cr * sp, -(sr * sp));
    let h = 0.5 * STEP;
    let (p, q, r) = (s.p.scale(h), s.q.scale(h), s.r.scale(h));
    let a = w - (x * p + y * q + z * r);
    let b = x + (w * p + y * r - z * q);
    let c = y + (w * q + z * p - x * r);
    let d = z + (w * r + x * q - y * p);
    let two = R::from_f64(2.0);
    let norm = a * a + b * b + c * c + d * d;
    let roll = (two * (a * b + c * d)).atan2(a * a - b * b - c * c + d * d);
    let pitch = (two * (a * c - b * d) / norm).asin();
    let turn = (two * (a * d + b * c)).atan2(a * a + b * b - c * c - d * d);
    (roll, pitch, turn)
}

/// A complete simulated aircraft: state, actuator filters, altitude and the model's memories.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twin {
    /// State of the flight.
    pub state: State,
    /// Actuator filters with their memories.
    pub actuators: Actuators,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    memory: Memory,
    /// Memory of the model's input effects (between actuators and surfaces) and lags. `None` before the first step, which starts
    /// from a steady state.
    inputs: Option<InputMemory>,
}

impl Twin {
    /// An aircraft at `state` and `altitude` (m), with all controls at zero.
    pub fn new(state: State, altitude: f64) -> Twin {
        Twin::at_rest(state, &Controls::default(), altitude)
    }

    /// An aircraft at `state` and `altitude` (m), with actuators and input effects in steady state at `controls`.
    pub fn at_rest(state: State, controls: &Controls, altitude: f64) -> Twin {
        let actuators = Actuators::at_rest(controls);
        Twin { state, actuators, altitude, memory: Memory::default(), inputs: None }
    }

    /// Advances by one [`STEP`] in still air, in the order of JSBSim. First the state is integrated with the present actuator
    /// positions, then the actuators respond to the command.
    pub fn step(&mut self, model: &GreyBox, command: &Command) {
        let air = model.air(&self.state, self.altitude);
        let velocity = rigid_body::air_velocity(&self.state, &air);
        let climb = -rigid_body::body_to_horizon(&self.state, velocity)[2];
        let measured = self.actuators.controls();
        let inputs = self.inputs.get_or_insert_with(|| model.at_rest(&measured));
        let controls = model.act(&measured, inputs);
        self.state = model.step(&self.state, &controls, self.altitude, &mut self.memory);
        self.altitude += climb * STEP;
        self.actuators.step(command, &model.airframe.actuators);
    }

    /// Specific force at the centre of gravity in body axes, m/s²: the reading of an ideal accelerometer at that point. In
    /// level flight its z component is about −9.81.
    pub fn specific_force(&self, model: &GreyBox) -> Vector<f64> {
        let air = model.air(&self.state, self.altitude);
        let measured = self.actuators.controls();
        let mut inputs = self.inputs.unwrap_or_else(|| model.at_rest(&measured));
        let controls = model.act(&measured, &mut inputs);
        let wrench = model.wrench(&self.state, &controls, &air);
        let mut force = rigid_body::body_force(&wrench, &air, model.axes)
            .map(|newton| newton / model.body.mass);
        if let Some(residual) = &model.residual {
            let learned = residual.rate(&self.state, &controls);
            let push = rigid_body::acceleration_of(&self.state, &air, &learned);
            force.iter_mut().zip(push).for_each(|(sum, part)| *sum += part);
        }
        force
    }
}
