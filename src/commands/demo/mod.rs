//! `greylag demo`: a demonstration flight in one program.
//!
//! Three parts communicate over real sockets: the simulator with its MAVLink side (the shim), the companion, which is
//! Greylag's autopilot, and a MAVLink client that commands attitudes.

mod client;
mod indicator;
mod live;
mod schedule;

use crate::report::Sight;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use anyhow::{Context, Result, anyhow};
use greylag_sitl::error_arguments::{FaultArgs, SensorArgs};
use greylag_sitl::plant::{Plant, PlantOptions};
use greylag_sitl::plant_arguments::PlantArgs;
use greylag_sitl::shim::{self, ShimOptions};

use crate::commands::choices;
use crate::commands::files::Overwrite;
use crate::commands::flown_with::{Chosen, FlownWith};
use crate::commands::fly::{CommandName, ProfileName};
use crate::commands::recording_report::{self, Reporter, TOLERANCE_DEG};
use crate::commands::start::{self, StartArguments};
use crate::commands::{controllers, files, fly};
use crate::control::cem::Change;
use crate::control::{self, ControllerKind};
use crate::flight::recorder::Place;
use crate::flight::runtime::{Companion, Flight, FlightOptions, Pace};
use crate::link::address::Address;
use crate::link::vehicle::{Sitl, Vehicle};
use crate::manoeuvres::Schedule;
use crate::model::GreyBox;
use crate::report::FlightReport;
use client::Client;
use live::Live;
use schedule::Legs;

/// Options of `greylag demo`.
#[derive(clap::Args)]
pub struct Arguments {
    /// Controller that flies the schedule.
    #[arg(long, value_name = "NAME", default_value = fly::CONTROLLER, value_parser = choices::controller())]
    controller: ControllerKind,
    /// Model that the controller is designed from or plans with.
    #[arg(long, value_name = "FILE", default_value = fly::MODEL)]
    model: PathBuf,
    /// Folder of the trained policy, for controllers that need one.
    #[arg(long, value_name = "DIR", default_value = controllers::POLICY)]
    policy: PathBuf,
    /// Settings of the planner that differ from the defaults, as KEY=VALUE.
    #[arg(long = "planner", value_name = "KEY=VALUE", num_args = 1..)]
    changes: Vec<Change>,
    /// Fly this flight-test schedule in place of the six attitudes.
    #[arg(long, value_name = "FILE")]
    schedule: Option<PathBuf>,
    /// New folder for the recording and the report [default: the next number under flights/].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Seed of everything random: turbulence, noise, lost frames.
    #[arg(long, default_value_t = 1)]
    seed: u32,
    /// End the flight when standard input ends, for a program that starts this one.
    #[arg(long)]
    attached: bool,
    #[command(flatten)]
    plant: PlantArgs,
    #[command(flatten)]
    start: StartArguments,
    #[command(flatten)]
    sensors: SensorArgs,
    #[command(flatten)]
    faults: FaultArgs,
}

