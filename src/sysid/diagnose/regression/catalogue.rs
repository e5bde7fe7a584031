//! Candidates of a diagnosis, which are effects (physical contributions to forces and moments) that the model may lack, and their
//! regressors (columns). A column has one row for each window, a short stretch of flight over which forces and moments are
//! averaged. A shape constant is a coefficient in which an effect is nonlinear. A candidate with shape constants is linearised at
//! several points: sets of values of its coefficients.

use rayon::prelude::*;

use crate::diagnose::regression::columns::{Ready, combine};
use crate::diagnose::regression::gather::Column;
use crate::diagnose::regression::local::CHANNELS;
use crate::diagnose::regression::rank::{Point, Trial};
use greylag_model::{GreyBox, JoinError};
use greylag_physics::catalogue::on_air;
use greylag_physics::effects::{Description, Kind};
use greylag_physics::formula::register;
use greylag_physics::inputs;
use greylag_physics::size::Size;

/// Finite-difference step of a coefficient of a nonlinear candidate, as a fraction of its value.
const MOVED: f64 = 0.02;
/// Largest change of such a coefficient from its value at the point of linearisation, as a fraction of this value.
pub const REACH: f64 = 0.35;

/// Factor between the first starting value of an input effect and the next weaker point of linearisation, and from this to the
/// weakest.
const SMALLER: f64 = 2.5;

/// A candidate effect.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Description of the effect.
    pub about: Description,
    /// Whether the effect changes the deflections (input effect), as an actuator lag does. The curve of a servo is linear in its
    /// constant, and its column is computed like those of other linear candidates.
    pub operator: bool,
}

impl Entry {
    /// Whether the effect comes from an effect file. Its linear coefficients may then take any value within their bounds.
    fn written(&self) -> bool {
        Kind::from_id(self.about.id).is_some_and(|kind| kind.written().is_some())
    }
}

/// The candidates for `model`: effects of the catalogue (the effects that the program knows), and the effects `with` from effect
/// files. Left out are the effects `without`, effects that `model` already has, and effects that cannot be searched for.
pub fn candidates(model: &GreyBox, with: &[String], without: &[String]) -> Vec<Entry> {
    let of = |about: Description, operator| Entry { about, operator };
    let physical = on_air().map(|about| of(about, false));
    let on_inputs = inputs::Kind::ALL.iter().map(|k| of(k.describe(), true));
    let shipped = |id: &str| register::shipped().iter().any(|effect| effect.about.id == id);
    let own = with.iter().filter(|id| !shipped(id)).filter_map(|id| Kind::from_id(id));
    let own = own.filter(|k| k.written().is_some());
    physical
        .chain(on_inputs)
        .chain(own.map(|k| of(k.describe(), false)))
        .filter(|e| {
            let about = &e.about;
            let searched =
                about.entry.is_some_and(|entry| about.shape == 0 || !entry.starts.is_empty());
            searched
                && about.table.is_none()
                && !model.has(about.id)
                && !without.iter().any(|id| id == about.id)
        })
        .collect()
}

/// Regressors of the candidates for all flights.
pub struct Columns {
    /// The candidates. They refer to their columns by index.
    pub trials: Vec<Trial>,
    /// The columns of each flight. All flights have the same number of columns.
    pub columns: Vec<Vec<Column>>,
}

/// Computes the regressors of the candidates `entries` for `flights` and `model`. `refined` holds additional points at which
/// nonlinear candidates are linearised. An entry is the id of a candidate with the values of its coefficients.
pub fn columns(
    model: &GreyBox,
    flights: &[Ready],
    entries: &[Entry],
    refined: &[(&str, Vec<f64>)],
) -> Columns {
    let mut all = Columns { trials: Vec::new(), columns: vec![Vec::new(); flights.len()] };
    let (straight, curved): (Vec<Entry>, Vec<Entry>) =
        entries.iter().partition(|e| starts(e).is_empty());
    all.add_linear(model, flights, &straight);
    let places: Vec<(&Entry, Vec<f64>)> = curved
        .iter()
        .flat_map(|e| {
            let own = refined.iter().filter(|(id, _)| *id == e.about.id).map(|(_, v)| v.clone());
            let listed = starts(e).iter().map(|s| s.to_vec());
            smaller(e)
                .into_iter()
                .chain(listed)
                .chain(own)
                .map(|values| (e, values))
                .collect::<Vec<_>>()
        })
        .collect();
    let made: Vec<Option<Vec<Vec<Column>>>> =
        places.par_iter().map(|(e, values)| curved_columns(model, flights, e, values)).collect();
    for e in &curved {
        let mut trial =
            Trial { id: e.about.id, points: Vec::new(), support: 0.0, channels: [false; 6] };
        for ((of, values), made) in places.iter().zip(&made) {
            if let (true, Some(made)) = (of.about.id == e.about.id, made) {
                all.add_point(&mut trial, e, &model.size(), values, made);
            }
        }
        all.finish(trial, flights);
    }
    all
}

