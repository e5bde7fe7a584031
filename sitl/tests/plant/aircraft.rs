//! Tests of aircraft that can be loaded, and of the errors for aircraft that cannot.

use std::fs;
use std::path::{Path, PathBuf};

use crate::flights::{assert_same, differ, fly, plant};
use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Properties, Start, Travel};

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("aircraft")
}

/// A folder with the X8 under the name `twin`; `edit` changes its document.
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

/// The one-line error for an aircraft that cannot be loaded.
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
fn the_aileron_is_found_by_jsbsims_own_name() {
    let renamed = twin(|xml| xml.replace("fcs/effective-aileron-pos", "fcs/left-aileron-pos-rad"));
    let options = options(renamed.path(), "twin");
    let mut other = Plant::new(&options).unwrap();
    assert_same(&fly(&mut other, 0, 50), &fly(&mut plant(), 0, 50));
    // Hidden effects also use this property.
    let hidden = vec!["roll_control_alpha=1".parse().unwrap()];
    let mut other = Plant::new(&PlantOptions { hidden: hidden.clone(), ..options }).unwrap();
    let mut built_in = Plant::new(&PlantOptions { hidden, ..PlantOptions::default() }).unwrap();
    assert_same(&fly(&mut other, 0, 50), &fly(&mut built_in, 0, 50));
}

#[test]
fn a_property_the_plant_needs_and_the_aircraft_lacks_is_named() {
    let renamed = twin(|xml| xml.replace("fcs/effective-aileron-pos", "fcs/my-aileron"));
    let mut properties =
        Properties { aileron_position: "fcs/no-aileron".into(), ..Properties::default() };
    let wrong = PlantOptions { properties, ..options(renamed.path(), "twin") };
    let message = refusal(&wrong);
    for part in ["'fcs/no-aileron'", "'twin'", "--property"] {
        assert!(message.contains(part), "{message}");
    }
    properties = Properties { aileron_position: "fcs/my-aileron".into(), ..Properties::default() };
    let mut named = Plant::new(&PlantOptions { properties, ..wrong }).unwrap();
    assert_same(&fly(&mut named, 0, 50), &fly(&mut plant(), 0, 50));
}

/// Thrust, N, after full throttle for 5 s.
fn open_throttle(plant: &mut Plant) -> f64 {
    for _ in 0..500 {
        plant.step(Inputs { throttle: 1.0, ..Inputs::default() }).unwrap();
    }
    plant.truth().thrust_n
}

#[test]
fn every_engine_gets_the_throttle_and_its_thrust_counts() {
    let twin_engined = twin(|xml| {
        let (from, to) = (xml.find("<engine").unwrap(), xml.find("</propulsion>").unwrap());
        let engine = xml[from..to].to_owned();
        [&xml[..to], &engine, &xml[to..]].concat()
    });
    let mut two = Plant::new(&options(twin_engined.path(), "twin")).unwrap();
    let (one, both) = (open_throttle(&mut plant()), open_throttle(&mut two));
    // The second engine has no lag; the first has settled to exp(−25) of its range.
    assert!(one > 10.0 && (both / one - 2.0).abs() < 1e-6, "{one} N, {both} N");
}

/// The X8 with a turbine of 5 lbf and a tank with `fuel_lbs` of fuel.
fn with_turbine(fuel_lbs: f64) -> tempfile::TempDir {
    let tank = format!(
        r#"<tank type="FUEL"><location unit="M"><x>0</x><y>0</y><z>0</z></location>
           <capacity unit="LBS">1</capacity><contents unit="LBS">{fuel_lbs}</contents></tank>"#
    );
    let folder = twin(|xml| {
        xml.replace("file=\"x8_motor\">", "file=\"turbine\"><feed>0</feed>")
            .replace("</propulsion>", &format!("{tank}</propulsion>"))
    });
    let turbine = r#"<turbine_engine name="turbine">
        <milthrust unit="LBS">5</milthrust> <bypassratio>0</bypassratio> <tsfc>0.8</tsfc>
        <bleed>0</bleed> <idlen1>30</idlen1> <idlen2>60</idlen2> <maxn1>100</maxn1>
        <maxn2>100</maxn2> <augmented>0</augmented> <injected>0</injected>
        <function name="IdleThrust"><value>0.05</value></function>
        <function name="MilThrust"><value>1</value></function>
        </turbine_engine>"#;
    fs::write(folder.path().join("twin/Engines/turbine.xml"), turbine).unwrap();
    folder
}

