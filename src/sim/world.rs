//! Training environments for policies: aircraft simulated together in blocks, one aircraft in each SIMD lane.

use crate::Trouble;
use crate::imagined::{Block, Imagination, Stepped};
use greylag_control::policy::{ACTIONS, OBSERVATIONS};

/// One or several aircraft, each in its own episode, which is a flight towards one target. When an episode ends, the aircraft
/// starts a new one.
pub trait World {
    /// Number of aircraft in the environment.
    fn instances(&self) -> usize;
    /// Observations of the aircraft of a block. If the last block has more lanes than aircraft, its remaining lanes are unused.
    fn observe(&self, block: usize) -> [Block; OBSERVATIONS];
    /// Simulates the aircraft of a block for one time step.
    ///
    /// # Errors
    ///
    /// If the environment cannot continue. The loss of an aircraft is not an error.
    fn step(&mut self, block: usize, action: &[Block; ACTIONS]) -> Result<Stepped, Trouble>;
    /// Starts new episodes. Their targets are taken from the random sequence of targets after its first `targets` members. A
    /// training that is resumed can therefore continue the sequence.
    ///
    /// # Errors
    ///
    /// If the environment cannot be reset.
    fn restart(&mut self, targets: u64) -> Result<(), Trouble>;
    /// Number of targets assigned to episodes so far.
    fn targets(&self) -> u64;
    /// Number of episodes that ended because a validity limit of the model was exceeded.
    fn lost(&self) -> u64;
}

impl World for Imagination {
    fn instances(&self) -> usize {
        Imagination::instances(self)
    }

    fn observe(&self, block: usize) -> [Block; OBSERVATIONS] {
        Imagination::observe(self, block)
    }

    fn step(&mut self, block: usize, action: &[Block; ACTIONS]) -> Result<Stepped, Trouble> {
        Ok(Imagination::step(self, block, action))
    }

    fn restart(&mut self, targets: u64) -> Result<(), Trouble> {
        Imagination::restart(self, targets);
        Ok(())
    }

    fn targets(&self) -> u64 {
        self.episodes()[0]
    }

    fn lost(&self) -> u64 {
        self.episodes()[1]
    }
}
