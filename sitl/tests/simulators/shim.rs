//! Tests of the shim in real time over real sockets: time advances by the wall clock, independent of the companion.

use std::net::UdpSocket;
use std::time::{Duration, Instant};

use crate::real_time;
use crate::shim_companion::*;
use greylag_sitl::shim::codec::{Encoder, Heartbeat};
use greylag_sitl::shim::{Event, Launch, Personality};

const STEP_US: u64 = 10_000;

fn sends_a_hundred_frames_a_second_without_drift() {
    let (mut companion, link) = listening();
    let shim = Shim::start(real_time(&link));
    let first = companion.state();
    let begun = Instant::now();
    let mut last = first;
    let mut count = 0;
    while begun.elapsed() < Duration::from_secs(3) {
        last = companion.state();
        count += 1;
        companion.answer(last.time_us(), [0.0, 0.0, 0.3]);
    }
    // With absolute deadlines, simulated time equals wall time within one frame, plus delays of a busy machine in the last frame.
    let (wall, simulated) =
        (begun.elapsed().as_secs_f64(), (last.time_us() - first.time_us()) as f64 * 1e-6);
    assert!((wall - simulated).abs() < 0.03, "{wall} s of wall time, {simulated} s simulated");
    assert_eq!(count, (last.time_us() - first.time_us()) / STEP_US, "no frame is missing");
    let summary = shim.stop();
    println!("{summary}");
    assert!(summary.latency.count() + 3 >= summary.answers, "every answer's delay is measured");
}

fn time_runs_without_anybody_there() {
    // No program listens on the port, so every datagram is refused.
    let (companion, link) = listening();
    drop(companion);
    let shim = Shim::start(real_time(&link));
    std::thread::sleep(Duration::from_millis(1000));
    let summary = shim.stop();
    // 100 frames, with a tolerance for the start of the thread and a busy machine.
    assert!((85..=103).contains(&summary.frames), "{} frames", summary.frames);
    assert_eq!((summary.answers, summary.flown_s), (0, 0.0), "held until armed");
}

fn a_silent_companion_leaves_the_surfaces_where_they_are_commanded() {
    let (mut companion, link) = listening();
    let at = companion.address().to_string();
    let shim = Shim::start(real_time(&link));
    companion.fly(50, |_| [0.0, 0.25, 0.5]);
    drop(companion);
    std::thread::sleep(Duration::from_millis(2500));
    let mut companion = Companion::udp_in(&at);
    let state = companion.state();
    // Surfaces settle within 0.1 s; after 2.5 s, the throttle lag (0.2 s) has settled to 4e-6.
    assert!((state.actuators.actuator[1] - 0.25).abs() < 1e-3, "{:?}", state.actuators.actuator);
    assert!((state.actuators.actuator[2] - 0.5).abs() < 1e-3);
    // The companion returns, and its commands are used again.
    companion.fly(50, |_| [0.0, -0.25, 0.5]);
    let state = companion.state();
    assert!((state.actuators.actuator[1] + 0.25).abs() < 1e-2, "{:?}", state.actuators.actuator);
    let events = shim.events();
    let found = events.iter().filter(|&e| *e == Event::Found).count();
    assert_eq!((found, events.contains(&Event::Lost)), (2, true), "{events:?}");
    let summary = shim.stop();
    assert!(summary.unanswered_steps >= 200, "{} steps alone", summary.unanswered_steps);
}

fn stale_wrong_and_repeated_answers_are_not_flown() {
    let (mut companion, link) = listening();
    let shim = Shim::start(real_time(&link));
    let states: Vec<State> = (0..70).map(|_| companion.state()).collect();
    let (old, new) = (states[5].time_us(), states[69].time_us());
    assert!(new - old > 500_000, "0.64 s lie between them");
    companion.answer(old, [0.0, 0.5, 0.0]);
    companion.answer(new + 5 * 1_000_000, [0.0, 0.5, 0.0]);
    companion.answer(new + 3, [0.0, 0.5, 0.0]);
    companion.send(&answer(new, [0.0, f32::NAN, 0.0], 128));
    for _ in 0..20 {
        assert_eq!(companion.state().actuators.actuator, [0.0; 32]);
    }
    let now = companion.state().time_us();
    companion.answer(now, [0.0, 0.1, 0.0]);
    for _ in 0..20 {
        companion.state();
    }
    companion.answer(now, [0.0, 0.9, 0.0]);
    for _ in 0..20 {
        companion.state();
    }
    let elevator = companion.state().actuators.actuator[1];
    assert!((elevator - 0.1).abs() < 1e-3, "the first answer holds: {elevator}");
    let summary = shim.stop();
    assert_eq!(
        (
            summary.stale_answers,
            summary.wrong_answers,
            summary.unusable_answers,
            summary.repeated_answers,
            summary.answers
        ),
        (1, 2, 1, 1, 1)
    );
}

fn a_flood_of_answers_costs_no_frame() {
    let (mut companion, link) = listening();
    let shim = Shim::start(real_time(&link));
    let mut last = companion.state().time_us();
    for _ in 0..100 {
        let state = companion.state();
        assert_eq!(state.time_us(), last + STEP_US);
        last = state.time_us();
        for _ in 0..10 {
            companion.answer(last, [0.0, 0.0, 0.3]);
            companion.send_bytes(b"rubbish");
        }
    }
    let summary = shim.stop();
    assert!(summary.repeated_answers >= 850, "{}", summary.repeated_answers);
    assert!(summary.bad_frames >= 950, "{}", summary.bad_frames);
}

