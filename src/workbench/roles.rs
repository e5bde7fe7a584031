//! Roles of the logs in a session of the workbench (fit, hold out, test, unused), and the names of their flights.
//!
//! A test flight is locked: nothing computed from it is shown until the user opens it to judge the models. `Session::usual_role`
//! in `session.rs` selects the role of a new log.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use super::bench::Inner;
use super::error::WorkbenchError;
use super::flights::Loaded;
use super::jobs::Work;
use super::session::{LogEntry, Occasion, Opening, Role};
use greylag_logs::names;
use greylag_sysid::amend::split;
use greylag_sysid::flight_path::ActuatorClock;
use greylag_sysid::flight_path::reconstruction::Reconstruction;

/// The flights for a fit and for its validation, with notes on their logs.
pub struct Divided {
    /// Flights to which the model is fitted.
    pub fit: Vec<Reconstruction>,
    /// Flights for the validation of the fit.
    pub held_out: Vec<Reconstruction>,
    /// Notes on defects and peculiarities of the logs.
    pub notes: Vec<String>,
}

impl Inner {
    /// Adds the log `entry`, which was read as `loaded`, to the session. Its role is `role`, or the usual one for `None`. It
    /// replaces a log with the same path. A log that was removed while it was a locked test flight becomes a test flight again,
    /// because with another role it would be opened without a record.
    pub fn take_in(&mut self, entry: LogEntry, role: Option<Role>, loaded: Arc<Loaded>) {
        let file = self.folder.join(&entry.path);
        let before = self.session.logs.iter().position(|l| self.folder.join(&l.path) == file);
        let usual = match (role, before) {
            (Some(role), _) => role,
            (None, Some(place)) => self.session.logs[place].role,
            (None, None) => self.session.usual_role(&entry.name()),
        };
        // a log with problems is not used until the user gives it a role, unless the user asked for such logs
        let refused = loaded.in_doubt() && !self.given.despite_problems;
        let removed = self.session.removed_tests.iter().position(|known| *known == entry.sha256);
        let role = match removed {
            Some(_) => Role::Test,
            None if refused => Role::Unused,
            None => usual,
        };
        if let Some(at) = removed {
            self.session.removed_tests.remove(at);
        }
        let entry = LogEntry { role, ..entry };
        match before {
            Some(place) => {
                self.note_removal(place);
                self.session.logs[place] = entry;
                self.flights[place] = Ok(loaded);
            }
            None => {
                self.session.make_room(entry.role);
                self.session.logs.push(entry);
                self.flights.push(Ok(loaded));
            }
        }
    }

    /// Records the hash of the log with the index `place`, which is about to be removed, if it is a locked test flight.
    pub fn note_removal(&mut self, place: usize) {
        let log = &self.session.logs[place];
        if self.locked(log) && !self.session.removed_tests.contains(&log.sha256) {
            self.session.removed_tests.push(log.sha256.clone());
        }
    }

    /// Changes the role of the log with the index `place`. If this opens a locked test flight, the opening is recorded.
    pub fn give_role(&mut self, place: usize, role: Role) -> Result<(), WorkbenchError> {
        let log = self.session.logs.get(place).ok_or(WorkbenchError::NoFlight(place))?;
        if role != Role::Test && self.locked(log) && self.flights[place].is_ok() {
            let opening = Opening {
                unix_s: now_s(),
                occasion: Occasion::OtherRole,
                effects: Vec::new(),
                flights: vec![log.name()],
                sha256: vec![log.sha256.clone()],
                given: f64::NAN,
                amended: f64::NAN,
                horizon_s: f64::NAN,
            };
            self.session.openings.push(opening);
        }
        self.session.logs[place].role = role;
        Ok(())
    }

    /// Whether `log` is a locked test flight: one that the user has not opened yet.
    pub fn locked(&self, log: &LogEntry) -> bool {
        // sessions of older versions have no hashes and identify flights by name
        let opened = self.session.openings.iter().any(|o| match o.sha256.is_empty() {
            true => o.flights.contains(&log.name()),
            false => o.sha256.contains(&log.sha256),
        });
        log.role == Role::Test && !opened
    }

    /// Path of the log with the index `place`.
    pub fn file(&self, place: usize) -> PathBuf {
        self.folder.join(&self.session.logs[place].path)
    }

