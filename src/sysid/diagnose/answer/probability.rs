//! Probabilities of the explanations of the flights: an effect of the catalogue, nothing, or something that the catalogue lacks.
//! An effect is a physical contribution to forces and moments that the model may lack.
//!
//! A multinomial logit model turns the results of the search into probabilities. Its weights were fitted to simulated flights
//! in which it is known what is missing (`tests/truth/probabilities.py`, `docs/validation/probabilities.md`). The Bayesian
//! information criterion alone would give probabilities of zero and one, because it takes the noise model and the formulas of the
//! effects to be exact.

use serde::Serialize;

use crate::diagnose::answer::result::{Candidate, Status, Verdict};
use crate::diagnose::search::stepwise::HELD_OUT;
use crate::per_flight::askew;

/// Range of the logarithm of evidence over critical value. Beyond it, more evidence makes an explanation no more probable.
const EVIDENCE: [f64; 2] = [-2.0, 6.0];
/// Range of the share of the residual that a flexible model still removes.
const LEARNABLE: [f64; 2] = [1e-3, 1.0];
/// Stability of a candidate that was not examined, because its evidence is below the critical value.
const UNEXAMINED: f64 = 0.5;
/// Beginning of the ids of effects that are errors of a servo's calibration.
const SERVO: &str = "servo_";
/// Smallest probability that is listed.
const LISTED: f64 = 0.005;

/// Weights of the leading candidate: constant, evidence, refused, small, instability.
const LEADING: [f64; 5] = [0.0, 1.0, -1.0, -1.0, -1.0];
/// Logarithm of the odds of an effect that cannot be distinguished from the leading one, relative to that one.
const ALIKE: f64 = -1.0;
/// Weights of all other effects together: constant, evidence, refused, small, instability.
const OTHER: [f64; 5] = [-1.0, 0.5, 0.5, 0.0, 1.0];
/// Weights of what the catalogue lacks: constant, evidence, refused, verdict `Unexplained`, logarithm of the learnable share.
const UNKNOWN: [f64; 5] = [-1.0, 0.5, 1.0, 0.0, 0.5];

/// What may explain the flights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Explained {
    /// An effect of the aircraft.
    Aircraft,
    /// An error of the installation: a servo, or the axes of the sensors.
    Installation,
    /// The model lacks nothing that these flights could show.
    Nothing,
    /// Another effect of the catalogue than those listed.
    OtherEffect,
    /// Something that the catalogue lacks.
    Unknown,
}

/// An explanation of the flights with its probability.
#[derive(Clone, Debug, Serialize)]
pub struct Explanation {
    /// Id of the effect; `nothing`, `other_effect` or `unknown` for the other kinds.
    pub id: String,
    /// Kind of the explanation.
    pub kind: Explained,
    /// Probability, 0 to 1.
    pub probability: f64,
}

impl Explanation {
    fn of(id: &str, kind: Explained, probability: f64) -> Explanation {
        Explanation { id: id.into(), kind, probability }
    }

    /// The explanation in words: the id of an effect, otherwise a phrase.
    pub fn words(&self) -> &str {
        match self.kind {
            Explained::Aircraft | Explained::Installation => &self.id,
            Explained::Nothing => "nothing is missing that these flights could show",
            Explained::OtherEffect => "another effect of the catalogue",
            Explained::Unknown => "something that the catalogue lacks",
        }
    }

    /// Whether the explanation is probable enough to be listed.
    pub fn is_listed(&self) -> bool {
        self.probability >= LISTED
    }
}

/// Probabilities of what the model lacks above all, the largest first. `verdict` and `effects` are those of a diagnosis, `learnable`
/// is the share of the residual that a flexible model still removes. Empty if there is no candidate.
///
/// The probabilities assume flights like those to which the weights were fitted: in a third of them nothing is missing.
pub fn explanations(verdict: Verdict, effects: &[Candidate], learnable: f64) -> Vec<Explanation> {
    let Some(leading) = effects.first() else { return Vec::new() };
    let logits = logits(verdict, leading, learnable);
    let mut all = vec![Explanation::of(&leading.id, kind(&leading.id), logits.leading)];
    all.extend(
        leading
            .indistinguishable_from
            .iter()
            .map(|id| Explanation::of(id, kind(id), logits.leading + ALIKE)),
    );
    all.push(Explanation::of("nothing", Explained::Nothing, 0.0));
    all.push(Explanation::of("other_effect", Explained::OtherEffect, logits.other));
    all.push(Explanation::of("unknown", Explained::Unknown, logits.unknown));
    normalise(&mut all);
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// Sentence with the probable explanations. `None` if there are none.
pub fn sentence(explanations: &[Explanation], several: bool) -> Option<String> {
    let listed = explanations.iter().filter(|e| e.is_listed());
    let words = |e: &Explanation| format!("{} {:.0} %", e.words(), 100.0 * e.probability);
    let listed: Vec<String> = listed.map(words).collect();
    let of = if several { " of the first" } else { "" };
    (!listed.is_empty()).then(|| format!("Probability{of}: {}.", listed.join(", ")))
}

/// Logarithms of the odds against "nothing".
struct Logits {
    leading: f64,
    other: f64,
    unknown: f64,
}

fn logits(verdict: Verdict, leading: &Candidate, learnable: f64) -> Logits {
    let ratio = (leading.evidence / leading.threshold).max(1e-9).ln();
    let evidence =
        if ratio.is_finite() { ratio.clamp(EVIDENCE[0], EVIDENCE[1]) } else { EVIDENCE[0] };
    let stable = leading.selected_in_bootstraps;
    let instability = 1.0 - if stable.is_finite() { stable } else { UNEXAMINED };
    let slight = leading.heldout_error_reduction < HELD_OUT;
    let small = leading.status == Status::Small || (leading.status == Status::Refused && slight);
    let refused = leading.status == Status::Refused && !slight;
    let unexplained = verdict == Verdict::Unexplained;
    let [refused, small, unexplained] =
        [refused, small, unexplained].map(|x| f64::from(u8::from(x)));
    let learnable = learnable.max(LEARNABLE[0]).min(LEARNABLE[1]) / LEARNABLE[0];
    let sum = |weights: &[f64; 5], features: [f64; 5]| -> f64 {
        weights.iter().zip(features).map(|(w, x)| w * x).sum()
    };
    let checked = [1.0, evidence, refused, small, instability];
    Logits {
        leading: sum(&LEADING, checked),
        other: sum(&OTHER, checked),
        unknown: sum(&UNKNOWN, [1.0, evidence, refused, unexplained, learnable.ln()]),
    }
}

/// Turns logarithms of odds into probabilities.
fn normalise(all: &mut [Explanation]) {
    let most = all.iter().map(|e| e.probability).fold(f64::NEG_INFINITY, f64::max);
    all.iter_mut().for_each(|e| e.probability = (e.probability - most).exp());
    let sum: f64 = all.iter().map(|e| e.probability).sum();
    all.iter_mut().for_each(|e| e.probability /= sum);
}

fn kind(id: &str) -> Explained {
    match id.starts_with(SERVO) || id == askew::ID {
        true => Explained::Installation,
        false => Explained::Aircraft,
    }
}
