//! Tests of lockstep over real sockets: simulated time advances only on the companion's answers.

use std::net::TcpListener;
use std::time::{Duration, Instant};

use crate::shim_companion::*;
use greylag_sitl::shim::codec::{Encoder, Heartbeat};
use greylag_sitl::shim::{Event, Over};

const STEP_US: u64 = 10_000;
const NEUTRAL: [f32; 3] = [0.0; 3];

/// Asserts that the times of `states` are consecutive, from `first_us`, µs.
fn assert_consecutive(states: &[State], first_us: u64) {
    for (i, state) in states.iter().enumerate() {
        assert_eq!(state.time_us(), first_us + i as u64 * STEP_US, "frame {i}");
    }
}

#[test]
fn flies_over_every_transport() {
    // 300 frames are 3 s of flight, in which each 1 Hz message occurs three times.
    let fly = |mut companion: Companion, shim: Shim| {
        let states = companion.fly(300, |_| NEUTRAL);
        assert_consecutive(&states, STEP_US);
        assert_eq!(companion.bad(), 0);
        let count = |id| companion.slow.iter().filter(|frame| frame.id == id).count();
        // HEARTBEAT, SYS_STATUS, WIND_COV at 1, 2 and 3 s; GPS at 5 Hz; position at 10 Hz.
        assert_eq!([count(1), count(231), count(24), count(33)], [3, 3, 15, 30]);
        assert!(count(0) >= 3, "a repeated frame brings a heartbeat of its own");
        drop(shim.stop());
    };

    let (companion, link) = listening();
    fly(companion, Shim::start(lockstep(&link)));

    let shim = Shim::start(lockstep("udpin:127.0.0.1:0"));
    let mut companion = Companion::udp_out(shim.address());
    companion.heartbeat();
    fly(companion, shim);

    let shim = Shim::start(lockstep("tcpin:127.0.0.1:0"));
    let companion = Companion::tcp_out(shim.address());
    fly(companion, shim);

    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let link = format!("tcpout:{}", listener.local_addr().expect("an address"));
    let shim = Shim::start(lockstep(&link));
    fly(Companion::tcp_in(&listener), shim);
}

#[test]
fn never_steps_without_an_answer() {
    let (mut companion, link) = listening();
    let shim = Shim::start(lockstep(&link));
    companion.fly(3, |_| NEUTRAL);
    let begun = Instant::now();
    let mut times = Vec::new();
    // 2.6 s cover the frame, its repetitions after 1 and 2 s, and delays of a slow machine.
    while let Some(left) = Duration::from_millis(2600).checked_sub(begun.elapsed()) {
        times.extend(companion.state_within(left).map(|state| state.time_us()));
    }
    assert_eq!(times, [4 * STEP_US; 3], "one frame, repeated every second");
    companion.answer(4 * STEP_US, NEUTRAL);
    assert_eq!(companion.state().time_us(), 5 * STEP_US);
    let events = shim.events();
    let count = |event: Event| events.iter().filter(|&e| *e == event).count();
    assert_eq!((count(Event::Paused), count(Event::Resumed)), (1, 1), "{events:?}");
    let summary = shim.stop();
    assert_eq!((summary.answers, summary.repeated_frames), (4, 2));
}

#[test]
fn ignores_answers_to_other_frames() {
    let (mut companion, link) = listening();
    let shim = Shim::start(lockstep(&link));
    companion.fly(3, |_| NEUTRAL);
    let now = companion.state().time_us();
    assert_eq!(now, 4 * STEP_US);
    companion.answer(now + STEP_US, [1.0; 3]);
    companion.answer(now + 1, [1.0; 3]);
    companion.answer(0, [1.0; 3]);
    companion.answer(u64::MAX, [1.0; 3]);
    companion.answer(now - STEP_US, [1.0; 3]);
    companion.answer(now, [f32::NAN, 0.0, 0.0]);
    companion.send(&answer(now, [0.0, 0.0, f32::INFINITY], 128));
    assert!(companion.state_within(Duration::from_millis(400)).is_none(), "no step");
    companion.answer(now, NEUTRAL);
    assert_eq!(companion.state().time_us(), now + STEP_US);
    let summary = shim.stop();
    assert_eq!(
        (summary.wrong_answers, summary.repeated_answers, summary.unusable_answers),
        (4, 1, 2)
    );
}

