//! Measures latency and settled error through MAVLink, with simulator (shim), companion and client over UDP sockets.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl --example mavlink_timing
//! ```
//! The example flies for one minute in real time, then for five minutes of flight time in lockstep. It prints the results and
//! fails if a requirement is not met. The machine must be idle. `--controller hybrid` flies a planner, and late plans are
//! counted. `--planner KEY=VALUE` changes the planner's settings. `--load 2` keeps two threads busy during the flight. Plans
//! may then be late, but the attitude must be held. `--realtime` gives the companion's threads real-time priority.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::panic::resume_unwind;
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use clap::Parser;
use greylag::commands::{controllers, fly};
use greylag::control::cem::Change;
use greylag::control::{self, ControllerKind, Target, build};
use greylag::flight::pilot::{Config, Pilot};
use greylag::flight::recorder::Place;
use greylag::flight::runtime::{
    Companion, Flight, FlightError, FlightOptions, Pace, Placement, Summary, take_real_time,
};
use greylag::link::autopilot::Mode;
use greylag::link::offboard::{Heard, OffboardClient};
use greylag::logs::Sample;
use greylag::logs::csv::{self, Tolerance};
use greylag::model::GreyBox;
use greylag::sim::{Episode, Simulator};
use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::{self, ShimOptions};

/// Commanded roll, degrees. With the pitch `PITCH_DEG` it is an easy target of the paper.
const ROLL_DEG: f64 = 30.0;
const PITCH_DEG: f64 = 10.0;
/// Length of the flight in real time, s.
const REAL_TIME_S: f64 = 60.0;
/// Length of the flight in lockstep, s.
const LOCKSTEP_S: f64 = 300.0;
/// Number of cycles of an episode. `SETTLED` is the number of its last cycles over which the settled error is computed.
const EPISODE: usize = 1000;
const SETTLED: usize = 200;
/// Largest accepted 99th percentile of the time from a state frame to its command, µs, for a controller in the control loop.
const P99_US: f64 = 2000.0;
/// Largest accepted median and 99.9th percentile of this time for a planner, µs.
const PLAN_US: [f64; 2] = [5000.0, 10_000.0];
/// Largest accepted roll or pitch error on a loaded machine, from ten seconds after the target was given, degrees.
const HELD_DEG: f64 = 2.0;
/// Largest accepted difference between the settled errors through MAVLink and in process, degrees.
const AGREEMENT_DEG: f64 = 0.05;
/// Smallest accepted ratio of flight time to wall time in lockstep.
const SPEED: f64 = 20.0;

/// Results of a flight.
struct Flown {
    samples: Vec<Sample>,
    companion: Summary,
    shim: shim::Summary,
}

/// Measures latency and settled error through MAVLink.
#[derive(Parser)]
struct Arguments {
    /// Controller that flies the aircraft.
    #[arg(long, default_value = "lqi")]
    controller: ControllerKind,
    /// Settings of a planner that differ from the defaults.
    #[arg(long, num_args = 1.., value_name = "KEY=VALUE")]
    planner: Vec<Change>,
    /// Number of threads that are kept busy during the flight.
    #[arg(long, default_value_t = 0)]
    load: usize,
    /// Run the companion's threads with real-time priority (SCHED_FIFO), as `greylag fly --realtime`.
    #[arg(long)]
    realtime: bool,
}

