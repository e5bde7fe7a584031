//! What a policy is trained in: blocks of aircraft that are observed and stepped together.

use crate::Trouble;
use crate::imagined::{Block, Imagination, Stepped};
use greylag_control::policy::{ACTIONS, OBSERVATIONS};

/// A world of one or many aircraft, each in an episode of its own that begins anew when it ends.
pub trait World {
    /// Aircraft there are.
    fn instances(&self) -> usize;
    /// What the aircraft of a block observe; lanes beyond the instances are of no account.
    fn observe(&self, block: usize) -> [Block; OBSERVATIONS];
    /// One step of a block.
    ///
    /// # Errors
    /// If the world cannot go on; an aircraft that is lost is no error.
    fn step(&mut self, block: usize, action: &[Block; ACTIONS]) -> Result<Stepped, Trouble>;
    /// Begins all episodes anew, `targets` having been given before.
    ///
    /// # Errors
    /// If the world cannot go back to the start.
    fn restart(&mut self, targets: u64) -> Result<(), Trouble>;
    /// Targets given so far.
    fn targets(&self) -> u64;
    /// Episodes that ended outside the envelope.
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
