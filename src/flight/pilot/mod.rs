//! The pilot turns telemetry, time and requests into one command per tick (control cycle of 10 ms).
//!
//! A tick uses no socket, clock, lock or `Result`. A recording can therefore be replayed: the same calls give the same
//! commands to the bit. [`Pilot`] describes the order of calls.
//!
//! ```text
//! planned command ─► fallback controller ─► command held 50 ms ─► wings level at trim constants
//!    late, or not finite         no usable state    no usable state for over 50 ms
//! ```

mod air_data;
mod command;
mod complaints;
mod config;
mod decision;
mod envelope;
mod estimate;
mod failsafe;
#[cfg(test)]
pub(crate) mod frames;
mod ground_velocity;
mod lift;
mod limits;
mod model_watch;
mod modes;
mod oscillation;
mod parameters;
mod polarity;
mod polarity_hold;
mod programme;
mod side_force;
mod telemetry;
mod texts;
mod wish;

pub use config::{Config, ConfigError, ThrustSource, TrimPoint};
pub use decision::{Decision, Plan, Request, Source};
pub use lift::LiftCurve;
pub use limits::{Limits, TICK_S};
pub use modes::mode_name;
pub use polarity::Answers;
pub use side_force::SideForce;

use crate::monitor::Monitor;
use complaints::{Complaints, due};
use estimate::{Estimate, Frame, RESTART, within};
use greylag_control::aircraft_estimate::AircraftEstimator;
use greylag_control::envelope::EnvelopeLimiter;
use greylag_control::{Controller, Observation, Overruled, Target};
use greylag_link::autopilot::{AttitudeSetpoint, Mode, Parameter, Severity, Sticks};
use greylag_link::vehicle::{Fault, Telemetry, Vehicle};
use greylag_manoeuvres::Schedule;
use greylag_physics::{Command, Time};
use oscillation::Oscillation;
use polarity::Check;
use programme::Programme;
use texts::Texts;

/// The pilot of one aircraft.
///
/// Kinds of methods:
///
/// - set-up before flight: [`Pilot::take_on`], [`Pilot::follow`], [`Pilot::protect_with`], [`Pilot::monitor_with`],
///   [`Pilot::estimate_with`];
/// - time: [`Pilot::advance`], about every 10 ms, with or without frames, and [`Pilot::excuse`] after a stall of this computer;
/// - tick: [`Pilot::observe`] with a state frame, then [`Pilot::decide`] with the plan for the request that `observe`
///   returned, once per frame and in this order; [`Pilot::monitor`] after the command is out;
/// - requests of clients (ground stations, offboard programs): the trait
///   [`Autopilot`](greylag_link::autopilot::Autopilot), between two ticks;
/// - vehicle: [`Pilot::engaged`] when a flight controller, not the simulator's MAVLink side, has given control authority.
///
/// All times are vehicle time and must not decrease. After a jump back by more than 1 s the pilot drops all earlier states.
pub struct Pilot {
    config: Config,
    limits: Limits,
    parameters: Vec<Parameter>,
    fallback: Box<dyn Controller>,
    estimate: Estimate,
    texts: Texts,
    /// Present vehicle time, which also advances between states.
    clock: Time,
    /// Vehicle time of the state to which the pilot responds.
    answering: Time,
    armed: bool,
    mode: Mode,
    setpoint: Option<(Time, AttitudeSetpoint)>,
    sticks: Option<(Time, Sticks)>,
    setpoint_lost: bool,
    vehicle_lost: bool,
    /// Whether a loss of the vehicle was reported, but not yet its recovery.
    loss_reported: bool,
    /// Vehicle time at which the vehicle link last recovered.
    vehicle_back: Option<Time>,
    /// Vehicle time since which airspeed and altitude are missing.
    air_late: Option<Time>,
    /// Roll and pitch (rad) of the last setpoint whose limitation by the envelope was reported.
    cut: Option<[f64; 2]>,
    /// The last command, after slew limits.
    in_force: Command,
    /// The command before the last command. Ticks with a repeated state do not count.
    before: Command,
    /// The command in force when the state last changed.
    last_moved: Command,
    source: Source,
    target: Target,
    pending: Pending,
    planner_engaged: bool,
    fallback_engaged: bool,
    complaints: Complaints,
    load: f64,
    programme: Option<Programme>,
    /// The polarity check of the surfaces, if enabled.
    check: Option<Check>,
    /// The guard against oscillations.
    oscillation: Oscillation,
    /// Whether a flight controller can take control back.
    hands_back: bool,
    /// Whether the companion sends attitude setpoints to a flight controller instead of surface commands.
    by_attitude: bool,
    /// Time of the last oscillation. The gain is reduced for a while after an oscillation.
    oscillated: Option<Time>,
    /// Time of the last update, and the controller's low-pass filtered commands at that time.
    mean: Option<(Time, Command)>,
    /// Whether the recovery from an upset is active.
    upset: bool,
    /// Fault found by the polarity check or the oscillation guard since arming; `None` without a fault.
    refused: Option<Fault>,
    /// The model monitor, if set.
    monitor: Option<Monitor>,
    /// The estimator of the aircraft's derivatives, if set.
    estimator: Option<AircraftEstimator>,
    /// The envelope limiter, if set.
    envelope: Option<EnvelopeLimiter>,
    /// The last command of a controller, if the envelope limiter changed it; otherwise `None`.
    overruled: Option<Overruled>,
}

