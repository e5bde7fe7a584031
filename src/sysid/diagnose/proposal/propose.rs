//! The search for a formula: one term after the other on some flights, the whole tested on others.

use super::draft::{self, Term};
use super::grades;
use super::library::{self, Form};
use super::result::{Alternative, HeldOut, Proposal, Rung};
use crate::model::GreyBox;
use crate::num::statistics::quantile;
use crate::physics::Channel;
use crate::physics::formula::{Variable, Written};
use crate::sysid::diagnose::answer::run::{problem, verdict};
use crate::sysid::diagnose::answer::sentences::figures;
use crate::sysid::diagnose::regression::catalogue::Entry;
use crate::sysid::diagnose::regression::rank::{Draw, Score, quadratic};
use crate::sysid::diagnose::search::checks;
use crate::sysid::diagnose::search::excitation;
use crate::sysid::diagnose::search::nulls;
use crate::sysid::diagnose::search::round::{Problem, Round};
use crate::sysid::diagnose::search::settling::{Ranked, ranked};
use crate::sysid::diagnose::search::stepwise::{Found, search};
use crate::sysid::diagnose::{DiagnoseError, Options, Verdict};
use crate::sysid::flight_path::reconstruction::Reconstruction;
use crate::sysid::progress::{Progress, part, say};

/// Terms of a formula.
const MOST: usize = 3;
/// Least part of what the first term takes that a further one must take.
const WORTH: f64 = 0.05;
/// Passes of tuning after a term has joined.
const SETTLING: usize = 2;
/// Share of a channel's variance beyond noise from which a search in it is worth its time: what the diagnosis
/// takes for adequate.
const FAILING: f64 = 5e-4;
/// Shares of the work after the diagnosis, and before the test.
const SEARCHED: f64 = 0.3;
const TESTED: f64 = 0.9;
/// The same beside the worst channel: what a lesser one lacks is searched for once that is mended.
const BESIDE: f64 = 0.05;
/// Channels that are searched.
const CHANNELS: usize = 3;
/// Channels of forces and moments in the order of the regression.
const ORDER: [Channel; 6] =
    [Channel::Drag, Channel::Lift, Channel::Side, Channel::Roll, Channel::Pitch, Channel::Yaw];

/// Proposes a formula for what `model` lacks according to `flights`, if a diagnosis leaves it unexplained, and tests
/// it on `held_out`; `progress` hears what is being done.
///
/// # Errors
/// As of [`diagnose`](crate::sysid::diagnose::diagnose).
pub fn propose(
    model: &GreyBox,
    flights: &[Reconstruction],
    held_out: &[Reconstruction],
    options: &Options,
    progress: &Progress,
) -> Result<Proposal, DiagnoseError> {
    let unusable = || DiagnoseError::Unusable { model: model.name.clone() };
    let (problem, _, mut notes) = problem(model, flights, options)?;
    notes.extend(excitation::check(&problem.flights)?);
    let found = search(&problem, model, options, &part(progress, [0.0, SEARCHED]))?;
    let mut proposal = Proposal {
        schema: "greylag.proposal/1",
        version: env!("CARGO_PKG_VERSION"),
        model: model.name.clone(),
        verdict: verdict(&found),
        sentences: Vec::new(),
        front: Vec::new(),
        alike: Vec::new(),
        grades: None,
        held_out: None,
        tried: 0,
        nulls: Vec::new(),
        effect: None,
        notes,
    };
    if let Some(why) = settled(&found, proposal.verdict) {
        proposal.sentences.push(why);
        return Ok(proposal);
    }
    let tuned = Round::new(&problem, model.clone(), &[]).ok_or_else(unusable)?.tuned();
    let forms = forms(&problem, &failing(&found));
    say(progress, &format!("trying {} shapes", forms.len()), SEARCHED)?;
    let ask = Ask { problem: &problem, options, forms: &forms };
    let climbed = ask.climb(tuned.clone(), &mut proposal).ok_or_else(unusable)?;
    let Some((first, terms)) = climbed else {
        proposal.sentences.push(nothing(&proposal));
        return Ok(proposal);
    };
    if let Some(grades) = proposal.grades.as_mut() {
        // further terms say that the first one's form is not the whole
        grades.form &= terms.len() == 1;
    }
    say(progress, "testing the formula on flights that the search has not seen", TESTED)?;
    let (test, used, more) = self::problem(model, held_out, options)?;
    proposal.notes.extend(more);
    let names: Vec<String> = used.iter().map(|f| f.name.clone()).collect();
    let tested = tested(&test, &tuned, &terms, options, names).ok_or_else(unusable)?;
    let borne_out = tested.fall > tested.threshold;
    proposal.sentences.extend(sentences(&proposal, &first, &terms, &tested));
    if borne_out {
        let words = grades::words(&first.form, first.value);
        let alike: Vec<String> = proposal.alike.iter().map(|a| a.formula.clone()).collect();
        let from = flights.iter().map(|f| f.name.as_str()).collect::<Vec<_>>().join(", ");
        proposal.effect = Some(draft::file(&terms, &capital(&words), &alike, &from));
    }
    proposal.held_out = Some(tested);
    Ok(proposal)
}

