//! Monitor of one channel, a component of specific force or angular acceleration. The residual is the measurement minus the
//! model's prediction. The band is two standard deviations of the prediction to either side of zero. The monitor reports a
//! residual that stays outside the band.

/// Time constant of the low-pass filter of the residual, s. The filter attenuates the noise of differenced gyro
/// signals.
const SMOOTHED_S: f64 = 0.1;
/// Averaging time of the square of the residual and of the variance of the prediction, s. An oscillating residual therefore
/// counts like a constant residual with the same root mean square.
const EFFECTIVE_S: f64 = 0.5;
/// Averaging time of the correlation between surface deflection and residual, s.
const COMPARED_S: f64 = 3.0;
/// Half width of the band in standard deviations of the prediction.
const BAND: f64 = 2.0;
/// Time (s) outside the band after which the residual is reported as a deviation.
const OUTSIDE_S: f64 = 2.0;
/// Condition for a further report: the residual must first stay below `QUIET` times the half width of the band for `QUIET_S`, s.
const QUIET: f64 = 0.7;
const QUIET_S: f64 = 5.0;
/// Smallest magnitude of the correlation at which a residual counts as caused by the channel's surface. `MOVES` is the smallest
/// standard deviation of the surface deflection for this test, rad.
const FOLLOWS: f64 = 0.8;
const MOVES: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// State of one monitored channel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watch {
    residual: f64,
    power: f64,
    variance: Option<f64>,
    outside_s: f64,
    quiet_s: f64,
    departed: bool,
    follows: Follows,
}

/// Running moments of surface deflection and residual.
#[derive(Clone, Copy, Debug, Default)]
struct Follows {
    mean: [f64; 2],
    square: [f64; 2],
    product: f64,
    seen_s: f64,
}

impl Watch {
    /// Updates the monitor with the residual of a step of length `dt` (s). `variance` is the variance of the prediction in the
    /// square of the residual's unit. `surface` is the deflection (rad) of the surface that acts on the channel; 0 if none does.
    pub fn see(&mut self, residual: f64, variance: f64, surface: f64, dt: f64) {
        let towards = |from: &mut f64, to: f64, time: f64| *from += (to - *from) * dt / (time + dt);
        towards(&mut self.residual, residual, SMOOTHED_S);
        towards(&mut self.power, self.residual.powi(2), EFFECTIVE_S);
        towards(self.variance.get_or_insert(variance), variance, EFFECTIVE_S);
        self.follows.see(surface, self.residual, dt);
        let share = self.share().abs();
        self.outside_s = if share > 1.0 { self.outside_s + dt } else { 0.0 };
        self.quiet_s = if share < QUIET { self.quiet_s + dt } else { 0.0 };
        self.departed &= self.quiet_s < QUIET_S;
    }

    /// The averaged residual (root mean square) divided by the half width of the band, with the sign of the filtered residual.
    /// A magnitude above 1 is outside the band. NaN before the first residual.
    pub fn share(&self) -> f64 {
        (self.power.sqrt() / self.band()).copysign(self.residual)
    }

    /// Half width of the band in the residual's unit; NaN before the first residual.
    pub fn band(&self) -> f64 {
        self.variance.map_or(f64::NAN, |variance| BAND * variance.sqrt())
    }

    /// Whether a deviation is to be reported now.
    pub fn is_due(&self) -> bool {
        self.outside_s >= OUTSIDE_S && !self.departed
    }

    /// Marks the deviation as reported.
    pub fn report(&mut self) {
        self.departed = true;
    }

    /// Whether the residual is correlated with the deflection of the channel's surface.
    pub fn follows_surface(&self) -> bool {
        self.follows.correlation().is_some_and(|c| c.abs() >= FOLLOWS)
    }
}

