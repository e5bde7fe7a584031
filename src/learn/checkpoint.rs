//! Checkpoints of the training of a grey-box model, in a file that is replaced atomically.
//!
//! The model has physical effects with coefficients (the prior) and a network (the residual).

use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use crate::adam::Adam;

/// State of a model training.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// Hash of the training's settings, prior and data.
    pub identity: String,
    /// Parameters of the network.
    pub network: Vec<f32>,
    /// Coordinates of the trained coefficients of the prior: a linear transformation of their changes (`dynamics::basis`).
    pub coordinates: Vec<f64>,
    /// State of the optimiser.
    pub adam: Adam,
    /// λ of eq. (24) of \[GSFM26\] (T. Guerin et al., 2026, see `src/lib.rs`): the penalty on the residual is divided by it.
    pub lambda: f64,
    /// Number of updates made.
    pub update: u64,
}

/// A checkpoint cannot be used or written.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("cannot {doing} {path}: {why}; check that its folder exists, can be written to and has room", path = path.display())]
    File {
        /// The operation that failed.
        doing: &'static str,
        /// Path of the file.
        path: PathBuf,
        /// The operating system's error.
        why: std::io::Error,
    },
    /// The file is not a checkpoint.
    #[error("{path} is no checkpoint of this program: {why}; remove it to begin anew", path = path.display())]
    Content {
        /// Path of the file.
        path: PathBuf,
        /// Description of the invalid content.
        why: String,
    },
    /// The checkpoint belongs to another training.
    #[error(
        "the checkpoint is of a training with other options, another prior or other flights; give the same ones, or another --out"
    )]
    Other,
}

/// The scalars of a checkpoint. The file stores them as one metadata entry.
#[derive(Serialize, Deserialize)]
struct Header {
    schema: String,
    identity: String,
    /// Bits of λ, stored without rounding.
    lambda_bits: u64,
    update: u64,
    adam_steps: u64,
}

const SCHEMA: &str = "greylag.checkpoint/1";
const METADATA: &str = "greylag";

impl Checkpoint {
    /// Checks that the checkpoint belongs to the training `identity` with `parameters` parameters, of which `coordinates` are
    /// coordinates of the prior.
    ///
    /// # Errors
    ///
    /// If the checkpoint belongs to another training.
    pub fn fits(
        &self,
        identity: &str,
        parameters: usize,
        coordinates: usize,
    ) -> Result<(), CheckpointError> {
        let fits = self.identity == identity
            && self.coordinates.len() == coordinates
            && self.network.len() + coordinates == parameters
            && self.adam.mean.len() == parameters
            && self.adam.square.len() == parameters;
        if fits { Ok(()) } else { Err(CheckpointError::Other) }
    }

    /// Writes the file `path` atomically. A reader sees either the old version or the new one.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let bytes =
            self.to_bytes().map_err(|why| CheckpointError::Content { path: path.into(), why })?;
        write_whole(path, &bytes).map_err(|why| CheckpointError::File {
            doing: "write",
            path: path.into(),
            why,
        })
    }

    /// Reads a checkpoint from the file `path`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read or is not a checkpoint.
    pub fn load(path: &Path) -> Result<Checkpoint, CheckpointError> {
        let bytes = std::fs::read(path).map_err(|why| CheckpointError::File {
            doing: "read",
            path: path.into(),
            why,
        })?;
        from_bytes(&bytes).map_err(|why| CheckpointError::Content { path: path.into(), why })
    }

    fn to_bytes(&self) -> Result<Vec<u8>, String> {
        let double = |list: &[f64]| list.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
        let single: Vec<u8> = self.network.iter().flat_map(|x| x.to_le_bytes()).collect();
        let parts = [
            ("network", Dtype::F32, self.network.len(), single),
            ("coordinates", Dtype::F64, self.coordinates.len(), double(&self.coordinates)),
            ("adam.mean", Dtype::F64, self.adam.mean.len(), double(&self.adam.mean)),
            ("adam.square", Dtype::F64, self.adam.square.len(), double(&self.adam.square)),
        ];
        let views = parts
            .iter()
            .map(|(name, kind, count, bytes)| {
                TensorView::new(*kind, vec![*count], bytes).map(|view| (*name, view))
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(|e| e.to_string())?;
        let header = Header {
            schema: SCHEMA.into(),
            identity: self.identity.clone(),
            lambda_bits: self.lambda.to_bits(),
            update: self.update,
            adam_steps: self.adam.steps,
        };
        let header = serde_json::to_string(&header).map_err(|e| e.to_string())?;
        let metadata = HashMap::from([(METADATA.to_owned(), header)]);
        safetensors::serialize(views, Some(metadata)).map_err(|e| e.to_string())
    }
}

fn from_bytes(bytes: &[u8]) -> Result<Checkpoint, String> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| e.to_string())?;
    let header = metadata.metadata().as_ref().and_then(|m| m.get(METADATA));
    let header: Header = serde_json::from_str(header.ok_or("it has no metadata of ours")?)
        .map_err(|e| e.to_string())?;
    if header.schema != SCHEMA {
        return Err(format!("its schema is {:?}, this program reads {SCHEMA}", header.schema));
    }
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| e.to_string())?;
    let part = |name: &str, kind: Dtype| match tensors.tensor(name) {
        Ok(t) if t.dtype() == kind => Ok(t.data().to_vec()),
        _ => Err(format!("it has no {name} of {kind:?}")),
    };
    let double = |name: &str| -> Result<Vec<f64>, String> {
        let bytes = part(name, Dtype::F64)?;
        Ok(bytes
            .chunks_exact(8)
            .filter_map(|b| Some(f64::from_le_bytes(b.try_into().ok()?)))
            .collect())
    };
    let network = part("network", Dtype::F32)?;
    Ok(Checkpoint {
        identity: header.identity,
        network: network
            .chunks_exact(4)
            .filter_map(|b| Some(f32::from_le_bytes(b.try_into().ok()?)))
            .collect(),
        coordinates: double("coordinates")?,
        adam: Adam {
            mean: double("adam.mean")?,
            square: double("adam.square")?,
            steps: header.adam_steps,
        },
        lambda: f64::from_bits(header.lambda_bits),
        update: header.update,
    })
}

/// Writes a temporary file in the same folder, then renames it to `path`.
pub fn write_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".greylag-").suffix(".part");
    // A temporary file is readable only by its owner by default. A model file must have the permissions that the umask allows.
    #[cfg(unix)]
    let everyone: std::fs::Permissions = std::os::unix::fs::PermissionsExt::from_mode(0o666);
    #[cfg(unix)]
    builder.permissions(everyone);
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}
