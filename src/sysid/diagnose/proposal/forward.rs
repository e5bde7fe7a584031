//! The forward selection of terms: the best shape joins while it is more than chance and worth it.

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

/// Terms of a formula.
const MOST: usize = 3;
/// Least part of what the first term takes that a further one must take.
const WORTH: f64 = 0.05;
/// Passes of tuning after a term has joined.
const SETTLING: usize = 2;
/// Share of a channel's variance beyond noise from which a search in it is worth its time: what the diagnosis
/// takes for adequate.
const FAILING: f64 = 5e-4;
/// The same beside the worst channel: what a lesser one lacks is searched for once that is mended.
const BESIDE: f64 = 0.05;
/// Standard deviations by which tuning all terms together may move a coefficient: beyond, the terms say the same.
const MOVED: f64 = 5.0;
/// Channels that are searched.
const CHANNELS: usize = 3;
/// Channels of forces and moments in the order of the regression.
pub(super) const ORDER: [Channel; 6] =
    [Channel::Drag, Channel::Lift, Channel::Side, Channel::Roll, Channel::Pitch, Channel::Yaw];

/// The channels that the diagnosis leaves unexplained, the worst first.
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

/// The forms to be tried, each as a candidate.
pub(super) fn forms(problem: &Problem, channels: &[Channel]) -> Vec<(Form, Entry)> {
    let threshold = |v: Variable, q: f64| rounded(magnitude(problem, v, q));
    candidates(channels.iter().flat_map(|c| library::forms(*c, &threshold)))
}

/// `forms`, each as a candidate.
pub(super) fn candidates(forms: impl Iterator<Item = Form>) -> Vec<(Form, Entry)> {
    let entry = |form: Form| {
        let effect = form.effect().ok()?;
        Some((form, Entry { about: effect.about, operator: false }))
    };
    forms.filter_map(entry).collect()
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
pub(super) struct Ask<'a> {
    pub problem: &'a Problem,
    pub options: &'a Options,
    pub forms: &'a [(Form, Entry)],
    /// Channels whose error counts, in the order of the regression.
    pub channels: [bool; 6],
    /// Evidence that the first term needs whatever chance reaches among `forms`: where these were picked from more.
    pub least: f64,
    /// Share of what the best form takes by which a simpler one may be behind.
    pub behind: f64,
}

/// What a search says beside its terms.
#[derive(Clone, Debug, Default)]
pub(super) struct Said {
    pub front: Vec<Rung>,
    pub alike: Vec<Alternative>,
    pub grades: Option<Grades>,
    pub refused: Vec<String>,
    pub nulls: Vec<f64>,
}

/// Where a search arrives.
pub(super) struct Climbed {
    pub said: Said,
    /// The first term as it was found; `None` if none was.
    pub first: Option<Term>,
    /// All of them as tuning leaves them.
    pub terms: Vec<Term>,
    /// The forms that the flights cannot tell from the first one.
    pub class: Vec<Form>,
    /// The model with the terms.
    pub model: GreyBox,
    /// The squared error beyond noise of the model given.
    pub excess: f64,
    /// The first round; `None` if there was nothing to try.
    pub round: Option<Round>,
    /// Whether a further term was more than chance and took a part of the error, and yet did not join: those there are
    /// stand for something else.
    pub significant_left_out: bool,
    first_fall: f64,
}

impl Climbed {
    /// Share of the error beyond noise that the terms remove.
    pub(super) fn removed(&self) -> f64 {
        self.said.front.iter().find(|r| r.chosen).map_or(0.0, |r| r.removed)
    }

    /// Nodes of the formula.
    pub(super) fn complexity(&self) -> usize {
        self.terms.iter().map(|t| 1 + t.form.shape.complexity()).sum()
    }
}

/// A round with its winner.
struct Stage<'a> {
    round: &'a Round,
    scores: &'a [(usize, Score)],
    place: usize,
    threshold: f64,
}

