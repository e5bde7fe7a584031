//! The target of a tick (roll, pitch and airspeed to be flown) before the envelope limits it. It comes from the flight-test
//! schedule or from the setpoint or sticks of a client (a ground station or an offboard program), else it is level flight.

use super::{Pilot, ThrustSource, due};
use greylag_control::Target;
use greylag_link::autopilot::{Mode, Severity};
use greylag_physics::Time;

/// Difference (rad) between the commanded angle and the angle within the envelope above which the limitation is reported.
const REPORTED_CUT: f64 = 0.5 * std::f64::consts::PI / 180.0;

impl Pilot {
    /// The target of the flight-test schedule at `now`, without a throttle: the controller sets the throttle. `None` if there is
    /// no schedule, or if the mode is not OFFBOARD or no client has sent a setpoint. In these cases the schedule returns to its
    /// start.
    pub(super) fn scheduled_wish(&mut self, now: Time) -> Option<(Target, Option<f64>)> {
        let programme = self.programme.as_mut()?;
        if self.mode == Mode::Offboard && self.setpoint.is_some() {
            return Some((programme.wish(now, &mut self.texts), None));
        }
        programme.stop();
        None
    }

    /// The target of the present mode before envelope limits. The second value is the throttle (0..1) if the client sets it.
    pub(super) fn wish(&self) -> (Target, Option<f64>) {
        let airspeed = self.config.envelope.airspeed_cruise_mps;
        match (self.mode, self.setpoint, self.sticks) {
            (Mode::Offboard, Some((_, s)), _) => {
                let throttle =
                    s.thrust.filter(|_| self.config.thrust_source == ThrustSource::Setpoint);
                (Target { roll: s.roll, pitch: s.pitch, airspeed }, throttle)
            }
            (Mode::Stabilized, _, Some((_, s))) => {
                // a positive value is a stick pushed forward and lowers the nose; full travel is the pitch limit on that side
                let pitch = if s.pitch > 0.0 {
                    s.pitch * self.limits.pitch_min
                } else {
                    -s.pitch * self.limits.pitch_max
                };
                (Target { roll: s.roll * self.limits.bank_max, pitch, airspeed }, Some(s.throttle))
            }
            _ => (self.level_target(), None),
        }
    }

    /// Reports that the envelope limits the attitude setpoint `wish` in OFFBOARD: once per setpoint, and at most once in 5 s.
    pub(super) fn report_limits(&mut self, wish: &Target) {
        let cut = |wanted: f64, flown: f64| (wanted - flown).abs() > REPORTED_CUT;
        let (roll, pitch) = (cut(wish.roll, self.target.roll), cut(wish.pitch, self.target.pitch));
        if self.mode != Mode::Offboard || !(roll || pitch) {
            self.cut = None;
            return;
        }
        let asked = [wish.roll, wish.pitch];
        let known =
            |cut: [f64; 2]| cut.iter().zip(asked).all(|(a, b)| (a - b).abs() <= REPORTED_CUT);
        if self.cut.is_some_and(known) || !due(&mut self.complaints.limits, self.clock) {
            return;
        }
        self.cut = Some(asked);
        let said = |name: &str, wanted: f64, flown: f64| {
            format!("{name} {:.0} deg is flown as {:.0}", wanted.to_degrees(), flown.to_degrees())
        };
        let words: Vec<String> = [
            roll.then(|| said("roll", wish.roll, self.target.roll)),
            pitch.then(|| said("pitch", wish.pitch, self.target.pitch)),
        ]
        .into_iter()
        .flatten()
        .collect();
        self.texts
            .say(Severity::Warning, format!("setpoint beyond the limits: {}", words.join(", ")));
    }

    pub(super) fn level_target(&self) -> Target {
        let airspeed = self.config.envelope.airspeed_cruise_mps;
        Target { roll: 0.0, pitch: self.config.trim_at(airspeed).pitch_deg.to_radians(), airspeed }
    }
}
