//! A cheap approximation of the critics, two neural networks that estimate the return from the terminal state of a plan. It is
//! a linear function, fitted in each tick to terminal states that the critics have evaluated.
//!
//! The critics are piecewise linear, and the candidate plans of one tick end close together. A linear function therefore
//! approximates them well. It needs no training and no file.

use nalgebra::{SMatrix, SVector};

use super::rollout::Worth;
use crate::policy::OBSERVATIONS as N;
use greylag_num::Real;

/// Ridge regularisation, as a fraction of the variance of each component of the observation. Without it, the slope would be
/// undetermined in every direction in which the terminal states do not vary.
const RIDGE: f64 = 1e-4;

/// The fitted function v(o) = level + slope · (o − centre). The observation o describes a state as in eq. (28) of \[GSFM26\] (see
/// `src/lib.rs`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Surrogate {
    centre: [f64; N],
    slope: [f64; N],
    level: f64,
}

impl Surrogate {
    /// The least-squares fit to the critics' values in `worth`, the rollout results of some candidates. Candidates with values
    /// that are not finite are left out. `None` if fewer than 2 N candidates remain, or if the fit is not finite.
    pub fn fit(worth: &[Worth]) -> Option<Surrogate> {
        let ends = || worth.iter().flat_map(ends_of).filter(|(o, v)| (o.sum() + v).is_finite());
        let count = ends().count();
        if count < 2 * N {
            return None;
        }
        let n = count as f64;
        let (centre, level) = ends()
            .fold((SVector::zeros(), 0.0), |(o, v), (end, value)| (o + end / n, v + value / n));
        let mut square = SMatrix::<f64, N, N>::zeros();
        let mut product = SVector::<f64, N>::zeros();
        for (end, value) in ends() {
            let off = end - centre;
            square.ger(1.0, &off, &off, 1.0);
            product.axpy(value - level, &off, 1.0);
        }
        for i in 0..N {
            // the smallest positive number keeps the matrix invertible if a component does not vary: its slope is then zero
            square[(i, i)] += RIDGE * square[(i, i)] + f64::MIN_POSITIVE;
        }
        let slope = square.cholesky()?.solve(&product);
        let surrogate = Surrogate { centre: centre.into(), slope: slope.into(), level };
        surrogate.slope.iter().all(|x| x.is_finite()).then_some(surrogate)
    }

    /// Evaluates the function at the observation `seen`, or at several observations in the lanes of a SIMD type.
    #[inline(always)]
    pub fn value<R: Real>(&self, seen: &[R; N]) -> R {
        let mut value = R::from_f64(self.level);
        let mut i = 0;
        while i < N {
            value += (seen[i] - R::from_f64(self.centre[i])).scale(self.slope[i]);
            i += 1;
        }
        value
    }
}

/// The terminal observations of the candidates in one SIMD block, each with the critics' value.
fn ends_of(worth: &Worth) -> impl Iterator<Item = (SVector<f64, N>, f64)> {
    (0..worth.value.len()).map(|lane| {
        let end = SVector::from_fn(|i, _| f64::from(worth.end[i][lane]));
        (end, f64::from(worth.value[lane]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Terminal states of which eleven of the sixteen components vary. Their values are a linear function of these components.
    fn valued(block: usize) -> Worth {
        let mut worth = Worth::NONE;
        for lane in 0..worth.value.len() {
            let mut value = -3.0;
            for i in 0..11 {
                let k = (16 * block + lane) * 11 + i;
                worth.end[i][lane] = 0.5 + 0.01 * (k as f32 * 0.7).sin();
                value += 0.1 * (i as f32 - 4.0) * (worth.end[i][lane] - 0.5);
            }
            worth.value[lane] = value;
        }
        worth
    }

    #[test]
    fn a_plane_is_found_again_and_lost_candidates_are_left_out() {
        let mut worth = [valued(0), valued(1), valued(2), valued(3)];
        worth[1].value[3] = f32::NAN;
        worth[2].end[4][5] = f32::INFINITY;
        let surrogate = Surrogate::fit(&worth).unwrap();
        let other = valued(9);
        for lane in 0..other.value.len() {
            let end = std::array::from_fn(|i| f64::from(other.end[i][lane]));
            let off = surrogate.value(&end) - f64::from(other.value[lane]);
            assert!(off.abs() < 1e-5, "{off}");
        }
    }

    #[test]
    fn too_few_ends_make_no_plane() {
        assert_eq!(Surrogate::fit(&[valued(0)]), None);
        let mut lost = [valued(0), valued(1)];
        lost.iter_mut().for_each(|worth| worth.value[4..].fill(f32::NAN));
        assert_eq!(Surrogate::fit(&lost), None);
    }

    /// Equal terminal states give a function with slope zero.
    #[test]
    fn equal_ends_have_their_value() {
        let mut worth = [Worth::NONE; 2];
        worth.iter_mut().for_each(|worth| worth.value.fill(-2.5));
        let surrogate = Surrogate::fit(&worth).unwrap();
        assert_eq!(surrogate.value(&[1.0; N]), -2.5);
    }
}
