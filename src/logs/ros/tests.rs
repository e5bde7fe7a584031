//! Compares the flights in ROS 2 bags with the flight from which `tests/data/ros/make.py` made these bags.

use std::path::{Path, PathBuf};

use crate::finding::Severity;
use crate::mapping::Mapping;
use crate::vehicle::Kind;
use crate::{Format, Log, LogError, Options, Sample, flights, inspect, load, parse};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data").join(name)
}

fn bag(name: &str) -> Vec<u8> {
    std::fs::read(data("ros").join(name)).unwrap()
}

/// The rows of the original flight that are in the bags.
fn truth() -> Vec<Sample> {
    let log = load(&data("odd_logs/good.csv"), &Options::default()).unwrap();
    log.flight.samples.into_iter().take(800).step_by(4).collect()
}

fn said(log: &Log) -> String {
    log.findings.iter().map(|f| format!("{f}\n")).collect()
}

/// The first rows of a log as text. In this form, two missing values (NaN) are equal.
fn table(log: &Log, rows: usize) -> String {
    log.flight.samples[..rows].iter().map(|s| format!("{s:?}\n")).collect()
}

/// The largest absolute differences between the log and the original flight: first that of the airspeed, then that over all
/// other columns. Altitudes are multiplied by 0.01.
fn differences(log: &Log, truth: &[Sample]) -> [f64; 2] {
    let start = log.flight.samples[0].time_s - truth[0].time_s;
    let mut worst = [0.0_f64; 2];
    for s in &log.flight.samples {
        let time = s.time_s - start;
        let t = truth.iter().find(|t| (t.time_s - time).abs() < 1e-4);
        let t = t.unwrap_or_else(|| panic!("no row at {time}"));
        let mut pairs = vec![
            (s.altitude_m * 0.01, t.altitude_m * 0.01),
            (s.aileron_cmd, t.aileron_cmd),
            (s.elevator_cmd, t.elevator_cmd),
            (s.throttle_cmd, t.throttle_cmd),
        ];
        for (a, b) in [
            (s.attitude_rad, t.attitude_rad),
            (s.rates_radps, t.rates_radps),
            (s.specific_force_mps2, t.specific_force_mps2),
            (s.velocity_ned_mps, t.velocity_ned_mps),
        ] {
            pairs.extend(a.into_iter().zip(b));
        }
        for (a, b) in pairs {
            assert!(a.is_finite(), "{s:?}");
            worst[1] = worst[1].max((a - b).abs());
        }
        worst[0] = worst[0].max((s.airspeed_mps - t.airspeed_mps).abs());
    }
    worst
}

#[test]
fn a_bag_of_px4_msgs_is_the_flight_that_it_was_made_of() {
    let truth = truth();
    let log = parse(&bag("px4.zstd.mcap"), Path::new("b.mcap"), &Options::default()).unwrap();
    assert_eq!(
        (log.format, log.flight.samples.len()),
        (Format::Ros, truth.len()),
        "{}",
        said(&log)
    );
    assert_eq!(log.vehicle.as_ref().map(|v| v.kind), Some(Kind::FixedWing));
    assert!(log.findings.iter().all(|f| f.severity == Severity::Note), "{}", said(&log));
    // The limit is the precision of single-precision numbers of the size 25 (airspeed, m/s) and 6 (600 m of altitude times
    // 0.01).
    let [airspeed, others] = differences(&log, &truth);
    assert!(airspeed < 2e-6 && others < 2e-6, "{airspeed} {others}");
    // An image that fills several chunks is counted and skipped.
    let counted = |name: &str| log.topics.iter().find(|t| t.0 == name).map(|t| t.2);
    assert_eq!(counted("camera/image_raw"), Some(4));
    assert_eq!(counted("vehicle_status"), Some(200));
    let alone = parse(&bag("px4_no_chunks.mcap"), Path::new("b"), &Options::default()).unwrap();
    assert_eq!(table(&alone, 12), table(&log, 12));
}

#[test]
fn a_bag_of_mavros_is_turned_from_its_axes_into_those_of_the_table() {
    let truth = truth();
    let log = parse(&bag("mavros.lz4.mcap"), Path::new("b.mcap"), &Options::default()).unwrap();
    assert_eq!(log.flight.samples.len(), truth.len(), "{}", said(&log));
    assert!(log.findings.iter().all(|f| f.severity == Severity::Note), "{}", said(&log));
    let [airspeed, others] = differences(&log, &truth);
    // The program that made the bags and Greylag use standard atmospheres whose constants differ in the sixth digit.
    assert!(airspeed < 3e-4 && others < 3e-6, "{airspeed} {others}");
    let big = parse(&bag("mavros_big_endian.zstd.mcap"), Path::new("b"), &Options::default());
    assert_eq!(table(&big.unwrap(), 30), table(&log, 30));
}

