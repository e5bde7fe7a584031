//! The aerodynamics section of an exported JSBSim aircraft. Each axis has one function.

use std::fmt::Write;

use super::conditions::Conditions;
use super::{AILERON, ALPHA, BETA, ELEVATOR, RUDDER, coefficient, engine, product};
use crate::GreyBox;
use greylag_num::Table;

/// A coefficient: its name, its axis, and the properties by which it is multiplied. The factor q S, and b or c for a moment,
/// is common to the axis and not listed.
type Factor = (&'static str, &'static str, &'static [&'static str]);

const P: [&str; 2] = ["aero/bi2vel", "velocities/p-aero-rad_sec"];
const Q: [&str; 2] = ["aero/ci2vel", "velocities/q-aero-rad_sec"];
const R: [&str; 2] = ["aero/bi2vel", "velocities/r-aero-rad_sec"];

/// The coefficients whose terms are exported as products of JSBSim properties.
const FACTORS: &[Factor] = &[
    ("lift_linear.CL0", "LIFT", &[]),
    ("lift_linear.CLalpha", "LIFT", &[ALPHA]),
    ("lift_linear.CLq", "LIFT", &Q),
    ("lift_linear.CLde", "LIFT", &[ELEVATOR]),
    ("drag_linear.CD0", "DRAG", &[]),
    ("drag_linear.CDalpha", "DRAG", &[ALPHA]),
    ("drag_linear.CDq", "DRAG", &Q),
    ("drag_linear.CDde", "DRAG", &[ELEVATOR]),
    ("drag_alpha2.CDalpha2", "DRAG", &[ALPHA, ALPHA]),
    ("drag_beta2.CDbeta", "DRAG", &["aero/mag-beta-rad"]),
    ("drag_beta2.CDbeta2", "DRAG", &[BETA, BETA]),
    ("drag_elevator_abs.CDde", "DRAG", &["fcs/mag-elevator-pos-rad"]),
    ("side_force_linear.CY0", "SIDE", &[]),
    ("side_force_linear.CYbeta", "SIDE", &[BETA]),
    ("side_force_linear.CYp", "SIDE", &P),
    ("side_force_linear.CYr", "SIDE", &R),
    ("side_force_linear.CYda", "SIDE", &[AILERON]),
    ("rudder_linear.CYdr", "SIDE", &[RUDDER]),
    ("roll_linear.Cl0", "ROLL", &[]),
    ("roll_linear.Clbeta", "ROLL", &[BETA]),
    ("roll_linear.Clp", "ROLL", &P),
    ("roll_linear.Clr", "ROLL", &R),
    ("roll_linear.Clda", "ROLL", &[AILERON]),
    ("rudder_linear.Cldr", "ROLL", &[RUDDER]),
    ("pitch_linear.Cm0", "PITCH", &[]),
    ("pitch_linear.Cmalpha", "PITCH", &[ALPHA]),
    ("pitch_linear.Cmq", "PITCH", &Q),
    ("pitch_linear.Cmde", "PITCH", &[ELEVATOR]),
    ("yaw_linear.Cn0", "YAW", &[]),
    ("yaw_linear.Cnbeta", "YAW", &[BETA]),
    ("yaw_linear.Cnp", "YAW", &P),
    ("yaw_linear.Cnr", "YAW", &R),
    ("yaw_linear.Cnda", "YAW", &[AILERON]),
    ("rudder_linear.Cndr", "YAW", &[RUDDER]),
];

/// Effects that are exported as tables over the angle of attack, each with its axis.
const TABLES: &[(&str, &str)] =
    &[("lift_table", "LIFT"), ("drag_table", "DRAG"), ("pitch_table", "PITCH")];

/// Whether the exported aerodynamics contain the coefficient `name`.
pub(super) fn knows(name: &str) -> bool {
    FACTORS.iter().any(|(factor, ..)| *factor == name)
        || TABLES.iter().any(|(table, _)| name.strip_suffix(".k") == Some(table))
}

/// The text of the section for all conditions, such as flap settings.
pub(super) fn section(conditions: &Conditions) -> String {
    let mut out = "  <aerodynamics>\n".to_owned();
    for (axis, length) in [
        ("DRAG", ""),
        ("SIDE", ""),
        ("LIFT", ""),
        ("ROLL", "metrics/bw-ft"),
        ("PITCH", "metrics/cbarw-ft"),
        ("YAW", "metrics/bw-ft"),
    ] {
        let sum = conditions.weighted(|model| terms(model, axis));
        let length = if length.is_empty() {
            String::new()
        } else {
            format!("          <property>{length}</property>\n")
        };
        let torque =
            if axis == "ROLL" { engine::torque(conditions.first()) } else { String::new() };
        let lower = axis.to_lowercase();
        let _ = write!(
            out,
            "    <axis name=\"{axis}\">\n      <function name=\"aero/{lower}\">\n        <product>\n          \
             <property>aero/qbar-psf</property>\n          <property>metrics/Sw-sqft</property>\n{length}          <sum>\n            \
             <value>0.0</value>\n{sum}          </sum>\n        </product>\n      </function>\n{torque}    </axis>\n"
        );
    }
    out.push_str("  </aerodynamics>\n");
    out
}

/// The terms of `model` on one axis, as XML elements of a sum.
fn terms(model: &GreyBox, axis: &str) -> String {
    let products = FACTORS
        .iter()
        .filter(|(_, of, _)| *of == axis)
        .map(|(name, _, factors)| (coefficient(model, name), factors))
        .filter(|(value, _)| *value != 0.0)
        .map(|(value, factors)| product(value, factors, "            "));
    let tables = model
        .tables()
        .filter(|(id, _)| TABLES.contains(&(*id, axis)))
        .map(|(id, table)| tabulated(table, coefficient(model, &format!("{id}.k"))));
    products.chain(tables).collect()
}

fn tabulated(table: &Table, factor: f64) -> String {
    let rows: String = table
        .points()
        .into_iter()
        .map(|(x, y)| format!("                {x:?} {:?}\n", factor * y))
        .collect();
    format!(
        "            <table>\n              <independentVar lookup=\"row\">{ALPHA}</independentVar>\n              <tableData>\n{rows}              \
         </tableData>\n            </table>\n"
    )
}
