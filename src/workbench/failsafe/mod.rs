//! The workbench's page on failsafes. The user selects a fault. A flight with this fault is then simulated, with the pilot of the
//! companion in control. The page shows who was in control at each time, which texts were sent, and which flight rules the flight
//! violated.

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

/// Function that makes companions with a controller. Its error is a message for the page.
type Make = Box<dyn Fn(ControllerKind) -> Result<CompanionFactory, String> + Send + Sync>;
/// Stack size of the thread that designs a controller, bytes. Dual numbers need a large stack in an unoptimised build.
const STACK: usize = 16 << 20;

/// Simulates the flights that the page requests.
pub struct Failsafes {
    make: Make,
    /// Companions by the name of their controller. They are kept because the design of a controller takes time.
    made: Mutex<HashMap<&'static str, Arc<CompanionFactory>>>,
}

/// The result of a flight, and the flight rules.
struct Flown {
    scenario: Scenario,
    controller: ControllerKind,
    witnessed: Witnessed,
    rules: Vec<Policy>,
    /// For each rule, the smallest robustness (normalised margin, at most 1, negative if the flight violates the rule) and its
    /// time, s. `None` if the rule does not apply.
    judged: Vec<Option<(f64, f64)>>,
}

/// Answer to a request for the page.
#[derive(Debug)]
pub struct Answer {
    /// The page, as HTML.
    pub html: String,
    /// Whether a value in the form was invalid. No flight was then simulated.
    pub refused: bool,
}

impl Failsafes {
    /// A simulation that flies with the companions that `make` returns.
    pub fn new(
        make: impl Fn(ControllerKind) -> Result<CompanionFactory, String> + Send + Sync + 'static,
    ) -> Failsafes {
        Failsafes { make: Box::new(make), made: Mutex::default() }
    }

    /// Simulates the flight that `query` describes, and returns the page. `query` has the form's fields as pairs of name and
    /// value; a missing field has its default value. If a value is invalid or the flight cannot be simulated, the page shows the
    /// error.
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
