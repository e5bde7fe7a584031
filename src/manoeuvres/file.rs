//! Schedule files in TOML. A schedule is a flight-test plan: steps with a target attitude and airspeed, and excitations (test
//! inputs) that are added to targets or commands. The name of a key ends with its unit.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::{
    AIRSPEED_MPS, Axis, DURATION_MAX_S, Excitation, PITCH_MAX_DEG, ROLL_MAX_DEG, Schedule, Shape,
    Step,
};
use greylag_physics::airframe::{check_schema, named, toml_error};

/// Highest frequency of a multisine, Hz: five samples per period at 100 Hz.
const FREQUENCY_MAX_HZ: f64 = 20.0;
/// Largest amplitude of an excitation of the airspeed target, m/s.
const AIRSPEED_AMPLITUDE_MAX_MPS: f64 = 50.0;

/// Reason why a schedule cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ScheduleError {
    /// The file could not be read.
    #[error("cannot read schedule {path}: {why}; name a schedule file, such as `greylag design` writes", path = path.display())]
    Read {
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// The file is not a valid schedule.
    #[error("schedule {path}: {why}", path = path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Description of the error and its remedy.
        why: String,
    },
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    name: String,
    #[serde(default)]
    description: String,
    #[serde(default)]
    step: Vec<StepFile>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct StepFile {
    duration_s: f64,
    roll_deg: f64,
    pitch_deg: f64,
    airspeed_mps: f64,
    #[serde(default)]
    excitation: Vec<ExcitationFile>,
}

/// An excitation in the file. Which keys are required depends on the axis `on` and the shape.
#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct ExcitationFile {
    on: String,
    shape: String,
    amplitude: Option<f64>,
    amplitude_deg: Option<f64>,
    amplitude_mps: Option<f64>,
    start_s: Option<f64>,
    width_s: Option<f64>,
    authority: Option<f64>,
    low_hz: Option<f64>,
    high_hz: Option<f64>,
    seed: Option<u64>,
}

impl Schedule {
    /// Reads a schedule file (`schema = 1`).
    ///
    /// # Errors
    ///
    /// If the file cannot be read, is not valid TOML of this schema, or has a value outside the bounds of a schedule.
    pub fn load(path: &Path) -> Result<Schedule, ScheduleError> {
        let text = greylag_physics::text_file::read(path)
            .map_err(|why| ScheduleError::Read { path: path.into(), why })?;
        Self::parse(&text).map_err(|why| ScheduleError::Content { path: path.into(), why })
    }

    /// Reads a schedule from the text of a file, as [`load`](Self::load) does. The error describes the fault.
    ///
    /// # Errors
    ///
    /// If the text is not valid TOML of this schema, or has a value outside the bounds of a schedule.
    pub fn parse(text: &str) -> Result<Schedule, String> {
        let file: File = toml::from_str(text).map_err(|e| toml_error(text, &e))?;
        check_schema(file.schema, 1)?;
        let steps = file.step.iter().enumerate().map(|(k, step)| {
            let excitations = step.excitation.iter().map(ExcitationFile::checked);
            let excitations: Result<Vec<_>, String> = excitations.collect();
            let excitations = excitations.map_err(|why| format!("step {}: {why}", k + 1))?;
            let held =
                Step::hold(step.duration_s, step.roll_deg, step.pitch_deg, step.airspeed_mps);
            Ok(Step { excitations, ..held })
        });
        let steps = steps.collect::<Result<Vec<_>, String>>()?;
        Schedule::new(named(file.name)?, file.description, steps)
    }

