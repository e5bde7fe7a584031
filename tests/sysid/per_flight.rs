//! Trims that differ from flight to flight, and measured axes that stand askew, are found where they are and not where
//! they are not.

use std::path::Path;
use std::process::Command;

use crate::amend_support::{Manoeuvres, errors, fly_hiding, off, rebuilt, sensors};
use greylag::logs::{Flight, csv};
use greylag::model::GreyBox;
use greylag::physics::formula::register;
use greylag::sim::missing::Missing;
use greylag::sysid::amend;
use greylag::sysid::diagnose::{Detail, Diagnosis, Options, Verdict, diagnose};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::per_flight::{PerFlight, SensorErrors};
use greylag::sysid::progress::ignore_progress;
use greylag_sitl::hidden::Hidden;
use nalgebra::{Rotation3, Vector3};

/// Seconds of a flight.
const FLOWN_S: f64 = 25.0;

/// A lift and a pitching moment of one flight, as JSBSim flies them.
fn trim([lift, pitch]: [f64; 2]) -> Hidden {
    let channel = |name: &str, factor: &str, shape: &str| {
        format!("[[channels]]\nchannel = \"{name}\"\nfactor = \"{factor}\"\nshape = \"{shape}\"\n")
    };
    let parameter = |name: &str| {
        format!(
            "[parameters.{name}]\nvalue = 0.0\nbounds = [-1.0, 1.0]\nunit = \"\"\nmeaning = \"a trim\"\n"
        )
    };
    let text = format!(
        "schema = 1\nid = \"own_trim\"\ndescription = \"A trim.\"\nsource = \"this test\"\nstatus = \"accepted\"\n{}{}{}{}",
        parameter("CL0"),
        parameter("Cm0"),
        channel("lift", "qbar_S", "CL0"),
        channel("pitch", "qbar_S*c", "Cm0")
    );
    Missing::written(register::read(&text).unwrap(), &[lift, pitch]).unwrap().hidden.unwrap()
}

/// The log of a flight with `trim` (CL0, Cm0) by a board that is turned by `askew` (roll, pitch, yaw, °).
fn log(trimmed: [f64; 2], askew: [f64; 3], seed: u64) -> Flight {
    let flown = fly_hiding(vec![trim(trimmed)], FLOWN_S, Manoeuvres::Usual, seed);
    let mut log = sensors::spoil(&flown, &errors(seed), seed);
    let turn = Rotation3::from_scaled_axis(Vector3::from(askew.map(f64::to_radians)));
    for sample in &mut log.samples {
        let seen = |x: [f64; 3]| (turn.inverse() * Vector3::from(x)).into();
        sample.rates_radps = seen(sample.rates_radps);
        sample.specific_force_mps2 = seen(sample.specific_force_mps2);
        let [roll, pitch, yaw] = sample.attitude_rad;
        let (roll, pitch, yaw) =
            (Rotation3::from_euler_angles(roll, pitch, yaw) * turn).euler_angles();
        sample.attitude_rad = [roll, pitch, yaw];
    }
    log
}

/// The same, reconstructed.
fn flight(trimmed: [f64; 2], askew: [f64; 3], seed: u64) -> Reconstruction {
    rebuilt(&log(trimmed, askew, seed), seed)
}

fn asked(flights: &[Reconstruction], per_flight: PerFlight) -> Diagnosis {
    let options = Options {
        nulls: 20,
        bootstraps: 20,
        detail: Detail::Lean,
        per_flight,
        ..Options::default()
    };
    let found = diagnose(&off(&sensors::model(), 3), flights, &options, &ignore_progress).unwrap();
    println!("{:?} {:#?}", found.verdict, found.sentences);
    found
}

