//! What logs of public repositories showed, in small: each test is a file's defect or kind, made here.

use std::path::Path;

use crate::logs_support::*;
use greylag::logs::vehicle::Kind;
use greylag::logs::{Flight, Format, Log, LogError, Options, Sample, inspect, parse};

fn said(log: &Log) -> String {
    log.findings.iter().map(|f| format!("{f}\n")).collect()
}

fn looked(name: &str, bytes: &[u8]) -> Log {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    inspect(&path, &Options::default()).unwrap()
}

fn refused(bytes: &[u8]) -> String {
    match parse(bytes, Path::new("file"), &Options::default()) {
        Err(error @ LogError::Foreign { .. }) => error.to_string(),
        other => panic!("{:?}", other.map(|log| log.flight.name)),
    }
}

/// A declaration of the binary format.
fn declared(kind: u8, len: usize, name: &str, letters: &str, labels: &str) -> Vec<u8> {
    let padded = |text: &str, width: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(width, 0);
        bytes
    };
    let head = vec![0xA3, 0x95, 128, kind, len as u8];
    [head, padded(name, 4), padded(letters, 16), padded(labels, 64)].concat()
}

#[test]
fn a_dataflash_log_in_text_is_the_log_that_it_was_made_of() {
    let binary = dataflash(&samples(500));
    let text = in_text(&binary, "ArduPlane V3.8.2 (abcdef)");
    assert_eq!(Format::of(text.as_bytes()), Some(Format::Dataflash));
    let read = |bytes: &[u8]| parse(bytes, Path::new("flight"), &Options::default()).unwrap();
    let (one, other) = (read(&binary), read(text.as_bytes()));
    // As text, in which an absent value is one like another.
    let table = |log: &Log| String::from_utf8(csv(&log.flight.samples)).unwrap();
    assert!(table(&one) == table(&other), "the tables differ");
    assert_eq!(other.vehicle.as_ref().map(|v| v.kind), Some(Kind::FixedWing));
    // A line that fits no declaration is counted.
    let spoiled = text.replacen("\nIMU, ", "\nIMU, x\nQQQ, 1\nIMU, ", 2);
    assert!(said(&read(spoiled.as_bytes())).contains("belong to no record"));
    // A log of a copter is refused in text as well.
    let copter = in_text(&binary, "ArduCopter V3.1.2");
    let error = parse(copter.as_bytes(), Path::new("c.log"), &Options::default()).unwrap_err();
    assert!(error.to_string().contains("multicopter"), "{error}");
}

#[test]
fn files_of_other_kinds_are_named_with_what_to_give_instead() {
    let mut stream = Vec::new();
    for payload in [9usize, 28, 30, 9] {
        stream.extend([0xFE, payload as u8, 0, 1, 1, 0]);
        stream.extend(vec![7; payload + 2]);
    }
    for (bytes, words) in [
        (stream, ["without their times", ".tlog"]),
        (b"#ROSBAG V2.0\n\x45\x00".to_vec(), ["ROS 1 bag", "rosbags-convert"]),
        (b"SQLite format 3\0".to_vec(), ["ROS 2 bag", "ros2 bag convert"]),
        (b"MATLAB 5.0 MAT-file, Platform: GLNXA64".to_vec(), ["MATLAB", "mat_to_csv"]),
        (b"MATLAB 7.3 MAT-file, Platform: GLNXA64".to_vec(), ["7.3", "mat_to_csv"]),
        (b"\x89HDF\r\n\x1a\n".to_vec(), ["HDF5", "mat_to_csv"]),
        (b"{\"t\": 0, \"p\": 1}\n".to_vec(), ["JSON", "CSV"]),
        (b"<!-- logged with, paparazzi -->\n<conf>\n".to_vec(), ["Paparazzi", ".data"]),
    ] {
        let error = refused(&bytes);
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
    }
}

#[test]
fn the_log_of_px4_from_before_ulog_is_not_taken_for_ardupilots() {
    let mut log = declared(129, 11, "TIME", "Q", "StartTime");
    log.extend(declared(2, 7, "ATT", "f", "Roll"));
    log.extend(declared(10, 4, "STAT", "B", "MainState"));
    for i in 0..50u64 {
        log.extend([&[0xA3, 0x95, 129][..], &(i * 10_000).to_le_bytes()].concat());
        log.extend([&[0xA3, 0x95, 2][..], &0.1f32.to_le_bytes()].concat());
        log.extend([0xA3, 0x95, 10, 1]);
    }
    let error = refused(&log);
    assert!(error.contains("sdlog2") && error.contains("before ULog"), "{error}");
}

#[test]
fn a_table_without_any_known_column_is_refused_in_one_sentence() {
    let log = looked("battery.csv", b"Date & Time, Current, Volt\n1,2,3\n2,3,4\n");
    let said = said(&log);
    assert_eq!(said.matches("problem").count(), 1, "{said}");
    assert!(said.contains("no column `time_s`, `roll_rad`") && said.contains("Current"), "{said}");
    assert!(!said.contains("rows dropped") && !said.contains("no flight"), "{said}");
}

