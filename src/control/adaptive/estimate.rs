//! Control power, damping and stiffness of one axis of an unknown aircraft, estimated in flight.
//!
//! The method is recursive least squares with a prior (a Kalman filter over constants, K. J. Åström, B. Wittenmark, "Adaptive
//! Control", 2nd ed., 1995, section 2.2). The regression at cruise is ω̇ = b u − a ω − m α̂. The body rate is ω, the command
//! behind an assumed servo is u, and the estimated change of the angle of attack is α̂. The estimated parameters are the control
//! power b, the damping a and the stiffness m. At other airspeeds u and α̂ are multiplied by (V/V_cruise)² and ω by V/V_cruise.
//! Both sides are differentiated and pass the same low-pass filters. The differentiation removes constant and slow influences
//! (trim, wind, asymmetry).

use greylag_model::STEP;

/// Corner frequency of the low-pass filters on both sides of the regression, rad/s.
const CORNER: f64 = 20.0;
/// Corner frequencies of two first-order lags that approximate an unknown servo and an unknown delay, rad/s.
const SERVO: [f64; 2] = [25.0, 40.0];
/// `NOISE` g/V (1/s³, at the cruise airspeed V) is the standard deviation of the part of the regression's error that does not
/// depend on the signals. `NOISE` is in 1/s².
const NOISE: f64 = 4.0;
/// Standard deviation of the other part of the error, as a fraction of the regression's left side. It covers servos and delays
/// that differ from the assumed ones.
const SHARE: f64 = 0.2;
/// Growth rate of each variance below its prior value (forgetting), as a fraction of the prior variance, 1/s.
const AGEING: f64 = 1e-3;

/// Prior of control power, damping and stiffness of an axis. The units are (g/V)², g/V and (g/V)², with the standard gravity g
/// and the cruise airspeed V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Prior {
    pub mean: [f64; 3],
    pub sd: [f64; 3],
    /// Lower limit of the control power, (g/V)².
    pub least: f64,
}

/// The running estimate of one axis, roll or pitch.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Estimate {
    prior: Prior,
    /// Estimated control power, damping and stiffness, in the prior's units.
    pub theta: [f64; 3],
    covariance: [[f64; 3]; 3],
    servo: [f64; 2],
    filters: Option<[[f64; 4]; 2]>,
}

/// Measurements of one axis at one instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// Body rate, rad/s.
    pub rate: f64,
    /// Command that acts at this instant, −1..1. A positive command accelerates the axis to positive rates.
    pub command: f64,
    /// Estimated deviation of the angle of attack from trim, rad. Zero for the roll axis, which has no stiffness.
    pub incidence: f64,
    /// Airspeed divided by the cruise airspeed.
    pub speed: f64,
    /// V/g at cruise, s.
    pub time: f64,
}

impl Estimate {
    pub(super) fn new(prior: Prior) -> Estimate {
        let mut covariance = [[0.0; 3]; 3];
        (0..3).for_each(|k| covariance[k][k] = prior.sd[k] * prior.sd[k]);
        Estimate { prior, theta: prior.mean, covariance, servo: [0.0; 2], filters: None }
    }

    /// Updates the estimate with the measurements of one instant. Measurements that contain a NaN or an infinity are ignored.
    pub(super) fn see(&mut self, seen: &Seen) {
        let Seen { rate, command, incidence, speed, time } = *seen;
        if ![rate, command, incidence, speed].iter().all(|x| x.is_finite()) {
            return;
        }
        let [first, second] = &mut self.servo;
        *first += STEP * SERVO[0] * (command - *first);
        *second += STEP * SERVO[1] * (*first - *second);
        let square = speed * speed;
        let raw = [rate, *second * square, rate * speed, incidence * square];
        let [low, slope] = self.filters.get_or_insert([raw, [0.0; 4]]);
        let mut bend = 0.0;
        for k in 0..4 {
            low[k] += STEP * CORNER * (raw[k] - low[k]);
            let steep = CORNER * (raw[k] - low[k]);
            slope[k] += STEP * CORNER * (steep - slope[k]);
            if k == 0 {
                bend = CORNER * (steep - slope[k]);
            }
        }
        let x = [slope[1], -slope[2] * time, -slope[3]];
        self.learn(x, bend * time * time, NOISE * time);
    }

    /// One step of recursive least squares for `y` = θ·`x`. The variance of the error is `noise`² + (`SHARE` `y`)².
    fn learn(&mut self, x: [f64; 3], y: f64, noise: f64) {
        let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let spread: [f64; 3] = std::array::from_fn(|k| dot(&self.covariance[k], &x));
        let variance = dot(&x, &spread) + noise * noise + (SHARE * y).powi(2);
        let error = y - dot(&self.theta, &x);
        for i in 0..3 {
            self.theta[i] += spread[i] * error / variance;
            for j in 0..3 {
                self.covariance[i][j] -= spread[i] * spread[j] / variance;
            }
            let before = self.prior.sd[i] * self.prior.sd[i];
            if self.covariance[i][i] < before {
                self.covariance[i][i] += AGEING * STEP * before;
            }
        }
        self.theta[0] = self.theta[0].max(self.prior.least);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Control power estimated after five seconds of a square-wave command, in units of (g/V)². The axis obeys
    /// ω̇ = `power` · u − `damping` · ω, and V/g is 2 s.
    fn found(power: f64, damping: f64) -> f64 {
        let prior = Prior { mean: [400.0, 15.0, 0.0], sd: [250.0, 10.0, 1e-6], least: 25.0 };
        let mut estimate = Estimate::new(prior);
        let (time, mut rate, mut servo) = (2.0, 0.0, [0.0; 2]);
        for k in 0..500 {
            let command = if k / 40 % 2 == 0 { 0.1 } else { -0.1 };
            estimate.see(&Seen { rate, command, incidence: 0.0, speed: 1.0, time });
            servo[0] += STEP * SERVO[0] * (command - servo[0]);
            servo[1] += STEP * SERVO[1] * (servo[0] - servo[1]);
            rate += STEP * (power * servo[1] - damping * rate);
        }
        estimate.theta[0]
    }

    /// The true control powers are 120 and 800 (g/V)², the prior mean is 400. The regression neglects one step of delay, which
    /// biases the estimates by about a fifth.
    #[test]
    fn the_power_of_an_axis_is_found_in_five_seconds() {
        for (power, damping) in [(30.0, 6.0), (200.0, 8.0)] {
            let (found, truth) = (found(power, damping), 4.0 * power);
            assert!((found / truth - 1.0).abs() < 0.25, "{found} for {truth}");
        }
    }

    #[test]
    fn what_is_no_number_is_left_out() {
        let prior = Prior { mean: [400.0, 15.0, 0.0], sd: [250.0, 10.0, 1e-6], least: 25.0 };
        let mut estimate = Estimate::new(prior);
        let seen = Seen { rate: f64::NAN, command: 0.0, incidence: 0.0, speed: 1.0, time: 2.0 };
        estimate.see(&seen);
        assert_eq!(estimate, Estimate::new(prior));
    }
}
