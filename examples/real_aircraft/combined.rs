//! Combination of the fitted model, the state at the start and the mean state, with weights from parts left out; and the same
//! without a model, and of ARX.

use anyhow::Result;
use greylag::model::GreyBox;
use greylag::sysid::amend::leave_one_out::Scored;
use greylag::sysid::compare::arx::{Arx, Choice as OfArx};
use greylag::sysid::compare::combination::{
    Combination, EVERY_S, Forecasts, choose, error_alone, mean_state, simplest,
};
use greylag::sysid::compare::correction::Correction;
use greylag::sysid::compare::free_run::START_EVERY_S;
use greylag::sysid::weak_form::prepared::Prepared;

use crate::corrected::Kind;
use crate::{HORIZONS_S, Row, scaled};

/// Smallest relative decrease of the error for which a correction is taken.
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

/// What is combined with the held and the mean state.
#[derive(Clone, Copy, Debug)]
pub enum Way {
    /// Nothing: no model.
    NoModel,
    /// The model with its correction.
    Model(Kind),
    /// The model without a correction, and ARX.
    ModelAndArx,
}

/// What was chosen for a forecast.
pub struct Choices {
    /// The structure, as its place among those tried.
    pub structure: usize,
    /// What is combined.
    pub way: Way,
    /// The weights.
    pub combination: Combination,
}

impl Choices {
    /// What is combined, in words. `structure` is the name of the structure.
    pub fn in_words(&self, structure: &str) -> String {
        match self.way {
            Way::NoModel => "no model".into(),
            Way::Model(kind) => format!("{structure}, {}", kind.in_words()),
            Way::ModelAndArx => format!("{structure}, and ARX"),
        }
    }

    /// The weights of the model, in words.
    pub fn weights(&self) -> String {
        weights(&self.combination)
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

/// A model that was fitted without a part, and this part.
type Left<'a> = (&'a GreyBox, &'a Fold);

/// The parts that `scored` predicts, each with its model. A part without a fit is left out.
fn judged<'a>(scored: &'a Scored, folds: &'a [Fold]) -> Vec<Left<'a>> {
    let one = |(name, model): (&String, &'a Option<GreyBox>)| {
        Some((model.as_ref()?, folds.iter().find(|fold| fold.test.name == *name)?))
    };
    scored.flights.iter().zip(&scored.models).filter_map(one).collect()
}

/// Runs along each part of its model with the correction `kind`.
fn along(parts: &[Left], kind: Kind) -> Vec<Forecasts> {
    let one = |(model, fold): &Left| {
        forecasts(model, &fold.others, &fold.test, kind, EVERY_S, fold.mean_state)
    };
    parts.iter().map(one).collect()
}

/// `plain`, the runs along `parts`, each together with those of ARX fitted to the other parts. `None` if ARX cannot be fitted.
fn with_arx(plain: &[Forecasts], parts: &[Left], choice: OfArx) -> Option<Vec<Forecasts>> {
    let one = |(runs, (model, fold)): (&Forecasts, &Left)| {
        let arx = Arx::fit(&fold.others, choice).ok()?;
        let of = [model.scale(), fold.mean_state];
        let second = Forecasts::of_arx(&arx, &fold.test, &HORIZONS_S, EVERY_S, of).ok()?;
        runs.clone().beside(&second)
    };
    plain.iter().zip(parts).map(one).collect()
}

/// What predicts the parts left out best: alone, and combined.
pub struct Best {
    /// The correction with the smallest error without weights.
    pub alone: Kind,
    /// What is combined, and the weights.
    pub combined: Choices,
}

/// Chooses the correction of the structure number `first` of `scored` among `kinds`, without weights, then what is combined: no model,
/// the model, the model with its correction, or the model and ARX as `arx` says. The first of `kinds` is [`Kind::Nothing`].
///
/// A correction is taken if it lowers the error by more than 1 %. So is a combination beside a simpler one. What diverges along a
/// part is left out. Without a choice the weights are equal.
pub fn best(
    scored: &[Scored],
    first: usize,
    folds: &[Fold],
    kinds: &[Kind],
    arx: Option<OfArx>,
) -> Best {
    let fitted = scored.get(first).is_some_and(|s| !s.models.is_empty());
    // the model as given can be combined where no part is long enough for a fit
    let structure = if fitted { first } else { GIVEN };
    let parts = scored.get(structure).map_or(Vec::new(), |scored| judged(scored, folds));
    let plain = along(&parts, Kind::Nothing);
    let alone = correction(&parts, &plain, kinds);
    let mut ways = vec![Way::NoModel, Way::Model(Kind::Nothing)];
    let mut runs = vec![plain.iter().map(Forecasts::held).collect(), plain.clone()];
    if !matches!(alone, Kind::Nothing) {
        ways.push(Way::Model(alone));
        runs.push(along(&parts, alone));
    }
    if let Some(both) = arx.and_then(|choice| with_arx(&plain, &parts, choice)) {
        ways.push(Way::ModelAndArx);
        runs.push(both);
    }
    let (way, combination) = match simplest(&runs) {
        Some((place, chosen)) => (ways[place], chosen.combination),
        None => (Way::Model(Kind::Nothing), Combination::equal(HORIZONS_S.len())),
    };
    Best { alone, combined: Choices { structure, way, combination } }
}

/// The correction among `kinds` with the smallest error on `parts` without weights. `plain` are the runs without a correction.
fn correction(parts: &[Left], plain: &[Forecasts], kinds: &[Kind]) -> Kind {
    let corrected = kinds.iter().filter(|kind| !matches!(kind, Kind::Nothing));
    let scored = corrected.filter_map(|kind| Some((*kind, error_alone(&along(parts, *kind))?)));
    let best = scored.min_by(|a, b| a.1.total_cmp(&b.1));
    let without = error_alone(plain).unwrap_or(f64::INFINITY);
    best.filter(|(_, error)| *error < (1.0 - CLEARLY) * without).map_or(Kind::Nothing, |b| b.0)
}

/// Errors on `test` of `model` and, if it is combined too, of `arx`, both fitted to `seen`, combined as `choices` say.
pub fn errors(
    model: &GreyBox,
    arx: Option<&Arx>,
    seen: &[Prepared],
    test: &Prepared,
    choices: &Choices,
) -> Row {
    let mean_state = mean_state(seen);
    let of = |kind| forecasts(model, seen, test, kind, START_EVERY_S, mean_state);
    let runs = match choices.way {
        Way::NoModel => of(Kind::Nothing).held(),
        Way::Model(kind) => of(kind),
        Way::ModelAndArx => {
            let scales = [model.scale(), mean_state];
            let second = arx.and_then(|arx| {
                Forecasts::of_arx(arx, test, &HORIZONS_S, START_EVERY_S, scales).ok()
            });
            let both = second.and_then(|second| of(Kind::Nothing).beside(&second));
            both.unwrap_or_else(|| of(Kind::Nothing))
        }
    };
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