/// Flies the six attitudes of the demonstration, or the given schedule. The exit status is 0 if every attitude was tracked
/// within [`TOLERANCE_DEG`]. A schedule has no attitudes to judge.
///
/// # Errors
/// If a file, a link or the simulator cannot be opened, or if the flight ends too early.
pub fn run(arguments: &Arguments) -> Result<ExitCode> {
    let model = fly::model(&arguments.model, None)?;
    let Arguments { controller, policy, changes, .. } = arguments;
    let set_up = || fly::companion_with_planner(*controller, &model, policy, changes);
    let mut flying = set_up()?;
    let schedule = arguments.schedule.as_deref().map(Schedule::load).transpose()?;
    let legs = schedule
        .as_ref()
        .map_or_else(|| Legs::demonstration(&model.airframe.envelope), Legs::during);
    let tracked = if schedule.is_none() { legs.legs.as_slice() } else { &[] };
    schedule.iter().for_each(|schedule| flying.pilot.follow(schedule.clone()));
    // an aircraft that cannot fly is reported before anything is opened or written
    let plant = plant(arguments, &model)?;
    Plant::new(&plant)?.reset(&plant.start)?;
    let stop = Arc::new(AtomicBool::new(false));
    let flight = Flight::start(&options(arguments, &model)?, flying, stop.clone())?;
    let folder = flight.recording.clone().context("the demonstration records")?;
    FlownWith::write(&folder, &chosen(arguments), &model)?;
    let companion = flight.clients.first().copied().flatten().context("no client link")?;
    let vehicle = flight.vehicle.context("no vehicle link")?;
    announce(*controller, &model, companion, &plant, vehicle);
    let simulator = simulate(arguments, plant.clone(), vehicle, stop.clone())?;
    let flown = as_client(arguments, companion, &legs);
    stop.store(true, Ordering::Relaxed);
    let summary =
        flight.join().context("the control thread has died; the recording holds all up to then")?;
    let simulated = simulator.join().map_err(|_| anyhow!("the shim's thread has died"))?;
    println!("{summary}");
    println!("{}", simulated?);
    let trouble = summary.timing.trouble();
    let texts = flown.map_err(|why| excused(why, trouble.as_deref()))?;
    let sights = match controller.pace() {
        control::Pace::Planned => sights(&folder, set_up()?, schedule, &model),
        _ => Vec::new(),
    };
    let recorded = recording_report::read(&folder)?;
    let segment = |leg: &schedule::Leg| {
        recording_report::segment([leg.roll_deg, leg.pitch_deg], leg.difficulty, &recorded)
    };
    let reporter = Reporter {
        title: format!("Greylag demo: {controller} on aircraft {} in JSBSim", plant.aircraft),
        controller: arguments.controller.name(),
        seed: Some(arguments.seed.into()),
        model: &model,
        model_file: &arguments.model,
        segments: tracked.iter().map(segment).collect(),
        texts,
        sights,
    };
    let report = reporter.report(&folder, &recorded)?;
    let page = folder.join("report.html");
    files::write(&page, &report.page().render(), Overwrite::New)?;
    println!("report: {}", page.display());
    println!("next: {}", report.next);
    Ok(verdict(&report, trouble.as_deref()))
}

/// The error of a flight that ended early. If this computer was too slow, its timing problem is given as the cause.
fn excused(why: anyhow::Error, trouble: Option<&str>) -> anyhow::Error {
    match trouble {
        Some(trouble) => why.context(trouble.to_owned()),
        None => why,
    }
}

fn announce(
    controller: ControllerKind,
    model: &GreyBox,
    companion: SocketAddr,
    plant: &PlantOptions,
    vehicle: SocketAddr,
) {
    println!(
        "companion: controller {controller}, model {}, clients on udp {companion}",
        model.name
    );
    println!("model: {}", model.description);
    println!("shim: aircraft {} in JSBSim, real time, towards udp {vehicle}", plant.aircraft);
}

/// Options of the flight that are stored with the recording.
fn chosen(arguments: &Arguments) -> Chosen<'_> {
    Chosen {
        controller: arguments.controller,
        model: &arguments.model,
        policy: &arguments.policy,
        changes: &arguments.changes,
        airframe: None,
        schedule: arguments.schedule.as_deref(),
        profile: ProfileName::Sitl,
        commanded: CommandName::Surfaces,
    }
}

/// Connects to the companion at `to` as a client and commands the attitudes of `legs` one after the other. Returns the
/// texts that the client received, with their times, s.
fn as_client(arguments: &Arguments, to: SocketAddr, legs: &Legs) -> Result<Vec<(f64, String)>> {
    let mut table = Live::begin(legs);
    let ended = arguments.attached.then(input_ends).unwrap_or_default();
    let flown = Client::connect(to)
        .and_then(|mut c| c.fly(legs, &ended, |leg, s, view| table.show(leg, s, view)));
    table.end();
    flown
}

/// The planner's candidate plans shortly after each new target. The companion `again` computes them by replaying the
/// recording in `folder`. The list is empty if the replay fails.
fn sights(
    folder: &Path,
    mut again: Companion,
    schedule: Option<Schedule>,
    model: &GreyBox,
) -> Vec<Sight> {
    schedule.into_iter().for_each(|schedule| again.pilot.follow(schedule));
    let vehicle = Vehicle::Sitl(Sitl::new(1, model.airframe.actuators.travels()));
    recording_report::sights(folder, again, vehicle).unwrap_or_else(|why| {
        eprintln!("the report does not show what the planner saw: {why:#}");
        Vec::new()
    })
}

