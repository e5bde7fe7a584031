//! Long logs: read in pieces they are the same, and a look at one holds stretches of it.

use std::io::Write;
use std::path::Path;

use crate::logs_support::*;
use greylag::logs::info::Info;
use greylag::logs::{Log, Options, Sample, inspect, load, parse};

/// Rows of 100 Hz for half an hour, of which a look keeps some.
const LONG: usize = 180_000;
/// Most rows that a look keeps.
const KEPT: usize = 65_536;

fn written(name: &str, bytes: &[u8]) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// Everything of a log, its numbers to the bit.
fn whole(log: &Log) -> String {
    format!("{log:?}")
}

#[test]
#[cfg(unix)]
fn a_log_that_comes_in_pieces_is_the_log_that_is_read_whole() {
    let truth = samples(400);
    let binary = dataflash(&truth);
    let text = in_text(&binary, "ArduPlane V4.6.0").into_bytes();
    let quoted = [&b"\"time_s\""[..], &csv(&truth)["time_s".len()..]].concat();
    for bytes in [csv(&truth), quoted, ulog(&truth), binary, tlog(&truth), text] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight");
        let at_once = parse(&bytes, &path, &Options::default()).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let pipe = path.clone();
        let writer = std::thread::spawn(move || {
            let mut pipe = std::fs::OpenOptions::new().write(true).open(pipe).unwrap();
            let mut rest = &bytes[..];
            for size in (1..900).cycle() {
                let (piece, after) = rest.split_at(size.min(rest.len()));
                pipe.write_all(piece).unwrap();
                rest = after;
                if rest.is_empty() {
                    break;
                }
            }
        });
        let in_pieces = load(&path, &Options::default()).unwrap();
        writer.join().unwrap();
        assert_eq!(whole(&in_pieces), whole(&at_once));
    }
}

/// A long flight between half minutes on the ground, with a pause of 3 s; p keeps one value for 5 s.
fn long() -> Vec<Sample> {
    let mut rows = samples(LONG);
    let flown = rows[3000].time_s..rows[LONG - 3000].time_s;
    for row in &mut rows {
        if !flown.contains(&row.time_s) {
            row.airspeed_mps = 0.5;
        }
    }
    for i in 100_000..100_500 {
        rows[i].rates_radps[0] = rows[100_000].rates_radps[0];
    }
    rows.drain(50_000..50_300);
    rows
}

#[test]
fn a_look_at_a_long_log_holds_stretches_and_knows_the_whole() {
    let rows = long();
    for (name, bytes) in
        [("l.ulg", ulog(&rows)), ("l.bin", dataflash(&rows)), ("l.csv", csv(&rows))]
    {
        let (_folder, path) = written(name, &bytes);
        let looked = inspect(&path, &Options::default()).unwrap();
        let whole = load(&path, &Options::default()).unwrap();
        assert!(looked.flight.samples.len() <= KEPT, "{name}: {}", looked.flight.samples.len());
        assert!(whole.flight.samples.len() > 2 * KEPT, "{name}");
        let (look, all) = (Info::of(&looked), Info::of(&whole));
        let near =
            |a: f64, b: f64, within: f64| assert!((a - b).abs() <= within, "{name}: {a} {b}");
        near(look.rows as f64, all.rows as f64, 600.0);
        near(look.from_s, all.from_s, 0.1);
        near(look.to_s, all.to_s, 0.1);
        // A pause is no flight, where its rows were looked at.
        near(look.flight_s, all.flight_s, 12.0);
        near(look.rate_hz, all.rate_hz, 1e-6);
        near(look.gaps[0].0, all.gaps[0].0, 1e-9);
        near(look.gaps[0].1, all.gaps[0].1, 1e-9);
        assert_eq!(look.gaps.len(), 1, "{name}: {:?}", look.gaps);
        for (a, b) in look.channels.iter().zip(&all.channels) {
            assert_eq!((&a.columns, a.quality.interpolated), (&b.columns, b.quality.interpolated));
            near(a.samples as f64 / b.samples as f64, 1.0, 0.01);
            near(a.largest_gap_s, b.largest_gap_s, 0.1);
            near(a.rate_hz / b.rate_hz, 1.0, 1e-6);
        }
        let stuck =
            |info: &Info| info.findings.iter().any(|f| f.text.contains("p_radps does not change"));
        assert!(stuck(&all) && stuck(&look), "{name}");
        assert!(look.findings.iter().any(|f| f.text.contains("long log")), "{name}");
        let served = |info: &Info| -> Vec<bool> {
            info.purposes.iter().map(|p| p.missing.is_empty() && p.slow.is_empty()).collect()
        };
        assert_eq!(served(&look), served(&all), "{name}: {:?} {:?}", look.purposes, all.purposes);
    }
}

/// A change of a row, and what is said of it.
type Turned = (fn(&mut Sample), &'static str);

#[test]
fn a_look_at_a_long_log_finds_a_wrong_unit_and_a_turned_axis() {
    let turned: [Turned; 2] = [
        (|s| s.rates_radps = s.rates_radps.map(f64::to_degrees), "degrees a second"),
        (|s| s.specific_force_mps2[2] *= -1.0, "positive up"),
    ];
    for (turn, wrong) in turned {
        let mut rows = samples(LONG / 2);
        rows.iter_mut().for_each(turn);
        let (_folder, path) = written("l.csv", &csv(&rows));
        let looked = inspect(&path, &Options::default()).unwrap();
        let said: Vec<&str> = looked.findings.iter().map(|f| f.text.as_str()).collect();
        assert!(looked.stretches.is_some() && looked.flight.samples.len() <= KEPT);
        assert!(said.iter().any(|text| text.contains(wrong)), "{said:?}");
    }
}

#[test]
fn a_second_recording_behind_a_long_one_is_found() {
    let first = samples(80_000);
    let mut second = samples(2_000);
    second.iter_mut().for_each(|row| row.time_s -= 9.0);
    let header = csv(&second).iter().position(|b| *b == b'\n').unwrap() + 1;
    let bytes = [csv(&first), csv(&second)[header..].to_vec()].concat();
    let (_folder, path) = written("two.csv", &bytes);
    let both = greylag::logs::inspect_all(Path::new(&path), &Options::default()).unwrap();
    assert_eq!(both.len(), 2);
    assert_eq!(both[1].flight.samples.len(), 2_000);
}
