//! Estimates stability and control derivatives of roll and pitch in flight, from body rates, flow angles and deflections.
//!
//! The method is equation error in the time domain (E. A. Morelli, V. Klein, "Aircraft System Identification", 2nd ed., 2016,
//! chapter 5) by recursive least squares with a prior. The regression equates the angular acceleration of an axis with a sum
//! of terms. Each term is a coefficient times a measured quantity. Both sides are differentiated and pass the same low-pass
//! filters. The differentiation removes constant and slow influences (trim, wind). The delay between measured and effective
//! deflections is unknown. Regressions with several delays therefore run in parallel, and the estimates are taken from the
//! regression with the smallest mean square error.
//!
//! The estimator needs no model, and no command depends on it. Its estimates are for display and for the flight's summary.

use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::{ActuatorState, Airframe, State, Time};

/// Names of the estimates, in the order of [`AircraftEstimator::derivatives`]: the dimensional derivatives L_δa, L_p, M_δe and
/// M_α at the cruise airspeed. M_q is estimated too but not returned, because closed-loop flights hardly separate it from M_α
/// (`docs/explanation/planner.md`).
pub const DERIVATIVES: [&str; 4] = ["L_da", "L_p", "M_de", "M_a"];

/// Number of regression terms of each axis that depend on the controls. `MOTION` terms depend on the motion alone.
const CONTROLS: usize = 2;
const MOTION: usize = 5;
const TERMS: usize = CONTROLS + MOTION;
/// Prior means and standard deviations of the coefficients of roll and of pitch, made dimensionless with V/g at the cruise
/// airspeed V. The values for control power, damping and stiffness are medians and spreads over aircraft drawn at random
/// (`greylag aircraft draw`). The coefficients belong to the terms of [`of_controls`], followed by those of [`of_motion`].
const PRIORS: [[[f64; TERMS]; 2]; 2] = [
    [[200.0, 0.0, 15.0, 0.0, 0.0, 0.0, 0.0], [250.0, 30.0, 10.0, 300.0, 20.0, 1.0, 1.0]],
    [[150.0, 0.0, 10.0, 40.0, 0.0, 0.0, 0.0], [200.0, 30.0, 7.0, 50.0, 30.0, 1.0, 1.0]],
];
/// Corner frequency of the low-pass filters on both sides of the regression, rad/s.
const CORNER: f64 = 10.0;
/// Standard deviation of the regression's error, divided by V/g at the cruise airspeed, 1/s².
const NOISE: f64 = 4.0;
/// Delays of the controls in the parallel regressions, samples. The longest delay is last.
const DELAYS: [usize; 4] = [0, 2, 4, 6];
const LONGEST: usize = DELAYS[DELAYS.len() - 1];
/// Time constant of the running mean square error by which the delays are compared, s.
const FORGETTING_S: f64 = 20.0;
/// Rate at which forgetting enlarges each variance that is below its prior variance, as a fraction of the prior variance, 1/s.
const AGEING: f64 = 1e-4;
/// Accepted sample intervals, s.
const STEPS_S: std::ops::RangeInclusive<f64> = 0.002..=0.05;
/// An estimate counts as known if its standard deviation is less than this fraction of its prior standard deviation.
const KNOWN: f64 = 0.3;
/// Range of the ratio of airspeed to cruise airspeed in which the estimates are updated.
const SPEEDS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// Estimator of the derivatives of one aircraft. [`AircraftEstimator::see`] must be called with each state of a flight, in the
/// order of time.
#[derive(Clone, Debug)]
pub struct AircraftEstimator {
    /// Cruise airspeed, m/s.
    cruise: f64,
    /// Travel of aileron, elevator and rudder to the side with the smaller travel, rad. Infinite for a missing rudder.
    travel: [f64; 3],
    /// The regressions of roll and of pitch.
    axes: [Axis; 2],
    /// Controls of the last samples, newest first: aileron, elevator and rudder divided by their travels, then the throttle.
    /// `None` before the first sample and after an interruption.
    controls: Option<[[f64; 4]; LONGEST + 1]>,
    last: Option<Time>,
}

/// The regressions of one axis, one for each of [`DELAYS`], with their common filters.
#[derive(Clone, Debug)]
struct Axis {
    regressions: [Regression; DELAYS.len()],
    filters: Option<Filters>,
}

/// Filters of the signals of one axis.
#[derive(Clone, Copy, Debug)]
struct Filters {
    rate: Filter,
    motion: [Filter; MOTION],
    controls: [[Filter; CONTROLS]; DELAYS.len()],
}

/// Recursive least squares with a prior.
#[derive(Clone, Debug)]
struct Regression {
    prior_sd: [f64; TERMS],
    theta: [f64; TERMS],
    covariance: [[f64; TERMS]; TERMS],
    /// Low-pass filtered square of the prediction error before each update.
    error: f64,
}

