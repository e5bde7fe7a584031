//! The `px4` and `ardupilot` profiles: a real flight controller that has the last word.
//!
//! The controller flies until a client engages us; we steer through what its stack accepts from a
//! companion, and give it back at the first fault. What it accepts, stack by stack, stands in
//! `profile`.

pub mod air_data;
mod assembly;
mod attitude_trim;
mod engagement;
pub mod parameters;
pub mod profile;
mod pulse;
mod requests;
mod sticks;
pub mod survey;

use std::collections::VecDeque;
use std::time::Duration;

use super::{Demand, Notice, Outputs, Telemetry, VehicleCounts};
use crate::link::autopilot::Severity;
use crate::link::framing::{Frame, FrameCounts, Frames, Source, Version};
use crate::link::peer::PeerId;
use crate::link::wire::Message;
use crate::link::wire::controller::{self as wire, ControllerMessage};
use crate::physics::{Command, Time};
use assembly::Assembly;
use attitude_trim::AttitudeTrim;
use engagement::{Engagement, Shown};
use parameters::{Parameters, Standing};
use profile::{Authority, Profile, Stack};
use pulse::Pulse;
use requests::{Answer, Requests};
use sticks::Sticks;
use survey::Survey;

/// Our component id: MAV_COMP_ID_ONBOARD_COMPUTER.
pub const ONBOARD: u8 = 191;
/// The controller's component id: MAV_COMP_ID_AUTOPILOT1.
const AUTOPILOT: u8 = 1;
/// MAV_AUTOPILOT_INVALID: whoever says this is no flight controller.
const NO_AUTOPILOT: u8 = 8;
const HEARTBEAT: Duration = Duration::from_secs(1);
/// Between two measurements of the latency.
const TIME_SYNC: Duration = Duration::from_millis(200);
/// A controller that is silent for this long is gone.
const GONE: Duration = Duration::from_secs(3);
/// Without a new state for this long the aircraft is handed back.
const BLIND: Duration = Duration::from_millis(300);
/// A stream below this share of its rate is asked for again, and engaging is refused.
const ENOUGH: f64 = 0.8;

/// What a controller that signs means for a companion that does not.
const SHUT_OUT: &str = "the controller signs its frames and ignores ours, which carry no right \
                        signature: give its key with --sign and add --sign-vehicle";

/// The controller that is spoken to.
#[derive(Clone, Copy, Debug)]
struct Controller {
    system: u8,
    peer: PeerId,
    autopilot: u8,
    armed: bool,
    /// Last heartbeat, host clock.
    heard: Duration,
}

