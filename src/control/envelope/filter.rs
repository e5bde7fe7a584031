//! The filter between a controller and the surfaces: the nearest command whose predicted motion stays inside the envelope.
//!
//! A command is held, within the slew limit, over a short horizon of the model, with what the model has left unexplained lately
//! added. Where a limit would be passed, the elevator (load factor, incidence, pitch) or the aileron (sideslip, bank) moves by
//! as much as the prediction needs: a command governor (Garone, Di Cairano and Kolmanovsky, Automatica 75, 2017) over a horizon
//! in which the actuators and the short period answer. Since the check is repeated every tick, a command that is allowed now and
//! would break a limit later is taken back in time.

use crate::Observation;
use crate::disturbance::{Disturbance, TIME_CONSTANT_S, TRUST};
use crate::envelope::{Bounds, load_factor};
use greylag_model::{GreyBox, STEP};
use greylag_physics::actuators::Actuators;
use greylag_physics::airframe::Envelope;
use greylag_physics::{Command, State};

/// Steps predicted: 80 ms, some four time constants of a surface's actuator and as long as the short period needs to show where it goes.
const HORIZON: usize = 8;
/// Part of the limits that is aimed at: the rest is for what the model does not know within the horizon.
const PART: f64 = 0.96;
/// Step of a command that shows what it does.
const PROBE: f64 = 0.1;
/// Corrections of one command.
const CORRECTIONS: usize = 3;
/// Steps count at which a surface acts at least by this part of its effect at the end: before, its deflection lags, and a
/// correction there would be a kick.
const ACTS: f64 = 0.6;

/// What limited a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limit {
    /// Load factor.
    Load,
    /// Angle of attack.
    Incidence,
    /// Pitch.
    Pitch,
    /// Bank.
    Bank,
    /// Sideslip.
    Sideslip,
    /// Nothing: the model has not predicted what happened, so nothing is limited by it.
    Distrust,
}

/// What the filter made of a command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filtered {
    /// The command to be flown.
    pub command: Command,
    /// What has limited it.
    pub by: Option<Limit>,
}

/// What is held against limits at a step.
#[derive(Clone, Copy, Debug, Default)]
struct Point {
    load: f64,
    alpha: f64,
    pitch: f64,
    bank: f64,
    sideslip: f64,
}

type Path = [Point; HORIZON];

/// The filter of one aircraft. It takes no memory after it is built.
#[derive(Clone, Debug)]
pub struct EnvelopeFilter {
    model: GreyBox,
    bounds: Bounds,
    disturbance: Disturbance,
}

/// The surface that acts on a limit.
#[derive(Clone, Copy)]
enum Surface {
    Elevator,
    Aileron,
}

impl EnvelopeFilter {
    /// The filter of the aircraft that `model` describes.
    pub fn new(model: &GreyBox) -> EnvelopeFilter {
        EnvelopeFilter {
            model: model.clone(),
            bounds: Bounds::of(&model.airframe),
            disturbance: Disturbance::new(TIME_CONSTANT_S),
        }
    }

    /// Keeps to another envelope from now on.
    pub fn keep_to(&mut self, envelope: &Envelope) {
        self.bounds = Bounds::new(envelope, &self.model.airframe.incidence);
    }

    /// Forgets what the model has left unexplained.
    pub fn reset(&mut self) {
        self.disturbance = Disturbance::new(TIME_CONSTANT_S);
    }

    /// `wanted`, as far as its predicted motion stays inside the envelope. To be called once a tick with what flies; a command
    /// that is not finite is left as it is.
    pub fn filter(&mut self, seen: &Observation, wanted: Command) -> Filtered {
        self.disturbance.update(&self.model, seen);
        if !wanted.is_finite() {
            return Filtered { command: wanted, by: None };
        }
        if self.disturbance.is_wrong(TRUST) {
            return Filtered { command: wanted, by: Some(Limit::Distrust) };
        }
        let bounds = self.bounds.within(PART);
        let lateral = [
            Aim { limit: Limit::Bank, bounds: [-bounds.bank, bounds.bank] },
            Aim { limit: Limit::Sideslip, bounds: [-bounds.sideslip, bounds.sideslip] },
        ];
        // the last aim has the last word: load factor and stall before attitude
        let longitudinal = [
            Aim { limit: Limit::Pitch, bounds: bounds.pitch },
            Aim { limit: Limit::Incidence, bounds: bounds.alpha },
            Aim { limit: Limit::Load, bounds: bounds.load },
        ];
        let mut out = Filtered { command: wanted.clamped(), by: None };
        let mut path = self.predict(seen, &out.command);
        for aim in lateral {
            self.bring(seen, &mut out, &mut path, aim, Surface::Aileron);
        }
        for aim in longitudinal {
            self.bring(seen, &mut out, &mut path, aim, Surface::Elevator);
        }
        out
    }