    /// Names of the flights of the logs `places`, as in the output of a command that reads these logs.
    pub fn names(&self, places: &[usize]) -> Vec<String> {
        names(&places.iter().map(|k| self.file(*k)).collect::<Vec<_>>())
    }

    /// Indices of the usable logs that have one of `roles`, in ascending order.
    pub fn usable(&self, roles: &[Role]) -> Vec<usize> {
        let logs = self.session.logs.iter().zip(&self.flights).enumerate();
        let usable = logs.filter(|(_, (log, flight))| roles.contains(&log.role) && flight.is_ok());
        usable.map(|(k, _)| k).collect()
    }

    /// Indices of the flights with which the models are compared.
    pub fn seen(&self) -> Vec<usize> {
        self.usable(&[Role::Fit, Role::HoldOut])
    }

    /// The usable flights at the indices `places`, with the deflections at their recorded times.
    pub fn reconstructions(&self, places: &[usize]) -> Vec<Reconstruction> {
        self.flights_on(ActuatorClock::AsRecorded, places)
    }

    /// The usable flights at the indices `places`, with the deflections on the time base `clock`.
    pub fn flights_on(&self, clock: ActuatorClock, places: &[usize]) -> Vec<Reconstruction> {
        let of = |(k, name): (&usize, String)| {
            let flight = self.flights[*k].as_ref().ok()?.on(clock).0.clone();
            Some(Reconstruction { name, ..flight })
        };
        places.iter().zip(self.names(places)).filter_map(of).collect()
    }

    /// The flights with the role Fit, each in its full length.
    pub fn to_fit(&self) -> Result<Vec<Reconstruction>, WorkbenchError> {
        match self.usable(&[Role::Fit])[..] {
            [] => Err(WorkbenchError::NoRole(Role::Fit)),
            ref places => Ok(self.reconstructions(places)),
        }
    }

    /// Time base of the deflections with which models are compared. It is that of the gyros, unless an effect between recorded and
    /// acting deflections (a lag, a delay) is accepted or asserted: it, not the log's clock, then explains why they come late.
    pub fn clock(&self) -> ActuatorClock {
        let accepted = self.session.effects.iter().map(|e| e.id.as_str());
        ActuatorClock::beside(accepted.chain(self.asserted()))
    }

    /// Ids of the effects that the diagnosis of the present flights asserts, in the order of their selection.
    pub fn asserted(&self) -> impl Iterator<Item = &str> {
        let key = self.key(Work::Diagnosis.word(), &[]);
        let known = self.diagnosis.as_ref().filter(|(of, _)| *of == key);
        let found = known.and_then(|(_, diagnosis)| diagnosis["effects"].as_array());
        let asserted = found.into_iter().flatten().filter(|e| e["asserted"] == true);
        asserted.filter_map(|e| e["id"].as_str())
    }

    /// Divides the flights into flights for a fit and flights for its validation, as `greylag amend` does.
    pub fn divided(&self) -> Result<Divided, WorkbenchError> {
        let fit = self.to_fit()?;
        let held = self.usable(&[Role::HoldOut]);
        let mut notes = self.findings(&self.usable(&[Role::Fit]));
        notes.extend(self.said_of_installation());
        match (&fit[..], &held[..]) {
            ([only], []) => {
                let name = &only.name;
                notes.push(format!("{name}: fitted to its first two thirds, judged by the last"));
                let [first, last] = split(only);
                Ok(Divided { fit: vec![first], held_out: vec![last], notes })
            }
            (_, []) => Err(WorkbenchError::NoRole(Role::HoldOut)),
            (_, held) => {
                notes.extend(self.findings(held));
                Ok(Divided { held_out: self.reconstructions(held), fit, notes })
            }
        }
    }

    /// Defects and peculiarities of the logs with the indices `places`, as a command prints them.
    fn findings(&self, places: &[usize]) -> Vec<String> {
        let of = |(k, name): (&usize, String)| {
            let all = self.flights[*k].iter().flat_map(|flight| flight.findings.clone());
            all.map(|finding| format!("{name}: {finding}")).collect::<Vec<_>>()
        };
        places.iter().zip(self.names(places)).flat_map(of).collect()
    }
}

/// Present time, s since 1970 (UTC).
pub fn now_s() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |t| t.as_secs())
}
