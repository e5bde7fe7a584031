//! Reconstruction of flights in JSBSim whose sensors were spoilt in known ways.

use crate::reconstruct_support::{Errors, Flown, air, fly, options, spoil};
use greylag::logs::{Flight, Sample};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{ActuatorClock, ManoeuvreKind, Options, manoeuvres, reconstruct};
use rayon::prelude::*;

/// Largest and root mean square error of roll, pitch, airspeed, p, q, r, α, β.
fn state_errors(flown: &Flown, found: &Reconstruction) -> [[f64; 2]; 8] {
    let mut errors = [[0.0_f64; 2]; 8];
    let mut count = 0.0;
    for instant in found.segments.iter().flat_map(|s| &s.instants) {
        let t = &flown.truth[(instant.time_s / 0.01).round() as usize];
        let truth = [
            t.roll_rad,
            t.pitch_rad,
            t.airspeed_mps,
            t.p_radps,
            t.q_radps,
            t.r_radps,
            t.alpha_rad,
            t.beta_rad,
        ];
        for (i, (x, y)) in instant.state.to_array().iter().zip(truth).enumerate() {
            errors[i][0] = errors[i][0].max((x - y).abs());
            errors[i][1] += (x - y).powi(2);
        }
        count += 1.0;
    }
    errors.map(|[largest, sum]| [largest, (sum / count).sqrt()])
}

fn print(found: &Reconstruction) {
    for n in &found.nuisances {
        println!("{:22} {:10.5} ± {:.5} {}", n.name, n.value, n.sd, n.unit);
    }
    println!("noise {:?} force {:?}", found.noise, found.force_noise);
    found.notes.iter().for_each(|n| println!("{n}"));
}

#[test]
fn a_perfect_log_stays_as_it_is() {
    let flown = fly(40.0, air([0.0; 3], None), 1);
    let log = spoil(&flown, &Errors::NONE, 1);
    let start = std::time::Instant::now();
    let found = reconstruct(&log, &options()).unwrap();
    println!("took {:?}", start.elapsed());
    print(&found);
    let errors = state_errors(&flown, &found);
    for (name, [largest, rms]) in greylag::physics::State::NAMES.iter().zip(errors) {
        println!("{name:14} largest {largest:.2e} rms {rms:.2e}");
    }
    let degree = 1.0_f64.to_radians();
    // a hundredth of what moves a free run: 0.02° of angle, 0.01 m/s, 1e-4 rad/s
    for (i, bound) in
        [0.02 * degree, 0.02 * degree, 0.01, 1e-4, 1e-4, 1e-4, 0.02 * degree, 0.02 * degree]
            .into_iter()
            .enumerate()
    {
        assert!(errors[i][0] < bound, "{i}: {:?}", errors[i]);
    }
    for n in found.nuisances.iter().filter(|n| n.name.starts_with("skew")) {
        assert!(n.value.abs() < 0.0003, "{n:?}");
    }
}

fn planted_flight(spoiling: impl Fn(&mut Sample), seconds: f64) -> (Flown, Flight) {
    let (errors, wind, _) = planted(0);
    let flown = fly(seconds, air(wind, None), 0);
    let mut log = spoil(&flown, &errors, 0);
    log.samples.iter_mut().for_each(spoiling);
    (flown, log)
}

#[test]
fn without_vanes_the_flow_angles_come_from_the_velocities() {
    let (flown, log) = planted_flight(
        |s| {
            s.alpha_rad = f64::NAN;
            s.beta_rad = f64::NAN;
        },
        60.0,
    );
    let found = reconstruct(&log, &options()).unwrap();
    print(&found);
    let errors = state_errors(&flown, &found);
    println!("{errors:?}");
    assert!(found.notes.iter().any(|n| n.contains("No vane")));
    assert!(found.nuisances.iter().all(|n| n.name != "alpha_bias"));
    // vanes of 0.3° noise with the planted biases of 1° and 0.5° would do worse
    assert!(errors[6][1] < 0.2_f64.to_radians() && errors[7][1] < 0.2_f64.to_radians());
}

