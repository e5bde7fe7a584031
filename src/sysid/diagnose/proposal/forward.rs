//! Forward selection of the terms of a formula for a missing effect, a force or moment. A form is a function of some variables. A
//! term is a form times a coefficient. A round is the model linearised over the flights, with the forms as candidate regressors.

use super::draft::{self, Term};
use super::grades;
use super::held_out;
use super::library::{self, Form};
use super::result::{Alternative, Grades, Rung};
use crate::diagnose::Options;
use crate::diagnose::regression::catalogue::Entry;
use crate::diagnose::regression::rank::Score;
use crate::diagnose::search::checks;
use crate::diagnose::search::round::{Problem, Round};
use crate::diagnose::search::settling::{Ranked, ranked};
use crate::diagnose::search::stepwise::{Found, SELECTED};
use greylag_model::GreyBox;
use greylag_num::statistics::quantile;
use greylag_physics::Channel;
use greylag_physics::formula::Variable;

/// Largest number of terms of a formula.
const MOST: usize = 3;
/// A further term must reduce the residual sum of squares by more than this share of the first term's reduction.
const WORTH: f64 = 0.05;
/// Number of passes in which all coefficients are re-estimated after a term has been added.
const SETTLING: usize = 2;
/// A channel (force or moment) is searched if the model leaves at least this share of its variance unexplained.
const FAILING: f64 = 5e-4;
/// The unexplained share must also be at least this fraction of the worst channel's share.
const BESIDE: f64 = 0.05;
/// A change of a coefficient by more than this number of standard deviations shows that terms are confounded.
const MOVED: f64 = 5.0;
/// Largest number of channels that are searched.
const CHANNELS: usize = 3;
/// Force and moment channels in the order of the regression.
pub(super) const ORDER: [Channel; 6] =
    [Channel::Drag, Channel::Lift, Channel::Side, Channel::Roll, Channel::Pitch, Channel::Yaw];

/// The channels that the diagnosis leaves unexplained, in descending order of removable residual over its critical value.
pub(super) fn failing(found: &Found) -> Vec<Channel> {
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

/// The forms of the library for `channels`, each with its entry as a candidate of the regression.
pub(super) fn forms(problem: &Problem, channels: &[Channel]) -> Vec<(Form, Entry)> {
    let threshold = |v: Variable, q: f64| rounded(magnitude(problem, v, q));
    candidates(channels.iter().flat_map(|c| library::forms(*c, &threshold)))
}

/// The forms, each with its entry as a candidate of the regression. Invalid forms are left out.
pub(super) fn candidates(forms: impl Iterator<Item = Form>) -> Vec<(Form, Entry)> {
    let entry = |form: Form| {
        let effect = form.effect().ok()?;
        Some((form, Entry { about: effect.about, operator: false }))
    };
    forms.filter_map(entry).collect()
}

/// Rounds `x` to two significant figures, for readable thresholds.
fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// The quantile `share` of the magnitude of a variable over the flights.
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

/// Inputs and limits of a forward search.
pub(super) struct Ask<'a> {
    pub problem: &'a Problem,
    pub options: &'a Options,
    pub forms: &'a [(Form, Entry)],
    /// Whether the residual of each channel is included, in the order of [`ORDER`].
    pub channels: [bool; 6],
    /// Smallest evidence of the first term: the critical value of the search that selected the forms, else 0.
    pub least: f64,
    /// A simpler form is preferred if its reduction of the residual is smaller by at most this share of the best one.
    pub behind: f64,
}

/// Record of a search: formulas, alternatives, certain properties, objections, best evidence in each draw of noise.
#[derive(Clone, Debug, Default)]
pub(super) struct Outcome {
    pub front: Vec<Rung>,
    pub alike: Vec<Alternative>,
    pub grades: Option<Grades>,
    pub refused: Vec<String>,
    pub nulls: Vec<f64>,
}

