//! Search for a formula of a missing effect among free forms, which are all expressions of a grammar up to a size. Every form
//! is evaluated with preset shape constants (constants inside its functions). The constants of the best forms are then
//! fitted. The residual is that of one channel, a force or a moment.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::grammar::{Candidate, Free, Grammar, MOST_NODES, Reach};
use super::refine::Place;
use super::samples::Samples;
use super::screen::{Kept, Screen};
use crate::diagnose::Options;
use crate::diagnose::proposal::draft::{self, Term};
use crate::diagnose::proposal::library::{BESIDE_AIR, Form, OF_AIR, Shape};
use crate::diagnose::search::nulls::threshold;
use crate::diagnose::search::round::Round;
use crate::progress::{Cancelled, Progress, report};
use greylag_num::statistics::quantile;
use greylag_physics::Channel;
use greylag_physics::formula::{Variable, file};

/// Number of forms evaluated at once.
const BATCH: usize = 64;
/// Number of batches between two progress reports.
const REPORT_EVERY: usize = 32;
/// Number of forms of each size (number of nodes) whose constants are fitted.
const FITTED: usize = 8;
/// Number of forms of a channel that are ranked together with the forms of the library of fixed shapes.
const FINALISTS: usize = 20;
/// Significant figures of a fitted constant.
const FIGURES: usize = 2;

/// A form with fitted constants.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// The form, with its channel and factor.
    pub form: Form,
    /// Number of nodes of its expression.
    pub size: usize,
    /// Reduction of the whitened residual sum of squares by the form.
    pub fall: f64,
    /// The reduction minus the penalties for its constants and for the number of forms of its size.
    pub worth: f64,
    /// Evidence: the smaller of the penalised reduction and the block-robust Wald statistic.
    pub evidence: f64,
}

/// Result of the search in one channel.
pub struct Searched {
    /// Number of forms evaluated.
    pub tried: usize,
    /// Critical value of the evidence, from the same search on bootstrap draws under the null hypothesis.
    pub threshold: f64,
    /// The best form of each size, if it reduces the error more than all smaller forms.
    pub front: Vec<Fitted>,
    /// Forms that take part in the final ranking, in descending order of `worth`.
    pub finalists: Vec<Fitted>,
}

/// One of two sets of forms: those that scale with dynamic pressure, or all others.
struct Side {
    of_air: bool,
    grammar: Grammar,
    factor: Vec<f64>,
    kept: Vec<Kept>,
}

/// Searches the free forms for `channel` in the residual of `round`. `None` if no flight measures the channel.
///
/// # Errors
/// If `progress` cancels the search.
pub fn searched(
    round: &Round,
    channel: Channel,
    options: &Options,
    progress: &Progress,
) -> Result<Option<Searched>, Cancelled> {
    let samples = Samples::new(round, channel);
    let Some(screen) = Screen::new(round, &samples, channel) else { return Ok(None) };
    let mut sides: Vec<Side> = [(true, &OF_AIR[..]), (false, &BESIDE_AIR[..])]
        .into_iter()
        .map(|(of_air, variables)| Side {
            of_air,
            grammar: Grammar::new(&reaches(&samples, variables)),
            factor: samples.factor(channel, of_air),
            kept: Vec::new(),
        })
        .collect();
    let tried: usize = sides.iter().map(|s| s.grammar.candidates.len()).sum();
    let mut done = 0;
    for side in &mut sides {
        side.keep(&screen, &samples, |count| {
            report(progress, "trying free forms", 0.7 * (done + count) as f64 / tried as f64)
        })?;
        done += side.kept.len();
    }
    report(progress, "fitting the constants of the best free forms", 0.7)?;
    let counts: Vec<usize> = (0..=MOST_NODES)
        .map(|n| sides.iter().flat_map(|s| &s.grammar.candidates).filter(|c| c.size == n).count())
        .collect();
    let search = Search { channel, screen: &screen, samples: &samples, counts };
    let fitted = search.fitted(&sides);
    report(progress, "the same search in flights that lack nothing", 0.85)?;
    let nulls = search.nulls(&sides, options);
    Ok(Some(Searched {
        tried,
        threshold: threshold(&nulls, options.level),
        front: front(&fitted),
        finalists: finalists(fitted),
    }))
}

