//! A formula compiled to a list of operations, generic over the scalar type.
//!
//! The list is the program of a stack machine. The top value of the stack is kept outside the array of the others. With
//! [`Dual`](greylag_num::Dual) numbers the program gives the derivatives with respect to states and controls. Parameters in
//! which the formula is linear are its coefficients; the others are shape constants.

use super::expression::{Expression, Function, Node};
use super::memory::Memory;
use super::variable::Variable;
use crate::{Channel, Point};
use greylag_num::{Real, Table};

/// Largest number of values on the stack below the top.
const DEPTH: usize = 12;

/// Largest sum of the numbers of operations and of multiplied variables of an effect. It limits the computation time of a
/// model's step.
const LONGEST: usize = 4000;

/// An operation of the stack machine.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Operation {
    Number(f64),
    Variable(Variable),
    Constant(u16),
    Add,
    Subtract,
    Multiply,
    Divide,
    Negate,
    Abs,
    Min,
    Max,
    Sign,
    Exp,
    Sin,
    Cos,
    Tanh,
    Sqrt,
    Smoothstep,
    Deadband,
    /// Replaces the top by the value of the lag or delay with this index. If the past is unknown, the top remains: it is
    /// the argument's present value, and thus the steady-state value.
    Remembered(u16),
    Square,
    Power(i16),
    Table(u16),
    /// Adds a number to the top. This operation and the next four use no value below the top.
    AddNumber(f64),
    Scale(f64),
    AddVariable(Variable),
    Times(Variable),
    /// Multiplies the top by the variables from the first index up to the second in the list of variables.
    TimesAll(u16, u16),
    /// Stores the top as the factor that several parts share, and removes it from the stack.
    Keep,
    TimesKept,
    /// Reports the top as the term of a coefficient (by its index) in a channel, and removes it from the stack.
    Report(u16, Channel),
}

/// A list of operations with the tables, variables and memories that it uses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tape {
    operations: Vec<Operation>,
    tables: Vec<Table>,
    /// Variables of the products. Each `TimesAll` refers to a range of this list.
    variables: Vec<Variable>,
    memories: Vec<Memory>,
    depth: usize,
    deepest: usize,
}

/// Index of each parameter among the shape constants. `None` for a coefficient.
pub type Places = [Option<u16>];

impl Tape {
    /// Appends the evaluation of `part` times `factor` (`None`: the kept factor) for coefficient `index` in `channel`.
    ///
    /// # Errors
    /// If the stack would be too deep, there would be too many operations, or the formula contains an invalid term.
    pub fn report(
        &mut self,
        part: &Expression,
        factor: Option<&Expression>,
        index: u16,
        channel: Channel,
        places: &Places,
    ) -> Result<(), String> {
        match factor {
            Some(factor) => self.push(&factor.clone().times(part.clone()), places)?,
            None => {
                self.push(part, places)?;
                self.operations.push(Operation::TimesKept);
            }
        }
        self.operations.push(Operation::Report(index, channel));
        self.depth -= 1;
        self.checked_length()
    }

    /// Appends the evaluation of a factor that several parts share, and keeps its value.
    ///
    /// # Errors
    /// If the stack would be too deep, or the factor contains an invalid term.
    pub fn keep(&mut self, factor: &Expression, places: &Places) -> Result<(), String> {
        self.push(factor, places)?;
        self.operations.push(Operation::Keep);
        self.depth -= 1;
        Ok(())
    }

    /// Number of operations in the list.
    pub fn len(&self) -> usize {
        self.operations.len()
    }

    /// Whether the list has no operations.
    pub fn is_empty(&self) -> bool {
        self.operations.is_empty()
    }

    fn checked_length(&self) -> Result<(), String> {
        let length = self.operations.len() + self.variables.len();
        match length > LONGEST {
            true => Err(format!(
                "the formulas take more than {LONGEST} operations; divide them into several effects"
            )),
            false => Ok(()),
        }
    }

