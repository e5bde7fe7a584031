//! Dense networks with rectified linear units, evaluated with any [`Real`].

use rand::Rng;
use rand::RngExt;

use super::Real;

/// Largest number of units that a layer may have. The buffers of [`Units`] have room for this number. With them,
/// [`Dense::evaluate_in`] and [`Dense::evaluate_one`] accept any network and allocate no memory.
pub const WIDEST: usize = 512;

/// Largest number of units in a layer for [`Dense::evaluate`] and [`Dense::last_hidden`], which use the stack. They need no
/// [`Units`] and allocate no memory, but panic for a wider network. A model with a wider residual network is refused.
pub const ON_STACK: usize = 128;

/// A dense network: affine layers with max(0, ·) between them, and none after the last layer.
///
/// All parameters are in one list, layer after layer. Each layer has its weights, `[in, out]` as the crate burn stores
/// them, then its biases.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    sizes: Vec<usize>,
    parameters: Vec<f32>,
}

/// One affine layer, y = x W + b.
#[derive(Clone, Copy, Debug)]
pub struct Layer<'a> {
    /// Weights W, `[in, out]`: the weights of one input are contiguous.
    pub weights: &'a [f32],
    /// Bias vector b.
    pub bias: &'a [f32],
}

/// Heap buffers for the units of two layers of up to [`WIDEST`] units. With them an evaluation allocates no memory.
#[derive(Clone, Debug)]
pub struct Units<R> {
    from: Vec<R>,
    to: Vec<R>,
}

impl<R: Copy> Units<R> {
    /// Buffers for any network, filled with `zero`.
    pub fn new(zero: R) -> Units<R> {
        Units { from: vec![zero; WIDEST], to: vec![zero; WIDEST] }
    }
}

/// Iterator over a network's layers. It is a named type so that its `next` can be `#[inline(always)]`: a call that is not
/// inlined would not use the caller's vector instructions.
#[derive(Clone, Debug)]
pub struct Layers<'a> {
    sizes: &'a [usize],
    rest: &'a [f32],
}

impl<'a> Iterator for Layers<'a> {
    type Item = Layer<'a>;

    #[inline(always)]
    fn next(&mut self) -> Option<Layer<'a>> {
        let [inputs, outputs, ..] = *self.sizes else { return None };
        let (weights, after) = self.rest.split_at(inputs * outputs);
        let (bias, after) = after.split_at(outputs);
        (self.sizes, self.rest) = (&self.sizes[1..], after);
        Some(Layer { weights, bias })
    }
}

/// Error in the definition of a network.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DenseError {
    /// The layer sizes are not supported.
    #[error(
        "a network of layers {0:?} cannot be used: it takes two or more, each of 1 to {WIDEST}"
    )]
    Sizes(Vec<usize>),
    /// The number of parameters is wrong.
    #[error("a network of layers {sizes:?} has {expected} parameters, not {found}")]
    Count {
        /// Sizes of the layers.
        sizes: Vec<usize>,
        /// Number of parameters needed.
        expected: usize,
        /// Number of parameters given.
        found: usize,
    },
    /// A parameter is not finite.
    #[error("parameter {0} of a network is not a finite number")]
    NotFinite(usize),
}

/// Number of parameters of a network with layers of these `sizes`.
fn count(sizes: &[usize]) -> usize {
    sizes.windows(2).map(|s| (s[0] + 1) * s[1]).sum()
}

impl Dense {
    /// A network with layers of these `sizes` (inputs first) and these parameters.
    ///
    /// # Errors
    /// If a size is not supported, the number of parameters is wrong, or a parameter is not finite.
    pub fn new(sizes: &[usize], parameters: Vec<f32>) -> Result<Self, DenseError> {
        let fits = |n: &usize| (1..=WIDEST).contains(n);
        if sizes.len() < 2 || !sizes.iter().all(fits) {
            return Err(DenseError::Sizes(sizes.into()));
        }
        let (expected, found) = (count(sizes), parameters.len());
        if expected != found {
            return Err(DenseError::Count { sizes: sizes.into(), expected, found });
        }
        match parameters.iter().position(|p| !p.is_finite()) {
            Some(place) => Err(DenseError::NotFinite(place)),
            None => Ok(Dense { sizes: sizes.into(), parameters }),
        }
    }

