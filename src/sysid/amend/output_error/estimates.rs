//! Results of a finished output-error fit: estimates with their intervals, estimates from each flight alone, constants of each
//! flight, and notes for the user. The constants of a flight are sensor errors, misalignment angles and trims.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::gauss_newton::System;
use super::{Fit, Left, Search};
use crate::amend::error::AmendError;
use crate::amend::flight::{Flight, SENSORS};
use crate::amend::interval::{self, Covariance};
use crate::amend::learned::{self, Learned};
use crate::amend::parameters::{self, Free};
use crate::amend::result::{FittedFlight, FlightEstimate, OwnConstant, Parameter};
use crate::amend::shooting::Shot;
use greylag_model::{GreyBox, Known};

/// Half width of a 95 % interval in standard deviations of a normal distribution.
const NORMAL_95: f64 = 1.96;
/// A prior counts as adding no information to the bounds of a coefficient if its standard deviation is at least this fraction of
/// the distance between them.
const WIDE: f64 = 0.5;
/// The flights count as exciting a coefficient if its posterior standard deviation is below this fraction of its prior standard
/// deviation.
const LEARNED: f64 = 0.7;
/// Magnitude of the error correlation above which two coefficients are confounded.
const SAME: f64 = 0.9;
/// A fit counts as not converged if the last step changed a coefficient by more than this number of its standard deviations.
const UNSETTLED: f64 = 0.5;
/// A fit is rejected if the last step changed a coefficient by more than this number of its standard deviations. It is kept if
/// the search ended because no smaller step decreased the cost.
const LOST: f64 = 5.0;

/// A note for the user that names the held coefficients; `None` if there are none.
fn held_note(held: &[String]) -> Option<String> {
    (!held.is_empty()).then(|| {
        format!(
            "Undetermined by these flights, so held at the value of the model's file: {}. Their 95 % intervals would hold all \
             that is physically possible; fly what moves them, or state a standard deviation (sd) in the file.",
            held.join(", ")
        )
    })
}

/// Whether `value` lies at a bound of `free`, within a millionth of the distance between the bounds.
fn at_bound(free: &Free, value: f64) -> bool {
    let (low, high) = free.bounds;
    let at = |bound: f64| (value - bound).abs() <= 1e-6 * (high - low);
    at(low) || at(high)
}

