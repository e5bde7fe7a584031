//! The rules of flight in signal temporal logic: held without faults, broken by a bad controller, searched and made smaller.

use std::ops::ControlFlow;
use std::path::Path;

use greylag::commands::controllers::POLICY;
use greylag::commands::fly::companion_with;
use greylag::control::{Controller, ControllerKind, Observation, Target};
use greylag::flight::runtime::Companion;
use greylag::link::vehicle::Fault;
use greylag::model::GreyBox;
use greylag::physics::Command;
use greylag::sim::faults::policies::{Sample, policies};
use greylag::sim::faults::search::{distances, search};
use greylag::sim::faults::{CompanionFactory, ControllerSetting, Counterpart, Scenario, Setting};

fn x8() -> GreyBox {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    GreyBox::load(&path).unwrap()
}

fn lqi() -> Companion {
    companion_with(ControllerKind::Lqi, &x8(), Path::new(POLICY)).unwrap()
}

fn quiet(counterpart: Counterpart) -> Scenario {
    Scenario { faults: Vec::new(), ..Scenario::of_seed(counterpart, 3) }
}

/// Names of the rules that a flight breaks.
fn broken(factory: &CompanionFactory, scenario: &Scenario) -> Vec<&'static str> {
    let rules = policies(&factory.envelope());
    let judged = distances(factory, &rules, scenario).unwrap();
    let broken = |d: &Option<(f64, f64)>| d.is_some_and(|(distance, _)| distance < 0.0);
    rules.iter().zip(&judged).filter(|(_, d)| broken(d)).map(|(rule, _)| rule.id).collect()
}

#[test]
fn flights_without_faults_break_no_rule() {
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    for counterpart in Counterpart::ALL {
        assert_eq!(broken(&factory, &quiet(counterpart)), [""; 0], "{counterpart:?}");
    }
}

#[test]
fn a_link_that_loses_half_of_its_frames_is_left_in_time() {
    // found by a search; with the surfaces kept the nose fell 24 degrees below the envelope
    let scenario = include_str!("../data/scenarios/lossy-link.json");
    let scenario: Scenario = serde_json::from_str(scenario).unwrap();
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    assert_eq!(broken(&factory, &scenario), [""; 0]);
}

#[test]
fn a_bank_that_is_reversed_by_attitude_stays_inside_a_narrow_envelope() {
    // found by a search; a step of the attitude put the nose 22 degrees above and 21 below the envelope
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    for scenario in [
        include_str!("../data/scenarios/reversal-px4-attitude.json"),
        include_str!("../data/scenarios/reversal-ardupilot-attitude.json"),
        include_str!("../data/scenarios/unplugged-ardupilot-attitude.json"),
    ] {
        let scenario: Scenario = serde_json::from_str(scenario).unwrap();
        assert_eq!(broken(&factory, &scenario), [""; 0], "{:?}", scenario.counterpart);
    }
}

#[test]
fn surfaces_that_answer_late_are_handed_back_before_the_rules_break() {
    // found by a search: 60 ms between command and surface; the guard saw the swing after three seconds, at 76 degrees of bank
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    let scenario = include_str!("../data/scenarios/late-surfaces-ardupilot.json");
    let scenario: Scenario = serde_json::from_str(scenario).unwrap();
    assert_eq!(broken(&factory, &scenario), [""; 0]);
}

#[test]
fn a_loop_that_a_starved_processor_makes_swing_is_calmed_where_nobody_else_can_fly() {
    // found by searches; states that were answered late kept the surfaces swinging between their stops
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    for scenario in [
        include_str!("../data/scenarios/starved-in-a-turn.json"),
        include_str!("../data/scenarios/starved-long.json"),
        include_str!("../data/scenarios/starved-in-a-descent.json"),
    ] {
        let scenario: Scenario = serde_json::from_str(scenario).unwrap();
        assert_eq!(broken(&factory, &scenario), [""; 0], "{:?}", scenario.faults);
    }
}