/// The variables that can be computed for the flights, with quantiles of their magnitude.
fn reaches(samples: &Samples, variables: &[Variable]) -> Vec<Reach> {
    let of = |variable: &Variable| {
        let all = samples.variable(*variable)?;
        let mut sizes: Vec<f64> = all.iter().map(|x| x.abs()).filter(|x| x.is_finite()).collect();
        sizes.sort_by(f64::total_cmp);
        let still = all.iter().all(|x| *x == all[0]);
        let level = |q: f64| if still { 0.0 } else { rounded(quantile(&sizes, q)) };
        Some(Reach { variable: *variable, levels: [level(0.5), level(0.75), level(0.95)] })
    };
    variables.iter().filter_map(of).collect()
}

fn rounded(x: f64) -> f64 {
    format!("{x:.*e}", FIGURES - 1).parse().unwrap_or(x)
}

impl Side {
    /// Evaluates all forms and stores the results in `kept`. `on_progress` receives the number of forms that are done.
    fn keep(
        &mut self,
        screen: &Screen,
        samples: &Samples,
        on_progress: impl Fn(usize) -> Result<(), Cancelled>,
    ) -> Result<(), Cancelled> {
        let atoms: Vec<Vec<f64>> = self
            .grammar
            .atoms
            .par_iter()
            .map(|a| {
                let mut x = samples.of(&a.free.expression, &a.free.constants);
                if a.below {
                    x.iter_mut().for_each(|x| *x = x.recip());
                }
                x
            })
            .collect();
        let column = |candidate: &Candidate| {
            let mut values = self.factor.clone();
            for part in &candidate.parts {
                values.iter_mut().zip(&atoms[*part]).for_each(|(x, a)| *x *= a);
            }
            screen.column(values)
        };
        let batch = |candidates: &[Candidate]| {
            let columns: Vec<f64> = candidates.iter().flat_map(column).collect();
            let rows = columns.len() / candidates.len();
            screen.keep(&DMatrix::from_vec(rows, candidates.len(), columns))
        };
        let mut kept = Vec::with_capacity(self.grammar.candidates.len());
        for many in self.grammar.candidates.chunks(BATCH * REPORT_EVERY) {
            on_progress(kept.len())?;
            let done: Vec<Vec<Kept>> = many.par_chunks(BATCH).map(batch).collect();
            kept.extend(done.into_iter().flatten());
        }
        self.kept = kept;
        Ok(())
    }

    fn place<'a>(&'a self, search: &'a Search) -> Place<'a> {
        Place { screen: search.screen, samples: search.samples, factor: &self.factor }
    }
}

struct Search<'a> {
    channel: Channel,
    screen: &'a Screen<'a>,
    samples: &'a Samples,
    /// Number of forms of each size.
    counts: Vec<usize>,
}

