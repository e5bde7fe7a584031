//! The `px4` and `ardupilot` profiles: the vehicle is a real flight controller, whose decisions have priority.
//!
//! In this module "controller" means the flight controller, and "stack" its software, PX4 or ArduPilot. The controller flies
//! until a client (a ground station or an offboard program) requests that the companion flies (engagement). The companion then
//! commands the controller through the interface of its stack (see `profile`). At the first fault the companion returns control
//! authority.

pub mod air_data;
mod arduplane_lead;
mod assembly;
mod attitude_ramp;
mod attitude_trim;
mod delay;
mod duties;
mod engagement;
mod gusts;
mod hearing;
mod obstacle;
pub mod parameters;
pub mod profile;
mod pulse;
mod requests;
mod sticks;
pub mod survey;

use std::collections::VecDeque;
use std::time::Duration;

use super::{Demand, Notice, Outputs, VehicleCounts};
use crate::autopilot::Severity;
use crate::framing::{FrameCounts, Source, Version};
use crate::peer::PeerId;
use crate::wire::{Message, controller as wire};
use arduplane_lead::ArduplaneLead;
use assembly::Assembly;
use attitude_ramp::AttitudeRamp;
use attitude_trim::AttitudeTrim;
use engagement::Engagement;
use greylag_physics::{Command, Time};
use parameters::{Parameters, Standing};
use profile::{Authority, Profile, Stack};
use pulse::Pulse;
use requests::Requests;
use sticks::Sticks;
use survey::Survey;

/// Component id of the companion: MAV_COMP_ID_ONBOARD_COMPUTER.
pub const ONBOARD: u8 = 191;
/// Component id of the flight controller: MAV_COMP_ID_AUTOPILOT1.
const AUTOPILOT: u8 = 1;
/// Time without heartbeats after which a controller counts as disconnected.
const GONE: Duration = Duration::from_secs(3);
/// If the rate of a message stream is below this fraction of its nominal rate, the stream is requested again. If the stream is
/// needed for control, engagement is refused.
const ENOUGH: f64 = 0.8;

/// The connected controller.
#[derive(Clone, Copy, Debug)]
struct Controller {
    system: u8,
    peer: PeerId,
    autopilot: u8,
    armed: bool,
    /// Time of the last heartbeat, host clock.
    heard: Duration,
}

/// Connection to a real flight controller.
#[derive(Clone, Debug)]
pub struct Real {
    profile: Profile,
    controller: Option<Controller>,
    /// Unexpected senders on the link: other autopilots, and another companion with the ids of this companion. Each was reported
    /// once.
    intruders: Vec<Source>,
    /// Another component of the controller's system that sends heartbeats, such as a gimbal or a camera, and the time of its last
    /// heartbeat.
    sibling: Option<(Duration, Source)>,
    /// Host time of the last call of `due`.
    now: Duration,
    parameters: Parameters,
    survey: Survey,
    requests: Requests,
    /// Whether the controller has sent a frame with a MAVLink signature.
    signs: bool,
    /// Whether the controller receives an RC transmitter, from its last report without engagement; `None` before the first
    /// report.
    radio: Option<bool>,
    /// Delay margin of the companion's control loop if it commands the surfaces; `None` if unknown.
    bears: Option<Duration>,
    assembly: Assembly,
    engagement: Engagement,
    sticks: Sticks,
    ramp: AttitudeRamp,
    trim: AttitudeTrim,
    lead: ArduplaneLead,
    /// The last finite command that the companion demanded, −1..1 (throttle 0..1).
    sent: Command,
    /// Host time of the last state frame.
    last_state: Option<Duration>,
    pulse: Pulse,
    states: u64,
    notices: VecDeque<Notice>,
    sequence: u8,
    next_heartbeat: Duration,
    next_sync: Duration,
    counts: FrameCounts,
    foreign: u64,
    bad_commands: u64,
}

impl Real {
    /// A connection with `profile`, before any frame is received.
    pub fn new(profile: Profile) -> Self {
        Real {
            profile,
            controller: None,
            intruders: Vec::new(),
            sibling: None,
            now: Duration::ZERO,
            parameters: Parameters::new(profile.stack.rules(profile.authority)),
            survey: Survey::default(),
            requests: Requests::default(),
            signs: false,
            radio: None,
            bears: None,
            assembly: Assembly::new(profile.actuators),
            engagement: Engagement::new(profile.stack.lead()),
            sticks: Sticks::default(),
            ramp: AttitudeRamp::default(),
            trim: AttitudeTrim::default(),
            lead: ArduplaneLead::default(),
            sent: Command::IDLE,
            last_state: None,
            pulse: Pulse::default(),
            states: 0,
            notices: VecDeque::new(),
            sequence: 0,
            next_heartbeat: Duration::ZERO,
            next_sync: Duration::ZERO,
            counts: FrameCounts::default(),
            foreign: 0,
            bad_commands: 0,
        }
    }

    fn say(&mut self, severity: Severity, words: String) {
        // the queue stays bounded even if nobody fetches notices
        if self.notices.len() < 64 {
            self.notices.push_back(Notice::Text(severity, words));
        }
    }

    /// Begins to return control authority for `reason`. The end is reported when the controller's mode confirms it.
    fn hand_back(&mut self, reason: String) {
        self.engagement.hand_back();
        self.notices.push_back(Notice::Released(reason));
    }

