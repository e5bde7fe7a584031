//! Stability derivatives as AVL writes them (`ST` and `SB`), as airframe and model.
//!
//! The text is a row of `NAME = number`: totals at a reference incidence, derivatives by α and β (1/rad), by pb/2V,
//! qc/2V, rb/2V, and by controls d01, d02, … whose names stand above their columns. OptVL, AeroSandbox and XFLR5 write
//! the same names. `ST` is in stability axes, turned here into body axes; `SB` is by u, v, w over V in body axes.

use std::collections::BTreeMap;

use super::textbook::{Estimate, Measures, Section};

/// What is known of an aircraft beside the derivatives.
#[derive(Clone, Debug)]
pub struct Beside {
    /// Name, mass, tail, travel and thrust; span and area are those of the file.
    pub measures: Measures,
    /// Metres in the unit of length of the file.
    pub metres: f64,
    /// Radians in the unit of the control derivatives: AVL has degrees times the control's gain.
    pub radians: f64,
}

/// What was made of a file.
#[derive(Clone, Debug)]
pub struct Read {
    /// The airframe file.
    pub airframe: String,
    /// The model file, beside `airframe.toml`.
    pub model: String,
    /// What is not of the file, and what was turned round, one sentence each.
    pub notes: Vec<String>,
}

/// Why a file is of no use.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum AvlError {
    /// A number is missing.
    #[error(
        "the file has no {name}: write it with AVL's command ST (or SB) after a run, from the menu OPER"
    )]
    Missing {
        /// The number.
        name: String,
    },
    /// A number is none.
    #[error("{name} = {text} in line {line} is not a number; run the case again")]
    Number {
        /// The number's name.
        name: String,
        /// What stands there.
        text: String,
        /// Where, from 1.
        line: usize,
    },
    /// The reference area or span is not positive.
    #[error("Sref, Cref and Bref must be positive; check the header of the geometry file")]
    Reference,
}

/// Widths by provenance, as shares of the value.
mod width {
    pub const LIFT: f64 = 0.05;
    /// The reference incidence is the modeller's.
    pub const ZERO: f64 = 0.2;
    pub const DAMPING: f64 = 0.2;
    /// Depends on the centre of gravity.
    pub const STIFFNESS: f64 = 0.2;
    pub const LATERAL: f64 = 0.5;
    pub const CONTROL: f64 = 0.5;
}

const SOURCE: &str = "vortex lattice (AVL)";
/// The six coefficients: side force, lift, rolling, pitching and yawing moment.
const NAMES: [&str; 5] = ["CY", "CL", "Cl", "Cm", "Cn"];

/// Derivatives of side force, lift, rolling, pitching, yawing moment by one variable, body axes.
type Column = [f64; 5];

/// A text of `NAME = number`.
struct Numbers(BTreeMap<String, f64>);

impl Numbers {
    fn read(text: &str) -> Result<Numbers, AvlError> {
        let mut all = BTreeMap::new();
        for (k, line) in text.lines().enumerate() {
            let parts: Vec<&str> = line.split('=').collect();
            for pair in parts.windows(2) {
                let name = pair[0].split_whitespace().next_back().unwrap_or_default();
                let value = pair[1].split_whitespace().next().unwrap_or_default();
                // words of a title may stand around a sign of equality
                if !name.starts_with(|c: char| c.is_ascii_alphabetic()) || value.is_empty() {
                    continue;
                }
                match value.parse::<f64>() {
                    Ok(number) if number.is_finite() => {
                        all.entry(name.to_owned()).or_insert(number);
                    }
                    // Fortran writes stars where a number does not fit
                    Ok(_) | Err(_)
                        if value.starts_with('*') || value.eq_ignore_ascii_case("nan") =>
                    {
                        let (name, text) = (name.to_owned(), value.to_owned());
                        return Err(AvlError::Number { name, text, line: k + 1 });
                    }
                    _ => {}
                }
            }
        }
        Ok(Numbers(all))
    }

    fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    fn need(&self, name: &str) -> Result<f64, AvlError> {
        self.get(name).ok_or_else(|| AvlError::Missing { name: name.into() })
    }
}

/// The derivatives of a file.
struct Derivatives {
    /// Reference area, chord, span in the file's unit.
    reference: [f64; 3],
    /// Incidence of the run, rad.
    alpha: f64,
    /// Lift and pitching moment of the run.
    totals: [f64; 2],
    by_alpha: Column,
    by_beta: Column,
    by_rates: [Column; 3],
    /// Name and derivatives of each control.
    controls: Vec<(String, Column)>,
}

