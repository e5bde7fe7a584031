//! The whole companion over real sockets: a scripted vehicle on one side, clients on the other.

use std::io::{Read, Write};
use std::net::{TcpStream, UdpSocket};
use std::time::Duration;

use crate::flight_support::*;
use crate::real_time;
use greylag::control::{Controller, ControllerKind, Observation, Target};
use greylag::flight::recorder::Place;
use greylag::flight::runtime::{Event, Pace, Placement, Signing, VehicleLink};
use greylag::link::signing::Key;
use greylag::logs::csv::{self, Tolerance};
use greylag::physics::Command;
use mavlink::dialects::ardupilotmega::*;

/// Longer than any answer takes, short enough to notice that none comes.
const PATIENCE: Duration = Duration::from_secs(2);

/// A flight in real time with one client, in OFFBOARD at 20° of bank.
fn in_offboard() -> (Companion, WallVehicle, Client) {
    let companion = Companion::start(&options(Pace::RealTime));
    let vehicle = Vehicle::new(companion.vehicle()).on_the_wall();
    let mut client = Client::new(companion.client(0));
    client.engage(20.0, 5.0);
    (companion, vehicle, client)
}

/// Ends a flight: every frame was answered, and no surface has stepped.
fn land(companion: Companion, vehicle: WallVehicle) -> Vehicle {
    let vehicle = vehicle.land();
    let summary = companion.end();
    check_surfaces(&vehicle.answers);
    println!("{summary}");
    vehicle
}

fn an_attitude_is_flown_and_setpoint_loss_ends_level_in_hold() {
    let (companion, vehicle, mut client) = in_offboard();
    client.steer(20.0, 5.0, 6.0);
    client.wait_for_mode(HOLD);
    let lost = client.log.len();
    client.wait_for_text("setpoints lost");
    // Setpoints that come again do not bring the mode back.
    client.steer(20.0, 5.0, 4.0);
    client.catch_up();
    let back = |m: &MavMessage| matches!(m, MavMessage::HEARTBEAT(h) if h.custom_mode == OFFBOARD);
    assert!(!client.log[lost..].iter().any(back));
    let critical = |m: &MavMessage| matches!(m, MavMessage::HEARTBEAT(h) if h.system_status == MavState::MAV_STATE_CRITICAL);
    assert!(client.log.iter().any(critical));
    // In OFFBOARD the last seconds were settled at the target: 0.5° is ten times what LQI leaves
    // on its own model, and a twentieth of the command.
    let settled = |m: &&MavMessage| matches!(m, MavMessage::ATTITUDE(a) if (a.roll.to_degrees() - 20.0).abs() < 0.5 && (a.pitch.to_degrees() - 5.0).abs() < 0.5);
    assert!(client.log.iter().filter(settled).count() > 10);
    let vehicle = land(companion, vehicle);
    assert!(vehicle.state().roll.to_degrees().abs() < 0.5, "{:?}", vehicle.state());
}

fn a_lost_vehicle_is_told_and_flown_in_hold_when_it_is_back() {
    let (companion, vehicle, mut client) = in_offboard();
    client.steer(20.0, 5.0, 2.0);
    vehicle.trouble(Trouble::Silent);
    client.wait_for_mode(HOLD);
    client.wait_for_text("vehicle link lost");
    vehicle.trouble(Trouble::None);
    client.wait_for_text("vehicle link back");
    client.steer(20.0, 5.0, 4.0);
    let vehicle = land(companion, vehicle);
    // Never back in OFFBOARD by itself: level, although setpoints of 20° kept coming.
    assert!(vehicle.state().roll.to_degrees().abs() < 1.0, "{:?}", vehicle.state());
}

fn a_vehicle_whose_rates_are_not_numbers_is_held_level_and_told() {
    let (companion, vehicle, mut client) = in_offboard();
    client.steer(20.0, 5.0, 1.0);
    vehicle.trouble(Trouble::NotANumber);
    client.wait_for_text("vehicle state refused: body rates");
    client.wait_for_mode(HOLD);
    std::thread::sleep(Duration::from_millis(300));
    let vehicle = land(companion, vehicle);
    // Trim of the X8 at 20 m/s: elevator 0.0688 / 0.5235, throttle 0.185.
    let last = vehicle.answers.last().unwrap();
    assert_eq!(last.aileron, 0.0);
    assert!(
        (last.elevator - 0.1314).abs() < 0.005 && (last.throttle - 0.185).abs() < 0.005,
        "{last:?}"
    );
}

