//! The client side, spoken to in bytes: identity, commands, modes, parameters, streams.

use std::time::Duration;

use crate::link_support::*;
use greylag::link::autopilot::*;
use greylag::link::client::{Clients, MAX_SESSIONS, Now};
use greylag::physics::Time;
use mavlink::MavlinkVersion::{V1, V2};
use mavlink::dialects::ardupilotmega::*;

fn new() -> (Clients, Double) {
    (Clients::new(US), Double::new())
}

/// The ground station's own heartbeat, by which it makes itself known.
fn hello(version: mavlink::MavlinkVersion) -> Vec<u8> {
    frame(
        version,
        &MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_GCS,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            ..Default::default()
        }),
    )
}

/// Runs the control task's calls from `from` to `to` ms, every 10 ms.
fn run(clients: &mut Clients, double: &mut Double, from: u64, to: u64) -> Vec<Seen> {
    let mut seen = vec![];
    for ms in (from..to).step_by(10) {
        clients.poll(at_ms(ms), double);
        seen.extend(sent(clients));
    }
    seen
}

fn count(seen: &[Seen], id: u32) -> usize {
    seen.iter().filter(|s| s.id == id).count()
}

fn heartbeats(seen: &[Seen]) -> Vec<HEARTBEAT_DATA> {
    seen.iter()
        .filter_map(|s| match s.message() {
            MavMessage::HEARTBEAT(m) => Some(m),
            _ => None,
        })
        .collect()
}

#[test]
fn a_newcomer_gets_a_heartbeat_at_once_then_one_a_second() {
    let (mut clients, mut double) = new();
    run(&mut clients, &mut double, 0, 500);
    clients.handle(at_ms(500), peer(1), &hello(V2), &mut double);
    clients.poll(at_ms(500), &mut double);
    let first = heartbeats(&sent(&mut clients));
    assert_eq!(first.len(), 1);
    let beat = &first[0];
    assert_eq!(beat.mavtype, MavType::MAV_TYPE_FIXED_WING);
    assert_eq!(beat.autopilot, MavAutopilot::MAV_AUTOPILOT_GENERIC);
    // HOLD is AUTO/LOITER: main mode 4, sub mode 3.
    assert_eq!(beat.custom_mode, 4 << 16 | 3 << 24);
    assert!(beat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_CUSTOM_MODE_ENABLED));
    assert_eq!(beat.system_status, MavState::MAV_STATE_STANDBY);
    assert_eq!(heartbeats(&run(&mut clients, &mut double, 510, 5510)).len(), 5);
}

#[test]
fn a_change_of_mode_or_arming_is_told_at_once() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    run(&mut clients, &mut double, 0, 100);
    double.status.armed = true;
    let beat = &heartbeats(&run(&mut clients, &mut double, 100, 110))[0];
    assert!(beat.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED));
    assert_eq!(beat.system_status, MavState::MAV_STATE_ACTIVE);
    double.status.mode = Mode::Offboard;
    assert_eq!(heartbeats(&run(&mut clients, &mut double, 110, 120))[0].custom_mode, 6 << 16);
    double.status.vehicle_alive = false;
    let beat = &heartbeats(&run(&mut clients, &mut double, 120, 130))[0];
    assert_eq!(beat.system_status, MavState::MAV_STATE_CRITICAL);
    assert!(heartbeats(&run(&mut clients, &mut double, 130, 900)).is_empty());
}

#[test]
fn heartbeats_go_on_while_the_vehicle_clock_stands() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    let mut beats = 0;
    for ms in (0..10_000).step_by(10) {
        clients.poll(
            Now { host: Duration::from_millis(ms), vehicle: Time::from_micros(77) },
            &mut double,
        );
        beats += heartbeats(&sent(&mut clients)).len();
    }
    assert_eq!(beats, 10);
}

#[test]
fn each_known_residual_and_derivative_comes_once_a_second_under_its_name() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    assert_eq!(count(&run(&mut clients, &mut double, 0, 3000), 251), 0, "none is known");
    double.status.residuals = [0.5, 0.0, -0.25, f64::NAN, 1.5, 0.0];
    let seen = run(&mut clients, &mut double, 3000, 6000);
    let named = |wanted: &str| -> Vec<f32> {
        seen.iter()
            .filter_map(|s| match s.message() {
                MavMessage::NAMED_VALUE_FLOAT(m) if m.name.to_str() == Ok(wanted) => Some(m.value),
                _ => None,
            })
            .collect()
    };
    assert_eq!(named("res_pitch"), [1.5; 3]);
    assert_eq!(named("res_fz"), [-0.25; 3]);
    assert_eq!((named("res_roll").len(), count(&seen, 251)), (0, 15), "five of six for 3 s");
    double.status.residuals = [f64::NAN; 6];
    double.status.derivatives = [90.0, -12.5, f64::NAN, f64::NAN];
    let seen = run(&mut clients, &mut double, 6000, 9000);
    let damping = seen.iter().filter(|s| match s.message() {
        MavMessage::NAMED_VALUE_FLOAT(m) => m.name.to_str() == Ok("est_L_p") && m.value == -12.5,
        _ => false,
    });
    assert_eq!((damping.count(), count(&seen, 251)), (3, 6), "two derivatives for 3 s");
}

