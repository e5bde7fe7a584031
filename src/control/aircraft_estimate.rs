//! Derivatives of roll and pitch of the aircraft, estimated in flight from body rates, flow angles and deflections.
//!
//! Equation error in the time domain (E. A. Morelli, V. Klein, "Aircraft System Identification", 2nd ed., 2016, chapter 5) by
//! recursive least squares with a prior: ω̇ is a sum of terms, each a coefficient times a measured quantity. Both sides are
//! differentiated and pass the same low-pass filters. The differentiation removes constant and slow influences (trim, wind).
//! A delay between measured and effective deflections is unknown: regressions with several delays run in parallel, and the one
//! with the smallest error counts.
//!
//! The estimator needs no model, and no command depends on it. Its estimates are for display and for the flight's summary.

use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::{ActuatorState, Airframe, State, Time};

/// Names of the estimates, in the order of [`AircraftEstimator::derivatives`]: the dimensional derivatives L_δa, L_p, M_δe, M_q
/// and M_α at the cruise airspeed.
pub const DERIVATIVES: [&str; 5] = ["L_da", "L_p", "M_de", "M_q", "M_a"];

/// Number of terms of each axis.
const TERMS: usize = 7;
/// Prior means and standard deviations of the coefficients of roll and pitch, dimensionless by V/g at the cruise airspeed V. The
/// first rows are medians and spreads of drawn aircraft (`greylag aircraft draw`). The order is that of [`terms`].
const PRIORS: [[[f64; TERMS]; 2]; 2] = [
    [[200.0, 15.0, 0.0, 0.0, 0.0, 0.0, 0.0], [250.0, 10.0, 300.0, 20.0, 1.0, 30.0, 1.0]],
    [[150.0, 10.0, 40.0, 0.0, 0.0, 0.0, 0.0], [200.0, 7.0, 50.0, 30.0, 1.0, 30.0, 1.0]],
];
/// Corner frequency of the low-pass filters on both sides of the regression, rad/s.
const CORNER: f64 = 10.0;
/// Standard deviation of the regression's error, 1/s². Its product with V/g (s) has the unit of the regression's left side.
const NOISE: f64 = 4.0;
/// Delays of the controls that are tried, in samples.
const DELAYS: [usize; 4] = [0, 2, 4, 6];
/// Largest delay, in samples.
const LONGEST: usize = 6;
/// Time constant of the mean square error that compares the delays, s.
const FORGETTING_S: f64 = 20.0;
/// Growth rate of each variance by forgetting, as a fraction of the prior variance, 1/s.
const AGEING: f64 = 1e-4;
/// Accepted sample intervals, s.
const STEPS_S: std::ops::RangeInclusive<f64> = 0.002..=0.05;
/// Ratio of an estimate's standard deviation to that of its prior below which the estimate counts as known.
const KNOWN: f64 = 0.3;
/// Range of the airspeed over the cruise airspeed in which the estimates are updated.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Estimator of the derivatives of one aircraft. [`AircraftEstimator::see`] is called with each state of a flight, in the order
/// of time.
#[derive(Clone, Debug)]
pub struct AircraftEstimator {
    /// Cruise airspeed, m/s.
    cruise: f64,
    /// Full travel of aileron, elevator and rudder, rad; infinite for an aircraft without a rudder.
    travel: [f64; 3],
    /// Regressions of roll and pitch, one for each of [`DELAYS`].
    axes: [[Axis; DELAYS.len()]; 2],
    /// Controls over their travels, the newest first.
    controls: [[f64; 4]; LONGEST + 1],
    last: Option<Time>,
}

/// The regression of one axis with one delay.
#[derive(Clone, Debug)]
struct Axis {
    prior_sd: [f64; TERMS],
    theta: [f64; TERMS],
    covariance: [[f64; TERMS]; TERMS],
    /// Low-passed square of the error before each update.
    error: f64,
    /// Filters of the rate and of the terms; `None` before the first sample and after an interruption.
    filters: Option<[Filter; TERMS + 1]>,
}

/// The derivative of a signal behind two first-order lags.
#[derive(Clone, Copy, Debug)]
struct Filter {
    low: f64,
    slope: f64,
}

