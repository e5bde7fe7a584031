//! Expressions that may describe an unknown effect (a physical contribution to forces and moments). They have at most nine nodes.
//! They are functions of one variable, products of up to three of these functions, and functions of a sum of two variables.
//!
//! An atom is one of these functions. Shape constants are the constants inside functions, for example c in tanh(v/c).

use greylag_physics::formula::Variable;
use greylag_physics::formula::dimension::Dimension;
use greylag_physics::formula::expression::{Expression, Function, Node};
use greylag_physics::formula::units;

/// Largest number of nodes of an expression: variables, numbers, functions and operators.
pub const MOST_NODES: usize = 9;

/// An expression whose shape constants are parameters without dimension.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// The expression, with its parameters by index.
    pub expression: Expression,
    /// The values of its parameters.
    pub constants: Vec<f64>,
}

/// A variable with quantiles of its magnitude in the flights. The quantiles set the values of the shape constants.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// The variable of the expressions.
    pub variable: Variable,
    /// The quantiles 0.5, 0.75 and 0.95 of the variable's magnitude.
    pub levels: [f64; 3],
}

impl Reach {
    /// Whether the variable is positive in all flights.
    fn positive(&self) -> bool {
        positive(self.variable)
    }
}

/// Whether `variable` is positive in all flights: throttle and airspeed.
pub fn positive(variable: Variable) -> bool {
    matches!(variable, Variable::Throttle | Variable::Airspeed)
}

/// A function of one variable, or a function of a sum of two variables.
#[derive(Clone, Debug)]
pub struct Atom {
    /// The expression of the atom, with its constants.
    pub free: Free,
    /// Whether the atom is a divisor in products.
    pub below: bool,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// The atom has no constant.
    Plain,
    /// The shape constant is the middle one of the three quantiles.
    Middle,
    /// The shape constant is the lowest or the highest of the three quantiles.
    Outer,
    /// The atom is a function of a sum and is not combined with other atoms.
    Sum,
}

/// A product of atoms.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Indices of the atoms.
    pub parts: Vec<usize>,
    /// Number of nodes of the expression.
    pub size: usize,
    /// Number of shape constants.
    pub constants: usize,
}

/// All expressions that the search tries.
#[derive(Clone, Debug)]
pub struct Grammar {
    /// The atoms, from which products are formed.
    pub atoms: Vec<Atom>,
    /// Products with consistent units.
    pub candidates: Vec<Candidate>,
}

fn of(variable: Variable) -> Expression {
    Expression { node: Node::Variable(variable), at: 0 }
}

fn constant(place: usize) -> Expression {
    Expression { node: Node::Parameter(place), at: 0 }
}

fn power(base: Expression, n: i16) -> Expression {
    Expression { node: Node::Power(Box::new(base), n), at: 0 }
}

fn call<const N: usize>(function: Function, arguments: [Expression; N]) -> Expression {
    Expression::call(function, arguments.into())
}

/// The ratio v/c, where c is the first constant.
fn scaled(v: Expression) -> Expression {
    call(Function::Divide, [v, constant(0)])
}

impl Grammar {
    /// Builds all expressions of `variables`. Variables whose 0.95 quantile is zero are left out.
    pub fn new(variables: &[Reach]) -> Grammar {
        let moving: Vec<Reach> = variables.iter().filter(|r| r.levels[2] > 0.0).copied().collect();
        let mut grammar = Grammar { atoms: Vec::new(), candidates: Vec::new() };
        moving.iter().for_each(|reach| grammar.add_plain(reach));
        moving.iter().for_each(|reach| grammar.add_bent(reach));
        for (i, v) in moving.iter().enumerate() {
            moving[i + 1..].iter().for_each(|w| grammar.add_sums(v, w));
        }
        grammar.add_products();
        grammar
    }

    fn add(&mut self, kind: Kind, below: bool, expression: Expression, constants: Vec<f64>) {
        self.atoms.push(Atom { free: Free { expression, constants }, below, kind });
    }

    fn add_plain(&mut self, reach: &Reach) {
        let v = || of(reach.variable);
        let mut all = vec![v(), power(v(), 2), power(v(), 3)];
        if !reach.positive() {
            let magnitude = || call(Function::Abs, [v()]);
            all.push(magnitude());
            all.push(call(Function::Multiply, [v(), magnitude()]));
        }
        all.into_iter().for_each(|e| self.add(Kind::Plain, false, e, Vec::new()));
        if reach.variable == Variable::Airspeed {
            self.add(Kind::Plain, true, v(), Vec::new());
        }
    }

