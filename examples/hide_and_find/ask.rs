//! Runs the diagnosis on a test case and records its answer.

use std::collections::BTreeMap;

use anyhow::Result;
use greylag::model::GreyBox;
use greylag::sysid::diagnose::{Candidate, Detail, Diagnosis, Options, diagnose};
use greylag::sysid::flight_path::reconstruction::Reconstruction;

use crate::cases::Case;
use crate::record::{Judged, Record};

/// Number of candidates of a diagnosis that are recorded.
const KEPT: usize = 10;

/// Answer of the diagnosis.
pub struct Answer {
    said: Diagnosis,
    /// Coefficients of each asserted effect by the effect's id, in the order of the catalogue.
    pub values: BTreeMap<String, Vec<f64>>,
}

/// Diagnoses which effects `model` lacks in the flights of `case`. `nulls` is the number of surrogate data sets without an
/// effect; `None` uses the default number.
pub fn ask(
    model: &GreyBox,
    flights: &[Reconstruction],
    case: &Case,
    nulls: Option<usize>,
) -> Result<Answer> {
    let usual = Options::default();
    let options = Options {
        seed: case.seed,
        without: case.without.clone(),
        detail: Detail::Lean,
        nulls: nulls.unwrap_or(usual.nulls),
        ..usual
    };
    let said = diagnose(model, flights, &options, &greylag::sysid::progress::ignore_progress)?;
    let asserted = said.effects.iter().filter(|c| c.asserted);
    let values = asserted.map(|c| (c.id.clone(), c.parameters.iter().map(|p| p.value).collect()));
    let values = values.collect();
    Ok(Answer { said, values })
}

impl Answer {
    /// Writes the answer into `record`.
    pub fn write_into(&self, record: &mut Record) {
        let effects = &self.said.effects;
        let id = |c: &Candidate| c.id.clone();
        record.verdict = format!("{:?}", self.said.verdict).to_lowercase();
        record.ranked = effects.iter().take(KEPT).map(id).collect();
        record.asserted = effects.iter().filter(|c| c.asserted).map(id).collect();
        record.instruments = seldom(&self.said);
        record.refused = effects.first().map_or_else(Vec::new, |c| c.refused.clone());
        let refused = effects.iter().filter(|c| !c.refused.is_empty());
        record.refusals = refused.map(|c| (id(c), c.refused.clone())).collect();
        let flights = effects.first().map_or(&[][..], |c| &c.by_flight);
        let flights = flights.iter().filter(|f| f.value.is_finite());
        record.by_flight = flights.map(|f| [f.value, f.sd]).collect();
        record.evidence = effects.iter().take(KEPT).map(|c| [c.evidence, c.threshold]).collect();
        record.judged = effects.iter().take(KEPT).map(judged).collect();
        record.learnable = self.said.learnable_remainder;
        let explanations = self.said.explanations.iter();
        record.explanations = explanations.map(|e| (e.id.clone(), e.probability)).collect();
        let told = effects.iter().enumerate().filter(|(k, c)| *k == 0 || c.asserted);
        record.alike = told.map(|(_, c)| (id(c), c.indistinguishable_from.clone())).collect();
        let least = |c: &Candidate| Some((c.id.clone(), c.minimum_detectable? * hidden(c)));
        record.minimum_detectable = effects.iter().filter_map(least).collect();
        record.reached = reached(record);
    }
}

fn judged(c: &Candidate) -> Judged {
    let status = serde_json::to_value(c.status).ok();
    Judged {
        status: status.and_then(|s| Some(s.as_str()?.to_owned())).unwrap_or_default(),
        stable: Some(c.selected_in_bootstraps).filter(|x| x.is_finite()),
        held_out: Some(c.heldout_error_reduction).filter(|x| x.is_finite()),
    }
}

/// Ids of the asserted installation and calibration errors. Delays are included if they exceed two samples.
fn seldom(said: &Diagnosis) -> Vec<String> {
    const LATE_S: f64 = 0.02;
    const IDS: [&str; 5] =
        ["axes_askew", "imu_gain", "vane_gain", "airspeed_offset", "heading_offset"];
    let is = |m: &&greylag::sysid::diagnose::Measurement| {
        IDS.contains(&m.id.as_str()) || (m.id == "clock_skew" && m.value.abs() > LATE_S)
    };
    let mut ids: Vec<String> =
        said.measurement.iter().filter(|m| m.asserted).filter(is).map(|m| m.id.clone()).collect();
    ids.sort();
    ids.dedup();
    ids
}

/// Amplitude as a multiple of the minimum detectable amplitude of the diagnosis. For a pair of effects it is the smaller
/// multiple. If the diagnosis has no minimum detectable amplitude, it is the recorded multiple.
fn reached(record: &Record) -> f64 {
    let truth = record.truth.iter().zip(&record.amplitudes);
    let multiples = truth.filter_map(|(id, amplitude)| {
        let multiple = amplitude.abs() / record.minimum_detectable.get(id)?;
        // a smaller rate limit is a stronger effect
        Some(if id == "rate_limit" { multiple.recip() } else { multiple })
    });
    let known = multiples.filter(|m| m.is_finite()).fold(f64::INFINITY, f64::min);
    if known.is_finite() { known } else { record.reached }
}

/// Ratio of the standard deviation of the hidden coefficient to that of the effect's first coefficient.
fn hidden(c: &Candidate) -> f64 {
    let place = if c.id == "drag_beta2" { 1 } else { 0 };
    let width = |k: usize| c.parameters.get(k).map_or(f64::NAN, |p| p.ci95[1] - p.ci95[0]);
    if place == 0 { 1.0 } else { width(place) / width(0) }
}
