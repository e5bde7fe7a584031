//! Tests that hidden effects change flights by their formulas, and that invalid effects are refused.

use crate::flights::{IDLE, assert_same, busy, fly, plant, plant_with};
use greylag_sitl::hidden::{EFFECTS, Hidden, HiddenError};
use greylag_sitl::plant::{DT_S, Inputs, Plant, PlantOptions, Truth};

#[test]
fn time_delay_is_exact_to_the_step() {
    let mut hidden = plant_with(&["time_delay=0.05"]);
    let flight: Vec<(f64, f64)> = (0..100)
        .map(|k| {
            let truth = hidden.step(busy(k)).unwrap();
            (truth.aileron_rad, hidden.property("hidden/aileron-1").unwrap())
        })
        .collect();
    for k in 5..100 {
        assert_eq!(flight[k].1, flight[k - 5].0, "step {k}");
    }
}

#[test]
fn actuator_lag_follows_its_recurrence_and_rate_limit_its_limit() {
    let mut hidden = plant_with(&["actuator_lag=0.04", "rate_limit=1.5"]);
    let (mut lagged, mut last, mut limited) = (0.0, 0.0, 0.0_f64);
    let mut fastest = 0.0_f64;
    for k in 0..200 {
        let aileron = if (k / 20) % 2 == 0 { 1.0 } else { -1.0 };
        let truth = hidden.step(Inputs { aileron, ..IDLE }).unwrap();
        let (ca, cb) = (DT_S / (2.0 * 0.04 + DT_S), (2.0 * 0.04 - DT_S) / (2.0 * 0.04 + DT_S));
        lagged = ca * (truth.aileron_rad + last) + cb * lagged;
        last = truth.aileron_rad;
        let before = limited;
        limited += (lagged - limited).clamp(-1.5 * DT_S, 1.5 * DT_S);
        fastest = fastest.max((limited - before).abs() / DT_S);
        let acts = hidden.property("hidden/aileron-2").unwrap();
        assert!((acts - limited).abs() < 1e-12, "step {k}: {acts} for {limited}");
    }
    assert!((fastest - 1.5).abs() < 1e-9, "the limit was not met: {fastest}");
}

#[test]
fn the_thrust_lag_follows_its_recurrence() {
    let lag = 0.3;
    let (mut hidden, mut plain) = (plant_with(&["thrust_lag=0.3"]), plant());
    let (gain, keep) = (DT_S / (2.0 * lag + DT_S), (2.0 * lag - DT_S) / (2.0 * lag + DT_S));
    let thrust = |plant: &mut Plant| plant.property("propulsion/engine/thrust-lbs").unwrap();
    let mut lagged = thrust(&mut hidden);
    let mut before = lagged;
    let mut most = 0.0_f64;
    for k in 0..200 {
        let throttle = if (k / 50) % 2 == 0 { 1.0 } else { 0.2 };
        hidden.step(Inputs { throttle, ..IDLE }).unwrap();
        plain.step(Inputs { throttle, ..IDLE }).unwrap();
        let own = thrust(&mut hidden);
        lagged = gain * (own + before) + keep * lagged;
        before = own;
        let acts = own + hidden.property("hidden/thrust-lbs").unwrap();
        assert!((acts - lagged).abs() < 1e-12, "step {k}: {acts} for {lagged}");
        most = most.max((acts - own).abs());
    }
    assert!(most > 1.0, "the lag was not met: {most} lbf");
}

#[test]
fn a_servos_gain_depends_on_the_side() {
    for (effect, k) in [("servo_elevator=0.3", 0.3), ("servo_elevator=-0.2", -0.2)] {
        let mut hidden = plant_with(&[effect]);
        let mut sides = [false; 2];
        for step in 0..200 {
            let elevator = if (step / 40) % 2 == 0 { 0.5 } else { -0.5 };
            let truth = hidden.step(Inputs { elevator, aileron: elevator, ..IDLE }).unwrap();
            let (e, a) = (truth.elevator_rad, truth.aileron_rad);
            let acts = hidden.property("hidden/elevator-1").unwrap();
            assert!((acts - (e + k * e.abs())).abs() < 1e-12, "{effect}, step {step}: {acts}");
            assert_eq!(hidden.property("hidden/aileron-1").unwrap(), a, "{effect}, step {step}");
            sides[usize::from(e > 0.0)] |= e.abs() > 0.05;
        }
        assert_eq!(sides, [true; 2], "the elevator moves to both sides");
    }
}