/// Result of `observe`, on which `decide` acts.
#[expect(clippy::large_enum_variant, reason = "a box would allocate memory at every state")]
#[derive(Clone, Copy, Debug)]
enum Pending {
    Disarmed,
    Repeated,
    Unusable,
    Sticks(Sticks),
    Check { time: Time, airspeed: f64 },
    Fly { seen: Observation, throttle: Option<f64> },
}

impl Pilot {
    /// A pilot with the settings `config` and the fallback controller `fallback`. It starts disarmed and in HOLD.
    ///
    /// # Errors
    ///
    /// The error of [`Config::check`] if a setting is invalid.
    pub fn new(config: Config, fallback: Box<dyn Controller>) -> Result<Self, ConfigError> {
        config.check()?;
        let nobody = Target {
            roll: f64::NAN,
            pitch: f64::NAN,
            airspeed: config.envelope.airspeed_cruise_mps,
        };
        Ok(Pilot {
            limits: Limits::from(&config),
            parameters: parameters::table(&config),
            config,
            fallback,
            estimate: Estimate::default(),
            texts: Texts::default(),
            clock: Time::default(),
            answering: Time::default(),
            armed: false,
            mode: Mode::Hold,
            setpoint: None,
            sticks: None,
            setpoint_lost: false,
            vehicle_lost: false,
            loss_reported: false,
            vehicle_back: None,
            air_late: None,
            cut: None,
            in_force: Command::IDLE,
            before: Command::IDLE,
            last_moved: Command::IDLE,
            source: Source::Disarmed,
            target: nobody,
            pending: Pending::Disarmed,
            planner_engaged: false,
            fallback_engaged: false,
            complaints: Complaints::default(),
            load: 0.0,
            programme: None,
            check: None,
            oscillation: Oscillation::default(),
            hands_back: false,
            by_attitude: false,
            mean: None,
            oscillated: None,
            upset: false,
            refused: None,
            monitor: None,
            estimator: None,
            envelope: None,
            overruled: None,
        })
    }

    /// Flies `schedule` in OFFBOARD instead of the client's attitudes. The schedule starts at each entry into the mode.
    /// The client must still send setpoints. Otherwise the offboard timeout applies.
    pub fn follow(&mut self, schedule: Schedule) {
        self.programme = Some(Programme::new(schedule));
    }

    /// Configures the pilot for `vehicle`. If surface commands pass through a flight controller, the polarity check is
    /// enabled. If attitude setpoints are sent, the polarity check and the oscillation guard are off.
    pub fn take_on(&mut self, vehicle: &Vehicle) {
        self.by_attitude = !vehicle.flies_surfaces();
        if vehicle.has_channels() {
            self.check_signs();
        }
    }

    /// Enables the polarity check of the surfaces at every engagement. Control is returned to the flight controller if
    /// a sign is wrong or the loop oscillates persistently. The check needs the modelled responses in the settings.
    pub fn check_signs(&mut self) {
        self.hands_back = true;
        self.check = self.config.answers.clone().map(Check::new);
    }

    /// Registers that the flight controller has given control authority, and starts the polarity check.
    pub fn engaged(&mut self, now: Time) {
        self.advance(now);
        (self.oscillation, self.oscillated, self.mean) = (Oscillation::default(), None, None);
        if let Some(check) = &mut self.check {
            check.begin(self.in_force);
        }
    }

    /// Advances time to `now` and checks the timeouts. It must also be called while no frames arrive.
    pub fn advance(&mut self, now: Time) {
        if self.clock.since(now) > RESTART {
            self.restart();
        }
        self.clock = now;
        self.watch_vehicle();
        self.watch_client();
    }

