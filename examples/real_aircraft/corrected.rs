//! Corrections of the fitted model's free runs: a disturbance observer, or a linear residual, chosen by leaving parts out.

use anyhow::Result;
use greylag::model::GreyBox;
use greylag::sysid::compare::arx::{Arx, Choice};
use greylag::sysid::compare::correction::{Correction, Observer, Pull, scores};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::weak_form::prepared::Prepared;

use crate::{HORIZONS_S, Row, scaled};

/// Times before a run over which an observer averages, s.
const PAST_S: [f64; 3] = [0.5, 1.0, 2.0];
/// Time constants of the decay of its disturbance, s.
const DECAY_S: [f64; 3] = [0.3, 1.0, 3.0];
/// Orders of a linear residual, in samples.
const ORDERS: [usize; 4] = [1, 2, 4, 8];
/// Ridges of a linear residual, dimensionless.
const RIDGES: [f64; 5] = [1e-4, 1e-2, 0.1, 1.0, 10.0];
/// Time constants of the pull of the attitude towards the start of a run, s.
const ATTITUDE_S: [f64; 4] = [1.0, 2.0, 5.0, f64::INFINITY];
/// Time constants of the pull of the airspeed towards the start of a run, s.
const AIRSPEED_S: [f64; 3] = [1.0, 3.0, f64::INFINITY];
/// Smallest relative decrease of the error for which runs are corrected.
const CLEARLY: f64 = 0.01;

/// A correction that is tried.
#[derive(Clone, Copy, Debug)]
pub enum Kind {
    /// The model alone.
    Nothing,
    /// A disturbance observer.
    Observer(Observer),
    /// A linear residual of the model.
    Linear(Choice),
    /// A pull towards the start of each run.
    Pull(Pull),
}

impl Kind {
    /// All corrections that are tried. The first is [`Kind::Nothing`].
    pub fn all() -> Vec<Kind> {
        let observers = PAST_S.iter().flat_map(|&past_s| {
            DECAY_S.iter().map(move |&decay_s| Kind::Observer(Observer { past_s, decay_s }))
        });
        Kind::pulls().into_iter().chain(observers).chain(Kind::of_order_and_ridge()).collect()
    }

    /// The model alone, and pulls towards the start.
    pub fn pulls() -> Vec<Kind> {
        let pulls = ATTITUDE_S.iter().flat_map(|&attitude_s| {
            AIRSPEED_S.iter().map(move |&airspeed_s| Pull { attitude_s, airspeed_s })
        });
        let some = pulls.filter(|p| p.attitude_s.is_finite() || p.airspeed_s.is_finite());
        [Kind::Nothing].into_iter().chain(some.map(Kind::Pull)).collect()
    }

    /// The linear residuals that are tried. The first is [`Kind::Nothing`].
    pub fn linear() -> Vec<Kind> {
        [Kind::Nothing].into_iter().chain(Kind::of_order_and_ridge()).collect()
    }

    fn of_order_and_ridge() -> impl Iterator<Item = Kind> {
        ORDERS.iter().flat_map(|&order| {
            RIDGES.iter().map(move |&ridge| Kind::Linear(Choice { order, ridge }))
        })
    }

    /// The correction in words.
    pub fn in_words(&self) -> String {
        match self {
            Kind::Nothing => "not corrected".into(),
            Kind::Observer(Observer { past_s, decay_s }) => {
                format!("observer over {past_s} s, decay {decay_s} s")
            }
            Kind::Linear(Choice { order, ridge }) => {
                format!("linear residual of order {order}, ridge {ridge:?}")
            }
            Kind::Pull(Pull { attitude_s, airspeed_s }) => {
                format!("pull of attitude {attitude_s} s, airspeed {airspeed_s} s")
            }
        }
    }
}

/// Scaled errors on `test` of `model`, corrected as `kind` says by the flights `fit`. A residual that cannot be fitted is left
/// out.
pub fn errors(
    model: &GreyBox,
    fit: &[Reconstruction],
    test: &[Reconstruction],
    kind: Kind,
) -> Result<Row> {
    let slowest = model.airframe.envelope.flying_from_mps();
    let of = |correction| Ok(scaled(&scores(model, test, &HORIZONS_S, correction)?));
    match kind {
        Kind::Nothing => of(None),
        Kind::Observer(observer) => of(Some(Correction::Observer(observer))),
        Kind::Pull(pull) => of(Some(Correction::Pull(pull))),
        Kind::Linear(choice) => {
            let seen =
                fit.iter().map(|f| Prepared::new(f, slowest)).collect::<Result<Vec<_>, _>>()?;
            match Arx::of_residual(model, &seen, choice) {
                Ok(arx) => of(Some(Correction::Linear(&arx))),
                Err(_) => of(None),
            }
        }
    }
}

/// The correction among `kinds` with the smallest error over `parts`, each predicted by `fitted`, a function that fits a model to
/// all others. The first of `kinds` is [`Kind::Nothing`].
///
/// The error is the geometric mean over the horizons of the mean over the parts. The model alone is taken unless a correction
/// lowers the error by more than 1 %.
pub fn chosen(
    kinds: &[Kind],
    parts: &[Reconstruction],
    fitted: impl Fn(&[Reconstruction]) -> Option<GreyBox>,
) -> Result<Kind> {
    let mut sums = vec![[(0.0, 0.0); HORIZONS_S.len()]; kinds.len()];
    for left in 0..parts.len() {
        let mut others = parts.to_vec();
        let test = [others.remove(left)];
        let Some(model) = fitted(&others) else { continue };
        for (kind, sums) in kinds.iter().zip(&mut sums) {
            let row = errors(&model, &others, &test, *kind)?;
            for ((sum, count), error) in sums.iter_mut().zip(row).filter(|(_, x)| x.is_finite()) {
                *sum += error;
                *count += 1.0;
            }
        }
    }
    let logarithm = |sums: &[(f64, f64)]| {
        let known = sums.iter().filter(|(_, count)| *count > 0.0);
        known.map(|(sum, count)| (sum / count).ln()).sum::<f64>() / HORIZONS_S.len() as f64
    };
    let alone = logarithm(&sums[0]);
    let best =
        (1..kinds.len()).min_by(|a, b| logarithm(&sums[*a]).total_cmp(&logarithm(&sums[*b])));
    let best = best.filter(|k| logarithm(&sums[*k]) < alone - CLEARLY);
    Ok(best.map_or(Kind::Nothing, |k| kinds[k]))
}
