//! Tests of sensor errors in the companion's messages, of the truth file, and of equal seeds.

use crate::shim_companion::*;
use greylag_sitl::plant::PlantOptions;
use greylag_sitl::shim::{
    self, Bias, Existing, Noise, Pace, Personality, ShimError, ShimOptions, TruthFile,
};
use std::sync::atomic::AtomicBool;

/// Frames while the aircraft is held at its start, so only the sensor errors vary.
fn held(change: impl FnOnce(&mut ShimOptions), frames: usize) -> Vec<State> {
    let (mut companion, link) = listening();
    let mut options = lockstep(&link);
    change(&mut options);
    let shim = Shim::start(options);
    let states = (0..frames)
        .map(|_| {
            let state = companion.state();
            companion.answer_disarmed(state.time_us());
            state
        })
        .collect();
    shim.stop();
    states
}

fn mean_and_deviation(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    (mean, (values.map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt())
}

#[test]
fn noise_has_the_deviation_asked_for_in_every_group() {
    // 3000 draws estimate a standard deviation to 1.3 % (1 σ), so 6 % is 4.6 σ; the seeds are fixed.
    let states = held(|o| o.noise = Noise::REALISTIC, 3000);
    let noise = Noise::REALISTIC;
    type Channel = (&'static str, fn(&State) -> f64, f64);
    let channels: [Channel; 11] = [
        ("p", |s| s.imu.xgyro.into(), noise.gyro_radps),
        ("q", |s| s.imu.ygyro.into(), noise.gyro_radps),
        ("r", |s| s.attitude.yawspeed.into(), noise.gyro_radps),
        ("ax", |s| s.imu.xacc.into(), noise.accelerometer_mps2),
        ("az", |s| s.imu.zacc.into(), noise.accelerometer_mps2),
        ("roll", |s| s.euler()[0], noise.attitude_rad),
        ("pitch", |s| s.euler()[1], noise.attitude_rad),
        ("airspeed", |s| s.hud.airspeed.into(), noise.airspeed_mps),
        ("alpha", |s| f64::from(s.vanes.aoa).to_radians(), noise.vane_rad),
        ("beta", |s| f64::from(s.vanes.ssa).to_radians(), noise.vane_rad),
        ("altitude", |s| s.hud.alt.into(), noise.altitude_m),
    ];
    for (name, channel, expected) in channels {
        let (_, deviation) = mean_and_deviation(states.iter().map(channel));
        assert!((deviation / expected - 1.0).abs() < 0.06, "{name}: {deviation} for {expected}");
    }
    // Channels have independent draws: the correlation of 3000 draws is below 0.09 (5 σ).
    let p = mean_and_deviation(states.iter().map(|s| f64::from(s.imu.xgyro)));
    let q = mean_and_deviation(states.iter().map(|s| f64::from(s.imu.ygyro)));
    let shared = states
        .iter()
        .map(|s| (f64::from(s.imu.xgyro) - p.0) / p.1 * (f64::from(s.imu.ygyro) - q.0) / q.1)
        .sum::<f64>()
        / states.len() as f64;
    assert!(shared.abs() < 0.09, "{shared}");
}

#[test]
fn a_bias_moves_its_channel_and_no_other() {
    let bias = Bias {
        gyro_radps: [0.01, -0.02, 0.03],
        accelerometer_mps2: [0.1, -0.2, 0.3],
        alpha_rad: 0.02,
        beta_rad: -0.03,
        airspeed_scale: 1.1,
        ..Bias::default()
    };
    let (with, without) = (held(|o| o.bias = bias, 3)[2], held(|_| (), 3)[2]);
    let moved = |shown: f32, was: f32, by: f64| {
        assert!((f64::from(shown) - f64::from(was) - by).abs() < 1e-5, "{shown}, was {was}");
    };
    moved(with.imu.xgyro, without.imu.xgyro, 0.01);
    moved(with.imu.ygyro, without.imu.ygyro, -0.02);
    moved(with.attitude.yawspeed, without.attitude.yawspeed, 0.03);
    moved(with.imu.xacc, without.imu.xacc, 0.1);
    moved(with.imu.yacc, without.imu.yacc, -0.2);
    moved(with.imu.zacc, without.imu.zacc, 0.3);
    moved(with.vanes.aoa, without.vanes.aoa, 0.02_f64.to_degrees());
    moved(with.vanes.ssa, without.vanes.ssa, -0.03_f64.to_degrees());
    moved(with.hud.airspeed, without.hud.airspeed, 1.667);
    assert_eq!((with.euler(), with.hud.alt), (without.euler(), without.hud.alt));
}

/// The truth file of one second of flight with noise and frame losses. The companion's commands depend on its measurements, so
/// every random draw affects the truth.
fn truth_of(seed: u64) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("truth.csv");
    let (mut companion, link) = listening();
    let mut options = lockstep(&link);
    options.truth = Some(TruthFile { path: path.clone(), existing: Existing::Keep });
    options.duration_s = Some(1.0);
    options.noise = Noise::REALISTIC;
    options.faults.drop_probability = 0.1;
    options.seed = seed;
    let shim = Shim::start(options);
    companion.fly(100, |s| [-0.5 * s.imu.xgyro, 0.5 * s.imu.ygyro, 0.2]);
    shim.end();
    std::fs::read_to_string(&path).expect("a truth file")
}

#[test]
fn equal_seeds_give_equal_flights_in_lockstep() {
    let (once, again, other) = (truth_of(7), truth_of(7), truth_of(8));
    assert_eq!(once.lines().count(), 101, "a header and 100 steps");
    assert_eq!(once, again);
    assert_ne!(once, other);
}

#[test]
fn a_truth_file_is_never_overwritten_unasked() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("truth.csv");
    std::fs::write(&path, "precious").expect("written");
    let mut options = lockstep("udpin:127.0.0.1:0");
    options.truth = Some(TruthFile { path: path.clone(), existing: Existing::Keep });
    let stopped = AtomicBool::new(true);
    let error = shim::run(&options, &stopped, &mut |_| ()).expect_err("it exists");
    assert!(matches!(error, ShimError::TruthExists { .. }), "{error}");
    assert_eq!(std::fs::read_to_string(&path).expect("still there"), "precious");
    options.truth = Some(TruthFile { path: path.clone(), existing: Existing::Replace });
    shim::run(&options, &stopped, &mut |_| ()).expect("allowed");
    assert!(std::fs::read_to_string(&path).expect("there").starts_with("time_s,roll_rad"));
}

