//! Angle of attack and sideslip without vanes, estimated from the flight controller's other measurements.
//!
//! An extended Kalman filter with three states, the velocity relative to the air in body axes (u, v, w).
//! Accelerometers, gyros and attitude drive it (Beard & McLain \[BM12\], eq. 3.15):
//!
//! ```text
//! u' = r v - q w - g sin θ         + ax
//! v' = p w - r u + g cos θ sin φ   + ay
//! w' = q u - p v + g cos θ cos φ   + az
//! ```
//!
//! Three measurements correct the state. The first is the airspeed |(u, v, w)|. The second is the climb rate, with the
//! assumption that the vertical velocity of the air is zero in the mean. The third is the assumption that the sideslip
//! is zero in the mean. If wind and velocity over ground are reported, the sideways velocity computed from them is used
//! as well. The state is a velocity relative to the air, so a constant wind cancels. A steady updraught does not
//! cancel: 1 m/s causes an error of 3° in the angle of attack at 20 m/s.

use greylag_physics::atmosphere::MIDDLE_GRAVITY;

/// Process noise of the air-relative velocity (gusts, accelerometer noise), m/s². The standard deviation per step is
/// this value times the step. Light turbulence changes the velocity of the air at about this rate.
const PROCESS: f64 = 1.0;
/// Standard deviation of the airspeed, m/s.
const AIRSPEED: f64 = 0.5;
/// Standard deviation of the climb rate as a measurement relative to the air, m/s.
const CLIMB: f64 = 0.5;
/// Standard deviation of the pseudo-measurement v = 0 at every step, m/s. With the process noise above, it returns the
/// sideslip to zero within a few seconds. This bounds the drift, and sideslip in turns remains visible.
const SIDEWAYS: f64 = 5.0;
/// Standard deviations of the estimated angle of attack and sideslip without gusts, rad. In calm air with an exact attitude
/// they were 0.2° (α) and 0.3° to 0.5° (β) with real ArduPlane, and 0.1° and 0.2° with real PX4
/// (`tests/firmware/angles.py`). A pitch error adds to α, and a heading error adds to β. Their standard deviations are
/// assumed to be 0.5° and 1°. ArduPlane's errors were 0.7° in pitch and 0.9° in heading, and a compass may have a larger error.
pub const DEVIATION: [f64; 2] = [0.71 * DEGREE, 1.12 * DEGREE];
const DEGREE: f64 = std::f64::consts::PI / 180.0;
/// Lowest airspeed at which the flow angles are estimated, m/s.
const SLOWEST: f64 = 3.0;

/// Measurements of one state frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Roll, pitch, yaw, rad.
    pub attitude: [f64; 3],
    /// p, q, r, rad/s.
    pub rates: [f64; 3],
    /// Specific force, m/s², FRD.
    pub specific_force: [f64; 3],
    /// True airspeed V_a, m/s. Below 3 m/s the estimate restarts.
    pub airspeed: f64,
    /// Climb rate, m/s, positive upward; NaN if not reported.
    pub climb: f64,
    /// Velocity over ground, NED, m/s; NaN if none was received since the last update, because an old velocity has the
    /// wrong direction in a turn.
    pub velocity: [f64; 3],
    /// Wind velocity, NED, m/s; NaN if not reported.
    pub wind: [f64; 3],
    /// Standard deviation of the wind, m/s. The sideways velocity computed from the wind has the same standard
    /// deviation.
    pub wind_sd: f64,
}

/// Extended Kalman filter of the air-relative velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirData {
    /// u, v, w, m/s; `None` before the first measurement.
    state: Option<[f64; 3]>,
    covariance: [[f64; 3]; 3],
}

impl Default for AirData {
    fn default() -> Self {
        AirData { state: None, covariance: diagonal([1.0, 4.0, 4.0]) }
    }
}

impl AirData {
    /// Updates with a measurement `step` seconds after the last one. Returns α and β, rad. If the airspeed is below 3 m/s,
    /// or the measurement or the estimate is not finite, the result is `None` and the estimate restarts.
    pub fn update(&mut self, m: &Measured, step: f64) -> Option<[f64; 2]> {
        let needed =
            m.attitude.iter().chain(&m.rates).chain(&m.specific_force).chain([&m.airspeed]);
        if !needed.copied().all(f64::is_finite) || m.airspeed < SLOWEST {
            *self = AirData::default();
            return None;
        }
        // the estimate restarts after a gap of more than 0.5 s and after a step that is not finite
        let step = match (0.0..=0.5).contains(&step) {
            true => step,
            false => {
                *self = AirData::default();
                0.0
            }
        };
        if self.state.is_none() {
            self.state = Some(beginning(m));
        }
        self.propagate(m, step);
        self.correct(m);
        let mut numbers = self.state.iter().flatten().chain(self.covariance.iter().flatten());
        if !numbers.all(|x| x.is_finite()) {
            // an estimate that is not finite would never recover
            *self = AirData::default();
        }
        let [u, v, w] = self.state?;
        let speed = (u * u + v * v + w * w).sqrt().max(SLOWEST);
        Some([w.atan2(u), (v / speed).clamp(-1.0, 1.0).asin()])
    }

