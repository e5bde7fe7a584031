//! The `sitl` profile's vehicle side, in bytes.

use std::time::Duration;

use crate::link_support::{Shown, dissect, frame_from, peer, shim};
use greylag::link::vehicle::{Faults, Order, Outputs, Sitl, Telemetry};
use greylag::physics::mixer::{Does, Effector, Mixer};
use greylag::physics::servos::{Travel, Travels};
use greylag::physics::{Command, Time};
use mavlink::MavlinkVersion::V2;
use mavlink::dialects::ardupilotmega::*;

/// What ±1 means where the vehicle sends no travel of its own, rad: the X8's.
#[expect(clippy::approx_constant, reason = "the simulator's stop is at 0.5235 rad, not at 30°")]
const DEFLECTION: f64 = 0.5235;

fn take(sitl: &mut Sitl, bytes: &[u8]) -> Vec<Telemetry> {
    let mut states = vec![];
    sitl.handle(Duration::ZERO, peer(1), bytes, |state| states.push(state));
    states
}

fn close(got: f64, want: f64) {
    // Floats on the wire: 24 bits.
    assert!((got - want).abs() <= 1e-6 * want.abs().max(1.0), "{got} for {want}");
}

#[test]
fn a_state_frame_is_converted_to_si() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let position = MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
        lat: 450_000_000,
        lon: 75_000_000,
        vx: 1000,
        vy: -200,
        vz: 50,
        ..Default::default()
    });
    let wind =
        MavMessage::WIND_COV(WIND_COV_DATA { wind_x: 3.0, wind_y: -2.0, ..Default::default() });
    let mut bytes = [shim(position), shim(wind)].concat();
    bytes.extend(Shown::at(20_000).bytes());
    let states = take(&mut sitl, &bytes);
    assert_eq!(states.len(), 1);
    let t = states[0];
    assert_eq!(
        (t.time, t.order, t.faults),
        (Time::from_micros(20_000), Order::First, Faults::NONE)
    );
    close(t.state.roll, 20f64.to_radians());
    close(t.state.pitch, 0.0);
    close(t.yaw, 0.0);
    close(t.state.airspeed, 16.5);
    close(t.state.alpha, 3f64.to_radians());
    close(t.state.beta, -1.5f64.to_radians());
    for (got, want) in [(t.state.p, 0.01), (t.state.q, 0.02), (t.state.r, 0.03)] {
        close(got, want);
    }
    for (got, want) in t.specific_force.into_iter().zip([0.1, 0.2, -9.7]) {
        close(got, want);
    }
    close(t.altitude, 301.0);
    close(t.actuators.aileron, 0.5 * DEFLECTION);
    close(t.actuators.elevator, -0.25 * DEFLECTION);
    close(t.actuators.throttle, 0.6);
    close(t.actuators.aileron_rate, 2.0 * DEFLECTION);
    close(t.actuators.elevator_rate, -4.0 * DEFLECTION);
    assert_eq!(
        (t.position, t.velocity, t.wind),
        ([45.0, 7.5], [10.0, -2.0, 0.5], [3.0, -2.0, 0.0])
    );
}

#[test]
fn a_travel_that_the_vehicle_sends_is_used_and_compared_with_the_airframes() {
    let sending = |aileron, elevator| {
        let mut shown = Shown::at(20_000);
        shown.actuators.active = 7;
        (shown.actuators.actuator[5], shown.actuators.actuator[6]) = (aileron, elevator);
        shown.bytes()
    };
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let t = take(&mut sitl, &sending(0.4, 0.3))[0];
    close(t.actuators.aileron, 0.5 * 0.4);
    close(t.actuators.elevator, -0.25 * 0.3);
    close(t.actuators.elevator_rate, -4.0 * 0.3);
    let obstacle = sitl.obstacle().unwrap();
    for part in ["0.4000 rad (aileron)", "0.3000 rad (elevator)", "0.5235", "airframe file"] {
        assert!(obstacle.contains(part), "{obstacle}");
    }
    assert!(sitl.take_notice().is_some());
    assert!(sitl.take_notice().is_none(), "it is said once");
    // The airframe of that aircraft agrees, as the X8's does with a vehicle that sends none.
    for (airframe, bytes) in [(0.4, sending(0.4, 0.4)), (DEFLECTION, Shown::at(20_000).bytes())] {
        let mut sitl = Sitl::new(1, Travels::alike(airframe));
        assert_eq!(take(&mut sitl, &bytes).len(), 1);
        assert_eq!((sitl.obstacle(), sitl.take_notice()), (None, None));
    }
    assert!(Sitl::new(1, Travels::alike(0.4)).obstacle().is_none(), "nothing was heard yet");
}

