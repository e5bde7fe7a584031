//! A controller behind the envelope limiter, as the pilot flies it.

use crate::envelope::EnvelopeLimiter;
use crate::insight::Insight;
use crate::{Controller, Observation, Target};
use greylag_model::GreyBox;
use greylag_physics::Command;

/// A controller whose commands pass through the envelope limiter.
pub struct Guarded {
    controller: Box<dyn Controller>,
    limiter: EnvelopeLimiter,
}

impl Guarded {
    /// `controller` behind the envelope of the aircraft that `model` describes.
    pub fn new(controller: Box<dyn Controller>, model: &GreyBox) -> Guarded {
        Guarded { controller, limiter: EnvelopeLimiter::new(model) }
    }
}

impl Controller for Guarded {
    fn name(&self) -> &'static str {
        self.controller.name()
    }

    fn reset(&mut self, seed: u64) {
        self.controller.reset(seed);
        self.limiter.reset();
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        let wanted = self.controller.command(seen, target);
        self.limiter.limit(seen, wanted).command
    }

    fn prepare(&mut self) {
        self.controller.prepare();
    }

    fn insight(&self, seen: &Observation) -> Option<Insight> {
        self.controller.insight(seen)
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        let controller = self.controller.boxed_clone();
        Box::new(Guarded { controller, limiter: self.limiter.clone() })
    }
}
