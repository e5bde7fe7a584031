//! Requests of clients (ground stations and offboard programs) to the pilot (the companion's flight logic): arming, modes,
//! setpoints and parameters.

use super::estimate::within;
use super::{Pilot, Source, parameters};
use greylag_link::autopilot::{
    AttitudeSetpoint, Autopilot, Mode, Parameter, ParameterValue, Severity, Status, Sticks, Text,
    Verdict,
};
use greylag_physics::{ActuatorState, Command, Time};

/// Name of a mode, as ground stations show it.
pub fn mode_name(mode: Mode) -> &'static str {
    match mode {
        Mode::Manual => "MANUAL",
        Mode::Hold => "HOLD",
        Mode::Return => "RTL",
        Mode::Offboard => "OFFBOARD",
        Mode::Stabilized => "STABILIZED",
    }
}

fn rejected(words: impl Into<String>) -> Verdict {
    Verdict::Rejected(words.into())
}

impl Pilot {
    /// Reason for which arming is refused; `None` if arming is allowed.
    fn arming_obstacle(&self) -> Option<String> {
        if !self.vehicle_alive() {
            return Some("no fresh state from the vehicle".into());
        }
        let state = self.estimate.last().map(|t| t.state)?;
        let tilt = self.config.arm_tilt_max_deg.to_radians();
        if state.roll.abs() > tilt || state.pitch.abs() > tilt {
            return Some(format!("tilted beyond {:.0} degrees", self.config.arm_tilt_max_deg));
        }
        if state.airspeed > self.config.envelope.airspeed_max_mps {
            return Some(format!("airspeed {:.1} m/s is above the maximum", state.airspeed));
        }
        if matches!(self.mode, Mode::Manual | Mode::Stabilized) && !self.sticks_fresh() {
            return Some(format!("{} without sticks: choose HOLD", mode_name(self.mode)));
        }
        None
    }

    /// Reason for which `mode` is refused; `None` if it is allowed.
    fn mode_obstacle(&self, mode: Mode) -> Option<String> {
        match mode {
            Mode::Offboard if !self.armed => Some("OFFBOARD refused: arm first".into()),
            Mode::Offboard if !self.vehicle_alive() => {
                Some("OFFBOARD refused: no fresh vehicle state".into())
            }
            Mode::Offboard if !self.setpoint_fresh() => {
                Some("OFFBOARD refused: send setpoints first".into())
            }
            Mode::Manual | Mode::Stabilized if self.armed && !self.sticks_fresh() => {
                Some(format!("{} refused: no sticks", mode_name(mode)))
            }
            _ => None,
        }
    }

    pub(super) fn setpoint_fresh(&self) -> bool {
        within(self.setpoint.map(|(at, _)| at), self.clock, self.config.offboard_loss_s)
    }

    pub(super) fn sticks_fresh(&self) -> bool {
        within(self.sticks.map(|(at, _)| at), self.clock, self.config.offboard_loss_s)
    }

    pub(super) fn vehicle_alive(&self) -> bool {
        !self.vehicle_lost && self.state_fresh() == Some(true)
    }

    fn airspeed(&self) -> f64 {
        self.estimate.last().map_or(f64::NAN, |t| t.state.airspeed)
    }
}

impl Autopilot for Pilot {
    fn arm(&mut self, now: Time, force: bool) -> Verdict {
        self.advance(now);
        if self.armed {
            return Verdict::Accepted;
        }
        if let Some(obstacle) = self.arming_obstacle().filter(|_| !force) {
            return rejected(format!("arming refused: {obstacle}"));
        }
        self.armed = true;
        self.setpoint_lost = false;
        self.forget_controllers();
        self.refused = None;
        if let Some(check) = &mut self.check {
            check.await_authority();
        }
        // the measured state of an aircraft at rest may stay constant, so an unchanged state counts as fresh at the time of
        // arming
        self.estimate.refresh(now);
        self.texts.say(Severity::Notice, format!("armed, {}", mode_name(self.mode)));
        Verdict::Accepted
    }