#[test]
fn the_default_streams_have_the_agreed_rates() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    let seen = run(&mut clients, &mut double, 0, 10_000);
    // Rates from the specification, counted over 10 s.
    for (id, hz) in [
        (30, 10),
        (31, 10),
        (83, 5),
        (74, 5),
        (33, 5),
        (36, 10),
        (1, 1),
        (245, 1),
        (24, 1),
        (147, 1),
        (2, 0),
    ] {
        assert_eq!(count(&seen, id), 10 * hz, "message {id}");
    }
    // Every two seconds.
    assert_eq!(count(&seen, 242), 5);
    for (before, after) in seen.iter().zip(&seen[1..]) {
        assert_eq!(after.sequence, before.sequence.wrapping_add(1));
    }
}

#[test]
fn a_mavlink_1_client_is_answered_in_mavlink_1_until_it_shows_2() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &hello(V1), &mut double);
    clients.handle(at_ms(0), peer(2), &hello(V2), &mut double);
    let seen = run(&mut clients, &mut double, 0, 1000);
    assert!(seen.iter().all(|s| s.version == if s.peer == peer(1) { V1 } else { V2 }));
    assert!(seen.iter().filter(|s| s.peer == peer(1)).count() > 40);
    // MAVLink 1 has no extension fields: BATTERY_STATUS is 36 bytes there, COMMAND_ACK 3.
    assert!(seen.iter().any(|s| s.id == 147 && s.peer == peer(1) && s.payload.len() == 36));
    let long = MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        command: MavCmd::MAV_CMD_REQUEST_MESSAGE,
        param1: 300.0,
        target_system: 1,
        target_component: 1,
        ..Default::default()
    });
    let seen = ask(&mut clients, &mut double, at_ms(1000), 1, &frame(V1, &long));
    assert_eq!((seen[0].version, seen[0].payload.as_slice()), (V1, &[0, 2, 0][..]), "ack of 512");
    // The handshake: PROTOCOL_VERSION itself is in MAVLink 2.
    assert_eq!((seen[1].version, seen[1].id), (V2, 300));
    clients.handle(at_ms(1000), peer(1), &hello(V2), &mut double);
    // A stray MAVLink 1 frame later changes nothing; one after 5 s of silence may be a new program.
    clients.handle(at_ms(1000), peer(1), &hello(V1), &mut double);
    assert!(run(&mut clients, &mut double, 1000, 2000).iter().all(|s| s.version == V2));
    clients.handle(at_ms(6001), peer(1), &hello(V1), &mut double);
    let seen = run(&mut clients, &mut double, 6010, 7010);
    assert!(seen.iter().any(|s| s.peer == peer(1)));
    assert!(seen.iter().all(|s| s.peer != peer(1) || s.version == V1));
}

#[test]
fn every_command_for_us_is_acknowledged_and_no_other() {
    let (mut clients, mut double) = new();
    let mut answer = |system, component, number| {
        let payload = command_payload(number, [f32::NAN; 7], system, component, 0);
        acks(&ask(&mut clients, &mut double, at_ms(0), 1, &raw_frame(76, &payload)))
    };
    // 60000 is no MAV_CMD of the dialect; 22 is one that is not flown here. 3 is UNSUPPORTED.
    assert_eq!(answer(1, 1, 60000), [(60000, 3)]);
    assert_eq!(answer(1, 0, 22), [(22, 3)]);
    assert_eq!(answer(0, 0, 22), [(22, 3)]);
    assert_eq!(answer(2, 1, 22), []);
    assert_eq!(answer(1, 190, 22), []);
    assert_eq!(clients.counts().unknown_commands, 3);
    assert_eq!(clients.counts().for_others, 2);
}

#[test]
fn acknowledgements_name_the_sender_of_the_command() {
    let (mut clients, mut double) = new();
    let seen = ask(&mut clients, &mut double, at_ms(0), 1, &command(60000, &[]));
    // command, result, progress, result_param2, target system, target component.
    assert_eq!(seen[0].payload, [0x60, 0xEA, 3, 0, 0, 0, 0, 0, 255, 190]);
}

#[test]
fn command_int_is_a_command_too() {
    let (mut clients, mut double) = new();
    let message = MavMessage::COMMAND_INT(COMMAND_INT_DATA {
        param1: 1.0,
        param2: f32::NAN,
        command: MavCmd::MAV_CMD_COMPONENT_ARM_DISARM,
        target_system: 1,
        target_component: 1,
        ..Default::default()
    });
    assert_eq!(
        acks(&ask(&mut clients, &mut double, at_ms(0), 1, &frame(V2, &message))),
        [(400, 0)]
    );
    assert_eq!(double.arms, [false]);
}

