//! Sensor and clock faults other than noise: freeze, offset, NaN, clock jump.

use crate::plant::Truth;

/// Present errors of the sensors and the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Every sensor keeps its last value before the freeze.
    pub frozen: bool,
    /// Value that replaces the airspeed, as a blocked pitot tube would show, m/s; `None` for no fault.
    pub airspeed_mps: Option<f64>,
    /// Offset of the angle of attack, rad.
    pub alpha_rad: f64,
    /// The pitch rate is NaN.
    pub rate_not_a_number: bool,
    /// Offset of the frames' time stamp, µs.
    pub clock_us: i64,
}

/// The present distortion and the last measurement.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Distorter {
    pub(super) now: Distortion,
    held: Option<Truth>,
}

impl Distorter {
    /// Distorted measurement and its time stamp, µs.
    pub(super) fn apply(&mut self, time_us: u64, measured: Truth) -> (u64, Truth) {
        let mut shown = match (self.now.frozen, self.held) {
            (true, Some(held)) => held,
            _ => measured,
        };
        self.held = Some(shown);
        if let Some(airspeed) = self.now.airspeed_mps {
            shown.airspeed_mps = airspeed;
        }
        shown.alpha_rad += self.now.alpha_rad;
        if self.now.rate_not_a_number {
            shown.q_radps = f64::NAN;
        }
        (time_us.saturating_add_signed(self.now.clock_us), shown)
    }
}
