//! Prior information on an aircraft's sensors and on the wind, from the section `[sensors]` of an airframe file or a mapping
//! file. It is used by the flight-path reconstruction, which estimates states, sensor errors and wind from kinematics alone. A
//! skew is the delay with which a group of sensors is recorded.
//!
//! ```toml
//! [sensors]
//! wind = "still"                                # no wind: the constants wind_… are fixed at 0
//! clocks = "one"                                # no delays between the sensors: the constants skew_… are fixed at 0
//! airspeed_scale = { value = 1.0, sd = 0.02 }   # ratio of measured to true airspeed; sd = 0 fixes it
//! alpha_bias_rad = { value = 0.01, sd = 0.005 }
//! vanes_sd_rad = 0.005                          # standard deviation of the vanes' noise
//! vanes_at_m = [0.6, 0.0, -0.02]                # position relative to the centre of gravity: forward, right, down
//! accelerometer_at_m = [0.05, 0.0, 0.01]
//! ```

use std::collections::BTreeMap;

use serde::Deserialize;

/// The constants of sensors and wind that the flight-path reconstruction estimates, each with its unit.
pub const CONSTANTS: [(&str, &str); 31] = [
    ("alpha_bias", "rad"),
    ("beta_bias", "rad"),
    ("airspeed_scale", ""),
    ("wind_north", "m/s"),
    ("wind_east", "m/s"),
    ("wind_down", "m/s"),
    ("skew_attitude", "s"),
    ("skew_airspeed", "s"),
    ("skew_vanes", "s"),
    ("skew_velocity", "s"),
    ("alpha_gain", ""),
    ("beta_gain", ""),
    ("airspeed_offset", "m/s"),
    ("heading_offset", "rad"),
    ("board_roll", "rad"),
    ("gyro_bias_p", "rad/s"),
    ("gyro_bias_q", "rad/s"),
    ("gyro_bias_r", "rad/s"),
    ("accelerometer_bias_x", "m/s²"),
    ("accelerometer_bias_y", "m/s²"),
    ("accelerometer_bias_z", "m/s²"),
    ("skew_accelerometer", "s"),
    ("gyro_drift_p", "rad/s²"),
    ("gyro_drift_q", "rad/s²"),
    ("gyro_drift_r", "rad/s²"),
    ("gyro_gain_p", ""),
    ("gyro_gain_q", ""),
    ("gyro_gain_r", ""),
    ("accelerometer_gain_x", ""),
    ("accelerometer_gain_y", ""),
    ("accelerometer_gain_z", ""),
];

/// Keys of the standard deviations of the sensors' noise, in the order of [`Noisy`].
const NOISE: [&str; 4] = ["attitude_sd_rad", "airspeed_sd_mps", "vanes_sd_rad", "velocity_sd_mps"];

/// Largest accepted distance of a sensor from the centre of gravity along each axis, m.
const FARTHEST: f64 = 100.0;

/// Prior distribution of a constant of the sensors or the wind.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// Mean, in the unit given in [`CONSTANTS`]. `airspeed_scale` is the measured airspeed divided by the true airspeed.
    pub value: f64,
    /// Standard deviation, in the same unit. With 0 the constant is fixed.
    pub sd: f64,
}

/// Prior information on sensors and wind: the content of a section `[sensors]`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "BTreeMap<String, Written>")]
pub struct Sensors {
    constants: BTreeMap<&'static str, Known>,
    noise: [Option<f64>; NOISE.len()],
    vanes_at: Option<[f64; 3]>,
    accelerometer_at: Option<[f64; 3]>,
}

/// A sensor whose noise may be stated, with the unit of the standard deviation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Noisy {
    /// Attitude: roll, pitch, yaw, rad.
    Attitude,
    /// Measured true airspeed, m/s.
    Airspeed,
    /// Angle of attack and sideslip, rad.
    Vanes,
    /// Velocity over ground, m/s.
    Velocity,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "a word, a number, [forward, right, down] or { value = …, sd = … }")]
enum Written {
    Word(String),
    Number(f64),
    Place([f64; 3]),
    Known(Known),
}

/// Key of a constant in a file: its name followed by its unit.
fn key((name, unit): (&str, &str)) -> String {
    let suffix = match unit {
        "rad" => "_rad",
        "rad/s" => "_radps",
        "m/s" => "_mps",
        "m/s²" => "_mps2",
        "rad/s²" => "_radps2",
        "s" => "_s",
        _ => "",
    };
    format!("{name}{suffix}")
}

