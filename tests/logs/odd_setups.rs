//! Logs of setups other than the writers' usual one: elevons by servo pulses, equivalent airspeed, clocks that wrap.

use std::path::Path;

use crate::logs_support::*;
use greylag::logs::vehicle::Kind;
use greylag::logs::{Log, Options, Sample, parse};
use mavlink::dialects::ardupilotmega::*;

fn read(bytes: &[u8]) -> Log {
    parse(bytes, Path::new("flight"), &Options::default()).unwrap()
}

fn worst(a: &[Sample], b: &[Sample], of: fn(&Sample) -> f64) -> f64 {
    assert_eq!(a.len(), b.len());
    // A NaN must not pass for agreement.
    let apart =
        |(a, b)| if (of(a) - of(b)).is_nan() { f64::INFINITY } else { (of(a) - of(b)).abs() };
    a.iter().zip(b).map(apart).fold(0.0, f64::max)
}

/// A servo: channel, SERVOn_FUNCTION, minimum, trim, maximum, whether reversed.
type Servo = (usize, f64, [f64; 3], bool);

/// Pulse of a servo at −1..1, as ArduPilot makes it: each side of the trim by its own range.
fn pulse((_, _, [min, trim, max], reversed): Servo, x: f64) -> f64 {
    let x = if reversed { -x } else { x };
    trim + x * if x > 0.0 { max - trim } else { trim - min }
}

/// Unlike servos: trims off the middle, unequal sides, one reversed.
const LEFT: Servo = (2, 77.0, [1010.0, 1480.0, 1990.0], true);
const RIGHT: Servo = (4, 78.0, [1100.0, 1520.0, 1900.0], false);
const THROTTLE: Servo = (3, 70.0, [1050.0, 1050.0, 1930.0], false);

/// The elevons of ArduPilot at mixing gain 0.5: left = g (elevator − aileron), right = g (elevator +
/// aileron), its elevator positive nose up; pulses by channel from 1.
fn pulses(s: &Sample) -> [f64; 5] {
    let (a, e) = (s.aileron_cmd, -s.elevator_cmd);
    let mut out = [0.0; 5];
    out[LEFT.0] = pulse(LEFT, 0.5 * (e - a));
    out[RIGHT.0] = pulse(RIGHT, 0.5 * (e + a));
    let [min, _, max] = THROTTLE.2;
    out[THROTTLE.0] = min + s.throttle_cmd * (max - min);
    out
}

fn parameters() -> Vec<(String, f64)> {
    let of = |(n, function, [min, trim, max], reversed): Servo| {
        [
            ("FUNCTION", function),
            ("MIN", min),
            ("TRIM", trim),
            ("MAX", max),
            ("REVERSED", f64::from(u8::from(reversed))),
        ]
        .map(|(what, x)| (format!("SERVO{n}_{what}"), x))
    };
    [LEFT, RIGHT, THROTTLE].into_iter().flat_map(of).collect()
}

/// The writer's log with its AETR taken out, PARM and RCOU put in.
fn with_servos(samples: &[Sample]) -> Vec<u8> {
    let mut out = Vec::new();
    let padded = |text: &str, len: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(len, 0);
        bytes
    };
    for (kind, len, name, format, labels) in [
        (20u8, 3 + 8 + 16 + 4, "PARM", "QNf", "TimeUS,Name,Value"),
        (21, 3 + 8 + 8, "RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4"),
    ] {
        out.extend([0xA3, 0x95, 128, kind, len as u8]);
        out.extend([padded(name, 4), padded(format, 16), padded(labels, 64)].concat());
    }
    for (name, value) in parameters() {
        out.extend([0xA3, 0x95, 20]);
        out.extend(0u64.to_le_bytes());
        out.extend(padded(&name, 16));
        out.extend((value as f32).to_le_bytes());
    }
    for s in samples {
        out.extend([0xA3, 0x95, 21]);
        out.extend(((s.time_s * 1e6).round() as u64).to_le_bytes());
        pulses(s)[1..].iter().for_each(|us| out.extend((us.round() as u16).to_le_bytes()));
    }
    let mut rest = dataflash(samples);
    // Record 8 is AETR: declared as another type, nothing asks for it.
    let at = rest.windows(4).position(|w| w == b"AETR").unwrap();
    rest[at..at + 4].copy_from_slice(b"NONE");
    // Its declarations come first, as in every log.
    let declared = 9 * 89;
    let tail = rest.split_off(declared);
    [rest, out, tail].concat()
}

