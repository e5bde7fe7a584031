//! Sentences for the user on an amendment of a model. An amendment fits the coefficients and adds effects (groups of model
//! terms). It may change conventions: integrator, force axes or air density.

use super::conventions::Tried;
use super::judge::judged;
use super::result::Amendment;
use crate::per_flight::PerFlight;

/// Sentences on conventions and on refused effects. They follow the main result, which is a sentence of its own.
pub fn sentences(story: &Amendment) -> Vec<String> {
    let mut all = Vec::new();
    let (before, after) = (judged(&story.before), judged(&story.after));
    let joined = story.effects.iter().filter(|e| e.joined);
    let kept: Vec<&str> = joined.map(|e| e.id.as_str()).collect();
    let taken = story.conventions.iter().filter(|t| t.kept);
    let taken: Vec<String> =
        taken.map(|t| format!("{} {}", t.convention.key().join("."), t.to)).collect();
    // the main result already covers coefficients and effects: a sentence is needed only if a convention changed
    if let (Some(before), Some(after), false) = (before, after, taken.is_empty()) {
        let joined = kept.iter().map(|id| (*id).to_owned());
        all.push(format!(
            "With {} as well {} ({before:.5} to {after:.5}).",
            joined.chain(taken).collect::<Vec<_>>().join(" and "),
            change(before, after)
        ));
    }
    for Tried { convention, from, to, error: [a, b], closer, kept } in &story.conventions {
        let key = convention.key().join(".");
        let said = if *kept { "is taken instead of" } else { "does not replace" };
        let found = if b.is_nan() {
            "no fit with it holds that long".into()
        } else {
            format!(
                "{} ({a:.5} to {b:.5}), and the fit's own flights are followed {} by {:.1} standard errors",
                change(*a, *b),
                if *closer > 0.0 { "more closely" } else { "less closely" },
                closer.abs()
            )
        };
        all.push(format!("{key} {to} {said} {from}: {found}."));
    }
    for effect in story.effects.iter().filter(|e| !e.refused.is_empty()) {
        let verb =
            if kept.contains(&effect.id.as_str()) { "kept though refused" } else { "refused" };
        let next = match effect.fly_next.as_str() {
            "" => String::new(),
            next => format!(" What would decide: {next}."),
        };
        all.push(format!("{} is {verb}: {}.{next}", effect.id, effect.refused.join("; ")));
    }
    all
}

/// A sentence on how the estimated constants of each flight are used after the fit. `asked` states which constants were
/// estimated. `None` if there are none.
pub fn apart(asked: &PerFlight) -> Option<String> {
    let what = match (asked.has_trims(), asked.angles() > 0) {
        (false, false) => return None,
        (true, false) => "trims",
        (false, true) => "axes",
        (true, true) => "trims and axes",
    };
    Some(format!(
        "Each flight was fitted with {what} of its own, which the model's file keeps ([flights.NAME]) and free runs of that \
         flight use; flights held out are judged with what all have in common: nothing is taken from them."
    ))
}

fn change(from: f64, to: f64) -> String {
    let percent = 100.0 * (1.0 - to / from);
    match percent {
        p if p >= 0.05 => format!("the error falls by {p:.1} %"),
        p if p <= -0.05 => format!("the error rises by {:.1} %", -p),
        _ => "the error stays as it is".into(),
    }
}