impl TryFrom<BTreeMap<String, Written>> for Sensors {
    type Error = String;

    fn try_from(written: BTreeMap<String, Written>) -> Result<Self, String> {
        let mut sensors = Sensors::default();
        // words such as "still" are applied first, so that a prior stated for a single constant replaces that of a word
        for (name, value) in &written {
            if let Written::Word(word) = value {
                sensors.take_word(name, word)?;
            }
        }
        for (name, value) in &written {
            sensors.take(name, value)?;
        }
        Ok(sensors)
    }
}

impl Sensors {
    fn take_word(&mut self, name: &str, word: &str) -> Result<(), String> {
        let prefix = match (name, word) {
            ("wind", "still") => "wind_",
            ("clocks", "one") => "skew_",
            ("wind", _) => {
                return Err(format!(
                    "sensors.wind = \"{word}\" is not \"still\"; give wind_north_mps and wind_east_mps as {{ value = …, sd = … }} instead"
                ));
            }
            ("clocks", _) => {
                return Err(format!(
                    "sensors.clocks = \"{word}\" is not \"one\"; give the skew_…_s as {{ value = …, sd = … }} instead"
                ));
            }
            _ => {
                return Err(format!("sensors.{name} = \"{word}\" takes no word; {}", known_keys()));
            }
        };
        let all = CONSTANTS.iter().filter(|(name, _)| name.starts_with(prefix));
        self.constants.extend(all.map(|(name, _)| (*name, Known { value: 0.0, sd: 0.0 })));
        Ok(())
    }

    fn take(&mut self, name: &str, value: &Written) -> Result<(), String> {
        match value {
            Written::Word(_) => {}
            Written::Number(sd) => {
                let place = NOISE.iter().position(|key| *key == name);
                let place = place.ok_or_else(|| {
                    format!("sensors.{name} takes no single number; {}", known_keys())
                })?;
                if !(*sd > 0.0 && sd.is_finite()) {
                    return Err(format!("sensors.{name} = {sd} must be positive"));
                }
                self.noise[place] = Some(*sd);
            }
            Written::Place(at) => {
                if !at.iter().all(|x| x.abs() <= FARTHEST) {
                    return Err(format!(
                        "sensors.{name} must lie within {FARTHEST} m of the centre of gravity"
                    ));
                }
                match name {
                    "vanes_at_m" => self.vanes_at = Some(*at),
                    "accelerometer_at_m" => self.accelerometer_at = Some(*at),
                    _ => return Err(format!("sensors.{name} takes no place; {}", known_keys())),
                }
            }
            // serde takes a list of two numbers for a value and its standard deviation, so a short position arrives here
            Written::Known(_) if ["vanes_at_m", "accelerometer_at_m"].contains(&name) => {
                return Err(format!("sensors.{name} is a place: [forward, right, down] in m"));
            }
            Written::Known(known) => {
                let found = CONSTANTS.into_iter().find(|c| key(*c) == name);
                let (constant, _) = found.ok_or_else(|| {
                    format!("sensors.{name} is not a constant of a sensor; {}", known_keys())
                })?;
                if !(known.value.is_finite() && known.sd.is_finite() && known.sd >= 0.0) {
                    return Err(format!(
                        "sensors.{name} needs a finite value and an sd of 0 or more"
                    ));
                }
                if constant == "airspeed_scale" && known.value <= 0.0 {
                    return Err(
                        "sensors.airspeed_scale is measured by true airspeed: 1 without an error"
                            .into(),
                    );
                }
                self.constants.insert(constant, *known);
            }
        }
        Ok(())
    }

    /// A copy of `self` in which every entry that `other` has replaces the one of `self`.
    pub fn overridden_by(&self, other: &Sensors) -> Sensors {
        let mut all = self.clone();
        all.constants.extend(other.constants.iter().map(|(name, known)| (*name, *known)));
        for (own, others) in all.noise.iter_mut().zip(other.noise) {
            *own = others.or(*own);
        }
        all.vanes_at = other.vanes_at.or(self.vanes_at);
        all.accelerometer_at = other.accelerometer_at.or(self.accelerometer_at);
        all
    }

