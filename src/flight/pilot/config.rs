//! The numbers a pilot flies by, as a TOML table writes them.

use serde::{Deserialize, Serialize};

/// The pilot's settings: what the airframe file may hold in its `[pilot]` table, and what the
/// parameters change. Units are in the names. Defaults are those of the X8.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Age of the last setpoint at which OFFBOARD is left, s.
    pub offboard_loss_s: f64,
    /// Age of the last fresh state at which the vehicle link counts as lost, s.
    pub vehicle_loss_s: f64,
    /// Gap in usable state over which the command in force is continued, s.
    pub state_hold_s: f64,
    /// Largest commanded bank, degrees.
    pub bank_max_deg: f64,
    /// Largest commanded pitch, degrees.
    pub pitch_max_deg: f64,
    /// Smallest commanded pitch, degrees.
    pub pitch_min_deg: f64,
    /// Airspeed held when nobody says otherwise, m/s.
    pub cruise_mps: f64,
    /// Airspeed below which the throttle opens and the nose goes down, m/s.
    pub airspeed_min_mps: f64,
    /// Airspeed above which the throttle closes and the nose comes up, m/s.
    pub airspeed_max_mps: f64,
    /// Stall speed in level flight, m/s; it bounds the bank through the load factor.
    pub stall_mps: f64,
    /// Largest load factor of a level turn.
    pub load_max: f64,
    /// Fastest change of a surface command, in units of −1..1 per second.
    pub surface_slew_per_s: f64,
    /// Fastest change of the throttle command, in units of 0..1 per second.
    pub throttle_slew_per_s: f64,
    /// Where OFFBOARD takes its throttle from.
    pub thrust_source: ThrustSource,
    /// Largest bank and pitch at which arming is allowed, degrees.
    pub arm_tilt_max_deg: f64,
    /// Airspeed above which disarming needs force, m/s.
    pub disarm_airspeed_max_mps: f64,
    /// Level trim, by rising airspeed.
    pub trim: Vec<TrimPoint>,
}

/// Where OFFBOARD takes its throttle from (parameter GL_THRUST_SRC).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ThrustSource {
    /// The controller holds the cruise airspeed.
    Cruise,
    /// The setpoint's thrust is the throttle, where it gives one.
    Setpoint,
}

/// One row of the level trim table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrimPoint {
    /// True airspeed, m/s.
    pub airspeed_mps: f64,
    /// Pitch, which is the angle of attack in level flight, degrees.
    pub pitch_deg: f64,
    /// Elevator command, −1..1.
    pub elevator: f64,
    /// Throttle command, 0..1.
    pub throttle: f64,
}

impl Default for Config {
    fn default() -> Self {
        // Elevator commands are deflections over the 0.5235 rad of full travel.
        let row = |airspeed_mps, pitch_deg, deflection: f64, throttle| TrimPoint {
            airspeed_mps,
            pitch_deg,
            elevator: deflection / 0.5235,
            throttle,
        };
        Config {
            offboard_loss_s: 1.0,
            vehicle_loss_s: 0.5,
            // Five frames; longer than any jitter, shorter than a roll mode of 33 1/s needs to
            // carry a wrong aileron far.
            state_hold_s: 0.05,
            bank_max_deg: 60.0,
            pitch_max_deg: 30.0,
            pitch_min_deg: -30.0,
            cruise_mps: 22.0,
            airspeed_min_mps: 13.0,
            airspeed_max_mps: 45.0,
            // sqrt(2 m g / (rho S CLmax)) with 3.364 kg, 1.156 kg/m3, 0.75 m2, CLmax 0.896.
            stall_mps: 9.2,
            load_max: 2.5,
            // Full travel in 0.1 s.
            surface_slew_per_s: 20.0,
            // Full travel in 0.2 s, the lag of the motor: faster would not show in the thrust.
            throttle_slew_per_s: 5.0,
            thrust_source: ThrustSource::Cruise,
            arm_tilt_max_deg: 60.0,
            disarm_airspeed_max_mps: 8.0,
            trim: vec![row(16.67, 2.283, 0.01855, 0.118), row(20.0, 0.858, 0.0688, 0.185), row(25.0, -0.30, 0.1096, 0.308)],
        }
    }
}

/// A setting that cannot be flown with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConfigError {
    /// A number is outside its range.
    #[error("pilot setting `{name}` is {value}: give a number from {low} to {high}")]
    Range {
        /// The setting.
        name: &'static str,
        /// What it is.
        value: f64,
        /// The least allowed.
        low: f64,
        /// The most allowed.
        high: f64,
    },
    /// Two settings contradict each other.
    #[error("pilot setting `{smaller}` must lie below `{larger}`: correct one of them")]
    Order {
        /// The one that must be smaller.
        smaller: &'static str,
        /// The one that must be larger.
        larger: &'static str,
    },
    /// The trim table cannot be interpolated.
    #[error("pilot table `trim` needs at least one row, finite numbers, and rising airspeeds: correct the rows")]
    Trim,
}

