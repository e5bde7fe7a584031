//! Compares the sensor messages for PX4 with the truth, and their noise with its specification.

use crate::px4_client::*;
use greylag_sitl::shim::{Bias, Existing, FIRST_US, Launch, Px4Noise, Px4Options, TruthFile};

/// Magnetic field at the home position (46.8° N, 0° E, 600 m, 2026.0) by WMM2025: north, east, down, gauss. The source is
/// pygeomag 1.1.0, which is independent of the simulator's implementation.
const FIELD: [f64; 3] = [0.221_101, 0.005_322, 0.422_151];
/// Gravity at the home position including the earth's rotation, m/s² (FACTS.md of the X8: JSBSim's value at 600 m).
const GRAVITY: f64 = 9.806;

/// A row of the truth file.
#[derive(Clone, Debug)]
struct Row(Vec<f64>);

const COLUMNS: [&str; 25] = [
    "time_s",
    "roll_rad",
    "pitch_rad",
    "yaw_rad",
    "p_radps",
    "q_radps",
    "r_radps",
    "airspeed_mps",
    "alpha_rad",
    "beta_rad",
    "ax_mps2",
    "ay_mps2",
    "az_mps2",
    "vn_mps",
    "ve_mps",
    "vd_mps",
    "altitude_m",
    "air_density_kgpm3",
    "aileron_rad",
    "elevator_rad",
    "throttle",
    "aileron_cmd",
    "elevator_cmd",
    "throttle_cmd",
    "rate_hold_s",
];

impl Row {
    fn get(&self, name: &str) -> f64 {
        self.0[COLUMNS.iter().position(|column| *column == name).expect(name)]
    }

    fn three(&self, names: [&str; 3]) -> [f64; 3] {
        names.map(|name| self.get(name))
    }

    /// Transforms a vector from north-east-down to body axes by direction cosines (ZYX).
    fn body(&self, [n, e, d]: [f64; 3]) -> [f64; 3] {
        let [(sr, cr), (sp, cp), (sy, cy)] =
            self.three(["roll_rad", "pitch_rad", "yaw_rad"]).map(f64::sin_cos);
        [
            cp * cy * n + cp * sy * e - sp * d,
            (sr * sp * cy - cr * sy) * n + (sr * sp * sy + cr * cy) * e + sr * cp * d,
            (cr * sp * cy + sr * sy) * n + (cr * sp * sy - sr * cy) * e + cr * cp * d,
        ]
    }
}

/// Messages and truth of 4 s of a flight that rolls, pitches and turns.
fn flight() -> (Vec<Shown>, Vec<Row>) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("truth.csv");
    let mut options = hurried();
    options.launch = Launch::Immediate;
    options.duration_s = Some(4.0);
    options.plant.air.wind_ned_mps = [3.0, -2.0, 0.0];
    options.truth = Some(TruthFile { path: path.clone(), existing: Existing::Keep });
    let simulator = Simulator::start(options);
    let mut px4 = Px4::boot(simulator.address);
    px4.armed = true;
    let control = |k: usize| {
        let t = k as f32 * 0.004;
        outputs(0.25 * (2.5 * t).sin(), 0.03 + 0.03 * (2.0 * t).sin(), 0.5)
    };
    let shown = (0..1000).map(|k| px4.step(control(k))).collect();
    simulator.end();
    let text = std::fs::read_to_string(&path).expect("a truth file");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some(COLUMNS.join(",").as_str()));
    let row = |line: &str| Row(line.split(',').map(|x| x.parse().expect(x)).collect());
    (shown, lines.map(row).collect())
}

fn near(name: &str, k: usize, shown: f64, expected: f64, within: f64) {
    assert!((shown - expected).abs() <= within, "{name} at step {k}: {shown}, truth {expected}");
}

