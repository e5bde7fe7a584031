//! Aircraft from JSBSim and to it: an import has the coefficients, an export flies as its model says.

use std::path::Path;

use greylag::control::{self, ControllerKind, Target};
use greylag::model::GreyBox;
use greylag::model::jsbsim::export;
use greylag::model::textbook::{Measures, Tail};
use greylag::physics::Command;
use greylag::physics::formula::register;
use greylag::sim::Simulator;
use greylag::sim::import::{Imported, import};
use greylag::sim::missing::Missing;
use greylag::sim::one_step::{Flight, errors};
use greylag_sitl::hidden::Hidden;
use greylag_sitl::plant::{Plant, PlantOptions, Start};

fn shipped(path: &str) -> GreyBox {
    GreyBox::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
}

fn options(aircraft: &str) -> PlantOptions {
    let start = Start { airspeed_mps: 25.0, ..Start::NEUTRAL };
    PlantOptions { aircraft: aircraft.into(), start, ..PlantOptions::default() }
}

/// The model that an import wrote.
fn loaded(found: &Imported) -> GreyBox {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("airframe.toml"), &found.airframe).unwrap();
    std::fs::write(folder.path().join("model.toml"), &found.model).unwrap();
    GreyBox::load(&folder.path().join("model.toml")).unwrap()
}

/// The rms of each state's rate beside that of `model` over 10 s, in x_c a second.
fn apart(model: &GreyBox, simulator: &mut Simulator) -> [f64; 8] {
    let target = Target { roll: 0.3, pitch: 0.05, airspeed: 25.0 };
    let amplitude = Command { aileron: 0.1, elevator: 0.1, throttle: 0.1, rudder: 0.1 };
    let flight = Flight { steps: 1000, moved: 1000, amplitude };
    let rms = errors(model, simulator, &flight, |_| target).unwrap().rms;
    println!("{rms:?}");
    rms
}

fn largest(rms: [f64; 8]) -> f64 {
    rms.into_iter().fold(0.0, f64::max)
}

#[test]
fn an_import_has_the_coefficients_of_the_aircraft() {
    let mut plant = Plant::new(&options("aerosonde")).unwrap();
    let found = import(&mut plant, "aerosonde", 25.0, 600.0).unwrap();
    println!("{:#?}", found.left_out);
    let model = loaded(&found);
    let truth = shipped("params/aerosonde/jsbsim.toml");
    for c in truth.coefficients() {
        let ours = model.coefficients().iter().find(|x| x.name == c.name);
        let Some(ours) = ours else { continue };
        // five decimals are written
        assert!((ours.value - c.value).abs() < 0.002 * c.value.abs() + 2e-5, "{ours:?} for {c:?}");
    }
    let [ours, theirs] = [&model, &truth].map(|model| model.thrust_grid().unwrap());
    // a point of both grids, N
    assert!((ours.at(0.5, 25.0) - theirs.at(0.5, 25.0)).abs() < 1e-3);
    let (ours, theirs) = (model.airframe.actuators.travels(), truth.airframe.actuators.travels());
    assert!((ours.elevator.least - theirs.elevator.least).abs() < 1e-5, "{ours:?}");
    assert!(ours.rudder.is_some());
    // 1 % of x_c a second is asked for
    assert!(largest(apart(&model, &mut Simulator::new(&options("aerosonde")).unwrap())) < 0.01);
}

#[test]
fn a_pitching_moment_that_bends_over_incidence_is_imported_as_a_table_and_exported() {
    let hidden = vec![Hidden::new("pitch_break", -5.0).unwrap()];
    let bent = PlantOptions { hidden, ..options("aerosonde") };
    let mut plant = Plant::new(&bent).unwrap();
    let found = import(&mut plant, "bent", 25.0, 600.0).unwrap();
    let model = loaded(&found);
    assert!(model.has("pitch_table"));
    let with = apart(&model, &mut Simulator::new(&bent).unwrap());
    assert!(largest(with) < 0.01);
    let mut straight = model.clone();
    assert!(straight.set_coefficient("pitch_table.k", 0.0));
    let without = apart(&straight, &mut Simulator::new(&bent).unwrap());
    let pitch = |rms: [f64; 8]| rms[4];
    assert!(pitch(with) < 0.1 * pitch(without));
    let exported = export(&model, "bent");
    assert_eq!(exported.left_out, Vec::<String>::new());
    let (_, document) = &exported.files[0];
    let axis = document.split("axis name=\"PITCH\"").nth(1).unwrap();
    assert!(axis.split("</axis>").next().unwrap().contains("<table>"));
}

#[test]
fn thrust_that_lags_is_imported_with_its_time_constant() {
    let hidden = vec![Hidden::new("thrust_lag", 0.5).unwrap()];
    let lagging = PlantOptions { hidden, ..options("x8") };
    let mut plant = Plant::new(&lagging).unwrap();
    let found = import(&mut plant, "late", 18.0, 600.0).unwrap();
    let model = loaded(&found);
    let lag = model.coefficients().iter().find(|c| c.name == "thrust_lag.tau_s").unwrap();
    // between throttle and thrust lies a frame of the simulator
    assert!((lag.value - 0.5).abs() < 0.03, "{lag:?}");
}