/// The vehicle side of a real flight controller.
#[derive(Clone, Debug)]
pub struct Real {
    profile: Profile,
    controller: Option<Controller>,
    /// Another autopilot on the same link, or another companion with our ids.
    intruder: Option<Source>,
    parameters: Parameters,
    survey: Survey,
    requests: Requests,
    /// Whether the controller's frames carry a signature.
    signs: bool,
    /// Whether the controller hears a radio, as far as it has shown while it flew itself.
    radio: Option<bool>,
    assembly: Assembly,
    engagement: Engagement,
    sticks: Sticks,
    trim: AttitudeTrim,
    /// The command that the actuators got last.
    sent: Command,
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
    /// A controller of `profile`, not heard yet.
    pub fn new(profile: Profile) -> Self {
        Real {
            profile,
            controller: None,
            intruder: None,
            parameters: Parameters::new(profile.stack.rules(profile.authority)),
            survey: Survey::default(),
            requests: Requests::default(),
            signs: false,
            radio: None,
            assembly: Assembly::new(profile.actuators),
            engagement: Engagement::new(profile.stack.lead()),
            sticks: Sticks::default(),
            trim: AttitudeTrim::default(),
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

    /// See [`super::Vehicle::handle`].
    pub fn handle(
        &mut self,
        host: Duration,
        peer: PeerId,
        bytes: &[u8],
        mut deliver: impl FnMut(Telemetry),
    ) {
        let mut counts = FrameCounts::default();
        for frame in Frames::new(bytes, &mut counts) {
            if let Some(telemetry) = self.take(host, peer, &frame) {
                deliver(telemetry);
            }
        }
        self.counts.add(counts);
    }

    fn take(&mut self, host: Duration, peer: PeerId, frame: &Frame<'_>) -> Option<Telemetry> {
        let message = wire::read(frame);
        if let Some(ControllerMessage::Heartbeat { autopilot, armed, custom_mode }) = message {
            self.heartbeat_of(host, peer, frame.source, (autopilot, armed, custom_mode));
        }
        let ours = self.controller.is_some_and(|c| {
            c.peer == peer && frame.source == Source { system: c.system, component: AUTOPILOT }
        });
        if !ours {
            self.foreign += 1;
            return None;
        }
        self.survey.frame(host, frame.id, frame.sequence, frame.bytes.len());
        self.signs |= frame.signed;
        match message? {
            ControllerMessage::Ack { command: wire::SET_MODE, result, to } if self.is_us(to) => {
                self.engagement.answered(result);
            }
            ControllerMessage::Ack { command: wire::SET_MESSAGE_INTERVAL, result, to }
                if self.is_us(to) =>
            {
                if let Answer::Granted(id) = self.requests.answered(result) {
                    self.survey.restart(host, id);
                }
            }
            // Our own overrides may look like a radio.
            ControllerMessage::Receiver { alive } if !self.engagement.steers() => {
                self.radio = Some(alive);
            }
            ControllerMessage::CurrentMode { custom_mode } => self.shown(host, custom_mode),
            ControllerMessage::Parameter { name, cast, bytewise } => {
                let value = if self.profile.stack == Stack::Px4 { bytewise } else { cast };
                self.parameters.take(&name, value);
            }
            ControllerMessage::TimeSync { ours } => {
                if let Ok(sent) = u64::try_from(ours) {
                    self.survey.trip(host.saturating_sub(Duration::from_nanos(sent)));
                }
            }
            message => {
                let state = self.assembly.take(host, &message, &self.sent)?;
                self.last_state = Some(host);
                self.pulse.state();
                return Some(state);
            }
        }
        None
    }

    fn heartbeat_of(
        &mut self,
        host: Duration,
        peer: PeerId,
        from: Source,
        (autopilot, armed, custom_mode): (u8, bool, u32),
    ) {
        let known = self.controller.filter(|c| host.saturating_sub(c.heard) <= GONE);
        if from.component != AUTOPILOT || autopilot == NO_AUTOPILOT {
            let ourselves = known.is_some_and(|c| c.system == from.system);
            if from.component == ONBOARD && ourselves {
                self.intrude(from, "another onboard computer with our ids");
            }
            return;
        }
        if known.is_some_and(|c| c.system != from.system || c.peer != peer) {
            self.intrude(from, "a second autopilot");
            return;
        }
        if known.is_none() {
            self.meet(from.system, autopilot);
        }
        let heard = host;
        let system = from.system;
        self.controller = Some(Controller { system, peer, autopilot, armed, heard });
        self.shown(host, custom_mode);
        if self.engagement.steers() && !armed {
            self.hand_back("the controller is disarmed".into());
        }
    }

    /// The controller shows its mode.
    fn shown(&mut self, host: Duration, custom_mode: u32) {
        let steered = self.profile.stack.steered(self.profile.authority);
        let name = steered.name;
        match self.engagement.shown(host, custom_mode == steered.custom(self.profile.stack)) {
            Shown::Nothing => {}
            Shown::Engaged => {
                self.say(Severity::Notice, format!("engaged: the controller is in {name}"));
                self.notices.push_back(Notice::Engaged);
            }
            Shown::Taken => self.notices.push_back(Notice::HandedBack(format!(
                "the controller left {name} by itself or by its pilot's hand"
            ))),
            Shown::Confirmed => self.say(
                Severity::Notice,
                format!("handed back to the controller: it has left {name}, as it was asked"),
            ),
        }
    }

    /// Whether an answer is to us; old firmware names nobody.
    fn is_us(&self, to: Source) -> bool {
        let system = self.system().unwrap_or(0);
        matches!(to, Source { system: 0, component: 0 })
            || to == Source { system, component: ONBOARD }
    }

    /// A controller is heard for the first time, or again: then nothing is known of it any more, not
    /// even which way its channels run, and nobody steers by that.
    fn meet(&mut self, system: u8, autopilot: u8) {
        if self.engagement.steers() {
            self.hand_back("no heartbeat of the controller for 3 s".into());
        }
        self.parameters.forget();
        self.survey = Survey::default();
        self.requests = Requests::default();
        (self.signs, self.radio) = (false, None);
        let stack = Stack::of(autopilot);
        let who = stack.map_or("an unknown autopilot".to_owned(), |stack| stack.to_string());
        self.say(Severity::Info, format!("controller found: {who}, system {system}"));
        self.notices.push_back(Notice::System(system));
        if stack != Some(self.profile.stack) {
            let words = self.wrong_stack(autopilot);
            self.say(Severity::Error, words);
        }
    }

    fn wrong_stack(&self, autopilot: u8) -> String {
        match Stack::of(autopilot) {
            Some(Stack::Px4) => "the controller is PX4: fly it with --profile px4".into(),
            Some(Stack::Ardupilot) => {
                "the controller is ArduPilot: fly it with --profile ardupilot".into()
            }
            None => format!(
                "the controller is neither PX4 nor ArduPilot (MAV_AUTOPILOT {autopilot}): \
                 connect one of these"
            ),
        }
    }

    fn intrude(&mut self, from: Source, what: &str) {
        if self.intruder.replace(from) != Some(from) {
            let words = format!(
                "{what} (system {}, component {}) is on the vehicle's link: disconnect it or change its ids",
                from.system, from.component
            );
            self.say(Severity::Error, words);
        }
    }

    fn say(&mut self, severity: Severity, words: String) {
        // Nobody fetching them is no reason to fill the memory.
        if self.notices.len() < 64 {
            self.notices.push_back(Notice::Text(severity, words));
        }
    }

    /// Asks the controller to take the aircraft; that it has is reported when it shows so.
    fn hand_back(&mut self, reason: String) {
        self.engagement.hand_back();
        self.notices.push_back(Notice::Released(reason));
    }

    /// The answer to the state of `time`: what makes the actuators do as demanded, or nothing.
    pub fn answer(&mut self, host: Duration, time: Time, demand: &Demand) -> Vec<u8> {
        let Outputs::Armed(command) = demand.outputs else {
            self.engagement.rest();
            self.trim.rest();
            return Vec::new();
        };
        if let Some(fault) = demand.fault.filter(|_| self.engagement.steers()) {
            self.hand_back(fault.words(self.profile.stack));
        }
        if self.controller.is_some() && self.engagement.begin(host) {
            self.radio_warning().into_iter().for_each(|words| self.say(Severity::Warning, words));
        }
        self.states += 1;
        if command.is_finite() {
            self.sent = command.clamped();
        } else {
            self.bad_commands += 1;
        }
        let every = self.profile.stack.frames_per_command(self.profile.authority);
        let attitude = match self.profile.authority {
            Authority::Attitude => self.trimmed(time, demand.attitude),
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

    /// The attitude to command where `wanted` (rad) is wanted: trimmed while the controller flies it.
    fn trimmed(&mut self, time: Time, wanted: [f64; 2]) -> [f64; 2] {
        if !self.flies() {
            self.trim.rest();
            return wanted;
        }
        self.trim.command(time, wanted, self.assembly.attitude())
    }

    /// What is due at `host` besides answers: heartbeat, requests, the hand-back.
    pub fn due(&mut self, host: Duration) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        if host >= self.next_heartbeat {
            self.next_heartbeat = host + HEARTBEAT;
            let message = wire::heartbeat(self.engagement.steers());
            bytes.extend(self.write(&message));
        }
        if let Some(to) = self.target() {
            self.watch(host);
            self.ask(host, to, &mut bytes);
            self.request_mode(host, to, &mut bytes);
        }
        (!bytes.is_empty()).then_some(bytes)
    }

    /// The watchdog.
    fn watch(&mut self, host: Duration) {
        if !self.engagement.steers() {
            self.pulse.rest();
            return self.remind(host);
        }
        // A controller that tracks an attitude does not mind a slow companion.
        let surfaces = self.profile.authority == Authority::Surfaces;
        let scarce = self.pulse.cycle(host).filter(|_| surfaces);
        let age = |at: Duration| host.saturating_sub(at);
        let silent = self.controller.is_none_or(|c| age(c.heard) > GONE);
        let blind = self.last_state.is_none_or(|at| age(at) > BLIND);
        let steered = self.profile.stack.steered(self.profile.authority).name;
        if silent {
            self.hand_back("no heartbeat of the controller for 3 s".into());
        } else if blind {
            self.hand_back("no state of the vehicle for 0.3 s".into());
        } else if let Some(words) = scarce {
            self.hand_back(words);
        } else if let Some(why) =
            self.engagement.overdue(host, self.profile.stack, self.profile.authority)
        {
            self.hand_back(format!("the controller did not go to {steered}: {why}"));
        }
    }

    /// Says that a hand-back is not confirmed.
    fn remind(&mut self, host: Duration) {
        if self.engagement.unconfirmed(host) {
            let (steered, hold) =
                (self.profile.stack.steered(self.profile.authority), self.profile.stack.hold());
            let words = format!(
                "hand-back not confirmed: the controller may still be in {}; take over by radio or \
                 set {}",
                steered.name, hold.name
            );
            self.say(Severity::Critical, words);
        }
    }

    /// Streams, parameters, latency.
    fn ask(&mut self, host: Duration, to: Source, bytes: &mut Vec<u8>) {
        let first = self.survey.windows() == 0 && self.survey.messages().count() <= 1;
        if self.survey.turn(host) || first {
            self.requests.turn();
            if let Some(words) = self.requests.complaint(self.profile.stack) {
                self.say(Severity::Error, words);
            }
            for stream in self.profile.stack.streams() {
                let thin = self.survey.hz(stream.id) < ENOUGH * stream.hz;
                if thin && self.requests.ask(stream.id) {
                    let message = wire::message_interval(to, stream.id, (1e6 / stream.hz) as f32);
                    bytes.extend(self.write(&message));
                }
            }
        }
        for name in self.parameters.due(host) {
            let message = wire::parameter_request(to, name);
            bytes.extend(self.write(&message));
        }
        if host >= self.next_sync {
            self.next_sync = host + TIME_SYNC;
            let message = wire::time_sync(host.as_nanos() as i64, to);
            bytes.extend(self.write(&message));
        }
    }

    fn request_mode(&mut self, host: Duration, to: Source, bytes: &mut Vec<u8>) {
        let Some(steer) = self.engagement.request(host) else { return };
        let stack = self.profile.stack;
        let mode = if steer { stack.steered(self.profile.authority) } else { stack.hold() };
        let message = wire::set_mode(to, mode.main, mode.sub);
        bytes.extend(self.write(&message));
        if !steer && (stack, self.profile.authority) == (Stack::Ardupilot, Authority::Surfaces) {
            // The channels go back to the radio.
            let message = wire::channels_override(to, [0; 3]);
            bytes.extend(self.write(&message));
        }
    }

    /// What a radio means for a flight by surfaces. ArduPlane goes on with the radio's sticks when
    /// our overrides end, and stays in MANUAL: no failsafe of its own acts.
    pub fn radio_warning(&self) -> Option<String> {
        let by_channels =
            (self.profile.stack, self.profile.authority) == (Stack::Ardupilot, Authority::Surfaces);
        (by_channels && self.radio == Some(true)).then(|| {
            "a radio is bound: if this computer dies, ArduPilot stays in MANUAL on the radio's \
             sticks. Put its throttle at cruise and be ready to fly"
                .to_owned()
        })
    }

    /// Whether the controller signs what it sends and has answered nothing that we asked.
    pub fn is_shut_out(&self) -> bool {
        self.signs && self.parameters.is_silent()
    }

    /// Why a stream that was denied does not come, with the remedy.
    pub fn denial(&self, id: u32) -> Option<String> {
        self.requests.words(self.profile.stack).filter(|_| self.requests.is_denied(id))
    }

    /// Why the aircraft cannot be engaged now, with the remedy.
    pub fn obstacle(&self) -> Option<String> {
        let Some(controller) = self.controller else {
            return Some(
                "no flight controller heard: check port, baud rate and its MAVLink".into(),
            );
        };
        if Stack::of(controller.autopilot) != Some(self.profile.stack) {
            return Some(self.wrong_stack(controller.autopilot));
        }
        if let Some(Source { system, component }) = self.intruder {
            return Some(format!(
                "system {system}, component {component} is on the vehicle's link too: \
                 disconnect it, then start again"
            ));
        }
        if !controller.armed {
            return Some("the controller is not armed: arm and launch it first".into());
        }
        if self.is_shut_out() {
            return Some(SHUT_OUT.into());
        }
        self.parameters.obstacle(controller.system).or_else(|| self.thin_stream())
    }

    /// A stream that comes too seldom.
    fn thin_stream(&self) -> Option<String> {
        let thin = self
            .profile
            .stack
            .streams()
            .iter()
            .find(|stream| stream.needed && self.survey.hz(stream.id) < ENOUGH * stream.hz)?;
        if let Some(words) = self.denial(thin.id) {
            return Some(words);
        }
        Some(format!(
            "{} comes at {:.0} Hz, {:.0} are needed: wait a second, then see `greylag link check`",
            thin.name,
            self.survey.hz(thin.id),
            thin.hz
        ))
    }

    /// The oldest notice that was not fetched.
    pub fn take_notice(&mut self) -> Option<Notice> {
        self.notices.pop_front()
    }

    /// Whether the controller was seen to fly what it is commanded.
    pub fn flies(&self) -> bool {
        self.engagement.is_engaged()
    }

    /// Whether we steer, or are about to.
    pub fn is_engaged(&self) -> bool {
        self.engagement.steers()
    }

    /// See [`super::Vehicle::peer`].
    pub fn peer(&self) -> Option<PeerId> {
        self.controller.map(|c| c.peer)
    }

    /// The controller's system id, once heard.
    pub fn system(&self) -> Option<u8> {
        self.controller.map(|c| c.system)
    }

    /// The stack that the controller says it is, and whether it is armed.
    pub fn controller(&self) -> Option<(u8, bool)> {
        self.controller.map(|c| (c.autopilot, c.armed))
    }

    /// What the link carries.
    pub fn survey(&self) -> &Survey {
        &self.survey
    }

    /// How each parameter stands.
    pub fn parameter_report(&self) -> Vec<(&'static str, Standing, String)> {
        self.parameters.report(self.system().unwrap_or(1))
    }

    /// The profile it is flown by.
    pub fn profile(&self) -> &Profile {
        &self.profile
    }

    /// See [`super::Vehicle::counts`].
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
        // Before a controller is heard the system is the one that nearly all have.
        let source = Source { system: self.system().unwrap_or(1), component: ONBOARD };
        self.sequence = self.sequence.wrapping_add(1);
        message.encode(Version::V2, self.sequence, source).unwrap_or_default()
    }
}
