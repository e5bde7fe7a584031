//! Tests of the program `greylag-sitl` on the command line: output, exit codes, Ctrl-C.

use std::net::UdpSocket;
use std::process::{Command, Output, Stdio};
use std::time::Duration;

use crate::shim_companion::*;

fn sitl(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_greylag-sitl"));
    command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Asserts that the program fails and that its error contains `named`.
fn fails(arguments: &[&str], named: &str) {
    let output = sitl(arguments).output().expect("the program runs");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{arguments:?}");
    assert!(errors.contains(named), "{arguments:?}: {errors}");
    assert!(!errors.contains("panicked"), "{errors}");
}

fn one_line(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(text.trim_end().lines().count(), 1, "{text}");
    text
}

#[test]
fn a_port_in_use_is_one_clear_line() {
    let taken = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let link = format!("udpin:{}", taken.local_addr().expect("an address"));
    let output = sitl(&["--link", &link]).output().expect("the program runs");
    assert!(!output.status.success());
    let line = one_line(&output);
    assert!(line.contains(&link) && line.contains("in use"), "{line}");
}

#[test]
fn bad_arguments_are_named() {
    fails(&["--link", "carrier-pigeon:1.2.3.4:5"], "carrier-pigeon");
    fails(&["--link", "udpin:no.such.host.invalid:5"], "no.such.host.invalid");
    fails(&["--wind-ned-mps", "1,2"], "3 numbers are needed");
    fails(&["--aircraft", "absent"], "absent");
    fails(&["--hide", "nonsense"], "ID=AMPLITUDE");
    fails(&["--drop", "2"], "drop probability");
    fails(&["--turbulence-severity", "9"], "severity");
}

#[test]
fn without_a_companion_it_says_what_is_missing_and_ctrl_c_ends_it_cleanly() {
    let (mut companion, link) = listening();
    let child = sitl(&["--link", &link]).spawn().expect("the program runs");
    let first = companion.state();
    companion.answer(first.time_us(), [0.0, 0.0, 0.3]);
    companion.fly(20, |_| [0.0, 0.0, 0.3]);
    interrupt(child.id());
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    for part in [
        "in real time",
        "waiting for a companion",
        "cargo fly",
        "companion found",
        "armed",
        "launched",
        "Late cycles",
    ] {
        assert!(said.contains(part), "'{part}' is missing in:\n{said}");
    }
}

#[test]
fn all_options_together_fly_in_lockstep() {
    let folder = tempfile::tempdir().expect("a folder");
    let truth = folder.path().join("truth.csv");
    let (mut companion, link) = listening();
    let arguments = [
        "--link",
        &link,
        "--lockstep",
        "--no-hold",
        "--duration-s",
        "0.5",
        "--seed",
        "4",
        "--start-roll-deg",
        "-10",
        "--start-pitch-deg",
        "5",
        "--start-airspeed-mps",
        "20",
        "--start-altitude-m",
        "500",
        "--wind-ned-mps",
        "-3,1,0",
        "--turbulence-severity",
        "3",
        "--gust",
        "0.1,0,2,0,0.1,0.1,0.1",
        "--noise",
        "realistic",
        "--noise-airspeed-mps",
        "0",
        "--bias-alpha-deg",
        "-1",
        "--bias-gyro-radps",
        "0,-0.01,0",
        "--airspeed-scale",
        "1.5",
        "--delay-ms",
        "20",
        "--drop",
        "0.05",
        "--jitter-ms",
        "2",
        "--late",
        "0.05",
        "--hide",
        "pitch_break=-3.0",
        "--truth",
        truth.to_str().expect("a name"),
    ];
    let child = sitl(&arguments).spawn().expect("the program runs");
    let states = companion.fly(50, |_| [0.0, 0.0, 0.4]);
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    // The start has 10° of left bank with 0.2° of noise, and the airspeed of 20 m/s is measured as 30 m/s.
    assert!((states[0].euler()[0].to_degrees() + 10.0).abs() < 1.0);
    assert!((states[0].hud.airspeed - 30.0).abs() < 0.5, "{:?}", states[0].hud);
    let rows = std::fs::read_to_string(&truth).expect("a truth file").lines().count();
    assert_eq!(rows, 51);
    // A repetition without --force is refused.
    fails(&arguments, "--force");
}

fn interrupt(id: u32) {
    std::thread::sleep(Duration::from_millis(50));
    let sent = Command::new("kill").args(["-INT", &id.to_string()]).status().expect("kill");
    assert!(sent.success());
}