#[test]
fn without_noise_every_sensor_shows_the_truth_in_its_unit() {
    let (shown, truth) = flight();
    assert_eq!((shown.len(), truth.len()), (1000, 1000));
    let mut turned: f64 = 0.0;
    for (k, (shown, row)) in shown.iter().zip(&truth).enumerate() {
        let s = &shown.sensor;
        assert_eq!(s.time_usec, FIRST_US + k as u64 * STEP_US);
        near("time", k, row.get("time_s"), k as f64 * 0.004, 1e-9);
        // The messages contain floats, with a relative error of 1e-6.
        let wide = |x: [f32; 3]| x.map(f64::from);
        let pairs = [
            (
                "gyro",
                wide([s.xgyro, s.ygyro, s.zgyro]),
                row.three(["p_radps", "q_radps", "r_radps"]),
            ),
            (
                "accelerometer",
                wide([s.xacc, s.yacc, s.zacc]),
                row.three(["ax_mps2", "ay_mps2", "az_mps2"]),
            ),
        ];
        for (name, shown, truth) in pairs {
            (0..3).for_each(|i| near(name, k, shown[i], truth[i], 1e-5));
        }
        turned = turned.max(row.get("roll_rad").abs());
        if !k.is_multiple_of(5) {
            continue;
        }
        // The field of an independent implementation differs by 1e-4 gauss (0.02 %).
        let field = row.body(FIELD);
        let magnetic = wide([s.xmag, s.ymag, s.zmag]);
        (0..3).for_each(|i| near("magnetometer", k, magnetic[i], field[i], 1e-4));
        // The standard atmosphere as a function of height, the inverse of the simulator's conversion. JSBSim's geopotential
        // height differs from the geometric height by 0.06 m at 600 m.
        let altitude = row.get("altitude_m");
        let pressure = 1013.25 * (1.0 - 2.255_77e-5 * altitude).powf(5.255_88);
        near("pressure, hPa", k, s.abs_pressure.into(), pressure, 0.02);
        near("pressure altitude", k, s.pressure_alt.into(), altitude, 0.2);
        near("temperature", k, s.temperature.into(), 15.0 - 0.0065 * altitude, 0.05);
        // A pitot tube along body x measures the component u of the air-relative velocity.
        let ahead =
            row.get("airspeed_mps") * row.get("alpha_rad").cos() * row.get("beta_rad").cos();
        let dynamic = 0.005 * row.get("air_density_kgpm3") * ahead * ahead;
        near("differential pressure, hPa", k, s.diff_pressure.into(), dynamic, 1e-5);
    }
    assert!(turned > 0.3, "the flight rolled by {turned} rad only");
}

#[test]
fn accelerometer_and_gyro_are_the_derivatives_of_what_gps_and_attitude_show() {
    let (shown, truth) = flight();
    let (mut worst_force, mut worst_rate): (f64, f64) = (0.0, 0.0);
    for k in 300..999 {
        let (before, now, after) = (&truth[k - 1], &truth[k], &truth[k + 1]);
        let names = ["vn_mps", "ve_mps", "vd_mps"];
        let (b, a) = (before.three(names), after.three(names));
        // The specific force is the acceleration minus gravity.
        let mut felt: [f64; 3] = std::array::from_fn(|i| (a[i] - b[i]) / 0.008);
        felt[2] -= GRAVITY;
        let felt = now.body(felt);
        let s = &shown[k].sensor;
        let force = [s.xacc, s.yacc, s.zacc].map(f64::from);
        (0..3).for_each(|i| worst_force = worst_force.max((force[i] - felt[i]).abs()));
        // Roll kinematics: dφ/dt = p + (q sin φ + r cos φ) tan θ.
        let derivative = (after.get("roll_rad") - before.get("roll_rad")) / 0.008;
        let (sr, cr) = now.get("roll_rad").sin_cos();
        let [p, q, r] = [s.xgyro, s.ygyro, s.zgyro].map(f64::from);
        let kinematic = p + (q * sr + r * cr) * now.get("pitch_rad").tan();
        worst_rate = worst_rate.max((derivative - kinematic).abs());
    }
    // Central differences over 8 ms; the earth's rotation (0.003 m/s²) is neglected. Measured: 0.002 m/s² and 0.0005 rad/s. A
    // wrong axis or one step of delay would give 0.1.
    println!("specific force within {worst_force:.4} m/s², roll rate within {worst_rate:.5} rad/s");
    assert!(worst_force < 0.02, "{worst_force} m/s²");
    assert!(worst_rate < 0.005, "{worst_rate} rad/s");
}