#[test]
fn a_servos_gain_changes_with_deflection() {
    for (effect, of_elevator, c) in
        [("servo_elevator_curve=0.6", true, 0.6), ("servo_aileron_curve=-0.5", false, -0.5)]
    {
        let mut hidden = plant_with(&[effect]);
        let mut sides = [false; 2];
        for step in 0..200 {
            let command = if (step / 40) % 2 == 0 { 0.5 } else { -0.5 };
            let truth =
                hidden.step(Inputs { elevator: command, aileron: command, ..IDLE }).unwrap();
            let mut acts =
                ["elevator", "aileron"].map(|s| hidden.property(&format!("hidden/{s}-1")).unwrap());
            let mut moves = [truth.elevator_rad, truth.aileron_rad];
            if !of_elevator {
                acts.reverse();
                moves.reverse();
            }
            let curved = moves[0] * (1.0 + c * moves[0].abs());
            assert!((acts[0] - curved).abs() < 1e-12, "{effect}, step {step}: {acts:?}");
            assert_eq!(acts[1], moves[1], "{effect}, step {step}");
            sides[usize::from(moves[0] > 0.0)] |= moves[0].abs() > 0.05;
        }
        assert_eq!(sides, [true; 2], "{effect}: the surface moves to both sides");
    }
}

/// An amplitude within the bounds at which a flight of 3 s stays finite.
fn mild(id: &str) -> f64 {
    match id {
        "time_delay" => 0.03,
        "dead_zone" | "backlash" | "actuator_lag" | "cg_shift" | "thrust_line_offset" => 0.02,
        "asymmetry" => 0.003,
        "propeller_gyro" => 0.05,
        "rate_limit" => 0.3,
        "servo_aileron" | "servo_elevator" => 0.2,
        "aeroelastic_loss" | "mass_error" | "inertia_xz" | "propwash" => 0.1,
        "thrust_scale" => -3.0,
        _ => 0.5,
    }
}

#[test]
fn amplitude_zero_changes_nothing_and_any_other_changes_the_flight() {
    let plain = fly(&mut plant(), 0, 300);
    for effect in &EFFECTS {
        let nothing = fly(&mut plant_with(&[&format!("{}=0", effect.id)]), 0, 300);
        assert_same(&nothing, &plain);
        let something =
            fly(&mut plant_with(&[&format!("{}={}", effect.id, mild(effect.id))]), 0, 300);
        let apart = |a: &Truth, b: &Truth| {
            (a.roll_rad - b.roll_rad).abs().max((a.pitch_rad - b.pitch_rad).abs())
        };
        let most = plain.iter().zip(&something).map(|(a, b)| apart(a, b)).fold(0.0, f64::max);
        println!(
            "{:25} {:8}: attitude changes by up to {:.2}°",
            effect.id,
            mild(effect.id),
            most.to_degrees()
        );
        assert!(most > 1e-4, "{}: {most}", effect.id);
    }
}

#[test]
fn all_effects_together_load_and_fly() {
    let all: Vec<String> =
        EFFECTS.iter().map(|e| format!("{}={}", e.id, 0.1 * mild(e.id))).collect();
    let all: Vec<&str> = all
        .iter()
        .map(|text| if text.starts_with("time_delay") { "time_delay=0.01" } else { text })
        .collect();
    let flight = fly(&mut plant_with(&all), 0, 300);
    assert_eq!(flight.len(), 300);
}

#[test]
fn text_is_read_and_slips_are_named() {
    let hidden: Hidden = " pitch_break = -3.0 ".parse().unwrap();
    assert_eq!(
        (hidden.effect().id, hidden.amplitude(), hidden.to_string()),
        ("pitch_break", -3.0, "pitch_break=-3".into())
    );
    for (text, wanted) in [
        ("pitch_brake=1", "known ids: drag_alpha2,"),
        ("pitch_break", "known ids: drag_alpha2,"),
        ("pitch_break=much", "write ID=AMPLITUDE"),
        ("pitch_break=NaN", "outside -1000 to 1000"),
        ("mass_error=-1", "outside -0.9 to 10"),
        ("dead_zone=-0.1", "outside 0 to 1 rad"),
    ] {
        let message = text.parse::<Hidden>().unwrap_err().to_string();
        assert!(message.contains(wanted), "{text}: {message}");
    }
    let refused = |effects: &[&str]| {
        let hidden = effects.iter().map(|text| text.parse().unwrap()).collect();
        Plant::new(&PlantOptions { hidden, ..PlantOptions::default() })
            .err()
            .expect("refused")
            .to_string()
    };
    assert!(refused(&["time_delay=0.013"]).contains("whole number of steps"));
    assert!(refused(&["pitch_break=1", "pitch_break=2"]).contains("given twice"));
    assert!(matches!(Hidden::new("backlash", 2.0), Err(HiddenError::Amplitude { .. })));
}
