//! Names of controllers in an evaluation. The model or policy is part of the name if the controllers use several.

use greylag_sim::evaluation::Evaluation;

/// Name of a controller, with the name of its model or policy if `all` have several.
pub(super) fn label(e: &Evaluation, all: &[Evaluation]) -> String {
    match e.model == "-" || only_model(all).is_some() {
        true => e.controller.clone(),
        false => format!("{} ({})", e.controller, e.model),
    }
}

/// The model, or the model and the policy, that all controllers share, except those that need none. A controller may use one of the
/// two alone. `None` if there are several models or policies.
pub fn only_model(all: &[Evaluation]) -> Option<&str> {
    let models = || all.iter().map(|e| e.model.as_str()).filter(|model| *model != "-");
    let longest = models().max_by_key(|model| model.len())?;
    let shared = |model: &str| {
        model == longest
            || longest.strip_prefix(model).is_some_and(|rest| rest.starts_with(", "))
            || longest.strip_suffix(model).is_some_and(|rest| rest.ends_with(", "))
    };
    models().all(shared).then_some(longest)
}
