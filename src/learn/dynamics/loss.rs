//! The objective over a minibatch of rollouts, eqs. (20) to (24) of \[GSFM26\] (see `src/lib.rs`), with its gradient.
//!
//! The trained model (the subject) is a prior, which is a physical model, plus a residual network. A rollout simulates the model
//! from a recorded state with the recorded controls. The objective penalises the prediction error and the size of the residual.

use rayon::prelude::*;

use crate::dynamics::kernel::InstructionSet;
use crate::dynamics::packet::Packet;
use crate::dynamics::rollout::{Gradient, Pass, Recorded, Subject, SumSlopes, Sums, Trace};
use crate::dynamics::windows::{Track, Window};

/// Penalty on the residual.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Penalty {
    /// The ratio ‖F_a‖/‖F_p‖ of the state rates of residual and prior, eq. (24).
    Ratio,
    /// The norm ‖F_a‖ of the residual's state rates, as in the published methods PhIHP and APHYNITY.
    Absolute,
}

/// The training objective.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Objective {
    /// Scale of errors and rates: the characteristic scale x_c of each state, eq. (21), or ones.
    pub scale: [f64; 8],
    /// Penalty on the residual.
    pub penalty: Penalty,
    /// Divisor of the prediction loss: L_prior of eq. (23), which is the loss of the prior alone, or 1.
    pub unit: f64,
    /// λ of eq. (24): the penalty is divided by it.
    pub lambda: f64,
}

/// Loss terms of a minibatch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loss {
    /// Prediction loss L_pred, eq. (20).
    pub prediction: f64,
    /// Norm ‖F_p‖ of the prior's state rates, eq. (22), 1/s.
    pub prior: f64,
    /// Norm ‖F_a‖ of the residual's state rates, 1/s.
    pub learned: f64,
    /// The whole objective, eq. (24).
    pub objective: f64,
    /// Number of rollouts omitted because a state was not finite.
    pub lost: usize,
}

impl Objective {
    /// The loss that follows from the `sums` over `points` steps of rollouts, and the derivatives of the objective with respect
    /// to the sums.
    pub fn of(&self, sums: &Sums, points: f64) -> (Loss, SumSlopes) {
        let prediction = sums.error / points;
        let [prior, learned] = [sums.prior, sums.learned].map(|s| (s / points).sqrt());
        // the norm is not differentiable at zero; its derivative is set to zero there
        let per = |norm: f64| if norm > 0.0 { 1.0 / (2.0 * norm * points) } else { 0.0 };
        let weight = 1.0 / self.lambda;
        let (penalty, of_learned, of_prior) = match self.penalty {
            Penalty::Ratio if prior > 0.0 => {
                let ratio = learned / prior;
                (ratio, per(learned) / prior, -ratio / prior * per(prior))
            }
            Penalty::Ratio => (0.0, 0.0, 0.0),
            Penalty::Absolute => (learned, per(learned), 0.0),
        };
        let objective = prediction / self.unit + weight * penalty;
        let slopes = SumSlopes {
            error: 1.0 / (points * self.unit),
            prior: weight * of_prior,
            learned: weight * of_learned,
        };
        (Loss { prediction, prior, learned, objective, lost: 0 }, slopes)
    }
}

impl Gradient {
    /// A zero gradient, with an entry for each parameter of the network and of the prior of `subject`.
    pub fn zero(subject: &Subject) -> Gradient {
        Gradient {
            network: vec![0.0; subject.network.network().parameters().len()],
            prior: vec![0.0; subject.prior.coefficients().len() + 1],
        }
    }

    fn clear(&mut self) {
        self.network.fill(0.0);
        self.prior.fill(0.0);
    }

    fn add(&mut self, other: &Gradient) {
        let add =
            |sum: &mut [f64], part: &[f64]| sum.iter_mut().zip(part).for_each(|(s, p)| *s += p);
        add(&mut self.network, &other.network);
        add(&mut self.prior, &other.prior);
    }
}

/// Memory of one block: rollouts that are simulated together, one in each lane of a SIMD vector.
#[derive(Clone, Debug)]
struct Work<R> {
    windows: Vec<Window>,
    recorded: Recorded<R>,
    trace: Trace<R>,
    gradient: Gradient,
    sums: Sums,
    /// Number of rollouts with finite states.
    good: usize,
}

