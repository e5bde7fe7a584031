//! Writers of the binary formats, sharing no code with the readers.
#![allow(dead_code)] // each test that includes this module uses its part

use greylag::logs::Sample;

/// A flight whose channels move, rows at 100 Hz: banked turns at 20 m/s, 600 m.
pub fn samples(rows: usize) -> Vec<Sample> {
    let g = 9.80665;
    let sample = |i: usize| {
        let t = 10.0 + i as f64 * 0.01;
        let w = 0.8;
        let roll = 0.6 * (w * t).sin();
        let pitch: f64 = 0.1 * (0.3 * t).sin();
        let v = 20.0 + (0.2 * t).sin();
        // Kinematics of a coordinated turn, so that units can be told.
        let turn = g * roll.tan() / v;
        let yaw = (t * 0.9).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        Sample {
            time_s: t,
            attitude_rad: [roll, pitch, yaw],
            rates_radps: [0.6 * w * (w * t).cos(), turn * roll.sin(), turn * roll.cos()],
            airspeed_mps: v,
            alpha_rad: 0.03 + 0.01 * (1.3 * t).sin(),
            beta_rad: 0.02 * (0.7 * t).sin(),
            specific_force_mps2: [0.3 * t.sin(), 0.1 * t.cos(), -g / roll.cos()],
            velocity_ned_mps: [v * yaw.cos(), v * yaw.sin(), -v * pitch],
            altitude_m: 600.0 + 5.0 * (0.1 * t).sin(),
            air_density_kgpm3: 1.156,
            aileron_cmd: 0.3 * (w * t).cos(),
            elevator_cmd: 0.05 + 0.1 * (0.5 * t).sin(),
            throttle_cmd: 0.3 + 0.1 * (0.4 * t).sin(),
            ..Sample::default()
        }
    };
    (0..rows).map(sample).collect()
}