    /// The schedule as the text of a file. [`Schedule::parse`] reads the same schedule from it.
    pub fn to_toml(&self) -> String {
        let quoted = |text: &str| toml::Value::String(text.into()).to_string();
        let mut out = format!("schema = 1\nname = {}\n", quoted(&self.name));
        let _ = writeln!(out, "description = {}", quoted(&self.description));
        for step in self.steps() {
            let target = step.target;
            let _ = write!(
                out,
                "\n[[step]]\nduration_s = {:?}\nroll_deg = {:?}\npitch_deg = {:?}\nairspeed_mps = {:?}\n",
                step.duration,
                tidy(target.roll.to_degrees()),
                tidy(target.pitch.to_degrees()),
                target.airspeed
            );
            for excitation in &step.excitations {
                out.push_str("[[step.excitation]]\n");
                // a schedule contains only numbers and strings, which TOML can always write
                let content = toml::to_string(&ExcitationFile::from(excitation));
                out.push_str(&content.unwrap_or_default());
            }
        }
        out
    }
}

/// Rounds an angle in degrees to 1e-9°. This removes the rounding error of its conversion from radians.
fn tidy(degrees: f64) -> f64 {
    (degrees * 1e9).round() / 1e9
}

impl From<&Excitation> for ExcitationFile {
    fn from(e: &Excitation) -> Self {
        let mut file = ExcitationFile { on: e.axis.name().into(), ..Default::default() };
        file.start_s = (e.start != 0.0).then_some(e.start);
        file.authority = (e.authority != 1.0).then_some(e.authority);
        match e.axis {
            Axis::Roll | Axis::Pitch => file.amplitude_deg = Some(tidy(e.amplitude.to_degrees())),
            Axis::Airspeed => file.amplitude_mps = Some(e.amplitude),
            Axis::Aileron | Axis::Elevator | Axis::Throttle | Axis::Rudder => {
                file.amplitude = Some(e.amplitude)
            }
        }
        let (shape, width) = match &e.shape {
            Shape::Step { width } => ("step", width.is_finite().then_some(*width)),
            Shape::Doublet { width } => ("doublet", Some(*width)),
            Shape::ThreeTwoOneOne { width } => ("3-2-1-1", Some(*width)),
            Shape::Multisine { low, high, seed, .. } => {
                (file.low_hz, file.high_hz, file.seed) = (Some(*low), Some(*high), Some(*seed));
                ("multisine", None)
            }
        };
        (file.shape, file.width_s) = (shape.into(), width);
        file
    }
}

impl ExcitationFile {
    fn checked(&self) -> Result<Excitation, String> {
        let axis = Axis::ALL.into_iter().find(|axis| axis.name() == self.on).ok_or_else(|| {
            let names = Axis::ALL.map(Axis::name).join(", ");
            format!("excitation.on = {:?} is unknown; there are {names}", self.on)
        })?;
        let amplitude = self.amplitude(axis)?;
        let shape = self.shape()?;
        if self.authority.is_some() && matches!(axis, Axis::Roll | Axis::Pitch | Axis::Airspeed) {
            return Err(format!(
                "excitation.authority means nothing to the target of {}; take it out",
                axis.name()
            ));
        }
        let excitation = Excitation::new(axis, amplitude, self.start_s.unwrap_or(0.0), shape);
        Ok(excitation.against(self.authority.unwrap_or(1.0)))
    }

    /// The amplitude from the key that belongs to `axis`, in the unit of the axis: rad, m/s, or a fraction of full command.
    fn amplitude(&self, axis: Axis) -> Result<f64, String> {
        let all = [
            ("amplitude", self.amplitude),
            ("amplitude_deg", self.amplitude_deg),
            ("amplitude_mps", self.amplitude_mps),
        ];
        let (key, unit) = match axis {
            Axis::Aileron | Axis::Elevator | Axis::Rudder => {
                ("amplitude", "as a share of the full command")
            }
            Axis::Throttle => ("amplitude", "as a share of full throttle"),
            Axis::Roll | Axis::Pitch => ("amplitude_deg", "in degrees"),
            Axis::Airspeed => ("amplitude_mps", "in m/s"),
        };
        if let Some((wrong, _)) = all.iter().find(|(k, value)| *k != key && value.is_some()) {
            return Err(format!("excitation.{wrong} does not fit {}; write {key}", axis.name()));
        }
        let value = all.iter().find(|(k, _)| *k == key).and_then(|(_, value)| *value);
        let value = value.ok_or_else(|| format!("excitation.{key} ({unit}) is missing; add it"))?;
        Ok(if key == "amplitude_deg" { value.to_radians() } else { value })
    }

