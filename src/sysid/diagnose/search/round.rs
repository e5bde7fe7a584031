//! One round of the search: a model linearised over all flights, with every candidate's columns.

use rayon::prelude::*;

use crate::model::GreyBox;
use crate::sysid::diagnose::regression::catalogue::{self, Columns, Entry};
use crate::sysid::diagnose::regression::cells::{Cells, Placed};
use crate::sysid::diagnose::regression::columns::{Ready, SENSORS, combine, of_body};
use crate::sysid::diagnose::regression::features;
use crate::sysid::diagnose::regression::gather::Column;
use crate::sysid::diagnose::regression::noise::Noise;
use crate::sysid::diagnose::regression::projected::{Known, Projected, scaled_inverse};
use crate::sysid::diagnose::regression::rank::{Draw, Score, Trial};
use crate::sysid::diagnose::regression::sensors;
use crate::sysid::diagnose::regression::shared;
use crate::sysid::weak_form::prepared::Prepared;

/// Times a nonlinear candidate is linearised anew where it fits best.
const REFINEMENTS: usize = 3;
/// Times that the clocks' second order is taken anew.
const CURVATURES: usize = 2;
/// A nonlinear candidate is worth it if it takes this part of what the best one takes,
const WORTH: f64 = 0.2;
/// or if its evidence is this close to the best.
const CLOSE: f64 = 40.0;
/// Draws of the noise that columns and residual share, over which its product is averaged. With one, an
/// inertia that is not there had an evidence of 3, 11 or 19 by the seed.
const DRAWS: usize = 8;

/// What all rounds share.
pub struct Problem {
    /// The flights.
    pub flights: Vec<Prepared>,
    /// Prior value and width of each coefficient of the model given.
    pub prior: Vec<(f64, f64)>,
    /// Errors of the reconstructed paths.
    pub path: Vec<shared::PathError>,
    /// Prior widths of the sensors' errors, flight by flight.
    pub sensors: Vec<[f64; SENSORS]>,
    /// Seed of everything random.
    pub seed: u64,
}

/// What a round takes from elsewhere.
#[derive(Clone, Copy, Default)]
pub struct Beside<'a> {
    /// The noise, if it is not estimated anew.
    pub noise: Option<&'a Noise>,
    /// The model by whose accelerations mass and inertia act, if its own are too far off.
    pub accelerating: Option<&'a GreyBox>,
}

/// A model linearised.
pub struct Round {
    /// The model.
    pub model: GreyBox,
    /// The flights under it.
    pub flights: Vec<Ready>,
    /// Their cells.
    pub cells: Cells,
    /// Coefficients and sensor errors fitted along.
    pub known: Vec<Known>,
    /// Place of each known coefficient in the model's list.
    pub coefficients: Vec<usize>,
    /// The candidates.
    pub trials: Vec<Trial>,
    /// Everything projected.
    pub projected: Projected,
    /// Columns flight by flight: known, candidates, residual, features.
    pub placed: Vec<Placed>,
    /// Place of the residual in them.
    pub last: usize,
    /// The noise.
    pub noise: Noise,
    /// Coefficients of the model given; those behind have joined.
    pub given: usize,
    /// Seed of everything random.
    pub seed: u64,
    /// The candidates as they are described.
    pub entries: Vec<Entry>,
    refined: Vec<(&'static str, Vec<f64>)>,
    /// What noise that columns share with the residual feigns, by place, flight by flight.
    pub shared: Vec<Vec<f64>>,
    /// The known columns and the linear candidates' of the flights with their noise once more, in the same
    /// places.
    pub disturbed: Vec<Placed>,
}

impl Round {
    /// `model` with `entries` as candidates; `None` if the flights do not hold it at all.
    pub fn new(problem: &Problem, model: GreyBox, entries: &[Entry]) -> Option<Round> {
        Round::beside(problem, model, entries, Beside::default())
    }

