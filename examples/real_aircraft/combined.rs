//! Combination of the fitted model, the state at the start and the mean state, with weights from parts left out; and the same
//! without a model, and of ARX.

use anyhow::Result;
use greylag::model::GreyBox;
use greylag::sysid::amend::leave_one_out::Scored;
use greylag::sysid::compare::arx::{Arx, Choice as OfArx};
use greylag::sysid::compare::combination::{
    Chosen, Combination, EVERY_S, Forecasts, choose, mean_state,
};
use greylag::sysid::compare::correction::Correction;
use greylag::sysid::compare::free_run::START_EVERY_S;
use greylag::sysid::weak_form::prepared::Prepared;

use crate::corrected::Kind;
use crate::{HORIZONS_S, Row, scaled};

/// Smallest relative decrease of the error for which another structure or correction is taken.
const CLEARLY: f64 = 0.01;

/// Place of the model as given among the structures.
const GIVEN: usize = 0;

/// A part that is left out, and the others.
pub struct Fold {
    /// The part.
    test: Prepared,
    /// All other parts.
    others: Vec<Prepared>,
    /// Mean state of the others, in the units of the state.
    mean_state: [f64; 8],
}

/// All `parts`, each left out in turn.
pub fn folds(parts: &[Prepared]) -> Vec<Fold> {
    let fold = |left: usize| {
        let mut others = parts.to_vec();
        let test = others.remove(left);
        Fold { test, mean_state: mean_state(&others), others }
    };
    (0..parts.len()).map(fold).collect()
}

/// What was chosen for a forecast.
pub struct Choices {
    /// The structure, as its place among those tried.
    pub structure: usize,
    /// The correction.
    pub kind: Kind,
    /// The weights.
    pub combination: Combination,
}

impl Choices {
    /// Correction and weights in words.
    pub fn in_words(&self) -> String {
        format!("{}, {}", self.kind.in_words(), weights(&self.combination))
    }
}

/// The mean weight over the states of the forecast that is combined, at every horizon, in words.
fn weights(combination: &Combination) -> String {
    let all: Vec<String> = combination.of_model().iter().map(|w| format!("{w:.2}")).collect();
    format!("weight {}", all.join(" "))
}

/// Runs along `test` of `model` with the correction `kind`, whose residual is fitted to `seen`. A residual that cannot be fitted is
/// left out.
fn forecasts(
    model: &GreyBox,
    seen: &[Prepared],
    test: &Prepared,
    kind: Kind,
    every_s: f64,
    mean_state: [f64; 8],
) -> Forecasts {
    let of =
        |correction| Forecasts::of_model(model, test, &HORIZONS_S, every_s, correction, mean_state);
    match kind {
        Kind::Nothing => of(None),
        Kind::Observer(observer) => of(Some(Correction::Observer(observer))),
        Kind::Pull(pull) => of(Some(Correction::Pull(pull))),
        Kind::Linear(choice) => match Arx::of_residual(model, seen, choice) {
            Ok(arx) => of(Some(Correction::Linear(&arx))),
            Err(_) => of(None),
        },
    }
}

/// The best combination of the structure `models` (one model for each of `folds`) with the correction `kind`. `None` if the parts are
/// too short.
fn of_structure(models: &[Option<GreyBox>], folds: &[&Fold], kind: Kind) -> Option<Chosen> {
    let one = |(model, fold): (&Option<GreyBox>, &&Fold)| {
        let model = model.as_ref()?;
        Some(forecasts(model, &fold.others, &fold.test, kind, EVERY_S, fold.mean_state))
    };
    choose(&models.iter().zip(folds).filter_map(one).collect::<Vec<_>>())
}

/// The folds of the parts that `scored` predicts.
fn judged<'a>(scored: &Scored, folds: &'a [Fold]) -> Vec<&'a Fold> {
    let named = |name: &String| folds.iter().find(|fold| fold.test.name == *name);
    scored.flights.iter().filter_map(named).collect()
}

