//! Tests of the PX4 simulator API: rates, lockstep, reconnection, and clients that are not PX4.

use std::io::Read;
use std::net::TcpStream;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::px4_client::*;
use crate::real_time;
use greylag_sitl::plant::Inputs;
use greylag_sitl::plant::{Plant, PlantOptions, Start};
use greylag_sitl::shim::{Launch, Pace, Px4Event, ShimOptions};
use mavlink::MavlinkVersion;
use mavlink::dialects::ardupilotmega::*;

/// Sufficient wait to detect an unwanted message.
const MOMENT: Duration = Duration::from_millis(60);

#[test]
fn sensors_come_every_4_ms_of_simulated_time_and_the_others_at_their_rates() {
    let simulator = Simulator::start(hurried());
    let mut px4 = Px4::boot(simulator.address);
    let steps: Vec<Shown> = (0..2500).map(|_| px4.step([0.0; 16])).collect();
    let times: Vec<u64> = steps.iter().map(|s| s.sensor.time_usec).collect();
    assert!(times.windows(2).all(|t| t[1] - t[0] == STEP_US), "250 Hz, none left out");
    // In 10 s: GPS at 10 Hz, but not before the first HIL_SENSOR.
    let gps: Vec<u64> = steps.iter().filter_map(|s| Some(s.gps.as_ref()?.time_usec)).collect();
    assert!((99..=100).contains(&gps.len()), "{}", gps.len());
    assert!(gps.windows(2).all(|t| t[1] - t[0] == 100_000));
    assert!(steps[0].gps.is_none(), "PX4 has no clock before its first HIL_SENSOR");
    // PX4 requests the state every 5 ms.
    let states = steps.iter().filter(|s| s.state.is_some()).count();
    assert!((1980..=2001).contains(&states), "{states} in 10 s");
    // The flags of magnetometer and air-pressure sensors are set at 50 Hz.
    let slow = HilSensorUpdatedFlags::from_bits_retain(0x1FC0);
    let fast = HilSensorUpdatedFlags::from_bits_retain(0x003F);
    assert!(steps.iter().all(|s| s.sensor.fields_updated.contains(fast)));
    let slower = steps.iter().filter(|s| s.sensor.fields_updated.contains(slow)).count();
    assert_eq!(slower, 500);
    assert!(steps.iter().all(
        |s| s.sensor.fields_updated.contains(slow) || !s.sensor.fields_updated.intersects(slow)
    ));
    let summary = simulator.stop();
    println!("{} steps in {:.2} s of wall time", summary.frames, summary.wall_s);
    assert!(summary.answers >= 2499 && summary.wrong_answers == 0, "{summary}");
}

#[test]
fn no_step_is_made_beyond_the_last_that_was_answered() {
    let simulator = Simulator::start(hurried());
    let mut px4 = Px4::boot(simulator.address);
    px4.armed = true;
    let mut last = (0..20).map(|_| px4.step([0.0; 16])).last().unwrap().sensor.time_usec;
    for turn in 0..10 {
        let shown = px4.shown().sensor.time_usec;
        assert_eq!(shown, last + STEP_US);
        // Neither silence, nor answers to earlier steps, nor an answer with a future time, nor an answer with NaN may cause a
        // step.
        assert!(px4.receive(MOMENT).is_none(), "turn {turn}: a step without an answer");
        px4.answer(last, [0.0; 16]);
        px4.answer(last - 5 * STEP_US, [0.0; 16]);
        px4.answer(shown + STEP_US, [0.0; 16]);
        px4.answer(shown, [f32::NAN; 16]);
        px4.send_bytes(b"\xFD garbage \xFE\x00");
        assert!(px4.receive(MOMENT).is_none(), "turn {turn}: a step on a wrong answer");
        px4.answer(shown, [0.0; 16]);
        // A repeated answer does not cause a second step.
        px4.answer(shown, [0.0; 16]);
        last = shown;
    }
    let shown = px4.shown().sensor.time_usec;
    assert_eq!(shown, last + STEP_US);
    let summary = simulator.stop();
    assert_eq!(
        (summary.stale_answers, summary.wrong_answers, summary.unusable_answers),
        (20, 10, 10),
        "{summary}"
    );
    assert!(summary.bad_frames >= 10, "{summary}");
}