impl Search<'_> {
    /// Holds the undetermined coefficients of the given model at their values in the model file, and returns their names.
    ///
    /// A coefficient is undetermined if its prior standard deviation is at least half the distance between its bounds, its 95 %
    /// interval contains both bounds, and its estimate is at neither of them. If all coefficients are undetermined, none is held.
    pub(super) fn hold_undetermined(&mut self) -> Vec<String> {
        let Some(cholesky) = self.system().information.cholesky() else { return Vec::new() };
        let inverse = cholesky.inverse();
        let undetermined = |(k, f): (usize, &Free)| {
            let (value, half) = (self.place.theta[k], NORMAL_95 * inverse[(k, k)].sqrt());
            let wide = f.width >= WIDE * (f.bounds.1 - f.bounds.0);
            // flights that drive an estimate to a bound contain information about the coefficient
            let inside = !at_bound(f, value);
            let holds_all = value - half <= f.bounds.0 && value + half >= f.bounds.1;
            !f.added && wide && inside && holds_all
        };
        let out: Vec<bool> = self.free.iter().enumerate().map(undetermined).collect();
        if !out.contains(&true) || !out.contains(&false) {
            return Vec::new();
        }
        let names = self.free.iter().zip(&out).filter(|(_, held)| **held);
        let names = names.map(|(f, _)| f.name.clone()).collect();
        let mut keep = out.iter().map(|held| !held);
        self.free.retain(|_| keep.next().unwrap_or(true));
        let mut keep = out.iter().map(|held| !held);
        self.place.theta.retain(|_| keep.next().unwrap_or(true));
        self.residuals = self.residuals_at(&self.place);
        self.change = (f64::INFINITY, 0);
        names
    }

    /// The result of the fit at the present estimates, with intervals.
    ///
    /// Its model is `given` with the estimated coefficients. The trims of the flights (constants that one flight adds to the
    /// coefficients) are not part of it. `held` names the undetermined coefficients.
    pub(super) fn finish(self, given: &GreyBox, held: &[String]) -> Result<Fit, AmendError> {
        let model_name = || self.base.name.clone();
        if self.change.0.is_nan() || (self.change.0 > LOST && !self.stuck) {
            return Err(AmendError::NotConverged {
                model: model_name(),
                iterations: self.iterations,
                change: self.change.0,
                parameter: self.free[self.change.1].name.clone(),
            });
        }
        let system = self.system();
        let singular = || AmendError::Singular { model: model_name() };
        let scores: Vec<DVector<f64>> = (self.shots.iter().zip(&system.shots))
            .map(|(shot, normal)| {
                let mut score = DVector::zeros(system.gradient.len());
                for (a, p) in self.places(shot.flight).iter().enumerate() {
                    score[*p] = normal.gradient[a];
                }
                score
            })
            .collect();
        let covariance = interval::covariance(&system.information, &system.prior, &scores)
            .ok_or_else(singular)?;
        let sd = &covariance.sd;
        let learned = |(k, f): (usize, &Free)| sd[k] < LEARNED * f.width;
        if !self.free.iter().enumerate().any(learned) {
            return Err(AmendError::NoExcitation { model: model_name() });
        }
        let by_flight = self.by_flight(&system);
        let unsettled = self.unsettled();
        let astray = if unsettled.is_some() { self.change.0 } else { 0.0 };
        let wider = self.disagreement(sd, &by_flight).hypot(astray);
        let sd: Vec<f64> = sd.iter().map(|x| x * wider).collect();
        let mut by_flight = by_flight;
        by_flight.iter_mut().flatten().for_each(|e| e.sd *= wider);
        let parameters = self.parameters(&sd, &by_flight, &covariance);
        let flights = self.fitted_flights(&sd, &covariance);
        let mut model = parameters::with(given, &self.free, &self.place.theta);
        model.known = Arc::new(self.known(given, &sd));
        let weakened = self.shots.iter().filter(|s| s.weight < 0.5).count() + self.short;
        Ok(Fit {
            model,
            parameters,
            flights,
            residual_sd: self.residual_sd(),
            shots: self.shots.len(),
            weakened,
            left: self.left(),
            weights: self.weights,
            iterations: self.iterations,
            notes: self.notes(weakened, &unsettled).into_iter().chain(held_note(held)).collect(),
            unsettled,
        })
    }

    /// The constants of each flight and of the installation for the model's file, such as trims and sensor errors. `given` is the
    /// model before the fit.
    fn known(&self, given: &GreyBox, sd: &[f64]) -> Known {
        let place = |k: usize| self.free.len() + k * self.of_flight();
        let numbered = self.flights.iter().enumerate();
        let flights: Vec<Learned> = numbered
            .map(|(k, flight)| Learned {
                name: flight.prepared.name.as_str(),
                own: &self.place.own[k],
                sd: &sd[place(k)..place(k + 1)],
            })
            .collect();
        learned::known(&given.known, &flights, &self.asked)
    }

    fn fitted_flights(&self, sd: &[f64], covariance: &Covariance) -> Vec<FittedFlight> {
        let (size, constants) = (self.of_flight(), self.asked.constants());
        let count = self.flights.len();
        let place = |flight: usize, which: usize| self.free.len() + flight * size + which;
        // the mean over the flights is subtracted from each estimate, because the mean is confounded with a coefficient
        let beside_mean = |flight: usize, which: usize| {
            let value =
                |k: usize| self.place.own[k].unknowns(&self.asked).nth(which).unwrap_or(0.0);
            let weight = |k: usize| f64::from(u8::from(k == flight)) - 1.0 / count as f64;
            let pairs = (0..count).flat_map(|a| (0..count).map(move |b| (a, b)));
            let variance: f64 = pairs
                .map(|(a, b)| {
                    let (i, j) = (place(a, which), place(b, which));
                    weight(a) * weight(b) * sd[i] * sd[j] * covariance.correlation(i, j)
                })
                .sum();
            let by: f64 = (0..count).map(|k| weight(k) * value(k)).sum();
            [by, variance.max(0.0).sqrt()]
        };
        let one = |(k, flight): (usize, &&Flight)| {
            let sd = &sd[place(k, 0)..place(k + 1, 0)];
            let own = &self.place.own[k];
            let mut fitted =
                FittedFlight::new(&flight.prepared.name, flight.seconds(), &own.sensors, sd);
            let values = own.unknowns(&self.asked).zip(sd).enumerate().skip(SENSORS);
            for ((which, (value, sd)), constant) in values.zip(&constants) {
                let beside_mean = (count > 1).then(|| beside_mean(k, which));
                fitted.own.push(OwnConstant::new(constant, value, *sd, beside_mean));
            }
            fitted
        };
        self.flights.iter().enumerate().map(one).collect()
    }

    fn parameters(
        &self,
        sd: &[f64],
        by_flight: &[Vec<FlightEstimate>],
        covariance: &Covariance,
    ) -> Vec<Parameter> {
        let same = |k: usize| {
            let own = self.free.iter().enumerate().filter(|(_, f)| !f.added);
            let all = own.map(|(j, f)| (covariance.correlation(k, j).abs(), &f.name));
            let closest = all.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(c, _)| *c > SAME);
            closest.map(|(_, name)| name.clone())
        };
        let one = |(k, f): (usize, &Free)| {
            let value = self.place.theta[k];
            let half = NORMAL_95 * sd[k];
            Parameter {
                name: f.name.clone(),
                meaning: f.meaning,
                added: f.added,
                prior: f.prior,
                prior_sd: f.width,
                value,
                sd: sd[k],
                ci95: [value - half, value + half],
                at_bound: at_bound(f, value),
                by_flight: by_flight[k].clone(),
                same_as: if f.added { same(k) } else { None },
            }
        };
        self.free.iter().enumerate().map(one).collect()
    }

    /// For each coefficient, its estimates from each flight alone. They are first-order estimates: one Gauss–Newton step from the
    /// common optimum, with the normal equations of the flight and the prior.
    fn by_flight(&self, system: &System) -> Vec<Vec<FlightEstimate>> {
        let count = self.free.len();
        let mut all = vec![Vec::new(); count];
        for (number, flight) in self.flights.iter().enumerate() {
            let size = count + self.of_flight();
            let (mut information, mut gradient) =
                (DMatrix::zeros(size, size), DVector::zeros(size));
            let places = self.places(number);
            let unknowns = self.unknowns(&self.place);
            for (a, p) in places.iter().enumerate() {
                information[(a, a)] = system.prior[*p];
                gradient[a] = system.prior[*p] * unknowns[*p];
            }
            let own = self.shots.iter().zip(&system.shots).filter(|(s, _)| s.flight == number);
            for (_, normal) in own {
                information += &normal.information;
                gradient += &normal.gradient;
            }
            let Some(cholesky) = information.cholesky() else { continue };
            let inverse = cholesky.inverse();
            let step = -(&inverse * gradient);
            for (k, list) in all.iter_mut().enumerate() {
                list.push(FlightEstimate {
                    flight: flight.prepared.name.clone(),
                    value: self.place.theta[k] + step[k],
                    sd: inverse[(k, k)].sqrt(),
                });
            }
        }
        all
    }

    /// Factor by which the intervals are widened if the flights disagree (Birge ratio, at least 1).
    ///
    /// The factor is the root mean square difference between the estimates of single flights and the common estimate, in
    /// standard deviations of the difference. It accounts for errors that are constant within a flight, for example the delay of
    /// a sensor.
    fn disagreement(&self, sd: &[f64], by_flight: &[Vec<FlightEstimate>]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        for (k, f) in self.free.iter().enumerate() {
            for own in by_flight[k].iter().filter(|e| e.sd < LEARNED * f.width) {
                let variance = own.sd.powi(2) - sd[k].powi(2);
                if variance > 0.1 * own.sd.powi(2) {
                    sum += (own.value - self.place.theta[k]).powi(2) / variance;
                    count += 1.0;
                }
            }
        }
        if count > 0.0 { f64::max(1.0, (sum / count).sqrt()) } else { 1.0 }
    }

    fn left(&self) -> Vec<Left> {
        let square = |r: &[[f64; 8]], k: usize| r.iter().map(|x| x[k] * x[k]).sum::<f64>();
        let shots = self.shots.iter().zip(&self.residuals).zip(&self.place.starts);
        let one = |((shot, r), from): ((&Shot, &Vec<[f64; 8]>), &[f64; 8])| Left {
            shot: [shot.flight, shot.segment, shot.start],
            output: std::array::from_fn(|k| square(r, k)),
            start: from.map(|x| x * x),
        };
        shots.map(one).collect()
    }

    fn residual_sd(&self) -> [f64; 8] {
        let residuals = &self.residuals;
        let count = residuals.iter().map(Vec::len).sum::<usize>() as f64;
        let square = |k: usize| residuals.iter().flatten().map(|r| r[k] * r[k]).sum::<f64>();
        std::array::from_fn(|k| (square(k) / count).sqrt())
    }

    /// A sentence on the coefficient that has not converged; `None` if all have converged.
    fn unsettled(&self) -> Option<String> {
        let (change, parameter) = (self.change.0, &self.free[self.change.1].name);
        (change > UNSETTLED).then(|| {
            format!(
                "the search had not settled after {} iterations: {parameter} still moved by {change:.2} \
                 standard deviations; leave out flights in which the aircraft spins or hits something, or \
                 fly more of what moves {parameter}",
                self.iterations
            )
        })
    }

    fn notes(&self, weakened: usize, unsettled: &Option<String>) -> Vec<String> {
        let mut notes: Vec<String> = unsettled
            .iter()
            .map(|why| format!("{why}; all intervals are widened by that"))
            .collect();
        if weakened > 0 {
            notes.push(format!(
                "{weakened} of {} shots stray far from the flight (stall, spin, gusts) and were cut \
                 short or count less",
                self.shots.len()
            ));
        }
        notes
    }
}
