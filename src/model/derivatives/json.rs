//! Reads aerodynamic derivatives that the Python packages OptVL and AeroSandbox computed, from a JSON file.
//!
//! A short Python script in docs/how-to/add-an-aircraft.md writes the file. Most keys are the tools' own names. A few, such
//! as `alpha_deg`, are names of this program. OptVL has names like `dCL/dalpha`. A prime marks moments and rates about
//! stability axes (`dCl'/dp'`). Its control derivatives are per degree. AeroSandbox has names like `CLa`, and moments about
//! body axes. It has no control derivatives, so the script computes them as differences per degree.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::{Column, Control, Derivatives, DerivativesError, Tool, about_body, positive, to_body};

/// Content of a document: its numbers at any depth (except those in `controls`), and its entries `controls`, `tool` and
/// `XYZref` (moment reference point, of which x and z are stored).
struct Flat<'a> {
    numbers: BTreeMap<&'a str, f64>,
    controls: Option<&'a Map<String, Value>>,
    tool: Option<&'a str>,
    point: Option<[f64; 2]>,
}

/// Reads a JSON document. `radians` is the document's unit of deflection, in rad. Control derivatives are converted to 1/rad.
pub(super) fn read(text: &str, radians: f64) -> Result<Derivatives, DerivativesError> {
    let flat = document(text)?;
    let flat = Flat::of(&flat)?;
    let tool = flat.tool()?;
    match tool {
        Tool::OptVl => flat.optvl(radians),
        _ => flat.aerosandbox(tool, radians),
    }
}

/// Reference area, chord and span, in the file's unit of length.
pub(super) fn reference(text: &str) -> Result<[f64; 3], DerivativesError> {
    Flat::of(&document(text)?)?.reference()
}

fn document(text: &str) -> Result<Map<String, Value>, DerivativesError> {
    let wrong = |what: String| DerivativesError::Json { what };
    match serde_json::from_str(text).map_err(|e| wrong(e.to_string()))? {
        Value::Object(object) => Ok(object),
        _ => Err(wrong("it is no object".into())),
    }
}

