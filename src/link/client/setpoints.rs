//! Setpoints from clients (ground stations and offboard programs). They are accepted, refused if they are invalid, or ignored if
//! another client is in control.

use super::{Clients, Now};
use crate::autopilot::{AttitudeSetpoint, Autopilot, Sticks};
use crate::wire::setpoint::SetpointFault;

/// Text that refuses setpoints of position, velocity or raw actuators.
pub const OTHER_SETPOINT: &str = "Setpoint refused: only attitudes (SET_ATTITUDE_TARGET) are flown";

fn refusal(fault: SetpointFault) -> &'static str {
    match fault {
        SetpointFault::NotFinite => "Setpoint refused: a number is NaN, infinite or absurd",
        SetpointFault::NoAttitude => "Setpoint refused: the quaternion is zero",
        SetpointFault::AttitudeMasked => {
            "Setpoint refused: it has no attitude, rates are not flown"
        }
    }
}

impl Clients {
    /// Passes an attitude setpoint to the autopilot. A refused setpoint does not reach the autopilot and does not
    /// restart the offboard timeout.
    pub(super) fn attitude(
        &mut self,
        now: Now,
        at: usize,
        setpoint: Result<AttitudeSetpoint, SetpointFault>,
        autopilot: &mut dyn Autopilot,
    ) {
        match setpoint {
            Err(fault) => self.refuse_setpoint(now, at, refusal(fault)),
            Ok(setpoint) if self.setpoint_authority.takes(self.sessions[at].peer, now.host) => {
                autopilot.attitude_setpoint(now.vehicle, setpoint);
            }
            Ok(_) => self.contested(now, at),
        }
    }

    pub(super) fn sticks(
        &mut self,
        now: Now,
        at: usize,
        sticks: Option<Sticks>,
        autopilot: &mut dyn Autopilot,
    ) {
        match sticks {
            None => self.counts.refused_setpoints += 1,
            Some(sticks) if self.stick_authority.takes(self.sessions[at].peer, now.host) => {
                autopilot.sticks(now.vehicle, sticks);
            }
            Some(_) => self.contested(now, at),
        }
    }

    pub(super) fn refuse_setpoint(&mut self, now: Now, at: usize, words: &str) {
        self.counts.refused_setpoints += 1;
        self.complain(now, at, words);
    }

    fn contested(&mut self, now: Now, at: usize) {
        self.counts.contested_setpoints += 1;
        self.complain(now, at, "Setpoint ignored: another client is sending them");
    }
}
