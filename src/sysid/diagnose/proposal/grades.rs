//! Which properties of a form the flights determine, and the description of a form in words.
//!
//! A form is a formula that may describe an unknown effect: a channel (force or moment) as a function of one or more variables.

use super::free::{self, trend::plain};
use super::library::{Form, Shape};
use super::result::Grades;
use greylag_physics::Channel;
use greylag_physics::formula::Variable;

/// Trend of a form in each of its variables (even or odd, rising or falling), in words.
fn trend(form: &Form) -> Option<String> {
    // in the steady state, a lagged control equals the control itself
    let shape = match form.shape {
        Shape::Lagged(v, _) => Shape::Linear(v),
        shape => shape,
    };
    free::trend::trend(&shape.text(None))
}

/// Determines which properties of `best` are certain: those that all forms of `alike` have too. `alike` are the forms that the
/// flights cannot distinguish from `best`.
pub fn grades(best: &Form, alike: &[Form]) -> Grades {
    let same = |of: &dyn Fn(&Form) -> bool| alike.iter().all(of);
    let variables = sorted(best);
    Grades {
        channel: same(&|f| f.channel == best.channel),
        variables: same(&|f| sorted(f) == variables),
        trend: same(&|f| trend(f) == trend(best)),
        form: alike.is_empty(),
    }
}

/// Names of the form's variables, sorted. A body rate and the same rate divided by the airspeed have one name.
fn sorted(form: &Form) -> Vec<&'static str> {
    let mut all: Vec<&str> = form.shape.variables().into_iter().map(plain).collect();
    all.sort_unstable();
    all
}

/// The physical quantity of a channel, in words.
pub fn amount(channel: Channel) -> &'static str {
    match channel {
        Channel::Drag => "drag",
        Channel::Lift => "lift",
        Channel::Side => "side force",
        Channel::BodyX => "thrust",
        Channel::Roll => "rolling moment",
        Channel::Pitch => "pitching moment",
        Channel::Yaw => "yawing moment",
    }
}

fn long(v: Variable) -> &'static str {
    match v {
        Variable::Alpha => "angle of attack",
        Variable::Beta => "sideslip",
        Variable::RollRate | Variable::RollRateHat => "roll rate",
        Variable::PitchRate | Variable::PitchRateHat => "pitch rate",
        Variable::YawRate | Variable::YawRateHat => "yaw rate",
        v => v.name(),
    }
}

/// Describes in words how the form's channel depends on its variables. The sign of the coefficient `value` decides between
/// growth and decrease.
pub fn words(form: &Form, value: f64) -> String {
    let runs = if value < 0.0 { "falls" } else { "grows" };
    let how = match form.shape {
        Shape::Linear(v) => format!("linearly with {}", long(v)),
        Shape::Magnitude(v) => format!("with the magnitude of {}", long(v)),
        Shape::Square(v) => format!("with the square of {}", long(v)),
        Shape::SignedSquare(v) => format!("with the square of {}, with its sign", long(v)),
        Shape::Product(v, w) => format!("with the product of {} and {}", long(v), long(w)),
        Shape::ByMagnitude(v, w) => format!("with {} times the magnitude of {}", long(v), long(w)),
        Shape::Above(v, c) => format!("with {} above {c}", long(v)),
        Shape::Beyond(v, c) => format!("with {} beyond ±{c}", long(v)),
        Shape::Lagged(v, tau) => {
            format!("linearly with {} through a lag of {tau} s", long(v))
        }
        Shape::Free(free) => format!("with {}", free.text(None)),
    };
    let pressure = match form.of_air {
        true => ", in proportion to dynamic pressure",
        false if form.shape.variables().contains(&Variable::Airspeed) => "",
        false => ", not with airspeed",
    };
    format!("{} {runs} {how}{pressure}", amount(form.channel))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn form(of_air: bool, shape: Shape) -> Form {
        Form { channel: Channel::Yaw, of_air, shape }
    }

    #[test]
    fn only_what_all_alike_share_is_sure() {
        let best = form(false, Shape::Linear(Variable::Throttle));
        let alone = grades(&best, &[]);
        assert!(alone.form && alone.trend && alone.variables && alone.channel);
        let square = grades(&best, &[form(false, Shape::Square(Variable::Throttle))]);
        assert!(!square.form && square.trend && square.variables);
        let [v, w] = [Variable::Throttle, Variable::Beta];
        let turned = [form(true, Shape::Product(v, w)), form(true, Shape::Product(w, v))];
        assert!(grades(&turned[0], &turned[1..]).trend);
        let other = grades(&best, &[form(true, Shape::Linear(Variable::Beta))]);
        assert!(!other.trend && !other.variables && other.channel);
        assert_eq!(
            words(&best, 0.53),
            "yawing moment grows linearly with throttle, not with airspeed"
        );
    }
}
