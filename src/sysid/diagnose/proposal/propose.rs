//! Proposes a formula for an effect (a physical contribution to forces and moments) that a model lacks and that the catalogue of
//! known effects does not contain. The formula is found term by term on some flights and tested on other flights, which are held
//! out. The terms come from a library of shapes or are expressions of a grammar (free forms).

use super::beyond::{better, beyond, doubt};
use super::draft::{self, Term};
use super::forward::{Ask, Climbed, ORDER, failing, forms};
use super::free::grammar::MOST_NODES;
use super::grades;
use super::held_out::{objection, tested};
use super::lags;
use super::result::{HeldOut, Proposal, Rung, Settings};
use super::sentences::{capital, sentences};
use crate::diagnose::answer::run::{known, problem, verdict};
use crate::diagnose::search::excitation;
use crate::diagnose::search::round::Round;
use crate::diagnose::search::stepwise::{Found, search};
use crate::diagnose::{DiagnoseError, Options, Verdict};
use crate::flight_path::reconstruction::Reconstruction;
use crate::per_flight::known::corrected;
use crate::progress::{Progress, part, report};
use crate::rudder;
use greylag_model::{GreyBox, RUDDER};
use greylag_physics::Channel;

/// Estimated share of the whole work that is done after the diagnosis (`SEARCHED`), before lagged controls are tried (`LAGS`),
/// before and after free forms are tried (`FREE`), and before the test (`TESTED`).
const SEARCHED: f64 = 0.3;
const LAGS: f64 = 0.5;
const FREE: [f64; 2] = [0.6, 0.9];
const TESTED: f64 = 0.9;