#[test]
fn an_engine_that_stands_still_when_loaded_is_started() {
    let folder = with_turbine(1.0);
    let mut plant = Plant::new(&options(folder.path(), "twin")).unwrap();
    assert_eq!(plant.property("propulsion/engine/set-running").unwrap(), 1.0);
    // The expected thrust is 5 lbf, 22.2 N; without a start, there would be no thrust.
    let thrust = open_throttle(&mut plant);
    assert!((thrust - 22.2).abs() < 1.0, "{thrust} N");
}

#[test]
fn an_aircraft_without_a_throttle_flies_as_a_glider_and_says_so() {
    let glider = twin(|xml| {
        let (from, to) = (xml.find("<propulsion>").unwrap(), xml.find("</propulsion>").unwrap());
        let xml = [&xml[..from], &xml[to + "</propulsion>".len()..]].concat();
        let channel = xml.find("<channel name=\"throttle\">").unwrap();
        let end = channel + xml[channel..].find("</channel>").unwrap() + "</channel>".len();
        [&xml[..channel], &xml[end..]].concat()
    });
    let mut plant = Plant::new(&options(glider.path(), "twin")).unwrap();
    let notes = plant.notes();
    assert!(notes.len() == 1 && notes[0].contains("glider"), "{notes:?}");
    assert_eq!(open_throttle(&mut plant), 0.0);
    assert!(self::plant().notes().is_empty());
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

#[test]
fn the_travel_is_measured_on_the_aircraft_and_leaves_it_where_it_was() {
    let mut plant = plant();
    let before = fly(&mut plant, 0, 50);
    assert_eq!(plant.travel().unwrap(), Travel::X8);
    let mut undisturbed = self::plant();
    assert_same(&before, &fly(&mut undisturbed, 0, 50));
    assert_same(&fly(&mut plant, 50, 50), &fly(&mut undisturbed, 50, 50));
    // The two surfaces get different travels, 15° and 25°.
    let other = twin(|xml| {
        let mut parts = xml.splitn(3, "0.5235 </gain>");
        let mut next = || parts.next().unwrap();
        [next(), "0.2618 </gain>", next(), "0.4363 </gain>", next()].concat()
    });
    let travel = Plant::new(&options(other.path(), "twin")).unwrap().travel().unwrap();
    // The filter comes to rest within rounding of its input.
    assert!((travel.aileron.most_rad - 0.2618).abs() < 1e-9, "{travel:?}");
    assert!((travel.elevator.most_rad - 0.4363).abs() < 1e-9, "{travel:?}");
}

#[test]
fn a_surface_that_does_not_follow_its_command_has_no_travel() {
    let fixed = twin(|xml| xml.replacen("<gain> 0.5235", "<gain> 0", 1));
    let mut plant = Plant::new(&options(fixed.path(), "twin")).unwrap();
    let message = plant.travel().unwrap_err().to_string();
    assert!(message.contains("fcs/effective-aileron-pos"), "{message}");
}

/// Flaps that need 3 s to extend are extended at the start of a flight, because a held property is a setting, not a movement.
#[test]
fn what_is_held_has_reached_its_position_at_the_start() {
    const FLAPS: &str = "<channel name=\"flaps\"><kinematic name=\"fcs/flaps\"><input>fcs/flap-cmd-norm</input>\
        <traverse><setting><position>0</position><time>0</time></setting>\
        <setting><position>1</position><time>3</time></setting></traverse>\
        <output>fcs/flap-pos-norm</output></kinematic></channel></flight_control>";
    const LIFT: &str = "<axis name=\"LIFT\"><function name=\"aero/flaps\"><product><property>aero/qbar-psf</property>\
        <property>metrics/Sw-sqft</property><value>0.3</value><property>fcs/flap-pos-norm</property></product></function>";
    let flapped =
        twin(|xml| xml.replace("</flight_control>", FLAPS).replace("<axis name=\"LIFT\">", LIFT));
    let held = |setting: f64| PlantOptions {
        held: vec![("fcs/flap-cmd-norm".to_owned(), setting)],
        ..options(flapped.path(), "twin")
    };
    let [up, down] = [0.0, 1.0].map(|setting| {
        let mut plant = Plant::new(&held(setting)).unwrap();
        assert_eq!(plant.property("fcs/flap-pos-norm").unwrap(), setting);
        assert_eq!(plant.truth().time_s, 0.0);
        plant.loads(&Start::NEUTRAL, &Inputs::default()).unwrap().force_n[2]
    });
    // The expected difference is 0.3 q S, with q S = 0.5 · 1.156 kg/m³ · (16.67 m/s)² · 0.75 m².
    assert!((up - down - 0.3 * 120.5).abs() < 1.0, "{up} {down} N");
}
