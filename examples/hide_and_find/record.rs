//! The result of a test case, stored as one line of JSON.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::cases::Case;

/// A fitted coefficient of an asserted effect that is truly missing.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Found {
    /// Full name `effect.coefficient`.
    pub name: String,
    /// Value that was hidden.
    pub truth: f64,
    /// Value that was fitted.
    pub value: f64,
    /// 95 % interval of the fitted value.
    pub ci95: [f64; 2],
}

/// Errors of open-loop simulations over 5 s on held-out flights, divided by the state's scale x_c.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub struct HeldOut {
    /// Error of the starting model with re-estimated coefficients.
    pub tuned: f64,
    /// Error after the asserted effects were added and fitted.
    pub amended: f64,
    /// Error after the true effects were added and fitted in the same way.
    pub oracle: f64,
}

/// Computing time of the steps of a case, s.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
pub struct Seconds {
    /// Time of flying, logging and reconstructing.
    pub flights: f64,
    /// Time of the diagnosis.
    pub diagnose: f64,
    /// Time of the fits.
    pub amend: f64,
}

/// Results of the checks of a candidate.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Judged {
    /// Classification of the candidate, as in the JSON of a diagnosis.
    pub status: String,
    /// Share of block bootstraps in which the candidate ranks first; `None` if not computed.
    pub stable: Option<f64>,
    /// Share of the residual that it removes in held-out blocks; `None` if not computed.
    pub held_out: Option<f64>,
}

/// A test case with its result.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Record {
    /// Name of the case.
    pub key: String,
    /// Part of the campaign: `nulls`, `installed`, `probes`, `effects`, `without` or `pairs`.
    pub part: String,
    /// Ids of the effects that the model lacked.
    pub truth: Vec<String>,
    /// Amplitudes of these effects.
    pub amplitudes: Vec<f64>,
    /// Requested amplitude as a multiple of the median minimum detectable amplitude of the nulls.
    pub factor: f64,
    /// Amplitude as a multiple of the minimum detectable amplitude in the case's own flights. For a pair it is the smaller
    /// multiple.
    pub reached: f64,
    /// Reason why there is no diagnosis; `None` if there is one.
    pub failure: Option<String>,
    /// Verdict of the diagnosis in one word.
    pub verdict: String,
    /// Ids of the best candidates in the order of the diagnosis.
    pub ranked: Vec<String>,
    /// Ids of the effects that the diagnosis asserts.
    pub asserted: Vec<String>,
    /// Name of the installation error of the instruments; `None` without such an error.
    #[serde(default)]
    pub installed: Option<String>,
    /// Ids of the asserted instrument errors. Biases, wind and short delays are excluded.
    #[serde(default)]
    pub instruments: Vec<String>,
    /// For the first candidate and each asserted effect: the effects that cannot be distinguished from it.
    pub alike: BTreeMap<String, Vec<String>>,
    /// Reasons why the first candidate is not asserted; empty if it is asserted.
    #[serde(default)]
    pub refused: Vec<String>,
    /// Reasons why an examined effect is not asserted, by its id.
    #[serde(default)]
    pub refusals: BTreeMap<String, Vec<String>>,
    /// First coefficient of the first candidate as estimated from each flight alone, with its standard deviation.
    #[serde(default)]
    pub by_flight: Vec<[f64; 2]>,
    /// Evidence and threshold of each candidate in `ranked`.
    pub evidence: Vec<[f64; 2]>,
    /// What else the probabilities are computed from, for each candidate in `ranked`.
    #[serde(default)]
    pub judged: Vec<Judged>,
    /// Share of the residual beyond noise that a flexible model still removes.
    #[serde(default)]
    pub learnable: f64,
    /// Probability of each explanation: effects by their ids, `other_effect`, `nothing`, `unknown`.
    #[serde(default)]
    pub explanations: BTreeMap<String, f64>,
    /// Minimum detectable amplitude of each candidate.
    pub minimum_detectable: BTreeMap<String, f64>,
    /// Fitted coefficients of the true effects that were asserted.
    pub parameters: Vec<Found>,
    /// Effects that could not be fitted, with the reason.
    #[serde(default)]
    pub unfitted: Vec<String>,
    /// Errors on held-out flights; `None` if the true effects could not be fitted.
    pub held_out: Option<HeldOut>,
    /// Computing times of the case.
    pub seconds: Seconds,
}

impl Record {
    /// A record of a case before its diagnosis.
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

    /// The record of a case that could not be flown or read.
    pub fn failed(case: &Case, why: &anyhow::Error) -> Record {
        Record { failure: Some(format!("{why:#}")), ..Record::of(case) }
    }

    /// Whether `id` or an effect that cannot be distinguished from it is asserted.
    pub fn names(&self, id: &str) -> bool {
        self.asserted.iter().any(|a| a == id || self.is_alike(a, id))
    }

    /// Whether the diagnosis finds `other` indistinguishable from `id`.
    pub fn is_alike(&self, id: &str, other: &str) -> bool {
        self.alike.get(id).is_some_and(|alike| alike.iter().any(|a| a == other))
    }
}

/// Reads the records of a file. A file that does not exist has no records. An incomplete last line is omitted.
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
