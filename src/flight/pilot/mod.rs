//! The pilot: from telemetry, time, requests to one command a tick.
//!
//! No socket, clock, lock or `Result` inside a tick, so that a recording is an input: the same
//! calls give the same commands to the bit. A tick has two phases, so that a planner can run
//! between them: [`Pilot::observe`] says what is wanted, [`Pilot::decide`] what shall be done.
//!
//! ```text
//! planned command ─► fallback controller ─► command held 50 ms ─► wings level at trim constants
//!    late, or not finite         no usable state         still none
//! ```

mod command;
mod complaints;
mod config;
mod decision;
mod envelope;
mod estimate;
mod failsafe;
mod limits;
mod model_watch;
mod modes;
mod oscillation;
mod parameters;
mod polarity;
mod polarity_hold;
mod programme;
mod telemetry;
mod texts;
mod wish;

pub use config::{Config, ConfigError, ThrustSource, TrimPoint};
pub use decision::{Decision, Plan, Request, Source};
pub use limits::{Limits, TICK_S};
pub use modes::mode_name;
pub use polarity::Answers;

use crate::monitor::Monitor;
use complaints::{Complaints, due};
use estimate::{Estimate, Frame, RESTART, within};
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

/// A loop that swings again within this time does not only swing for once, s.
const SWINGS_AGAIN_S: f64 = 20.0;

/// The pilot of one aircraft.
pub struct Pilot {
    config: Config,
    limits: Limits,
    parameters: Vec<Parameter>,
    fallback: Box<dyn Controller>,
    estimate: Estimate,
    texts: Texts,
    /// The vehicle's time now, also while no states come.
    clock: Time,
    /// Time of the state that is being answered.
    answering: Time,
    armed: bool,
    mode: Mode,
    setpoint: Option<(Time, AttitudeSetpoint)>,
    sticks: Option<(Time, Sticks)>,
    setpoint_lost: bool,
    vehicle_lost: bool,
    /// Whether a loss was said of which the end was not.
    loss_told: bool,
    /// When the vehicle last came back from a loss.
    vehicle_back: Option<Time>,
    /// Since when airspeed and altitude are late.
    air_late: Option<Time>,
    /// The setpoint of which it was said that the limits cut it: roll and pitch, rad.
    cut: Option<[f64; 2]>,
    /// The command in force.
    in_force: Command,
    /// The command that was in force before it; repeated states do not count.
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
    /// The check of the surfaces' signs, where there is one.
    check: Option<Check>,
    /// The guard against oscillations.
    oscillation: Oscillation,
    /// Whether there is a controller to give the aircraft to.
    hands_back: bool,
    /// Whether a controller flies attitudes by itself, so that our surfaces are not those that fly.
    by_attitude: bool,
    /// When the loop last swung: deflections are eased for a while after it.
    eased: Option<Time>,
    /// What the controller's deflections are on the average of the last half second, and until when.
    mean: Option<(Time, Command)>,
    /// Whether the aircraft is being rolled upright.
    upset: bool,
    /// What the sign check or the oscillation guard has found wrong since the aircraft was armed.
    refused: Option<Fault>,
    /// The model that says what it has not predicted, where there is one.
    monitor: Option<Monitor>,
    /// What keeps the commands inside the envelope, where there is a model to predict with.
    envelope: Option<EnvelopeLimiter>,
    /// The last command of a controller, where it was not flown as it was given.
    overruled: Option<Overruled>,
}

