//! The envelope limiter between a controller and the surfaces. It limits load factor and angle of attack through the elevator,
//! bank through the aileron, and sideslip through the rudder.
//!
//! For each limit a control law gives the deflection of the surface that brings the limited quantity to the limit. The command
//! is clamped between the deflections for the lower and the upper limit (min/max selection, as in fly-by-wire: Stevens, Lewis
//! and Johnson, *Aircraft Control and Simulation*, 3rd ed., section 4.6).
//! The law is that of an exponential control barrier function (Nguyen and Sreenath, ACC 2016). Let x be the limited quantity and
//! x_lim its limit. The surface acts on ẍ. The deflection is chosen so that
//!
//! ```text
//! ẍ + 2 ω (ẋ − ẋ_lim) + ω² (x − x_lim) = 0
//! ```
//!
//! This brings x to its limit without overshoot. A command between the two deflections is not changed. The model gives ẍ and its
//! change with the deflection, at the state that is predicted for the time at which the command acts. Thus ẍ includes the
//! effects of rolling, airspeed and gravity.

use crate::disturbance::{Disturbance, TIME_CONSTANT_S, TRUST};
use crate::envelope::{Bounds, load_factor_under};
use crate::{Observation, Overruled};
use greylag_model::{GreyBox, STEP};
use greylag_physics::actuators::Actuators;
use greylag_physics::airframe::Envelope;
use greylag_physics::servos::Travel;
use greylag_physics::{Command, Controls, State};

/// The control laws keep load factor, angle of attack and sideslip within this fraction of their limits. The rest covers model
/// error.
const PART: f64 = 0.96;
/// Pole ω of the law for load factor and angle of attack, rad/s.
const PITCH_POLE: f64 = 10.0;
/// Pole ω of the law for bank, rad/s.
const BANK_POLE: f64 = 10.0;
/// Pole ω of the law for sideslip, rad/s.
const SIDESLIP_POLE: f64 = 10.0;
/// Time until a command acts, in steps of [`STEP`]. The first step lasts until the next tick. The others approximate the lag of
/// the actuator.
const AHEAD: usize = 3;
/// Change of a surface's deflection for finite differences, as a fraction of the surface's travel.
const PROBE: f64 = 0.1;
/// Time step for the finite difference of the model's rates, s.
const SPAN_S: f64 = 1e-3;
/// Change of the angle of attack for the finite difference of the load factor, rad.
const SLOPE_STEP: f64 = 0.01;
/// Number of Newton steps from the predicted angle of attack to the angle of attack at the load-factor limit.
const NEWTON: usize = 2;

/// The limit that changed a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Limits of the load factor, largest and smallest.
    Load,
    /// Limits of the angle of attack before the stall, positive and negative.
    Incidence,
    /// Limit of the bank to either side.
    Bank,
    /// Limit of the sideslip to either side.
    Sideslip,
    /// No limit. The limiter is inactive because the model's predictions were wrong.
    Distrust,
}

/// A command after the limiter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limited {
    /// The command to be flown.
    pub command: Command,
    /// The limit that changed the command, or the reason why the limiter is inactive. `None` if the command is within limits.
    pub by: Option<Limit>,
}

impl Limited {
    /// The command `wanted` together with the limited command, for the controller's integrators. `None` if no limit changed
    /// the command.
    pub fn overruled(&self, wanted: Command) -> Option<Overruled> {
        let wanted = wanted.clamped();
        let limited = self.by.is_some_and(|by| by != Limit::Distrust);
        limited.then_some(Overruled { wanted, flown: self.command })
    }
}

/// The envelope limiter of one aircraft. It allocates memory only when it is built.
#[derive(Clone, Debug)]
pub struct EnvelopeLimiter {
    model: GreyBox,
    bounds: Bounds,
    disturbance: Disturbance,
}

/// The surface that keeps a quantity within its limits.
#[derive(Clone, Copy)]
enum Surface {
    Elevator,
    Aileron,
    Rudder,
}