#[test]
fn gps_and_state_agree_with_the_truth() {
    let (shown, truth) = flight();
    let mut fixes = 0;
    for (k, (shown, row)) in shown.iter().zip(&truth).enumerate() {
        let velocity = row.three(["vn_mps", "ve_mps", "vd_mps"]);
        if let Some(gps) = &shown.gps {
            fixes += 1;
            assert_eq!((gps.fix_type, gps.time_usec), (3, shown.sensor.time_usec));
            // The resolutions are 1 cm/s and 1 mm.
            let shown = [gps.vn, gps.ve, gps.vd].map(f64::from);
            (0..3).for_each(|i| near("GPS velocity", k, shown[i], velocity[i] * 1e2, 0.51));
            near("GPS speed", k, gps.vel.into(), velocity[0].hypot(velocity[1]) * 1e2, 0.51);
            let course = velocity[1].atan2(velocity[0]).to_degrees().rem_euclid(360.0);
            near("GPS course", k, f64::from(gps.cog) * 1e-2, course, 0.01);
            near("GPS altitude", k, gps.alt.into(), row.get("altitude_m") * 1e3, 0.51);
        }
        if let Some(state) = &shown.state {
            let shown = [state.vx, state.vy, state.vz].map(f64::from);
            (0..3).for_each(|i| near("state velocity", k, shown[i], velocity[i] * 1e2, 0.51));
            near(
                "true airspeed",
                k,
                state.true_airspeed.into(),
                row.get("airspeed_mps") * 1e2,
                0.51,
            );
            let [w, x, y, z] = state.attitude_quaternion.map(f64::from);
            let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
            near("roll of the quaternion", k, roll, row.get("roll_rad"), 1e-6);
            let az = row.get("az_mps2") / 9.806_65 * 1e3;
            near("acceleration, mG", k, state.zacc.into(), az, 0.51);
        }
    }
    assert!(fixes >= 39, "{fixes}");
    // The displacement between two fixes must equal velocity times 0.1 s, about 1.7 m; the resolution of 1e-7° is 11 mm.
    let fixes: Vec<_> = shown.iter().filter_map(|s| s.gps.as_ref()).collect();
    for pair in fixes.windows(2) {
        let north = f64::from(pair[1].lat - pair[0].lat) * 1e-7 * 111_160.0;
        let flown = 0.05 * f64::from(pair[0].vn + pair[1].vn) * 1e-2;
        assert!((north - flown).abs() < 0.03, "{north} m north, {flown} by velocity");
    }
}

#[test]
fn on_the_stand_it_feels_gravity_alone_and_the_catapult_leads_to_the_start() {
    let mut options = hurried();
    options.start.pitch_rad = 0.1;
    options.start.alpha_rad = 0.05;
    let simulator = Simulator::start(options);
    let mut px4 = Px4::boot(simulator.address);
    let standing: Vec<Shown> = (0..300).map(|_| px4.step(outputs(0.0, 0.0, 1.0))).collect();
    for Shown { sensor: s, gps, .. } in &standing {
        // Disarmed: nothing moves, whatever PX4 commands.
        assert_eq!([s.xgyro, s.ygyro, s.zgyro], [0.0; 3]);
        // JSBSim leaves a rounding error in the wind.
        assert!(s.diff_pressure.abs() < 1e-20, "{s:?}");
        let expected = [GRAVITY * 0.1_f64.sin(), 0.0, -GRAVITY * 0.1_f64.cos()];
        for (shown, expected) in [s.xacc, s.yacc, s.zacc].into_iter().zip(expected) {
            assert!((f64::from(shown) - expected).abs() < 1e-3, "{s:?}");
        }
        if let Some(gps) = gps {
            assert_eq!((gps.vel, gps.vn, gps.ve, gps.vd), (0, 0, 0, 0));
        }
    }
    let stand = standing.iter().rev().find_map(|s| s.gps.clone()).unwrap();
    // Armed without throttle, the aircraft stays on its stand.
    px4.armed = true;
    assert!(px4.step(outputs(0.0, 0.0, 0.0)).sensor.diff_pressure < 1e-20);
    px4.step(outputs(0.0, 0.0, 0.0));
    px4.step(outputs(0.0, 0.0, 0.5));
    let pulled: Vec<Shown> = (0..400).map(|_| px4.step(outputs(0.0, 0.0, 0.5))).collect();
    // The catapult accelerates at 16.67 m/s² for 1 s along the path, which is 0.05 rad below the nose.
    let push = f64::from(pulled[100].sensor.xacc) - GRAVITY * 0.1_f64.sin();
    assert!((push - 16.67 * 0.05_f64.cos()).abs() < 0.01, "{push}");
    let speed: f64 = pulled[..250]
        .iter()
        .map(|s| (f64::from(s.sensor.xacc) - GRAVITY * 0.1_f64.sin()) * 0.004)
        .sum();
    assert!((speed / 0.05_f64.cos() - 16.67).abs() < 0.1, "{speed} m/s by the accelerometer");
    let flying: Vec<_> = pulled.iter().filter_map(|s| s.gps.clone()).collect();
    let at_release = flying.iter().find(|gps| gps.time_usec >= FIRST_US + (303 + 250) * STEP_US);
    let at_release = at_release.unwrap();
    // The displacement is half of 1 s at full speed, 8.3 m, plus that of less than 0.1 s of flight.
    let north = f64::from(at_release.lat - stand.lat) * 1e-7 * 111_160.0;
    assert!((8.0..10.2).contains(&north), "{north} m");
    assert!((f64::from(at_release.vel) - 1667.0).abs() < 60.0, "{at_release:?}");
    // Only the acceleration may jump: consecutive states differ by at most the motion within a step.
    for pair in pulled.windows(2).filter(|p| p[0].state.is_some() && p[1].state.is_some()) {
        let [a, b] = [&pair[0].state, &pair[1].state].map(|s| s.clone().unwrap());
        assert!((b.true_airspeed as i32 - a.true_airspeed as i32).abs() < 15, "{a:?} {b:?}");
        assert!((b.alt - a.alt).abs() < 20 && (b.lat - a.lat).abs() < 8, "{a:?} {b:?}");
    }
    simulator.stop();
}

