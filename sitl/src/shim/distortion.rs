//! Faults of the measurements apart from noise: sensors that freeze, err or jump.

use crate::plant::Truth;

/// Present errors of the sensors and the clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Every sensor keeps the value that it had when this began.
    pub frozen: bool,
    /// The airspeed sensor shows this, as a blocked tube does, m/s.
    pub airspeed_mps: Option<f64>,
    /// Added to the angle of attack, rad.
    pub alpha_rad: f64,
    /// The pitch rate is not a number.
    pub rate_not_a_number: bool,
    /// Added to the time that frames show, µs.
    pub clock_us: i64,
}

/// Distortions with their memory.
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