    /// Adds functions of one variable with a shape constant.
    fn add_bent(&mut self, reach: &Reach) {
        let v = || of(reach.variable);
        let c = || constant(0);
        let zero = || Expression::number(0.0);
        let one = || Expression::number(1.0);
        let kind = |k: usize| if k == 1 { Kind::Middle } else { Kind::Outer };
        let above = |x: Expression| call(Function::Max, [x, zero()]);
        for (k, level) in reach.levels.into_iter().enumerate().filter(|(_, l)| *l > 0.0) {
            let mut all = vec![
                call(Function::Tanh, [scaled(v())]),
                above(call(Function::Subtract, [v(), c()])),
            ];
            if !reach.positive() {
                let deadband = || call(Function::Deadband, [v(), c()]);
                all.push(deadband());
                // the variable minus its dead-band function is a saturation
                all.push(call(Function::Subtract, [v(), deadband()]));
                let below = call(Function::Add, [v(), c()]);
                all.push(call(Function::Min, [below, zero()]));
                let bell = call(Function::Negate, [power(scaled(v()), 2)]);
                all.push(call(Function::Exp, [bell]));
            }
            all.into_iter().for_each(|e| self.add(kind(k), false, e, vec![level]));
            let magnitude = if reach.positive() { v() } else { call(Function::Abs, [v()]) };
            for bend in [scaled(magnitude), power(scaled(v()), 2)] {
                self.add(kind(k), true, call(Function::Add, [one(), bend]), vec![level]);
            }
            for sign in [1.0, -1.0] {
                let grows = call(Function::Exp, [scaled(v())]);
                let grows = call(Function::Subtract, [grows, one()]);
                self.add(kind(k), false, grows, vec![sign * level]);
            }
        }
    }

    /// Adds functions of the sum v + c·w with the shape constant c.
    fn add_sums(&mut self, v: &Reach, w: &Reach) {
        let ratio = v.levels[1] / w.levels[1].max(f64::MIN_POSITIVE);
        if !ratio.is_finite() {
            return;
        }
        for share in [-2.0, -1.0, -0.5, 0.5, 1.0, 2.0] {
            let sum = || {
                let more = call(Function::Multiply, [constant(0), of(w.variable)]);
                call(Function::Add, [of(v.variable), more])
            };
            let c = share * ratio;
            self.add(Kind::Sum, false, call(Function::Abs, [sum()]), vec![c]);
            let above = call(Function::Max, [sum(), Expression::number(0.0)]);
            self.add(Kind::Sum, false, above, vec![c]);
            let size = v.levels[1] * (1.0 + share.abs());
            let bent = call(Function::Divide, [sum(), constant(1)]);
            self.add(Kind::Sum, false, call(Function::Tanh, [bent]), vec![c, size]);
        }
    }

    fn add_products(&mut self) {
        let count = self.atoms.len();
        for i in 0..count {
            self.keep(vec![i]);
            if self.atoms[i].kind == Kind::Sum {
                continue;
            }
            for j in i + 1..count {
                let (a, b) = (self.atoms[i].kind, self.atoms[j].kind);
                let both_bent = a != Kind::Plain && b != Kind::Plain;
                if b == Kind::Sum || both_bent && (a == Kind::Outer || b == Kind::Outer) {
                    continue;
                }
                self.keep(vec![i, j]);
                if a != Kind::Plain || b != Kind::Plain {
                    continue;
                }
                for k in j + 1..count {
                    if matches!(self.atoms[k].kind, Kind::Plain | Kind::Middle) {
                        self.keep(vec![i, j, k]);
                    }
                }
            }
        }
    }

    /// Adds the product of the atoms `parts` to the candidates if each variable occurs once, the product is small enough, and
    /// its units are consistent.
    fn keep(&mut self, parts: Vec<usize>) {
        let atoms: Vec<&Atom> = parts.iter().map(|p| &self.atoms[*p]).collect();
        let of_one: Vec<Variable> =
            atoms.iter().flat_map(|a| a.free.expression.variables()).collect();
        let repeated = of_one.iter().enumerate().any(|(i, v)| of_one[..i].contains(v));
        let nodes: usize = atoms.iter().map(|a| a.free.expression.size()).sum();
        if repeated || nodes + parts.len() - 1 > MOST_NODES {
            return;
        }
        let free = product(&atoms);
        let size = free.expression.size();
        if size <= MOST_NODES && free.dimension().is_some() {
            self.candidates.push(Candidate { parts, size, constants: free.constants.len() });
        }
    }

