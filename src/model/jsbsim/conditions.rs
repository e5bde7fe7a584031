//! Exports several models of an aircraft as one aircraft of JSBSim. Each model is valid in one condition, for example at one
//! flap setting. The exported aircraft interpolates between the conditions.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::aerodynamics;
use crate::GreyBox;

/// Properties that every JSBSim aircraft has. They need no declaration.
const OF_JSBSIM: [&str; 4] =
    ["fcs/flap-cmd-norm", "fcs/speedbrake-cmd-norm", "fcs/spoiler-cmd-norm", "gear/gear-cmd-norm"];

/// Reason why models cannot be exported as one aircraft in several conditions.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ConditionsError {
    /// No model is given.
    #[error("no model to export: name one with --model")]
    Nothing,
    /// The airframes differ in no property, or in several.
    #[error(
        "cannot export the models {models} as one aircraft: the [conditions] of their airframes must differ in exactly one \
         property and differ in {}; give each airframe.toml its setting of the same property, such as \"fcs/flap-cmd-norm\"",
        if properties.is_empty() { "none".to_owned() } else { properties.join(", ") }
    )]
    Properties {
        /// Names of the models.
        models: String,
        /// Properties in which they differ.
        properties: Vec<String>,
    },
    /// Two models have the same setting.
    #[error(
        "cannot export the models {first} and {second} as one aircraft: both are of {property} = {setting}; leave one of \
         them out"
    )]
    Twice {
        /// Name of the first model.
        first: String,
        /// Name of the second model.
        second: String,
        /// The property that distinguishes the conditions.
        property: String,
        /// Value of the property in both models.
        setting: f64,
    },
    /// A quantity that a condition cannot change differs between two models.
    #[error(
        "cannot export the models {first} and {second} as one aircraft: their {what} differ; a condition changes only \
         aerodynamic coefficients, so give both models the same {what}"
    )]
    Differ {
        /// Name of the first model.
        first: String,
        /// Name of the second model.
        second: String,
        /// Description of the differing quantity.
        what: String,
    },
}

/// Models of one aircraft, one for each setting of a property of JSBSim.
pub(super) struct Conditions<'a> {
    /// Name of the property. Empty for a single model.
    property: String,
    /// Settings in ascending order, each with its model.
    settings: Vec<(f64, &'a GreyBox)>,
}

impl<'a> Conditions<'a> {
    /// A single model that applies in all conditions.
    pub(super) fn one(model: &'a GreyBox) -> Self {
        Conditions { property: String::new(), settings: vec![(0.0, model)] }
    }

    /// Several models, which are distinguished by the only property in which their airframes' conditions differ.
    pub(super) fn of(models: &'a [GreyBox]) -> Result<Self, ConditionsError> {
        let Some((first, rest)) = models.split_first() else {
            return Err(ConditionsError::Nothing);
        };
        if rest.is_empty() {
            return Ok(Conditions::one(first));
        }
        for other in rest {
            same(first, other)?;
        }
        let property = property(models)?;
        let mut settings: Vec<(f64, &GreyBox)> =
            models.iter().map(|m| (m.airframe.conditions[&property], m)).collect();
        settings.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some([(setting, one), (_, other)]) =
            settings.array_windows().find(|[(a, _), (b, _)]| a == b)
        {
            let (first, second) = (one.name.clone(), other.name.clone());
            return Err(ConditionsError::Twice { first, second, property, setting: *setting });
        }
        Ok(Conditions { property, settings })
    }

    /// The models in ascending order of their settings.
    pub(super) fn models(&self) -> impl Iterator<Item = &'a GreyBox> + '_ {
        self.settings.iter().map(|(_, model)| *model)
    }

