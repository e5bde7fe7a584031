//! Trend of a formula with each of its variables (monotonic or not, odd or even), determined by sampling. The formula without
//! its coefficients is called shape.

use super::evaluate::evaluate;
use super::grammar::positive;
use greylag_physics::formula::Variable;
use greylag_physics::formula::expression::Expression;
use greylag_physics::formula::parser;

/// Values of a variable at which a shape is sampled, as fractions of the variable's typical range in flight.
const ALONG: [f64; 8] = [0.02, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 1.0];
/// Constant values of the other variables, as fractions of their typical ranges.
const BESIDE: [f64; 3] = [0.9, 0.37, 0.71];
/// Fraction of a variable's possible range that flights typically cover.
const FLOWN: f64 = 0.3;
/// Differences below this fraction of the largest value count as rounding errors.
const ROUNDING: f64 = 1e-9;

/// Text about the trend of `shape` with each of its variables. Equal trends have equal texts. `None` if `shape` is not a
/// formula.
///
/// A body rate and the same rate divided by the airspeed count as one variable.
pub fn trend(shape: &str) -> Option<String> {
    let expression = parser::parse(shape, &[]).ok()?;
    let variables = expression.variables();
    let mut all: Vec<String> =
        variables.iter().map(|v| along(&expression, &variables, *v)).collect();
    all.sort();
    Some(all.join(" "))
}

/// Name of a variable. A body rate and the same rate divided by the airspeed have one name.
pub fn plain(v: Variable) -> &'static str {
    match v {
        Variable::RollRateHat => "p",
        Variable::PitchRateHat => "q",
        Variable::YawRateHat => "r",
        v => v.name(),
    }
}

/// Typical largest value of the variable in flight. A positive variable may reach its largest possible value. Other
/// variables reach `FLOWN` times their largest possible value.
fn reach(v: Variable) -> f64 {
    if positive(v) { v.range()[1] } else { FLOWN * v.range()[1] }
}

/// Text about the trend with variable `v`, while the other variables are constant.
fn along(expression: &Expression, variables: &[Variable], v: Variable) -> String {
    let values = |sign: f64| {
        let columns: Vec<(Variable, Vec<f64>)> = variables
            .iter()
            .enumerate()
            .map(|(k, w)| match *w == v {
                true => (v, ALONG.iter().map(|share| sign * share * reach(v)).collect()),
                false => (*w, vec![BESIDE[k % BESIDE.len()] * reach(*w); ALONG.len()]),
            })
            .collect();
        evaluate(expression, &[], ALONG.len(), &|w| {
            columns.iter().find(|(x, _)| *x == w).map(|(_, c)| &c[..])
        })
    };
    let up = values(1.0);
    let size = up.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
    if positive(v) {
        return format!("{} {}", if runs(&up, size) { "runs" } else { "turns" }, plain(v));
    }
    let down = values(-1.0);
    let size = down.iter().fold(size, |a, x| a.max(x.abs()));
    let pairs = || up.iter().zip(&down);
    let near = |x: f64| x.abs() <= ROUNDING * size;
    let parity = if pairs().all(|(a, b)| near(a + b)) {
        "odd"
    } else if pairs().all(|(a, b)| near(a - b)) {
        "even"
    } else if down.iter().all(|x| near(*x)) || up.iter().all(|x| near(*x)) {
        "one-sided"
    } else {
        "neither"
    };
    let turns = if runs(&up, size) && runs(&down, size) { "" } else { "turning " };
    format!("{turns}{parity} {}", plain(v))
}

/// Whether `values` are monotonic, within rounding errors relative to `size`.
fn runs(values: &[f64], size: f64) -> bool {
    let steps = || values.windows(2).map(|w| w[1] - w[0]);
    let least = ROUNDING * size;
    steps().all(|d| d >= -least) || steps().all(|d| d <= least)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trends_are_told_apart() {
        let of = |text: &str| trend(text).unwrap();
        assert_eq!(of("alpha"), of("alpha*abs(alpha)"));
        assert_eq!(of("tanh(alpha/0.05)"), of("deadband(alpha, 0.05)"));
        assert_eq!(of("abs(beta)"), of("beta^2"));
        assert_eq!(of("p_hat*throttle"), of("throttle*p"));
        assert_eq!(of("throttle"), of("throttle^2"));
        assert_eq!(of("alpha*abs(beta)"), "even beta odd alpha");
        assert_eq!(of("max(alpha - 0.05, 0)"), "one-sided alpha");
        assert_eq!(of("exp(alpha/0.1) - 1"), "neither alpha");
        assert_eq!(of("exp(-(alpha/0.1)^2)"), "even alpha");
        assert_eq!(of("throttle*(1 - throttle)"), "turns throttle");
        assert_ne!(of("alpha*beta"), of("alpha*beta^2"));
        assert_eq!(trend("no formula"), None);
    }
}