    /// The expression of `candidate`.
    pub fn free(&self, candidate: &Candidate) -> Free {
        product(&candidate.parts.iter().map(|p| &self.atoms[*p]).collect::<Vec<_>>())
    }
}

/// The product of `atoms`. Atoms that are divisors are put into the denominator.
fn product(atoms: &[&Atom]) -> Free {
    let (mut above, mut below) = (Expression::number(1.0), Expression::number(1.0));
    let mut constants = Vec::new();
    for atom in atoms {
        let mut expression = atom.free.expression.clone();
        renumber(&mut expression, constants.len());
        constants.extend(&atom.free.constants);
        let side = if atom.below { &mut below } else { &mut above };
        *side = side.clone().times(expression);
    }
    let expression = match below.node {
        Node::Number(1.0) => above,
        _ => call(Function::Divide, [above, below]),
    };
    Free { expression, constants }
}

/// Increases the indices of the parameters in `of` by `by`.
fn renumber(of: &mut Expression, by: usize) {
    match &mut of.node {
        Node::Parameter(k) => *k += by,
        Node::Call(_, all) => all.iter_mut().for_each(|e| renumber(e, by)),
        Node::Power(base, _) => renumber(base, by),
        _ => (),
    }
}

impl Free {
    /// Dimension of the expression if its constants have no dimension; `None` if its units are then inconsistent.
    pub fn dimension(&self) -> Option<Dimension> {
        let plain = vec![Dimension::NONE; self.constants.len()];
        units::dimension(&self.expression, &plain).ok().flatten()
    }

    /// The expression as text that can be a factor of a product. `names` replace the values of the constants if they are given.
    pub fn text(&self, names: Option<&[String]>) -> String {
        let numbers: Vec<String> = self.constants.iter().map(|c| format!("{c}")).collect();
        let names: Vec<&str> = names.unwrap_or(&numbers).iter().map(String::as_str).collect();
        let text = self.expression.written(&names).to_string();
        match self.expression.node {
            Node::Call(Function::Add | Function::Subtract, _) => format!("({text})"),
            _ => text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_physics::formula::parser;

    fn grammar(variables: &[Variable]) -> Grammar {
        let reach = |v: &Variable| Reach { variable: *v, levels: [0.03, 0.05, 0.1] };
        Grammar::new(&variables.iter().map(reach).collect::<Vec<_>>())
    }

    #[test]
    fn every_form_can_be_read_and_is_small_and_there_once() {
        let grammar = grammar(&[Variable::Alpha, Variable::Beta, Variable::Throttle]);
        let mut texts: Vec<String> = Vec::new();
        for candidate in &grammar.candidates {
            let free = grammar.free(candidate);
            let text = free.text(None);
            let read = parser::parse(&text, &[]).unwrap_or_else(|why| panic!("{text}: {why:?}"));
            assert!(read.size() <= MOST_NODES, "{text}");
            assert_eq!(candidate.constants, free.constants.len());
            texts.push(text);
        }
        for wanted in [
            "tanh(alpha/0.05)",
            "alpha*beta*throttle",
            "alpha - deadband(alpha, 0.05)",
            "throttle/(1 + abs(beta)/0.05)",
            "max(alpha + 1*beta, 0)",
        ] {
            let there = texts.iter().any(|t| t == wanted || *t == format!("({wanted})"));
            assert!(there, "{wanted} is not among {} forms", texts.len());
        }
        let count = texts.len();
        texts.sort();
        texts.dedup();
        assert_eq!(texts.len(), count);
    }

    #[test]
    fn units_prune_what_would_need_a_number_with_a_unit() {
        let grammar = grammar(&[Variable::RollRate, Variable::Airspeed, Variable::Alpha]);
        let texts: Vec<String> =
            grammar.candidates.iter().map(|c| grammar.free(c).text(None)).collect();
        assert!(texts.iter().any(|t| t == "p/airspeed"), "{texts:?}");
        assert!(texts.iter().any(|t| t == "tanh(alpha/0.05)"));
        for wrong in ["tanh(p", "deadband(p", "exp(airspeed", "p + "] {
            assert!(!texts.iter().any(|t| t.contains(wrong)), "{wrong}");
        }
    }
}
