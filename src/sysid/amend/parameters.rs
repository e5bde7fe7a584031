//! The free coefficients of a fit, with their priors, bounds and finite-difference steps.
//!
//! Shape constants are coefficients in which the model is nonlinear. A curve is an effect (a physical contribution to forces and
//! moments) that is given by ordinates instead of a formula.

use greylag_model::{GreyBox, Named};
use greylag_physics::catalogue;
use greylag_physics::effects::Description;
use greylag_physics::formula::register;
use greylag_physics::inputs;

/// Coefficients of added effects that are held at their starting values: factors of a shape that the data cannot separate from
/// the shape itself.
const HELD: &[&str] = &["lift_stall.k"];
/// Curves. Their ordinates have a narrow prior about their starting values, which determines the curve in ranges with few data.
pub(super) const SLIGHT: &[&str] = &["lift_curve", "drag_curve"];
/// Prior standard deviation of an ordinate of a curve, as a fraction of the range of its bounds.
const SLIGHT_SHARE: f64 = 0.1;
/// Pairs of a curve and the effect whose formula describes the same curve. The shape constants of that formula are held,
/// because the curve can represent any change of them.
const TAKES_OVER: &[(&str, &str)] = &[("lift_curve", "lift_stall")];
/// Finite-difference step of a coefficient of the given model in which the model is linear, as a fraction of its prior standard
/// deviation.
const STEP: f64 = 1e-3;
/// Finite-difference step of a shape constant, as a fraction of its value.
const SHAPE_STEP: f64 = 0.02;
/// Largest change of a shape constant in one iteration, as a fraction of its value.
const SHAPE_STRIDE: f64 = 0.4;

/// A coefficient that the fit estimates.
#[derive(Clone, Debug)]
pub(super) struct Free {
    /// Index in the model's list of coefficients.
    pub index: usize,
    /// Name, `effect.coefficient`, as in the model file.
    pub name: String,
    /// Meaning, with its unit.
    pub meaning: &'static str,
    /// Prior mean. `width` is the prior standard deviation.
    pub prior: f64,
    pub width: f64,
    /// Range in which the fit keeps the coefficient.
    pub bounds: (f64, f64),
    /// Finite-difference step of the derivatives with respect to the coefficient.
    pub step: f64,
    /// Largest change in one iteration.
    pub stride: f64,
    /// Whether the model is linear in the coefficient.
    pub linear: bool,
    /// Whether the coefficient belongs to an input effect, which converts measured to acting deflections.
    pub input: bool,
    /// Whether the coefficient changes the acting deflections for given measured deflections, or the lags and delays of a
    /// formula.
    pub acting: bool,
    /// Whether the coefficient belongs to an added effect.
    pub added: bool,
}

/// Description of the effect `id`, and whether it is an input effect. `None` if there is no such effect.
pub(super) fn describe(id: &str) -> Option<(Description, bool)> {
    catalogue::describe(id).map(|about| (about, inputs::Kind::from_id(id).is_some()))
}

/// Whether `id` is an effect from a file with a `lag(…)` or `delay(…)` term in its formula.
fn remembers(id: &str) -> bool {
    register::find(id).is_some_and(|effect| !effect.memories().is_empty())
}

