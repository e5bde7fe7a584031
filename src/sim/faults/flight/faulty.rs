//! Effects of the active faults on companion, sensors, clock and disk.
//!
//! The companion is Greylag's autopilot, which runs here on a desk: without threads, sockets or a wall clock. A finding is a
//! violated requirement.

use std::sync::atomic::Ordering;
use std::time::Duration;

use greylag_sitl::shim::Distortion;

use rand::RngExt;

use super::Flight;
use crate::faults::counterpart::Aircraft;
use crate::faults::judge::{Exposure, Finding};
use crate::faults::mix::{Fault, FaultKind};

impl Flight {
    /// Number of 10 ms steps for which the companion is suspended at this step; 0 if it is not suspended.
    pub(super) fn nap(&mut self, acting: &[Fault]) -> u64 {
        let starved = acting.iter().find(|fault| fault.kind == FaultKind::Starvation);
        let Some(Fault { strength, .. }) = starved else { return 0 };
        match self.random.random::<f64>() < 0.05 + 0.3 * strength {
            // 20 ms to 300 ms without execution
            true => self.random.random_range(2..=5 + (25.0 * strength) as u64),
            false => 0,
        }
    }

    /// Stops the companion when a fault of the kind `Killed` starts, and starts another companion when this fault ends. Returns
    /// whether a companion is running.
    pub(super) fn is_alive(&mut self, acting: &[Fault]) -> bool {
        let killed = acting.iter().any(|fault| fault.kind == FaultKind::Killed);
        if killed && !self.killed {
            // the recording ends with the companion
            self.disk = None;
            // there is a spare companion for each fault of this kind
            if let Some(next) = self.spares.pop() {
                self.desk = next;
            }
            self.follower.died();
        }
        self.killed = killed;
        if killed {
            self.unread.clear();
        }
        !killed
    }

    /// The conditions at this step that the companion cannot prevent and that may cause a finding.
    pub(super) fn exposure(&mut self, acting: &[Fault]) -> Exposure {
        let inputs = self.aircraft.inputs();
        let same = std::mem::replace(&mut self.flown, inputs) == inputs;
        let lied_to = |fault: &Fault| matches!(fault.kind, FaultKind::Airspeed | FaultKind::Alpha);
        Exposure {
            unsteered: same && self.aircraft.is_steered() || self.aircraft.turns_back(),
            blind: matches!(self.aircraft, Aircraft::Sitl(_)) && self.judge.is_blind(),
            misled: acting.iter().any(lied_to),
        }
    }

    /// Applies the faults of sensors, clock and disk. Returns the distortion of the sensors and the clock.
    pub(super) fn distortion(&mut self, acting: &[Fault], step: u64) -> Distortion {
        let mut distortion = Distortion::default();
        for fault in acting {
            let s = fault.strength;
            match fault.kind {
                FaultKind::Frozen => distortion.frozen = true,
                // a blocked pitot tube shows a constant airspeed, 0.4 to 1.4 times the cruise airspeed
                FaultKind::Airspeed => {
                    distortion.airspeed_mps = Some(0.4 * self.cruise + self.cruise * s)
                }
                FaultKind::Alpha => distortion.alpha_rad = 0.5 * (s - 0.5),
                FaultKind::NotANumber => distortion.rate_not_a_number = true,
                FaultKind::Clock => self.clock_us = (1e7 * s) as i64,
                FaultKind::Disk => {
                    self.disk.iter().for_each(|disk| disk.full.store(true, Ordering::Relaxed));
                }
                // the vehicle's clock restarts at zero
                FaultKind::Reboot => self.clock_us = -(10_000 * step as i64),
                _ => {}
            }
        }
        distortion.clock_us = self.clock_us;
        distortion
    }

    /// Waits up to 3 s for the companion's report that the disk is full. A missing report is a finding.
    pub(super) fn hear_of_the_disk(&mut self, now_s: f64) {
        if self.disk.as_ref().is_none_or(|disk| !disk.full.load(Ordering::Relaxed)) {
            return;
        }
        for _ in 0..300 {
            self.desk.poll(Duration::from_secs(61), &mut Vec::new());
            self.hear_texts(now_s);
            if self.texts.iter().any(|(_, words)| words.contains("recording of flight")) {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        self.judge.note(now_s, Finding::Unreported);
    }
}
