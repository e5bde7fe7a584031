//! Edits the text of a model file: sets values of coefficients and adds effects, with all other text unchanged. An effect is one
//! term of the forces and moments, such as `lift_linear`.

use crate::known::{FlightConstants, Known, SENSORS, TRIMS};
use greylag_physics::effects::Kind;
use toml_edit::{DocumentMut, InlineTable, Item, Table, TableLike, Value};

/// Reason why the text of a model file cannot be edited.
#[derive(Debug, thiserror::Error)]
pub enum EditError {
    /// The text is not valid TOML.
    #[error("cannot edit the model file: {0}; `greylag compare` names the fault")]
    Syntax(#[from] toml_edit::TomlError),
    /// An entry is missing or has another type than in a model file.
    #[error("cannot edit the model file: {0} is not where a model file has it")]
    Place(String),
    /// The model already has the effect.
    #[error("cannot add {0} to the model file: it has that effect already")]
    Present(String),
}

/// A number that is to be written into a model file.
#[derive(Clone, Debug, PartialEq)]
pub struct Number {
    /// Name of the coefficient, written as `effect.coefficient`.
    pub name: String,
    /// Value in the coefficient's unit.
    pub value: f64,
    /// Standard deviation, in the unit of the value. `None` leaves the file's entry unchanged.
    pub sd: Option<f64>,
    /// Bounds in the unit of the value. `None` leaves the file's entry unchanged.
    pub bounds: Option<[f64; 2]>,
}

/// Changes of a model file.
#[derive(Clone, Debug, Default)]
pub struct Edit {
    /// New name of the model.
    pub name: String,
    /// Path of the airframe file, relative to the new model file.
    pub airframe: String,
    /// New values of coefficients of the model's own effects.
    pub changed: Vec<Number>,
    /// Coefficients of new effects, each with the source of the effect's formula. The coefficients of one effect are adjacent.
    pub added: Vec<(Number, String)>,
    /// Coefficients that are set to zero, each with the id of the effect that replaces its term.
    pub dropped: Vec<(String, &'static str)>,
    /// Other entries whose value becomes a text. Each has the path of keys, outermost first, and the text.
    pub replaced: Vec<(&'static [&'static str], &'static str)>,
    /// Paths of the effect files (files that define an effect), relative to the new model file.
    pub effect_files: Vec<String>,
    /// Text that names the flights to which the values were fitted. It becomes part of the `source` of each value.
    pub fitted_to: String,
    /// Sensor errors and trims of the installation and of single flights, which replace those in the file. `None` leaves the
    /// file's entries unchanged.
    pub known: Option<Known>,
}

impl Edit {
    /// Applies the edit to `text`, the text of a model file. Comments and all other entries are unchanged.
    ///
    /// # Errors
    /// If `text` is not that of a model file, lacks a coefficient to be changed, or already has an effect to be added.
    pub fn apply(&self, text: &str) -> Result<String, EditError> {
        let mut document: DocumentMut = text.parse()?;
        for (key, new) in [("name", &self.name), ("airframe", &self.airframe)] {
            let old = document.get_mut(key).and_then(Item::as_value_mut);
            replace(old.ok_or_else(|| EditError::Place(key.into()))?, new.as_str().into());
        }
        for (keys, new) in &self.replaced {
            let place = || EditError::Place(keys.join("."));
            let (last, tables) = keys.split_last().ok_or_else(place)?;
            let mut table: &mut dyn TableLike = document.as_table_mut();
            for key in tables {
                let next = table.get_mut(key).and_then(Item::as_table_like_mut);
                table = next.ok_or_else(place)?;
            }
            let old = table.get_mut(last).and_then(Item::as_value_mut);
            replace(old.ok_or_else(place)?, (*new).into());
        }
        if !self.effect_files.is_empty() {
            let files: toml_edit::Array = self.effect_files.iter().collect();
            document.insert("effect_files", Item::Value(files.into()));
        }
        let place = || EditError::Place("effects".into());
        let effects = document.get_mut("effects").ok_or_else(place)?;
        let effects = effects.as_table_like_mut().ok_or_else(place)?;
        for number in &self.changed {
            self.change(effects, number)?;
        }
        for (name, by) in &self.dropped {
            drop_coefficient(effects, name, by)?;
        }
        let mut fresh = String::new();
        for (number, source) in &self.added {
            let (id, short) = split(&number.name)?;
            if fresh != id {
                if effects.contains_key(id) {
                    return Err(EditError::Present(id.into()));
                }
                effects.insert(id, Item::Table(Table::new()));
                fresh = id.into();
            }
            let table = effects.get_mut(id).and_then(Item::as_table_like_mut);
            let table = table.ok_or_else(|| EditError::Place(id.into()))?;
            let source = format!("greylag amend: added, {source}; fitted to {}", self.fitted_to);
            table.insert(short, Item::Value(Value::InlineTable(sourced(number, &source))));
        }
        if let Some(known) = &self.known {
            write_known(&mut document, known);
        }
        Ok(document.to_string())
    }

