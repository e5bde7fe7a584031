//! Logs as people bring them: several lives, vehicles and instances in a file, sensors that hang or come late, tables
//! of other programs, damage in the middle. The files and the right answers: `tests/data/odd_logs/README.md`.

use std::io::Read;
use std::path::{Path, PathBuf};

use greylag::logs::info::Info;
use greylag::logs::mapping::Mapping;
use greylag::logs::vehicle::Kind;
use greylag::logs::{Log, Options, Sample, flights, inspect, load};

fn odd(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/odd_logs").join(name)
}

fn good() -> String {
    std::fs::read_to_string(odd("good.csv")).unwrap()
}

fn read(path: &Path) -> Log {
    load(path, &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// The bytes of a file of the folder, unpacked.
fn unpacked(name: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(odd(name)).unwrap();
    flate2::read::GzDecoder::new(file).read_to_end(&mut bytes).unwrap();
    bytes
}

/// What `bytes` read as in a file of their own.
fn through_file<T>(name: &str, bytes: &[u8], read: impl Fn(&Path) -> T) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path)
}

fn said(log: &Log) -> String {
    log.findings.iter().map(|f| f.to_string()).collect::<Vec<_>>().join("\n")
}

/// `good.csv` with one column of each row rewritten.
fn rewritten(column: &str, new: impl Fn(usize, f64, f64) -> String) -> String {
    let text = good();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let place = header.split(',').position(|name| name == column).unwrap();
    let mut out = format!("{header}\n");
    for (k, line) in lines.enumerate() {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        fields[place] = new(k, fields[0].parse().unwrap(), fields[place].parse().unwrap());
        out += &(fields.join(",") + "\n");
    }
    out
}

/// The largest difference of a value between two tables.
fn worst(a: &[Sample], b: &[Sample], of: impl Fn(&Sample) -> f64) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (of(a) - of(b)).abs()).fold(0.0, f64::max)
}

#[test]
fn a_reboot_in_flight_makes_two_flights_and_loses_no_row() {
    let path = odd("tlog_reboot_midflight.tlog.gz");
    let both = flights(&path, &Options::default()).unwrap();
    let rows: Vec<usize> = both.iter().map(|log| log.flight.samples.len()).collect();
    assert_eq!(rows, [201, 199]);
    assert!(both[1].flight.name.ends_with("#2"), "{}", both[1].flight.name);
    // One of them is named by its number; alone, the longest speaks of the other.
    let second = PathBuf::from(format!("{}#2", path.display()));
    assert_eq!(read(&second).flight.samples.len(), 199);
    assert!(said(&read(&path)).contains("the file holds 2 flights"));
    let none = PathBuf::from(format!("{}#3", path.display()));
    let error = load(&none, &Options::default()).unwrap_err().to_string();
    assert!(error.contains("holds 2 flights"), "{error}");
}

#[test]
fn the_commands_of_a_vtol_s_wings_are_read_and_said() {
    let log = read(&odd("px4_vtol_torque_instance1.ulg.gz"));
    let good = read(&odd("px4_good.ulg.gz"));
    let [a, b] = [&log, &good].map(|log| &log.flight.samples);
    assert!(worst(a, b, |s| s.aileron_cmd) < 1e-9 && worst(a, b, |s| s.throttle_cmd) < 1e-9);
    assert!(
        said(&log).contains("vehicle_torque_setpoint: instance 1 is read, for 0 never changes")
    );
    // The user has the last word: the dead instance is read, and named as what it is.
    let sources = vec!["vehicle_torque_setpoint=0".parse().unwrap()];
    let options = Options { sources, ..Options::default() };
    let dead = load(&odd("px4_vtol_torque_instance1.ulg.gz"), &options).unwrap();
    let problems = dead.problems().unwrap();
    assert!(problems.contains("not what flies the aircraft"), "{problems}");
}

#[test]
fn of_two_pitots_the_one_that_works_is_read_and_said() {
    let log = read(&odd("px4_airspeed0_dead_airspeed1_good.ulg.gz"));
    let info = Info::of(&log);
    assert!(info.flight_s > 7.0);
    assert!(
        said(&log).contains("airspeed: instance 1 is read, for 0 never changes"),
        "{}",
        said(&log)
    );
    let read: Vec<&str> =
        info.sources.iter().filter(|s| s.read).map(|s| s.instance.as_str()).collect();
    assert_eq!(read, ["1"]);
}

