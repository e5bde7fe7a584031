//! Computes the loss of a minibatch and its gradient. A minibatch is a set of windows, which are short sections of the tracks
//! (recorded flights). In each window the model is simulated from the recorded start (a rollout) and compared with the recorded
//! states.

use crate::dynamics::kernel::Double;
#[cfg(target_arch = "aarch64")]
use crate::dynamics::kernel::Neon;
#[cfg(target_arch = "x86_64")]
use crate::dynamics::kernel::{In256, In512};
use crate::dynamics::loss::{Loss, Minibatch, Objective};
use crate::dynamics::rollout::{Gradient, Subject};
use crate::dynamics::windows::{Track, Window};

/// Number format and parallelism of the computation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arithmetic {
    /// Several rollouts at once in single precision, one in each lane of a SIMD vector. On processors without fused
    /// multiply-add (x86 from before 2013), [`Double`](Arithmetic::Double) is used instead.
    Lanes,
    /// One rollout at a time in double precision. It is slow and is used for tests.
    Double,
}

/// Computes losses and gradients of minibatches. Only [`Engine::new`] allocates memory.
#[derive(Clone, Debug)]
pub struct Engine(Kind);

#[derive(Clone, Debug)]
enum Kind {
    #[cfg(target_arch = "x86_64")]
    In512(Minibatch<In512>),
    #[cfg(target_arch = "x86_64")]
    In256(Minibatch<In256>),
    #[cfg(target_arch = "aarch64")]
    Neon(Minibatch<Neon>),
    Double(Minibatch<Double>),
}

impl Kind {
    /// The kind for the widest SIMD vectors of the processor; `None` if the processor has no fused multiply-add.
    #[cfg_attr(
        not(any(target_arch = "x86_64", target_arch = "aarch64")),
        expect(unused_variables, reason = "elsewhere no multiply-add is known to be fused")
    )]
    fn in_lanes(subject: &Subject, windows: usize, steps: usize) -> Option<Kind> {
        #[cfg(target_arch = "x86_64")]
        {
            let in_512 = |set| Kind::In512(Minibatch::new(subject, windows, steps, set));
            let in_256 = |set| Kind::In256(Minibatch::new(subject, windows, steps, set));
            In512::detect().map(in_512).or_else(|| In256::detect().map(in_256))
        }
        #[cfg(target_arch = "aarch64")]
        return Some(Kind::Neon(Minibatch::new(subject, windows, steps, Neon)));
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
        None
    }
}

impl Engine {
    /// An engine for minibatches of up to `windows` rollouts of up to `steps` steps.
    pub fn new(subject: &Subject, windows: usize, steps: usize, arithmetic: Arithmetic) -> Engine {
        let lanes = match arithmetic {
            Arithmetic::Lanes => Kind::in_lanes(subject, windows, steps),
            Arithmetic::Double => None,
        };
        let double = || Kind::Double(Minibatch::new(subject, windows, steps, Double));
        Engine(lanes.unwrap_or_else(double))
    }

    /// The loss over `windows` of `tracks` for the model `subject`, and its gradient. Each window has `steps` steps. The result
    /// is the same to the bit on any number of cores.
    ///
    /// # Panics
    /// If the engine was made for fewer windows or fewer steps.
    pub fn step(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        windows: &[Window],
        steps: usize,
    ) -> (Loss, &Gradient) {
        match &mut self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::In512(m) => m.step(subject, objective, tracks, windows, steps),
            #[cfg(target_arch = "x86_64")]
            Kind::In256(m) => m.step(subject, objective, tracks, windows, steps),
            #[cfg(target_arch = "aarch64")]
            Kind::Neon(m) => m.step(subject, objective, tracks, windows, steps),
            Kind::Double(m) => m.step(subject, objective, tracks, windows, steps),
        }
    }

    /// The same loss, without its gradient.
    ///
    /// # Panics
    ///
    /// The same as [`step`](Engine::step).
    pub fn loss(
        &mut self,
        subject: &Subject,
        objective: &Objective,
        tracks: &[Track],
        windows: &[Window],
        steps: usize,
    ) -> Loss {
        match &mut self.0 {
            #[cfg(target_arch = "x86_64")]
            Kind::In512(m) => m.loss(subject, objective, tracks, windows, steps),
            #[cfg(target_arch = "x86_64")]
            Kind::In256(m) => m.loss(subject, objective, tracks, windows, steps),
            #[cfg(target_arch = "aarch64")]
            Kind::Neon(m) => m.loss(subject, objective, tracks, windows, steps),
            Kind::Double(m) => m.loss(subject, objective, tracks, windows, steps),
        }
    }
}