#[test]
fn what_stands_on_the_ground_has_no_dead_sensors_and_no_vane_in_degrees() {
    let mut parked = samples(1000);
    for (i, s) in parked.iter_mut().enumerate() {
        (s.airspeed_mps, s.attitude_rad) = (0.5 + 0.1 * (i as f64).sin(), [0.0, 0.115, 0.6]);
        // ArduPilot's estimate of the angle of attack of what stands still.
        (s.alpha_rad, s.beta_rad) = (1.5, 1.4);
    }
    let said = said(&looked("parked.bin", &dataflash(&parked)));
    assert!(said.contains("there is no flight"), "{said}");
    assert!(!said.contains("constantly") && !said.contains("degrees"), "{said}");
    assert!(!said.contains("spike"), "{said}");
}

/// pymavlink 2.4.50's `mavlogdump --reduce 2` keeps one of two sensors whole and nothing of the first one
/// (findings/mavlogdump-thinned-sensors.sh).
#[test]
fn a_log_without_its_first_imu_is_noted() {
    let whole = dataflash(&samples(500));
    let (mut thin, mut at, mut lengths) = (Vec::new(), 0, [89usize; 256]);
    while at < whole.len() {
        let record = &whole[at..at + lengths[usize::from(whole[at + 2])]];
        if record[2] == 128 {
            lengths[usize::from(record[3])] = usize::from(record[4]);
        }
        // of the IMU (type 2) the instance follows the time
        if record[2] != 2 || record[11] != 0 {
            thin.extend_from_slice(record);
        }
        at += record.len();
    }
    let note = "note: IMU has instance 1 and no instance 0: ";
    let said_of = |bytes: &[u8]| said(&looked("flight.bin", bytes));
    let thinned = said_of(&thin);
    assert!(thinned.contains(note) && thinned.contains("mavlogdump --reduce 2"), "{thinned}");
    assert_eq!(thinned.matches("and no instance 0").count(), 1, "{thinned}");
    assert!(!said_of(&whole).contains("and no instance 0"));
}

#[test]
fn a_record_that_lost_a_byte_gives_no_numbers() {
    let truth = samples(500);
    let mut bytes = dataflash(&truth);
    // As git does to a binary file that it takes for text: bytes vanish.
    let middle = bytes.len() / 2;
    for k in 0..20 {
        bytes.remove(middle + 997 * k);
    }
    let log = parse(&bytes, Path::new("flight"), &Options::default()).unwrap();
    assert_eq!(log.life, None, "no second flight is invented");
    let said = said(&log);
    let (_, lost) = said.split_once("places, with ").unwrap();
    let lost: f64 = lost.split(' ').next().unwrap().parse().unwrap();
    assert!(lost < 2.0, "{said}");
    let end = truth.last().unwrap().time_s;
    assert!(log.flight.samples.iter().all(|s| s.time_s <= end + 1e-6));
}

#[test]
fn a_dive_with_its_load_on_the_back_does_not_turn_the_z_axis_round() {
    // A tilt-rotor's simulation dives and rolls to and fro for most of its flight, pushed at 1.6 g.
    let mut rows: Vec<Sample> = samples(3000);
    for (i, s) in rows.iter_mut().enumerate().skip(800) {
        let t = 0.01 * i as f64;
        s.attitude_rad[..2].copy_from_slice(&[1.2 * (0.3 * t).sin(), -0.6]);
        s.rates_radps = [0.36 * (0.3 * t).cos(), -0.2, -0.2];
        s.specific_force_mps2 = [-4.0, 1.0, 15.0];
    }
    let said = said(&looked("dive.csv", &csv(&rows)));
    assert!(!said.contains("positive up"), "{said}");
}

#[test]
fn a_tumble_does_not_turn_the_elevator_round() {
    // Level flight at rest, then full nose down while the nose turns over both ways: what the surface does there
    // shows no polarity.
    let mut rows: Vec<Sample> = samples(3000);
    for (i, s) in rows.iter_mut().enumerate().skip(1200) {
        let t = 0.01 * i as f64;
        s.attitude_rad[..2].copy_from_slice(&[2.0 * t.sin(), 1.4 * (3.0 * t).sin()]);
        s.rates_radps = [0.1, 12.0 * (2.0 * t).sin(), 0.0];
        s.elevator_cmd = (2.0 * t).cos();
        s.specific_force_mps2[2] = 7.0;
    }
    let log = looked("tumble.csv", &csv(&rows));
    let said = said(&log);
    assert!(!said.contains("acts the other way") && !said.contains("positive up"), "{said}");
}

#[test]
fn roll_and_p_of_a_flight_that_stands_on_its_tail_are_of_one_scale() {
    // A knife edge pitch at which roll and yaw are one axis: roll jumps by π without any p.
    let mut rows: Vec<Sample> = samples(3000);
    for (i, s) in rows.iter_mut().enumerate() {
        s.attitude_rad[1] = 1.45;
        s.attitude_rad[0] = 3.0 * (0.01 * i as f64).sin();
        s.rates_radps[0] = 0.5 * 3.0 * 0.01 * 100.0 * (0.01 * i as f64).cos();
    }
    let flight: Flight = rows.into();
    let log = looked("tail.csv", &csv(&flight.samples));
    assert!(!said(&log).contains("times as much as p"), "{}", said(&log));
}

/// The companion's image has no reader of bags.
#[test]
#[cfg(not(feature = "study"))]
fn a_bag_is_named_by_a_program_without_their_reader() {
    let error = refused(b"\x89MCAP0\r\n\x01\x20");
    assert!(error.contains("ROS 2 bag") && error.contains("--features study"), "{error}");
}