/// A limit: the value of the limited quantity at the limit, rad, and the rate of this value, rad/s.
#[derive(Clone, Copy, Debug)]
struct At {
    limit: Limit,
    value: f64,
    rate: f64,
}

/// The model with the estimated disturbance, at one altitude.
struct Dynamics<'a> {
    model: &'a GreyBox,
    /// Estimated disturbance: the part of the recent state rates that the model did not predict, per second.
    unexplained: State,
    /// Altitude above mean sea level, m.
    altitude: f64,
}

/// The predicted state at the time at which a command acts.
struct Moment<'a> {
    dynamics: Dynamics<'a>,
    state: State,
    controls: Controls,
    /// Rates of `state`, and of the state [`SPAN_S`] later, per second.
    rates: [State; 2],
}

/// Value (rad), first and second derivative of a limited quantity, the deflection (rad) of the surface that acts on it, and
/// the effect of the surface on the second derivative.
#[derive(Clone, Copy)]
struct Motion {
    value: f64,
    rate: f64,
    acceleration: f64,
    /// Change of the second derivative per deflection, 1/s².
    effect: f64,
    deflection: f64,
}

impl EnvelopeLimiter {
    /// The limiter of the aircraft that `model` describes.
    pub fn new(model: &GreyBox) -> EnvelopeLimiter {
        EnvelopeLimiter {
            model: model.clone(),
            bounds: Bounds::of(&model.airframe),
            disturbance: Disturbance::new(TIME_CONSTANT_S),
        }
    }

    /// Replaces the limits by those of `envelope`.
    pub fn keep_to(&mut self, envelope: &Envelope) {
        self.bounds = Bounds::new(envelope, &self.model.airframe.incidence);
    }

    /// Sets the disturbance estimate to zero. To be called when the controller engages.
    pub fn reset(&mut self) {
        self.disturbance = Disturbance::new(TIME_CONSTANT_S);
    }

    /// Whether the recent predictions of the model were wrong, so that no command is limited.
    pub fn distrusts(&self) -> bool {
        self.disturbance.is_wrong(TRUST)
    }

    /// The command nearest to `wanted` that stays inside the envelope. To be called once per tick with the command that would
    /// be flown without limits. `wanted` is returned unchanged if it is not finite, or if the model recently predicted wrongly.
    pub fn limit(&mut self, seen: &Observation, wanted: Command) -> Limited {
        self.disturbance.update(&self.model, seen);
        if !wanted.is_finite() {
            return Limited { command: wanted, by: None };
        }
        if self.distrusts() {
            return Limited { command: wanted, by: Some(Limit::Distrust) };
        }
        let mut out = Limited { command: wanted.clamped(), by: None };
        let at = self.when_it_acts(seen);
        self.keep_bank(&at, &mut out);
        self.keep_sideslip(&at, &mut out);
        self.keep_load(&at, &mut out);
        out
    }