#[test]
fn an_aircraft_that_rolled_onto_its_back_while_nothing_was_heard_of_it_recovers_in_time() {
    // found by a search: up elevator, nearly inverted, had the nose 85 degrees down for four seconds
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    let scenario = include_str!("../data/scenarios/reboot-in-a-turn.json");
    let scenario: Scenario = serde_json::from_str(scenario).unwrap();
    let (samples, _) = factory.trace(&scenario).unwrap();
    assert!(samples.iter().any(|s| s.attitude_deg[0].abs() > 120.0));
    assert_eq!(broken(&factory, &scenario), [""; 0]);
}

#[test]
fn a_turn_near_the_largest_bank_is_held() {
    // found by a search, without any fault: the roll integral held 63.6 degrees of bank, the nose fell, and the aircraft dived
    let damped = companion_with(ControllerKind::LqiDamped, &x8(), Path::new(POLICY)).unwrap();
    let factory = CompanionFactory::new(damped, &x8()).unwrap();
    let scenario = include_str!("../data/scenarios/steep-turn.json");
    let scenario: Scenario = serde_json::from_str(scenario).unwrap();
    assert_eq!(broken(&factory, &scenario), [""; 0]);
}

#[test]
fn a_wrong_vane_and_a_blocked_pitot_tube_are_not_followed() {
    // found by searches: the limiter followed the vane out of the envelope, and the nose went up or down by 20 degrees and more
    let damped = companion_with(ControllerKind::LqiDamped, &x8(), Path::new(POLICY)).unwrap();
    let factory = CompanionFactory::new(damped, &x8()).unwrap();
    for scenario in [
        include_str!("../data/scenarios/wrong-vane.json"),
        include_str!("../data/scenarios/blocked-airspeed.json"),
    ] {
        let scenario: Scenario = serde_json::from_str(scenario).unwrap();
        assert_eq!(broken(&factory, &scenario), [""; 0], "{:?}", scenario.faults);
    }
}

#[test]
fn turbulence_is_no_oscillation() {
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    let swings =
        |s: &Sample| matches!(s.decision.and_then(|d| d.refused), Some(Fault::Oscillation(_)));
    for counterpart in [Counterpart::Px4, Counterpart::Ardupilot] {
        for turbulence in [4, 5, 6] {
            let scenario = Scenario { turbulence, ..quiet(counterpart) };
            let (samples, _) = factory.trace(&scenario).unwrap();
            assert!(samples.iter().any(|s| s.confirmed), "{counterpart:?}, {turbulence}");
            assert!(!samples.iter().any(swings), "{counterpart:?}, {turbulence}");
        }
    }
}

#[test]
fn parameters_of_the_flight_controller_are_set_and_looked_at() {
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    let with = |counterpart, name: &str, value| {
        let controller_parameters = vec![ControllerSetting { name: name.into(), value }];
        Scenario { controller_parameters, ..quiet(counterpart) }
    };
    // engaging is refused: nothing is flown, and nothing broken
    for (counterpart, name, value) in [
        (Counterpart::Px4, "COM_RC_IN_MODE", 0.0),
        (Counterpart::Px4Attitude, "COM_OF_LOSS_T", 5.0),
        (Counterpart::Ardupilot, "RC_OVERRIDE_TIME", 3.0),
    ] {
        let scenario = with(counterpart, name, value);
        assert_eq!(broken(&factory, &scenario), [""; 0], "{name}");
        let (samples, _) = factory.trace(&scenario).unwrap();
        assert!(!samples.iter().any(|s| s.confirmed), "{name}");
        assert!(samples.iter().any(|s| s.spoke), "{name}");
    }
    let rules = policies(&factory.envelope());
    let refused = |scenario| distances(&factory, &rules, &scenario).unwrap_err().to_string();
    assert!(refused(with(Counterpart::Px4, "NONE", 1.0)).contains("has no parameter NONE"));
    assert!(
        refused(with(Counterpart::Sitl, "X", 1.0)).contains("no flight controller is simulated")
    );
}

