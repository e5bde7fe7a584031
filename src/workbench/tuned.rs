//! The tuned model of a session of the workbench: the given model with its coefficients fitted to the flights and no effect
//! (group of model terms) added. Its remaining error shows what the model lacks.

use std::collections::BTreeMap;
use std::fs;

use serde::Serialize;
use serde_json::json;

use super::bench::{Bench, Inner};
use greylag_model::GreyBox;
use greylag_report::write_over;
use greylag_sysid::amend::Fit;

/// Which of the session's models is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// The model as its file states it.
    Given,
    /// The given model with its coefficients fitted.
    Tuned,
    /// The fitted model with the accepted effects.
    Amended,
}

impl Bench {
    /// Stores `fit`, a fit without added effects, in memory and in a file for a later run of the program.
    pub(super) fn keep_tuned(&self, key: String, fit: Fit) {
        let values: BTreeMap<&str, f64> =
            fit.parameters.iter().map(|p| (p.name.as_str(), p.value)).collect();
        // if the file cannot be written, a later run of the program makes the fit again
        let _ = write_over(&self.result_file(&key), json!(values).to_string());
        self.lock().tuned = Some((key, fit));
    }
}

impl Inner {
    /// The model tuned to the present flights, from memory or from the file; `None` if it was not tuned to them yet.
    fn tuned_model(&self) -> Option<GreyBox> {
        let key = self.key("tuned", &[]);
        let mut model = match self.tuned.as_ref().filter(|(of, _)| *of == key) {
            Some((_, fit)) => fit.model.clone(),
            None => {
                let text = fs::read_to_string(self.folder.join(format!("{key}.json"))).ok()?;
                let values: BTreeMap<String, f64> = serde_json::from_str(&text).ok()?;
                let mut model = self.model.clone();
                let set = values.iter().all(|(name, value)| model.set_coefficient(name, *value));
                set.then_some(model)?
            }
        };
        model.name = format!("{}-tuned", self.model.name);
        Some(model)
    }

    /// The given, the tuned and the amended model, each with its kind. A model that was not fitted yet is left out.
    pub(super) fn ways(&self) -> (Vec<Way>, Vec<GreyBox>) {
        let mut models = self.models();
        let amended = (models.len() > 1).then(|| models.remove(1));
        let all =
            [(Way::Given, models.pop()), (Way::Tuned, self.tuned_model()), (Way::Amended, amended)];
        all.into_iter().filter_map(|(way, model)| Some((way, model?))).unzip()
    }
}