/// Diagnoses `model` on `flights`. If the diagnosis finds that something is missing that the catalogue cannot explain, a
/// formula is searched for on `flights` and tested on `held_out`. Constants of the installation and of flights in the model's
/// file are used as in a diagnosis. `progress` receives the stages and may cancel.
///
/// # Errors
/// The same as [`diagnose`](crate::diagnose::diagnose).
pub fn propose(
    model: &GreyBox,
    flights: &[Reconstruction],
    held_out: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Proposal, DiagnoseError> {
    let right = corrected(&model.known, &[flights, held_out].concat(), options.per_flight);
    let (search, test) = right.flights.split_at(flights.len());
    let mut bare = model.clone();
    bare.known = Default::default();
    let options = Options { per_flight: right.per_flight, ..options.clone() };
    let mut proposal = of_corrected(&bare, search, test, &options, progress)?;
    proposal.notes.splice(0..0, right.notes);
    Ok(proposal)
}

/// The proposal for flights that are already corrected. The file of `model` has no constants of flights.
fn of_corrected(
    model: &GreyBox,
    flights: &[Reconstruction],
    held_out: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Proposal, DiagnoseError> {
    let unusable = || DiagnoseError::Unusable { model: model.name.clone() };
    known(&[&options.without[..], &options.with[..]].concat())?;
    let (problem, searched_on, mut notes) = problem(model, flights, options)?;
    notes.extend(excitation::check(&problem.flights)?);
    // errors in the held-out flights are reported before the search, which takes minutes
    let (test, used, more) = self::problem(model, held_out, options)?;
    notes.extend(more);
    notes.extend(excitation::check(&test.flights)?);
    let mut found = search(&problem, model, options, &part(progress, [0.0, SEARCHED]))?;
    let rudder = rudder::unmodelled(flights, model).or(rudder::unmodelled(held_out, model));
    if let Some(motion) = rudder {
        found.refuse_in(&rudder::CHANNELS, RUDDER, &rudder::reason(motion));
    }
    let warnings = rudder.map(rudder::warning).into_iter().collect();
    let mut proposal = empty(model, verdict(&found), options, warnings, notes);
    if let Some(why) = settled(&found, proposal.verdict) {
        proposal.sentences.push(why);
        return Ok(proposal);
    }
    let tuned = Round::new(&problem, model.clone(), &[]).ok_or_else(unusable)?.tuned();
    let channels = searched(&found, rudder.is_some());
    let forms = forms(&problem, &channels);
    proposal.tried = forms.len();
    report(progress, &format!("trying {} shapes", forms.len()), SEARCHED)?;
    let ask = Ask {
        problem: &problem,
        options,
        forms: &forms,
        channels: std::array::from_fn(|c| channels.contains(&ORDER[c])),
        least: 0.0,
        behind: 0.0,
    };
    let library = ask.climb(tuned.clone()).ok_or_else(unusable)?;
    let climbed = beyond_library(&ask, library, &tuned, &mut proposal, progress)?;
    let Climbed { outcome, first, terms, .. } = climbed;
    (proposal.front, proposal.alike, proposal.grades) =
        (outcome.front, outcome.alike, outcome.grades);
    (proposal.refused, proposal.nulls) = (outcome.refused, outcome.nulls);
    let Some(first) = first else {
        proposal.sentences.push(nothing(&proposal));
        return Ok(proposal);
    };
    // if the formula has further terms, the form of the first term is incomplete
    let whole = terms.len() == 1 && !outdone(&proposal);
    proposal.grades.iter_mut().for_each(|grades| grades.form &= whole);
    report(progress, "testing the formula on flights that the search has not seen", TESTED)?;
    let names: Vec<String> = used.iter().map(|f| f.name.clone()).collect();
    let tested = tested(&test, &tuned, &terms, options, names).ok_or_else(unusable)?;
    let from = searched_on.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ");
    conclude(&mut proposal, &first, &terms, tested, &from);
    Ok(proposal)
}

/// Channels (forces and moments) in which a formula is searched for. If `rudder` is true, a rudder moves that the model does
/// not have. The channels on which a rudder acts are then left out.
fn searched(found: &Found, rudder: bool) -> Vec<Channel> {
    let moved = [Channel::Drag, Channel::Side, Channel::Roll, Channel::Yaw];
    let mut channels = failing(found);
    channels.retain(|c| !(rudder && moved.contains(c)));
    channels
}

/// Whether a free form that was not chosen has more evidence than the chosen formula of the library. The form of the
/// chosen formula is then not certain. The two values of evidence come from different estimates of the model and are not
/// strictly comparable. They therefore decide only on whether the form is called certain.
fn outdone(proposal: &Proposal) -> bool {
    let best = |rungs: &[Rung]| rungs.iter().map(|r| r.evidence).fold(0.0, f64::max);
    let free = proposal.free.as_ref().filter(|free| !free.chosen);
    free.is_some_and(|free| best(&free.front) > best(&proposal.front))
}

/// A proposal before the search for a formula, without results.
fn empty(
    model: &GreyBox,
    verdict: Verdict,
    options: &Options,
    sentences: Vec<String>,
    notes: Vec<String>,
) -> Proposal {
    Proposal {
        schema: "greylag.proposal/1",
        version: env!("CARGO_PKG_VERSION"),
        model: model.name.clone(),
        verdict,
        sentences,
        front: Vec::new(),
        free: None,
        alike: Vec::new(),
        grades: None,
        held_out: None,
        tried: 0,
        refused: Vec::new(),
        settings: Settings {
            seed: options.seed,
            nulls: options.nulls,
            without: options.without.clone(),
            free_forms: options.free_forms,
        },
        nulls: Vec::new(),
        effect: None,
        notes,
    }
}

/// Adds the result of the test, the sentences and, if there is no objection, the text of the effect file to `proposal`.
/// `from` names the flights of the search.
fn conclude(proposal: &mut Proposal, first: &Term, terms: &[Term], tested: HeldOut, from: &str) {
    proposal.refused.extend(objection(&tested));
    proposal.sentences.extend(sentences(proposal, first, terms, &tested));
    if proposal.refused.is_empty() {
        let words = grades::words(&first.form, first.value);
        let alike: Vec<String> = proposal.alike.iter().map(|a| a.formula.clone()).collect();
        proposal.effect = Some(draft::file(terms, &capital(&words), &alike, from));
    }
    proposal.held_out = Some(tested);
}

/// Returns the formula `library`, or a better formula with lagged controls or free forms. Records the free forms in
/// `proposal`.
fn beyond_library(
    ask: &Ask,
    library: Climbed,
    tuned: &GreyBox,
    proposal: &mut Proposal,
    progress: &Progress,
) -> Result<Climbed, DiagnoseError> {
    let mut doubted = doubt(ask, &library);
    let mut library = library;
    let channels = doubted.as_ref().map_or(&[][..], |(_, channels)| channels);
    let forms = lags::forms(&library, channels);
    if !forms.is_empty() {
        report(progress, "trying controls through a lag", LAGS)?;
        proposal.tried += forms.len();
        let lagged = lags::climb(ask, &library, forms, tuned);
        if let Some(lagged) = lagged.filter(|lagged| better(lagged, &library)) {
            library = lagged;
            doubted = doubt(ask, &library);
        }
    }
    let Some(doubt) = doubted.filter(|_| ask.options.free_forms) else { return Ok(library) };
    report(progress, "trying free forms", FREE[0])?;
    let Some((mut record, free)) = beyond(ask, &library, tuned, doubt, &part(progress, FREE))?
    else {
        return Ok(library);
    };
    let taken = better(&free, &library);
    record.chosen &= taken;
    record.front.iter_mut().for_each(|rung| rung.chosen &= taken);
    proposal.free = Some(record);
    Ok(if taken { free } else { library })
}

/// Sentence that states why no formula is searched for; `None` if the diagnosis leaves a residual unexplained.
fn settled(found: &Found, verdict: Verdict) -> Option<String> {
    match verdict {
        Verdict::Unexplained => None,
        Verdict::Unknown => Some(
            "These flights cannot say whether anything is missing, so no formula is proposed."
                .into(),
        ),
        Verdict::Adequate => Some(
            "Nothing is missing that these flights could show, so no formula is proposed.".into(),
        ),
        Verdict::Effect => {
            let ids = found.selected.iter().filter(|s| s.refused.is_empty()).map(|s| s.id);
            let ids: Vec<&str> = ids.collect();
            Some(format!(
                "The catalogue explains it ({}), so no formula is proposed; `greylag amend --effect {}` adds it.",
                ids.join(", "),
                ids.join(" ")
            ))
        }
    }
}

fn nothing(proposal: &Proposal) -> String {
    let best = proposal.front.first().map_or(String::new(), |r| {
        format!(
            "; the closest is {}, evidence {:.1}, where chance reaches {:.1}",
            r.formula, r.evidence, r.threshold
        )
    });
    let free = proposal.free.as_ref().map_or(String::new(), |f| {
        format!(" and {} free forms of at most {MOST_NODES} nodes", f.tried)
    });
    format!("Something is missing, and none of {} shapes{free} is it{best}.", proposal.tried)
}
