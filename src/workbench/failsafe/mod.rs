//! Interactive failsafe scenarios. A page selects a fault, the companion's own pilot flies it in
//! lockstep, and the page shows who was in control when, which texts were sent and which rules of
//! flight held.

mod answer;
mod bands;
mod choices;
mod form;
mod page;
mod verdict;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use form::Form;
use greylag_control::ControllerKind;
use greylag_sim::faults::policies::{Policy, policies};
use greylag_sim::faults::search::judged;
use greylag_sim::faults::{CompanionFactory, FaultsError, Scenario, Witnessed};

/// Makes the companions with a controller; the error is a message for the page.
type Make = Box<dyn Fn(ControllerKind) -> Result<CompanionFactory, String> + Send + Sync>;
/// Stack size of the thread that designs a controller, bytes: dual numbers need much of it in an unoptimised build.
const STACK: usize = 16 << 20;

/// Simulates the scenario that the page requests.
pub struct Failsafes {
    make: Make,
    /// Companions made so far, by controller: the design of one takes a moment.
    made: Mutex<HashMap<&'static str, Arc<CompanionFactory>>>,
}

/// A flight with its rules.
struct Flown {
    scenario: Scenario,
    controller: ControllerKind,
    witnessed: Witnessed,
    rules: Vec<Policy>,
    /// For each rule its least distance (at most 1, negative if broken) and the time of it, s; `None` if the rule
    /// does not apply.
    judged: Vec<Option<(f64, f64)>>,
}

/// Answer to a request for the page.
#[derive(Debug)]
pub struct Answer {
    /// The page, as HTML.
    pub html: String,
    /// Whether a choice was invalid, so that nothing was flown.
    pub refused: bool,
}

impl Failsafes {
    /// Flies with the companions of `make`.
    pub fn new(
        make: impl Fn(ControllerKind) -> Result<CompanionFactory, String> + Send + Sync + 'static,
    ) -> Failsafes {
        Failsafes { make: Box::new(make), made: Mutex::default() }
    }

    /// The page for the choices in `query` (names and values of the form's fields); a missing field has its default. The
    /// page shows the error of an invalid choice, or of a flight that cannot be flown.
    pub fn page(&self, query: &[(String, String)]) -> Answer {
        let (form, unknown) = Form::of(query);
        let chosen = match unknown {
            Some(wrong) => Err(wrong),
            None => form.chosen(),
        };
        match chosen {
            Err(wrong) => Answer {
                html: page::render(&form, Some(&wrong), &page::refused(&wrong)),
                refused: true,
            },
            Ok(chosen) => {
                let shown = match self.fly(chosen.scenario, chosen.controller) {
                    Ok(flown) => answer::html(&flown),
                    Err(why) => page::failed(&why),
                };
                Answer { html: page::render(&form, None, &shown), refused: false }
            }
        }
    }

    fn fly(&self, scenario: Scenario, controller: ControllerKind) -> Result<Flown, String> {
        let factory = self.factory(controller)?;
        let words = |e: FaultsError| e.to_string();
        let witnessed = factory.witness(&scenario).map_err(words)?;
        let rules = policies(&factory.envelope());
        let judged = judged(&rules, scenario.counterpart, &witnessed.samples, &witnessed.findings);
        Ok(Flown { scenario, controller, witnessed, rules, judged })
    }

    fn factory(&self, controller: ControllerKind) -> Result<Arc<CompanionFactory>, String> {
        let known = |made: &Failsafes| {
            let made = made.made.lock().unwrap_or_else(PoisonError::into_inner);
            made.get(controller.name()).cloned()
        };
        if let Some(factory) = known(self) {
            return Ok(factory);
        }
        let make = &self.make;
        let design = move || make(controller);
        let made = std::thread::scope(|scope| {
            let thread = std::thread::Builder::new().stack_size(STACK).spawn_scoped(scope, design);
            let thread = thread.map_err(|e| format!("starting the design of {controller}: {e}"))?;
            thread.join().unwrap_or_else(|_| Err(format!("the design of {controller} panicked")))
        })?;
        let made = Arc::new(made);
        let mut all = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(all.entry(controller.name()).or_insert(made).clone())
    }
}
