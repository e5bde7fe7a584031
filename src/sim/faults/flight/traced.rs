//! Records the quantities of a simulated flight with faults at each step. From these samples the flight rules are evaluated.

use super::Flight;
use crate::faults::mix::{Fault, FaultKind};
use crate::faults::policies::{Sample, Shown};
use greylag_flight::pilot::{Decision, Source, TICK_S};
use greylag_link::autopilot::{Autopilot, Mode, Status};
use greylag_link::vehicle::Vehicle;

/// Time constant of the high-pass filter of a surface command, s. `MEAN_S` is the averaging time of the square of the filtered
/// command, s.
const SLOW_S: f64 = 0.5;
const MEAN_S: f64 = 1.0;
/// A commanded roll or pitch that changes by at least this much is a new commanded attitude, rad.
const SAME: f64 = 1e-3;

/// The state that is kept from step to step for the samples. [`Sample`] explains the quantities.
#[derive(Clone, Debug, Default)]
pub(super) struct Follower {
    /// Whether a client has requested the companion to fly and no other pilot has taken control since then.
    pub(super) asked: bool,
    decision: Option<Decision>,
    fresh: bool,
    age_s: f64,
    held_s: f64,
    moved: f64,
    heard_s: f64,
    client_heard_s: f64,
    steady_s: f64,
    target: [f64; 2],
    lines: usize,
    start_m: Option<f64>,
    surfaces: [Fast; 2],
}

/// High-pass filter of a surface command (−1..1), with the mean square of the filtered command.
#[derive(Clone, Copy, Debug, Default)]
struct Fast {
    slow: f64,
    mean_square: f64,
}

impl Fast {
    fn update(&mut self, x: f64) {
        self.slow += TICK_S / SLOW_S * (x - self.slow);
        let fast = x - self.slow;
        self.mean_square += TICK_S / MEAN_S * (fast * fast - self.mean_square);
    }
}

impl Follower {
    pub(super) fn heard(&mut self, now_s: f64, something: bool) {
        if something {
            self.heard_s = now_s;
        }
    }

    pub(super) fn client_heard(&mut self, now_s: f64) {
        self.client_heard_s = now_s;
    }

    pub(super) fn decided(&mut self, decision: &Decision) {
        if let Some(last) = self.decision.filter(|last| last.armed && decision.armed) {
            let (c, l) = (decision.command, last.command);
            let step = (c.aileron - l.aileron).abs().max((c.elevator - l.elevator).abs());
            self.moved = self.moved.max(step);
        }
        let since = self.decision.map_or(0.0, |last| decision.time.since(last.time).as_secs_f64());
        self.held_s = if decision.source == Source::Held { self.held_s + since } else { 0.0 };
        (self.decision, self.fresh) = (Some(*decision), true);
    }

    /// Resets the quantities that belong to the companion's process, after a fault killed it. The process that replaces it has
    /// made no decision yet, and no client has requested it to fly.
    pub(super) fn died(&mut self) {
        (self.decision, self.fresh, self.asked) = (None, false, false);
        (self.held_s, self.moved) = (0.0, 0.0);
    }

    /// Updates the time for which the companion has held the same commanded attitude. If `flown` is false, the time starts anew.
    fn steady(&mut self, flown: bool) {
        let target = self.decision.map_or([0.0; 2], |d| [d.target.roll, d.target.pitch]);
        let same = target.iter().zip(self.target).all(|(a, b)| (a - b).abs() < SAME);
        self.steady_s = if flown && same { self.steady_s + TICK_S } else { 0.0 };
        self.target = target;
    }
}

impl Flight {
    /// Stores the sample of the step at `now_s` (s), if samples are requested. `acting` are the faults that act in this step.
    pub(super) fn sample(&mut self, now_s: f64, acting: &[Fault]) {
        let Some(trace) = &mut self.trace else { return };
        let Status { mode, armed, failsafe, .. } = self.desk.pilot().status();
        let shown = (!self.killed).then_some(Shown { mode, armed, failsafe });
        let truth = self.aircraft.truth();
        let follower = &mut self.follower;
        let (steered, exposed) = (self.aircraft.is_steered(), self.judge.is_exposed());
        let (engaged, confirmed) = match self.desk.vehicle() {
            Vehicle::Real(session) => (session.is_engaged(), session.flies()),
            Vehicle::Sitl(_) => {
                let armed = follower.decision.is_some_and(|d| d.armed);
                (armed, armed)
            }
        };
        let controlled = |d: &Decision| {
            let by_attitude = matches!(d.source, Source::Planned | Source::Late | Source::Fallback);
            d.armed && d.mode == Mode::Offboard && by_attitude
        };
        let controlled = follower.decision.as_ref().is_some_and(controlled);
        let harmless = |f: &Fault| matches!(f.kind, FaultKind::Client | FaultKind::Disk);
        let disturbed = !acting.iter().all(harmless);
        let calm = self.scenario.turbulence == 0 && !exposed && !disturbed;
        follower.steady(steered && engaged && controlled && calm);
        follower.age_s =
            if std::mem::take(&mut follower.fresh) { 0.0 } else { follower.age_s + TICK_S };
        let inputs = self.aircraft.inputs();
        // if the companion commands attitudes, the surface commands are those of the flight controller and are not filtered
        let ours = steered && self.desk.vehicle().flies_surfaces();
        let [aileron, elevator] = &mut follower.surfaces;
        aileron.update(if ours { inputs.aileron } else { aileron.slow });
        elevator.update(if ours { inputs.elevator } else { elevator.slow });
        let mean_square = aileron.mean_square.max(elevator.mean_square);
        let config = self.desk.pilot().config();
        let start = *follower.start_m.get_or_insert(truth.altitude_m);
        trace.push(Sample {
            decision: follower.decision,
            age_s: follower.age_s,
            held_s: follower.held_s,
            moved: std::mem::take(&mut follower.moved),
            steered,
            engaged,
            confirmed,
            silent_s: now_s - follower.heard_s,
            client_silent_s: now_s - follower.client_heard_s,
            steady_s: follower.steady_s,
            attitude_deg: [truth.roll_rad, truth.pitch_rad].map(f64::to_degrees),
            airspeed_mps: truth.airspeed_mps,
            lost_m: start - truth.altitude_m,
            swing: mean_square.sqrt(),
            exposed,
            disturbed,
            spoke: self.texts.len() > std::mem::replace(&mut follower.lines, self.texts.len()),
            asked: follower.asked,
            envelope: config.envelope,
            offboard_loss_s: config.offboard_loss_s,
            altitude_m: truth.altitude_m,
            shown,
            controller: self.aircraft.mode(),
        });
    }
}
