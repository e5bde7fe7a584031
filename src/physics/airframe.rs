//! The airframe: geometry, actuators, flight envelope and sensors, read from a TOML file.

mod controls;
mod effectors;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::mixer::Mixer;
use crate::{Sensors, State};

pub use controls::Yaw;
use controls::{Alike, Each};
use effectors::{MotorFile, SurfaceFile};

pub use crate::servos::ActuatorFigures;

/// Reference dimensions of the wing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Reference wing area S, m².
    pub area: f64,
    /// Wing span b, m.
    pub span: f64,
    /// Mean aerodynamic chord c, m.
    pub chord: f64,
}

/// Flight envelope: the limits that this program enforces in flight.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope {
    /// Largest bank angle, degrees.
    pub bank_max_deg: f64,
    /// Largest pitch angle, degrees.
    pub pitch_max_deg: f64,
    /// Smallest pitch angle, degrees.
    pub pitch_min_deg: f64,
    /// Largest normal load factor.
    pub load_factor_max: f64,
    /// Smallest normal load factor. If `None`, see [`load_factor_least`](Envelope::load_factor_least).
    #[serde(default)]
    pub load_factor_min: Option<f64>,
    /// Largest sideslip, degrees. If `None`, see [`sideslip_most_deg`](Envelope::sideslip_most_deg).
    #[serde(default)]
    pub sideslip_max_deg: Option<f64>,
    /// Smallest true airspeed, m/s.
    pub airspeed_min_mps: f64,
    /// Largest true airspeed, m/s.
    pub airspeed_max_mps: f64,
    /// Cruise airspeed (true), which is used if no airspeed is commanded, m/s.
    pub airspeed_cruise_mps: f64,
    /// Largest rate of a surface command, in units of the command (−1..1) per second.
    pub surface_slew_per_s: f64,
}

/// Ratio of the smallest to the largest load factor if a file states only the largest: FAR 23.337 (b) (1), normal and
/// utility category.
const LEAST_LOAD: f64 = -0.4;
/// Largest sideslip if a file states none, degrees. Linear lateral derivatives are not valid beyond it.
const SIDESLIP_DEG: f64 = 25.0;
/// Ratio of the stall angle to the angle from which the nose is pushed down, if a file states no stall angle.
const STALL: f64 = 4.0 / 3.0;
/// Largest angle of attack in flight, as a fraction of the stall angle.
const BEFORE_STALL: f64 = 0.95;

impl Envelope {
    /// Smallest normal load factor: the file's, or −0.4 times the largest if the file states none (FAR 23.337).
    pub fn load_factor_least(&self) -> f64 {
        self.load_factor_min.unwrap_or(LEAST_LOAD * self.load_factor_max)
    }

    /// Largest sideslip, degrees: the file's, or 25° if the file states none.
    pub fn sideslip_most_deg(&self) -> f64 {
        self.sideslip_max_deg.unwrap_or(SIDESLIP_DEG)
    }

    /// Airspeed from which the rows of a log count as flight, m/s. It is half the smallest airspeed: a stall counts as flight,
    /// taxiing does not.
    pub fn flying_from_mps(&self) -> f64 {
        0.5 * self.airspeed_min_mps
    }
}

/// Reference flight condition of an aircraft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Reference airspeed V0 of the state's characteristic scale x_c, eq. (21) of \[GSFM26\] (see `src/lib.rs`), m/s.
    pub airspeed: f64,
    /// Altitude at which controllers are designed and models are trimmed and simulated, m above mean sea level.
    pub altitude: f64,
}

impl Reference {
    /// Reference condition for files of schema 1, which state none: the start of an episode in section V-A of \[GSFM26\].
    pub const OF_SCHEMA_1: Reference = Reference { airspeed: 16.67, altitude: 600.0 };
}

/// Limits of the angle of attack for controllers.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Incidence {
    /// Largest angle of attack of steady flight, rad.
    #[serde(rename = "comfortable_rad")]
    pub comfortable: f64,
    /// Largest angle of attack that a commanded attitude may require, rad. Larger angles occur only in transients.
    #[serde(rename = "tolerable_rad")]
    pub tolerable: f64,
    /// Angle of attack above which the controller pushes the nose down, rad.
    #[serde(rename = "push_from_rad")]
    pub push_from: f64,
    /// Angle of attack at stall, rad. If `None`, see [`before_stall`](Incidence::before_stall).
    #[serde(default, rename = "stall_rad")]
    pub stall: Option<f64>,
    /// Nose-down elevator deflection per angle of attack above `push_from`, rad/rad.
    pub push_gain: f64,
}

impl Incidence {
    /// Limits for a wing that stalls at about 12°.
    pub const DEFAULT: Incidence = Incidence {
        comfortable: 0.05,
        tolerable: 0.09,
        push_from: 0.16,
        push_gain: 3.0,
        stall: None,
    };