/// What `observe` found, for `decide`.
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
    /// A pilot, disarmed and in HOLD, that flies by `config` and falls back on `fallback`.
    ///
    /// # Errors
    /// What [`Config::check`] finds.
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
            loss_told: false,
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
            eased: None,
            upset: false,
            refused: None,
            monitor: None,
            envelope: None,
            overruled: None,
        })
    }

    /// Flies `schedule` in offboard in place of the client's attitudes, from each entry on. The client
    /// still has to send setpoints: without them offboard ends as it always does.
    pub fn follow(&mut self, schedule: Schedule) {
        self.programme = Some(Programme::new(schedule));
    }

    /// Prepares for `vehicle`: where a controller moves the surfaces for us, their signs are checked; where it flies attitudes by
    /// itself, our surfaces do not fly, and nothing is said of them.
    pub fn take_on(&mut self, vehicle: &Vehicle) {
        self.by_attitude = !vehicle.flies_surfaces();
        if vehicle.has_channels() {
            self.check_signs();
        }
    }

    /// Checks the surfaces' signs from now on, whenever control authority is taken, and gives the aircraft back when they are
    /// wrong or the loop oscillates: for a vehicle whose controller moves the surfaces for us. Without the model's answers
    /// in the settings no signs can be checked.
    pub fn check_signs(&mut self) {
        self.hands_back = true;
        self.check = self.config.answers.clone().map(Check::new);
    }

    /// The vehicle's controller has given us control authority, if it is one to give it.
    pub fn engaged(&mut self, now: Time) {
        self.advance(now);
        (self.oscillation, self.eased, self.mean) = (Oscillation::default(), None, None);
        if let Some(check) = &mut self.check {
            check.begin(self.in_force);
        }
    }

    /// Lets time pass to `now`: finds lost setpoints, lost sticks, a lost vehicle. To be called
    /// also while no frames come. A clock that jumps back is a vehicle that has restarted.
    pub fn advance(&mut self, now: Time) {
        if self.clock.since(now) > RESTART {
            self.restart();
        }
        self.clock = now;
        self.watch_vehicle();
        self.watch_client();
    }

    /// First phase of a tick: takes in a state frame that came at `now`, and says what a planner
    /// should plan, if anything.
    pub fn observe(&mut self, now: Time, frame: &Telemetry) -> Option<Request> {
        if self.estimate.restarted(frame) {
            self.restart();
        }
        self.advance(now);
        let quality = self.estimate.take(now, frame);
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

    /// Second phase of a tick: the answer to the frame last observed.
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

    /// Looks for an oscillation in what was flown on: deflections are eased for a while. If the loop swings again soon and there
    /// is a controller, it gets the aircraft back.
    fn guard(&mut self) {
        let Pending::Fly { seen, .. } = &self.pending else { return };
        if self.by_attitude {
            return;
        }
        let (time, step) = (seen.time, self.limits.surface_step);
        let found = self.oscillation.see(time, &seen.state, &self.before, &self.in_force, step);
        let Some((axis, lasted_s)) = found else { return };
        self.oscillation = Oscillation::default();
        if self.hands_back && within(self.eased, time, SWINGS_AGAIN_S) {
            self.refused = Some(Fault::Oscillation(axis));
        } else {
            self.ease(axis, lasted_s, time);
        }
    }

    /// Notes which share of the cycle the control task needed lately, 0..1, for the status.
    pub fn note_load(&mut self, load: f64) {
        self.load = load;
    }

    /// Passes on a line from outside to the ground stations.
    pub fn tell(&mut self, severity: Severity, words: &str) {
        self.texts.say(severity, words);
    }

    /// The settings in force.
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

    fn decision(&self) -> Decision {
        Decision {
            time: self.answering,
            command: self.in_force,
            source: self.source,
            armed: self.armed,
            mode: self.mode,
            target: self.target,
            failsafe: self.failsafe(),
            refused: self.refused,
        }
    }

    /// Whoever flies next starts afresh from the command in force.
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
        let Some(frame) = self.estimate.last().copied().filter(|_| usable) else {
            self.target = self.level_target();
            return Pending::Unusable;
        };
        let (wish, throttle) = self.scheduled_wish(frame.time).unwrap_or_else(|| self.wish());
        self.target = self.limits.limit(wish, frame.state.airspeed);
        self.tell_of_limits(&wish);
        let Telemetry { time, mut state, actuators, altitude, .. } = frame;
        // Noise of a sensor at rest.
        state.airspeed = state.airspeed.max(0.0);
        Pending::Fly {
            seen: Observation {
                time,
                state,
                actuators,
                altitude,
                previous: [self.in_force, self.before],
            },
            throttle,
        }
    }
}
