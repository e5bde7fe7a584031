//! Requests of the workbench's page and their execution.
//!
//! A session of the workbench holds flights with roles, a model, and effects that the user has accepted. The amended model is
//! the fit with these effects.

use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, PoisonError};

use serde::Deserialize;

use super::bench::{Bench, Inner, load};
use super::error::WorkbenchError;
use super::fit::scores;
use super::fly::Order;
use super::jobs::Work;
use super::roles::now_s;
use super::session::{Accepted, LogEntry, Occasion, Opening, Role};
use greylag_model::GreyBox;
use greylag_physics::catalogue;
use greylag_report::write_over;
use greylag_sysid::amend::Options;
use greylag_sysid::amend::document::sha256;
use greylag_sysid::compare::HorizonScore;
use greylag_sysid::weak_form::prepared::Prepared;

/// Subfolder of the session's folder for the saved model.
pub(super) const SAVED: &str = "model";

/// A request with the revision of the session that the page showed.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Request {
    /// Revision of the session that the page showed.
    pub revision: u64,
    /// The request that the page makes.
    pub act: Act,
}

/// Requests that a page can make.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum Act {
    /// Change the role of a flight.
    Role {
        /// Index of the flight in the session.
        flight: usize,
        /// New role of the flight.
        role: Role,
    },
    /// Remove a flight from the session; its log file is kept.
    Remove {
        /// Index of the flight in the session.
        flight: usize,
    },
    /// Multiply a column of all logs by a factor, as the finding about a flight recommends.
    Map {
        /// Index of the flight with the finding.
        flight: usize,
        /// Name of the column in the log format.
        column: String,
        /// Factor by which the column is multiplied.
        scale: f64,
    },
    /// Start a diagnosis of the model.
    Diagnose,
    /// Accept an effect and refit the model with it.
    Tick {
        /// Id of the effect in the catalogue.
        effect: String,
    },
    /// Keep the last accepted effect although the fit refuses it.
    Keep,
    /// Remove the last accepted effect.
    Undo,
    /// Accept again the last removed effect.
    Redo,
    /// Compute fits that are missing, for example after the role of a flight has changed.
    Fit,
    /// Compare the given and the amended model on the test flights, which are no longer unseen afterwards.
    Judge,
    /// Write the amended model to the subfolder `model` of the session's folder.
    Save,
    /// Read the model file again after a change.
    ReloadModel,
    /// Cancel a running job.
    Cancel {
        /// Id of the job.
        job: u64,
    },
    /// Add an effect from the text of an effect file to the session.
    Write {
        /// Text of the effect file.
        text: String,
    },
    /// Remove an effect that was added as text from the session.
    Forget {
        /// Id of the effect.
        effect: String,
    },
    /// Search for a formula for the residual that no effect explains.
    Propose,
    /// Design a flight schedule that distinguishes two effects.
    Design {
        /// Ids of the two effects.
        between: [String; 2],
    },
    /// Fly a simulated aircraft as ordered, with a controller designed from the session's model.
    Fly(Order),
    /// Display a recording that another program is writing.
    Watch {
        /// Folder of the recording, or path of the recorded log.
        folder: PathBuf,
    },
    /// Stop the flight or the display of a recording.
    StopFlight,
    /// Add a recording to the session as a log.
    TakeFlight {
        /// Index of the recording in the session.
        flown: usize,
    },
}

