//! Shots and starting point of the output-error fit. A shot is a short stretch of a flight that is simulated from its own initial
//! state.

use rayon::prelude::*;

use super::Search;
use crate::amend::error::AmendError;
use crate::amend::normal::{self, Place};
use crate::amend::parameters;
use crate::amend::shooting::{self, Shot};
use greylag_num::statistics::quantile;

impl Search<'_> {
    /// Cuts the flights into shots of `length_s` (s), and shortens the shots in which the present model diverges.
    pub(super) fn shots_of(&mut self, length_s: f64) -> Result<(), AmendError> {
        self.shots = shooting::cut(&self.flights, length_s);
        self.place.starts = vec![[0.0; 8]; self.shots.len()];
        let model = parameters::with(self.base, &self.free, &self.place.theta);
        let acting = normal::acting(&model, &self.flights, &self.place);
        let reach: Vec<usize> = self
            .shots
            .par_iter()
            .map(|shot| {
                let flight = &self.flights[shot.flight].prepared;
                let own = &self.place.own[shot.flight];
                let start = shooting::start(shot, flight, own, &[0.0; 8]);
                let controls = &acting[shot.flight][shot.segment];
                let model = normal::of_flight(&model, own);
                shooting::fly(&model, flight, shot, controls, start).len()
            })
            .collect();
        self.short = 0;
        for (shot, reach) in self.shots.iter_mut().zip(&reach) {
            if *reach < shot.steps {
                // only the first three quarters of the run before divergence are used
                shot.steps = reach * 3 / 4;
                self.short += 1;
            }
        }
        let worth = |shot: &Shot| {
            shot.steps as f64 * self.flights[shot.flight].prepared.dt >= shooting::SHORTEST_S
        };
        let left = self.shots.iter().filter(|s| worth(s)).count();
        if 2 * left < self.shots.len() {
            let reach: Vec<f64> = self
                .shots
                .iter()
                .zip(reach)
                .map(|(s, r)| r as f64 * self.flights[s.flight].prepared.dt)
                .collect();
            let reach_s = quantile(&reach, 0.5);
            return Err(AmendError::Diverges { model: self.base.name.clone(), reach_s });
        }
        self.shots.retain(worth);
        self.place.starts.truncate(self.shots.len());
        self.residuals = self.residuals_at(&self.place);
        Ok(())
    }

    /// Chooses the starting point: the equation-error estimate or `given`, the coefficients of the model file. The choice is the
    /// one with the smaller residuals in shots of `length_s` (s). A kink of a table or a delayed sensor can bias the
    /// equation-error estimate.
    pub(super) fn start_from_the_closer(&mut self, given: &[f64], length_s: f64) {
        self.shots = shooting::cut(&self.flights, length_s);
        self.place.starts = vec![[0.0; 8]; self.shots.len()];
        let other = Place { theta: given.to_vec(), ..self.place.clone() };
        if self.distance(&other) < self.distance(&self.place) {
            self.place.theta = other.theta;
        }
    }

    /// Sum over the shots of the root of their weighted mean square residual. A single diverged shot does not dominate this sum.
    fn distance(&self, place: &Place) -> f64 {
        let square =
            |r: &[f64; 8]| (0..8).map(|k| self.weights.output[k] * r[k] * r[k]).sum::<f64>();
        let root = |r: &Vec<[f64; 8]>| (r.iter().map(square).sum::<f64>() / r.len() as f64).sqrt();
        self.residuals_at(place).iter().map(root).sum()
    }
}