    /// The same with what another round or model knows.
    pub fn beside(
        problem: &Problem,
        model: GreyBox,
        entries: &[Entry],
        beside: Beside,
    ) -> Option<Round> {
        let Beside { noise, accelerating } = beside;
        let ready = |f: &Prepared| Ready::new(&model, f).accelerating_as(accelerating);
        let flights: Vec<Ready> = problem.flights.par_iter().map(ready).collect();
        let cells = Cells::new(&flights);
        let own = 0..model.coefficients().len();
        let linear = flights.par_iter().map(|f| f.linear(&model, own.clone())).collect();
        let (mut known, coefficients, mut placed) = known(problem, &model, &flights, linear);
        let features = features::features(&model, &flights, problem.seed);
        let made = catalogue::columns(&model, &flights, entries, &[]);
        let last = place(&mut placed, known.len(), &made, &flights);
        for (list, own) in placed.iter_mut().zip(features) {
            list.extend(own.into_iter().enumerate().map(|(k, c)| (last + 1 + k, c)));
        }
        let noise = noise.cloned().unwrap_or_else(|| {
            Noise::estimate(&cells, &rich(&placed, known.len(), &made.trials), last)
        });
        let kept: Vec<Placed> = placed.iter().map(|l| up_to(l, last)).collect();
        let (shared, disturbed) = shared(
            &Setting { problem, model: &model, entries, accelerating },
            &cells,
            &kept,
            last,
            &noise,
        );
        let shares = sum(&shared);
        let mut projected = Projected::new(&cells, &kept, last, &known, &noise, &shares)?;
        for _ in 0..CURVATURES {
            curved(problem, &mut known, &projected);
            projected = Projected::new(&cells, &kept, last, &known, &noise, &shares)?;
        }
        Some(Round {
            model,
            flights,
            cells,
            known,
            coefficients,
            trials: made.trials,
            projected,
            placed,
            last,
            noise,
            given: problem.prior.len(),
            seed: problem.seed,
            entries: entries.to_vec(),
            refined: Vec::new(),
            shared,
            disturbed,
        })
    }

