//! Splits the formula of an effect into the factor of each parameter in which it is linear. `k*alpha*beta + m*p` is thus split
//! into `alpha*beta` for k and `p` for m. Parameters in which a formula is linear are the coefficients of the effect.

use super::expression::{Expression, Function, Node};
use super::parser::Fault;

/// The index of each parameter in which a formula is linear, with the expression that the parameter multiplies.
pub type Parts = Vec<(usize, Expression)>;

/// For each of `count` parameters, whether it counts as linear in all of `formulas`.
///
/// A parameter within a function, a denominator or a power other than 1 does not count as linear. Of several parameters that
/// are multiplied, only the leftmost one counts as linear.
pub fn linear(formulas: &[Expression], count: usize) -> Vec<bool> {
    let mut linear = vec![true; count];
    loop {
        let before = linear.clone();
        formulas.iter().for_each(|formula| mark(formula, &mut linear));
        if linear == before {
            return linear;
        }
    }
}

fn holds(of: &Expression, linear: &[bool]) -> bool {
    of.any(&|node| matches!(node, Node::Parameter(k) if linear[*k]))
}

/// Sets `linear` to false for each parameter that does not count as linear in `of`.
fn mark(of: &Expression, linear: &mut [bool]) {
    match &of.node {
        Node::Call(Function::Add | Function::Subtract | Function::Negate, all) => {
            all.iter().for_each(|part| mark(part, linear));
        }
        Node::Call(Function::Multiply, all) => {
            all.iter().for_each(|part| mark(part, linear));
            if holds(&all[0], linear) && holds(&all[1], linear) {
                bend(&all[1], linear);
            }
        }
        Node::Call(Function::Divide, all) => {
            mark(&all[0], linear);
            bend(&all[1], linear);
        }
        Node::Power(base, 1) => mark(base, linear),
        _ => of.children().iter().for_each(|part| bend(part, linear)),
    }
}

/// Sets `linear` to false for all parameters in `of`.
fn bend(of: &Expression, linear: &mut [bool]) {
    of.visit(&mut |e| {
        if let Node::Parameter(k) = e.node {
            linear[k] = false;
        }
    });
}

/// For each parameter for which `linear` is true, the factor in `formula` by which it is multiplied.
///
/// # Errors
/// If a term of the formula contains no such parameter. No coefficient could then be fitted to make the term zero.
pub fn parts(formula: &Expression, linear: &[bool]) -> Result<Parts, Fault> {
    let mut all: Parts = Vec::new();
    for (parameter, part) in divided(formula, linear) {
        let Some(parameter) = parameter else {
            if part.node == Node::Number(0.0) {
                continue;
            }
            let why = "this term has no parameter that multiplies it, so it could not be fitted; write k* before it \
                       and give k under [parameters]";
            return Err(Fault { at: part.at, why: why.into() });
        };
        match all.iter_mut().find(|(k, _)| *k == parameter) {
            Some((_, sum)) => {
                *sum = Expression::call(Function::Add, vec![sum.clone(), part]);
            }
            None => all.push((parameter, part)),
        }
    }
    Ok(all)
}

/// The terms of `of`. Each is divided by its parameter for which `linear` is true, and comes with the index of this parameter.
/// The index is `None` if the term has no such parameter.
fn divided(of: &Expression, linear: &[bool]) -> Vec<(Option<usize>, Expression)> {
    if !holds(of, linear) {
        return vec![(None, of.clone())];
    }
    let each = |e: &Expression, change: &dyn Fn(Expression) -> Expression| {
        divided(e, linear).into_iter().map(|(k, part)| (k, change(part))).collect::<Vec<_>>()
    };
    let negative = |e: Expression| Expression::call(Function::Negate, vec![e]);
    match &of.node {
        Node::Parameter(k) => vec![(Some(*k), Expression { node: Node::Number(1.0), at: of.at })],
        Node::Power(base, 1) => divided(base, linear),
        Node::Call(Function::Negate, all) => each(&all[0], &negative),
        Node::Call(Function::Add, all) => {
            [divided(&all[0], linear), divided(&all[1], linear)].concat()
        }
        Node::Call(Function::Subtract, all) => {
            [divided(&all[0], linear), each(&all[1], &negative)].concat()
        }
        Node::Call(Function::Multiply, all) if holds(&all[0], linear) => {
            each(&all[0], &|part| part.times(all[1].clone()))
        }
        Node::Call(Function::Multiply, all) => each(&all[1], &|part| all[0].clone().times(part)),
        Node::Call(Function::Divide, all) => {
            each(&all[0], &|part| Expression::call(Function::Divide, vec![part, all[1].clone()]))
        }
        // no other node contains a parameter for which `linear` is true, because `mark` has set it to false for those
        _ => vec![(None, of.clone())],
    }
}

#[cfg(test)]
mod tests {
    use super::super::parser::parse;
    use super::*;

    const NAMES: [&str; 3] = ["k", "m", "w"];

    fn parts_of(text: &str) -> (Vec<bool>, Vec<String>) {
        let formula = parse(text, &NAMES).unwrap();
        let linear = linear(std::slice::from_ref(&formula), 3);
        let all = parts(&formula, &linear).unwrap();
        let words = all.iter().map(|(k, e)| format!("{}: {}", NAMES[*k], e.written(&NAMES)));
        (linear, words.collect())
    }

    #[test]
    fn each_coefficient_has_what_it_multiplies() {
        let (linear, parts) = parts_of("k*alpha*beta - (m + k*alpha)*p/V");
        assert_eq!(linear, [true; 3]);
        assert_eq!(parts, ["k: alpha*beta + -(alpha*p/airspeed)", "m: -(p/airspeed)"]);
    }

    #[test]
    fn what_bends_is_a_shape_constant() {
        assert_eq!(parts_of("k*max(alpha - w, 0)^2").0, [true, true, false]);
        assert_eq!(parts_of("k*(1 + m*alpha)*beta").0, [true, false, true]);
        assert_eq!(parts_of("k*alpha/(1 + w*alpha^2)").0, [true, true, false]);
    }

    #[test]
    fn a_term_without_a_parameter_is_refused() {
        let formula = parse("k*alpha + 0.1*beta", &NAMES).unwrap();
        let fault = parts(&formula, &[true; 3]).unwrap_err();
        assert!(fault.at == 10 && fault.why.contains("k*"), "{fault:?}");
    }
}
