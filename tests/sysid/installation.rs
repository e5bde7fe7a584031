//! An instrument that is installed or calibrated wrong is named as that, and no effect of the aircraft in its stead.

use std::path::Path;

use crate::diagnosis_support;
use greylag::control::{self, ControllerKind};
use greylag::logs::Flight;
use greylag::manoeuvres::flights;
use greylag::model::GreyBox;
use greylag::num::stream::stream;
use greylag::sim::flight_test::fly_within_bounds;
use greylag::sim::installation::Installation;
use greylag::sim::instruments::Instruments;
use greylag::sysid::diagnose::{Detail, Diagnosis, Options, diagnose};
use greylag::sysid::flight_path::installation::{Prior, share};
use greylag::sysid::flight_path::reconstruction::{Nuisance, Reconstruction};
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag::sysid::progress::ignore_progress;
use greylag_sitl::hidden::Hidden;
use greylag_sitl::plant::PlantOptions;
use rand_distr::{Distribution, StandardNormal};

/// Half of a flight, s: enough for what shows in every manoeuvre.
const HALF_S: f64 = 25.0;

fn exact() -> GreyBox {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    GreyBox::load(&path).unwrap()
}

/// The reference model with every coefficient wrong by 15 % (standard deviation).
fn wrong(seed: u64) -> GreyBox {
    let mut model = exact();
    let mut random = stream(seed, &[1]);
    let mut off = |value: f64| {
        let unit: f64 = StandardNormal.sample(&mut random);
        value * (1.0 + 0.15 * unit.clamp(-2.0, 2.0))
    };
    let values: Vec<f64> = model.coefficients().iter().map(|c| off(c.value)).collect();
    model.set_coefficients(&values);
    model
}

/// The first `seconds` of two flights of 50 s of an aircraft with `hidden`, logged by instruments that are noisy and
/// `installed` so.
fn flown(
    seed: u64,
    hidden: &[(&str, f64)],
    installed: &Installation,
    seconds: f64,
) -> Vec<Reconstruction> {
    logged(seed, hidden, installed, seconds).iter().map(|log| rebuilt(log, &[])).collect()
}

/// The logs of these flights.
fn logged(
    seed: u64,
    hidden: &[(&str, f64)],
    installed: &Installation,
    seconds: f64,
) -> Vec<Flight> {
    let lqi = control::build(ControllerKind::Lqi, &exact()).unwrap();
    let hidden: Vec<Hidden> =
        hidden.iter().map(|(id, amount)| Hidden::new(id, *amount).unwrap()).collect();
    let [pitch, _, all] = flights::training(seed);
    let one = |(k, schedule): (usize, greylag::manoeuvres::Schedule)| {
        let plant = PlantOptions { hidden: hidden.clone(), ..PlantOptions::default() };
        let flown = fly_within_bounds(&plant, &*lqi, &schedule).unwrap();
        let own = 10 * seed + k as u64;
        let mut log = Instruments::drawn(own).log(&flown, &schedule.name, own);
        installed.apply(&mut log);
        log.samples.retain(|s| s.time_s < seconds);
        log
    };
    [pitch, all].into_iter().enumerate().map(one).collect()
}

/// The flight of `log`, reconstructed with `priors` of the installation.
fn rebuilt(log: &Flight, priors: &[Prior]) -> Reconstruction {
    let options = flight_path::Options {
        gravity: 9.806,
        actuators_clock: ActuatorClock::AsRecorded,
        ..flight_path::Options::new(&log.name, exact().airframe.actuators)
    };
    reconstruct(log, &options.expecting(priors)).unwrap()
}

fn asked(seed: u64, hidden: &[(&str, f64)], installed: &Installation) -> Diagnosis {
    asked_of(seed, &flown(seed, hidden, installed, f64::INFINITY))
}

fn asked_of(seed: u64, flights: &[Reconstruction]) -> Diagnosis {
    let options = Options { detail: Detail::Lean, ..Options::default() };
    for n in flights.iter().flat_map(|f| &f.nuisances) {
        println!("{} {:.4} ± {:.4}", n.name, n.value, n.sd);
    }
    let found = diagnose(&wrong(seed), flights, &options, &ignore_progress).unwrap();
    println!("{:?} {:#?} {:#?}", found.verdict, found.sentences, found.notes);
    diagnosis_support::agree(&found);
    found
}

/// The error `name` of the kind `id` is asserted in the flights that excite it, `least` of the two; its value there is
/// `truth` within `within` or within its own 95 % interval; a sentence names it, and no effect of the aircraft is asserted.
fn named(found: &Diagnosis, [id, name]: [&str; 2], [truth, within]: [f64; 2], least: usize) {
    let asserted: Vec<&str> =
        found.effects.iter().filter(|c| c.asserted).map(|c| c.id.as_str()).collect();
    assert!(asserted.is_empty(), "asserts {asserted:?}");
    let of: Vec<_> = found.measurement.iter().filter(|m| m.name == name && m.asserted).collect();
    assert!(of.len() >= least, "{name} in {} flights", of.len());
    for m in of {
        assert_eq!(m.id, id, "{m:?}");
        let off = (m.value - truth).abs();
        assert!(off < within.max(1.96 * m.sd), "{} {} for {truth}", m.flight, m.value);
        assert!(3.0 * off < truth.abs(), "{} {} for {truth}", m.flight, m.value);
    }
    assert!(found.sentences.iter().any(|s| s.contains(id)), "{:?}", found.sentences);
}

