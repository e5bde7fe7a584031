//! Replay of a recorded flight. A new pilot and controller receive the recorded calls and telemetry frames. Their commands
//! are compared with the recorded ones bit by bit. The pilot decides on the command of each control cycle (tick).

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::pilot::{Plan, Request};
use crate::recorder::call::{Call, CallError, HEADER, Planned, same};
use crate::runtime::Companion;
use greylag_control::Controller;
use greylag_link::autopilot::Autopilot;
use greylag_link::framing::{FrameCounts, Frames, frame_len};
use greylag_link::peer::{LinkId, PeerId, SERIAL};
use greylag_link::vehicle::{Order, Telemetry, Vehicle};
use greylag_physics::{Command, Time};

/// Largest number of differences that the outcome lists.
const SHOWN: usize = 10;

/// A recorded flight cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// A file of the recording cannot be read.
    #[error("reading {}: {source}; name a folder that `greylag fly` has recorded", path.display())]
    File {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        source: std::io::Error,
    },
    /// The file of calls has another format version.
    #[error("{} does not begin with `{HEADER}`: it was recorded by another version", path.display())]
    Header {
        /// Path of the file.
        path: PathBuf,
    },
    /// A line other than the last is invalid.
    #[error("{}, line {line}: {source}", path.display())]
    Line {
        /// Path of the file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Reason for which the line is invalid.
        source: CallError,
    },
}

/// A tick whose replayed command differs from the recorded one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// Time of the state by the vehicle's clock.
    pub time: Time,
    /// The command in the recording.
    pub recorded: Command,
    /// The command in the replay.
    pub replayed: Command,
}

/// Result of a replay.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Number of ticks replayed.
    pub ticks: u64,
    /// Number of ticks whose command differs from the recorded one in any bit.
    pub different: u64,
    /// Number of ticks at which the command computed by the controller differs from the recorded one in any bit.
    pub plans_different: u64,
    /// Number of ticks whose state is missing in the telemetry. Later commands may differ for this reason.
    pub without_state: u64,
    /// The first differences, at most ten, in order.
    pub differences: Vec<Difference>,
    /// Whether the end of the recording is missing, for instance after a crash.
    pub cut_short: bool,
}

/// The recorded states in order.
struct States {
    vehicle: Vehicle,
    bytes: Vec<u8>,
    at: usize,
    ready: VecDeque<(Duration, Telemetry)>,
}

impl States {
    /// The state with the vehicle's time stamp `time`, and its arrival time; `None` if the telemetry has no such state.
    /// Earlier states are skipped, because the recording has no call for them.
    fn next(&mut self, time: Time) -> Option<(Duration, Telemetry)> {
        loop {
            while let Some((host, state)) = self.ready.pop_front() {
                if state.order != Order::Late && state.time == time {
                    return Some((host, state));
                }
                if state.order != Order::Late && state.time > time {
                    self.ready.push_front((host, state));
                    return None;
                }
            }
            self.read_packet()?;
        }
    }

    /// Timestamp of the next record, µs since 1970.
    fn stamp(&self) -> Option<u64> {
        Some(u64::from_be_bytes(*self.bytes.get(self.at..)?.first_chunk()?))
    }

    /// Reads the frames of one packet, which share a timestamp. As in flight, all frames are processed before a command
    /// is computed from a state.
    fn read_packet(&mut self) -> Option<()> {
        let (stamp, mut read) = (self.stamp()?, None);
        while self.stamp() == Some(stamp) && self.read_one(stamp).is_some() {
            read = Some(());
        }
        read
    }

    /// Reads one record: eight bytes of time (big-endian, µs since 1970), then a frame.
    fn read_one(&mut self, stamp: u64) -> Option<()> {
        let rest = self.bytes.get(self.at + 8..)?;
        let len = frame_len(rest).filter(|len| *len <= rest.len())?;
        let peer = PeerId { link: LinkId(0), address: SERIAL };
        let host = Duration::from_micros(stamp);
        let frame = &rest[..len];
        let ours = Frames::new(frame, &mut FrameCounts::default())
            .next()
            .is_some_and(|f| f.source.component == 1 && f.id == 93);
        let ready = &mut self.ready;
        if !ours {
            self.vehicle.handle(host, peer, frame, |state| ready.push_back((host, state)));
        }
        self.at += 8 + len;
        Some(())
    }
}

/// Replays the recording in `folder` with a new `companion` and `vehicle`.
///
/// # Errors
///
/// If a file cannot be read, has another format version, or contains an invalid line.
pub fn replay(
    folder: &Path,
    companion: Companion,
    vehicle: Vehicle,
) -> Result<Outcome, ReplayError> {
    replay_watched(folder, companion, vehicle, &mut |_, _, _| ())
}

/// Callback for each tick of a replay at which the controller computes a command. Its arguments are the vehicle time, the
/// request to the controller, and the controller after the computation.
pub type Watch<'a> = dyn FnMut(Time, &Request, &dyn Controller) + 'a;