    fn propagate(&mut self, m: &Measured, step: f64) {
        let Some([u, v, w]) = self.state else { return };
        let [p, q, r] = m.rates;
        let [ax, ay, az] = m.specific_force;
        let (sr, cr) = m.attitude[0].sin_cos();
        let (sp, cp) = m.attitude[1].sin_cos();
        let rate = [
            r * v - q * w - MIDDLE_GRAVITY * sp + ax,
            p * w - r * u + MIDDLE_GRAVITY * cp * sr + ay,
            q * u - p * v + MIDDLE_GRAVITY * cp * cr + az,
        ];
        self.state = Some([u + step * rate[0], v + step * rate[1], w + step * rate[2]]);
        let f =
            [[1.0, r * step, -q * step], [-r * step, 1.0, p * step], [q * step, -p * step, 1.0]];
        let noise = (PROCESS * step).powi(2);
        self.covariance = add(&product(&product(&f, &self.covariance), &transpose(&f)), noise);
    }

    fn correct(&mut self, m: &Measured) {
        let Some([u, v, w]) = self.state else { return };
        let speed = (u * u + v * v + w * w).sqrt().max(SLOWEST);
        self.scalar([u / speed, v / speed, w / speed], m.airspeed - speed, AIRSPEED);
        let (sr, cr) = m.attitude[0].sin_cos();
        let (sp, cp) = m.attitude[1].sin_cos();
        if m.climb.is_finite() {
            let row = [sp, -sr * cp, -cr * cp];
            self.scalar(row, m.climb - self.seen(row), CLIMB);
        }
        let sideways = [0.0, 1.0, 0.0];
        let air = [0, 1, 2].map(|i| m.velocity[i] - m.wind[i]);
        if air.iter().all(|x| x.is_finite()) {
            // the second column of the rotation from body axes to NED
            let (sy, cy) = m.attitude[2].sin_cos();
            let side = [sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp];
            let measured: f64 = side.iter().zip(air).map(|(a, b)| a * b).sum();
            self.scalar(sideways, measured - self.seen(sideways), m.wind_sd);
        }
        self.scalar(sideways, -self.seen(sideways), SIDEWAYS);
    }

    fn seen(&self, row: [f64; 3]) -> f64 {
        self.state.map_or(0.0, |x| row.iter().zip(x).map(|(a, b)| a * b).sum())
    }

    /// Updates with one scalar measurement: its row of the measurement matrix, its innovation (m/s) and its standard
    /// deviation (m/s).
    fn scalar(&mut self, row: [f64; 3], innovation: f64, deviation: f64) {
        let Some(state) = &mut self.state else { return };
        let p = self.covariance;
        let cross: [f64; 3] = [0, 1, 2].map(|i| (0..3).map(|j| p[i][j] * row[j]).sum());
        let spread: f64 =
            row.iter().zip(cross).map(|(a, b)| a * b).sum::<f64>() + deviation * deviation;
        // an outlier counts as three standard deviations at most
        let limit = 3.0 * spread.sqrt();
        // not `clamp`, which would panic for a NaN limit
        let innovation = innovation.max(-limit).min(limit);
        for i in 0..3 {
            state[i] += cross[i] / spread * innovation;
            for j in 0..3 {
                self.covariance[i][j] -= cross[i] * cross[j] / spread;
            }
        }
    }
}

/// Initial velocity (u, v, w), m/s: straight flight along the path given by airspeed and climb rate.
fn beginning(m: &Measured) -> [f64; 3] {
    let climb = if m.climb.is_finite() { m.climb } else { 0.0 };
    let path = (climb / m.airspeed).clamp(-0.9, 0.9).asin();
    let alpha = (m.attitude[1] - path).clamp(-0.2, 0.2);
    [m.airspeed * alpha.cos(), 0.0, m.airspeed * alpha.sin()]
}

fn diagonal(d: [f64; 3]) -> [[f64; 3]; 3] {
    [[d[0], 0.0, 0.0], [0.0, d[1], 0.0], [0.0, 0.0, d[2]]]
}