#[test]
fn arming_takes_zero_or_one_only_and_the_magic_number_forces() {
    let (mut clients, mut double) = new();
    let mut arm =
        |params: &[f32]| acks(&ask(&mut clients, &mut double, at_ms(0), 1, &command(400, params)));
    assert_eq!(arm(&[1.0]), [(400, 0)]);
    assert_eq!(arm(&[1.0, 21196.0]), [(400, 0)]);
    assert_eq!(arm(&[0.0]), [(400, 0)]);
    for odd in [2.0, 0.5, -1.0, f32::NAN, f32::INFINITY, 1e30] {
        assert_eq!(arm(&[odd]), [(400, 2)], "param1 {odd}");
    }
    assert_eq!(double.arms, [false, true]);
}

#[test]
fn a_retransmission_is_acknowledged_again_but_not_carried_out_again() {
    let (mut clients, mut double) = new();
    let mut params = [f32::NAN; 7];
    params[0] = 1.0;
    for confirmation in 0..4 {
        let bytes = raw_frame(76, &command_payload(400, params, 1, 1, confirmation));
        assert_eq!(acks(&ask(&mut clients, &mut double, at_ms(100), 1, &bytes)), [(400, 0)]);
    }
    assert_eq!(double.arms.len(), 1);
    // Sent anew, it is carried out anew.
    let bytes = raw_frame(76, &command_payload(400, params, 1, 1, 0));
    assert_eq!(acks(&ask(&mut clients, &mut double, at_ms(200), 1, &bytes)), [(400, 0)]);
    assert_eq!(double.arms.len(), 2);
}