/// Why there is nothing to propose, where the catalogue or chance explains what is left.
fn settled(found: &Found, verdict: Verdict) -> Option<String> {
    match verdict {
        Verdict::Unexplained => None,
        Verdict::Adequate => Some(
            "Nothing is missing that these flights could show, so no formula is proposed.".into(),
        ),
        Verdict::Effect => {
            let ids = found.selected.iter().filter(|s| s.refused.is_empty()).map(|s| s.id);
            Some(format!(
                "The catalogue explains it ({}), so no formula is proposed; `greylag amend --accept` adds it.",
                ids.collect::<Vec<_>>().join(", ")
            ))
        }
    }
}

/// The channels that the diagnosis leaves unexplained, the worst first.
fn failing(found: &Found) -> Vec<Channel> {
    let tuned = &found.unexplained;
    let removable = |c: usize| {
        let of = &found.first_remainder;
        of.removable[c] / of.threshold[c].max(f64::MIN_POSITIVE)
    };
    let worst = tuned.iter().fold(0.0_f64, |a, b| a.max(*b));
    let least = FAILING.max(BESIDE * worst);
    let mut all: Vec<usize> = (0..ORDER.len()).filter(|c| tuned[*c] >= least).collect();
    all.sort_by(|a, b| removable(*b).total_cmp(&removable(*a)));
    all.truncate(CHANNELS);
    all.into_iter().map(|c| ORDER[c]).collect()
}

/// The forms to be tried, each as a candidate.
fn forms(problem: &Problem, channels: &[Channel]) -> Vec<(Form, Entry)> {
    let threshold = |v: Variable, q: f64| rounded(magnitude(problem, v, q));
    let all = channels.iter().flat_map(|c| library::forms(*c, &threshold));
    let entry = |form: Form| {
        let effect = form.effect().ok()?;
        Some((form, Entry { about: effect.about, operator: false }))
    };
    all.filter_map(entry).collect()
}

/// Two significant figures, so that thresholds can be read.
fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// A quantile of the magnitude of a variable over the flights.
fn magnitude(problem: &Problem, variable: Variable, share: f64) -> f64 {
    let mut values: Vec<f64> = Vec::new();
    for instant in problem.flights.iter().flat_map(|f| f.segments.iter().flatten()) {
        let (s, z) = (&instant.state, &instant.controls);
        values.push(match variable {
            Variable::Alpha => s.alpha,
            Variable::Beta => s.beta,
            Variable::Aileron => z.aileron,
            Variable::Elevator => z.elevator,
            Variable::Throttle => z.throttle,
            _ => continue,
        });
    }
    values.iter_mut().for_each(|x| *x = x.abs());
    values.retain(|x| x.is_finite());
    values.sort_by(f64::total_cmp);
    quantile(&values, share)
}

/// What is searched, and in what.
struct Ask<'a> {
    problem: &'a Problem,
    options: &'a Options,
    forms: &'a [(Form, Entry)],
}

/// The first term with all of them.
type Climbed = Option<(Term, Vec<Term>)>;