impl Bench {
    /// Executes `request`, which a page has made.
    ///
    /// # Errors
    /// `WorkbenchError::Conflict` if the session has changed since the page read it. Another error if the request cannot be
    /// executed.
    pub fn act(self: &Arc<Self>, request: Request) -> Result<(), WorkbenchError> {
        let seen = request.revision;
        match request.act {
            Act::Role { flight, role } => self.change(seen, |inner| inner.give_role(flight, role)),
            Act::Remove { flight } => self.remove(seen, flight),
            Act::Map { flight, column, scale } => self.map(seen, flight, &column, scale),
            Act::Diagnose => {
                self.same_model()?;
                self.lock().to_fit()?;
                self.start(Work::Diagnosis);
                Ok(())
            }
            Act::Tick { effect } => self.tick(seen, effect),
            Act::Keep => self.keep(seen),
            Act::Undo => self.undo(seen),
            Act::Redo => self.redo(seen),
            Act::Fit => {
                self.same_model()?;
                self.start(Work::Fit);
                Ok(())
            }
            Act::Judge => self.judge(seen),
            Act::Save => {
                self.same_model()?;
                self.save(&self.folder.join(SAVED))
            }
            Act::ReloadModel => self.reload(seen),
            Act::Cancel { job } => {
                self.cancel(job);
                Ok(())
            }
            Act::Write { text } => self.write_effect(seen, &text),
            Act::Forget { effect } => self.forget(seen, &effect),
            Act::Propose => {
                self.same_model()?;
                self.lock().searched_places()?;
                self.start(Work::Proposal);
                Ok(())
            }
            Act::Design { between } => self.start_design(between),
            Act::Fly(order) => self.fly(seen, &order),
            Act::Watch { folder } => self.watch(seen, &folder),
            Act::StopFlight => self.stop_flight(),
            Act::TakeFlight { flown } => self.take_flight(seen, flown),
        }
    }

    /// Removes a log from the session.
    fn remove(&self, seen: u64, flight: usize) -> Result<(), WorkbenchError> {
        self.change(seen, |inner| {
            if flight >= inner.session.logs.len() {
                return Err(WorkbenchError::NoFlight(flight));
            }
            inner.note_removal(flight);
            inner.session.logs.remove(flight);
            drop(inner.flights.remove(flight));
            Ok(())
        })
    }

    /// Keeps the last accepted effect although the fit refuses it.
    fn keep(self: &Arc<Self>, seen: u64) -> Result<(), WorkbenchError> {
        self.change(seen, |inner| {
            let last = inner.session.effects.last_mut();
            last.ok_or(WorkbenchError::Nothing("keep"))?.anyway = true;
            Ok(())
        })?;
        self.start(Work::Fit);
        Ok(())
    }

    /// Removes the last accepted effect.
    fn undo(self: &Arc<Self>, seen: u64) -> Result<(), WorkbenchError> {
        self.change(seen, |inner| {
            let last = inner.session.effects.pop();
            inner.session.undone.push(last.ok_or(WorkbenchError::Nothing("take back"))?);
            inner.supersede(Work::Fit);
            Ok(())
        })?;
        // The fit with the remaining effects may be missing: it may have been interrupted, or a flight may have changed its
        // role.
        self.start(Work::Fit);
        Ok(())
    }

    /// Accepts again the last removed effect.
    fn redo(self: &Arc<Self>, seen: u64) -> Result<(), WorkbenchError> {
        self.change(seen, |inner| {
            let last = inner.session.undone.pop();
            inner.session.effects.push(last.ok_or(WorkbenchError::Nothing("accept again"))?);
            Ok(())
        })?;
        self.start(Work::Fit);
        Ok(())
    }

    /// Adds a log that the page has sent, with the name `name` and the content `bytes`.
    ///
    /// # Errors
    /// If `name` is invalid, `bytes` are not a usable log, the session already contains the log, the session is not at revision
    /// `seen`, or the file cannot be written.
    pub fn take(&self, seen: u64, name: &str, bytes: &[u8]) -> Result<(), WorkbenchError> {
        self.take_as(seen, name, bytes, None)
    }

    /// Adds a log with the role `role`; `None` selects the default role.
    pub(super) fn take_as(
        &self,
        seen: u64,
        name: &str,
        bytes: &[u8],
        role: Option<Role>,
    ) -> Result<(), WorkbenchError> {
        let plain = |c: char| c.is_alphanumeric() || "._- +()".contains(c);
        if name.is_empty() || name.starts_with('.') || name.len() > 200 || !name.chars().all(plain)
        {
            return Err(WorkbenchError::Name(name.into()));
        }
        let _one_at_a_time = self.taking.lock().unwrap_or_else(PoisonError::into_inner);
        let place = PathBuf::from("logs").join(name);
        let file = self.folder.join(&place);
        // if another log has this name, the new file name begins with a hash of its content
        let place = match fs::read(&file) {
            Ok(there) if there != bytes => {
                PathBuf::from("logs").join(format!("{}-{name}", &sha256(bytes)[..8]))
            }
            _ => place,
        };
        let file = self.folder.join(&place);
        let (revision, known) = {
            let inner = self.lock();
            (inner.session.revision, file.exists())
        };
        if revision != seen {
            return Err(WorkbenchError::Conflict { now: revision, seen });
        }
        if !known {
            write_over(&file, bytes)?;
        }
        self.add(seen, place, bytes, role).inspect_err(|_| {
            if !known {
                let _ = fs::remove_file(&file);
            }
        })
    }

