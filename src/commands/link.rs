//! `greylag link`: checks a link to a flight controller, and makes signing keys.

mod key;
mod shown;

use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use comfy_table::Table;
use comfy_table::presets::NOTHING;
use crossbeam_channel::{Receiver, bounded};
use serde::Serialize;

use crate::commands::files::{JsonArgument, Overwrite};
use crate::commands::fly::{self, CommandName, ProfileName};
use crate::commands::{choices, margin};
use crate::control::ControllerKind;
use crate::link::address::Address;
use crate::link::peer::LinkId;
use crate::link::transport::{Arrival, Link, Network};
use crate::link::vehicle::{Authority, Profile, Real, Stack};
use crate::model::GreyBox;
use crate::physics::airframe::ActuatorFigures;
use shown::{delay, latency, parameters};

/// Writes a line to `$out`. Errors, such as a closed pipe, are ignored.
macro_rules! print_to {
    ($out:expr, $($words:tt)*) => {{
        let _ = writeln!($out, $($words)*);
    }};
}
use print_to;

/// Time within which the flight controller must send a heartbeat.
const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(4);
/// Largest fraction of a serial port's data rate that the state messages may use. The rest is for parameters, commands and
/// routed messages.
const BUDGET: f64 = 0.6;
/// Fraction of its nominal rate below which a stream (a message that is sent periodically) counts as missing.
const ENOUGH: f64 = 0.8;

/// The arguments of `greylag link`.
#[derive(Args)]
pub struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Measure rates, loss, jitter, latency; list what is missing and which parameters to set.
    Check(Check),
    /// Make a key that signs links.
    Key(key::Make),
}

/// The arguments of `greylag link check`.
#[derive(Args)]
struct Check {
    /// Link to the flight controller, such as serial:/dev/ttyACM0:921600.
    #[arg(long, value_name = "ADDRESS")]
    vehicle: Address,
    /// Autopilot stack to check for [default: the stack that answers].
    #[arg(long, value_name = "NAME", value_enum)]
    profile: Option<ProfileName>,
    /// Model of the aircraft, for the actuators of its airframe.
    #[arg(long, value_name = "FILE", default_value = "params/x8/jsbsim.toml")]
    model: PathBuf,
    /// Quantity that will be commanded.
    #[arg(long, value_name = "WHAT", default_value = "surfaces", value_enum)]
    command: CommandName,
    /// Controller whose delay margin is compared with the delay of the link, if surfaces are commanded.
    #[arg(long, value_name = "NAME", default_value = "lqi", value_parser = choices::controller())]
    controller: ControllerKind,
    /// Duration of the measurement.
    #[arg(long, value_name = "S", default_value_t = 8, value_parser = clap::value_parser!(u64).range(4..=3600))]
    seconds: u64,
    #[command(flatten)]
    json: JsonArgument,
}

/// Runs `greylag link …`.
///
/// # Errors
/// If the link cannot be opened, or no flight controller answers on it.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    match &arguments.command {
        Command::Check(check) => run_check(check),
        Command::Key(make) => key::run(make),
    }
}

fn run_check(check: &Check) -> Result<ExitCode> {
    check.json.writable(Overwrite::New)?;
    let mut out: Box<dyn Write> =
        if check.json.takes_stdout() { Box::new(io::sink()) } else { Box::new(io::stdout()) };
    let model = flown(&check.model)?;
    let mut listener = Listener::open(&check.vehicle)?;
    let actuators = model.airframe.actuators;
    let asked = check.profile.and_then(ProfileName::stack);
    let stack = match asked {
        Some(stack) => stack,
        None => listener.find(check.command, actuators)?,
    };
    let profile = Profile { stack, authority: check.command.authority(), actuators };
    print_to!(out, "measuring {} for {} s …", check.vehicle, check.seconds);
    let mut real = Real::new(profile);
    if profile.authority == Authority::Surfaces {
        real.bear(margin::of(check.controller, &model)?);
    }
    let real = listener.listen(real, Duration::from_secs(check.seconds));
    report(check, &real, &mut out)
}

/// Loads the model as `greylag fly` uses it with a flight controller: without a rudder, because no message of the link
/// commands one.
fn flown(file: &Path) -> Result<GreyBox> {
    Ok(fly::model(file, None)?.leaving_rudder())
}

/// An open link, with the packets that arrive on it and the remarks of the network thread.
struct Listener {
    started: Instant,
    arrivals: Receiver<Arrival>,
    link: Link,
    remarks: Vec<String>,
    _network: Network,
}

impl Listener {
    fn open(address: &Address) -> Result<Listener> {
        let network = Network::start()?;
        let (to, arrivals) = bounded(1024);
        let link = network.open(LinkId(0), address, "--vehicle", to)?;
        let started = Instant::now();
        Ok(Listener { started, arrivals, link, remarks: Vec::new(), _network: network })
    }