#[test]
fn a_mapping_names_topics_and_fields_of_a_bag() {
    let text = "schema = 1\n[columns]\nthrottle_cmd = { from = \"rc/out.channels[2]\", scale = 0.001, offset = -1 }\n\
        beta_rad = { from = \"local_position/velocity_local.twist.angular.x\" }\n";
    let mapping = Mapping::parse(text, Path::new("m.toml")).unwrap();
    let options = Options { mapping, ..Options::default() };
    let log = parse(&bag("mavros.lz4.mcap"), Path::new("b"), &options).unwrap();
    for (s, t) in log.flight.samples.iter().zip(truth()) {
        // Servo pulses are whole numbers of microseconds.
        assert!((s.throttle_cmd - t.throttle_cmd).abs() <= 5.1e-4 && s.beta_rad.is_nan(), "{s:?}");
    }
    assert!(said(&log).contains("beta_rad is constantly 0"), "{}", said(&log));
}

#[test]
fn two_vehicles_in_one_bag_are_two_flights() {
    let path = data("ros/two_vehicles.plain.mcap");
    let lives: Vec<_> = crate::inspect_all(&path, &Options::default()).unwrap();
    let named: Vec<_> = lives.iter().map(|log| log.life.clone().unwrap()).collect();
    assert_eq!(named, ["vehicle uav1", "vehicle uav2"]);
    assert!(lives.iter().all(|log| log.flight.samples.len() == 10));
    assert!(
        flights(&path, &Options::default()).is_ok() && inspect(&path, &Options::default()).is_ok()
    );
}

/// Reads a damaged bag, which must not fail.
fn damaged(bytes: &[u8]) -> Log {
    parse(bytes, Path::new("damaged.mcap"), &Options::default()).unwrap()
}

#[test]
fn a_bag_cut_anywhere_is_read_up_to_there_and_says_so() {
    for name in ["px4.zstd.mcap", "mavros.lz4.mcap"] {
        let whole = bag(name);
        let mut last = 0;
        for tenths in 3..10 {
            let log = damaged(&whole[..whole.len() * tenths / 10]);
            let rows = log.flight.samples.len();
            assert!(rows >= last, "{name}: {rows} after {last}");
            last = rows;
            let said = said(&log);
            assert!(
                said.contains("middle of a record") || said.contains("no end record"),
                "{said}"
            );
        }
        assert!(last > 170, "{name}: {last}");
    }
}

#[test]
fn damage_costs_a_chunk_and_is_counted() {
    let truth = truth();
    let warned = |text: &str| {
        let words =
            ["chunks could not be read", "do not have their checksum", "belong to no record"];
        words.iter().any(|word| text.contains(word)) && text.contains("s of messages")
            || text.contains("do not have their checksum")
    };
    for name in ["px4.zstd.mcap", "mavros.lz4.mcap"] {
        let whole = bag(name);
        let sound = damaged(&whole);
        let mut noticed = 0;
        // The first chunk stays undamaged: it alone has the definitions, without which no topic can be read.
        for tenths in 2..8 {
            let at = whole.len() * tenths / 10;
            let mut spoiled = whole.clone();
            spoiled[at..][..40].fill(0xA5);
            let mut lacking = whole.clone();
            lacking.drain(at..at + 900);
            for bytes in [spoiled, lacking] {
                let log = damaged(&bytes);
                let text = said(&log);
                noticed += usize::from(warned(&text));
                // The index of a chunk is not read, so its damage has no effect.
                let same =
                    log.flight.samples.len() == 200 && table(&log, 200) == table(&sound, 200);
                assert!(warned(&text) || same, "{name} at {at}: {text}");
                assert!(log.flight.samples.len() > 100, "{name} at {at}: {text}");
            }
        }
        assert!(noticed > 7, "{name}: {noticed}");
    }
    // The messages outside the damaged chunk must be correct.
    let mut bytes = bag("px4.zstd.mcap");
    bytes[25_000] ^= 0x40;
    let log = damaged(&bytes);
    let first = log.flight.samples[0].time_s;
    let right = |s: &&Sample| {
        let t = truth.iter().find(|t| (t.time_s - (s.time_s - first)).abs() < 1e-4);
        t.is_some_and(|t| (t.rates_radps[0] - s.rates_radps[0]).abs() < 1e-5)
    };
    assert!(log.flight.samples.iter().filter(right).count() > 150, "{}", said(&log));
}

#[test]
fn a_bag_without_flight_topics_says_what_it_holds() {
    // The first 40 bytes of the file declare no topic.
    let empty = &bag("px4.zstd.mcap")[..40];
    let error = parse(empty, Path::new("e.mcap"), &Options::default()).unwrap_err();
    assert!(matches!(error, LogError::Missing { .. }), "{error}");
    assert!(error.to_string().contains("imu/data"), "{error}");
}