#[test]
fn a_retransmission_is_rejected_once_its_effect_has_ended() {
    let (mut clients, mut double) = new();
    let offboard = [1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    double.status.armed = true;
    let mut send = |double: &mut Double, confirmation| {
        let bytes = raw_frame(76, &command_payload(176, offboard, 1, 1, confirmation));
        let sent = ask(&mut clients, double, at_ms(100), 1, &bytes);
        (acks(&sent), count(&sent, 253))
    };
    // MAVROS begins with 1, so that a new request looks like the one before
    assert_eq!(send(&mut double, 1), (vec![(176, 0)], 0));
    assert_eq!(send(&mut double, 1), (vec![(176, 0)], 0));
    assert_eq!(double.modes, [Mode::Offboard; 2]);
    // setpoints are lost
    double.status.mode = Mode::Hold;
    for confirmation in 2..4 {
        assert_eq!(send(&mut double, confirmation), (vec![(176, 1)], 1));
    }
    assert_eq!(double.modes, [Mode::Offboard; 2]);
    assert_eq!(send(&mut double, 1), (vec![(176, 0)], 0));
    assert_eq!(double.modes, [Mode::Offboard; 3]);
}

#[test]
fn a_refusal_or_a_question_is_not_answered_from_memory() {
    let (mut clients, mut double) = new();
    let mut again = |number, params: [f32; 7], confirmation| {
        let bytes = raw_frame(76, &command_payload(number, params, 1, 1, confirmation));
        ask(&mut clients, &mut double, at_ms(100), 1, &bytes)
    };
    let offboard = [1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(acks(&again(176, offboard, 0)), [(176, 1)]);
    again(400, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 0);
    assert_eq!(acks(&again(176, offboard, 1)), [(176, 0)]);
    // The version is sent again, since it may be what was lost.
    for confirmation in 0..2 {
        assert_eq!(count(&again(512, [148.0; 7], confirmation), 148), 1);
    }
}

#[test]
fn the_modes_can_be_listed() {
    let (mut clients, mut double) = new();
    let all = ask(&mut clients, &mut double, at_ms(0), 1, &command(512, &[435.0, 0.0]));
    let names: Vec<_> = all
        .iter()
        .filter_map(|s| match s.message() {
            MavMessage::AVAILABLE_MODES(m) => {
                Some((m.mode_name.to_str().unwrap().to_owned(), m.custom_mode))
            }
            _ => None,
        })
        .collect();
    assert_eq!(names.len(), 4);
    // PX4's numbers: HOLD is 4/3, OFFBOARD 6.
    assert!(
        names.contains(&("Hold".into(), 0x0304_0000))
            && names.contains(&("Offboard".into(), 6 << 16))
    );
    assert_eq!(
        count(&ask(&mut clients, &mut double, at_ms(0), 1, &command(512, &[435.0, 2.0])), 435),
        1
    );
    let none = ask(&mut clients, &mut double, at_ms(0), 1, &command(512, &[435.0, 9.0]));
    assert_eq!(acks(&none), [(512, 2)]);
}

#[test]
fn modes_are_set_in_every_way_that_clients_use() {
    let (mut clients, mut double) = new();
    let mut set = |bytes: &[u8]| {
        let seen = ask(&mut clients, &mut double, at_ms(0), 1, bytes);
        (acks(&seen), texts(&seen).concat())
    };
    // MAVSDK and QGroundControl for PX4: main and sub mode; pymavlink otherwise: one number.
    assert_eq!(set(&command(176, &[1.0, 4.0, 3.0])).0, [(176, 0)]);
    assert_eq!(set(&command(176, &[1.0, (7 << 16) as f32])).0, [(176, 0)]);
    // Temporarily rejected, with the reason in words.
    let (ack, words) = set(&command(176, &[1.0, 6.0]));
    assert_eq!((ack, words.as_str()), (vec![(176, 1)], "Offboard needs arming"));
    let (ack, words) = set(&command(176, &[1.0, 4.0, 5.0]));
    assert_eq!((ack, words.as_str()), (vec![(176, 2)], "Return is not flown"));
    assert_eq!(set(&command(176, &[1.0, 99.0])).0, [(176, 2)]);
    assert_eq!(set(&command(176, &[0.0, 6.0])).0, [(176, 2)]);
    // SET_MODE is not acknowledged: custom_mode of MANUAL, flag bit 0 set.
    assert_eq!(set(&raw_frame(11, &[0, 0, 1, 0, 1, 1])), (vec![], String::new()));
    assert_eq!(
        set(&raw_frame(11, &[0, 0, 9, 0, 1, 1])).1,
        "Mode refused: not a mode of this autopilot"
    );
    assert_eq!(double.modes, [Mode::Hold, Mode::Stabilized, Mode::Manual]);
}

#[test]
fn what_clients_request_is_sent() {
    let (mut clients, mut double) = new();
    // The home position is known only once the autopilot has been looked at.
    assert_eq!(
        acks(&ask(&mut clients, &mut double, at_ms(0), 1, &command(512, &[242.0]))),
        [(512, 1)]
    );
    run(&mut clients, &mut double, 0, 10);
    for id in [0, 1, 24, 30, 31, 33, 36, 74, 83, 147, 148, 242, 245, 300, 2, 436] {
        let seen = ask(&mut clients, &mut double, at_ms(100), 1, &command(512, &[id as f32]));
        assert_eq!(acks(&seen), [(512, 0)], "message {id}");
        assert_eq!(count(&seen, id), 1, "message {id}");
    }
    for (id, result) in [(11039.0, 3), (f32::NAN, 2), (-1.0, 2), (30.5, 2), (1e30, 2)] {
        let seen = ask(&mut clients, &mut double, at_ms(100), 1, &command(512, &[id]));
        assert_eq!(acks(&seen), [(512, result)], "message {id}");
    }
    assert_eq!(
        count(&ask(&mut clients, &mut double, at_ms(100), 1, &command(520, &[1.0])), 148),
        1
    );
    assert_eq!(count(&ask(&mut clients, &mut double, at_ms(100), 1, &command(410, &[])), 242), 1);
}

#[test]
fn the_version_names_exactly_one_parameter_encoding() {
    let (mut clients, mut double) = new();
    let seen = ask(&mut clients, &mut double, at_ms(0), 1, &command(512, &[148.0]));
    let MavMessage::AUTOPILOT_VERSION(version) = seen[1].message() else { panic!("{:?}", seen[1]) };
    let bits = version.capabilities.bits();
    // MAVLINK2 8192, SET_ATTITUDE_TARGET 64, COMMAND_INT 8, PARAM_ENCODE_BYTEWISE 16.
    assert_eq!(bits, 8192 + 64 + 8 + 16);
}

#[test]
fn intervals_are_per_client_and_limited() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(2), &hello(V2), &mut double);
    // 1 µs is limited to 10 ms, the control cycle; −1 is off.
    let fast = ask(&mut clients, &mut double, at_ms(0), 1, &command(511, &[30.0, 1.0]));
    let off = ask(&mut clients, &mut double, at_ms(0), 1, &command(511, &[31.0, -1.0]));
    assert_eq!((acks(&fast), acks(&off)), (vec![(511, 0)], vec![(511, 0)]));
    let seen = run(&mut clients, &mut double, 0, 1000);
    let of = |port, id| seen.iter().filter(|s| s.peer == peer(port) && s.id == id).count();
    assert_eq!((of(1, 30), of(1, 31)), (100, 0));
    assert_eq!((of(2, 30), of(2, 31)), (10, 10));

    for params in [[9999.0, 1e5], [30.0, f32::NAN], [30.0, -5.0], [f32::NAN, 1e5]] {
        let seen = ask(&mut clients, &mut double, at_ms(0), 1, &command(511, &params));
        assert_eq!(acks(&seen), [(511, 2)], "{params:?}");
    }
    for (id, us) in [(30.0, 10_000), (31.0, -1), (83.0, 200_000), (9999.0, 0)] {
        let seen = ask(&mut clients, &mut double, at_ms(0), 1, &command(510, &[id]));
        let MavMessage::MESSAGE_INTERVAL(m) = seen[1].message() else { panic!() };
        assert_eq!((f32::from(m.message_id), m.interval_us), (id, us));
    }
}