#[test]
fn a_client_that_echoes_the_simulators_time_or_has_a_clock_of_its_own_is_understood() {
    let simulator = Simulator::start(hurried());
    let mut echo = Px4::boot(simulator.address);
    for _ in 0..50 {
        let time = echo.shown().sensor.time_usec;
        echo.answer_at(time, [0.0; 16]);
    }
    drop(echo);
    simulator.until(|e| *e == Px4Event::Gone);
    let mut own = Px4::boot(simulator.address);
    for step in 0..50 {
        own.shown();
        own.answer_at(1_763_000_000_000_001 + step, [0.0; 16]);
    }
    simulator.until(|e| *e == Px4Event::ForeignClock);
    simulator.stop();
}

#[test]
fn outputs_move_the_aircraft_exactly_as_they_move_the_plant() {
    let mut options = hurried();
    options.launch = Launch::Immediate;
    let simulator = Simulator::start(options);
    let mut px4 = Px4::boot(simulator.address);
    px4.armed = true;
    let plant = PlantOptions { step_s: 0.004, ..PlantOptions::default() };
    let mut plant = Plant::new(&plant).unwrap();
    plant.reset(&Start::NEUTRAL).unwrap();
    let mut largest: f64 = 0.0;
    for k in 0..750 {
        let t = k as f32 * 0.004;
        // Roll, pitch and throttle vary together, each with a different period.
        let (roll, pitch, throttle) =
            (0.1 * (3.0 * t).sin(), 0.05 * (2.0 * t).cos(), 0.4 + 0.3 * t.sin());
        let shown = px4.step(outputs(roll, pitch, throttle));
        let truth = plant.truth();
        for (shown, truth) in [
            (shown.sensor.xgyro, truth.p_radps),
            (shown.sensor.ygyro, truth.q_radps),
            (shown.sensor.zgyro, truth.r_radps),
            (shown.sensor.xacc, truth.specific_force_mps2[0]),
            (shown.sensor.zacc, truth.specific_force_mps2[2]),
        ] {
            largest = largest.max((f64::from(shown) - truth).abs());
        }
        let [roll, pitch, throttle] = [roll, pitch, throttle].map(f64::from);
        // A positive elevator of the plant pitches down, but that of PX4 pitches up.
        plant.step(Inputs { aileron: roll, elevator: -pitch, throttle, rudder: 0.0 }).unwrap();
    }
    // The messages contain floats, whose resolution is 1e-6 at 10 m/s².
    assert!(largest < 2e-6, "{largest}");
    simulator.stop();
}

#[test]
fn each_output_acts_with_its_sign() {
    let respond = |controls: [f32; 16]| {
        let mut options = hurried();
        options.launch = Launch::Immediate;
        let simulator = Simulator::start(options);
        let mut px4 = Px4::boot(simulator.address);
        px4.armed = true;
        let last = (0..50).map(|_| px4.step(controls)).last().unwrap().sensor;
        simulator.stop();
        last
    };
    let neutral = respond(outputs(0.0, 0.0, 0.3));
    let one = |output: usize, value: f32| {
        let mut controls = outputs(0.0, 0.0, 0.3);
        controls[output] = value;
        respond(controls)
    };
    // After 0.2 s with a fifth of the travel, the X8 rolls at about 0.3 rad/s and pitches at 0.5 rad/s.
    assert!(one(RIGHT_AILERON, 0.2).xgyro > neutral.xgyro + 0.1, "right trailing edge up: right");
    assert!(one(LEFT_AILERON, 0.2).xgyro < neutral.xgyro - 0.1, "left trailing edge up: left");
    assert!(one(ELEVATOR, 0.2).ygyro > neutral.ygyro + 0.1, "trailing edge up: nose up");
    assert!(one(THROTTLE, 0.9).xacc > neutral.xacc + 0.5, "throttle pulls");
    // Outputs without a control have no effect.
    assert_eq!(one(0, 1.0), neutral);
    assert_eq!(one(15, -1.0), neutral);
}

