//! Evidence for each candidate, a physical effect that the model may lack. It is the smaller of the penalised likelihood gain (as
//! in the BIC) and a Wald statistic with a block-robust covariance. The data are whitened regressor columns and residuals, from
//! which the model's own coefficients have been projected out. Blocks are sections of the flights.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::regression::projected::{Grams, scaled_inverse};

/// A point at which a candidate is linearised.
#[derive(Clone, Debug)]
pub struct Point {
    /// Values of all coefficients of the candidate at this point.
    pub values: Vec<f64>,
    /// Index of the column with the candidate's contribution to the forces and moments at this point. `None` for a linear
    /// candidate, which is linearised at zero contribution.
    pub contribution: Option<usize>,
    /// Free coefficients, each with its index in `values`, the index of the column with the derivative, and the range of values
    /// in which the linearisation is used.
    pub free: Vec<(usize, usize, [f64; 2])>,
}

/// A candidate effect, with the indices of its regressor columns.
#[derive(Clone, Debug)]
pub struct Trial {
    /// Identifier of the effect.
    pub id: &'static str,
    /// Points of linearisation; a linear candidate has a single point.
    pub points: Vec<Point>,
    /// Number of independent rows n of the regression in the channels in which the effect acts.
    pub support: f64,
    /// Channels in which the effect acts: D, L, Y, l, m, n.
    pub channels: [bool; 6],
}

/// Score of a candidate.
#[derive(Clone, Debug)]
pub struct Score {
    /// Evidence: the smaller of `fall` − d ln n and `wald`, for d free coefficients and n independent rows.
    pub evidence: f64,
    /// Block-robust Wald statistic of the free coefficients.
    pub wald: f64,
    /// Ranking criterion: the geometric mean of penalised gain and Wald statistic, or the evidence if that is not
    /// positive. A ranking by evidence would favour strong effects that are evenly spread over the blocks.
    pub order: f64,
    /// Reduction of the whitened residual sum of squares by the candidate.
    pub fall: f64,
    /// Estimated values of all coefficients of the effect.
    pub values: Vec<f64>,
    /// Standard deviations of the free coefficients; zero for the other coefficients.
    pub deviations: Vec<f64>,
    /// The columns whose weighted sum is the fitted contribution, each as index and weight.
    pub weights: Vec<(usize, f64)>,
    /// Index of the point of linearisation among the candidate's points.
    pub point: usize,
}

/// Products of the candidate columns with a residual. The residual is measured or drawn at random.
pub struct Draw {
    /// Products summed over all blocks and the prior's pseudo-observations.
    pub total: DVector<f64>,
    /// Products within each block.
    pub blocks: Vec<DVector<f64>>,
}

impl Draw {
    /// The products with the measured residual.
    pub fn measured(p: &Grams) -> Draw {
        let last = p.total.ncols() - 1;
        let of = |m: &DMatrix<f64>| m.view((0, last), (last, 1)).column(0).into_owned();
        Draw { total: of(&p.total), blocks: p.blocks.iter().map(|b| of(b)).collect() }
    }
}

impl Trial {
    /// Score of the candidate for the residual of `draw`. It is computed at the point of linearisation with the largest
    /// reduction of the residual sum of squares. `None` if no point can be used.
    pub fn score(&self, p: &Grams, draw: &Draw) -> Option<Score> {
        let scores = (0..self.points.len()).filter_map(|k| self.score_at(p, draw, k));
        scores.max_by(|a, b| a.fall.total_cmp(&b.fall))
    }

    fn score_at(&self, p: &Grams, draw: &Draw, place: usize) -> Option<Score> {
        let point = &self.points[place];
        let columns: Vec<usize> = point.free.iter().map(|f| f.1).collect();
        let gram = select(&p.total, &columns);
        let inverse = scaled_inverse(&gram)?;
        let mut product = pick(&draw.total, &columns);
        if let Some(own) = point.contribution {
            product -=
                DVector::from_iterator(columns.len(), columns.iter().map(|c| p.total[(*c, own)]));
        }
        let step = self.within(point, &gram, &product, &inverse * &product);
        let mut weights: Vec<(usize, f64)> =
            columns.iter().copied().zip(step.0.iter().copied()).collect();
        weights.extend(point.contribution.map(|c| (c, 1.0)));
        let (linear, square) = along(&weights, &p.total, &draw.total);
        let fall = 2.0 * linear - square;
        let gain = fall - columns.len() as f64 * self.support.max(2.0).ln();
        let whole = point.contribution.is_none() && !step.1;
        let (wald, deviations) = if whole {
            joint_wald(p, draw, &columns, &inverse, &weights, &step.0)
        } else {
            let wald = ray_wald(p, draw, &weights, linear, square);
            (wald, joint_wald(p, draw, &columns, &inverse, &weights, &step.0).1)
        };
        let mut values = point.values.clone();
        let mut all_deviations = vec![0.0; values.len()];
        for (k, (index, _, _)) in point.free.iter().enumerate() {
            values[*index] += step.0[k];
            all_deviations[*index] = deviations[k];
        }
        Some(Score {
            evidence: gain.min(wald),
            order: if gain.min(wald) > 0.0 { (gain * wald).sqrt() } else { gain.min(wald) },
            wald,
            fall,
            values,
            deviations: all_deviations,
            weights,
            point: place,
        })
    }

