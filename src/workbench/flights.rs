//! The logs of a session in memory: read, with reconstructed flight path, and prepared for comparison with models.

use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::error::{WorkbenchError, io};
use super::session::LogEntry;
use greylag_logs::finding::{Finding, Severity};
use greylag_logs::info::Info;
use greylag_logs::phases::Flying;
use greylag_logs::{self as logs, Log};
use greylag_model::GreyBox;
use greylag_sysid::amend::document::sha256;
use greylag_sysid::flight_path::installation::{Estimate, Prior};
use greylag_sysid::flight_path::reconstruction::Reconstruction;
use greylag_sysid::flight_path::{self, ActuatorClock, reconstruct};
use greylag_sysid::weak_form::prepared::Prepared;

/// Largest number of points in the small plot of a flight.
const STRIP: usize = 160;

/// A log in memory.
pub struct Loaded {
    /// Summary of the log from its reader.
    pub info: Info,
    /// Findings in the file, without those that [`Info`] adds.
    pub findings: Vec<Finding>,
    /// The reconstructed flight, with the deflections at their recorded times.
    pub flight: Reconstruction,
    /// The flight, prepared for simulations and comparisons of models.
    pub prepared: Prepared,
    /// Estimates of the constants of the sensors' installation from this flight alone.
    pub alone: Vec<Estimate>,
    /// Priors of such constants from the flights of the session, with which this flight was reconstructed.
    pub priors: Vec<Prior>,
    /// The same with the deflections on the time base of the gyros; `None` if their recorded times need no correction.
    corrected: Option<Box<(Reconstruction, Prepared)>>,
}

/// Values of a flight for a small plot.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Strip {
    /// Angle of attack α, °.
    pub alpha: Vec<f32>,
    /// Angle of sideslip β, °.
    pub beta: Vec<f32>,
    /// True airspeed, m/s.
    pub airspeed: Vec<f32>,
    /// Deflection of the aileron, °.
    pub aileron: Vec<f32>,
    /// Deflection of the elevator, °.
    pub elevator: Vec<f32>,
}

impl Loaded {
    /// Reads the log `name` with the content `bytes`. `model` states the mixer, and the airspeed above which the aircraft counts
    /// as flying.
    ///
    /// # Errors
    /// If the content is not a log, its flight path cannot be reconstructed, or its clock cannot be used.
    pub fn parse(
        bytes: &[u8],
        name: &str,
        reading: &logs::Options,
        model: &GreyBox,
    ) -> Result<Arc<Loaded>, WorkbenchError> {
        Ok(Arc::new(Loaded::parse_as(bytes, name, (reading, model), Vec::new())?))
    }

    /// As [`parse`](Self::parse), with `priors` of the constants of the installation that other flights give.
    fn parse_as(
        bytes: &[u8],
        name: &str,
        (reading, model): (&logs::Options, &GreyBox),
        priors: Vec<Prior>,
    ) -> Result<Loaded, WorkbenchError> {
        let mixer = model.airframe.mixer.clone();
        let flies = Flying::from(model.airframe.envelope.flying_from_mps());
        let mapping = reading.mapping.clone().with_mixer(mixer);
        let flies = mapping.flies(Some(flies));
        let reading = logs::Options { flies, mapping, ..reading.clone() };
        let log = logs::parse(bytes, Path::new(name), &reading)?;
        Loaded::of(&log, name, model, priors)
    }

    fn of(
        log: &Log,
        name: &str,
        model: &GreyBox,
        priors: Vec<Prior>,
    ) -> Result<Loaded, WorkbenchError> {
        let options = flight_path::Options::of(name, model, ActuatorClock::AsRecorded)
            .down_to(log.flies.sustained_s)
            .expecting(&priors);
        let flight = reconstruct(&log.flight, &options)?;
        let slowest = model.airframe.envelope.flying_from_mps();
        let prepared = Prepared::new(&flight, slowest)?;
        let corrected = match flight.actuators_late() {
            Some(_) => {
                let flight = flight.clone().with_corrected_clock();
                let prepared = Prepared::new(&flight, slowest)?;
                Some(Box::new((flight, prepared)))
            }
            None => None,
        };
        Ok(Loaded {
            info: Info::of(log),
            findings: log.findings.clone(),
            alone: flight.installation.clone(),
            priors,
            flight,
            prepared,
            corrected,
        })
    }

    /// The flight with the deflections on the time base `clock`.
    pub fn on(&self, clock: ActuatorClock) -> (&Reconstruction, &Prepared) {
        match &self.corrected {
            Some(pair) if clock == ActuatorClock::Estimated => (&pair.0, &pair.1),
            _ => (&self.flight, &self.prepared),
        }
    }

    /// Reads the log of `entry`; a relative path is relative to `folder`.
    ///
    /// # Errors
    /// `WorkbenchError::LogChanged` if the content has changed, and the errors of reading and of `parse`.
    pub fn read(
        entry: &LogEntry,
        folder: &Path,
        reading: &logs::Options,
        model: &GreyBox,
    ) -> Result<Arc<Loaded>, WorkbenchError> {
        Ok(Arc::new(Loaded::read_as(entry, folder, (reading, model), Vec::new())?))
    }

    /// As [`read`](Self::read), with `priors` of the constants of the installation that other flights give.
    ///
    /// # Errors
    /// As `read`.
    pub fn read_as(
        entry: &LogEntry,
        folder: &Path,
        by: (&logs::Options, &GreyBox),
        priors: Vec<Prior>,
    ) -> Result<Loaded, WorkbenchError> {
        let path = folder.join(&entry.path);
        let bytes = std::fs::read(&path).map_err(|e| io(&path, e))?;
        if sha256(&bytes) != entry.sha256 {
            return Err(WorkbenchError::LogChanged { path });
        }
        Loaded::parse_as(&bytes, &entry.name(), by, priors)
    }

    /// Whether the log has defects that make results computed from it wrong.
    pub fn in_doubt(&self) -> bool {
        self.info.severity() == Severity::Problem
    }

    /// The values of the flight for a small plot.
    pub fn strip(&self) -> Strip {
        let all: Vec<_> = self.prepared.segments.iter().flatten().collect();
        let every = all.len().div_ceil(STRIP).max(1);
        let mut strip = Strip::default();
        for i in all.iter().step_by(every) {
            strip.alpha.push(i.state.alpha.to_degrees() as f32);
            strip.beta.push(i.state.beta.to_degrees() as f32);
            strip.airspeed.push(i.state.airspeed as f32);
            strip.aileron.push(i.controls.aileron.to_degrees() as f32);
            strip.elevator.push(i.controls.elevator.to_degrees() as f32);
        }
        strip
    }
}