impl Derivatives {
    fn read(text: &str) -> Result<Derivatives, AvlError> {
        let numbers = Numbers::read(text)?;
        let alpha = numbers.need("Alpha")?.to_radians();
        let reference = reference(text)?;
        let is_body = numbers.get("CLa").is_none() && numbers.get("CZw").is_some();
        let of = |suffix: &str| column(&numbers, suffix, alpha, is_body);
        let (by_alpha, by_beta) = if is_body { (of("w")?, of("v")?) } else { (of("a")?, of("b")?) };
        let rates = [of("p")?, of("q")?, of("r")?];
        let by_rates = if is_body { rates } else { about_body(rates, alpha) };
        let controls = control_names(text)
            .into_iter()
            .map(|(name, suffix)| Ok((name, of(&suffix)?)))
            .collect::<Result<_, AvlError>>()?;
        let totals = [numbers.need("CLtot")?, numbers.need("Cmtot")?];
        Ok(Derivatives { reference, alpha, totals, by_alpha, by_beta, by_rates, controls })
    }
}

/// The derivatives with that suffix, moments about body axes.
fn column(numbers: &Numbers, suffix: &str, alpha: f64, is_body: bool) -> Result<Column, AvlError> {
    let (sin, cos) = alpha.sin_cos();
    if is_body {
        let get = |name: &str| numbers.need(&format!("{name}{suffix}"));
        let lift = get("CX")? * sin - get("CZ")? * cos;
        return Ok([get("CY")?, lift, get("Cl")?, get("Cm")?, get("Cn")?]);
    }
    let mut all = [0.0; 5];
    for (value, name) in all.iter_mut().zip(NAMES) {
        *value = numbers.need(&format!("{name}{suffix}"))?;
    }
    let [side, lift, roll, pitch, yaw] = all;
    Ok([side, lift, roll * cos - yaw * sin, pitch, roll * sin + yaw * cos])
}

/// Derivatives by body rates of those by rates about stability axes: p' = p cos α + r sin α, r' = r cos α − p sin α.
fn about_body([p, q, r]: [Column; 3], alpha: f64) -> [Column; 3] {
    let (sin, cos) = alpha.sin_cos();
    let both = |a: f64, b: f64| std::array::from_fn(|i| a * p[i] + b * r[i]);
    [both(cos, -sin), q, both(sin, cos)]
}

/// Controls by name, with the suffix of their derivatives: a line has `aileron d01 elevator d02`.
fn control_names(text: &str) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    for line in text.lines().filter(|line| !line.contains('=')) {
        let words: Vec<&str> = line.split_whitespace().collect();
        for pair in words.windows(2) {
            let number = pair[1].strip_prefix('d').filter(|n| n.parse::<u32>().is_ok());
            let is_new = all.iter().all(|(_, suffix)| suffix != pair[1]);
            if number.is_some() && is_new {
                all.push((pair[0].to_owned(), pair[1].to_owned()));
            }
        }
    }
    all
}

/// Reference area, chord and span of the `text` of a file, in its unit of length.
///
/// # Errors
/// If one is missing or not positive.
pub fn reference(text: &str) -> Result<[f64; 3], AvlError> {
    let numbers = Numbers::read(text)?;
    let all = [numbers.need("Sref")?, numbers.need("Cref")?, numbers.need("Bref")?];
    if all.iter().all(|x| *x > 0.0) { Ok(all) } else { Err(AvlError::Reference) }
}

/// Reads the `text` of a file of AVL, with what is known `beside` it.
///
/// # Errors
/// If a number that is needed is missing or is none.
pub fn read(text: &str, beside: &Beside) -> Result<Read, AvlError> {
    let found = Derivatives::read(text)?;
    let [area, chord, span] = found.reference;
    let measures = Measures {
        area: area * beside.metres * beside.metres,
        span: span * beside.metres,
        ..beside.measures.clone()
    };
    let mut notes = vec![
        "drag, inertia and thrust are textbook estimates: the file does not have them".to_owned(),
    ];
    let mut values = longitudinal(&found);
    values.extend(lateral(&found));
    values.extend(controls(&found, beside, &measures, &mut notes));
    let mut sections = measures.sections();
    for (full, value, width) in values {
        let Some((effect, name)) = full.split_once('.') else { continue };
        let own = sections.iter_mut().find(|(id, _)| *id == effect);
        let own = own.and_then(|(_, all)| all.iter_mut().find(|e: &&mut Estimate| e.0 == name));
        if let Some(estimate) = own {
            (estimate.1, estimate.2, estimate.3) = (value, width, SOURCE);
        }
    }
    trimmed(&mut sections, &measures);
    Ok(Read {
        airframe: measures.airframe_with_chord(chord * beside.metres, slope_and_zero(&sections)),
        model: measures
            .model_of(&sections, "Vortex-lattice derivatives; drag and inertia by the textbook."),
        notes,
    })
}