    /// Limits `step` to the range of the linearisation, one coefficient after the other. Returns the limited step, and whether
    /// a coefficient was limited.
    fn within(
        &self,
        point: &Point,
        gram: &DMatrix<f64>,
        product: &DVector<f64>,
        mut step: DVector<f64>,
    ) -> (DVector<f64>, bool) {
        let mut held = vec![false; step.len()];
        for _ in 0..step.len() {
            let Some(k) = (0..step.len()).find(|k| {
                let (index, _, [low, high]) = point.free[*k];
                let value = point.values[index] + step[*k];
                !held[*k] && !(low..=high).contains(&value)
            }) else {
                break;
            };
            let (index, _, [low, high]) = point.free[k];
            held[k] = true;
            step[k] = (point.values[index] + step[k]).clamp(low, high) - point.values[index];
            // the other coefficients are estimated again with the limited coefficients fixed
            let open: Vec<usize> = (0..step.len()).filter(|i| !held[*i]).collect();
            if open.is_empty() {
                break;
            }
            let fixed: Vec<usize> = (0..step.len()).filter(|i| held[*i]).collect();
            let rest = DVector::from_iterator(
                open.len(),
                open.iter().map(|i| {
                    product[*i] - fixed.iter().map(|j| gram[(*i, *j)] * step[*j]).sum::<f64>()
                }),
            );
            if let Some(inverse) = scaled_inverse(&select(gram, &open)) {
                let solved = inverse * rest;
                open.iter().zip(solved.iter()).for_each(|(i, x)| step[*i] = *x);
            }
        }
        (step, held.iter().any(|h| *h))
    }
}

/// Products x'b and x'Sx, where `weights` holds the entries of x, `product` is b and `gram` is S.
fn along(weights: &[(usize, f64)], gram: &DMatrix<f64>, product: &DVector<f64>) -> (f64, f64) {
    let linear = weights.iter().map(|(c, w)| w * product[*c]).sum();
    (linear, quadratic(weights, weights, gram))
}

/// Bilinear form u'Sv, where `gram` is S. The vectors u and v are given by indices and entries.
pub fn quadratic(u: &[(usize, f64)], v: &[(usize, f64)], gram: &DMatrix<f64>) -> f64 {
    u.iter().map(|(i, a)| v.iter().map(|(j, b)| a * b * gram[(*i, *j)]).sum::<f64>()).sum()
}

fn select(matrix: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(columns.len(), columns.len(), |i, j| matrix[(columns[i], columns[j])])
}

fn pick(vector: &DVector<f64>, columns: &[usize]) -> DVector<f64> {
    DVector::from_iterator(columns.len(), columns.iter().map(|c| vector[*c]))
}

/// Wald statistic θ' V⁻¹ θ of the coefficients `theta`, and their standard deviations. The covariance V is estimated from
/// the scatter of the blocks.
fn joint_wald(
    p: &Grams,
    draw: &Draw,
    columns: &[usize],
    inverse: &DMatrix<f64>,
    weights: &[(usize, f64)],
    theta: &DVector<f64>,
) -> (f64, Vec<f64>) {
    let mut meat = select(p.prior, columns);
    let count = p.blocks.len() as f64;
    let correction = count / (count - 1.0).max(1.0);
    for (gram, product) in p.blocks.iter().zip(&draw.blocks) {
        let explained =
            columns.iter().map(|c| weights.iter().map(|(d, w)| w * gram[(*c, *d)]).sum::<f64>());
        let score = pick(product, columns) - DVector::from_iterator(columns.len(), explained);
        meat += correction * &score * score.transpose();
    }
    let covariance = inverse * meat * inverse;
    // by chance, the scatter of the blocks may be smaller than the white noise requires
    let deviations =
        (0..columns.len()).map(|k| covariance[(k, k)].max(inverse[(k, k)]).sqrt()).collect();
    let wald = scaled_inverse(&covariance).map_or(0.0, |v| theta.dot(&(v * theta)));
    (wald, deviations)
}

/// Wald statistic for the amplitude of a contribution whose shape is fixed by `weights`. Zero if the amplitude is not positive.
fn ray_wald(p: &Grams, draw: &Draw, weights: &[(usize, f64)], linear: f64, square: f64) -> f64 {
    if square <= 0.0 {
        return 0.0;
    }
    let amount = linear / square;
    let count = p.blocks.len() as f64;
    let correction = count / (count - 1.0).max(1.0);
    let mut meat = quadratic(weights, weights, p.prior);
    for (gram, product) in p.blocks.iter().zip(&draw.blocks) {
        let (l, s) = along(weights, gram, product);
        meat += correction * (l - s * amount).powi(2);
    }
    if amount > 0.0 && meat > 0.0 { linear * linear / meat } else { 0.0 }
}

/// Two standard deviations of the first coefficient in a joint fit of `columns`: that due to white noise, and that computed
/// from the scatter of the blocks of `null`, a draw of pure noise. `None` if the fit is singular.
pub fn deviations(p: &Grams, null: &Draw, columns: &[usize]) -> Option<(f64, f64)> {
    let inverse = scaled_inverse(&select(&p.total, columns))?;
    let zero = DVector::zeros(columns.len());
    let (_, deviations) = joint_wald(p, null, columns, &inverse, &[], &zero);
    Some((inverse[(0, 0)].max(0.0).sqrt(), deviations[0]))
}
