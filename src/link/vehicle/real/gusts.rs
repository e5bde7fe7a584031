//! Turbulence intensity, estimated from airspeed and velocity over ground.
//!
//! Without vanes no sensor measures a gust from the side or from below. An angle of attack or sideslip that is
//! estimated without vanes has an error equal to the gust velocity divided by the airspeed. Gusts along the path are
//! measurable: they are the difference between the velocity over ground, less the mean wind, and the airspeed. At
//! altitude all three components have the same intensity (MIL-F-8785C, 3.7.2).

/// Time constant of the mean wind, s.
const WIND_S: f64 = 10.0;
/// Longest averaging time of the mean square of the gusts, s.
const AVERAGED_S: f64 = 60.0;
/// Initial intensity, m/s (moderate turbulence). It has the weight of a measurement that lasted `SUPPOSED_S`, s.
const SUPPOSED_MPS: f64 = 1.5;
const SUPPOSED_S: f64 = 20.0;
/// Scale length of gusts at altitude, m (MIL-F-8785C above 2000 ft).
const LENGTH_M: f64 = 533.0;
/// Factor on the gusts' standard deviation. The monitor's band has a half width of two of the resulting standard
/// deviations. With this factor it covers the largest gust of a flight, 3.5 standard deviations of the gusts. A gust can
/// last for half a minute, so it does not average out.
const LASTING: f64 = 1.75;
/// Lowest airspeed at which gusts are estimated, and lowest divisor of a gust, m/s.
const SLOWEST_MPS: f64 = 3.0;
/// Longest gap between two velocities, s. After a longer gap the mean wind restarts.
const GAP_S: f64 = 1.0;

/// Running estimate of the gusts' standard deviation, m/s.
#[derive(Clone, Copy, Debug)]
pub struct Gusts {
    /// Mean wind, NED, m/s.
    wind: Option<[f64; 3]>,
    /// Mean square of the gusts along the path, with a correction for the part that the mean wind absorbs, m²/s².
    power: f64,
    /// Present averaging time, s.
    averaged: f64,
    /// Time since the last velocity, s.
    since: f64,
}

impl Default for Gusts {
    fn default() -> Self {
        Gusts { wind: None, power: SUPPOSED_MPS.powi(2), averaged: SUPPOSED_S, since: 0.0 }
    }
}

impl Gusts {
    /// Updates with a state `step` seconds after the last one: roll, pitch and yaw, α and β (rad), true airspeed (m/s),
    /// and velocity over ground (NED, m/s). The velocity is NaN if none was received with the state. Below 3 m/s the
    /// estimate restarts.
    pub fn update(
        &mut self,
        attitude: [f64; 3],
        incidence: [f64; 2],
        airspeed: f64,
        velocity: [f64; 3],
        step: f64,
    ) {
        if airspeed < SLOWEST_MPS {
            *self = Gusts::default();
            return;
        }
        self.since += step.max(0.0);
        if !velocity.iter().chain(&attitude).chain(&incidence).all(|x| x.is_finite()) {
            return;
        }
        let dt = std::mem::take(&mut self.since);
        let path = towards(attitude, incidence);
        let seen: [f64; 3] = std::array::from_fn(|i| velocity[i] - airspeed * path[i]);
        let Some(wind) = self.wind.as_mut().filter(|_| dt <= GAP_S) else {
            self.wind = Some(seen);
            return;
        };
        let off: [f64; 3] = std::array::from_fn(|i| seen[i] - wind[i]);
        (0..3).for_each(|i| wind[i] += off[i] * dt / (WIND_S + dt));
        let along: f64 = off.iter().zip(path).map(|(a, b)| a * b).sum();
        self.averaged = (self.averaged + dt).min(AVERAGED_S);
        // the mean wind absorbs the slow part of the gusts, which is a known fraction for a first-order process
        let whole = along.powi(2) * (1.0 + LENGTH_M / (airspeed * WIND_S));
        self.power += (whole - self.power) * dt / self.averaged;
    }