impl Follows {
    fn see(&mut self, surface: f64, residual: f64, dt: f64) {
        // until `COMPARED_S` has passed, all samples have equal weight; later the mean is exponential
        self.seen_s += dt;
        let weight = dt / self.seen_s.min(COMPARED_S);
        let towards = |from: &mut f64, to: f64| *from += (to - *from) * weight;
        for (k, value) in [surface, residual].into_iter().enumerate() {
            towards(&mut self.mean[k], value);
            towards(&mut self.square[k], value * value);
        }
        towards(&mut self.product, surface * residual);
    }

    /// The correlation between deflection and residual; `None` while the surface hardly moves or the residual is constant.
    fn correlation(&self) -> Option<f64> {
        let spread = |k: usize| (self.square[k] - self.mean[k].powi(2)).max(0.0).sqrt();
        let moves = spread(0) >= MOVES && spread(1) > 0.0;
        moves.then(|| (self.product - self.mean[0] * self.mean[1]) / (spread(0) * spread(1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const DT: f64 = 0.01;

    /// Times (s) at which a deviation is reported in a flight of `seconds`, for the residual as a function of time. The standard
    /// deviation of the prediction is 1 and the band is therefore ±2.
    fn departures(seconds: f64, residual: impl Fn(f64) -> f64) -> Vec<f64> {
        let (mut watch, mut times) = (Watch::default(), Vec::new());
        for i in 0..(seconds / DT) as usize {
            let at = i as f64 * DT;
            watch.see(residual(at), 1.0, 0.0, DT);
            if watch.is_due() {
                watch.report();
                times.push(at);
            }
        }
        times
    }

    #[test]
    fn a_residual_outside_its_band_departs_after_two_seconds_and_once() {
        let times = departures(60.0, |_| 3.0);
        // The residual steps to 3, and the band ends at 2. The filtered residual takes time to pass 2, then stays out for 2 s.
        assert!(times.len() == 1 && (2.2..3.0).contains(&times[0]), "{times:?}");
        assert_eq!(departures(60.0, |_| 1.8), [0.0; 0], "inside");
        let burst = |t: f64| if (10.0..11.0).contains(&t) { 6.0 } else { 0.0 };
        assert_eq!(departures(60.0, burst), [0.0; 0], "a second is a gust");
    }

    #[test]
    fn a_residual_that_swings_about_zero_is_outside_all_the_same() {
        let times = departures(20.0, |t| 5.0 * (TAU * 0.5 * t).sin());
        assert_eq!(times.len(), 1, "{times:?}");
        // noise as of a differenced gyro signal: ten times the half width of the band, of alternating sign
        let noise = |t: f64| if (t / DT).round() as i64 % 2 == 0 { 20.0 } else { -20.0 };
        assert_eq!(departures(20.0, noise), [0.0; 0]);
    }

    #[test]
    fn it_departs_again_only_after_it_was_quiet() {
        let flutter = |t: f64| if t % 4.0 < 3.5 { 3.0 } else { 1.6 };
        assert_eq!(departures(60.0, flutter).len(), 1, "never below the quiet share for 5 s");
        let twice = |t: f64| if t % 20.0 < 8.0 { 3.0 } else { 0.0 };
        assert_eq!(departures(40.0, twice).len(), 2);
    }

    #[test]
    fn a_residual_that_follows_the_surface_is_known_by_it() {
        let follows = |surface: fn(f64) -> f64, residual: fn(f64) -> f64| {
            let mut watch = Watch::default();
            for i in 0..600 {
                let at = f64::from(i) * DT;
                watch.see(residual(at), 1.0, surface(at), DT);
            }
            watch.follows_surface()
        };
        let moving = |t: f64| 0.1 * (0.5 * TAU * t).sin();
        assert!(follows(moving, |t| 60.0 * 0.1 * (0.5 * TAU * t).sin() + 3.0));
        assert!(!follows(moving, |_| 5.0), "it stands");
        assert!(!follows(|_| 0.02, |_| 5.0), "the surface stands");
    }
}
