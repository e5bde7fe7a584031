//! Page of the report of `greylag amend`.

use anyhow::Result;

use super::places::Places;
use super::{Arguments, options};
use crate::commands::files;
use crate::model::GreyBox;
use crate::report::AmendmentReport;
use crate::sysid::amend::Amended;
use crate::sysid::compare::{self, Answer, compare};
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::progress::Progress;

/// The report as HTML, with the errors of open-loop simulations of the validation flights over the simulated time.
pub fn page(
    arguments: &Arguments,
    model: &GreyBox,
    amended: &Amended,
    tests: &[Reconstruction],
    (places, answer): (&Places, &Answer),
    progress: &Progress,
) -> Result<String> {
    let conventions = amended.amendment.conventions.iter().any(|tried| tried.kept);
    let models = compared(model, &amended.tuned, &amended.model, conventions);
    let held_out = compare(&models, tests, &compare::Options::default(), progress)?;
    let paths = arguments.logs.paths.iter().chain(&arguments.hold_out);
    let report = AmendmentReport {
        title: format!("{} amended", model.name),
        amendment: &amended.amendment,
        answer: Some(answer),
        held_out: Some(&held_out),
        model_files: vec![
            arguments.model.display().to_string(),
            places.model().display().to_string(),
        ],
        log_files: paths.map(|p| p.display().to_string()).collect(),
        prior: options(arguments, Vec::new()).prior,
        command_line: files::command_line(),
        versions: vec![("greylag".into(), env!("CARGO_PKG_VERSION").into())],
    };
    Ok(report.page().render())
}

/// The models of the page: as given, tuned, and amended. The amended model is left out if it is the tuned one, with no effect added
/// and no convention changed. No two models have one name.
fn compared(
    given: &GreyBox,
    tuned: &GreyBox,
    amended: &GreyBox,
    conventions: bool,
) -> Vec<GreyBox> {
    let mut models = vec![given.clone(), tuned.clone()];
    models[1].name = format!("{}-tuned", given.name);
    let values = |model: &GreyBox| -> Vec<(String, f64)> {
        model.coefficients().iter().map(|c| (c.name.clone(), c.value)).collect()
    };
    if conventions || values(amended) != values(tuned) {
        let mut last = amended.clone();
        if models.iter().any(|model| model.name == last.name) {
            last.name = format!("{}-amended", given.name);
        }
        models.push(last);
    }
    models
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn no_two_models_of_the_page_are_one_or_have_one_name() {
        let given = GreyBox::load(Path::new("params/x8/prior.toml")).unwrap();
        let mut tuned = given.clone();
        assert!(tuned.set_coefficient("drag_linear.CD0", 0.03));
        let mut amended = tuned.clone();
        let names = |amended: &GreyBox, conventions| -> Vec<String> {
            let models = compared(&given, &tuned, amended, conventions);
            models.into_iter().map(|model| model.name).collect()
        };
        assert_eq!(names(&amended, false), ["prior", "prior-tuned"]);
        let all = ["prior", "prior-tuned", "prior-amended"];
        assert_eq!(names(&amended, true), all);
        assert!(amended.set_coefficient("drag_linear.CD0", 0.04));
        assert_eq!(names(&amended, false), all);
        amended.name = "prior-with-stall".into();
        assert_eq!(names(&amended, false)[2], "prior-with-stall");
    }
}