#[test]
fn elevon_pulses_become_commands() {
    let truth = samples(500);
    let log = read(&with_servos(&truth));
    let rows = &log.flight.samples;
    // A pulse counts µs: half of one in 380 µs of range, for two servos at gain 0.5.
    let quantum = 2.0 * 0.5 / 380.0 + 1e-6;
    assert!(worst(&truth, rows, |s| s.aileron_cmd) < quantum);
    assert!(worst(&truth, rows, |s| s.elevator_cmd) < quantum);
    assert!(worst(&truth, rows, |s| s.throttle_cmd) < 0.5 / 880.0 + 1e-6);
    assert!(log.flight.notes.iter().any(|n| n.contains("elevons")), "{:?}", log.flight.notes);
}

fn written(stamp: u64, component_id: u8, message: &MavMessage, out: &mut Vec<u8>) {
    sent(stamp, [1, component_id], message, out);
}

fn sent(stamp: u64, [system_id, component_id]: [u8; 2], message: &MavMessage, out: &mut Vec<u8>) {
    out.extend(stamp.to_be_bytes());
    let header = mavlink::MavHeader { system_id: system_id.into(), component_id, sequence: 0 };
    mavlink::write_v2_msg(out, header, message).unwrap();
}

/// A telemetry log of ArduPilot: heartbeat, Euler angles, milli-g, servo pulses, equivalent airspeed;
/// own times from `start_ms` on, which wraps at 32 bits.
fn ardupilot(samples: &[Sample], start_ms: u32) -> Vec<u8> {
    let mut out = Vec::new();
    let host = 1_760_000_000_000_000u64;
    let heartbeat = HEARTBEAT_DATA {
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        mavtype: MavType::MAV_TYPE_FIXED_WING,
        ..Default::default()
    };
    written(host, 1, &MavMessage::HEARTBEAT(heartbeat), &mut out);
    for (name, value) in parameters() {
        let parameter = PARAM_VALUE_DATA {
            param_id: name.as_str().into(),
            param_value: value as f32,
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
            ..Default::default()
        };
        written(host, 1, &MavMessage::PARAM_VALUE(parameter), &mut out);
    }
    for (i, s) in samples.iter().enumerate() {
        let stamp = host + 10_000 * i as u64;
        let ms = start_ms.wrapping_add(10 * i as u32);
        let [roll, pitch, yaw] = s.attitude_rad.map(|x| x as f32);
        let [p, q, r] = s.rates_radps.map(|x| x as f32);
        let density = s.air_density_kgpm3;
        let [_, left, throttle, right] = [1, 2, 3, 4].map(|n| pulses(s)[n].round() as u16);
        let messages = [
            MavMessage::SCALED_PRESSURE(SCALED_PRESSURE_DATA {
                time_boot_ms: ms,
                press_abs: (density * 287.053 * 298.15 / 100.0) as f32,
                temperature: 2500,
                ..Default::default()
            }),
            MavMessage::VFR_HUD(VFR_HUD_DATA {
                airspeed: (s.airspeed_mps * (density / 1.225).sqrt()) as f32,
                alt: s.altitude_m as f32,
                ..Default::default()
            }),
            MavMessage::SERVO_OUTPUT_RAW(SERVO_OUTPUT_RAW_DATA {
                time_usec: ms.wrapping_mul(1000),
                servo2_raw: left,
                servo3_raw: throttle,
                servo4_raw: right,
                ..Default::default()
            }),
            MavMessage::ATTITUDE(ATTITUDE_DATA {
                time_boot_ms: ms,
                roll,
                pitch,
                yaw,
                rollspeed: p,
                pitchspeed: q,
                yawspeed: r,
            }),
        ];
        messages.iter().for_each(|m| written(stamp, 1, m, &mut out));
    }
    out
}

#[test]
fn equivalent_airspeed_becomes_true() {
    let mut truth = samples(500);
    // Air as at 3000 m: equivalent airspeed is 14 % lower.
    truth.iter_mut().for_each(|s| s.air_density_kgpm3 = 0.909);
    let log = read(&ardupilot(&truth, 60_000));
    assert!(worst(&truth, &log.flight.samples, |s| s.airspeed_mps) < 1e-5);
    assert!(log.flight.notes.iter().any(|n| n.contains("equivalent airspeed")));
    // The same by ARSP and BARO of a DataFlash log.
    let log = read(&dataflash(&truth));
    assert!(worst(&truth, &log.flight.samples, |s| s.airspeed_mps) < 1e-5);
}

