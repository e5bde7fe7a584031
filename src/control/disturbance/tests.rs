//! Tests of the disturbance estimate and of the judgement of the model.

use super::*;
use greylag_model::Trim;
use greylag_num::stream::stream;
use greylag_physics::{ActuatorState, Command, Time};
use rand::RngExt;
use std::path::Path;
use std::time::Duration;

/// The observation before the first step.
fn first() -> Observation {
    Observation {
        time: Time::default(),
        state: State::NEUTRAL,
        incidence_sd: [0.0; 2],
        actuators: ActuatorState::default(),
        altitude: 600.0,
        previous: [Command::IDLE; 2],
    }
}

/// A constant pitch acceleration that the model lacks appears only in the pitch-rate component of the estimate.
#[test]
fn a_constant_rate_is_found() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
    let model = GreyBox::load(&path).unwrap();
    let mut disturbance = Disturbance::new(0.2);
    let hidden = State { q: 0.3, ..NONE };
    let mut seen = first();
    let mut memory = Memory::default();
    for _ in 0..100 {
        disturbance.update(&model, &seen);
        let controls = seen.actuators.controls();
        let next = model.step(&seen.state, &controls, seen.altitude, &mut memory);
        seen.state = next.advance(&hidden, STEP);
        seen.time = seen.time.plus(Duration::from_secs_f64(STEP));
    }
    let found = disturbance.rate();
    // after five time constants the estimate is low by 0.7 %
    assert!((found.q - 0.3).abs() < 0.005, "{found:?}");
    let others = State { q: 0.0, ..found };
    assert!(others.to_array().iter().all(|x| x.abs() < 1e-9), "{found:?}");
    // a change during a gap does not enter the estimate
    seen.time = seen.time.plus(Duration::from_secs(1));
    seen.state.q += 5.0;
    disturbance.update(&model, &seen);
    assert_eq!(disturbance.rate(), found);
}

/// ArduPlane's loop of 250 Hz sends states every 8 or 12 ms; a stream of 50 Hz sends one every 20 ms.
#[test]
fn steps_of_any_length_count() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
    let model = GreyBox::load(&path).unwrap();
    let hidden = State { q: 0.3, ..NONE };
    for gaps_ms in [[8_u64, 12], [20, 20], [4, 4]] {
        let mut disturbance = Disturbance::new(0.2);
        let mut seen = first();
        // the pace of the states must be known first
        for tick in 0..500 {
            disturbance.update(&model, &seen);
            let gap_ms = gaps_ms[tick % 2];
            for _ in 0..gap_ms {
                let rate = model.rate(&seen.state, &seen.actuators.controls(), seen.altitude);
                seen.state = seen.state.advance(&rate.advance(&hidden, 1.0), 1e-3);
            }
            seen.time = seen.time.plus(Duration::from_millis(gap_ms));
        }
        let found = disturbance.rate();
        // the steps of the model are those of 10 ms
        assert!((found.q - 0.3).abs() < 0.03, "{gaps_ms:?} {found:?}");
        let others = State { q: 0.0, ..found };
        assert!(others.to_array().iter().all(|x| x.abs() < 0.03), "{gaps_ms:?} {found:?}");
        assert!(!disturbance.is_wrong(TRUST), "{gaps_ms:?} {disturbance:?}");
    }
}

/// A sideslip that errs by 2° makes the exact model predict angular accelerations that do not happen.
#[test]
fn an_inexact_sideslip_is_no_wrong_model() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
    let model = GreyBox::load(&path).unwrap();
    let trim = Trim::straight(&model, 20.0, 600.0).unwrap();
    let Controls { elevator, throttle, .. } = trim.controls;
    let actuators = ActuatorState { elevator, throttle, ..ActuatorState::default() };
    for (sd, wrong) in [(0.0, true), (0.02, false)] {
        let mut disturbance = Disturbance::new(TIME_CONSTANT_S);
        for k in 0..300 {
            let beta = 0.035 * (2.0 * std::f64::consts::PI * 0.01 * f64::from(k)).sin();
            disturbance.update(
                &model,
                &Observation {
                    time: Time::from_micros(10_000 * k as u64),
                    state: State { beta, ..trim.state },
                    incidence_sd: [0.0, sd],
                    actuators,
                    ..first()
                },
            );
        }
        assert_eq!(disturbance.is_wrong(TRUST), wrong, "{sd} {disturbance:?}");
    }
}