    /// Largest angle of attack in a transient, rad: 95 % of the stall angle. If the file states no stall angle, 4/3 of
    /// `push_from` is taken.
    pub fn before_stall(&self) -> f64 {
        BEFORE_STALL * self.stall.unwrap_or(STALL * self.push_from)
    }

    fn checked(self) -> Result<Self, String> {
        let Incidence { comfortable, tolerable, push_from, push_gain, stall } = self;
        if stall.is_some_and(|stall| !(push_from <= stall && stall < 1.0)) {
            return Err(
                "incidence.stall_rad must lie between push_from_rad and 1; correct it there".into(),
            );
        }
        if 0.0 < comfortable
            && comfortable < tolerable
            && tolerable < push_from
            && push_from < 1.0
            && (0.0..=20.0).contains(&push_gain)
        {
            return Ok(self);
        }
        Err("incidence must have 0 < comfortable_rad < tolerable_rad < push_from_rad < 1 and push_gain in \
             0..20; correct it there"
            .into())
    }
}

/// Properties of an aircraft other than its aerodynamics.
#[derive(Clone, Debug, PartialEq)]
pub struct Airframe {
    /// Name of the aircraft.
    pub name: String,
    /// Wing area, span and chord.
    pub geometry: Geometry,
    /// Travels and rate limits of the surfaces, and the filters of surfaces and throttle for a time step of 0.01 s.
    pub actuators: ActuatorFigures,
    /// Whether the file's schema can describe a rudder.
    pub yaw: Yaw,
    /// Surfaces and motors moved by the controls. `None` if the file names none.
    pub mixer: Option<Mixer>,
    /// JSBSim properties that are constant in flight, for example flaps.
    pub conditions: BTreeMap<String, f64>,
    /// Reference condition for x_c, design and simulation.
    pub reference: Reference,
    /// Limits of the angle of attack for controllers.
    pub incidence: Incidence,
    /// Limits of the flight envelope.
    pub envelope: Envelope,
    /// Errors and noise of the aircraft's sensors, as stated in the file.
    pub sensors: Sensors,
}

/// A number in a parameter file with its source.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a number with its source: { value = …, source = \"…\" }")]
pub struct Sourced {
    /// Value, in the unit given by the suffix of the field's name.
    pub value: f64,
    /// Source of the value, in words.
    pub source: String,
    /// Prior standard deviation, in the same unit. `None` if it is unknown.
    pub sd: Option<f64>,
    /// Lower and upper bound, in the same unit. `None` if the file states none.
    pub bounds: Option<[f64; 2]>,
}