#[test]
fn what_was_never_heard_is_not_a_number() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let t = take(&mut sitl, &Shown::at(0).bytes())[0];
    assert!(t.position[0].is_nan() && t.velocity[0].is_nan() && t.wind[0].is_nan());
}

#[test]
fn garbage_is_flagged_and_the_last_good_value_stands() {
    type Spoil = fn(&mut Shown);
    let cases: [(Spoil, Faults); 9] = [
        (|s| s.attitude.q1 = f32::NAN, Faults::ATTITUDE),
        (|s| (s.attitude.q1, s.attitude.q2) = (0.0, 0.0), Faults::ATTITUDE),
        (|s| s.attitude.rollspeed = 1e30, Faults::RATES),
        (|s| s.air.airspeed = f32::INFINITY, Faults::AIR),
        (|s| s.air.alt = f32::NAN, Faults::AIR),
        (|s| s.incidence.AOA = 1e30, Faults::INCIDENCE),
        (|s| s.imu.zacc = f32::NAN, Faults::SPECIFIC_FORCE),
        (|s| s.actuators.actuator[0] = 7.0, Faults::ACTUATORS),
        (|s| s.actuators.actuator[4] = f32::NAN, Faults::ACTUATORS),
    ];
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let good = take(&mut sitl, &Shown::at(0).bytes())[0];
    for (at, (spoil, fault)) in cases.into_iter().enumerate() {
        let mut shown = Shown::at(10_000 * (at as u64 + 1));
        spoil(&mut shown);
        let t = take(&mut sitl, &shown.bytes())[0];
        assert_eq!(t.faults, fault, "case {at}");
        assert_eq!(
            (t.state, t.actuators, t.altitude),
            (good.state, good.actuators, good.altitude),
            "case {at}"
        );
        assert!(!t.faults.to_string().is_empty());
    }
    assert_eq!(sitl.counts().faulty, 9);
    // Position and wind that cannot be are left out.
    let lost = MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
        lat: 2_000_000_000,
        ..Default::default()
    });
    let mut bytes = shim(lost);
    bytes.extend(Shown::at(200_000).bytes());
    assert!(take(&mut sitl, &bytes)[0].position[0].is_nan());
}

#[test]
fn loss_repetition_lateness_and_restart_are_told_apart() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let mut order = |us| take(&mut sitl, &Shown::at(us).bytes())[0].order;
    assert_eq!(order(5_000_000), Order::First);
    assert_eq!(order(5_010_000), Order::Next { lost: 0 });
    assert_eq!(order(5_010_000), Order::Repeated);
    assert_eq!(order(5_040_000), Order::Next { lost: 2 });
    assert_eq!(order(5_020_000), Order::Late);
    // Jitter of 3 ms is no loss.
    assert_eq!(order(5_053_000), Order::Next { lost: 0 });
    assert_eq!(order(0), Order::First);
    let counts = sitl.counts();
    assert_eq!(
        (counts.states, counts.lost, counts.repeated, counts.late, counts.starts),
        (5, 2, 1, 1, 2)
    );
}

#[test]
fn a_frame_with_a_missing_or_foreign_part_is_incomplete() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let whole = Shown::at(0).bytes();
    let imu = shim(MavMessage::HIGHRES_IMU(Shown::at(0).imu)).len();
    assert!(take(&mut sitl, &whole[imu..]).is_empty());
    let mut mixed = Shown::at(10_000);
    mixed.incidence.time_usec = 0;
    assert!(take(&mut sitl, &mixed.bytes()).is_empty());
    let mut mixed = Shown::at(20_000);
    mixed.attitude.time_boot_ms = 10;
    assert!(take(&mut sitl, &mixed.bytes()).is_empty());
    let mut few = Shown::at(30_000);
    few.actuators.active = 3;
    assert!(take(&mut sitl, &few.bytes()).is_empty());
    assert_eq!(sitl.counts().incomplete, 4);
    assert_eq!(take(&mut sitl, &Shown::at(40_000).bytes()).len(), 1);
    // Split anywhere, as TCP may: the frame is complete when its last byte has come.
    let bytes = Shown::at(50_000).bytes();
    assert!(take(&mut sitl, &bytes[..imu]).is_empty());
    assert_eq!(take(&mut sitl, &bytes[imu..]).len(), 1);
}