/// Replays like [`replay`], and calls `watch` for each tick at which the controller computes a command.
///
/// # Errors
///
/// The same as [`replay`].
pub fn replay_watched(
    folder: &Path,
    companion: Companion,
    vehicle: Vehicle,
    watch: &mut Watch,
) -> Result<Outcome, ReplayError> {
    let file = |name: &str| folder.join(name);
    let failed = |path: PathBuf| move |source| ReplayError::File { path, source };
    let path = file("flight.calls");
    let text = std::fs::read(&path).map_err(failed(path.clone()))?;
    let text = String::from_utf8_lossy(&text).into_owned();
    let tlog = file("flight.tlog");
    let bytes = std::fs::read(&tlog).map_err(failed(tlog.clone()))?;
    let states = States { vehicle, bytes, at: 0, ready: VecDeque::new() };
    let mut companion = companion;
    companion.pilot.take_on(&states.vehicle);
    let outcome = Outcome::default();
    let mut replayed = Replayed { companion, states, watch, outcome, owed: false };
    let mut lines = text.split_inclusive('\n').enumerate().peekable();
    match lines.next() {
        Some((_, first)) if first.trim_end() == HEADER => {}
        _ => return Err(ReplayError::Header { path }),
    }
    while let Some((number, line)) = lines.next() {
        let whole = line.ends_with('\n');
        match line.trim_end().parse::<Call>() {
            Ok(call) if whole => {
                if !replayed.make(&call) {
                    break;
                }
            }
            _ if lines.peek().is_none() => replayed.outcome.cut_short = true,
            Ok(_) => {}
            Err(source) => return Err(ReplayError::Line { path, line: number + 1, source }),
        }
    }
    Ok(replayed.outcome)
}

struct Replayed<'w, 'f> {
    watch: &'w mut Watch<'f>,
    companion: Companion,
    states: States,
    outcome: Outcome,
    /// Whether the next request must reset the controller. The planner was busy when the companion last took control.
    owed: bool,
}

impl Replayed<'_, '_> {
    /// Repeats one recorded call of the pilot. Returns `false` when the telemetry has ended. The pilot's replies to
    /// requests are not compared.
    fn make(&mut self, call: &Call) -> bool {
        let pilot = &mut self.companion.pilot;
        match *call {
            Call::Advance(now) => pilot.advance(now),
            Call::Excuse(missed) => pilot.excuse(missed),
            Call::Arm(now, force) => drop(pilot.arm(now, force)),
            Call::Disarm(now, force) => drop(pilot.disarm(now, force)),
            Call::Engaged(now) => pilot.engaged(now),
            Call::Mode(now, mode) => drop(pilot.set_mode(now, mode)),
            Call::Setpoint(now, setpoint) => pilot.attitude_setpoint(now, setpoint),
            Call::Sticks(now, sticks) => pilot.sticks(now, sticks),
            Call::Parameter(index, value) => drop(pilot.set_parameter(index, value)),
            Call::Tick(time, planned, recorded) => return self.tick(time, planned, recorded),
        }
        true
    }

    fn tick(&mut self, time: Time, planned: Planned, recorded: Command) -> bool {
        let Some((host, state)) = self.states.next(time) else {
            self.outcome.without_state += 1;
            // the telemetry of a truncated recording may end before its calls
            let ended = self.states.at + 8 >= self.states.bytes.len();
            self.outcome.cut_short |= ended;
            return !ended;
        };
        let request = self.companion.pilot.observe(state.time, &state);
        // in flight, a planner that was busy or had ended did not process the request
        let heard = request.filter(|_| !matches!(planned, Planned::Busy | Planned::None));
        if heard.is_none() {
            self.owed |= request.is_some_and(|request| request.engage);
        }
        let own = heard.map(|request| {
            let engage = request.engage || std::mem::take(&mut self.owed);
            let request = Request { engage, ..request };
            let command = request.ask(self.companion.controller.as_mut());
            (self.watch)(time, &request, self.companion.controller.as_ref());
            command
        });
        let plan = match planned {
            Planned::Ready(command) => {
                let differs = own.is_none_or(|own| !same(&own, &command));
                self.outcome.plans_different += u64::from(differs);
                own.map_or(Plan::Ready(command), Plan::Ready)
            }
            Planned::Late => Plan::Late,
            Planned::Busy => Plan::Busy,
            Planned::None => Plan::None,
        };
        let decision = self.companion.pilot.decide(plan);
        // The link to a real flight controller estimates the actuator positions from the sent commands.
        self.states.vehicle.answer(host, state.time, &decision.demand());
        self.outcome.ticks += 1;
        if !same(&decision.command, &recorded) {
            self.outcome.different += 1;
            if self.outcome.differences.len() < SHOWN {
                let replayed = decision.command;
                self.outcome.differences.push(Difference { time, recorded, replayed });
            }
        }
        true
    }
}
