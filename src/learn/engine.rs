//! The engine: minibatches in the precision asked for, in the widest vectors there are.

use crate::learn::kernel::{Double, Vectors, vectors};
use crate::learn::loss::{Loss, Minibatch, Objective};
use crate::learn::rollout::{Gradient, Subject};
use crate::learn::windows::{Track, Window};

/// What an engine computes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arithmetic {
    /// Blocks of single-precision lanes. Where no multiply-add is fused (x86 from before 2013) it is
    /// [`Double`](Arithmetic::Double).
    Lanes,
    /// One rollout at a time in double precision: slow, for tests.
    Double,
}

/// Computes losses and gradients of minibatches. All memory is taken when it is made.
#[derive(Clone, Debug)]
pub struct Engine(Kind);

#[derive(Clone, Debug)]
enum Kind {
    Lanes(Minibatch<Vectors>),
    Double(Minibatch<Double>),
}

impl Engine {
    /// An engine for minibatches of up to `windows` rollouts of up to `steps` steps.
    pub fn new(subject: &Subject, windows: usize, steps: usize, arithmetic: Arithmetic) -> Engine {
        Engine(match (arithmetic, vectors()) {
            (Arithmetic::Lanes, Some(set)) => {
                Kind::Lanes(Minibatch::new(subject, windows, steps, set))
            }
            _ => Kind::Double(Minibatch::new(subject, windows, steps, Double)),
        })
    }

    /// The loss of `windows` of `steps` steps, with its gradient; the same to the bit on any number of
    /// cores.
    ///
    /// # Panics
    /// If there are more windows than the engine was made for, or longer ones.
    pub fn step(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        windows: &[Window],
        steps: usize,
    ) -> (Loss, &Gradient) {
        match &mut self.0 {
            Kind::Lanes(m) => m.step(subject, objective, tracks, windows, steps),
            Kind::Double(m) => m.step(subject, objective, tracks, windows, steps),
        }
    }

    /// The loss alone.
    ///
    /// # Panics
    /// As [`step`](Engine::step).
    pub fn loss(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        windows: &[Window],
        steps: usize,
    ) -> Loss {
        match &mut self.0 {
            Kind::Lanes(m) => m.loss(subject, objective, tracks, windows, steps),
            Kind::Double(m) => m.loss(subject, objective, tracks, windows, steps),
        }
    }
}