impl<'a> Flat<'a> {
    fn of(object: &'a Map<String, Value>) -> Result<Flat<'a>, DerivativesError> {
        let mut flat = Flat { numbers: BTreeMap::new(), controls: None, tool: None, point: None };
        flat.gather(object)?;
        Ok(flat)
    }

    fn gather(&mut self, object: &'a Map<String, Value>) -> Result<(), DerivativesError> {
        for (name, value) in object {
            match value {
                Value::Number(number) => {
                    let number = number.as_f64().filter(|x| x.is_finite());
                    let number = number.ok_or_else(|| no_number(name, value))?;
                    self.numbers.insert(name, number);
                }
                Value::Object(inner)
                    if name == "controls" && inner.values().any(Value::is_object) =>
                {
                    self.controls = Some(inner);
                }
                Value::Object(inner) => self.gather(inner)?,
                Value::String(text) if name == "tool" => self.tool = Some(text),
                // Python writes a missing number as NaN, which is not valid JSON, or as null
                Value::Null => return Err(no_number(name, value)),
                Value::Array(all) if name == "XYZref" => {
                    let at = |k: usize| all.get(k).and_then(Value::as_f64);
                    self.point = at(0).map(|x| [x, at(2).unwrap_or(0.0)]);
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn need(&self, name: &str, from: &'static str) -> Result<f64, DerivativesError> {
        let missing = || DerivativesError::Missing { name: name.into(), tool: from };
        self.numbers.get(name).copied().ok_or_else(missing)
    }

    fn reference(&self) -> Result<[f64; 3], DerivativesError> {
        const FROM: &str =
            "write the reference as \"reference\": {\"Sref\": …, \"Cref\": …, \"Bref\": …}";
        positive([self.need("Sref", FROM)?, self.need("Cref", FROM)?, self.need("Bref", FROM)?])
    }

    /// Angle of attack of the run, rad.
    fn alpha(&self) -> Result<f64, DerivativesError> {
        const FROM: &str = "write the incidence of the run as \"alpha_deg\": …";
        Ok(self.need("alpha_deg", FROM)?.to_radians())
    }

    fn tool(&self) -> Result<Tool, DerivativesError> {
        if self.numbers.contains_key("dCL/dalpha") {
            return Ok(Tool::OptVl);
        }
        let said = self.tool.unwrap_or_default().to_lowercase().replace(['-', '_', ' '], "");
        let known = [
            ("vortexlattice", Tool::AeroSandboxLattice),
            ("aerobuildup", Tool::AeroBuildup),
            ("liftingline", Tool::LiftingLine),
        ];
        let found = known.into_iter().find(|(word, _)| said.contains(word));
        match (found, self.tool) {
            (Some((_, tool)), _) => Ok(tool),
            (None, Some(said)) => Err(DerivativesError::Tool { said: said.to_owned() }),
            (None, None) => Err(DerivativesError::NoTool),
        }
    }

    fn optvl(&self, radians: f64) -> Result<Derivatives, DerivativesError> {
        const FROM: &str =
            "OptVL's get_stab_derivs(), get_total_forces() and get_control_stab_derivs() return it";
        let alpha = self.alpha()?;
        let need = |name: &str| self.need(name, FROM);
        let by = |variable: &str| -> Result<Column, DerivativesError> {
            let names = ["CY", "CL", "Cl'", "Cm", "Cn'"];
            let [a, b, c, d, e] = names.map(|n| need(&format!("d{n}/d{variable}")));
            Ok(to_body([a?, b?, c?, d?, e?], alpha))
        };
        let rates = [by("p'")?, by("q'")?, by("r'")?];
        let variables = ["alpha", "beta", "p'", "q'", "r'"];
        let controls = self
            .numbers
            .keys()
            .filter_map(|name| name.strip_prefix("dCL/d"))
            .filter(|name| !variables.contains(name))
            .map(|name| {
                Ok(Control { name: name.to_owned(), column: by(name)?.map(|x| x / radians) })
            })
            .collect::<Result<_, DerivativesError>>()?;
        Ok(Derivatives {
            tool: Tool::OptVl,
            reference: self.reference()?,
            point: self.point,
            alpha,
            totals: [need("CL")?, need("Cm")?],
            by_alpha: by("alpha")?,
            by_beta: by("beta")?,
            by_rates: about_body(rates, alpha),
            controls,
            notes: Vec::new(),
        })
    }

    fn aerosandbox(&self, tool: Tool, radians: f64) -> Result<Derivatives, DerivativesError> {
        const FROM: &str = "AeroSandbox's run_with_stability_derivatives() returns it";
        let alpha = self.alpha()?;
        let need = |name: &str| self.need(name, FROM);
        let by = |suffix: &str| -> Result<Column, DerivativesError> {
            let [a, b, c, d, e] = NAMES.map(|n| need(&format!("{n}{suffix}")));
            Ok([a?, b?, c?, d?, e?])
        };
        let mut controls = Vec::new();
        for (name, values) in self.controls.into_iter().flatten() {
            let get = |n: &str| {
                let value = values.get(n).and_then(Value::as_f64).filter(|x| x.is_finite());
                let name = format!("controls.{name}.{n}");
                value.ok_or(DerivativesError::Missing { name, tool: CONTROLS })
            };
            let [a, b, c, d, e] = NAMES.map(get);
            let column = [a?, b?, c?, d?, e?].map(|x| x / radians);
            controls.push(Control { name: name.clone(), column });
        }
        Ok(Derivatives {
            tool,
            reference: self.reference()?,
            point: self.point,
            alpha,
            totals: [need("CL")?, need("Cm")?],
            by_alpha: by("a")?,
            by_beta: by("b")?,
            by_rates: [by("p")?, by("q")?, by("r")?],
            controls,
            notes: Vec::new(),
        })
    }
}

const NAMES: [&str; 5] = ["CY", "CL", "Cl", "Cm", "Cn"];
const CONTROLS: &str = "a control has the differences of CY, CL, Cl, Cm and Cn for one degree";

fn no_number(name: &str, value: &Value) -> DerivativesError {
    DerivativesError::Json { what: format!("{name} = {value} is no finite number") }
}