#[test]
fn the_attitude_target_is_streamed_before_there_is_one_and_says_so() {
    let (mut clients, mut double) = new();
    double.status.target = [f64::NAN; 2];
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    let asked = ask(&mut clients, &mut double, at_ms(0), 1, &command(511, &[83.0, 1e5]));
    assert_eq!(acks(&asked), [(511, 0)]);
    let targets = |seen: &[Seen]| -> Vec<ATTITUDE_TARGET_DATA> {
        let target = |s: &Seen| match s.message() {
            MavMessage::ATTITUDE_TARGET(m) => Some(m),
            _ => None,
        };
        seen.iter().filter_map(target).collect()
    };
    // Rates ignored is 7, attitude ignored 128; nobody reads an attitude out of it that is not flown.
    let none = targets(&run(&mut clients, &mut double, 0, 1000));
    assert_eq!(none.len(), 10);
    assert!(none.iter().all(|m| m.type_mask.bits() == 7 | 128), "{none:?}");
    assert!(none.iter().all(|m| m.q.iter().all(|x| x.is_finite())), "{none:?}");
    double.status.target = [0.2, 0.0];
    let some = targets(&run(&mut clients, &mut double, 1000, 2000));
    assert_eq!(some.len(), 10);
    assert!(some.iter().all(|m| m.type_mask.bits() == 7), "{some:?}");
}

#[test]
fn a_data_stream_request_concerns_the_asker_only() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(2), &hello(V2), &mut double);
    // MAVProxy's request: all streams at 4 Hz. Fields: rate, system, component, group, start.
    clients.handle(at_ms(0), peer(1), &raw_frame(66, &[4, 0, 1, 1, 0, 1]), &mut double);
    let seen = run(&mut clients, &mut double, 0, 10_000);
    let of = |port, id| seen.iter().filter(|s| s.peer == peer(port) && s.id == id).count();
    assert_eq!((of(1, 30), of(1, 1)), (40, 40));
    assert_eq!((of(2, 30), of(2, 1)), (100, 10));
    clients.handle(at_ms(10_000), peer(1), &raw_frame(66, &[4, 0, 1, 1, 10, 0]), &mut double);
    let seen = run(&mut clients, &mut double, 10_000, 11_000);
    assert_eq!(seen.iter().filter(|s| s.peer == peer(1) && s.id == 30).count(), 0);
}

#[test]
fn long_texts_come_in_chunks_that_can_be_joined() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    clients.handle(at_ms(0), peer(2), &hello(V1), &mut double);
    let words = "Setpoints lost for 1.0 s: leaving OFFBOARD, holding wings level at 16.7 m/s until told otherwise.";
    double.texts.push_back(Text { severity: Severity::Critical, words: words.into() });
    let seen = run(&mut clients, &mut double, 0, 10);
    let of = |port| {
        seen.iter().filter(|s| s.peer == peer(port) && s.id == 253).cloned().collect::<Vec<_>>()
    };
    assert_eq!(texts(&of(1)).concat(), words);
    assert_eq!(texts(&of(2)).concat(), words);
    let chunks: Vec<_> = of(1)
        .iter()
        .map(|s| match s.message() {
            MavMessage::STATUSTEXT(m) => (m.severity, m.id != 0, m.chunk_seq),
            _ => panic!(),
        })
        .collect();
    let critical = MavSeverity::MAV_SEVERITY_CRITICAL;
    assert_eq!(chunks, [(critical, true, 0), (critical, true, 1)]);
}

#[test]
fn a_text_that_is_cut_says_so() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    // 400 characters are sent whole. Of more, 397 and three dots.
    for (length, expected) in [(400, "x".repeat(400)), (401, "x".repeat(397) + "...")] {
        double.texts.push_back(Text { severity: Severity::Error, words: "x".repeat(length) });
        let seen = run(&mut clients, &mut double, 0, 10);
        let seen: Vec<_> = seen.into_iter().filter(|s| s.id == 253).collect();
        assert_eq!(texts(&seen).concat(), expected);
    }
}

#[test]
fn missions_files_time_and_pings_are_answered() {
    let (mut clients, mut double) = new();
    let mut answer = |bytes: &[u8]| ask(&mut clients, &mut double, at_ms(5), 1, bytes);
    let list = answer(&raw_frame(43, &[1, 1]));
    let MavMessage::MISSION_COUNT(count) = list[0].message() else { panic!() };
    assert_eq!((count.count, count.target_system, count.target_component), (0, 255, 190));
    // An upload of three items: MAV_MISSION_UNSUPPORTED is 3.
    let upload = answer(&raw_frame(44, &[3, 0, 1, 1]));
    assert_eq!((upload[0].id, &upload[0].payload[..3]), (47, &[255, 190, 3][..]));
    // A fence (MAV_MISSION_TYPE 1) likewise, in its own type; and the items themselves, which some send unasked.
    let fence = answer(&raw_frame(44, &[3, 0, 1, 1, 1]));
    assert_eq!((fence[0].id, &fence[0].payload[..4]), (47, &[255, 190, 3, 1][..]));
    let fences = answer(&raw_frame(43, &[1, 1, 1]));
    let MavMessage::MISSION_COUNT(count) = fences[0].message() else { panic!() };
    assert_eq!((count.count, count.mission_type as u8), (0, 1));
    let item = answer(&raw_frame(51, &[0, 0, 1, 1]));
    assert_eq!((item[0].id, item[0].payload[2]), (47, 13), "there is no item 0");
    let cleared = answer(&raw_frame(45, &[1, 1]));
    assert_eq!(cleared[0].id, 47);

    // Open a file for reading (opcode 4), sequence 258: NAK (129) of the next sequence number.
    let open = answer(&raw_frame(110, &[0, 1, 1, 2, 1, 9, 4, 0]));
    assert_eq!((open[0].id, &open[0].payload[3..8]), (110, &[3, 1, 9, 129, 1][..]));
    assert!(answer(&raw_frame(110, &[0, 1, 1, 3, 1, 9, 129, 1])).is_empty(), "no NAK of a NAK");

    let sync = MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 0, ts1: 12345, ..Default::default() });
    let MavMessage::TIMESYNC(m) = answer(&frame(V2, &sync))[0].message() else { panic!() };
    // 5 ms of vehicle time in ns.
    assert_eq!((m.tc1, m.ts1), (5_000_000, 12345));
    let reply = MavMessage::TIMESYNC(TIMESYNC_DATA { tc1: 1, ts1: 12345, ..Default::default() });
    assert!(answer(&frame(V2, &reply)).is_empty());

    let mut ping = 99u64.to_le_bytes().to_vec();
    ping.extend([7, 0, 0, 0, 0, 0]);
    let pong = answer(&raw_frame(4, &ping));
    assert_eq!((pong[0].id, &pong[0].payload[8..]), (4, &[7, 0, 0, 0, 255, 190][..]));
}