/// The mean vertical wind, and with it α, is then known by how the airspeed goes with climb alone.
#[test]
fn without_vanes_an_airspeed_that_errs_with_climb_is_no_sure_vertical_wind() {
    let (_, mut log) = planted_flight(
        |s| {
            let climb = -s.velocity_ned_mps[2] / s.airspeed_mps;
            s.airspeed_mps += 0.2 * climb;
            (s.alpha_rad, s.beta_rad) = (f64::NAN, f64::NAN);
        },
        120.0,
    );
    let (_, wind, _) = planted(0);
    // the noise of a sample may be stated: it says nothing of slow errors
    for sensors in ["", "airspeed_sd_mps = 0.1"] {
        log.sensors = toml::from_str(sensors).unwrap();
        let found = reconstruct(&log, &options()).unwrap();
        let down = found.nuisances.iter().find(|n| n.name == "wind_down").unwrap();
        let error = down.value - wind[2];
        println!("{sensors} vertical wind off by {error:.3} ± {:.3} m/s", down.sd);
        assert!(error.abs() > 0.1, "the error is to show: {error}");
        assert!(error.abs() < 2.0 * down.sd, "{error} {}", down.sd);
        // that is no reason to know α less well than it is
        assert!(found.deviation("alpha_bias").unwrap() < 1.5_f64.to_radians());
    }
}

#[test]
fn what_the_data_cannot_see_keeps_its_prior_and_is_named() {
    let (_, log) = planted_flight(|s| s.velocity_ned_mps = [f64::NAN; 3], 30.0);
    let found = reconstruct(&log, &options()).unwrap();
    let of = |name: &str| found.nuisances.iter().find(|n| n.name == name).unwrap();
    // the prior widths of the wind are 15 m/s
    assert!(of("wind_north").sd > 12.0 && of("wind_north").value.abs() < 5.0);
    assert!(found.notes.iter().any(|n| n.contains("wind_north") && n.contains("velocity over")));
    // the gyros' biases need no velocity
    assert!((of("gyro_bias_p").value - 0.01).abs() < 4.0 * of("gyro_bias_p").sd);
}

#[test]
fn sensors_of_the_air_that_meet_no_other_sensor_are_believed() {
    let flown = fly(30.0, air([0.0; 3], None), 1);
    let mut log = spoil(&flown, &Errors::NONE, 1);
    for sample in &mut log.samples {
        sample.specific_force_mps2 = [f64::NAN; 3];
        sample.velocity_ned_mps = [f64::NAN; 3];
    }
    let found = reconstruct(&log, &options()).unwrap();
    print(&found);
    // nothing but the smoothness of the path says the scale of the airspeed: it is not to be sought in that
    for n in found.nuisances.iter().filter(|n| !n.name.starts_with("gyro")) {
        let moved = n.moved().abs();
        assert!(moved < 0.1, "{n:?}");
    }
    let errors = state_errors(&flown, &found);
    println!("{errors:?}");
    assert!(errors[2][1] < 0.1 && errors[6][1] < 0.003 && errors[7][1] < 0.003, "{errors:?}");
    assert_eq!(found.notes.iter().filter(|n| n.contains("do not determine")).count(), 1);
}

#[test]
fn a_gyro_that_drifts_turns_no_heading() {
    let drift = [1.5e-5, -1.0e-5, 1.5e-5];
    let (_, log) = planted_flight(
        |s| {
            (s.alpha_rad, s.beta_rad) = (f64::NAN, f64::NAN);
            (0..3).for_each(|i| s.rates_radps[i] += drift[i] * s.time_s);
        },
        180.0,
    );
    let found = reconstruct(&log, &options()).unwrap();
    print(&found);
    for (axis, drift) in ["p", "q", "r"].iter().zip(drift) {
        let name = format!("gyro_drift_{axis}");
        let n = found.nuisances.iter().find(|n| n.name == name).unwrap();
        assert!((n.value - drift).abs() < 4e-6, "{n:?}");
    }
    let beta = found.nuisances.iter().find(|n| n.name == "beta_path").unwrap();
    assert!(beta.sd < 0.01, "{beta:?}");
}

