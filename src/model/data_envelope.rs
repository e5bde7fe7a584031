//! Envelope of the training data of a residual, the neural network that corrects a model's rates. It gives the distance of a
//! flight condition from the training data.
//!
//! The distance is the square root of a leverage, scaled so that 99.9 % of the training samples have a distance of at most 1.
//! The leverage of a linear regression over the training samples is x̂ᵀ (X̂ᵀX̂)⁻¹ x̂. Here the features x̂ are 1, the network's
//! inputs, and the outputs (units) of its last hidden layer. The leverage grows if inputs leave the range of the training data.
//! It also grows if units are active that were hardly active there. It is proportional to the output variance of a network with
//! a Bayesian last layer.

use nalgebra::{DMatrix, DVector};

use crate::residual::INPUTS;
use greylag_num::Dense;
use greylag_num::dense::ON_STACK;

/// Largest number of features: 1, the inputs and the widest hidden layer.
const MOST: usize = 1 + INPUTS + ON_STACK;

/// A constant that is added to the second moment of each feature, as a fraction of the mean second moment (ridge). It is needed
/// because a unit that was never active has a second moment of zero.
const RIDGE: f64 = 1e-4;

/// Fraction of the training samples whose distance is at most 1.
const WITHIN: f64 = 0.999;

/// Envelope of training data in the space of a network's features.
#[derive(Clone, Debug, PartialEq)]
pub struct DataEnvelope {
    /// Square matrix W in row-major order. The distance of a point with the features x̂ is ‖W x̂‖.
    whitening: Vec<f32>,
}

impl DataEnvelope {
    /// The envelope of the training samples. `inputs` are the scaled inputs of `network` in each sample. `None` if there are no
    /// samples, or a value is not finite.
    pub fn of(network: &Dense, inputs: &[[f64; INPUTS]]) -> Option<DataEnvelope> {
        let all: Vec<DVector<f64>> = inputs
            .iter()
            .map(|x| {
                let (features, count) = features(network, x);
                DVector::from_column_slice(&features[..count])
            })
            .collect();
        let count = all.first()?.len();
        let mut moments = DMatrix::<f64>::zeros(count, count);
        all.iter().for_each(|x| moments.ger(1.0 / all.len() as f64, x, x, 1.0));
        let ridge = RIDGE * moments.trace() / count as f64;
        for k in 0..count {
            moments[(k, k)] += ridge;
        }
        let whitening = moments.cholesky()?.l().try_inverse()?;
        let mut distances: Vec<f64> = all.iter().map(|x| (&whitening * x).norm()).collect();
        let place = (WITHIN * (distances.len() - 1) as f64) as usize;
        let (_, unit, _) = distances.select_nth_unstable_by(place, f64::total_cmp);
        let scaled = whitening.transpose() / *unit;
        DataEnvelope::new(scaled.iter().map(|w| *w as f32).collect(), network).ok()
    }

    /// The envelope for `network` whose matrix W is `whitening`, in row-major order.
    ///
    /// # Errors
    /// If the size of the matrix differs from the number of the network's features, or an entry is not finite.
    pub fn new(whitening: Vec<f32>, network: &Dense) -> Result<DataEnvelope, String> {
        let features = features(network, &[0.0; INPUTS]).1;
        if whitening.len() != features * features {
            let found = whitening.len();
            return Err(format!("its data envelope has {found} numbers, not {features}²"));
        }
        if !whitening.iter().all(|w| w.is_finite()) {
            return Err("its data envelope has an entry that is not a finite number".into());
        }
        Ok(DataEnvelope { whitening })
    }

    /// The matrix W in row-major order.
    pub fn whitening(&self) -> &[f32] {
        &self.whitening
    }

    /// Number of features, which is the number of rows and columns of W.
    pub fn features(&self) -> usize {
        self.whitening.len().isqrt()
    }

    /// Distance of a point from the training data. `inputs` are the scaled inputs of `network` at the point.
    pub fn distance(&self, network: &Dense, inputs: &[f64; INPUTS]) -> f64 {
        let (features, count) = features(network, inputs);
        let rows = self.whitening.chunks_exact(count);
        let product = |row: &[f32]| -> f64 {
            row.iter().zip(&features).map(|(w, x)| f64::from(*w) * x).sum()
        };
        rows.map(|row| product(row).powi(2)).sum::<f64>().sqrt()
    }
}

/// The features of a point (1, the inputs, the units of the last hidden layer), and their number.
fn features(network: &Dense, inputs: &[f64; INPUTS]) -> ([f64; MOST], usize) {
    let mut features = [0.0; MOST];
    features[0] = 1.0;
    features[1..=INPUTS].copy_from_slice(inputs);
    let mut units = [0.0; ON_STACK];
    let count = network.last_hidden(inputs, &mut units);
    features[1 + INPUTS..][..count].copy_from_slice(&units[..count]);
    (features, 1 + INPUTS + count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::residual::OUTPUTS;
    use greylag_num::stream;
    use rand::RngExt;

    #[test]
    fn the_distance_is_one_at_the_edge_of_the_data_and_grows_beyond() {
        let mut rng = stream::stream(4, &[]);
        let network = Dense::uniform(&[INPUTS, 16, 16, OUTPUTS], &mut rng).unwrap();
        let mut draw = |reach: f64| -> [f64; INPUTS] {
            std::array::from_fn(|_| reach * rng.random_range(-1.0..1.0))
        };
        let data: Vec<_> = (0..5000).map(|_| draw(1.0)).collect();
        let envelope = DataEnvelope::of(&network, &data).unwrap();
        let beyond = |points: &[[f64; INPUTS]]| {
            let out = points.iter().filter(|x| envelope.distance(&network, x) > 1.0).count();
            out as f64 / points.len() as f64
        };
        assert!((beyond(&data) - 0.001).abs() < 5e-4, "{}", beyond(&data));
        let fresh: Vec<_> = (0..5000).map(|_| draw(1.0)).collect();
        assert!(beyond(&fresh) < 0.01, "{}", beyond(&fresh));
        // a point that is outside the data in a single input has a distance above 1
        for k in 0..INPUTS {
            let mut point = [0.0; INPUTS];
            point[k] = 8.0;
            let distance = envelope.distance(&network, &point);
            assert!(distance > 1.0, "input {k}: {distance}");
        }
    }

    #[test]
    fn a_matrix_of_another_size_or_with_lost_numbers_is_refused() {
        let network = Dense::silent(&[INPUTS, 4, OUTPUTS], &mut stream::stream(1, &[])).unwrap();
        let count = 1 + INPUTS + 4;
        assert!(DataEnvelope::new(vec![0.0; count * count], &network).is_ok());
        assert!(DataEnvelope::new(vec![0.0; count], &network).is_err());
        assert!(DataEnvelope::new(vec![f32::NAN; count * count], &network).is_err());
        assert!(DataEnvelope::of(&network, &[]).is_none());
    }
}
