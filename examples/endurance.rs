//! Flies for a day or more in lockstep. Checks that memory does not grow, that wrapping counters are handled and that every
//! cycle is answered.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl --example endurance -- \
//!     [--hours 24] [--sockets] [--opposite sitl|px4|ardupilot]
//! ```
//! Without `--sockets` the companion and the vehicle exchange bytes within this process, at about a thousand times real time.
//! With `--sockets` they run as in flight, with threads, UDP sockets and a client, at about a hundred times real time.
//!
//! The vehicle's clock starts so that its 32-bit counter of milliseconds wraps in the middle of the flight. Its microseconds
//! wrap after 35.8 minutes as i32 and after 71.6 minutes as u32. Sequence numbers wrap every few seconds.

use std::net::{Ipv4Addr, UdpSocket};
use std::path::Path;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail, ensure};
use greylag::commands::controllers::POLICY;
use greylag::commands::fly::{self, companion_with};
use greylag::control::{ControllerKind, build};
use greylag::flight::desk::Desk;
use greylag::flight::pilot::{Config, Pilot};
use greylag::flight::runtime::{Companion, Flight, FlightOptions, Pace, Placement};
use greylag::link::autopilot::{AttitudeSetpoint, Autopilot, Mode, Verdict};
use greylag::link::framing::{FrameCounts, Frames};
use greylag::link::offboard::{Heard, OffboardClient};
use greylag::link::vehicle::{Authority, Profile, Real, Sitl, Stack, Vehicle};
use greylag::model::GreyBox;
use greylag_sitl::plant::{PlantOptions, Start, Truth};
use greylag_sitl::shim::bench::Bench;
use greylag_sitl::shim::controller::FlightController;
use greylag_sitl::shim::{self, Launch, Noise, Personality, ShimOptions};

/// Period of a 32-bit counter of milliseconds, s.
const WRAP_S: f64 = 4_294_967.296;
/// Duration of a leg, s.
const LEG_S: u64 = 30;
/// Roll and pitch of the legs, degrees. Climbs and descents balance.
const LEGS: [(f64, f64); 4] = [(0.0, 2.0), (35.0, 5.0), (0.0, 2.0), (-35.0, 0.0)];
/// Largest accepted growth of memory, bytes. It allows for the fragmentation of the heap.
const FLAT: u64 = 2 << 20;
/// Id of the message VFR_HUD, which has the altitude (m) in its third 32-bit word.
const VFR_HUD: u32 = 74;
/// Range of altitudes, m. Outside it the pitch of the legs is corrected.
const ALTITUDE_M: (f64, f64) = (300.0, 900.0);

