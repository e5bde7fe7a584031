//! Plausibility checks of stability and control derivatives that an aerodynamic tool has computed. A tool writes zero for a
//! quantity that it did not compute. Such a value is rejected.

use super::{Tool, Value};
use crate::textbook::{Measures, Tail};

/// Smallest −Clp as a fraction of the lift slope. Elliptic wings have 1/8, wings of very small aspect ratio 1/12.
const ROLL_DAMPING: f64 = 0.02;
/// Smallest −Cmq of an aircraft with a tail. Textbook values are 5 and more.
const PITCH_DAMPING: f64 = 1.0;
/// Smallest −Cnr of an aircraft with a tail. A fin alone gives 0.02 and more.
const YAW_DAMPING: f64 = 8e-3;
/// Smallest magnitude of the derivative of a control's primary moment, 1/rad.
const CONTROL: f64 = 5e-3;
/// Range of plausible lift slopes of a whole aircraft, 1/rad.
const SLOPES: std::ops::RangeInclusive<f64> = 1.0..=8.0;

/// Removes from `values` those that `tool` cannot have computed. Returns warnings about these and about implausible values.
pub(super) fn doubtful(tool: Tool, measures: &Measures, values: &mut Vec<Value>) -> Vec<String> {
    let of = |name: &str| values.iter().find(|(full, _)| full.ends_with(name)).map(|(_, x)| *x);
    let slope = of(".CLalpha").unwrap_or(0.0);
    let mut warnings = Vec::new();
    let mut out: Vec<&str> = Vec::new();
    for (control, moment, all) in CONTROLS {
        if of(moment).is_some_and(|x| x.abs() < CONTROL) {
            let name = &moment[1..];
            warnings.push(format!("{name} is 0 in the file: {}", tool.of_controls(control)));
            out.extend(all);
        }
    }
    let damping = |name: &str, least: f64, rates: &[&'static str]| {
        let x = of(name)?;
        (x > -least).then(|| {
            let text = format!(
                "{} = {x:.4} with CLalpha = {slope:.2}: {}; {} are textbook estimates",
                &name[1..],
                tool.of_damping(),
                rates.iter().map(|r| &r[1..]).collect::<Vec<_>>().join(", ")
            );
            (text, rates.to_vec())
        })
    };
    let tailed = measures.tail == Tail::Conventional;
    let [pitch, yaw] = if tailed { [PITCH_DAMPING, YAW_DAMPING] } else { [0.0; 2] };
    for found in [
        damping(".Clp", ROLL_DAMPING * slope, &[".CYp", ".Clp", ".Cnp"]),
        damping(".Cmq", pitch, &[".CLq", ".Cmq"]),
        damping(".Cnr", yaw, &[".CYr", ".Clr", ".Cnr"]),
    ]
    .into_iter()
    .flatten()
    {
        warnings.push(found.0);
        out.extend(found.1);
    }
    odd(&of, slope, &mut warnings);
    values.retain(|(full, _)| !out.iter().any(|name| full.ends_with(name)));
    warnings
}

/// The controls. Each has the name of the derivative of its primary moment, and the names of all its derivatives.
const CONTROLS: [(&str, &str, &[&str]); 3] = [
    ("aileron", ".Clda", &[".CYda", ".Clda", ".Cnda"]),
    ("elevator", ".Cmde", &[".CLde", ".Cmde"]),
    ("rudder", ".Cndr", &[".CYdr", ".Cldr", ".Cndr"]),
];

/// Appends warnings about values that are implausible but kept.
fn odd(of: &dyn Fn(&str) -> Option<f64>, slope: f64, warnings: &mut Vec<String>) {
    if !SLOPES.contains(&slope) {
        warnings.push(format!(
            "CLalpha = {slope:.3} by a radian is of no whole aircraft: see that alpha is in degrees there and the reference \
             area is the wing's"
        ));
    }
    if let Some(x) = of(".Cmalpha").filter(|x| *x >= 0.0) {
        warnings.push(format!(
            "Cmalpha = {x:.3} makes the aircraft unstable: see that moments are about the centre of gravity"
        ));
    }
    if let Some(x) = of(".Cnbeta").filter(|x| *x <= 0.0) {
        warnings.push(format!(
            "Cnbeta = {x:.4} turns the nose away from the wind: see that the fin is in the geometry and sideslip is positive \
             with wind from the right"
        ));
    }
}