#[test]
fn garbage_is_counted_and_harmless() {
    let (mut companion, link) = listening();
    let shim = Shim::start(lockstep(&link));
    let first = companion.state();
    let mut whole = Vec::new();
    Encoder::new(1, 1).encode(&answer(first.time_us(), [0.5; 3], 128), &mut whole);
    companion.send_bytes(b"");
    companion.send_bytes(b"not MAVLink at all");
    companion.send_bytes(&whole[..whole.len() - 1]);
    companion.send_bytes(&[0xFD; 1400]);
    let mut flipped = whole.clone();
    flipped[20] ^= 1;
    companion.send_bytes(&flipped);
    // Messages of other senders: a ground station's heartbeat, and an answer from another system.
    for (system, component) in [(255, 190), (2, 1)] {
        let mut bytes = Vec::new();
        let mut other = Encoder::new(system, component);
        other.encode(&Heartbeat::default(), &mut bytes);
        other.encode(&answer(first.time_us(), [0.5; 3], 128), &mut bytes);
        companion.send_bytes(&bytes);
    }
    assert!(companion.state_within(Duration::from_millis(300)).is_none(), "no step");
    // A valid answer after garbage in the same datagram is accepted.
    let mut behind = b"rubbish".to_vec();
    behind.extend(&whole);
    companion.send_bytes(&behind);
    assert_eq!(companion.state().time_us(), first.time_us() + STEP_US);
    let summary = shim.stop();
    assert_eq!((summary.bad_frames, summary.foreign_frames, summary.answers), (5, 4, 1));
}

