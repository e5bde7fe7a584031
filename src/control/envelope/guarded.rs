//! A controller followed by the envelope limiter, for simulated flights. In flight, the companion combines the two in the same
//! way.

use crate::envelope::EnvelopeLimiter;
use crate::insight::Insight;
use crate::{Controller, Observation, Overruled, Target};
use greylag_model::GreyBox;
use greylag_physics::Command;

/// A controller whose commands pass through the envelope limiter before they are returned.
pub struct Guarded {
    controller: Box<dyn Controller>,
    limiter: EnvelopeLimiter,
    overruled: Option<Overruled>,
}

impl Guarded {
    /// `controller` with the envelope limiter of the aircraft that `model` describes.
    pub fn new(controller: Box<dyn Controller>, model: &GreyBox) -> Guarded {
        Guarded { controller, limiter: EnvelopeLimiter::new(model), overruled: None }
    }
}

impl Controller for Guarded {
    fn name(&self) -> &'static str {
        self.controller.name()
    }

    fn reset(&mut self, seed: u64) {
        self.controller.reset(seed);
        self.limiter.reset();
        self.overruled = None;
    }

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        if let Some(by) = self.overruled.take() {
            self.controller.overruled(&by);
        }
        let wanted = self.controller.command(seen, target);
        let limited = self.limiter.limit(seen, wanted);
        self.overruled = limited.overruled(wanted);
        limited.command
    }

    fn prepare(&mut self) {
        self.controller.prepare();
    }

    fn insight(&self, seen: &Observation) -> Option<Insight> {
        self.controller.insight(seen)
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        let controller = self.controller.boxed_clone();
        let (limiter, overruled) = (self.limiter.clone(), self.overruled);
        Box::new(Guarded { controller, limiter, overruled })
    }
}
