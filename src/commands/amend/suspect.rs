//! Fitted coefficients that no flyable aircraft has: a control without effect, and an absurd thrust.

use crate::model::GreyBox;
use crate::physics::atmosphere::STANDARD_GRAVITY;
use crate::sysid::amend::{Amendment, Parameter};

/// Effects of the controls, each with the name of the control.
const CONTROLS: [(&str, &str); 3] = [
    ("pitch_linear.Cmde", "elevator"),
    ("roll_linear.Clda", "aileron"),
    ("rudder_linear.Cndr", "rudder"),
];
/// Magnitude of a control derivative below which the control has no effect.
const NO_EFFECT: f64 = 1e-6;
/// Thrust as a multiple of the weight above which it is absurd.
const WEIGHTS: f64 = 5.0;

/// Notes on such coefficients of `story`; `model` has the mass. Empty if there are none.
pub fn notes(story: &Amendment, model: &GreyBox) -> Vec<String> {
    let fitted = &story.parameters;
    let weight = model.body.mass * STANDARD_GRAVITY;
    let given = model.coefficients();
    let given = |name: &str| given.iter().find(|c| c.name == name).map_or(0.0, |c| c.value);
    without_effect(fitted).into_iter().chain(absurd_thrust(fitted, given, weight)).collect()
}

/// Note on controls whose effect ended at zero; `None` if every control has an effect.
pub fn without_effect(fitted: &[Parameter]) -> Option<String> {
    let dead = |(name, control): &(&str, &str)| {
        let zero = fitted.iter().any(|p| p.name == *name && p.value.abs() < NO_EFFECT);
        zero.then(|| format!("{name} ({control})"))
    };
    let dead: Vec<String> = CONTROLS.iter().filter_map(dead).collect();
    (!dead.is_empty()).then(|| {
        format!(
            "problem: The model cannot be flown: {} ended at zero, so the control has no effect. Check the order and the signs of the \
             commands in the log.",
            dead.join(" and ")
        )
    })
}

/// Note on a thrust far above `weight` (N). `given` is the value of a coefficient that was not fitted.
fn absurd_thrust(fitted: &[Parameter], given: impl Fn(&str) -> f64, weight: f64) -> Option<String> {
    if !fitted.iter().any(|p| p.name.starts_with("propeller.")) {
        return None;
    }
    let of = |name: &str| {
        fitted.iter().find(|p| p.name == name).map_or_else(|| given(name), |p| p.value)
    };
    let [idle, slope, curvature] = ["propeller.T0_n", "propeller.Tt_n", "propeller.Ttt_n"].map(of);
    let at_rest = [("at full throttle", idle + slope + curvature), ("without throttle", idle)];
    let (throttle, thrust) = at_rest.into_iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let ratio = thrust.abs() / weight;
    (ratio > WEIGHTS).then(|| {
        format!(
            "warning: The fitted thrust is absurd: at rest {throttle} it is {thrust:.0} N, {ratio:.0} times the weight. Fly throttle \
             steps at two airspeeds."
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fitted(name: &str, value: f64) -> Parameter {
        Parameter {
            name: name.into(),
            meaning: "",
            added: false,
            prior: 0.0,
            prior_sd: 1.0,
            value,
            sd: 0.1,
            ci95: [value - 0.2, value + 0.2],
            at_bound: false,
            by_flight: Vec::new(),
            same_as: None,
        }
    }

    #[test]
    fn a_control_at_zero_has_no_effect() {
        let dead = [fitted("pitch_linear.Cmde", 0.0), fitted("roll_linear.Clda", -0.0)];
        let said = without_effect(&dead).unwrap();
        assert!(said.contains("Cmde (elevator) and roll_linear.Clda (aileron)"), "{said}");
        assert_eq!(without_effect(&[fitted("pitch_linear.Cmde", -0.9)]), None);
        assert_eq!(without_effect(&[fitted("roll_linear.Cl0", 0.0)]), None);
    }

    #[test]
    fn a_thrust_of_many_times_the_weight_is_absurd() {
        let weight = 3.4 * STANDARD_GRAVITY;
        let none = |_: &str| 0.0;
        let said = absurd_thrust(&[fitted("propeller.T0_n", 4477.0)], none, weight).unwrap();
        assert!(said.contains("without throttle it is 4477 N, 134 times the weight"), "{said}");
        // slope and curvature make up for each other
        let usual = [fitted("propeller.Tt_n", 400.0), fitted("propeller.Ttt_n", -360.0)];
        assert_eq!(absurd_thrust(&usual, none, weight), None);
        let held = |name: &str| if name == "propeller.Ttt_n" { -360.0 } else { 0.0 };
        assert_eq!(absurd_thrust(&usual[..1], held, weight), None);
        assert!(absurd_thrust(&usual[..1], none, weight).is_some());
        assert_eq!(absurd_thrust(&[], |_| 1e6, weight), None);
    }
}
