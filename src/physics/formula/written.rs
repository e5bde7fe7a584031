//! An effect that was read from an effect file and can be evaluated. An effect is one contribution to forces and moments.

use super::expression::{Expression, Node};
use super::memory::Memory;
use super::tape::Tape;
use super::variable::Variable;
use crate::airframe::Sourced;
use crate::effects::{Description, Needs, Own, Terms};
use crate::{Channel, Point};
use greylag_num::Real;

/// Acceptance status of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// A search proposed the effect, and no person has reviewed it.
    Proposed,
    /// A person has reviewed and accepted the effect.
    Accepted,
}

/// Contribution of an effect to one channel, which is a component of force or moment. It is `factor` times `shape`.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// Channel of the contribution.
    pub channel: Channel,
    /// Factor that contains no parameters.
    pub factor: Expression,
    /// Sum of terms, each of which is multiplied by a parameter.
    pub shape: Expression,
}

/// An effect read from a file.
#[derive(Debug)]
pub struct Written {
    /// Description in the form used for every effect.
    pub about: Description,
    /// Acceptance status.
    pub status: Status,
    /// Contributions to the channels. Parameters are numbered in the order of `about.coefficients`.
    pub lines: Vec<Line>,
    /// Values of the coefficients in the file.
    pub values: Vec<f64>,
    /// Prior standard deviations of the coefficients, in their units.
    pub widths: Vec<f64>,
    /// The text of the file.
    pub text: String,
    pub(super) tape: Tape,
    pub(super) needs: Needs,
}

impl Written {
    /// The inputs that the effect needs, at least `Needs::Base`. Formulas are therefore never evaluated in the sum over the
    /// effects that need only state, controls and airflow, where a planner spends most of its time.
    pub const fn needs(&self) -> Needs {
        self.needs
    }

    /// Adds to `terms` the contribution of one unit of each coefficient.
    #[inline(always)]
    pub fn basis<R: Real>(&self, at: &Point<R>, own: Own, terms: &mut impl Terms<R>) {
        let Own { shape, first_lag, .. } = own;
        self.tape.run(at, shape, first_lag, |index, channel, amount| {
            terms.add(index, channel, amount);
        });
    }

    /// Lags and delays of the effect, at most [`LAGS`](crate::actuators::LAGS).
    pub fn memories(&self) -> &[Memory] {
        self.tape.memories()
    }

    /// The value of the coefficient at index `coefficient` in the file, with its source and its prior standard deviation.
    pub fn number(&self, coefficient: usize) -> Sourced {
        Sourced {
            bounds: None,
            value: self.values[coefficient],
            source: self.about.source.into(),
            sd: Some(self.widths[coefficient]),
        }
    }

    /// Number of operations of one evaluation.
    pub fn operations(&self) -> usize {
        self.tape.len()
    }

    /// The variables on which the effect depends.
    pub fn variables(&self) -> Vec<Variable> {
        let named = |v: &Variable| self.lines.iter().any(|l| l.uses(*v));
        Variable::ALL.iter().copied().filter(named).collect()
    }

    /// Names of the effect's functions whose value or slope is discontinuous, each once. Tables are included.
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
