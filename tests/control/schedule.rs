//! Flight-test schedules: files, manoeuvres, whole flights in JSBSim with effects hidden, logs.

use std::path::Path;

use greylag::control::{self, Controller, ControllerKind};
use greylag::manoeuvres::{Axis, Excitation, Schedule, Shape, Step, flights, menu};
use greylag::model::GreyBox;
use greylag::physics::Command;
use greylag::sim::flight_test::{FlightTestError, Flown, fly};
use greylag::sim::instruments::{Group, Instruments};
use greylag::sim::missing::Craft;
use greylag::sim::missing::{KINDS, Missing, SERVOS};
use greylag::sim::trial::Trial;
use greylag_sitl::plant::{PlantOptions, Truth};

/// A schedule that uses every shape, axis and key.
const EVERYTHING: &str = r#"
schema = 1
name = "everything"
description = "One of each."

[[step]]
duration_s = 10.0
roll_deg = -20.0
pitch_deg = 4.0
airspeed_mps = 18.0
[[step.excitation]]
on = "elevator"
shape = "3-2-1-1"
amplitude = 0.2
start_s = 1.0
width_s = 0.5
authority = 0.25
[[step.excitation]]
on = "roll"
shape = "doublet"
amplitude_deg = 10.0
start_s = 6.0
width_s = 1.0
[[step.excitation]]
on = "throttle"
shape = "step"
amplitude = -0.5
start_s = 8.0

[[step]]
duration_s = 5.0
roll_deg = 0.0
pitch_deg = 2.0
airspeed_mps = 20.0
[[step.excitation]]
on = "aileron"
shape = "multisine"
amplitude = 0.1
low_hz = 0.5
high_hz = 4.0
seed = 7
[[step.excitation]]
on = "airspeed"
shape = "step"
amplitude_mps = 3.0
width_s = 2.0
"#;

fn lqi() -> Box<dyn Controller> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    control::build(ControllerKind::Lqi, &GreyBox::load(&path).unwrap()).unwrap()
}

fn range(flown: &Flown, of: fn(&Truth) -> f64) -> [f64; 2] {
    // the start is not trimmed; what it does is no part of the manoeuvres
    let all = flown.truth.iter().skip(150).map(of);
    all.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
}

#[test]
fn a_schedule_is_a_function_of_time() {
    let schedule = Schedule::parse(EVERYTHING).unwrap();
    assert_eq!(schedule.duration(), 15.0);
    let elevator = |t: f64| schedule.at(t).added.elevator;
    // 3-2-1-1 of 0.5 s from 1 s on: + to 2.5, − to 3.5, + to 4, − to 4.5
    let wanted =
        [(0.9, 0.0), (1.1, 0.2), (2.4, 0.2), (2.6, -0.2), (3.6, 0.2), (4.1, -0.2), (4.6, 0.0)];
    wanted.iter().for_each(|(t, value)| assert_eq!(elevator(*t), *value, "at {t} s"));
    assert_eq!(schedule.at(1.1).authority, [1.0, 0.25, 1.0, 1.0]);
    assert_eq!(schedule.at(4.6).authority, [1.0; 4]);
    let roll = |t: f64| schedule.at(t).target.roll.to_degrees();
    assert!((roll(6.5) + 10.0).abs() < 1e-9 && (roll(7.5) + 30.0).abs() < 1e-9);
    assert_eq!([7.9, 8.1, 9.9].map(|t| schedule.at(t).added.throttle), [0.0, -0.5, -0.5]);
    assert_eq!([10.5, 12.5].map(|t| schedule.at(t).target.airspeed), [23.0, 20.0]);
    let sines: f64 =
        (0..400).map(|k| schedule.at(10.5 + 0.01 * f64::from(k)).added.aileron.powi(2)).sum();
    // the power of a sine of amplitude 0.1 is 0.005, over 4 s of seven lines within a third
    assert!((sines / 400.0 - 0.005).abs() < 0.0017, "{}", sines / 400.0);
    let end = schedule.at(15.0);
    assert_eq!((end.target.roll, end.target.pitch, end.target.airspeed), (0.0, 0.0, 20.0));
    assert_eq!((end.added, schedule.at(1e9)), (Command::IDLE, end));
}