    fn deeper(&mut self) -> Result<(), String> {
        self.depth += 1;
        self.deepest = self.deepest.max(self.depth);
        match self.depth > DEPTH {
            true => Err(format!(
                "more than {DEPTH} intermediate results wait for one another; begin sums and products with their \
                 longest bracket"
            )),
            false => Ok(()),
        }
    }

    /// Appends a product: first the factors other than variables, then all variables together, then the number.
    fn product(&mut self, of: &Expression, places: &Places) -> Result<(), String> {
        let mut factors = Vec::new();
        let number = factors_of(of, &mut factors);
        let (mut variables, others): (Vec<Variable>, Vec<&Expression>) = divided(&factors);
        of_area(&mut variables);
        let mut begun = false;
        for other in others {
            self.push(other, places)?;
            if begun {
                self.operations.push(Operation::Multiply);
                self.depth -= 1;
            }
            begun = true;
        }
        if !begun {
            match variables.pop() {
                Some(first) => self.leaf(Operation::Variable(first))?,
                None => return self.leaf(Operation::Number(number)),
            }
        }
        match variables[..] {
            [] => (),
            [one] => self.operations.push(Operation::Times(one)),
            _ => {
                let first = self.variables.len() as u16;
                self.variables.append(&mut variables);
                self.operations.push(Operation::TimesAll(first, self.variables.len() as u16));
            }
        }
        if number != 1.0 {
            self.operations.push(Operation::Scale(number));
        }
        Ok(())
    }

    fn push(&mut self, of: &Expression, places: &Places) -> Result<(), String> {
        match &of.node {
            Node::Call(Function::Multiply | Function::Negate, _) => self.product(of, places),
            Node::Number(x) => self.leaf(Operation::Number(*x)),
            Node::Variable(v) => self.leaf(Operation::Variable(*v)),
            Node::Parameter(k) => match places.get(*k).copied().flatten() {
                Some(place) => self.leaf(Operation::Constant(place)),
                None => Err("a coefficient is used where only shape constants are allowed".into()),
            },
            Node::Power(base, n) => {
                self.push(base, places)?;
                self.operations.push(if *n == 2 {
                    Operation::Square
                } else {
                    Operation::Power(*n)
                });
                Ok(())
            }
            Node::Table(x, points) => {
                self.push(x, places)?;
                let [x, y] = [0, 1].map(|i| points.iter().map(|p| p[i]).collect::<Vec<_>>());
                let table = Table::new(&x, &y).map_err(|why| why.to_string())?;
                self.operations.push(Operation::Table(self.tables.len() as u16));
                self.tables.push(table);
                Ok(())
            }
            Node::Call(function, all) => self.function(*function, all, places),
        }
    }

    fn leaf(&mut self, operation: Operation) -> Result<(), String> {
        self.operations.push(operation);
        self.deeper()
    }

    fn function(
        &mut self,
        function: Function,
        all: &[Expression],
        places: &Places,
    ) -> Result<(), String> {
        use Function as F;
        if function.has_memory() {
            return self.remembered(function, all, places);
        }
        // a number or variable is added to the top directly, without being put on the stack
        if let ([left, right], F::Add) = (all, function) {
            for (leaf, other) in [(right, left), (left, right)] {
                if let Some(direct) = direct(function, &leaf.node) {
                    self.push(other, places)?;
                    self.operations.push(direct);
                    return Ok(());
                }
            }
        }
        for argument in all {
            self.push(argument, places)?;
        }
        self.operations.push(match function {
            F::Add => Operation::Add,
            F::Subtract => Operation::Subtract,
            F::Multiply => Operation::Multiply,
            F::Divide => Operation::Divide,
            F::Negate => Operation::Negate,
            F::Abs => Operation::Abs,
            F::Min => Operation::Min,
            F::Max => Operation::Max,
            F::Sign => Operation::Sign,
            F::Exp => Operation::Exp,
            F::Sin => Operation::Sin,
            F::Cos => Operation::Cos,
            F::Tanh => Operation::Tanh,
            F::Sqrt => Operation::Sqrt,
            F::Smoothstep => Operation::Smoothstep,
            F::Deadband => Operation::Deadband,
            F::Lag | F::Delay => return Ok(()),
        });
        self.depth -= all.len().saturating_sub(1);
        Ok(())
    }

