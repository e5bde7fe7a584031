//! Model and controller of a recorded flight. They are stored in the recording's folder, so that `replay` and `report`
//! need no options for them.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::commands::files::{self, Overwrite, shipped};
use crate::commands::fly::{CommandName, ProfileName};
use crate::control::ControllerKind;
use crate::control::cem::Change;
use crate::model::GreyBox;

/// File name in a recording.
pub const FILE: &str = "flown-with.toml";
/// Schema of the file.
const SCHEMA: u32 = 1;

/// Controller, model and link of a flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlownWith {
    schema: u32,
    /// The program with its version.
    program: String,
    /// Command line of the flight.
    command: String,
    /// Name of the controller.
    pub controller: String,
    /// Path of the model file.
    pub model: PathBuf,
    /// SHA-256 of the model's files.
    model_sha256: String,
    /// The folder of the policy.
    pub policy: PathBuf,
    /// Settings of the planner, as KEY=VALUE.
    #[serde(default)]
    planner: Vec<String>,
    /// Airframe file in place of the model's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub airframe: Option<PathBuf>,
    /// Path of the flight-test schedule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schedule: Option<PathBuf>,
    /// Profile of the vehicle's link.
    pub profile: ProfileName,
    /// Quantity that was commanded to the flight controller.
    pub commanded: CommandName,
}

/// Options of `fly` or `demo` that are stored with the recording.
#[derive(Clone, Copy, Debug)]
pub struct Chosen<'a> {
    /// Controller that flies.
    pub controller: ControllerKind,
    /// Path of the model file.
    pub model: &'a Path,
    /// The folder of the policy.
    pub policy: &'a Path,
    /// Settings of the planner.
    pub changes: &'a [Change],
    /// Airframe file in place of the model's.
    pub airframe: Option<&'a Path>,
    /// Path of the flight-test schedule.
    pub schedule: Option<&'a Path>,
    /// The other end of the vehicle's link.
    pub profile: ProfileName,
    /// Quantity that is commanded to the flight controller.
    pub commanded: CommandName,
}

/// A path that is valid in any working directory. A path of a shipped file stays as it is.
fn lasting(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

impl FlownWith {
    /// Writes controller, model and link of the flight into the recording `folder`.
    pub fn write(folder: &Path, chosen: &Chosen<'_>, model: &GreyBox) -> Result<()> {
        let said = FlownWith {
            schema: SCHEMA,
            program: concat!("greylag ", env!("CARGO_PKG_VERSION")).into(),
            command: files::command_line(),
            controller: chosen.controller.name().into(),
            model: lasting(chosen.model),
            model_sha256: model.sha256.clone(),
            policy: lasting(chosen.policy),
            planner: chosen.changes.iter().map(Change::to_string).collect(),
            airframe: chosen.airframe.map(lasting),
            schedule: chosen.schedule.map(lasting),
            profile: chosen.profile,
            commanded: chosen.commanded,
        };
        let text = "# What flew this flight; `greylag replay` and `greylag report` read it.\n"
            .to_owned()
            + &toml::to_string(&said)?;
        files::write(&folder.join(FILE), &text, Overwrite::New)
    }

    /// Reads the file from a recording; `None` if the recording has no such file. Recordings from before November 2026
    /// have none.
    ///
    /// # Errors
    /// If the file cannot be read, is invalid or has another schema.
    pub fn read(folder: &Path) -> Result<Option<FlownWith>> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Ok(None);
        }
        let context =
            || format!("cannot use {}; name the flight's options instead", path.display());
        let text = crate::physics::text_file::read(&path).with_context(context)?;
        let said: FlownWith = toml::from_str(&text).with_context(context)?;
        if said.schema != SCHEMA {
            bail!("{} has schema {}, this program reads {SCHEMA}", path.display(), said.schema);
        }
        Ok(Some(said))
    }

    /// The settings of the planner.
    ///
    /// # Errors
    /// If a setting cannot be parsed.
    pub fn changes(&self) -> Result<Vec<Change>> {
        Ok(self.planner.iter().map(|text| text.parse()).collect::<Result<_, _>>()?)
    }

    /// The controller.
    ///
    /// # Errors
    /// If this program has no controller of that name.
    pub fn kind(&self) -> Result<ControllerKind> {
        Ok(self.controller.parse()?)
    }

    /// Note if the model's files have changed since the flight.
    pub fn changed_model(&self, model: &GreyBox) -> Option<String> {
        (model.sha256 != self.model_sha256).then(|| {
            format!(
                "note: the files of {} have changed since the flight; what follows is of the model as it is now",
                shipped(&self.model).display()
            )
        })
    }
}