fn main() -> Result<ExitCode> {
    let Arguments { controller: kind, planner: changes, load, realtime } = Arguments::parse();
    let model = fly::model(Path::new(fly::MODEL), None)?;
    let in_process = settled_in_process(kind, &model, &changes)?;
    println!(
        "target {ROLL_DEG} / {PITCH_DEG} deg, {kind}, JSBSim; in process {in_process:.4} deg; {load} busy \
         threads\n"
    );
    let busy = Busy::start(load)?;
    let begin: Begin = if realtime { start_in_real_time } else { Flight::start };
    let real = flight(kind, &model, &changes, (Pace::RealTime, REAL_TIME_S), begin)?;
    drop(busy);
    let mut verdicts = real_time(&real, kind, load, in_process)?;
    if load == 0 {
        let lockstep = flight(kind, &model, &changes, (Pace::Lockstep, LOCKSTEP_S), begin)?;
        let speed = lockstep.shim.flown_s / lockstep.shim.wall_s;
        let errors = settled(&lockstep.samples)?;
        verdicts.push((near(errors, in_process), format!("lockstep: settled {}", told(errors))));
        if kind.pace() == control::Pace::Immediate {
            let words = format!("lockstep: {speed:.0} times real time, {SPEED:.0} wanted");
            verdicts.push((speed >= SPEED, words));
        }
    }
    for (reached, words) in &verdicts {
        println!("{:>6}  {words}", if *reached { "ok" } else { "MISSED" });
    }
    let all = verdicts.iter().all(|(reached, _)| *reached);
    Ok(if all { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn near(errors: [f64; 2], in_process: f64) -> bool {
    errors.iter().all(|e| (e - in_process).abs() <= AGREEMENT_DEG)
}

fn told([early, late]: [f64; 2]) -> String {
    format!("{early:.4} deg after 10 s, {late:.4} at the end")
}

/// The requirements on the flight in real time as text, each with whether it was met.
fn real_time(
    real: &Flown,
    kind: ControllerKind,
    load: usize,
    in_process: f64,
) -> Result<Vec<(bool, String)>> {
    let timing = &real.companion.timing;
    let count = timing.latency.count();
    if load > 0 {
        let worst = worst_held(&real.samples)?;
        let words = format!(
            "{load} busy threads: worst error {worst:.3} deg of {HELD_DEG}; {} plans late, {} cycles late of \
             {count}",
            timing.late_plans, timing.missed
        );
        return Ok(vec![(worst <= HELD_DEG, words)]);
    }
    // late commands, lost state frames, and steps that the shim made without a new command
    let missed = timing.missed + real.companion.vehicle.lost + real.shim.unanswered_steps;
    let quantile = |q: f64| timing.latency.quantile_us(q);
    let (p50, p99, p999) = (quantile(0.5), quantile(0.99), quantile(0.999));
    let late = timing.late_plans;
    let in_time = match kind.pace() {
        control::Pace::Immediate => {
            (p99 <= P99_US, format!("real time: state to command p99 {p99:.0} us of {P99_US:.0}"))
        }
        control::Pace::Planned => (
            p50 <= PLAN_US[0] && p999 <= PLAN_US[1] && late == 0,
            format!(
                "real time: state to command p50 {p50:.0}, p99.9 {p999:.0} us; {late} plans late"
            ),
        ),
    };
    let errors = settled(&real.samples)?;
    Ok(vec![
        (missed == 0, format!("real time: {missed} cycles missed of {count}")),
        in_time,
        (near(errors, in_process), format!("real time: settled {}", told(errors))),
    ])
}

/// Threads that load the processor.
struct Busy {
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Busy {
    fn start(count: usize) -> Result<Busy> {
        let stop = Arc::new(AtomicBool::new(false));
        let threads = (0..count).map(|_| {
            let told = stop.clone();
            let work = move || while !told.load(Ordering::Relaxed) {};
            thread::Builder::new().name("busy".into()).spawn(work)
        });
        let threads = threads.collect::<Result<_, _>>()?;
        Ok(Busy { stop, threads })
    }
}

impl Drop for Busy {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // the result of a thread that only loops is ignored
            let _ = thread.join();
        }
    }
}

/// The settled error of the same target in an episode within this process, degrees.
fn settled_in_process(kind: ControllerKind, model: &GreyBox, changes: &[Change]) -> Result<f64> {
    let mut simulator = Simulator::new(&PlantOptions::default())?;
    let mut controller =
        controllers::controller(kind, model, Path::new(controllers::POLICY), changes)?;
    let target =
        Target { roll: ROLL_DEG.to_radians(), pitch: PITCH_DEG.to_radians(), airspeed: 20.0 };
    let episode = Episode { environment: &mut simulator, controller: controller.as_mut(), seed: 0 };
    Ok(episode.fly(&target, |_, _| {})?.settled_deg)
}

/// The settled error (degrees) at the end of the first ten seconds on the target, as in an episode, and at the end of the
/// flight.
fn settled(samples: &[Sample]) -> Result<[f64; 2]> {
    let first = begun(samples)?;
    let episode = samples.get(first..first + EPISODE).context("the flight was too short")?;
    Ok([episode, samples].map(error_at_end))
}

/// Index of the first cycle in which the target is commanded.
fn begun(samples: &[Sample]) -> Result<usize> {
    let on_target = |s: &Sample| (s.roll_target_rad.to_degrees() - ROLL_DEG).abs() < 1e-3;
    samples.iter().position(on_target).context("the target was never flown")
}

/// The largest roll or pitch error from ten seconds after the target was given, degrees.
fn worst_held(samples: &[Sample]) -> Result<f64> {
    let held = samples.get(begun(samples)? + EPISODE..).context("the flight was too short")?;
    let errors = held.iter().map(|s| {
        let [roll, pitch] = [s.attitude_rad[0], s.attitude_rad[1]].map(f64::to_degrees);
        (roll - ROLL_DEG).abs().max((pitch - PITCH_DEG).abs())
    });
    Ok(errors.fold(0.0, f64::max))
}

/// Mean of roll and pitch RMSE over the last cycles, degrees.
fn error_at_end(samples: &[Sample]) -> f64 {
    let last = &samples[samples.len().saturating_sub(SETTLED)..];
    let rmse = |axis: usize, wanted: f64| {
        let square = |s: &Sample| (s.attitude_rad[axis].to_degrees() - wanted).powi(2);
        (last.iter().map(square).sum::<f64>() / last.len() as f64).sqrt()
    };
    (rmse(0, ROLL_DEG) + rmse(1, PITCH_DEG)) / 2.0
}

/// Starts the companion of a flight.
type Begin = fn(&FlightOptions, Companion, Arc<AtomicBool>) -> Result<Flight, FlightError>;

/// Starts the companion with real-time priority. Simulator, client and busy threads keep the usual class.
fn start_in_real_time(
    options: &FlightOptions,
    companion: Companion,
    stop: Arc<AtomicBool>,
) -> Result<Flight, FlightError> {
    let start = || {
        take_real_time().map_err(|why| FlightError::Thread("companion", why))?;
        Flight::start(options, companion, stop)
    };
    // the threads of the flight inherit the class of the thread that starts them
    thread::scope(|scope| scope.spawn(start).join().unwrap_or_else(|died| resume_unwind(died)))
}

/// Flies the target in OFFBOARD until the shim has flown `seconds`.
fn flight(
    kind: ControllerKind,
    model: &GreyBox,
    changes: &[Change],
    (pace, seconds): (Pace, f64),
    begin: Begin,
) -> Result<Flown> {
    let room = tempfile::tempdir()?;
    let folder = room.path().join("flight");
    let stop = Arc::new(AtomicBool::new(false));
    let options = options(model, pace, &folder)?;
    let companion = begin(&options, companion_with(kind, model, changes, pace)?, stop.clone())?;
    let vehicle = companion.vehicle.context("no vehicle link")?;
    let client = companion.clients.first().copied().flatten().context("no client link")?;
    let simulator = simulate(vehicle, pace, seconds, stop.clone())?;
    let steered = steer(client, &simulator);
    stop.store(true, Ordering::Relaxed);
    let shim = simulator.join().map_err(|_| anyhow!("the shim's thread has died"))??;
    let companion = companion.join().context("the control thread has died")?;
    steered?;
    println!("{pace:?}\n{companion}\n{shim}\n");
    let recorded = csv::load(&folder.join("flight.csv"), Tolerance::Strict)?;
    Ok(Flown { samples: recorded.flight.samples, companion, shim })
}

fn options(model: &GreyBox, pace: Pace, folder: &Path) -> Result<FlightOptions> {
    let free_port: greylag::link::address::Address = "udpin:127.0.0.1:0".parse()?;
    Ok(FlightOptions {
        vehicle: free_port.clone(),
        clients: vec![free_port],
        record: Some(Place::Exactly(folder.to_owned())),
        pace,
        duration: None,
        plan_deadline: FlightOptions::PLAN_DEADLINE,
        controller: None,
        delay_margin: None,
        signing: None,
        travels: model.airframe.actuators.travels(),
        mixer: model.airframe.mixer.clone(),
    })
}

/// The companion with the controller and an LQI as its fallback. In lockstep the flight time passes much faster than the
/// client's time. The client's timeout is therefore longer.
fn companion_with(
    kind: ControllerKind,
    model: &GreyBox,
    changes: &[Change],
    pace: Pace,
) -> Result<Companion> {
    let mut config = Config::for_model(model)?;
    if pace == Pace::Lockstep {
        config.offboard_loss_s = 60.0;
    }
    let controller = controllers::controller(kind, model, Path::new(controllers::POLICY), changes)?;
    let pilot = Pilot::new(config, build(ControllerKind::Lqi, model)?)?;
    let placement = match kind.pace() {
        control::Pace::Planned => Placement::Thread,
        control::Pace::Immediate => Placement::Loop,
    };
    Ok(Companion { pilot, controller, placement })
}

type Simulation = JoinHandle<Result<shim::Summary, shim::ShimError>>;

fn simulate(
    companion: SocketAddr,
    pace: Pace,
    seconds: f64,
    stop: Arc<AtomicBool>,
) -> Result<Simulation> {
    let options = ShimOptions {
        link: format!("udpout:{companion}").parse()?,
        pace: match pace {
            Pace::RealTime => shim::Pace::RealTime,
            Pace::Lockstep => shim::Pace::Lockstep,
        },
        duration_s: Some(seconds),
        ..ShimOptions::new(PlantOptions::default(), Start::NEUTRAL)
    };
    let work = move || shim::run(&options, &stop, &mut |_| ());
    Ok(thread::Builder::new().name("shim".into()).spawn(work)?)
}

/// Arms, enters OFFBOARD and sends setpoints at 50 Hz until the simulation has ended.
fn steer(companion: SocketAddr, simulation: &Simulation) -> Result<()> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    socket.connect(companion)?;
    socket.set_read_timeout(Some(Duration::from_millis(20)))?;
    let (mut client, start) = (OffboardClient::default(), Instant::now());
    let (mut state, mut entered, mut setpoint_due) = (None, false, start);
    let mut ask_due = start + Duration::from_millis(200);
    while !simulation.is_finished() {
        let now = Instant::now();
        if now >= setpoint_due {
            setpoint_due = now + Duration::from_millis(20);
            let time_ms = start.elapsed().as_millis() as u32;
            let (roll, pitch) = (ROLL_DEG.to_radians(), PITCH_DEG.to_radians());
            socket.send(&client.setpoint(time_ms, roll, pitch))?;
        }
        if now >= ask_due && !entered {
            ask_due = now + Duration::from_millis(50);
            let armed = matches!(state, Some((true, _)));
            socket.send(&if armed { client.set_mode(Mode::Offboard) } else { client.arm() })?;
        }
        let mut datagram = [0; 2048];
        // after a time-out there are no bytes to read
        let length = socket.recv(&mut datagram).unwrap_or(0);
        client.read(&datagram[..length], |heard| {
            if let Heard::Heartbeat { armed, mode } = heard {
                state = Some((armed, mode));
            }
        });
        let offboard = matches!(state, Some((true, Some(Mode::Offboard))));
        if entered && !offboard {
            bail!("the companion left OFFBOARD: {state:?}");
        }
        entered |= offboard;
    }
    if entered { Ok(()) } else { bail!("OFFBOARD was never entered: {state:?}") }
}
