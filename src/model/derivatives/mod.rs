//! Reads stability derivatives that an aerodynamic tool computed, and converts them to an airframe and a model.
//!
//! Each tool has its own axes, units and names. Its derivatives are converted to body axes, 1/rad, and nondimensional rates
//! pb/2V, qc/2V, rb/2V. The assumed standard deviation of a derivative depends on the tool ([`widths`]). A derivative that
//! the tool cannot compute is reported and not used (`checks`).

mod avl;
mod checks;
mod json;
mod numbers;
pub mod widths;
mod xflr5;

use numbers::Numbers;
pub use widths::Tool;

use super::textbook::{Estimate, Measures, Section};

/// Data of an aircraft in addition to its derivatives.
#[derive(Clone, Debug)]
pub struct Beside {
    /// Name, mass, tail, travel and thrust. The span and area in the file of derivatives replace the values given here.
    pub measures: Measures,
    /// Unit of length in the file of derivatives, m.
    pub metres: f64,
    /// Unit of angle of the control derivatives, rad. AVL's unit is a degree times the control's gain.
    pub radians: f64,
}

/// Result of the conversion of a file of derivatives.
#[derive(Clone, Debug)]
pub struct Read {
    /// Tool that wrote the file.
    pub tool: Tool,
    /// Text of the airframe file.
    pub airframe: String,
    /// Text of the model file, which belongs in the folder of `airframe.toml`.
    pub model: String,
    /// Assumptions that are not in the file, and changes of sign, one sentence each.
    pub notes: Vec<String>,
    /// Warnings about implausible values, one sentence each, with the coefficient's name.
    pub warnings: Vec<String>,
}

/// Reason why derivatives cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DerivativesError {
    /// A required number is missing.
    #[error("the file has no {name}: {tool}")]
    Missing {
        /// Name of the number.
        name: String,
        /// Text that states which output of the tool contains the number.
        tool: &'static str,
    },
    /// A value is not a number.
    #[error("{name} = {text} in line {line} is not a number; run the case again")]
    Number {
        /// Name of the number.
        name: String,
        /// The text in place of the number.
        text: String,
        /// Number of the line, counted from 1.
        line: usize,
    },
    /// The JSON is invalid.
    #[error(
        "the JSON cannot be read: {what}; write it as docs/how-to/add-an-aircraft.md does, without NaN"
    )]
    Json {
        /// Description of the error.
        what: String,
    },
    /// The tool named in the JSON is unknown.
    #[error(
        "the tool '{said}' is not known: name AeroSandbox's method, as \"tool\": \"AeroBuildup\", \"VortexLatticeMethod\" or \"LiftingLine\""
    )]
    Tool {
        /// Name of the tool in the file.
        said: String,
    },
    /// The JSON does not name the tool, and its keys do not identify it.
    #[error(
        "the JSON does not say which method computed it, and its errors depend on it: add \"tool\": \"AeroBuildup\", \"VortexLatticeMethod\" or \"LiftingLine\""
    )]
    NoTool,
    /// The reference area, chord or span is not positive.
    #[error("Sref, Cref and Bref must be positive; check the geometry's reference")]
    Reference,
}

/// Derivatives with respect to one variable: of side force, lift, rolling, pitching and yawing moment, in body axes.
type Column = [f64; 5];

/// A control and its derivatives, 1/rad, in the tool's sign convention.
#[derive(Clone, Debug)]
struct Control {
    name: String,
    column: Column,
}

/// Derivatives from a file, converted to body axes and 1/rad.
struct Derivatives {
    tool: Tool,
    /// Reference area, chord and span, in the file's unit of length.
    reference: [f64; 3],
    /// Moment reference point: x and z in the file's axes. `None` if the file does not state it.
    point: Option<[f64; 2]>,
    /// Angle of attack at which the tool computed the derivatives, rad.
    alpha: f64,
    /// Lift and pitching moment coefficients at this angle of attack.
    totals: [f64; 2],
    by_alpha: Column,
    by_beta: Column,
    by_rates: [Column; 3],
    controls: Vec<Control>,
    /// Assumptions of the reader, one sentence each.
    notes: Vec<String>,
}