#[test]
fn a_board_that_stands_askew_in_one_flight_is_found_there_and_not_in_the_other() {
    let turned = [2.0, 0.0, 3.0];
    let flights = [flight([0.0; 2], turned, 1), flight([0.0; 2], [0.0; 3], 2)];
    let without = asked(&flights, PerFlight::default());
    let found = asked(&flights, PerFlight { askew_deg: Some(3.0), ..PerFlight::default() });
    let angles: Vec<_> = found.measurement.iter().filter(|m| m.id == "axes_askew").collect();
    // a tilt that explains more than the effects do is proposed unasked, with the same angles
    let unasked: Vec<_> = without.measurement.iter().filter(|m| m.id == "axes_askew").collect();
    assert_eq!(unasked.len(), angles.len());
    for (m, asked) in unasked.iter().zip(&angles) {
        assert!((m.value - asked.value).abs() < asked.sd, "{} {}", m.flight, m.name);
    }
    assert!(without.sentences[0].contains("axes are misaligned, roll"), "{:?}", without.sentences);
    for (k, m) in angles.iter().enumerate() {
        println!("{} {} {:.3} ± {:.3}", m.flight, m.name, m.value.to_degrees(), m.sd.to_degrees());
        let truth = if k < 3 { turned[k].to_radians() } else { 0.0 };
        assert!((m.value - truth).abs() < 3.0 * m.sd, "{} {}", m.flight, m.name);
    }
    let clear: Vec<bool> = angles.iter().map(|m| m.asserted).collect();
    assert_eq!(clear, [true, false, true, false, false, false]);
    assert!(found.sentences.iter().any(|s| s.contains("axes are misaligned, roll")));
}

#[test]
fn trims_of_flights_are_found_beside_the_model() {
    let trims = [[0.04, 0.012], [-0.04, -0.012], [0.0, 0.0]];
    let flights: Vec<Reconstruction> =
        (0..3).map(|k| flight(trims[k], [0.0; 3], 11 + k as u64)).collect();
    let without = asked(&flights, PerFlight::default());
    let found = asked(&flights, PerFlight { trims: Some(1.0), ..PerFlight::default() });
    for t in &found.trims {
        let k = flights.iter().position(|f| f.name == t.flight).unwrap();
        let own = trims[k];
        let (truth, clear) = match t.name.as_str() {
            "CL0" => (own[0], own[0] != 0.0),
            "Cm0" => (own[1], own[1] != 0.0),
            _ => (0.0, false),
        };
        let [by, sd] = t.beside_mean.unwrap();
        println!("{} {} {:.5} ± {:.5}, {by:.5} ± {sd:.5}", t.flight, t.name, t.value, t.sd);
        // all flights' common part is the model's as well, whose coefficients are 15 % off
        assert!((by - truth).abs() < 3.0 * sd, "{} {}", t.flight, t.name);
        assert_eq!(t.asserted, clear, "{} {}", t.flight, t.name);
        if clear {
            assert!((t.value - truth).abs() < 3.0 * t.sd && t.sd < 0.5 * truth.abs());
        }
    }
    // one trim for all turns the sign of the pitch damping, which no aircraft has: nothing is said about forces
    assert_eq!(without.verdict, Verdict::Unknown);
    assert!(without.doubtful.iter().any(|s| s.contains("Cmq")), "{:?}", without.doubtful);
    assert_eq!(found.verdict, Verdict::Adequate);
    assert!(found.sentences.iter().any(|s| s.contains("its trim differs") && s.contains("Cm0")));
}

/// A flight whose airspeed reads 5 % high and whose vane reads 0.03 rad high, as a reconstruction without other sensors leaves it.
fn misread(seed: u64) -> Reconstruction {
    let mut flight = flight([0.0; 2], [0.0; 3], seed);
    for at in flight.segments.iter_mut().flat_map(|s| &mut s.instants) {
        at.state.airspeed *= 1.05;
        at.state.alpha += 0.03;
    }
    for nuisance in &mut flight.nuisances {
        match nuisance.name.as_str() {
            "airspeed_scale" => nuisance.sd = 0.05,
            "alpha_bias" => nuisance.sd = 0.03,
            _ => {}
        }
    }
    flight
}

