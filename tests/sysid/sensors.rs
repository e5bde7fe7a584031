//! What `[sensors]` states of a flight's sensors, against flights in JSBSim whose sensors are known.

use crate::reconstruct_support::{Errors, Flown, STEP, air, fly, options, spoil};
use greylag::logs::Flight;
use greylag::physics::Sensors;
use greylag::sysid::flight_path::reconstruct;
use greylag::sysid::flight_path::reconstruction::{Nuisance, Reconstruction};
use greylag_sitl::plant::Truth;

fn stated(text: &str) -> Sensors {
    toml::from_str(text).unwrap()
}

fn of<'a>(found: &'a Reconstruction, name: &str) -> &'a Nuisance {
    found.nuisances.iter().find(|n| n.name == name).unwrap()
}

/// Root mean square of `error` over the reconstructed instants.
fn rms(
    found: &Reconstruction,
    flown: &Flown,
    error: impl Fn(&greylag::sysid::flight_path::reconstruction::Instant, &Truth) -> f64,
) -> f64 {
    let errors: Vec<f64> = found
        .segments
        .iter()
        .flat_map(|s| &s.instants)
        .map(|i| error(i, &flown.truth[(i.time_s / STEP).round() as usize]))
        .filter(|e| e.is_finite())
        .collect();
    (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn rate(t: &Truth) -> [f64; 3] {
    [t.p_radps, t.q_radps, t.r_radps]
}

/// The log with its vanes on a boom and its accelerometer off the centre of gravity.
fn moved(flown: &Flown, boom: [f64; 3], box_at: [f64; 3]) -> Flight {
    let mut log = spoil(flown, &Errors::NONE, 1);
    let last = flown.truth.len() - 1;
    for (k, s) in log.samples.iter_mut().enumerate() {
        let t = &flown.truth[k];
        let (w, v) = (rate(t), t.airspeed_mps);
        let swept = cross(w, boom);
        let air = [
            v * t.alpha_rad.cos() * t.beta_rad.cos(),
            v * t.beta_rad.sin(),
            v * t.alpha_rad.sin() * t.beta_rad.cos(),
        ];
        let u: [f64; 3] = std::array::from_fn(|i| air[i] + swept[i]);
        s.alpha_rad = u[2].atan2(u[0]);
        s.beta_rad = (u[1] / u.iter().map(|x| x * x).sum::<f64>().sqrt()).asin();
        let (before, after) =
            (rate(&flown.truth[k.saturating_sub(1)]), rate(&flown.truth[(k + 1).min(last)]));
        let turning: [f64; 3] = std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * STEP));
        let (tangential, central) = (cross(turning, box_at), cross(w, cross(w, box_at)));
        for i in 0..3 {
            s.specific_force_mps2[i] += tangential[i] + central[i];
        }
    }
    log
}

#[test]
fn a_boom_and_a_box_off_the_centre_of_gravity_are_put_right_where_they_are_stated() {
    let flown = fly(40.0, air([2.0, -1.0, 0.0], None), 1);
    let log = moved(&flown, [1.5, 0.2, -0.3], [0.4, 0.1, 0.15]);
    let left = |sensors: &str| {
        let options =
            greylag::sysid::flight_path::Options { sensors: stated(sensors), ..options() };
        let found = reconstruct(&log, &options).unwrap();
        let alpha = rms(&found, &flown, |i, t| i.state.alpha - t.alpha_rad).to_degrees();
        let force = rms(&found, &flown, |i, t| i.specific_force[2] - t.specific_force_mps2[2]);
        println!("{sensors:?}: alpha {alpha:.4} deg, force {force:.4} m/s2");
        [alpha, force]
    };
    let unsaid = left("");
    let said = left("vanes_at_m = [1.5, 0.2, -0.3]\naccelerometer_at_m = [0.4, 0.1, 0.15]");
    assert!(said[0] < 0.3 * unsaid[0] && said[1] < 0.5 * unsaid[1], "{said:?} {unsaid:?}");
}

#[test]
fn a_held_constant_stays_and_one_that_the_data_moves_is_noted() {
    let flown = fly(40.0, air([3.0, 1.0, 0.0], None), 2);
    let errors =
        Errors { airspeed_scale: 1.06, alpha_bias: 0.02, noise: Errors::NOISE, ..Errors::NONE };
    let log = spoil(&flown, &errors, 2);
    let with = |text: &str| {
        let options = greylag::sysid::flight_path::Options { sensors: stated(text), ..options() };
        reconstruct(&log, &options).unwrap()
    };
    let held = with(
        "airspeed_scale = { value = 1.06, sd = 0.0 }\nwind_north_mps = { value = 3.0, sd = 0.0 }",
    );
    assert!((of(&held, "airspeed_scale").value - 1.06).abs() < 1e-4);
    assert!((of(&held, "wind_north").value - 3.0).abs() < 0.02);
    // the usual prior: 1 ± 0.2, so that 1.06 is 0.3 of it
    let usual = with("");
    let scale = of(&usual, "airspeed_scale");
    assert!((scale.moved() - 0.3).abs() < 0.1, "{scale:?}");
    assert!(usual.notes.iter().all(|n| !n.contains("from the prior mean")));
    let sure = with("airspeed_scale = { value = 1.0, sd = 0.01 }");
    assert!(of(&sure, "airspeed_scale").moved() > 3.0);
    assert!(
        sure.notes.iter().any(|n| n.starts_with("airspeed_scale is found at")),
        "{:?}",
        sure.notes
    );
}

#[test]
fn in_still_air_velocity_and_attitude_stand_for_airspeed_vanes_and_accelerometers() {
    let flown = fly(40.0, air([0.0; 3], None), 3);
    let mut log = spoil(
        &flown,
        &Errors { noise: [0.0005, 0.001, 0.0, 0.0, 0.0, 0.005, 0.0], ..Errors::NONE },
        3,
    );
    for s in &mut log.samples {
        s.airspeed_mps = s.velocity_ned_mps.iter().map(|v| v * v).sum::<f64>().sqrt();
        (s.alpha_rad, s.beta_rad, s.specific_force_mps2) = (f64::NAN, f64::NAN, [f64::NAN; 3]);
    }
    log.sensors =
        stated("wind = \"still\"\nclocks = \"one\"\nairspeed_scale = { value = 1.0, sd = 0.0 }");
    let found = reconstruct(&log, &options()).unwrap();
    let alpha = rms(&found, &flown, |i, t| i.state.alpha - t.alpha_rad).to_degrees();
    assert!(alpha < 0.1, "{alpha}");
    // forward: a difference over 20 ms of velocities with 5 mm/s of noise errs by 0.35 m/s² at a sample.
    // Across, the path errs by more: docs/limits.md
    let force: [f64; 3] = std::array::from_fn(|k| {
        rms(&found, &flown, |i, t| i.specific_force[k] - t.specific_force_mps2[k])
    });
    println!("alpha {alpha:.4} deg, force {force:.3?} m/s2");
    assert!(force[0] < 0.7, "{force:?}");
    assert!(found.nuisances.iter().any(|n| n.name == "alpha_path" && n.sd < 0.01));
}