fn without_lockstep_time_is_the_walls() {
    let mut options = hurried();
    options.pace = Pace::RealTime;
    let simulator = Simulator::start(options);
    let mut px4 = Px4::boot(simulator.address);
    px4.flags = 0;
    let first = px4.step([0.0; 16]).sensor.time_usec;
    let begun = Instant::now();
    let mut last = first;
    while begun.elapsed() < Duration::from_secs(2) {
        last = px4.step([0.0; 16]).sensor.time_usec;
    }
    let simulated = (last - first) as f64 * 1e-6;
    // A machine that pauses for more than 0.1 s loses that time; the limit allows 10 %.
    assert!((1.8..2.05).contains(&simulated), "{simulated} s in 2 s");
    // A client that becomes silent does not stop the simulation, and the silence is reported.
    std::thread::sleep(Duration::from_millis(1300));
    simulator.until(|e| *e == Px4Event::Silent);
    let (mut now, drained) = (last, Instant::now());
    while drained.elapsed() < Duration::from_millis(300) {
        now = px4.shown().sensor.time_usec;
    }
    assert!(now - last > 1_000_000, "{} µs", now - last);
    px4.step([0.0; 16]);
    simulator.until(|e| *e == Px4Event::SilenceEnded);
    simulator.stop();
}

fn lockstep_keeps_to_the_wall_clock_unless_it_is_told_to_hurry() {
    let mut options = hurried();
    options.pace = Pace::RealTime;
    let simulator = Simulator::start(options);
    let mut px4 = Px4::boot(simulator.address);
    px4.step([0.0; 16]);
    let begun = Instant::now();
    px4.idle(250);
    let taken = begun.elapsed();
    // The run must not be faster than real time, but may be slower on a busy machine.
    assert!((0.98..2.0).contains(&taken.as_secs_f64()), "{taken:?} for a second");
    simulator.stop();
}

fn a_client_that_stops_answering_is_told_and_may_be_replaced() {
    let simulator = Simulator::start(hurried());
    let mut hung = Px4::boot(simulator.address);
    hung.idle(10);
    let begun = Instant::now();
    simulator.until(|e| *e == Px4Event::Stopped);
    assert!((0.5..4.0).contains(&begun.elapsed().as_secs_f64()), "{:?}", begun.elapsed());
    // After an interruption, the run resumes at the same step.
    let time = hung.shown().sensor.time_usec;
    assert!(hung.receive(MOMENT).is_none());
    hung.answer(time, [0.0; 16]);
    simulator.until(|e| *e == Px4Event::Resumed);
    assert_eq!(hung.shown().sensor.time_usec, time + STEP_US);
    // The client itself may wait for a sensor, so a step is made every 3 s.
    let begun = Instant::now();
    assert_eq!(hung.shown().sensor.time_usec, time + 2 * STEP_US);
    assert!(begun.elapsed() > Duration::from_secs(2), "{:?}", begun.elapsed());
    // While the client stays silent, another client replaces it.
    simulator.until(|e| *e == Px4Event::Stopped);
    let mut other = Px4::boot(simulator.address);
    other.idle(10);
    simulator.stop();
}

#[test]
fn a_second_client_is_turned_away_while_the_first_is_alive() {
    let simulator = Simulator::start(hurried());
    let mut first = Px4::boot(simulator.address);
    first.step([0.0; 16]);
    let mut second = TcpStream::connect(simulator.address).unwrap();
    second.set_read_timeout(Some(Duration::from_millis(20))).unwrap();
    let mut closed = false;
    for _ in 0..200 {
        first.step([0.0; 16]);
        closed |= matches!(second.read(&mut [0; 64]), Ok(0));
        if closed {
            break;
        }
    }
    assert!(closed, "the second connection is closed");
    first.step([0.0; 16]);
    simulator.stop();
}

#[test]
fn a_client_that_comes_back_finds_the_aircraft_at_its_start_and_time_going_on() {
    let simulator = Simulator::start(hurried());
    let mut px4 = Px4::boot(simulator.address);
    px4.step([0.0; 16]);
    px4.launch();
    let flown = (0..500).map(|_| px4.step(outputs(0.1, 0.0, 0.5))).last().unwrap().sensor;
    drop(px4);
    simulator.until(|e| *e == Px4Event::Gone);
    let mut again = Px4::boot(simulator.address);
    let first = again.step([0.0; 16]).sensor;
    assert!(first.time_usec >= flown.time_usec, "time never goes back");
    let shown: Vec<Shown> = (0..60).map(|_| again.step([0.0; 16])).collect();
    let gps = shown.iter().find_map(|s| s.gps.clone()).unwrap();
    assert_eq!((gps.vel, gps.alt), (0, 600_000), "on its stand");
    simulator.stop();
}

