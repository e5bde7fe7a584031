//! ArduPlane's failsafes, after its sources (`events.cpp`, `radio.cpp`, `system.cpp` of 4.6 to 4.8-dev).
//!
//! One state holds the active failure. A failure triggers one action when it is detected. While it is active, it masks failures
//! of lower priority.

use super::modes::Mode;
use super::parameters::Table;

/// Time of ten readings of the channels at 50 Hz, s; ArduPilot adds these readings to RC_FS_TIMEOUT.
const COUNTED_S: f64 = 0.2;
/// Steps between two checks for long failures: 3 Hz.
const LOOK_EVERY: u64 = 33;
/// Largest age of the ground station's heartbeat that ends the ground-station failure, s (FS_SHORT_TIMEOUT).
const BACK_S: f64 = 1.5;

/// The active failure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Failed {
    #[default]
    Nothing,
    /// RC receiver lost since this time, µs; the mode is the mode before the loss.
    Short(u64, Mode),
    /// RC receiver lost for longer than FS_LONG_TIMEOUT, or from the start.
    Long,
    /// Ground station lost.
    Station,
}

/// Inputs of the failsafes at a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Number of steps since the start, and simulated time, µs.
    pub(super) steps: u64,
    pub(super) now_us: u64,
    pub(super) mode: Mode,
    /// Whether an RC transmitter is bound.
    pub(super) radio: bool,
    /// Age of the last overrides, and of the ground station's last heartbeat, s; `None` if there was none.
    pub(super) sticks_s: Option<f64>,
    pub(super) station_s: Option<f64>,
}

/// Action of a failsafe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Act {
    /// The mode to enter; `None` if the mode does not change.
    pub(super) mode: Option<Mode>,
    /// Whether the companion's channel overrides are dropped.
    pub(super) drops_overrides: bool,
    /// STATUSTEXT for the ground station.
    pub(super) words: &'static [u8],
}

/// An action that enters `mode` and keeps the overrides.
fn go(mode: Mode, words: &'static [u8]) -> Option<Act> {
    Some(Act { mode: Some(mode), drops_overrides: false, words })
}

/// The failsafes of one aircraft.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Failsafes {
    failed: Failed,
    begun: bool,
}

impl Failsafes {
    /// Evaluates the failsafes at a step.
    pub(super) fn watch(&mut self, seen: &Seen, parameters: &Table) -> Option<Act> {
        let patience = parameters.get("RC_FS_TIMEOUT") + COUNTED_S;
        let silent = !seen.radio && seen.sticks_s.is_none_or(|age| age > patience);
        let receiver = parameters.get("THR_FAILSAFE") == 1.0 && silent;
        if !std::mem::replace(&mut self.begun, true) && receiver {
            // The failure began before the flight, so its failsafe has already acted on the ground.
            self.failed = Failed::Long;
        }
        let short = parameters.get("FS_SHORT_ACTN") as i32;
        match self.failed {
            Failed::Nothing if receiver && short != SHORT_DISABLED => {
                self.failed = Failed::Short(seen.now_us, seen.mode);
                let circles = match seen.mode {
                    Mode::Manual => matches!(short, 0 | 1),
                    Mode::Guided | Mode::Hold => short == 1,
                    Mode::Return | Mode::Circle => false,
                };
                return go(Mode::Circle, b"RC Short Failsafe").filter(|_| circles);
            }
            Failed::Short(_, before) if !receiver => {
                self.failed = Failed::Nothing;
                let restored = seen.mode == Mode::Circle && before != Mode::Circle;
                return go(before, b"RC Short Failsafe Cleared").filter(|_| restored);
            }
            _ => {}
        }
        if seen.steps.is_multiple_of(LOOK_EVERY) {
            self.look(seen, receiver, parameters)
        } else {
            None
        }
    }

    /// Checks for long failures, which run at 3 Hz.
    fn look(&mut self, seen: &Seen, receiver: bool, parameters: &Table) -> Option<Act> {
        let timeout = parameters.get("FS_LONG_TIMEOUT");
        let since = match self.failed {
            Failed::Long => {
                self.failed = if receiver { Failed::Long } else { Failed::Nothing };
                return None;
            }
            Failed::Station => {
                let back = seen.station_s.is_some_and(|age| age < BACK_S);
                self.failed = if back { Failed::Nothing } else { Failed::Station };
                return None;
            }
            Failed::Short(at, _) => Some((seen.now_us - at) as f64 * 1e-6),
            Failed::Nothing => seen.sticks_s,
        };
        let watches = matches!(parameters.get("FS_GCS_ENABL") as i32, 1 | 2);
        let words: &'static [u8] = if receiver && since.is_none_or(|s| s > timeout) {
            self.failed = Failed::Long;
            b"RC Long Failsafe On"
        } else if watches && seen.station_s.is_some_and(|age| age > timeout) {
            self.failed = Failed::Station;
            b"GCS Failsafe On"
        } else {
            return None;
        };
        let long = parameters.get("FS_LONG_ACTN") as i32;
        let returns = match seen.mode {
            Mode::Manual | Mode::Circle | Mode::Hold => matches!(long, 0 | 1),
            Mode::Guided => long == 1,
            Mode::Return => false,
        };
        Some(Act { mode: returns.then_some(Mode::Return), drops_overrides: true, words })
    }
}

/// Value of FS_SHORT_ACTN that disables the short failsafe.
const SHORT_DISABLED: i32 = 3;