    /// The model of the lowest setting, from which all common quantities are taken.
    pub(super) fn first(&self) -> &'a GreyBox {
        self.settings[0].1
    }

    /// Names of the models, separated by commas.
    pub(super) fn names(&self) -> String {
        let names: Vec<&str> = self.models().map(|m| m.name.as_str()).collect();
        names.join(", ")
    }

    /// Declaration of the property, with the lowest setting as its initial value. Empty if JSBSim has the property already.
    pub(super) fn declaration(&self) -> String {
        match &self.settings[..] {
            [_] => String::new(),
            _ if OF_JSBSIM.contains(&self.property.as_str()) => String::new(),
            settings => {
                format!(
                    "    <property value=\"{:?}\"> {} </property>\n",
                    settings[0].0, self.property
                )
            }
        }
    }

    /// Text of a JSBSim channel that computes the weight of each condition. A weight is one at the setting of its condition and
    /// zero at the other settings. Between two settings it is interpolated linearly.
    pub(super) fn weights(&self) -> String {
        if self.settings.len() == 1 {
            return String::new();
        }
        let mut out = "    <channel name=\"conditions\">\n".to_owned();
        for (i, _) in self.settings.iter().enumerate() {
            let rows: String = self
                .settings
                .iter()
                .enumerate()
                .map(|(j, (setting, _))| format!("          {setting:?} {}\n", u8::from(i == j)))
                .collect();
            let _ = write!(
                out,
                "      <fcs_function name=\"{}\">\n        <function> <table>\n          <independentVar \
                 lookup=\"row\">{}</independentVar>\n          <tableData>\n{rows}          </tableData>\n        </table> \
                 </function>\n      </fcs_function>\n",
                weight(i),
                self.property
            );
        }
        out.push_str("    </channel>\n");
        out
    }

    /// Text of the weighted sum over all conditions. `terms` returns the text of the terms of one model.
    pub(super) fn weighted(&self, terms: impl Fn(&GreyBox) -> String) -> String {
        if let [(_, model)] = &self.settings[..] {
            return terms(model);
        }
        self.models()
            .enumerate()
            .map(|(i, model)| {
                format!(
                    "            <product> <property>{}</property> <sum>\n            <value>0.0</value>\n{}            </sum> \
                     </product>\n",
                    weight(i),
                    terms(model)
                )
            })
            .collect()
    }
}

/// Name of the property with the weight of condition `number`.
fn weight(number: usize) -> String {
    format!("fcs/condition-{number}")
}

/// The only property in which the conditions of `models` differ.
fn property(models: &[GreyBox]) -> Result<String, ConditionsError> {
    let names: BTreeSet<&String> =
        models.iter().flat_map(|m| m.airframe.conditions.keys()).collect();
    let setting = |model: &GreyBox, name: &str| model.airframe.conditions.get(name).copied();
    let differ =
        |name: &&&String| models.iter().any(|m| setting(m, name) != setting(&models[0], name));
    let properties: Vec<String> = names.iter().filter(differ).map(|name| (*name).clone()).collect();
    match &properties[..] {
        [one] if models.iter().all(|m| setting(m, one).is_some()) => Ok(one.clone()),
        _ => {
            let models: Vec<&str> = models.iter().map(|m| m.name.as_str()).collect();
            Err(ConditionsError::Properties { models: models.join(", "), properties })
        }
    }
}

/// Checks that two models agree in all quantities that a condition cannot change.
fn same(first: &GreyBox, second: &GreyBox) -> Result<(), ConditionsError> {
    let differ = |what: &str| ConditionsError::Differ {
        first: first.name.clone(),
        second: second.name.clone(),
        what: what.to_owned(),
    };
    let (one, other) = (&first.airframe, &second.airframe);
    for (what, same) in [
        ("geometry", one.geometry == other.geometry),
        ("controls", one.actuators == other.actuators),
        ("surfaces and motors", one.mixer == other.mixer),
        ("mass and inertia", first.body == second.body),
        ("force axes", first.axes == second.axes),
        ("thrust tables", first.thrust_grid() == second.thrust_grid()),
    ] {
        if !same {
            return Err(differ(what));
        }
    }
    let fixed = |model: &GreyBox| -> Vec<(String, u64)> {
        let of_engine = model.coefficients().iter().filter(|c| !aerodynamics::knows(&c.name));
        of_engine.map(|c| (c.name.clone(), c.value.to_bits())).collect()
    };
    let (ours, theirs) = (fixed(first), fixed(second));
    let lacking = ours.iter().find(|c| !theirs.contains(c));
    match lacking.or_else(|| theirs.iter().find(|c| !ours.contains(c))) {
        Some((name, _)) => Err(differ(&format!("values of {name}"))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jsbsim::{export, export_in_conditions};
    use greylag_num::Grid;
    use std::path::Path;

    fn model() -> GreyBox {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/aerosonde/jsbsim.toml");
        GreyBox::load(&path).unwrap()
    }

    #[test]
    fn models_with_different_thrust_tables_are_not_one_aircraft() {
        let mut other = model();
        let values = [vec![0.0, -1.0], vec![90.0, 0.0]];
        let grid = Grid::new(&[0.0, 1.0], &[0.0, 50.0], &values).unwrap();
        for term in other.terms.iter_mut().filter(|term| term.points.grid.is_some()) {
            term.points.grid = Some(grid.clone());
        }
        let why = export_in_conditions(&[model(), other], "a").unwrap_err().to_string();
        assert!(why.contains("thrust tables differ"), "{why}");
    }

    #[test]
    fn a_name_with_two_hyphens_does_not_break_the_comment() {
        let mut model = model();
        model.name = "a---b".into();
        let text = &export(&model, "a").files[0].1;
        let (_, rest) = text.split_once("<!--").unwrap();
        let (comment, _) = rest.split_once("-->").unwrap();
        assert!(comment.contains("from the model") && comment.ends_with(". "), "{comment}");
        assert!(!comment.contains("--"), "{comment}");
    }
}