fn product(a: &[[f64; 3]; 3], b: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

fn transpose(a: &[[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

fn add(a: &[[f64; 3]; 3], noise: f64) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][j] + if i == j { noise } else { 0.0 }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Level flight at 20 m/s with an angle of attack of 3° and no wind.
    fn level() -> Measured {
        Measured {
            attitude: [0.0, 3f64.to_radians(), 0.0],
            rates: [0.0; 3],
            specific_force: [
                MIDDLE_GRAVITY * 3f64.to_radians().sin(),
                0.0,
                -MIDDLE_GRAVITY * 3f64.to_radians().cos(),
            ],
            airspeed: 20.0,
            climb: 0.0,
            velocity: [20.0, 0.0, 0.0],
            wind: [0.0; 3],
            wind_sd: 0.5,
        }
    }

    #[test]
    fn level_flight_shows_its_pitch_as_angle_of_attack() {
        let mut air = AirData::default();
        let mut last = [0.0; 2];
        for _ in 0..500 {
            last = air.update(&level(), 0.01).unwrap();
        }
        assert!((last[0].to_degrees() - 3.0).abs() < 0.05 && last[1].abs() < 1e-6, "{last:?}");
    }

    #[test]
    fn a_constant_wind_from_the_side_is_no_sideslip() {
        let mut air = AirData::default();
        let windy = Measured { velocity: [20.0, 8.0, 0.0], wind: [0.0, 8.0, 0.0], ..level() };
        let last = (0..500).filter_map(|_| air.update(&windy, 0.01)).last().unwrap();
        assert!(last[1].to_degrees().abs() < 0.1, "{last:?}");
    }

    #[test]
    fn garbage_gives_no_angles_and_is_forgotten() {
        let mut air = AirData::default();
        air.update(&level(), 0.01).unwrap();
        let bad = Measured { specific_force: [f64::NAN, 0.0, 0.0], ..level() };
        assert_eq!(air.update(&bad, 0.01), None);
        assert_eq!(air.update(&Measured { airspeed: 0.0, ..level() }, 0.01), None);
        assert!(air.update(&level(), 0.01).unwrap()[0].to_degrees() < 4.0);
        assert!(air.update(&level(), f64::NAN).is_some());
    }

    #[test]
    fn an_estimate_that_is_not_finite_is_forgotten() {
        for (state, variance) in [(f64::NAN, 1.0), (f64::INFINITY, 1.0), (0.0, f64::NAN)] {
            let covariance = diagonal([variance; 3]);
            let mut air = AirData { state: Some([20.0, 0.0, state]), covariance };
            assert_eq!(air.update(&level(), 0.01), None, "{state} {variance}");
            let again = air.update(&level(), 0.01).unwrap();
            assert!((again[0].to_degrees() - 3.0).abs() < 0.1, "{state} {variance}: {again:?}");
        }
    }

    /// Measurement at `t` seconds in a steady turn at the rate `turn` (rad/s), with the velocity `air` (m/s) relative
    /// to the air in body axes.
    fn turning(air: [f64; 3], [roll, pitch]: [f64; 2], turn: f64, t: f64) -> Measured {
        let [u, v, w] = air;
        let yaw = 0.4 + turn * t;
        let ((sr, cr), (sp, cp), (sy, cy)) = (roll.sin_cos(), pitch.sin_cos(), yaw.sin_cos());
        let [p, q, r] = [-turn * sp, turn * sr * cp, turn * cr * cp];
        // The velocity is constant in body axes, so the acceleration is that of the turn. The specific force is this
        // acceleration less gravity.
        let specific_force = [
            q * w - r * v + MIDDLE_GRAVITY * sp,
            r * u - p * w - MIDDLE_GRAVITY * cp * sr,
            p * v - q * u - MIDDLE_GRAVITY * cp * cr,
        ];
        let wind = [6.0, -3.0, 0.0];
        let ned = [
            u * cp * cy + v * (sr * sp * cy - cr * sy) + w * (cr * sp * cy + sr * sy),
            u * cp * sy + v * (sr * sp * sy + cr * cy) + w * (cr * sp * sy - sr * cy),
            -u * sp + v * sr * cp + w * cr * cp,
        ];
        Measured {
            attitude: [roll, pitch, yaw],
            rates: [p, q, r],
            specific_force,
            airspeed: (u * u + v * v + w * w).sqrt(),
            climb: -ned[2],
            velocity: [0, 1, 2].map(|i| ned[i] + wind[i]),
            wind,
            wind_sd: 0.05,
        }
    }

    #[test]
    fn the_angles_of_a_climbing_turn_with_sideslip_are_found() {
        // Every measurement is consistent with the motion, so the filter must converge to it with any weights. The
        // pseudo-measurement of zero sideslip reduces the sideslip by the fraction (0.05 / 5)².
        for (air, attitude, turn) in
            [([21.0, 1.5, 2.0], [0.6, 0.25], 0.35), ([19.0, -2.0, 0.5], [-0.9, -0.1], -0.6)]
        {
            let mut filter = AirData::default();
            let step = |k: u32| turning(air, attitude, turn, f64::from(k) * 0.01);
            let last = (0..3000).filter_map(|k| filter.update(&step(k), 0.01)).last().unwrap();
            let [u, v, w] = air;
            let truth = [w.atan2(u), (v / (u * u + v * v + w * w).sqrt()).asin()];
            for (found, truth) in last.into_iter().zip(truth) {
                assert!((found - truth).to_degrees().abs() < 0.03, "{last:?}, {found} for {truth}");
            }
        }
    }

    #[test]
    fn the_first_state_is_straight_flight_along_the_path() {
        // 10° of pitch on a path that climbs at 6°: the angle of attack is 4° from the first state on.
        let path = 6f64.to_radians();
        let air = [20.0 * 4f64.to_radians().cos(), 0.0, 20.0 * 4f64.to_radians().sin()];
        let climbing = turning(air, [0.0, 10f64.to_radians()], 0.0, 0.0);
        assert!((climbing.climb - 20.0 * path.sin()).abs() < 1e-9);
        let first = AirData::default().update(&climbing, 0.01).unwrap();
        assert!((first[0].to_degrees() - 4.0).abs() < 0.02, "{first:?}");
        // Without a climb rate the path counts as level, and the angle is bounded.
        let blind = Measured { climb: f64::NAN, attitude: [0.0, 0.1, 0.0], ..climbing };
        let [u, _, w] = beginning(&blind);
        assert!((w.atan2(u) - 0.1).abs() < 1e-12 && (u.hypot(w) - 20.0).abs() < 1e-9);
        for pitch in [0.9, -0.9] {
            let [u, _, w] = beginning(&Measured { attitude: [0.0, pitch, 0.0], ..blind });
            assert!((w.atan2(u) - 0.2 * pitch.signum()).abs() < 1e-12);
        }
    }

    #[test]
    fn large_angles_are_found_too_and_at_the_slowest_airspeed_they_still_are() {
        let air = [20.0, 4.0, 6.0];
        let mut filter = AirData::default();
        let step = |k: u32| turning(air, [0.5, 0.3], 0.3, f64::from(k) * 0.01);
        let last = (0..3000).filter_map(|k| filter.update(&step(k), 0.01)).last().unwrap();
        // atan(6 / 20) and asin(4 / 21.26)
        let [alpha, beta] = last.map(f64::to_degrees);
        assert!((alpha - 16.699).abs() < 0.03 && (beta - 10.844).abs() < 0.03, "{alpha} {beta}");
        let slow = Measured { airspeed: 3.0, velocity: [3.0, 0.0, 0.0], ..level() };
        assert!(AirData::default().update(&slow, 0.01).is_some());
    }

    #[test]
    fn a_first_airspeed_that_was_wrong_is_forgotten_within_half_a_second() {
        // An airspeed that is too high by 6 m/s makes the path seem flatter and the angle of attack larger by 1.4°.
        let (sin, cos) = 4f64.to_radians().sin_cos();
        let good = turning([20.0 * cos, 0.0, 20.0 * sin], [0.0, 10f64.to_radians()], 0.0, 0.0);
        let mut filter = AirData::default();
        let first = filter.update(&Measured { airspeed: 26.0, ..good }, 0.01).unwrap();
        assert!(first[0].to_degrees() > 5.0, "{first:?}");
        let last = (0..50).filter_map(|_| filter.update(&good, 0.01)).last().unwrap();
        assert!((last[0].to_degrees() - 4.0).abs() < 0.4, "{last:?}");
    }

    #[test]
    fn a_wrong_beginning_is_forgotten_in_a_steep_turn_too() {
        let air = [20.0, 0.0, 1.5];
        let measured = |k: u32| Measured {
            velocity: [f64::NAN; 3],
            ..turning(air, [1.0, 0.1], 0.5, f64::from(k) * 0.01)
        };
        let mut filter = AirData::default();
        let first = measured(0);
        filter.update(&Measured { airspeed: first.airspeed + 4.0, ..first }, 0.01).unwrap();
        let last = (1..300).filter_map(|k| filter.update(&measured(k), 0.01)).last().unwrap();
        let truth = 1.5f64.atan2(20.0);
        assert!((last[0] - truth).to_degrees().abs() < 1.0, "{last:?} for {truth}");
    }

    #[test]
    fn a_glitch_moves_the_angles_by_a_tenth_of_a_degree() {
        // The climb rate has an outlier of 40 m/s. Its innovation is limited to 1.5 m/s, and the gain is about 1/50.
        let mut filter = AirData::default();
        let before = (0..400).filter_map(|_| filter.update(&level(), 0.01)).last().unwrap();
        let after = filter.update(&Measured { climb: 40.0, ..level() }, 0.01).unwrap();
        let moved = (after[0] - before[0]).to_degrees();
        assert!((-0.15..-0.05).contains(&moved), "{moved}");
    }
}