#[test]
fn a_torn_tcp_stream_is_read_and_garbage_in_it_skipped() {
    let shim = Shim::start(lockstep("tcpin:127.0.0.1:0"));
    let mut companion = Companion::tcp_out(shim.address());
    for k in 1..=20 {
        let state = companion.state();
        assert_eq!(state.time_us(), k * STEP_US);
        let mut bytes = b"noise".to_vec();
        Encoder::new(1, 1).encode(&answer(state.time_us(), NEUTRAL, 128), &mut bytes);
        for piece in bytes.chunks(23) {
            companion.send_bytes(piece);
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    companion.state();
    let summary = shim.stop();
    assert_eq!((summary.answers, summary.bad_frames), (20, 20));
}

#[test]
fn pauses_when_the_companion_dies_and_goes_on_when_it_returns() {
    // With UDP, the port closes (datagrams are refused) and opens again. With TCP, the stream ends and is set up again, by either
    // side.
    let (mut companion, link) = listening();
    let at = companion.address().to_string();
    let shim = Shim::start(lockstep(&link));
    let before = companion.fly(50, |_| [0.1, 0.0, 0.4]);
    drop(companion);
    std::thread::sleep(Duration::from_millis(2500));
    let mut companion = Companion::udp_in(&at);
    let after = companion.fly(50, |_| [0.1, 0.0, 0.4]);
    assert_consecutive(&[before, after].concat(), STEP_US);
    let events = shim.events();
    assert!(events.contains(&Event::Lost) && events.contains(&Event::Resumed), "{events:?}");
    companion.state();
    assert_eq!(shim.stop().answers, 100);

    let shim = Shim::start(lockstep("tcpin:127.0.0.1:0"));
    let to = shim.address();
    let before = Companion::tcp_out(to).fly(50, |_| NEUTRAL);
    let mut companion = Companion::tcp_out(to);
    let after = companion.fly(50, |_| NEUTRAL);
    // The next frame proves that the last answer was used.
    companion.state();
    assert_consecutive(&[before, after].concat(), STEP_US);
    assert!(shim.events().contains(&Event::Lost));
    assert_eq!(shim.stop().answers, 100);

    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let link = format!("tcpout:{}", listener.local_addr().expect("an address"));
    let shim = Shim::start(lockstep(&link));
    let before = Companion::tcp_in(&listener).fly(50, |_| NEUTRAL);
    let mut companion = Companion::tcp_in(&listener);
    let after = companion.fly(50, |_| NEUTRAL);
    // The next frame proves that the last answer was used.
    companion.state();
    assert_consecutive(&[before, after].concat(), STEP_US);
    assert_eq!(shim.stop().answers, 100);
}

#[test]
fn a_listening_udp_link_takes_the_companion_that_returns_on_another_port() {
    let shim = Shim::start(lockstep("udpin:127.0.0.1:0"));
    let to = shim.address();
    let mut companion = Companion::udp_out(to);
    companion.heartbeat();
    let before = companion.fly(20, |_| NEUTRAL);
    // While the first companion is alive, frames of a second companion are foreign.
    let mut second = Companion::udp_out(to);
    second.heartbeat();
    assert!(second.state_within(Duration::from_millis(100)).is_none());
    drop(companion);
    // After two seconds of silence, the link accepts another companion; heartbeats arrive once per second.
    let mut first = None;
    for _ in 0..5 {
        second.heartbeat();
        first = first.or_else(|| second.state_within(Duration::from_secs(1)));
    }
    let first = first.expect("the second companion is heard");
    second.answer(first.time_us(), NEUTRAL);
    assert_eq!(first.time_us(), 21 * STEP_US);
    while second.state().time_us() == first.time_us() {}
    assert_consecutive(&before, STEP_US);
    let summary = shim.stop();
    assert_eq!((summary.answers, summary.foreign_frames > 0), (21, true));
}

#[test]
fn waits_for_a_companion_that_comes_later() {
    // tcpout to a port without listener: the connection is refused repeatedly.
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let at = listener.local_addr().expect("an address");
    drop(listener);
    let shim = Shim::start(lockstep(&format!("tcpout:{at}")));
    std::thread::sleep(Duration::from_millis(500));
    let listener = TcpListener::bind(at).expect("the same port");
    let mut companion = Companion::tcp_in(&listener);
    let states = companion.fly(5, |_| NEUTRAL);
    companion.state();
    assert_consecutive(&states, STEP_US);
    assert_eq!(shim.stop().answers, 5);
}

#[test]
fn a_second_tcp_client_does_not_take_the_link() {
    let shim = Shim::start(lockstep("tcpin:127.0.0.1:0"));
    let to = shim.address();
    let mut companion = Companion::tcp_out(to);
    companion.fly(5, |_| NEUTRAL);
    let mut intruder = Companion::tcp_out(to);
    // The shim checks for new connections every 0.1 s while it receives answers.
    let until = Instant::now() + Duration::from_millis(400);
    while Instant::now() < until {
        companion.fly(1, |_| NEUTRAL);
    }
    assert!(intruder.state_within(Duration::from_millis(50)).is_none());
    assert!(!shim.events().contains(&Event::Lost));
    drop(shim.stop());
}

#[test]
fn lost_frames_delay_and_never_skip() {
    let (mut companion, link) = listening();
    let mut options = lockstep(&link);
    options.faults.drop_probability = 0.3;
    options.seed = 5;
    let shim = Shim::start(options);
    let begun = Instant::now();
    let states = companion.fly(200, |_| NEUTRAL);
    assert_consecutive(&states, STEP_US);
    let summary = shim.stop();
    // Each of 200 frames is sent until it is not lost, so 200 · 0.3/0.7 = 86 transmissions are lost, ± 11 (1 σ).
    assert!((40..=140).contains(&summary.dropped_frames), "{}", summary.dropped_frames);
    assert_eq!(summary.dropped_frames, summary.repeated_frames);
    // Each loss costs about 20 ms, not the 1 s after which a frame without an answer is repeated.
    assert!(begun.elapsed() < Duration::from_secs(15));
}

#[test]
fn is_held_until_armed_while_time_runs() {
    let (mut companion, link) = listening();
    let shim = Shim::start(lockstep(&link));
    let mut held = Vec::new();
    for _ in 0..30 {
        let state = companion.state();
        companion.send(&answer(state.time_us(), [1.0; 3], 64));
        held.push(state);
    }
    assert_consecutive(&held, STEP_US);
    for state in &held {
        assert_eq!((state.attitude.q1, state.hud.alt), (1.0, held[0].hud.alt), "it does not move");
        assert_eq!(state.actuators.actuator, [0.0; 32], "nor do its surfaces");
    }
    let flown = companion.fly(30, |_| [0.0, 0.0, 0.5]);
    // The first armed answer is to flown[0], so the first step is between flown[0] and flown[1]. At the neutral start, q̇ = +5.74
    // rad/s² (FACTS.md), which gives q = 0.057 rad/s after one step.
    assert_eq!(flown[0].attitude.pitchspeed, held[0].attitude.pitchspeed);
    assert!((flown[1].attitude.pitchspeed - 0.0574).abs() < 0.001, "{:?}", flown[1].attitude);
    let notices: Vec<_> = shim.notices.try_iter().collect();
    let launched = notices.iter().find(|n| n.event == Event::Launched).expect("launched");
    assert!((launched.time_s - flown[0].time_us() as f64 * 1e-6).abs() < 1e-9);
    drop(shim.stop());
}

#[test]
fn a_delayed_frame_shows_the_past() {
    // The same flight without delay and with a delay of 45 ms, which lockstep rounds up to 5 steps. The frames at equal times are
    // equal, but the answers act 5 steps later. The aileron's response to a pulse at frame 10 therefore appears 5 frames later.
    let response = |delay_ms: f64| {
        let (mut companion, link) = listening();
        let mut options = lockstep(&link);
        options.faults.delay_ms = delay_ms;
        let shim = Shim::start(options);
        let states = companion.fly(60, |state| {
            if state.time_us() >= 10 * STEP_US { [0.5, 0.0, 0.3] } else { [0.0, 0.0, 0.3] }
        });
        drop(shim.stop());
        assert_consecutive(&states, STEP_US);
        states.iter().position(|state| state.actuators.actuator[0] > 0.01).expect("a response")
    };
    assert_eq!(response(45.0), response(0.0) + 5);
}

#[test]
fn ends_after_the_asked_flight_time() {
    let (mut companion, link) = listening();
    let mut options = lockstep(&link);
    options.duration_s = Some(0.5);
    let shim = Shim::start(options);
    for _ in 0..20 {
        let time_us = companion.state().time_us();
        companion.answer_disarmed(time_us);
    }
    companion.fly(50, |_| NEUTRAL);
    let summary = shim.end();
    assert_eq!((summary.over, summary.flown_s), (Some(Over::Duration), 0.5));
}
