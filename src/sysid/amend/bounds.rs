//! Advice on coefficients of the model itself whose fit ended at a bound of the physically possible range.

use super::parameters;
use super::result::Parameter;
use greylag_model::GreyBox;

/// What a bound at which a fit ended calls for.
enum Cure {
    /// The bound is zero: the estimate has the sign that the coefficient does not have.
    Zero,
    /// The bound has the sign that the coefficient hardly has on an aircraft.
    WrongSign,
    /// A bound farther away may be allowed. The text is an argument of the option `--bound`.
    Lift(String),
}

/// Advice, in words, on the coefficients of `model` itself whose fitted value is at a bound.
pub fn at_bounds(model: &GreyBox, parameters: &[Parameter]) -> Vec<String> {
    let ended = parameters.iter().filter(|p| p.at_bound && !p.added);
    let one = |p: &Parameter| {
        let (bound, cure) = cure(model, &p.name, p.value)?;
        let advice = match cure {
            Cure::Zero => format!(
                "the flights give the opposite sign or do not determine it apart from other coefficients; {}, or hold {} by a \
                 smaller sd in the model file",
                remedy(&p.name),
                p.name
            ),
            Cure::WrongSign => "a sign that it hardly has on an aircraft. The data are wrong or do not determine it apart from \
                                other coefficients; check signs and units of the logs' columns"
                .into(),
            Cure::Lift(range) => format!(
                "the others make up for what it lacks, and it has no interval; `greylag amend --bound {range}` lifts it"
            ),
        };
        Some(format!("{} ends at its bound {bound}: {advice}", p.name))
    };
    ended.filter_map(one).collect()
}

/// What to do about the coefficient `name` that ended at zero. Only a control derivative depends on the sign of a control.
fn remedy(name: &str) -> String {
    let (id, short) = name.split_once('.').unwrap_or(("", name));
    if ["de", "da", "dr", "throttle"].into_iter().any(|control| short.ends_with(control)) {
        return "check the sign of that control in the mapping".into();
    }
    let stated = parameters::describe(id).and_then(|(about, _)| about.entry);
    let motion = match stated.map_or("", |entry| entry.separated_by) {
        "" if short == "CD0" => "glides and level flight at several airspeeds",
        "" if short.ends_with('q') => "elevator doublets",
        "" if short.ends_with('p') => "aileron doublets",
        "" if short.ends_with('r') => "rudder doublets, or turns to both sides",
        "" => "manoeuvres that move each input and the angles of attack and sideslip, one by one",
        stated => stated,
    };
    format!("fly {motion}")
}

/// The argument of the option `--bound` that lifts the bound at which the coefficient `name` of `model` ended with `value`. `None`
/// if the bound should not be lifted, because it separates the usual sign from the other one, or there is no such coefficient.
pub fn lifted(model: &GreyBox, name: &str, value: f64) -> Option<String> {
    match cure(model, name, value)? {
        (_, Cure::Lift(range)) => Some(range),
        _ => None,
    }
}

/// The bound of the coefficient `name` that is nearest to `value`, and what it calls for. Only this bound is lifted, by a factor
/// of two.
fn cure(model: &GreyBox, name: &str, value: f64) -> Option<(f64, Cure)> {
    let (low, high) = model.bounds_of(name)?;
    let above = (value - high).abs() < (value - low).abs();
    let bound = if above { high } else { low };
    let (id, short) = name.split_once('.')?;
    let (about, _) = parameters::describe(id)?;
    let (least, most) = model.size().bounds(about.coefficients.iter().find(|k| k.name == short)?);
    // the usual sign is that of the side on which the catalogue leaves more room
    let cure = match bound {
        0.0 => Cure::Zero,
        _ if bound * (least + most) < 0.0 => Cure::WrongSign,
        _ => {
            let outward = above == (bound > 0.0);
            let far = if outward { 2.0 * bound } else { 0.5 * bound };
            let [from, to] = if above { [low, far] } else { [far, high] };
            Cure::Lift(format!("{name}={from}..{to}"))
        }
    };
    Some((bound, cure))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn the_sign_of_a_control_is_blamed_for_control_derivatives_alone() {
        for name in ["pitch_linear.Cmde", "roll_linear.Clda", "rudder_linear.Cndr"] {
            assert!(remedy(name).contains("sign of that control"), "{name}");
        }
        assert_eq!(remedy("pitch_linear.Cmq"), "fly elevator doublets");
        assert_eq!(remedy("roll_linear.Clp"), "fly aileron doublets");
        assert_eq!(remedy("drag_linear.CD0"), "fly glides and level flight at several airspeeds");
        assert!(remedy("drag_beta2.CDbeta2").contains("skids"));
        assert!(remedy("lift_linear.CLalpha").contains("angles of attack"));
    }

    #[test]
    fn only_the_side_at_which_a_fit_ended_is_lifted_and_no_sign_is_allowed_that_is_not_physical() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
        let mut model = GreyBox::load(&path).unwrap();
        // the value need not be the bound to the bit
        let lift = lifted(&model, "drag_linear.CD0", 0.499_999_999);
        assert_eq!(lift.as_deref(), Some("drag_linear.CD0=0..1"));
        let lift = lifted(&model, "drag_linear.CDalpha", -1.0);
        assert_eq!(lift.as_deref(), Some("drag_linear.CDalpha=-2..1"));
        assert_eq!(lifted(&model, "drag_linear.CD0", 0.0), None);
        assert_eq!(lifted(&model, "side_force_linear.CYbeta", 0.5), None);
        let lift = lifted(&model, "side_force_linear.CYbeta", -2.0);
        assert_eq!(lift.as_deref(), Some("side_force_linear.CYbeta=-4..0.5"));
        // the user's own bounds
        assert!(model.set_bounds("roll_linear.Clp", [-0.5, -0.25]));
        let lift = lifted(&model, "roll_linear.Clp", -0.25);
        assert_eq!(lift.as_deref(), Some("roll_linear.Clp=-0.5..-0.125"));
        assert_eq!(lifted(&model, "roll_linear.Clx", 1.0), None);
    }
}