    fn shape(&self) -> Result<Shape, String> {
        let name = self.shape.as_str();
        let wide = || match self.width_s {
            Some(width) => Ok(width),
            None => Err(format!("excitation.width_s is missing, which {name} needs; add it")),
        };
        let multisine = name == "multisine";
        let foreign = [
            ("width_s", multisine && self.width_s.is_some()),
            ("low_hz", !multisine && self.low_hz.is_some()),
            ("high_hz", !multisine && self.high_hz.is_some()),
            ("seed", !multisine && self.seed.is_some()),
        ];
        if let Some((key, _)) = foreign.iter().find(|(_, is)| *is) {
            return Err(format!("excitation.{key} means nothing to {name}; take it out"));
        }
        match name {
            "step" => Ok(Shape::Step { width: self.width_s.unwrap_or(f64::INFINITY) }),
            "doublet" => Ok(Shape::Doublet { width: wide()? }),
            "3-2-1-1" => Ok(Shape::ThreeTwoOneOne { width: wide()? }),
            "multisine" => match (self.low_hz, self.high_hz) {
                (Some(low), Some(high))
                    if low >= 0.01 && low < high && high <= FREQUENCY_MAX_HZ =>
                {
                    Ok(Shape::multisine(low, high, self.seed.unwrap_or(0)))
                }
                _ => Err(format!(
                    "a multisine needs low_hz and high_hz with 0.01 <= low_hz < high_hz <= {FREQUENCY_MAX_HZ}"
                )),
            },
            _ => Err(format!(
                "excitation.shape = {name:?} is unknown; there are step, doublet, 3-2-1-1, multisine"
            )),
        }
    }
}

/// Checks that `steps` are within the bounds of a schedule. The error describes the first fault and gives the number of its step.
pub(super) fn check(steps: &[Step]) -> Result<(), String> {
    if steps.is_empty() {
        return Err(
            "it has no step; add [[step]] with duration_s, roll_deg, pitch_deg and airspeed_mps"
                .into(),
        );
    }
    for (k, step) in steps.iter().enumerate() {
        check_step(step).map_err(|why| format!("step {}: {why}", k + 1))?;
    }
    let total: f64 = steps.iter().map(|step| step.duration).sum();
    if total > DURATION_MAX_S {
        return Err(format!("it lasts {total} s; {DURATION_MAX_S} s is the most, so split it"));
    }
    Ok(())
}