#[test]
fn straight_lines_between_slow_samples_serve_for_nothing() {
    let log = inspect(&odd("interpolated_slow.csv"), &Options::default()).unwrap();
    let problems = log.problems().unwrap();
    for words in ["straight lines", "p_radps (1.7 Hz)", "elevator_cmd (0.2 Hz)"] {
        assert!(problems.contains(words), "{words}: {problems}");
    }
    let info = Info::of(&log);
    let slow = &info.purposes[0].slow;
    assert!(slow.iter().any(|s| s == "p_radps 1.7 Hz; wanted ≥ 10"), "{slow:?}");
    // The flight itself is fast enough.
    let info = Info::of(&read(&odd("good.csv")));
    assert!(info.purposes.iter().all(|p| p.missing.is_empty() && p.slow.is_empty()));
}

#[test]
fn slow_commands_with_empty_fields_between_them_serve_for_nothing() {
    let slow = |column: &'static str| {
        rewritten(column, |k, _, x| if k % 500 == 0 { x.to_string() } else { String::new() })
    };
    let log = through_file("slow.csv", slow("elevator_cmd").as_bytes(), |path| {
        inspect(path, &Options::default()).unwrap()
    });
    let slow = Info::of(&log).purposes[0].slow.join(" ");
    assert!(slow.contains("elevator_cmd 0.2 Hz; wanted ≥ 10"), "{slow}");
}

#[test]
fn a_pitot_that_hangs_counts_as_missing_there() {
    let stuck = rewritten("airspeed_mps", |_, t, x| {
        (if (5.0..10.0).contains(&t) { 14.321 } else { x }).to_string()
    });
    let log = through_file("stuck.csv", stuck.as_bytes(), read);
    let words = "airspeed_mps does not change in flight from 5.00 to 9.99 s: frozen; these rows count as missing";
    assert!(said(&log).contains(words), "{}", said(&log));
    let samples = &log.flight.samples;
    assert_eq!(samples.len(), 1500);
    let empty = samples.iter().filter(|s| s.airspeed_mps.is_nan()).count();
    assert!((498..=500).contains(&empty), "{empty}");
}

#[test]
fn a_pitot_that_hangs_for_less_than_a_second_is_named_too() {
    let stuck = rewritten("airspeed_mps", |_, t, x| {
        (if (5.0..6.0).contains(&t) { 14.321 } else { x }).to_string()
    });
    let log = through_file("stuck.csv", stuck.as_bytes(), read);
    assert!(
        said(&log).contains("airspeed_mps does not change in flight from 5.00 to 5.99 s: frozen")
    );
    let empty = log.flight.samples.iter().filter(|s| s.airspeed_mps.is_nan()).count();
    assert!((98..=100).contains(&empty), "{empty}");
}

#[test]
fn gyros_that_hang_leave_a_gap() {
    let stuck = rewritten("q_radps", |_, t, x| {
        (if (5.0..8.0).contains(&t) { 0.0123 } else { x }).to_string()
    });
    let log = through_file("stuck.csv", stuck.as_bytes(), read);
    assert!(
        said(&log).contains("q_radps does not change in flight from 5.00 to"),
        "{}",
        said(&log)
    );
    assert!(log.flight.samples.iter().all(|s| !(5.05..7.95).contains(&s.time_s)));
    assert_eq!(log.dropped, 0, "left out on purpose, not as unusable");
}

#[test]
fn spikes_are_named_and_cost_nothing() {
    let spiky =
        rewritten("airspeed_mps", |k, _, x| (if k % 250 == 100 { 95.0 } else { x }).to_string());
    let log = through_file("spiky.csv", spiky.as_bytes(), read);
    assert!(said(&log).contains("airspeed_mps: 6 spikes, the largest to 95.0"), "{}", said(&log));
    assert_eq!(log.flight.samples.len(), 1500);
}

