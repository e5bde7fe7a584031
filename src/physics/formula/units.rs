//! Checks that the units in a formula of an effect file balance, for example in a sum.

use super::dimension::Dimension;
use super::expression::{Expression, Function, Node};
use super::parser::Fault;

/// Physical dimension of a term of a formula.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Measure {
    /// The term has this dimension.
    Of(Dimension),
    /// The term is zero, which is compatible with any dimension.
    Any,
}

/// Physical dimension of `formula`, whose parameters have the dimensions `dimensions`. `None` if the formula is always zero.
///
/// # Errors
/// If the units do not balance. The error states the position in the formula and the dimensions that do not match.
pub fn dimension(
    formula: &Expression,
    dimensions: &[Dimension],
) -> Result<Option<Dimension>, Fault> {
    Ok(match measure(formula, dimensions)? {
        Measure::Of(dimension) => Some(dimension),
        Measure::Any => None,
    })
}

fn measure(of: &Expression, dimensions: &[Dimension]) -> Result<Measure, Fault> {
    use Measure::{Any, Of};
    let part = |e: &Expression| measure(e, dimensions);
    Ok(match &of.node {
        Node::Number(0.0) => Any,
        Node::Number(_) => Of(Dimension::NONE),
        Node::Variable(v) => Of(v.dimension()),
        Node::Parameter(k) => Of(dimensions.get(*k).copied().unwrap_or(Dimension::NONE)),
        Node::Power(base, n) => match part(base)? {
            Of(base) => Of(base.to_power(*n)),
            Any => Any,
        },
        Node::Table(x, _) => {
            part(x)?;
            // the first number of a pair in a table has the unit of the variable, the second has none
            Of(Dimension::NONE)
        }
        Node::Call(function, all) => match function {
            Function::Add
            | Function::Subtract
            | Function::Min
            | Function::Max
            | Function::Deadband => same(part(&all[0])?, part(&all[1])?, &all[1], function.name())?,
            Function::Multiply => both(part(&all[0])?, part(&all[1])?, Dimension::times),
            Function::Divide => both(part(&all[0])?, part(&all[1])?, Dimension::per),
            Function::Negate | Function::Abs => part(&all[0])?,
            Function::Sign => {
                part(&all[0])?;
                Of(Dimension::NONE)
            }
            Function::Sqrt => match part(&all[0])? {
                Of(inside) => Of(inside.root().ok_or_else(|| Fault {
                    at: all[0].at,
                    why: format!("{inside} under the root has no root; make it a square"),
                })?),
                Any => Any,
            },
            Function::Exp | Function::Sin | Function::Cos | Function::Tanh => {
                plain(part(&all[0])?, &all[0], function.name())?
            }
            Function::Lag | Function::Delay => timed(*function, all, dimensions)?,
            Function::Smoothstep => {
                let x = part(&all[2])?;
                same(part(&all[0])?, x, &all[2], "smoothstep")?;
                same(part(&all[1])?, x, &all[2], "smoothstep")?;
                Of(Dimension::NONE)
            }
        },
    })
}

/// Dimension of a lag or delay: that of its first argument. Its second argument must be a time in s.
fn timed(
    function: Function,
    all: &[Expression],
    dimensions: &[Dimension],
) -> Result<Measure, Fault> {
    let time = Dimension::new(0, 0, 1);
    match measure(&all[1], dimensions)? {
        Measure::Of(found) if found != time => Err(Fault {
            at: all[1].at,
            why: format!(
                "the units do not balance: the time of {} is in s, here it is in {found}; give its \
                 parameter the unit s",
                function.name()
            ),
        }),
        _ => measure(&all[0], dimensions),
    }
}

fn both(a: Measure, b: Measure, of: impl Fn(Dimension, Dimension) -> Dimension) -> Measure {
    match (a, b) {
        (Measure::Of(a), Measure::Of(b)) => Measure::Of(of(a, b)),
        _ => Measure::Any,
    }
}

fn same(left: Measure, right: Measure, at: &Expression, name: &str) -> Result<Measure, Fault> {
    match (left, right) {
        (Measure::Any, other) | (other, Measure::Any) => Ok(other),
        (Measure::Of(a), Measure::Of(b)) if a == b => Ok(left),
        (Measure::Of(a), Measure::Of(b)) => Err(Fault {
            at: at.at,
            why: format!(
                "the units do not balance: left of {name:?} is {a}, right of it {b}; give a number that has \
                 a unit as a parameter, or divide by a speed or length"
            ),
        }),
    }
}

fn plain(of: Measure, at: &Expression, name: &str) -> Result<Measure, Fault> {
    match of {
        Measure::Of(d) if d != Dimension::NONE => Err(Fault {
            at: at.at,
            why: format!(
                "the units do not balance: {name} takes a number, its argument is {d}; divide it by a parameter in {d}"
            ),
        }),
        _ => Ok(Measure::Of(Dimension::NONE)),
    }
}
