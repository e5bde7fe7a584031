//! The LQI as imagined aircraft fly it: its laws over the coming steps, evaluated in lanes.

use super::design::STATES;
use super::{AIRSPEED_KP, PITCH_RATE, ROLL_RATE, ROUNDING, STALL_ALPHA, STALL_GAIN};
use crate::control::lqi::gain_schedule::Entry;
use crate::model::STEP;
use crate::num::{Real, each};
use crate::physics::{ActuatorState, Command, State};

/// The law of one condition: the gain, and the steady flight that it holds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    /// Rows aileron and elevator.
    gain: [[f64; STATES]; 2],
    /// p q r α β of the steady condition, rad/s and rad.
    steady: [f64; 5],
    /// Aileron and elevator that hold it, rad.
    deflection: [f64; 2],
    /// Throttle that holds it, 0..1.
    throttle: f64,
}

/// What the law feeds back besides attitude and rates: rad and rad s.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inner<R> {
    /// Reference roll and pitch.
    pub reference: [R; 2],
    /// Integrals of their errors.
    pub integral: [R; 2],
}

impl Law {
    pub(super) const NONE: Law =
        Law { gain: [[0.0; STATES]; 2], steady: [0.0; 5], deflection: [0.0; 2], throttle: 0.0 };

    /// Aileron and elevator in units of the largest deflection, not limited.
    #[inline(always)]
    pub(super) fn surfaces<R: Real>(
        &self,
        inner: &Inner<R>,
        s: &State<R>,
        z: &ActuatorState<R>,
        previous: &[Command<R>; 2],
        deflection: f64,
    ) -> [R; 2] {
        let number = R::from_f64;
        let [aileron, elevator] = each(self.deflection, number);
        let [p, q, r, alpha, beta] = each(self.steady, number);
        let [new, old] = previous;
        let x = [
            s.roll - inner.reference[0],
            s.pitch - inner.reference[1],
            s.p - p,
            s.q - q,
            s.r - r,
            s.alpha - alpha,
            s.beta - beta,
            z.aileron - aileron,
            z.aileron - z.aileron_rate.scale(STEP) - aileron,
            new.aileron.scale(deflection) - aileron,
            old.aileron.scale(deflection) - aileron,
            z.elevator - elevator,
            z.elevator - z.elevator_rate.scale(STEP) - elevator,
            new.elevator.scale(deflection) - elevator,
            old.elevator.scale(deflection) - elevator,
            inner.integral[0],
            inner.integral[1],
        ];
        let mut u = [aileron, elevator];
        let mut i = 0;
        while i < STATES {
            u[0] -= x[i].scale(self.gain[0][i]);
            u[1] -= x[i].scale(self.gain[1][i]);
            i += 1;
        }
        u[1] += (s.alpha - number(STALL_ALPHA)).max(R::zero()).scale(STALL_GAIN);
        [u[0].scale(1.0 / deflection), u[1].scale(1.0 / deflection)]
    }

    pub(super) fn throttle(&self) -> f64 {
        self.throttle
    }
}

impl From<Entry> for Law {
    fn from(entry: Entry) -> Law {
        let mut law = Law { deflection: entry.deflection, throttle: entry.throttle, ..Law::NONE };
        law.steady.copy_from_slice(&entry.steady[2..]);
        for (row, gain) in law.gain.iter_mut().zip(entry.gain.row_iter()) {
            row.iter_mut().zip(gain.iter()).for_each(|(to, from)| *to = *from);
        }
        law
    }
}

/// Steps over which one law holds.
pub(super) const HOLD: usize = 5;

/// The LQI from some tick on, as far as it does not depend on the aircraft that flies it: the schedule
/// is followed along the reference, at the airspeed of the tick; the integrals stand still.
#[derive(Clone, Debug)]
pub(crate) struct Ahead {
    pub(super) laws: Vec<Law>,
    pub(super) steps: usize,
    pub(super) wanted: [f64; 2],
    pub(super) airspeed: f64,
    pub(super) inner: Inner<f64>,
    pub(super) airspeed_integral: f64,
    pub(super) deflection: f64,
}

impl Ahead {
    /// Room for `steps` steps.
    pub(crate) fn new(steps: usize) -> Ahead {
        Ahead {
            laws: vec![Law::NONE; steps.div_ceil(HOLD)],
            steps,
            wanted: [0.0; 2],
            airspeed: 0.0,
            inner: Inner { reference: [0.0; 2], integral: [0.0; 2] },
            airspeed_integral: 0.0,
            deflection: 1.0,
        }
    }

    /// Steps looked ahead.
    #[inline(always)]
    pub(crate) fn steps(&self) -> usize {
        self.steps
    }

    /// Roll and pitch (rad) of the LQI's own reference at the first step.
    pub(crate) fn reference(&self) -> [f64; 2] {
        self.inner.reference
    }

    /// The command at `step` of an aircraft; its `reference` (rad) moves on.
    #[inline(always)]
    pub(crate) fn command<R: Real>(
        &self,
        step: usize,
        reference: &mut [R; 2],
        state: &State<R>,
        actuators: &ActuatorState<R>,
        previous: &[Command<R>; 2],
    ) -> Command<R> {
        let rates = [ROLL_RATE, PITCH_RATE];
        let mut i = 0;
        while i < 2 {
            let towards = (R::from_f64(self.wanted[i]) - reference[i]).scale(1.0 / ROUNDING);
            reference[i] += towards.clamp(-rates[i], rates[i]).scale(STEP);
            i += 1;
        }
        let law = &self.laws[step / HOLD];
        let integral = [R::from_f64(self.inner.integral[0]), R::from_f64(self.inner.integral[1])];
        let inner = Inner { reference: *reference, integral };
        let [aileron, elevator] = law.surfaces(&inner, state, actuators, previous, self.deflection);
        let feed_forward = R::from_f64(law.throttle + self.airspeed_integral);
        let throttle =
            feed_forward + (R::from_f64(self.airspeed) - state.airspeed).scale(AIRSPEED_KP);
        Command {
            aileron: aileron.clamp(-1.0, 1.0),
            elevator: elevator.clamp(-1.0, 1.0),
            throttle: throttle.clamp(0.0, 1.0),
        }
    }
}