/// The free coefficients of `model`. `added` are the ids of the effects that were added to the given model.
///
/// A coefficient of the given model is held if its prior standard deviation is zero. The prior standard deviation of a
/// coefficient of an added effect is the range of its bounds, or a fraction of this range for a curve. The shape constants of a
/// formula are held if the model also has the curve that replaces the formula.
pub(super) fn free(model: &GreyBox, added: &[&str]) -> Vec<Free> {
    let linear = model.linear();
    let named = model.coefficients().iter().zip(linear).enumerate();
    named
        .filter_map(|(index, (c, linear))| {
            let (id, short) = c.name.split_once('.')?;
            let (about, input) = describe(id)?;
            // the curve of a servo: deflections are linear in its constant
            let linear = linear || (input && about.shape == 0);
            let coefficient = about.coefficients.iter().find(|k| k.name == short)?;
            let added = added.contains(&id);
            let (low, high) = model.bounds(index, coefficient);
            let share = if SLIGHT.contains(&id) { SLIGHT_SHARE } else { 1.0 };
            let width = if added { share * (high - low) } else { c.width() };
            let taken_over = taken_over(model).any(|(of, _)| of == id);
            let held = (added && HELD.contains(&c.name.as_str())) || (taken_over && !linear);
            if width <= 0.0 || held {
                return None;
            }
            let place = about.coefficients.iter().position(|k| k.name == short)?;
            let starts = about.entry.map_or(&[][..], |e| e.starts);
            let least = starts.iter().map(|s| s[place].abs()).fold(f64::INFINITY, f64::min);
            let size = c.value.abs().max(if least.is_finite() { 0.5 * least } else { 0.0 });
            let (step, stride) = match (linear, added) {
                (true, true) => (1e-4 * width, f64::INFINITY),
                (true, false) => (STEP * width, f64::INFINITY),
                (false, _) => (SHAPE_STEP * size, SHAPE_STRIDE * size),
            };
            Some(Free {
                index,
                name: c.name.clone(),
                meaning: coefficient.meaning,
                prior: c.value,
                width,
                bounds: (low, high),
                step: step.max(1e-9),
                stride: stride.max(1e-9),
                linear,
                input,
                acting: input || (!linear && remembers(id)),
                added,
            })
        })
        .collect()
}

/// `model` with physical bounds as its only prior. The prior standard deviation of every coefficient in which the model is
/// linear is the range of its bounds, even if the coefficient is zero.
pub(super) fn from_scratch(model: &GreyBox) -> GreyBox {
    let linear = model.linear();
    let names: Vec<&str> = model.coefficients().iter().map(|c| c.name.as_str()).collect();
    let range = |c: &Named| {
        let place = names.iter().position(|name| *name == c.name)?;
        let (id, short) = c.name.split_once('.').filter(|_| linear[place])?;
        let (about, _) = describe(id)?;
        let coefficient = about.coefficients.iter().find(|k| k.name == short)?;
        let (low, high) = model.bounds(place, coefficient);
        Some(high - low)
    };
    model.clone().with_widths(range)
}

/// `model` with the prior standard deviations of its free coefficients multiplied by `factor`.
pub fn widened(model: &GreyBox, factor: f64) -> GreyBox {
    let wider = |c: &Named| (c.width() > 0.0).then(|| factor * c.width());
    model.clone().with_widths(wider)
}

/// Names of the coefficients of `model` that no fit changes, because they are zero and the model file states no standard
/// deviation.
pub(super) fn held_at_zero(model: &GreyBox) -> Vec<String> {
    let held = model.coefficients().iter().filter(|c| c.width() == 0.0 && c.sd.is_none());
    let known =
        held.filter(|c| c.name.split_once('.').is_some_and(|(id, _)| describe(id).is_some()));
    known.map(|c| c.name.clone()).collect()
}

/// Effects of `model` whose shape constants are held, each with the curve that describes the same.
pub(super) fn taken_over(model: &GreyBox) -> impl Iterator<Item = (&'static str, &'static str)> {
    let both = TAKES_OVER.iter().filter(|(by, of)| model.has(by) && model.has(of));
    both.map(|(by, of)| (*of, *by))
}

/// A copy of `model` with the free coefficients at `values`.
pub(super) fn with(model: &GreyBox, free: &[Free], values: &[f64]) -> GreyBox {
    let mut all: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
    for (f, value) in free.iter().zip(values) {
        all[f.index] = *value;
    }
    let mut changed = model.clone();
    changed.set_coefficients(&all);
    changed
}

/// Models for a finite difference with respect to the free coefficient with the index `place` at `values`, and the difference
/// of this coefficient between the two models.
///
/// The difference is one-sided if the model is linear in the coefficient. The first model is then `None`, which stands for the
/// model at `values`. Otherwise the difference is central.
pub(super) fn beside(
    model: &GreyBox,
    free: &[Free],
    values: &[f64],
    place: usize,
) -> (Option<GreyBox>, GreyBox, f64) {
    let f = &free[place];
    let at = |value: f64| {
        let mut changed = values.to_vec();
        changed[place] = value;
        with(model, free, &changed)
    };
    let value = values[place];
    let (low, high) = ((value - f.step).max(f.bounds.0), (value + f.step).min(f.bounds.1));
    match f.linear {
        true if high > value => (None, at(high), high - value),
        true => (None, at(low), low - value),
        false => (Some(at(low)), at(high), high - low),
    }
}
