//! The coefficients that a fit may change, with their priors, bounds and steps.

use greylag_model::{GreyBox, Named};
use greylag_physics::catalogue;
use greylag_physics::effects::Description;
use greylag_physics::formula::register;
use greylag_physics::inputs;

/// Coefficients of added effects that stay where they start: shares of a whole, which cannot be determined
/// from the shape beside them.
const HELD: &[&str] = &["lift_stall.k"];
/// Effects without a formula of their own (curves): their heights stay small where little was flown.
pub(super) const SLIGHT: &[&str] = &["lift_curve", "drag_curve"];
/// Prior width of a height of those effects, as a share of the range that is possible.
const SLIGHT_SHARE: f64 = 0.1;
/// Such an effect with the one whose shape it takes over: the constants of that formula stay as they are, since
/// the curve can take up whatever they could.
const TAKES_OVER: &[(&str, &str)] = &[("lift_curve", "lift_stall")];
/// Step of a derivative in a coefficient of the prior, as a share of its prior width.
const STEP: f64 = 1e-3;
/// Step of a derivative in a shape constant or that of an input effect, as a share of its value.
const SHAPE_STEP: f64 = 0.02;
/// Largest change of such a constant in one iteration, as a share of its value.
const SHAPE_STRIDE: f64 = 0.4;

/// A coefficient that the fit may change.
#[derive(Clone, Debug)]
pub(super) struct Free {
    /// Its place in the model's list.
    pub index: usize,
    /// `effect.coefficient`.
    pub name: String,
    /// What it is, with its unit.
    pub meaning: &'static str,
    /// Value and standard deviation before the data is seen.
    pub prior: f64,
    pub width: f64,
    /// The physically possible values.
    pub bounds: (f64, f64),
    /// Step of numerical derivatives.
    pub step: f64,
    /// Largest change in one iteration.
    pub stride: f64,
    /// Whether the model is linear in it.
    pub linear: bool,
    /// Whether it belongs to an effect between measured deflections and what acts.
    pub input: bool,
    /// Whether it changes what acts for given measured deflections, or what a formula remembers of them.
    pub acting: bool,
    /// Whether it belongs to an effect that is being added.
    pub added: bool,
}

/// What is known of the effect `id`, and whether it acts on inputs.
pub(super) fn describe(id: &str) -> Option<(Description, bool)> {
    catalogue::describe(id).map(|about| (about, inputs::Kind::from_id(id).is_some()))
}

/// Whether `id` is an effect of a file with a lag or delay.
fn remembers(id: &str) -> bool {
    register::find(id).is_some_and(|effect| !effect.memories().is_empty())
}

/// The coefficients of `model` that may change when `added` are the ids of new effects.
///
/// A coefficient of the prior is held if its width is zero; one of a new effect has no prior but its
/// bounds, or a share of them. Constants of a formula whose shape a curve takes over are held.
pub(super) fn free(model: &GreyBox, added: &[&str]) -> Vec<Free> {
    let linear = model.linear();
    let named = model.coefficients().iter().zip(linear).enumerate();
    named
        .filter_map(|(index, (c, linear))| {
            let (id, short) = c.name.split_once('.')?;
            let (about, input) = describe(id)?;
            let coefficient = about.coefficients.iter().find(|k| k.name == short)?;
            let added = added.contains(&id);
            let (low, high) = model.size().bounds(coefficient);
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

/// `model` with nothing known of its coefficients beforehand but what is physically possible: the prior of every
/// coefficient that the model is linear in is as wide as its bounds, zero or not.
pub(super) fn from_scratch(model: &GreyBox) -> GreyBox {
    let linear = model.linear();
    let names: Vec<&str> = model.coefficients().iter().map(|c| c.name.as_str()).collect();
    let range = |c: &Named| {
        let place = names.iter().position(|name| *name == c.name)?;
        let (id, short) = c.name.split_once('.').filter(|_| linear[place])?;
        let (about, _) = describe(id)?;
        let coefficient = about.coefficients.iter().find(|k| k.name == short)?;
        let (low, high) = model.size().bounds(coefficient);
        Some(high - low)
    };
    model.clone().with_widths(range)
}

/// Coefficients of `model` that no fit changes: they are zero and their file states no standard deviation.
pub(super) fn held_at_zero(model: &GreyBox) -> Vec<String> {
    let held = model.coefficients().iter().filter(|c| c.width() == 0.0 && c.sd.is_none());
    let known =
        held.filter(|c| c.name.split_once('.').is_some_and(|(id, _)| describe(id).is_some()));
    known.map(|c| c.name.clone()).collect()
}

/// Effects of `model` whose shape constants are held, each with the curve that takes their shape over.
pub(super) fn taken_over(model: &GreyBox) -> impl Iterator<Item = (&'static str, &'static str)> {
    let both = TAKES_OVER.iter().filter(|(by, of)| model.has(by) && model.has(of));
    both.map(|(by, of)| (*of, *by))
}

/// `model` with the free coefficients at `values`.
pub(super) fn with(model: &GreyBox, free: &[Free], values: &[f64]) -> GreyBox {
    let mut all: Vec<f64> = model.coefficients().iter().map(|c| c.value).collect();
    for (f, value) in free.iter().zip(values) {
        all[f.index] = *value;
    }
    let mut changed = model.clone();
    changed.set_coefficients(&all);
    changed
}

/// The models beside `values` in coefficient `place`, the difference between them: on both sides of it
/// for what the model is not linear in, else one side and `None`, the present model.
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