impl Search<'_> {
    /// Penalty of a form of `size` nodes with `constants` shape constants. It accounts for the fitted numbers of the form, and
    /// for its selection among all forms of this size.
    fn price(&self, size: usize, constants: usize) -> f64 {
        self.screen.price(constants) + 2.0 * (self.counts[size].max(1) as f64).ln()
    }

    /// The best forms of each size for the measured residual, with fitted constants.
    fn fitted(&self, sides: &[Side]) -> Vec<Fitted> {
        let mut best: Vec<(usize, usize, f64)> = Vec::new();
        for size in 1..=MOST_NODES {
            let mut own: Vec<(usize, usize, f64)> = Vec::new();
            for (s, side) in sides.iter().enumerate() {
                for (k, candidate) in side.grammar.candidates.iter().enumerate() {
                    if candidate.size == size {
                        let reached = self.screen.measured(&side.kept[k], candidate.constants);
                        own.push((s, k, reached.fall - self.price(size, candidate.constants)));
                    }
                }
            }
            own.sort_by(|a, b| b.2.total_cmp(&a.2));
            best.extend(own.into_iter().take(FITTED));
        }
        let residual = self.screen.residual();
        let fit = |&(s, k, _): &(usize, usize, f64)| {
            let (side, candidate) = (&sides[s], &sides[s].grammar.candidates[k]);
            let place = side.place(self);
            let (mut free, _) = place.refined(&side.grammar.free(candidate), &residual);
            free.constants.iter_mut().for_each(|c| *c = rounded(*c));
            self.judged(side, free)
        };
        let mut fitted: Vec<Fitted> = best.par_iter().filter_map(fit).collect();
        fitted.sort_by(|a, b| b.worth.total_cmp(&a.worth));
        fitted
    }

    /// Scores the form `free`. `None` if an effect file cannot represent it.
    fn judged(&self, side: &Side, free: Free) -> Option<Fitted> {
        let mut values = self.samples.of(&free.expression, &free.constants);
        values.iter_mut().zip(&side.factor).for_each(|(x, f)| *x *= f);
        let column = self.screen.column(values);
        let kept = self.screen.keep(&DMatrix::from_vec(column.len(), 1, column)).pop()?;
        let (size, constants) = (free.expression.size(), free.constants.len());
        let reached = self.screen.measured(&kept, constants);
        let shape = Shape::Free(Box::leak(Box::new(free)));
        let form = Form { channel: self.channel, of_air: side.of_air, shape };
        let term = Term { form, value: 1.0, sd: 0.1 };
        file::parse(&draft::file(&[term], "Tried.", &[], "flights")).ok()?;
        let worth = reached.fall - self.price(size, constants);
        Some(Fitted { form, size, fall: reached.fall, worth, evidence: reached.evidence })
    }

    /// Best evidence of the search in each bootstrap draw under the null hypothesis that no effect is missing. The constants of
    /// the best form are fitted as for the measured residual.
    fn nulls(&self, sides: &[Side], options: &Options) -> Vec<f64> {
        let of = |k: usize| {
            let null = self.screen.null(options.seed, k);
            let (mut most, mut best) = (f64::NEG_INFINITY, None);
            let mut evidence = f64::NEG_INFINITY;
            for side in sides {
                for (candidate, kept) in side.grammar.candidates.iter().zip(&side.kept) {
                    let reached = self.screen.by_chance(kept, &null, candidate.constants);
                    evidence = evidence.max(reached.evidence);
                    let gain = reached.fall - self.screen.price(candidate.constants);
                    if gain > most {
                        (most, best) = (gain, Some((side, candidate)));
                    }
                }
            }
            let fitted = best.map_or(0.0, |(side, candidate)| {
                let target = self.screen.residual_of(&null);
                let free = side.grammar.free(candidate);
                let (_, fall) = side.place(self).refined(&free, &target);
                fall - self.screen.price(candidate.constants) - most
            });
            // fitting the constants may increase the best evidence as much as the best penalised reduction
            evidence + fitted.max(0.0)
        };
        (0..options.nulls).into_par_iter().map(of).collect()
    }
}

/// The best form of each size, if it reduces the error more than all smaller forms.
fn front(fitted: &[Fitted]) -> Vec<Fitted> {
    let mut front: Vec<Fitted> = Vec::new();
    for size in 1..=MOST_NODES + 1 {
        let own = fitted.iter().filter(|f| f.size == size);
        if let Some(best) = own.max_by(|a, b| a.fall.total_cmp(&b.fall))
            && front.last().is_none_or(|f| best.fall > f.fall)
        {
            front.push(best.clone());
        }
    }
    front
}

/// The best form of each size and the best other forms, at most `FINALISTS` in all, in descending order of `worth`.
fn finalists(fitted: Vec<Fitted>) -> Vec<Fitted> {
    let front = front(&fitted);
    let mut all: Vec<Fitted> = front.clone();
    for other in fitted {
        if all.len() >= FINALISTS {
            break;
        }
        if !all.iter().any(|f| f.form == other.form) {
            all.push(other);
        }
    }
    all.sort_by(|a, b| b.worth.total_cmp(&a.worth));
    all
}
