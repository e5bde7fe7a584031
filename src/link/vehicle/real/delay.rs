//! Delay in the control loop through the flight controller, from the controller's parameters, and the remaining delay margin.
//!
//! The delay margin is the smallest delay at which the loop of controller, surfaces and aircraft oscillates.

use std::fmt;
use std::time::Duration;

use super::Real;
use super::profile::{Authority, Stack};

/// Delay of a second-order Butterworth low-pass at low frequencies, in periods of its cut-off frequency: √2 / 2π.
const LOW_PASS: f64 = 0.225;
/// Sampling periods of the stick channels, s. ArduPilot samples its RC channels every 20 ms. PX4 uses each MANUAL_CONTROL
/// message, one per 10 ms.
const CHANNELS_S: [f64; 2] = [0.02, 0.01];
/// Remaining delay margin below which a warning is given, s. It leaves room for the link and other delays that are not
/// computed.
const SCARCE_S: f64 = 0.015;

/// Contributions of the flight controller to the delay of the loop, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delays {
    stack: Stack,
    /// Cut-off frequency of the gyro low-pass, Hz, and its delay, s.
    gyros: (f64, f64),
    /// Loop rate (Hz) and period (s) of the flight controller; `None` if its delay is negligible (PX4).
    cycle: Option<(f64, f64)>,
    /// Sampling period of the channels, s.
    channels_s: f64,
}

impl Delays {
    /// Sum of the contributions, s.
    pub fn sum_s(&self) -> f64 {
        self.gyros.1 + self.cycle.map_or(0.0, |(_, s)| s) + self.channels_s
    }
}

impl fmt::Display for Delays {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = |s: f64| 1e3 * s;
        let filter = match self.stack {
            Stack::Px4 => "IMU_GYRO_CUTOFF",
            Stack::Ardupilot => "INS_GYRO_FILTER",
        };
        write!(f, "gyros {:.0} ms ({filter} {:.0})", ms(self.gyros.1), self.gyros.0)?;
        if let Some((hz, s)) = self.cycle {
            write!(f, ", loop {:.0} ms (SCHED_LOOP_RATE {hz:.0})", ms(s))?;
        }
        write!(f, ", channels {:.0} ms", ms(self.channels_s))
    }
}

impl Real {
    /// Sets the delay margin of the loop through the surfaces; `None` if it is unknown.
    pub fn bear(&mut self, least: Option<Duration>) {
        self.bears = least;
    }

    /// The flight controller's contributions to the delay. `None` before its parameters are read, and if the companion commands
    /// attitudes.
    pub fn delays(&self) -> Option<Delays> {
        if self.profile.authority == Authority::Attitude {
            return None;
        }
        let stack = self.profile.stack;
        let (filter, cycle, channels_s) = match stack {
            Stack::Ardupilot => {
                let hz = self.parameters.get("SCHED_LOOP_RATE")?;
                ("INS_GYRO_FILTER", Some((hz, 1.0 / hz.max(1.0))), CHANNELS_S[0])
            }
            Stack::Px4 => ("IMU_GYRO_CUTOFF", None, CHANNELS_S[1]),
        };
        let hz = self.parameters.get(filter)?;
        // 0 disables the filter
        let low_pass = if hz > 0.0 { LOW_PASS / hz } else { 0.0 };
        Some(Delays { stack, gyros: (hz, low_pass), cycle, channels_s })
    }

    /// Remaining delay margin, s, with a text on the contributions; `None` if it is unknown.
    fn left(&self) -> Option<(f64, String)> {
        let (delays, bears) = (self.delays()?, self.bears?.as_secs_f64());
        let left = bears - delays.sum_s();
        let words = format!(
            "{delays}: {:.0} of the {:.0} ms at which the loop oscillates; margin {:.0} ms",
            1e3 * delays.sum_s(),
            1e3 * bears,
            1e3 * left
        );
        Some((left, words))
    }

    /// The remaining delay margin as text; `None` if it is unknown.
    pub fn delay_words(&self) -> Option<String> {
        self.left().map(|(_, words)| words)
    }

    /// Reason for which the companion must not command the surfaces, with the remedy; `None` if the remaining delay margin is
    /// positive or unknown.
    pub fn delay_obstacle(&self) -> Option<String> {
        let (left, words) = self.left()?;
        (left <= 0.0).then(|| {
            format!("the delay exceeds the controller's margin: {words}; {}", self.shorter())
        })
    }

    pub(super) fn delay_warning(&self) -> Option<String> {
        let (left, words) = self.left()?;
        (left < SCARCE_S).then(|| format!("small delay margin: {words}; {}", self.shorter()))
    }

    fn shorter(&self) -> &'static str {
        match self.profile.stack {
            Stack::Ardupilot => {
                "set INS_GYRO_FILTER 80 and SCHED_LOOP_RATE 250 (then reboot), or fly --controller lqi-damped"
            }
            Stack::Px4 => "raise IMU_GYRO_CUTOFF, or fly --controller lqi-damped",
        }
    }
}