/// State and result of a forward search.
pub(super) struct Climbed {
    pub outcome: Outcome,
    /// The first term before the joint re-estimation; `None` if no term was found.
    pub first: Option<Term>,
    /// All terms, with their coefficients from the joint re-estimation.
    pub terms: Vec<Term>,
    /// Forms that the flights cannot distinguish from the first term.
    pub class: Vec<Form>,
    /// The model with the terms added.
    pub model: GreyBox,
    /// Residual beyond noise of the model without terms: whitened residual sum of squares minus that of pure noise.
    pub excess: f64,
    /// The first round; `None` if there was nothing to try.
    pub round: Option<Round>,
    /// Whether a further term was significant and removed enough of the residual but could not be added. The present
    /// terms then approximate another form.
    pub significant_left_out: bool,
    first_fall: f64,
}

impl Climbed {
    /// Share of the residual beyond noise that the chosen formula removes.
    pub(super) fn removed(&self) -> f64 {
        self.outcome.front.iter().find(|r| r.chosen).map_or(0.0, |r| r.removed)
    }

    /// Number of nodes (variables, numbers and operations) of the formula.
    pub(super) fn complexity(&self) -> usize {
        self.terms.iter().map(|t| 1 + t.form.shape.complexity()).sum()
    }
}

/// A round, with the index of its best form in `scores`.
struct Stage<'a> {
    round: &'a Round,
    scores: &'a [(usize, Score)],
    place: usize,
    threshold: f64,
}