/// Filter for the time derivative of a signal, with two first-order lags.
#[derive(Clone, Copy, Debug)]
struct Filter {
    low: f64,
    slope: f64,
}

impl Filter {
    fn at(low: f64) -> Filter {
        Filter { low, slope: 0.0 }
    }

    /// Filters a sample `x`, which is `step` seconds after the previous one. Returns the filtered derivative before and after
    /// this sample.
    fn take(&mut self, x: f64, step: f64) -> [f64; 2] {
        let before = self.slope;
        self.low += step * CORNER * (x - self.low);
        self.slope += step * CORNER * (CORNER * (x - self.low) - self.slope);
        [before, self.slope]
    }
}

fn middle([before, after]: [f64; 2]) -> f64 {
    0.5 * (before + after)
}

impl Axis {
    fn new(prior: [[f64; TERMS]; 2]) -> Axis {
        Axis { regressions: std::array::from_fn(|_| Regression::new(prior)), filters: None }
    }

    /// Updates the regressions with the body rate (rad/s), the terms of the motion, and the terms of the controls for each delay.
    /// `time` is V/g at the cruise airspeed, s. `step` is the time since the last sample, s. If a value is not finite, the
    /// filters restart.
    fn see(
        &mut self,
        rate: f64,
        motion: &[f64; MOTION],
        controls: &[[f64; CONTROLS]; DELAYS.len()],
        [time, step]: [f64; 2],
    ) {
        let mut all = motion.iter().chain(controls.iter().flatten()).chain([&rate]);
        if !all.all(|x| x.is_finite()) {
            return self.filters = None;
        }
        let Some(filters) = &mut self.filters else {
            let controls = controls.map(|terms| terms.map(Filter::at));
            let (rate, motion) = (Filter::at(rate), motion.map(Filter::at));
            return self.filters = Some(Filters { rate, motion, controls });
        };
        // the difference quotient of two samples is the derivative midway between them
        let [before, after] = filters.rate.take(rate, step);
        let y = (after - before) / step * time * time;
        let motion: [f64; MOTION] =
            std::array::from_fn(|k| middle(filters.motion[k].take(motion[k], step)));
        for (d, regression) in self.regressions.iter_mut().enumerate() {
            let own = &mut filters.controls[d];
            let own: [f64; CONTROLS] =
                std::array::from_fn(|k| middle(own[k].take(controls[d][k], step)));
            let x = std::array::from_fn(|k| match k {
                0..CONTROLS => own[k],
                _ => motion[k - CONTROLS],
            });
            regression.learn(&x, y, NOISE * time, step);
        }
    }

    /// The regression with the smallest mean square error.
    fn best(&self) -> &Regression {
        let all = &self.regressions;
        all.iter().min_by(|a, b| a.error.total_cmp(&b.error)).unwrap_or(&all[0])
    }
}

impl Regression {
    fn new([mean, sd]: [[f64; TERMS]; 2]) -> Regression {
        let mut covariance = [[0.0; TERMS]; TERMS];
        (0..TERMS).for_each(|k| covariance[k][k] = sd[k] * sd[k]);
        Regression { prior_sd: sd, theta: mean, covariance, error: 0.0 }
    }

    /// One step of recursive least squares for the equation `y` = θ·`x`. Its error has the standard deviation `noise`. `step` is
    /// the time since the last sample, s.
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

    /// Estimate of coefficient `k`. NaN if its standard deviation is not below the fraction [`KNOWN`] of the prior standard
    /// deviation.
    fn known(&self, k: usize) -> f64 {
        let narrowed = self.covariance[k][k].sqrt() / self.prior_sd[k];
        if narrowed < KNOWN { self.theta[k] } else { f64::NAN }
    }
}

/// Regression terms of roll (aileron, rudder) and pitch (elevator, throttle) that depend on the controls. The deflections are
/// divided by their travels. `speed` is the airspeed divided by the cruise airspeed.
fn of_controls(
    [aileron, elevator, rudder, throttle]: [f64; 4],
    speed: f64,
) -> [[f64; CONTROLS]; 2] {
    let pressure = speed * speed;
    [[aileron * pressure, rudder * pressure], [-elevator * pressure, throttle]]
}

/// Regression terms that depend on the motion. The terms of roll are those of damping, β, yaw rate and two products of body
/// rates (inertial coupling). The terms of pitch are those of damping, α, a constant moment coefficient and inertial coupling.
/// `speed` is the airspeed divided by the cruise airspeed, and `time` is V/g at the cruise airspeed, s.
fn of_motion(s: &State, speed: f64, time: f64) -> [[f64; MOTION]; 2] {
    let (pressure, rate, square) = (speed * speed, speed * time, time * time);
    [
        [-s.p * rate, s.beta * pressure, s.r * rate, s.q * s.r * square, s.p * s.q * square],
        [
            -s.q * rate,
            -s.alpha * pressure,
            pressure,
            s.p * s.r * square,
            (s.r * s.r - s.p * s.p) * square,
        ],
    ]
}

