//! Reads and writes the weights of a dense network as a safetensors file. One metadata entry states the origin of the network.

use std::collections::HashMap;

use safetensors::SafeTensorError;
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::Serialize;
use serde::de::DeserializeOwned;

use greylag_num::Dense;

/// Key of the metadata entry with the file's origin, as JSON.
const METADATA: &str = "greylag";

/// A square matrix that is stored in addition to a network's layers.
#[derive(Clone, Copy, Debug)]
pub struct Square<'a> {
    /// Name of the tensor.
    pub name: &'static str,
    /// Number of rows, which equals the number of columns.
    pub size: usize,
    /// Matrix entries, row by row.
    pub entries: &'a [f32],
}

/// Returns the content of a file with the layers of `network`, an optional square matrix and the origin `origin`.
///
/// # Errors
/// If safetensors cannot serialise the tensors, or the origin cannot be written as JSON.
pub fn to_bytes(
    network: &Dense,
    matrix: Option<Square>,
    origin: &impl Serialize,
) -> Result<Vec<u8>, SafeTensorError> {
    let little = |list: &[f32]| list.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    let mut tensors = Vec::new();
    for (k, layer) in network.layers().enumerate() {
        let shape = [network.sizes()[k], network.sizes()[k + 1]];
        tensors.push((format!("layers.{k}.weight"), shape.to_vec(), little(layer.weights)));
        tensors.push((format!("layers.{k}.bias"), vec![shape[1]], little(layer.bias)));
    }
    if let Some(Square { name, size, entries }) = matrix {
        tensors.push((name.to_owned(), vec![size, size], little(entries)));
    }
    let views = tensors
        .iter()
        .map(|(name, shape, bytes)| {
            Ok((name.as_str(), TensorView::new(Dtype::F32, shape.clone(), bytes)?))
        })
        .collect::<Result<Vec<_>, SafeTensorError>>()?;
    // only one metadata entry: safetensors writes several entries in no fixed order, but equal networks must give equal files
    let origin = serde_json::to_string(origin)?;
    safetensors::serialize(views, Some(HashMap::from([(METADATA.to_owned(), origin)])))
}

/// Reads the origin from the metadata of a file.
///
/// # Errors
/// If the bytes are not a safetensors file, or the metadata have no valid origin.
pub fn origin<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, String> {
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(|e| e.to_string())?;
    let origin = metadata.metadata().as_ref().and_then(|m| m.get(METADATA));
    let origin = origin.ok_or(format!("its metadata has no entry {METADATA}"))?;
    serde_json::from_str(origin).map_err(|e| format!("its metadata: {e}"))
}

/// Reads the network of a file from the tensors `layers.0.weight`, `layers.0.bias` and so on.
///
/// # Errors
/// If a tensor is missing or has a wrong shape or type, or a parameter is not finite.
pub fn network(bytes: &[u8]) -> Result<Dense, String> {
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| e.to_string())?;
    let (mut sizes, mut parameters) = (Vec::new(), Vec::new());
    let layers = tensors.names().iter().filter(|name| name.ends_with(".weight")).count();
    for k in 0..layers {
        for part in ["weight", "bias"] {
            let name = format!("layers.{k}.{part}");
            let tensor = tensors.tensor(&name).map_err(|_| format!("it has no tensor {name}"))?;
            let outputs = match (part, tensor.shape()) {
                ("weight", [inputs, outputs]) if sizes.last().is_none_or(|n| n == inputs) => {
                    if sizes.is_empty() {
                        sizes.push(*inputs);
                    }
                    *outputs
                }
                ("bias", [outputs]) if sizes.last() == Some(outputs) => *outputs,
                (_, shape) => return Err(format!("tensor {name} has the shape {shape:?}")),
            };
            if tensor.dtype() != Dtype::F32 {
                return Err(format!("tensor {name} is {:?}, not F32", tensor.dtype()));
            }
            if part == "weight" {
                sizes.push(outputs);
            }
            parameters.extend(numbers(tensor.data()));
        }
    }
    Dense::new(&sizes, parameters).map_err(|e| e.to_string())
}

/// Reads the entries of the matrix `name` of a file, row by row. `None` if the file has no such matrix.
///
/// # Errors
/// If the bytes are not a safetensors file, or the matrix is not in single precision.
pub fn matrix(bytes: &[u8], name: &str) -> Result<Option<Vec<f32>>, String> {
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| e.to_string())?;
    let Ok(tensor) = tensors.tensor(name) else { return Ok(None) };
    match tensor.dtype() {
        Dtype::F32 => Ok(Some(numbers(tensor.data()).collect())),
        other => Err(format!("tensor {name} is {other:?}, not F32")),
    }
}

fn numbers(data: &[u8]) -> impl Iterator<Item = f32> + '_ {
    data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
}