fn main() -> Result<ExitCode> {
    let mut arguments = std::env::args().skip(1);
    let (mut hours, mut sockets, mut opposite) = (24.0, false, "sitl".to_owned());
    while let Some(word) = arguments.next() {
        match word.as_str() {
            "--hours" => hours = arguments.next().context("--hours needs a number")?.parse()?,
            "--opposite" => opposite = arguments.next().context("--opposite needs a name")?,
            "--sockets" => sockets = true,
            _ => bail!("{word}: known are --hours N, --opposite NAME, --sockets"),
        }
    }
    let model = fly::model("params/x8/jsbsim.toml".as_ref(), None)?;
    match sockets {
        true => through_sockets(&model, hours)?,
        false => in_process(&model, hours, &opposite)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Resident memory of this process, bytes.
fn resident() -> Result<u64> {
    let text = std::fs::read_to_string("/proc/self/status").context("reading the memory's size")?;
    let line = text.lines().find(|line| line.starts_with("VmRSS")).context("no VmRSS")?;
    Ok(1024 * line.split_whitespace().nth(1).context("no number")?.parse::<u64>()?)
}

fn shim_options(hours: f64) -> ShimOptions {
    let mut options = ShimOptions::new(PlantOptions::default(), Start::NEUTRAL);
    options.clock_start_s = (WRAP_S - hours * 1800.0).max(0.0);
    options.noise = Noise::REALISTIC;
    options
}

enum Aircraft {
    Sitl(Box<Bench>),
    Real(Box<FlightController>),
}

impl Aircraft {
    fn show(&mut self, out: &mut Vec<u8>) -> Truth {
        match self {
            Aircraft::Sitl(bench) => {
                bench.show(out);
                bench.measured()
            }
            Aircraft::Real(controller) => {
                controller.show(out);
                controller.measured()
            }
        }
    }

    fn fly(&mut self, heard: &[u8]) -> Result<()> {
        let over = match self {
            Aircraft::Sitl(bench) => {
                bench.receive(heard);
                bench.fly()?
            }
            Aircraft::Real(controller) => {
                controller.receive(heard);
                controller.fly()?
            }
        };
        ensure!(over.is_none(), "the flight is over: {over:?}");
        Ok(())
    }
}

fn in_process(model: &GreyBox, hours: f64, opposite: &str) -> Result<()> {
    let mut options = shim_options(hours);
    let actuators = model.airframe.actuators;
    let (mut aircraft, vehicle) = match opposite {
        "sitl" => (
            Aircraft::Sitl(Box::new(Bench::new(&options)?)),
            Vehicle::Sitl(Sitl::new(1, actuators.travels())),
        ),
        "px4" | "ardupilot" => {
            options.launch = Launch::Immediate;
            let (personality, stack) = match opposite {
                "px4" => (Personality::Px4, Stack::Px4),
                _ => (Personality::Ardupilot, Stack::Ardupilot),
            };
            let profile = Profile { stack, authority: Authority::Surfaces, actuators };
            (
                Aircraft::Real(Box::new(FlightController::new(personality, &options)?)),
                Vehicle::Real(Box::new(Real::new(profile))),
            )
        }
        other => bail!("{other}: known are sitl, px4, ardupilot"),
    };
    let mut desk =
        Desk::new(companion_with(ControllerKind::Lqi, model, Path::new(POLICY))?, vehicle);
    let steps = (hours * 360_000.0) as u64;
    let begun = Instant::now();
    let (mut down, mut up) = (Vec::new(), Vec::new());
    let (mut armed, mut ticks, mut late, mut worst, mut texts) = (false, 0u64, 0u64, 0.0f64, 0u64);
    let mut before = None;
    for step in 0..steps {
        let host = Duration::from_secs(1) + Duration::from_millis(10 * step);
        down.clear();
        let truth = aircraft.show(&mut down);
        let mut ticked = 0;
        desk.receive(host, &down, &mut up, |_, _| ticked += 1);
        ticks += ticked;
        // after the first state, every state must be answered by a command within its own step
        late += u64::from(ticks > 0 && ticked != 1);
        let (roll, pitch) = leg(step / (100 * LEG_S), truth.altitude_m);
        if step % 10 == 0 {
            let now = desk.now(host);
            let setpoint = AttitudeSetpoint {
                roll: roll.to_radians(),
                pitch: pitch.to_radians(),
                thrust: None,
            };
            if !armed && desk.arm(host) == Verdict::Accepted {
                armed = true;
                desk.pilot().attitude_setpoint(now, setpoint);
                let verdict = desk.pilot().set_mode(now, Mode::Offboard);
                ensure!(verdict == Verdict::Accepted, "OFFBOARD: {verdict:?}");
            }
            desk.pilot().attitude_setpoint(now, setpoint);
        }
        // the attitude is settled in the second half of each leg
        if armed && step > 6000 && step % (100 * LEG_S) > 50 * LEG_S {
            worst = worst.max((truth.roll_rad.to_degrees() - roll).abs());
        }
        desk.poll(host, &mut up);
        aircraft.fly(&std::mem::take(&mut up))?;
        for text in desk.texts.drain(..) {
            texts += 1;
            if texts <= 20 {
                println!("  {:.2} h: {}", step as f64 / 360_000.0, text.words);
            }
        }
        if step == 60_000 || (step > 0 && step % (steps / 6).max(1) == 0) {
            let (now, first) = (resident()?, *before.get_or_insert(resident()?));
            println!(
                "{:5.2} h: memory {:.2} MB ({:+} kB since ten minutes)",
                step as f64 / 360_000.0,
                now as f64 / 1e6,
                (now as i64 - first as i64) / 1000
            );
        }
    }
    let grown = resident()?.saturating_sub(before.unwrap_or(0));
    let counts = desk.vehicle().counts();
    println!(
        "{opposite}: {hours} h in {:.0} s; {ticks} states answered, {late} steps without exactly one, \
         {} lost, {} starts; largest roll error in the second half of legs {worst:.2} deg; \
         memory grew by {} kB; {texts} texts",
        begun.elapsed().as_secs_f64(),
        counts.lost,
        counts.starts,
        grown / 1000
    );
    ensure!(late == 0 && counts.lost == 0 && counts.starts == 1, "a cycle was left out");
    ensure!(grown < FLAT, "memory grew");
    ensure!(worst < 5.0, "the aircraft was not held");
    Ok(())
}

/// Roll and pitch of a leg, degrees. The pitch is corrected if the aircraft is too high or too low.
fn leg(number: u64, altitude_m: f64) -> (f64, f64) {
    let (roll, pitch) = LEGS[number as usize % LEGS.len()];
    let pitch = match altitude_m {
        low if low < ALTITUDE_M.0 => 8.0,
        high if high > ALTITUDE_M.1 => -5.0,
        _ => pitch,
    };
    (roll, pitch)
}

fn through_sockets(model: &GreyBox, hours: f64) -> Result<()> {
    let stop = Arc::new(AtomicBool::new(false));
    let free_port: greylag::link::address::Address = "udpin:127.0.0.1:0".parse()?;
    let options = FlightOptions {
        vehicle: free_port.clone(),
        clients: vec![free_port],
        record: None,
        pace: Pace::Lockstep,
        duration: None,
        plan_deadline: FlightOptions::PLAN_DEADLINE,
        controller: None,
        travels: model.airframe.actuators.travels(),
        mixer: model.airframe.mixer.clone(),
        delay_margin: None,
        signing: None,
    };
    // a minute of the aircraft's time is about half a second of the client's
    let config = Config { offboard_loss_s: 60.0, ..Config::for_model(model)? };
    let controller = build(ControllerKind::Lqi, model)?;
    let pilot = Pilot::new(config, controller.boxed_clone())?;
    let flight = Flight::start(
        &options,
        Companion { pilot, controller, placement: Placement::Loop },
        stop.clone(),
    )?;
    let vehicle = flight.vehicle.context("no vehicle link")?;
    let client = flight.clients.first().copied().flatten().context("no client link")?;
    let shim_options = ShimOptions {
        link: format!("udpout:{vehicle}").parse()?,
        pace: shim::Pace::Lockstep,
        duration_s: Some(hours * 3600.0),
        ..shim_options(hours)
    };
    let told = stop.clone();
    let shim = std::thread::spawn(move || shim::run(&shim_options, &told, &mut |_| ()));
    let steered = steer(client, &shim);
    let end = resident()?;
    stop.store(true, Ordering::Relaxed);
    let flown = shim.join().map_err(|_| anyhow::anyhow!("the shim's thread has died"))??;
    let summary = flight.join().context("the control thread has died")?;
    let (early, resets) = steered?;
    println!("{summary}\n{flown}");
    println!(
        "{hours} h through sockets, {:.0} times real time; memory {:.2} MB after ten seconds, {:.2} MB \
         at the end; {} state frames lost, {} steps without an answer, {} cycles missed; \
         OFFBOARD entered {resets} times",
        flown.flown_s / flown.wall_s,
        early as f64 / 1e6,
        end as f64 / 1e6,
        summary.vehicle.lost,
        flown.unanswered_steps,
        summary.timing.missed
    );
    ensure!(end.saturating_sub(early) < 2 * FLAT, "memory grew");
    let missed = summary.timing.missed + summary.vehicle.lost + flown.unanswered_steps;
    ensure!(missed == 0, "a cycle was left out");
    Ok(())
}

type Simulation = std::thread::JoinHandle<Result<shim::Summary, shim::ShimError>>;

/// Sends setpoints until the simulation has ended. Returns the resident memory after ten seconds (bytes) and the number of
/// times that OFFBOARD was entered.
fn steer(companion: std::net::SocketAddr, simulation: &Simulation) -> Result<(u64, u32)> {
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
    socket.connect(companion)?;
    socket.set_read_timeout(Some(Duration::from_millis(20)))?;
    let (mut client, start) = (OffboardClient::default(), Instant::now());
    let (mut state, mut entered, mut due) = (None, 0, start);
    let mut altitude = 600.0;
    let (mut ask_due, mut early, mut was) = (start + Duration::from_millis(200), None, false);
    while !simulation.is_finished() {
        let now = Instant::now();
        if now >= due {
            due = now + Duration::from_millis(20);
            let (roll, pitch) = leg(start.elapsed().as_secs(), altitude);
            let time_ms = start.elapsed().as_millis() as u32;
            socket.send(&client.setpoint(time_ms, roll.to_radians(), pitch.to_radians()))?;
        }
        let offboard = matches!(state, Some((true, Some(Mode::Offboard))));
        entered += u32::from(offboard && !was);
        was = offboard;
        if now >= ask_due && !offboard {
            ask_due = now + Duration::from_millis(50);
            let armed = matches!(state, Some((true, _)));
            socket.send(&if armed { client.set_mode(Mode::Offboard) } else { client.arm() })?;
        }
        if early.is_none() && start.elapsed() > Duration::from_secs(10) {
            early = Some(resident()?);
        }
        let mut datagram = [0; 2048];
        // after a time-out there are no bytes to read
        let length = socket.recv(&mut datagram).unwrap_or(0);
        for frame in Frames::new(&datagram[..length], &mut FrameCounts::default()) {
            if let (VFR_HUD, Some(&[a, b, c, d])) = (frame.id, frame.payload.get(8..12)) {
                altitude = f64::from(f32::from_le_bytes([a, b, c, d]));
            }
        }
        client.read(&datagram[..length], |heard| {
            if let Heard::Heartbeat { armed, mode } = heard {
                state = Some((armed, mode));
            }
        });
    }
    Ok((early.context("it ended too soon")?, entered))
}
