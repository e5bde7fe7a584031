//! Selection of the pilot's command at each tick. The command is that of the controller (planned), that of the fallback
//! controller, the last command (held), or level trim, the command of trimmed flight with level wings.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};

use super::oscillation::Oscillation;
use super::{Pending, Pilot, Plan, Source, due, within};
use greylag_control::Observation;
use greylag_link::autopilot::Severity;
use greylag_link::vehicle::{Axis, Fault};
use greylag_physics::{Command, Time};

/// An oscillation counts as persistent if it recurs within this time, s.
const SWINGS_AGAIN_S: f64 = 20.0;
/// After an oscillation, the deviations of the surface commands from their running mean are multiplied by this factor. The
/// loop gain at the frequency of the oscillation falls to a third, and the delay margin grows about threefold.
const REDUCED_GAIN: f64 = 1.0 / 3.0;
/// Time constant of the running mean of the surface commands, s. A limit cycle of 1 to 8 Hz averages out. The constant
/// deflections of a turn remain.
const MEAN_S: f64 = 0.5;
/// Duration of the reduced gain after an oscillation, s.
const REDUCED_S: f64 = 5.0;
/// Bank above which the aircraft counts as upset, then bank below which it has recovered, rad. Near inverted flight, up
/// elevator lowers the nose, so the wings are levelled first. No envelope allows a bank of 90°.
const UPSET: [f64; 2] = [FRAC_PI_2, FRAC_PI_3];

impl Pilot {
    /// Reduces the gain for a while if the flown commands oscillate. If the oscillation recurs within 20 s and a flight
    /// controller can take over, control is returned to the flight controller.
    pub(super) fn guard(&mut self) {
        let Pending::Fly { seen, .. } = &self.pending else { return };
        if self.by_attitude {
            return;
        }
        let (time, step) = (seen.time, self.limits.surface_step);
        let found = self.oscillation.see(time, &seen.state, &self.before, &self.in_force, step);
        let Some((axis, lasted_s)) = found else { return };
        self.oscillation = Oscillation::default();
        if self.hands_back && within(self.oscillated, time, SWINGS_AGAIN_S) {
            self.refused = Some(Fault::Oscillation(axis));
        } else {
            self.reduce_gain(axis, lasted_s, time);
        }
    }

    /// Reduces the gain from `time` on. The loop about `axis` has oscillated for `lasted_s` seconds.
    fn reduce_gain(&mut self, axis: Axis, lasted_s: f64, time: Time) {
        self.oscillated = Some(time);
        let axis = match axis {
            Axis::Roll => "roll",
            Axis::Pitch => "pitch",
        };
        let words = format!(
            "oscillates in {axis} since {lasted_s:.1} s: a third of the deflections for the next {REDUCED_S} s"
        );
        self.texts.say(Severity::Error, words);
    }

    /// Returns `command`, or full aileron towards level wings while the aircraft is upset. `roll` is the bank, rad.
    fn upright(&mut self, command: Command, roll: f64) -> Command {
        if self.by_attitude {
            return command;
        }
        let [begins, ends] = UPSET;
        if self.upset {
            self.upset = roll.abs() > ends;
        } else if roll.abs() > begins {
            self.upset = true;
            let words = format!("bank {:.0} degrees: wings level first", roll.to_degrees());
            self.texts.say(Severity::Error, words);
        }
        if !self.upset {
            return command;
        }
        let level = self.level_command();
        Command { aileron: -roll.signum(), throttle: command.throttle, ..level }
    }

    /// `command` with the reduced gain, if it is active at `time`.
    fn with_reduced_gain(&mut self, command: Command, time: Time) -> Command {
        let (last, mean) = self.mean.get_or_insert((time, command));
        let passed = time.since(*last).as_secs_f64();
        *last = time;
        for (mean, wanted) in [
            (&mut mean.aileron, command.aileron),
            (&mut mean.elevator, command.elevator),
            (&mut mean.rudder, command.rudder),
        ] {
            *mean += (wanted - *mean) * (passed / MEAN_S).min(1.0);
        }
        if !within(self.oscillated, time, REDUCED_S) {
            return command;
        }
        let toward = |mean: f64, wanted: f64| mean + REDUCED_GAIN * (wanted - mean);
        Command {
            aileron: toward(mean.aileron, command.aileron),
            elevator: toward(mean.elevator, command.elevator),
            rudder: toward(mean.rudder, command.rudder),
            throttle: command.throttle,
        }
    }

    pub(super) fn with_state(
        &mut self,
        plan: Plan,
        seen: &Observation,
        throttle: Option<f64>,
    ) -> (Command, Source) {
        let (mut command, source) = match plan {
            Plan::Ready(command) if command.is_finite() => {
                self.fallback_engaged = false;
                (command, Source::Planned)
            }
            Plan::Ready(_) => {
                self.planner_engaged = false;
                if due(&mut self.complaints.plan, self.clock) {
                    self.texts
                        .say(Severity::Error, "controller gave no finite command: fallback flies");
                }
                self.fall_back(seen, Source::Fallback)
            }
            Plan::Late | Plan::Busy => self.fall_back(seen, Source::Late),
            Plan::None => {
                if !std::mem::replace(&mut self.complaints.ended, true) {
                    self.texts.say(Severity::Critical, "controller has ended: fallback flies on");
                }
                self.fall_back(seen, Source::Fallback)
            }
        };
        if let Some(programme) = &mut self.programme {
            command = programme.excite(command);
        }
        command = self.with_reduced_gain(command, seen.time);
        command = self.inside_envelope(command, seen);
        command = self.upright(command, seen.state.roll);
        command.throttle =
            self.limits.protect(throttle.unwrap_or(command.throttle), seen.state.airspeed);
        (command, source)
    }

    fn fall_back(&mut self, seen: &Observation, source: Source) -> (Command, Source) {
        if !self.fallback_engaged {
            self.fallback.reset(0);
            self.fallback_engaged = true;
        } else if let Some(by) = &self.overruled {
            self.fallback.overruled(by);
        }
        let command = self.fallback.command(seen, &self.target);
        if command.is_finite() {
            return (command, source);
        }
        self.fallback_engaged = false;
        if due(&mut self.complaints.fallback, self.clock) {
            self.texts.say(Severity::Critical, "fallback gave no finite command: level at trim");
        }
        (self.level_command(), Source::Level)
    }

    /// The command while the state is unusable: the last command for `state_hold_s` seconds, then level trim. If the vehicle is
    /// lost, it is level trim at once.
    pub(super) fn without_state(&self) -> (Command, Source) {
        let short = self.estimate.usable_within(self.clock, self.config.state_hold_s);
        if short && !self.vehicle_lost {
            (self.in_force, Source::Held)
        } else {
            (self.level_command(), Source::Level)
        }
    }

    fn level_command(&self) -> Command {
        let trim = self.config.trim_at(self.config.envelope.airspeed_cruise_mps);
        Command { elevator: trim.elevator, throttle: trim.throttle, ..Command::IDLE }
    }
}
