//! Tests of the smoother on a simulated flight in gusts.

use greylag_logs::{Flight, Sample};
use greylag_num::stream::stream;
use greylag_physics::airframe::ActuatorFigures;
use rand_distr::{Distribution, StandardNormal};

use crate::flight_path::{Options, reconstruct};
use greylag_physics::sensors::Known;

/// Time between samples, s.
const STEP: f64 = 0.01;
/// Standard deviations of the noise of attitude (rad), gyros (rad/s), airspeed (m/s), vanes (rad), accelerometers (m/s²) and
/// velocity (m/s).
const NOISE: [f64; 6] = [0.0035, 0.005, 0.3, 0.005, 0.1, 0.1];

/// 50 s of level flight at 17 m/s with rudder steps, through gusts of 0.7 m/s that are correlated over 1.5 s. The aircraft turns
/// into the gusts like a weathercock.
fn through_gusts() -> Flight {
    let mut random = stream(3, &[]);
    let mut unit = || -> f64 { StandardNormal.sample(&mut random) };
    let kept = (-STEP / 1.5_f64).exp();
    let ([mut u, mut v, mut r, mut yaw], mut gust) = ([17.0, 0.0, 0.0, 0.0_f64], [0.0; 2]);
    let one = |k: usize| {
        let time_s = k as f64 * STEP;
        gust = gust.map(|g| g * kept + 0.7 * (1.0 - kept * kept).sqrt() * unit());
        let (sin, cos) = yaw.sin_cos();
        let air = [u - cos * gust[0] - sin * gust[1], v + sin * gust[0] - cos * gust[1]];
        let airspeed = air[0].hypot(air[1]);
        let beta = (air[1] / airspeed).asin();
        let (ax, ay) = (17.0 - airspeed, -16.0 * beta);
        let three =
            |x: [f64; 3], sd: f64, unit: &mut dyn FnMut() -> f64| x.map(|x| x + sd * unit());
        let sample = Sample {
            time_s,
            attitude_rad: three([0.0, 0.0, yaw], NOISE[0], &mut unit),
            rates_radps: three([0.0, 0.0, r], NOISE[1], &mut unit),
            airspeed_mps: airspeed + NOISE[2] * unit(),
            alpha_rad: NOISE[3] * unit(),
            beta_rad: beta + NOISE[3] * unit(),
            specific_force_mps2: three([ax, ay, -9.80665], NOISE[4], &mut unit),
            velocity_ned_mps: three(
                [cos * u - sin * v, sin * u + cos * v, 0.0],
                NOISE[5],
                &mut unit,
            ),
            altitude_m: 600.0,
            aileron_rad: 0.0,
            elevator_rad: 0.0,
            throttle: 0.5,
            ..Sample::default()
        };
        let rudder = if ((time_s / 2.5) as u32).is_multiple_of(2) { 1.0 } else { -1.0 };
        (u, v) = (u + STEP * (ax + r * v), v + STEP * (ay - r * u));
        (yaw, r) = (yaw + STEP * r, r + STEP * (30.0 * beta - 4.0 * r + rudder));
        sample
    };
    Flight { name: "rough".into(), samples: (0..5000).map(one).collect(), ..Flight::default() }
}

#[test]
fn gusts_are_not_taken_for_a_vane_gain_and_leave_its_noise_as_it_is() {
    let options = Options::new("rough", ActuatorFigures::tustin(30.0, 0.7, 0.4, 0.2, STEP));
    let found = reconstruct(through_gusts(), &options).unwrap();
    // without the check for gusts, the gain of the vane of β was found at −0.50
    let gains: Vec<&str> = found.nuisances.iter().map(|n| n.name.as_str()).collect();
    assert!(!gains.iter().any(|name| name.ends_with("_gain")), "{gains:?}");
    // the estimate from 5000 samples has a standard deviation of 6 %; fourth differences gave 0.0057
    let vane = found.noise[7];
    assert!((vane / NOISE[3] - 1.0).abs() < 0.12, "{vane}");
    // gusts of 0.7 m/s over 1.5 s: the change in one sample. The search for the level has steps of a factor 1.2, and the error of
    // the vane's noise, 12 % of its variance, shifts the change by 7 %, so two standard deviations and a step are a quarter; the
    // gusts of this flight have two components of three, which the common level does not know
    let change = 0.7 * (2.0 * STEP / 1.5_f64).sqrt();
    assert!((found.gust_step / change - 1.0).abs() < 0.35, "{} {change}", found.gust_step);
}

/// What calm flights say of a vane is kept in gusts, which would draw it to the gain that they feign.
#[test]
fn in_gusts_a_vane_keeps_the_gain_that_other_flights_show() {
    let options = Options::new("rough", ActuatorFigures::tustin(30.0, 0.7, 0.4, 0.2, STEP));
    let options = options.expecting(&[("beta_gain", Known { value: 0.08, sd: 0.01 })]);
    let found = reconstruct(through_gusts(), &options).unwrap();
    let gain = found.nuisances.iter().find(|n| n.name == "beta_gain").unwrap();
    assert!((gain.value - 0.08).abs() < 1e-3 && gain.sd == 0.01, "{gain:?}");
    let estimated = |name: &str| found.installation.iter().any(|e| e.name == name);
    assert!(!estimated("beta_gain") && !estimated("alpha_gain") && !estimated("board_roll"));
}