#[test]
fn little_is_enough_for_a_path() {
    type Strip = fn(&mut Sample);
    let strip: [(&str, Strip); 3] = [
        ("accelerometers", |s| s.specific_force_mps2 = [f64::NAN; 3]),
        ("heading", |s| s.attitude_rad[2] = f64::NAN),
        ("altitude", |s| s.altitude_m = f64::NAN),
    ];
    for (what, strip) in strip {
        let (flown, log) = planted_flight(strip, 20.0);
        let found = reconstruct(&log, &options()).unwrap();
        let errors = state_errors(&flown, &found);
        println!("without {what}: {errors:?}");
        // roll and pitch to a third of a degree; α within its bias and a degree
        assert!(errors[0][1] < 0.006 && errors[1][1] < 0.006, "without {what}");
        assert!(errors[6][1] < 2.0_f64.to_radians(), "without {what}");
    }
}

#[test]
fn actuators_that_come_late_are_put_right() {
    let flown = fly(60.0, air([0.0; 3], None), 3);
    let mut errors = Errors { noise: Errors::NOISE, ..Errors::NONE };
    errors.skew[6] = 0.007;
    let corrected_at_once = reconstruct(spoil(&flown, &errors, 3), &options()).unwrap();
    let found = corrected_at_once.clone();
    let skew = found.nuisances.iter().find(|n| n.name == "skew_actuators").unwrap();
    println!("{skew:?}");
    assert!((skew.value - 0.007).abs() < 3.0 * skew.sd && skew.sd < 0.002);
    // put right: closer to the truth than a third of the error logged
    let (mut logged, mut corrected) = (0.0, 0.0);
    for instant in &found.segments[0].instants {
        let k = (instant.time_s / 0.01).round() as usize;
        let truth = flown.truth[k].aileron_rad;
        let late = truth + 0.7 * (flown.truth[k.saturating_sub(1)].aileron_rad - truth);
        logged += (late - truth).powi(2);
        corrected += (instant.controls.aileron - truth).powi(2);
    }
    println!("aileron: rms error {corrected:.2e} after {logged:.2e}");
    assert!(corrected < logged / 4.0);
    // left on the log's clock when asked
    let as_recorded = Options { actuators_clock: ActuatorClock::AsRecorded, ..options() };
    let log = spoil(&flown, &errors, 3);
    let found = reconstruct(&log, &as_recorded).unwrap();
    assert!(found.notes.iter().any(|n| n.contains("left as recorded")), "{:?}", found.notes);
    for instant in &found.segments[0].instants {
        let row = &log.samples[(instant.time_s / 0.01).round() as usize];
        // the uniform clock is the log's own, to rounding
        assert!((instant.controls.aileron - row.aileron_rad).abs() < 1e-9);
    }
    // and corrected later, as the workbench does
    assert!(found.actuators_late().is_some());
    let later = found.with_corrected_clock();
    assert!(later.actuators_late().is_none());
    assert_eq!(later.notes, corrected_at_once.notes);
    assert_eq!(
        later.segments[0].instants[500].controls,
        corrected_at_once.segments[0].instants[500].controls
    );
}

#[test]
fn commands_become_deflections_through_the_actuators() {
    let flown = fly(10.0, air([0.0; 3], None), 4);
    let mut log = spoil(&flown, &Errors::NONE, 4);
    for s in &mut log.samples {
        (s.aileron_rad, s.elevator_rad, s.throttle) = (f64::NAN, f64::NAN, f64::NAN);
    }
    let found = reconstruct(&log, &options()).unwrap();
    assert!(found.notes.iter().any(|n| n.contains("aileron, elevator, throttle")));
    // the filters start at rest at the first command: τ of the throttle is 0.2 s
    for instant in found.segments[0].instants.iter().skip(300) {
        let truth = &flown.truth[(instant.time_s / 0.01).round() as usize];
        assert!((instant.controls.aileron - truth.aileron_rad).abs() < 1e-6);
        assert!((instant.controls.elevator - truth.elevator_rad).abs() < 1e-6);
        assert!((instant.controls.throttle - truth.throttle).abs() < 1e-6);
    }
}