#[test]
fn a_schedule_reads_back_from_its_own_text() {
    let schedule = Schedule::parse(EVERYTHING).unwrap();
    assert_eq!(Schedule::parse(&schedule.to_toml()).unwrap(), schedule);
    for manoeuvre in menu::MENU {
        let schedule = manoeuvre.schedule();
        let back = Schedule::parse(&schedule.to_toml())
            .unwrap_or_else(|why| panic!("{}: {why}", manoeuvre.name));
        // degrees go through radians, so the last bit may differ
        for k in 0..(schedule.duration() * 20.0) as usize {
            let (a, b) = (schedule.at(0.05 * k as f64), back.at(0.05 * k as f64));
            assert!((a.target.roll - b.target.roll).abs() < 1e-9, "{}", manoeuvre.name);
            assert_eq!((a.added, a.authority), (b.added, b.authority), "{}", manoeuvre.name);
        }
    }
}

#[test]
fn what_no_schedule_may_ask_for_is_refused_with_its_place() {
    let refused = |from: &str, to: &str, words: &[&str]| {
        assert!(EVERYTHING.contains(from), "{from}");
        let why = Schedule::parse(&EVERYTHING.replacen(from, to, 1)).unwrap_err();
        words.iter().for_each(|w| assert!(why.contains(w), "{to}: {why:?} lacks {w:?}"));
    };
    refused("roll_deg = -20.0", "roll_deg = -80.0", &["step 1", "roll_deg = -80", "70"]);
    refused("roll_deg = -20.0", "roll_deg = nan", &["step 1", "roll_deg = NaN"]);
    refused("amplitude_deg = 10.0", "amplitude_deg = 55.0", &["step 1", "excitation", "75"]);
    refused("amplitude_deg = 10.0", "amplitude = 10.0", &["step 1", "roll", "amplitude_deg"]);
    refused("duration_s = 10.0", "duration_s = -1.0", &["step 1", "duration_s"]);
    refused("duration_s = 10.0", "duration_s = 2.0", &["step 1", "width_s"]);
    refused("duration_s = 10.0", "length_s = 10.0", &["line", "length_s", "duration_s"]);
    refused("\"elevator\"", "\"flaps\"", &["step 1", "flaps", "aileron"]);
    refused("\"3-2-1-1\"", "\"3211\"", &["step 1", "3211", "doublet"]);
    refused("high_hz = 4.0", "high_hz = 60.0", &["step 2", "high_hz", "20"]);
    refused("high_hz = 4.0", "", &["step 2", "multisine", "high_hz"]);
    refused("width_s = 0.5", "", &["step 1", "width_s", "3-2-1-1"]);
    refused("authority = 0.25", "authority = 1.5", &["step 1", "authority"]);
    refused("schema = 1", "schema = 2", &["schema"]);
    assert!(Schedule::parse("schema = 1\nname = \"none\"\n").unwrap_err().contains("[[step]]"));
    let error = Schedule::load(Path::new("nowhere.toml")).unwrap_err().to_string();
    assert!(error.contains("nowhere.toml") && error.contains("greylag design"), "{error}");
}

#[test]
fn every_manoeuvre_of_the_menu_is_flown_and_ends_level() {
    let lqi = lqi();
    for manoeuvre in menu::MENU {
        let flown = fly(&PlantOptions::default(), lqi.as_ref(), &manoeuvre.schedule())
            .unwrap_or_else(|e| panic!("{e}"));
        let last = flown.truth.last().unwrap();
        let (roll, pitch) = (last.roll_rad.to_degrees(), last.pitch_rad.to_degrees());
        // two seconds of wings level at the end are enough to come back from 50° of bank
        assert!(roll.abs() < 2.0 && pitch.abs() < 12.0, "{}: {roll} {pitch}", manoeuvre.name);
    }
}

#[test]
fn training_flights_excite_everything_and_test_flights_differ() {
    let lqi = lqi();
    let flights = flights::training(11);
    let flown: Vec<Flown> = flights
        .iter()
        .map(|schedule| fly(&PlantOptions::default(), lqi.as_ref(), schedule).unwrap())
        .collect();
    let over = |of: fn(&Truth) -> f64, low: f64, high: f64| {
        let all = flown.iter().map(|f| range(f, of));
        let [a, b] = all.fold([0.0_f64, 0.0_f64], |[a, b], [c, d]| [a.min(c), b.max(d)]);
        assert!(a < low && b > high, "{a}..{b} does not hold {low}..{high}");
    };
    // slow flight towards the stall at 12°, pushes below zero lift at −1.6°
    over(|t| t.alpha_rad.to_degrees(), -2.5, 8.5);
    over(|t| t.beta_rad.to_degrees(), -10.0, 10.0);
    over(|t| t.p_radps.to_degrees(), -60.0, 60.0);
    over(|t| t.q_radps.to_degrees(), -50.0, 50.0);
    over(|t| t.elevator_rad.to_degrees(), -15.0, 15.0);
    over(|t| t.aileron_rad.to_degrees(), -20.0, 20.0);
    over(|t| 20.0 - t.airspeed_mps, -10.0, 9.0);
    over(|t| 2.0 * t.throttle - 1.0, -0.99, 0.9);
    assert!(flights.iter().all(|f| (f.duration() - flights::FLIGHT_S).abs() < 1.0));
    assert_ne!(flights, flights::training(12));
    assert!(flights::testing(11).iter().all(|test| !flights.contains(test)));
}

