//! Compares the shim's codec with frames from pymavlink 2.4.50 (`shim_vectors.py` generates them).

use greylag_sitl::shim::codec::*;

const VECTORS: &str = include_str!("../shim_vectors.txt");

fn vector(name: &str) -> Vec<u8> {
    let hex = VECTORS
        .lines()
        .find_map(|line| line.strip_prefix(name)?.strip_prefix(' '))
        .unwrap_or_else(|| panic!("no vector {name}"));
    (0..hex.len() / 2)
        .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).expect(name))
        .collect()
}

fn parsed(bytes: &[u8]) -> (Vec<Frame>, Parser) {
    let (mut frames, mut parser) = (Vec::new(), Parser::default());
    parser.datagram(bytes, &mut |frame| frames.push(frame));
    (frames, parser)
}

/// Checks both directions: the encoded bytes equal pymavlink's, and pymavlink's bytes decode to the same values.
fn agrees<M: Message + PartialEq + std::fmt::Debug>(name: &str, sequence: u8, ours: M) {
    let theirs = vector(name);
    let mut encoder = Encoder::new(1, 200);
    let mut bytes = Vec::new();
    for _ in 0..sequence {
        encoder.encode(&Heartbeat::default(), &mut Vec::new());
    }
    encoder.encode(&ours, &mut bytes);
    assert_eq!(bytes, theirs, "{name}: bytes");
    let (frames, parser) = parsed(&theirs);
    assert_eq!((frames.len(), parser.bad()), (1, 0), "{name}");
    let frame = &frames[0];
    assert_eq!((frame.system, frame.component, frame.sequence), (1, 200, sequence), "{name}");
    assert_eq!(frame.decode::<M>(), Some(ours), "{name}: values");
}

fn controls() -> HilActuatorControls {
    let mut controls = [0.0; 16];
    controls[..3].copy_from_slice(&[0.25, -0.5, 0.75]);
    HilActuatorControls { time_usec: 123_456_789_012_345, flags: 0, controls, mode: 128 }
}

fn imu(id: u8) -> HighresImu {
    HighresImu {
        time_usec: 10_000,
        xacc: 0.5,
        yacc: -0.25,
        zacc: -9.75,
        xgyro: 0.125,
        ygyro: -0.375,
        zgyro: 0.625,
        xmag: 1.0,
        ymag: 2.0,
        zmag: 3.0,
        abs_pressure: 943.25,
        diff_pressure: 4.0,
        pressure_alt: 600.5,
        temperature: 11.5,
        fields_updated: 0x1A3F,
        id,
    }
}

#[test]
fn every_message_agrees_with_pymavlink() {
    agrees(
        "heartbeat",
        0,
        Heartbeat {
            custom_mode: 393_216,
            kind: 1,
            autopilot: 8,
            base_mode: 129,
            system_status: 4,
            mavlink_version: 3,
        },
    );
    agrees(
        "sys_status",
        1,
        SysStatus {
            onboard_control_sensors_present: 0x3B,
            onboard_control_sensors_enabled: 0x3A,
            onboard_control_sensors_health: 0x39,
            load: 501,
            voltage_battery: 12_600,
            current_battery: -1,
            drop_rate_comm: 2,
            errors_comm: 3,
            errors_count1: 4,
            errors_count2: 5,
            errors_count3: 6,
            errors_count4: 7,
            battery_remaining: -1,
            onboard_control_sensors_present_extended: 8,
            onboard_control_sensors_enabled_extended: 9,
            onboard_control_sensors_health_extended: 10,
        },
    );
    agrees(
        "gps_raw_int",
        2,
        GpsRawInt {
            time_usec: 1_234_567_890_123,
            lat: 468_000_001,
            lon: -71_234_567,
            alt: 600_123,
            eph: 80,
            epv: 120,
            vel: 1667,
            cog: 35_999,
            fix_type: 3,
            satellites_visible: 12,
            alt_ellipsoid: 600_124,
            h_acc: 5,
            v_acc: 6,
            vel_acc: 7,
            hdg_acc: 8,
            yaw: 9,
        },
    );
    agrees(
        "attitude_quaternion",
        3,
        AttitudeQuaternion {
            time_boot_ms: 4_000_000_001,
            q1: 0.5,
            q2: -0.25,
            q3: 0.125,
            q4: 0.75,
            rollspeed: 1.5,
            pitchspeed: -2.5,
            yawspeed: 3.5,
            repr_offset_q: [0.0; 4],
        },
    );
    agrees(
        "global_position_int",
        4,
        GlobalPositionInt {
            time_boot_ms: 77,
            lat: 468_000_001,
            lon: -71_234_567,
            alt: 600_123,
            relative_alt: -1000,
            vx: 1667,
            vy: -200,
            vz: 35,
            hdg: 35_999,
        },
    );
    agrees(
        "vfr_hud",
        5,
        VfrHud {
            airspeed: 16.625,
            groundspeed: 17.5,
            alt: 600.5,
            climb: -0.75,
            heading: 359,
            throttle: 100,
        },
    );
    agrees("hil_actuator_controls", 6, controls());
    agrees("highres_imu", 7, imu(0));
    agrees("highres_imu_extension", 8, imu(7));
    agrees(
        "wind_cov",
        9,
        WindCov {
            time_usec: 20_000,
            wind_x: 3.5,
            wind_y: -4.5,
            wind_z: 0.25,
            var_horiz: 0.5,
            var_vert: 0.75,
            wind_alt: 600.5,
            horiz_accuracy: 1.25,
            vert_accuracy: 1.5,
        },
    );
    agrees(
        "actuator_output_status",
        10,
        ActuatorOutputStatus {
            time_usec: 30_000,
            active: 5,
            actuator: std::array::from_fn(|i| 0.125 * i as f32 - 1.0),
        },
    );
    agrees("aoa_ssa", 11, AoaSsa { time_usec: 40_000, aoa: 2.25, ssa: -1.75 });
    agrees("all_zero", 12, AoaSsa::default());
}