/// Memory for minibatches, allocated once.
#[derive(Clone, Debug)]
pub struct Minibatch<S: InstructionSet> {
    works: Vec<Work<S::Number>>,
    set: S,
    gradient: Gradient,
}

impl<R: Packet, S: InstructionSet<Number = R>> Minibatch<S> {
    /// Memory for up to `windows` rollouts of up to `steps` steps.
    pub fn new(subject: &Subject, windows: usize, steps: usize, set: S) -> Self {
        let gradient = Gradient::zero(subject);
        let work = Work {
            windows: Vec::with_capacity(R::WIDTH),
            recorded: Recorded {
                lagged: Vec::new(),
                states: Vec::new(),
                controls: Vec::new(),
                density: Vec::new(),
                weight: None,
            },
            trace: Trace::new(subject, steps),
            gradient: gradient.clone(),
            sums: Sums::default(),
            good: 0,
        };
        Minibatch { works: vec![work; windows.div_ceil(R::WIDTH)], set, gradient }
    }

    /// The loss over the rollouts of `windows`, and the gradient of the objective.
    ///
    /// Blocks are summed in order. The result therefore does not depend on the number of cores.
    ///
    /// # Panics
    ///
    /// If there are more windows than the memory was allocated for.
    pub fn step(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        windows: &[Window],
        steps: usize,
    ) -> (Loss, &Gradient) {
        let (loss, slopes) = self.fly(subject, objective, tracks, windows, steps);
        let blocks = windows.len().div_ceil(R::WIDTH);
        let set = self.set;
        self.works[..blocks].par_iter_mut().for_each(|work| {
            work.gradient.clear();
            if work.good > 0 {
                let pass = Pass { set, subject, recorded: &work.recorded, scale: &objective.scale };
                set.reverse(&pass, &mut work.trace, &slopes, &mut work.gradient);
            }
        });
        self.gradient.clear();
        for work in &self.works[..blocks] {
            self.gradient.add(&work.gradient);
        }
        (loss, &self.gradient)
    }

    /// The loss without its gradient.
    ///
    /// # Panics
    ///
    /// The same as [`step`](Minibatch::step).
    pub fn loss(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        windows: &[Window],
        steps: usize,
    ) -> Loss {
        self.fly(subject, objective, tracks, windows, steps).0
    }

    fn fly(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        windows: &[Window],
        steps: usize,
    ) -> (Loss, SumSlopes) {
        let blocks = windows.chunks(R::WIDTH);
        assert!(blocks.len() <= self.works.len(), "room for every window");
        let count = blocks.len();
        let set = self.set;
        self.works[..count].par_iter_mut().zip(windows.par_chunks(R::WIDTH)).for_each(
            |(work, windows)| {
                work.windows.clear();
                work.windows.extend_from_slice(windows);
                work.fly(subject, objective, tracks, steps, set);
            },
        );
        let mut sums = Sums::default();
        let mut good = 0;
        for work in &self.works[..count] {
            sums.error += work.sums.error;
            sums.prior += work.sums.prior;
            sums.learned += work.sums.learned;
            good += work.good;
        }
        let (mut loss, slopes) = objective.of(&sums, (good.max(1) * steps) as f64);
        loss.lost = windows.len() - good;
        (loss, slopes)
    }
}

impl<R: Packet> Work<R> {
    /// Simulates the rollouts of the block. Rollouts with a state that is not finite are removed, and the others are simulated
    /// again.
    fn fly(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        steps: usize,
        set: impl InstructionSet<Number = R>,
    ) {
        self.sums = Sums::default();
        loop {
            self.good = self.windows.len();
            if self.good == 0 {
                return;
            }
            self.recorded.fill(tracks, &self.windows, steps);
            let pass = Pass { set, subject, recorded: &self.recorded, scale: &objective.scale };
            let (sums, finite) = set.forward(&pass, &mut self.trace);
            let mut lane = 0;
            self.windows.retain(|_| {
                lane += 1;
                finite.lane(lane - 1).is_finite()
            });
            if self.windows.len() == self.good {
                self.sums = sums;
                return;
            }
        }
    }
}
