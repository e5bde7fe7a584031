//! A file in a recording's folder that states the model and the controller of the flight. With it, `greylag replay` and
//! `greylag report` need no options for them.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::commands::files::{self, Overwrite, shipped};
use crate::commands::fly::{CommandName, ProfileName};
use crate::control::ControllerKind;
use crate::control::cem::Change;
use crate::model::GreyBox;

/// Name of the file in a recording's folder.
pub const FILE: &str = "flown-with.toml";
/// Version of the file's format.
const SCHEMA: u32 = 1;

/// Controller, model and link of a flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlownWith {
    schema: u32,
    /// Name and version of the program.
    program: String,
    /// Command line of the flight.
    command: String,
    /// Name of the controller.
    pub controller: String,
    /// Path of the model file.
    pub model: PathBuf,
    /// SHA-256 of the model's files.
    model_sha256: String,
    /// Folder of the trained policy, a neural network. It is recorded even if the controller uses none.
    pub policy: PathBuf,
    /// Settings, as KEY=VALUE, that the user changed in the planner: a controller that searches for commands with the model.
    #[serde(default)]
    planner: Vec<String>,
    /// Airframe file that replaced the one named by the model file; `None` if none did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub airframe: Option<PathBuf>,
    /// Path of the flight-test schedule.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schedule: Option<PathBuf>,
    /// Kind of autopilot at the other end of the link: the simulator's, PX4 or ArduPilot.
    pub profile: ProfileName,
    /// Quantity that was commanded to a real flight controller: surfaces or attitude.
    pub commanded: CommandName,
}

/// Options of `fly` or `demo` that are stored with the recording.
#[derive(Clone, Copy, Debug)]
pub struct Chosen<'a> {
    /// Kind of controller that flies.
    pub controller: ControllerKind,
    /// Path of the model file.
    pub model: &'a Path,
    /// Folder of the trained policy.
    pub policy: &'a Path,
    /// Settings that the user changed in the planner.
    pub changes: &'a [Change],
    /// Airframe file that replaces the one named by the model file; `None` if none does.
    pub airframe: Option<&'a Path>,
    /// Path of the flight-test schedule.
    pub schedule: Option<&'a Path>,
    /// Kind of autopilot at the other end of the link.
    pub profile: ProfileName,
    /// Quantity that is commanded to a real flight controller.
    pub commanded: CommandName,
}

/// The absolute form of `path`, which is valid in any working directory. A path that does not exist stays as it is, such as the
/// path of a file that only the program's own copy of `params/` contains.
fn lasting(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

impl FlownWith {
    /// Writes the file into the recording's folder `folder`. `model` is the model in the file `chosen.model`.
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

    /// Reads the file from the recording's folder `folder`. Returns `None` if there is no such file, as in recordings from
    /// before November 2026.
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

    /// The settings that the user changed in the planner.
    ///
    /// # Errors
    /// If a setting cannot be parsed.
    pub fn changes(&self) -> Result<Vec<Change>> {
        Ok(self.planner.iter().map(|text| text.parse()).collect::<Result<_, _>>()?)
    }

    /// The controller that flew.
    ///
    /// # Errors
    /// If this program has no controller of that name.
    pub fn kind(&self) -> Result<ControllerKind> {
        Ok(self.controller.parse()?)
    }

    /// A note for the user if `model` has other files than the model that flew; `None` if the files are the same.
    pub fn changed_model(&self, model: &GreyBox) -> Option<String> {
        (model.sha256 != self.model_sha256).then(|| {
            format!(
                "note: the files of {} have changed since the flight; what follows is of the model as it is now",
                shipped(&self.model).display()
            )
        })
    }
}
