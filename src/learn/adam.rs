//! The Adam optimiser (Kingma and Ba, 2015).

/// State of Adam (Kingma and Ba, 2015, algorithm 1) for a list of parameters.
///
/// The Adam of the machine-learning library burn requires the parameters in burn's tensors. The training of dynamics models
/// keeps them in plain arrays and updates them 500 times a second. Copying them to tensors would take more code than the
/// algorithm. A test compares the algorithm with a case calculated by hand.
///
/// The state is public because a checkpoint stores it. A resumed training must equal an uninterrupted one to the bit.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    /// Running means of the gradients.
    pub mean: Vec<f64>,
    /// Running means of the squared gradients.
    pub square: Vec<f64>,
    /// Number of updates begun so far.
    pub steps: u64,
}

const BETA: [f64; 2] = [0.9, 0.999];
const EPSILON: f64 = 1e-8;

impl Adam {
    /// The initial state for `count` parameters.
    pub fn new(count: usize) -> Adam {
        Adam { mean: vec![0.0; count], square: vec![0.0; count], steps: 0 }
    }

    /// Starts an update of all parameters.
    pub fn begin(&mut self) {
        self.steps += 1;
    }

    /// Returns the change of parameter number `place` for its `gradient` at the learning rate `rate`. The function must be
    /// called once for each parameter between two calls of [`begin`](Adam::begin).
    pub fn move_of(&mut self, place: usize, gradient: f64, rate: f64) -> f64 {
        let (m, v) = (&mut self.mean[place], &mut self.square[place]);
        *m = BETA[0] * *m + (1.0 - BETA[0]) * gradient;
        *v = BETA[1] * *v + (1.0 - BETA[1]) * gradient * gradient;
        let steps = self.steps.min(1 << 20) as i32;
        let [m, v] = [*m / (1.0 - BETA[0].powi(steps)), *v / (1.0 - BETA[1].powi(steps))];
        -rate * m / (v.sqrt() + EPSILON)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moves_as_the_algorithm_says() {
        let mut adam = Adam::new(1);
        adam.begin();
        // the first step has the size of the learning rate for any gradient
        assert!((adam.move_of(0, 3.0, 0.1) + 0.1).abs() < 1e-9);
        adam.begin();
        // m = 0.9·0.3 − 0.1 = 0.17, divided by 0.19; v = 0.999·0.009 + 0.001 = 0.009991, divided by 0.001999
        let expected = -0.1 * (0.17 / 0.19) / (0.009991_f64 / 0.001999).sqrt();
        assert!((adam.move_of(0, -1.0, 0.1) - expected).abs() < 1e-9);
    }
}