#[test]
fn gaps_split_and_short_stretches_are_named() {
    let (flown, mut log) = planted_flight(|_| (), 30.0);
    // a gap of 0.5 s leaves 1 s before the next one, which is too short
    log.samples.retain(|s| !(10.0..10.5).contains(&s.time_s) && !(11.5..11.8).contains(&s.time_s));
    let found = reconstruct(&log, &options()).unwrap();
    assert_eq!(found.segments.len(), 2);
    assert!(found.notes.iter().any(|n| n.contains("10.50 s to 11.49 s")), "{:?}", found.notes);
    let errors = state_errors(&flown, &found);
    assert!(errors[6][1] < 0.3_f64.to_radians());
    let list = manoeuvres(&found);
    assert!(list.windows(2).all(|w| w[0].end_s <= w[1].start_s));
    assert!(list.iter().all(|m| m.end_s <= 10.0 || m.start_s >= 11.8));
}

#[test]
fn manoeuvres_are_told_apart() {
    let flown = fly(20.0, air([0.0; 3], None), 5);
    let mut found = reconstruct(spoil(&flown, &Errors::NONE, 5), &options()).unwrap();
    // straight flight with an elevator doublet of the test's own
    for (k, i) in found.segments[0].instants.iter_mut().enumerate() {
        (i.state.roll, i.state.p, i.state.q, i.state.r) = (0.0, 0.0, 0.0, 0.0);
        i.controls = Default::default();
        if (800..1000).contains(&k) && k % 100 < 50 {
            i.controls.elevator = 0.1;
        }
    }
    let list = manoeuvres(&found);
    println!("{list:?}");
    let kinds: Vec<_> = list.iter().map(|m| m.kind).collect();
    assert_eq!(kinds, [ManoeuvreKind::Steady, ManoeuvreKind::Pitch, ManoeuvreKind::Steady]);
    // the activity is averaged over a second
    assert!((list[1].start_s - 8.0).abs() < 0.6 && (list[1].end_s - 10.0).abs() < 0.6);
}

#[test]
fn bad_logs_are_refused_with_what_would_help() {
    let (_, good) = planted_flight(|_| (), 8.0);
    let refused = |change: &dyn Fn(&mut Vec<Sample>)| {
        let mut log = good.clone();
        change(&mut log.samples);
        reconstruct(&log, &options()).unwrap_err().to_string()
    };
    let each =
        |change: fn(&mut Sample)| move |rows: &mut Vec<Sample>| rows.iter_mut().for_each(change);
    assert!(refused(&|rows| rows.clear()).contains("roll_rad"));
    assert!(refused(&|rows| rows.truncate(100)).contains("1.0 s"));
    assert!(refused(&each(|s| s.rates_radps[1] = f64::NAN)).contains("q_radps"));
    assert!(refused(&each(|s| s.rates_radps[1] = 0.1)).contains("body rates that change"));
    assert!(refused(&each(|s| s.airspeed_mps *= 0.1)).contains("no flight"));
    assert!(refused(&each(|s| s.airspeed_mps = f64::NAN)).contains("airspeed"));
    let none = each(|s| (s.elevator_cmd, s.elevator_rad) = (f64::NAN, f64::NAN));
    assert!(refused(&none).contains("elevator_cmd"));
}

#[test]
fn odd_logs_are_reconstructed_without_panic() {
    let (_, good) = planted_flight(|_| (), 8.0);
    type Spoil = fn(usize, &mut Sample);
    let odd: [(&str, Spoil); 8] = [
        ("stuck vane", |_, s| s.alpha_rad = 0.03),
        ("sparse vane", |k, s| s.alpha_rad = if k % 50 == 0 { s.alpha_rad } else { f64::NAN }),
        ("held velocity", |k, s| s.velocity_ned_mps = [(k / 20) as f64; 3]),
        ("infinite altitude", |_, s| s.altitude_m = f64::INFINITY),
        ("backward clock", |k, s| s.time_s = if k == 400 { 1.0 } else { s.time_s }),
        ("repeated times", |k, s| s.time_s = (k / 2) as f64 * 0.02),
        ("huge forces", |k, s| s.specific_force_mps2[2] = if k % 7 == 0 { 1e9 } else { -9.8 }),
        ("degrees for radians", |_, s| s.attitude_rad = s.attitude_rad.map(f64::to_degrees)),
    ];
    for (what, change) in odd {
        let mut log = good.clone();
        log.samples.iter_mut().enumerate().for_each(|(k, s)| change(k, s));
        match reconstruct(&log, &options()) {
            Ok(found) => {
                let finite = found.segments.iter().flat_map(|s| &s.instants);
                println!("{what}: {} notes", found.notes.len());
                assert!(finite.clone().all(|i| i.state.is_finite()), "{what}");
            }
            Err(error) => println!("{what}: {error}"),
        }
    }
}