#[test]
fn rules_go_with_the_parameters_and_a_parameter_that_is_refused_is_named() {
    let factory = CompanionFactory::new(lqi(), &x8()).unwrap();
    let with = |name: &str, times| {
        let parameters = vec![Setting { name: name.into(), times }];
        Scenario { parameters, ..quiet(Counterpart::Sitl) }
    };
    // the legs ask for a bank of 40 degrees, and 30 are allowed
    assert_eq!(broken(&factory, &with("GL_BANK_MAX_DEG", 0.5)), [""; 0]);
    let rules = policies(&factory.envelope());
    let refused = |scenario| distances(&factory, &rules, &scenario).unwrap_err().to_string();
    let said = refused(with("GL_BANK_MAX_DEG", 3.0));
    assert!(
        said.contains("GL_BANK_MAX_DEG to 3 times its default") && said.contains("80"),
        "{said}"
    );
    assert!(refused(with("GL_NONE", 1.0)).contains("no such parameter"));
    assert!(refused(with("SYSID_THISMAV", 2.0)).contains("not a real number"));
}

/// Rolls as far as it goes, and swings its elevator.
#[derive(Clone)]
struct Wild;

impl Controller for Wild {
    fn name(&self) -> &'static str {
        "wild"
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }

    fn reset(&mut self, _: u64) {}

    fn command(&mut self, seen: &Observation, _: &Target) -> Command {
        let up = (seen.time.as_micros() / 200_000).is_multiple_of(2);
        let elevator = if up { 0.9 } else { -0.9 };
        Command { aileron: 0.2, elevator, throttle: 0.5, rudder: 0.0 }
    }
}

#[test]
fn a_controller_that_does_not_fly_breaks_the_rules_of_the_aircraft() {
    let wild = Companion { controller: Box::new(Wild), ..lqi() };
    let factory = CompanionFactory::new(wild, &x8()).unwrap();
    let broken = broken(&factory, &quiet(Counterpart::Sitl));
    assert!(broken.contains(&"nose-down") && broken.contains(&"reached"), "{broken:?}");
    // what the companion itself answers for holds whatever the controller does; the bank by the envelope limiter
    for rule in ["finite", "range", "slew", "idle", "bank", "bank-target", "failsafe-reported"] {
        assert!(!broken.contains(&rule), "{broken:?}");
    }
}

#[test]
fn a_search_repeats_from_its_seed_and_what_it_finds_is_made_smaller() {
    let wild = Companion { controller: Box::new(Wild), ..lqi() };
    let factory = CompanionFactory::new(wild, &x8()).unwrap();
    let run = || {
        let on = &mut |_, _| ControlFlow::Continue(());
        search(&factory, &[Counterpart::Sitl], 4, 5, on).unwrap()
    };
    let [one, two] = [run(), run()];
    for (a, b) in one.iter().zip(&two) {
        assert_eq!((a.policy, a.flights, a.broken), (b.policy, b.flights, b.broken));
        assert_eq!((a.distance, &a.scenario), (b.distance, &b.scenario));
    }
    let bank = one.iter().find(|n| n.policy == "bank").unwrap();
    let scenario = bank.scenario.as_ref().unwrap();
    assert!(bank.broken > 0 && bank.distance < 0.0);
    // no fault is needed for it, no wind and no request
    assert!(scenario.faults.is_empty() && scenario.asked.is_empty(), "{scenario:?}");
    assert!(scenario.wind_ned_mps == [0.0; 3] && scenario.turbulence == 0, "{scenario:?}");
    let text = serde_json::to_string(scenario).unwrap();
    assert_eq!(&serde_json::from_str::<Scenario>(&text).unwrap(), scenario);
}
