//! Reads a diagnosis that an earlier `greylag diagnose --json` wrote.

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::sysid::amend::Added;

/// The fields that this module reads from the file.
#[derive(Deserialize)]
struct Written {
    schema: String,
    model: String,
    effects: Vec<Effect>,
}

#[derive(Deserialize)]
struct Effect {
    id: String,
    asserted: bool,
    parameters: Vec<Parameter>,
}

#[derive(Deserialize)]
struct Parameter {
    name: String,
    value: Option<f64>,
}

/// The effects (physical contributions to forces and moments) that the diagnosis in `path` asserts to be missing in the model
/// named `model`. The diagnosed coefficients are the starting values of their fit.
pub fn asserted(path: &Path, model: &str) -> Result<Vec<Added>> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the diagnosis {}", path.display()))?;
    let written: Written = serde_json::from_str(&text).with_context(|| {
        format!("{} is not a diagnosis; write one with `greylag diagnose --json`", path.display())
    })?;
    if written.schema != "greylag.diagnosis/1" || written.model != model {
        bail!(
            "{} is a diagnosis ({}) of the model {}, not of {model}; diagnose this model",
            path.display(),
            written.schema,
            written.model
        );
    }
    Ok(written.effects.iter().filter(|e| e.asserted).map(added).collect())
}

fn added(effect: &Effect) -> Added {
    Added::near(&effect.id, |name| effect.parameters.iter().find(|p| p.name == name)?.value)
}