/// The planted errors of one trial: signs, the wind's direction and what is delayed vary.
///
/// The wind is the steady one. In turbulence the mean of a minute differs from it by what gusts of 20 s
/// leave; the stated deviation has to hold that.
fn planted(seed: u64) -> (Errors, [f64; 3], Vec<(&'static str, f64)>) {
    let sign = |bit: u64| if (seed >> bit) & 1 == 0 { 1.0 } else { -1.0 };
    let course = seed as f64 * 2.4;
    let wind = [6.0 * course.cos(), 6.0 * course.sin(), 0.0];
    let (g, a) = (0.01, 0.2);
    let mut errors = Errors {
        gyro_bias: [g * sign(0), g * sign(1), g * sign(2)],
        force_bias: [a * sign(1), a * sign(2), a * sign(0)],
        airspeed_scale: 1.05,
        alpha_bias: sign(0) * 1.0_f64.to_radians(),
        beta_bias: sign(1) * 0.5_f64.to_radians(),
        skew: [0.0; 7],
        noise: Errors::NOISE,
    };
    // attitude, accelerometers, airspeed, vanes, velocity, actuators: all but the gyros, the reference
    let late = [0, 2, 3, 4, 5, 6][seed as usize % 6];
    errors.skew[late] = 0.007;
    let e = &errors;
    let expected = vec![
        ("gyro_bias_p", e.gyro_bias[0]),
        ("gyro_bias_q", e.gyro_bias[1]),
        ("gyro_bias_r", e.gyro_bias[2]),
        ("accelerometer_bias_x", e.force_bias[0]),
        ("accelerometer_bias_y", e.force_bias[1]),
        ("accelerometer_bias_z", e.force_bias[2]),
        ("alpha_bias", e.alpha_bias),
        ("beta_bias", e.beta_bias),
        ("airspeed_scale", e.airspeed_scale),
        ("wind_north", wind[0]),
        ("wind_east", wind[1]),
        ("wind_down", wind[2]),
        ("skew_attitude", e.skew[0]),
        ("skew_accelerometer", e.skew[2]),
        ("skew_airspeed", e.skew[3]),
        ("skew_vanes", e.skew[4]),
        ("skew_velocity", e.skew[5]),
        ("skew_actuators", e.skew[6]),
    ];
    (errors, wind, expected)
}

/// Flights of a coverage, each logged several times with noise of its own.
#[derive(Clone)]
struct Campaign {
    seeds: std::ops::Range<u64>,
    draws: u64,
    seconds: f64,
    severity: Option<u8>,
    noise: [f64; 7],
}

/// z of every planted error, for one flight: by draw, then quantity.
fn scores(campaign: &Campaign, seed: u64) -> Vec<Vec<(&'static str, f64, f64)>> {
    let (errors, wind, expected) = planted(seed);
    let errors = Errors { noise: campaign.noise, ..errors };
    let flown = fly(campaign.seconds, air(wind, campaign.severity), seed);
    let draw = |draw: u64| {
        let found = reconstruct(spoil(&flown, &errors, seed + 1_000_000 * draw), &options());
        let found = found.unwrap();
        let score = |(name, value): &(&'static str, f64)| {
            let n = found.nuisances.iter().find(|n| n.name == *name).unwrap();
            (*name, (n.value - value) / n.sd, n.sd)
        };
        expected.iter().map(score).collect()
    };
    (0..campaign.draws).map(draw).collect()
}

/// How often the planted errors lie within their stated 95 % intervals, by quantity.
fn coverage(campaign: &Campaign) -> Vec<(&'static str, f64)> {
    let flights: Vec<_> =
        campaign.seeds.clone().into_par_iter().map(|seed| scores(campaign, seed)).collect();
    println!("{} flights of {} s", flights.len(), campaign.seconds);
    let of_quantity = |i: usize| {
        let within =
            |all: &[f64]| all.iter().filter(|z| z.abs() < 1.96).count() as f64 / all.len() as f64;
        let first: Vec<f64> = flights.iter().map(|draws| draws[0][i].1).collect();
        let all: Vec<f64> = flights.iter().flatten().map(|q| q[i].1).collect();
        let mean = |x: &mut dyn Iterator<Item = f64>| x.sum::<f64>() / all.len() as f64;
        let (name, share) = (flights[0][0][i].0, within(&all));
        println!(
            "{name:22} {:5.1} % within, of the first draws {:5.1} %, z {:+.2} rms {:.2}, mean sd {:.5}",
            100.0 * share,
            100.0 * within(&first),
            mean(&mut all.iter().copied()),
            mean(&mut all.iter().map(|z| z * z)).sqrt(),
            mean(&mut flights.iter().flatten().map(|q| q[i].2)),
        );
        (name, share)
    };
    (0..flights[0][0].len()).map(of_quantity).collect()
}

#[test]
fn planted_errors_lie_within_their_intervals() {
    let campaign =
        Campaign { seeds: 0..6, draws: 1, seconds: 40.0, severity: None, noise: Errors::NOISE };
    let hits = coverage(&campaign);
    let share = hits.iter().map(|h| h.1).sum::<f64>() / hits.len() as f64;
    // 108 intervals of 95 %: a share under 0.87 has a chance of 1 in 2000
    assert!(share > 0.87, "{share}");
}

/// Asserts that every quantity but those `not_reached`, which are printed, is within its 95 % interval in
/// 90 % of the cases.
fn assert_covered(campaign: &Campaign, not_reached: &[&str]) {
    let hits = coverage(campaign).into_iter();
    let short: Vec<_> = hits.filter(|h| h.1 < 0.9 && !not_reached.contains(&h.0)).collect();
    assert!(short.is_empty(), "{short:?}");
}

/// 50 flights with seeds used nowhere else. One draw each would leave a true 95 % under 90 % by chance in
/// one of 26 quantities; four, of which flights share what is not noise, leave about one in a thousand.
const FIFTY: Campaign = Campaign {
    seeds: 730_000..730_050,
    draws: 4,
    seconds: 60.0,
    severity: None,
    noise: Errors::NOISE,
};

#[test]
#[ignore = "200 reconstructions: run in release"]
fn planted_errors_lie_within_their_intervals_in_fifty_flights() {
    assert_covered(&FIFTY, &[]);
}

#[test]
#[ignore = "50 flights: run in release"]
fn planted_errors_in_turbulence() {
    // gusts, not noise, decide here: one draw a flight; the airspeed scale reaches 86 %
    let campaign = Campaign { seeds: 710_000..710_050, draws: 1, severity: Some(3), ..FIFTY };
    assert_covered(&campaign, &["airspeed_scale"]);
}

#[test]
#[ignore = "200 reconstructions: run in release"]
fn planted_errors_beside_a_clean_velocity_over_ground() {
    let mut noise = Errors::NOISE;
    noise[5] = 0.0;
    // the actuators' delay reaches 86 %, with errors of 0.2 ms; why is not known
    let campaign = Campaign { seeds: 720_000..720_050, noise, ..FIFTY };
    assert_covered(&campaign, &["skew_actuators"]);
}

#[test]
fn what_noise_is_left_is_stated() {
    let flown = fly(30.0, air([0.0; 3], None), 7);
    let errors = Errors { noise: Errors::NOISE, ..Errors::NONE };
    let found = reconstruct(spoil(&flown, &errors, 7), &options()).unwrap();
    let of = |name: &str| found.nuisances.iter().find(|n| n.name == name).unwrap().sd;
    let rms = state_errors(&flown, &found).map(|e| e[1]);
    println!("{:?}\n{rms:?}", found.left);
    for (i, (left, rms)) in found.left.iter().zip(rms).enumerate() {
        // the constants' errors come on top, through the airspeed and the flow angles; what is slow has
        // few independent values in half a minute, so that its rms scatters by some 20 %
        let constant = [0.0, 0.0, 20.0 * of("airspeed_scale"), 0.0, 0.0, 0.0];
        let constant = constant.get(i).copied().unwrap_or(of("alpha_bias").max(of("beta_bias")));
        let stated = left.hypot(constant);
        assert!((0.6..1.6).contains(&(rms / stated)), "{i}: {rms} of {stated}");
        assert!(*left < 1.05 * found.noise[i], "{i}");
    }
}