    /// Waits for the flight controller's heartbeat and returns its autopilot stack. Fails after `HEARTBEAT_TIMEOUT`.
    fn find(&mut self, command: CommandName, actuators: ActuatorFigures) -> Result<Stack> {
        let authority = command.authority();
        let guess = Profile { stack: Stack::Px4, authority, actuators };
        let end = Instant::now() + HEARTBEAT_TIMEOUT;
        let mut real = Real::new(guess);
        while Instant::now() < end {
            real = self.listen(real, Duration::from_millis(100));
            if let Some((autopilot, _)) = real.controller() {
                let Some(stack) = Stack::of(autopilot) else {
                    bail!(
                        "the controller is neither PX4 nor ArduPilot (MAV_AUTOPILOT {autopilot}): \
                         connect one of these"
                    );
                };
                return Ok(stack);
            }
        }
        if let Some(remark) = self.remarks.first() {
            bail!("{remark}");
        }
        bail!(
            "no flight controller heard for {} s: check port, baud rate, and that its port speaks \
             MAVLink (MAV_1_CONFIG on PX4, SERIAL2_PROTOCOL 2 on ArduPilot)",
            HEARTBEAT_TIMEOUT.as_secs()
        )
    }

    fn listen(&mut self, mut real: Real, duration: Duration) -> Real {
        let end = Instant::now() + duration;
        while Instant::now() < end {
            match self.arrivals.recv_timeout(Duration::from_millis(5)) {
                Ok(Arrival::Packet(packet)) => {
                    let host = packet.arrived.saturating_duration_since(self.started);
                    real.handle(host, packet.peer, &packet.bytes, |_| {});
                }
                Ok(Arrival::Remark(remark)) => self.remarks.push(remark.to_string()),
                Ok(_) | Err(_) => {}
            }
            let peer = real.peer().or(self.link.target());
            if let (Some(bytes), Some(peer)) = (real.due(self.started.elapsed()), peer) {
                self.link.send(peer, bytes);
            }
        }
        real
    }
}

/// Result of the check as JSON.
#[derive(Serialize)]
struct Document {
    stack: String,
    system: Option<u8>,
    armed: Option<bool>,
    loss: f64,
    /// Median round-trip time of the TIMESYNC messages, ms.
    round_trip_ms: Option<f64>,
    streams: Vec<StreamRow>,
    parameters: Vec<String>,
    warning: Option<String>,
    /// Reasons why the flight controller cannot be flown with the profile (its stack and the commanded quantity). Empty if
    /// it can.
    missing: Vec<String>,
}

#[derive(Serialize)]
struct StreamRow {
    message: &'static str,
    wanted_hz: f64,
    received_hz: f64,
    jitter_ms: f64,
    needed: bool,
}

impl Document {
    fn new(real: &Real, missing: &[String]) -> Document {
        let survey = real.survey();
        let trips = survey.round_trips();
        let stream = |s: &crate::link::vehicle::real::profile::Stream| {
            let traffic = survey.messages().find(|(id, _)| *id == s.id);
            let (received_hz, jitter_ms) =
                traffic.map_or((0.0, 0.0), |(_, t)| (t.hz, t.jitter_ms()));
            StreamRow { message: s.name, wanted_hz: s.hz, received_hz, jitter_ms, needed: s.needed }
        };
        Document {
            stack: real.profile().stack.to_string(),
            system: real.system(),
            armed: real.controller().map(|(_, armed)| armed),
            loss: survey.loss(),
            round_trip_ms: trips.get(trips.len() / 2).map(|t| t.as_secs_f64() * 1e3),
            streams: real.profile().stack.streams().iter().map(stream).collect(),
            parameters: real.parameter_report().into_iter().map(|(_, _, words)| words).collect(),
            warning: real.radio_warning(),
            missing: missing.to_vec(),
        }
    }
}

/// Prints the results and writes the JSON file. The exit status is 1 if the flight controller cannot be flown with the
/// profile.
fn report(check: &Check, real: &Real, out: &mut dyn Write) -> Result<ExitCode> {
    let Some((autopilot, armed)) = real.controller() else {
        bail!("the controller fell silent while it was measured: check cable and power");
    };
    let who = Stack::of(autopilot).map_or("unknown autopilot".into(), |stack| stack.to_string());
    let state = if armed { "armed" } else { "disarmed" };
    print_to!(out, "controller  {who}, system {}, {state}", real.system().unwrap_or(0));
    let mut missing = Vec::new();
    if Stack::of(autopilot) != Some(real.profile().stack) {
        missing.push(format!("the controller is {who}, not {}", real.profile().stack));
    }
    traffic(check, real, &mut missing, out);
    latency(real, out);
    if real.is_shut_out() {
        missing.push(
            "the controller signs its frames and ignores this command's, which are not signed: fly \
             with --sign and --sign-vehicle, or switch its signing off for this check"
                .into(),
        );
    } else {
        streams(real, &mut missing, out);
        parameters(real, &mut missing, out);
        delay(real, &mut missing, out);
        if let Some(words) = real.radio_warning() {
            print_to!(out, "\nwarning: {words}");
        }
    }
    check.json.write("greylag.link-check/1", &Document::new(real, &missing), Overwrite::New)?;
    if missing.is_empty() {
        print_to!(out, "\n{} can be flown by {:?}", real.profile().stack, real.profile().authority);
        return Ok(ExitCode::SUCCESS);
    }
    print_to!(out, "\nmissing for {} by {:?}:", real.profile().stack, real.profile().authority);
    for line in &missing {
        print_to!(out, "  {line}");
    }
    Ok(ExitCode::FAILURE)
}