#[test]
fn mavlink_1_and_signed_frames_are_read() {
    let (frames, _) = parsed(&vector("hil_actuator_controls_v1"));
    assert_eq!((frames.len(), frames[0].version, frames[0].sequence), (1, Version::One, 42));
    assert_eq!(frames[0].decode::<HilActuatorControls>(), Some(controls()));
    let (frames, parser) = parsed(&vector("heartbeat_signed"));
    assert_eq!((frames.len(), parser.bad()), (1, 0), "13 bytes of signature belong to the frame");
    assert_eq!(frames[0].decode::<Heartbeat>().map(|m| m.custom_mode), Some(7));
}

/// A complete frame of a message that the shim does not define.
fn unknown() -> Vec<u8> {
    let mut bytes = vector("statustext");
    // the message identifier of MAVLink 2, least significant byte first
    bytes[7..10].copy_from_slice(&60_000_u32.to_le_bytes()[..3]);
    bytes
}

#[test]
fn an_unknown_message_is_skipped_whole_and_is_not_bad() {
    let mut bytes = unknown();
    bytes.extend(vector("heartbeat"));
    let (frames, parser) = parsed(&bytes);
    assert_eq!((frames.len(), parser.unknown(), parser.bad()), (1, 1, 0));
}

#[test]
fn every_flipped_bit_is_caught() {
    // The checksum covers every bit after the magic byte; a flipped length bit moves the checksum.
    let good = vector("hil_actuator_controls");
    for bit in 8..good.len() * 8 {
        let mut bytes = good.clone();
        bytes[bit / 8] ^= 1 << (bit % 8);
        let (frames, parser) = parsed(&bytes);
        assert!(frames.is_empty(), "bit {bit}");
        // A flipped bit in the identifier can give an unknown message, whose checksum cannot be checked.
        assert_eq!(parser.bad() + parser.unknown(), 1, "bit {bit}");
    }
}

#[test]
fn every_truncation_is_one_bad_run_and_no_frame() {
    let good = vector("gps_raw_int");
    for length in 1..good.len() {
        let (frames, parser) = parsed(&good[..length]);
        assert_eq!((frames.len(), parser.bad()), (0, 1), "{length} bytes");
    }
}

#[test]
fn a_stream_in_pieces_of_any_size_gives_the_same_frames() {
    let mut stream = Vec::new();
    for name in ["heartbeat", "highres_imu", "unknown", "heartbeat_signed", "aoa_ssa"] {
        stream.extend(b"noise between");
        stream.extend(if name == "unknown" { unknown() } else { vector(name) });
    }
    for size in 1..60 {
        let (mut ids, mut parser) = (Vec::new(), Parser::default());
        for piece in stream.chunks(size) {
            parser.stream(piece, &mut |frame| ids.push(frame.id));
        }
        // The unknown frame is followed by noise, so it is accepted only if it ends a piece. In both cases it yields no frame.
        assert_eq!(ids, [0, 105, 0, 11020], "pieces of {size}");
        assert!(
            (4..=5).contains(&parser.bad()),
            "pieces of {size}: {} runs of noise",
            parser.bad()
        );
    }
}

#[test]
fn random_bytes_never_panic_and_hold_no_frame() {
    // A 64-bit xorshift generator. A random valid frame needs the magic byte, flags, a known identifier and 16 checksum bits.
    let mut x = 0x9E37_79B9_7F4A_7C15_u64;
    let mut parser = Parser::default();
    let mut frames = 0;
    for round in 0..2000 {
        let bytes: Vec<u8> = (0..round % 300)
            .map(|_| {
                x ^= x << 13;
                x ^= x >> 7;
                x ^= x << 17;
                // Magic bytes are frequent, because the later stages of the parser must also be tested.
                match x % 8 {
                    0 => 0xFD,
                    1 => 0xFE,
                    2 | 3 => 0,
                    _ => (x >> 32) as u8,
                }
            })
            .collect();
        parser.datagram(&bytes, &mut |_| frames += 1);
        parser.stream(&bytes, &mut |_| frames += 1);
    }
    assert!(parser.bad() > 1000);
    assert!(frames < 20, "{frames} frames in noise");
}

