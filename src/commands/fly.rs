//! `greylag fly`: runs the companion autopilot, which steers a real or simulated vehicle over MAVLink.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context;
use clap::{Args, ValueEnum};
use crossbeam_channel::RecvTimeoutError;
use serde::{Deserialize, Serialize};

use crate::commands::choices;
use crate::commands::controllers::{POLICY, check_changes, controller};
use crate::commands::exposure::{self, Asked};
use crate::commands::files::shipped;
use crate::commands::flown_with::{Chosen, FlownWith};
use crate::commands::terminal::{complain, say};
use crate::commands::watchdog;
use crate::commands::{margin, no_vehicle, punctual};
use crate::control::aircraft_estimate::AircraftEstimator;
use crate::control::cem::Change;
use crate::control::envelope::EnvelopeLimiter;
use crate::control::{self, Controller, ControllerKind, build};
use crate::flight::monitor::Monitor;
use crate::flight::pilot::{Config, Pilot};
use crate::flight::recorder::Place;
use crate::flight::runtime::{
    Companion, Event, Flight, FlightOptions, Pace, Placement, Signing, VehicleLink,
};
use crate::link::address::Address;
use crate::link::autopilot::Severity;
use crate::link::vehicle::{Authority, Profile, Stack};
#[cfg(feature = "demo")]
use crate::logs::quoted;
use crate::manoeuvres::Schedule;
use crate::model::GreyBox;
use crate::physics::Airframe;
use crate::physics::airframe::ActuatorFigures;

/// The default model of the aircraft. It was learned from simulated flights, starting from a model with wrong coefficients.
pub const MODEL: &str = "params/x8/learned/model.toml";
/// Name of the default controller.
pub const CONTROLLER: &str = "hybrid-ilqr";

/// The arguments of `greylag fly`.
#[derive(Args, Debug)]
pub struct Arguments {
    /// Link to the vehicle: udpin:, udpout:, tcpin: or tcpout:HOST:PORT, or serial:DEVICE:BAUD.
    #[arg(long, value_name = "ADDRESS", default_value = "udpin:127.0.0.1:14600")]
    vehicle: Address,
    /// Flight controller or simulator at the other end of the vehicle's link.
    #[arg(long, value_name = "NAME", default_value = "sitl", value_enum)]
    profile: ProfileName,
    /// Quantity commanded to a real flight controller: surfaces (in its mode MANUAL), or attitude (in
    /// OFFBOARD or GUIDED).
    #[arg(long, value_name = "WHAT", default_value = "surfaces", value_enum)]
    command: CommandName,
    /// Link to clients, such as ground stations; may be given several times. A link that other machines can reach needs --sign,
    /// or --insecure.
    #[arg(long = "client", value_name = "ADDRESS", default_values = ["udpin:127.0.0.1:14550", "udpout:127.0.0.1:14540"])]
    clients: Vec<Address>,
    /// Sign messages to clients and refuse unsigned ones, with the key in this file: 64 hexadecimal
    /// digits, readable by its owner only.
    #[arg(long, value_name = "FILE")]
    sign: Option<PathBuf>,
    /// Sign messages to the vehicle as well, and refuse unsigned ones from it.
    #[arg(long, requires = "sign")]
    sign_vehicle: bool,
    /// A further link to clients, on which messages are neither signed nor checked because the user
    /// declares it local; may be given several times.
    #[arg(long, value_name = "ADDRESS", requires = "sign")]
    local: Vec<Address>,
    /// Allow unsigned links that other machines can reach: anybody who reaches one can steer the aircraft.
    #[arg(long)]
    insecure: bool,
    /// Controller that flies the aircraft.
    #[arg(long, value_name = "NAME", default_value = CONTROLLER, value_parser = choices::controller())]
    controller: ControllerKind,
    /// Model that the controller is designed from or plans with.
    #[arg(long, value_name = "FILE", default_value = MODEL)]
    model: PathBuf,
    /// Folder of the trained policy, for controllers that use one.
    #[arg(long, value_name = "DIR", default_value = POLICY)]
    policy: PathBuf,
    /// Settings of the planner that differ from the defaults, as KEY=VALUE.
    #[arg(long = "planner", value_name = "KEY=VALUE", num_args = 1..)]
    changes: Vec<Change>,
    /// Airframe file that replaces the one named in the model file.
    #[arg(long, value_name = "FILE")]
    airframe: Option<PathBuf>,
    /// Fly this flight-test schedule instead of the client's setpoints in offboard mode.
    #[arg(long, value_name = "FILE")]
    schedule: Option<PathBuf>,
    /// New folder for the recording [default: the next number under flights/].
    #[arg(long, value_name = "DIR", conflicts_with = "no_record")]
    record: Option<PathBuf>,
    /// Do not record the flight.
    #[arg(long)]
    no_record: bool,
    /// Lockstep, for a simulator that waits for each command: wait for every plan, also for a late one.
    #[arg(long)]
    lockstep: bool,
    /// A plan counts as late if it arrives more than this time after the vehicle's state, in milliseconds.
    #[arg(long, value_name = "MS", default_value_t = FlightOptions::PLAN_DEADLINE.as_millis() as u64, value_parser = clap::value_parser!(u64).range(1..=1000))]
    plan_deadline_ms: u64,
    /// Run with real-time priority (SCHED_FIFO), where the system permits it.
    #[arg(long)]
    realtime: bool,
    /// End after this many seconds instead of at Ctrl-C.
    #[arg(long, value_name = "S", value_parser = seconds)]
    duration_s: Option<Duration>,
}