    /// The scores of all candidates, best evidence first; nonlinear ones near the top are linearised
    /// again where they fit best.
    pub fn rank(&mut self) -> Vec<(usize, Score)> {
        let mut scores = self.scores();
        for _ in 0..REFINEMENTS {
            let best = scores.first().map_or(0.0, |(_, s)| s.evidence);
            let most = scores.iter().map(|(_, s)| s.fall).fold(0.0, f64::max);
            let mut wanted: Vec<(&'static str, Vec<f64>)> = Vec::new();
            for (k, score) in &scores {
                let trial = &self.trials[*k];
                let point = &trial.points[score.point];
                let moved = point.free.iter().any(|(index, _, [low, high])| {
                    let by = (score.values[*index] - point.values[*index]).abs();
                    by > 0.02 * (high - low)
                });
                let worth = score.fall > WORTH * most || score.evidence > best - CLOSE;
                if point.contribution.is_some() && moved && worth {
                    wanted.push((trial.id, score.values.clone()));
                }
            }
            if wanted.is_empty() || !self.refine(wanted) {
                break;
            }
            scores = self.scores();
        }
        scores
    }

    /// Adds places at which candidates are linearised; `false` if that cannot be done.
    fn refine(&mut self, wanted: Vec<(&'static str, Vec<f64>)>) -> bool {
        self.refined.extend(wanted);
        let made = catalogue::columns(&self.model, &self.flights, &self.entries, &self.refined);
        let count = self.known.len();
        let mut placed: Vec<Placed> =
            self.placed.iter().map(|l| up_to(l, count.saturating_sub(1))).collect();
        let last = place(&mut placed, count, &made, &self.flights);
        let Some(projected) =
            Projected::new(&self.cells, &placed, last, &self.known, &self.noise, &self.shared())
        else {
            return false;
        };
        for (list, old) in placed.iter_mut().zip(&self.placed) {
            let features = old.iter().filter(|(p, _)| *p > self.last);
            list.extend(features.map(|(p, c)| (p - self.last + last, c.clone())));
        }
        (self.placed, self.last, self.projected) = (placed, last, projected);
        self.trials = made.trials;
        true
    }

    /// What noise that columns share with the residual feigns over all flights, by place.
    pub fn shared(&self) -> Vec<f64> {
        sum(&self.shared)
    }

    fn scores(&self) -> Vec<(usize, Score)> {
        let grams = self.projected.grams();
        let draw = Draw::measured(&grams);
        let mut scores: Vec<(usize, Score)> = (0..self.trials.len())
            .filter_map(|k| Some((k, self.trials[k].score(&grams, &draw)?)))
            .collect();
        let key = |(k, s): &(usize, Score)| (!self.at_bound(*k, s), s.order);
        scores.sort_by(|a, b| {
            let (a, b) = (key(a), key(b));
            b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
        });
        scores
    }

    /// Whether a free coefficient of the trial ended at its physical bound.
    pub fn at_bound(&self, trial: usize, score: &Score) -> bool {
        let trial = &self.trials[trial];
        let Some(entry) = self.entries.iter().find(|e| e.about.id == trial.id) else {
            return false;
        };
        trial.points[score.point].free.iter().any(|(index, _, _)| {
            let (low, high) = self.model.size().bounds(&entry.about.coefficients[*index]);
            let near = 1e-6 * (high - low);
            let value = score.values[*index];
            value <= low + near || value >= high - near
        })
    }

    /// Wald statistic of all free constants of an effect that has joined against zero; `None` for one whose
    /// constants are not amounts.
    pub fn amount(&self, id: &str) -> Option<f64> {
        let prefix = format!("{id}.");
        let operator = crate::physics::inputs::Kind::from_id(id).is_some();
        let linear = self.model.linear();
        let named = self.model.coefficients();
        let own: Vec<usize> = (0..self.coefficients.len())
            .filter(|k| named[self.coefficients[*k]].name.starts_with(&prefix))
            .collect();
        if own.is_empty() || !(operator || own.iter().all(|k| linear[self.coefficients[*k]])) {
            return None;
        }
        let p = &self.projected;
        let value = |k: &usize| named[self.coefficients[*k]].value + p.tuned[*k];
        let theta = nalgebra::DVector::from_iterator(own.len(), own.iter().map(value));
        let covariance =
            nalgebra::DMatrix::from_fn(own.len(), own.len(), |i, j| p.covariance[(own[i], own[j])]);
        Some(theta.dot(&(scaled_inverse(&covariance)? * &theta)))
    }

    /// The model with its coefficients where they go once `score`'s effect has joined.
    pub fn with(&self, score: &Score) -> GreyBox {
        let p = &self.projected;
        let mut model = self.model.clone();
        let mut values: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
        for (k, place) in self.coefficients.iter().enumerate() {
            let given: f64 = score.weights.iter().map(|(c, w)| w * p.taken[(k, *c)]).sum();
            values[*place] += p.tuned[k] - given;
        }
        model.set_coefficients(&values);
        model
    }

    /// Measured less the tuned model, sensors' errors taken out, flight by flight.
    pub fn tuned_residual(&self) -> Vec<Column> {
        let na = self.known.len();
        let of = |placed: &Placed| {
            let (mut columns, mut weights) = (Vec::new(), Vec::new());
            for (place, column) in placed {
                if *place < na {
                    weights.push(-self.projected.tuned[*place]);
                    columns.push(column.clone());
                } else if *place == self.last {
                    weights.push(1.0);
                    columns.push(column.clone());
                }
            }
            combine(&columns, &weights)
        };
        self.placed.iter().map(of).collect()
    }

    /// What `score` adds to the residual, flight by flight.
    pub fn contribution(&self, score: &Score) -> Vec<Column> {
        let na = self.known.len();
        let of = |placed: &Placed| {
            let columns: Vec<Column> = score
                .weights
                .iter()
                .filter_map(|(c, _)| {
                    placed.iter().find(|(p, _)| *p == na + c).map(|(_, column)| column.clone())
                })
                .collect();
            let weights: Vec<f64> = score.weights.iter().map(|(_, w)| *w).collect();
            combine(&columns, &weights)
        };
        self.placed.iter().map(of).collect()
    }

    /// What `score` takes of the squared whitened error, channel by channel.
    pub fn taken_by(&self, score: &Score) -> [f64; 6] {
        let mut taken = [0.0; 6];
        let last = self.projected.width();
        for (cell, rows) in self.cells.list.iter().zip(&self.projected.rows) {
            for row in rows.row_iter() {
                let x: f64 = score.weights.iter().map(|(c, w)| w * row[*c]).sum();
                taken[cell.channel] += x * (2.0 * row[last] - x);
            }
        }
        taken
    }

    /// Channels in which `score` takes at least a tenth of what it takes in the best, the best first.
    pub fn channels_of(&self, score: &Score) -> Vec<usize> {
        let taken = self.taken_by(score);
        let most = taken.iter().fold(0.0_f64, |a, b| a.max(*b));
        let mut channels: Vec<usize> =
            (0..6).filter(|c| taken[*c] > 0.1 * most && taken[*c] > 0.0).collect();
        channels.sort_by(|a, b| taken[*b].total_cmp(&taken[*a]));
        channels
    }

    /// The model with its coefficients where the data and their prior put them, asserted effects' within
    /// their bounds.
    pub fn tuned(&self) -> GreyBox {
        let mut model = self.model.clone();
        let linear = model.linear();
        let mut values: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
        for (k, place) in self.coefficients.iter().enumerate() {
            let mut step = self.projected.tuned[k];
            if !linear[*place] {
                let reach = catalogue::REACH * values[*place].abs();
                step = step.clamp(-reach, reach);
            }
            values[*place] += step;
            if *place >= self.given
                && let Some((low, high)) = bounds(&model, *place)
            {
                values[*place] = values[*place].clamp(low, high);
            }
        }
        model.set_coefficients(&values);
        if self.model.body.may_become(&model.body) {
            return model;
        }
        let of_body: Vec<usize> =
            self.coefficients.iter().copied().filter(|k| of_body(&self.model, *k)).collect();
        let given: Vec<f64> = self.model.coefficients().iter().map(|c| c.value).collect();
        let less = (0..100).rev().map(|percent| {
            let mut less = values.clone();
            for k in &of_body {
                less[*k] = given[*k] + 0.01 * f64::from(percent) * (values[*k] - given[*k]);
            }
            less
        });
        for values in less {
            model.set_coefficients(&values);
            if self.model.body.may_become(&model.body) {
                break;
            }
        }
        model
    }
}

/// The list's columns up to `place`.
fn up_to(list: &Placed, place: usize) -> Placed {
    list.iter().take_while(|(p, _)| *p <= place).cloned().collect()
}

/// Puts candidates and residual behind the known columns; the residual's place.
fn place(placed: &mut [Placed], count: usize, made: &Columns, flights: &[Ready]) -> usize {
    let last = count + made.columns.first().map_or(0, Vec::len);
    for ((list, own), flight) in placed.iter_mut().zip(&made.columns).zip(flights) {
        list.extend(own.iter().cloned().enumerate().map(|(k, c)| (count + k, c)));
        list.push((last, flight.residual.clone()));
    }
    last
}

/// The columns of the rich fit: all but the derivatives of nonlinear candidates.
fn rich(placed: &[Placed], count: usize, trials: &[Trial]) -> Vec<Placed> {
    let curved = trials.iter().flat_map(|t| &t.points).filter(|p| p.contribution.is_some());
    let left_out: Vec<usize> = curved.flat_map(|p| p.free.iter().map(|f| count + f.1)).collect();
    let keep = |l: &Placed| l.iter().filter(|(p, _)| !left_out.contains(p)).cloned().collect();
    placed.iter().map(keep).collect()
}

/// The flights with the noise number `draw` once more.
fn disturbed(of: &Setting, draw: usize) -> Vec<Ready> {
    let flights = of.problem.flights.par_iter().zip(&of.problem.path).enumerate();
    flights
        .map(|(k, (f, path))| {
            let flight = shared::disturbed(f, path, of.problem.seed, [k, draw]);
            Ready::new(of.model, &flight).accelerating_as(of.accelerating)
        })
        .collect()
}

/// What a round is made of.
struct Setting<'a> {
    problem: &'a Problem,
    model: &'a GreyBox,
    entries: &'a [Entry],
    accelerating: Option<&'a GreyBox>,
}

/// The sum of lists of one length.
fn sum(lists: &[Vec<f64>]) -> Vec<f64> {
    let count = lists.first().map_or(0, Vec::len);
    (0..count).map(|k| lists.iter().map(|list| list[k]).sum()).collect()
}

/// What noise that columns share with the residual feigns, flight by flight: by place, of the known unknowns
/// and the linear candidates, which stand in front; the mean of `DRAWS` where there are candidates to judge,
/// one draw where a model only settles. With it, those columns with the noise of the first draw.
fn shared(
    of: &Setting,
    cells: &Cells,
    before: &[Placed],
    last: usize,
    noise: &Noise,
) -> (Vec<Vec<f64>>, Vec<Placed>) {
    let straight: Vec<Entry> =
        of.entries.iter().filter(|e| catalogue::straight(e)).copied().collect();
    let everything = catalogue::with_all(of.model, &straight).0;
    let drawn = |draw: usize| {
        let flights = disturbed(of, draw);
        // the model's own columns and the candidates' in one pass
        let all = |flight: &Ready| {
            let mut own = flight.linear(&everything, 0..everything.coefficients().len());
            let candidates = own.split_off(of.model.coefficients().len());
            (own, candidates)
        };
        let (columns, candidates) = flights.par_iter().map(all).unzip();
        let (known, _, mut after) = known(of.problem, of.model, &flights, columns);
        let made = Columns { trials: Vec::new(), columns: candidates };
        let end = place(&mut after, known.len(), &made, &flights);
        // the residual stands where it stands before
        for list in &mut after {
            list.iter_mut().filter(|(p, _)| *p == end).for_each(|(p, _)| *p = last);
        }
        (shared::products(cells, before, &after, last, noise), after)
    };
    let draws = if of.entries.is_empty() { 1 } else { DRAWS };
    let (mut mean, first) = drawn(0);
    let others: Vec<Vec<Vec<f64>>> = (1..draws).into_par_iter().map(|draw| drawn(draw).0).collect();
    for (k, flight) in mean.iter_mut().enumerate() {
        for (place, sum) in flight.iter_mut().enumerate() {
            *sum += others.iter().map(|of| of[k][place]).sum::<f64>();
            *sum /= draws as f64;
        }
    }
    (mean, first)
}

type KnownColumns = (Vec<Known>, Vec<usize>, Vec<Placed>);

/// The known unknowns and their columns: free coefficients, whose columns `linear_columns` has where the model is linear in
/// them, then the sensors of each flight.
fn known(
    problem: &Problem,
    model: &GreyBox,
    flights: &[Ready],
    linear_columns: Vec<Vec<Column>>,
) -> KnownColumns {
    let (mut known, mut coefficients) = (Vec::new(), Vec::new());
    let mut placed: Vec<Placed> = vec![Vec::new(); flights.len()];
    let linear = model.linear();
    for (index, named) in model.coefficients().iter().enumerate() {
        // a shape constant that has joined is not moved farther than its linearisation reaches
        let joined =
            if linear[index] { f64::INFINITY } else { catalogue::REACH * named.value.abs() };
        let (value, width) = problem.prior.get(index).copied().unwrap_or((named.value, joined));
        let held = width <= 0.0 || model.replaced(&named.name).is_some();
        if held || !searched(model, index) {
            continue;
        }
        for ((list, flight), columns) in placed.iter_mut().zip(flights).zip(&linear_columns) {
            let column = match linear[index] {
                true => columns[index].clone(),
                false => tangent(model, flight, index),
            };
            list.push((known.len(), column));
        }
        coefficients.push(index);
        known.push(Known { name: named.name.clone(), width, offset: value - named.value });
    }
    for (k, (list, flight)) in placed.iter_mut().zip(flights).enumerate() {
        for (i, column) in flight.sensors.iter().enumerate() {
            list.push((known.len(), column.clone()));
            known.push(Known {
                name: format!("{} of flight {}", sensors::NAMES[i], k + 1),
                width: problem.sensors[k][i],
                offset: sensors::mean(i),
            });
        }
    }
    (known, coefficients, placed)
}

/// Expects of every flight's blur what its clock adds to it: a record of u that is late by λ samples is
/// u − λu' + ½λ²u'', and the clock's column holds the first order alone. Without the second, a delay of a
/// sample that the clock takes for its own leaves a curvature that only a lag explains.
fn curved(problem: &Problem, known: &mut [Known], projected: &Projected) {
    let first = known.len().saturating_sub(problem.flights.len() * SENSORS);
    for (k, flight) in problem.flights.iter().enumerate() {
        let own = first + k * SENSORS;
        let (late, blur) = (own + sensors::LATE_PLACE, own + sensors::BLUR_PLACE);
        let samples = projected.tuned[late] / flight.dt;
        let unsure = projected.covariance[(late, late)].max(0.0).sqrt() / flight.dt;
        let [mean, sd] = sensors::BLURRED;
        known[blur].offset = mean - 0.5 * samples * samples;
        known[blur].width = sd.hypot(samples * unsure);
    }
}

/// The physical bounds of a coefficient.
fn bounds(model: &GreyBox, index: usize) -> Option<(f64, f64)> {
    let (id, own) = model.coefficients()[index].name.split_once('.')?;
    let about = model.effects().find(|about| about.id == id)?;
    about.coefficients.iter().find(|c| c.name == own).map(|c| model.size().bounds(c))
}

/// Whether a search leaves the coefficient free: gains of nominally one are held.
fn searched(model: &GreyBox, index: usize) -> bool {
    let name = &model.coefficients()[index].name;
    let Some((id, own)) = name.split_once('.') else { return true };
    let Some(about) = model.effects().find(|about| about.id == id) else { return true };
    let entry = Entry { about, operator: false };
    let starts = about.entry.map_or(0, |e| e.starts.len());
    starts == 0 || catalogue::free(&entry).iter().any(|k| about.coefficients[*k].name == own)
}

/// The derivative of the prediction by a coefficient that the model is not linear in.
fn tangent(model: &GreyBox, flight: &Ready, index: usize) -> Column {
    let named = &model.coefficients()[index];
    let by = (0.02 * named.value.abs()).max(1e-4);
    let moved = |by: f64| {
        let mut moved = model.clone();
        moved.set_coefficient(&named.name, named.value + by);
        moved
    };
    let id = named.name.split('.').next().unwrap_or_default();
    let own: Vec<usize> = (0..model.coefficients().len())
        .filter(|k| model.coefficients()[*k].name.split('.').next() == Some(id))
        .collect();
    let linear = model.linear();
    let of = |model: &GreyBox| {
        if own.iter().all(|k| !linear[*k]) {
            return flight.operator(model);
        }
        let (first, last) = (own[0], own[own.len() - 1] + 1);
        let values: Vec<f64> = (first..last)
            .map(|k| if linear[k] { model.coefficients()[k].value } else { 0.0 })
            .collect();
        combine(&flight.linear(model, first..last), &values)
    };
    // lags, delays and dead zones are not negative
    let down = by.min(named.value.max(0.0));
    combine(&[of(&moved(by)), of(&moved(-down))], &[1.0 / (by + down), -1.0 / (by + down)])
}
