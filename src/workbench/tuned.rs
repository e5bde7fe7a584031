//! The model with its own coefficients tuned and no effect added: only a missing effect can explain its remaining error.

use std::collections::BTreeMap;
use std::fs;

use serde::Serialize;
use serde_json::json;

use super::bench::{Bench, Inner};
use greylag_model::GreyBox;
use greylag_report::write_over;
use greylag_sysid::amend::Fit;

/// Origin of a displayed model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Way {
    /// The model as in its file.
    Given,
    /// Its own coefficients fitted, no effect added.
    Tuned,
    /// With the accepted effects.
    Amended,
}

impl Bench {
    /// Keeps a fit of the model's own coefficients, and its values in a file for a later run.
    pub(super) fn keep_tuned(&self, key: String, fit: Fit) {
        let values: BTreeMap<&str, f64> =
            fit.parameters.iter().map(|p| (p.name.as_str(), p.value)).collect();
        // without the file a later run tunes again
        let _ = write_over(&self.result_file(&key), json!(values).to_string());
        self.lock().tuned = Some((key, fit));
    }
}

impl Inner {
    /// The tuned model of the present flights, if it is known.
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

    /// The model as given, tuned, and amended; those that are not fitted yet are left out.
    pub(super) fn ways(&self) -> (Vec<Way>, Vec<GreyBox>) {
        let mut models = self.models();
        let amended = (models.len() > 1).then(|| models.remove(1));
        let all =
            [(Way::Given, models.pop()), (Way::Tuned, self.tuned_model()), (Way::Amended, amended)];
        all.into_iter().filter_map(|(way, model)| Some((way, model?))).unzip()
    }
}
