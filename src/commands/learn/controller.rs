//! The folder of the learned controller: model and policy together, with a record of their origin.

use std::path::Path;

use anyhow::{Context, Result};
use serde::Serialize;

use super::imagined::Reached;
use super::plan::{MODEL, POLICY, Stage};
use crate::learn::write_whole;
use crate::model::GreyBox;
use crate::model::residual::hash;
use crate::sysid::amend::document::effect_file;

/// Name of the controller's folder inside the output folder of `greylag learn`.
pub const CONTROLLER: &str = "controller";
/// File name of the record of origin.
pub const ORIGIN: &str = "learned.toml";

/// The controller's files: subfolder of the output folder, and file name.
const FILES: [(&str, &str); 6] = [
    (MODEL, "airframe.toml"),
    (MODEL, "residual.safetensors"),
    (POLICY, "critic1.safetensors"),
    (POLICY, "critic2.safetensors"),
    (POLICY, "actor.safetensors"),
    (MODEL, "model.toml"),
];

/// Record of the origin of a controller.
#[derive(Serialize)]
struct Origin<'a> {
    schema: u32,
    program: &'static str,
    command: &'a str,
    prior: &'a str,
    prior_sha256: &'a str,
    model: &'a str,
    stages: Vec<String>,
    files: Vec<Content>,
    /// Scores of flights in the learned model instead of JSBSim.
    imagined: &'a [Reached],
}

#[derive(Serialize)]
struct Content {
    name: String,
    sha256: String,
}

/// Copies model and policy from the output folder `out` into its subfolder `controller`, and writes the record of origin.
/// The model file is copied after all other files: where it exists, they exist.
///
/// # Errors
/// If a file cannot be read or written.
pub fn assemble(
    out: &Path,
    command: &str,
    prior: &GreyBox,
    stages: &[Stage],
    imagined: &[Reached],
) -> Result<()> {
    let folder = out.join(CONTROLLER);
    std::fs::create_dir_all(folder.join(POLICY))
        .with_context(|| format!("cannot make {}", folder.display()))?;
    let mut files = Vec::new();
    let effects: Vec<String> = prior.written().map(effect_file).collect();
    let effects = effects.iter().map(|name| (MODEL, name.as_str()));
    for (from, name) in effects.chain(FILES) {
        let source = out.join(from).join(name);
        let bytes =
            std::fs::read(&source).with_context(|| format!("cannot read {}", source.display()))?;
        let name = if from == POLICY { format!("{POLICY}/{name}") } else { name.to_owned() };
        write(&folder.join(&name), &bytes)?;
        files.push(Content { name, sha256: hash(&bytes) });
    }
    let model = GreyBox::load(&folder.join("model.toml"))?;
    let origin = Origin {
        schema: 1,
        program: concat!("greylag ", env!("CARGO_PKG_VERSION")),
        command,
        prior: &prior.name,
        prior_sha256: &prior.sha256,
        model: &model.description,
        stages: stages.iter().map(Stage::command).collect(),
        files,
        imagined,
    };
    let text = "# Origin of the files in this folder. Written by `greylag learn`.\n".to_owned()
        + &toml::to_string(&origin)?;
    write(&folder.join(ORIGIN), text.as_bytes())
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    write_whole(path, bytes).with_context(|| format!("cannot write {}", path.display()))
}