    fn change(&self, effects: &mut dyn TableLike, number: &Number) -> Result<(), EditError> {
        let place = || EditError::Place(format!("effects.{}", number.name));
        if let Some((table, short, own)) = left_to_effect_file(effects, &number.name)? {
            let source = format!("{}; fitted to {}", original(own), self.fitted_to);
            let mut entry = sourced(number, &source);
            if let Some(bounds) = number.bounds {
                let both: toml_edit::Array = bounds.into_iter().collect();
                entry.insert("bounds", both.into());
            }
            table.insert(short, Item::Value(Value::InlineTable(entry)));
            return Ok(());
        }
        let item = entry(effects, &number.name)?;
        let table = item.as_table_like_mut().ok_or_else(place)?;
        let old = table.get("source").and_then(Item::as_str).unwrap_or("no source");
        let source = format!("{}; fitted to {}", original(old), self.fitted_to);
        for (key, new) in [("value", number.value.into()), ("source", Value::from(source))] {
            let old = table.get_mut(key).and_then(Item::as_value_mut).ok_or_else(place)?;
            replace(old, new);
        }
        if let Some(sd) = number.sd {
            table.insert("sd", Item::Value(sd.into()));
        }
        if let Some(bounds) = number.bounds {
            let both: toml_edit::Array = bounds.into_iter().collect();
            table.insert("bounds", Item::Value(both.into()));
        }
        if let Some(inline) = item.as_inline_table_mut() {
            inline.fmt();
        }
        Ok(())
    }
}

/// Replaces the sections `[installation]` and `[flights]` of `document` by the constants in `known`.
fn write_known(document: &mut DocumentMut, known: &Known) {
    document.remove("installation");
    document.remove("flights");
    if let Some(shared) = &known.installation {
        document.insert("installation", Item::Table(constants(shared)));
    }
    if !known.flights.is_empty() {
        let mut flights = Table::new();
        flights.set_implicit(true);
        for (name, own) in &known.flights {
            flights.insert(name, Item::Table(constants(own)));
        }
        document.insert("flights", Item::Table(flights));
    }
}

fn constants(of: &FlightConstants) -> Table {
    let named = |names: &[&str], values: &[f64]| {
        let stated = names.iter().zip(values).filter(|(_, x)| **x != 0.0);
        let mut table = InlineTable::new();
        stated.for_each(|(name, x)| {
            table.insert(*name, (*x).into());
        });
        Item::Value(Value::InlineTable(table))
    };
    let mut table = Table::new();
    table.insert("source", Item::Value(of.source.as_str().into()));
    if let Some(axes) = of.axes_deg {
        let angles: toml_edit::Array = axes.into_iter().collect();
        table.insert("axes_deg", Item::Value(angles.into()));
    }
    if let Some(trims) = of.trims {
        table.insert("trims", named(&TRIMS, &trims));
    }
    if let Some(sensors) = of.sensors {
        table.insert("sensors", named(&SENSORS, &sensors));
    }
    table
}

/// The entry of the coefficient `name`.
fn entry<'a>(effects: &'a mut dyn TableLike, name: &str) -> Result<&'a mut Item, EditError> {
    let (id, short) = split(name)?;
    let effect = effects.get_mut(id).and_then(Item::as_table_like_mut);
    let item = effect.and_then(|effect| effect.get_mut(short));
    item.ok_or_else(|| EditError::Place(format!("effects.{name}")))
}

