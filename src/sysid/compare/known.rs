//! Prediction errors with and without the constants of flights that a model's file holds, such as sensor errors and trims.
//!
//! The errors are those of free runs: simulations of the model with the recorded controls.

use super::free_run;
use super::result::{HorizonScore, KnownUse};
use crate::weak_form::prepared::Prepared;
use greylag_model::GreyBox;

/// The flights for which the file of `model` has constants, and the free-run errors over all flights without the constants,
/// at `horizons_s` (s). `None` if the file has no constants for these flights.
pub fn used(model: &GreyBox, flights: &[Prepared], horizons_s: &[f64]) -> Option<KnownUse> {
    let (own, shared): (Vec<&Prepared>, Vec<_>) =
        flights.iter().partition(|f| model.known.names(&f.name));
    let names = |all: &[&Prepared]| all.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
    let by_installation = model.known.installation.as_ref().map_or(Vec::new(), |_| names(&shared));
    let flights_of_own = names(&own);
    if flights_of_own.is_empty() && by_installation.is_empty() {
        return None;
    }
    let mut bare = model.clone();
    bare.known = Default::default();
    let (runs, _) = free_run::fly(&bare, flights, horizons_s);
    let without = horizons_s.iter().map(|h| runs.score(*h)).collect();
    Some(KnownUse { flights: flights_of_own, by_installation, without })
}

impl KnownUse {
    /// Sentence about the constants, and about the errors with them (`with`) and without them at the longest horizon that a
    /// run reaches. `None` if no run reaches any horizon.
    pub fn sentence(&self, with: &[HorizonScore]) -> Option<String> {
        let reached = with.iter().zip(&self.without).filter(|(a, b)| a.runs > 0 && b.runs > 0);
        let both = reached.max_by(|(a, _), (b, _)| a.horizon_s.total_cmp(&b.horizon_s))?;
        let mut what = Vec::new();
        if !self.flights.is_empty() {
            what.push(format!("constants of their own for {}", self.flights.join(", ")));
        }
        if !self.by_installation.is_empty() {
            what.push(format!("the installation for {}", self.by_installation.join(", ")));
        }
        let (with, without) = both;
        Some(format!(
            "The flights' constants in the model's file are used ({}): the error over {} s is {:.5} with it, {:.5} without.",
            what.join("; "),
            with.horizon_s,
            with.rmse_scaled,
            without.rmse_scaled
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sentence_is_on_the_longest_horizon_in_any_order_of_horizons() {
        let at = HorizonScore::of_three;
        let without = vec![at(10.0, 0.5), at(1.0, 0.4)];
        let used = KnownUse { flights: vec!["a".into()], by_installation: Vec::new(), without };
        let said = used.sentence(&[at(10.0, 0.2), at(1.0, 0.1)]).unwrap();
        assert!(said.contains("over 10 s is 0.20000 with it, 0.50000 without"), "{said}");
    }
}