impl Ask<'_> {
    /// One term after the other joins `model` while it is more than chance and worth it. `None` if the flights do
    /// not hold the model.
    pub(super) fn climb(&self, model: GreyBox) -> Option<Climbed> {
        let given = model.clone();
        let excess = self.excess(&model)?.max(1.0);
        let mut c = Climbed {
            said: Said::default(),
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
                    c.said.nulls = nulls;
                }
                let stage = Stage { round: &round, scores: &scores, place, threshold };
                self.joins(&mut c, &given, &stage) == Some(true)
            });
            c.round.get_or_insert(round);
            if !on {
                break;
            }
        }
        if let Some(rung) = c.terms.len().checked_sub(1).and_then(|k| c.said.front.get_mut(k)) {
            rung.chosen = true;
        }
        if let Some(grades) = c.said.grades.as_mut().filter(|_| c.significant_left_out) {
            *grades = Grades { variables: false, trend: false, form: false, ..*grades };
        }
        c.first = c.terms.first().copied();
        c.terms = self.joint(&c.model, std::mem::take(&mut c.terms));
        Some(c)
    }

    /// Notes the winner of a round in the front and, if it passes, in the terms and the model; whether it joined.
    /// `None` if the flights do not hold the model with it.
    fn joins(&self, c: &mut Climbed, given: &GreyBox, stage: &Stage) -> Option<bool> {
        let &Stage { round, scores, place, threshold } = stage;
        let (trial, score) = &scores[place];
        let form = self.form(round.trials[*trial].id)?.fitted(&score.values);
        let first = c.terms.is_empty();
        let threshold = if first { threshold.max(self.least) } else { threshold };
        let before = c.said.front.last().map_or(0.0, |r| r.removed);
        let worth = score.fall > WORTH * c.first_fall;
        c.terms.push(Term { form, value: score.values[0], sd: score.deviations[0] });
        c.said.front.push(Rung {
            formula: draft::formula(&c.terms),
            complexity: c.complexity(),
            // a term also frees the coefficients that stood in for it, which are counted in its fall
            removed: (before + score.fall / c.excess).min(1.0),
            evidence: score.evidence,
            threshold,
            chosen: false,
        });
        // until it stands beside the others
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
        // a term that pulls the others far off, or makes things worse, is one of them again
        if c.terms.iter().any(|t| moved(t, &tuned)) || removed <= before {
            c.terms.pop();
            return Some(false);
        }
        if let Some(rung) = c.said.front.last_mut() {
            rung.removed = removed;
        }
        c.model = tuned;
        c.significant_left_out = false;
        Some(true)
    }

    /// What is sure of the first term.
    fn grade(&self, c: &mut Climbed, stage: &Stage, form: &Form) {
        let &Stage { round, scores, place, .. } = stage;
        let (trial, score) = &scores[place];
        let alike = self.alike(round, scores, place);
        c.said.refused.extend(contradicted(round, *trial, score));
        let steady = self.selected(round, scores, place) >= SELECTED;
        c.class = alike.iter().map(|a| a.0).collect();
        let mut grades = grades::grades(form, &c.class);
        grades.form &= steady && !self.surpassed(stage);
        c.said.grades = Some(grades);
        let alternative = |(form, evidence): &(Form, f64)| Alternative {
            formula: draft::formula(&[Term { form: *form, value: 0.0, sd: 0.0 }]),
            evidence: *evidence,
        };
        c.said.alike = alike.iter().map(alternative).collect();
    }

    /// What `model` leaves beyond noise.
    fn excess(&self, model: &GreyBox) -> Option<f64> {
        Some(checks::excess(&Round::new(self.problem, model.clone(), &[])?, &self.channels))
    }

    /// The model of `round` with a trial in it, all coefficients tuned together; `Some(None)` if it cannot join.
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

    /// Share of the block bootstraps in which the form in `place` or a look-alike is the best.
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

    /// The simplest of those that are as good as the best one.
    fn winner(&self, round: &Round, scores: &[(usize, Score)]) -> Option<usize> {
        let fits = |k: &usize| {
            let (trial, score) = &scores[*k];
            !round.at_bound(*trial, score) && !checks::relieves(round, score)
        };
        let best = (0..scores.len()).find(fits)?;
        let size =
            |k: usize| self.form(round.trials[scores[k].0].id).map_or(99, |f| f.shape.complexity());
        let own = &scores[best].1;
        let pool: Vec<usize> = match self.behind > 0.0 {
            true => (0..scores.len())
                .filter(|k| checks::likeness(round, own, &scores[*k].1).abs() > checks::ALIKE)
                .collect(),
            false => checks::class(round, scores, best),
        };
        // a simpler one in its place must be as likely, or as good in practice
        let likely = |k: &usize| {
            let slack =
                (LIKELY + NODE * (size(best) as f64 - size(*k) as f64)).max(self.behind * own.fall);
            let slack = if self.behind > 0.0 { slack } else { LIKELY };
            scores[*k].1.fall > own.fall - slack && size(*k) < size(best)
        };
        let simpler = pool.into_iter().filter(fits).filter(likely);
        simpler.min_by_key(|k| (size(*k), *k)).or(Some(best))
    }

    /// The forms that these flights cannot tell from the one in `place`, with their evidence: of those that were
    /// picked from more, no larger ones, of which there is always one.
    fn alike(&self, round: &Round, scores: &[(usize, Score)], place: usize) -> Vec<(Form, f64)> {
        let own = self.form(round.trials[scores[place].0].id).map_or(0, |f| f.shape.complexity());
        checks::class(round, scores, place)
            .into_iter()
            .filter_map(|k| {
                let (trial, score) = &scores[k];
                let form = self.form(round.trials[*trial].id)?.fitted(&score.values);
                let same = checks::likeness(round, &scores[place].1, score).abs() > 1.0 - SAME;
                let larger = self.behind > 0.0 && form.shape.complexity() > own;
                (!same && !larger).then_some((form, score.evidence))
            })
            .collect()
    }

    /// Whether a form much like the winner takes more than it by more than its size is worth: the simpler one is as good in
    /// practice, and its form is not the truth.
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
                    && checks::likeness(round, own, other).abs() > checks::ALIKE
            })
    }

    fn form(&self, id: &str) -> Option<Form> {
        self.forms.iter().find(|(_, e)| e.about.id == id).map(|(form, _)| *form)
    }

    /// The terms with their coefficients as all of them together were tuned.
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

/// Why a form is not proposed whose amount differs from flight to flight, as for an effect of the catalogue.
fn contradicted(round: &Round, trial: usize, score: &Score) -> Option<String> {
    let by_flight = checks::by_flight(round, &round.trials[trial], score);
    checks::contradict(score.values[0], &by_flight)
        .then(|| "the flights contradict one another about its amount".into())
}

/// Whether tuning has moved the coefficient of `term` in `model` further than its own uncertainty allows.
fn moved(term: &Term, model: &GreyBox) -> bool {
    let name = format!("{}.k", term.form.id());
    let now = model.coefficients().iter().find(|c| c.name == name);
    now.is_some_and(|c| {
        let off = (c.value - term.value).abs();
        off > MOVED * term.sd && off > 0.5 * term.value.abs()
    })
}

/// Fall of the squared error by which a simpler form may be behind: its likelihood is then e⁻² of the other's.
const LIKELY: f64 = 4.0;
/// The same for each node that it has less: with a node more there are about e times as many forms.
const NODE: f64 = 2.0;
/// Forms whose contributions are as alike as this are one, written in two ways.
const SAME: f64 = 1e-9;