#[test]
fn noise_has_the_deviations_that_are_stated_and_is_white() {
    let noise = Px4Noise::STANDARD;
    let mut options = hurried();
    options.px4 = Some(Px4Options { noise, ..Px4Options::default() });
    options.seed = 11;
    let simulator = Simulator::start(options);
    let mut px4 = Px4::boot(simulator.address);
    let shown: Vec<Shown> = (0..20_000).map(|_| px4.step([0.0; 16])).collect();
    simulator.stop();
    let slow: Vec<_> = shown.iter().step_by(5).map(|s| &s.sensor).collect();
    let gps: Vec<_> = shown.iter().filter_map(|s| s.gps.clone()).collect();
    let fast = |get: fn(&mavlink::dialects::ardupilotmega::HIL_SENSOR_DATA) -> f32| {
        shown.iter().map(|s| f64::from(get(&s.sensor))).collect::<Vec<f64>>()
    };
    let slow = |get: fn(&mavlink::dialects::ardupilotmega::HIL_SENSOR_DATA) -> f32| {
        slow.iter().map(|s| f64::from(get(s))).collect::<Vec<f64>>()
    };
    let fix = |get: fn(&mavlink::dialects::ardupilotmega::HIL_GPS_DATA) -> f64| {
        gps.iter().map(get).collect::<Vec<f64>>()
    };
    let metre = 1e-7_f64.to_radians() * 6_371_000.0;
    let channels: Vec<(&str, Vec<f64>, f64)> = vec![
        ("xacc", fast(|s| s.xacc), noise.accelerometer_mps2),
        ("yacc", fast(|s| s.yacc), noise.accelerometer_mps2),
        ("zacc", fast(|s| s.zacc), noise.accelerometer_mps2),
        ("xgyro", fast(|s| s.xgyro), noise.gyro_radps),
        ("ygyro", fast(|s| s.ygyro), noise.gyro_radps),
        ("zgyro", fast(|s| s.zgyro), noise.gyro_radps),
        ("xmag", slow(|s| s.xmag), noise.magnetometer_gauss[0]),
        ("ymag", slow(|s| s.ymag), noise.magnetometer_gauss[1]),
        ("zmag", slow(|s| s.zmag), noise.magnetometer_gauss[2]),
        ("abs_pressure", slow(|s| s.abs_pressure), noise.static_pressure_pa * 1e-2),
        ("diff_pressure", slow(|s| s.diff_pressure), noise.differential_pressure_pa * 1e-2),
        ("lat", fix(|g| g.lat.into()), noise.gps_horizontal_m / metre),
        (
            "lon",
            fix(|g| g.lon.into()),
            noise.gps_horizontal_m / metre / 46.8_f64.to_radians().cos(),
        ),
        ("alt", fix(|g| g.alt.into()), noise.gps_altitude_m * 1e3),
        ("vn", fix(|g| g.vn.into()), noise.gps_velocity_mps[0] * 1e2),
        ("ve", fix(|g| g.ve.into()), noise.gps_velocity_mps[1] * 1e2),
        ("vd", fix(|g| g.vd.into()), noise.gps_velocity_mps[2] * 1e2),
    ];
    for (name, values, stated) in &channels {
        let (mean, deviation) = statistics(values);
        let n = values.len() as f64;
        // The relative standard error of a standard deviation is 1/√(2n), that of a correlation 1/√n; the limit is 4.5 σ.
        let uncertain = 4.5 / (2.0 * n).sqrt();
        let neighbours = values.windows(2).map(|v| (v[0] - mean) * (v[1] - mean)).sum::<f64>();
        let correlation = neighbours / (n * deviation * deviation);
        println!(
            "{name}: {deviation:.6}, stated {stated:.6} (n {n}, correlation {correlation:.3})"
        );
        assert!((deviation / stated - 1.0).abs() < uncertain, "{name}: {deviation} for {stated}");
        assert!(correlation.abs() < 4.5 / n.sqrt(), "{name}: correlation {correlation}");
    }
    // The channels must have independent draws.
    for pair in channels[..6].windows(2) {
        let ((ma, da), (mb, db)) = (statistics(&pair[0].1), statistics(&pair[1].1));
        let shared =
            pair[0].1.iter().zip(&pair[1].1).map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>()
                / (pair[0].1.len() as f64 * da * db);
        assert!(shared.abs() < 4.5 / (pair[0].1.len() as f64).sqrt(), "{shared}");
    }
}

