//! An effect as its file has it, ready to be evaluated.

use super::expression::{Expression, Node};
use super::memory::Memory;
use super::tape::Tape;
use super::variable::Variable;
use crate::airframe::Sourced;
use crate::effects::{Description, Needs, Own, Terms};
use crate::{Channel, Point};
use greylag_num::Real;

/// Whether an effect may fly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// A search proposed it, and nobody has looked at it yet.
    Proposed,
    /// A person has accepted it.
    Accepted,
}

/// What an effect adds to one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The channel.
    pub channel: Channel,
    /// What the shape is multiplied by.
    pub factor: Expression,
    /// A sum of terms, each with a parameter.
    pub shape: Expression,
}

/// An effect of a file.
#[derive(Debug)]
pub struct Written {
    /// What is known of it, as of any effect.
    pub about: Description,
    /// Whether it may fly.
    pub status: Status,
    /// What it adds to each channel; parameters in the order of `about.coefficients`.
    pub lines: Vec<Line>,
    /// The values that the file gives the coefficients.
    pub values: Vec<f64>,
    /// Their widths as priors.
    pub widths: Vec<f64>,
    /// The text of the file.
    pub text: String,
    pub(super) tape: Tape,
    pub(super) needs: Needs,
}

impl Written {
    /// What it needs: never only the point, so that a planner's sum over the effects that need no more
    /// holds no code of formulas.
    pub const fn needs(&self) -> Needs {
        self.needs
    }

    /// What one unit of each coefficient contributes.
    #[inline(always)]
    pub fn basis<R: Real>(&self, at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        let Own { shape, first_lag, .. } = own;
        self.tape.run(at, shape, first_lag, |index, channel, amount| {
            terms.add(index, channel, amount);
        });
    }

    /// Its lags and delays; at most [`LAGS`](crate::actuators::LAGS).
    pub fn memories(&self) -> &[Memory] {
        self.tape.memories()
    }

    /// The value of a coefficient as the file gives it.
    pub fn number(&self, coefficient: usize) -> Sourced {
        Sourced {
            value: self.values[coefficient],
            source: self.about.source.into(),
            sd: Some(self.widths[coefficient]),
        }
    }

    /// How many operations an evaluation takes.
    pub fn operations(&self) -> usize {
        self.tape.len()
    }

    /// The variables it depends on.
    pub fn variables(&self) -> Vec<Variable> {
        let named = |v: &Variable| self.lines.iter().any(|l| l.uses(*v));
        Variable::ALL.iter().copied().filter(named).collect()
    }

    /// Functions with kinks or jumps in it, each once.
    pub fn kinks(&self) -> Vec<&'static str> {
        let mut all = Vec::new();
        let mut note = |e: &Expression| {
            let name = match &e.node {
                Node::Call(function, _) if function.has_kink() => function.name(),
                Node::Table(..) => "table",
                _ => return,
            };
            if !all.contains(&name) {
                all.push(name);
            }
        };
        for line in &self.lines {
            line.factor.visit(&mut note);
            line.shape.visit(&mut note);
        }
        all
    }
}

impl Line {
    fn uses(&self, v: Variable) -> bool {
        let named = |node: &Node| *node == Node::Variable(v);
        self.factor.any(&named) || self.shape.any(&named)
    }
}
