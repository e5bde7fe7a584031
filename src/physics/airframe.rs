//! The airframe: geometry, actuators and the envelope it may be flown in, from a TOML file.

use std::path::{Path, PathBuf};

use serde::Deserialize;

/// Wing area in m², span and mean chord in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Wing area S.
    pub area: f64,
    /// Span b.
    pub span: f64,
    /// Mean aerodynamic chord c.
    pub chord: f64,
}

/// The actuators' discrete filters at one time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorFigures {
    /// b0, a1, a2 of y = b0 (u + 2u₋₁ + u₋₂) − a1 y₋₁ − a2 y₋₂.
    pub surface: [f64; 3],
    /// b, a of y = b (u + u₋₁) + a y₋₁.
    pub throttle: [f64; 2],
    /// Deflection at full command, which is also the stop, rad.
    pub deflection_max: f64,
    /// Time step, s.
    pub step: f64,
}

impl ActuatorFigures {
    /// The bilinear transform of ω²/(s² + 2ζωs + ω²) for the surfaces (`frequency` in rad/s) and of
    /// 1/(τs + 1) for the throttle (`lag` in s), at `step` (s).
    pub fn tustin(frequency: f64, damping: f64, deflection_max: f64, lag: f64, step: f64) -> Self {
        let w = frequency * step;
        let d = 4.0 + 4.0 * damping * w + w * w;
        let k = step / lag;
        ActuatorFigures {
            surface: [w * w / d, (2.0 * w * w - 8.0) / d, (4.0 - 4.0 * damping * w + w * w) / d],
            throttle: [k / (2.0 + k), (2.0 - k) / (2.0 + k)],
            deflection_max,
            step,
        }
    }
}

/// Limits within which the pilot keeps the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope {
    /// Largest bank angle, degrees.
    pub bank_max_deg: f64,
    /// Largest pitch angle, degrees.
    pub pitch_max_deg: f64,
    /// Smallest pitch angle, degrees.
    pub pitch_min_deg: f64,
    /// Largest load factor.
    pub load_factor_max: f64,
    /// Smallest airspeed, m/s.
    pub airspeed_min_mps: f64,
    /// Largest airspeed, m/s.
    pub airspeed_max_mps: f64,
    /// Airspeed held when nothing else is asked for, m/s.
    pub airspeed_cruise_mps: f64,
    /// Fastest change of a surface command, in units of the command (−1..1) a second.
    pub surface_slew_per_s: f64,
}

/// An aircraft without its aerodynamics.
#[derive(Clone, Debug, PartialEq)]
pub struct Airframe {
    /// The aircraft's name.
    pub name: String,
    /// Wing area, span and chord.
    pub geometry: Geometry,
    /// Actuator filters at 0.01 s.
    pub actuators: ActuatorFigures,
    /// Limits to fly within.
    pub envelope: Envelope,
}

/// A number in a parameter file, with where it comes from.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a number with its source: { value = …, source = \"…\" }")]
pub struct Sourced {
    /// The number, in the unit that the field's name ends with.
    pub value: f64,
    /// Where it comes from.
    pub source: String,
    /// Its standard deviation as a prior, in the same unit, where one is known.
    pub sd: Option<f64>,
}