    /// The predicted state at the time at which a new command acts. Until this time the previous command is held.
    fn when_it_acts(&self, seen: &Observation) -> Moment<'_> {
        let figures = &self.model.airframe.actuators;
        let mut actuators = Actuators::from_observed(&seen.actuators, &seen.previous, figures);
        let mut inputs = self.model.at_rest(&actuators.controls());
        let mut memory = self.disturbance.memory();
        let unexplained = self.disturbance.rate();
        let mut state = seen.state;
        let mut controls = self.model.act(&actuators.controls(), &mut inputs);
        for _ in 0..AHEAD {
            let next = self.model.step(&state, &controls, seen.altitude, &mut memory);
            state = next.advance(&unexplained, STEP);
            actuators.step(&seen.previous[0], figures);
            controls = self.model.act(&actuators.controls(), &mut inputs);
        }
        let dynamics = Dynamics { model: &self.model, unexplained, altitude: seen.altitude };
        let rates = dynamics.rates(&state, &controls);
        Moment { dynamics, state, controls, rates }
    }

    fn keep_bank(&self, at: &Moment, out: &mut Limited) {
        let travel = self.model.airframe.actuators.aileron.travel;
        let motion = at.motion(Surface::Aileron, travel, |s| s.roll);
        let most = self.bounds.bank;
        let law = |value| motion.law(At { limit: Limit::Bank, value, rate: 0.0 }, BANK_POLE);
        // the law holds only if positive aileron rolls right
        if motion.effect > 0.0 {
            clamp(&mut out.command.aileron, &mut out.by, travel, [law(-most), law(most)]);
        }
    }

    /// Limits the sideslip of an aircraft with a rudder. Without a rudder no surface can limit it: full aileron of the Skywalker
    /// X8 changes β̈ by less than a twentieth of what the law needs.
    fn keep_sideslip(&self, at: &Moment, out: &mut Limited) {
        let Some(rudder) = &self.model.airframe.actuators.rudder else {
            return;
        };
        let motion = at.motion(Surface::Rudder, rudder.travel, |s| s.beta);
        let most = self.bounds.within(PART).sideslip;
        let law =
            |value| motion.law(At { limit: Limit::Sideslip, value, rate: 0.0 }, SIDESLIP_POLE);
        // the law holds only if positive rudder yaws left, towards positive sideslip
        if motion.effect > 0.0 {
            clamp(&mut out.command.rudder, &mut out.by, rudder.travel, [law(-most), law(most)]);
        }
    }

    /// Limits load factor and angle of attack through the elevator. The limits of the load factor are converted to limits of the
    /// angle of attack.
    fn keep_load(&self, at: &Moment, out: &mut Limited) {
        let travel = self.model.airframe.actuators.elevator.travel;
        let motion = at.motion(Surface::Elevator, travel, |s| s.alpha);
        // the law holds only if positive elevator pitches down
        if motion.effect >= 0.0 {
            return;
        }
        let bounds = self.bounds.within(PART);
        // The elevator adds its own lift. The load factor is therefore computed for the elevator deflection at which α̈ is zero.
        let held = (motion.deflection - motion.acceleration / motion.effect)
            .clamp(travel.least, travel.most);
        let law = |side: usize| motion.law(at.incidence_limit(&bounds, side, held), PITCH_POLE);
        let [least, most] = [law(0), law(1)];
        // the elevator's lift acts before the angle of attack responds
        let [push, pull] = at.lift_limits(&self.bounds, motion.deflection);
        let low = if pull > most.0 { (pull.min(least.0), Limit::Load) } else { most };
        let high = if push < least.0 { (push.max(most.0), Limit::Load) } else { least };
        // the lower bound limits nose-up commands; it has priority because the stall and the largest load factor matter more
        // than the smallest load factor
        clamp(&mut out.command.elevator, &mut out.by, travel, [low, high]);
    }
}

/// Clamps `command` (−1..1) between the deflections `low` and `high` (rad). If this changes the command, `by` becomes the limit
/// that belongs to the deflection. If `low` exceeds `high`, the result is `low`.
fn clamp(
    command: &mut f64,
    by: &mut Option<Limit>,
    travel: Travel,
    [low, high]: [(f64, Limit); 2],
) {
    let [least, most] =
        [low, high].map(|(x, _)| travel.command(x.clamp(travel.least, travel.most)));
    if *command > most {
        (*command, *by) = (most, Some(high.1));
    }
    if *command < least {
        (*command, *by) = (least, Some(low.1));
    }
}

impl Surface {
    fn of(self, controls: &mut Controls) -> &mut f64 {
        match self {
            Surface::Elevator => &mut controls.elevator,
            Surface::Aileron => &mut controls.aileron,
            Surface::Rudder => &mut controls.rudder,
        }
    }
}

impl Dynamics<'_> {
    /// Rates of `state` under `controls` with the disturbance, per second.
    fn rate(&self, state: &State, controls: &Controls) -> State {
        self.model.rate(state, controls, self.altitude).advance(&self.unexplained, 1.0)
    }

    /// Rates of `state`, and of the state [`SPAN_S`] later, under constant `controls`, per second.
    fn rates(&self, state: &State, controls: &Controls) -> [State; 2] {
        let rate = self.rate(state, controls);
        [rate, self.rate(&state.advance(&rate, SPAN_S), controls)]
    }
}