#[test]
fn the_checksum_is_mcrf4xx() {
    // The check value of CRC-16/MCRF4XX over "123456789" is 0x6F91; its last byte serves as CRC_EXTRA.
    assert_eq!(checksum(b"12345678", b'9'), 0x6F91);
}

#[test]
fn the_simulators_messages_agree_with_pymavlink() {
    agrees(
        "hil_sensor",
        13,
        HilSensor {
            time_usec: 50_000,
            xacc: 0.5,
            yacc: -0.25,
            zacc: -9.75,
            xgyro: 0.125,
            ygyro: -0.375,
            zgyro: 0.625,
            xmag: 0.25,
            ymag: 0.5,
            zmag: 0.75,
            abs_pressure: 943.25,
            diff_pressure: 4.5,
            pressure_alt: 600.5,
            temperature: 11.5,
            fields_updated: 0x1FFF,
            id: 0,
        },
    );
    agrees(
        "hil_gps",
        14,
        HilGps {
            time_usec: 60_000,
            lat: 468_000_001,
            lon: -71_234_567,
            alt: 600_123,
            eph: 90,
            epv: 178,
            vel: 1667,
            vn: -1,
            ve: 2,
            vd: -3,
            cog: 35_999,
            fix_type: 3,
            satellites_visible: 10,
            id: 0,
            yaw: 0,
        },
    );
    agrees(
        "hil_state_quaternion",
        15,
        HilStateQuaternion {
            time_usec: 70_000,
            attitude_quaternion: [0.5, -0.25, 0.125, 0.75],
            rollspeed: 1.5,
            pitchspeed: -2.5,
            yawspeed: 3.5,
            lat: 468_000_001,
            lon: -71_234_567,
            alt: 600_123,
            vx: -1000,
            vy: 1667,
            vz: -200,
            ind_airspeed: 1600,
            true_airspeed: 1650,
            xacc: 11,
            yacc: -12,
            zacc: -1000,
        },
    );
}

#[test]
fn the_messages_of_a_connecting_ground_station_agree_with_pymavlink() {
    let (target_system, target_component) = (1, 1);
    agrees(
        "mission_request",
        16,
        MissionRequest { seq: 7, target_system, target_component, mission_type: 2 },
    );
    agrees(
        "mission_request_list",
        17,
        MissionRequestList { target_system, target_component, mission_type: 1 },
    );
    agrees(
        "mission_count",
        18,
        MissionCount { count: 0, target_system: 255, target_component: 190, mission_type: 2 },
    );
    agrees(
        "mission_clear_all",
        19,
        MissionClearAll { target_system, target_component, mission_type: 2 },
    );
    agrees(
        "mission_ack",
        20,
        MissionAck { target_system: 255, target_component: 190, result: 13, mission_type: 1 },
    );
    agrees(
        "mission_request_int",
        21,
        MissionRequestInt { seq: 7, target_system, target_component, mission_type: 2 },
    );
    agrees(
        "autopilot_version",
        22,
        AutopilotVersion {
            capabilities: 0xE054,
            uid: 5,
            flight_sw_version: 0x010F_00FF,
            vendor_id: 3,
            product_id: 4,
            flight_custom_version: [1; 8],
            os_custom_version: [2; 8],
            uid2: [6; 18],
            ..AutopilotVersion::default()
        },
    );
    agrees(
        "home_position",
        23,
        HomePosition {
            latitude: 468_000_001,
            longitude: -71_234_567,
            altitude: 600_123,
            local: [0.25, 0.5, 0.75],
            q: [1.0, 0.0, 0.0, 0.0],
            approach: [1.5, 2.5, 3.5],
            time_usec: 80_000,
        },
    );
    agrees("message_interval", 24, MessageInterval { interval_us: -1, message_id: 31 });
    let mut payload = [[0; 32]; 7];
    payload[0][..6].copy_from_slice(&[8, 0, 3, 129, 1, 4]);
    payload[0][12] = 7;
    let mut more = [0; 27];
    more[26] = 9;
    let (target_system, target_component) = (255, 190);
    agrees(
        "file_transfer_protocol",
        25,
        FileTransferProtocol { target_network: 0, target_system, target_component, payload, more },
    );
    let mut mode_name = [0; 32];
    mode_name[..6].copy_from_slice(b"Return");
    agrees(
        "available_modes",
        100,
        AvailableModes {
            custom_mode: 0x0504_0000,
            properties: 0,
            number_modes: 4,
            mode_index: 2,
            standard_mode: 5,
            mode_name,
            more: [0; 3],
        },
    );
}