impl Derivatives {
    fn read(text: &str, radians: f64) -> Result<Derivatives, DerivativesError> {
        match text {
            _ if is_json(text) => json::read(text, radians),
            _ if xflr5::is_here(text) => xflr5::read(text),
            _ => avl::read(text, radians),
        }
    }
}

fn is_json(text: &str) -> bool {
    text.trim_start().starts_with('{')
}

/// Converts moments about stability axes to moments about body axes. `alpha` is in rad.
fn to_body([side, lift, roll, pitch, yaw]: Column, alpha: f64) -> Column {
    let (sin, cos) = alpha.sin_cos();
    [side, lift, roll * cos - yaw * sin, pitch, roll * sin + yaw * cos]
}

/// Converts derivatives with respect to rates about stability axes to derivatives with respect to rates about body axes.
/// With stability-axis rates p' and r': p' = p cos α + r sin α, r' = r cos α − p sin α.
fn about_body([p, q, r]: [Column; 3], alpha: f64) -> [Column; 3] {
    let (sin, cos) = alpha.sin_cos();
    let both = |a: f64, b: f64| std::array::from_fn(|i| a * p[i] + b * r[i]);
    [both(cos, -sin), q, both(sin, cos)]
}

fn positive(all: [f64; 3]) -> Result<[f64; 3], DerivativesError> {
    if all.iter().all(|x| *x > 0.0) { Ok(all) } else { Err(DerivativesError::Reference) }
}

/// Reference area, chord and span of the `text` of a file, in its unit of length.
///
/// # Errors
/// If the text cannot be parsed, or one of the three is missing or not positive.
pub fn reference(text: &str) -> Result<[f64; 3], DerivativesError> {
    match is_json(text) {
        true => json::reference(text),
        false => Numbers::read(text)?.reference(
            "AVL's commands ST and SB write it; on top of XFLR5's log it is to be added, as Sref = 0.45, Cref = 0.25, \
             Bref = 1.8",
        ),
    }
}

/// Converts `text`, which is the output of AVL or XFLR5, or the results of OptVL or AeroSandbox as JSON. `beside` has the
/// data of the aircraft that the text lacks.
///
/// # Errors
/// If the text cannot be parsed, a required number is missing or not a number, or the tool is unknown.
pub fn read(text: &str, beside: &Beside) -> Result<Read, DerivativesError> {
    let mut found = Derivatives::read(text, beside.radians)?;
    let [area, chord, span] = found.reference;
    let measures = Measures {
        area: area * beside.metres * beside.metres,
        span: span * beside.metres,
        ..beside.measures.clone()
    };
    let mut notes = std::mem::take(&mut found.notes);
    notes.push(
        "drag, inertia and thrust are textbook estimates: the file does not have them".into(),
    );
    notes.push(about(&found));
    let mut values = longitudinal(&found);
    values.extend(lateral(&found));
    values.extend(controls(&found, &measures, &mut notes));
    let warnings = checks::doubtful(found.tool, &measures, &mut values);
    let mut sections = measures.sections();
    for (full, value) in values {
        let Some((effect, name)) = full.split_once('.') else { continue };
        let own = sections.iter_mut().find(|(id, _)| *id == effect);
        let own = own.and_then(|(_, all)| all.iter_mut().find(|e: &&mut Estimate| e.0 == name));
        if let Some(estimate) = own {
            let width = widths::of(found.tool, name).unwrap_or(estimate.2);
            (estimate.1, estimate.2, estimate.3) = (value, width, found.tool.source());
        }
    }
    trimmed(&mut sections, &measures);
    let description = format!("Derivatives by {}; drag and inertia by the textbook.", found.tool);
    Ok(Read {
        tool: found.tool,
        airframe: measures.airframe_with_chord(chord * beside.metres, slope_and_zero(&sections)),
        model: measures.model_of(&sections, &description),
        notes,
        warnings,
    })
}

/// A sentence about the moment reference point.
fn about(d: &Derivatives) -> String {
    match d.point {
        Some([x, z]) => format!(
            "moments are about x = {x:.4}, z = {z:.4} of the file's axes: that must be the centre of gravity as flown, or Cmalpha \
             and Cmq are of another aircraft"
        ),
        None => "the file does not say about which point its moments are: it must be the centre of gravity as flown".into(),
    }
}