#[test]
fn what_is_not_px4_is_said_once_and_a_wrong_protocol_is_not_flown() {
    let simulator = Simulator::start(hurried());
    let mut old = Px4::connect(simulator.address);
    old.shown();
    old.version = MavlinkVersion::V1;
    old.armed = true;
    for _ in 0..5 {
        let time = old.shown().sensor.time_usec;
        // MAVLink 1 also has this message, but it must not count as an answer.
        old.answer(time, outputs(0.0, 0.0, 1.0));
    }
    let told = simulator.until(|e| matches!(e, Px4Event::Refused(_))).to_string();
    assert!(told.contains("MAVLink 1") && !told.contains('\n'), "{told}");
    drop(old);
    simulator.until(|e| *e == Px4Event::Gone);
    let mut other = Px4::connect(simulator.address);
    other.heartbeat(MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA);
    other.heartbeat(MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA);
    let told = simulator.until(|e| matches!(e, Px4Event::Refused(_))).to_string();
    assert!(told.contains("not of PX4"), "{told}");
    other.idle(30);
    let more = simulator.notices.try_iter().map(|n| n.event.to_string());
    assert!(more.filter(|words| words.contains("not of PX4")).count() == 0, "said once");
    let summary = simulator.stop();
    assert!(summary.foreign_frames >= 5, "{summary}");
    assert_eq!(summary.flown_s, 0.0, "the old client's throttle was not flown");
}

#[test]
fn what_cannot_be_is_refused_before_anything_is_opened() {
    let refused = |change: fn(&mut ShimOptions), words: &str| {
        let mut options = hurried();
        change(&mut options);
        let stopped = std::sync::atomic::AtomicBool::new(true);
        let run = greylag_sitl::shim::run(&options, &stopped, &mut |_| panic!("it has begun"));
        let error = run.expect_err("refused").to_string();
        assert!(error.contains(words) && !error.contains('\n'), "{error}");
    };
    refused(|o| o.link = "udpin:127.0.0.1:0".parse().unwrap(), "tcpin");
    refused(|o| o.faults.drop_probability = 0.1, "--px4-noise");
    refused(|o| o.bias.alpha_rad = 0.01, "flow angles");
    refused(|o| o.clock_start_s = 10.0, "--clock-start-s");
    refused(|o| o.personality = Some(greylag_sitl::shim::Personality::Px4), "--personality");
}

#[test]
fn the_program_waits_for_px4_and_names_bad_options() {
    let sitl = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_greylag-sitl"));
        command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    };
    for (arguments, named) in [
        (&["--px4-sim", "--px4-outputs", "aileron=1"][..], "pitch is moved by nothing"),
        (&["--px4-sim", "udpin:127.0.0.1:0"][..], "tcpin"),
        (&["--px4-sim", "--personality", "px4"][..], "personality"),
        (&["--px4-outputs", "aileron=1,elevator=2,throttle=3"][..], "px4-sim"),
    ] {
        let output = sitl(arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && errors.contains(named), "{arguments:?}: {errors}");
    }
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let link = format!("tcpin:{}", taken.local_addr().unwrap());
    let output = sitl(&["--px4-sim", &link]).output().unwrap();
    assert!(String::from_utf8_lossy(&output.stderr).contains("in use"));
    let mut child = sitl(&["--px4-sim", "tcpin:127.0.0.1:0"]).spawn().unwrap();
    std::thread::sleep(Duration::from_millis(800));
    child.kill().unwrap();
    let said = child.wait_with_output().unwrap().stdout;
    let said = String::from_utf8_lossy(&said);
    assert!(said.contains("waiting for PX4") && said.contains("PX4_SYS_AUTOSTART"), "{said}");
}

real_time::tests!(
    without_lockstep_time_is_the_walls,
    lockstep_keeps_to_the_wall_clock_unless_it_is_told_to_hurry,
    a_client_that_stops_answering_is_told_and_may_be_replaced,
);