#[test]
fn the_aircraft_stays_flyable_with_every_effect_hidden() {
    let lqi = lqi();
    for kind in KINDS.into_iter().chain(SERVOS) {
        // the largest clear amplitude of each
        let largest =
            if kind.clear[0].abs() > kind.clear[1].abs() { kind.clear[0] } else { kind.clear[1] };
        let missing = vec![Missing::new(&craft(), kind.id, largest).unwrap()];
        let logs =
            Trial { seed: 3, missing, turbulence: None, ..Trial::default() }.fly(lqi.as_ref());
        let logs = logs.unwrap_or_else(|e| panic!("{}: {e}", kind.id));
        assert_eq!((logs.training.len(), logs.testing.len()), (3, 2));
    }
}

#[test]
fn an_aircraft_that_leaves_its_bounds_is_said_with_time_and_attitude() {
    // a 4 s step of full aileron against a controller held off
    let step = Step::hold(6.0, 0.0, 3.0, 18.0);
    let roll = Excitation::new(Axis::Aileron, 1.0, 0.5, Shape::Step { width: 4.0 }).against(0.0);
    let schedule = Schedule::new("over", "", vec![step.with(roll)]).unwrap();
    let error = fly(&PlantOptions::default(), lqi().as_ref(), &schedule).unwrap_err();
    assert!(
        matches!(error, FlightTestError::Departed { roll_deg, .. } if roll_deg > 70.0),
        "{error}"
    );
    let gentle = schedule.gentler(0.05);
    assert!(fly(&PlantOptions::default(), lqi().as_ref(), &gentle).is_ok());
}

#[test]
fn instruments_err_as_they_are_told() {
    let schedule = menu::named("aileron-3211").unwrap().schedule();
    let flown = fly(&PlantOptions::default(), lqi().as_ref(), &schedule).unwrap();
    let perfect = Instruments::PERFECT.log(&flown, "perfect", 1);
    assert!(perfect.samples.iter().zip(&flown.truth).all(|(s, t)| s.rates_radps[0] == t.p_radps));
    let mut late = Instruments::PERFECT;
    late.late[Group::Vanes as usize] = 0.01;
    (late.alpha_bias, late.airspeed_scale, late.gyro_bias) = (0.02, 1.05, [0.0, 0.01, 0.0]);
    let log = late.log(&flown, "late", 1);
    for k in 1..log.samples.len() {
        let (s, now, before) = (&log.samples[k], &flown.truth[k], &flown.truth[k - 1]);
        assert!((s.alpha_rad - before.alpha_rad - 0.02).abs() < 1e-12);
        assert!((s.airspeed_mps - 1.05 * now.airspeed_mps).abs() < 1e-9);
        assert_eq!(s.rates_radps[1], now.q_radps + 0.01);
    }
    let noisy = Instruments::NOISY.log(&flown, "noisy", 1);
    let gyro = noisy.samples.iter().zip(&flown.truth).map(|(s, t)| s.rates_radps[0] - t.p_radps);
    let n = flown.truth.len() as f64;
    let sd = (gyro.map(|x| x * x).sum::<f64>() / n).sqrt();
    // 1400 draws of 0.005: four standard errors are 8 %
    assert!((sd / 0.005 - 1.0).abs() < 0.08, "{sd}");
    let specific = |log: &greylag::logs::Flight| -> Vec<[f64; 3]> {
        log.samples.iter().map(|s| s.specific_force_mps2).collect()
    };
    assert!(specific(&noisy) == specific(&Instruments::NOISY.log(&flown, "noisy", 1)));
    assert!(specific(&noisy) != specific(&Instruments::NOISY.log(&flown, "noisy", 2)));
    let drawn = Instruments::drawn(5);
    assert!(drawn.late.iter().all(|l| (0.0..=0.01).contains(l)) && drawn.late[1] == 0.0);
    assert_ne!(drawn, Instruments::drawn(6));
}

/// The size of the X8.
fn craft() -> Craft {
    Craft::of(&greylag::model::GreyBox::load("params/x8/jsbsim.toml".as_ref()).unwrap())
}
