//! The forward selection of terms: the best shape joins while it is more than chance and worth it.

use super::draft::{self, Term};
use super::grades;
use super::held_out;
use super::library::{self, Form};
use super::result::{Alternative, Proposal, Rung};
use crate::model::GreyBox;
use crate::num::statistics::quantile;
use crate::physics::Channel;
use crate::physics::formula::Variable;
use crate::sysid::diagnose::Options;
use crate::sysid::diagnose::regression::catalogue::Entry;
use crate::sysid::diagnose::regression::rank::Score;
use crate::sysid::diagnose::search::checks;
use crate::sysid::diagnose::search::round::{Problem, Round};
use crate::sysid::diagnose::search::settling::{Ranked, ranked};
use crate::sysid::diagnose::search::stepwise::{Found, SELECTED};

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
pub(super) struct Ask<'a> {
    pub problem: &'a Problem,
    pub options: &'a Options,
    pub forms: &'a [(Form, Entry)],
}

/// The first term with all of them.
pub(super) type Climbed = Option<(Term, Vec<Term>)>;

impl Ask<'_> {
    /// One term after the other joins `model` while it is more than chance and worth it. `None` if the flights do
    /// not hold the model.
    pub(super) fn climb(&self, mut model: GreyBox, proposal: &mut Proposal) -> Option<Climbed> {
        proposal.tried = self.forms.len();
        let mut terms: Vec<Term> = Vec::new();
        let channels = self.channels();
        let given = model.clone();
        let excess = self.excess(&model, &channels)?.max(1.0);
        let mut first_fall = 0.0;
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
                proposal.refused.extend(contradicted(&round, *trial, score));
                let steady = self.selected(&round, &scores, place) >= SELECTED;
                proposal.grades =
                    Some(grades::grades(&form, &alike.iter().map(|a| a.0).collect::<Vec<_>>()));
                if let Some(grades) = &mut proposal.grades {
                    grades.form &= steady;
                }
                proposal.alike = alike
                    .iter()
                    .map(|(form, evidence)| Alternative {
                        formula: draft::formula(&[Term { form: *form, value: 0.0, sd: 0.0 }]),
                        evidence: *evidence,
                    })
                    .collect();
            }
            let Some(tuned) = self.tuned(&round, *trial, score)? else { break };
            let removed = held_out::removed(self.problem, &given, &tuned, &channels)?;
            // a term that pulls the others far off, or makes things worse, is one of them again
            if terms.iter().any(|t| moved(t, &tuned)) || removed <= before {
                terms.pop();
                break;
            }
            if let Some(rung) = proposal.front.last_mut() {
                rung.removed = removed;
            }
            model = tuned;
        }
        if let Some(rung) = terms.len().checked_sub(1).and_then(|k| proposal.front.get_mut(k)) {
            rung.chosen = true;
        }
        let Some(first) = terms.first().copied() else { return Some(None) };
        Some(Some((first, self.joint(&model, terms))))
    }

    /// The channels of the forms, in the order of the regression.
    fn channels(&self) -> [bool; 6] {
        std::array::from_fn(|c| self.forms.iter().any(|(f, _)| f.channel == ORDER[c]))
    }

    /// What `model` leaves beyond noise in `channels`.
    fn excess(&self, model: &GreyBox, channels: &[bool; 6]) -> Option<f64> {
        Some(checks::excess(&Round::new(self.problem, model.clone(), &[])?, channels))
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
