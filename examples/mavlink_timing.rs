//! Real-time figures through MAVLink: shim, companion and client over real sockets.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl --example mavlink_timing
//! ```
//! It flies a minute in real time, then five minutes of flight in lockstep, prints what it
//! measured, and ends with an error when a wanted figure is missed. An idle machine is part of
//! the measurement.

use std::net::{Ipv4Addr, SocketAddr, UdpSocket};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use greylag::commands::fly;
use greylag::control::{Kind, Target, build};
use greylag::flight::pilot::{Config, Pilot};
use greylag::flight::recorder::Place;
use greylag::flight::runtime::{Crew, Flight, Options, Pace, Seat, Summary};
use greylag::link::autopilot::Mode;
use greylag::link::offboard::{Heard, OffboardClient};
use greylag::logs::Sample;
use greylag::logs::csv::{self, Tolerance};
use greylag::model::GreyBox;
use greylag::sim::{Episode, Simulator};
use greylag_sitl::plant::{PlantOptions, Start};
use greylag_sitl::shim::{self, ShimOptions};

/// The attitude that is flown, degrees: an easy target of the paper.
const ROLL_DEG: f64 = 30.0;
const PITCH_DEG: f64 = 10.0;
/// Length of the flight in real time, s.
const REAL_TIME_S: f64 = 60.0;
/// Length of the flight in lockstep, s.
const LOCKSTEP_S: f64 = 300.0;
/// Cycles of an episode in process, with how many at its end the settled error is taken over.
const EPISODE: usize = 1000;
const SETTLED: usize = 200;
/// Longest p99 from a state frame to its command, µs.
const P99_US: f64 = 2000.0;
/// How far the settled error may be from that in process, degrees.
const AGREEMENT_DEG: f64 = 0.05;
/// Least ratio of lockstep to real time.
const SPEED: f64 = 20.0;

/// What a flight came to.
struct Flown {
    samples: Vec<Sample>,
    companion: Summary,
    shim: shim::Summary,
}

fn main() -> Result<ExitCode> {
    let model = fly::model(Path::new("params/x8/jsbsim.toml"), None)?;
    let in_process = settled_in_process(&model)?;
    println!("target {ROLL_DEG} / {PITCH_DEG} deg, LQI, JSBSim; in process {in_process:.4} deg\n");
    let real = flight(&model, Pace::RealTime, REAL_TIME_S)?;
    let lockstep = flight(&model, Pace::Lockstep, LOCKSTEP_S)?;

    let timing = &real.companion.timing;
    let p99 = timing.latency.quantile_us(0.99);
    // Late answers, frames that did not come, steps that the shim made without a new answer.
    let missed = timing.missed + real.companion.vehicle.lost + real.shim.unanswered_steps;
    let (real_error, lockstep_error) = (settled(&real.samples)?, settled(&lockstep.samples)?);
    let speed = lockstep.shim.flown_s / lockstep.shim.wall_s;
    let near = |errors: [f64; 2]| errors.iter().all(|e| (e - in_process).abs() <= AGREEMENT_DEG);
    let told = |[early, late]: [f64; 2]| format!("{early:.4} deg after 10 s, {late:.4} at the end");
    let verdicts = [
        (missed == 0, format!("real time: {missed} cycles missed of {}", timing.latency.count())),
        (p99 <= P99_US, format!("real time: state to command p99 {p99:.0} us of {P99_US:.0}")),
        (near(real_error), format!("real time: settled {}", told(real_error))),
        (near(lockstep_error), format!("lockstep: settled {}", told(lockstep_error))),
        (speed >= SPEED, format!("lockstep: {speed:.0} times real time, {SPEED:.0} wanted")),
    ];
    for (reached, words) in &verdicts {
        println!("{:>6}  {words}", if *reached { "ok" } else { "MISSED" });
    }
    let all = verdicts.iter().all(|(reached, _)| *reached);
    Ok(if all { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The settled error of the same target flown from neutral in process, degrees.
fn settled_in_process(model: &GreyBox) -> Result<f64> {
    let mut simulator = Simulator::new(&PlantOptions::default())?;
    let mut controller = build(Kind::Lqi, model)?;
    let target =
        Target { roll: ROLL_DEG.to_radians(), pitch: PITCH_DEG.to_radians(), airspeed: 20.0 };
    let episode = Episode { environment: &mut simulator, controller: controller.as_mut(), seed: 0 };
    Ok(episode.fly(&target, |_, _| {})?.settled_deg)
}

/// The settled error, degrees: at the end of the first ten seconds on the target, as in an
/// episode, then at the end of the flight.
fn settled(samples: &[Sample]) -> Result<[f64; 2]> {
    let on_target = |s: &Sample| (s.roll_target_rad.to_degrees() - ROLL_DEG).abs() < 1e-3;
    let first = samples.iter().position(on_target).context("the target was never flown")?;
    let episode = samples.get(first..first + EPISODE).context("the flight was too short")?;
    Ok([episode, samples].map(error_at_end))
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

/// Flies the target in OFFBOARD until the shim has flown `seconds`.
fn flight(model: &GreyBox, pace: Pace, seconds: f64) -> Result<Flown> {
    let room = tempfile::tempdir()?;
    let folder = room.path().join("flight");
    let stop = Arc::new(AtomicBool::new(false));
    let options = options(model, pace, &folder)?;
    let companion = Flight::start(&options, crew(model, pace)?, stop.clone())?;
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

fn options(model: &GreyBox, pace: Pace, folder: &Path) -> Result<Options> {
    let free_port: greylag::link::address::Address = "udpin:127.0.0.1:0".parse()?;
    Ok(Options {
        vehicle: free_port.clone(),
        clients: vec![free_port],
        record: Some(Place::Exactly(folder.to_owned())),
        pace,
        duration: None,
        plan_deadline: Options::PLAN_DEADLINE,
        controller: None,
        signing: None,
        deflection: model.airframe.actuators.deflection_max,
    })
}

/// LQI in the loop. In lockstep the aircraft's seconds are milliseconds of the client's, so that
/// it may be silent for longer of them.
fn crew(model: &GreyBox, pace: Pace) -> Result<Crew> {
    let mut config = Config::for_model(model)?;
    if pace == Pace::Lockstep {
        config.offboard_loss_s = 60.0;
    }
    let controller = build(Kind::Lqi, model)?;
    let pilot = Pilot::new(config, controller.boxed_clone())?;
    Ok(Crew { pilot, controller, seat: Seat::Loop })
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

/// Sends setpoints at 50 Hz until the simulation is over; arms and enters OFFBOARD on the way.
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
        // A time-out is no news.
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
