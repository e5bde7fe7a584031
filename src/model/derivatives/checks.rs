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
/// Smallest distance of an elevator's lift behind the centre of gravity, in chords, of an aircraft with a tail. Tails have 2 and
/// more, elevons less than 1.
const TAIL_ARM: f64 = 1.0;
/// Range of plausible lift slopes of a whole aircraft, 1/rad.
const SLOPES: std::ops::RangeInclusive<f64> = 1.0..=8.0;

/// Removes from `values` those that `tool` cannot have computed. Returns warnings about these and about implausible values.
pub(super) fn doubtful(tool: Tool, measures: &Measures, values: &mut Vec<Value>) -> Vec<String> {
    let of = |name: &str| named(values, name);
    let slope = of(".CLalpha").unwrap_or(0.0);
    let mut warnings = Vec::new();
    let mut out: Vec<&str> = Vec::new();
    for (control, moment, all) in CONTROLS {
        let Some(x) = of(moment) else { continue };
        let name = &moment[1..];
        if moment == ".Cmde" && measures.tail == Tail::FlyingWing && !tool.has_flap_moment() {
            warnings.push(format!("{name} = {x:.4} is not used: {}", tool.of_elevons()));
            out.extend(all);
        } else if x.abs() < CONTROL {
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
    values.retain(|(full, _)| !out.iter().any(|name| full.ends_with(name)));
    let of = |name: &str| named(values, name);
    odd(&of, slope, &mut warnings);
    misplaced(&of, measures.tail, &mut warnings);
    warnings
}

/// The value whose full name ends with `name`.
fn named(values: &[Value], name: &str) -> Option<f64> {
    values.iter().find(|(full, _)| full.ends_with(name)).map(|(_, x)| *x)
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

/// Appends warnings about controls whose force and moment contradict each other. The reader of the file turns each control until
/// its primary moment has this program's sign, so that a wrong sign of Cmde or Cndr shows in CLde or CYdr. The aileron has no
/// such force.
fn misplaced(of: &dyn Fn(&str) -> Option<f64>, tail: Tail, warnings: &mut Vec<String>) {
    if let Some((lift, moment)) = of(".CLde").zip(of(".Cmde")) {
        let least = if tail == Tail::Conventional { TAIL_ARM } else { 0.0 };
        if lift < 0.0 {
            warnings.push(format!(
                "CLde = {lift:.3} and Cmde = {moment:.3} have the same sign: unless it is a canard, an elevator that pitches the \
                 nose down adds lift; see the signs of CL and Cm in the file"
            ));
        } else if moment > -least * lift {
            warnings.push(format!(
                "Cmde = {moment:.3} with CLde = {lift:.3} is of an elevator less than a chord behind the centre of gravity: give \
                 --tail flying-wing if it is an elevon, else see the reference chord and point"
            ));
        }
    }
    if let Some((side, moment)) = of(".CYdr").zip(of(".Cndr")).filter(|(side, _)| *side < 0.0) {
        warnings.push(format!(
            "CYdr = {side:.3} and Cndr = {moment:.4} have the same sign: a rudder behind the centre of gravity that yaws the nose \
             left pushes to the right; see the signs of CY and Cn in the file"
        ));
    }
}
