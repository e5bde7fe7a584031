//! Expression tree of a formula in an effect file, and the conversion of the tree to text. An effect is one physical
//! contribution to a model's forces and moments.

use std::fmt;

use super::variable::Variable;

/// A node of a formula, with its position in the text.
#[derive(Clone, Debug, PartialEq)]
pub struct Expression {
    /// Kind of the node.
    pub node: Node,
    /// Byte offset of the node's start in the text of the formula.
    pub at: usize,
}

/// Kind of a node, with its children.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// A number written in the formula.
    Number(f64),
    /// A variable of the flight, for example α.
    Variable(Variable),
    /// The parameter with this index in the effect's list of parameters.
    Parameter(usize),
    /// A function or operator with its arguments.
    Call(Function, Vec<Expression>),
    /// An expression raised to an integer power.
    Power(Box<Expression>, i16),
    /// A function of one argument that is given by points (argument, value). It is linear between the points and constant
    /// outside of them.
    Table(Box<Expression>, Vec<[f64; 2]>),
}

macro_rules! functions {
    ($($id:ident $name:literal $count:literal $meaning:literal;)*) => {
        /// A function or operator.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function { $(#[doc = $meaning] $id,)* }

        impl Function {
            /// All functions and operators.
            pub const ALL: &'static [Function] = &[$(Function::$id),*];
            /// Name in a formula, or the operator's sign.
            pub const fn name(self) -> &'static str {
                match self { $(Function::$id => $name,)* }
            }
            /// Number of arguments that the function takes.
            pub const fn count(self) -> usize {
                match self { $(Function::$id => $count,)* }
            }
            /// Meaning, in words, for the list of functions.
            pub const fn meaning(self) -> &'static str {
                match self { $(Function::$id => $meaning,)* }
            }
        }
    };
}

functions! {
    Add "+" 2 "sum";
    Subtract "-" 2 "difference";
    Multiply "*" 2 "product";
    Divide "/" 2 "quotient";
    Negate "-" 1 "negative";
    Abs "abs" 1 "magnitude";
    Min "min" 2 "the smaller of two";
    Max "max" 2 "the larger of two";
    Sign "sign" 1 "−1, 0 or 1";
    Exp "exp" 1 "exponential";
    Sin "sin" 1 "sine";
    Cos "cos" 1 "cosine";
    Tanh "tanh" 1 "hyperbolic tangent";
    Sqrt "sqrt" 1 "square root";
    Smoothstep "smoothstep" 3 "smoothstep(low, high, x): 0 below low, 1 above high, 3t² − 2t³ between";
    Deadband "deadband" 2 "deadband(x, w): 0 within ±w, x ∓ w beyond";
    Lag "lag" 2 "lag(x, tau): x through a first-order lag of time constant tau, s; x of controls alone";
    Delay "delay" 2 "delay(x, t): x as it was t seconds before; x of controls alone";
}

impl Function {
    /// The function with this name in formulas; `None` for operators and unknown names.
    pub fn from_name(name: &str) -> Option<Function> {
        Function::ALL.iter().copied().find(|f| f.name() == name && !f.is_operator())
    }

    /// Whether it is an operator, such as `+`.
    pub fn is_operator(self) -> bool {
        use Function::{Add, Divide, Multiply, Negate, Subtract};
        matches!(self, Add | Subtract | Multiply | Divide | Negate)
    }

    /// Whether its value depends on past values of its argument.
    pub fn has_memory(self) -> bool {
        matches!(self, Function::Lag | Function::Delay)
    }

    /// Whether the function or its derivative is discontinuous at some value of an argument.
    pub fn has_kink(self) -> bool {
        use Function::{Abs, Deadband, Max, Min, Sign};
        matches!(self, Abs | Min | Max | Sign | Deadband)
    }
}

impl Expression {
    /// The expression that is the number `x`.
    pub fn number(x: f64) -> Expression {
        Expression { node: Node::Number(x), at: 0 }
    }

