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

/// Weights of the leading candidate, and of each effect that cannot be distinguished from it: constant, evidence, asserted, small,
/// instability.
const LEADING: [f64; 5] = [0.10, 2.74, -0.65, -1.51, -0.92];
/// Weights of all other effects together, in the same order.
const OTHER: [f64; 5] = [-2.62, 1.18, -0.24, 1.00, 2.28];
/// Weights of what the catalogue lacks: constant, evidence, asserted, verdict `Unexplained`, logarithm of the learnable share.
const UNKNOWN: [f64; 5] = [-2.49, 2.11, 2.45, 6.53, 0.35];

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
/// is the share of the residual that a flexible model still removes. Empty if the verdict is `Unknown` or there is no candidate.
///
/// Prior probabilities: 1/3 for nothing, 1/2 for an effect of the catalogue, 1/6 for something that it lacks.
pub fn explanations(verdict: Verdict, effects: &[Candidate], learnable: f64) -> Vec<Explanation> {
    let Some(leading) = effects.first().filter(|_| verdict != Verdict::Unknown) else {
        return Vec::new();
    };
    let logits = logits(verdict, leading, learnable);
    let mut all = vec![Explanation::of(&leading.id, kind(&leading.id), logits.leading)];
    all.extend(
        leading
            .indistinguishable_from
            .iter()
            .map(|id| Explanation::of(id, kind(id), logits.leading)),
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
    let unexplained = verdict == Verdict::Unexplained;
    let [asserted, small, unexplained] =
        [leading.asserted, small, unexplained].map(|x| f64::from(u8::from(x)));
    let learnable = if learnable.is_finite() { learnable } else { 0.0 };
    let learnable = learnable.clamp(LEARNABLE[0], LEARNABLE[1]) / LEARNABLE[0];
    let sum = |weights: &[f64; 5], features: [f64; 5]| -> f64 {
        weights.iter().zip(features).map(|(w, x)| w * x).sum()
    };
    let checked = [1.0, evidence, asserted, small, instability];
    Logits {
        leading: sum(&LEADING, checked),
        other: sum(&OTHER, checked),
        unknown: sum(&UNKNOWN, [1.0, evidence, asserted, unexplained, learnable.ln()]),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(status: Status, evidence: f64, stable: f64, alike: &[&str]) -> Candidate {
        Candidate {
            id: "lift_stall".into(),
            description: "",
            asserted: matches!(status, Status::Missing | Status::Indistinguishable),
            status,
            evidence,
            threshold: 10.0,
            parameters: Vec::new(),
            channels: Vec::new(),
            acts: Vec::new(),
            indistinguishable_from: alike.iter().map(|id| (*id).to_owned()).collect(),
            heldout_error_reduction: if stable.is_finite() { 0.5 } else { f64::NAN },
            selected_in_bootstraps: stable,
            by_flight: Vec::new(),
            minimum_detectable: None,
            refused: Vec::new(),
            curve: None,
        }
    }

    fn of(all: &[Explanation], id: &str) -> f64 {
        all.iter().find(|e| e.id == id).unwrap().probability
    }

    #[test]
    fn probabilities_sum_to_one_and_follow_the_evidence() {
        let clear = candidate(Status::Missing, 5000.0, 1.0, &[]);
        let clear = explanations(Verdict::Effect, &[clear], 0.0);
        let sum: f64 = clear.iter().map(|e| e.probability).sum();
        assert!((sum - 1.0).abs() < 1e-12 && clear[0].id == "lift_stall", "{clear:?}");
        let weak = candidate(Status::Missing, 20.0, 1.0, &[]);
        let weak = explanations(Verdict::Effect, &[weak], 0.0);
        assert!(of(&weak, "lift_stall") < of(&clear, "lift_stall"));
        let chance = candidate(Status::NotShown, 4.0, f64::NAN, &[]);
        let chance = explanations(Verdict::Adequate, &[chance], 0.0);
        assert!(chance[0].kind == Explained::Nothing && chance[0].probability > 0.5);
        let open = candidate(Status::NotShown, 4.0, f64::NAN, &[]);
        let open = explanations(Verdict::Unexplained, &[open], 0.4);
        assert_eq!(open[0].kind, Explained::Unknown);
    }

    #[test]
    fn effects_that_cannot_be_distinguished_are_equally_probable() {
        let tied = candidate(Status::Indistinguishable, 5000.0, 1.0, &["servo_elevator"]);
        let all = explanations(Verdict::Effect, &[tied], 0.0);
        assert_eq!(of(&all, "lift_stall"), of(&all, "servo_elevator"));
        let servo = all.iter().find(|e| e.id == "servo_elevator").unwrap();
        assert_eq!(servo.kind, Explained::Installation);
        let said = sentence(&all, true).unwrap();
        assert!(said.starts_with("Probability of the first: ") && said.ends_with(" %."), "{said}");
        assert!(
            explanations(Verdict::Effect, &[], 0.0).is_empty() && sentence(&[], false).is_none()
        );
    }
}
