//! Setpoints and parameters from clients, good, bad and contested.

use crate::link_support::*;
use greylag::link::autopilot::*;
use greylag::link::client::Clients;
use mavlink::MavlinkVersion::{V1, V2};
use mavlink::dialects::ardupilotmega::*;

fn new() -> (Clients, Double) {
    (Clients::new(US), Double::new())
}

fn setpoint(q: [f32; 4], thrust: f32, mask: u8) -> SET_ATTITUDE_TARGET_DATA {
    SET_ATTITUDE_TARGET_DATA {
        q,
        thrust,
        target_system: 1,
        target_component: 1,
        type_mask: AttitudeTargetTypemask::from_bits_retain(mask),
        ..Default::default()
    }
}

fn send(
    clients: &mut Clients,
    double: &mut Double,
    ms: u64,
    port: u16,
    data: SET_ATTITUDE_TARGET_DATA,
) -> Vec<Seen> {
    ask(clients, double, at_ms(ms), port, &frame(V2, &MavMessage::SET_ATTITUDE_TARGET(data)))
}

/// 60° of bank to the right: half the angle on the x axis.
fn banked() -> [f32; 4] {
    [30f32.to_radians().cos(), 30f32.to_radians().sin(), 0.0, 0.0]
}

#[test]
fn an_attitude_is_decoded_whatever_its_sign_and_scale() {
    let (mut clients, mut double) = new();
    for factor in [1.0, -1.0, 2.0] {
        send(&mut clients, &mut double, 0, 1, setpoint(banked().map(|c| factor * c), 0.5, 7));
    }
    assert_eq!(double.setpoints.len(), 3);
    for got in &double.setpoints {
        // The quaternion's floats carry 24 bits: 1e-6 rad.
        assert!((got.roll - 60f64.to_radians()).abs() < 1e-6 && got.pitch.abs() < 1e-6, "{got:?}");
        assert_eq!(got.thrust, Some(0.5));
    }
}

#[test]
fn yaw_is_ignored_and_masked_thrust_is_absent() {
    let (mut clients, mut double) = new();
    // Pitch 10° up after yaw 90°: the quaternion product of both.
    let (sy, cy) = 45f32.to_radians().sin_cos();
    let (sp, cp) = 5f32.to_radians().sin_cos();
    send(
        &mut clients,
        &mut double,
        0,
        1,
        setpoint([cy * cp, -sy * sp, cy * sp, sy * cp], f32::NAN, 64 + 7),
    );
    let got = double.setpoints[0];
    assert!(got.roll.abs() < 1e-6 && (got.pitch - 10f64.to_radians()).abs() < 1e-6, "{got:?}");
    assert_eq!(got.thrust, None);
}

#[test]
fn garbage_setpoints_are_counted_and_never_reach_the_autopilot() {
    let (mut clients, mut double) = new();
    let unit = [1.0, 0.0, 0.0, 0.0];
    let bad = [
        setpoint([f32::NAN, 0.0, 0.0, 0.0], 0.5, 7),
        setpoint([1.0, f32::INFINITY, 0.0, 0.0], 0.5, 7),
        setpoint([0.0; 4], 0.5, 7),
        setpoint([1e30, 0.0, 0.0, 0.0], 0.5, 7),
        setpoint(unit, f32::NAN, 7),
        setpoint(unit, 1e30, 7),
        // Rates without an attitude.
        setpoint(unit, 0.5, 128),
    ];
    let n = bad.len() as u64;
    for data in bad {
        send(&mut clients, &mut double, 0, 1, data);
    }
    assert!(double.setpoints.is_empty());
    assert_eq!(clients.counts().refused_setpoints, n);
    // For another aircraft: neither followed nor refused.
    let mut other = setpoint(unit, 0.5, 7);
    other.target_system = 2;
    send(&mut clients, &mut double, 0, 1, other);
    assert!(double.setpoints.is_empty());
    assert_eq!(clients.counts().refused_setpoints, n);
}

#[test]
fn refusals_are_told_at_a_bounded_rate() {
    let (mut clients, mut double) = new();
    let mut told = 0;
    // 1000 bad setpoints in 10 s: ten at once, then two a second.
    for ms in (0..10_000).step_by(10) {
        told += texts(&send(&mut clients, &mut double, ms, 1, setpoint([0.0; 4], 0.5, 7))).len();
    }
    assert!((20..=30).contains(&told), "{told} texts");
}

#[test]
fn each_refusal_of_a_setpoint_says_what_was_wrong() {
    let unit = [1.0, 0.0, 0.0, 0.0];
    for (data, words) in [
        (setpoint(unit, f32::NAN, 7), "a number is NaN"),
        (setpoint([0.0; 4], 0.5, 7), "the quaternion is zero"),
        (setpoint(unit, 0.5, 128), "it has no attitude"),
    ] {
        let (mut clients, mut double) = new();
        let said = texts(&send(&mut clients, &mut double, 0, 1, data)).concat();
        assert!(said.contains(words), "{said}");
    }
}

