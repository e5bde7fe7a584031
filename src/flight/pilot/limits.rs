//! Limits of the target attitude and airspeed (flight envelope), and of the commands (slew rate, airspeed protection).

use super::config::Config;
use greylag_control::Target;
use greylag_physics::Command;

/// Time between two ticks of the control loop, s.
pub const TICK_S: f64 = 0.01;
/// Within this distance of the minimum or maximum airspeed, the pitch limit moves linearly to its protective value, m/s.
const PROTECTION_BAND: f64 = 2.0;
/// Upper pitch limit at the minimum airspeed and below, rad. The nose is then clearly down, but the aircraft does not
/// dive.
const RECOVERY_PITCH: f64 = -5.0 * DEGREE;
/// Lower pitch limit at the maximum airspeed and above, rad. The nose is then clearly up, but the aircraft does not
/// climb.
const ARREST_PITCH: f64 = 5.0 * DEGREE;
/// Load factor allowed at the minimum airspeed. This airspeed is about √2 times the stall speed in level flight (13 and
/// 9.2 m/s for the X8), so the aircraft would stall at a load factor of 2. The airspeed must also be at least 1.2 times the
/// stall speed of the turn, which reduces the load factor to 2 / 1.2².
const LOAD_AT_MINIMUM: f64 = 2.0 / 1.44;
/// Part of the largest load factor that a level turn may take. The envelope limiter allows 96 % of the largest; in a turn that takes
/// as much the nose could not be raised again.
const LEVEL_SHARE: f64 = 0.93;
const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Limits in SI units and radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest magnitude of the bank, rad.
    pub bank_max: f64,
    /// Largest pitch angle, rad.
    pub pitch_max: f64,
    /// Smallest pitch angle, rad.
    pub pitch_min: f64,
    /// Smallest true airspeed, m/s.
    pub airspeed_min: f64,
    /// Largest true airspeed, m/s.
    pub airspeed_max: f64,
    /// Largest load factor of a level turn, dimensionless.
    pub load_max: f64,
    /// Largest change of a surface command (−1..1) per tick.
    pub surface_step: f64,
    /// Largest change of the throttle command (0..1) per tick.
    pub throttle_step: f64,
}

impl From<&Config> for Limits {
    fn from(config: &Config) -> Self {
        let e = &config.envelope;
        Limits {
            bank_max: e.bank_max_deg.to_radians(),
            pitch_max: e.pitch_max_deg.to_radians(),
            pitch_min: e.pitch_min_deg.to_radians(),
            airspeed_min: e.airspeed_min_mps,
            airspeed_max: e.airspeed_max_mps,
            load_max: e.load_factor_max,
            surface_step: e.surface_slew_per_s * TICK_S,
            throttle_step: config.throttle_slew_per_s * TICK_S,
        }
    }
}

impl Limits {
    /// The bank limit of a level turn at the true airspeed `airspeed` (m/s), rad. The load factor 1/cos φ of the turn must exceed
    /// neither 93 % of `load_max` nor the load factor that the lift allows, which grows as V².
    pub fn bank_limit(&self, airspeed: f64) -> f64 {
        let lift = LOAD_AT_MINIMUM * (airspeed / self.airspeed_min).powi(2);
        let load = lift.min(LEVEL_SHARE * self.load_max).max(1.0);
        (1.0 / load).acos().min(self.bank_max)
    }

    /// Smallest and largest pitch that may be commanded at the true airspeed `airspeed` (m/s), rad.
    pub fn pitch_limits(&self, airspeed: f64) -> (f64, f64) {
        let slow = ((airspeed - self.airspeed_min) / PROTECTION_BAND).clamp(0.0, 1.0);
        let fast = ((self.airspeed_max - airspeed) / PROTECTION_BAND).clamp(0.0, 1.0);
        let most = RECOVERY_PITCH + slow * (self.pitch_max - RECOVERY_PITCH);
        let least = ARREST_PITCH + fast * (self.pitch_min - ARREST_PITCH);
        (least, most)
    }

    /// `target` limited to the envelope at the true airspeed `airspeed` (m/s).
    pub fn limit(&self, target: Target, airspeed: f64) -> Target {
        let bank = self.bank_limit(airspeed);
        let (least, most) = self.pitch_limits(airspeed);
        Target {
            roll: target.roll.clamp(-bank, bank),
            pitch: target.pitch.max(least).min(most),
            airspeed: target.airspeed.clamp(self.airspeed_min, self.airspeed_max),
        }
    }

    /// The throttle (0..1) after airspeed protection: full below the minimum airspeed, idle above the maximum, else unchanged.
    pub fn protect(&self, throttle: f64, airspeed: f64) -> f64 {
        if airspeed < self.airspeed_min {
            1.0
        } else if airspeed > self.airspeed_max {
            0.0
        } else {
            throttle
        }
    }