    /// Prior of the constant `name` of [`CONSTANTS`]. `None` if it is not stated.
    pub fn known(&self, name: &str) -> Option<Known> {
        self.constants.get(name).copied()
    }

    /// Fixes the constant `name` of [`CONSTANTS`] at `value` (in its unit), unless a prior is stated.
    pub fn hold(&mut self, name: &'static str, value: f64) {
        self.expect(name, Known { value, sd: 0.0 });
    }

    /// States `prior` for the constant `name` of [`CONSTANTS`], unless a prior is stated.
    pub fn expect(&mut self, name: &'static str, prior: Known) {
        self.constants.entry(name).or_insert(prior);
    }

    /// Wind velocity north, east, down (m/s). `None` if its horizontal part is not stated. An unstated vertical part is zero.
    pub fn wind(&self) -> Option<[f64; 3]> {
        let [north, east, down] =
            ["wind_north", "wind_east", "wind_down"].map(|name| self.known(name).map(|k| k.value));
        Some([north?, east?, down.unwrap_or(0.0)])
    }

    /// Standard deviation of a sensor's noise, in its unit. `None` if it is not stated.
    pub fn noise(&self, of: Noisy) -> Option<f64> {
        self.noise[of as usize]
    }

    /// Position of the vanes relative to the centre of gravity in body axes, m. `None` if it is not stated.
    pub fn vanes_at(&self) -> Option<[f64; 3]> {
        self.vanes_at
    }

    /// Position of the accelerometer relative to the centre of gravity in body axes, m. `None` if it is not stated.
    pub fn accelerometer_at(&self) -> Option<[f64; 3]> {
        self.accelerometer_at
    }
}

fn known_keys() -> String {
    let constants: Vec<String> = CONSTANTS.into_iter().map(key).collect();
    format!(
        "[sensors] accepts wind, clocks, {}, vanes_at_m, accelerometer_at_m, and as {{ value = …, sd = … }} {}",
        NOISE.join(", "),
        constants.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Sensors, String> {
        toml::from_str(text).map_err(|e| e.to_string())
    }

    #[test]
    fn a_section_says_winds_clocks_constants_noise_and_places() {
        let sensors = read(
            "wind = \"still\"\nclocks = \"one\"\nwind_down_mps = { value = 0.1, sd = 0.2 }\n\
             airspeed_scale = { value = 1.02, sd = 0 }\nvanes_sd_rad = 0.004\nvanes_at_m = [13.0, 0.0, 0.5]\n",
        )
        .unwrap();
        assert_eq!(sensors.wind(), Some([0.0, 0.0, 0.1]));
        assert_eq!(sensors.known("wind_down"), Some(Known { value: 0.1, sd: 0.2 }));
        assert_eq!(sensors.known("skew_velocity"), Some(Known { value: 0.0, sd: 0.0 }));
        assert_eq!(sensors.known("airspeed_scale"), Some(Known { value: 1.02, sd: 0.0 }));
        assert_eq!((sensors.known("alpha_bias"), sensors.accelerometer_at()), (None, None));
        assert_eq!(sensors.noise(Noisy::Vanes), Some(0.004));
        assert_eq!(sensors.vanes_at(), Some([13.0, 0.0, 0.5]));
    }

    #[test]
    fn what_it_cannot_mean_is_refused_with_what_it_could_be() {
        for (text, said) in [
            ("wind = \"calm\"", "still"),
            ("airspeed_scale = { value = 0, sd = 0.1 }", "1 without an error"),
            ("alpha_bias = { value = 0, sd = 0.1 }", "alpha_bias_rad"),
            ("vanes_sd_rad = -1.0", "must be positive"),
            ("vanes_at_m = [1.0, 2.0]", "[forward, right, down]"),
            ("nose = 3.0", "vanes_sd_rad"),
            ("vanes_at_m = [1000.0, 0.0, 0.0]", "within 100 m"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(said), "{text}: {error}");
        }
    }

    #[test]
    fn a_mapping_speaks_before_the_airframe() {
        let airframe = read("vanes_sd_rad = 0.01\nwind_north_mps = { value = 1, sd = 1 }").unwrap();
        let mapping = read("wind = \"still\"").unwrap();
        let both = airframe.overridden_by(&mapping);
        assert_eq!(both.known("wind_north"), Some(Known { value: 0.0, sd: 0.0 }));
        assert_eq!(both.noise(Noisy::Vanes), Some(0.01));
    }
}