#[test]
fn a_vane_that_turns_too_far_is_no_induced_drag() {
    let installed = Installation { vane_gain: [0.1, 0.0], ..Installation::TRUE };
    let flights = flown(4, &[], &installed, HALF_S);
    named(&asked_of(4, &flights), ["vane_gain", "alpha_gain"], [0.1, 0.02], 1);
}

/// The estimate of the gain of the angle-of-attack vane; `None` if the flight was reconstructed without it.
fn gain(flight: &Reconstruction) -> Option<&Nuisance> {
    flight.nuisances.iter().find(|n| n.name == "alpha_gain")
}

#[test]
fn a_vanes_gain_that_one_flight_shows_is_taken_out_of_the_other_one() {
    let installed = Installation { vane_gain: [0.1, 0.0], ..Installation::TRUE };
    let mut logs = logged(4, &[], &installed, HALF_S);
    // with noise of 0.06 rad, twelve times the usual one, the second flight knows the gain to some 3 % and does not show it
    let mut random = stream(4, &[2]);
    for sample in &mut logs[1].samples {
        let unit: f64 = StandardNormal.sample(&mut random);
        sample.alpha_rad += 0.06 * unit;
    }
    let mut flights: Vec<Reconstruction> = logs.iter().map(|log| rebuilt(log, &[])).collect();
    println!("{:?}", flights.iter().map(|f| &f.installation).collect::<Vec<_>>());
    let alone = gain(&flights[0]).unwrap().clone();
    assert!(gain(&flights[1]).is_none());
    let again = |k: usize, priors: &[Prior]| Ok::<_, ()>(rebuilt(&logs[k], priors));
    let shared = share(&mut flights, again).unwrap();
    for flight in &flights {
        let found = gain(flight).unwrap();
        println!("{} {} ± {}", flight.name, found.value, found.sd);
        assert!((found.value - 0.1).abs() < 0.02_f64.max(3.0 * found.sd), "{found:?}");
        // the Birge ratio of two estimates that differ by three standard deviations would be three
        assert!((found.value - alone.value).abs() < 3.0 * alone.sd && found.sd < 3.0 * alone.sd);
    }
    let said = shared.sentences(&["a", "b"]);
    assert!(said[0].starts_with("The angle-of-attack vane reads "), "{said:?}");
    assert!(said[0].contains("too much, as a shows"), "{said:?}");
}

#[test]
fn a_gyro_that_shows_too_much_is_no_effect() {
    let installed = Installation { gyro_gain: [0.05, 0.0, 0.0], ..Installation::TRUE };
    named(&asked(5, &[], &installed), ["imu_gain", "gyro_gain_p"], [0.05, 0.01], 1);
}

#[test]
fn a_pitot_that_lags_is_late() {
    let installed = Installation { airspeed_lag: 0.15, ..Installation::TRUE };
    let flights = flown(6, &[], &installed, HALF_S);
    named(&asked_of(6, &flights), ["clock_skew", "skew_airspeed"], [0.15, 0.03], 2);
}

#[test]
fn a_board_that_stands_askew_is_no_product_of_inertia() {
    let pitched = 3.0_f64.to_radians();
    let installed = Installation { tilt: [0.0, pitched, 0.0], ..Installation::TRUE };
    let flights = flown(7, &[], &installed, HALF_S);
    named(&asked_of(7, &flights), ["axes_askew", "askew_pitch"], [pitched, 0.01], 2);
}

/// Without its roll against the vanes, α and β lay between the axes of the board and those of the body, by which no model flies.
#[test]
fn a_board_that_is_rolled_contradicts_the_vanes_and_is_misaligned() {
    let rolled = 2.0_f64.to_radians();
    let installed = Installation { tilt: [rolled, 0.0, 0.0], ..Installation::TRUE };
    let logs = logged(11, &[], &installed, f64::INFINITY);
    let mut flights: Vec<Reconstruction> = logs.iter().map(|log| rebuilt(log, &[])).collect();
    let again = |k: usize, priors: &[Prior]| Ok::<_, ()>(rebuilt(&logs[k], priors));
    share(&mut flights, again).unwrap();
    for flight in &flights {
        let found = flight.nuisances.iter().find(|n| n.name == "board_roll").unwrap();
        assert!((found.value - rolled).abs() < 3.0 * found.sd, "{found:?}");
    }
    let found = asked_of(11, &flights);
    named(&found, ["axes_askew", "askew_roll"], [rolled, 0.01], 2);
}

#[test]
fn instruments_without_errors_of_installation_have_none_said() {
    for seed in [8, 9] {
        let found = asked(seed, &[], &Installation::TRUE);
        for m in &found.measurement {
            let seldom = [
                "vane_gain",
                "vanes_askew",
                "imu_gain",
                "airspeed_offset",
                "heading_offset",
                "axes_askew",
            ];
            assert!(!seldom.contains(&m.id.as_str()), "{m:?}");
        }
        assert!(found.effects.iter().all(|c| !c.asserted));
    }
}

/// Both at once: the gain is taken out, the drag is found beside it.
#[test]
fn an_effect_of_the_aircraft_is_found_beside_an_instruments_error() {
    let installed = Installation { gyro_gain: [0.05, 0.0, 0.0], ..Installation::TRUE };
    let found = asked(10, &[("drag_alpha2", 0.6)], &installed);
    let first = &found.effects[0];
    assert!(first.asserted && first.id == "drag_alpha2", "{}", first.id);
    assert!(found.measurement.iter().any(|m| m.asserted && m.name == "gyro_gain_p"));
}
