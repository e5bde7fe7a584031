//! A dense network in the deep-learning framework burn, with its optimiser Adam.

use burn::tensor::{Device, Gradients, Tensor, TensorData, activation};

use greylag_num::Dense;
use greylag_num::dense::DenseError;

/// A dense network as tensors: weights `[in, out]` and biases of each layer.
#[derive(Clone, Debug)]
pub struct Mlp {
    sizes: Vec<usize>,
    layers: Vec<(Tensor<2>, Tensor<1>)>,
}

/// The optimiser Adam for one network. It updates each tensor in a single pass.
///
/// burn's Adam makes a dozen passes over each tensor, each with a new allocation. At the layer sizes of Table VII of \[GSFM26\]
/// (see `src/lib.rs`), these passes take a tenth of the time of a TD3 update. This code uses burn's operations in burn's order. A
/// test checks that the results are equal to the bit.
#[derive(Clone, Debug)]
pub struct Optimiser {
    rate: f64,
    steps: u64,
    /// First and second moments for the weights and the biases of each layer.
    layers: Vec<[Moment; 2]>,
}

/// Running means of a tensor's gradient and of the gradient's square.
#[derive(Clone, Debug)]
struct Moment {
    mean: Vec<f32>,
    square: Vec<f32>,
}

/// Values for one step that are the same for all parameters.
struct Pace {
    rate: f32,
    /// Bias correction of the mean divided by the bias correction of the root mean square.
    ahead: f32,
    epsilon: f32,
}

const BETA: [f32; 2] = [0.9, 0.999];
const EPSILON: f32 = 1e-8;

/// State of an optimiser: number of steps, first moments and second moments. The moments are in the order of the network's
/// parameters.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Moments {
    /// Number of steps made.
    pub steps: u64,
    /// Running means of the gradient; empty before the first step.
    pub mean: Vec<f32>,
    /// Running means of the squared gradient; empty before the first step.
    pub square: Vec<f32>,
}

impl Mlp {
    /// Copies `network` into tensors on `device`. Their gradients are not tracked.
    pub fn new(network: &Dense, device: &Device) -> Mlp {
        let sizes = network.sizes();
        let layers = network.layers().zip(sizes.windows(2)).map(|(layer, s)| {
            let weights = TensorData::new(layer.weights.to_vec(), [s[0], s[1]]);
            let bias = TensorData::new(layer.bias.to_vec(), [s[1]]);
            (Tensor::from_data(weights, device), Tensor::from_data(bias, device))
        });
        Mlp { sizes: sizes.into(), layers: layers.collect() }
    }

    /// Number of units of each layer, inputs first.
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

    /// The network in the form that is evaluated in flight.
    ///
    /// # Errors
    ///
    /// If a parameter is not finite.
    pub fn to_dense(&self) -> Result<Dense, DenseError> {
        Dense::new(&self.sizes, self.parameters())
    }

    /// The outputs for the rows of `input`.
    pub fn forward(&self, input: Tensor<2>) -> Tensor<2> {
        let last = self.layers.len() - 1;
        self.layers.iter().enumerate().fold(input, |x, (k, (weights, bias))| {
            let y = x.matmul(weights.clone()) + bias.clone().unsqueeze();
            if k < last { activation::relu(y) } else { y }
        })
    }

    /// A copy whose parameters' gradients are tracked.
    pub fn followed(&self) -> Mlp {
        let follow = |(w, b): &(Tensor<2>, Tensor<1>)| {
            (w.clone().autodiff().require_grad(), b.clone().autodiff().require_grad())
        };
        Mlp { sizes: self.sizes.clone(), layers: self.layers.iter().map(follow).collect() }
    }

    /// A copy through which gradients pass to its inputs, but whose parameters' gradients are not tracked.
    pub fn passed(&self) -> Mlp {
        let pass = |(w, b): &(Tensor<2>, Tensor<1>)| (w.clone().autodiff(), b.clone().autodiff());
        Mlp { sizes: self.sizes.clone(), layers: self.layers.iter().map(pass).collect() }
    }

    /// Moves each parameter by the fraction `tau` towards that of `other` (soft update).
    pub fn approach(&mut self, other: &Mlp, tau: f64) {
        let [stay, go] = [(1.0 - tau) as f32, tau as f32];
        let layers = std::mem::take(&mut self.layers).into_iter().zip(&other.layers);
        let between = |own: &mut [f32], other: &[f32]| {
            own.iter_mut().zip(other).for_each(|(own, other)| *own = *own * stay + *other * go);
        };
        self.layers = layers
            .map(|((w, b), (to_w, to_b))| {
                (changed(w, to_w.clone(), between), changed(b, to_b.clone(), between))
            })
            .collect();
    }
}