fn setpoints_of_garbage_move_nothing_and_do_not_keep_offboard_alive() {
    let (companion, vehicle, mut client) = in_offboard();
    client.steer(20.0, 5.0, 3.0);
    let nan = f64::NAN;
    for i in 0..40 {
        let q = [
            [nan; 4],
            [1e30, 0.0, 0.0, 0.0],
            [0.0; 4],
            [f64::INFINITY, 0.0, 0.0, 1.0],
            [1.0, nan, 0.0, 0.0],
        ][i % 5];
        client.send(&raw_setpoint(q));
        std::thread::sleep(Duration::from_millis(50));
    }
    client.wait_for_text("setpoints lost");
    client.wait_for_mode(HOLD);
    assert!(client.texts().iter().any(|t| t.contains("Setpoint refused")), "{:?}", client.texts());
    land(companion, vehicle);
}

fn garbage_and_a_flood_from_both_sides_delay_no_answer_and_move_no_surface() {
    let (companion, vehicle, client) = in_offboard();
    client.steer(20.0, 5.0, 3.0);
    vehicle.trouble(Trouble::Garbage);
    let good = frame(245, 190, &setpoint(20.0, 5.0));
    // 3 s of ten times the 20 Hz of setpoints, each with cut, flipped, foreign and unknown frames.
    for i in 0..600usize {
        client.send_bytes(&good);
        let mut flipped = good.clone();
        flipped[i % good.len()] ^= 1 << (i % 8);
        client.send_bytes(&flipped);
        client.send_bytes(&good[..i % good.len()]);
        client.send_bytes(&frame(1, 1, &setpoint(-60.0, 30.0)));
        client.send_bytes(&vec![i as u8; i % 2000]);
        let stranger = COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
            target_system: 7,
            ..Default::default()
        };
        client.send(&MavMessage::COMMAND_LONG(stranger));
        std::thread::sleep(Duration::from_millis(5));
    }
    let vehicle = vehicle.land();
    let summary = companion.end();
    println!("{summary}");
    check_surfaces(&vehicle.answers);
    assert!(summary.clients.frames.bad() > 500 && summary.clients.echoes > 300, "{summary:?}");
    assert!(summary.vehicle.frames.bad() > 100 && summary.vehicle.foreign > 100, "{summary:?}");
    let state = vehicle.state();
    // One flipped frame in a thousand may carry the vehicle's ids with a good CRC: none did.
    assert!(
        (state.roll.to_degrees() - 20.0).abs() < 1.0
            && (state.pitch.to_degrees() - 5.0).abs() < 1.0,
        "{state:?}"
    );
}

fn a_second_client_watches_and_a_restarted_one_takes_over() {
    let (companion, vehicle, client) = in_offboard();
    let mut second = Client::new(companion.client(0));
    second
        .wait("heartbeat", |m| matches!(m, MavMessage::HEARTBEAT(h) if h.custom_mode == OFFBOARD));
    for _ in 0..40 {
        client.setpoint(20.0, 5.0);
        second.setpoint(-50.0, 0.0);
        std::thread::sleep(Duration::from_millis(50));
    }
    second.wait_for_text("another client");
    drop(client);
    // From a new port. Authority is free after one second of silence, when the setpoints count as
    // lost as well: the restarted client may find the aircraft in HOLD, and asks for OFFBOARD.
    let mut restarted = Client::new(companion.client(0));
    restarted.steer(15.0, 2.0, 1.5);
    assert_eq!(restarted.mode(OFFBOARD), MavResult::MAV_RESULT_ACCEPTED);
    restarted.steer(15.0, 2.0, 4.0);
    let vehicle = land(companion, vehicle);
    let roll = vehicle.state().roll.to_degrees();
    assert!((roll - 15.0).abs() < 1.0, "{roll}");
}

