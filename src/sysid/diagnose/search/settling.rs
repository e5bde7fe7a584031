//! Ranks the candidates, which are effects (physical contributions to forces and moments) that the model may lack, and
//! re-estimates the model after a candidate has been added.
//!
//! The evidence of a candidate is the smaller of its penalised likelihood gain and its Wald statistic. A round of the search
//! ranks all candidates once.

use crate::diagnose::options::Options;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::nulls;
use crate::diagnose::search::round::{Beside, Problem, Round};
use greylag_model::GreyBox;

/// Number of passes in which all coefficients are re-estimated after an effect has been added. Nonlinear effects need
/// several passes to converge.
pub const SETTLING: usize = 3;
/// Largest number of times that the model is linearised again beside a candidate at a physical bound.
const RELINEARISATIONS: usize = 3;
/// Largest relative change of a mass or inertia estimate in the re-estimation. A larger change shows that the model's
/// accelerations were too inaccurate for the estimate.
const ASTRAY: f64 = 0.1;

/// A round of the search with the scores of its candidates.
pub struct Ranked {
    /// The round that was ranked.
    pub round: Round,
    /// Indices and scores of the candidates, in descending order of rank.
    pub scores: Vec<(usize, Score)>,
    /// Evidence of the best candidate in each bootstrap draw under the null hypothesis that no effect is missing,
    /// ascending.
    pub nulls: Vec<f64>,
    /// Critical value that the evidence of a candidate must exceed.
    pub threshold: f64,
}

impl Ranked {
    /// The candidate with the most evidence. It need not rank first.
    fn strongest(&self) -> Option<&(usize, Score)> {
        self.scores.iter().max_by(|(_, a), (_, b)| a.evidence.total_cmp(&b.evidence))
    }

    /// Evidence of that candidate.
    fn evidence(&self) -> f64 {
        self.strongest().map_or(0.0, |(_, score)| score.evidence)
    }
}

/// Ranks the candidates of `round`. The regressors of mass and inertia contain accelerations that the model predicts.
/// If these accelerations are too inaccurate, the ranking is repeated with the accelerations of a better model.
pub fn ranked(problem: &Problem, round: Round, options: &Options) -> Ranked {
    let rank = |mut round: Round| {
        let scores = round.rank(problem);
        let nulls = nulls::best(&round.projected, &round.trials, options.seed, options.nulls);
        let threshold = nulls::threshold(&nulls, options.level);
        Ranked { round, scores, nulls, threshold }
    };
    let mut ranked = rank(round);
    for _ in 0..RELINEARISATIONS {
        let Some(round) = beside_the_strongest(problem, &ranked) else { break };
        let next = rank(round);
        if next.evidence() <= ranked.evidence() {
            break;
        }
        ranked = next;
    }
    match accelerated(problem, &ranked) {
        Some(round) => rank(round),
        None => ranked,
    }
}

/// Linearises the model again with its coefficients from the joint fit with the candidate of the most evidence, if that
/// candidate ended at a physical bound. `None` otherwise.
///
/// Moments of control and damping nearly balance, so that only the small angular acceleration determines the scale of the
/// coefficients. A missing moment that is larger shrinks them all (attenuation). The regressor of an effect on a control contains
/// the control derivative and shrinks with it, so that its constant would have to exceed its bound.
fn beside_the_strongest(problem: &Problem, ranked: &Ranked) -> Option<Round> {
    let Ranked { round, threshold, .. } = ranked;
    let (trial, score) = ranked.strongest()?;
    let bounded = score.evidence > *threshold && round.at_bound(*trial, score);
    bounded.then(|| Round::new(problem, round.with(score), &round.entries)).flatten()
}

/// Repeats a round with the accelerations of a better model in the regressors of mass and inertia. The better model is
/// obtained from the model of the round: the best-ranked change of mass or inertia is added, and all coefficients are
/// re-estimated.
///
/// A large inertia error of the model makes these regressors wrong. The estimates of mass or inertia then differ between
/// flights and are all too small. `None` if no change of mass or inertia exceeds the critical value, if the re-estimation
/// changes its first coefficient by at most the fraction `ASTRAY`, or if a model cannot be linearised.
fn accelerated(problem: &Problem, ranked: &Ranked) -> Option<Round> {
    let Ranked { round, scores, threshold, .. } = ranked;
    let of_body = |trial: usize, score: &Score| {
        let mut model = round.with(score);
        let before = model.body;
        model.join_most(round.trials[trial].id, &score.values).ok()?;
        (model.body != before).then_some(model)
    };
    let mut passing = scores.iter().filter(|(_, s)| s.evidence > *threshold);
    let (trial, score, model) = passing.find_map(|(k, s)| Some((*k, s, of_body(*k, s)?)))?;
    let trial = &round.trials[trial];
    let first = trial.points[score.point].free[0].0;
    let entry = round.entries.iter().find(|e| e.about.id == trial.id)?;
    let name = format!("{}.{}", trial.id, entry.about.coefficients[first].name);
    // the first pass shows whether further passes are worthwhile
    let (model, _) = settled(problem, round, model, 1)?;
    let value = model.coefficients().iter().find(|c| c.name == name)?.value;
    if (value - score.values[first]).abs() <= ASTRAY * value.abs() {
        return None;
    }
    let (model, _) = settled(problem, round, model, SETTLING)?;
    let beside = Beside { accelerating: Some(&model), ..Beside::default() };
    Round::beside(problem, round.model.clone(), &round.entries, beside)
}

/// Re-estimates all coefficients of `model` in `passes` passes with the noise of `round`. Returns the re-estimated model, and
/// the whitened residual sum of squares before the last pass. `None` if the model cannot be linearised.
pub fn settled(
    problem: &Problem,
    round: &Round,
    mut model: GreyBox,
    passes: usize,
) -> Option<(GreyBox, f64)> {
    let mut left = f64::INFINITY;
    for _ in 0..passes {
        let beside = Beside { noise: Some(&round.noise), ..Beside::default() };
        let settled = Round::beside(problem, model, &[], beside)?;
        let last = settled.projected.width();
        left = settled.projected.total[(last, last)];
        model = settled.tuned();
    }
    Some((model, left))
}