/// Returns `tensor` after `change` has updated its numbers. `change` gets them together with the numbers of `other`, which has
/// the same shape.
fn changed<const D: usize>(
    tensor: Tensor<D>,
    other: Tensor<D>,
    change: impl FnOnce(&mut [f32], &[f32]),
) -> Tensor<D> {
    let device = tensor.device();
    let (mut own, other) = (tensor.into_data(), other.into_data());
    if let (Ok(own), Ok(other)) = (own.as_mut_slice::<f32>(), other.as_slice::<f32>()) {
        change(own, other);
    }
    Tensor::from_data(own, &device)
}

/// Appends a tensor's numbers.
fn append<const D: usize>(all: &mut Vec<f32>, tensor: Tensor<D>) {
    if let Ok(numbers) = tensor.into_data().try_into_vec::<f32>() {
        all.extend(numbers);
    }
}

impl Optimiser {
    /// Adam for `network` at the learning rate `rate`. ε is 1e-8 instead of burn's 1e-5.
    pub fn new(network: &Mlp, rate: f64) -> Optimiser {
        let zeros = |n: usize| Moment { mean: vec![0.0; n], square: vec![0.0; n] };
        let layers = network.sizes.windows(2).map(|s| [zeros(s[0] * s[1]), zeros(s[1])]);
        Optimiser { rate, steps: 0, layers: layers.collect() }
    }

    /// Updates `network` by one step. `followed` is the copy of `network` with tracked gradients; `gradients` holds the
    /// gradients of its parameters.
    pub fn step(&mut self, network: &mut Mlp, followed: Mlp, gradients: &mut Gradients) {
        self.steps += 1;
        let pace = Pace::of(self.steps, self.rate);
        // The copy shares the parameters' memory. Once the copy is dropped, the parameters are updated in place.
        let slopes: Vec<_> = followed
            .layers
            .into_iter()
            .map(|(w, b)| (w.grad_remove(gradients), b.grad_remove(gradients)))
            .collect();
        let layers = std::mem::take(&mut network.layers).into_iter().zip(slopes);
        network.layers = layers
            .zip(&mut self.layers)
            .map(|(((w, b), (slope_w, slope_b)), [of_w, of_b])| {
                (of_w.step(w, slope_w, &pace), of_b.step(b, slope_b, &pace))
            })
            .collect();
    }

    /// Sets the learning rate.
    pub fn set_rate(&mut self, rate: f64) {
        self.rate = rate;
    }

    /// The present state of the optimiser.
    pub fn moments(&self) -> Moments {
        if self.steps == 0 {
            return Moments::default();
        }
        let all = || self.layers.iter().flatten();
        Moments {
            steps: self.steps,
            mean: all().flat_map(|m| m.mean.iter().copied()).collect(),
            square: all().flat_map(|m| m.square.iter().copied()).collect(),
        }
    }

    /// Restores `moments`. Returns `false` if they belong to another network.
    pub fn remember(&mut self, moments: Moments) -> bool {
        if moments.steps == 0 {
            return moments.mean.is_empty() && moments.square.is_empty();
        }
        let count: usize = self.layers.iter().flatten().map(|m| m.mean.len()).sum();
        if [moments.mean.len(), moments.square.len()] != [count; 2] {
            return false;
        }
        let mut first = 0;
        for m in self.layers.iter_mut().flatten() {
            let place = first..first + m.mean.len();
            m.mean.copy_from_slice(&moments.mean[place.clone()]);
            m.square.copy_from_slice(&moments.square[place.clone()]);
            first = place.end;
        }
        self.steps = moments.steps;
        true
    }
}

impl Pace {
    fn of(steps: u64, rate: f64) -> Pace {
        let steps = steps as i32;
        let root = (1.0 - BETA[1].powi(steps)).sqrt();
        Pace {
            rate: rate as f32,
            ahead: root / (1.0 - BETA[0].powi(steps)),
            epsilon: EPSILON * root,
        }
    }
}

impl Moment {
    /// Returns `parameter` after a descent step with its gradient `slope`. Without a gradient it is unchanged.
    fn step<const D: usize>(
        &mut self,
        parameter: Tensor<D>,
        slope: Option<Tensor<D>>,
        pace: &Pace,
    ) -> Tensor<D> {
        match slope {
            Some(slope) => changed(parameter, slope, |own, slope| self.follow(own, slope, pace)),
            None => parameter,
        }
    }

    fn follow(&mut self, parameters: &mut [f32], slopes: &[f32], pace: &Pace) {
        let moments = self.mean.iter_mut().zip(&mut self.square);
        for ((p, g), (m, v)) in parameters.iter_mut().zip(slopes).zip(moments) {
            *m = *m * BETA[0] + g * (1.0 - BETA[0]);
            *v = *v * BETA[1] + g * g * (1.0 - BETA[1]);
            *p -= *m * pace.ahead / (v.sqrt() + pace.epsilon) * pace.rate;
        }
    }
}