/// Kind of the other end of the vehicle's link.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProfileName {
    /// The simulator `greylag-sitl` with its own interface.
    Sitl,
    /// A flight controller with PX4 for fixed wings.
    Px4,
    /// A flight controller with ArduPilot Plane.
    Ardupilot,
}

/// Quantity that the companion commands to a real flight controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CommandName {
    /// Commands of aileron, elevator and throttle.
    Surfaces,
    /// Setpoints of roll, pitch and thrust.
    Attitude,
}

impl ProfileName {
    /// The flight stack (autopilot software) of a real flight controller; `None` for the simulator.
    pub fn stack(self) -> Option<Stack> {
        match self {
            ProfileName::Sitl => None,
            ProfileName::Px4 => Some(Stack::Px4),
            ProfileName::Ardupilot => Some(Stack::Ardupilot),
        }
    }
}

impl CommandName {
    /// The same choice as a value of [`Authority`], the type of the vehicle's link.
    pub fn authority(self) -> Authority {
        match self {
            CommandName::Surfaces => Authority::Surfaces,
            CommandName::Attitude => Authority::Attitude,
        }
    }
}

impl Arguments {
    /// All links to clients, including those declared local.
    fn all_clients(&self) -> impl Iterator<Item = &Address> {
        self.clients.iter().chain(&self.local)
    }

    /// The links to clients whose messages are not signed.
    fn unsigned(&self) -> impl Iterator<Item = &Address> {
        let signed = self.sign.is_some();
        self.clients.iter().filter(move |_| !signed).chain(&self.local)
    }

    fn vehicle_link(&self) -> VehicleLink {
        if self.sign_vehicle { VehicleLink::Signed } else { VehicleLink::Open }
    }

    fn signing(&self) -> Option<Signing> {
        let vehicle = self.vehicle_link();
        self.sign.clone().map(|key| Signing { key, vehicle, local: self.local.clone() })
    }

    /// Options that are stored with the recording.
    fn chosen(&self) -> Chosen<'_> {
        Chosen {
            controller: self.controller,
            model: &self.model,
            policy: &self.policy,
            changes: &self.changes,
            airframe: self.airframe.as_deref(),
            schedule: self.schedule.as_deref(),
            profile: self.profile,
            commanded: self.command,
        }
    }

    fn controller_profile(&self, model: &GreyBox) -> Option<Profile> {
        // no message of the companion to a real flight controller commands a rudder
        let actuators = ActuatorFigures { rudder: None, ..model.airframe.actuators };
        let authority = self.command.authority();
        self.profile.stack().map(|stack| Profile { stack, authority, actuators })
    }
}

