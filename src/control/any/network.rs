//! The network of the policy that flies any aircraft: a recurrent layer (GRU), and in parallel a linear path from the inputs
//! to the outputs.

use std::sync::LazyLock;

use safetensors::{Dtype, SafeTensors};

use crate::SetupError;

/// Number of inputs of the network.
pub(super) const INPUTS: usize = 24;
/// Number of recurrent units.
pub(super) const HIDDEN: usize = 32;
/// Number of outputs, each −1..1: aileron, elevator, throttle and rudder. The throttle output −1..1 stands for a throttle of
/// 0..1.
const OUTPUTS: usize = 4;
/// Number of rows of the GRU's matrices: one row per unit for the update gate, the reset gate and the candidate state.
const GATES: usize = 3 * HIDDEN;

static FILE: &[u8] = include_bytes!("../../../params/any/policy.safetensors");
static SHIPPED: LazyLock<Result<Network, String>> = LazyLock::new(|| Network::read(FILE));

/// The weights of the network, as matrices with one row per gate or per output.
#[derive(Clone, Debug)]
pub(super) struct Network {
    input: Vec<f64>,
    recurrent: Vec<f64>,
    bias: Vec<f64>,
    output: Vec<f64>,
    beside: Vec<f64>,
    output_bias: Vec<f64>,
}

/// The network that is built into the program.
pub(super) fn shipped() -> Result<&'static Network, SetupError> {
    SHIPPED.as_ref().map_err(|why| SetupError::Any { why: why.clone() })
}

fn dot(row: &[f64], x: &[f64]) -> f64 {
    row.iter().zip(x).map(|(w, x)| w * x).sum()
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

impl Network {
    /// Reads the network from a safetensors file with values in single precision.
    fn read(bytes: &[u8]) -> Result<Network, String> {
        let file = SafeTensors::deserialize(bytes).map_err(|e| e.to_string())?;
        let tensor = |name: &str, shape: &[usize]| {
            let found = file.tensor(name).map_err(|e| e.to_string())?;
            if found.dtype() != Dtype::F32 || found.shape() != shape {
                return Err(format!(
                    "{name} is {:?} {:?}, not F32 {shape:?}",
                    found.dtype(),
                    found.shape()
                ));
            }
            let numbers = found.data().chunks_exact(4);
            let all: Vec<f64> =
                numbers.map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect();
            match all.iter().all(|x| x.is_finite()) {
                true => Ok(all),
                false => Err(format!("{name} has a value that is not finite")),
            }
        };
        Ok(Network {
            input: tensor("wx", &[GATES, INPUTS])?,
            recurrent: tensor("wh", &[GATES, HIDDEN])?,
            bias: tensor("b", &[GATES])?,
            output: tensor("out", &[OUTPUTS, HIDDEN])?,
            beside: tensor("skip", &[OUTPUTS, INPUTS])?,
            output_bias: tensor("ob", &[OUTPUTS])?,
        })
    }

    /// One step of the network: returns its outputs (−1..1) and updates `hidden`.
    pub(super) fn step(&self, hidden: &mut [f64; HIDDEN], x: &[f64; INPUTS]) -> [f64; OUTPUTS] {
        let before = *hidden;
        let seen = |k: usize| dot(&self.input[k * INPUTS..][..INPUTS], x) + self.bias[k];
        let kept = |k: usize| dot(&self.recurrent[k * HIDDEN..][..HIDDEN], &before);
        for (k, unit) in hidden.iter_mut().enumerate() {
            let hold = sigmoid(seen(k) + kept(k));
            let reset = sigmoid(seen(HIDDEN + k) + kept(HIDDEN + k));
            let new = (seen(2 * HIDDEN + k) + reset * kept(2 * HIDDEN + k)).tanh();
            *unit = (1.0 - hold) * new + hold * before[k];
        }
        std::array::from_fn(|k| {
            let memory = dot(&self.output[k * HIDDEN..][..HIDDEN], &hidden[..]);
            let beside = dot(&self.beside[k * INPUTS..][..INPUTS], x);
            (memory + beside + self.output_bias[k]).tanh()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The file holds the inputs and commands of five steps, computed by the training program.
    #[test]
    fn the_network_is_the_one_that_was_trained() {
        let text = include_str!("../../../tests/data/any/policy.trace.csv");
        let (network, mut hidden, mut steps) = (shipped().unwrap(), [0.0; HIDDEN], 0);
        for line in text.lines() {
            let numbers: Vec<f64> = line.split(',').map(|x| x.parse().unwrap()).collect();
            let (x, u) = numbers.split_at(INPUTS);
            let [aileron, elevator, throttle, rudder] =
                network.step(&mut hidden, x.try_into().unwrap());
            let ours = [aileron, elevator, 0.5 + 0.5 * throttle, rudder];
            for (ours, theirs) in ours.iter().zip(u) {
                // the recorded outputs have single precision, the recorded inputs six decimals
                assert!((ours - theirs).abs() < 1e-5, "step {steps}: {ours} {theirs}");
            }
            steps += 1;
        }
        assert_eq!(steps, 5);
    }

    #[test]
    fn a_file_of_another_shape_is_refused() {
        assert!(Network::read(&FILE[..FILE.len() - 4]).is_err());
        assert!(Network::read(b"no tensors").is_err());
    }
}