#[test]
fn peers_are_bounded_and_the_longest_silent_one_makes_room() {
    let (mut clients, mut double) = new();
    for port in 0..MAX_SESSIONS as u16 {
        clients.handle(at_ms(u64::from(port)), peer(100 + port), &hello(V2), &mut double);
    }
    // All have been heard within 3 s: nobody is displaced.
    clients.handle(at_ms(1000), peer(1), &hello(V2), &mut double);
    assert_eq!((clients.session_count(), clients.counts().turned_away), (MAX_SESSIONS, 1));
    // Now all but the first have fallen silent.
    clients.handle(at_ms(4000), peer(100), &hello(V2), &mut double);
    clients.handle(at_ms(4000), peer(1), &hello(V2), &mut double);
    clients.poll(at_ms(4000), &mut double);
    let seen = sent(&mut clients);
    assert!([1, 100, 102].iter().all(|port| seen.iter().any(|s| s.peer == peer(*port))));
    assert!(!seen.iter().any(|s| s.peer == peer(101)));
    // A datagram peer is forgotten after a minute, a connection is not.
    clients.welcome(at_ms(4000), peer(1));
    clients.poll(at_ms(65_000), &mut double);
    assert_eq!(clients.session_count(), 1);
    clients.forget(peer(1));
    assert_eq!(clients.session_count(), 0);
}

#[test]
fn a_listener_is_served_before_it_speaks() {
    let (mut clients, mut double) = new();
    clients.welcome(at_ms(0), peer(14540));
    assert_eq!(heartbeats(&run(&mut clients, &mut double, 0, 3000)).len(), 3);
}

#[test]
fn our_own_frames_are_not_answered() {
    let (mut clients, mut double) = new();
    let echo = frame_from(V2, 1, 1, &MavMessage::PARAM_REQUEST_LIST(Default::default()));
    assert!(ask(&mut clients, &mut double, at_ms(0), 1, &echo).is_empty());
    assert_eq!((clients.session_count(), clients.counts().echoes), (0, 1));
}

#[test]
fn unknown_values_are_not_sent_as_zeros() {
    let (mut clients, mut double) = new();
    double.status.position = [f64::NAN; 2];
    double.status.attitude = [f64::NAN; 3];
    clients.handle(at_ms(0), peer(1), &hello(V2), &mut double);
    let seen = run(&mut clients, &mut double, 0, 1000);
    assert_eq!((count(&seen, 33), count(&seen, 30), count(&seen, 31)), (0, 0, 0));
    let gps = seen.iter().find(|s| s.id == 24).unwrap().message();
    let MavMessage::GPS_RAW_INT(gps) = gps else { panic!() };
    assert_eq!(gps.fix_type, GpsFixType::GPS_FIX_TYPE_NO_FIX);
    assert_eq!(
        acks(&ask(&mut clients, &mut double, at_ms(0), 1, &command(512, &[33.0]))),
        [(512, 1)]
    );
}

#[test]
fn a_flood_costs_a_bounded_outbox() {
    let (mut clients, mut double) = new();
    // Nobody drains; each datagram holds as many commands as fit.
    let datagram: Vec<u8> = (0..100).flat_map(|_| command(60000, &[])).collect();
    for _ in 0..100 {
        clients.handle(at_ms(0), peer(1), &datagram, &mut double);
    }
    assert_eq!(clients.counts().unknown_commands, 10_000);
    assert!(sent(&mut clients).len() <= 4096);
    assert!(clients.counts().dropped >= 5000);
}

