//! The LQI's control law over the steps of a prediction, evaluated for many simulated aircraft at once, one per vector lane.

use super::design::{RUDDER_STATES, STATES};
use super::{AIRSPEED_KP, PITCH_RATE, ROLL_RATE, ROUNDING};
use crate::lqi::gain_schedule::Entry;
use greylag_model::STEP;
use greylag_num::{Real, each};
use greylag_physics::airframe::Incidence;
use greylag_physics::servos::ActuatorFigures;
use greylag_physics::{ActuatorState, Airframe, Command, State};

/// The gain for one flight condition, and the steady state to which it regulates.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    /// Gains of aileron and elevator on the states, rad of deflection per unit of the state.
    gain: [[f64; STATES]; 2],
    /// Values of p, q, r, α, β in the steady state, rad/s and rad.
    steady: [f64; 5],
    /// Deflections of aileron and elevator in the steady state, rad.
    deflection: [f64; 2],
    /// Throttle in the steady state, 0..1.
    throttle: f64,
    /// The rudder's law. `None` for an aircraft without a rudder.
    rudder: Option<RudderLaw>,
}

/// The rudder's part of the gain of one flight condition.
#[derive(Clone, Copy, Debug)]
struct RudderLaw {
    /// Gains of aileron and elevator on the rudder's filter states.
    coupling: [[f64; RUDDER_STATES]; 2],
    /// Gains of the rudder on the states on which aileron and elevator depend.
    row: [f64; STATES],
    /// Gains of the rudder on its own filter states.
    own: [f64; RUDDER_STATES],
    /// Deflection of the rudder in the steady state, rad.
    deflection: f64,
}

/// Actuator travels, which convert deflections to commands, and the angle of attack above which the law lowers the nose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surfaces {
    pub figures: ActuatorFigures,
    pub incidence: Incidence,
}

/// Reference attitude and integrator states of the control law.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inner<R> {
    /// Reference roll and pitch, rad.
    pub reference: [R; 2],
    /// Integrals of the roll and pitch errors, rad s.
    pub integral: [R; 2],
}

impl Surfaces {
    /// The actuators and the limit of the angle of attack of an airframe file.
    pub(super) fn of(airframe: &Airframe) -> Surfaces {
        Surfaces { figures: airframe.actuators, incidence: airframe.incidence }
    }
}

impl Law {
    pub(super) const NONE: Law = Law {
        gain: [[0.0; STATES]; 2],
        steady: [0.0; 5],
        deflection: [0.0; 2],
        throttle: 0.0,
        rudder: None,
    };

    /// Commands of aileron, elevator and rudder, not limited to −1..1. `previous` holds the last two commands, newest first.
    #[inline(always)]
    pub(super) fn surfaces<R: Real>(
        &self,
        inner: &Inner<R>,
        s: &State<R>,
        z: &ActuatorState<R>,
        previous: &[Command<R>; 2],
        of: &Surfaces,
    ) -> [R; 3] {
        let number = R::from_f64;
        let Surfaces { figures, incidence } = of;
        let [aileron, elevator] = each(self.deflection, number);
        let [p, q, r, alpha, beta] = each(self.steady, number);
        let [new, old] = previous;
        let (ailerons, elevators) = (figures.aileron.travel, figures.elevator.travel);
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
            ailerons.deflection(new.aileron) - aileron,
            ailerons.deflection(old.aileron) - aileron,
            z.elevator - elevator,
            z.elevator - z.elevator_rate.scale(STEP) - elevator,
            elevators.deflection(new.elevator) - elevator,
            elevators.deflection(old.elevator) - elevator,
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
        let mut rudder = R::zero();
        if let (Some(law), Some(figures)) = (&self.rudder, &figures.rudder) {
            let travel = figures.travel;
            let held = number(law.deflection);
            let y = [
                z.rudder - held,
                z.rudder - z.rudder_rate.scale(STEP) - held,
                travel.deflection(new.rudder) - held,
                travel.deflection(old.rudder) - held,
            ];
            let yaw = law.act(held, &x, &y, &mut u);
            rudder = travel.command(yaw);
        }
        let excess = (s.alpha - number(incidence.push_from)).max(R::zero());
        u[1] += excess.scale(incidence.push_gain);
        [ailerons.command(u[0]), elevators.command(u[1]), rudder]
    }