#[test]
fn options_that_mean_nothing_are_refused_before_anything_is_opened() {
    let refused = |change: fn(&mut ShimOptions)| {
        let mut options = lockstep("udpin:127.0.0.1:0");
        change(&mut options);
        let error = shim::run(&options, &AtomicBool::new(true), &mut |_| panic!("it has begun"));
        let error = error.expect_err("refused").to_string();
        assert!(!error.contains('\n') && !error.is_empty(), "{error}");
    };
    refused(|o| o.noise.gyro_radps = -1.0);
    refused(|o| o.noise.altitude_m = f64::NAN);
    refused(|o| o.faults.drop_probability = 1.0);
    refused(|o| o.faults.delay_ms = 1e9);
    refused(|o| o.faults.late_probability = 1.5);
    refused(|o| {
        o.pace = Pace::RealTime;
        o.personality = Some(Personality::Px4);
        o.faults.drop_probability = 0.1;
    });
    refused(|o| o.bias.airspeed_scale = 0.0);
    refused(|o| o.bias.alpha_rad = f64::INFINITY);
    refused(|o| o.bias.attitude_rad[1] = f64::NAN);
    refused(|o| o.duration_s = Some(0.0));
    refused(|o| o.start.airspeed_mps = 0.0);
    refused(|o| o.start.altitude_m = f64::NAN);
    refused(|o| o.plant = PlantOptions { aircraft: "absent".into(), ..Default::default() });
}