fn traffic(check: &Check, real: &Real, missing: &mut Vec<String>, out: &mut dyn Write) {
    let survey = real.survey();
    let rate: f64 = survey
        .messages()
        .map(|(_, t)| survey.mean_hz(t) * t.bytes as f64 / t.frames.max(1) as f64)
        .sum();
    let kilobits = |bytes: f64| bytes * 10.0 * 1e-3;
    let _ = write!(out, "received    {:.0} kbit/s (ten bits a byte on a wire)", kilobits(rate));
    let wanted: f64 =
        real.profile().stack.streams().iter().map(|s| s.hz * f64::from(s.bytes)).sum();
    match check.vehicle {
        Address::Serial { baud, .. } => {
            let share = wanted * 10.0 / f64::from(baud);
            print_to!(
                out,
                "; the streams need {:.0} of {:.0} kbit/s, {:.0} %",
                kilobits(wanted),
                f64::from(baud) * 1e-3,
                100.0 * share
            );
            if share > BUDGET {
                missing.push(format!(
                    "baud rate {baud} is too low for {:.0} kbit/s of state: set the port to 921600",
                    kilobits(wanted)
                ));
            }
        }
        _ => print_to!(out, "; the streams need {:.0}", kilobits(wanted)),
    }
    print_to!(out, "loss        {:.2} % by sequence numbers", 100.0 * survey.loss());
    let counts = real.counts().frames;
    if counts.bad() > 0 {
        print_to!(out, "bad frames  {} ({} with a wrong CRC)", counts.bad(), counts.bad_crc);
    }
    if survey.loss() > 0.02 {
        missing.push("more than 2 % of the frames are lost: check cable and flow control".into());
    }
}

fn streams(real: &Real, missing: &mut Vec<String>, out: &mut dyn Write) {
    let mut table = Table::new();
    table.load_style(NOTHING).set_header(["message", "wanted", "received", "jitter", ""]);
    for stream in real.profile().stack.streams() {
        let traffic = real.survey().messages().find(|(id, _)| *id == stream.id);
        let (hz, jitter) = traffic.map_or((0.0, 0.0), |(_, t)| (t.hz, t.jitter_ms()));
        let thin = hz < ENOUGH * stream.hz;
        let verdict = match (thin, stream.needed) {
            (false, _) => "",
            (true, true) => "missing",
            (true, false) => "missing, not needed",
        };
        if thin && stream.needed {
            let words = real.denial(stream.id).unwrap_or_else(|| {
                format!(
                    "{} comes at {hz:.0} Hz instead of {:.0}: {}",
                    stream.name,
                    stream.hz,
                    remedy(real.profile().stack)
                )
            });
            // Every refused stream has the same text, which names all of them. It is therefore listed only once.
            if !missing.contains(&words) {
                missing.push(words);
            }
        }
        table.add_row([
            stream.name.to_owned(),
            format!("{:.0} Hz", stream.hz),
            format!("{hz:.1} Hz"),
            format!("{jitter:.2} ms"),
            verdict.to_owned(),
        ]);
    }
    print_to!(out, "\n{table}");
    let named: Vec<u32> = real.profile().stack.streams().iter().map(|stream| stream.id).collect();
    let others: Vec<String> = real
        .survey()
        .messages()
        .filter(|(id, _)| !named.contains(id))
        .map(|(id, traffic)| format!("{id} ({:.1} Hz)", real.survey().mean_hz(traffic)))
        .collect();
    if !others.is_empty() {
        print_to!(out, "others by number: {}", others.join(", "));
    }
}

/// Advice for the user if a stream is too slow.
fn remedy(stack: Stack) -> &'static str {
    match stack {
        Stack::Px4 => "raise the port's data rate (MAV_1_RATE) or its baud rate",
        Stack::Ardupilot => "raise the port's baud rate, or SCHED_LOOP_RATE (then reboot)",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check must use the same delay margin as the flight, which has no rudder.
    #[test]
    fn a_link_without_a_rudder_command_is_checked_without_a_rudder() {
        let file = Path::new("params/c172p/jsbsim.toml");
        assert!(fly::model(file, None).unwrap().has_rudder());
        assert!(!flown(file).unwrap().has_rudder());
    }
}
