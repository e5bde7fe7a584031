//! The companion's own process stopped, slowed and flooded while a client flies: OFFBOARD survives what the aircraft survives,
//! and a stall is called a stall.
//!
//! Counts of lines and modes decide, not times. Each test has the machine to itself, for what they stop and flood takes its
//! processors from the client and the vehicle of another.

#![cfg(target_os = "linux")]

#[path = "support/flight.rs"]
mod flight_support;
#[path = "support/real_time.rs"]
mod real_time;

use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use flight_support::*;
use mavlink::dialects::ardupilotmega::*;

/// The commanded attitude: a turn of 20 degrees.
const TURN: (f64, f64) = (20.0, 5.0);

/// Held by the test that runs.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// `greylag fly` in a process of its own.
struct Process {
    child: Child,
    vehicle: u16,
    client: u16,
}

fn free_port() -> u16 {
    UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

impl Process {
    fn start() -> Self {
        let (vehicle, client) = (free_port(), free_port());
        let child = Command::new(env!("CARGO_BIN_EXE_greylag"))
            .args(["fly", "--controller", "lqi", "--model", "params/x8/jsbsim.toml", "--no-record"])
            .args(["--vehicle", &format!("udpin:127.0.0.1:{vehicle}")])
            .args(["--client", &format!("udpin:127.0.0.1:{client}")])
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        Process { child, vehicle, client }
    }

    fn signal(&self, signal: i32) {
        // SAFETY: the process is our child and has not been waited for.
        assert_eq!(unsafe { libc::kill(self.child.id() as i32, signal) }, 0);
    }

    /// Stands still for so long.
    fn stop(&self, length: Duration) {
        self.signal(libc::SIGSTOP);
        std::thread::sleep(length);
        self.signal(libc::SIGCONT);
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A client in OFFBOARD beside a vehicle that flies on whatever the companion does.
struct Scene {
    process: Process,
    vehicle: WallVehicle,
    client: Client,
}

impl Scene {
    fn in_offboard() -> Self {
        let process = Process::start();
        let vehicle = Vehicle::new(([127, 0, 0, 1], process.vehicle).into()).unanswered();
        // Until the companion is there, what it is sent is refused.
        let start = Instant::now();
        let mut client = loop {
            let mut client = Client::new(([127, 0, 0, 1], process.client).into());
            std::thread::sleep(Duration::from_millis(200));
            client.catch_up();
            if !client.log.is_empty() {
                break client;
            }
            assert!(start.elapsed() < Duration::from_secs(60), "no companion within a minute");
        };
        client.engage(TURN.0, TURN.1);
        client.steer(TURN.0, TURN.1, 2.0);
        Scene { process, vehicle, client }
    }

    /// Steers while `trouble` lasts.
    fn during(&mut self, trouble: impl FnOnce(&Process) + Send) {
        let over = AtomicBool::new(false);
        let (process, client) = (&self.process, &self.client);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                trouble(process);
                over.store(true, Ordering::Relaxed);
            });
            while !over.load(Ordering::Relaxed) {
                client.steer(TURN.0, TURN.1, 0.1);
            }
        });
    }

    /// What became of the flight after a trouble: the client steers until the aircraft is back in its turn, 20 s at most.
    fn aftermath(mut self) -> Aftermath {
        let begun = Instant::now();
        let turned = |m: &MavMessage| matches!(m, MavMessage::ATTITUDE(a) if (a.roll.to_degrees() - 20.0).abs() < 2.0 && (a.pitch.to_degrees() - 5.0).abs() < 2.0);
        self.client.catch_up();
        let mut seen = self.client.log.len();
        let mut back = None;
        while back.is_none() && begun.elapsed() < Duration::from_secs(20) {
            self.client.steer(TURN.0, TURN.1, 1.0);
            self.client.catch_up();
            let fresh = &self.client.log[seen..];
            let attitudes = fresh.iter().filter(|m| matches!(m, MavMessage::ATTITUDE(_))).count();
            let settled = fresh.iter().filter(|m| turned(m)).count();
            back = (attitudes > 3 && settled == attitudes).then(|| begun.elapsed());
            seen = self.client.log.len();
        }
        let mode = self.client.log.iter().rev().find_map(|m| match m {
            MavMessage::HEARTBEAT(h) => Some(h.custom_mode),
            _ => None,
        });
        let texts = self.client.texts();
        drop(self.vehicle.land());
        Aftermath { back, offboard: mode == Some(OFFBOARD), texts }
    }

    /// The aircraft comes back to its turn, in OFFBOARD, with one loss and one return of the link at most; what was said.
    fn recovers(self, what: &str) -> Vec<String> {
        let Aftermath { back, offboard, texts } = self.aftermath();
        assert!(back.is_some(), "{what}: not back in its turn: {texts:?}");
        assert!(offboard, "{what}: {texts:?}");
        for words in ["link lost", "link back"] {
            let said = texts.iter().filter(|text| text.contains(words)).count();
            assert!(said <= 1, "{what}: {said} times {words}: {texts:?}");
        }
        assert!(!texts.iter().any(|text| text.contains("clock jumped back")), "{what}: {texts:?}");
        texts
    }
}