/// Full name, value and width of a coefficient.
type Value = (&'static str, f64, f64);

fn longitudinal(d: &Derivatives) -> Vec<Value> {
    let [total_lift, total_pitch] = d.totals;
    let (slope, stiffness) = (d.by_alpha[1], d.by_alpha[3]);
    vec![
        ("lift_linear.CL0", total_lift - slope * d.alpha, width::ZERO),
        ("lift_linear.CLalpha", slope, width::LIFT),
        ("lift_linear.CLq", d.by_rates[1][1], width::DAMPING),
        ("pitch_linear.Cm0", total_pitch - stiffness * d.alpha, width::LATERAL),
        ("pitch_linear.Cmalpha", stiffness, width::STIFFNESS),
        ("pitch_linear.Cmq", d.by_rates[1][3], width::DAMPING),
    ]
}

fn lateral(d: &Derivatives) -> Vec<Value> {
    let [p, _, r] = d.by_rates;
    vec![
        ("side_force_linear.CYbeta", d.by_beta[0], width::LATERAL),
        ("side_force_linear.CYp", p[0], width::LATERAL),
        ("side_force_linear.CYr", r[0], width::LATERAL),
        ("roll_linear.Clbeta", d.by_beta[2], width::LATERAL),
        ("roll_linear.Clp", p[2], width::DAMPING),
        ("roll_linear.Clr", r[2], width::LATERAL),
        ("yaw_linear.Cnbeta", d.by_beta[4], width::LATERAL),
        ("yaw_linear.Cnp", p[4], width::LATERAL),
        ("yaw_linear.Cnr", r[4], width::LATERAL),
    ]
}

/// Derivatives by aileron, elevator and rudder, each with our sign; what the file lacks stays the textbook's.
fn controls(
    d: &Derivatives,
    beside: &Beside,
    measures: &Measures,
    notes: &mut Vec<String>,
) -> Vec<Value> {
    let mut out = Vec::new();
    let mut used = Vec::new();
    // the place in a column, and its sign for a positive deflection
    for (control, word, place, sign) in
        [("aileron", "ail", 2, 1.0), ("elevator", "elev", 3, -1.0), ("rudder", "rud", 4, -1.0)]
    {
        if control == "rudder" && measures.rudder.is_none() {
            continue;
        }
        let named = d.controls.iter().filter(|(name, _)| name.to_lowercase().contains(word));
        let Some((name, column)) =
            named.max_by(|a, b| a.1[place].abs().total_cmp(&b.1[place].abs()))
        else {
            notes.push(format!(
                "no control of the file is called {control}: its coefficients are textbook estimates"
            ));
            continue;
        };
        used.push(name.as_str());
        let turn = if column[place] * sign < 0.0 { -1.0 } else { 1.0 };
        if turn < 0.0 {
            notes.push(format!("{name} of the file is turned round: {}", SENSE[place - 2]));
        }
        let [side, lift, roll, pitch, yaw] = column.map(|x| turn * x / beside.radians);
        out.extend(match control {
            "aileron" => vec![
                ("side_force_linear.CYda", side, width::CONTROL),
                ("roll_linear.Clda", roll, width::CONTROL),
                ("yaw_linear.Cnda", yaw, width::CONTROL),
            ],
            "elevator" => vec![
                ("lift_linear.CLde", lift, width::CONTROL),
                ("pitch_linear.Cmde", pitch, width::CONTROL),
            ],
            _ => vec![
                ("rudder_linear.CYdr", side, width::CONTROL),
                ("rudder_linear.Cldr", roll, width::CONTROL),
                ("rudder_linear.Cndr", yaw, width::CONTROL),
            ],
        });
    }
    for (name, _) in d.controls.iter().filter(|(name, _)| !used.contains(&name.as_str())) {
        notes.push(format!("the control {name} is left out"));
    }
    out
}

/// What a positive deflection does here.
const SENSE: [&str; 3] = [
    "a positive aileron rolls right here",
    "a positive elevator pitches down here",
    "a positive rudder yaws left here",
];

fn value(sections: &[Section], effect: &str, name: &str) -> f64 {
    let own = sections.iter().find(|(id, _)| *id == effect);
    own.and_then(|(_, all)| all.iter().find(|e| e.0 == name)).map_or(0.0, |e| e.1)
}

/// Slope of the lift (1/rad) and lift at α = 0.
fn slope_and_zero(sections: &[Section]) -> [f64; 2] {
    [value(sections, "lift_linear", "CLalpha"), value(sections, "lift_linear", "CL0")]
}

/// The induced drag goes by the file's lift.
fn trimmed(sections: &mut [Section], measures: &Measures) {
    let [slope, zero] = slope_and_zero(sections);
    let [linear, square] = measures.induced_by(slope, zero);
    for (id, all) in sections.iter_mut() {
        for estimate in all.iter_mut() {
            match (*id, estimate.0) {
                ("drag_linear", "CDalpha") => estimate.1 = linear,
                ("drag_alpha2", "CDalpha2") => estimate.1 = square,
                _ => {}
            }
        }
    }
}