    fn disarm(&mut self, now: Time, force: bool) -> Verdict {
        self.advance(now);
        let airspeed = self.airspeed();
        let landed = airspeed <= self.config.disarm_airspeed_max_mps;
        if self.armed && !force && !landed {
            return rejected(match airspeed.is_nan() {
                true => {
                    "disarming refused: airspeed unknown, so it may be flying: force it".to_owned()
                }
                false => format!("disarming refused: flying at {airspeed:.1} m/s"),
            });
        }
        if self.armed {
            self.texts.say(Severity::Notice, "disarmed");
        }
        self.armed = false;
        self.refused = None;
        if let Some(check) = &mut self.check {
            check.rest();
        }
        self.setpoint_lost = false;
        self.in_force = Command::IDLE;
        if self.mode == Mode::Offboard {
            self.mode = Mode::Hold;
        }
        Verdict::Accepted
    }

    fn set_mode(&mut self, now: Time, mode: Mode) -> Verdict {
        self.advance(now);
        if mode == Mode::Return {
            return Verdict::Denied("RTL is not available: use HOLD".into());
        }
        if let Some(obstacle) = self.mode_obstacle(mode) {
            return rejected(obstacle);
        }
        self.setpoint_lost = false;
        if self.mode != mode {
            self.mode = mode;
            self.texts.say(Severity::Info, format!("mode {}", mode_name(mode)));
        }
        Verdict::Accepted
    }

    fn attitude_setpoint(&mut self, now: Time, setpoint: AttitudeSetpoint) {
        self.advance(now);
        // the pilot does not rely on the link to refuse setpoints that are not finite
        if setpoint.roll.is_finite() && setpoint.pitch.is_finite() {
            let thrust = setpoint.thrust.filter(|x| x.is_finite());
            self.setpoint = Some((now, AttitudeSetpoint { thrust, ..setpoint }));
        }
    }

    fn sticks(&mut self, now: Time, sticks: Sticks) {
        self.advance(now);
        if [sticks.roll, sticks.pitch, sticks.throttle].iter().all(|x| x.is_finite()) {
            let Sticks { roll, pitch, throttle } = sticks;
            let limited = Sticks {
                roll: roll.clamp(-1.0, 1.0),
                pitch: pitch.clamp(-1.0, 1.0),
                throttle: throttle.clamp(0.0, 1.0),
            };
            self.sticks = Some((now, limited));
        }
    }

    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn set_parameter(&mut self, index: usize, value: ParameterValue) -> Verdict {
        match parameters::changed(&self.config, index, value) {
            Ok(config) => {
                self.configure(config);
                Verdict::Accepted
            }
            Err(verdict) => verdict,
        }
    }

    fn status(&self) -> Status {
        let nan = f64::NAN;
        let seen = self.estimate.last();
        let target = match self.source {
            Source::Disarmed | Source::Sticks | Source::Check => [nan; 2],
            _ => [self.target.roll, self.target.pitch],
        };
        Status {
            mode: self.mode,
            armed: self.armed,
            failsafe: self.failsafe(),
            vehicle_alive: self.vehicle_alive(),
            attitude: seen.map_or([nan; 3], |t| [t.state.roll, t.state.pitch, t.yaw]),
            rates: seen.map_or([nan; 3], |t| [t.state.p, t.state.q, t.state.r]),
            airspeed: self.airspeed(),
            altitude: seen.map_or(nan, |t| t.altitude),
            position: seen.map_or([nan; 2], |t| t.position),
            velocity: seen.map_or([nan; 3], |t| t.velocity),
            target,
            command: self.in_force,
            actuators: seen.map_or_else(ActuatorState::default, |t| t.actuators),
            load: self.load,
            residuals: self.residual_shares(),
            derivatives: self.derivatives(),
        }
    }

    fn take_text(&mut self) -> Option<Text> {
        self.texts.take()
    }
}
