//! Record of a case: one line of JSON.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::cases::Case;

/// A parameter of an asserted true effect, after the fit.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Found {
    /// Full name `effect.coefficient` of the parameter.
    pub name: String,
    /// Value that was hidden.
    pub truth: f64,
    /// Value that was fitted.
    pub value: f64,
    /// 95 % interval of the fitted value.
    pub ci95: [f64; 2],
}

/// Free-run errors over 5 s on held-out flights, scaled by x_c.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub struct HeldOut {
    /// Error of the tuned prior.
    pub tuned: f64,
    /// With what was asserted.
    pub amended: f64,
    /// With what is true, fitted in the same way.
    pub oracle: f64,
}

/// Seconds that the steps of a case took.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
pub struct Seconds {
    /// Time of flying, logging and reconstructing.
    pub flights: f64,
    /// Time of the diagnosis.
    pub diagnose: f64,
    /// Time of the fits.
    pub amend: f64,
}

/// A case with what came of it.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Record {
    /// Name of the case.
    pub key: String,
    /// `nulls`, `probes`, `effects`, `without` or `pairs`.
    pub part: String,
    /// Ids of the effects that the model lacked.
    pub truth: Vec<String>,
    /// How much of it.
    pub amplitudes: Vec<f64>,
    /// Amplitude as a multiple of the median minimum detectable one of the nulls, as requested.
    pub factor: f64,
    /// And as a multiple of what the case's own flights would have shown; of a pair, the smaller one.
    pub reached: f64,
    /// Why there is no answer, if there is none.
    pub failure: Option<String>,
    /// The answer in one word.
    pub verdict: String,
    /// Candidates as the diagnosis lists them.
    pub ranked: Vec<String>,
    /// Those that it asserts.
    pub asserted: Vec<String>,
    /// Error of the instruments' installation, if there is one.
    #[serde(default)]
    pub installed: Option<String>,
    /// Errors of the instruments that the diagnosis asserts, beyond biases, wind and clocks within a sample.
    #[serde(default)]
    pub instruments: Vec<String>,
    /// For each of those, and for the first, what cannot be distinguished from it.
    pub alike: BTreeMap<String, Vec<String>>,
    /// Why the first is not asserted; empty if it is.
    #[serde(default)]
    pub refused: Vec<String>,
    /// Why an effect that was examined is not asserted.
    #[serde(default)]
    pub refusals: BTreeMap<String, Vec<String>>,
    /// First coefficient of the first candidate as each flight has it, with standard deviation.
    #[serde(default)]
    pub by_flight: Vec<[f64; 2]>,
    /// Evidence and threshold of the first ten.
    pub evidence: Vec<[f64; 2]>,
    /// Smallest amplitude of each candidate that would have shown.
    pub minimum_detectable: BTreeMap<String, f64>,
    /// Parameters of true effects that were asserted.
    pub parameters: Vec<Found>,
    /// Effects that could not be fitted, with the reason.
    #[serde(default)]
    pub unfitted: Vec<String>,
    /// Errors on held-out flights; none if the truth could not be fitted.
    pub held_out: Option<HeldOut>,
    /// How long it took.
    pub seconds: Seconds,
}

impl Record {
    /// A record with what is known before the search.
    pub fn of(case: &Case) -> Record {
        Record {
            key: case.key(),
            part: case.part.into(),
            truth: case.truth(),
            amplitudes: case.missing.iter().map(|m| m.amplitude).collect(),
            factor: case.factor,
            reached: case.reached,
            installed: case.installed().map(|(name, _)| name.to_owned()),
            ..Record::default()
        }
    }

    /// A case that could not be flown or read.
    pub fn failed(case: &Case, why: &anyhow::Error) -> Record {
        Record { failure: Some(format!("{why:#}")), ..Record::of(case) }
    }

    /// Whether `id` is asserted, itself or by one that cannot be distinguished from it.
    pub fn names(&self, id: &str) -> bool {
        self.asserted.iter().any(|a| a == id || self.is_alike(a, id))
    }

    /// Whether the diagnosis finds `other` indistinguishable from `id`.
    pub fn is_alike(&self, id: &str, other: &str) -> bool {
        self.alike.get(id).is_some_and(|alike| alike.iter().any(|a| a == other))
    }
}

/// The records in a file; none if there is no file yet. A last line that was cut short is left out.
pub fn load(path: &Path) -> Result<Vec<Record>> {
    if !path.exists() {
        return Ok(Vec::new());
    }
    let text =
        std::fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
    let count = text.lines().count();
    let mut records = Vec::with_capacity(count);
    for (k, line) in text.lines().enumerate() {
        match serde_json::from_str(line) {
            Ok(record) => records.push(record),
            Err(_) if k + 1 == count => {
                eprintln!("the last line of the results is cut short: done again")
            }
            Err(error) => {
                return Err(error).with_context(|| format!("{} line {}", path.display(), k + 1));
            }
        }
    }
    Ok(records)
}
