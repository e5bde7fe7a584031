//! Steps through time: RK4, and the scheme that JSBSim flies with.

use serde::{Deserialize, Serialize};

use crate::model::GreyBox;
use crate::num::Real;
use crate::physics::actuators::Actuators;
use crate::physics::inputs::InputMemory;
use crate::physics::rigid_body::{self, Vector};
use crate::physics::{AirData, Command, Controls, State};

/// The time step of control and simulation, s.
pub const STEP: f64 = 0.01;

/// How a model advances by [`STEP`] with its controls held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// Classical fourth-order Runge–Kutta, as in \[GSFM26\].
    Rk4,
    /// JSBSim's default: rates and attitude by explicit Euler, velocity by Adams–Bashforth 2 in
    /// earth axes (`FGPropagate`). It remembers the last acceleration.
    Jsbsim,
}

/// What [`Integrator::Jsbsim`] remembers: the last acceleration in the horizon frame, m/s².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Memory<R = f64>(Option<Vector<R>>);

impl<R> Default for Memory<R> {
    /// The memory at the start of an episode.
    fn default() -> Self {
        Memory(None)
    }
}

impl GreyBox {
    /// The state one [`STEP`] later, controls held, at `altitude` (m).
    #[inline(always)]
    pub fn step<R: Real>(
        &self,
        state: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        memory: &mut Memory<R>,
    ) -> State<R> {
        match self.integrator {
            Integrator::Rk4 => self.step_rk4(state, controls, altitude),
            Integrator::Jsbsim => self.step_jsbsim(state, controls, altitude, memory),
        }
    }

    #[inline(always)]
    fn step_rk4<R: Real>(&self, s: &State<R>, controls: &Controls<R>, altitude: f64) -> State<R> {
        let rate = |s: &State<R>| self.rate(s, controls, altitude);
        let k1 = rate(s);
        let k2 = rate(&s.advance(&k1, STEP / 2.0));
        let k3 = rate(&s.advance(&k2, STEP / 2.0));
        let k4 = rate(&s.advance(&k3, STEP));
        s.advance(&k1, STEP / 6.0)
            .advance(&k2, STEP / 3.0)
            .advance(&k3, STEP / 3.0)
            .advance(&k4, STEP / 6.0)
    }

    #[inline(always)]
    fn step_jsbsim<R: Real>(
        &self,
        s: &State<R>,
        controls: &Controls<R>,
        altitude: f64,
        memory: &mut Memory<R>,
    ) -> State<R> {
        let air = self.air(s, altitude);
        let (mut acceleration, mut spin) = self.accelerations(s, controls, &air);
        if let Some(residual) = &self.residual {
            // this scheme knows accelerations only: what was learned of φ̇ and θ̇ has no place in it
            let learned = residual.rate(s, controls);
            let push = rigid_body::acceleration_of(s, &air, &learned);
            let turn = [learned.p, learned.q, learned.r];
            acceleration = std::array::from_fn(|i| acceleration[i] + push[i]);
            spin = std::array::from_fn(|i| spin[i] + turn[i]);
        }
        let (next, last) = advance_jsbsim(s, &air, acceleration, spin, memory.0);
        memory.0 = Some(last);
        next
    }
}

/// The state one [`STEP`] later by [`Integrator::Jsbsim`] from accelerations in body axes (m/s²,
/// rad/s²) and the last acceleration in the horizon frame, if there is one; and what is to be
/// remembered in its place.
#[inline(always)]
pub(crate) fn advance_jsbsim<R: Real>(
    s: &State<R>,
    air: &AirData<R>,
    acceleration: Vector<R>,
    spin: Vector<R>,
    last: Option<Vector<R>>,
) -> (State<R>, Vector<R>) {
    let acceleration = rigid_body::body_to_horizon(s, acceleration);
    let velocity = rigid_body::body_to_horizon(s, rigid_body::air_velocity(s, air));
    let last = last.unwrap_or(acceleration);
    let velocity: Vector<R> = std::array::from_fn(|i| {
        velocity[i] + acceleration[i].scale(1.5 * STEP) - last[i].scale(0.5 * STEP)
    });
    let (roll, pitch, turn) = euler_step_attitude(s);
    let (sin, cos) = turn.sin_cos();
    let to_new_heading = |[n, e, d]: Vector<R>| [n * cos + e * sin, e * cos - n * sin, d];
    let turned = State { roll, pitch, ..*s };
    let [u, v, w] = rigid_body::horizon_to_body(&turned, to_new_heading(velocity));
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
    (next, to_new_heading(acceleration))
}

/// Attitude after an explicit Euler step of the quaternion: roll, pitch, and the turn in heading.
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

/// A whole simulated aircraft: state, actuator filters, altitude and the integrator's memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Twin {
    /// The physical state.
    pub state: State,
    /// The actuator filters.
    pub actuators: Actuators,
    /// Altitude above mean sea level, m.
    pub altitude: f64,
    memory: Memory,
    inputs: InputMemory,
}

impl Twin {
    /// An aircraft at `state` and `altitude` (m), actuators at zero.
    pub fn new(state: State, altitude: f64) -> Twin {
        let actuators = Actuators::at_rest(&Controls::default());
        let inputs = InputMemory::at_rest(&Controls::default());
        Twin { state, actuators, altitude, memory: Memory::default(), inputs }
    }

    /// Advances by [`STEP`] in the order of the simulator: the state moves under the actuators as
    /// they are, then the actuators take the command.
    pub fn step(&mut self, model: &GreyBox, command: &Command) {
        let air = model.air(&self.state, self.altitude);
        let velocity = rigid_body::air_velocity(&self.state, &air);
        let climb = -rigid_body::body_to_horizon(&self.state, velocity)[2];
        let controls = model.act(&self.actuators.controls(), &mut self.inputs);
        self.state = model.step(&self.state, &controls, self.altitude, &mut self.memory);
        self.altitude += climb * STEP;
        self.actuators.step(command, &model.airframe.actuators);
    }
}