    /// First phase of a tick: processes a state frame that arrived at `now`. Returns the request to a planner; `None`
    /// if no plan is needed.
    pub fn observe(&mut self, now: Time, frame: &Telemetry) -> Option<Request> {
        if self.estimate.restarted(frame) {
            self.restart();
        }
        self.advance(now);
        let quality = self.estimate.take(now, frame, &self.config);
        self.report_air_data();
        self.excuse_stillness(quality, now);
        self.answering = frame.time;
        self.watch_return();
        self.pending = self.assess(quality);
        match self.pending {
            Pending::Fly { seen, .. } => {
                let engage = !self.planner_engaged;
                self.planner_engaged = true;
                Some(Request {
                    observation: seen,
                    target: self.target,
                    overruled: self.overruled.filter(|_| self.source == Source::Planned),
                    engage,
                })
            }
            Pending::Repeated => None,
            _ => {
                self.forget_controllers();
                None
            }
        }
    }

    /// Second phase of a tick: the decision for the frame last observed.
    pub fn decide(&mut self, plan: Plan) -> Decision {
        let (wanted, source) = match self.pending {
            Pending::Disarmed => (Command::IDLE, Source::Disarmed),
            Pending::Repeated => (self.in_force, self.source),
            Pending::Unusable => self.without_state(),
            Pending::Sticks(s) => (
                Command { aileron: s.roll, elevator: s.pitch, throttle: s.throttle, rudder: 0.0 },
                Source::Sticks,
            ),
            Pending::Check { time, airspeed } => {
                (self.check_command(time, airspeed), Source::Check)
            }
            Pending::Fly { seen, throttle } => self.with_state(plan, &seen, throttle),
        };
        self.source = source;
        if !matches!(self.pending, Pending::Repeated) {
            self.before = self.in_force;
        }
        self.in_force =
            if self.armed { self.limits.slew(self.in_force, wanted) } else { Command::IDLE };
        self.guard();
        if let (Pending::Check { time, .. }, Some(check)) = (self.pending, &mut self.check) {
            check.commanded(time, self.in_force);
        }
        self.decision()
    }

    /// Stores the recent processing time of the control task as a fraction of its cycle, 0..1, for the status.
    pub fn note_load(&mut self, load: f64) {
        self.load = load;
    }

    /// Sends a text of another part of the program to the ground stations.
    pub fn send_text(&mut self, severity: Severity, words: &str) {
        self.texts.say(severity, words);
    }

    /// The present settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    fn configure(&mut self, config: Config) {
        self.limits = Limits::from(&config);
        self.envelope.iter_mut().for_each(|limiter| limiter.keep_to(&config.envelope));
        self.parameters = parameters::table(&config);
        self.config = config;
    }

    fn failsafe(&self) -> bool {
        self.armed && (self.setpoint_lost || self.vehicle_lost)
    }

    /// Disengages planner and fallback. Each is reset at its next engagement.
    fn forget_controllers(&mut self) {
        self.planner_engaged = false;
        self.fallback_engaged = false;
        self.overruled = None;
    }

    fn assess(&mut self, quality: Frame) -> Pending {
        let nobody = Target {
            roll: f64::NAN,
            pitch: f64::NAN,
            airspeed: self.config.envelope.airspeed_cruise_mps,
        };
        if quality == Frame::Repeated {
            return if self.armed { Pending::Repeated } else { Pending::Disarmed };
        }
        match quality {
            Frame::Defective(reason) => self.complain_of_state(reason),
            _ => self.air_late = None,
        }
        self.target = nobody;
        if !self.armed {
            return Pending::Disarmed;
        }
        if let Some(pending) = self.check_polarity(quality) {
            return pending;
        }
        if let (Mode::Manual, Some((_, sticks))) = (self.mode, self.sticks) {
            return Pending::Sticks(sticks);
        }
        let usable = matches!(quality, Frame::Usable | Frame::Frozen) && !self.vehicle_lost;
        let Some(frame) = self.estimate.for_control().filter(|_| usable) else {
            self.target = self.level_target();
            return Pending::Unusable;
        };
        let (wish, throttle) = self.scheduled_wish(frame.time).unwrap_or_else(|| self.wish());
        self.target = self.limits.limit(wish, frame.state.airspeed);
        self.report_limits(&wish);
        let Telemetry { time, mut state, incidence_sd, actuators, altitude, .. } = frame;
        // Sensor noise makes an airspeed near zero negative at times.
        state.airspeed = state.airspeed.max(0.0);
        Pending::Fly {
            seen: Observation {
                time,
                state,
                incidence_sd,
                actuators,
                altitude,
                previous: [self.in_force, self.before],
            },
            throttle,
        }
    }
}