#[test]
fn a_late_gps_is_named_with_its_delay() {
    let rows = read(&odd("good.csv")).flight.samples;
    let mut late = rows.clone();
    for k in 150..rows.len() {
        late[k].velocity_ned_mps = rows[k - 150].velocity_ned_mps;
    }
    let mut bytes = Vec::new();
    greylag::logs::csv::write(&late.into(), &mut bytes).unwrap();
    let log = through_file("late.csv", &bytes, read);
    let problems = log.problems().unwrap();
    assert!(problems.contains("velocity over ground is 1.5 s late"), "{problems}");
}

#[test]
fn two_recordings_in_one_table_are_two_flights() {
    let text = good();
    let rows: Vec<&str> = text.lines().collect();
    let twice = format!("{}\n{}\n", rows.join("\n"), rows[1..].join("\n"));
    let both = through_file("twice.csv", twice.as_bytes(), |path| {
        flights(path, &Options::default()).unwrap()
    });
    let rows: Vec<usize> = both.iter().map(|log| log.flight.samples.len()).collect();
    assert_eq!(rows, [1500, 1500]);
}

#[test]
fn a_quaternion_and_microseconds_are_read_whichever_part_comes_first() {
    let truth = read(&odd("good.csv")).flight.samples;
    let text = |order: [usize; 4]| {
        let names = ["q[0]", "q[1]", "q[2]", "q[3]"].join(",");
        let mut out = format!(
            "timestamp,{names},p_radps,q_radps,r_radps,airspeed_mps,ax_mps2,ay_mps2,az_mps2,aileron_cmd,elevator_cmd,throttle_cmd\n"
        );
        for s in &truth {
            let [r, p, y] = s.attitude_rad.map(|x| 0.5 * x);
            let q = [
                r.cos() * p.cos() * y.cos() + r.sin() * p.sin() * y.sin(),
                r.sin() * p.cos() * y.cos() - r.cos() * p.sin() * y.sin(),
                r.cos() * p.sin() * y.cos() + r.sin() * p.cos() * y.sin(),
                r.cos() * p.cos() * y.sin() - r.sin() * p.sin() * y.cos(),
            ];
            let q = order.map(|i| q[i].to_string()).join(",");
            let [a, b, c] = s.rates_radps;
            let [x, y, z] = s.specific_force_mps2;
            let stamp = 1e6 * (100.0 + s.time_s);
            out += &format!(
                "{stamp:.0},{q},{a},{b},{c},{},{x},{y},{z},{},{},{}\n",
                s.airspeed_mps, s.aileron_cmd, s.elevator_cmd, s.throttle_cmd
            );
        }
        out
    };
    for order in [[0, 1, 2, 3], [1, 2, 3, 0]] {
        let log = through_file("ulog2csv.csv", text(order).as_bytes(), read);
        let samples = &log.flight.samples;
        assert!(worst(samples, &truth, |s| s.attitude_rad[0]) < 1e-9, "{order:?}");
        assert!((samples[1].time_s - samples[0].time_s - 0.01).abs() < 1e-6);
    }
    // A mapping says the order and other names.
    let other = text([1, 2, 3, 0]).replace("q[0],q[1],q[2],q[3]", "qa,qb,qc,qd");
    let toml = "schema = 1\n[attitude]\nquaternion = [\"csv.qa\", \"csv.qb\", \"csv.qc\", \"csv.qd\"]\norder = \"xyzw\"\n";
    let mapping = Mapping::parse(toml, Path::new("m.toml")).unwrap();
    let options = Options { mapping, ..Options::default() };
    let log = through_file("own.csv", other.as_bytes(), |path| load(path, &options).unwrap());
    assert!(worst(&log.flight.samples, &truth, |s| s.attitude_rad[1]) < 1e-9);
}

#[test]
fn text_as_a_spreadsheet_writes_it_is_read() {
    let truth = read(&odd("good.csv")).flight.samples;
    let wide: Vec<u8> =
        format!("\u{feff}{}", good()).encode_utf16().flat_map(u16::to_le_bytes).collect();
    let german = good().replace(',', ";").replace('.', ",");
    let tabs = good().replace(',', "\t");
    for (name, bytes) in
        [("utf16.csv", &wide[..]), ("de.csv", german.as_bytes()), ("t.csv", tabs.as_bytes())]
    {
        let samples = through_file(name, bytes, read).flight.samples;
        // What is missing is no number, which equals nothing.
        assert_eq!(format!("{samples:?}"), format!("{truth:?}"), "{name}");
    }
}

