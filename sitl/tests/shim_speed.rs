//! Measures the lockstep frame rate over sockets, with a companion that sends a constant command.

#[path = "../../tests/support/real_time.rs"]
mod real_time;
#[path = "support/shim_companion.rs"]
mod shim_companion;

use std::net::TcpListener;
use std::time::Instant;

use shim_companion::*;

/// Number of measured frames: 20 s of flight.
const FRAMES: usize = 2000;

fn frames_per_second(mut companion: Companion, shim: Shim) -> f64 {
    companion.fly(100, |_| [0.0, 0.05, 0.2]);
    let begun = Instant::now();
    companion.fly(FRAMES, |_| [0.0, 0.05, 0.2]);
    let rate = FRAMES as f64 / begun.elapsed().as_secs_f64();
    println!("{}", shim.stop());
    rate
}

fn lockstep_is_at_least_twenty_times_real_time() {
    let (companion, link) = listening();
    let udp = frames_per_second(companion, Shim::start(lockstep(&link)));
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let link = format!("tcpout:{}", listener.local_addr().expect("an address"));
    let shim = Shim::start(lockstep(&link));
    let tcp = frames_per_second(Companion::tcp_in(&listener), shim);
    println!("lockstep: {udp:.0} frames/s over UDP, {tcp:.0} over TCP (real time is 100)");
    // The requirement for the shim over UDP is 20 times real time.
    assert!(udp >= 2000.0, "{udp:.0} frames/s over UDP");
}

real_time::tests!(lockstep_is_at_least_twenty_times_real_time);