    /// Gains from the reference roll to the aileron and from the reference pitch to the elevator, rad/rad.
    pub(super) fn by_reference(&self) -> [f64; 2] {
        [self.gain[0][0], self.gain[1][1]]
    }

    pub(super) fn throttle(&self) -> f64 {
        self.throttle
    }
}

impl RudderLaw {
    /// Returns the rudder's deflection (rad); `held` is its deflection in the steady state. Adds to the deflections `u` of
    /// aileron and elevator the contribution of the rudder's filter states `y`: the present and previous deflection and the
    /// last two commands.
    #[inline(always)]
    fn act<R: Real>(&self, held: R, x: &[R; STATES], y: &[R; RUDDER_STATES], u: &mut [R; 2]) -> R {
        let mut yaw = held;
        let mut i = 0;
        while i < STATES {
            yaw -= x[i].scale(self.row[i]);
            i += 1;
        }
        i = 0;
        while i < RUDDER_STATES {
            yaw -= y[i].scale(self.own[i]);
            u[0] -= y[i].scale(self.coupling[0][i]);
            u[1] -= y[i].scale(self.coupling[1][i]);
            i += 1;
        }
        yaw
    }
}

impl From<Entry> for Law {
    fn from(entry: Entry) -> Law {
        let [aileron, elevator, rudder] = entry.deflection;
        let deflection = [aileron, elevator];
        let mut law = Law { deflection, throttle: entry.throttle, ..Law::NONE };
        law.steady.copy_from_slice(&entry.steady[2..]);
        for (row, gain) in law.gain.iter_mut().zip(entry.gain.surfaces.row_iter()) {
            row.iter_mut().zip(gain.iter()).for_each(|(to, from)| *to = *from);
        }
        law.rudder = entry.gain.rudder.map(|gain| RudderLaw {
            coupling: std::array::from_fn(|i| std::array::from_fn(|j| gain.coupling[(i, j)])),
            row: std::array::from_fn(|j| gain.row[j]),
            own: std::array::from_fn(|j| gain.own[j]),
            deflection: rudder,
        });
        law
    }
}

/// Number of steps for which one law is used before the next one is taken from the gain schedule.
pub(super) const HOLD: usize = 5;

/// The LQI's data that are the same for all simulated aircraft of a prediction. The gains are scheduled along the reference
/// attitude at the present airspeed. The integrators keep their present values.
#[derive(Clone, Debug)]
pub(crate) struct Ahead {
    pub(super) laws: Vec<Law>,
    pub(super) steps: usize,
    pub(super) wanted: [f64; 2],
    pub(super) airspeed: f64,
    pub(super) inner: Inner<f64>,
    pub(super) airspeed_integral: f64,
    pub(super) surfaces: Surfaces,
}

impl Ahead {
    /// Allocates memory for `steps` steps of an aircraft.
    pub(crate) fn new(steps: usize, airframe: &Airframe) -> Ahead {
        Ahead {
            laws: vec![Law::NONE; steps.div_ceil(HOLD)],
            steps,
            wanted: [0.0; 2],
            airspeed: 0.0,
            inner: Inner { reference: [0.0; 2], integral: [0.0; 2] },
            airspeed_integral: 0.0,
            surfaces: Surfaces::of(airframe),
        }
    }

    /// Number of steps of the prediction.
    #[inline(always)]
    pub(crate) fn steps(&self) -> usize {
        self.steps
    }

    /// Roll and pitch (rad) of the LQI's reference at the first step.
    pub(crate) fn reference(&self) -> [f64; 2] {
        self.inner.reference
    }

    /// Returns the LQI's command at `step` for a simulated aircraft. Moves the aircraft's `reference` (roll and pitch, rad)
    /// towards the commanded attitude by one step.
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
        let [aileron, elevator, rudder] =
            law.surfaces(&inner, state, actuators, previous, &self.surfaces);
        let feed_forward = R::from_f64(law.throttle + self.airspeed_integral);
        let throttle =
            feed_forward + (R::from_f64(self.airspeed) - state.airspeed).scale(AIRSPEED_KP);
        Command {
            aileron: aileron.clamp(-1.0, 1.0),
            elevator: elevator.clamp(-1.0, 1.0),
            throttle: throttle.clamp(0.0, 1.0),
            rudder: rudder.clamp(-1.0, 1.0),
        }
    }
}