impl Ask<'_> {
    /// Adds terms to `model` one by one as long as each is significant and removes enough of the residual. `None` if
    /// the model cannot be evaluated over the flights.
    pub(super) fn climb(&self, model: GreyBox) -> Option<Climbed> {
        let given = model.clone();
        let excess = self.excess(&model)?.max(1.0);
        let mut c = Climbed {
            outcome: Outcome::default(),
            first: None,
            terms: Vec::new(),
            class: Vec::new(),
            model,
            excess,
            round: None,
            significant_left_out: false,
            first_fall: 0.0,
        };
        while c.terms.len() < MOST {
            let open: Vec<Entry> =
                self.forms.iter().map(|(_, e)| *e).filter(|e| !c.model.has(e.about.id)).collect();
            let round = Round::new(self.problem, c.model.clone(), &open)?;
            let Ranked { round, scores, nulls, threshold } =
                ranked(self.problem, round, self.options);
            let on = self.winner(&round, &scores).is_some_and(|place| {
                if c.terms.is_empty() {
                    c.outcome.nulls = nulls;
                }
                let stage = Stage { round: &round, scores: &scores, place, threshold };
                let count = c.terms.len();
                let added = self.joins(&mut c, &given, &stage);
                draft::kept(&mut c.terms, count, added)
            });
            c.round.get_or_insert(round);
            if !on {
                break;
            }
        }
        if let Some(rung) = c.terms.len().checked_sub(1).and_then(|k| c.outcome.front.get_mut(k)) {
            rung.chosen = true;
        }
        if let Some(grades) = c.outcome.grades.as_mut().filter(|_| c.significant_left_out) {
            *grades = Grades { variables: false, trend: false, form: false, ..*grades };
        }
        c.first = c.terms.first().copied();
        c.terms = self.joint(&c.model, std::mem::take(&mut c.terms));
        Some(c)
    }

    /// Records the best form of a round and, if accepted, adds it to the terms and the model. Returns whether it was
    /// added. `None` if the model with the form cannot be evaluated over the flights.
    fn joins(&self, c: &mut Climbed, given: &GreyBox, stage: &Stage) -> Option<bool> {
        let &Stage { round, scores, place, threshold } = stage;
        let (trial, score) = &scores[place];
        let form = self.form(round.trials[*trial].id)?.fitted(&score.values);
        let first = c.terms.is_empty();
        let threshold = if first { threshold.max(self.least) } else { threshold };
        let before = c.outcome.front.last().map_or(0.0, |r| r.removed);
        let worth = score.fall > WORTH * c.first_fall;
        c.terms.push(Term { form, value: score.values[0], sd: score.deviations[0] });
        c.outcome.front.push(Rung {
            formula: draft::formula(&c.terms),
            complexity: c.complexity(),
            // the reduction by a term may exceed the residual: other coefficients no longer compensate for its absence
            removed: (before + score.fall / c.excess).min(1.0),
            evidence: score.evidence,
            threshold,
            chosen: false,
        });
        let much = score.fall > WORTH * c.excess;
        c.significant_left_out = !first && score.evidence > threshold && much;
        if score.evidence <= threshold || !worth {
            c.terms.pop();
            return Some(false);
        }
        if first {
            c.first_fall = score.fall;
            self.grade(c, stage, &form);
        }
        let Some(tuned) = self.tuned(round, *trial, score)? else {
            c.terms.pop();
            return Some(false);
        };
        let removed = held_out::removed(self.problem, given, &tuned, &self.channels)?;
        // a term that changes other terms strongly, or does not reduce the residual, duplicates another term
        if c.terms.iter().any(|t| moved(t, &tuned)) || removed <= before {
            c.terms.pop();
            return Some(false);
        }
        if let Some(rung) = c.outcome.front.last_mut() {
            rung.removed = removed;
        }
        c.model = tuned;
        c.significant_left_out = false;
        Some(true)
    }

    /// Determines which properties of the first term are certain, and which other forms cannot be distinguished from it.
    fn grade(&self, c: &mut Climbed, stage: &Stage, form: &Form) {
        let &Stage { round, scores, place, .. } = stage;
        let (trial, score) = &scores[place];
        let alike = self.alike(round, scores, place);
        c.outcome.refused.extend(contradicted(round, *trial, score));
        let steady = self.selected(round, scores, place) >= SELECTED;
        c.class = alike.iter().map(|a| a.0).collect();
        let mut grades = grades::grades(form, &c.class);
        grades.form &= steady && !self.surpassed(stage);
        c.outcome.grades = Some(grades);
        let alternative = |(form, evidence): &(Form, f64)| Alternative {
            formula: draft::formula(&[Term { form: *form, value: 0.0, sd: 0.0 }]),
            evidence: *evidence,
        };
        c.outcome.alike = alike.iter().map(alternative).collect();
    }

    /// Residual beyond noise of `model`; `None` if the model cannot be evaluated over the flights.
    fn excess(&self, model: &GreyBox) -> Option<f64> {
        Some(checks::excess(&Round::new(self.problem, model.clone(), &[])?, &self.channels))
    }

    /// The model of `round` with a candidate added, re-estimated. `Some(None)` if the candidate cannot be added.
    fn tuned(&self, round: &Round, trial: usize, score: &Score) -> Option<Option<GreyBox>> {
        let mut model = round.with(score);
        if model.join_most(round.trials[trial].id, &score.values).is_err() {
            return Some(None);
        }
        for _ in 0..SETTLING {
            model = Round::new(self.problem, model, &[])?.tuned();
        }
        Some(Some(model))
    }

    /// Share of the block bootstraps in which the form at index `place`, or an indistinguishable form, is best.
    fn selected(&self, round: &Round, scores: &[(usize, Score)], place: usize) -> f64 {
        let alike = checks::class(round, scores, place);
        let members: Vec<usize> =
            std::iter::once(&place).chain(&alike).map(|k| scores[*k].0).collect();
        let open: Vec<usize> = scores.iter().map(|(t, _)| *t).collect();
        match self.options.bootstraps {
            0 => 1.0,
            count => checks::selected(round, &open, &members, count),
        }
    }

    /// Index in `scores` of the simplest form that is about as good as the best form.
    fn winner(&self, round: &Round, scores: &[(usize, Score)]) -> Option<usize> {
        let fits = |k: &usize| {
            let (trial, score) = &scores[*k];
            !round.at_bound(*trial, score) && !checks::absorbs_prior_error(round, score)
        };
        let best = (0..scores.len()).find(fits)?;
        let size =
            |k: usize| self.form(round.trials[scores[k].0].id).map_or(99, |f| f.shape.complexity());
        let own = &scores[best].1;
        let pool: Vec<usize> = match self.behind > 0.0 {
            true => (0..scores.len())
                .filter(|k| checks::correlation(round, own, &scores[*k].1).abs() > checks::ALIKE)
                .collect(),
            false => checks::class(round, scores, best),
        };
        // a simpler form must be about as likely, or remove almost as much of the residual
        let likely = |k: &usize| {
            let slack =
                (LIKELY + NODE * (size(best) as f64 - size(*k) as f64)).max(self.behind * own.fall);
            let slack = if self.behind > 0.0 { slack } else { LIKELY };
            scores[*k].1.fall > own.fall - slack && size(*k) < size(best)
        };
        let simpler = pool.into_iter().filter(fits).filter(likely);
        simpler.min_by_key(|k| (size(*k), *k)).or(Some(best))
    }

    /// Forms that the flights cannot distinguish from the form at index `place`, with their evidence. If an earlier
    /// search selected the forms, larger ones are left out, because some larger form always fits as well.
    fn alike(&self, round: &Round, scores: &[(usize, Score)], place: usize) -> Vec<(Form, f64)> {
        let own = self.form(round.trials[scores[place].0].id).map_or(0, |f| f.shape.complexity());
        checks::class(round, scores, place)
            .into_iter()
            .filter_map(|k| {
                let (trial, score) = &scores[k];
                let form = self.form(round.trials[*trial].id)?.fitted(&score.values);
                let same = checks::correlation(round, &scores[place].1, score).abs() > 1.0 - SAME;
                let larger = self.behind > 0.0 && form.shape.complexity() > own;
                (!same && !larger).then_some((form, score.evidence))
            })
            .collect()
    }

    /// Whether a correlated form removes much more of the residual. The form at `place` is then an approximation of it.
    fn surpassed(&self, stage: &Stage) -> bool {
        let &Stage { round, scores, place, .. } = stage;
        let size = |k: usize| {
            let form = self.form(round.trials[scores[k].0].id);
            form.map_or(0.0, |f| f.shape.complexity() as f64)
        };
        let own = &scores[place].1;
        self.behind > 0.0
            && (0..scores.len()).any(|k| {
                let slack = LIKELY + NODE * (size(k) - size(place)).max(0.0);
                let other = &scores[k].1;
                other.fall > own.fall + slack
                    && checks::correlation(round, own, other).abs() > checks::ALIKE
            })
    }

    fn form(&self, id: &str) -> Option<Form> {
        self.forms.iter().find(|(_, e)| e.about.id == id).map(|(form, _)| *form)
    }

    /// The terms with their coefficients in `model`, in which they were estimated jointly.
    fn joint(&self, model: &GreyBox, mut terms: Vec<Term>) -> Vec<Term> {
        for term in &mut terms {
            let prefix = format!("{}.", term.form.id());
            let own = model.coefficients().iter().filter(|c| c.name.starts_with(&prefix));
            let tuned: Vec<f64> = own.map(|c| c.value).collect();
            term.value = tuned.first().copied().unwrap_or(term.value);
            term.form = term.form.fitted(&tuned);
        }
        terms
    }
}

/// Objection to a form whose coefficient differs between flights; `None` if the flights agree.
fn contradicted(round: &Round, trial: usize, score: &Score) -> Option<String> {
    let by_flight = checks::by_flight(round, &round.trials[trial], score);
    checks::contradict(score.values[0], &by_flight[0].1, false)
        .then(|| "the flights contradict one another about its amount".into())
}

/// Whether the joint re-estimation changed the coefficient of `term` by more than its uncertainty allows.
fn moved(term: &Term, model: &GreyBox) -> bool {
    let name = format!("{}.k", term.form.id());
    let now = model.coefficients().iter().find(|c| c.name == name);
    now.is_some_and(|c| {
        let off = (c.value - term.value).abs();
        off > MOVED * term.sd && off > 0.5 * term.value.abs()
    })
}

/// A simpler form may reduce the residual sum of squares by this much less, which is a likelihood ratio of e⁻².
const LIKELY: f64 = 4.0;
/// Additional allowance for each node by which the form is smaller. With each node there are about e times as many forms.
const NODE: f64 = 2.0;
/// Two contributions are the same form, written in different ways, if their correlation differs from ±1 by less than this.
const SAME: f64 = 1e-9;
