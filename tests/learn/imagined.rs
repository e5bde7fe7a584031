//! Imagined aircraft in lanes: they fly as one imagined in double precision, and episodes end as said.

use std::path::Path;
use std::sync::Arc;

use greylag::model::GreyBox;
use greylag::num::Real;
use greylag::physics::{Airframe, Command, State};
use greylag::sim::imagined::{Block, Ended, Imagination, STEPS, Validity};
use greylag::sim::targets::Stratified;
use greylag::sim::{Environment, Imagined};

fn model(name: &str) -> GreyBox {
    let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    GreyBox::load(&params.join(format!("{name}.toml"))).unwrap()
}

fn world(name: &str, instances: usize) -> Imagination {
    Imagination::new(Arc::new(model(name)), instances, Stratified::new(7, 0, 0.0))
}

/// Slow waves of aileron, elevator and thrust in −1..1.
fn wave(step: usize) -> [f64; 3] {
    let t = 0.01 * step as f64;
    [0.15 * (2.0 * t).sin(), -0.1 + 0.1 * (3.0 * t).cos(), -0.5 + 0.2 * t.sin()]
}

#[test]
fn lanes_fly_as_one_aircraft_in_double_precision() {
    for name in ["jsbsim", "prior"] {
        let mut lanes = world(name, 16);
        let mut single = Imagined::new(model(name));
        single.reset().unwrap();
        let mut worst = 0.0_f64;
        for step in 0..300 {
            let [aileron, elevator, thrust] = wave(step);
            let seen = single
                .step(Command { aileron, elevator, throttle: (thrust + 1.0) / 2.0, rudder: 0.0 })
                .unwrap();
            let stepped = lanes.step(0, &wave(step).map(Block::from_f64));
            let roll = f64::from(stepped.observed[0].0[5]);
            let pitch = 0.5 * f64::from(stepped.observed[1].0[5]);
            worst = worst.max((roll - seen.state.roll).abs()).max((pitch - seen.state.pitch).abs());
        }
        println!("{name}: attitude of lanes and of double precision within {worst:.1e} rad in 3 s");
        // single precision, and the density of the start: 0.3 % over the 30 m that are climbed
        assert!(worst < 5e-3, "{name}");
    }
}

#[test]
fn one_aircraft_flies_as_the_first_of_many() {
    let (mut one, mut many) = (world("jsbsim", 1), world("jsbsim", 64));
    for step in 0..200 {
        let action = wave(step).map(Block::from_f64);
        let (a, b) = (one.step(0, &action), many.step(0, &action));
        assert_eq!(a.observed.map(|x| x.0[0]), b.observed.map(|x| x.0[0]));
        assert_eq!(a.reward.0[0], b.reward.0[0]);
    }
}

#[test]
fn episodes_end_in_time_and_begin_anew_with_another_target() {
    let mut world = world("jsbsim", 20);
    let start = world.observe(0);
    let action = [-0.0, -0.05, -0.6].map(Block::from_f64);
    for step in 1..=STEPS {
        let stepped = world.step(0, &action);
        let expected = if step == STEPS { Ended::Time } else { Ended::No };
        assert_eq!(stepped.ended, [expected; 16], "step {step}");
    }
    let again = world.observe(0);
    assert_eq!(again[..13], start[..13]);
    assert_ne!(again[13], start[13]);
    // 20 first targets, and one for each of the 16 that ended
    assert_eq!(world.episodes(), [36, 0]);
}

#[test]
fn aircraft_that_leave_the_envelope_are_lost_alone_and_counted() {
    let mut world = world("jsbsim", 16);
    // full elevator down takes the nose through the vertical; the others hold still
    let mut action = [0.0, -0.05, -0.6].map(Block::from_f64);
    action[1].0[3] = 1.0;
    let mut lost = 0;
    for _ in 0..400 {
        let stepped = world.step(0, &action);
        for (lane, how) in stepped.ended.iter().enumerate() {
            assert!(*how == Ended::No || lane == 3);
            lost += u64::from(*how == Ended::Lost);
            let whole = stepped.observed.iter().all(|x| x.0[lane].is_finite());
            assert!(whole || *how == Ended::Lost);
        }
        assert!(world.observe(0).iter().all(|x| x.0.iter().all(|x| x.is_finite())));
    }
    assert!(lost > 0);
    assert_eq!(world.episodes(), [16 + lost, lost]);
}

/// The airspeeds at which an episode ends are those of the aircraft: a C172 flies up to 60 m/s and dives beyond, an indoor
/// aircraft flies from 5 m/s.
#[test]
fn an_aircraft_is_lost_at_airspeeds_of_its_own() {
    let params = Path::new(env!("CARGO_MANIFEST_DIR")).join("params");
    let validity = |aircraft: &str| {
        let file = params.join(aircraft).join("airframe.toml");
        Validity::of(&Airframe::load(&file).unwrap())
    };
    let lost = |aircraft: &str, airspeed: f64| {
        let state = State { airspeed, ..State::NEUTRAL }.map(Block::from_f64);
        validity(aircraft).outside(&state).0[0] > 0.0
    };
    // the limits of the trainings of the shipped policies
    assert_eq!(validity("x8").bounds().map(|s| s.airspeed), [4.0, 60.0]);
    assert!(lost("x8", 65.0) && !lost("c172p", 65.0) && lost("c172p", 85.0));
    assert!(lost("x8", 3.0) && !lost("a430", 3.0) && lost("a430", 1.0));
}