/// A flag that becomes true when standard input ends.
fn input_ends() -> Arc<AtomicBool> {
    let ended = Arc::new(AtomicBool::new(false));
    let heard = ended.clone();
    thread::spawn(move || {
        // the content of standard input is ignored, and a read error counts as its end
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        heard.store(true, Ordering::Relaxed);
    });
    ended
}

fn options(arguments: &Arguments, model: &GreyBox) -> Result<FlightOptions> {
    let free_port: Address = "udpin:127.0.0.1:0".parse()?;
    Ok(FlightOptions {
        vehicle: free_port.clone(),
        clients: vec![free_port],
        record: Some(
            arguments.out.clone().map_or(Place::Numbered("flights".into()), Place::Exactly),
        ),
        pace: Pace::RealTime,
        duration: None,
        plan_deadline: FlightOptions::PLAN_DEADLINE,
        travels: model.airframe.actuators.travels(),
        mixer: model.airframe.mixer.clone(),
        controller: None,
        delay_margin: None,
        signing: None,
    })
}

/// Options of the simulated aircraft, with the model's airframe and with the initial state from the command line.
fn plant(arguments: &Arguments, model: &GreyBox) -> Result<PlantOptions> {
    let mut plant = arguments.plant.options(arguments.seed);
    let models = std::slice::from_ref(model);
    start::describe(&mut plant, models)?;
    plant.start = arguments.start.start(&plant.aircraft, models)?;
    Ok(plant)
}

/// Starts the shim on a separate thread. It runs until `stop` is true.
fn simulate(
    arguments: &Arguments,
    plant: PlantOptions,
    vehicle: SocketAddr,
    stop: Arc<AtomicBool>,
) -> Result<thread::JoinHandle<Result<shim::Summary, shim::ShimError>>> {
    let link = format!("udpout:{vehicle}").parse()?;
    let start = plant.start;
    let options = ShimOptions {
        link,
        seed: arguments.seed.into(),
        noise: arguments.sensors.noise(),
        bias: arguments.sensors.bias(),
        faults: arguments.faults.rule(),
        ..ShimOptions::new(plant, start)
    };
    thread::Builder::new()
        .name("shim".into())
        .spawn(move || shim::run(&options, &stop, &mut |_| ()))
        .context("starting the shim's thread")
}

/// Prints how well each target was tracked. If one was not tracked, also prints `trouble`, the timing problem of this
/// computer. The exit status is 0 if all targets were tracked.
fn verdict(report: &FlightReport<'_>, trouble: Option<&str>) -> ExitCode {
    let (tracked, all) = (report.tracked(), report.segments.len());
    let qualities = report.qualities().unwrap_or_default();
    if all > 0 {
        println!(
            "   target roll/pitch  settled  integral  overshoot  load factor      alpha    outside"
        );
    }
    for (s, q) in report.segments.iter().zip(&qualities) {
        let ([roll, pitch], [least, most]) = (q.overshoot_deg, q.load_factor);
        println!(
            "{:>4} {:>4.0}/{:>3.0} deg: {:>6.3} deg {:>5.0} deg s  {roll:>4.1}/{pitch:.1} deg  {least:>4.1} to {most:>4.1} \
             {:>6.1} deg {:>6.2} s",
            s.difficulty.name(),
            s.roll_target_rad.to_degrees(),
            s.pitch_target_rad.to_degrees(),
            s.settled_error_rad.to_degrees(),
            q.error_integral_deg_s,
            q.alpha_deg[1],
            q.outside_s.any
        );
    }
    if all > 0 {
        println!("tracked {tracked} of {all} targets within {TOLERANCE_DEG} deg");
    }
    if tracked != all {
        trouble.iter().for_each(|trouble| println!("{trouble}"));
    }
    // printed last, because the workbench shows the last line of a program
    println!("{}", report.page_sentence());
    if tracked == all { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