#[test]
fn only_the_vehicle_is_listened_to() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let stranger = frame_from(V2, 255, 190, &MavMessage::HIGHRES_IMU(Shown::at(0).imu));
    assert!(take(&mut sitl, &stranger).is_empty());
    assert_eq!((sitl.counts().foreign, sitl.peer()), (1, None));
    assert_eq!(take(&mut sitl, &Shown::at(0).bytes()).len(), 1);
    assert_eq!(sitl.peer(), Some(peer(1)));
    // A second shim is ignored until the first has been silent for a second.
    let ms = Duration::from_millis;
    sitl.handle(ms(999), peer(2), &Shown::at(10_000).bytes(), |_| panic!("two vehicles at once"));
    let mut taken = 0;
    sitl.handle(ms(1000), peer(2), &Shown::at(10_000).bytes(), |_| taken += 1);
    assert_eq!((taken, sitl.peer()), (1, Some(peer(2))));
}

fn controls(bytes: &[u8]) -> HIL_ACTUATOR_CONTROLS_DATA {
    match dissect(peer(1), bytes).message() {
        MavMessage::HIL_ACTUATOR_CONTROLS(m) => m,
        other => panic!("{other:?}"),
    }
}

#[test]
fn the_answer_echoes_the_time_and_is_zero_when_disarmed() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let time = Time::from_micros(123_456);
    let command = Command { aileron: 0.5, elevator: -3.0, throttle: 0.7, rudder: 0.0 };
    let armed = controls(&sitl.command(time, Outputs::Armed(command)));
    assert_eq!((armed.time_usec, armed.mode.bits()), (123_456, 128));
    // Beyond its range a command is limited.
    assert_eq!(armed.controls[..4], [0.5, -1.0, 0.7, 0.0]);
    let disarmed = controls(&sitl.command(time, Outputs::Disarmed));
    assert_eq!((disarmed.controls, disarmed.mode.bits()), ([0.0; 16], 0));
}

#[test]
fn a_command_that_is_not_finite_never_leaves() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let bad = Command { aileron: f64::NAN, elevator: 0.0, throttle: f64::INFINITY, rudder: 0.0 };
    let first = controls(&sitl.command(Time::default(), Outputs::Armed(bad)));
    assert_eq!(first.controls, [0.0; 16]);
    let good = Command { aileron: 0.25, elevator: 0.5, throttle: 0.75, rudder: 0.0 };
    sitl.command(Time::default(), Outputs::Armed(good));
    let after = controls(&sitl.command(Time::default(), Outputs::Armed(bad)));
    assert_eq!(after.controls[..3], [0.25, 0.5, 0.75]);
    assert_eq!(sitl.counts().bad_commands, 2);
}

#[test]
fn the_heartbeat_beats_once_a_second() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let beats = (0..500)
        .filter(|i| sitl.heartbeat(Duration::from_millis(10 * i), Outputs::Disarmed).is_some());
    assert_eq!(beats.count(), 5);
}

#[test]
fn a_rudder_is_read_and_the_rates_are_held_for_a_period() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let mut shown = Shown::at(20_000);
    shown.actuators.active = 15;
    // Travels as of old, deflection and rate of the rudder, then travels to each side.
    shown.actuators.actuator[5..15]
        .copy_from_slice(&[0.4, 0.3, 0.5, -3.0, 0.4, 0.3, 0.25, -0.4, -0.3, -0.2]);
    let t = take(&mut sitl, &shown.bytes())[0];
    close(t.rate_hold_s, 0.01);
    close(t.actuators.rudder, 0.5 * 0.25);
    close(t.actuators.rudder_rate, -3.0 * 0.25);
    // A surface that does not move to one side has no travel.
    let mut stuck = Shown::at(30_000);
    stuck.actuators.active = 15;
    stuck.actuators.actuator[5..15]
        .copy_from_slice(&[0.4, 0.3, 0.5, -3.0, 0.4, 0.3, 0.25, 0.0, -0.3, -0.2]);
    assert_eq!(take(&mut sitl, &stuck.bytes())[0].faults, Faults::ACTUATORS);
}

#[test]
fn a_frame_that_comes_early_after_a_gap_tells_the_gap() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let mut order = |us| take(&mut sitl, &Shown::at(us).bytes())[0].order;
    assert_eq!(order(5_000_000), Order::First);
    // 17 ms are two periods with jitter: one frame is missing. 14 ms are one.
    assert_eq!(order(5_017_000), Order::Next { lost: 1 });
    assert_eq!(order(5_031_000), Order::Next { lost: 0 });
    // By a second it comes late, by more the clock has started anew.
    assert_eq!(order(4_031_000), Order::Late);
    assert_eq!(order(4_030_000), Order::First);
}

