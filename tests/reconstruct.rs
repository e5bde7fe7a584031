//! Reconstruction of flights in JSBSim whose sensors were spoilt in known ways.
#![cfg(feature = "sitl")]

mod reconstruct_support;

use greylag::sysid::reconstruct::reconstruct;
use greylag::sysid::reconstruction::Reconstruction;
use reconstruct_support::{Errors, Flown, air, fly, options, spoil};

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
}

#[test]
fn planted_errors_are_found() {
    let flown = fly(60.0, air([4.0, -4.5, 0.0], None), 2);
    let errors = Errors {
        gyro_bias: [0.01, -0.01, 0.01],
        force_bias: [0.2, -0.2, 0.2],
        airspeed_scale: 1.05,
        alpha_bias: 1.0_f64.to_radians(),
        beta_bias: 0.5_f64.to_radians(),
        skew: [0.007, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        noise: Errors::NOISE,
    };
    let log = spoil(&flown, &errors, 2);
    let start = std::time::Instant::now();
    let found = reconstruct(&log, &options()).unwrap();
    println!("took {:?}", start.elapsed());
    print(&found);
    let errors = state_errors(&flown, &found);
    for (name, [largest, rms]) in greylag::physics::State::NAMES.iter().zip(errors) {
        println!("{name:14} largest {largest:.2e} rms {rms:.2e}");
    }
}