#[test]
fn sensor_errors_that_flights_share_correct_a_flight_that_the_fit_has_not_seen() {
    let flights = [31, 32, 33].map(misread);
    let fitted = |sensors: SensorErrors| {
        let per_flight = PerFlight { sensors, ..PerFlight::default() };
        let options = amend::Options { per_flight, ..amend::Options::default() };
        let model = sensors::model();
        amend::amend(&model, &flights[..2], &flights[2..], &options, &ignore_progress).unwrap()
    };
    let [judged, dropped] = [SensorErrors::Judged, SensorErrors::Dropped].map(fitted);
    let error = |of: &amend::Amended| of.amendment.after[2].rmse_scaled;
    println!("{} {} {:?}", error(&judged), error(&dropped), judged.model.known.installation);
    println!("{:#?}", judged.amendment.notes);
    assert!(error(&judged) < 0.8 * error(&dropped));
    let shared = judged.model.known.installation.as_ref().and_then(|all| all.sensors).unwrap();
    assert!((shared[0] - 0.05).abs() < 0.02 && (shared[4] - 0.03).abs() < 0.015, "{shared:?}");
    assert!(judged.amendment.notes.iter().any(|n| n.contains("sensor errors in common")));
    assert!(dropped.model.known.installation.is_none());
}

#[test]
fn free_runs_find_trims_and_axes_and_leave_the_model_what_flights_have_in_common() {
    let trims = [[0.04, 0.012], [-0.04, -0.012], [0.0, 0.0]];
    let turned = [[0.0; 3], [2.0, 0.0, 3.0], [0.0; 3]];
    let flights: Vec<Reconstruction> =
        (0..3).map(|k| flight(trims[k], turned[k], 21 + k as u64)).collect();
    let fitted = |per_flight: PerFlight| {
        let options = amend::Options { per_flight, ..amend::Options::default() };
        let wrong = off(&sensors::model(), 3);
        amend::amend(&wrong, &flights[..2], &flights[2..], &options, &ignore_progress)
            .unwrap()
            .amendment
    };
    let (without, with) = (
        fitted(PerFlight::default()),
        fitted(PerFlight { trims: Some(1.0), askew_deg: Some(3.0), ..PerFlight::default() }),
    );
    for (k, f) in with.flights.iter().enumerate() {
        for c in &f.own {
            let of = |k: usize| match c.name {
                "askew_roll" => turned[k][0].to_radians(),
                "askew_yaw" => turned[k][2].to_radians(),
                "CL0" => trims[k][0],
                "Cm0" => trims[k][1],
                _ => 0.0,
            };
            let (truth, mean) = (of(k), 0.5 * (of(0) + of(1)));
            let [by, sd] = c.beside_mean.unwrap();
            println!(
                "{} {} {:.5} ± {:.5}, {by:.5} ± {sd:.5}: {truth:.5}",
                f.flight, c.name, c.value, c.sd
            );
            assert!((c.value - truth).abs() < 3.0 * c.sd, "{} {}", f.flight, c.name);
            assert!((by - truth + mean).abs() < 3.0 * sd, "{} {}", f.flight, c.name);
        }
    }
    let exact = sensors::model();
    for p in &with.parameters {
        let truth = exact.coefficients().iter().find(|c| c.name == p.name).unwrap().value;
        assert!((p.value - truth).abs() < 3.0 * p.sd, "{} {} ± {}", p.name, p.value, p.sd);
    }
    // −0.2292 in the aircraft: one trim for both flights halves it, and the intervals say so little that they hold it
    let elevator = |of: &amend::Amendment| {
        let found = of.parameters.iter().find(|p| p.name == "pitch_linear.Cmde").unwrap();
        [found.value / -0.2292 - 1.0, found.sd / 0.2292]
    };
    println!("{:?} {:?}", elevator(&without), elevator(&with));
    assert!(elevator(&without)[0].abs() > 0.3 && elevator(&without)[1] > 0.1);
    assert!(elevator(&with)[0].abs() < 0.02 && elevator(&with)[1] < 0.01);
    let after = |of: &amend::Amendment| of.after.last().unwrap().rmse_scaled;
    println!("{} {}", after(&without), after(&with));
    assert!(after(&with) < 0.8 * after(&without));
    assert!(with.notes.iter().any(|n| n.contains("nothing is taken from them")));
}