impl Ask<'_> {
    /// One term after the other joins `model` while it is more than chance and worth it. `None` if the flights do
    /// not hold the model.
    fn climb(&self, mut model: GreyBox, proposal: &mut Proposal) -> Option<Climbed> {
        proposal.tried = self.forms.len();
        let mut terms: Vec<Term> = Vec::new();
        let (mut first_fall, mut excess) = (0.0, 1.0);
        while terms.len() < MOST {
            let open: Vec<Entry> =
                self.forms.iter().map(|(_, e)| *e).filter(|e| !model.has(e.about.id)).collect();
            let round = Round::new(self.problem, model.clone(), &open)?;
            let Ranked { round, scores, nulls, threshold } =
                ranked(self.problem, round, self.options);
            let Some(place) = self.winner(&round, &scores) else { break };
            let (trial, score) = &scores[place];
            let form = self.form(round.trials[*trial].id)?;
            let passes = score.evidence > threshold && score.fall > WORTH * first_fall;
            if terms.is_empty() {
                proposal.nulls = nulls;
                first_fall = score.fall;
                let channels =
                    std::array::from_fn(|c| self.forms.iter().any(|(f, _)| f.channel == ORDER[c]));
                excess = checks::excess(&round, &channels).max(score.fall).max(1.0);
            }
            let term = Term { form, value: score.values[0], sd: score.deviations[0] };
            terms.push(term);
            let before = proposal.front.last().map_or(0.0, |r| r.removed);
            proposal.front.push(Rung {
                formula: draft::formula(&terms),
                complexity: terms.iter().map(|t| 1 + t.form.shape.complexity()).sum(),
                removed: before + score.fall / excess,
                evidence: score.evidence,
                threshold,
                chosen: false,
            });
            if !passes {
                terms.pop();
                break;
            }
            if terms.len() == 1 {
                let alike = self.alike(&round, &scores, place);
                proposal.grades =
                    Some(grades::grades(&form, &alike.iter().map(|a| a.0).collect::<Vec<_>>()));
                proposal.alike = alike
                    .iter()
                    .map(|(form, evidence)| Alternative {
                        formula: draft::formula(&[Term { form: *form, value: 0.0, sd: 0.0 }]),
                        evidence: *evidence,
                    })
                    .collect();
            }
            model = round.with(score);
            if model.join_most(round.trials[*trial].id, &score.values).is_err() {
                break;
            }
            for _ in 0..SETTLING {
                model = Round::new(self.problem, model, &[])?.tuned();
            }
        }
        if let Some(rung) = terms.len().checked_sub(1).and_then(|k| proposal.front.get_mut(k)) {
            rung.chosen = true;
        }
        let Some(first) = terms.first().copied() else { return Some(None) };
        Some(Some((first, self.joint(&model, terms))))
    }

    /// The simplest of those that are as good as the best one.
    fn winner(&self, round: &Round, scores: &[(usize, Score)]) -> Option<usize> {
        let fits = |k: &usize| {
            let (trial, score) = &scores[*k];
            !round.at_bound(*trial, score) && !checks::relieves(round, score)
        };
        let best = (0..scores.len()).find(fits)?;
        let size =
            |k: usize| self.form(round.trials[scores[k].0].id).map_or(99, |f| f.shape.complexity());
        let alike = checks::class(round, scores, best).into_iter().filter(fits);
        // a simpler one in its place must be as likely
        let likely = alike
            .filter(|k| scores[*k].1.fall > scores[best].1.fall - LIKELY && size(*k) < size(best));
        likely.min_by_key(|k| (size(*k), *k)).or(Some(best))
    }

    /// The forms that these flights cannot tell from the one in `place`, with their evidence.
    fn alike(&self, round: &Round, scores: &[(usize, Score)], place: usize) -> Vec<(Form, f64)> {
        checks::class(round, scores, place)
            .into_iter()
            .filter_map(|k| {
                let (trial, score) = &scores[k];
                Some((self.form(round.trials[*trial].id)?, score.evidence))
            })
            .collect()
    }

    fn form(&self, id: &str) -> Option<Form> {
        self.forms.iter().find(|(_, e)| e.about.id == id).map(|(form, _)| *form)
    }

    /// The terms with their coefficients as all of them together were tuned.
    fn joint(&self, model: &GreyBox, mut terms: Vec<Term>) -> Vec<Term> {
        for term in &mut terms {
            let name = format!("{}.k", term.form.id());
            let tuned = model.coefficients().iter().find(|c| c.name == name);
            term.value = tuned.map_or(term.value, |c| c.value);
        }
        terms
    }
}

/// Fall of the squared error by which a simpler form may be behind: its likelihood is then e⁻² of the other's.
const LIKELY: f64 = 4.0;

