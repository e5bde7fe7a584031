//! Wrong units, signs, axes and clocks: named with their cure before anything is computed from a log.
//!
//! The flights are JSBSim's, with sensor noise of a small autopilot; each case spoils one thing.

use std::sync::LazyLock;

use crate::reconstruct_support::{Errors, air, fly, spoil};
use greylag::logs::mapping::Mapping;
use greylag::logs::{Flight, Options, Sample, csv, parse};

/// One minute through banks to both sides and doublets, in 3 m/s of wind.
static FLIGHT: LazyLock<Flight> = LazyLock::new(|| {
    let errors = Errors { noise: Errors::NOISE, ..Errors::NONE };
    spoil(&fly(60.0, air([3.0, -1.0, 0.0], None), 71), &errors, 72)
});

fn text(samples: &[Sample]) -> Vec<u8> {
    let mut out = Vec::new();
    csv::write(&samples.to_vec().into(), &mut out).unwrap();
    out
}

fn spoiled(change: impl Fn(&mut Sample)) -> Vec<u8> {
    let mut samples = FLIGHT.samples.clone();
    samples.iter_mut().for_each(change);
    text(&samples)
}

/// What a look at the bytes finds; reading itself may fail with the same words.
fn found(bytes: &[u8], mapping: &str) -> String {
    let path = std::path::Path::new("flight.csv");
    let mapping = match mapping {
        "" => Mapping::default(),
        columns => Mapping::parse(&format!("schema = 1\n[columns]\n{columns}"), path).unwrap(),
    };
    let options = Options { mapping, ..Options::default() };
    match parse(bytes, path, &options) {
        Ok(log) => log.problems().unwrap_or_default(),
        Err(error) => error.to_string(),
    }
}

/// Spoils a row of the log.
type Change = fn(&mut Sample);
/// A spoiled column, the words that name it, and the mapping that cures it.
type Case = (Change, &'static str, &'static str);

const DEGREE: f64 = 57.295_779_513;

const CASES: [Case; 17] = [
    (
        |s| s.throttle *= 100.0,
        "throttle looks like per cent",
        r#"throttle = { from = "csv.throttle", scale = 0.01 }"#,
    ),
    (
        |s| s.alpha_rad *= DEGREE,
        "alpha_rad looks like degrees",
        r#"alpha_rad = { from = "csv.alpha_rad", scale = 0.0174533 }"#,
    ),
    (
        |s| s.elevator_rad *= DEGREE,
        "elevator_rad looks like degrees",
        r#"elevator_rad = { from = "csv.elevator_rad", scale = 0.0174533 }"#,
    ),
    (
        |s| s.elevator_rad *= -1.0,
        "elevator_rad acts the other way",
        r#"elevator_rad = { from = "csv.elevator_rad", scale = -1 }"#,
    ),
    (
        |s| s.aileron_rad *= -1.0,
        "aileron_rad acts the other way",
        r#"aileron_rad = { from = "csv.aileron_rad", scale = -1 }"#,
    ),
    (
        |s| s.specific_force_mps2[2] *= -1.0,
        "z accelerometer looks positive up",
        r#"az_mps2 = { from = "csv.az_mps2", scale = -1 }"#,
    ),
    (
        |s| s.specific_force_mps2[0] *= -1.0,
        "ax_mps2 contradicts",
        r#"ax_mps2 = { from = "csv.ax_mps2", scale = -1 }"#,
    ),
    (
        |s| s.specific_force_mps2[1] *= -1.0,
        "ay_mps2 contradicts",
        r#"ay_mps2 = { from = "csv.ay_mps2", scale = -1 }"#,
    ),
    (
        |s| s.airspeed_mps *= 1.943_844,
        "airspeed looks like knots",
        r#"airspeed_mps = { from = "csv.airspeed_mps", scale = 0.514444 }"#,
    ),
    (
        |s| s.airspeed_mps *= 3.28084,
        "airspeed looks like ft/s",
        r#"airspeed_mps = { from = "csv.airspeed_mps", scale = 0.3048 }"#,
    ),
    (
        |s| s.altitude_m *= 3.28084,
        "altitude looks like feet",
        r#"altitude_m = { from = "csv.altitude_m", scale = 0.3048 }"#,
    ),
    (
        |s| s.altitude_m *= -1.0,
        "looks positive down",
        r#"altitude_m = { from = "csv.altitude_m", scale = -1 }"#,
    ),
    (
        |s| s.velocity_ned_mps[2] *= -1.0,
        "velocity looks positive up",
        r#"vd_mps = { from = "csv.vd_mps", scale = -1 }"#,
    ),
    (
        |s| s.attitude_rad[1] *= -1.0,
        "pitch falls while q is positive",
        r#"pitch_rad = { from = "csv.pitch_rad", scale = -1 }"#,
    ),
    (
        |s| s.attitude_rad[0] *= -1.0,
        "roll falls while p is positive",
        r#"roll_rad = { from = "csv.roll_rad", scale = -1 }"#,
    ),
    (
        |s| s.attitude_rad[2] = std::f64::consts::FRAC_PI_2 - s.attitude_rad[2],
        "counted from east to the left",
        r#"yaw_rad = { from = "csv.yaw_rad", scale = -1, offset = 1.5708 }"#,
    ),
    (
        |s| s.time_s *= 1000.0,
        "time_s looks like milliseconds",
        r#"time_s = { from = "csv.time_s", scale = 0.001 }"#,
    ),
];

