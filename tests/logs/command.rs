//! `greylag logs` as a user runs it: what a log holds, converted, with the exit status by severity.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use crate::logs_support::{csv, dataflash, samples, tlog, ulog};
use greylag::logs::{self, Options, Sample};

fn greylag(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_greylag")).arg("logs").args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// Ten seconds of flight, written by `write`.
fn flight(folder: &Path, write: fn(&[Sample]) -> Vec<u8>) -> PathBuf {
    // The name tells nothing: content does.
    put(folder, "flight.dat", &write(&samples(1000)))
}

#[test]
fn info_says_what_every_format_holds() {
    let folder = tempfile::tempdir().unwrap();
    for (name, write) in [
        ("CSV table", csv as fn(&[Sample]) -> Vec<u8>),
        ("PX4 ULog", ulog),
        ("ArduPilot DataFlash", dataflash),
        ("MAVLink telemetry log", tlog),
    ] {
        let path = flight(folder.path(), write);
        let output = greylag(&["info", path.to_str().unwrap()]);
        let said = text(&output.stdout);
        assert_eq!(output.status.code(), Some(0), "{said}{}", text(&output.stderr));
        for words in ["1000 rows", "100.0 Hz", name, "comparison in free run: yes", "in flight"] {
            assert!(said.contains(words), "{name} lacks {words:?}: {said}");
        }
        let output = greylag(&["info", path.to_str().unwrap(), "--json"]);
        let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(found["schema"], "greylag.log-info/1");
        assert_eq!((&found["rows"], &found["dropped_rows"]), (&1000.into(), &0.into()));
    }
}

#[test]
fn info_takes_several_logs() {
    let folder = tempfile::tempdir().unwrap();
    let good = put(folder.path(), "good.csv", &csv(&samples(1000)));
    let parked = put(folder.path(), "parked.csv", &csv(&samples(20)));
    let both = [good.to_str().unwrap(), parked.to_str().unwrap()];
    let output = greylag(&["info", both[0], both[1]]);
    let said = text(&output.stdout);
    assert!(said.contains("good.csv: CSV") && said.contains("parked.csv: CSV"), "{said}");
    // the worse of the two: 0.2 s are no flight
    assert_eq!(output.status.code(), Some(3), "{said}");
    let output = greylag(&["info", both[0], both[1], "--json"]);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found[0]["rows"], 1000);
    assert_eq!(found[1]["name"], "parked.csv");
}

#[test]
fn info_goes_on_after_a_log_that_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let good = put(folder.path(), "good.csv", &csv(&samples(1000)));
    let broken = put(folder.path(), "broken.csv", b"\x89PNG\r\n\x1a\n0000");
    let (good, broken) = (good.to_str().unwrap(), broken.to_str().unwrap());
    let output = greylag(&["info", broken, good]);
    let (said, failed) = (text(&output.stdout), text(&output.stderr));
    assert_eq!(output.status.code(), Some(3), "{said}{failed}");
    assert!(said.contains("good.csv: CSV") && failed.contains("broken.csv"), "{said}{failed}");
    // two logs were asked for: a list, though one is read
    let output = greylag(&["info", good, broken, "--json"]);
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), &found[0]["rows"]), (Some(3), &1000.into()));
    // none can be read
    let output = greylag(&["info", broken, "gone.ulg"]);
    let failed = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{failed}");
    assert!(failed.contains("broken.csv") && failed.contains("gone.ulg"), "{failed}");
}