/// Reason why an airframe or model file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file cannot be read.
    #[error("cannot read {what} {path}: {why}. Name an existing file, for example params/x8/{example}", path = path.display())]
    Read {
        /// Kind of file, in words.
        what: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
        /// Path of an existing example file.
        example: &'static str,
    },
    /// The content is invalid.
    #[error("{what} {path}: {why}", path = path.display())]
    Content {
        /// Kind of file, in words.
        what: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// Description of the error and its remedy.
        why: String,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    name: String,
    geometry: GeometryFile,
    actuators: Option<Alike>,
    controls: Option<Each>,
    reference: Option<ReferenceFile>,
    incidence: Option<Incidence>,
    envelope: Envelope,
    #[serde(default)]
    surfaces: BTreeMap<String, SurfaceFile>,
    #[serde(default)]
    motors: BTreeMap<String, MotorFile>,
    #[serde(default)]
    conditions: BTreeMap<String, f64>,
    #[serde(default)]
    sensors: Sensors,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReferenceFile {
    airspeed_mps: Sourced,
    altitude_m: Sourced,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GeometryFile {
    wing_area_m2: Sourced,
    span_m: Sourced,
    mean_chord_m: Sourced,
}

impl File {
    /// Actuator filters, and whether the file's schema can describe a rudder.
    fn controls(&self) -> Result<(ActuatorFigures, Yaw), String> {
        match (self.schema, &self.actuators, &self.controls) {
            (1, Some(alike), None) => alike.figures(),
            (2, None, Some(each)) => each.figures(),
            (1, ..) => {
                Err("schema 1 describes its controls in [actuators] alone; [controls] is of \
                            schema = 2"
                    .into())
            }
            _ => {
                Err("schema 2 describes its controls in [controls.aileron], [controls.elevator], \
                      [controls.throttle] and, where there is one, [controls.rudder]"
                    .into())
            }
        }
    }

    fn mixer(&self, actuators: &ActuatorFigures) -> Result<Option<Mixer>, String> {
        let named =
            !(self.surfaces.is_empty() && self.motors.is_empty() && self.conditions.is_empty());
        if self.schema == 1 && named {
            return Err("[surfaces], [motors] and [conditions] are of schema = 2".into());
        }
        if let Some((name, value)) = self.conditions.iter().find(|(_, value)| !value.is_finite()) {
            return Err(format!("conditions.{name} = {value} must be a finite number"));
        }
        effectors::mixer(&self.surfaces, &self.motors, &actuators.travels())
    }

    fn reference(&self) -> Result<Reference, String> {
        let Some(reference) = &self.reference else {
            return Ok(Reference::OF_SCHEMA_1);
        };
        let altitude = reference.altitude_m.value;
        if !(-500.0..=11_000.0).contains(&altitude) {
            return Err(format!(
                "reference.altitude_m = {altitude} must lie between -500 and 11000"
            ));
        }
        Ok(Reference {
            airspeed: positive("reference.airspeed_mps", &reference.airspeed_mps, 1000.0)?,
            altitude,
        })
    }
}

impl Airframe {
    /// Straight and level flight at the reference airspeed, the initial state of simulated flights.
    pub fn start(&self) -> State {
        State { airspeed: self.reference.airspeed, ..State::NEUTRAL }
    }

    /// Reads an airframe file of schema 2, or of schema 1 from earlier programs.
    ///
    /// # Errors
    /// If the file cannot be read, has a syntax error or another schema, lacks an entry, or has a number outside its accepted
    /// range.
    pub fn load(path: &Path) -> Result<Airframe, FileError> {
        let what = "airframe file";
        let text = crate::text_file::read(path).map_err(|why| FileError::Read {
            what,
            path: path.into(),
            why,
            example: "airframe.toml",
        })?;
        Self::parse(&text).map_err(|why| FileError::Content { what, path: path.into(), why })
    }

    /// Reads the text of an airframe file, as [`load`](Self::load) does. The error describes the fault.
    pub fn parse(text: &str) -> Result<Airframe, String> {
        let file: File = toml::from_str(text).map_err(|e| toml_error(text, &e))?;
        check_schema(file.schema, 2)?;
        let file = File { name: named(file.name)?, ..file };
        if file.schema == 2 && file.reference.is_none() {
            return Err("schema 2 needs [reference] with airspeed_mps and altitude_m".into());
        }
        let (actuators, yaw) = file.controls()?;
        let mixer = file.mixer(&actuators)?;
        let reference = file.reference()?;
        let g = &file.geometry;
        Ok(Airframe {
            name: file.name,
            geometry: Geometry {
                area: positive("geometry.wing_area_m2", &g.wing_area_m2, 1000.0)?,
                span: positive("geometry.span_m", &g.span_m, 100.0)?,
                chord: positive("geometry.mean_chord_m", &g.mean_chord_m, 50.0)?,
            },
            actuators,
            yaw,
            mixer,
            conditions: file.conditions,
            reference,
            incidence: file.incidence.unwrap_or(Incidence::DEFAULT).checked()?,
            envelope: file.envelope.checked()?,
            sensors: file.sensors,
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
                self.load_factor_min.is_none_or(|n| (-20.0..0.9).contains(&n)),
                "load_factor_min must lie between -20 and 0.9",
            ),
            (
                self.sideslip_max_deg.is_none_or(|deg| deg > 1.0 && deg <= 90.0),
                "sideslip_max_deg must lie between 1 and 90",
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

/// Checks that a name is usable in tables and file names: one line of 1 to 64 bytes.
pub fn named(name: String) -> Result<String, String> {
    let fits = !name.trim().is_empty() && name.len() <= 64 && !name.chars().any(char::is_control);
    if fits { Ok(name) } else { Err("name must be one line of 1 to 64 bytes; give it one".into()) }
}

/// Checks that the schema of a file lies in 1 to `newest`.
pub fn check_schema(schema: u32, newest: u32) -> Result<(), String> {
    if (1..=newest).contains(&schema) {
        return Ok(());
    }
    Err(format!(
        "its schema is {schema}, this program reads schema {newest}; use a file of schema {newest} or \
         the program version that wrote it"
    ))
}

/// Returns the value of `number` if it is positive and at most `most`. The error names `field`.
pub fn positive(field: &str, number: &Sourced, most: f64) -> Result<f64, String> {
    within(field, number, [most * 1e-9, most])
}

/// Returns the value of `number` if it lies between the positive bounds `least` and `most` and its standard deviation, if
/// stated, is positive. The error names `field`.
pub fn within(field: &str, number: &Sourced, [least, most]: [f64; 2]) -> Result<f64, String> {
    if number.sd.is_some_and(|sd| !(sd.is_finite() && sd > 0.0)) {
        return Err(format!("{field}.sd must be a positive number"));
    }
    if number.value >= least && number.value <= most {
        return Ok(number.value);
    }
    Err(format!(
        "{field} = {} is not physical: it must be positive and at most {most}",
        number.value
    ))
}

/// A TOML error as one line of text: the line number, then the description.
pub fn toml_error(text: &str, error: &toml::de::Error) -> String {
    let line =
        error.span().map(|span| text[..span.start.min(text.len())].matches('\n').count() + 1);
    let message = error.message().lines().collect::<Vec<_>>().join("; ");
    let short: String = message.chars().take(300).collect();
    line.map_or(short.clone(), |line| format!("line {line}: {short}"))
}
