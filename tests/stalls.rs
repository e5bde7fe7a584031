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
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
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

    /// The aircraft comes back to its turn, in OFFBOARD, with one loss and one return of the link at most; what was said.
    fn recovers(mut self, what: &str) -> Vec<String> {
        let end = Instant::now() + Duration::from_secs(20);
        let turned = |m: &MavMessage| matches!(m, MavMessage::ATTITUDE(a) if (a.roll.to_degrees() - 20.0).abs() < 2.0 && (a.pitch.to_degrees() - 5.0).abs() < 2.0);
        self.client.catch_up();
        let mut seen = self.client.log.len();
        loop {
            self.client.steer(TURN.0, TURN.1, 1.0);
            self.client.catch_up();
            let fresh = &self.client.log[seen..];
            let attitudes = fresh.iter().filter(|m| matches!(m, MavMessage::ATTITUDE(_))).count();
            if attitudes > 3 && fresh.iter().filter(|m| turned(m)).count() == attitudes {
                break;
            }
            assert!(
                Instant::now() < end,
                "{what}: not back in its turn: {:?}",
                self.client.texts()
            );
            seen = self.client.log.len();
        }
        let mode = self.client.log.iter().rev().find_map(|m| match m {
            MavMessage::HEARTBEAT(h) => Some(h.custom_mode),
            _ => None,
        });
        let texts = self.client.texts();
        assert_eq!(mode, Some(OFFBOARD), "{what}: {texts:?}");
        for words in ["link lost", "link back"] {
            let said = texts.iter().filter(|text| text.contains(words)).count();
            assert!(said <= 1, "{what}: {said} times {words}: {texts:?}");
        }
        assert!(!texts.iter().any(|text| text.contains("clock jumped back")), "{what}: {texts:?}");
        drop(self.vehicle.land());
        texts
    }
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

fn a_companion_that_gets_a_tenth_of_the_time_flies_on() {
    let _alone = alone();
    let mut scene = Scene::in_offboard();
    scene.during(|process| {
        for _ in 0..40 {
            process.stop(Duration::from_millis(90));
            std::thread::sleep(Duration::from_millis(10));
        }
    });
    scene.recovers("slowed");
}

fn a_flood_of_a_client_costs_nobody_the_flight() {
    let _alone = alone();
    let mut scene = Scene::in_offboard();
    let heartbeat = frame(
        99,
        190,
        &MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            mavtype: MavType::MAV_TYPE_GCS,
            ..Default::default()
        }),
    );
    let sent = Arc::new(std::sync::atomic::AtomicU64::new(0));
    let counted = sent.clone();
    scene.during(move |process| {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let end = Instant::now() + Duration::from_secs(4);
        while Instant::now() < end {
            let round = Instant::now() + Duration::from_millis(1);
            for _ in 0..40 {
                let sent = socket.send_to(&heartbeat, ("127.0.0.1", process.client)).is_ok();
                counted.fetch_add(u64::from(sent), Ordering::Relaxed);
            }
            std::thread::sleep(round.saturating_duration_since(Instant::now()));
        }
    });
    println!("{} datagrams", sent.load(Ordering::Relaxed));
    let texts = scene.recovers("flooded");
    assert!(!texts.iter().any(|text| text.contains("lost")), "{texts:?}");
}

real_time::tests!(
    a_companion_that_is_stopped_in_a_turn_flies_on_and_names_the_stall,
    a_companion_that_gets_a_tenth_of_the_time_flies_on,
    a_flood_of_a_client_costs_nobody_the_flight
);