#[test]
fn an_onboard_computer_answers_for_itself_only_and_streams_nothing_by_itself() {
    let (mut clients, mut double) = (Clients::onboard(), Double::new());
    clients.adopt(US.system);
    let drained = |clients: &mut Clients| clients.drain().map(|(_, b)| b).collect::<Vec<_>>();
    // The controller is component 1, and whoever names no component means it.
    for component in [0, 1] {
        let arm = raw_frame(76, &command_payload(400, [1.0; 7], 1, component, 0));
        clients.handle(at_ms(0), peer(1), &arm, &mut double);
    }
    assert!(double.arms.is_empty() && drained(&mut clients).is_empty());
    assert_eq!(clients.counts().for_others, 2);
    let arm = raw_frame(76, &command_payload(400, [1.0; 7], 1, 191, 0));
    clients.handle(at_ms(0), peer(1), &arm, &mut double);
    assert_eq!(double.arms.len(), 1);
    drained(&mut clients);
    let mut ids = vec![];
    for ms in (0..3000).step_by(10) {
        clients.poll(at_ms(ms), &mut double);
        ids.extend(drained(&mut clients).iter().map(|bytes| bytes[7]));
    }
    assert!(!ids.is_empty() && ids.iter().all(|id| *id == 0), "heartbeats only: {ids:?}");
}

#[test]
fn the_old_questions_for_versions_are_answered_and_others_denied() {
    let (mut clients, mut double) = new();
    let mut asked = |number, param| {
        let seen = ask(&mut clients, &mut double, at_ms(0), 1, &command(number, &[param]));
        (acks(&seen), seen.iter().map(|s| s.id).filter(|id| *id != 77).collect::<Vec<_>>())
    };
    assert_eq!(asked(519, 1.0), (vec![(519, 0)], vec![300]));
    assert_eq!(asked(520, 1.0), (vec![(520, 0)], vec![148]));
    // Zero asks for nothing: denied, and not unknown.
    assert_eq!(asked(520, 0.0), (vec![(520, 2)], vec![]));
    assert_eq!(clients.counts().unknown_commands, 0);
}

#[test]
fn home_is_where_the_vehicle_was_first_seen_then_where_it_was_armed() {
    let (mut clients, mut double) = new();
    let mut home = |double: &mut Double, ms, latitude: f64, armed| {
        double.status.position[0] = latitude;
        double.status.armed = armed;
        clients.poll(at_ms(ms), double);
        let seen = ask(&mut clients, double, at_ms(ms), 1, &command(410, &[]));
        let found = seen.iter().find(|s| s.id == 242).map(|s| s.message());
        let Some(MavMessage::HOME_POSITION(m)) = found else { panic!("{seen:?}") };
        f64::from(m.latitude) * 1e-7
    };
    let near = |got: f64, want: f64| assert!((got - want).abs() < 1e-6, "{got} for {want}");
    near(home(&mut double, 0, 45.0, false), 45.0);
    near(home(&mut double, 10, 45.1, false), 45.0);
    near(home(&mut double, 20, 45.2, true), 45.2);
    near(home(&mut double, 30, 45.3, true), 45.2);
    near(home(&mut double, 40, 45.4, false), 45.2);
}

#[test]
fn an_answer_is_remembered_for_three_seconds() {
    for (later_ms, arms) in [(2999, 1), (3000, 2)] {
        let (mut clients, mut double) = new();
        let mut arm = |ms, confirmation| {
            let payload = command_payload(400, [1.0; 7], 1, 1, confirmation);
            ask(&mut clients, &mut double, at_ms(ms), 1, &raw_frame(76, &payload))
        };
        arm(100, 0);
        arm(100 + later_ms, 1);
        assert_eq!(double.arms.len(), arms, "{later_ms} ms later");
    }
}

#[test]
fn a_peer_may_change_its_version_after_more_than_five_seconds_of_silence() {
    for (silent_ms, version) in [(5000, V2), (5001, V1)] {
        let (mut clients, mut double) = new();
        clients.handle(at_ms(100), peer(1), &hello(V2), &mut double);
        clients.handle(at_ms(100 + silent_ms), peer(1), &hello(V1), &mut double);
        clients.poll(at_ms(100 + silent_ms), &mut double);
        let seen = sent(&mut clients);
        assert!(!seen.is_empty() && seen.iter().all(|s| s.version == version), "{silent_ms} ms");
    }
}

#[test]
fn a_peer_is_forgotten_after_a_minute_of_silence() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(100), peer(1), &hello(V2), &mut double);
    clients.poll(at_ms(60_099), &mut double);
    assert_eq!(clients.session_count(), 1);
    clients.poll(at_ms(60_100), &mut double);
    assert_eq!(clients.session_count(), 0);
}

#[test]
fn a_request_for_streams_concerns_its_group_or_all_that_come_by_default() {
    // Group 10 has the attitude: the others keep their rates.
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &raw_frame(66, &[4, 0, 1, 1, 10, 1]), &mut double);
    let seen = run(&mut clients, &mut double, 0, 10_000);
    assert_eq!([30, 83, 33, 1].map(|id| count(&seen, id)), [40, 50, 50, 10]);
    // Group 0 is no request for SYSTEM_TIME and CURRENT_MODE, which nobody gets unasked.
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(1), &raw_frame(66, &[4, 0, 1, 1, 0, 1]), &mut double);
    let seen = run(&mut clients, &mut double, 0, 10_000);
    assert_eq!([30, 33, 2, 436].map(|id| count(&seen, id)), [40, 40, 0, 0]);
}

/// The program's log, in memory.
#[derive(Clone, Default)]
struct Log(std::sync::Arc<std::sync::Mutex<Vec<u8>>>);