    /// Appends the lag or delay of an expression. Equal lags or delays share one memory.
    fn remembered(
        &mut self,
        function: Function,
        all: &[Expression],
        places: &Places,
    ) -> Result<(), String> {
        let time = match all.get(1).map(|e| &e.node) {
            Some(Node::Parameter(k)) => places.get(*k).copied().flatten(),
            _ => None,
        };
        let (Some(argument), Some(time)) = (all.first(), time) else {
            return Err(format!("the time of {} must be a shape constant", function.name()));
        };
        let mut alone = Tape::default();
        alone.report(argument, Some(&Expression::number(1.0)), 0, Channel::Drag, places)?;
        let memory = Memory { function, argument: alone, time };
        let known = self.memories.iter().position(|m| *m == memory);
        let place = known.unwrap_or(self.memories.len());
        if known.is_none() {
            self.memories.push(memory);
        }
        self.push(argument, places)?;
        self.operations.push(Operation::Remembered(place as u16));
        Ok(())
    }

    /// The lags and delays, in the order of their indices.
    pub fn memories(&self) -> &[Memory] {
        &self.memories
    }

    /// Evaluates the list at the point `at` with the shape constants `shape`, and calls `report` with the value of each part.
    /// The values of the list's lags and delays are in `at.controls.lagged` from index `first_lag` on.
    #[inline(always)]
    pub fn run<R: Real>(
        &self,
        at: &Point<R>,
        shape: &[f64],
        first_lag: usize,
        mut report: impl FnMut(usize, Channel, R),
    ) {
        let one = R::from_f64(1.0);
        let mut below = [R::zero(); DEPTH];
        let (mut top, mut kept, mut depth) = (R::zero(), one, 0);
        for operation in &self.operations {
            match *operation {
                Operation::Number(x) => {
                    put(&mut below, &mut depth, top);
                    top = R::from_f64(x);
                }
                Operation::Variable(variable) => {
                    put(&mut below, &mut depth, top);
                    top = variable.value(at);
                }
                Operation::Constant(k) => {
                    put(&mut below, &mut depth, top);
                    top = R::from_f64(shape.get(k as usize).copied().unwrap_or(0.0));
                }
                Operation::Add => top = take(&below, &mut depth) + top,
                Operation::Subtract => top = take(&below, &mut depth) - top,
                Operation::Multiply => top = take(&below, &mut depth) * top,
                Operation::Divide => top = take(&below, &mut depth) / top,
                Operation::Min => top = take(&below, &mut depth).min(top),
                Operation::Max => top = take(&below, &mut depth).max(top),
                Operation::Negate => top = -top,
                Operation::Abs => top = top.abs(),
                Operation::Sign => {
                    let negative = R::where_less(top, R::zero(), -one, R::zero());
                    top = R::where_less(R::zero(), top, one, negative);
                }
                Operation::Exp => top = top.exp(),
                Operation::Sin => top = top.sin_cos().0,
                Operation::Cos => top = top.sin_cos().1,
                Operation::Tanh => top = top.tanh(),
                Operation::Sqrt => top = top.sqrt(),
                Operation::Smoothstep => {
                    let high = take(&below, &mut depth);
                    let low = take(&below, &mut depth);
                    let t = ((top - low) / (high - low)).clamp(0.0, 1.0);
                    top = t * t * (R::from_f64(3.0) - t.scale(2.0));
                }
                Operation::Deadband => {
                    let width = top.abs();
                    let x = take(&below, &mut depth);
                    top = x - x.max(-width).min(width);
                }
                Operation::Remembered(place) => {
                    if let Some(lagged) = &at.controls.lagged {
                        top = lagged.get(first_lag + place as usize).copied().unwrap_or(top);
                    }
                }
                Operation::Square => top = top * top,
                Operation::Power(n) => top = power(top, n),
                Operation::Table(k) => top = self.tables[k as usize].at(top),
                Operation::AddNumber(x) => top += R::from_f64(x),
                Operation::Scale(x) => top = top.scale(x),
                Operation::AddVariable(variable) => top += variable.value(at),
                Operation::Times(variable) => top = top * variable.value(at),
                Operation::TimesAll(first, end) => {
                    for variable in &self.variables[first as usize..end as usize] {
                        top = top * variable.value(at);
                    }
                }
                Operation::Keep => {
                    kept = top;
                    top = take(&below, &mut depth);
                }
                Operation::TimesKept => top = top * kept,
                Operation::Report(index, channel) => {
                    report(index as usize, channel, top);
                    top = take(&below, &mut depth);
                }
            }
        }
    }
}

