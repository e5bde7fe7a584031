//! The checkpoint of a policy training with TD3 (twin delayed policy gradient), in a file that is replaced atomically.

use std::collections::HashMap;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use crate::checkpoint::{CheckpointError, write_whole};
use crate::policy::mlp::Moments;
use crate::policy::td3::Standing;
use crate::policy::trainer::PolicyStanding;

const SCHEMA: &str = "greylag.policy-checkpoint/1";
const METADATA: &str = "greylag";
/// The networks, in the order of a [`Standing`].
const NAMES: [&str; 3] = ["actor", "critic1", "critic2"];

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    schema: String,
    identity: String,
    steps: u64,
    targets: u64,
    remembered: u64,
    updates: u64,
    adam_steps: [u64; 3],
}

impl PolicyStanding {
    /// Writes the file `path` atomically. A reader sees either the old version or the new one.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let bytes =
            to_bytes(self).map_err(|why| CheckpointError::Content { path: path.into(), why })?;
        write_whole(path, &bytes).map_err(|why| CheckpointError::File {
            doing: "write",
            path: path.into(),
            why,
        })
    }

    /// Reads a checkpoint.
    ///
    /// # Errors
    ///
    /// If the file cannot be read or is not a checkpoint.
    pub fn load(path: &Path) -> Result<PolicyStanding, CheckpointError> {
        let bytes = std::fs::read(path).map_err(|why| CheckpointError::File {
            doing: "read",
            path: path.into(),
            why,
        })?;
        from_bytes(&bytes).map_err(|why| CheckpointError::Content { path: path.into(), why })
    }
}

/// The arrays of the training state `standing`, each with its name in the file: the replay buffer, and the parameters and
/// the optimiser's moments of each network.
fn lists(standing: &PolicyStanding) -> Vec<(String, &[f32])> {
    let mut lists = vec![("replay".to_owned(), &standing.replay[..])];
    for (name, (own, target, moments)) in NAMES.iter().zip(&standing.td3.networks) {
        lists.push((format!("{name}.own"), own));
        lists.push((format!("{name}.target"), target));
        lists.push((format!("{name}.mean"), &moments.mean));
        lists.push((format!("{name}.square"), &moments.square));
    }
    lists
}

fn to_bytes(standing: &PolicyStanding) -> Result<Vec<u8>, String> {
    let little = |list: &[f32]| list.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let parts: Vec<_> =
        lists(standing).into_iter().map(|(name, list)| (name, list.len(), little(list))).collect();
    let views = parts
        .iter()
        .map(|(name, count, bytes)| {
            TensorView::new(Dtype::F32, vec![*count], bytes).map(|view| (name.as_str(), view))
        })
        .collect::<Result<Vec<_>, _>>()
        .map_err(|e| e.to_string())?;
    let header = Header {
        schema: SCHEMA.into(),
        identity: standing.identity.clone(),
        steps: standing.steps,
        targets: standing.targets,
        remembered: standing.remembered,
        updates: standing.td3.updates,
        adam_steps: standing.td3.networks.each_ref().map(|(_, _, moments)| moments.steps),
    };
    let header = serde_json::to_string(&header).map_err(|e| e.to_string())?;
    let metadata = HashMap::from([(METADATA.to_owned(), header)]);
    safetensors::serialize(views, Some(metadata)).map_err(|e| e.to_string())
}

fn from_bytes(bytes: &[u8]) -> Result<PolicyStanding, String> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| e.to_string())?;
    let header = metadata.metadata().as_ref().and_then(|m| m.get(METADATA));
    let header: Header = serde_json::from_str(header.ok_or("it has no metadata of ours")?)
        .map_err(|e| e.to_string())?;
    if header.schema != SCHEMA {
        return Err(format!("its schema is {:?}, this program reads {SCHEMA}", header.schema));
    }
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| e.to_string())?;
    let list = |name: String| -> Result<Vec<f32>, String> {
        match tensors.tensor(&name) {
            Ok(t) if t.dtype() == Dtype::F32 => {
                let number = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
                Ok(t.data().chunks_exact(4).map(number).collect())
            }
            _ => Err(format!("it has no {name} of F32")),
        }
    };
    let network = |k: usize| -> Result<(Vec<f32>, Vec<f32>, Moments), String> {
        let part = |what: &str| list(format!("{}.{what}", NAMES[k]));
        let (mean, square) = (part("mean")?, part("square")?);
        Ok((part("own")?, part("target")?, Moments { steps: header.adam_steps[k], mean, square }))
    };
    Ok(PolicyStanding {
        identity: header.identity,
        steps: header.steps,
        targets: header.targets,
        remembered: header.remembered,
        replay: list("replay".into())?,
        td3: Standing {
            updates: header.updates,
            networks: [network(0)?, network(1)?, network(2)?],
        },
    })
}