#[test]
fn info_says_of_a_table_without_a_column_what_it_still_serves_for() {
    let folder = tempfile::tempdir().unwrap();
    let table = text(&csv(&samples(1000)));
    let renamed = table.replacen("airspeed_mps", "ias_kt", 1).replacen("az_mps2", "accel", 1);
    let path = put(folder.path(), "partial.csv", renamed.as_bytes());
    let output = greylag(&["info", path.to_str().unwrap()]);
    let said = text(&output.stdout);
    assert_eq!(output.status.code(), Some(3), "{said}{}", text(&output.stderr));
    for words in [
        "1000 rows",
        "comparison in free run: no, for want of airspeed_mps",
        "forces D, Y, L: no, for want of airspeed_mps",
        "alpha, beta: no, for want of a flight",
        "has no column `airspeed_mps`",
        "ias_kt",
    ] {
        assert!(said.contains(words), "{words:?} is missing: {said}");
    }
    // Without a time there are no rows, but the columns are still told.
    let timeless = table.replacen("time_s", "moment", 1);
    let path = put(folder.path(), "timeless.csv", timeless.as_bytes());
    let output = greylag(&["info", path.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(3));
    let said = text(&output.stdout);
    assert!(said.contains("has no column `time_s`"), "{said}");
    assert!(said.contains("comparison in free run: no, for want of time_s\n"), "{said}");
    // What is computed with is still refused.
    assert!(logs::load(&path, &Options::default()).is_err());
}

#[test]
fn convert_writes_the_same_table_once() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("table.csv");
    let output_path = out.to_str().unwrap();
    for (write, quantum) in
        [(ulog as fn(&[Sample]) -> Vec<u8>, 2e-6), (dataflash, 2e-6), (tlog, 2e-6)]
    {
        let path = flight(folder.path(), write);
        let arguments = ["convert", path.to_str().unwrap(), output_path];
        let output = greylag(&arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        assert!(text(&output.stdout).starts_with("1000 rows of flight.dat"));
        let back = logs::load(&out, &Options::default()).unwrap().flight.samples;
        for (a, b) in samples(1000).iter().zip(&back) {
            // Single precision of angles in degrees.
            assert!((a.attitude_rad[0] - b.attitude_rad[0]).abs() < quantum);
            assert!((a.elevator_cmd - b.elevator_cmd).abs() < quantum);
        }
        // A second time it is refused, and done with --force.
        let again = greylag(&arguments);
        assert_eq!(again.status.code(), Some(1));
        assert!(text(&again.stderr).contains("--force"), "{}", text(&again.stderr));
        assert!(greylag(&[&arguments[..], &["--force"]].concat()).status.success());
        fs::remove_file(&out).unwrap();
    }
}

#[test]
fn bad_files_fail_by_name_and_wrong_units_by_status() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.csv");
    let out = out.to_str().unwrap();
    for (name, bytes, words) in [
        ("empty.bin", &b""[..], "is empty"),
        ("photo.csv", b"\x89PNG\r\n\x1a\n0000", "no flight log"),
    ] {
        let path = put(folder.path(), name, bytes);
        for arguments in
            [vec!["info", path.to_str().unwrap()], vec!["convert", path.to_str().unwrap(), out]]
        {
            let output = greylag(&arguments);
            let said = text(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{said}");
            assert!(said.contains(name) && said.contains(words), "{said}");
        }
    }
    let gone = greylag(&["info", "gone.ulg"]);
    assert!(gone.status.code() == Some(1) && text(&gone.stderr).contains("gone.ulg"));
    // Degrees for radians in rates: read, converted, and said with status 3.
    let mut wrong = samples(1000);
    wrong.iter_mut().for_each(|s| s.rates_radps = s.rates_radps.map(f64::to_degrees));
    let path = put(folder.path(), "degrees.csv", &csv(&wrong));
    let info = greylag(&["info", path.to_str().unwrap()]);
    assert_eq!(info.status.code(), Some(3));
    assert!(text(&info.stdout).contains("p, q, r look like degrees"), "{}", text(&info.stdout));
    let converted = greylag(&["convert", path.to_str().unwrap(), out]);
    assert_eq!(converted.status.code(), Some(3), "{}", text(&converted.stderr));
    assert!(text(&converted.stderr).contains("look like degrees"));
    // A mapping that names no column is refused before anything is read.
    let mapping =
        put(folder.path(), "odd.toml", b"schema = 1\n[columns]\nspeed = { from = \"a.b\" }");
    let refused =
        greylag(&["info", path.to_str().unwrap(), "--mapping", mapping.to_str().unwrap()]);
    assert!(refused.status.code() == Some(1) && text(&refused.stderr).contains("odd.toml"));
}