#[test]
fn a_good_log_has_no_problem() {
    assert_eq!(found(&spoiled(|_| {}), ""), "");
}

#[test]
fn each_wrong_column_is_named_and_its_cure_cures_it() {
    for (change, words, cure) in CASES {
        let bytes = spoiled(change);
        let said = found(&bytes, "");
        assert!(said.contains(words) && said.contains(cure), "{words}: {said}");
        assert_eq!(found(&bytes, cure), "", "{words}: with the mapping");
    }
}

#[test]
fn a_command_that_moves_with_a_reversed_deflection_is_corrected_with_it() {
    let cases: [(Change, &str); 2] = [
        (|s| (s.aileron_rad, s.aileron_cmd) = (-s.aileron_rad, -s.aileron_cmd), "aileron"),
        (|s| (s.elevator_rad, s.elevator_cmd) = (-s.elevator_rad, -s.elevator_cmd), "elevator"),
    ];
    for (change, surface) in cases {
        let bytes = spoiled(change);
        let said = found(&bytes, "");
        let cures = ["rad", "cmd"].map(|unit| {
            format!("{surface}_{unit} = {{ from = \"csv.{surface}_{unit}\", scale = -1 }}")
        });
        assert!(cures.iter().all(|cure| said.contains(cure)), "{surface}: {said}");
        assert_eq!(found(&bytes, &cures.join("\n")), "", "{surface}: with the mapping");
    }
    // a command whose sign is right stays beside a deflection whose sign is wrong
    let said = found(&spoiled(|s| s.aileron_rad *= -1.0), "");
    assert!(said.contains("aileron_rad") && !said.contains("aileron_cmd"), "{said}");
}

#[test]
fn a_climb_rate_is_checked_though_no_row_has_it_beside_the_altitude() {
    let slow = |sign: f64| {
        spoiled(move |s| {
            let row = (100.0 * s.time_s).round() as i64;
            s.velocity_ned_mps[2] =
                if row % 4 == 0 { sign * s.velocity_ned_mps[2] } else { f64::NAN };
            s.altitude_m = if row % 4 == 1 { s.altitude_m } else { f64::NAN };
        })
    };
    assert_eq!(found(&slow(1.0), ""), "");
    let said = found(&slow(-1.0), "");
    assert!(said.contains("velocity looks positive up"), "{said}");
    assert_eq!(found(&slow(-1.0), r#"vd_mps = { from = "csv.vd_mps", scale = -1 }"#), "");
}

#[test]
fn an_inverted_throttle_is_named_and_its_mapping_cures_it() {
    let bytes = spoiled(|s| s.throttle = 1.0 - s.throttle);
    let said = found(&bytes, "");
    let cure = r#"throttle = { from = "csv.throttle", scale = -1, offset = 1 }"#;
    assert!(said.starts_with("throttle acts the other way") && said.contains(cure), "{said}");
    assert_eq!(found(&bytes, cure), "");
}

#[test]
fn real_flights_have_right_velocities_and_throttles() {
    for aircraft in ["dawn_one", "proto", "thor"] {
        for flight in ["fit", "test"] {
            let path = format!("{}/tests/data/{aircraft}/{flight}.csv", env!("CARGO_MANIFEST_DIR"));
            let said = found(&std::fs::read(path).unwrap(), "");
            for words in ["exchanged", "throttle acts", "throttle_cmd acts", "vd_mps", "altitude"] {
                assert!(!said.contains(words), "{aircraft} {flight}: {said}");
            }
        }
    }
}

#[test]
fn exchanged_north_and_east_are_named_and_their_mapping_cures_them() {
    let bytes = spoiled(|s| s.velocity_ned_mps.swap(0, 1));
    let said = found(&bytes, "");
    assert!(said.contains("vn_mps and ve_mps look exchanged"), "{said}");
    let lines = [("vn", "ve"), ("ve", "vn")]
        .map(|(column, from)| format!("{column}_mps = {{ from = \"csv.{from}_mps\", scale = 1 }}"));
    assert!(lines.iter().all(|line| said.contains(line)), "{said}");
    assert_eq!(found(&bytes, &lines.join("\n")), "");
}

#[test]
fn foreign_axes_are_named_as_such() {
    let said = found(
        &spoiled(|s| {
            for axis in [1, 2] {
                s.rates_radps[axis] *= -1.0;
                s.specific_force_mps2[axis] *= -1.0;
                s.attitude_rad[axis] *= -1.0;
            }
        }),
        "",
    );
    assert!(said.contains("forward-left-up"), "{said}");
}

#[test]
fn rows_that_go_back_are_said_and_semicolons_are_read() {
    let mut back = FLIGHT.samples.clone();
    back[2000..2600].iter_mut().for_each(|s| s.time_s -= 8.0);
    let said = found(&text(&back), "");
    assert!(said.contains("600 are not later than the row before"), "{said}");
    let with_commas = String::from_utf8(spoiled(|_| {})).unwrap();
    let said = found(with_commas.replace(',', ";").as_bytes(), "");
    assert_eq!(said, "");
}

#[test]
fn three_seconds_are_too_little() {
    let said = found(&text(&FLIGHT.samples[1000..1300]), "");
    assert!(said.contains("3.0 s of flight"), "{said}");
}