/// Full name (`effect.coefficient`) and value of a coefficient.
type Value = (&'static str, f64);

fn longitudinal(d: &Derivatives) -> Vec<Value> {
    let [total_lift, total_pitch] = d.totals;
    let (slope, stiffness) = (d.by_alpha[1], d.by_alpha[3]);
    vec![
        ("lift_linear.CL0", total_lift - slope * d.alpha),
        ("lift_linear.CLalpha", slope),
        ("lift_linear.CLq", d.by_rates[1][1]),
        ("pitch_linear.Cm0", total_pitch - stiffness * d.alpha),
        ("pitch_linear.Cmalpha", stiffness),
        ("pitch_linear.Cmq", d.by_rates[1][3]),
    ]
}

fn lateral(d: &Derivatives) -> Vec<Value> {
    let [p, _, r] = d.by_rates;
    vec![
        ("side_force_linear.CYbeta", d.by_beta[0]),
        ("side_force_linear.CYp", p[0]),
        ("side_force_linear.CYr", r[0]),
        ("roll_linear.Clbeta", d.by_beta[2]),
        ("roll_linear.Clp", p[2]),
        ("roll_linear.Clr", r[2]),
        ("yaw_linear.Cnbeta", d.by_beta[4]),
        ("yaw_linear.Cnp", p[4]),
        ("yaw_linear.Cnr", r[4]),
    ]
}

/// Derivatives with respect to aileron, elevator and rudder, converted to this program's sign convention. A control that
/// the file lacks has no entry, and its coefficients keep their textbook values.
fn controls(d: &Derivatives, measures: &Measures, notes: &mut Vec<String>) -> Vec<Value> {
    let mut out = Vec::new();
    let mut used = Vec::new();
    // for each control: a part of its name, the index of its primary moment in a column, and the sign of this moment for a
    // positive deflection
    for (control, word, place, sign) in
        [("aileron", "ail", 2, 1.0), ("elevator", "elev", 3, -1.0), ("rudder", "rud", 4, -1.0)]
    {
        if control == "rudder" && measures.rudder.is_none() {
            continue;
        }
        let named = d.controls.iter().filter(|c| c.name.to_lowercase().contains(word));
        let Some(Control { name, column }) =
            named.max_by(|a, b| a.column[place].abs().total_cmp(&b.column[place].abs()))
        else {
            notes.push(format!(
                "no control of the file is called {control}: its coefficients are textbook estimates"
            ));
            continue;
        };
        used.push(name.as_str());
        let turn = if column[place] * sign < 0.0 { -1.0 } else { 1.0 };
        if turn < 0.0 {
            notes.push(format!("{name} of the file is reversed in sign: {}", SENSE[place - 2]));
        }
        let [side, lift, roll, pitch, yaw] = column.map(|x| turn * x);
        out.extend(match control {
            "aileron" => vec![
                ("side_force_linear.CYda", side),
                ("roll_linear.Clda", roll),
                ("yaw_linear.Cnda", yaw),
            ],
            "elevator" => vec![("lift_linear.CLde", lift), ("pitch_linear.Cmde", pitch)],
            _ => vec![
                ("rudder_linear.CYdr", side),
                ("rudder_linear.Cldr", roll),
                ("rudder_linear.Cndr", yaw),
            ],
        });
    }
    for control in d.controls.iter().filter(|c| !used.contains(&c.name.as_str())) {
        notes.push(format!("the control {} is left out", control.name));
    }
    out
}

/// Effect of a positive deflection in this program, for messages.
const SENSE: [&str; 3] = [
    "a positive aileron rolls right here",
    "a positive elevator pitches down here",
    "a positive rudder yaws left here",
];

fn value(sections: &[Section], effect: &str, name: &str) -> f64 {
    let own = sections.iter().find(|(id, _)| *id == effect);
    own.and_then(|(_, all)| all.iter().find(|e| e.0 == name)).map_or(0.0, |e| e.1)
}

/// Lift slope (1/rad), and lift coefficient at α = 0.
fn slope_and_zero(sections: &[Section]) -> [f64; 2] {
    [value(sections, "lift_linear", "CLalpha"), value(sections, "lift_linear", "CL0")]
}

/// Recomputes the coefficients of induced drag in `sections` from the lift coefficients there.
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