impl Config {
    /// Checks ranges and order.
    ///
    /// # Errors
    /// The first setting that is out of its range, or the first pair that contradicts itself.
    pub fn check(&self) -> Result<(), ConfigError> {
        for (name, value, low, high) in self.ranges() {
            if !(value >= low && value <= high) {
                return Err(ConfigError::Range { name, value, low, high });
            }
        }
        let ordered = [
            ("pitch_min_deg", self.pitch_min_deg, "pitch_max_deg", self.pitch_max_deg),
            ("stall_mps", self.stall_mps, "airspeed_min_mps", self.airspeed_min_mps),
            ("airspeed_min_mps", self.airspeed_min_mps, "cruise_mps", self.cruise_mps),
            ("cruise_mps", self.cruise_mps, "airspeed_max_mps", self.airspeed_max_mps),
        ];
        for (smaller, low, larger, high) in ordered {
            if low >= high {
                return Err(ConfigError::Order { smaller, larger });
            }
        }
        self.check_trim()
    }

    fn check_trim(&self) -> Result<(), ConfigError> {
        let finite = |t: &TrimPoint| {
            t.airspeed_mps > 0.0 && t.pitch_deg.abs() <= 30.0 && t.elevator.abs() <= 1.0 && (0.0..=1.0).contains(&t.throttle)
        };
        let rising = self.trim.windows(2).all(|w| w[0].airspeed_mps < w[1].airspeed_mps);
        if self.trim.is_empty() || !rising || !self.trim.iter().all(finite) { Err(ConfigError::Trim) } else { Ok(()) }
    }

    fn ranges(&self) -> [(&'static str, f64, f64, f64); 15] {
        [
            ("offboard_loss_s", self.offboard_loss_s, 0.1, 60.0),
            ("vehicle_loss_s", self.vehicle_loss_s, 0.05, 5.0),
            ("state_hold_s", self.state_hold_s, 0.0, 0.5),
            ("bank_max_deg", self.bank_max_deg, 5.0, 80.0),
            ("pitch_max_deg", self.pitch_max_deg, 5.0, 60.0),
            ("pitch_min_deg", self.pitch_min_deg, -60.0, -5.0),
            ("cruise_mps", self.cruise_mps, 1.0, 100.0),
            ("airspeed_min_mps", self.airspeed_min_mps, 1.0, 100.0),
            ("airspeed_max_mps", self.airspeed_max_mps, 1.0, 110.0),
            ("stall_mps", self.stall_mps, 0.5, 100.0),
            ("load_max", self.load_max, 1.1, 10.0),
            ("surface_slew_per_s", self.surface_slew_per_s, 1.0, 200.0),
            ("throttle_slew_per_s", self.throttle_slew_per_s, 0.5, 100.0),
            ("arm_tilt_max_deg", self.arm_tilt_max_deg, 5.0, 180.0),
            ("disarm_airspeed_max_mps", self.disarm_airspeed_max_mps, 0.0, 100.0),
        ]
    }

    /// Level trim at an airspeed (m/s): linear between the rows, constant beyond the ends.
    pub fn trim_at(&self, airspeed_mps: f64) -> TrimPoint {
        let (first, last) = (self.trim[0], self.trim[self.trim.len() - 1]);
        if airspeed_mps <= first.airspeed_mps {
            return first;
        }
        for pair in self.trim.windows(2) {
            if airspeed_mps <= pair[1].airspeed_mps {
                return between(&pair[0], &pair[1], airspeed_mps);
            }
        }
        last
    }
}

fn between(a: &TrimPoint, b: &TrimPoint, airspeed_mps: f64) -> TrimPoint {
    let share = (airspeed_mps - a.airspeed_mps) / (b.airspeed_mps - a.airspeed_mps);
    let mix = |x: f64, y: f64| x + share * (y - x);
    TrimPoint {
        airspeed_mps,
        pitch_deg: mix(a.pitch_deg, b.pitch_deg),
        elevator: mix(a.elevator, b.elevator),
        throttle: mix(a.throttle, b.throttle),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_can_be_flown() {
        assert_eq!(Config::default().check(), Ok(()));
    }

    #[test]
    fn a_table_may_name_a_few_settings_only() {
        let config: Config = toml::from_str("bank_max_deg = 45.0\nthrust_source = \"setpoint\"").unwrap();
        assert_eq!(config.bank_max_deg, 45.0);
        assert_eq!(config.thrust_source, ThrustSource::Setpoint);
        assert_eq!(config.cruise_mps, Config::default().cruise_mps);
    }

    #[test]
    fn an_unknown_setting_is_refused_by_name() {
        let error = toml::from_str::<Config>("bank_maximum_deg = 45.0").unwrap_err();
        assert!(error.to_string().contains("bank_maximum_deg"), "{error}");
    }

    #[test]
    fn a_contradiction_names_both_sides() {
        let config = Config { airspeed_min_mps: 30.0, ..Config::default() };
        let words = config.check().unwrap_err().to_string();
        assert!(words.contains("airspeed_min_mps") && words.contains("cruise_mps"), "{words}");
        assert!(Config { load_max: f64::NAN, ..Config::default() }.check().is_err());
        assert!(Config { trim: vec![], ..Config::default() }.check().is_err());
    }

    #[test]
    fn trim_is_linear_between_rows_and_constant_beyond() {
        let config = Config::default();
        // Half way between 20 and 25 m/s: (0.858 - 0.30) / 2 and (0.185 + 0.308) / 2.
        let middle = config.trim_at(22.5);
        assert!((middle.pitch_deg - 0.279).abs() < 1e-12);
        assert!((middle.throttle - 0.2465).abs() < 1e-12);
        assert_eq!(config.trim_at(5.0), config.trim[0]);
        assert_eq!(config.trim_at(80.0), config.trim[2]);
    }
}
