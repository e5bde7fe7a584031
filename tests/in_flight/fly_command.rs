//! `greylag fly` as a user runs it: the real program, its words and its exit status.

use std::io::{BufRead, BufReader};
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use crate::flight_support::{Client, Trouble, Vehicle, check_surfaces};
use crate::real_time;
use greylag::logs::csv::{self, Tolerance};

/// The program, run in a folder of its own, so that files are found by its source folder.
fn fly(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_greylag"));
    command
        .arg("fly")
        .args(arguments)
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command
}

/// Two ports of this machine that were free a moment ago.
fn free_ports() -> [u16; 2] {
    let sockets = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").unwrap());
    sockets.map(|s| s.local_addr().unwrap().port())
}

/// Asserts that the program ends with one line of error with these words, having left no file.
fn refused(arguments: &[&str], words: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let Output { status, stdout, stderr } = fly(folder.path(), arguments).output().unwrap();
    let said = String::from_utf8(stderr).unwrap();
    assert!(!status.success() && stdout.is_empty(), "{said}");
    assert_eq!(said.trim_end().lines().count(), 1, "{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "{word} in {said}"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_port_in_use_is_one_line_and_nothing_is_started() {
    let taken = UdpSocket::bind("127.0.0.1:0").unwrap();
    let address = format!("udpin:{}", taken.local_addr().unwrap());
    refused(
        &["--vehicle", &address, "--client", "udpin:127.0.0.1:0"],
        &[&address, "in use", "--vehicle"],
    );
    refused(
        &["--vehicle", "udpin:127.0.0.1:0", "--client", &address],
        &[&address, "in use", "--client"],
    );
}

#[test]
fn a_serial_port_that_cannot_be_had_is_one_line_with_the_remedy() {
    let words = ["serial:/dev/no-such-port:921600", "no such device", "plug", "--vehicle"];
    refused(&["--vehicle", "serial:/dev/no-such-port:921600"], &words);
    // A file that is no port.
    refused(&["--vehicle", "serial:/dev/null:921600"], &["/dev/null", "not a serial port"]);
}

#[test]
fn files_that_are_not_there_are_named() {
    refused(&["--model", "params/x8/nowhere.toml"], &["params/x8/nowhere.toml", "model"]);
    refused(&["--airframe", "nowhere.toml"], &["nowhere.toml", "airframe"]);
}

/// The words are those of sd_notify(3); systemd is a socket of ours.
#[cfg(unix)]
#[test]
fn systemds_watchdog_is_fed_while_the_control_loop_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notify");
    let systemd = std::os::unix::net::UnixDatagram::bind(&path).unwrap();
    systemd.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    let links = ["--vehicle", "udpin:127.0.0.1:0", "--client", "udpin:127.0.0.1:0"];
    let start = |watchdog: bool| {
        let mut command = fly(folder.path(), &links);
        command.args(["--controller", "lqi", "--no-record", "--duration-s", "2"]);
        command.env("NOTIFY_SOCKET", &path);
        if watchdog {
            command.env("WATCHDOG_USEC", "200000");
        }
        command.output().unwrap()
    };
    assert!(start(true).status.success());
    let mut word = [0; 64];
    for _ in 0..5 {
        let length = systemd.recv(&mut word).unwrap();
        assert_eq!(std::str::from_utf8(&word[..length]).unwrap().trim(), "WATCHDOG=1");
    }
    systemd.set_nonblocking(true).unwrap();
    while systemd.recv(&mut word).is_ok() {}
    // where no watchdog watches, nothing is said
    assert!(start(false).status.success());
    assert!(systemd.recv(&mut word).is_err());
}

/// As in `greylag fly | head`, or over a connection that is cut.
#[test]
fn a_flight_goes_on_without_a_reader_of_its_words() {
    let folder = tempfile::tempdir().unwrap();
    let links = ["--vehicle", "udpin:127.0.0.1:0", "--client", "udpin:127.0.0.1:0"];
    let mut command = fly(folder.path(), &links);
    command.args(["--controller", "lqi", "--no-record", "--duration-s", "2"]);
    let mut child = command.spawn().unwrap();
    let begun = Instant::now();
    drop((child.stdout.take(), child.stderr.take()));
    assert!(child.wait().unwrap().success());
    assert!(begun.elapsed() > Duration::from_secs(2));
}

#[test]
fn a_recording_is_not_overwritten() {
    let root = tempfile::tempdir().unwrap();
    let old = root.path().join("old");
    std::fs::create_dir(&old).unwrap();
    let arguments = ["--vehicle", "udpin:127.0.0.1:0", "--client", "udpin:127.0.0.1:0", "--record"];
    refused(&[&arguments[..], &[old.to_str().unwrap()]].concat(), &["exists already", "--record"]);
}

#[test]
fn arguments_that_make_no_sense_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, word) in [
        (["--controller", "magic"], "pid-retuned"),
        (["--vehicle", "14600"], "udpin:HOST:PORT"),
        (["--duration-s", "0"], "above zero"),
        (["--duration-s", "-4"], "above zero"),
        (["--plan-deadline-ms", "0"], "1..=1000"),
    ] {
        let output = fly(folder.path(), &arguments).output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && said.contains(word), "{said}");
    }
}

