//! The effects of a model that is imported from JSBSim. An effect is one physical contribution to the forces and moments. Its
//! coefficients follow from differences of the forces and moments that JSBSim computes.

use super::fits::line;
use super::propeller::Propeller;
use super::{Beside, Polar, Slopes};
use greylag_model::textbook::Estimate;
use greylag_physics::catalogue::describe;
use greylag_physics::size::Size;

/// The id of an effect, and its coefficients.
pub(super) type Effect = (&'static str, Vec<Estimate>);

const SOURCE: &str = "central difference of JSBSim's loads";

/// Limits the coefficients of an effect to the range that is plausible for an aircraft of `size`. A text on each changed
/// coefficient is added to `left_out`.
fn bounded(effect: &str, estimates: &mut [Estimate], size: &Size, left_out: &mut Vec<String>) {
    let coefficients = describe(effect).map_or(&[][..], |about| about.coefficients);
    for estimate in estimates {
        let Some(own) = coefficients.iter().find(|c| c.name == estimate.0) else { continue };
        let (least, most) = size.bounds(own);
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

/// All effects of the model, with their coefficients from the polar, the derivatives `slopes` and the further effects `beside`.
pub(super) fn effects(
    polar: &Polar,
    slopes: &Slopes,
    beside: &Beside,
    size: &Size,
    left_out: &mut Vec<String>,
) -> Vec<Effect> {
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
    beside.put(&mut all);
    all.iter_mut().for_each(|(effect, estimates)| bounded(effect, estimates, size, left_out));
    all
}

/// Derivatives of lift and pitching moment coefficient with respect to α̇c/2V count as zero below this magnitude.
const NO_RATE: f64 = 1e-3;

impl Beside {
    /// Adds these effects to `all`. They take over a part of some linear coefficients, which are reduced to the remaining part.
    fn put(&self, all: &mut Vec<Effect>) {
        let [lift, pitch] = [self.alpha_rate[2], self.alpha_rate[4]];
        if lift.abs() > NO_RATE || pitch.abs() > NO_RATE {
            let source = "difference of JSBSim's loads between two attitudes";
            let numbers =
                vec![("CLalphadot", lift, 0.02, source), ("Cmalphadot", pitch, 0.02, source)];
            all.push(("unsteady_lift", numbers));
        }
        self.propeller.put(all);
        let source = "central differences of JSBSim's loads at two incidences";
        if let Some(found) = self.aileron {
            set(all, "roll_linear", "Clda", found.without[0]);
            set(all, "yaw_linear", "Cnda", found.without[1]);
            let names = ["Clalphada", "Cnalphada"].into_iter().zip(found.by_incidence);
            let numbers = names.map(|(name, value)| (name, value, 0.05, source)).collect();
            all.push(("roll_control_alpha", numbers));
        }
        if let Some(found) = &self.with_lift {
            let linear = [
                ("roll_linear", "Clr"),
                ("roll_linear", "Clbeta"),
                ("yaw_linear", "Cnp"),
                ("yaw_linear", "Cnbeta"),
            ];
            for ((effect, name), value) in linear.into_iter().zip(found.without) {
                set(all, effect, name, value);
            }
            let names = ["Clr_CL", "Clbeta_CL", "Cnp_CL", "Cnbeta_CL"];
            let numbers = names.into_iter().zip(found.by_lift);
            let numbers = numbers.map(|(name, value)| (name, value, 0.05, source)).collect();
            all.push(("lateral_with_lift", numbers));
        }
    }
}

impl Propeller {
    fn put(&self, all: &mut Vec<Effect>) {
        let surfaces = [
            (self.elevator, "pitch_linear", "Cmde", "Cmde_T"),
            (self.rudder, "rudder_linear", "Cndr", "Cndr_T"),
        ];
        let powered = "central difference of JSBSim's loads at three throttles";
        let mut slipstream = Vec::new();
        for (found, linear, own, name) in surfaces {
            if let Some([still, _]) = found {
                set(all, linear, own, still);
            }
            slipstream.push((name, found.map_or(0.0, |[_, by_thrust]| by_thrust), 0.05, powered));
        }
        if surfaces.iter().any(|(found, ..)| found.is_some()) {
            all.push(("tail_slipstream", slipstream));
        }
        if let Some([still, full]) = self.gyro {
            let source = "least squares over JSBSim's moments of the engines by yaw rate";
            all.push(("propeller_gyro", vec![("h_nms", still, 0.1, source)]));
            all.push(("propeller_gyro_throttle", vec![("h_nms", full, 0.1, source)]));
        }
        let source = "least squares over JSBSim's yawing moment of the engines";
        if let Some(y) = self.sideways {
            all.push(("thrust_line_sideways", vec![("y_m", y, 0.1, source)]));
        }
        if let Some(k) = self.p_factor {
            all.push(("p_factor", vec![("k", k, 0.1, source)]));
        }
    }
}

/// Sets the coefficient `name` of `effect` in `all` to `value`.
fn set(all: &mut [Effect], effect: &str, name: &str, value: f64) {
    let own = all.iter_mut().filter(|(id, _)| *id == effect).flat_map(|(_, numbers)| numbers);
    own.filter(|number| number.0 == name).for_each(|number| number.1 = value);
}