    /// The encoded message that sends `demand` to the controller, in reply to the state with vehicle time `time`. Empty if no
    /// command is due. Begins engagement if the companion is armed, and returns control authority if `demand` has a fault.
    pub fn answer(&mut self, host: Duration, time: Time, demand: &Demand) -> Vec<u8> {
        let Outputs::Armed(command) = demand.outputs else {
            self.engagement.rest();
            self.ramp.rest();
            self.trim.rest();
            self.lead.rest();
            return Vec::new();
        };
        if let Some(fault) = demand.fault.filter(|_| self.engagement.steers()) {
            self.hand_back(fault.words(self.profile.stack));
        }
        if self.controller.is_some() && self.engagement.begin(host) {
            let warnings = self.radio_warning().into_iter().chain(self.delay_warning());
            warnings
                .collect::<Vec<_>>()
                .into_iter()
                .for_each(|words| self.say(Severity::Warning, words));
        }
        self.states += 1;
        if command.is_finite() {
            self.sent = command.clamped();
        } else {
            self.bad_commands += 1;
        }
        let every = self.profile.stack.frames_per_command(self.profile.authority);
        let attitude = match self.profile.authority {
            Authority::Attitude => self.commanded(time, demand.attitude),
            _ => demand.attitude,
        };
        let due = self.engagement.steers() && self.states.is_multiple_of(every);
        let Some(to) = self.target().filter(|_| due) else {
            return Vec::new();
        };
        let message = match (self.profile.authority, self.profile.stack) {
            (Authority::Surfaces, Stack::Px4) => {
                wire::manual_control(to, self.sticks.thousandths(&self.sent, &self.parameters))
            }
            (Authority::Surfaces, Stack::Ardupilot) => {
                wire::channels_override(to, self.sticks.pulses(&self.sent, &self.parameters))
            }
            (Authority::Attitude, _) => {
                let time_ms = (time.as_micros() / 1000) as u32;
                wire::attitude_target(to, time_ms, attitude, self.sent.throttle)
            }
        };
        self.write(&message)
    }

    /// The roll and pitch (rad) that are sent for the demanded ones, `wanted`: limited in rate, and with an integral correction
    /// while the controller executes them. ArduPlane also receives what its loops leave out.
    fn commanded(&mut self, time: Time, wanted: [f64; 2]) -> [f64; 2] {
        let seen = self.assembly.attitude();
        if !self.flies() {
            // until the controller executes attitude setpoints, the measured attitude is sent
            self.ramp.rest();
            self.trim.rest();
            self.lead.rest();
            return self.ramp.command(time, wanted, seen);
        }
        let on_the_way = self.ramp.command(time, wanted, seen);
        let trimmed = self.trim.command(time, on_the_way, seen);
        match self.profile.stack {
            Stack::Px4 => trimmed,
            Stack::Ardupilot => {
                let airspeed = self.assembly.last.state.airspeed;
                let added = self.lead.command(time, on_the_way, seen, airspeed);
                std::array::from_fn(|axis| trimmed[axis] + added[axis])
            }
        }
    }

    /// Removes and returns the oldest notice.
    pub fn take_notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }

    /// Whether the controller's mode confirms that it executes the companion's commands.
    pub fn flies(&self) -> bool {
        self.engagement.is_engaged()
    }

    /// Whether the companion has control authority or is requesting it.
    pub fn is_engaged(&self) -> bool {
        self.engagement.steers()
    }

    /// The controller's address on the link, see [`super::Vehicle::peer`]; `None` before the first heartbeat.
    pub fn peer(&self) -> Option<PeerId> {
        self.controller.map(|c| c.peer)
    }

    /// System id of the controller; `None` before the first heartbeat.
    pub fn system(&self) -> Option<u8> {
        self.controller.map(|c| c.system)
    }

    /// The controller's stack as the number MAV_AUTOPILOT, and whether it is armed; `None` before the first heartbeat.
    pub fn controller(&self) -> Option<(u8, bool)> {
        self.controller.map(|c| (c.autopilot, c.armed))
    }

    /// Statistics of the link.
    pub fn survey(&self) -> &Survey {
        &self.survey
    }

    /// For each checked parameter of the controller: its name, the result of the check, and a text.
    pub fn parameter_report(&self) -> Vec<(&'static str, Standing, String)> {
        self.parameters.report(self.system().unwrap_or(1), self.radio == Some(true))
    }

    /// The profile in use.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// Traffic counters, see [`super::Vehicle::counts`].
    pub fn counts(&self) -> VehicleCounts {
        VehicleCounts {
            frames: self.counts,
            foreign: self.foreign,
            bad_commands: self.bad_commands,
            ..self.assembly.counts
        }
    }

    fn target(&self) -> Option<Source> {
        self.controller.map(|c| Source { system: c.system, component: AUTOPILOT })
    }

    fn write(&mut self, message: &Message) -> Vec<u8> {
        // before the controller's first heartbeat its system id is assumed to be 1
        let source = Source { system: self.system().unwrap_or(1), component: ONBOARD };
        self.sequence = self.sequence.wrapping_add(1);
        message.encode(Version::V2, self.sequence, source).unwrap_or_default()
    }
}