#[test]
fn a_clock_at_its_last_microsecond_is_a_gap_and_no_overflow() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let mut order = |us| take(&mut sitl, &Shown::at(us).bytes())[0].order;
    assert_eq!(order(0), Order::First);
    assert_eq!(order(u64::MAX), Order::Next { lost: u32::MAX });
    assert_eq!(order(10_000), Order::First);
}

#[test]
fn a_force_that_was_never_believed_is_that_of_level_flight() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let mut shown = Shown::at(0);
    shown.imu.zacc = f32::NAN;
    let t = take(&mut sitl, &shown.bytes())[0];
    // Lift carries the weight: upwards, in axes that have z down.
    assert_eq!((t.faults, t.specific_force), (Faults::SPECIFIC_FORCE, [0.0, 0.0, -9.81]));
}

#[test]
fn an_absurd_wind_is_left_out_and_the_last_one_stands() {
    let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
    let mut wind = |us, wind_x| {
        let said = MavMessage::WIND_COV(WIND_COV_DATA { wind_x, ..Default::default() });
        take(&mut sitl, &[shim(said), Shown::at(us).bytes()].concat())[0].wind
    };
    assert!(wind(0, 1000.0)[0].is_nan());
    assert_eq!(wind(10_000, 8.0), [8.0, 0.0, 0.0]);
    assert_eq!(wind(20_000, f32::NAN), [8.0, 0.0, 0.0]);
}

#[test]
fn a_travel_that_differs_by_the_files_rounding_is_the_same_and_by_more_is_not() {
    for (found, same) in [(0.52351, true), (0.5238, true), (0.5243, false), (0.5227, false)] {
        let mut shown = Shown::at(20_000);
        shown.actuators.active = 7;
        (shown.actuators.actuator[5], shown.actuators.actuator[6]) = (found, found);
        let mut sitl = Sitl::new(1, Travels::alike(DEFLECTION));
        take(&mut sitl, &shown.bytes());
        assert_eq!(sitl.obstacle().is_none(), same, "{found} rad");
    }
}

#[test]
fn a_travel_that_differs_to_one_side_only_is_another() {
    // A companion whose airframe has 0.4 to each side.
    for (least, same) in [(-0.4, true), (-0.3, false)] {
        let mut shown = Shown::at(20_000);
        shown.actuators.active = 15;
        shown.actuators.actuator[5..15]
            .copy_from_slice(&[0.4, 0.4, 0.0, 0.0, 0.4, 0.4, 0.4, least, -0.4, -0.4]);
        let mut sitl = Sitl::new(1, Travels::alike(0.4));
        take(&mut sitl, &shown.bytes());
        assert_eq!(sitl.obstacle().is_none(), same, "{:?}", sitl.obstacle());
    }
}

#[test]
fn surfaces_of_the_airframe_follow_the_controls() {
    let surface = |name: &str, gains| Effector {
        name: name.into(),
        does: Does::Deflects(Travel::symmetric(0.5)),
        gains,
        channel: None,
        command: None,
        position: None,
    };
    let elevons = vec![
        surface("left", [1.0, 1.0, 0.0, 0.0]),
        surface("right", [-1.0, 1.0, 0.0, 0.0]),
        Effector { does: Does::Pulls, ..surface("motor", [0.0, 0.0, 0.0, 1.0]) },
    ];
    let mixer = Mixer::new(elevons, false).unwrap();
    let mut sitl = Sitl::new(1, Travels::alike(0.5)).with_mixer(Some(mixer));
    let command = Command { aileron: 0.25, elevator: 0.5, throttle: 0.75, rudder: 0.0 };
    let sent = controls(&sitl.command(Time::default(), Outputs::Armed(command))).controls;
    assert_eq!(sent[..4], [0.25, 0.5, 0.75, 0.0]);
    // Sum and difference on the elevons.
    assert_eq!(sent[4..8], [0.75, 0.25, 0.75, 0.0]);
}

#[test]
fn a_fault_that_is_found_twice_is_still_one() {
    let mut faults = Faults::NONE;
    for fault in [Faults::AIR, Faults::RATES, Faults::AIR] {
        faults.insert(fault);
    }
    assert!(faults.contains(Faults::AIR) && faults.contains(Faults::RATES));
    assert!(!faults.contains(Faults::ATTITUDE) && !faults.is_empty());
}