    fn tick(self: &Arc<Self>, seen: u64, effect: String) -> Result<(), WorkbenchError> {
        self.same_model()?;
        self.change(seen, |inner| {
            if inner.model.residual.is_some() {
                return Err(WorkbenchError::Residual(inner.model.name.clone()));
            }
            inner.divided()?;
            if catalogue::describe(&effect).is_none() {
                return Err(WorkbenchError::Amend(
                    greylag_model::JoinError::Unknown { id: effect.clone() }.into(),
                ));
            }
            let there = inner.session.effects.iter().any(|e| e.id == effect);
            if there || inner.model.has(&effect) {
                return Err(WorkbenchError::Present(effect));
            }
            inner.session.effects.push(Accepted { id: effect, anyway: false });
            inner.session.undone.clear();
            Ok(())
        })?;
        self.start(Work::Fit);
        Ok(())
    }

    /// Scores the given and the amended model by free runs (open-loop simulations) over the test flights. Records in the
    /// session that the test flights have been used, before the results are displayed.
    fn judge(&self, seen: u64) -> Result<(), WorkbenchError> {
        self.same_model()?;
        let (given, amended, effects, places, flights) = {
            let inner = self.lock();
            let places = inner.usable(&[Role::Test]);
            if places.is_empty() {
                return Err(WorkbenchError::NoRole(Role::Test));
            }
            let clock = inner.clock();
            let used = |k: &usize| inner.flights[*k].as_ref().ok().map(|f| f.on(clock).1.clone());
            let flights: Vec<Prepared> = places.iter().filter_map(used).collect();
            let (amended, effects) = inner.amended()?;
            (inner.model.clone(), amended, effects, places, flights)
        };
        let (horizon_s, given) = judged(&scores(&given, &flights));
        let (_, amended) = judged(&scores(&amended, &flights));
        self.change(seen, |inner| {
            let logs = || places.iter().map(|k| &inner.session.logs[*k]);
            let opening = Opening {
                unix_s: now_s(),
                occasion: Occasion::Judged,
                effects,
                flights: logs().map(LogEntry::name).collect(),
                sha256: logs().map(|l| l.sha256.clone()).collect(),
                given,
                amended,
                horizon_s,
            };
            inner.session.openings.push(opening);
            Ok(())
        })
    }

    /// Reads the model files and the logs again, and discards results of the old files.
    fn reload(&self, seen: u64) -> Result<(), WorkbenchError> {
        let path = self.lock().session.model.clone();
        let read = load(&path)?;
        self.change(seen, |inner| {
            inner.session.model_sha256 = read.fingerprint;
            (inner.model, inner.original) = (read.model, read.original);
            // the logs are read again because gravity, actuators and the lowest airspeed of flight are those of the model
            inner.reread();
            Ok(())
        })
    }
}

impl Inner {
    /// The amended model, and those of the accepted effects that its fit added.
    fn amended(&self) -> Result<(GreyBox, Vec<String>), WorkbenchError> {
        if self.session.effects.is_empty() {
            return Ok((self.model.clone(), Vec::new()));
        }
        let key = self.key("fit", &self.session.effects);
        let fitted = self.fits.get(&key).ok_or(WorkbenchError::Unfitted)?;
        Ok((fitted.model.clone(), fitted.joined()))
    }
}

/// The longest horizon, s, that is at most `Options::JUDGED_AT_S` and that runs reach, and the error at this horizon. NaN if no
/// run reaches a horizon.
fn judged(scores: &[HorizonScore]) -> (f64, f64) {
    let mut reached = scores.iter().filter(|s| s.runs > 0 && s.horizon_s <= Options::JUDGED_AT_S);
    reached.next_back().map_or((f64::NAN, f64::NAN), |s| (s.horizon_s, s.rmse_scaled))
}
