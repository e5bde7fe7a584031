//! Orders of the workbench's user for simulated flights, and the commands that execute them. A schedule is a sequence of
//! attitudes and excitations to be flown.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use super::super::bench::Inner;
use super::super::error::WorkbenchError;
use greylag_control::ControllerKind;
use greylag_logs::quoted;
use greylag_manoeuvres::menu::{self, MENU};

/// Name in an order for the default schedule of `greylag demo`.
pub const ATTITUDES: &str = "attitudes";
/// Name of the subfolder for schedules in the session's folder.
pub const SCHEDULES: &str = "schedules";
/// Names of the aircraft that the simulator contains.
pub const AIRCRAFT: [&str; 4] = ["x8", "aerosonde", "x8-elevons", "c172p"];

/// Order for a simulated flight.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// Name of the schedule: `attitudes`, a standard manoeuvre, or a schedule that was designed in this session.
    pub schedule: String,
    /// Name of the controller. It is designed from the session's model.
    pub controller: String,
    /// Name of the simulated aircraft, one of those that the page offers.
    pub aircraft: String,
    /// Effects that are added to the simulated aircraft and that the model lacks. Each is written as ID=AMPLITUDE; spaces
    /// separate them.
    #[serde(default)]
    pub hide: String,
    /// Turbulence severity, 1 to 7 (3 light, 4 moderate, 6 severe); `None` for calm air.
    #[serde(default)]
    pub turbulence: Option<u8>,
    /// Seed of all random numbers.
    pub seed: u32,
}

/// A schedule that the user can select.
#[derive(Clone, Debug, Serialize)]
pub struct Choice {
    /// Name of the schedule in an [`Order`].
    pub id: String,
    /// Purpose of the schedule.
    pub description: String,
}

impl Inner {
    /// The available schedules: the default of `greylag demo`, those of this session, and the standard manoeuvres.
    pub fn schedules(&self) -> Vec<Choice> {
        let attitudes = Choice {
            id: ATTITUDES.into(),
            description: "Six attitudes of 8 s each, easy ones first, as greylag demo flies them."
                .into(),
        };
        let of_menu =
            MENU.iter().map(|m| Choice { id: m.name.into(), description: m.description.into() });
        let own = self.designed.iter().map(|d| Choice {
            id: d.name.clone(),
            description: format!(
                "{} {} times: distinguishes {}.",
                d.manoeuvre,
                d.times,
                d.between.join(" and ")
            ),
        });
        std::iter::once(attitudes).chain(own).chain(of_menu).collect()
    }

    /// Path of the model for a flight. It is the amended model if the fit with the accepted effects is complete and has added an
    /// effect, otherwise the session's given model.
    pub fn flying_model(&self) -> PathBuf {
        let key = self.key("fit", &self.session.effects);
        let fitted = self.fits.get(&key).filter(|f| !f.all_refused());
        match fitted {
            Some(_) => {
                self.folder.join("fits").join(key).join(greylag_sysid::amend::document::MODEL)
            }
            None => self.session.model.clone(),
        }
    }
}

/// Names of the controllers that need no trained policy (neural network).
pub fn controllers() -> impl Iterator<Item = &'static str> {
    let alone = ControllerKind::ALL.iter().filter(|k| !k.needs().policy());
    alone.map(|k| k.name())
}

impl Order {
    /// Arguments of the command that executes the order with the model file `model` and records to `record`. If the schedule is a
    /// manoeuvre of the list, its file is first written below the session's folder `folder`, for the cruise airspeed
    /// `cruise_mps`.
    ///
    /// # Errors
    /// `WorkbenchError::Order` if an option is unknown, and an error if the schedule cannot be written.
    pub fn words(
        &self,
        folder: &Path,
        model: &Path,
        cruise_mps: f64,
        record: &Path,
    ) -> Result<Vec<String>, WorkbenchError> {
        ControllerKind::from_str(&self.controller)
            .map_err(|e| WorkbenchError::Order(format!("{e}")))?;
        if !AIRCRAFT.contains(&self.aircraft.as_str()) {
            return Err(WorkbenchError::Order(format!("there is no aircraft {:?}", self.aircraft)));
        }
        let text = |path: &Path| path.display().to_string();
        let mut words: Vec<String> = ["demo", "--model"].map(str::to_owned).into();
        words.extend([text(model), "--controller".into(), self.controller.clone()]);
        if let Some(file) = self.schedule(folder, cruise_mps)? {
            words.extend(["--schedule".into(), text(&file)]);
        }
        words.extend(["--aircraft".into(), self.aircraft.clone()]);
        for hidden in self.hide.split_whitespace() {
            let plain = |c: char| c.is_ascii_alphanumeric() || "_=.,+-".contains(c);
            if !hidden.contains('=') || !hidden.chars().all(plain) {
                let why = format!(
                    "{hidden:?} is no hidden effect; write ID=AMPLITUDE, such as drag_beta2=1.0"
                );
                return Err(WorkbenchError::Order(why));
            }
            words.push(format!("--hide={hidden}"));
        }
        if let Some(severity) = self.turbulence {
            words.extend(["--turbulence-severity".into(), severity.to_string()]);
        }
        words.extend(["--seed".into(), self.seed.to_string(), "--out".into(), text(record)]);
        Ok(words)
    }

    /// Path of the schedule's file; `None` for the default schedule of `greylag demo`. The file of a standard manoeuvre is
    /// written.
    fn schedule(&self, folder: &Path, cruise_mps: f64) -> Result<Option<PathBuf>, WorkbenchError> {
        if self.schedule == ATTITUDES {
            return Ok(None);
        }
        let unknown = || WorkbenchError::Order(format!("there is no schedule {:?}", self.schedule));
        let plain = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
        if !self.schedule.chars().all(plain) {
            return Err(unknown());
        }
        let file = folder.join(SCHEDULES).join(format!("{}.toml", self.schedule));
        if let Some(manoeuvre) = menu::named(&self.schedule) {
            let place = file.parent().unwrap_or(folder);
            std::fs::create_dir_all(place).map_err(|e| super::super::error::io(place, e))?;
            let schedule = manoeuvre.schedule().at_cruise(cruise_mps);
            greylag_report::write_over(&file, schedule.to_toml())?;
        }
        if file.exists() { Ok(Some(file)) } else { Err(unknown()) }
    }
}

/// The command `greylag` with the arguments `words`, quoted for a shell.
pub fn line(words: &[String]) -> String {
    words.iter().fold("greylag".into(), |line, word| line + " " + &quoted(Path::new(word)))
}
