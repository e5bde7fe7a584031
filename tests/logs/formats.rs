//! Logs of four formats: one flight gives one table, odd files give a clear statement.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::logs_support::*;
use greylag::logs::finding::Severity;
use greylag::logs::mapping::Mapping;
use greylag::logs::{Format, Log, LogError, Options, Sample, inspect, load, parse};

fn read(bytes: &[u8]) -> Log {
    parse(bytes, Path::new("flight"), &Options::default()).unwrap()
}

fn angle(a: f64, b: f64) -> f64 {
    (a - b + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
}

/// Largest differences: angles, everything else, velocity.
fn difference(a: &[Sample], b: &[Sample]) -> [f64; 3] {
    assert_eq!(a.len(), b.len());
    let mut worst = [0.0f64; 3];
    // A NaN must not pass for agreement.
    let mut take = |i: usize, d: f64| {
        worst[i] = if d.is_nan() { f64::INFINITY } else { worst[i].max(d.abs()) }
    };
    for (a, b) in a.iter().zip(b) {
        assert!((a.time_s - b.time_s).abs() < 1e-9);
        for k in 0..3 {
            take(0, angle(a.attitude_rad[k], b.attitude_rad[k]));
            take(1, a.rates_radps[k] - b.rates_radps[k]);
            take(1, a.specific_force_mps2[k] - b.specific_force_mps2[k]);
            take(2, a.velocity_ned_mps[k] - b.velocity_ned_mps[k]);
        }
        take(0, a.alpha_rad - b.alpha_rad);
        take(0, a.beta_rad - b.beta_rad);
        take(1, a.airspeed_mps - b.airspeed_mps);
        take(1, (a.altitude_m - b.altitude_m) * 0.01);
        take(1, a.air_density_kgpm3 - b.air_density_kgpm3);
        take(1, a.aileron_cmd - b.aileron_cmd);
        take(1, a.elevator_cmd - b.elevator_cmd);
        take(1, a.throttle_cmd - b.throttle_cmd);
    }
    worst
}

#[test]
fn one_flight_in_four_formats_is_one_table() {
    let truth = samples(2000);
    let files = [
        (Format::Csv, csv(&truth)),
        (Format::Ulog, ulog(&truth)),
        (Format::Dataflash, dataflash(&truth)),
        (Format::Tlog, tlog(&truth)),
    ];
    for (format, bytes) in files {
        let log = read(&bytes);
        assert_eq!(log.format, format);
        assert_eq!(log.dropped, 0);
        assert!(log.findings.iter().all(|f| f.severity == Severity::Note), "{:?}", log.findings);
        let [angles, others, velocity] = difference(&truth, &log.flight.samples);
        // Single precision: 24 bits of 2π through degrees, of 25 m/s, of 1e5 Pa.
        assert!(angles < 2e-6 && others < 5e-6, "{format:?}: {angles} {others}");
        // GLOBAL_POSITION_INT counts cm/s.
        let quantum = if format == Format::Tlog { 0.0051 } else { 5e-6 };
        assert!(velocity < quantum, "{format:?}: {velocity}");
    }
}

#[test]
fn targets_of_px4_come_from_its_quaternion() {
    let mut truth = samples(400);
    for (i, sample) in truth.iter_mut().enumerate() {
        let t = i as f64 * 0.01;
        (sample.roll_target_rad, sample.pitch_target_rad) = (0.9 * t.sin(), 0.3 * t.cos());
    }
    let read = read(&ulog(&truth)).flight.samples;
    for (a, b) in truth.iter().zip(&read) {
        // Single precision.
        assert!((a.roll_target_rad - b.roll_target_rad).abs() < 1e-5, "{a:?} {b:?}");
        assert!((a.pitch_target_rad - b.pitch_target_rad).abs() < 1e-5);
    }
}

#[test]
fn a_motor_that_px4_stops_has_no_throttle() {
    let mut truth = samples(400);
    truth[150..250].iter_mut().for_each(|sample| sample.throttle_cmd = 0.0);
    let read = read(&ulog(&truth)).flight.samples;
    for (a, b) in truth.iter().zip(&read) {
        assert!((a.throttle_cmd - b.throttle_cmd).abs() < 1e-6, "{} {}", a.time_s, b.throttle_cmd);
    }
}

#[test]
fn a_file_cut_anywhere_is_read_up_to_there_with_a_warning() {
    let truth = samples(60);
    for bytes in [ulog(&truth), dataflash(&truth), tlog(&truth)] {
        for end in (bytes.len() - 300)..bytes.len() - 1 {
            let log = read(&bytes[..end]);
            assert!((56..=60).contains(&log.flight.samples.len()));
        }
        // One byte short of a whole record.
        let log = read(&bytes[..bytes.len() - 1]);
        assert!(log.findings.iter().any(|f| f.text.contains("middle of a record")));
    }
}

fn problems(samples: &[Sample]) -> String {
    let path = tempfile::tempdir().unwrap();
    let file = path.path().join("flight.csv");
    std::fs::write(&file, csv(samples)).unwrap();
    let log = inspect(&file, &Options::default()).unwrap();
    let of = log.findings.iter().filter(|f| f.severity == Severity::Problem);
    of.map(|f| f.text.as_str()).collect::<Vec<_>>().join("\n")
}

#[test]
fn wrong_units_are_named() {
    let truth = samples(6000);
    assert_eq!(problems(&truth), "");
    let with = |change: fn(&mut Sample)| {
        let mut rows = truth.clone();
        rows.iter_mut().for_each(change);
        problems(&rows)
    };
    let degrees = with(|s| s.attitude_rad = s.attitude_rad.map(f64::to_degrees));
    assert!(degrees.contains("roll and pitch look like degrees"), "{degrees}");
    let rates = with(|s| s.rates_radps = s.rates_radps.map(f64::to_degrees));
    assert!(rates.contains("p, q, r look like degrees"), "{rates}");
    let kmh = with(|s| s.airspeed_mps *= 3.6);
    assert!(kmh.contains("km/h"), "{kmh}");
    // Turns tell it where no velocity over ground is logged.
    let alone =
        with(|s| (s.airspeed_mps, s.velocity_ned_mps) = (s.airspeed_mps * 3.6, [f64::NAN; 3]));
    assert!(alone.contains("km/h"), "{alone}");
    let knots = with(|s| s.airspeed_mps *= 1.943_844);
    assert!(knots.contains("knots"), "{knots}");
    let g = with(|s| s.specific_force_mps2 = s.specific_force_mps2.map(|a| a / 9.80665));
    assert!(g.contains("looks like g,"), "{g}");
    let up = with(|s| s.specific_force_mps2[2] *= -1.0);
    assert!(up.contains("positive up"), "{up}");
    let dead = with(|s| s.rates_radps[1] = 0.25);
    assert!(dead.contains("q_radps is constantly 0.25"), "{dead}");
    let standing = with(|s| s.airspeed_mps = 1.0 + 0.1 * s.time_s.sin());
    assert!(standing.contains("no flight in this log"), "{standing}");
}

#[test]
fn a_mapping_overrides_what_the_format_means() {
    let truth = samples(200);
    let mut wrong = truth.clone();
    wrong.iter_mut().for_each(|s| s.airspeed_mps *= 3.6);
    let text = |from: &str| {
        format!(
            "schema = 1\n[columns]\nairspeed_mps = {{ from = \"{from}\", scale = 0.2777777777777778 }}\n"
        )
    };
    for (from, bytes) in [
        ("csv.airspeed_mps", csv(&wrong)),
        ("airspeed_validated.true_airspeed_m_s", ulog(&wrong)),
        ("VFR_HUD.airspeed", tlog(&wrong)),
    ] {
        let mapping = Mapping::parse(&text(from), Path::new("mapping.toml")).unwrap();
        let log =
            parse(&bytes, Path::new("f"), &Options { mapping, ..Options::default() }).unwrap();
        assert!(difference(&truth, &log.flight.samples)[1] < 5e-6, "{from}");
    }
    for bad in [
        "schema = 2\n[columns]\n",
        "schema = 1\n[columns]\nspeed = { from = \"a.b\" }",
        "schema = 1\n[columns]\nroll_rad = { from = \"a\" }",
    ] {
        assert!(
            Mapping::parse(bad, Path::new("m.toml")).unwrap_err().to_string().contains("m.toml")
        );
    }
}

#[test]
fn foreign_empty_and_incomplete_files_are_refused_by_name() {
    let refuse =
        |bytes: &[u8]| parse(bytes, Path::new("odd.bin"), &Options::default()).unwrap_err();
    assert!(matches!(refuse(b""), LogError::Empty { .. }));
    assert!(matches!(refuse(b"\x89PNG\r\n\x1a\n0000"), LogError::Foreign { .. }));
    let mut bare = samples(300);
    bare.iter_mut().for_each(|s| s.airspeed_mps = f64::NAN);
    let error = refuse(&ulog(&bare)).to_string();
    assert!(error.contains("odd.bin") && error.contains("`airspeed_mps`"), "{error}");
    assert!(error.contains("airspeed_validated.true_airspeed_m_s"), "{error}");
}

#[test]
fn nothing_is_carried_across_a_gap_of_a_channel() {
    let mut rows = samples(1000);
    // The sensor of incidence is silent for 0.3 s.
    rows[400..430].iter_mut().for_each(|s| s.alpha_rad = f64::NAN);
    let log = read(&ulog(&rows));
    let missing = |s: &&Sample| s.alpha_rad.is_nan();
    assert_eq!(log.flight.samples.iter().filter(missing).count(), 30);
}

/// A sample file of the house; `None` with a reason on the terminal if it is not there.
fn shared(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let root = std::env::var_os("GREYLAG_SHARED").map_or(beside, PathBuf::from);
    let path = root.join("data/logs").join(name);
    if !path.exists() {
        println!(
            "skipped: {name} is not there (set GREYLAG_SHARED to the folder that holds data/logs)"
        );
    }
    path.exists().then_some(path)
}

#[test]
fn a_real_px4_log_on_the_ground_says_so() {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/px4_vtol_sample_log_small.ulg");
    let log = inspect(&path, &Options::default()).unwrap();
    // Counts by pyulog 1.3.0.
    let counted = |n: &str| log.topics.iter().find(|t| t.0 == n).map(|t| t.2);
    assert_eq!(counted("vehicle_attitude"), Some(1298));
    assert_eq!(counted("vehicle_angular_velocity"), Some(1812));
    let text: String = log.findings.iter().map(|f| f.to_string()).collect();
    assert!(text.contains("no flight in this log") && text.contains("dropped out 1 times, 30 ms"));
    // its pitot shows −3.6 to −1.1 m/s at rest, which is no reason to refuse it; there is no flight to compare
    let flight = load(&path, &Options::default()).unwrap().flight;
    assert!(flight.samples.iter().all(|s| s.airspeed_mps < 5.0));
}

#[test]
fn real_ardupilot_logs_are_read_where_they_lie() {
    if let Some(path) = shared("ardupilot_quadplane_sitl_vtol.tlog") {
        let log = inspect(&path, &Options::default()).unwrap();
        // pymavlink 2.4.50 counts 888 ATTITUDE, two of which repeat a time; 337 are of flight on the wings, or of the ground.
        assert_eq!(log.flight.samples.len(), 337);
        let roll = log.channels.iter().find(|c| c.columns.iter().any(|n| n == "roll_rad")).unwrap();
        assert_eq!(roll.samples, 886);
    }
    if let Some(path) = shared("arduplane_3.8.2_pymavlink_test.BIN") {
        let log = inspect(&path, &Options::default()).unwrap();
        let first = log.flight.samples[1];
        assert_eq!(log.flight.samples.len(), 45);
        // First IMU record as pymavlink reads it: rates are the table's own times.
        let s = log.flight.samples[0];
        assert!((s.rates_radps[0] + 0.1165708526968956).abs() < 1e-12);
        assert!((s.specific_force_mps2[2] + 9.780994415283203).abs() < 1e-12);
        // ATT begins a millisecond later: roll −7.18° there.
        assert!((first.attitude_rad[0].to_degrees() + 7.18).abs() < 0.3, "{first:?}");
    }
}

#[test]
fn ten_minutes_at_100_hz_are_read_in_a_second() {
    let truth = samples(60_000);
    for bytes in [csv(&truth), ulog(&truth), dataflash(&truth), tlog(&truth)] {
        let before = Instant::now();
        let log = read(&bytes);
        let took = before.elapsed().as_secs_f64();
        println!("{}: {:.1} MB in {took:.3} s", log.format.name(), bytes.len() as f64 / 1e6);
        assert_eq!(log.flight.samples.len(), 60_000);
        // The limit is for an optimised build on an idle machine.
        assert!(cfg!(debug_assertions) || took < 1.0, "{took}");
    }
}

/// pyulog and pymavlink read what the writers of these tests write: the formats are the real ones.
#[test]
fn other_readers_read_the_same_numbers() {
    let python = std::env::var("GREYLAG_PYTHON").unwrap_or("python3".into());
    let have = |m: &str| {
        let import =
            std::process::Command::new(&python).args(["-c", &format!("import {m}")]).output();
        import.is_ok_and(|o| o.status.success())
    };
    if !have("pyulog, pymavlink") {
        println!(
            "skipped: {python} lacks pyulog or pymavlink (name one that has them in GREYLAG_PYTHON)"
        );
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let truth = samples(300);
    for (name, bytes) in [
        ("flight.csv", csv(&truth)),
        ("flight.ulg", ulog(&truth)),
        ("flight.bin", dataflash(&truth)),
        ("flight.tlog", tlog(&truth)),
    ] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/logs_crosscheck.py");
    let run = std::process::Command::new(&python).arg(script).arg(folder.path()).output().unwrap();
    let (said, complained) =
        (String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    println!("{said}");
    assert!(run.status.success(), "{said}{complained}");
}

/// The records of a ULog, each with its header, behind the header of the file.
fn ulog_records(log: &[u8]) -> Vec<Vec<u8>> {
    let (mut records, mut at) = (Vec::new(), 16);
    while at < log.len() {
        let size = usize::from(u16::from_le_bytes([log[at], log[at + 1]]));
        records.push(log[at..at + 3 + size].to_vec());
        at += 3 + size;
    }
    records
}

/// A flight as a ULog that subscribes to each topic again in the middle, under message numbers that are higher by `later`.
fn resubscribed(samples: &[Sample], later: u8) -> Vec<u8> {
    let log = ulog(samples);
    let records = ulog_records(&log);
    let again: Vec<Vec<u8>> = records.iter().filter(|r| r[2] == b'A').cloned().collect();
    let middle = again.len() * (samples.len() / 2);
    let (mut out, mut data) = (log[..16].to_vec(), 0);
    for mut record in records {
        if record[2] == b'D' {
            if data == middle {
                for mut subscription in again.clone() {
                    subscription[4] += later;
                    out.extend(subscription);
                }
            }
            record[3] += if data < middle { 0 } else { later };
            data += 1;
        }
        out.extend(record);
    }
    out
}

#[test]
fn a_topic_of_a_ulog_that_is_subscribed_to_again_continues_its_series() {
    let truth = samples(400);
    for later in [0, 20] {
        let log = read(&resubscribed(&truth, later));
        let [angles, others, _] = difference(&truth, &log.flight.samples);
        assert!(angles < 2e-6 && others < 5e-6, "{later}: {angles} {others}");
        let count = log.topics.iter().find(|(name, ..)| name == "vehicle_attitude").map(|t| t.2);
        assert_eq!(count, Some(400), "{later}");
    }
}

#[test]
fn records_without_a_format_and_records_without_a_subscription_are_counted_apart() {
    let truth = samples(400);
    let log = ulog(&truth);
    let without = |kind: u8, name: &str| -> Vec<u8> {
        let of =
            |r: &Vec<u8>| r[2] == kind && r.windows(name.len()).any(|part| part == name.as_bytes());
        let kept = ulog_records(&log).into_iter().filter(|r| !of(r));
        log[..16].iter().copied().chain(kept.flatten()).collect()
    };
    let said = |bytes: &[u8]| {
        let log = read(bytes);
        assert_eq!(log.flight.samples.len(), 400);
        let lost = log.findings.iter().filter(|f| f.text.contains("left out"));
        lost.map(|f| f.text.clone()).collect::<Vec<_>>()
    };
    // No column needs the target.
    let name = "vehicle_attitude_setpoint";
    let formless = "the file lacks the format of 1 topics that it subscribes to: their 400 records were left out";
    assert_eq!(said(&without(b'F', name)), [formless]);
    let undeclared = "400 records of topics that the file does not declare were left out";
    assert_eq!(said(&without(b'A', name)), [undeclared]);
}