    /// `wanted`, limited to its range and to the largest change per tick from `last`. An actuator whose command is NaN
    /// keeps its last command, because a NaN would make the clamp of the next tick panic.
    pub fn slew(&self, last: Command, wanted: Command) -> Command {
        let wanted = wanted.clamped();
        let near = |from: f64, to: f64, step: f64| {
            if to.is_nan() { from } else { to.clamp(from - step, from + step) }
        };
        Command {
            aileron: near(last.aileron, wanted.aileron, self.surface_step),
            elevator: near(last.elevator, wanted.elevator, self.surface_step),
            throttle: near(last.throttle, wanted.throttle, self.throttle_step),
            rudder: near(last.rudder, wanted.rudder, self.surface_step),
        }
        .clamped()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::Airframe;
    use std::path::Path;

    fn x8() -> Limits {
        let airframe = Airframe::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/airframe.toml"
        )))
        .unwrap();
        Limits::from(&Config::new(airframe.envelope, vec![]))
    }

    fn wish(roll_deg: f64, pitch_deg: f64) -> Target {
        Target { roll: roll_deg.to_radians(), pitch: pitch_deg.to_radians(), airspeed: 22.0 }
    }

    #[test]
    fn the_hardest_target_of_the_paper_passes_unchanged_at_the_start_airspeed() {
        // A bank of 60° needs a load factor of 2.0. At 16.67 m/s, 1.389 (16.67 / 13)² = 2.28 is available.
        assert_eq!(x8().limit(wish(60.0, 30.0), 16.67), wish(60.0, 30.0));
    }

    #[test]
    fn more_than_the_limits_is_cut_to_them() {
        let cut = x8().limit(wish(-170.0, -89.0), 22.0);
        assert!((cut.roll.to_degrees() + 60.0).abs() < 1e-12);
        assert!((cut.pitch.to_degrees() + 30.0).abs() < 1e-12);
    }

    #[test]
    fn bank_shrinks_with_the_lift_that_is_left() {
        // At 13 m/s the load factor may be 1.389: acos(1 / 1.389) = 43.95°.
        assert!((x8().bank_limit(13.0).to_degrees() - 43.95).abs() < 0.01);
        // Below 13 / sqrt(1.389) = 11.03 m/s the lift suffices for level flight only.
        assert_eq!(x8().bank_limit(11.0), 0.0);
    }

    #[test]
    fn the_load_limit_binds_where_the_bank_limit_is_wide() {
        // A bank of 80° has a load factor of 5.8. The limit of 2.2 allows acos(1 / (0.93 · 2.2)) = 60.74°.
        let envelope = Limits { bank_max: 80f64.to_radians(), ..x8() };
        assert!((envelope.bank_limit(40.0).to_degrees() - 60.74).abs() < 0.01);
    }

    #[test]
    fn slow_flight_puts_the_nose_down_and_opens_the_throttle() {
        let e = x8();
        assert!((e.limit(wish(0.0, 20.0), 12.9).pitch.to_degrees() + 5.0).abs() < 1e-9);
        assert_eq!(e.protect(0.2, 12.9), 1.0);
        // 2 m/s above the minimum airspeed, at 15 m/s, the full pitch range is allowed.
        assert_eq!(e.limit(wish(0.0, 30.0), 15.0).pitch, 30f64.to_radians());
        assert_eq!(e.protect(0.2, 13.1), 0.2);
    }

    #[test]
    fn fast_flight_brings_the_nose_up_and_closes_the_throttle() {
        let e = x8();
        assert!((e.limit(wish(0.0, -30.0), 45.1).pitch.to_degrees() - 5.0).abs() < 1e-9);
        assert_eq!(e.protect(0.7, 45.1), 0.0);
        assert_eq!(e.limit(wish(0.0, -30.0), 42.9).pitch, -30f64.to_radians());
    }

    #[test]
    fn full_travel_takes_ten_ticks() {
        // The surfaces may move through their whole range, 2.0, in 0.1 s: 0.2 per tick.
        let e = x8();
        let mut now = Command { aileron: -1.0, elevator: 1.0, ..Command::IDLE };
        let wanted = Command { aileron: 1e30, elevator: -5.0, throttle: 2.0, rudder: 0.0 };
        for _ in 0..9 {
            now = e.slew(now, wanted);
            assert!(now.aileron < 1.0 - 1e-9);
        }
        now = e.slew(now, wanted);
        assert!((now.aileron - 1.0).abs() < 1e-9 && (now.elevator + 1.0).abs() < 1e-9);
        // The throttle takes 20 ticks from 0 to 1, so it is at 0.5 after ten.
        assert!((now.throttle - 0.5).abs() < 1e-9);
    }

    #[test]
    fn a_command_that_is_nan_keeps_the_last_one() {
        let e = x8();
        let last = Command { aileron: 0.1, elevator: -0.2, throttle: 0.3, rudder: 0.05 };
        let nan = f64::NAN;
        let none = Command { aileron: nan, elevator: nan, throttle: nan, rudder: nan };
        assert_eq!(e.slew(last, none), last);
        let one = e.slew(last, Command { elevator: nan, aileron: 0.2, ..last });
        assert!((one.aileron - 0.2).abs() < 1e-12 && one.elevator == -0.2, "{one:?}");
    }

    #[test]
    fn protection_fades_in_linearly_over_two_metres_a_second() {
        let e = x8();
        let pitch =
            |wanted: f64, airspeed: f64| e.limit(wish(0.0, wanted), airspeed).pitch.to_degrees();
        // Airspeeds 1 m/s and 0.5 m/s inside the minimum and the maximum are half and a quarter of the band. The upper limit
        // is interpolated between −5° and 30°, the lower limit between 5° and −30°.
        for (wanted, airspeed, limited) in [
            (90.0, 14.0, 12.5),
            (90.0, 13.5, 3.75),
            (90.0, 20.0, 30.0),
            (-90.0, 44.0, -12.5),
            (-90.0, 44.5, -3.75),
            (-90.0, 20.0, -30.0),
        ] {
            let pitch = pitch(wanted, airspeed);
            assert!((pitch - limited).abs() < 1e-9, "{pitch} at {airspeed} m/s");
        }
    }

    #[test]
    fn at_the_limits_of_airspeed_themselves_the_throttle_is_free() {
        let e = x8();
        assert_eq!([e.protect(0.2, 13.0), e.protect(0.7, 45.0)], [0.2, 0.7]);
    }
}
