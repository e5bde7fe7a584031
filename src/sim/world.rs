//! Training environments for policies: blocks of aircraft observed and stepped together.

use crate::Trouble;
use crate::imagined::{Block, Imagination, Stepped};
use greylag_control::policy::{ACTIONS, OBSERVATIONS};

/// One or many aircraft, each in its own episode, which is reset when it ends.
pub trait World {
    /// Number of aircraft.
    fn instances(&self) -> usize;
    /// Observations of a block's aircraft; lanes above the instances are unused.
    fn observe(&self, block: usize) -> [Block; OBSERVATIONS];
    /// One step of a block.
    ///
    /// # Errors
    ///
    /// If the environment cannot continue; losing an aircraft is not an error.
    fn step(&mut self, block: usize, action: &[Block; ACTIONS]) -> Result<Stepped, Trouble>;
    /// Resets all episodes; `targets` were given out before.
    ///
    /// # Errors
    ///
    /// If the environment cannot be reset.
    fn restart(&mut self, targets: u64) -> Result<(), Trouble>;
    /// Number of targets given.
    fn targets(&self) -> u64;
    /// Number of episodes that ended outside the limits.
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