#[test]
fn two_clients_cannot_steer_at_once() {
    let (mut clients, mut double) = new();
    for ms in (0..2000).step_by(100) {
        send(&mut clients, &mut double, ms, 1, setpoint(banked(), 0.5, 7));
        send(&mut clients, &mut double, ms, 2, setpoint([1.0, 0.0, 0.0, 0.0], 0.5, 7));
    }
    assert_eq!((double.setpoints.len(), clients.counts().contested_setpoints), (20, 20));
    assert!(double.setpoints.iter().all(|s| s.roll > 1.0));
    // The first one falls silent at 1.9 s: a second later control authority is free.
    send(&mut clients, &mut double, 2899, 2, setpoint([1.0, 0.0, 0.0, 0.0], 0.5, 7));
    assert_eq!(double.setpoints.len(), 20);
    send(&mut clients, &mut double, 2900, 2, setpoint([1.0, 0.0, 0.0, 0.0], 0.5, 7));
    assert_eq!(double.setpoints.len(), 21);
}

#[test]
fn a_client_that_is_forgotten_leaves_control_authority_to_the_next_and_no_other_does() {
    let sticks = |x| {
        let data = MANUAL_CONTROL_DATA { x, target: 1, ..Default::default() };
        frame(V2, &MavMessage::MANUAL_CONTROL(data))
    };
    for (forgotten, followed) in [(3, 1), (1, 2)] {
        let (mut clients, mut double) = new();
        send(&mut clients, &mut double, 0, 1, setpoint(banked(), 0.5, 7));
        ask(&mut clients, &mut double, at_ms(0), 1, &sticks(100));
        // As when a TCP connection has closed.
        clients.forget(peer(forgotten));
        send(&mut clients, &mut double, 10, 2, setpoint([1.0, 0.0, 0.0, 0.0], 0.5, 7));
        ask(&mut clients, &mut double, at_ms(10), 2, &sticks(200));
        let got = (double.setpoints.len(), double.sticks.len());
        assert_eq!(got, (followed, followed), "after client {forgotten} was forgotten");
    }
}

#[test]
fn sticks_are_scaled_limited_and_refused_when_an_axis_is_missing() {
    let (mut clients, mut double) = new();
    let mut push = |x, y, z| {
        let data = MANUAL_CONTROL_DATA { x, y, z, target: 1, ..Default::default() };
        ask(&mut clients, &mut double, at_ms(0), 1, &frame(V1, &MavMessage::MANUAL_CONTROL(data)));
    };
    push(500, -250, 700);
    push(-32768, 1500, -1000);
    push(i16::MAX, 0, 0);
    let sticks = |pitch, roll, throttle| Sticks { roll, pitch, throttle };
    assert_eq!(double.sticks, [sticks(0.5, -0.25, 0.7), sticks(-1.0, 1.0, 0.0)]);
    assert_eq!(clients.counts().refused_setpoints, 1);
}

fn parameter_values(seen: &[Seen]) -> Vec<PARAM_VALUE_DATA> {
    seen.iter()
        .filter_map(|s| match s.message() {
            MavMessage::PARAM_VALUE(m) => Some(m),
            _ => None,
        })
        .collect()
}

/// PARAM_SET in bytes: value, system, component, name, type.
fn set(name: &str, value: [u8; 4], kind: u8) -> Vec<u8> {
    let mut payload = value.to_vec();
    payload.extend([1, 1]);
    let mut id = [0; 16];
    id[..name.len()].copy_from_slice(name.as_bytes());
    payload.extend(id);
    payload.push(kind);
    raw_frame(23, &payload)
}

#[test]
fn the_list_is_paced_and_complete() {
    let (mut clients, mut double) = new();
    double.parameters =
        (0..50).map(|_| Parameter { name: "GL_MANY", value: ParameterValue::Real(1.0) }).collect();
    clients.handle(at_ms(0), peer(1), &raw_frame(21, &[1, 1]), &mut double);
    let mut indices = vec![];
    for ms in (0..1000).step_by(10) {
        clients.poll(at_ms(ms), &mut double);
        let values = parameter_values(&sent(&mut clients));
        assert!(values.len() <= 2, "a burst of {}", values.len());
        assert!(values.iter().all(|v| v.param_count == 50));
        indices.extend(values.iter().map(|v| v.param_index));
    }
    assert_eq!(indices, (0..50).collect::<Vec<_>>());
}

#[test]
fn whole_numbers_travel_bytewise() {
    let (mut clients, mut double) = new();
    double.parameters[1].value = ParameterValue::Int(-2);
    let mut read = vec![1, 0, 1, 1];
    read.extend([0; 16]);
    let seen = ask(&mut clients, &mut double, at_ms(0), 1, &raw_frame(20, &read));
    // −2 in two's complement, count 3, index 1, the name, type 6 (INT32).
    assert_eq!(seen[0].payload[..8], [0xFE, 0xFF, 0xFF, 0xFF, 3, 0, 1, 0]);
    assert_eq!(seen[0].payload[8..15], *b"GL_SEED");
    assert_eq!(seen[0].payload[24], 6);
    // 0x7FC00001 would be NaN as a float: its bits must survive.
    let seen = ask(
        &mut clients,
        &mut double,
        at_ms(0),
        1,
        &set("GL_SEED", 0x7FC0_0001u32.to_le_bytes(), 6),
    );
    assert_eq!(seen[0].payload[..4], 0x7FC0_0001u32.to_le_bytes());
    assert_eq!(double.parameters[1].value, ParameterValue::Int(0x7FC0_0001));
}

