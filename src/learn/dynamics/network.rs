//! Forward pass of the residual's network, which stores the activations, and the backward pass, which uses them.

use crate::dynamics::packet::Packet;
use greylag_model::residual::{INPUTS, OUTPUTS};
use greylag_num::dense::{Layer, rectify};
use greylag_num::{Dense, Real};

/// Number of rows and columns of a tile of a weight matrix. The gradient of a tile is summed in registers.
const TILE: usize = 4;

/// A network prepared for both passes.
#[derive(Clone, Debug)]
pub struct Passes {
    network: Dense,
    /// For each layer: transposed weights `[out, in]` for the backward pass, and zeros as its biases, one per input.
    transposed: Vec<(Vec<f32>, Vec<f32>)>,
}

impl Passes {
    /// Prepares `network` for both passes.
    pub fn new(network: Dense) -> Self {
        let zeros = |n: usize| vec![0.0; n];
        let sizes = network.sizes();
        let transposed = sizes.windows(2).map(|s| (zeros(s[0] * s[1]), zeros(s[0]))).collect();
        let mut passes = Passes { network, transposed };
        passes.renew();
        passes
    }

    /// The network with its present parameters.
    pub fn network(&self) -> &Dense {
        &self.network
    }

    /// Applies `change` to the parameters.
    pub fn update(&mut self, change: impl FnOnce(&mut [f32])) {
        change(self.network.parameters_mut());
        self.renew();
    }

    fn renew(&mut self) {
        for (layer, (turned, zeros)) in self.network.layers().zip(&mut self.transposed) {
            let (inputs, outputs) = (zeros.len(), layer.bias.len());
            for (i, row) in layer.weights.chunks_exact(outputs).enumerate() {
                for (o, w) in row.iter().enumerate() {
                    turned[o * inputs + i] = *w;
                }
            }
        }
    }

    /// Number of activations that the forward pass stores for each sample: those of the inputs and of the hidden layers.
    pub fn trace(&self) -> usize {
        let sizes = self.network.sizes();
        sizes[..sizes.len() - 1].iter().sum()
    }

    /// Number of gradients that the backward pass stores for each sample: those of all layers except the inputs.
    pub fn slopes(&self) -> usize {
        self.network.sizes()[1..].iter().sum()
    }

    /// Returns the network's output and stores the activations in `trace`.
    #[inline(always)]
    pub fn forward<R: Real>(&self, input: [R; INPUTS], trace: &mut [R]) -> [R; OUTPUTS] {
        let mut output = [R::zero(); OUTPUTS];
        trace[..INPUTS].copy_from_slice(&input);
        let sizes = self.network.sizes();
        let last = sizes.len() - 2;
        let mut rest = trace;
        for (k, layer) in self.network.layers().enumerate() {
            let (from, after) = rest.split_at_mut(sizes[k]);
            if k == last {
                layer.apply(from, &mut output);
            } else {
                layer.apply(from, &mut after[..sizes[k + 1]]);
                rectify(&mut after[..sizes[k + 1]]);
            }
            rest = after;
        }
        output
    }

    /// Returns the loss gradient with respect to the inputs. `output` is the loss gradient with respect to the outputs. The
    /// gradients with respect to all pre-activations are stored in `slopes`.
    #[inline(always)]
    pub fn backward<R: Real>(
        &self,
        trace: &[R],
        output: [R; OUTPUTS],
        slopes: &mut [R],
    ) -> [R; INPUTS] {
        let mut input = [R::zero(); INPUTS];
        let sizes = self.network.sizes();
        let end = slopes.len();
        slopes[end - OUTPUTS..].copy_from_slice(&output);
        let (mut place, mut seen) = (end - OUTPUTS, trace.len());
        for (k, (weights, bias)) in self.transposed.iter().enumerate().rev() {
            let layer = Layer { weights, bias };
            let (before, after) = slopes.split_at_mut(place);
            let from = &after[..sizes[k + 1]];
            if k == 0 {
                layer.apply(from, &mut input);
                break;
            }
            place -= sizes[k];
            seen -= sizes[k];
            let to = &mut before[place..];
            layer.apply(from, to);
            for (slope, unit) in to.iter_mut().zip(&trace[seen..]) {
                *slope = R::where_less(R::zero(), *unit, *slope, R::zero());
            }
        }
        input
    }

    /// Adds the contributions of several samples to `gradient`, the loss gradient with respect to the parameters. `traces` and
    /// `slopes` hold the stored data of the samples, one sample after another.
    #[inline(always)]
    pub fn gather<R: Packet>(&self, traces: &[R], slopes: &[R], gradient: &mut [f64]) {
        let sizes = self.network.sizes();
        let (mut from, mut to, mut place) = (0, 0, 0);
        for s in sizes.windows(2) {
            let [inputs, outputs] = [s[0], s[1]];
            let sides = Sides {
                traces,
                slopes,
                stride: (self.trace(), self.slopes()),
                first: (from, to),
                outputs,
            };
            let (weights, rest) = gradient[place..].split_at_mut(inputs * outputs);
            sides.weights(inputs, weights);
            for (o, bias) in rest[..outputs].iter_mut().enumerate() {
                let slopes = slopes.iter().skip(to + o).step_by(self.slopes());
                *bias += slopes.fold(R::zero(), |sum, s| sum + *s).sum().into();
            }
            (from, to, place) = (from + inputs, to + outputs, place + (inputs + 1) * outputs);
        }
    }
}

/// Data for the gradient of a layer's weights. The gradient is the sum over the samples of input activation times the gradient
/// with respect to the pre-activation.
struct Sides<'a, R> {
    traces: &'a [R],
    slopes: &'a [R],
    stride: (usize, usize),
    first: (usize, usize),
    outputs: usize,
}

impl<R: Packet> Sides<'_, R> {
    #[inline(always)]
    fn weights(&self, inputs: usize, gradient: &mut [f64]) {
        let mut i = 0;
        while i + TILE <= inputs {
            self.rows::<TILE>(i, gradient);
            i += TILE;
        }
        while i < inputs {
            self.rows::<1>(i, gradient);
            i += 1;
        }
    }

    #[inline(always)]
    fn rows<const I: usize>(&self, i: usize, gradient: &mut [f64]) {
        let mut o = 0;
        while o + TILE <= self.outputs {
            self.tile::<I, TILE>(i, o, gradient);
            o += TILE;
        }
        while o < self.outputs {
            self.tile::<I, 1>(i, o, gradient);
            o += 1;
        }
    }

    #[inline(always)]
    fn tile<const I: usize, const O: usize>(&self, i: usize, o: usize, gradient: &mut [f64]) {
        let mut sums = [[R::zero(); O]; I];
        let traces = self.traces.chunks_exact(self.stride.0);
        for (trace, slope) in traces.zip(self.slopes.chunks_exact(self.stride.1)) {
            let units = &trace[self.first.0 + i..][..I];
            let slopes = &slope[self.first.1 + o..][..O];
            for (sums, unit) in sums.iter_mut().zip(units) {
                for (sum, slope) in sums.iter_mut().zip(slopes) {
                    *sum = unit.mul_add(*slope, *sum);
                }
            }
        }
        for (a, sums) in sums.into_iter().enumerate() {
            let row = &mut gradient[(i + a) * self.outputs + o..][..O];
            for (entry, sum) in row.iter_mut().zip(sums) {
                *entry += sum.sum().into();
            }
        }
    }
}