impl std::io::Write for Log {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().unwrap().extend(bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

impl Log {
    /// What is logged meanwhile, line by line.
    fn of(during: impl FnOnce()) -> Vec<String> {
        let log = Log::default();
        let writer = log.clone();
        let subscriber =
            tracing_subscriber::fmt().with_writer(move || writer.clone()).with_ansi(false).finish();
        tracing::subscriber::with_default(subscriber, during);
        let bytes = log.0.lock().unwrap().clone();
        String::from_utf8(bytes).unwrap().lines().map(str::to_owned).collect()
    }
}

/// A frame with a wrong check sum.
fn spoilt() -> Vec<u8> {
    let mut bytes = hello(V2);
    *bytes.last_mut().unwrap() ^= 0xFF;
    bytes
}

/// An attitude with a quaternion of zeros.
fn refused() -> Vec<u8> {
    raw_frame(82, &[0])
}

#[test]
fn each_kind_of_input_that_cannot_be_used_is_logged() {
    let level = || {
        let target = SET_ATTITUDE_TARGET_DATA { q: [1.0, 0.0, 0.0, 0.0], ..Default::default() };
        frame(V2, &MavMessage::SET_ATTITUDE_TARGET(target))
    };
    type Spoil = fn(&mut Clients, &mut Double, &[u8]);
    let cases: [(&str, Spoil); 4] = [
        ("bad_crc=1", |clients, double, _| clients.handle(at_ms(0), peer(1), &spoilt(), double)),
        ("refused_setpoints=1", |clients, double, _| {
            clients.handle(at_ms(0), peer(1), &refused(), double);
        }),
        ("contested_setpoints=1", |clients, double, level| {
            clients.handle(at_ms(0), peer(1), level, double);
            clients.handle(at_ms(0), peer(2), level, double);
        }),
        ("turned_away=1", |clients, double, _| {
            for port in 0..=MAX_SESSIONS as u16 {
                clients.handle(at_ms(0), peer(port), &hello(V2), double);
            }
        }),
    ];
    for (field, spoil) in cases {
        let (mut clients, mut double) = new();
        let lines = Log::of(|| {
            spoil(&mut clients, &mut double, &level());
            clients.poll(at_ms(0), &mut double);
        });
        let (said, summary): (Vec<_>, Vec<_>) =
            lines.iter().partition(|line| line.contains("status text to a client: "));
        assert!(summary.len() == 1 && summary[0].contains(field), "{field}: {lines:?}");
        // the client has the cause as a text, and so has the log
        assert_eq!(said.len(), usize::from(field.contains("setpoints")), "{field}: {lines:?}");
    }
    let (mut clients, mut double) = new();
    let lines = Log::of(|| {
        clients.handle(at_ms(0), peer(1), &level(), &mut double);
        run(&mut clients, &mut double, 0, 30_000);
    });
    assert!(lines.is_empty(), "nothing was wrong: {lines:?}");
}

#[test]
fn a_flood_of_bad_input_is_logged_once_in_ten_seconds() {
    let (mut clients, mut double) = new();
    let mut lines = vec![];
    let mut told = vec![];
    for ms in (0..40_000).step_by(10) {
        // Bad input for 15 s; the line at 20 s is of what came after the one at 10 s.
        let said = Log::of(|| {
            if ms < 15_000 {
                clients.handle(at_ms(ms), peer(1), &refused(), &mut double);
            }
            clients.poll(at_ms(ms), &mut double);
        });
        sent(&mut clients);
        let (words, summary): (Vec<_>, Vec<_>) =
            said.into_iter().partition(|line| line.contains("status text to a client: "));
        told.extend(words);
        lines.extend(summary.into_iter().map(|line| (ms, line)));
    }
    assert!(matches!(&told[..], [once] if once.contains("Setpoint refused: ")), "{told:?}");
    assert_eq!(lines.iter().map(|(ms, _)| *ms).collect::<Vec<_>>(), [0, 10_000, 20_000]);
    assert!(lines[2].1.contains("refused_setpoints=1500"), "{}", lines[2].1);
}

#[test]
fn to_loiter_is_to_hold_and_to_return_is_refused() {
    let (mut clients, mut double) = new();
    let mut asked =
        |number| acks(&ask(&mut clients, &mut double, at_ms(0), 1, &command(number, &[])));
    assert_eq!((asked(17), asked(20)), (vec![(17, 0)], vec![(20, 2)]));
    assert_eq!(double.modes, [Mode::Hold]);
}

#[test]
fn who_was_silent_for_three_seconds_makes_room() {
    for (silent_ms, turned_away) in [(2999, 1), (3000, 0)] {
        let (mut clients, mut double) = new();
        for port in 0..MAX_SESSIONS as u16 {
            clients.handle(at_ms(0), peer(100 + port), &hello(V2), &mut double);
        }
        clients.handle(at_ms(silent_ms), peer(1), &hello(V2), &mut double);
        assert_eq!(clients.counts().turned_away, turned_away, "{silent_ms} ms");
        assert_eq!(clients.session_count(), MAX_SESSIONS);
    }
}
