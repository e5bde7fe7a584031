//! Airframe files: which controls there are, and how each follows its command.

use greylag::physics::actuators::Actuators;
use greylag::physics::airframe::{Airframe, Yaw};
use greylag::physics::servos::{ActuatorFigures, Travel};
use greylag::physics::{Command, Controls};

const COMMON: &str = "name = \"Trainer\"
[geometry]
wing_area_m2 = { value = 0.55, source = \"here\" }
span_m = { value = 2.9, source = \"here\" }
mean_chord_m = { value = 0.19, source = \"here\" }
[envelope]
bank_max_deg = 45.0
pitch_max_deg = 20.0
pitch_min_deg = -20.0
load_factor_max = 2.0
airspeed_min_mps = 18.0
airspeed_max_mps = 40.0
airspeed_cruise_mps = 25.0
surface_slew_per_s = 20.0
";

const SURFACE: &str = "frequency_radps = { value = 50.0, source = \"s\" }
damping = { value = 0.7, source = \"s\" }
";

const REST: &str = "[controls.throttle]
lag_s = { value = 0.2, source = \"s\" }
[reference]
airspeed_mps = { value = 25.0, source = \"s\" }
altitude_m = { value = 100.0, source = \"s\" }
";

/// A surface that is named, with its travel.
fn surface(name: &str, travel: &str) -> String {
    format!("[controls.{name}]\n{SURFACE}{travel}\n")
}

fn both(name: &str) -> String {
    surface(name, "travel_rad = { value = 0.35, source = \"s\" }")
}

fn sides(name: &str, min: f64, max: f64) -> String {
    surface(
        name,
        &format!(
            "travel_min_rad = {{ value = {min:?}, source = \"s\" }}\ntravel_max_rad = {{ value = {max:?}, source = \"s\" }}"
        ),
    )
}

fn of(controls: &[String]) -> Result<Airframe, String> {
    Airframe::parse(&format!("schema = 2\n{COMMON}{}{REST}", controls.concat()))
}

#[test]
fn each_control_has_its_own_travel_and_a_rudder_is_there_if_it_is_described() {
    let with = of(&[both("aileron"), sides("elevator", -0.44, 0.26), both("rudder")]).unwrap();
    assert_eq!(with.yaw, Yaw::Stated);
    assert_eq!(with.actuators.aileron.travel, Travel::symmetric(0.35));
    assert_eq!(with.actuators.elevator.travel, Travel { least: -0.44, most: 0.26 });
    assert!(with.actuators.rudder.is_some());
    let without = of(&[both("aileron"), both("elevator")]).unwrap();
    assert_eq!((without.yaw, without.actuators.rudder), (Yaw::Stated, None));
}

#[test]
fn schema_1_is_still_read_and_says_nothing_of_a_rudder() {
    let text = format!(
        "schema = 1\n{COMMON}[actuators]
surface_frequency_radps = {{ value = 100.0, source = \"s\" }}
surface_damping = {{ value = 0.7, source = \"s\" }}
deflection_max_rad = {{ value = 0.4, source = \"s\" }}
throttle_lag_s = {{ value = 0.2, source = \"s\" }}
"
    );
    let airframe = Airframe::parse(&text).unwrap();
    assert_eq!(airframe.yaw, Yaw::Unstated);
    assert_eq!(airframe.actuators, ActuatorFigures::tustin(100.0, 0.7, 0.4, 0.2, 0.01));
    // the start of an episode in the paper, which programs before schema 2 had in their code
    assert_eq!((airframe.reference.airspeed, airframe.reference.altitude), (16.67, 600.0));
    let mixed = text.replacen("schema = 1", "schema = 2", 1);
    assert!(Airframe::parse(&mixed).unwrap_err().contains("[reference]"));
}

#[test]
fn what_no_surface_has_is_refused_by_name() {
    let refused = |elevator: String, words: &[&str]| {
        let why = of(&[both("aileron"), elevator]).unwrap_err();
        assert!(words.iter().all(|word| why.contains(word)), "{why}");
    };
    refused(sides("elevator", 0.1, 0.3), &["controls.elevator.travel_min_rad", "below zero"]);
    refused(sides("elevator", -0.1, 3.0), &["controls.elevator.travel_max_rad"]);
    refused(surface("elevator", ""), &["controls.elevator", "travel_rad", "travel_min_rad"]);
    refused(surface("flap", ""), &["flap"]);
}

#[test]
fn a_command_goes_to_the_stop_of_its_side_at_the_rate_of_its_servo() {
    let slow = surface("rudder", "travel_rad = { value = 0.3, source = \"s\" }")
        + "rate_max_radps = { value = 0.5, source = \"s\" }\n";
    let figures = of(&[both("aileron"), sides("elevator", -0.44, 0.26), slow]).unwrap().actuators;
    let settle = |command: &Command| {
        let mut actuators = Actuators::at_rest(&Controls::default());
        (0..200).for_each(|_| actuators.step(command, &figures));
        actuators.controls()
    };
    let up = settle(&Command { elevator: 0.5, rudder: 1.0, ..Command::IDLE });
    let down = settle(&Command { elevator: -0.5, rudder: -1.0, ..Command::IDLE });
    // half a command is half the travel of that side
    assert!((up.elevator - 0.13).abs() < 1e-9 && (down.elevator + 0.22).abs() < 1e-9);
    assert!((up.rudder - 0.3).abs() < 1e-9 && (down.rudder + 0.3).abs() < 1e-9);
    let mut actuators = Actuators::at_rest(&Controls::default());
    for k in 1..=40 {
        actuators.step(&Command { rudder: 1.0, ..Command::IDLE }, &figures);
        assert!(actuators.controls().rudder <= 0.005 * f64::from(k) + 1e-12, "0.5 rad/s");
    }
    // within what a filter of 50 rad/s is late
    assert!(actuators.controls().rudder > 0.005 * 40.0 - 0.03);
    // the command of a deflection is that which asks for it
    for deflection in [-0.3, -0.01, 0.2] {
        let controls = Controls { elevator: deflection, ..Controls::default() };
        let again = figures.controls(&figures.command(&controls));
        assert!((again.elevator - deflection).abs() < 1e-15);
    }
}

#[test]
fn an_envelope_is_open_where_it_says_so_and_refused_beyond() {
    let controls = [both("aileron"), both("elevator")].concat();
    let with = |field: &str, value: f64| {
        let line = COMMON.lines().find(|line| line.starts_with(field)).unwrap();
        let common = COMMON.replace(line, &format!("{field} = {value:?}"));
        Airframe::parse(&format!("schema = 2\n{common}{controls}{REST}"))
    };
    // The ends themselves are refused where the rule says "between", but for the largest load and rate.
    for (field, bad, good) in [
        ("bank_max_deg", [0.0, 90.0], [0.1, 89.9]),
        ("pitch_min_deg", [-90.0, 0.0], [-89.9, -0.1]),
        ("pitch_max_deg", [0.0, 90.0], [0.1, 89.9]),
        ("load_factor_max", [1.0, 20.1], [1.1, 20.0]),
        ("airspeed_min_mps", [0.0, 25.0], [0.1, 24.9]),
        ("airspeed_max_mps", [25.0, 1000.0], [25.1, 999.0]),
        ("surface_slew_per_s", [0.0, 200.1], [0.1, 200.0]),
    ] {
        for value in bad {
            let refused = with(field, value).unwrap_err();
            assert!(refused.contains(&format!("envelope.{field}")), "{value}: {refused}");
        }
        for value in good {
            assert!(with(field, value).is_ok(), "{field} {value}: {:?}", with(field, value).err());
        }
    }
    assert_eq!(with("airspeed_min_mps", 18.0).unwrap().envelope.flying_from_mps(), 9.0);
}