/// Appends the factors of the product `of` that are not numbers to `factors`, and returns the product of its numbers.
fn factors_of<'a>(of: &'a Expression, factors: &mut Vec<&'a Expression>) -> f64 {
    match &of.node {
        Node::Number(x) => *x,
        Node::Call(Function::Negate, all) => -factors_of(&all[0], factors),
        Node::Call(Function::Multiply, all) => {
            factors_of(&all[0], factors) * factors_of(&all[1], factors)
        }
        _ => {
            factors.push(of);
            1.0
        }
    }
}

/// Separates `factors` into variables and others. A power of a variable up to the fourth counts as that many variables.
fn divided<'a>(factors: &[&'a Expression]) -> (Vec<Variable>, Vec<&'a Expression>) {
    let (mut variables, mut others) = (Vec::new(), Vec::new());
    for factor in factors {
        match &factor.node {
            Node::Variable(v) => variables.push(*v),
            Node::Power(base, n @ 1..=4) => match base.node {
                Node::Variable(v) => variables.extend((0..*n).map(|_| v)),
                _ => others.push(*factor),
            },
            _ => others.push(*factor),
        }
    }
    (variables, others)
}

/// Replaces dynamic pressure and wing area by their product, which the air data contain.
fn of_area(variables: &mut Vec<Variable>) {
    let place = |v: Variable| variables.iter().position(|other| *other == v);
    if let (Some(pressure), Some(area)) = (place(Variable::Pressure), place(Variable::Area)) {
        variables[pressure] = Variable::PressureArea;
        variables.remove(area);
    }
}

/// The operation that adds the number or variable `leaf` to the top directly. `None` for other terms.
fn direct(function: Function, leaf: &Node) -> Option<Operation> {
    Some(match (function, leaf) {
        (Function::Add, Node::Number(x)) => Operation::AddNumber(*x),
        (Function::Add, Node::Variable(v)) => Operation::AddVariable(*v),
        _ => return None,
    })
}

#[inline(always)]
fn put<R: Real>(below: &mut [R; DEPTH], depth: &mut usize, x: R) {
    // the first call stores an unused value, which is simpler than an optional top
    if let Some(place) = below.get_mut(*depth) {
        *place = x;
    }
    *depth += 1;
}

#[inline(always)]
fn take<R: Real>(below: &[R; DEPTH], depth: &mut usize) -> R {
    *depth = depth.wrapping_sub(1);
    below.get(*depth).copied().unwrap_or(R::zero())
}

#[inline(always)]
fn power<R: Real>(x: R, n: i16) -> R {
    let one = R::from_f64(1.0);
    let mut all = one;
    for _ in 0..n.unsigned_abs() {
        all = all * x;
    }
    if n < 0 { one / all } else { all }
}