/// For a coefficient `name` that the model file leaves out, because its effect file states the value: the effect's table in the
/// model file, the name without the effect's id, and the source of the effect. `None` if the model file has the coefficient or no
/// effect file defines it.
fn left_to_effect_file<'a, 'b>(
    effects: &'a mut dyn TableLike,
    name: &'b str,
) -> Result<Option<(&'a mut dyn TableLike, &'b str, &'static str)>, EditError> {
    let (id, short) = split(name)?;
    let written = Kind::from_id(id).and_then(Kind::written).map(|effect| effect.about);
    let known = written.filter(|about| about.coefficients.iter().any(|c| c.name == short));
    let table = effects.get_mut(id).and_then(Item::as_table_like_mut);
    let table = table.filter(|table| !table.contains_key(short));
    Ok(table.zip(known).map(|(table, about)| (table, short, about.source)))
}

/// Sets the coefficient `name` to zero because the effect `by` replaces its term.
fn drop_coefficient(effects: &mut dyn TableLike, name: &str, by: &str) -> Result<(), EditError> {
    let place = || EditError::Place(format!("effects.{name}"));
    let item = entry(effects, name)?;
    let table = item.as_table_like_mut().ok_or_else(place)?;
    let source = format!("greylag amend: zero, {by} stands in its place");
    for (key, new) in [("value", 0.0.into()), ("source", Value::from(source))] {
        let old = table.get_mut(key).and_then(Item::as_value_mut).ok_or_else(place)?;
        replace(old, new);
    }
    table.remove("sd");
    // the bounds may exclude zero
    table.remove("bounds");
    Ok(())
}

/// The text "greylag amend: " and the original source of a coefficient. What an earlier fit added to `source` is left out.
fn original(source: &str) -> String {
    let amended = "greylag amend: ";
    let bare = source.strip_prefix(amended).and_then(|s| s.split("; fitted to ").next());
    format!("{amended}{}", bare.unwrap_or(source))
}

fn split(name: &str) -> Result<(&str, &str), EditError> {
    name.split_once('.').ok_or_else(|| EditError::Place(name.into()))
}

/// Replaces the value `old` by `new`, without a change of the spaces and comments around it.
fn replace(old: &mut Value, mut new: Value) {
    *new.decor_mut() = old.decor().clone();
    *old = new;
}