impl Filter {
    /// Takes a further sample `x`, `step` seconds after the previous one.
    fn take(&mut self, x: f64, step: f64) {
        self.low += step * CORNER * (x - self.low);
        self.slope += step * CORNER * (CORNER * (x - self.low) - self.slope);
    }
}

impl Axis {
    fn new([mean, sd]: [[f64; TERMS]; 2]) -> Axis {
        let mut covariance = [[0.0; TERMS]; TERMS];
        (0..TERMS).for_each(|k| covariance[k][k] = sd[k] * sd[k]);
        Axis { prior_sd: sd, theta: mean, covariance, error: 0.0, filters: None }
    }

    /// Updates with the rate and the terms of one sample. `time` is V/g at the cruise airspeed, s.
    fn see(&mut self, rate: f64, terms: &[f64; TERMS], time: f64, step: f64) {
        let signals: [f64; TERMS + 1] =
            std::array::from_fn(|k| if k == 0 { rate } else { terms[k - 1] });
        if !signals.iter().all(|x| x.is_finite()) {
            return self.filters = None;
        }
        let Some(filters) = &mut self.filters else {
            return self.filters = Some(signals.map(|low| Filter { low, slope: 0.0 }));
        };
        let before = filters.map(|filter| filter.slope);
        filters.iter_mut().zip(signals).for_each(|(filter, x)| filter.take(x, step));
        // the difference of two rates is the acceleration in the middle between them
        let x = std::array::from_fn(|k| 0.5 * (filters[k + 1].slope + before[k + 1]));
        let y = (filters[0].slope - before[0]) / step * time * time;
        self.learn(&x, y, NOISE * time, step);
    }

    /// One step of the least squares: `y` = θ·x with an error of `noise`.
    fn learn(&mut self, x: &[f64; TERMS], y: f64, noise: f64, step: f64) {
        let dot = |a: &[f64; TERMS]| a.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
        let spread: [f64; TERMS] = std::array::from_fn(|k| dot(&self.covariance[k]));
        let variance = dot(&spread) + noise * noise;
        let error = y - dot(&self.theta);
        self.error += step / FORGETTING_S * (error * error - self.error);
        for i in 0..TERMS {
            self.theta[i] += spread[i] * error / variance;
            for j in 0..TERMS {
                self.covariance[i][j] -= spread[i] * spread[j] / variance;
            }
            let before = self.prior_sd[i] * self.prior_sd[i];
            if self.covariance[i][i] < before {
                self.covariance[i][i] += AGEING * step * before;
            }
        }
    }

    /// Coefficient `k`; NaN if its standard deviation is above [`KNOWN`] of the prior's.
    fn known(&self, k: usize) -> f64 {
        let narrowed = self.covariance[k][k].sqrt() / self.prior_sd[k];
        if narrowed < KNOWN { self.theta[k] } else { f64::NAN }
    }
}

/// Terms of the roll and the pitch equation: control, damping, incidence (for roll β and the yaw rate), gyroscopic moments, trim
/// moment by dynamic pressure, rudder or throttle. `speed` is the airspeed over the cruise airspeed, `time` V/g at cruise (s),
/// `controls` are aileron, elevator and rudder over their travels, and the throttle.
fn terms(s: &State, controls: [f64; 4], speed: f64, time: f64) -> [[f64; TERMS]; 2] {
    let [aileron, elevator, rudder, throttle] = controls;
    let (pressure, square) = (speed * speed, time * time);
    let rate = speed * time;
    [
        [
            aileron * pressure,
            -s.p * rate,
            s.beta * pressure,
            s.r * rate,
            s.q * s.r * square,
            rudder * pressure,
            s.p * s.q * square,
        ],
        [
            -elevator * pressure,
            -s.q * rate,
            -s.alpha * pressure,
            pressure,
            s.p * s.r * square,
            throttle,
            (s.r * s.r - s.p * s.p) * square,
        ],
    ]
}

impl AircraftEstimator {
    /// An estimator for the aircraft with `airframe`, from which only the cruise airspeed and the travels are used.
    pub fn new(airframe: &Airframe) -> AircraftEstimator {
        let surfaces = &airframe.actuators;
        let rudder = surfaces.rudder.as_ref().map_or(f64::INFINITY, |s| s.travel.smallest());
        AircraftEstimator {
            cruise: airframe.envelope.airspeed_cruise_mps,
            travel: [
                surfaces.aileron.travel.smallest(),
                surfaces.elevator.travel.smallest(),
                rudder,
            ],
            axes: PRIORS.map(|prior| std::array::from_fn(|_| Axis::new(prior))),
            controls: [[f64::NAN; 4]; LONGEST + 1],
            last: None,
        }
    }

