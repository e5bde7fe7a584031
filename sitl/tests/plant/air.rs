//! Tests of wind, gusts and turbulence in the plant, and of the refusal of invalid air.

use crate::flights::{fly, plant, plant_in};
use greylag_sitl::air::{Air, Gust, Turbulence};
use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start};

#[test]
fn wind_moves_the_ground_and_not_the_air() {
    let wind_ned_mps = [3.0, -4.0, 1.5];
    let mut windy = plant_in(Air { wind_ned_mps, ..Air::default() });
    let start = Start {
        roll_rad: 0.3,
        pitch_rad: -0.2,
        yaw_rad: 2.0,
        alpha_rad: 0.05,
        beta_rad: -0.03,
        ..Start::NEUTRAL
    };
    let truth = windy.reset(&start).unwrap();
    let calm = plant().reset(&start).unwrap();
    for (got, wanted) in [
        (truth.airspeed_mps, 16.67),
        (truth.alpha_rad, 0.05),
        (truth.beta_rad, -0.03),
        (truth.roll_rad, 0.3),
        (truth.pitch_rad, -0.2),
        (truth.yaw_rad, 2.0),
    ] {
        assert!((got - wanted).abs() < 1e-9, "{got} for {wanted}: {truth:?}");
    }
    for (i, wind) in wind_ned_mps.iter().enumerate() {
        assert!((truth.wind_ned_mps[i] - wind).abs() < 1e-9, "{truth:?}");
        let drift = truth.velocity_ned_mps[i] - calm.velocity_ned_mps[i];
        assert!((drift - wind).abs() < 1e-9, "axis {i}: {drift}");
        let force = truth.specific_force_mps2[i] - calm.specific_force_mps2[i];
        assert!(force.abs() < 1e-6, "axis {i}: {force}");
    }
}

#[test]
fn gust_blows_when_and_as_told() {
    let gust = Gust {
        start_s: 0.5,
        velocity_ned_mps: [0.0, 2.0, -3.0],
        rise_s: 0.2,
        hold_s: 0.2,
        fall_s: 0.4,
    };
    let mut plant = plant_in(Air { gusts: vec![gust], ..Air::default() });
    let flight = fly(&mut plant, 0, 200);
    let down: Vec<f64> = flight.iter().map(|t| t.wind_ned_mps[2]).collect();
    // Entry 50 is the step that begins at 0.50 s, the start of the gust.
    assert!(down[..=50].iter().all(|w| *w == 0.0), "{down:?}");
    assert!((down[60] + 1.5).abs() < 1e-6, "half up after half the rise: {}", down[60]);
    assert!(down[71..89].iter().all(|w| (w + 3.0).abs() < 1e-6), "{:?}", &down[71..89]);
    assert!((down[110] + 1.5).abs() < 1e-6, "half down after half the fall: {}", down[110]);
    assert!(down[132..].iter().all(|w| *w == 0.0), "{:?}", &down[132..]);
    assert!((flight[80].wind_ned_mps[1] - 2.0).abs() < 1e-6);
}

/// For a wind without a north component, JSBSim keeps the previous direction of the wind. The plant must set the
/// direction, because the turbulence depends on it.
#[test]
fn turbulence_goes_with_a_wind_from_due_west() {
    let turbulence = Some(Turbulence { wind_20ft_mps: 15.0, severity: 5 });
    let east = |north: f64| {
        let air = Air { wind_ned_mps: [north, 5.0, 0.0], turbulence, ..Air::default() };
        fly(&mut plant_in(air), 0, 300)
    };
    let (exact, nearly) = (east(0.0), east(1e-9));
    assert!(exact.iter().any(|t| t.wind_ned_mps[0].abs() > 0.2));
    for (a, b) in exact.iter().zip(&nearly) {
        for (a, b) in a.wind_ned_mps.iter().zip(b.wind_ned_mps) {
            assert!((a - b).abs() < 1e-3, "{a} {b}");
        }
    }
}

#[test]
fn air_that_cannot_blow_is_refused() {
    let gust = Gust {
        start_s: 1.0,
        velocity_ned_mps: [1.0, 0.0, 0.0],
        rise_s: 1.0,
        hold_s: 0.0,
        fall_s: 1.0,
    };
    let refused = |air: Air| {
        let options = PlantOptions { air, ..PlantOptions::default() };
        Plant::new(&options).err().expect("this air cannot blow").to_string()
    };
    let wind_ned_mps = [f64::NAN, 0.0, 0.0];
    assert!(refused(Air { wind_ned_mps, ..Air::default() }).contains("steady wind"));
    for (wind_20ft_mps, severity) in [(-1.0, 3), (5.0, 0), (5.0, 8), (f64::INFINITY, 3)] {
        let turbulence = Some(Turbulence { wind_20ft_mps, severity });
        assert!(refused(Air { turbulence, ..Air::default() }).contains("turbulence"));
    }
    for shapeless in [
        Gust { rise_s: 0.0, ..gust },
        Gust { fall_s: f64::NAN, ..gust },
        Gust { start_s: -1.0, ..gust },
        Gust { velocity_ned_mps: [0.0; 3], ..gust },
    ] {
        assert!(refused(Air { gusts: vec![gust, shapeless], ..Air::default() }).contains("gust 1"));
    }
    let gusts = vec![Gust { start_s: 2.5, ..gust }, gust];
    assert!(refused(Air { gusts, ..Air::default() }).contains("overlap"));
}

#[test]
fn the_wildest_flight_never_panics() {
    let turbulence = Some(Turbulence { wind_20ft_mps: 30.0, severity: 7 });
    let mut plant = plant_in(Air { turbulence, wind_ned_mps: [-20.0, 5.0, 3.0], ..Air::default() });
    let mut failed = 0;
    for seed in 0..10 {
        plant.reseed(seed);
        plant.reset(&Start::NEUTRAL).unwrap();
        let mut x = u64::from(seed);
        for _ in 0..3000 {
            // Bang-bang commands from a linear congruential generator (Knuth's MMIX constants).
            x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let bang = |bit: u32| if x >> bit & 1 == 1 { 1.0 } else { -1.0 };
            let inputs =
                Inputs { aileron: bang(60), elevator: bang(61), throttle: bang(62), rudder: 0.0 };
            if plant.step(inputs).is_err() {
                failed += 1;
                break;
            }
        }
    }
    println!("{failed} of 10 wild flights of 30 s diverged");
    assert!(failed < 10, "none flew to its end");
}
