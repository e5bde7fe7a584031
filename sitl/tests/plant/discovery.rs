//! Tests that commands and surfaces of an aircraft are found by trying all candidates.

use std::path::Path;

use greylag_sitl::plant::discovery::{discover, steered};
use greylag_sitl::plant::{Inputs, PlantOptions, Properties, Start};

/// An aircraft with unusual property names; tests may change its XML.
fn lab() -> PlantOptions {
    PlantOptions {
        aircraft_dir: Some(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data")),
        aircraft: "lab".into(),
        ..PlantOptions::default()
    }
}

#[test]
fn surfaces_behind_actuators_with_names_of_their_own_are_found_and_steer() {
    let (mut plant, found) = steered(&lab()).unwrap();
    let found = found.unwrap();
    println!("{:?} {:?}", found.properties, found.notes);
    let named = found.properties;
    // the two ailerons with opposite signs; the flaps also roll the aircraft but must not be selected
    assert!(named.aileron_command.contains("cmdAilL") && named.aileron_command.contains("cmdAilR"));
    assert!(named.elevator_command.contains("cmdElev_ext_rad"));
    assert!(named.rudder_position.contains("posRud_rad"));
    let travel = plant.travel().unwrap();
    for stops in [travel.aileron, travel.elevator, travel.rudder.unwrap()] {
        // the travel of the actuators, within their hysteresis
        assert!(
            (stops.most_rad - 0.5).abs() < 0.02 && (stops.least_rad + 0.5).abs() < 0.02,
            "{stops:?}"
        );
    }
    let start = Start { airspeed_mps: 15.0, ..Start::NEUTRAL };
    let mut moments = |inputs: Inputs| plant.loads(&start, &inputs).unwrap().moment_nm;
    let none = moments(Inputs::default());
    let roll = moments(Inputs { aileron: 0.5, ..Inputs::default() });
    let pitch = moments(Inputs { elevator: 0.5, ..Inputs::default() });
    let yaw = moments(Inputs { rudder: 0.5, ..Inputs::default() });
    assert!(roll[0] - none[0] > 0.5 && (roll[1] - none[1]).abs() < 0.01, "{none:?} {roll:?}");
    assert!(pitch[1] - none[1] < -0.5, "{pitch:?}");
    assert!(yaw[2] - none[2] < -0.1, "{yaw:?}");
}

#[test]
fn names_that_are_given_are_not_replaced() {
    let properties = Properties { elevator_position: "fcs/none".into(), ..Properties::default() };
    let refused = steered(&PlantOptions { properties, ..lab() }).err().unwrap().to_string();
    assert!(refused.contains("no property"), "{refused}");
}

/// The error for an aircraft that cannot be steered names the axis and the commands that were tried.
#[test]
fn an_aircraft_without_an_elevator_is_told_what_was_tried() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("lab");
    std::fs::create_dir_all(&to).unwrap();
    for name in ["lab.xml", "FlightControl.xml", "Effectors.xml", "Sensors.xml"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/lab").join(name);
        let text = std::fs::read_to_string(from).unwrap();
        let text = text.replace("<value>-1.1</value>", "<value>0</value>");
        std::fs::write(
            to.join(name),
            text.replace(
                "<value>-0.05</value><property>fcs/posAil",
                "<value>0</value><property>fcs/posAil",
            ),
        )
        .unwrap();
    }
    let options = PlantOptions { aircraft_dir: Some(folder.path().to_owned()), ..lab() };
    let said = discover(&options).unwrap_err().to_string();
    assert!(said.contains("pitches") && said.contains("fcs/cmdAilL_ext_rad rolls"), "{said}");
    assert_eq!(said.lines().count(), 1);
}

/// The error for a property that only another program defines names the property. With the property held, the aircraft flies.
#[test]
fn a_property_of_another_program_is_named_and_can_be_given() {
    let folder = tempfile::tempdir().unwrap();
    let to = folder.path().join("lab");
    std::fs::create_dir_all(&to).unwrap();
    for name in ["lab.xml", "FlightControl.xml", "Effectors.xml", "Sensors.xml"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/lab").join(name);
        let text = std::fs::read_to_string(from).unwrap();
        std::fs::write(
            to.join(name),
            text.replace("velocities/q-rad_sec", "/sim/model/pushback/position-norm"),
        )
        .unwrap();
    }
    let options = PlantOptions { aircraft_dir: Some(folder.path().to_owned()), ..lab() };
    let said = steered(&options).err().unwrap().to_string();
    println!("{said}");
    let cure = said.split("--set ").nth(1).and_then(|rest| rest.split('=').next()).unwrap();
    let held = vec![(cure.to_owned(), 0.0)];
    steered(&PlantOptions { held, ..options }).unwrap();
}
