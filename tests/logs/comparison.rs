//! One flight in four formats gives one comparison.

use std::path::Path;

use crate::compare_support::{REALISTIC, fly, model};
use crate::logs_support::{csv, dataflash, tlog, tlog_with, ulog};
use greylag::logs::{FlowAngles, Options, Sample, parse};
use greylag::physics::atmosphere::{Atmosphere, Density};
use greylag::sysid::compare::{self, Comparison, compare};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, reconstruct};

/// Twenty seconds of flight with what all four formats can hold: commands, no deflections.
fn flown() -> Vec<Sample> {
    let air = Atmosphere { density: Density::Standard, gravity: 9.80665 };
    let mut rows = fly(3, 20.0, REALISTIC).samples;
    for s in &mut rows {
        s.air_density_kgpm3 = air.density_at(s.altitude_m);
        (s.aileron_rad, s.elevator_rad, s.throttle) = (f64::NAN, f64::NAN, f64::NAN);
    }
    rows
}

fn rebuilt(bytes: &[u8]) -> Reconstruction {
    let mut flight = parse(bytes, Path::new("flight"), &Options::default()).unwrap().flight;
    // this aircraft has vanes, though ArduPilot's record of them usually holds estimates
    flight.flow_angles = FlowAngles::Measured;
    let aircraft = model("jsbsim");
    let options = flight_path::Options {
        gravity: aircraft.atmosphere.gravity,
        ..flight_path::Options::new("flight", aircraft.airframe.actuators)
    };
    reconstruct(&flight, &options).unwrap()
}

fn compared(flight: &Reconstruction) -> Comparison {
    let options = compare::Options { horizons_s: vec![1.0, 5.0], ..compare::Options::default() };
    compare(
        &[model("prior-as-printed")],
        std::slice::from_ref(flight),
        &options,
        &greylag::sysid::progress::ignore_progress,
    )
    .unwrap()
}

/// The largest relative difference of the figures that a reader sees.
fn difference(a: &Comparison, b: &Comparison) -> f64 {
    let (a, b) = (&a.models[0], &b.models[0]);
    let relative = |x: f64, y: f64| {
        // What is no number must be none in both.
        if x.is_nan() && y.is_nan() { 0.0 } else { (x - y).abs() / x.abs().max(1e-3) }
    };
    let runs = a.free_run.iter().zip(&b.free_run).map(|(x, y)| {
        assert_eq!((x.runs, x.diverged), (y.runs, y.diverged));
        relative(x.rmse_scaled, y.rmse_scaled)
    });
    assert_eq!(a.channels.len(), b.channels.len());
    let channels = a.channels.iter().zip(&b.channels).flat_map(|(x, y)| {
        println!(
            "{:?} {:.5} {:.5} {:.5} {:.5}",
            x.channel,
            x.unexplained_fraction,
            y.unexplained_fraction,
            x.residual_rms,
            y.residual_rms
        );
        [
            relative(x.unexplained_fraction, y.unexplained_fraction),
            relative(x.residual_rms, y.residual_rms),
        ]
    });
    // A NaN on one side only must not pass for agreement.
    runs.chain(channels).map(|d| if d.is_nan() { f64::INFINITY } else { d }).fold(0.0, f64::max)
}

fn nuisance(flight: &Reconstruction, name: &str) -> [f64; 2] {
    let found = flight.nuisances.iter().find(|n| n.name == name).unwrap();
    [found.value, found.sd]
}

#[test]
fn one_flight_in_four_formats_is_one_comparison() {
    let mut rows = flown();
    let fine = compared(&rebuilt(&csv(&rows)));
    for (name, bytes) in [("ulog", ulog(&rows)), ("dataflash", dataflash(&rows))] {
        let other = compared(&rebuilt(&bytes));
        let found = difference(&fine, &other);
        println!("{name}: {found:.2e}");
        // Single precision is 6e-8, through a smoother that stops at 1e-6; reached: 2e-6.
        assert!(found < 1e-4, "{name}: {found}");
        assert_eq!(fine.sentences, other.sentences);
    }
    let telemetry = compared(&rebuilt(&tlog(&rows)));
    // GLOBAL_POSITION_INT counts cm/s: the same counts in the table give the same comparison.
    let count = |v: f64| (100.0 * v).round() / 100.0;
    rows.iter_mut().for_each(|s| s.velocity_ned_mps = s.velocity_ned_mps.map(count));
    let found = difference(&compared(&rebuilt(&csv(&rows))), &telemetry);
    println!("tlog: {found:.2e}; its velocities finely: {:.2e}", difference(&fine, &telemetry));
    assert!(found < 1e-4, "{found}");
    // The counts move the biases by 0.1 of their standard deviations; reached: 1.2 %.
    assert!(difference(&fine, &telemetry) < 0.03);
}

#[test]
fn a_slow_channel_counts_once_a_sample() {
    let rows = flown();
    let mut sparse = rows.clone();
    for (i, s) in sparse.iter_mut().enumerate() {
        if i % 10 != 0 {
            s.velocity_ned_mps = [f64::NAN; 3];
        }
    }
    let mut held = rows.clone();
    for i in 0..held.len() {
        held[i].velocity_ned_mps = rows[i - i % 10].velocity_ned_mps;
    }
    let [plain, held, telemetry] =
        [csv(&sparse), csv(&held), tlog_with(&rows, 10)].map(|b| rebuilt(&b));
    for name in ["wind_north", "wind_east", "wind_down", "alpha_bias", "airspeed_scale"] {
        let [a, b, c] = [&plain, &held, &telemetry].map(|f| nuisance(f, name));
        println!("{name}: {a:?} {b:?} {c:?}");
        for other in [b, c] {
            assert!((a[0] - other[0]).abs() < 0.2 * a[1], "{name}: {a:?} {other:?}");
            assert!((a[1] / other[1] - 1.0).abs() < 0.05, "{name}: {a:?} {other:?}");
        }
    }
    let [plain, held, telemetry] = [&plain, &held, &telemetry].map(compared);
    for other in [&held, &telemetry] {
        let found = difference(&plain, other);
        println!("{found:.2e}");
        assert!(found < 0.01, "{found}");
    }
}

#[test]
fn a_log_without_altitude_is_compared_with_the_air_of_sea_level() {
    let mut rows = flown();
    for s in &mut rows {
        (s.altitude_m, s.air_density_kgpm3) = (f64::NAN, f64::NAN);
    }
    let flight = rebuilt(&csv(&rows));
    assert!(flight.notes.iter().any(|n| n.contains("sea level")), "{:?}", flight.notes);
    assert!(compared(&flight).models[0].free_run.iter().all(|run| run.runs > 0));
}