fn sourced(number: &Number, source: &str) -> InlineTable {
    let mut table = InlineTable::new();
    table.insert("value", number.value.into());
    if let Some(sd) = number.sd {
        table.insert("sd", sd.into());
    }
    table.insert("source", source.into());
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"# about
schema = 1
name = "prior" # why
airframe = "airframe.toml"

[air]
density = { kgpm3 = 1.2 } # at home

[effects.lift_linear]
# the slope
CLalpha = { value = 4.0, source = "Gryte" } # measured
CLq = { value = 3.87, sd = 0.1, source = "Gryte" } # damps
"#;

    fn number(name: &str, value: f64, sd: Option<f64>) -> Number {
        Number { name: name.into(), value, sd, bounds: None }
    }

    fn edit() -> Edit {
        Edit {
            name: "prior+lift_stall".into(),
            airframe: "a.toml".into(),
            changed: vec![number("lift_linear.CLalpha", 0.1 + 0.2, Some(0.01))],
            added: vec![(number("lift_stall.k", 1.0, None), "BM12".into())],
            dropped: vec![("lift_linear.CLq".into(), "lift_table")],
            replaced: vec![(&["air", "density"], "standard")],
            effect_files: vec!["own.toml".into()],
            fitted_to: "a.csv (sha256 01)".into(),
            known: None,
        }
    }

    #[test]
    fn comments_stay_and_numbers_return_to_the_bit() {
        let text = edit().apply(TEXT).unwrap();
        for kept in [
            "# about",
            "# why",
            "density = \"standard\" # at home",
            "# the slope",
            "# measured",
            "# damps",
        ] {
            assert!(text.contains(kept), "{kept} lost in\n{text}");
        }
        let read: toml::Table = toml::from_str(&text).unwrap();
        let slope = &read["effects"]["lift_linear"]["CLalpha"];
        assert_eq!(slope["value"].as_float(), Some(0.1 + 0.2));
        assert_eq!(read["effect_files"][0].as_str(), Some("own.toml"));
        assert_eq!(slope["sd"].as_float(), Some(0.01));
        assert_eq!(
            slope["source"].as_str(),
            Some("greylag amend: Gryte; fitted to a.csv (sha256 01)")
        );
        let dropped = &read["effects"]["lift_linear"]["CLq"];
        assert_eq!(dropped["value"].as_float(), Some(0.0));
        assert!(dropped.get("sd").is_none());
        let source = dropped["source"].as_str();
        assert_eq!(source, Some("greylag amend: zero, lift_table stands in its place"));
        assert_eq!(read["effects"]["lift_stall"]["k"]["value"].as_float(), Some(1.0));
        // after a second amendment the source names only the last fit
        let again = Edit { fitted_to: "b.csv".into(), added: Vec::new(), ..edit() };
        let read: toml::Table = toml::from_str(&again.apply(&text).unwrap()).unwrap();
        let source = read["effects"]["lift_linear"]["CLalpha"]["source"].as_str();
        assert_eq!(source, Some("greylag amend: Gryte; fitted to b.csv"));
    }

    #[test]
    fn a_dropped_coefficient_loses_its_bounds_and_one_of_an_effect_file_gets_an_entry() {
        let text =
            TEXT.replace("3.87, sd", "3.87, bounds = [2.0, 6.0], sd") + "[effects.p_factor]\n";
        let number = Number { bounds: Some([0.1, 2.0]), ..number("p_factor.k", 0.4, Some(0.1)) };
        let text = Edit { changed: vec![number], ..edit() }.apply(&text).unwrap();
        let read: toml::Table = toml::from_str(&text).unwrap();
        let dropped = &read["effects"]["lift_linear"]["CLq"];
        assert_eq!(dropped["value"].as_float(), Some(0.0));
        assert!(dropped.get("bounds").is_none(), "{text}");
        let fitted = &read["effects"]["p_factor"]["k"];
        assert_eq!(fitted["value"].as_float(), Some(0.4));
        assert_eq!(fitted["bounds"][1].as_float(), Some(2.0));
        assert!(fitted["source"].as_str().unwrap().ends_with("fitted to a.csv (sha256 01)"));
    }

    #[test]
    fn what_is_not_there_or_there_already_is_said() {
        let unknown = Edit { changed: vec![number("lift_linear.CLx", 1.0, None)], ..edit() };
        assert!(unknown.apply(TEXT).unwrap_err().to_string().contains("lift_linear.CLx"));
        let text = edit().apply(TEXT).unwrap();
        assert!(matches!(edit().apply(&text), Err(EditError::Present(id)) if id == "lift_stall"));
        assert!(matches!(edit().apply("= 1"), Err(EditError::Syntax(_))));
        assert!(matches!(edit().apply("schema = 1"), Err(EditError::Place(_))));
    }
}
