//! Compares the plant in steps of 4 ms, as for PX4, with steps of 10 ms, the default.

use greylag_sitl::plant::{Inputs, Plant, PlantError, PlantOptions, Start, Truth};

fn plant(step_s: f64) -> Plant {
    Plant::new(&PlantOptions { step_s, ..PlantOptions::default() }).expect("the X8")
}

/// States every 20 ms of a 5 s flight, with each command held for 20 ms.
fn fly(step_s: f64) -> Vec<Truth> {
    let mut plant = plant(step_s);
    plant.reset(&Start::NEUTRAL).expect("a start");
    let steps = (0.02 / step_s).round() as usize;
    (0..250)
        .map(|k| {
            let t = k as f64 * 0.02;
            let inputs = Inputs {
                aileron: 0.06 * (3.0 * t).sin(),
                elevator: 0.02 * (2.0 * t).cos(),
                throttle: 0.5,
                rudder: 0.0,
            };
            (0..steps).map(|_| plant.step(inputs).expect("flown")).last().expect("a step")
        })
        .collect()
}

fn furthest(a: &[Truth], b: &[Truth], get: fn(&Truth) -> f64) -> f64 {
    a.iter().zip(b).map(|(a, b)| (get(a) - get(b)).abs()).fold(0.0, f64::max)
}

#[test]
fn another_step_is_nearly_the_same_aircraft() {
    let (slow, fast, finest) = (fly(0.01), fly(0.004), fly(0.001));
    for truth in [&slow, &fast, &finest] {
        assert!((truth[249].time_s - 5.0).abs() < 1e-9);
    }
    let report = |name: &str, a: &[Truth], b: &[Truth]| {
        let roll = furthest(a, b, |t| t.roll_rad).to_degrees();
        let pitch = furthest(a, b, |t| t.pitch_rad).to_degrees();
        let aileron = furthest(a, b, |t| t.aileron_rad);
        println!("{name}: roll {roll:.3}°, pitch {pitch:.3}°, aileron {aileron:.5} rad");
        (roll, pitch, aileron)
    };
    let (roll, pitch, aileron) = report("4 ms against 10 ms", &slow, &fast);
    let (near_roll, near_pitch, near_aileron) = report("4 ms against 1 ms", &finest, &fast);
    // The filters of the actuators (100 rad/s) are discretised for the step, and a command acts on the step after it. Deflections
    // therefore differ for about 10 ms after a change, and attitudes by the integral of that difference. Measured: 0.035° of
    // roll, 0.13° of pitch, 0.0003 rad of aileron.
    assert!(roll < 0.1 && pitch < 0.3 && aileron < 1e-3, "{roll}° {pitch}° {aileron} rad");
    // A finer step gives a smaller difference from the aircraft that the file describes.
    assert!(near_roll < roll && near_pitch < pitch && near_aileron < aileron);
}

#[test]
fn a_held_deflection_is_the_same_whatever_the_step() {
    for step_s in [0.01, 0.004, 0.001] {
        let mut plant = plant(step_s);
        plant.reset(&Start::NEUTRAL).expect("a start");
        let inputs = Inputs { aileron: 0.1, elevator: -0.1, throttle: 0.5, rudder: 0.0 };
        let steps = (0.5 / step_s) as usize;
        let truth = (0..steps).map(|_| plant.step(inputs).expect("flown")).last().expect("a step");
        // 0.5 s are 35 time constants of the surfaces.
        assert!((truth.aileron_rad - 0.05235).abs() < 1e-9, "{truth:?}");
        assert!((truth.elevator_rad + 0.05235).abs() < 1e-9, "{truth:?}");
        // The throttle lag of 0.2 s gives 1 − e^−2.5 of the change, within one step.
        let lag = 0.5 * (1.0 - (-2.5_f64).exp());
        assert!((truth.throttle - lag).abs() < 0.5 * step_s / 0.2, "{} for {lag}", truth.throttle);
    }
}

#[test]
fn a_step_that_nothing_was_tried_with_is_refused() {
    for step_s in [0.0, 0.02, -0.01, f64::NAN] {
        let refused = Plant::new(&PlantOptions { step_s, ..PlantOptions::default() });
        assert!(matches!(refused.err(), Some(PlantError::Step { .. })), "{step_s}");
    }
}