#[test]
fn a_clock_of_32_bits_may_wrap() {
    let truth = samples(500);
    let plain = read(&ardupilot(&truth, 60_000));
    // The wrap comes after 2 s of 5.
    let start = u32::MAX - 1999;
    let wrapped = read(&ardupilot(&truth, start));
    let times = |log: &Log| -> Vec<f64> {
        let first = log.flight.samples[0].time_s;
        log.flight.samples.iter().map(|s| s.time_s - first).collect()
    };
    assert_eq!((wrapped.flight.samples.len(), wrapped.dropped), (500, 0));
    for (a, b) in times(&plain).iter().zip(times(&wrapped)) {
        assert!((a - b).abs() < 1e-6, "{a} {b}");
    }
    let quantum = 2.0 * 0.5 / 380.0 + 1e-6;
    for log in [&plain, &wrapped] {
        let rows = &log.flight.samples;
        assert!(worst(&truth, rows, |s| s.airspeed_mps) < 1e-5);
        assert!(worst(&truth, rows, |s| s.aileron_cmd) < quantum);
        assert!(worst(&truth, rows, |s| s.elevator_cmd) < quantum);
    }
}

/// Attitudes of a second vehicle that stands still, twice as often as those of the one that flies.
fn beside_one_that_stands(flight: Vec<u8>, rows: usize) -> Vec<u8> {
    let mut out = Vec::new();
    for i in 0..2 * rows {
        let message = MavMessage::ATTITUDE(ATTITUDE_DATA {
            time_boot_ms: 5 * i as u32,
            ..Default::default()
        });
        sent(1_760_000_000_000_000 + 5_000 * i as u64, [2, 1], &message, &mut out);
    }
    out.extend(flight);
    out
}

#[test]
fn of_two_vehicles_in_a_file_the_one_that_flies_is_read() {
    let truth = samples(1000);
    let bytes = beside_one_that_stands(ardupilot(&truth, 1000), 1000);
    let log = read(&bytes);
    assert_eq!(log.life.as_deref(), Some("system 1"));
    assert_eq!(log.flight.samples.len(), 1000);
    let said = log.findings.iter().any(|f| f.text.contains("the file holds 2 flights"));
    assert!(said, "{:?}", log.findings);
}

/// The same telemetry from a vehicle of another type.
fn of_type(mavtype: MavType) -> Vec<u8> {
    let mut out = ardupilot(&samples(1000), 1000);
    let heartbeat = HEARTBEAT_DATA {
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        mavtype,
        ..Default::default()
    };
    written(1_760_000_000_000_000 + 20_000_000, 1, &MavMessage::HEARTBEAT(heartbeat), &mut out);
    out
}

#[test]
fn a_multicopter_is_named_and_asked_for_nothing() {
    // Both types in one log are those of a quadplane: the copter's alone makes a copter.
    let quadplane = read(&of_type(MavType::MAV_TYPE_QUADROTOR));
    assert_eq!(quadplane.vehicle.map(|v| v.kind), Some(Kind::Vtol));
    let mut copter = Vec::new();
    let heartbeat = HEARTBEAT_DATA {
        autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
        mavtype: MavType::MAV_TYPE_HEXAROTOR,
        ..Default::default()
    };
    written(1_760_000_000_000_000, 1, &MavMessage::HEARTBEAT(heartbeat), &mut copter);
    for i in 0..500u32 {
        let message =
            MavMessage::ATTITUDE(ATTITUDE_DATA { time_boot_ms: 10 * i, ..Default::default() });
        written(1_760_000_000_000_000 + 10_000 * u64::from(i), 1, &message, &mut copter);
    }
    let path = Path::new("copter.tlog");
    let error = greylag::logs::parse(&copter, path, &Options::default()).unwrap_err().to_string();
    assert!(error.contains("the vehicle is a multicopter (HEARTBEAT.type 13)"), "{error}");
    assert!(!error.contains("HIL_ACTUATOR_CONTROLS"), "{error}");
}

#[test]
fn a_quadplane_is_cut_to_flight_on_its_wings() {
    let mut out = Vec::new();
    let mode = |custom_mode: u32| {
        MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode,
            autopilot: MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA,
            mavtype: MavType::MAV_TYPE_VTOL_TILTROTOR,
            ..Default::default()
        })
    };
    let start = 1_760_000_000_000_000;
    // QHOVER until 4 s, FBWA after.
    written(start, 1, &mode(18), &mut out);
    written(start + 4_000_000, 1, &mode(5), &mut out);
    out.extend(ardupilot(&samples(1000), 1000));
    let log = read(&out);
    assert_eq!(log.vehicle.map(|v| v.kind), Some(Kind::Vtol));
    let first = log.flight.samples[0].time_s;
    assert!((first - 5.0).abs() < 0.05, "1 s of boot and 4 s of hover: {first}");
    assert!(log.findings.iter().any(|f| f.text.contains("rows are left out: the vehicle hovers")));
}