#[test]
fn a_parameter_is_set_and_echoed_to_everybody() {
    let (mut clients, mut double) = new();
    clients.handle(at_ms(0), peer(2), &raw_frame(43, &[1, 1]), &mut double);
    sent(&mut clients);
    let seen =
        ask(&mut clients, &mut double, at_ms(0), 1, &set("GL_BANK_MAX", 45f32.to_le_bytes(), 9));
    assert_eq!(
        seen.iter().map(|s| (s.peer, s.id)).collect::<Vec<_>>(),
        [(peer(2), 22), (peer(1), 22)]
    );
    assert!(parameter_values(&seen).iter().all(|v| v.param_value == 45.0 && v.param_index == 0));
    // pymavlink's param_set_send marks everything REAL32.
    ask(&mut clients, &mut double, at_ms(0), 1, &set("GL_SEED", 12f32.to_le_bytes(), 9));
    assert_eq!(double.parameters[1].value, ParameterValue::Int(12));
    ask(&mut clients, &mut double, at_ms(0), 1, &set("GL_SIXTEEN_CHARS", 1f32.to_le_bytes(), 9));
    assert_eq!(double.parameters[2].value, ParameterValue::Real(1.0));
}

#[test]
fn a_bad_parameter_leaves_the_old_value_and_says_so() {
    let (mut clients, mut double) = new();
    // Out of range, not a number, and types that are not the table's. Errors: 2 out of range,
    // 7 type mismatch.
    let cases = [
        (set("GL_BANK_MAX", 1e30f32.to_le_bytes(), 9), 2),
        (set("GL_BANK_MAX", f32::NAN.to_le_bytes(), 9), 2),
        (set("GL_BANK_MAX", 45i32.to_le_bytes(), 6), 7),
        (set("GL_BANK_MAX", 45f32.to_le_bytes(), 200), 7),
        (set("GL_SEED", 1.5f32.to_le_bytes(), 9), 7),
        (set("GL_SEED", 1e30f32.to_le_bytes(), 9), 7),
    ];
    let before = double.parameters.clone();
    for (bytes, error) in cases {
        let seen = ask(&mut clients, &mut double, at_ms(0), 1, &bytes);
        assert_eq!(seen.iter().map(|s| s.id).take(2).collect::<Vec<_>>(), [345, 22]);
        let MavMessage::PARAM_ERROR(m) = seen[0].message() else { panic!() };
        assert_eq!(m.error as u8, error);
        assert!(texts(&seen).concat().contains("refused"));
        assert_eq!(double.parameters, before);
    }
    // To a MAVLink 1 client: the old value and the text, as PARAM_ERROR has a number above 255.
    let v1 = MavMessage::PARAM_SET(PARAM_SET_DATA {
        param_value: 1e30,
        target_system: 1,
        target_component: 1,
        param_id: "GL_BANK_MAX".into(),
        param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
    });
    let seen = ask(&mut clients, &mut double, at_ms(0), 9, &frame(V1, &v1));
    assert_eq!(parameter_values(&seen)[0].param_value, 60.0);
    assert!(texts(&seen).concat().contains("GL_BANK_MAX"));
}

#[test]
fn a_parameter_that_does_not_exist_is_an_error() {
    let (mut clients, mut double) = new();
    let mut by_name = vec![0xFF, 0xFF, 1, 1];
    by_name.extend(*b"_HASH_CHECK\0\0\0\0\0");
    let mut by_index = vec![3, 0, 1, 1];
    by_index.extend([0; 16]);
    for bytes in [raw_frame(20, &by_name), raw_frame(20, &by_index), set("NOT_HERE", [0; 4], 9)] {
        let seen = ask(&mut clients, &mut double, at_ms(0), 1, &bytes);
        let MavMessage::PARAM_ERROR(m) = seen[0].message() else { panic!() };
        assert_eq!(m.error, MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST);
        // −1: it was asked for by its name.
        assert_eq!(m.param_index, if bytes == raw_frame(20, &by_index) { 3 } else { -1 });
    }
}

#[test]
fn a_truncated_payload_reads_as_zeros() {
    let (mut clients, mut double) = new();
    // MAVLink 2 cuts trailing zeros: of q = (0,0,0,0) and thrust 0 nothing is left but one byte.
    clients.handle(at_ms(0), peer(1), &raw_frame(82, &[0]), &mut double);
    // Target 0/0 is a broadcast, so it is for us, and refused for its zero quaternion.
    assert_eq!(clients.counts().refused_setpoints, 1);
}