    /// Standard deviation, rad, by which gusts widen the monitor's band of an angle of attack or sideslip that is estimated
    /// without vanes. It includes the factor `LASTING`.
    pub fn incidence(&self, airspeed: f64) -> f64 {
        LASTING * self.deviation() / airspeed.max(SLOWEST_MPS)
    }

    /// Standard deviation of each gust component, m/s.
    fn deviation(&self) -> f64 {
        self.power.sqrt()
    }
}

/// Unit vector of the velocity relative to the air, in NED.
fn towards([roll, pitch, yaw]: [f64; 3], [alpha, beta]: [f64; 2]) -> [f64; 3] {
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    let (sy, cy) = yaw.sin_cos();
    let [u, v, w] = [alpha.cos() * beta.cos(), beta.sin(), alpha.sin() * beta.cos()];
    [
        cp * cy * u + (sr * sp * cy - cr * sy) * v + (cr * sp * cy + sr * sy) * w,
        cp * sy * u + (sr * sp * sy + cr * cy) * v + (cr * sp * sy - sr * cy) * w,
        -sp * u + sr * cp * v + cr * cp * w,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform numbers in 0..1 (splitmix64).
    fn uniform(state: &mut u64) -> f64 {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Estimated intensity (m/s) after a minute of turning flight in a wind of 5 m/s with gusts of `intensity` along
    /// the path. The heading has an error of 2°.
    fn found(intensity: f64, mut seed: u64) -> f64 {
        let (mut gusts, mut gust, speed, step) = (Gusts::default(), 0.0, 18.0, 0.01);
        let decay = f64::exp(-0.1 * speed / LENGTH_M);
        for i in 0..6000 {
            let yaw = 0.02 * f64::from(i) * step;
            if i % 10 == 0 {
                // the sum of twelve uniform numbers, less six, is nearly normal
                let normal: f64 = (0..12).map(|_| uniform(&mut seed)).sum::<f64>() - 6.0;
                gust = decay * gust + intensity * (1.0 - decay * decay).sqrt() * normal;
            }
            let velocity = match i % 10 {
                0 => [(speed + gust) * yaw.cos() + 5.0, (speed + gust) * yaw.sin(), 0.0],
                _ => [f64::NAN; 3],
            };
            gusts.update([0.0, 0.0, yaw + 0.035], [0.0; 2], speed, velocity, step);
        }
        gusts.deviation()
    }

    #[test]
    fn calm_air_and_turbulence_are_told_apart_by_airspeed_and_velocity_over_ground() {
        let calm: Vec<f64> = (0..20).map(|seed| found(0.0, seed)).collect();
        assert!(calm.iter().all(|s| *s < 1.0), "{calm:?}");
        let rough: Vec<f64> = (0..20).map(|seed| found(3.0, seed)).collect();
        let mean = rough.iter().sum::<f64>() / 20.0;
        assert!((2.0..4.0).contains(&mean), "{mean} {rough:?}");
    }

    #[test]
    fn standing_on_the_ground_leaves_nothing_behind() {
        let mut gusts = Gusts::default();
        (0..1000).for_each(|_| gusts.update([0.0; 3], [0.0; 2], 0.0, [0.0; 3], 0.1));
        gusts.update([0.0; 3], [0.0; 2], 20.0, [20.0, 0.0, 0.0], 0.1);
        gusts.update([0.0; 3], [0.0; 2], 20.0, [20.0, 0.0, 0.0], 0.1);
        let deviation = gusts.deviation();
        assert!((1.0..=SUPPOSED_MPS).contains(&deviation), "{deviation}");
    }

    #[test]
    fn without_a_velocity_moderate_turbulence_is_supposed() {
        let mut gusts = Gusts::default();
        (0..1000).for_each(|_| gusts.update([0.0; 3], [0.0; 2], 18.0, [f64::NAN; 3], 0.01));
        assert_eq!(gusts.deviation(), SUPPOSED_MPS);
    }
}