impl Moment<'_> {
    /// Value and derivatives of the quantity `of`, and the effect of `surface`, whose travel limits are `travel`.
    fn motion(&self, surface: Surface, travel: Travel, of: impl Fn(&State) -> f64) -> Motion {
        let mut controls = self.controls;
        // second derivative: difference of the two rates over the time between them
        let along = |[rate, later]: &[State; 2]| (of(later) - of(rate)) / SPAN_S;
        let acceleration = along(&self.rates);
        let deflection = *surface.of(&mut controls);
        let probe = if deflection > 0.0 { PROBE * travel.least } else { PROBE * travel.most };
        *surface.of(&mut controls) += probe;
        let probed = along(&self.dynamics.rates(&self.state, &controls));
        let effect = (probed - acceleration) / probe;
        let (value, rate) = (of(&self.state), of(&self.rates[0]));
        Motion { value, rate, acceleration, effect, deflection }
    }

    /// The load factor in g at the angle of attack `alpha` (rad) and the elevator deflection `elevator` (rad).
    fn load(&self, alpha: f64, elevator: f64) -> f64 {
        let state = State { alpha, ..self.state };
        let controls = Controls { elevator, ..self.controls };
        load_factor_under(&state, &self.dynamics.rate(&state, &controls))
    }

    /// The elevator deflections (rad) at which the load factor reaches its largest and its smallest limit at the present angle of
    /// attack, through the elevator's own lift. `elevator` is the predicted deflection (rad).
    fn lift_limits(&self, bounds: &Bounds, elevator: f64) -> [f64; 2] {
        let load = self.load(self.state.alpha, elevator);
        let travel = self.dynamics.model.airframe.actuators.elevator.travel;
        let probe = if elevator > 0.0 { PROBE * travel.least } else { PROBE * travel.most };
        let slope = (self.load(self.state.alpha, elevator + probe) - load) / probe;
        // With a canard, positive elevator reduces the lift. There is then no such limit.
        if slope <= 0.0 {
            return [f64::INFINITY, f64::NEG_INFINITY];
        }
        let [least, most] = bounds.load.map(|bound| elevator + (bound - load) / slope);
        [most, least]
    }

    /// The smallest (`side` 0) or largest (`side` 1) permitted angle of attack. It is the angle at which the load factor reaches
    /// its limit, or the limit before the stall if that comes first. `elevator` is the deflection (rad) at which the load factor
    /// is computed.
    fn incidence_limit(&self, bounds: &Bounds, side: usize, elevator: f64) -> At {
        let stall = At { limit: Limit::Incidence, value: bounds.alpha[side], rate: 0.0 };
        let mut alpha = self.state.alpha;
        let mut slope = 0.0;
        for _ in 0..NEWTON {
            let load = self.load(alpha, elevator);
            slope = (self.load(alpha + SLOPE_STEP, elevator) - load) / SLOPE_STEP;
            // beyond the stall, the lift does not increase with the angle of attack
            if slope <= 0.0 || slope.is_nan() {
                return stall;
            }
            let next = alpha + (bounds.load[side] - load) / slope;
            alpha = next.clamp(bounds.alpha[0], bounds.alpha[1]);
        }
        let inside = bounds.alpha[0] < alpha && alpha < bounds.alpha[1];
        if !inside {
            return stall;
        }
        // the angle of attack at the limit changes with airspeed V, because the lift at one angle is proportional to V²
        let rate = self.rates[0].airspeed;
        let rate = -2.0 * rate / self.state.airspeed * bounds.load[side] / slope;
        At { limit: Limit::Load, value: alpha, rate }
    }
}

impl Motion {
    /// The deflection (rad) at which the equation of the law (see the top of this file) holds for the limit `at` with ω = `pole`
    /// (rad/s).
    fn law(&self, at: At, pole: f64) -> (f64, Limit) {
        let wanted = -2.0 * pole * (self.rate - at.rate) - pole * pole * (self.value - at.value);
        (self.deflection + (wanted - self.acceleration) / self.effect, at.limit)
    }
}
