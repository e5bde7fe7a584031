//! Writes the model that is given to a search for missing effects. It is made from a reference model: its coefficients have
//! random errors, and some effects are removed. An effect is one physical contribution to the forces and moments.

use std::fmt::Write;

use rand_distr::{Distribution, StandardNormal};

use crate::missing::{Missing, rounded};
use greylag_num::stream::stream;
use greylag_physics::catalogue::describe;
use greylag_physics::size::Size;

/// Standard deviation of the coefficients' errors, as a fraction of the value. Errors are limited to two standard
/// deviations.
pub const WRONG: f64 = 0.15;
/// Number that separates the random stream of these errors from others with the same seed.
const DRAW: u64 = 81;
/// Ends of the range of the angle of attack in which a line replaces the lift table, rad: −4° and 7°, between negative and
/// positive stall.
const LINE: [f64; 2] = [-0.069_813_2, 0.122_173];

/// Returns the text of a model file with the model name `name`, made from the text `reference` of a model file. The effects
/// that `missing` takes out are removed. In place of a lift table, the linear lift coefficients are set. In place of a
/// propeller or a thrust table, a thrust independent of airspeed is inserted. Every coefficient gets an error with the standard
/// deviation [`WRONG`], drawn from `seed`.
///
/// # Errors
///
/// If `reference` is not the text of a model file, or lacks an effect that is to be removed.
pub fn starting_model(
    reference: &str,
    name: &str,
    seed: u64,
    missing: &[Missing],
) -> Result<String, String> {
    let broken = |what: &str| format!("the reference model has no {what}; give a model file");
    let mut file: toml::Table = toml::from_str(reference).map_err(|e| e.message().to_owned())?;
    file.insert("name".into(), name.into());
    let about = "A model whose coefficients are off by some 15 %, and which may lack an effect.";
    file.insert("description".into(), about.into());
    let effects = file.get_mut("effects").and_then(|e| e.as_table_mut());
    let effects = effects.ok_or_else(|| broken("effects"))?;
    for id in missing.iter().filter_map(|missing| missing.taken_out) {
        let taken = effects.remove(id).ok_or_else(|| broken(id))?;
        if id == "lift_table" {
            let [zero, slope] = line(&taken).ok_or_else(|| broken("lift_table.CL"))?;
            let lift = effects.get_mut("lift_linear").and_then(|e| e.as_table_mut());
            let lift = lift.ok_or_else(|| broken("lift_linear"))?;
            set(lift, "CL0", zero).ok_or_else(|| broken("lift_linear.CL0"))?;
            set(lift, "CLalpha", slope).ok_or_else(|| broken("lift_linear.CLalpha"))?;
        }
        if ["propeller", "thrust_table"].contains(&id) {
            let most = most_thrust(&taken).or_else(|| most_in_table(&taken));
            let most = most.ok_or_else(|| broken(id))?;
            effects.insert("thrust_linear".into(), linear_thrust(most));
        }
    }
    make_wrong(effects, seed);
    Ok(text(&file))
}

/// Intercept and slope (1/rad) of a line that replaces the table of an effect `lift_table`. The line passes through the table's
/// values at the ends of [`LINE`].
fn line(effect: &toml::Value) -> Option<[f64; 2]> {
    let table = effect.get("CL")?;
    let list = |key: &str| -> Option<Vec<f64>> {
        let number = |v: &toml::Value| v.as_float().or_else(|| v.as_integer().map(|n| n as f64));
        table.get(key)?.as_array()?.iter().map(number).collect()
    };
    let (alpha, lift) = (list("alpha_rad")?, list("value")?);
    let at = |x: f64| {
        let k = alpha.windows(2).position(|w| w[0] <= x && x <= w[1])?;
        let share = (x - alpha[k]) / (alpha[k + 1] - alpha[k]);
        Some(lift[k] + share * (lift[k + 1] - lift[k]))
    };
    let [low, high] = LINE;
    let slope = (at(high)? - at(low)?) / (high - low);
    Some([rounded(at(low)? - slope * low), rounded(slope)])
}

/// Thrust (N) of an effect `propeller` at full throttle and zero airspeed.
fn most_thrust(effect: &toml::Value) -> Option<f64> {
    let value = |name: &str| effect.get(name)?.get("value")?.as_float();
    Some(value("T0_n")? + value("Tt_n")? + value("Ttt_n")?)
}

/// Thrust (N) of an effect `thrust_table` at full throttle and its smallest airspeed.
fn most_in_table(effect: &toml::Value) -> Option<f64> {
    effect.get("T_n")?.get("value")?.as_array()?.last()?.as_array()?.first()?.as_float()
}