/// Reads a positive number of seconds.
fn seconds(text: &str) -> Result<Duration, String> {
    let number = text.parse::<f64>().map_err(|e| e.to_string())?;
    let duration = Duration::try_from_secs_f64(number.max(0.0)).map_err(|e| e.to_string())?;
    if duration.is_zero() { Err("give a time above zero".into()) } else { Ok(duration) }
}

/// Flies until Ctrl-C or the end of the duration.
///
/// # Errors
/// If a file cannot be read or is invalid, an unsigned link is exposed without `--insecure`, a link cannot be opened or a
/// recording cannot be created. No flight starts in these cases. An error is also returned if the control thread panics.
pub fn run(arguments: &Arguments) -> anyhow::Result<ExitCode> {
    let asked = if arguments.insecure { Asked::Insecure } else { Asked::Nothing };
    let exposed = exposure::check(arguments.unsigned(), asked)?;
    let mut model = model(&arguments.model, arguments.airframe.as_deref())?;
    if arguments.profile.stack().is_some() {
        model = model.leaving_rudder();
    }
    let Arguments { controller, policy, changes, .. } = arguments;
    let mut companion = companion_with_planner(*controller, &model, policy, changes)?;
    if let Some(path) = &arguments.schedule {
        companion.pilot.follow(Schedule::load(path)?);
    }
    companion.pilot.monitor_with(Monitor::new(model.clone()));
    let vehicle = exposure::vehicle(&arguments.vehicle, arguments.vehicle_link());
    for words in exposed.into_iter().chain(vehicle) {
        companion.pilot.send_text(Severity::Warning, &words);
    }
    let mut options = options(arguments, &model);
    if options.controller.is_some_and(|profile| profile.authority == Authority::Surfaces) {
        options.delay_margin = margin::of(*controller, &model)?;
    }
    let stop = Arc::new(AtomicBool::new(false));
    let asked = stop.clone();
    ctrlc::set_handler(move || asked.store(true, Ordering::Relaxed))
        .context("setting the handler of Ctrl-C")?;
    let class = punctual::class(arguments.realtime);
    let flight = Flight::start(&options, companion, stop)?;
    if !arguments.lockstep {
        punctual::print_timing(class);
    }
    if let Some(folder) = &flight.recording {
        // The flight continues without this file, because `replay` takes the same information as options.
        if let Err(why) = FlownWith::write(folder, &arguments.chosen(), &model) {
            complain(format_args!("`replay` will need this flight's options: {why:#}"));
        }
    }
    watchdog::feed(flight.rounds.clone());
    announce(arguments, &model, &flight);
    show_events(&flight, arguments);
    #[cfg(feature = "demo")]
    let recorded = flight.recording.clone();
    let mut summary =
        flight.join().context("the control thread has died; the recording holds all up to then")?;
    no_vehicle::tell(&mut summary);
    say(format_args!("{summary}"));
    #[cfg(feature = "demo")]
    recorded
        .iter()
        .filter(|_| summary.vehicle.states > 0)
        .for_each(|folder| say(format_args!("next: greylag report {}", quoted(folder))));
    Ok(ExitCode::SUCCESS)
}

fn options(arguments: &Arguments, model: &GreyBox) -> FlightOptions {
    let record = match (&arguments.record, arguments.no_record) {
        (_, true) => None,
        (Some(folder), _) => Some(Place::Exactly(folder.clone())),
        (None, _) => Some(Place::Numbered("flights".into())),
    };
    FlightOptions {
        vehicle: arguments.vehicle.clone(),
        clients: arguments.all_clients().cloned().collect(),
        record,
        pace: if arguments.lockstep { Pace::Lockstep } else { Pace::RealTime },
        duration: arguments.duration_s,
        plan_deadline: Duration::from_millis(arguments.plan_deadline_ms),
        travels: model.airframe.actuators.travels(),
        mixer: model.airframe.mixer.clone(),
        controller: arguments.controller_profile(model),
        delay_margin: None,
        signing: arguments.signing(),
    }
}

/// Loads a model file and, if `airframe` is given, replaces its airframe. [`shipped`] resolves paths below `params/`.
///
/// # Errors
/// If the model file or the airframe file cannot be read or is invalid.
pub fn model(path: &Path, airframe: Option<&Path>) -> anyhow::Result<GreyBox> {
    let mut model = GreyBox::load(&shipped(path))?;
    if let Some(path) = airframe {
        model.airframe = Airframe::load(&shipped(path))?;
    }
    Ok(model)
}