fn a_client_over_tcp_is_served_like_any_other() {
    let companion = Companion::start(&options(Pace::RealTime));
    let mut vehicle = Vehicle::new(companion.vehicle());
    vehicle.step(Trouble::None, PATIENCE).unwrap();
    let mut stream = TcpStream::connect(companion.client(1)).unwrap();
    stream.set_read_timeout(Some(PATIENCE)).unwrap();
    let arm = COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        param1: 1.0,
        target_system: 1,
        ..Default::default()
    };
    stream.write_all(&frame(245, 190, &MavMessage::COMMAND_LONG(arm))).unwrap();
    let mut bytes = Vec::new();
    let mut chunk = [0; 1024];
    let acknowledged = |bytes: &[u8]| bytes.windows(10).any(|w| w[0] == 0xFD && w[7] == 77);
    while !acknowledged(&bytes) {
        let len = stream.read(&mut chunk).unwrap();
        assert!(len > 0);
        bytes.extend_from_slice(&chunk[..len]);
    }
    assert!(vehicle.step(Trouble::None, PATIENCE).unwrap().armed);
}

/// Flies 2000 steps in lockstep from the same start, armed from the first.
fn lockstep_flight(kind: ControllerKind) -> Vec<Answer> {
    let options = options(Pace::Lockstep);
    let companion = Companion::with(
        &options,
        greylag::commands::fly::companion_with(kind, x8(), std::path::Path::new("")).unwrap(),
    );
    let mut vehicle = Vehicle::new(companion.vehicle());
    vehicle.step(Trouble::None, PATIENCE).unwrap();
    let mut client = Client::new(companion.client(0));
    assert_eq!(client.arm(), MavResult::MAV_RESULT_ACCEPTED);
    let steps = if kind.pace() == greylag::control::Pace::Planned { 100 } else { 2000 };
    for i in 0..steps {
        assert!(vehicle.step(Trouble::None, PATIENCE).is_some(), "step {i}");
    }
    check_surfaces(&vehicle.answers);
    vehicle.answers
}

#[test]
fn lockstep_flights_are_the_same_to_the_bit() {
    for kind in [ControllerKind::Lqi, ControllerKind::PidRetuned, ControllerKind::Cem] {
        assert_eq!(lockstep_flight(kind), lockstep_flight(kind), "{kind}");
    }
}

/// A planner that takes longer than a cycle.
#[derive(Clone)]
struct Slow;

impl Controller for Slow {
    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }
    fn name(&self) -> &'static str {
        "slow"
    }
    fn reset(&mut self, _seed: u64) {}
    fn command(&mut self, _: &Observation, _: &Target) -> Command {
        std::thread::sleep(Duration::from_millis(30));
        Command { aileron: 1.0, elevator: 1.0, throttle: 1.0, rudder: 0.0 }
    }
}

#[test]
fn a_planner_that_is_always_late_leaves_the_fallback_flying_and_is_recorded() {
    let root = tempfile::tempdir().unwrap();
    let mut options = options(Pace::RealTime);
    options.record = Some(Place::Exactly(root.path().join("flight")));
    let mut companion =
        greylag::commands::fly::companion_with(ControllerKind::Lqi, x8(), std::path::Path::new(""))
            .unwrap();
    (companion.controller, companion.placement) = (Box::new(Slow), Placement::Thread);
    let companion = Companion::with(&options, companion);
    let vehicle = Vehicle::new(companion.vehicle()).on_the_wall();
    let mut client = Client::new(companion.client(0));
    client.engage(20.0, 5.0);
    client.steer(20.0, 5.0, 5.0);
    let vehicle = vehicle.land();
    let summary = companion.end();
    check_surfaces(&vehicle.answers);
    assert!((vehicle.state().roll.to_degrees() - 20.0).abs() < 1.0, "{:?}", vehicle.state());
    assert!(summary.timing.late_plans > 300, "{summary}");
    let (folder, written) = summary.recording.clone().unwrap();
    // A state that a newer one has overtaken is flown on by nobody.
    let flown = summary.vehicle.states - summary.timing.overtaken;
    assert_eq!((written.rows, written.dropped), (flown, 0));
    let reading = csv::load(&folder.join("flight.csv"), Tolerance::Strict).unwrap();
    assert_eq!(reading.flight.samples.len() as u64, written.rows);
    let text = std::fs::read_to_string(folder.join("flight.csv")).unwrap();
    assert!(text.matches(",OFFBOARD,1,late,0,").count() > 300);
    // The tlog holds both sides' traffic: at least a state frame's five messages with its answer.
    assert!(written.frames >= 6 * written.rows, "{written:?}");
}