#[test]
fn dates_count_as_seconds() {
    let dated =
        rewritten("time_s", |k, _, _| format!("2026-11-27T07:42:{:06.3}Z", 0.01 * k as f64));
    let log = through_file("dated.csv", dated.as_bytes(), read);
    let samples = &log.flight.samples;
    assert_eq!(samples.len(), 1500);
    assert!((samples[1499].time_s - samples[0].time_s - 14.99).abs() < 1e-5);
}

#[test]
fn jsbsim_s_own_table_is_read_with_its_units() {
    let truth = read(&odd("good.csv")).flight.samples;
    let mut text = String::from(
        "Time,Aileron Command (norm),Elevator Command (norm),P (deg/s),Q (deg/s),R (deg/s),V_{Total} (ft/s),\
         Phi (deg),Theta (deg),Psi (deg),Altitude ASL (ft),/fdm/jsbsim/fcs/throttle-cmd-norm,/fdm/jsbsim/sim-extra\n",
    );
    for s in &truth {
        let [p, q, r] = s.rates_radps.map(f64::to_degrees);
        let [phi, theta, psi] = s.attitude_rad.map(f64::to_degrees);
        let (v, h) = (s.airspeed_mps / 0.3048, s.altitude_m / 0.3048);
        text += &format!(
            "{},{},{},{p},{q},{r},{v},{phi},{theta},{psi},{h},{},0\n",
            s.time_s, s.aileron_cmd, s.elevator_cmd, s.throttle_cmd
        );
    }
    let log = through_file("JSBout.csv", text.as_bytes(), read);
    let samples = &log.flight.samples;
    assert!(worst(samples, &truth, |s| s.rates_radps[0]) < 1e-9);
    assert!(worst(samples, &truth, |s| s.airspeed_mps) < 1e-9);
    assert!(worst(samples, &truth, |s| s.altitude_m) < 1e-6);
    assert!(said(&log).contains("roll_rad from Phi (deg)"), "{}", said(&log));
}

#[test]
fn damage_in_the_middle_of_a_ulog_costs_what_was_damaged() {
    let whole = unpacked("px4_good.ulg.gz");
    let rows = |bytes: &[u8]| through_file("damaged.ulg", bytes, read);
    let all = rows(&whole).flight.samples.len();
    for at in [whole.len() / 3, whole.len() / 2, 2 * whole.len() / 3] {
        let mut bytes = whole.clone();
        for (k, byte) in bytes[at..at + 300].iter_mut().enumerate() {
            *byte = (k * 37 % 251) as u8;
        }
        let log = rows(&bytes);
        let kept = log.flight.samples.len();
        assert!(kept + 20 > all, "{at}: {kept} of {all}");
        assert!(
            said(&log).contains("it is damaged there") && said(&log).contains("s of records lost")
        );
    }
}

#[test]
fn what_was_right_stays_right() {
    let one = read(&odd("tlog_one.tlog.gz"));
    assert_eq!(one.vehicle.as_ref().map(|v| v.kind), Some(Kind::FixedWing));
    for name in ["tlog_pc_clock_jump.tlog.gz", "tlog_v1_v2_mixed.tlog.gz"] {
        let log = read(&odd(name));
        assert_eq!(log.flight.samples.len(), one.flight.samples.len(), "{name}");
        assert_eq!(log.problems(), None, "{name}");
    }
    let cut = inspect(&odd("px4_truncated.ulg.gz"), &Options::default()).unwrap();
    assert!(said(&cut).contains("ends in the middle of a record"), "{}", said(&cut));
    assert!(read(&odd("good.csv")).findings.is_empty());
}

#[test]
fn a_clock_that_is_set_in_flight_leaves_a_gap_in_one_flight() {
    let set = rewritten("time_s", |_, t, _| (if t < 5.0 { t } else { t + 3600.0 }).to_string());
    let log = through_file("set.csv", set.as_bytes(), read);
    let info = Info::of(&log);
    assert_eq!((log.flight.samples.len(), info.gaps.len()), (1500, 1));
    assert!((info.flight_s - 15.0).abs() < 0.1);
}