    /// A call of `function` with these arguments. Its position in the text is that of the first argument.
    pub fn call(function: Function, arguments: Vec<Expression>) -> Expression {
        let at = arguments.first().map_or(0, |e| e.at);
        Expression { node: Node::Call(function, arguments), at }
    }

    /// The product of two expressions. A factor that is the number 1 is omitted.
    pub fn times(self, other: Expression) -> Expression {
        let one = |e: &Expression| e.node == Node::Number(1.0);
        match (one(&self), one(&other)) {
            (true, _) => other,
            (_, true) => self,
            _ => Expression::call(Function::Multiply, vec![self, other]),
        }
    }

    /// Child expressions of the node.
    pub fn children(&self) -> &[Expression] {
        match &self.node {
            Node::Call(_, all) => all,
            Node::Power(base, _) | Node::Table(base, _) => std::slice::from_ref(base),
            _ => &[],
        }
    }

    /// Calls `visit` for the node and all its descendants.
    pub fn visit(&self, visit: &mut impl FnMut(&Expression)) {
        visit(self);
        self.children().iter().for_each(|child| child.visit(visit));
    }

    /// Whether `of` holds for the node or any of its descendants.
    pub fn any(&self, of: &impl Fn(&Node) -> bool) -> bool {
        of(&self.node) || self.children().iter().any(|child| child.any(of))
    }

    /// The variables that occur in the expression, each once, in the order of `Variable::ALL`.
    pub fn variables(&self) -> Vec<Variable> {
        let named = |v: &Variable| self.any(&|node| *node == Node::Variable(*v));
        Variable::ALL.iter().copied().filter(named).collect()
    }

    /// Number of nodes: this node and its descendants.
    pub fn size(&self) -> usize {
        1 + self.children().iter().map(Expression::size).sum::<usize>()
    }

    /// The expression as text that can be parsed again. `names` are the names of the parameters.
    pub fn written<'a>(&'a self, names: &'a [&'a str]) -> Written<'a> {
        Written { of: self, names }
    }
}

/// An expression with the names of its parameters, for conversion to text.
pub struct Written<'a> {
    of: &'a Expression,
    names: &'a [&'a str],
}

/// Operator precedence of a node: 0 for sums, 1 for products, 2 for powers, 3 for all others.
fn binding(node: &Node) -> u8 {
    match node {
        Node::Call(Function::Add | Function::Subtract, _) => 0,
        Node::Call(Function::Multiply | Function::Divide | Function::Negate, _) => 1,
        Node::Number(x) if *x < 0.0 => 1,
        Node::Power(..) => 2,
        _ => 3,
    }
}

impl Written<'_> {
    fn part(&self, of: &Expression, least: u8) -> String {
        let text = Written { of, names: self.names }.to_string();
        if binding(&of.node) < least { format!("({text})") } else { text }
    }
}

impl fmt::Display for Written<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.of.node {
            Node::Number(x) => write!(f, "{x}"),
            Node::Variable(v) => f.write_str(v.name()),
            Node::Parameter(k) => f.write_str(self.names.get(*k).copied().unwrap_or("?")),
            Node::Power(base, n) => write!(f, "{}^{n}", self.part(base, 3)),
            Node::Table(x, points) => {
                let points: Vec<String> = points.iter().map(|[x, y]| format!("{x}:{y}")).collect();
                write!(f, "table({}; {})", self.part(x, 0), points.join(", "))
            }
            Node::Call(Function::Negate, all) => write!(f, "-{}", self.part(&all[0], 2)),
            Node::Call(function, all) if function.is_operator() => {
                let own = binding(&self.of.node);
                let (left, right) = (self.part(&all[0], own), self.part(&all[1], own + 1));
                let gap = if own == 0 { " " } else { "" };
                write!(f, "{left}{gap}{}{gap}{right}", function.name())
            }
            Node::Call(function, all) => {
                let all: Vec<String> = all.iter().map(|e| self.part(e, 0)).collect();
                write!(f, "{}({})", function.name(), all.join(", "))
            }
        }
    }
}