impl AircraftEstimator {
    /// An estimator for the aircraft with `airframe`. It uses only the cruise airspeed and the travels of the surfaces.
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
            axes: PRIORS.map(Axis::new),
            controls: None,
            last: None,
        }
    }

    /// Updates the estimates with a state and the deflections at `time`. After a gap in time or a state that is not finite, the
    /// filters restart and the estimates remain. The function allocates no memory.
    pub fn see(&mut self, time: Time, state: &State, actuators: &ActuatorState) {
        let before = self.last.replace(time);
        let step = before.map_or(f64::NAN, |before| time.since(before).as_secs_f64());
        let speed = state.airspeed / self.cruise;
        if !STEPS_S.contains(&step) || !SPEEDS.contains(&speed) {
            return self.interrupt();
        }
        let [aileron, elevator, rudder] = self.travel;
        let now = [
            actuators.aileron / aileron,
            actuators.elevator / elevator,
            actuators.rudder / rudder,
            actuators.throttle,
        ];
        // before the first sample the controls count as constant
        let controls = self.controls.get_or_insert([now; LONGEST + 1]);
        controls.rotate_right(1);
        controls[0] = now;
        let delayed = DELAYS.map(|delay| of_controls(controls[delay], speed));
        let scale = self.cruise / STANDARD_GRAVITY;
        let motion = of_motion(state, speed, scale);
        for (k, rate) in [state.p, state.q].into_iter().enumerate() {
            let own = delayed.map(|axes| axes[k]);
            self.axes[k].see(rate, &motion[k], &own, [scale, step]);
        }
    }

    /// Restarts the filters, for instance when the deflections are unknown for a while. The estimates remain.
    pub fn interrupt(&mut self) {
        self.axes.iter_mut().for_each(|axis| axis.filters = None);
        self.controls = None;
    }

    /// The dimensional derivatives at the cruise airspeed, in the order of [`DERIVATIVES`]: L_δa and M_δe in rad/s² at full
    /// deflection (L_δa is positive, M_δe negative), L_p in 1/s, M_α in 1/s². A value is NaN if the flight does not determine it:
    /// its standard deviation is not below 0.3 of its prior standard deviation.
    pub fn derivatives(&self) -> [f64; DERIVATIVES.len()] {
        let time = self.cruise / STANDARD_GRAVITY;
        let [roll, pitch] = self.axes.each_ref().map(Axis::best);
        let square = time * time;
        let damping = -roll.known(CONTROLS) / time;
        let stiffness = -pitch.known(CONTROLS + 1) / square;
        [roll.known(0) / square, damping, -pitch.known(0) / square, stiffness]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The simulated axis has a dimensionless control power of 120 and damping of 12, a constant moment, and a control delay of
    /// 40 ms.
    #[test]
    fn control_power_and_damping_are_found_beside_a_delay() {
        let (time, step, truth) = (2.0, 0.01, [120.0, 12.0]);
        let mut axis = Axis::new(PRIORS[0]);
        let command =
            |k: i32| 0.1 * (f64::from(k) * 0.05).sin() + 0.1 * (f64::from(k) * 0.013).cos();
        let mut rate: f64 = 0.0;
        for k in 0..3000 {
            let controls = DELAYS.map(|delay| [command(k - delay as i32), 0.0]);
            axis.see(rate, &[-rate * time, 0.0, 0.0, 0.0, 0.0], &controls, [time, step]);
            // ten integration steps between two samples approximate continuous time
            for part in 0..10 {
                let at = f64::from(part) / 10.0;
                let now = (1.0 - at) * command(k - 4) + at * command(k - 3);
                let acceleration = (truth[0] * now + 3.0) / (time * time) - truth[1] / time * rate;
                rate += 0.1 * step * acceleration;
            }
        }
        let best = axis.best();
        for (found, truth) in [best.known(0), best.known(CONTROLS)].into_iter().zip(truth) {
            assert!((found / truth - 1.0).abs() < 0.1, "{found} for {truth}");
        }
        let undelayed = &axis.regressions[0];
        assert!((undelayed.theta[CONTROLS] / truth[1] - 1.0).abs() > 0.1, "{:?}", undelayed.theta);
    }

    #[test]
    fn what_was_not_moved_is_not_known() {
        let mut axis = Axis::new(PRIORS[1]);
        let still = [[0.0; CONTROLS]; DELAYS.len()];
        (0..1000).for_each(|_| axis.see(0.0, &[0.0; MOTION], &still, [2.0, 0.01]));
        assert!(axis.best().known(0).is_nan() && axis.best().known(CONTROLS).is_nan());
        axis.see(f64::NAN, &[0.0; MOTION], &still, [2.0, 0.01]);
        assert!(axis.filters.is_none() && axis.best().theta == PRIORS[1][0]);
    }
}