    /// Moves one surface of the command until its prediction, `path`, keeps to one limit.
    fn bring(
        &self,
        seen: &Observation,
        out: &mut Filtered,
        path: &mut Path,
        aim: Aim,
        surface: Surface,
    ) {
        for _ in 0..CORRECTIONS {
            let Some(side) = aim.passed(path) else { return };
            let now = surface.of(&out.command);
            let probe = if now > 0.0 { now - PROBE } else { now + PROBE };
            let probed = self.predict(seen, &surface.moved(&out.command, probe));
            let Some(change) = aim.change(path, &probed, side, probe - now) else { return };
            let reach = self.bounds.slew * STEP;
            let before = surface.of(&seen.previous[0]);
            let next = (now + change).clamp(-1.0, 1.0).clamp(before - reach, before + reach);
            out.by = Some(aim.limit);
            if next == now {
                return;
            }
            out.command = surface.moved(&out.command, next);
            *path = self.predict(seen, &out.command);
        }
    }

    /// What the model makes of a command that is held.
    fn predict(&self, seen: &Observation, command: &Command) -> Path {
        let figures = &self.model.airframe.actuators;
        let mut actuators = Actuators::from_observed(&seen.actuators, &seen.previous, figures);
        let mut inputs = self.model.at_rest(&actuators.controls());
        let mut memory = self.disturbance.memory();
        let rate = self.disturbance.rate();
        let reach = self.bounds.slew * STEP;
        let (mut state, mut held) = (seen.state, seen.previous[0]);
        let mut path = [Point::default(); HORIZON];
        for point in &mut path {
            let controls = self.model.act(&actuators.controls(), &mut inputs);
            let next = self.model.step(&state, &controls, seen.altitude, &mut memory);
            let next = next.advance(&rate, STEP);
            *point = Point::of(&state, &next);
            held.aileron += (command.aileron - held.aileron).clamp(-reach, reach);
            held.elevator += (command.elevator - held.elevator).clamp(-reach, reach);
            (held.throttle, held.rudder) = (command.throttle, command.rudder);
            actuators.step(&held, figures);
            state = next;
        }
        path
    }
}

impl Surface {
    fn of(self, command: &Command) -> f64 {
        match self {
            Surface::Elevator => command.elevator,
            Surface::Aileron => command.aileron,
        }
    }

    fn moved(self, command: &Command, to: f64) -> Command {
        match self {
            Surface::Elevator => Command { elevator: to, ..*command },
            Surface::Aileron => Command { aileron: to, ..*command },
        }
    }
}

/// A limit to keep to.
#[derive(Clone, Copy)]
struct Aim {
    limit: Limit,
    bounds: [f64; 2],
}

impl Aim {
    fn of(&self, point: &Point) -> f64 {
        match self.limit {
            Limit::Load | Limit::Distrust => point.load,
            Limit::Incidence => point.alpha,
            Limit::Pitch => point.pitch,
            Limit::Bank => point.bank,
            Limit::Sideslip => point.sideslip,
        }
    }

    /// The bound that is passed, if any: 0 the lower, 1 the upper.
    fn passed(&self, path: &Path) -> Option<usize> {
        let [low, high] = self.bounds;
        if path.iter().any(|point| self.of(point) > high) {
            return Some(1);
        }
        path.iter().any(|point| self.of(point) < low).then_some(0)
    }

    /// The change of the surface that brings the path to the bound at every step where the surface acts; `None` if it does not.
    fn change(&self, path: &Path, probed: &Path, side: usize, by: f64) -> Option<f64> {
        let slope = |k: usize| (self.of(&probed[k]) - self.of(&path[k])) / by;
        let last = slope(HORIZON - 1);
        if !last.is_finite() || last.abs() < 1e-9 {
            return None;
        }
        let acts = |k: &usize| slope(*k) * last > ACTS * last * last;
        let needed = |k: usize| (self.bounds[side] - self.of(&path[k])) / slope(k);
        // on the upper side a negative change of the quantity is wanted: the largest in that direction
        let towards = if side == 1 { -last.signum() } else { last.signum() };
        let most = (0..HORIZON).filter(acts).map(|k| needed(k) * towards).fold(0.0, f64::max);
        (most > 0.0).then_some(most * towards)
    }
}

impl Point {
    fn of(state: &State, next: &State) -> Point {
        Point {
            load: load_factor(state, next),
            alpha: next.alpha,
            pitch: next.pitch,
            bank: next.roll,
            sideslip: next.beta,
        }
    }
}