fn starts(entry: &Entry) -> &'static [&'static [f64]] {
    entry.about.entry.map_or(&[], |e| e.starts)
}

/// Two points of linearisation at which an input effect is weaker than at its first starting value, because accurate sensors may
/// detect such weak effects. Empty for other effects.
fn smaller(entry: &Entry) -> Vec<Vec<f64>> {
    let (Some(first), Some(last)) = (starts(entry).first(), starts(entry).last()) else {
        return Vec::new();
    };
    if !entry.operator {
        return Vec::new();
    }
    // if the starting values decrease, the coefficient is a limit, and the effect is weaker with a higher limit
    let factor = if first[0] < last[0] { 1.0 / SMALLER } else { SMALLER };
    vec![vec![first[0] * factor.powi(2)], vec![first[0] * factor]]
}

/// Whether an effect is linear in all its coefficients.
pub fn straight(entry: &Entry) -> bool {
    starts(entry).is_empty()
}

/// A model with entries that were added to it, and the values of their coefficients: zero, or the bound nearest to zero.
pub type With = (GreyBox, Vec<(Entry, Vec<f64>)>);

/// Adds all of `entries` to copies of `model`, except those that cannot be added. A single copy has all of them, unless that
/// would be too many input effects; those beyond the limit are added to further copies. There is at least one copy.
pub fn with_all(model: &GreyBox, entries: &[Entry]) -> Vec<With> {
    let (first, mut left) = with_some(model, entries);
    let mut all = vec![first];
    while !left.is_empty() {
        let (next, still_left) = with_some(model, &left);
        if next.1.is_empty() {
            // the model has no room for any
            break;
        }
        all.push(next);
        left = still_left;
    }
    all
}

/// Adds `entries` to a copy of `model`. The second result has the entries for which it has too many input effects.
fn with_some(model: &GreyBox, entries: &[Entry]) -> (With, Vec<Entry>) {
    let mut everything = model.clone();
    let (mut joined, mut left) = (Vec::new(), Vec::new());
    for e in entries {
        let nearest = |(low, high): (f64, f64)| 0.0_f64.clamp(low, high);
        let values: Vec<f64> = e.about.coefficients.iter().map(|c| nearest(c.bounds)).collect();
        match everything.join(e.about.id, &values) {
            Ok(()) => joined.push((*e, values)),
            Err(JoinError::Inputs { .. }) => left.push(*e),
            Err(_) => (),
        }
    }
    // added effects may have set coefficients that they replace to zero; these get their values back
    for c in model.coefficients() {
        everything.set_coefficient(&c.name, c.value);
    }
    ((everything, joined), left)
}

/// Indices of the coefficients that the search estimates. Linear coefficients that are 1 in every list of starting values of the
/// effect are not estimated.
pub fn free(entry: &Entry) -> Vec<usize> {
    let linear = entry.about.coefficients.len() - entry.about.shape;
    (0..entry.about.coefficients.len())
        .filter(|k| {
            *k >= linear || starts(entry).is_empty() || starts(entry).iter().any(|s| s[*k] != 1.0)
        })
        .collect()
}

impl Columns {
    /// Adds the linear candidates `entries`. Each model of [`with_all`] gives the columns of its candidates in one pass over the
    /// flights.
    fn add_linear(&mut self, model: &GreyBox, flights: &[Ready], entries: &[Entry]) {
        let mut joined = Vec::new();
        for (everything, its_own) in with_all(model, entries) {
            let wanted = model.coefficients().len()..everything.coefficients().len();
            for (list, flight) in self.columns.iter_mut().zip(flights) {
                list.extend(flight.linear(&everything, wanted.clone()));
            }
            joined.extend(its_own);
        }
        let mut next = 0;
        for (e, values) in joined {
            let free = e.about.coefficients.iter().enumerate().map(|(k, c)| {
                let (low, high) = model.size().bounds(c);
                (k, next + k, [low, high])
            });
            // coefficients that have no effect in the flights, such as those of a missing rudder, are not free
            let free = free.filter(|(_, column, _)| self.acts(*column)).collect();
            let trial = Trial {
                id: e.about.id,
                points: vec![Point { values, contribution: None, free }],
                support: 0.0,
                channels: [false; 6],
            };
            next += e.about.coefficients.len();
            self.finish(trial, flights);
        }
    }

