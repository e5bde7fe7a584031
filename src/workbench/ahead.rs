//! The fit with the next effect: the first effect that the diagnosis asserts and the user has not accepted yet. It is made before
//! the user accepts the effect, so that the page states by how much the error would fall. If the user accepts the effect, this fit
//! is the fit with the accepted effects.

use serde::Serialize;
use serde_json::Value;

use super::bench::Inner;
use super::jobs::Work;
use super::session::{Accepted, Role};

/// The next effect with the result of its fit.
#[derive(Serialize)]
pub struct AheadView {
    id: String,
    /// One of `fitted`, `fitting`, `unfitted`.
    status: &'static str,
    /// Content of the file `amend.json` of the fit with the accepted effects and the next one; `None` before the fit is complete.
    story: Option<Value>,
}

impl Inner {
    /// The accepted effects and the next one. `None` if the diagnosis asserts no further effect, or if the user could not accept it:
    /// the model has a learned residual, or no flight is left to judge the effect.
    fn with_next(&self) -> Option<Vec<Accepted>> {
        let [fitted, held_out] = [Role::Fit, Role::HoldOut].map(|role| self.usable(&[role]).len());
        // a single flight is divided into a part for the fit and a part for its validation
        let judged = fitted == 1 || fitted > 1 && held_out > 0;
        if !judged || self.model.residual.is_some() {
            return None;
        }
        let accepted = &self.session.effects;
        let id = self.asserted().find(|id| accepted.iter().all(|e| e.id != *id))?.to_owned();
        let next = Accepted { id, anyway: false };
        Some(accepted.iter().cloned().chain([next]).collect())
    }

    /// The lists of effects of which fits are made: the first accepted effect, the first two, and so on, and all accepted effects
    /// with the next one.
    pub fn stacks(&self) -> Vec<Vec<Accepted>> {
        let all = &self.session.effects;
        let accepted = (1..=all.len()).map(|count| all[..count].to_vec());
        accepted.chain(self.with_next()).collect()
    }

    /// The next effect with its fit, as far as it is made; `None` if there is no such effect.
    pub fn ahead(&self) -> Option<AheadView> {
        let effects = self.with_next()?;
        let fitted = self.fits.get(&self.key("fit", &effects));
        let working = self.jobs.iter().any(|job| job.work == Work::Fit);
        let status = match (fitted, working) {
            (Some(_), _) => "fitted",
            (None, true) => "fitting",
            (None, false) => "unfitted",
        };
        let id = effects.last()?.id.clone();
        Some(AheadView { id, status, story: fitted.map(|f| f.story.clone()) })
    }
}
