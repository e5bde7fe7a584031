//! Damped Gauss–Newton step of the output-error fit. The step keeps the bounds of the coefficients and their largest changes
//! per iteration. A shot is a part of a flight that is simulated from its own initial state (multiple shooting).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::Search;
use crate::amend::error::AmendError;
use crate::amend::flight::SENSORS;
use crate::amend::normal::{self, Normal, Place};
use crate::amend::parameters::Free;

/// Normal equations of all shots together. `prior` holds the inverse prior variances of the unknowns.
pub(super) struct System {
    pub(super) shots: Vec<Normal>,
    pub(super) information: DMatrix<f64>,
    pub(super) gradient: DVector<f64>,
    pub(super) prior: DVector<f64>,
}

impl Search<'_> {
    /// Deviations of the unknowns at `place` from their prior means: free coefficients, then the constants of each flight (sensor
    /// errors, misalignment angles, trims).
    pub(super) fn unknowns(&self, place: &Place) -> DVector<f64> {
        let coefficients = self.free.iter().zip(&place.theta).map(|(f, x)| x - f.prior);
        let mut all: Vec<f64> = coefficients.collect();
        for (own, expected) in place.own.iter().zip(&self.expected) {
            let mean = expected.iter().map(|[mean, _]| *mean).chain(std::iter::repeat(0.0));
            all.extend(own.unknowns(&self.asked).zip(mean).map(|(x, mean)| x - mean));
        }
        DVector::from_vec(all)
    }

    /// Number of constants that are estimated for each flight.
    pub(super) fn of_flight(&self) -> usize {
        SENSORS + self.asked.constants().len()
    }

    /// Inverse prior variances of the unknowns, in the order of `unknowns`.
    pub(super) fn prior(&self) -> DVector<f64> {
        let constants = self.asked.constants();
        let mut all: Vec<f64> = self.free.iter().map(|f| f.width).collect();
        for expected in &self.expected {
            all.extend(expected.iter().map(|[_, sd]| *sd));
            all.extend(constants.iter().map(|c| c.width));
        }
        DVector::from_vec(all.iter().map(|sd| sd.powi(-2)).collect())
    }

    /// Indices of the unknowns on which the shots of `flight` depend: all coefficients and the constants of this flight.
    pub(super) fn places(&self, flight: usize) -> Vec<usize> {
        let count = self.free.len();
        let size = self.of_flight();
        let own = count + flight * size;
        (0..count).chain(own..own + size).collect()
    }

    /// The normal equations at the present estimates, with the derivatives that were computed last.
    pub(super) fn system(&self) -> System {
        let one = |index: usize| {
            let (derivatives, residuals) = (&self.derivatives[index], &self.residuals[index]);
            let (shot, from) = (&self.shots[index], &self.place.starts[index]);
            normal::normal(derivatives, residuals, shot, from, &self.weights)
        };
        let shots: Vec<Normal> = (0..self.shots.len()).into_par_iter().map(one).collect();
        let prior = self.prior();
        let mut information = DMatrix::from_diagonal(&prior);
        let mut gradient = prior.component_mul(&self.unknowns(&self.place));
        for (shot, normal) in self.shots.iter().zip(&shots) {
            let places = self.places(shot.flight);
            for (a, p) in places.iter().enumerate() {
                gradient[*p] += normal.gradient[a];
                for (b, q) in places.iter().enumerate() {
                    information[(*p, *q)] += normal.information[(a, b)];
                }
            }
        }
        System { shots, information, gradient, prior }
    }

    /// Takes one damped step that decreases the cost. Up to eight increasing values of the damping are tried. Returns false if
    /// the cost decreases with none of them.
    pub(super) fn step(&mut self, system: &System, damping: &mut f64) -> Result<bool, AmendError> {
        let before = self.cost(&self.place, &self.residuals);
        for _ in 0..8 {
            let step = self.solve(system, *damping)?;
            let next = self.moved(system, &step);
            let residuals = self.residuals_at(&next);
            if self.cost(&next, &residuals) < before {
                self.change = self.in_deviations(system, &step);
                (self.place, self.residuals) = (next, residuals);
                *damping = (*damping / 10.0).max(1e-9);
                return Ok(true);
            }
            *damping = (*damping * 10.0).max(1e-3);
        }
        self.change = self.in_deviations(system, &self.solve(system, 1e-9)?);
        Ok(false)
    }

    /// Solves the damped normal equations. Steps of coefficients that would pass a limit of [`Self::room`] are held at it.
    fn solve(&self, system: &System, damping: f64) -> Result<DVector<f64>, AmendError> {
        let singular = || AmendError::Singular { model: self.base.name.clone() };
        let mut held: Vec<Option<f64>> = vec![None; system.gradient.len()];
        let scale = system.information.diagonal().map(|d| d.sqrt().recip());
        for _ in 0..=self.free.len() {
            let mut matrix = system.information.clone();
            let mut right = -&system.gradient;
            for (k, known) in held.iter().enumerate().filter_map(|(k, h)| h.map(|h| (k, h))) {
                right -= system.information.column(k) * known;
                matrix.row_mut(k).fill(0.0);
                matrix.column_mut(k).fill(0.0);
                matrix[(k, k)] = system.information[(k, k)];
            }
            for (k, known) in held.iter().enumerate().filter_map(|(k, h)| h.map(|h| (k, h))) {
                right[k] = system.information[(k, k)] * known;
            }
            // the matrix is scaled to a unit diagonal, so that the effect of the damping does not depend on the units
            for (a, b) in (0..scale.len()).flat_map(|a| (0..scale.len()).map(move |b| (a, b))) {
                matrix[(a, b)] *= scale[a] * scale[b];
            }
            right.component_mul_assign(&scale);
            for k in 0..scale.len() {
                matrix[(k, k)] += damping * f64::from(u8::from(held[k].is_none()));
            }
            let mut step = matrix.cholesky().ok_or_else(singular)?.solve(&right);
            step.component_mul_assign(&scale);
            let beyond = self.free.iter().enumerate().find_map(|(k, f)| {
                let (low, high) = self.room(k, f);
                let outside = step[k] < low - 1e-12 || step[k] > high + 1e-12;
                (held[k].is_none() && outside).then(|| (k, step[k].clamp(low, high)))
            });
            match beyond {
                Some((k, limit)) => held[k] = Some(limit),
                None => return Ok(step),
            }
        }
        Err(singular())
    }

    /// Largest decrease (a negative number) and largest increase of coefficient `k` in one step.
    fn room(&self, k: usize, f: &Free) -> (f64, f64) {
        let here = self.place.theta[k];
        ((f.bounds.0 - here).max(-f.stride), (f.bounds.1 - here).min(f.stride))
    }

    fn moved(&self, system: &System, step: &DVector<f64>) -> Place {
        let mut next = self.place.clone();
        let count = self.free.len();
        for (k, f) in self.free.iter().enumerate() {
            next.theta[k] = (next.theta[k] + step[k]).clamp(f.bounds.0, f.bounds.1);
        }
        let step_of = step.as_slice()[count..].chunks(self.of_flight());
        for (own, step) in next.own.iter_mut().zip(step_of) {
            own.step(&self.asked, step);
        }
        for ((shot, normal), from) in
            self.shots.iter().zip(&system.shots).zip(next.starts.iter_mut())
        {
            let places = self.places(shot.flight);
            let own = DVector::from_iterator(places.len(), places.iter().map(|p| step[*p]));
            let change = normal.start_step(&own);
            from.iter_mut().zip(change).for_each(|(x, d)| *x += d);
        }
        next
    }

    /// The largest change of any coefficient, in standard deviations of its estimate, and the index of this coefficient.
    pub(super) fn in_deviations(&self, system: &System, step: &DVector<f64>) -> (f64, usize) {
        let Some(cholesky) = system.information.clone().cholesky() else {
            return (f64::INFINITY, 0);
        };
        let inverse = cholesky.inverse();
        let change = |k: usize| step[k].abs() / inverse[(k, k)].sqrt();
        let all = (0..self.free.len()).map(|k| (change(k), k));
        all.fold((0.0, 0), |a, b| if b.0 > a.0 { b } else { a })
    }
}