    /// A network whose output is zero for any input. The parameters of hidden layers are uniform in ±1/√in, as burn and PyTorch
    /// initialise them. Those of the last layer are zero.
    ///
    /// # Errors
    /// If `sizes` has fewer than two layers or a layer outside 1..=`WIDEST` units.
    pub fn silent(sizes: &[usize], rng: &mut impl Rng) -> Result<Self, DenseError> {
        let mut parameters = Vec::new();
        for (k, s) in sizes.windows(2).enumerate() {
            let bound = if k + 2 == sizes.len() { 0.0 } else { 1.0 / (s[0].max(1) as f64).sqrt() };
            let draw = |_| (bound * rng.random_range(-1.0..1.0)) as f32;
            parameters.extend((0..(s[0] + 1) * s[1]).map(draw));
        }
        Dense::new(sizes, parameters)
    }

    /// Number of units of each layer, inputs first.
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// All parameters, layer after layer.
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// All parameters, mutable. The caller must keep the values finite.
    pub fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.parameters
    }

    /// The layers in order.
    #[inline(always)]
    pub fn layers(&self) -> Layers<'_> {
        Layers { sizes: &self.sizes, rest: &self.parameters }
    }

    /// A network initialised as in PyTorch and burn, with all parameters of a layer uniform in ±1/√in.
    ///
    /// # Errors
    /// If `sizes` has fewer than two layers or a layer outside 1..=`WIDEST` units.
    pub fn uniform(sizes: &[usize], rng: &mut impl Rng) -> Result<Self, DenseError> {
        let mut parameters = Vec::new();
        for s in sizes.windows(2) {
            let bound = 1.0 / (s[0].max(1) as f64).sqrt();
            let draw = |_| (bound * rng.random_range(-1.0..1.0)) as f32;
            parameters.extend((0..(s[0] + 1) * s[1]).map(draw));
        }
        Dense::new(sizes, parameters)
    }

    /// Output of the network for `input`.
    ///
    /// # Panics
    /// If the network does not have `IN` inputs and `OUT` outputs, or has a layer wider than [`ON_STACK`].
    #[inline(always)]
    pub fn evaluate<R: Real, const IN: usize, const OUT: usize>(&self, input: [R; IN]) -> [R; OUT] {
        // the smaller buffer is used where possible, because the initialisation of unused buffer space costs time
        if self.sizes.iter().all(|units| *units <= ON_STACK / 2) {
            self.on_stack::<R, IN, OUT, { ON_STACK / 2 }>(input)
        } else {
            self.on_stack::<R, IN, OUT, ON_STACK>(input)
        }
    }

    #[inline(always)]
    fn on_stack<R: Real, const IN: usize, const OUT: usize, const ROOM: usize>(
        &self,
        input: [R; IN],
    ) -> [R; OUT] {
        let (mut one, mut other) = ([R::zero(); ROOM], [R::zero(); ROOM]);
        let (mut from, mut to) = (&mut one, &mut other);
        from[..IN].copy_from_slice(&input);
        let last = self.sizes.len() - 2;
        let mut layers = self.layers();
        for k in 0..=last {
            let Some(layer) = layers.next() else { break };
            let (inputs, outputs) = (self.sizes[k], self.sizes[k + 1]);
            layer.apply(&from[..inputs], &mut to[..outputs]);
            if k < last {
                rectify(&mut to[..outputs]);
            }
            std::mem::swap(&mut from, &mut to);
        }
        let mut answer = [R::zero(); OUT];
        answer.copy_from_slice(&from[..OUT]);
        answer
    }

    /// Writes the outputs of the last hidden layer to `units` and returns their number. A network without a hidden layer
    /// returns zero.
    ///
    /// # Panics
    /// If the length of `input` differs from the network's inputs, or a layer is wider than [`ON_STACK`].
    pub fn last_hidden(&self, input: &[f64], units: &mut [f64; ON_STACK]) -> usize {
        let hidden = self.sizes.len() - 2;
        let mut from = [0.0; ON_STACK];
        from[..self.sizes[0]].copy_from_slice(input);
        for (k, layer) in self.layers().take(hidden).enumerate() {
            let (inputs, outputs) = (self.sizes[k], self.sizes[k + 1]);
            layer.apply(&from[..inputs], &mut units[..outputs]);
            rectify(&mut units[..outputs]);
            from[..outputs].copy_from_slice(&units[..outputs]);
        }
        if hidden == 0 { 0 } else { self.sizes[hidden] }
    }

    /// Output of a network of any width for `input`, with `units` as buffers.
    ///
    /// # Panics
    /// If the length of `input` differs from the network's inputs.
    #[inline(always)]
    pub fn evaluate_in<'a, R: Real>(&self, units: &'a mut Units<R>, input: &[R]) -> &'a [R] {
        let Units { from, to } = units;
        from[..self.sizes[0]].copy_from_slice(input);
        let last = self.sizes.len() - 2;
        let mut layers = self.layers();
        for k in 0..=last {
            let Some(layer) = layers.next() else { break };
            let (inputs, outputs) = (self.sizes[k], self.sizes[k + 1]);
            layer.apply(&from[..inputs], &mut to[..outputs]);
            if k < last {
                rectify(&mut to[..outputs]);
            }
            std::mem::swap(from, to);
        }
        &from[..self.sizes[last + 1]]
    }

    /// Output for one input in single precision, vectorised over the outputs of a layer. The function suits networks that are
    /// evaluated once per tick. It skips units whose value is zero.
    ///
    /// # Panics
    /// If the length of `input` differs from the network's inputs.
    #[inline(always)]
    pub fn evaluate_one<'a>(&self, units: &'a mut Units<f32>, input: &[f32]) -> &'a [f32] {
        let Units { from, to: next } = units;
        from[..self.sizes[0]].copy_from_slice(input);
        let last = self.sizes.len() - 2;
        for (k, layer) in self.layers().enumerate() {
            let (inputs, outputs) = (self.sizes[k], self.sizes[k + 1]);
            let to = &mut next[..outputs];
            to.copy_from_slice(layer.bias);
            for (x, row) in from[..inputs].iter().zip(layer.weights.chunks_exact(outputs)) {
                if *x != 0.0 {
                    to.iter_mut().zip(row).for_each(|(y, w)| *y += x * w);
                }
            }
            if k < last {
                to.iter_mut().for_each(|y| *y = if *y < 0.0 { 0.0 } else { *y });
            }
            std::mem::swap(from, next);
        }
        &from[..self.sizes[last + 1]]
    }
}

