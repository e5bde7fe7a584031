//! Writes policies that were trained elsewhere to folders that greylag can fly, and evaluates the policy of a folder.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use greylag::control::policy::{ACTIONS, Actor, Agent, Critic, OBSERVATIONS, Origin};
use greylag::model::block::Block;
use greylag::model::residual::fingerprint;
use greylag::num::dense::Units;
use greylag::num::{Dense, ROW, Real};
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

use crate::batch::{gather, scatter};
use crate::error::raised;
use crate::model::Model;

/// The layers of a network: weights with the shape (outputs, inputs), as in PyTorch, and biases.
type Layers<'py> = Vec<(PyReadonlyArray2<'py, f32>, PyReadonlyArray1<'py, f32>)>;

/// A policy read from its folder.
#[pyclass(frozen, module = "greylag._greylag")]
pub struct Policy {
    agent: Agent,
}

#[pymethods]
impl Policy {
    /// Reads the policy in `folder` for the airframe of `model`.
    #[staticmethod]
    fn load(folder: PathBuf, model: &Model) -> PyResult<Policy> {
        let agent = Agent::load(&folder, &model.model.airframe).map_err(raised)?;
        Ok(Policy { agent })
    }

    #[getter]
    fn origin(&self) -> PyResult<String> {
        serde_json::to_string(&self.agent.origin).map_err(raised)
    }

    #[getter]
    fn has_critics(&self) -> bool {
        self.agent.critics.is_some()
    }

    #[getter]
    fn sizes(&self) -> Vec<usize> {
        self.agent.actor.network().sizes().to_vec()
    }

    /// The actions, (n, 3), for (n, 16) observations.
    fn act<'py>(
        &self,
        py: Python<'py>,
        observations: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let [rows, columns] = [observations.shape()[0], observations.shape()[1]];
        if columns != OBSERVATIONS {
            let said = format!("observations have {columns} columns, not {OBSERVATIONS}");
            return Err(PyValueError::new_err(said));
        }
        let seen = observations.as_slice()?;
        let mut actions = vec![0.0; rows * ACTIONS];
        let mut units = Units::new(Block::zero());
        for first in (0..rows).step_by(ROW) {
            let block = gather::<OBSERVATIONS>(seen, first);
            scatter(&self.agent.actor.act_block(&mut units, &block), &mut actions, first);
        }
        actions.into_pyarray(py).reshape([rows, ACTIONS])
    }
}

/// Writes the folder of a policy and replaces an existing policy.
#[pyfunction]
#[pyo3(signature = (folder, model, actor, critics, trained_in, seed, steps))]
pub fn export_policy(
    folder: PathBuf,
    model: &Model,
    actor: Layers<'_>,
    critics: Option<[Layers<'_>; 2]>,
    trained_in: Option<&str>,
    seed: u64,
    steps: u64,
) -> PyResult<()> {
    let critics = match critics {
        None => None,
        Some([one, two]) => Some(Arc::new([critic(&one)?, critic(&two)?])),
    };
    let origin = Origin {
        schema: Origin::SCHEMA.into(),
        airframe: fingerprint(&model.model.airframe),
        model: trained_in.unwrap_or("jsbsim").into(),
        model_sha256: trained_in.map_or(String::new(), |_| model.model.sha256.clone()),
        seed,
        steps,
        evaluation: None,
        program: concat!("greylag ", env!("CARGO_PKG_VERSION"), " from Python").into(),
    };
    let actor = Arc::new(Actor::new(dense(&actor)?).map_err(raised)?);
    let agent = Agent { actor, critics, origin };
    write(&folder, &agent.to_files().map_err(raised)?)
}

fn critic(layers: &Layers<'_>) -> PyResult<Critic> {
    Critic::new(dense(layers)?).map_err(raised)
}

/// The network with these layers.
fn dense(layers: &Layers<'_>) -> PyResult<Dense> {
    let mut sizes: Vec<usize> = layers.first().map(|(w, _)| w.shape()[1]).into_iter().collect();
    let mut parameters = Vec::new();
    for (k, (weights, bias)) in layers.iter().enumerate() {
        let (weights, bias) = (weights.as_array(), bias.as_array());
        let shape = [weights.nrows(), weights.ncols()];
        if sizes.last() != Some(&shape[1]) || bias.len() != shape[0] {
            return Err(PyValueError::new_err(format!(
                "layer {k} has weights {shape:?} and {} biases, after {} units; weights are (out, in)",
                bias.len(),
                sizes.last().unwrap_or(&0)
            )));
        }
        sizes.push(shape[0]);
        parameters.extend(weights.t().iter());
        parameters.extend(bias.iter());
    }
    Dense::new(&sizes, parameters).map_err(raised)
}

/// Writes the files of a policy. The networks of an older policy are removed first, and the actor is written last. A
/// folder with an actor is therefore complete. Each file is renamed into place after it has been written.
fn write(folder: &Path, files: &[(&str, Vec<u8>)]) -> PyResult<()> {
    let said = |what: &Path, e: std::io::Error| {
        PyOSError::new_err(format!("cannot write the policy {}: {e}", what.display()))
    };
    std::fs::create_dir_all(folder).map_err(|e| said(folder, e))?;
    for name in ["actor", "critic1", "critic2"] {
        let old = folder.join(format!("{name}.safetensors"));
        if old.exists() {
            std::fs::remove_file(&old).map_err(|e| said(&old, e))?;
        }
    }
    for (name, bytes) in files {
        let (path, part) = (folder.join(name), folder.join(format!("{name}.part")));
        std::fs::write(&part, bytes).map_err(|e| said(&part, e))?;
        std::fs::rename(&part, &path).map_err(|e| said(&path, e))?;
    }
    Ok(())
}
