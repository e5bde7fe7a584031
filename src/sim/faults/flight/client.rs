//! What the simulated client and ground station send to the companion during a flight under faults. The companion is this
//! program's autopilot.

use std::time::Duration;

use super::Flight;
use crate::faults::mix::{Fault, FaultKind};
use crate::faults::scenario::{Asking, mode_of};
use greylag_link::autopilot::{AttitudeSetpoint, Autopilot, Mode, Verdict};

/// Number of steps of 0.01 s between two setpoints of the client, which sends them at 10 Hz.
const SETPOINT_EVERY: u64 = 10;

impl Flight {
    /// Performs the client's actions at the step `step`. The client makes the requests that are due, and arms when it can. At
    /// 10 Hz it sends the attitude setpoint of the present leg of the scenario. It does nothing during a fault of the client.
    pub(super) fn client(&mut self, step: u64, now_s: f64, host: Duration, acting: &[Fault]) {
        if acting.iter().any(|fault| fault.kind == FaultKind::Client) {
            return;
        }
        let now = self.desk.now(host);
        let due = self.scenario.asked.iter().filter(|a| at_step(a.at_s) == step);
        for what in due.map(|a| a.what).collect::<Vec<_>>() {
            self.ask(now_s, host, what);
        }
        if !step.is_multiple_of(SETPOINT_EVERY) {
            return;
        }
        let legs = &self.scenario.legs;
        let Some(leg) = legs.iter().rev().find(|leg| leg.from_s <= now_s).or(legs.first()).copied()
        else {
            return;
        };
        let [roll, pitch] = [leg.roll_deg, leg.pitch_deg].map(f64::to_radians);
        let setpoint = AttitudeSetpoint { roll, pitch, thrust: None };
        self.follower.client_heard(now_s);
        if !self.armed {
            self.armed = self.desk.arm(host) == Verdict::Accepted;
            if self.armed {
                self.follower.asked = true;
                self.desk.pilot().attitude_setpoint(now, setpoint);
                // the request is refused only if the link is lost at this moment, and the companion then flies HOLD
                let _ = self.desk.pilot().set_mode(now, Mode::Offboard);
            }
        }
        self.desk.pilot().attitude_setpoint(now, setpoint);
    }

    /// Passes a request other than a setpoint to the companion.
    fn ask(&mut self, now_s: f64, host: Duration, what: Asking) {
        let now = self.desk.now(host);
        let verdict = match (what, mode_of(what)) {
            (_, Some(mode)) => self.desk.pilot().set_mode(now, mode),
            (Asking::Arm, _) => self.desk.arm(host),
            (Asking::Disarm, _) => self.desk.pilot().disarm(now, false),
            _ => return,
        };
        let steers = matches!(what, Asking::Arm | Asking::Offboard);
        self.follower.asked |= steers && verdict == Verdict::Accepted;
        self.answers.push((now_s, what, verdict));
        self.hear_texts(now_s);
    }

    /// Applies the mode change by which a ground station takes control from the companion. The ground station sends it to the
    /// flight controller on a link of its own.
    pub(super) fn take_over(&mut self, step: u64) {
        let asked = &self.scenario.asked;
        let taken = asked.iter().any(|a| a.what == Asking::TakeOver && at_step(a.at_s) == step);
        // if the flight controller already flies by itself, the companion has no control to lose
        let steered = self.aircraft.is_steered();
        if taken && self.aircraft.take_over() && steered {
            self.follower.asked = false;
        }
    }
}

/// Number of the step of 0.01 s in which the time `at_s` (s) lies.
fn at_step(at_s: f64) -> u64 {
    // 0.29 s is step 29, although 100 · 0.29 is 28.999999999999996
    (100.0 * at_s + 1e-6) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_in_whole_steps_is_its_own_step() {
        for step in 0..6000 {
            assert_eq!(at_step(step as f64 / 100.0), step);
        }
        assert_eq!([0.29, 33.009_25].map(at_step), [29, 3300]);
    }
}