/// A flight after a trouble of the companion's.
struct Aftermath {
    /// Time until every attitude of a whole second lies within 2° of the turn; that second counts. `None` if there is none.
    back: Option<Duration>,
    offboard: bool,
    texts: Vec<String>,
}

fn a_companion_that_is_stopped_in_a_turn_flies_on_and_names_the_stall() {
    let _alone = alone();
    for ms in [100, 600, 1200, 5000] {
        let mut scene = Scene::in_offboard();
        scene.during(|process| process.stop(Duration::from_millis(ms)));
        let texts = scene.recovers(&format!("stopped for {ms} ms"));
        assert!(!texts.iter().any(|text| text.contains("lost")), "{ms} ms: {texts:?}");
        if ms > 500 {
            let named = texts.iter().any(|text| text.contains("this computer stalled for"));
            assert!(named, "{ms} ms: {texts:?}");
        }
    }
}

/// Lets the companion run for 10 of every 100 ms.
fn slowed(process: &Process, tenths: usize) {
    for _ in 0..tenths {
        process.stop(Duration::from_millis(90));
        std::thread::sleep(Duration::from_millis(10));
    }
}

fn a_companion_that_gets_a_tenth_of_the_time_flies_on() {
    let _alone = alone();
    let mut scene = Scene::in_offboard();
    scene.during(|process| slowed(process, 40));
    scene.recovers("slowed");
}

/// Sends the companion's client port heartbeats of another ground station, `per_ms` in each millisecond of four seconds; how many.
fn flooded(process: &Process, per_ms: u32) -> u64 {
    let data = HEARTBEAT_DATA { mavtype: MavType::MAV_TYPE_GCS, ..Default::default() };
    let heartbeat = frame(99, 190, &MavMessage::HEARTBEAT(data));
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    let end = Instant::now() + Duration::from_secs(4);
    let mut sent = 0;
    while Instant::now() < end {
        let round = Instant::now() + Duration::from_millis(1);
        for _ in 0..per_ms {
            sent += u64::from(socket.send_to(&heartbeat, ("127.0.0.1", process.client)).is_ok());
        }
        std::thread::sleep(round.saturating_duration_since(Instant::now()));
    }
    sent
}

fn a_flood_of_a_client_costs_nobody_the_flight() {
    let _alone = alone();
    let mut scene = Scene::in_offboard();
    scene.during(|process| println!("{} datagrams", flooded(process, 40)));
    let texts = scene.recovers("flooded");
    assert!(!texts.iter().any(|text| text.contains("lost")), "{texts:?}");
}

/// Each trouble fifty times; prints the table of docs/validation/faults.md. Half an hour.
#[test]
#[ignore = "half an hour"]
fn fifty_of_each_trouble() {
    let _alone = alone();
    type Trouble<'t> = (&'t str, &'t (dyn Fn(&Process, u64) + Sync));
    let troubles: [Trouble<'_>; 3] = [
        ("stopped for 0.1 to 5 s", &|process, k| {
            process.stop(Duration::from_millis([100, 300, 600, 1200, 2500, 5000][k as usize % 6]));
        }),
        ("a tenth of the time for 10 s", &|process, _| slowed(process, 100)),
        ("flooded for 4 s, 100 datagrams in a millisecond", &|process, _| {
            flooded(process, 100);
        }),
    ];
    let mut failures = 0;
    for (name, trouble) in troubles {
        let (mut kept, mut back, mut said, mut late) = (0, 0, 0, Duration::ZERO);
        for k in 0..50 {
            let mut scene = Scene::in_offboard();
            scene.during(|process| trouble(process, k));
            let after = scene.aftermath();
            let count = |words| after.texts.iter().filter(|text| text.contains(words)).count();
            said = said.max(count("link lost")).max(count("link back"));
            kept += u32::from(after.offboard);
            back += u32::from(after.back.is_some());
            late = late.max(after.back.unwrap_or(Duration::MAX));
        }
        println!("| {name} | {kept} of 50 | {back} of 50 | {:.1} s | {said} |", late.as_secs_f64());
        failures += 100 - kept - back + u32::from(said > 1);
    }
    assert_eq!(failures, 0);
}

real_time::tests!(
    a_companion_that_is_stopped_in_a_turn_flies_on_and_names_the_stall,
    a_companion_that_gets_a_tenth_of_the_time_flies_on,
    a_flood_of_a_client_costs_nobody_the_flight
);
