//! A dense network in burn, with its optimiser.

use burn::optim::{Adam, AdamConfig, AdamState, AdaptiveMomentumState, Optimizer};
use burn::tensor::{Device, Gradients, Tensor, TensorData, activation};

use crate::num::Dense;
use crate::num::dense::DenseError;

/// A dense network as tensors: weights `[in, out]` with biases, layer after layer.
#[derive(Clone, Debug)]
pub struct Mlp {
    sizes: Vec<usize>,
    layers: Vec<(Tensor<2>, Tensor<1>)>,
}

/// Adam for one network.
#[derive(Clone)]
pub struct Optimiser {
    adam: Adam,
    rate: f64,
    states: Vec<(Option<AdamState<2>>, Option<AdamState<1>>)>,
}

/// What an optimiser remembers: its steps, then mean and square of the gradient in the order of a
/// network's parameters.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Moments {
    /// Steps made.
    pub steps: u64,
    /// Running means of the gradient; none before the first step.
    pub mean: Vec<f32>,
    /// Running means of its square.
    pub square: Vec<f32>,
}

impl Mlp {
    /// The tensors of `network`, without gradients.
    pub fn new(network: &Dense, device: &Device) -> Mlp {
        let sizes = network.sizes();
        let layers = network.layers().zip(sizes.windows(2)).map(|(layer, s)| {
            let weights = TensorData::new(layer.weights.to_vec(), [s[0], s[1]]);
            let bias = TensorData::new(layer.bias.to_vec(), [s[1]]);
            (Tensor::from_data(weights, device), Tensor::from_data(bias, device))
        });
        Mlp { sizes: sizes.into(), layers: layers.collect() }
    }

    /// Units of each layer, inputs first.
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// All parameters in the order of [`Dense`].
    pub fn parameters(&self) -> Vec<f32> {
        let mut all = Vec::new();
        for (weights, bias) in &self.layers {
            append(&mut all, weights.clone());
            append(&mut all, bias.clone());
        }
        all
    }

    /// The network for flight.
    ///
    /// # Errors
    /// If a parameter is no longer finite.
    pub fn to_dense(&self) -> Result<Dense, DenseError> {
        Dense::new(&self.sizes, self.parameters())
    }

    /// The answers to the rows of `input`.
    pub fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        let last = self.layers.len() - 1;
        self.layers.iter().enumerate().fold(input, |x, (k, (weights, bias))| {
            let y = x.matmul(weights.clone()) + bias.clone().unsqueeze();
            if k < last { activation::relu(y) } else { y }
        })
    }

    /// The same network with its parameters' gradients followed.
    pub fn followed(&self) -> Mlp {
        let follow = |(w, b): &(Tensor<2>, Tensor<1>)| {
            (w.clone().autodiff().require_grad(), b.clone().autodiff().require_grad())
        };
        Mlp { sizes: self.sizes.clone(), layers: self.layers.iter().map(follow).collect() }
    }

    /// The same network for gradients that go through it and stop at it.
    pub fn passed(&self) -> Mlp {
        let pass = |(w, b): &(Tensor<2>, Tensor<1>)| (w.clone().autodiff(), b.clone().autodiff());
        Mlp { sizes: self.sizes.clone(), layers: self.layers.iter().map(pass).collect() }
    }

    /// Moves each parameter the part `tau` of the way to `other`'s.
    pub fn approach(&mut self, other: &Mlp, tau: f64) {
        for ((w, b), (to_w, to_b)) in self.layers.iter_mut().zip(&other.layers) {
            *w = w.clone() * (1.0 - tau) + to_w.clone() * tau;
            *b = b.clone() * (1.0 - tau) + to_b.clone() * tau;
        }
    }
}

/// Appends a tensor's numbers.
fn append<const D: usize>(all: &mut Vec<f32>, tensor: Tensor<D>) {
    if let Ok(numbers) = tensor.into_data().try_into_vec::<f32>() {
        all.extend(numbers);
    }
}

impl Optimiser {
    /// Adam for `network` at learning rate `rate`; ε is 1e-8, not burn's 1e-5.
    pub fn new(network: &Mlp, rate: f64) -> Optimiser {
        let adam = AdamConfig::new().with_epsilon(1e-8).build();
        Optimiser { adam, rate, states: vec![(None, None); network.layers.len()] }
    }

    /// Moves `network` against the gradients that its `followed` copy has in `gradients`.
    pub fn step(&mut self, network: &mut Mlp, followed: &Mlp, gradients: &mut Gradients) {
        let layers = network.layers.iter_mut().zip(&followed.layers).zip(&mut self.states);
        for (((w, b), (seen_w, seen_b)), (state_w, state_b)) in layers {
            move_one(&self.adam, self.rate, w, seen_w.grad_remove(gradients), state_w);
            move_one(&self.adam, self.rate, b, seen_b.grad_remove(gradients), state_b);
        }
    }

    /// The learning rate from now on.
    pub fn set_rate(&mut self, rate: f64) {
        self.rate = rate;
    }

    /// What it remembers.
    pub fn moments(&self) -> Moments {
        let mut all = Moments::default();
        for (w, b) in &self.states {
            if let (Some(w), Some(b)) = (w, b) {
                all.steps = w.momentum.time as u64;
                append(&mut all.mean, w.momentum.moment_1.clone());
                append(&mut all.mean, b.momentum.moment_1.clone());
                append(&mut all.square, w.momentum.moment_2.clone());
                append(&mut all.square, b.momentum.moment_2.clone());
            }
        }
        all
    }

    /// Remembers what `moments` says of a network of layers `sizes`; `false` if it is of another.
    pub fn remember(&mut self, sizes: &[usize], moments: Moments, device: &Device) -> bool {
        if moments.steps == 0 {
            return moments.mean.is_empty() && moments.square.is_empty();
        }
        let [Ok(mean), Ok(square)] =
            [moments.mean, moments.square].map(|numbers| Dense::new(sizes, numbers))
        else {
            return false;
        };
        let (mean, square) = (Mlp::new(&mean, device), Mlp::new(&square, device));
        let time = moments.steps as usize;
        self.states = mean
            .layers
            .into_iter()
            .zip(square.layers)
            .map(|((w1, b1), (w2, b2))| {
                let w = AdamState::new(AdaptiveMomentumState::new(time, w1, w2));
                (Some(w), Some(AdamState::new(AdaptiveMomentumState::new(time, b1, b2))))
            })
            .collect();
        true
    }
}

fn move_one<const D: usize>(
    adam: &Adam,
    rate: f64,
    parameter: &mut Tensor<D>,
    gradient: Option<Tensor<D>>,
    state: &mut Option<AdamState<D>>,
) {
    if let Some(gradient) = gradient {
        let (moved, next) = adam.step(rate, parameter.clone(), gradient, state.take());
        (*parameter, *state) = (moved, next);
    }
}