/// The program's next line that contains `part`; panics after ten seconds.
fn wait_for(lines: &mut impl Iterator<Item = std::io::Result<String>>, part: &str) -> String {
    let end = Instant::now() + Duration::from_secs(10);
    let mut heard = Vec::new();
    while Instant::now() < end {
        let Some(Ok(line)) = lines.next() else { break };
        if line.contains(part) {
            return line;
        }
        heard.push(line);
    }
    panic!("no line with {part:?} among {heard:#?}");
}

/// Ctrl-C.
fn interrupt(child: &Child) {
    let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(status.success());
}

fn a_flight_is_announced_told_summed_up_and_recorded_until_ctrl_c() {
    let folder = tempfile::tempdir().unwrap();
    let [vehicle_port, client_port] = free_ports();
    let vehicle_address = format!("udpin:127.0.0.1:{vehicle_port}");
    let client_address = format!("udpin:127.0.0.1:{client_port}");
    let mut child =
        // unoptimised planners are late; who flies is not what this is about
        fly(folder.path(), &["--vehicle", &vehicle_address, "--client", &client_address, "--controller", "lqi"])
            .spawn()
            .unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    wait_for(&mut lines, "Learned from");
    wait_for(&mut lines, &vehicle_address);
    wait_for(&mut lines, &client_address);
    wait_for(&mut lines, "flights/0001");
    wait_for(&mut lines, "start one with `cargo sitl`");
    let vehicle = Vehicle::new(([127, 0, 0, 1], vehicle_port).into()).on_the_wall();
    wait_for(&mut lines, "vehicle found");
    let mut client = Client::new(([127, 0, 0, 1], client_port).into());
    client.engage(10.0, 3.0);
    wait_for(&mut lines, "armed, HOLD");
    wait_for(&mut lines, "mode OFFBOARD");
    wait_for(&mut lines, "setpoints lost");
    interrupt(&child);
    wait_for(&mut lines, "state to command: p50");
    wait_for(&mut lines, "recorded");
    assert!(child.wait().unwrap().success());
    vehicle.trouble(Trouble::Silent);
    check_surfaces(&vehicle.land().answers);
    let flown =
        csv::load(&folder.path().join("flights/0001/flight.csv"), Tolerance::Strict).unwrap();
    assert!(flown.flight.samples.len() > 50 && !flown.cut_short && flown.dropped == 0);
    let summary = std::fs::read_to_string(folder.path().join("flights/0001/summary.txt")).unwrap();
    assert!(summary.contains("state to command: p50"), "{summary}");
    assert!(
        std::fs::metadata(folder.path().join("flights/0001/flight.tlog")).unwrap().len() > 10_000
    );
    is_replayed_and_drawn_without_options(folder.path());
}

/// The recording says what flew: the LQI, not the controller that flies by default.
fn is_replayed_and_drawn_without_options(folder: &Path) {
    let greylag = |arguments: &[&str]| -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_greylag"));
        command.args(arguments).arg("flights/0001").current_dir(folder).output().unwrap()
    };
    let replayed = greylag(&["replay", "--json", "-"]);
    let said = String::from_utf8_lossy(&replayed.stderr);
    assert!(replayed.status.success(), "{said}");
    let outcome: serde_json::Value = serde_json::from_slice(&replayed.stdout).unwrap();
    assert_eq!(outcome["schema"], "greylag.replay/1");
    assert!(outcome["ticks"].as_u64().unwrap() > 50 && outcome["different"] == 0, "{outcome}");
    // another controller gives other commands
    assert!(!greylag(&["replay", "--controller", "pid"]).status.success());
    let drawn = greylag(&["report"]);
    assert!(drawn.status.success(), "{}", String::from_utf8_lossy(&drawn.stderr));
    let page = std::fs::read_to_string(folder.join("flights/0001/report.html")).unwrap();
    assert!(page.contains("lqi") && page.contains("prior-severe-learned"));
    let again = greylag(&["report"]);
    assert!(String::from_utf8_lossy(&again.stderr).contains("--force"));
    let recording = folder.join("flights/0001/flight.csv");
    let over = greylag(&["report", "--force", "--out", recording.to_str().unwrap()]);
    assert!(String::from_utf8_lossy(&over.stderr).contains("would be lost"));
}

#[test]
fn a_duration_ends_the_flight_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "--vehicle",
        "udpin:127.0.0.1:0",
        "--client",
        "tcpin:127.0.0.1:0",
        "--no-record",
        "--duration-s",
        "0.5",
    ];
    let output = fly(folder.path(), &arguments).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && said.contains("flew 0.5 s: 0 states"), "{said}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn without_a_vehicle_no_recording_stays_and_none_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = [
        "--vehicle",
        "udpin:127.0.0.1:0",
        "--client",
        "tcpin:127.0.0.1:0",
        "--controller",
        "lqi",
        "--duration-s",
        "0.5",
    ];
    let output = fly(folder.path(), &arguments).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success() && said.contains("no vehicle was seen"), "{said}");
    assert!(!said.contains("next: "), "{said}");
    assert_eq!(std::fs::read_dir(folder.path().join("flights")).unwrap().count(), 0);
}

real_time::tests!(a_flight_is_announced_told_summed_up_and_recorded_until_ctrl_c,);
