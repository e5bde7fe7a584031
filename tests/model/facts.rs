//! The facts of the X8 that the model must reproduce (`params/x8`, `params/x8/FACTS.md`).

use std::path::Path;

use greylag::model::{GreyBox, Trim};
use greylag::physics::{Controls, State};

fn model(name: &str) -> GreyBox {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    GreyBox::load(&folder.join(format!("{name}.toml"))).unwrap()
}

/// At 600 m, the start of an episode.
const ALTITUDE: f64 = 600.0;

#[test]
fn pitch_acceleration_at_the_start() {
    for name in ["prior", "jsbsim"] {
        let rate = model(name).rate(&State::NEUTRAL, &Controls::default(), ALTITUDE);
        println!("{name}: q-dot at the start {:+.4} rad/s^2 (simulator +5.74)", rate.q);
        // the simulator's figure is given with three digits
        assert!((rate.q - 5.74).abs() < 5e-3);
    }
}

#[test]
fn level_trim_at_three_airspeeds() {
    let model = model("jsbsim");
    // rows of the facts: V, α in degrees, δe in rad, throttle; each given to its last digit
    for (v, alpha, elevator, throttle) in
        [(16.67, 2.283, 0.01855, 0.118), (20.0, 0.858, 0.0688, 0.185), (25.0, -0.30, 0.1096, 0.308)]
    {
        let trim = Trim::level(&model, v, ALTITUDE).unwrap();
        let found = (trim.state.alpha.to_degrees(), trim.controls.elevator, trim.controls.throttle);
        println!(
            "{v:5.2} m/s: alpha {:.3} deg, elevator {:.5} rad, throttle {:.4}",
            found.0, found.1, found.2
        );
        assert!((found.0 - alpha).abs() < 6e-3, "alpha {}", found.0);
        assert!((found.1 - elevator).abs() < 6e-5, "elevator {}", found.1);
        assert!((found.2 - throttle).abs() < 6e-4, "throttle {}", found.2);
    }
}

#[test]
fn what_cannot_fly_level_descends_at_idle_throttle() {
    let mut glider = model("jsbsim");
    assert!(glider.set_coefficient("thrust_linear.Cp_n", 0.0));
    assert!(Trim::level(&glider, 18.0, ALTITUDE).is_err());
    let trim = Trim::straight(&glider, 18.0, ALTITUDE).unwrap();
    let rate = glider.rate(&trim.state, &trim.controls, ALTITUDE);
    assert!(rate.to_array().into_iter().all(|x| x.abs() < 1e-9), "{rate:?}");
    let path = trim.path().to_degrees();
    println!("descends by {path:.2} deg");
    assert!((-8.0..-2.0).contains(&path) && trim.controls.throttle == 0.0);
    let powered = model("jsbsim");
    let [level, straight] =
        [Trim::level, Trim::straight].map(|of| of(&powered, 18.0, ALTITUDE).unwrap());
    assert_eq!(level, straight);
}

/// A thrust that is flat up to half throttle and steep beyond, as an afterburner's.
#[test]
fn a_thrust_with_a_kink_is_trimmed_level_and_in_turns() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/aerosonde");
    let text = std::fs::read_to_string(folder.join("jsbsim.toml")).unwrap();
    let start = text.find("[effects.thrust_table.T_n]").unwrap();
    let kinked = "[effects.thrust_table.T_n]\nthrottle = [0.0, 0.5, 0.501, 1.0]\nairspeed_mps = [10.0, 40.0]\n\
                  value = [[2.0, 1.0], [2.0, 1.0], [60.0, 50.0], [60.1, 50.1]]\nsource = \"a test\"\n";
    let text = format!("{}{kinked}", &text[..start]);
    let model = GreyBox::parse(&text, &folder.join("kinked.toml")).unwrap();
    for trim in [
        Trim::level(&model, 25.0, ALTITUDE).unwrap(),
        Trim::attitude(&model, 0.5, 0.1, 25.0, ALTITUDE).unwrap(),
    ] {
        let rate = model.rate(&trim.state, &trim.controls, ALTITUDE);
        assert!(rate.to_array().into_iter().all(|x| x.abs() < 1e-6), "{rate:?}");
        assert!((0.5..0.501).contains(&trim.controls.throttle), "{trim:?}");
    }
}

/// Above the airspeed that full throttle holds in level flight.
#[test]
fn what_is_too_fast_for_its_engine_descends_at_full_throttle() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/aerosonde");
    let model = GreyBox::load(&folder.join("jsbsim.toml")).unwrap();
    assert!(Trim::level(&model, 35.0, ALTITUDE).is_err());
    let trim = Trim::straight(&model, 35.0, ALTITUDE).unwrap();
    let rate = model.rate(&trim.state, &trim.controls, ALTITUDE);
    assert!(rate.to_array().into_iter().all(|x| x.abs() < 1e-9), "{rate:?}");
    let path = trim.path().to_degrees();
    println!("descends by {path:.2} deg");
    assert!((-10.0..0.0).contains(&path) && trim.controls.throttle == 1.0);
}

/// The least thrust of a polynomial with a square in throttle may lie above what a steep descent asks for.
#[test]
fn a_thrust_that_no_throttle_gives_is_left_at_idle() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/aerosonde");
    let mut model = GreyBox::load(&folder.join("prior.toml")).unwrap();
    for (name, value) in [
        ("T0_n", 1.0),
        ("Tt_n", -2.0),
        ("Ttt_n", 40.0),
        ("TV_nspm", 0.0),
        ("TtV_nspm", 0.0),
        ("TVV_ns2pm2", 0.0),
    ] {
        assert!(model.set_coefficient(&format!("propeller.{name}"), value));
    }
    let trim = Trim::attitude(&model, 0.3, -0.4, 25.0, ALTITUDE).unwrap();
    let mut rate = model.rate(&trim.state, &trim.controls, ALTITUDE).to_array();
    assert_eq!(trim.controls.throttle, 0.0);
    assert!(trim.acceleration > 0.5 && rate[2] == trim.acceleration);
    rate[2] = 0.0;
    assert!(rate.into_iter().all(|x| x.abs() < 1e-9), "{rate:?}");
}

#[test]
fn trimmed_turns_are_steady() {
    let model = model("jsbsim");
    for (roll, pitch) in [(60.0_f64, 20.0_f64), (-45.0, -10.0), (20.0, 5.0)] {
        let trim =
            Trim::attitude(&model, roll.to_radians(), pitch.to_radians(), 22.0, ALTITUDE).unwrap();
        let rate = model.rate(&trim.state, &trim.controls, ALTITUDE);
        for (i, x) in rate.to_array().into_iter().enumerate().filter(|(i, _)| *i != 2) {
            // the solver settles at 1e-10
            assert!(x.abs() < 1e-9, "roll {roll} pitch {pitch}: component {i} is {x}");
        }
    }
}
