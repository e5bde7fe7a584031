//! How a search ended: what it selected, what each of it took, what is left.

use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::checks;
use crate::diagnose::search::remainder::Remainder;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::shape::Shape;
use crate::diagnose::search::unexplained::unexplained;

/// A channel that is explained but for this share of its variance is adequate: reconstruction and sampling
/// leave as much of exact models.
const ADEQUATE: f64 = 5e-4;

/// The candidate that a round selected, with its checks.
#[derive(Clone, Debug)]
pub struct Selected {
    /// Its id.
    pub id: &'static str,
    /// Its score in that round.
    pub score: Score,
    /// Threshold of that round.
    pub threshold: f64,
    /// Ids that the data cannot tell from it.
    pub class: Vec<String>,
    /// Share of the error removed from held-out segments.
    pub heldout: f64,
    /// Share of bootstraps.
    pub selected: f64,
    /// First free coefficient flight by flight, with standard deviations.
    pub by_flight: Vec<[f64; 2]>,
    /// Channels, the one with most of it first.
    pub channels: Vec<usize>,
    /// What it took of the squared whitened error, channel by channel.
    pub taken: [f64; 6],
    /// Why it is not asserted; empty if it is.
    pub refused: Vec<String>,
    /// Whether it takes too little of the error to matter, whatever else speaks against it.
    pub slight: bool,
    /// What there is to say of it if it is significant but not material.
    pub trace: Option<String>,
    /// Whether it is a figure of the model's own by another name, so that what is left says nothing of it.
    pub relieves: bool,
    /// Whether it is not linear in its constants.
    pub curved: bool,
    /// What it added to the residual, fitted, flight by flight.
    pub contribution: Vec<Column>,
}

/// How a search ended.
pub struct Found {
    /// The first round: the model tuned, nothing joined.
    pub first: Round,
    /// Share of each channel's variance beyond noise that the first round leaves unexplained.
    pub unexplained: [f64; 6],
    /// What a flexible model could remove of what the first round leaves.
    pub first_remainder: Remainder,
    /// The last round, with every asserted effect in the model; `None` if that is the first one.
    pub last: Option<Round>,
    /// The same of the last round.
    pub remainder: Remainder,
    /// What the model of the last round leaves beyond noise; `None` if that is the first one.
    pub beyond: Option<checks::Beyond>,
    /// What products of the states take of what it leaves; `None` if they cannot be fitted.
    pub shape: Option<Shape>,
    /// Scores of the last round.
    pub scores: Vec<(usize, Score)>,
    /// Best evidence in the null flights of the first round.
    pub nulls: Vec<f64>,
    /// Threshold of the last round.
    pub threshold: f64,
    /// Trials of the last round that lost against the first one once both had settled.
    pub beaten: Vec<usize>,
    /// Trials of the last round that were as good as the first one once both had settled.
    pub level: Vec<usize>,
    /// Asserted effects in the order of selection, then those refused.
    pub selected: Vec<Selected>,
    /// Standard deviation that the sums over samples leave in each coefficient of the last round's model; empty if nothing was selected.
    pub sums: Vec<f64>,
}

impl Found {
    /// The last round.
    pub fn round(&self) -> &Round {
        self.last.as_ref().unwrap_or(&self.first)
    }

    /// Whether what is left goes with products of states more than chance does, in a channel where it matters.
    pub fn has_shape(&self) -> bool {
        let left = self.left();
        let in_channel = |shape: &Shape, c: usize| left[c] >= ADEQUATE && shape.term(c).is_some();
        self.shape.as_ref().is_some_and(|shape| (0..6).any(|c| in_channel(shape, c)))
    }

    /// Share of each channel's variance beyond noise that the last round leaves unexplained.
    pub fn left(&self) -> [f64; 6] {
        unexplained(&self.first, &self.round().tuned_residual())
    }

    /// Whether the last round leaves a channel that is not adequate.
    pub fn leaves_something(&self) -> bool {
        self.left().iter().any(|share| *share >= ADEQUATE)
    }

    /// Share of the squared error beyond noise under the tuned model that a flexible model could still
    /// remove.
    pub fn learnable(&self) -> f64 {
        let excess = checks::excess(&self.first, &[true; 6]);
        self.remainder.total / excess.max(self.remainder.total).max(1.0)
    }
}
