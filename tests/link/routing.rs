//! Routing between clients and a real controller, and two codecs that must agree.

use std::time::Duration;

use crate::link_support::*;
use greylag::link::framing::Source;
use greylag::link::routing::Router;
use greylag_sitl::shim::codec::{self, Encoder, Parser};
use mavlink::MavlinkVersion::V2;
use mavlink::dialects::ardupilotmega::*;

/// The companion beside a controller of system 7.
const BESIDE: Source = Source { system: 7, component: 191 };

fn command_to(system: u8, component: u8) -> Vec<u8> {
    frame(
        V2,
        &MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            command: MavCmd::MAV_CMD_DO_SET_MODE,
            target_system: system,
            target_component: component,
            ..Default::default()
        }),
    )
}

#[test]
fn what_is_for_the_controller_goes_on_as_it_came() {
    let mut router = Router::default();
    let for_controller = command_to(7, 1);
    let for_us = command_to(7, 191);
    let for_all = command_to(0, 0);
    // A message that no dialect knows, with a signature behind it.
    let mut unknown = vec![0xFD, 3, 1, 0, 9, 255, 190, 0x34, 0x12, 0x77, 1, 2, 3, 0xAA, 0xBB];
    unknown.extend([0x5A; 13]);
    let bytes = [for_controller.clone(), for_us, for_all.clone(), unknown.clone()].concat();
    let on = router.to_controller(&bytes, BESIDE, false);
    assert_eq!(on, [for_controller, for_all, unknown].concat());
}

#[test]
fn nobody_steers_past_us_and_no_key_is_given_away() {
    let mut router = Router::default();
    let target = frame(
        V2,
        &MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
            target_system: 7,
            target_component: 1,
            ..Default::default()
        }),
    );
    assert_eq!(router.to_controller(&target, BESIDE, false), target);
    assert!(router.to_controller(&target, BESIDE, true).is_empty());
    let key = frame(V2, &MavMessage::SETUP_SIGNING(SETUP_SIGNING_DATA::default()));
    assert!(router.to_controller(&key, BESIDE, false).is_empty());
    assert_eq!(router.held, 2);
}

#[test]
fn what_is_for_one_client_goes_only_where_it_was_heard() {
    let mut router = Router::default();
    let (here, there) = (peer(1), peer(2));
    router.learn(Duration::ZERO, here, &frame_from(V2, 255, 190, &heartbeat()));
    router.learn(Duration::ZERO, there, &frame_from(V2, 254, 190, &heartbeat()));
    let ack = frame_from(
        V2,
        7,
        1,
        &MavMessage::COMMAND_ACK(COMMAND_ACK_DATA {
            target_system: 255,
            target_component: 190,
            ..Default::default()
        }),
    );
    let beat = frame_from(V2, 7, 1, &heartbeat());
    let bytes = [ack, beat.clone()].concat();
    assert_eq!(router.to_client(&bytes, here), bytes);
    assert_eq!(router.to_client(&bytes, there), beat);
}

fn heartbeat() -> MavMessage {
    MavMessage::HEARTBEAT(HEARTBEAT_DATA::default())
}

/// What the shim's codec reads of a frame by rust-mavlink.
fn theirs<M: codec::Message>(message: &MavMessage) -> M {
    let mut found = None;
    Parser::default().datagram(&frame(V2, message), &mut |f| found = f.decode::<M>());
    found.expect("not read")
}

/// What rust-mavlink reads of a frame by the shim's codec.
fn ours<M: codec::Message>(message: &M) -> MavMessage {
    let mut bytes = Vec::new();
    Encoder::new(1, 1).encode(message, &mut bytes);
    dissect_any(&bytes)
}

fn dissect_any(bytes: &[u8]) -> MavMessage {
    use mavlink::Message;
    let id = u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]);
    let end = 10 + bytes[1] as usize;
    let crc = mavlink::calculate_crc(&bytes[1..end], MavMessage::extra_crc(id));
    assert_eq!(crc.to_le_bytes(), bytes[end..], "CRC of message {id}");
    MavMessage::parse(V2, id, &bytes[10..end]).unwrap()
}