    /// Updates the estimates with a state and the deflections at `time`. After a gap in time, or a state that is not finite, the
    /// filters restart; the estimates remain.
    pub fn see(&mut self, time: Time, state: &State, actuators: &ActuatorState) {
        let before = self.last.replace(time);
        let step = before.map_or(f64::NAN, |before| time.since(before).as_secs_f64());
        let speed = state.airspeed / self.cruise;
        if !STEPS_S.contains(&step) || !SPEEDS.contains(&speed) {
            return self.interrupt();
        }
        let scale = self.cruise / STANDARD_GRAVITY;
        let [aileron, elevator, rudder] = self.travel;
        self.controls.rotate_right(1);
        self.controls[0] = [
            actuators.aileron / aileron,
            actuators.elevator / elevator,
            actuators.rudder / rudder,
            actuators.throttle,
        ];
        for (k, delay) in DELAYS.into_iter().enumerate() {
            let [roll, pitch] = terms(state, self.controls[delay], speed, scale);
            self.axes[0][k].see(state.p, &roll, scale, step);
            self.axes[1][k].see(state.q, &pitch, scale, step);
        }
    }

    /// Restarts the filters, for instance when the deflections are unknown for a while. The estimates remain.
    pub fn interrupt(&mut self) {
        self.axes.iter_mut().flatten().for_each(|axis| axis.filters = None);
        self.controls = [[f64::NAN; 4]; LONGEST + 1];
    }

    /// The regression of axis 0 (roll) or 1 (pitch) with the delay that explains the flight best.
    fn best(&self, axis: usize) -> &Axis {
        let all = &self.axes[axis];
        all.iter().min_by(|a, b| a.error.total_cmp(&b.error)).unwrap_or(&all[0])
    }

    /// The dimensional derivatives at the cruise airspeed, in the order of [`DERIVATIVES`]: L_δa and M_δe in rad/s² at full
    /// deflection (L_δa is positive, M_δe negative), L_p and M_q in 1/s, M_α in 1/s². NaN if the standard deviation of the
    /// estimate is above 0.3 of the prior's.
    pub fn derivatives(&self) -> [f64; DERIVATIVES.len()] {
        let time = self.cruise / STANDARD_GRAVITY;
        let [roll, pitch] = [self.best(0), self.best(1)];
        [
            roll.known(0) / (time * time),
            -roll.known(1) / time,
            -pitch.known(0) / (time * time),
            -pitch.known(1) / time,
            -pitch.known(2) / (time * time),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The true control power is 120, the true damping 12. The constant moment is not among the regressors.
    #[test]
    fn control_power_and_damping_are_found_without_bias() {
        let (time, step, truth) = (2.0, 0.01, [120.0, 12.0]);
        let mut axis = Axis::new(PRIORS[0]);
        let mut rate: f64 = 0.0;
        for k in 0..1500 {
            let command = 0.1 * (f64::from(k) * 0.05).sin() + 0.1 * (f64::from(k) * 0.013).cos();
            let mut terms = [0.0; TERMS];
            (terms[0], terms[1]) = (command, -rate * time);
            axis.see(rate, &terms, time, step);
            // ten steps of integration between two samples stand for continuous time
            for _ in 0..10 {
                let acceleration =
                    (truth[0] * command + 3.0) / (time * time) - truth[1] / time * rate;
                rate += 0.1 * step * acceleration;
            }
        }
        for (k, truth) in truth.iter().enumerate() {
            assert!((axis.known(k) / truth - 1.0).abs() < 0.1, "{:?}", axis.theta);
        }
    }

    #[test]
    fn what_was_not_moved_is_not_known() {
        let mut axis = Axis::new(PRIORS[1]);
        (0..1000).for_each(|_| axis.see(0.0, &[0.0; TERMS], 2.0, 0.01));
        assert!(axis.known(0).is_nan() && axis.known(2).is_nan());
        axis.see(f64::NAN, &[0.0; TERMS], 2.0, 0.01);
        assert!(axis.filters.is_none() && axis.theta == PRIORS[1][0]);
    }
}
