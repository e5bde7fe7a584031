//! The effects of the model with their coefficients, from slopes and polar.

use super::fits::line;
use super::{Polar, Slopes};
use crate::model::textbook::Estimate;
use crate::physics::catalogue::describe;

/// An effect of the model file with its numbers.
pub(super) type Effect = (&'static str, Vec<Estimate>);

const SOURCE: &str = "central difference of JSBSim's loads";

/// Keeps coefficients within what their effects take; what is cut off is said.
fn bounded(effect: &str, estimates: &mut [Estimate], left_out: &mut Vec<String>) {
    let coefficients = describe(effect).map_or(&[][..], |about| about.coefficients);
    for estimate in estimates {
        let Some(own) = coefficients.iter().find(|c| c.name == estimate.0) else { continue };
        let (least, most) = own.bounds;
        let within = estimate.1.clamp(least, most);
        if within != estimate.1 {
            left_out.push(format!(
                "{effect}.{} = {:.4} lies outside of the model's {least} to {most}: {within} is written",
                estimate.0, estimate.1
            ));
            estimate.1 = within;
        }
    }
}

/// The effects of the model with their coefficients.
pub(super) fn effects(polar: &Polar, slopes: &Slopes, left_out: &mut Vec<String>) -> Vec<Effect> {
    let [zero, slope, _] = line(polar);
    let Slopes { base, beta, p, q, r, aileron: a, elevator: e, .. } = slopes;
    let exact = |name, value| -> Estimate { (name, value, 0.02, SOURCE) };
    let lateral = |names: [&'static str; 5], k: usize| -> Vec<Estimate> {
        let values = [base[k], beta[k], p[k], r[k], a[k]];
        names.into_iter().zip(values).map(|(name, value)| exact(name, value)).collect()
    };
    let none = "lift_table stands in its place";
    let mut all = vec![
        (
            "lift_linear",
            vec![
                ("CL0", 0.0, 0.0, none),
                ("CLalpha", 0.0, 0.0, none),
                exact("CLq", q[2]),
                exact("CLde", e[2]),
            ],
        ),
        (
            "drag_beta2",
            vec![exact("CDbeta", slopes.drag_beta[0]), exact("CDbeta2", slopes.drag_beta[1])],
        ),
        ("drag_elevator_abs", vec![exact("CDde", slopes.drag_elevator)]),
        ("side_force_linear", lateral(["CY0", "CYbeta", "CYp", "CYr", "CYda"], 1)),
        ("roll_linear", lateral(["Cl0", "Clbeta", "Clp", "Clr", "Clda"], 3)),
        (
            "pitch_linear",
            vec![
                exact("Cm0", zero),
                exact("Cmalpha", slope),
                exact("Cmq", q[4]),
                exact("Cmde", e[4]),
            ],
        ),
        ("yaw_linear", lateral(["Cn0", "Cnbeta", "Cnp", "Cnr", "Cnda"], 5)),
    ];
    if let Some(d) = &slopes.rudder {
        let numbers = vec![exact("CYdr", d[1]), exact("Cldr", d[3]), exact("Cndr", d[5])];
        all.push(("rudder_linear", numbers));
    }
    all.iter_mut().for_each(|(effect, estimates)| bounded(effect, estimates, left_out));
    all
}
