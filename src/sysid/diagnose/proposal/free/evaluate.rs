//! Evaluates an expression at all samples of the flights.

use greylag_physics::formula::Variable;
use greylag_physics::formula::expression::{Expression, Function, Node};

/// Values of the expression `of` at `count` samples. `constants` are the values of its parameters. `variable` returns
/// the values of a variable at all samples.
///
/// The values are NaN if a variable is not available, or if the expression has a table or a function that is not supported
/// here, such as a lag.
pub fn evaluate<'a>(
    of: &Expression,
    constants: &[f64],
    count: usize,
    variable: &impl Fn(Variable) -> Option<&'a [f64]>,
) -> Vec<f64> {
    let part = |e: &Expression| evaluate(e, constants, count, variable);
    match &of.node {
        Node::Number(x) => vec![*x; count],
        Node::Parameter(k) => vec![constants.get(*k).copied().unwrap_or(f64::NAN); count],
        Node::Variable(v) => variable(*v).map_or_else(|| vec![f64::NAN; count], <[f64]>::to_vec),
        Node::Power(base, n) => {
            let mut x = part(base);
            x.iter_mut().for_each(|x| *x = x.powi(i32::from(*n)));
            x
        }
        Node::Call(function, all) => match &all[..] {
            [a] => {
                let mut x = part(a);
                x.iter_mut().for_each(|x| *x = unary(*function, *x));
                x
            }
            [a, b] => {
                let (mut x, y) = (part(a), part(b));
                x.iter_mut().zip(y).for_each(|(x, y)| *x = binary(*function, *x, y));
                x
            }
            _ => vec![f64::NAN; count],
        },
        _ => vec![f64::NAN; count],
    }
}

fn unary(function: Function, x: f64) -> f64 {
    match function {
        Function::Negate => -x,
        Function::Abs => x.abs(),
        Function::Exp => x.exp(),
        Function::Sin => x.sin(),
        Function::Cos => x.cos(),
        Function::Tanh => x.tanh(),
        Function::Sqrt => x.sqrt(),
        _ => f64::NAN,
    }
}

fn binary(function: Function, x: f64, y: f64) -> f64 {
    match function {
        Function::Add => x + y,
        Function::Subtract => x - y,
        Function::Multiply => x * y,
        Function::Divide => x / y,
        Function::Min => x.min(y),
        Function::Max => x.max(y),
        // `clamp` panics for a NaN width
        Function::Deadband if y.is_nan() => f64::NAN,
        Function::Deadband => x - x.clamp(-y.abs(), y.abs()),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::formula::parser::parse;

    #[test]
    fn values_are_those_of_mathematics() {
        let (alpha, beta) = ([0.1, -0.2, 0.3], [0.02, 0.05, -0.01]);
        let variable = |v: Variable| match v {
            Variable::Alpha => Some(&alpha[..]),
            Variable::Beta => Some(&beta[..]),
            _ => None,
        };
        let by_hand = |text: &str, of: &dyn Fn(f64, f64) -> f64| {
            let found = evaluate(&parse(text, &["w"]).unwrap(), &[0.15], 3, &variable);
            for (k, x) in found.iter().enumerate() {
                assert!((x - of(alpha[k], beta[k])).abs() < 1e-15, "{text} at {k}: {x}");
            }
        };
        by_hand("tanh(alpha/w)*beta^2", &|a, b| (a / 0.15).tanh() * b * b);
        by_hand("alpha - deadband(alpha, w)", &|a, _| a.clamp(-0.15, 0.15));
        by_hand("max(alpha - w, 0)/(1 + abs(beta)/w)", &|a, b| {
            (a - 0.15).max(0.0) / (1.0 + b.abs() / 0.15)
        });
        by_hand("exp(-(alpha/w)^2) - 1", &|a, _| (-(a / 0.15).powi(2)).exp() - 1.0);
        let unknown = evaluate(&parse("throttle", &[]).unwrap(), &[], 3, &variable);
        assert!(unknown.iter().all(|x| x.is_nan()));
        let wide = parse("deadband(alpha, throttle)", &[]).unwrap();
        assert!(evaluate(&wide, &[], 3, &variable).iter().all(|x| x.is_nan()));
    }
}