/// The step itself of a blocked airspeed tube that opens must not look like an acceleration of 2000 m/s², and what was estimated
/// at the wrong airspeed is no disturbance at the right one. The envelope limiter, which adds the estimate to its model, pitched
/// the aircraft down by 45° after it.
#[test]
fn a_jump_of_a_sensor_is_no_disturbance() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
    let model = GreyBox::load(&path).unwrap();
    let hidden = State { q: 0.3, ..NONE };
    let jumps = [
        State { airspeed: 20.0, ..NONE },
        State { alpha: -0.095, ..NONE },
        State { beta: 0.1, ..NONE },
        State { roll: 0.2, ..NONE },
        State { p: -3.0, ..NONE },
    ];
    for jump in jumps {
        let mut disturbance = Disturbance::new(TIME_CONSTANT_S);
        let mut seen = first();
        let mut memory = Memory::default();
        for tick in 0..52 {
            disturbance.update(&model, &seen);
            let controls = seen.actuators.controls();
            let next = model.step(&seen.state, &controls, seen.altitude, &mut memory);
            seen.state = next.advance(&hidden, STEP);
            seen.time = seen.time.plus(Duration::from_secs_f64(STEP));
            if tick == 50 {
                assert!(disturbance.rate().q > 0.2, "{:?}", disturbance.rate());
                seen.state = seen.state.advance(&jump, 1.0);
            }
        }
        assert_eq!(disturbance.rate(), NONE, "{jump:?}");
    }
}

/// The estimator for `model` after a simulated flight of 10 s with the model `truth`. Aileron and elevator alternate between
/// ±0.1 rad. At each step random gusts change the body rates by up to `gust` (rad/s).
fn predicted(model: &str, truth: &str, gust: f64) -> Disturbance {
    let load = |name: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8").join(name);
        GreyBox::load(&path).unwrap()
    };
    let (model, truth) = (load(model), load(truth));
    let mut random = stream(7, &[]);
    let mut disturbance = Disturbance::new(TIME_CONSTANT_S);
    let mut state = State::NEUTRAL;
    let mut memory = Memory::default();
    for tick in 0..1000_u64 {
        let side = |period: u64| if (tick / period).is_multiple_of(2) { 0.1 } else { -0.1 };
        let (aileron, elevator) = (side(50), side(35));
        let actuators = ActuatorState { aileron, elevator, ..ActuatorState::default() };
        let seen = Observation {
            time: Time::from_micros(10_000 * tick),
            incidence_sd: [0.0; 2],
            state,
            actuators,
            altitude: 600.0,
            previous: [Command::IDLE; 2],
        };
        disturbance.update(&model, &seen);
        let figures = &truth.airframe.actuators;
        let controls = Actuators::from_observed(&actuators, &seen.previous, figures).controls();
        state = truth.step(&state, &controls, 600.0, &mut memory);
        let mut kick = || gust * (2.0 * random.random::<f64>() - 1.0);
        (state.p, state.q, state.r) = (state.p + kick(), state.q + kick(), state.r + kick());
    }
    disturbance
}

/// A model with an effect between actuators and surfaces predicts its own flight: nothing is left to a disturbance.
#[test]
fn input_effects_are_no_disturbance() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
    for (effect, constant) in [("servo_aileron", 0.2), ("actuator_lag", 0.05)] {
        let mut model = GreyBox::load(&path).unwrap();
        model.join(effect, &[constant]).unwrap();
        let mut disturbance = Disturbance::new(TIME_CONSTANT_S);
        let (mut state, mut memory, mut inputs) = (State::NEUTRAL, Memory::default(), None);
        for tick in 0..200_u64 {
            let aileron = if (tick / 25).is_multiple_of(2) { 0.1 } else { -0.1 };
            let actuators = ActuatorState { aileron, ..ActuatorState::default() };
            let seen = Observation {
                time: Time::from_micros(10_000 * tick),
                incidence_sd: [0.0; 2],
                state,
                actuators,
                altitude: 600.0,
                previous: [Command::IDLE; 2],
            };
            disturbance.update(&model, &seen);
            let figures = &model.airframe.actuators;
            let measured = Actuators::from_observed(&actuators, &seen.previous, figures).controls();
            let past = inputs.get_or_insert_with(|| model.at_rest(&measured));
            let controls = model.act(&measured, past);
            state = model.step(&state, &controls, 600.0, &mut memory);
        }
        let left = disturbance.rate().to_array();
        assert!(left.iter().all(|x| x.abs() < 1e-9), "{effect}: {left:?}");
    }
}

#[test]
fn gusts_are_no_wrong_model() {
    let gusts = predicted("prior.toml", "prior.toml", 0.1);
    assert!((gusts.missed / gusts.happened).sqrt() > TRUST, "{gusts:?}");
    assert!(!gusts.is_wrong(TRUST), "{gusts:?}");
    assert!(!predicted("prior.toml", "prior.toml", 0.0).is_wrong(TRUST));
    for gust in [0.0, 0.03] {
        let wrong = predicted("prior-as-printed.toml", "prior.toml", gust);
        assert!(wrong.is_wrong(TRUST), "{gust}: {wrong:?}");
    }
}
