//! Search for free forms, which are expressions of a grammar. It is made if a formula of the library's fixed shapes leaves a
//! residual that a flexible model (a regression without physics) could remove.

use super::forward::{Ask, Climbed, ORDER, candidates};
use super::free::search::{Fitted, Searched, searched};
use super::library::{self, Form, Shape};
use super::result::{FreeForms, Rung};
use crate::diagnose::DiagnoseError;
use crate::diagnose::proposal::draft::{self, Term};
use crate::diagnose::search::remainder::remainder;
use crate::diagnose::search::round::Round;
use crate::progress::{Progress, part, report};
use greylag_model::GreyBox;
use greylag_physics::Channel;

/// Free forms are tried if a flexible model could still remove more than this share of the residual that the library's
/// formula removes.
const MATERIAL: f64 = 0.02;
/// The simplest form is chosen whose reduction of the residual is less than the largest reduction by at most this share.
/// Even an exact formula of a strong effect leaves a residual of this order, due to errors of the reconstructed path.
const BEHIND: f64 = 0.01;
/// Smallest additional reduction of the whitened residual sum of squares that justifies a larger formula.
const WORTH: f64 = 10.0;

/// Returns the reason to try free forms, and the channels in which they are tried.
///
/// `None` if the library's formula suffices: a flexible model hardly removes more, one shape is enough for the channel,
/// and no significant second shape was left out. `None` also if the model cannot be evaluated over the flights, or if
/// no channel is included.
pub(super) fn doubt(ask: &Ask, library: &Climbed) -> Option<(String, Vec<Channel>)> {
    let counted = |c: &usize| ask.channels[*c];
    if library.terms.is_empty() {
        let all: Vec<Channel> = (0..6).filter(counted).map(|c| ORDER[c]).collect();
        let why = "no shape of the library is what is missing";
        return (!all.is_empty()).then(|| (why.into(), all));
    }
    let round = Round::new(ask.problem, library.model.clone(), &[])?;
    let left = remainder(&round, ask.options.nulls, ask.options.level);
    let taken = library.removed() * library.excess;
    let material = |c: &usize| {
        left.removable[*c] > left.threshold[*c] && left.removable[*c] > MATERIAL * taken
    };
    let all: Vec<usize> = (0..6).filter(counted).filter(material).collect();
    if !all.is_empty() {
        let more: f64 = all.iter().map(|c| left.removable[*c]).sum();
        let why = format!(
            "a flexible model could remove {:.0} % more than the best shapes of the library",
            100.0 * more / taken.max(1.0)
        );
        return Some((why, all.into_iter().map(|c| ORDER[c]).collect()));
    }
    let own = |t: &&Term| t.form.channel == library.terms[0].form.channel;
    let several = library.terms.iter().filter(own).count() > 1;
    let why = match (several, library.significant_left_out) {
        (true, _) => "the library needs several shapes for one channel",
        (false, true) => {
            "a second shape of the library explains more, but cannot be combined with the first"
        }
        (false, false) => return None,
    };
    Some((why.into(), vec![library.terms[0].form.channel]))
}

/// Searches free forms for `channels` in the residual of the library's first round (linearisation of the model over the flights).
/// Then selects among these forms and the library's best forms, starting from `tuned`. `why` is the reason for the search.
///
/// Returns a record of the free forms, and the new selection. `None` if the library's search tried nothing, or if the
/// model cannot be evaluated over the flights.
///
/// # Errors
/// `progress` cancelled.
pub(super) fn beyond(
    ask: &Ask,
    library: &Climbed,
    tuned: &GreyBox,
    (why, channels): (String, Vec<Channel>),
    progress: &Progress,
) -> Result<Option<(FreeForms, Climbed)>, DiagnoseError> {
    let Some(round) = &library.round else { return Ok(None) };
    let mut all: Vec<(Channel, Searched)> = Vec::new();
    for (k, channel) in channels.iter().enumerate() {
        let share = |k: usize| 0.8 * k as f64 / channels.len() as f64;
        let own = part(progress, [share(k), share(k + 1)]);
        if let Some(found) = searched(round, *channel, ask.options, &own)? {
            all.push((*channel, found));
        }
    }
    report(progress, "comparing the best free forms with the library's", 0.8)?;
    let mut forms: Vec<Form> =
        library.terms.iter().map(|t| t.form).chain(library.class.clone()).collect();
    for finalist in all.iter().flat_map(|(_, s)| &s.finalists) {
        let form = as_of_library(finalist.form);
        if !forms.contains(&form) {
            forms.push(form);
        }
    }
    let forms = candidates(forms.into_iter());
    let ask = Ask {
        forms: &forms,
        least: all.iter().map(|(_, s)| s.threshold).fold(0.0, f64::max),
        behind: BEHIND,
        ..*ask
    };
    let Some(climbed) = ask.climb(tuned.clone()) else { return Ok(None) };
    // the reduction by a form may exceed the residual: other coefficients no longer compensate for its absence
    let falls = all.iter().flat_map(|(_, s)| s.front.iter().map(|f| f.fall));
    let whole = falls.fold(library.excess, f64::max);
    let rung = |f: &Fitted, threshold: f64| Rung {
        formula: draft::formula(&[Term { form: f.form, value: 0.0, sd: 0.0 }]),
        complexity: 1 + f.size,
        removed: f.fall / whole,
        evidence: f.evidence,
        threshold,
        chosen: climbed.terms.iter().any(|t| t.form == as_of_library(f.form)),
    };
    let front = all.iter().flat_map(|(_, s)| s.front.iter().map(|f| rung(f, s.threshold)));
    let front: Vec<Rung> = front.collect();
    let tried = all.iter().map(|(_, s)| s.tried).sum();
    let chosen = climbed.terms.iter().any(|t| matches!(t.form.shape, Shape::Free(_)));
    Ok(Some((FreeForms { why, tried, front, chosen }, climbed)))
}

/// Returns the library's form with the same text as `form`. If there is none, returns `form` itself.
fn as_of_library(form: Form) -> Form {
    let text = form.shape.text(None);
    let of = library::forms(form.channel, &|_, _| 0.0);
    let same = |f: &Form| f.of_air == form.of_air && f.shape.text(None) == text;
    of.into_iter().find(same).unwrap_or(form)
}

/// Whether the formula `free` replaces the formula of the library.
///
/// - If both have the same structure and other constants, `free` must reduce the residual sum of squares further by
///   more than `WORTH`. The library takes its constants from quantiles of the flights and does not fit them.
/// - A simpler formula may reduce it less. The difference must be smaller than `WORTH` or the share `BEHIND` of the
///   library's reduction, whichever is larger.
/// - Any other formula must reduce it more, by at least the same difference.
pub(super) fn better(free: &Climbed, library: &Climbed) -> bool {
    let taken = |c: &Climbed| c.removed() * library.excess;
    let more = taken(free) - taken(library);
    let least = WORTH.max(BEHIND * taken(library));
    if structure(free) == structure(library) {
        return more > WORTH;
    }
    match free.complexity() < library.complexity() {
        true => more > -least,
        false => more > least,
    }
}

/// Structure of a formula: channel, scaling and shape of each term, without the constants.
fn structure(of: &Climbed) -> Vec<(Channel, bool, String)> {
    let letters = |form: &Form| -> String {
        form.shape.text(None).chars().filter(|c| !c.is_ascii_digit() && *c != '.').collect()
    };
    of.terms.iter().map(|t| (t.form.channel, t.form.of_air, letters(&t.form))).collect()
}