/// The coefficient `name` of `aircraft` with `hidden`, as an import at `cruise` has it, with that import.
fn imported(aircraft: &str, cruise: f64, hidden: Hidden, name: &str) -> (f64, GreyBox) {
    let mut plant =
        Plant::new(&PlantOptions { hidden: vec![hidden], ..options(aircraft) }).unwrap();
    let model = loaded(&import(&mut plant, aircraft, cruise, 600.0).unwrap());
    let found = model.coefficients().iter().find(|c| c.name == name);
    println!("{found:?}");
    (found.unwrap_or_else(|| panic!("no {name}")).value, model)
}

#[test]
fn what_goes_with_the_rate_of_incidence_is_imported_apart_from_the_pitch_rate() {
    let truth = shipped("params/aerosonde/jsbsim.toml");
    let of = |model: &GreyBox, name: &str| {
        model.coefficients().iter().find(|c| c.name == name).unwrap().value
    };
    let hidden = Hidden::new("unsteady_lift", 3.0).unwrap();
    let (lift, model) = imported("aerosonde", 25.0, hidden, "unsteady_lift.CLalphadot");
    assert!((lift - 3.0).abs() < 0.03);
    // the hidden effect pitches by half of what it lifts, against it
    assert!((of(&model, "unsteady_lift.Cmalphadot") + 1.5).abs() < 0.015);
    for name in ["pitch_linear.Cmq", "pitch_linear.Cmalpha", "lift_linear.CLq"] {
        let (ours, theirs) = (of(&model, name), of(&truth, name));
        assert!((ours - theirs).abs() < 0.005 * theirs.abs() + 1e-3, "{name}: {ours} for {theirs}");
    }
}

/// The slipstream is hidden as a function of JSBSim's own thrust, which the import does not read.
#[test]
fn an_elevator_in_the_slipstream_is_imported_with_its_share_of_the_thrust() {
    let effect = register::find("tail_slipstream").unwrap();
    let hidden = Missing::written(effect, &[-0.8, 0.0]).unwrap().hidden.unwrap();
    let (by_thrust, model) = imported("x8", 18.0, hidden, "tail_slipstream.Cmde_T");
    assert!((by_thrust + 0.8).abs() < 0.02);
    let truth = shipped("params/x8/jsbsim.toml");
    let of = |model: &GreyBox| {
        model.coefficients().iter().find(|c| c.name == "pitch_linear.Cmde").unwrap().value
    };
    assert!((of(&model) - of(&truth)).abs() < 0.01 * of(&truth).abs());
    assert!(!model.has("unsteady_lift") && !model.has("p_factor"));
}

#[test]
fn an_export_flies_as_its_model_says() {
    for (path, own) in
        [("params/aerosonde/jsbsim.toml", "gander"), ("params/x8/jsbsim.toml", "wing")]
    {
        let model = shipped(path);
        let folder = tempfile::tempdir().unwrap();
        let exported = export(&model, own);
        assert_eq!(exported.left_out, Vec::<String>::new());
        std::fs::create_dir_all(folder.path().join(own).join("Engines")).unwrap();
        for (file, text) in &exported.files {
            std::fs::write(folder.path().join(own).join(file), text).unwrap();
        }
        let aircraft_dir = Some(folder.path().to_owned());
        let mut simulator = Simulator::new(&PlantOptions { aircraft_dir, ..options(own) }).unwrap();
        // rounding of units, of gravity and of the density: 5 parts in a million
        assert!(largest(apart(&model, &mut simulator)) < 1e-4);
    }
}

#[test]
fn what_an_export_cannot_hold_is_named() {
    let mut model = shipped("params/x8/jsbsim.toml");
    model.join("dihedral_alpha", &[0.5]).unwrap();
    assert_eq!(export(&model, "wing").left_out, ["dihedral_alpha"]);
}

/// From 0.8 to 25 kg, with tail and without: what the textbook gives can be flown by its LQI as it is written.
#[test]
fn an_aircraft_from_its_measures_has_an_lqi_over_its_whole_envelope() {
    let small = Measures {
        name: "small".into(),
        mass: 2.4,
        span: 1.8,
        area: 0.45,
        tail: Tail::Conventional,
        rudder: Some(0.43),
        travel: 0.43,
        static_thrust: 12.0,
        pitch_speed: 30.0,
    };
    let light = Measures {
        mass: 0.8,
        span: 1.2,
        area: 0.25,
        static_thrust: 4.0,
        pitch_speed: 22.0,
        ..small.clone()
    };
    let heavy = Measures {
        mass: 25.0,
        span: 4.0,
        area: 1.6,
        static_thrust: 120.0,
        pitch_speed: 50.0,
        ..small.clone()
    };
    let wing = Measures { tail: Tail::FlyingWing, rudder: None, ..small.clone() };
    for measures in [small, light, heavy, wing] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("airframe.toml"), measures.airframe()).unwrap();
        std::fs::write(folder.path().join("model.toml"), measures.model()).unwrap();
        let model = GreyBox::load(&folder.path().join("model.toml")).unwrap();
        control::build(ControllerKind::Lqi, &model)
            .unwrap_or_else(|why| panic!("{measures:?}: {why}"));
    }
}
