//! Effect of uncertain sensor errors on the residual (measured minus predicted value) of each channel.
//!
//! A channel is a force, a moment or a rate. A window is a short section of a flight over which it is averaged with a kernel.
//!
//! The error of an estimated sensor bias shifts the residuals of all windows of a flight equally. A bootstrap over windows does
//! not cover this shift. The sensor constants (biases, scales, delays) are treated as independent, with the standard deviations
//! that the reconstruction states.

use crate::flight_path::reconstruction::{Instant, Nuisance};
use crate::weak_form::channels::ChannelId;
use crate::weak_form::prepared::Prepared;
use crate::weak_form::windows;
use greylag_model::GreyBox;
use greylag_num::statistics::mean;
use greylag_physics::{Controls, State};

/// Half width of a 95 % interval in standard deviations of a normal distribution.
pub const NORMAL_95: f64 = 1.96;

/// Adds an error of one sensor constant to an instant. The arguments are the instant, the rates of the controls (rad/s,
/// throttle 1/s), and the error in the constant's unit.
type Move = fn(&mut Instant, &Controls, f64);

/// Sensor constants (biases, scales, delays) whose errors shift a residual.
const CONSTANTS: [(&str, Move); COUNT] = [
    ("gyro_bias_p", |i, _, by| i.state.p += by),
    ("gyro_bias_q", |i, _, by| i.state.q += by),
    ("gyro_bias_r", |i, _, by| i.state.r += by),
    ("accelerometer_bias_x", |i, _, by| i.specific_force[0] += by),
    ("accelerometer_bias_y", |i, _, by| i.specific_force[1] += by),
    ("accelerometer_bias_z", |i, _, by| i.specific_force[2] += by),
    ("alpha_bias", |i, _, by| i.state.alpha += by),
    ("beta_bias", |i, _, by| i.state.beta += by),
    ("airspeed_scale", |i, _, by| i.state.airspeed *= 1.0 + by),
    ("alpha_path", |i, _, by| i.state.alpha += by),
    ("beta_path", |i, _, by| i.state.beta += by),
    ("skew_actuators", |i, rate, by| {
        i.controls.aileron += rate.aileron * by;
        i.controls.elevator += rate.elevator * by;
        i.controls.throttle += rate.throttle * by;
        i.controls.rudder += rate.rudder * by;
    }),
];
/// Number of entries of `CONSTANTS`.
pub const COUNT: usize = 12;

/// Shift of a residual for an error of one standard deviation in each constant, in the channel's unit.
pub type Shift = [f64; COUNT];

/// Shifts of every channel's residual, `[window][channel]` in the order of [`ChannelId::ALL`].
///
/// The shifts are evaluated at the middle of each window, where the kernel is largest. The shift of a constant that
/// `nuisances` lacks is 0.
pub fn shifts(
    model: &GreyBox,
    flight: &Prepared,
    nuisances: &[Nuisance],
) -> Vec<[Shift; ChannelId::ALL.len()]> {
    let flight = &*flight.acting(model);
    let sd = CONSTANTS.map(|(name, _)| {
        let found = nuisances.iter().find(|n| n.name == name).map_or(0.0, |n| n.sd);
        if found.is_finite() { found } else { 0.0 }
    });
    let of_window = |samples: &[Instant]| {
        let middle = samples.len() / 2;
        let (at, rate) = (&samples[middle], controls_rate(samples, middle));
        let mut shifts = [[0.0; COUNT]; ChannelId::ALL.len()];
        for (k, (_, change)) in CONSTANTS.iter().enumerate().filter(|(k, _)| sd[*k] > 0.0) {
            let moved = |by: f64| {
                let mut moved = Instant { state: State { ..at.state }, ..*at };
                change(&mut moved, &rate, by);
                windows::residual(model, &moved)
            };
            let (up, down) = (moved(sd[k]), moved(-sd[k]));
            for (shift, (up, down)) in shifts.iter_mut().zip(up.iter().zip(down)) {
                shift[k] = 0.5 * (up - down);
            }
        }
        shifts
    };
    flight.windows.iter().map(|window| of_window(flight.samples(window))).collect()
}

/// Rates of the controls at sample `k` (rad/s, throttle 1/s), by central difference.
fn controls_rate(samples: &[Instant], k: usize) -> Controls {
    let (a, b) = (&samples[k.saturating_sub(1)], &samples[(k + 1).min(samples.len() - 1)]);
    let time = b.time_s - a.time_s;
    let rate = |a: f64, b: f64| if time > 0.0 { (b - a) / time } else { 0.0 };
    Controls {
        aileron: rate(a.controls.aileron, b.controls.aileron),
        elevator: rate(a.controls.elevator, b.controls.elevator),
        throttle: rate(a.controls.throttle, b.controls.throttle),
        rudder: rate(a.controls.rudder, b.controls.rudder),
        lagged: None,
    }
}

/// Standard deviation of a mean of residuals due to the errors of the constants. `shifts` contains a flight index and a shift
/// for each window.
///
/// Shifts add up within a flight and are independent between flights.
pub fn deviation<'a>(shifts: impl Iterator<Item = (usize, &'a Shift)>) -> f64 {
    let mut sums: Vec<Shift> = Vec::new();
    let mut count = 0.0;
    for (flight, shift) in shifts {
        if sums.len() <= flight {
            sums.resize(flight + 1, [0.0; COUNT]);
        }
        sums[flight].iter_mut().zip(shift).for_each(|(sum, x)| *sum += x);
        count += 1.0;
    }
    let square: f64 = sums.iter().flatten().map(|sum| (sum / count).powi(2)).sum();
    if square.is_finite() { square.sqrt() } else { 0.0 }
}

/// Root mean square over windows of the residual's standard deviation that the errors of all constants cause.
pub fn level<'a>(shifts: impl Iterator<Item = &'a Shift>) -> f64 {
    let squares: Vec<f64> = shifts.map(|s| s.iter().map(|x| x * x).sum()).collect();
    if squares.is_empty() { 0.0 } else { mean(&squares).sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_flight_adds_up_and_several_average_out() {
        let mut shift = [0.0; COUNT];
        (shift[6], shift[8]) = (3.0, 4.0);
        // Ten windows of one flight shift equally. The squares of the shifts by two constants add up: 3² + 4² = 5².
        assert_eq!(deviation((0..10).map(|_| (0, &shift))), 5.0);
        // With four flights of independent errors, the standard deviation is half as large.
        let four = deviation((0..40).map(|i| (i % 4, &shift)));
        assert!((four - 2.5).abs() < 1e-12, "{four}");
        assert_eq!(deviation(std::iter::empty()), 0.0);
    }
}