/// What `terms`, their coefficients as they are, take of what `model` leaves in flights that were not searched.
fn tested(
    problem: &Problem,
    model: &GreyBox,
    terms: &[Term],
    options: &Options,
    flights: Vec<String>,
) -> Option<HeldOut> {
    let effects: Vec<&'static Written> =
        terms.iter().filter_map(|t| t.form.effect().ok()).collect();
    let entries: Vec<Entry> =
        effects.iter().map(|e| Entry { about: e.about, operator: false }).collect();
    let round = Round::new(problem, model.clone(), &entries)?;
    let grams = round.projected.grams();
    let weight =
        |id: &str| terms.iter().zip(&effects).find(|(_, e)| e.about.id == id).map(|(t, _)| t.value);
    let weights: Vec<(usize, f64)> =
        round.trials.iter().filter_map(|t| Some((t.points[0].free[0].1, weight(t.id)?))).collect();
    let square = quadratic(&weights, &weights, &grams.total);
    let fall =
        |draw: &Draw| 2.0 * weights.iter().map(|(c, w)| w * draw.total[*c]).sum::<f64>() - square;
    let measured = fall(&Draw::measured(&grams));
    let mut chance: Vec<f64> =
        (0..options.nulls).map(|k| fall(&nulls::draw(&round.projected, options.seed, k))).collect();
    chance.sort_by(f64::total_cmp);
    let channels = std::array::from_fn(|c| terms.iter().any(|t| t.form.channel == ORDER[c]));
    let excess = checks::excess(&round, &channels).max(measured).max(1.0);
    // nothing is gained by a fall below zero
    let threshold = chance.last().copied().unwrap_or(f64::INFINITY).max(0.0);
    Some(HeldOut { flights, removed: measured / excess, fall: measured, threshold })
}

fn nothing(proposal: &Proposal) -> String {
    let best = proposal.front.first().map_or(String::new(), |r| {
        format!(
            "; the closest is {}, evidence {:.1}, where chance reaches {:.1}",
            r.formula, r.evidence, r.threshold
        )
    });
    format!("Something is missing, and none of {} shapes is it{best}.", proposal.tried)
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |c| c.to_uppercase().chain(letters).collect()) + "."
}

/// What was found, in sentences.
fn sentences(proposal: &Proposal, first: &Term, terms: &[Term], tested: &HeldOut) -> Vec<String> {
    let mut said: Vec<String> = Vec::new();
    for term in terms {
        let unit = term.form.unit();
        let at = match (&term.form.shape, term.form.of_air) {
            (library::Shape::Linear(Variable::Throttle), false) => " at full throttle",
            _ => "",
        };
        said.push(format!(
            "{} {} ± {}{}{at} ({} = k*{}{}).",
            capital(&grades::words(&term.form, term.value)).trim_end_matches('.').to_owned() + ":",
            figures(term.value),
            figures(term.sd),
            if unit.is_empty() { String::new() } else { format!(" {unit}") },
            crate::physics::formula::file::channel_name(term.form.channel),
            if term.form.of_air { format!("{}*", term.form.factor()) } else { String::new() },
            term.form.shape.text(None)
        ));
    }
    if let Some(g) = proposal.grades {
        let sure = [
            ("channel", g.channel),
            ("variables", g.variables),
            ("trend", g.trend),
            ("form", g.form),
        ];
        let of = |wanted: bool| {
            let all: Vec<&str> =
                sure.iter().filter(|(_, s)| *s == wanted).map(|(n, _)| *n).collect();
            all.join(", ")
        };
        said.push(match (of(true), of(false)) {
            (sure, open) if open.is_empty() => {
                format!("Sure of {}: {sure}.", grades::amount(first.form.channel))
            }
            (sure, open) => format!(
                "Sure: {sure}. Open: {open}; these flights cannot tell it from {}.",
                proposal
                    .alike
                    .iter()
                    .take(3)
                    .map(|a| a.formula.as_str())
                    .collect::<Vec<_>>()
                    .join(" or ")
            ),
        });
    }
    let verdict =
        if tested.fall > tested.threshold { "it is proposed" } else { "it is not proposed" };
    said.push(format!(
        "On {}, which the search has not seen, it removes {:.0} % of the error beyond noise (fall {:.0}, by chance \
         {:.0}): {verdict}.",
        tested.flights.join(", "),
        100.0 * tested.removed,
        tested.fall,
        tested.threshold
    ));
    said
}