pub fn quaternion([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let ((sr, cr), (sp, cp), (sy, cy)) =
        ((roll / 2.0).sin_cos(), (pitch / 2.0).sin_cos(), (yaw / 2.0).sin_cos());
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
}

fn micros(s: &Sample) -> u64 {
    (s.time_s * 1e6).round() as u64
}

fn ulog_record(out: &mut Vec<u8>, kind: u8, body: &[u8]) {
    out.extend((body.len() as u16).to_le_bytes());
    out.push(kind);
    out.extend(body);
}

pub fn ulog(samples: &[Sample]) -> Vec<u8> {
    let mut out = vec![0x55, 0x4C, 0x6F, 0x67, 0x01, 0x12, 0x35, 1];
    out.extend(0u64.to_le_bytes());
    ulog_record(&mut out, b'B', &[0; 40]);
    let topics = [
        ("vehicle_attitude", "float[4] q"),
        ("vehicle_angular_velocity", "float[3] xyz"),
        ("vehicle_acceleration", "float[3] xyz"),
        ("airspeed_validated", "float true_airspeed_m_s"),
        ("airflow_aoa", "float aoa_rad"),
        ("airflow_slip", "float slip_rad"),
        ("vehicle_local_position", "float vx;float vy;float vz"),
        ("vehicle_air_data", "float baro_alt_meter;float rho"),
        ("actuator_servos", "float[8] control"),
        ("actuator_motors", "float[12] control"),
        // As PX4 of 2025 writes it: no Euler angles.
        ("vehicle_attitude_setpoint", "float[4] q_d"),
    ];
    for (name, fields) in topics {
        ulog_record(&mut out, b'F', format!("{name}:uint64_t timestamp;{fields};").as_bytes());
    }
    // Two elevons: right (0) rolls left when down, left (1) rolls right; both pitch down.
    for (name, x) in [
        ("CA_SV_CS0_TRQ_R", -0.5f32),
        ("CA_SV_CS1_TRQ_R", 0.5),
        ("CA_SV_CS0_TRQ_P", -0.5),
        ("CA_SV_CS1_TRQ_P", -0.5),
    ] {
        let key = format!("float {name}");
        let body = [&[key.len() as u8], key.as_bytes(), &x.to_le_bytes()].concat();
        ulog_record(&mut out, b'P', &body);
    }
    for (i, (name, _)) in topics.iter().enumerate() {
        ulog_record(&mut out, b'A', &[&[0, i as u8, 0], name.as_bytes()].concat());
    }
    for s in samples {
        let (v, f, w) = (s.velocity_ned_mps, s.specific_force_mps2, s.rates_radps);
        let (a, e) = (s.aileron_cmd, s.elevator_cmd);
        let mut servos = vec![e - a, e + a];
        servos.resize(8, f64::NAN);
        // PX4 stops a motor below 0.02, by NaN.
        let motor = if s.throttle_cmd < 0.02 { f64::NAN } else { s.throttle_cmd };
        let mut motors = vec![motor];
        motors.resize(12, f64::NAN);
        let all: [Vec<f64>; 11] = [
            quaternion(s.attitude_rad).to_vec(),
            w.to_vec(),
            f.to_vec(),
            vec![s.airspeed_mps],
            vec![s.alpha_rad],
            vec![s.beta_rad],
            v.to_vec(),
            vec![s.altitude_m, s.air_density_kgpm3],
            servos,
            motors,
            // NaN where there is no target.
            quaternion([s.roll_target_rad, s.pitch_target_rad, 0.3]).to_vec(),
        ];
        for (i, values) in all.iter().enumerate() {
            let mut body = vec![i as u8, 0];
            body.extend(micros(s).to_le_bytes());
            values.iter().for_each(|x| body.extend((*x as f32).to_le_bytes()));
            ulog_record(&mut out, b'D', &body);
        }
    }
    out
}

fn padded(text: &str, len: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(len, 0);
    bytes
}

pub fn dataflash(samples: &[Sample]) -> Vec<u8> {
    let mut out = Vec::new();
    let types: [(u8, u8, &str, &str, &str); 9] = [
        (128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        (1, 3 + 8 + 12, "ATT", "Qfff", "TimeUS,Roll,Pitch,Yaw"),
        (2, 3 + 9 + 24, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        (3, 3 + 9 + 4, "ARSP", "QBf", "TimeUS,I,Airspeed"),
        (4, 3 + 8 + 8, "AOA", "Qff", "TimeUS,AOA,SSA"),
        (5, 3 + 9 + 12, "BARO", "QBfff", "TimeUS,I,Alt,Press,Temp"),
        (6, 3 + 9 + 12, "XKF1", "QBfff", "TimeUS,C,VN,VE,VD"),
        (7, 3 + 8 + 12, "POS", "Qfff", "TimeUS,Lat,Lng,Alt"),
        (8, 3 + 8 + 12, "AETR", "Qfff", "TimeUS,Ail,Elev,Thr"),
    ];
    for (kind, len, name, format, labels) in types {
        out.extend([0xA3, 0x95, 128, kind, len]);
        out.extend([padded(name, 4), padded(format, 16), padded(labels, 64)].concat());
    }
    for s in samples {
        let mut record = |kind: u8, instance: Option<u8>, values: &[f64]| {
            out.extend([0xA3, 0x95, kind]);
            out.extend(micros(s).to_le_bytes());
            out.extend(instance);
            values.iter().for_each(|x| out.extend((*x as f32).to_le_bytes()));
        };
        let degrees = s.attitude_rad.map(f64::to_degrees);
        record(1, None, &[degrees[0], degrees[1], degrees[2].rem_euclid(360.0)]);
        let imu = [s.rates_radps, s.specific_force_mps2].concat();
        // A second, worse sensor comes first in the file.
        record(2, Some(1), &[9.0; 6]);
        record(2, Some(0), &imu);
        record(3, Some(0), &[s.airspeed_mps * (s.air_density_kgpm3 / 1.225).sqrt()]);
        record(4, None, &[s.alpha_rad.to_degrees(), s.beta_rad.to_degrees()]);
        record(5, Some(0), &[0.0, s.air_density_kgpm3 * 287.053 * 288.15, 15.0]);
        record(6, Some(0), &s.velocity_ned_mps);
        record(7, None, &[0.0, 0.0, s.altitude_m]);
        record(
            8,
            None,
            &[4500.0 * s.aileron_cmd, -4500.0 * s.elevator_cmd, 100.0 * s.throttle_cmd],
        );
    }
    out
}

/// What the shim sends with what the companion answers, at a host clock of its own.
pub fn tlog(samples: &[Sample]) -> Vec<u8> {
    tlog_with(samples, 1)
}

/// The same with every `nth` GLOBAL_POSITION_INT only.
pub fn tlog_with(samples: &[Sample], nth: usize) -> Vec<u8> {
    use mavlink::dialects::ardupilotmega::*;
    let mut out = Vec::new();
    for (i, s) in samples.iter().enumerate() {
        // Lockstep runs five times as fast as time.
        let stamp = 1_760_000_000_000_000u64 + 2_000 * i as u64;
        let us = micros(s);
        let q = quaternion(s.attitude_rad).map(|x| x as f32);
        let [p, r, y] = s.rates_radps.map(|x| x as f32);
        let f = s.specific_force_mps2.map(|x| x as f32);
        let v = s.velocity_ned_mps.map(|x| (x * 100.0).round() as i16);
        let mut controls = [0.0; 16];
        controls[0] = s.aileron_cmd as f32;
        controls[1] = s.elevator_cmd as f32;
        controls[2] = s.throttle_cmd as f32;
        let pressure = (s.air_density_kgpm3 * 287.053 * 288.15 / 100.0) as f32;
        let messages = [
            (
                200,
                MavMessage::GLOBAL_POSITION_INT(GLOBAL_POSITION_INT_DATA {
                    time_boot_ms: (us / 1000) as u32,
                    vx: v[0],
                    vy: v[1],
                    vz: v[2],
                    ..Default::default()
                }),
            ),
            (
                200,
                MavMessage::HIGHRES_IMU(HIGHRES_IMU_DATA {
                    time_usec: us,
                    xacc: f[0],
                    yacc: f[1],
                    zacc: f[2],
                    abs_pressure: pressure,
                    temperature: 15.0,
                    ..Default::default()
                }),
            ),
            (
                200,
                MavMessage::VFR_HUD(VFR_HUD_DATA {
                    airspeed: s.airspeed_mps as f32,
                    alt: s.altitude_m as f32,
                    ..Default::default()
                }),
            ),
            (
                200,
                MavMessage::AOA_SSA(AOA_SSA_DATA {
                    time_usec: us,
                    AOA: s.alpha_rad.to_degrees() as f32,
                    SSA: s.beta_rad.to_degrees() as f32,
                }),
            ),
            (
                200,
                MavMessage::ATTITUDE_QUATERNION(ATTITUDE_QUATERNION_DATA {
                    time_boot_ms: (us / 1000) as u32,
                    q1: q[0],
                    q2: q[1],
                    q3: q[2],
                    q4: q[3],
                    rollspeed: p,
                    pitchspeed: r,
                    yawspeed: y,
                    ..Default::default()
                }),
            ),
            (
                1,
                MavMessage::HIL_ACTUATOR_CONTROLS(HIL_ACTUATOR_CONTROLS_DATA {
                    time_usec: us,
                    controls,
                    ..Default::default()
                }),
            ),
        ];
        let skipped = usize::from(i % nth != 0);
        for (component_id, message) in messages.into_iter().skip(skipped) {
            out.extend(stamp.to_be_bytes());
            let header = mavlink::MavHeader { system_id: 1, component_id, sequence: i as u8 };
            mavlink::write_v2_msg(&mut out, header, &message).unwrap();
        }
    }
    out
}

pub fn csv(samples: &[Sample]) -> Vec<u8> {
    let mut out = Vec::new();
    greylag::logs::csv::write(&samples.to_vec().into(), &mut out).unwrap();
    out
}

/// The binary log in text, as ground stations save it, behind the lines of the firmware.
pub fn in_text(binary: &[u8], firmware: &str) -> String {
    let mut out = format!("\n{firmware}\n\nFree RAM: 1234\n");
    let mut letters: [(String, String); 256] = std::array::from_fn(|_| Default::default());
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim_end_matches('\0').to_owned();
    out += "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n";
    out += "FMT, 200, 67, MSG, Z, Message\n";
    let mut at = 0;
    let mut lengths = [89usize; 256];
    while at + 3 <= binary.len() {
        let kind = usize::from(binary[at + 2]);
        let body = &binary[at + 3..at + lengths[kind]];
        if kind == 128 {
            let (declared, name) = (usize::from(body[0]), text(&body[2..6]));
            let (format, labels) = (text(&body[6..22]), text(&body[22..86]));
            lengths[declared] = usize::from(body[1]);
            out += &format!("FMT, {declared}, {}, {name}, {format}, {labels}\n", body[1]);
            letters[declared] = (name, format);
        } else {
            let (name, format) = &letters[kind];
            let mut offset = 0;
            let mut fields = vec![name.clone()];
            for letter in format.bytes() {
                let piece = &body[offset..];
                let (value, size) = match letter {
                    b'Q' => (u64::from_le_bytes(piece[..8].try_into().unwrap()).to_string(), 8),
                    b'f' => (f32::from_le_bytes(piece[..4].try_into().unwrap()).to_string(), 4),
                    b'B' => (piece[0].to_string(), 1),
                    b'd' => (f64::from_le_bytes(piece[..8].try_into().unwrap()).to_string(), 8),
                    other => panic!("{}", char::from(other)),
                };
                fields.push(value);
                offset += size;
            }
            out += &(fields.join(", ") + "\n");
        }
        at += lengths[kind];
    }
    out
}