impl Layer<'_> {
    /// Computes y = x W + b.
    #[inline(always)]
    pub fn apply<R: Real>(&self, input: &[R], output: &mut [R]) {
        match R::ABREAST {
            ..6 => self.blocks::<R, 3>(input, output),
            6..8 => self.blocks::<R, 6>(input, output),
            8..16 => self.blocks::<R, 8>(input, output),
            16.. => self.blocks::<R, 16>(input, output),
        }
    }

    /// Computes `B` outputs at a time, then the remaining outputs two at a time or singly.
    #[inline(always)]
    fn blocks<R: Real, const B: usize>(&self, input: &[R], output: &mut [R]) {
        let mut first = 0;
        while first + B <= output.len() {
            self.columns::<R, B>(first, input, output);
            first += B;
        }
        while first + 2 <= output.len() {
            self.columns::<R, 2>(first, input, output);
            first += 2;
        }
        while first < output.len() {
            self.columns::<R, 1>(first, input, output);
            first += 1;
        }
    }

    /// Computes the `B` outputs from index `first` on.
    #[inline(always)]
    fn columns<R: Real, const B: usize>(&self, first: usize, input: &[R], output: &mut [R]) {
        let outputs = output.len();
        let mut sum = [R::zero(); B];
        let bias = &self.bias[first..first + B];
        let mut j = 0;
        while j < B {
            sum[j] = R::from_f64(bias[j].into());
            j += 1;
        }
        let mut place = first;
        for x in input {
            let row = &self.weights[place..place + B];
            let mut j = 0;
            while j < B {
                sum[j] = x.mul_add_constant(row[j].into(), sum[j]);
                j += 1;
            }
            place += outputs;
        }
        output[first..first + B].copy_from_slice(&sum);
    }
}

/// Applies max(0, ·) to every unit.
#[inline(always)]
pub fn rectify<R: Real>(units: &mut [R]) {
    for unit in units {
        *unit = unit.max(R::zero());
    }
}

#[cfg(test)]
mod tests;