fn greylag(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_greylag")).args(arguments).output().unwrap();
    let said = [&output.stdout[..], &output.stderr[..]].map(String::from_utf8_lossy).concat();
    // 3 is "done, in doubt"
    assert!(matches!(output.status.code(), Some(0 | 3)), "{arguments:?}: {said}");
    said
}

/// A board that stands askew in the same way in all flights, each flight with its own trim: the model's file keeps both,
/// a flight that nobody fitted is predicted with the board, one that was with its trim too.
#[test]
fn what_was_learned_of_the_board_and_of_flights_is_kept_and_used() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let turned = [4.0, 0.0, 5.0];
    let trims = [[0.04, 0.012], [-0.04, -0.012], [0.0, 0.0], [0.0, 0.0]];
    let names = ["a.csv", "b.csv", "c.csv", "d.csv"].map(at);
    for (k, name) in names.iter().enumerate() {
        csv::save(&log(trims[k], turned, 31 + k as u64), Path::new(name)).unwrap();
    }
    let [a, b, c, d] = names.each_ref().map(String::as_str);
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let model = root.join("params/x8/prior-mild.toml").display().to_string();
    let line = ["amend", "--model", &model, "--log", a, b, c, "--hold-out", d, "--tune-only"];
    let own = ["--flight-trims", "--axes-askew", "5", "--out", &at("out")];
    let said = greylag(&[&line[..], &own].concat());
    assert!(said.contains("kept as [installation]"), "{said}");
    let fitted = at("out/model.toml");
    let known = GreyBox::load(Path::new(&fitted)).unwrap().known;
    println!("{known:#?}");
    let axes = known.installation.as_ref().unwrap().axes_deg.unwrap();
    assert!((axes[0] - 4.0).abs() < 1.0 && (axes[2] - 5.0).abs() < 1.0, "{axes:?}");
    let pitching = |name: &str| known.of(name).unwrap().trims.unwrap()[4];
    assert!((pitching("a.csv") - pitching("b.csv") - 0.024).abs() < 0.004);
    let json = at("compared.json");
    let said = greylag(&[
        "compare",
        "--model",
        &fitted,
        "--log",
        a,
        d,
        "--horizon",
        "1,5",
        "--json",
        &json,
    ]);
    assert!(said.contains("A without"), "{said}");
    let read: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    let of = &read["models"][0]["known"];
    assert_eq!(of["flights"][0].as_str(), Some("a.csv"));
    assert_eq!(of["by_installation"][0].as_str(), Some("d.csv"));
    let error = |scores: &serde_json::Value| scores[1]["rmse_scaled"].as_f64().unwrap();
    let (with, without) = (error(&read["free_run"]), error(&of["without"]));
    println!("{with} with what is known, {without} without");
    assert!(with < 0.7 * without, "{with} {without}");
    let predicted = at("runs.csv");
    greylag(&["compare", "--model", &fitted, "--log", d, "--predictions", &predicted]);
    let text = std::fs::read_to_string(&predicted).unwrap();
    assert!(text.contains("without its flights' constants"));
    let said = greylag(&["diagnose", "--model", &fitted, "--log", a, b, "--nulls", "20"]);
    assert!(said.contains("as the model's file has them: a.csv, b.csv"), "{said}");
}
