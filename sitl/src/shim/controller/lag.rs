//! Delays of a real flight controller: low-pass filters of the gyros and delay of the surfaces.

use std::collections::VecDeque;

use crate::plant::{DT_S, Inputs, Truth};

/// Longest delay of the surfaces, in steps: one minute. A ground station may set any delay.
const LONGEST: usize = 6000;

/// States of the gyro filter and of the command delay.
#[derive(Clone, Debug, Default)]
pub(super) struct Lag {
    rates: Option<[f64; 3]>,
    late: VecDeque<Inputs>,
}

impl Lag {
    /// `measured` with its body rates low-pass filtered at `cutoff_hz`, Hz; 0 disables the filter.
    pub(super) fn filtered(&mut self, mut measured: Truth, cutoff_hz: f64) -> Truth {
        let now = [measured.p_radps, measured.q_radps, measured.r_radps];
        let share = if cutoff_hz > 0.0 { share(cutoff_hz) } else { 1.0 };
        let rates = self.rates.get_or_insert(now);
        for (y, x) in rates.iter_mut().zip(now) {
            *y += share * (x - *y);
        }
        [measured.p_radps, measured.q_radps, measured.r_radps] = *rates;
        measured
    }

    /// Returns the inputs of the call `delay_ms` (ms, rounded to whole steps) ago. If there were fewer calls, returns
    /// the inputs of the first call.
    pub(super) fn delayed(&mut self, inputs: Inputs, delay_ms: f64) -> Inputs {
        // NaN, for a stack without this parameter, becomes 0
        let steps = ((delay_ms * 1e-3 / DT_S).round().max(0.0) as usize).min(LONGEST);
        self.late.push_back(inputs);
        while self.late.len() > steps + 1 {
            self.late.pop_front();
        }
        self.late.front().copied().unwrap_or(inputs)
    }
}

/// Weight of a new sample in a first-order low-pass at the step rate. Both stacks use a second-order Butterworth low-pass. The
/// first-order filter has the same delay at low frequency, √2 / (2π f): 11 ms at 20 Hz.
fn share(cutoff_hz: f64) -> f64 {
    let late_s = std::f64::consts::SQRT_2 / (std::f64::consts::TAU * cutoff_hz);
    DT_S / (DT_S + late_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_of_the_gyro_comes_late_by_the_filters_delay() {
        let mut lag = Lag::default();
        let mut shown = 0.0;
        for i in 0..100 {
            let measured = Truth { q_radps: 0.01 * f64::from(i), ..Truth::default() };
            shown = lag.filtered(measured, 20.0).q_radps;
        }
        // The ramp is 1 rad/s², so the lag is √2 / (2π 20 Hz) = 11.25 ms; the transient has decayed to 1e-28.
        let behind = std::f64::consts::SQRT_2 / (std::f64::consts::TAU * 20.0);
        assert!((0.99 - shown - behind).abs() < 1e-9, "{shown}");
    }

    #[test]
    fn inputs_come_late_by_whole_steps() {
        let mut lag = Lag::default();
        let at = |i: usize| Inputs { elevator: i as f64, ..Inputs::default() };
        let flown: Vec<f64> = (0..8).map(|i| lag.delayed(at(i), 30.0).elevator).collect();
        assert_eq!(flown, [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 4.0]);
    }

    #[test]
    fn a_delay_of_any_length_holds_the_first_inputs() {
        let mut lag = Lag::default();
        let at = |elevator| Inputs { elevator, ..Inputs::default() };
        let flown = [0.25, 0.5].map(|x| lag.delayed(at(x), 1e300).elevator);
        assert_eq!(flown, [0.25, 0.25]);
        assert_eq!(Lag::default().delayed(at(0.5), f64::NAN).elevator, 0.5);
    }
}