#[test]
fn a_bias_moves_its_sensor_and_equal_seeds_give_equal_flights() {
    let fly = |seed: u64, bias: Bias, noise: Px4Noise| {
        let mut options = hurried();
        options.px4 = Some(Px4Options { noise, ..Px4Options::default() });
        (options.seed, options.bias, options.launch) = (seed, bias, Launch::Immediate);
        let simulator = Simulator::start(options);
        let mut px4 = Px4::boot(simulator.address);
        px4.armed = true;
        // The commands depend on the measurements, so every random draw affects the flight.
        let mut last = Shown::default();
        let all: Vec<Shown> = (0..200)
            .map(|_| {
                let s = &last.sensor;
                last = px4.step(outputs(-0.2 * s.xgyro, 0.1 * s.ygyro, 0.4));
                last.clone()
            })
            .collect();
        simulator.stop();
        format!("{all:?}")
    };
    let noise = Px4Noise::STANDARD;
    let once = fly(3, Bias::default(), noise);
    assert_eq!(once, fly(3, Bias::default(), noise));
    assert_ne!(once, fly(4, Bias::default(), noise));

    let bias = Bias {
        gyro_radps: [0.01, -0.02, 0.03],
        accelerometer_mps2: [0.1, -0.2, 0.3],
        airspeed_scale: 1.1,
        ..Bias::default()
    };
    let first = |bias: Bias| {
        let mut options = hurried();
        (options.bias, options.launch) = (bias, Launch::Immediate);
        let simulator = Simulator::start(options);
        let sensor = Px4::boot(simulator.address).step([0.0; 16]).sensor;
        simulator.stop();
        sensor
    };
    let (with, without) = (first(bias), first(Bias::default()));
    for (shown, was, by) in [
        (with.xgyro, without.xgyro, 0.01),
        (with.ygyro, without.ygyro, -0.02),
        (with.zgyro, without.zgyro, 0.03),
        (with.xacc, without.xacc, 0.1),
        (with.yacc, without.yacc, -0.2),
        (with.zacc, without.zacc, 0.3),
        // The differential pressure is proportional to the square of the airspeed.
        (with.diff_pressure, without.diff_pressure, 0.21 * without.diff_pressure),
    ] {
        assert!((shown - was - by).abs() < 1e-5, "{shown}, was {was}");
    }
}