/// Why an airframe or model file could not be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file could not be read.
    #[error("cannot read {what} {path}: {why}. Name an existing file, for example params/x8/{example}", path = path.display())]
    Read {
        /// What kind of file.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// The system's words.
        why: std::io::Error,
        /// A file that exists.
        example: &'static str,
    },
    /// The file is not what it should be.
    #[error("{what} {path}: {why}", path = path.display())]
    Content {
        /// What kind of file.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// What is wrong and what to do.
        why: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    name: String,
    geometry: GeometryFile,
    actuators: ActuatorFile,
    envelope: Envelope,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GeometryFile {
    wing_area_m2: Sourced,
    span_m: Sourced,
    mean_chord_m: Sourced,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ActuatorFile {
    surface_frequency_radps: Sourced,
    surface_damping: Sourced,
    deflection_max_rad: Sourced,
    throttle_lag_s: Sourced,
}

impl Airframe {
    /// Reads an airframe file (`schema = 1`).
    ///
    /// # Errors
    /// If the file cannot be read, is no such TOML, or holds a number that no aircraft has.
    pub fn load(path: &Path) -> Result<Airframe, FileError> {
        let what = "airframe file";
        let text = std::fs::read_to_string(path).map_err(|why| FileError::Read {
            what,
            path: path.into(),
            why,
            example: "airframe.toml",
        })?;
        Self::parse(&text).map_err(|why| FileError::Content { what, path: path.into(), why })
    }

    /// [`load`](Self::load) from the file's text; the error is what is wrong with it.
    pub fn parse(text: &str) -> Result<Airframe, String> {
        let file: File = toml::from_str(text).map_err(|e| toml_error(text, &e))?;
        check_schema(file.schema)?;
        let file = File { name: named(file.name)?, ..file };
        let g = &file.geometry;
        let a = &file.actuators;
        Ok(Airframe {
            name: file.name,
            geometry: Geometry {
                area: positive("geometry.wing_area_m2", &g.wing_area_m2, 1000.0)?,
                span: positive("geometry.span_m", &g.span_m, 100.0)?,
                chord: positive("geometry.mean_chord_m", &g.mean_chord_m, 50.0)?,
            },
            actuators: ActuatorFigures::tustin(
                positive("actuators.surface_frequency_radps", &a.surface_frequency_radps, 1000.0)?,
                positive("actuators.surface_damping", &a.surface_damping, 10.0)?,
                positive("actuators.deflection_max_rad", &a.deflection_max_rad, 1.6)?,
                positive("actuators.throttle_lag_s", &a.throttle_lag_s, 20.0)?,
                0.01,
            ),
            envelope: file.envelope.checked()?,
        })
    }
}

impl Envelope {
    fn checked(self) -> Result<Self, String> {
        let rules = [
            (self.bank_max_deg > 0.0 && self.bank_max_deg < 90.0, "bank_max_deg must lie in 0..90"),
            (
                -90.0 < self.pitch_min_deg && self.pitch_min_deg < 0.0,
                "pitch_min_deg must lie between -90 and 0",
            ),
            (
                0.0 < self.pitch_max_deg && self.pitch_max_deg < 90.0,
                "pitch_max_deg must lie between 0 and 90",
            ),
            (
                self.load_factor_max > 1.0 && self.load_factor_max <= 20.0,
                "load_factor_max must lie between 1 and 20",
            ),
            (
                0.0 < self.airspeed_min_mps && self.airspeed_min_mps < self.airspeed_cruise_mps,
                "airspeed_min_mps must be positive and under airspeed_cruise_mps",
            ),
            (
                self.airspeed_cruise_mps < self.airspeed_max_mps && self.airspeed_max_mps < 1000.0,
                "airspeed_max_mps must exceed airspeed_cruise_mps",
            ),
            (
                self.surface_slew_per_s > 0.0 && self.surface_slew_per_s <= 200.0,
                "surface_slew_per_s must lie between 0 and 200",
            ),
        ];
        match rules.iter().find(|(holds, _)| !holds) {
            Some((_, rule)) => Err(format!("envelope.{rule}; correct it there")),
            None => Ok(self),
        }
    }
}

/// A name that tables and file names can bear.
pub(crate) fn named(name: String) -> Result<String, String> {
    let fits = !name.trim().is_empty() && name.len() <= 64 && !name.chars().any(char::is_control);
    if fits { Ok(name) } else { Err("name must be one line of 1 to 64 bytes; give it one".into()) }
}

/// Refuses a file of another layout than this program's.
pub(crate) fn check_schema(schema: u32) -> Result<(), String> {
    if schema == 1 {
        return Ok(());
    }
    Err(format!(
        "its schema is {schema}, this program reads schema 1; use a file of schema 1 or the \
         program version that wrote it"
    ))
}

/// A number that must lie above zero and at most at `most`, the largest that an aircraft has.
pub(crate) fn positive(field: &str, number: &Sourced, most: f64) -> Result<f64, String> {
    if number.sd.is_some_and(|sd| !(sd.is_finite() && sd > 0.0)) {
        return Err(format!("{field}.sd must be a positive number"));
    }
    if number.value >= most * 1e-9 && number.value <= most {
        return Ok(number.value);
    }
    Err(format!(
        "{field} = {} is not physical: it must be positive and at most {most}",
        number.value
    ))
}

/// A TOML error on one line: where, then what.
pub(crate) fn toml_error(text: &str, error: &toml::de::Error) -> String {
    let line =
        error.span().map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
    let message = error.message().lines().collect::<Vec<_>>().join("; ");
    let short: String = message.chars().take(300).collect();
    line.map_or(short.clone(), |line| format!("line {line}: {short}"))
}