#[test]
fn the_shims_codec_and_rust_mavlink_read_each_other() {
    let m: codec::ManualControl = theirs(&MavMessage::MANUAL_CONTROL(MANUAL_CONTROL_DATA {
        x: -1000,
        y: 37,
        z: 500,
        target: 7,
        ..Default::default()
    }));
    assert_eq!((m.x, m.y, m.z, m.target), (-1000, 37, 500, 7));
    let m: codec::RcChannelsOverride =
        theirs(&MavMessage::RC_CHANNELS_OVERRIDE(RC_CHANNELS_OVERRIDE_DATA {
            chan1_raw: 1000,
            chan3_raw: 1777,
            target_system: 7,
            target_component: 1,
            ..Default::default()
        }));
    assert_eq!(
        (m.channel[0], m.channel[2], m.target_system, m.target_component),
        (1000, 1777, 7, 1)
    );
    let m: codec::SetAttitudeTarget =
        theirs(&MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
            q: [0.5, 0.1, 0.2, 0.3],
            thrust: 0.7,
            target_system: 7,
            type_mask: AttitudeTargetTypemask::from_bits_retain(7),
            ..Default::default()
        }));
    assert_eq!((m.q, m.thrust, m.target_system, m.type_mask), ([0.5, 0.1, 0.2, 0.3], 0.7, 7, 7));
    let m: codec::CommandLong = theirs(&MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
        param2: 4.0,
        command: MavCmd::MAV_CMD_DO_SET_MODE,
        target_system: 7,
        ..Default::default()
    }));
    assert_eq!((m.param[1], m.command, m.target_system), (4.0, 176, 7));
    let m: codec::ParamRequestRead =
        theirs(&MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: 7,
            target_component: 1,
            param_id: "RC1_MIN".into(),
        }));
    assert_eq!((m.param_index, m.target_system, &m.param_id[..8]), (-1, 7, &b"RC1_MIN\0"[..]));
    let m: codec::TimeSync = theirs(&MavMessage::TIMESYNC(TIMESYNC_DATA {
        tc1: 0,
        ts1: 123_456_789_012,
        ..Default::default()
    }));
    assert_eq!((m.tc1, m.ts1), (0, 123_456_789_012));

    let mut param_id = [0; 16];
    param_id[..7].copy_from_slice(b"RC1_MAX");
    let value = codec::ParamValue {
        param_value: 2000.0,
        param_count: 24,
        param_index: 12,
        param_id,
        param_type: 6,
    };
    let MavMessage::PARAM_VALUE(m) = ours(&value) else { panic!() };
    assert_eq!((m.param_value, m.param_count, m.param_index), (2000.0, 24, 12));
    assert_eq!(m.param_id.to_str().unwrap(), "RC1_MAX");
    let ack = codec::CommandAck {
        command: 176,
        result: 1,
        target_system: 7,
        target_component: 191,
        ..Default::default()
    };
    let MavMessage::COMMAND_ACK(m) = ours(&ack) else { panic!() };
    assert_eq!((m.command as u32, m.result as u32, m.target_component), (176, 1, 191));
    let mut servos = codec::ServoOutputRaw { time_usec: 5, ..Default::default() };
    servos.servo[2] = 1640;
    let MavMessage::SERVO_OUTPUT_RAW(m) = ours(&servos) else { panic!() };
    assert_eq!((m.time_usec, m.servo3_raw), (5, 1640));
    let mut text = codec::StatusText { severity: 2, ..Default::default() };
    text.text[..4].copy_from_slice(b"lost");
    let MavMessage::STATUSTEXT(m) = ours(&text) else { panic!() };
    assert_eq!(m.text.to_str().unwrap(), "lost");
    let MavMessage::TIMESYNC(m) = ours(&codec::TimeSync { tc1: 9, ts1: 8, ..Default::default() })
    else {
        panic!()
    };
    assert_eq!((m.tc1, m.ts1), (9, 8));
}