#[test]
fn unsigned_frames_of_a_vehicle_on_a_signed_link_are_reported_without_a_client() {
    let root = tempfile::tempdir().unwrap();
    let key = root.path().join("key");
    Key::from_bytes([7; 32]).save(&key).unwrap();
    let mut options = options(Pace::RealTime);
    options.signing = Some(Signing { key, vehicle: VehicleLink::Signed, local: vec![] });
    let companion = Companion::start(&options);
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let heartbeat = frame(1, 200, &MavMessage::HEARTBEAT(HEARTBEAT_DATA::default()));
    socket.send_to(&heartbeat, companion.vehicle()).unwrap();
    let events = companion.flight.as_ref().unwrap().events.clone();
    // Without the report the only event is that of a missing vehicle, after 2 s.
    let reported = std::iter::from_fn(|| events.recv_timeout(2 * PATIENCE).ok())
        .take(5)
        .any(|event| matches!(event, Event::Text(text) if text.words.contains("signature")));
    assert!(reported);
    companion.end();
}

/// A state frame of the vehicle at `time_usec`, in level flight.
fn state_frame(time_usec: u64) -> Vec<u8> {
    let mut actuators = ACTUATOR_OUTPUT_STATUS_DATA { time_usec, active: 5, ..Default::default() };
    actuators.actuator[2] = 0.2;
    let attitude = ATTITUDE_QUATERNION_DATA {
        time_boot_ms: (time_usec / 1000) as u32,
        q1: 1.0,
        rollspeed: time_usec as f32 * 1e-9,
        ..Default::default()
    };
    let messages = [
        MavMessage::HIGHRES_IMU(HIGHRES_IMU_DATA { time_usec, zacc: -9.8, ..Default::default() }),
        MavMessage::VFR_HUD(VFR_HUD_DATA { airspeed: 20.0, alt: 600.0, ..Default::default() }),
        MavMessage::AOA_SSA(AOA_SSA_DATA { time_usec, ..Default::default() }),
        MavMessage::ACTUATOR_OUTPUT_STATUS(actuators),
        MavMessage::ATTITUDE_QUATERNION(attitude),
    ];
    messages.iter().flat_map(|message| frame(1, 200, message)).collect()
}

#[test]
fn of_many_states_in_one_datagram_the_newest_is_answered() {
    let companion = Companion::start(&options(Pace::RealTime));
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(PATIENCE)).unwrap();
    let states: Vec<u8> = (1..=12).flat_map(|k| state_frame(10_000 * k)).collect();
    socket.send_to(&states, companion.vehicle()).unwrap();
    let answered = std::iter::from_fn(|| {
        let mut bytes = [0; 2048];
        let (len, _) = socket.recv_from(&mut bytes).ok()?;
        Some(messages(&bytes[..len]))
    });
    let time = answered.flatten().find_map(|message| match message {
        MavMessage::HIL_ACTUATOR_CONTROLS(m) => Some(m.time_usec),
        _ => None,
    });
    assert_eq!(time, Some(120_000));
    companion.end();
}

real_time::tests!(
    an_attitude_is_flown_and_setpoint_loss_ends_level_in_hold,
    a_lost_vehicle_is_told_and_flown_in_hold_when_it_is_back,
    a_vehicle_whose_rates_are_not_numbers_is_held_level_and_told,
    setpoints_of_garbage_move_nothing_and_do_not_keep_offboard_alive,
    garbage_and_a_flood_from_both_sides_delay_no_answer_and_move_no_surface,
    a_second_client_watches_and_a_restarted_one_takes_over,
    a_client_over_tcp_is_served_like_any_other,
);