/// What predicts the parts left out best: alone, and combined.
pub struct Best {
    /// The correction with the smallest error without weights, of the structure that was chosen first.
    pub alone: Kind,
    /// Structure, correction and weights of the combination.
    pub combined: Choices,
}

/// Chooses among the structures `scored` and the corrections `kinds`. `first` is the place of the structure that predicts the parts
/// best alone. Without a choice the weights are equal.
///
/// Another structure or correction than the first is taken if it lowers the error by more than 1 %.
pub fn best(scored: &[Scored], first: usize, folds: &[Fold], kinds: &[Kind]) -> Best {
    let mut tried = Vec::new();
    for (structure, of) in scored.iter().enumerate().filter(|(_, s)| !s.models.is_empty()) {
        for kind in kinds.iter().filter(|kind| structure == first || kind.is_quick()) {
            if let Some(chosen) = of_structure(&of.models, &judged(of, folds), *kind) {
                tried.push((structure, *kind, chosen));
            }
        }
    }
    let least = |error: fn(&Chosen) -> f64, own: bool| {
        let all = || tried.iter().filter(|t| !own || t.0 == first);
        let plain = all().find(|t| t.0 == first && matches!(t.1, Kind::Nothing));
        let best = all().min_by(|a, b| error(&a.2).total_cmp(&error(&b.2)));
        let clearly = |b: &&(usize, Kind, Chosen)| {
            plain.is_none_or(|p| error(&b.2) < (1.0 - CLEARLY) * error(&p.2))
        };
        best.filter(clearly).or(plain)
    };
    let alone = least(|chosen| chosen.alone, true).map_or(Kind::Nothing, |t| t.1);
    let combined = match least(|chosen| chosen.error, false) {
        Some((structure, kind, chosen)) => {
            Choices { structure: *structure, kind: *kind, combination: chosen.combination.clone() }
        }
        // too short for a judgement, and so for a fit
        None => Choices {
            structure: GIVEN,
            kind: Kind::Nothing,
            combination: Combination::equal(HORIZONS_S.len()),
        },
    };
    Best { alone, combined }
}

/// Errors on `test` of `model`, fitted to `seen`, combined as `choices` say.
pub fn errors(model: &GreyBox, seen: &[Prepared], test: &Prepared, choices: &Choices) -> Row {
    let mean_state = mean_state(seen);
    let runs = forecasts(model, seen, test, choices.kind, START_EVERY_S, mean_state);
    scaled(&choices.combination.scores(&runs))
}

/// Errors on the one flight of `test` without a model (held and mean state), and of `arx` together with these, both with weights
/// from `folds`; and the weights of ARX in words. `arx` is fitted to `seen` as `choice` says.
pub fn without_model(
    arx: &Arx,
    choice: OfArx,
    folds: &[Fold],
    [seen, test]: [&[Prepared]; 2],
    scale: [f64; 8],
) -> Result<([Row; 2], String)> {
    let mut parts = Vec::new();
    for fold in folds {
        let Ok(arx) = Arx::fit(&fold.others, choice) else { continue };
        let of = [scale, fold.mean_state];
        parts.push(Forecasts::of_arx(&arx, &fold.test, &HORIZONS_S, EVERY_S, of)?);
    }
    let of = [scale, mean_state(seen)];
    let runs = Forecasts::of_arx(arx, &test[0], &HORIZONS_S, START_EVERY_S, of)?;
    let chosen = |parts: &[Forecasts]| {
        let equal = || Combination::equal(HORIZONS_S.len());
        choose(parts).map_or_else(equal, |chosen| chosen.combination)
    };
    let held: Vec<Forecasts> = parts.iter().map(Forecasts::held).collect();
    let of_arx = chosen(&parts);
    let rows = [chosen(&held).scores(&runs.held()), of_arx.scores(&runs)];
    Ok((rows.map(|scores| scaled(&scores)), weights(&of_arx)))
}