fn frames_are_delayed_and_dropped_as_asked() {
    let (mut companion, link) = listening();
    let mut options = real_time(&link);
    options.faults.delay_ms = 35.0;
    options.faults.drop_probability = 0.25;
    options.seed = 3;
    options.launch = Launch::Immediate;
    let shim = Shim::start(options);
    let mut times = Vec::new();
    let begun = Instant::now();
    while begun.elapsed() < Duration::from_secs(3) {
        let state = companion.state();
        times.push(state.time_us());
        companion.answer(state.time_us(), [0.0, 0.0, 0.3]);
    }
    assert!(times.is_sorted(), "frames keep their order");
    let summary = shim.stop();
    // Of 300 frames, 75 ± 7.5 (1 σ) are lost.
    assert!((45..=105).contains(&summary.dropped_frames), "{}", summary.dropped_frames);
    // The answer to a frame with 35 ms of delay arrives after 3 or 4 newer frames. The latency is measured from the
    // transmission, so it contains only the delay of the socket.
    assert!(summary.latency.quantile(0.5) < Duration::from_millis(5), "{summary}");
    assert_eq!(summary.wrong_answers + summary.stale_answers, 0, "{summary}");
}

fn over_tcp_a_companion_that_does_not_read_costs_no_cycle() {
    let shim = Shim::start(real_time("tcpin:127.0.0.1:0"));
    let mut companion = Companion::tcp_out(shim.address());
    companion.fly(20, |_| [0.0, 0.0, 0.3]);
    // During 2 s without reading, about 60 kB accumulate in the socket.
    std::thread::sleep(Duration::from_secs(2));
    let mut last = companion.state().time_us();
    for _ in 0..250 {
        let time_us = companion.state().time_us();
        assert_eq!(time_us, last + STEP_US, "no frame is torn or lost");
        last = time_us;
    }
    assert_eq!(companion.bad(), 0);
    let summary = shim.stop();
    assert!(summary.frames >= 220, "{summary}");
}

fn late_frames_hold_up_those_behind_them_and_none_is_lost() {
    let (mut companion, link) = listening();
    let mut options = real_time(&link);
    options.faults.late_probability = 0.02;
    options.faults.late_ms = 100.0;
    options.faults.jitter_ms = 5.0;
    options.seed = 11;
    let shim = Shim::start(options);
    let mut last = (companion.state().time_us(), Instant::now());
    let mut gaps = Vec::new();
    for _ in 0..300 {
        let time_us = companion.state().time_us();
        assert_eq!(time_us, last.0 + STEP_US, "late, not lost");
        gaps.push(last.1.elapsed());
        last = (time_us, Instant::now());
    }
    let summary = shim.stop();
    // On average, 6 of 300 frames are late; the probability of none is 0.2 %, and the seed is fixed. A frame with a delay of 100
    // ms and a jitter of 5 ms leaves a gap of 105 to 115 ms, or more on a busy machine.
    let longest = gaps.iter().max().expect("gaps");
    assert!(
        (Duration::from_millis(95)..Duration::from_millis(250)).contains(longest),
        "{longest:?}"
    );
    // Delayed frames arrive in a burst.
    assert!(gaps.iter().filter(|gap| **gap < Duration::from_millis(1)).count() >= 8);
    assert_eq!(summary.dropped_frames, 0);
}

fn garbage_does_not_take_the_link_of_a_flight_controller() {
    let mut options = real_time("udpin:127.0.0.1:0");
    options.personality = Some(Personality::Px4);
    let shim = Shim::start(options);
    let to = shim.address();
    let [companion, stranger] =
        [(), ()].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a socket"));
    companion.set_read_timeout(Some(PATIENCE)).expect("set");
    let (mut beat, mut buffer) = (Vec::new(), [0; 2048]);
    Encoder::new(255, 190).encode(&Heartbeat::default(), &mut beat);
    companion.send_to(&beat, to).expect("sent");
    companion.recv(&mut buffer).expect("telemetry");
    stranger.send_to(b"rubbish", to).expect("sent");
    std::thread::sleep(Duration::from_millis(500));
    companion.set_nonblocking(true).expect("set");
    while companion.recv(&mut buffer).is_ok() {}
    companion.set_nonblocking(false).expect("set");
    companion.recv(&mut buffer).expect("telemetry goes on");
    shim.stop();
}

/// Run with `cargo test -p greylag-sitl --release --test simulators shim:: -- --ignored --nocapture`.
#[test]
#[ignore = "takes a minute; prints the punctuality of the clock on this machine"]
fn a_minute_of_real_time() {
    let (mut companion, link) = listening();
    let shim = Shim::start(real_time(&link));
    companion.fly(6000, |_| [0.0, 0.05, 0.2]);
    let summary = shim.stop();
    println!("{summary}");
    assert_eq!(summary.late_cycles, 0, "cycles that began more than 2 ms late");
}

real_time::tests!(
    sends_a_hundred_frames_a_second_without_drift,
    time_runs_without_anybody_there,
    a_silent_companion_leaves_the_surfaces_where_they_are_commanded,
    stale_wrong_and_repeated_answers_are_not_flown,
    a_flood_of_answers_costs_no_frame,
    frames_are_delayed_and_dropped_as_asked,
    over_tcp_a_companion_that_does_not_read_costs_no_cycle,
    late_frames_hold_up_those_behind_them_and_none_is_lost,
    garbage_does_not_take_the_link_of_a_flight_controller,
);
