//! Result of the search: the selected effects, their reductions, the remaining residual.

use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::checks;
use crate::diagnose::search::remainder::Remainder;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::shape::Shape;
use crate::diagnose::search::unexplained::unexplained;

/// A channel is adequate if its unexplained share is below this. Errors of reconstruction and sampling cause such
/// shares even with an exact model.
const ADEQUATE: f64 = 5e-4;

/// Candidate selected by a round, with its checks.
#[derive(Clone, Debug)]
pub struct Selected {
    /// Identifier of the effect.
    pub id: &'static str,
    /// Score in the round that selected the effect.
    pub score: Score,
    /// Threshold of evidence in the same round.
    pub threshold: f64,
    /// Ids of effects that the data cannot distinguish from this effect.
    pub class: Vec<String>,
    /// Relative reduction of the error on held-out segments.
    pub heldout: f64,
    /// Share of bootstraps in which the effect, or one of `class`, ranks first.
    pub selected: f64,
    /// For each free coefficient its index, and its estimate from each flight with its standard deviation.
    pub by_flight: Vec<(usize, Vec<[f64; 2]>)>,
    /// Channels it acts in, the largest reduction first.
    pub channels: Vec<usize>,
    /// Reduction of the squared whitened error, by channel.
    pub taken: [f64; 6],
    /// Reasons not to assert it; empty if it is asserted.
    pub refused: Vec<String>,
    /// Whether its reduction is too small to matter, whatever the other checks show.
    pub slight: bool,
    /// Remark if it is significant but not material.
    pub trace: Option<String>,
    /// Whether it mostly replaces an adjustment of existing coefficients, so that the remaining residual is no
    /// argument against it.
    pub absorbs_prior_error: bool,
    /// Whether it is nonlinear in its constants.
    pub curved: bool,
    /// Fitted contribution to the residual, by flight.
    pub contribution: Vec<Column>,
}

/// Result of the search.
pub struct Found {
    /// The first round: the model tuned, without added effects.
    pub first: Round,
    /// Unexplained share of each channel's variance beyond noise in the first round.
    pub unexplained: [f64; 6],
    /// Error that a flexible model could remove from the residual of the first round.
    pub first_remainder: Remainder,
    /// The last round, with every asserted effect in the model; `None` if it is the first one.
    pub last: Option<Round>,
    /// Error that a flexible model could remove from the residual of the last round.
    pub remainder: Remainder,
    /// Error beyond noise of the last round's model; `None` if that is the first one.
    pub beyond: Option<checks::Beyond>,
    /// Reduction of the last round's residual by products of the states; `None` if they cannot be fitted.
    pub shape: Option<Shape>,
    /// Candidates' scores in the last round.
    pub scores: Vec<(usize, Score)>,
    /// Best evidence in each null flight of the first round.
    pub nulls: Vec<f64>,
    /// Threshold of evidence in the last round.
    pub threshold: f64,
    /// Indices of the trials that were worse than the best one after both had been tuned.
    pub beaten: Vec<usize>,
    /// Indices of the trials that were as good as the best one after both had been tuned.
    pub level: Vec<usize>,
    /// Asserted effects in the order of selection, then the refused ones.
    pub selected: Vec<Selected>,
    /// Standard deviation of each coefficient of the last round's model due to discretisation; empty if nothing was
    /// selected.
    pub sums: Vec<f64>,
}

impl Found {
    /// The last round, which may be the first one.
    pub fn round(&self) -> &Round {
        self.last.as_ref().unwrap_or(&self.first)
    }

    /// Whether the residual correlates significantly with products of states in a channel where it matters.
    pub fn has_shape(&self) -> bool {
        let left = self.left();
        let in_channel = |shape: &Shape, c: usize| left[c] >= ADEQUATE && shape.term(c).is_some();
        self.shape.as_ref().is_some_and(|shape| (0..6).any(|c| in_channel(shape, c)))
    }

    /// Unexplained share of each channel's variance beyond noise in the last round.
    pub fn left(&self) -> [f64; 6] {
        unexplained(&self.first, &self.round().tuned_residual())
    }

    /// Whether a channel is not adequate in the last round.
    pub fn leaves_something(&self) -> bool {
        self.left().iter().any(|share| *share >= ADEQUATE)
    }

    /// Share of the tuned model's squared error beyond noise that a flexible model could still remove.
    pub fn learnable(&self) -> f64 {
        let excess = checks::excess(&self.first, &[true; 6]);
        self.remainder.total / excess.max(self.remainder.total).max(1.0)
    }
}