/// The companion of `greylag fly`: the controller `kind`, and a pilot that checks and limits the commands in each cycle. The
/// pilot has the envelope limiter of `model` and a fallback controller. `folder` holds the policy, see
/// [`controllers::policy`](crate::commands::controllers::policy). The fallback is an LQI of the same model. If no LQI can
/// be designed, the fallback is `pid-retuned`, and a line on standard error states this.
///
/// # Errors
/// If the policy cannot be read or belongs to another airframe, if `kind` cannot be built from the model, or if the model
/// can be trimmed at its cruise airspeed neither in level flight nor in a glide. An LQI that cannot be designed as the
/// fallback is no error.
pub fn companion_with(
    kind: ControllerKind,
    model: &GreyBox,
    folder: &Path,
) -> anyhow::Result<Companion> {
    companion_with_planner(kind, model, folder, &[])
}

/// The same as [`companion_with`]. `changes` replace default settings of the planner.
///
/// # Errors
/// The same as [`companion_with`], or if there are changes and `kind` has no planner.
pub fn companion_with_planner(
    kind: ControllerKind,
    model: &GreyBox,
    folder: &Path,
    changes: &[Change],
) -> anyhow::Result<Companion> {
    check_changes(&[kind], changes)?;
    let controller = controller(kind, model, folder, changes)?;
    // The design of an LQI takes time, so it is not repeated for the fallback.
    let fallback = if matches!(kind, ControllerKind::Lqi | ControllerKind::LqiDamped) {
        controller.boxed_clone()
    } else {
        fallback(model)?
    };
    let mut pilot = Pilot::new(Config::for_model(model)?, fallback)?;
    pilot.protect_with(EnvelopeLimiter::new(model));
    pilot.estimate_with(AircraftEstimator::new(&model.airframe));
    let placement =
        if kind.pace() == control::Pace::Planned { Placement::Thread } else { Placement::Loop };
    Ok(Companion { pilot, controller, placement })
}

/// The fallback controller of `model`: an LQI. If no LQI can be designed, it is `pid-retuned`, and a line on standard error
/// states this.
///
/// # Errors
/// If `pid-retuned` cannot be built either.
fn fallback(model: &GreyBox) -> anyhow::Result<Box<dyn Controller>> {
    match build(ControllerKind::Lqi, model) {
        Ok(lqi) => Ok(lqi),
        Err(error) => {
            eprintln!("greylag: {error}; the fallback is {} instead", ControllerKind::PidRetuned);
            Ok(build(ControllerKind::PidRetuned, model)?)
        }
    }
}

fn announce(arguments: &Arguments, model: &GreyBox, flight: &Flight) {
    say(format_args!("controller {}, model {}", arguments.controller, arguments.model.display()));
    say(format_args!("model      {}: {}", model.name, model.description));
    say(format_args!("vehicle    {}", arguments.vehicle));
    for client in arguments.all_clients() {
        say(format_args!("clients    {client}"));
    }
    match &flight.recording {
        Some(folder) => say(format_args!("recording  {}", folder.display())),
        None => say(format_args!("recording  none")),
    }
    say(format_args!("waiting for a vehicle; Ctrl-C ends"));
}

/// Prints the events of the flight until it ends.
fn show_events(flight: &Flight, arguments: &Arguments) {
    while flight.is_flying() {
        match flight.events.recv_timeout(Duration::from_millis(50)) {
            Ok(event) => say(format_args!("{}", line(&event, arguments))),
            Err(RecvTimeoutError::Timeout) => {}
            // The control thread is about to end.
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}

fn line(event: &Event, arguments: &Arguments) -> String {
    match event {
        Event::Text(text) => format!("[{}] {}", severity(text.severity), text.words),
        Event::VehicleFound(peer) => format!("vehicle found at {peer}"),
        Event::NoVehicle => no_vehicle::yet(arguments.profile, &arguments.vehicle),
    }
}

fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Critical => "critical",
        Severity::Error => "error",
        Severity::Warning => "warning",
        Severity::Notice => "notice",
        Severity::Info => "info",
    }
}
