//! Controllers built from the files that a command names.

use std::path::Path;

use anyhow::bail;

use crate::commands::files::shipped;
use crate::control::cem::Change;
use crate::control::policy::{Agent, AgentError, Origin};
use crate::control::{Controller, ControllerKind, Needs, Source, build};
use crate::model::GreyBox;

/// Folder of the default policy (a trained neural network), which was trained in the default model.
pub const POLICY: &str = "params/x8/learned/policy";

/// Builds the controller `kind` for `model`, with the policy in `folder` (see [`policy`]). `changes` modify the settings of
/// the planner, a controller that searches for a sequence of actions in simulations of the model.
///
/// # Errors
/// If the policy cannot be read or belongs to another airframe, or the model does not allow the controller.
pub fn controller(
    kind: ControllerKind,
    model: &GreyBox,
    folder: &Path,
    changes: &[Change],
) -> anyhow::Result<Box<dyn Controller>> {
    let agent = policy(kind, model, folder)?;
    Ok(build(kind, Source { model, agent: agent.as_ref(), changes })?)
}

/// Reads the policy in `folder` for the controller `kind` of `model`. Notes on the policy are printed on standard error.
///
/// The result is `None` if the controller uses no policy. It is also `None` if three conditions hold: the controller can
/// work without a policy, `folder` is the default folder, and its policy belongs to another airframe than the model's.
///
/// # Errors
/// If the policy cannot be read or belongs to another airframe.
pub fn policy(
    kind: ControllerKind,
    model: &GreyBox,
    folder: &Path,
) -> anyhow::Result<Option<Agent>> {
    if matches!(kind.needs(), Needs::Gains | Needs::Model) {
        return Ok(None);
    }
    let agent = match Agent::load(&shipped(folder), &model.airframe) {
        Err(AgentError::Airframe { airframe, .. })
            if !kind.needs().policy() && folder == Path::new(POLICY) =>
        {
            eprintln!(
                "note: there is no policy for airframe {airframe}; {kind} searches around the LQI's plan alone: \
                 train one with `greylag train policy --env model:FILE` and name its folder with --policy"
            );
            return Ok(None);
        }
        agent => agent?,
    };
    if let Some(note) = foreign_policy_note(&agent.origin, model, folder) {
        eprintln!("{note}");
    }
    Ok(Some(agent))
}

/// A note for the user if the policy in `folder` was not trained in `model`. `origin` states in which model it was trained.
fn foreign_policy_note(origin: &Origin, model: &GreyBox, folder: &Path) -> Option<String> {
    (origin.model_sha256 != model.sha256).then(|| {
        format!(
            "note: policy {} was trained in {}, not in model {} as its files are now; its proposals and \
             values are those of another model: train one with `greylag train policy --env model:FILE`, or name \
             the model it belongs to",
            folder.display(),
            origin.model,
            model.name
        )
    })
}

/// Refuses planner settings if none of `kinds` is a planner.
///
/// # Errors
/// If there are `changes` but no planner.
pub fn check_changes(kinds: &[ControllerKind], changes: &[Change]) -> anyhow::Result<()> {
    if changes.is_empty() || kinds.iter().any(|kind| kind.searches()) {
        return Ok(());
    }
    let searching: Vec<&str> =
        ControllerKind::ALL.iter().filter(|k| k.searches()).map(|k| k.name()).collect();
    bail!(
        "--planner changes the settings of a search, and none of the controllers has one; choose one of {} \
         or leave --planner out",
        searching.join(", ")
    )
}