    fn add_point(
        &mut self,
        trial: &mut Trial,
        entry: &Entry,
        size: &Size,
        values: &[f64],
        made: &[Vec<Column>],
    ) {
        let first = self.columns.first().map_or(0, Vec::len);
        for (list, own) in self.columns.iter_mut().zip(made) {
            list.extend(own.iter().cloned());
        }
        let reach = |k: usize| {
            let (low, high) = size.bounds(&entry.about.coefficients[k]);
            if entry.written() && k < entry.about.coefficients.len() - entry.about.shape {
                return [low, high];
            }
            let by = REACH * values[k].abs();
            [(values[k] - by).max(low), (values[k] + by).min(high)]
        };
        trial.points.push(Point {
            values: values.to_vec(),
            contribution: Some(first),
            free: free(entry)
                .iter()
                .enumerate()
                .map(|(i, &k)| (k, first + 1 + i, reach(k)))
                .collect(),
        });
    }

    /// Whether the column with index `column` has a nonzero entry in any flight.
    fn acts(&self, column: usize) -> bool {
        let moved = |x: &f64| *x != 0.0;
        self.columns.iter().any(|list| list[column].iter().flatten().any(moved))
    }

    /// Sets the channels (forces and moments) in which the candidate `trial` acts, and its number of independent rows. Adds the
    /// candidate to the list if it acts in any channel.
    fn finish(&mut self, mut trial: Trial, flights: &[Ready]) {
        let own: Vec<usize> = trial
            .points
            .iter()
            .flat_map(|p| p.free.iter().map(|f| f.1).chain(p.contribution))
            .collect();
        for channel in 0..CHANNELS {
            let acts =
                self.columns.iter().any(|list| own.iter().any(|c| !list[*c][channel].is_empty()));
            trial.channels[channel] = acts;
            if acts {
                let finite =
                    |f: &Ready| f.residual[channel].iter().filter(|x| x.is_finite()).count();
                // neighbouring windows overlap by half, so only half of the rows are independent
                trial.support += 0.5 * flights.iter().map(finite).sum::<usize>() as f64;
            }
        }
        if trial.channels.iter().any(|c| *c) {
            self.trials.push(trial);
        }
    }
}

/// Columns of a nonlinear candidate whose coefficients are `values`, for each flight: the candidate's contribution, then its
/// derivatives with respect to the free coefficients. `None` if the candidate cannot be added to the model with these values.
pub fn curved_columns(
    model: &GreyBox,
    flights: &[Ready],
    entry: &Entry,
    values: &[f64],
) -> Option<Vec<Vec<Column>>> {
    let id = entry.about.id;
    let joined = |values: &[f64]| {
        let mut with = model.clone();
        with.join(id, values).is_ok().then_some(with)
    };
    let of = |flight: &Ready, with: &GreyBox, values: &[f64]| {
        if entry.operator {
            return flight.operator(with);
        }
        let first = model.coefficients().len();
        let linear = values.len() - entry.about.shape;
        combine(&flight.linear(with, first..first + linear), &values[..linear])
    };
    let here = joined(values)?;
    let mut moved = Vec::new();
    for k in free(entry) {
        let (low, high) = model.size().bounds(&entry.about.coefficients[k]);
        let by = (MOVED * values[k].abs()).max(1e-6);
        let (mut a, mut b) = (values.to_vec(), values.to_vec());
        a[k] = (a[k] - by).max(low);
        b[k] = (b[k] + by).min(high);
        moved.push((joined(&a)?, joined(&b)?, a.clone(), b.clone(), b[k] - a[k]));
    }
    let one = |flight: &Ready| {
        let mut list = vec![of(flight, &here, values)];
        for (down, up, a, b, by) in &moved {
            let (down, up) = (of(flight, down, a), of(flight, up, b));
            list.push(combine(&[up, down], &[1.0 / by, -1.0 / by]));
        }
        list
    };
    Some(flights.iter().map(one).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// There are more linear input effects than a model has room for.
    #[test]
    fn every_linear_input_effect_is_in_one_of_the_models() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/jsbsim.toml");
        let model = GreyBox::load(&path).unwrap();
        let mut crowded = model.clone();
        crowded.join("actuator_lag", &[0.02]).unwrap();
        crowded.join("dead_zone", &[0.01]).unwrap();
        let mut full = crowded.clone();
        full.join("backlash", &[0.01]).unwrap();
        for (model, room) in [(&model, 3), (&crowded, 1), (&full, 0)] {
            let all: Vec<Entry> =
                candidates(model, &[], &[]).into_iter().filter(straight).collect();
            let wanted: Vec<&str> = all.iter().filter(|e| e.operator).map(|e| e.about.id).collect();
            assert_eq!(wanted.len(), 4, "{wanted:?}");
            let mut joined: Vec<&str> = Vec::new();
            for (_, own) in with_all(model, &all) {
                let on_inputs = own.iter().filter(|(e, _)| e.operator);
                let ids: Vec<&str> = on_inputs.map(|(e, _)| e.about.id).collect();
                assert!(ids.len() <= room, "{ids:?}");
                joined.extend(ids);
            }
            assert_eq!(joined, if room > 0 { wanted } else { Vec::new() });
        }
    }
}
