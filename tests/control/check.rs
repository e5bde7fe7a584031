//! The check of an aircraft, and its responses to the stick.

use std::path::Path;

use greylag::control::aircraft_check::check;
use greylag::control::stick_response::{STEPPED, StickResponse, stick_responses};
use greylag::model::GreyBox;

fn model(path: &str) -> GreyBox {
    GreyBox::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

#[test]
fn the_shipped_aircraft_can_be_flown() {
    for path in ["params/x8/jsbsim.toml", "params/aerosonde/jsbsim.toml"] {
        let found = check(&model(path)).unwrap();
        let kept = found.loops.iter().all(|l| l.delay > 0.02 && l.gain[1] > 1.5);
        assert!(kept, "{:?}", found.loops);
        // 20 degrees a second
        assert!(found.authority.roll_rate > 0.35);
        // their only findings concern the delay margin of the LQI
        assert!(found.findings.iter().all(|f| f.contains("of delay")), "{:?}", found.findings);
        assert_eq!(found.modes.iter().filter(|m| m.name == "short period").count(), 1);
    }
}

/// The delay that the recommended controller tolerates is that of one of the loops that page and terminal list.
#[test]
fn the_delay_of_the_advice_is_that_of_a_listed_loop() {
    for path in ["params/x8/jsbsim.toml", "params/aerosonde/jsbsim.toml"] {
        let found = check(&model(path)).unwrap();
        let advised = &found.controller;
        let own = || found.named_loops().filter(|(name, _)| *name == advised.name);
        let least = own().map(|(_, l)| l.delay).fold(f64::INFINITY, f64::min);
        assert_eq!(least, advised.delay_s, "{path}: {advised:?}");
        assert_eq!(own().count(), found.loops.len(), "{path}");
    }
}

#[test]
fn a_reversed_surface_and_a_weak_motor_are_said() {
    let mut wrong = model("params/aerosonde/jsbsim.toml");
    assert!(wrong.set_coefficient("roll_linear.Clda", -0.17));
    assert!(wrong.set_coefficient("thrust_table.k", 0.25));
    let said = check(&wrong).unwrap().findings.join("\n");
    assert!(said.contains("Clda") && said.contains("throttle"), "{said}");
    // only the surface that is reversed is named
    assert!(!said.contains("elevator must") && !said.contains("rudder must"), "{said}");
}

/// An elevator that is much too weak: each cause is one line, and the trims beyond its travel are not possible.
#[test]
fn a_cause_at_many_airspeeds_is_one_finding() {
    let mut weak = model("params/aerosonde/jsbsim.toml");
    assert!(weak.set_coefficient("pitch_linear.Cmde", -0.02));
    let found = check(&weak).unwrap();
    let travel = found.findings.iter().filter(|f| f.contains("of the elevator's travel")).count();
    assert_eq!(travel, 1, "{:?}", found.findings);
    assert!(found.levels.iter().any(|l| !l.is_possible()), "{:?}", found.levels);
    // a controller is recommended only if one can be designed
    let undesigned = found.findings.iter().any(|f| f.contains("cannot design"));
    assert_eq!(found.designed, !undesigned, "{:?}", found.findings);
    assert_eq!(found.named_loops().count() > 0, found.designed);
}

#[test]
fn the_stick_rolls_right_and_pitches_up() {
    let model = model("params/aerosonde/prior.toml");
    let [roll, pitch] = stick_responses(&model).unwrap();
    let at = |r: &StickResponse, t: f64| r.states[r.time_s.iter().filter(|x| **x < t).count()];
    assert!(at(&roll, 0.5).p > 0.1 && at(&roll, 0.5).roll > 0.02);
    assert!(at(&pitch, 0.2).q > 0.01 && at(&pitch, 0.5).alpha > at(&pitch, 0.0).alpha);
    // sideslip and the dihedral effect reduce the roll rate below that of the aileron alone
    let full = check(&model).unwrap().authority.roll_rate;
    let share = at(&roll, 0.4).p / (STEPPED * full);
    assert!((0.4..1.1).contains(&share), "{share}");
}
