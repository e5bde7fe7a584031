//! Result of the search for missing effects: the selected effects with their checks, and the remaining residual. In each round of
//! the search the model is linearised over all flights and the candidates (effects that it may lack) are ranked. Evidence is the
//! test statistic of the ranking. A flexible model is a regression without physics.

use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::checks;
use crate::diagnose::search::remainder::Remainder;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::shape::Shape;
use crate::diagnose::search::unexplained::unexplained;

/// The model is adequate in a channel if it leaves less than this share of the variance unexplained. Errors of
/// reconstruction and sampling leave shares up to this size even with an exact model.
const ADEQUATE: f64 = 5e-4;

/// Candidate effect that was best in a round, with the results of its checks.
#[derive(Clone, Debug)]
pub struct Selected {
    /// Identifier of the effect.
    pub id: &'static str,
    /// Score in the round that selected the effect.
    pub score: Score,
    /// Critical value of the evidence in the same round.
    pub threshold: f64,
    /// Ids of effects that the data cannot distinguish from this effect.
    pub class: Vec<String>,
    /// Share of the residual beyond noise that the effect removes from held-out blocks, which its fit did not use; NaN if it
    /// cannot be computed.
    pub heldout: f64,
    /// Share of block bootstraps in which the effect, or an effect of `class`, ranks first.
    pub selected: f64,
    /// Estimates from each flight alone. For each free coefficient: its index, then estimate and standard deviation by
    /// flight.
    pub by_flight: Vec<(usize, Vec<[f64; 2]>)>,
    /// Indices of the channels in which the effect reduces the residual most, in descending order of the reduction.
    pub channels: Vec<usize>,
    /// Reduction of the whitened residual sum of squares, by channel.
    pub taken: [f64; 6],
    /// Reasons not to assert the effect; empty if it is asserted.
    pub refused: Vec<String>,
    /// Whether the effect removes too little of the residual from held-out blocks.
    pub slight: bool,
    /// Remark if the effect is significant but too small to be asserted.
    pub trace: Option<String>,
    /// Whether the effect merely replaces changes of existing coefficients. A remaining residual then does not count
    /// against it.
    pub absorbs_prior_error: bool,
    /// Whether the effect is nonlinear in a coefficient.
    pub curved: bool,
    /// Fitted contribution to forces (N) and moments (N m), by flight.
    pub contribution: Vec<Column>,
}

/// Result of the search.
pub struct Found {
    /// The first round: the re-estimated model without added effects.
    pub first: Round,
    /// Unexplained share of each channel's variance beyond noise in the first round; NaN if the channel is not
    /// measured.
    pub unexplained: [f64; 6],
    /// Part of the first round's residual that a flexible model could remove on flights to which it is not fitted.
    pub first_remainder: Remainder,
    /// The last round, whose model contains all added effects; `None` if no effect was added.
    pub last: Option<Round>,
    /// The same part of the last round's residual.
    pub remainder: Remainder,
    /// Residual beyond noise of the last round's model; `None` if no effect was added.
    pub beyond: Option<checks::Beyond>,
    /// Reduction of the last round's residual by products of states and deflections; `None` if they cannot be fitted.
    pub shape: Option<Shape>,
    /// Indices and scores of the candidates in the last round, the best first.
    pub scores: Vec<(usize, Score)>,
    /// Evidence of the best candidate in each bootstrap draw under the null hypothesis, in the first round.
    pub nulls: Vec<f64>,
    /// Critical value of the evidence in the last round.
    pub threshold: f64,
    /// Indices of the candidates that fitted clearly worse than the best one when each was added to the model.
    pub beaten: Vec<usize>,
    /// Indices of the candidates that fitted as well as the best one when each was added to the model.
    pub level: Vec<usize>,
    /// Asserted effects in the order of selection, then the refused ones.
    pub selected: Vec<Selected>,
    /// Standard deviation of each coefficient of the last round's model, due to sums over samples in place of integrals; empty
    /// if no effect was added.
    pub sums: Vec<f64>,
}

impl Found {
    /// The last round, which may be the first one.
    pub fn round(&self) -> &Round {
        self.last.as_ref().unwrap_or(&self.first)
    }

    /// Whether products of states and deflections explain a significant part of the residual in a channel that is not
    /// adequate.
    pub fn has_shape(&self) -> bool {
        let left = self.left();
        let in_channel = |shape: &Shape, c: usize| left[c] >= ADEQUATE && shape.term(c).is_some();
        self.shape.as_ref().is_some_and(|shape| (0..6).any(|c| in_channel(shape, c)))
    }

    /// Unexplained share of each channel's variance beyond noise in the last round.
    pub fn left(&self) -> [f64; 6] {
        unexplained(&self.first, &self.round().tuned_residual())
    }

    /// Whether the model of the last round is not adequate in some channel.
    pub fn leaves_something(&self) -> bool {
        self.left().iter().any(|share| *share >= ADEQUATE)
    }

    /// Reduction of the residual that a flexible model could still achieve after the last round, as a share of the first
    /// round's residual beyond noise.
    pub fn learnable(&self) -> f64 {
        let excess = checks::excess(&self.first, &[true; 6]);
        self.remainder.total / excess.max(self.remainder.total).max(1.0)
    }
}