fn check_step(step: &Step) -> Result<(), String> {
    let within = |name: &str, value: f64, low: f64, high: f64| {
        if (low..=high).contains(&value) {
            return Ok(());
        }
        Err(format!("{name} = {value} lies outside {low}..{high}; correct it"))
    };
    let target = step.target;
    within("duration_s", step.duration, 0.01, DURATION_MAX_S)?;
    within("airspeed_mps", target.airspeed, AIRSPEED_MPS[0], AIRSPEED_MPS[1])?;
    let moved = |axis: Axis| -> f64 {
        let on = step.excitations.iter().filter(|e| e.axis == axis);
        on.map(|e| e.peak().to_degrees()).sum()
    };
    let (roll, pitch) = (tidy(target.roll.to_degrees()), tidy(target.pitch.to_degrees()));
    within("roll_deg", roll, -ROLL_MAX_DEG, ROLL_MAX_DEG)?;
    within("pitch_deg", pitch, -PITCH_MAX_DEG, PITCH_MAX_DEG)?;
    let (farthest_roll, farthest_pitch) =
        (roll.abs() + tidy(moved(Axis::Roll)), pitch.abs() + tidy(moved(Axis::Pitch)));
    within("roll_deg with its excitation", farthest_roll, 0.0, ROLL_MAX_DEG)?;
    within("pitch_deg with its excitation", farthest_pitch, 0.0, PITCH_MAX_DEG)?;
    for airspeed in farthest_airspeeds(step) {
        within("airspeed_mps with its excitation", airspeed, AIRSPEED_MPS[0], AIRSPEED_MPS[1])?;
    }
    for e in &step.excitations {
        let most = match e.axis {
            Axis::Aileron | Axis::Elevator | Axis::Throttle | Axis::Rudder => 1.0,
            Axis::Roll | Axis::Pitch => std::f64::consts::PI,
            Axis::Airspeed => AIRSPEED_AMPLITUDE_MAX_MPS,
        };
        within(&format!("amplitude on {}", e.axis.name()), e.amplitude, -most, most)?;
        within("start_s", e.start, 0.0, step.duration)?;
        within("authority", e.authority, 0.0, 1.0)?;
        // the length of a shape "step" or "multisine" may be infinite: it then lasts to the end of the schedule's step
        let pulses = matches!(e.shape, Shape::Doublet { .. } | Shape::ThreeTwoOneOne { .. });
        if pulses || e.length() != f64::INFINITY {
            within("width_s of the whole excitation", e.length(), 0.01, step.duration - e.start)?;
        }
    }
    Ok(())
}

/// Smallest and largest airspeed target (m/s) that a step can reach with its excitations.
fn farthest_airspeeds(step: &Step) -> [f64; 2] {
    let mut farthest = [step.target.airspeed; 2];
    for e in step.excitations.iter().filter(|e| e.axis == Axis::Airspeed) {
        let [down, up] = match e.shape {
            Shape::Step { .. } => [e.amplitude.min(0.0), e.amplitude.max(0.0)],
            _ => [-e.peak(), e.peak()],
        };
        farthest[0] += down;
        farthest[1] += up;
    }
    farthest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::menu::MENU;

    #[test]
    fn the_menu_of_a_slow_aircraft_reads_back() {
        for manoeuvre in MENU {
            let schedule = manoeuvre.schedule().at_cruise(8.0);
            let back = Schedule::parse(&schedule.to_toml());
            assert!(back.is_ok(), "{}: {back:?}", manoeuvre.name);
        }
    }

    #[test]
    fn a_pulse_has_a_finite_width() {
        let with = |shape: Shape| {
            let step = Step::hold(5.0, 0.0, 0.0, 15.0);
            let excitation = Excitation::new(Axis::Elevator, 0.1, 0.0, shape);
            Schedule::new("s", "", vec![step.with(excitation)])
        };
        for width in [f64::NAN, f64::INFINITY] {
            for shape in [Shape::Doublet { width }, Shape::ThreeTwoOneOne { width }] {
                let why = with(shape).unwrap_err();
                assert!(why.contains("width_s of the whole excitation"), "{why}");
            }
        }
        assert!(with(Shape::Step { width: f64::NAN }).is_err());
        assert!(with(Shape::Step { width: f64::INFINITY }).is_ok());
        assert!(with(Shape::Doublet { width: 0.5 }).is_ok());
    }

    #[test]
    fn an_airspeed_is_limited_with_its_excitation() {
        let with = |amplitude: f64| {
            let shape = Shape::Step { width: 1.0 };
            let step = Step::hold(5.0, 0.0, 0.0, 10.0);
            let excitation = Excitation::new(Axis::Airspeed, amplitude, 0.0, shape);
            Schedule::new("s", "", vec![step.with(excitation)])
        };
        assert!(with(5.0).is_ok() && with(-5.0).is_ok() && with(20.0).is_ok());
        assert!(with(-12.0).unwrap_err().contains("airspeed_mps with its excitation = -2"));
    }
}
