//! Results of the fit of a round. A round is the model linearised over the flights, with effects that it may lack as
//! candidates. The fit re-estimates the model's coefficients and the sensor errors. A [`Score`] is the fit of one candidate.

use super::Round;
use crate::diagnose::regression::catalogue::{self};
use crate::diagnose::regression::cells::Placed;
use crate::diagnose::regression::columns::{combine, of_body};
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::rank::Score;
use greylag_model::GreyBox;

impl Round {
    /// The model with the coefficients from a joint fit with the candidate of `score`. The candidate itself is not added to the
    /// model.
    pub fn with(&self, score: &Score) -> GreyBox {
        let p = &self.projected;
        let mut model = self.model.clone();
        let mut values: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
        for (k, place) in self.coefficients.iter().enumerate() {
            let given: f64 = score.weights.iter().map(|(c, w)| w * p.taken[(k, *c)]).sum();
            values[*place] += p.tuned[k] - given;
        }
        model.set_coefficients(&values);
        model
    }

    /// Largest change of a coefficient of the model in the fit, in standard deviations of its estimate. It is small after
    /// convergence.
    pub fn stride(&self) -> f64 {
        let p = &self.projected;
        let of = |k: usize| p.tuned[k].abs() / p.covariance[(k, k)].sqrt();
        (0..self.coefficients.len()).map(of).filter(|x| x.is_finite()).fold(0.0, f64::max)
    }

    /// For each flight: the residual of forces (N) and moments (N m) after the fit without candidates.
    pub fn tuned_residual(&self) -> Vec<Column> {
        let na = self.known.len();
        let of = |placed: &Placed| {
            let (mut columns, mut weights) = (Vec::new(), Vec::new());
            for (place, column) in placed {
                if *place < na {
                    weights.push(-self.projected.tuned[*place]);
                    columns.push(column.clone());
                } else if *place == self.last {
                    weights.push(1.0);
                    columns.push(column.clone());
                }
            }
            combine(&columns, &weights)
        };
        self.placed.iter().map(of).collect()
    }

    /// For each flight: the fitted contribution of the candidate of `score` to forces (N) and moments (N m).
    pub fn contribution(&self, score: &Score) -> Vec<Column> {
        let na = self.known.len();
        let of = |placed: &Placed| {
            let columns: Vec<Column> = score
                .weights
                .iter()
                .filter_map(|(c, _)| {
                    placed.iter().find(|(p, _)| *p == na + c).map(|(_, column)| column.clone())
                })
                .collect();
            let weights: Vec<f64> = score.weights.iter().map(|(_, w)| *w).collect();
            combine(&columns, &weights)
        };
        self.placed.iter().map(of).collect()
    }

    /// For each flight: the residual of forces (N) and moments (N m) after a joint fit of the candidate of `score`, the model and
    /// the sensor errors.
    pub fn residual_with(&self, score: &Score) -> Vec<Column> {
        let added = self.contribution(score);
        let given = |place: usize| -> f64 {
            score.weights.iter().map(|(c, w)| w * self.projected.taken[(place, *c)]).sum()
        };
        let moved = |placed: &Placed| {
            let known = placed.iter().filter(|(place, _)| *place < self.known.len());
            known.map(|(place, column)| (column.clone(), given(*place))).unzip()
        };
        let of = |((residual, added), placed): ((Column, Column), &Placed)| {
            let (mut columns, mut weights): (Vec<Column>, Vec<f64>) = moved(placed);
            columns.extend([residual, added]);
            weights.extend([1.0, -1.0]);
            combine(&columns, &weights)
        };
        self.tuned_residual().into_iter().zip(added).zip(&self.placed).map(of).collect()
    }

    /// For each channel (force or moment): the reduction of the whitened residual sum of squares by the candidate of `score`.
    pub fn taken_by(&self, score: &Score) -> [f64; 6] {
        let mut taken = [0.0; 6];
        let last = self.projected.width();
        for (cell, rows) in self.cells.list.iter().zip(&self.projected.rows) {
            for row in rows.row_iter() {
                let x: f64 = score.weights.iter().map(|(c, w)| w * row[*c]).sum();
                taken[cell.channel] += x * (2.0 * row[last] - x);
            }
        }
        taken
    }

    /// Indices of the channels in descending order of the reduction by the candidate of `score`. Channels with less than a tenth
    /// of the largest reduction are left out.
    pub fn channels_of(&self, score: &Score) -> Vec<usize> {
        let taken = self.taken_by(score);
        let most = taken.iter().fold(0.0_f64, |a, b| a.max(*b));
        let mut channels: Vec<usize> =
            (0..6).filter(|c| taken[*c] > 0.1 * most && taken[*c] > 0.0).collect();
        channels.sort_by(|a, b| taken[*b].total_cmp(&taken[*a]));
        channels
    }

    /// The model with coefficients estimated from data and prior. Steps of nonlinear coefficients are limited. Coefficients of
    /// added effects stay within their bounds. Changes of mass and inertia are reduced until the body is physically possible.
    pub fn tuned(&self) -> GreyBox {
        let mut model = self.model.clone();
        let linear = model.linear();
        let mut values: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
        for (k, place) in self.coefficients.iter().enumerate() {
            let mut step = self.projected.tuned[k];
            if !linear[*place] {
                let reach = catalogue::REACH * values[*place].abs();
                step = step.clamp(-reach, reach);
            }
            values[*place] += step;
            if *place >= self.given
                && let Some((low, high)) = bounds(&model, *place)
            {
                values[*place] = values[*place].clamp(low, high);
            }
        }
        model.set_coefficients(&values);
        if self.model.body.may_become(&model.body) {
            return model;
        }
        let of_body: Vec<usize> =
            self.coefficients.iter().copied().filter(|k| of_body(&self.model, *k)).collect();
        let given: Vec<f64> = self.model.coefficients().iter().map(|c| c.value).collect();
        let less = (0..100).rev().map(|percent| {
            let mut less = values.clone();
            for k in &of_body {
                less[*k] = given[*k] + 0.01 * f64::from(percent) * (values[*k] - given[*k]);
            }
            less
        });
        for values in less {
            model.set_coefficients(&values);
            if self.model.body.may_become(&model.body) {
                break;
            }
        }
        model
    }
}

/// Physical bounds of the coefficient with the index `index`; `None` if the coefficient belongs to no effect.
fn bounds(model: &GreyBox, index: usize) -> Option<(f64, f64)> {
    let (id, own) = model.coefficients()[index].name.split_once('.')?;
    let about = model.effects().find(|about| about.id == id)?;
    about.coefficients.iter().find(|c| c.name == own).map(|c| model.size().bounds(c))
}
