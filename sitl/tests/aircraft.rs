//! Which aircraft can be flown, and what is said of one that cannot.

mod flights;

use std::fs;
use std::path::{Path, PathBuf};

use flights::{assert_same, differ, fly, plant};
use greylag_sitl::plant::{Plant, PlantOptions, Properties};

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("aircraft")
}

/// A folder with the X8 under the name `twin`, its document changed by `edit`.
fn twin(edit: impl Fn(String) -> String) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (from, to) = (shipped().join("x8"), folder.path().join("twin"));
    fs::create_dir_all(to.join("Engines")).unwrap();
    for engine in ["x8_motor.xml", "x8_direct.xml"] {
        fs::copy(from.join("Engines").join(engine), to.join("Engines").join(engine)).unwrap();
    }
    let document = fs::read_to_string(from.join("x8.xml")).unwrap();
    fs::write(to.join("twin.xml"), edit(document)).unwrap();
    folder
}

fn options(folder: &Path, aircraft: &str) -> PlantOptions {
    PlantOptions {
        aircraft_dir: Some(folder.to_owned()),
        aircraft: aircraft.to_owned(),
        ..PlantOptions::default()
    }
}

/// What is said of an aircraft that cannot be flown: one line.
fn refusal(options: &PlantOptions) -> String {
    let message = Plant::new(options).err().expect("this aircraft cannot be flown").to_string();
    println!("{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    message
}

#[test]
fn an_aircraft_in_a_folder_flies_as_the_built_in_one() {
    let folder = twin(|xml| xml);
    let mut other = Plant::new(&options(folder.path(), "twin")).unwrap();
    assert_same(&fly(&mut other, 0, 200), &fly(&mut plant(), 0, 200));
}

#[test]
fn another_aircraft_with_the_same_properties_flies_its_own_way() {
    let heavy = twin(|xml| xml.replace("7.4163504999", "9.5"));
    let mut other = Plant::new(&options(heavy.path(), "twin")).unwrap();
    assert!(differ(&fly(&mut other, 0, 200), &fly(&mut plant(), 0, 200)));
}

#[test]
fn hidden_effects_are_written_into_an_aircraft_in_a_folder_too() {
    let folder = twin(|xml| xml);
    let hidden = vec!["pitch_break=-2".parse().unwrap(), "propwash=0.5".parse().unwrap()];
    let mut other =
        Plant::new(&PlantOptions { hidden: hidden.clone(), ..options(folder.path(), "twin") })
            .unwrap();
    let mut built_in = Plant::new(&PlantOptions { hidden, ..PlantOptions::default() }).unwrap();
    assert_same(&fly(&mut other, 0, 200), &fly(&mut built_in, 0, 200));
}

#[test]
fn engines_are_found_beside_the_aircraft_folder_as_in_a_jsbsim_tree() {
    let tree = tempfile::tempdir().unwrap();
    let (aircraft, engine) = (tree.path().join("aircraft/x8"), tree.path().join("engine"));
    fs::create_dir_all(&aircraft).unwrap();
    fs::create_dir_all(&engine).unwrap();
    fs::copy(shipped().join("x8/x8.xml"), aircraft.join("x8.xml")).unwrap();
    for name in ["x8_motor.xml", "x8_direct.xml"] {
        fs::copy(shipped().join("x8/Engines").join(name), engine.join(name)).unwrap();
    }
    let mut other = Plant::new(&options(&tree.path().join("aircraft"), "x8")).unwrap();
    assert_same(&fly(&mut other, 0, 50), &fly(&mut plant(), 0, 50));
}

#[test]
fn a_wrong_name_or_folder_is_one_clear_line() {
    let unknown = refusal(&PlantOptions { aircraft: "x9".into(), ..PlantOptions::default() });
    assert!(unknown.contains("'x9'") && unknown.contains("--aircraft-dir"), "{unknown}");
    let name = refusal(&options(&shipped(), "x9"));
    assert!(name.contains("x9.xml") && name.contains("--aircraft"), "{name}");
    let folder = refusal(&options(Path::new("no/such/folder"), "x8"));
    assert!(folder.contains("no/such/folder"), "{folder}");
}

#[test]
fn a_broken_aircraft_is_one_clear_line() {
    let cut = twin(|xml| xml[..xml.len() / 2].to_owned());
    assert!(refusal(&options(cut.path(), "twin")).contains("'twin'"));
    let engine = twin(|xml| xml.replace("x8_motor", "lost_motor"));
    assert!(refusal(&options(engine.path(), "twin")).contains("lost_motor"));
    let property = twin(|xml| xml.replace("aero/qbar-psf", "aero/no-such-property"));
    assert!(refusal(&options(property.path(), "twin")).contains("no-such-property"));
    let axis = twin(|xml| xml.replace("axis name=\"PITCH\"", "axis name=\"YAW\""));
    let hidden = vec!["pitch_break=1".parse().unwrap()];
    let message = refusal(&PlantOptions { hidden, ..options(axis.path(), "twin") });
    assert!(message.contains("PITCH"), "{message}");
}

#[test]
fn a_property_the_plant_needs_and_the_aircraft_lacks_is_named() {
    let renamed = twin(|xml| xml.replace("fcs/effective-aileron-pos", "fcs/my-aileron"));
    let message = refusal(&options(renamed.path(), "twin"));
    assert!(
        message.contains("'fcs/effective-aileron-pos'") && message.contains("'twin'"),
        "{message}"
    );
    let properties =
        Properties { aileron_position: "fcs/my-aileron".into(), ..Properties::default() };
    let mut named =
        Plant::new(&PlantOptions { properties, ..options(renamed.path(), "twin") }).unwrap();
    assert_same(&fly(&mut named, 0, 50), &fly(&mut plant(), 0, 50));
}

#[test]
fn a_plant_can_be_sent_to_another_thread() {
    let mut plant = plant();
    let there = std::thread::spawn(move || fly(&mut plant, 0, 50)).join().unwrap();
    assert_same(&there, &fly(&mut self::plant(), 0, 50));
}

#[test]
fn a_snapshot_of_another_aircraft_is_refused() {
    let heavy = twin(|xml| xml.replace("7.4163504999", "9.5"));
    let mut other = Plant::new(&options(heavy.path(), "twin")).unwrap();
    let snapshot = other.snapshot().unwrap();
    let mut plant = plant();
    let before = plant.truth();
    assert!(plant.restore(&snapshot).unwrap_err().to_string().contains("restoring a snapshot"));
    assert_eq!(plant.truth(), before);
}