/// An effect `thrust_linear` whose thrust at full throttle is half of the static thrust `most` (N).
fn linear_thrust(most: f64) -> toml::Value {
    let number =
        [("value", rounded(0.5 * most).into()), ("source", "half the thrust at rest".into())];
    let number = number.map(|(k, v): (&str, toml::Value)| (k.to_owned(), v));
    toml::Table::from_iter([("Cp_n".to_owned(), toml::Table::from_iter(number).into())]).into()
}

fn set(effect: &mut toml::Table, name: &str, value: f64) -> Option<()> {
    let number = effect.get_mut(name)?.as_table_mut()?;
    number.insert("value".into(), value.into());
    Some(())
}

/// Multiplies every coefficient by 1 + 0.15 x, where x is normally distributed and limited to ±2. Each coefficient has its own
/// random stream, which depends on its name. The removal of an effect therefore does not change the other errors.
fn make_wrong(effects: &mut toml::Table, seed: u64) {
    for (id, effect) in effects.iter_mut() {
        let Some(effect) = effect.as_table_mut() else { continue };
        for (name, entry) in effect.iter_mut() {
            let Some(number) = entry.as_table_mut() else { continue };
            // entries without a single value, such as tables over α, are not coefficients
            let Some(value) = number.get("value").and_then(toml::Value::as_float) else { continue };
            let path: Vec<u64> = format!("{id}.{name}").bytes().map(u64::from).collect();
            let mut random = stream(seed, &[[DRAW].as_slice(), &path].concat());
            let unit: f64 = StandardNormal.sample(&mut random);
            let wrong = possible(id, name, value * (1.0 + WRONG * unit.clamp(-2.0, 2.0)));
            // a prior standard deviation `sd` below 15 % of the value would hold a fit near the wrong value and is therefore
            // removed; the default is 15 %
            if number
                .get("sd")
                .and_then(toml::Value::as_float)
                .is_some_and(|sd| sd < WRONG * wrong.abs())
            {
                number.remove("sd");
            }
            number.insert("value".into(), rounded(wrong).into());
            number.insert("source".into(), "a guess, good to some 15 %".into());
        }
    }
}

/// `value` limited to the catalogue's bounds of the coefficient, unless these bounds scale with the aircraft's size.
fn possible(effect: &str, name: &str, value: f64) -> f64 {
    let about = describe(effect);
    let own = about.and_then(|about| about.coefficients.iter().find(|c| c.name == name));
    match own.filter(|c| !Size::scales(c.unit)) {
        Some(c) => value.clamp(c.bounds.0, c.bounds.1),
        None => value,
    }
}

/// `file` as the text of a model file, with one line for each number.
fn text(file: &toml::Table) -> String {
    let mut out = String::new();
    let is_section = |value: &toml::Value| {
        value.as_table().is_some_and(|t| t.values().any(|v| v.is_table() || v.is_array()))
    };
    let mut sections = vec![(String::new(), file)];
    // `sections` is a stack: the sections below a section are pushed in reverse order, so that the first is written next
    while let Some((path, table)) = sections.pop() {
        let (below, here): (Vec<_>, Vec<_>) = table.iter().partition(|(_, v)| is_section(v));
        if !path.is_empty() && !here.is_empty() {
            let _ = writeln!(out, "\n[{path}]");
        }
        here.iter().for_each(|(name, value)| {
            let _ = writeln!(out, "{} = {value}", key(name));
        });
        let dot = if path.is_empty() { "" } else { "." };
        for (name, value) in below.into_iter().rev() {
            sections.extend(value.as_table().map(|t| (format!("{path}{dot}{}", key(name)), t)));
        }
    }
    out
}

/// `name` as a key in a TOML file. It is quoted if it has characters other than letters, digits, `_` and `-`, for example if it
/// is the name of a log.
fn key(name: &str) -> String {
    let bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    match !name.is_empty() && name.chars().all(bare) {
        true => name.to_owned(),
        false => toml::Value::from(name).to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_of_a_flight_are_read_back() {
        let reference = "schema = 1\n[effects.roll_linear]\nClp = { value = -0.5, source = \"a\" }\n\
                         [flights.\"a b.csv\"]\nsource = \"b\"\ntrims = [0.1, 0.2]\n";
        let text = starting_model(reference, "m", 1, &[]).unwrap();
        let read: toml::Table = toml::from_str(&text).unwrap();
        assert!(read["flights"]["a b.csv"]["trims"].is_array(), "{text}");
    }
}
