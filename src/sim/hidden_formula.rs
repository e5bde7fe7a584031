//! Translates the formulas of an effect file to functions of JSBSim. The simulated aircraft then has the effect.
//!
//! The translation shares only the parsed expressions with Greylag's own effect. JSBSim evaluates the functions with its own
//! code.

use greylag_sitl::hidden::{Filter, FilterKind, Hidden, Place};

use greylag_physics::Channel;
use greylag_physics::formula::expression::{Expression, Function, Node};
use greylag_physics::formula::{Variable, Written};

/// Newtons per pound of force.
const LBF: f64 = 4.448_221_615_260_5;
/// Largest length of a function, characters. Nested tables and nested calls of smoothstep, tanh, sign and deadband
/// repeat their arguments and multiply the length.
const LONGEST: usize = 200_000;
/// Metres in a foot.
const FT: f64 = 0.3048;

/// Returns the functions of `effect` in JSBSim's syntax, with `values` as the values of its coefficients.
///
/// # Errors
///
/// If the formula reads the lift, if the time of a lag or delay is no parameter, or if a function exceeds 200 000
/// characters.
pub fn hidden(effect: &Written, values: &[f64]) -> Result<Hidden, String> {
    let mut writer = Writer { values, filters: Vec::new() };
    let mut functions = Vec::new();
    for line in &effect.lines {
        let (place, unit) = place(line.channel);
        let (factor, shape) = (writer.xml(&line.factor)?, writer.xml(&line.shape)?);
        functions.push((place, element("product", &[number(1.0 / unit), factor, shape])));
    }
    Ok(Hidden::written(effect.about.id, functions, writer.filters))
}

/// The axis of JSBSim to which a channel (component of force or moment) belongs, and the size of JSBSim's unit (lbf or lbf ft)
/// in N or N m.
fn place(channel: Channel) -> (Place, f64) {
    match channel {
        Channel::Drag => (Place::Drag, LBF),
        Channel::Lift => (Place::Lift, LBF),
        Channel::Side => (Place::Side, LBF),
        Channel::BodyX => (Place::Thrust, LBF),
        Channel::Roll => (Place::Roll, LBF * FT),
        Channel::Pitch => (Place::Pitch, LBF * FT),
        Channel::Yaw => (Place::Yaw, LBF * FT),
    }
}

fn too_long() -> String {
    format!(
        "the formula takes more than {LONGEST} characters as a function of JSBSim, which repeats what is inside \
         tables, smoothstep, tanh, sign and deadband; nest them less"
    )
}

fn element(name: &str, parts: &[String]) -> String {
    format!("<{name}>{}</{name}>", parts.concat())
}

fn number(x: f64) -> String {
    format!("<value>{x}</value>")
}

fn property(name: &str) -> String {
    format!("<property>{name}</property>")
}

/// A property converted to another unit.
fn scaled(factor: f64, name: &str) -> String {
    element("product", &[number(factor), property(name)])
}

fn variable(of: Variable) -> Result<String, String> {
    use Variable as V;
    Ok(match of {
        V::Roll => property("attitude/phi-rad"),
        V::Pitch => property("attitude/theta-rad"),
        V::Airspeed => scaled(FT, "velocities/vt-fps"),
        V::RollRate => property("velocities/p-rad_sec"),
        V::PitchRate => property("velocities/q-rad_sec"),
        V::YawRate => property("velocities/r-rad_sec"),
        V::Alpha => property("aero/alpha-rad"),
        V::Beta => property("aero/beta-rad"),
        V::Aileron => property("{aileron}"),
        V::Elevator => property("{elevator}"),
        V::Rudder => property("{rudder}"),
        V::Throttle => property("{throttle}"),
        V::RollRateHat => hat("velocities/p-aero-rad_sec", "aero/bi2vel"),
        V::PitchRateHat => hat("velocities/q-aero-rad_sec", "aero/ci2vel"),
        V::YawRateHat => hat("velocities/r-aero-rad_sec", "aero/bi2vel"),
        V::Pressure => scaled(LBF / (FT * FT), "aero/qbar-psf"),
        V::PressureArea => {
            let all = [number(LBF), property("aero/qbar-psf"), property("metrics/Sw-sqft")];
            element("product", &all)
        }
        V::Altitude => scaled(FT, "position/h-sl-ft"),
        V::Area => scaled(FT * FT, "metrics/Sw-sqft"),
        V::Span => scaled(FT, "metrics/bw-ft"),
        V::Chord => scaled(FT, "metrics/cbarw-ft"),
        V::Thrust => scaled(LBF, "propulsion/engine/thrust-lbs"),
        V::AlphaRate => property("aero/alphadot-rad_sec"),
        V::BetaRate => property("aero/betadot-rad_sec"),
        V::Lift => {
            return Err(format!(
                "{} is not available while forces are computed; write qbar*S and alpha",
                of.name()
            ));
        }
    })
}

fn hat(rate: &str, per: &str) -> String {
    element("product", &[property(rate), property(per)])
}

/// Writes formulas, and collects the filters (lags and delays) whose outputs they read.
struct Writer<'a> {
    /// Values of the effect's parameters.
    values: &'a [f64],
    filters: Vec<Filter>,
}

impl Writer<'_> {
    fn xml(&mut self, of: &Expression) -> Result<String, String> {
        match &of.node {
            Node::Number(x) => Ok(number(*x)),
            Node::Variable(v) => variable(*v),
            Node::Parameter(k) => Ok(number(self.value(*k))),
            Node::Power(base, n) => Ok(element("pow", &[self.xml(base)?, number(f64::from(*n))])),
            Node::Table(x, points) => {
                let x = self.xml(x)?;
                // the length is checked before the table is written, because every pair of points repeats `x`
                match x.len().saturating_mul(points.len()) > LONGEST {
                    true => Err(too_long()),
                    false => Ok(table(&x, points)),
                }
            }
            Node::Call(function, all) if function.has_memory() => self.filter(*function, all),
            Node::Call(function, all) => {
                let all = all.iter().map(|e| self.xml(e)).collect::<Result<Vec<_>, _>>()?;
                let written = call(*function, &all);
                match written.len() > LONGEST {
                    true => Err(too_long()),
                    false => Ok(written),
                }
            }
        }
    }

    fn value(&self, parameter: usize) -> f64 {
        self.values.get(parameter).copied().unwrap_or(0.0)
    }

    /// The JSBSim property that is the output of the filter for `function`. Equal filters are written once.
    fn filter(&mut self, function: Function, all: &[Expression]) -> Result<String, String> {
        let time_s = match all.get(1).map(|e| &e.node) {
            Some(Node::Parameter(k)) => self.value(*k),
            _ => return Err(format!("the time of {} is not a parameter", function.name())),
        };
        let input = self.xml(&all[0])?;
        let kind = if function == Function::Delay { FilterKind::Delay } else { FilterKind::Lag };
        let filter = Filter { input, kind, time_s };
        let known = self.filters.iter().position(|f| *f == filter);
        let place = known.unwrap_or(self.filters.len());
        if known.is_none() {
            self.filters.push(filter);
        }
        Ok(property(&Filter::placeholder(place)))
    }
}

/// A piecewise linear table as a sum of ramps, because JSBSim's tables accept no expression as input.
fn table(x: &str, points: &[[f64; 2]]) -> String {
    let ramp = |pair: &[[f64; 2]]| {
        let [[x0, y0], [x1, y1]] = [pair[0], pair[1]];
        let from = element("difference", &[x.to_owned(), number(x0)]);
        let part = element("min", &[element("max", &[from, number(0.0)]), number(x1 - x0)]);
        element("product", &[number((y1 - y0) / (x1 - x0)), part])
    };
    let ramps: Vec<String> = points.windows(2).map(ramp).collect();
    element("sum", &[vec![number(points[0][1])], ramps].concat())
}

fn call(function: Function, all: &[String]) -> String {
    let one = || number(1.0);
    match function {
        Function::Add => element("sum", all),
        Function::Subtract => element("difference", all),
        Function::Multiply => element("product", all),
        Function::Divide => element("quotient", all),
        Function::Negate => element("product", &[number(-1.0), all[0].clone()]),
        Function::Abs => element("abs", all),
        Function::Min => element("min", all),
        Function::Max => element("max", all),
        Function::Exp => element("exp", all),
        Function::Sin => element("sin", all),
        Function::Cos => element("cos", all),
        Function::Sqrt => element("sqrt", all),
        Function::Sign => sign(&all[0]),
        Function::Tanh => {
            let held =
                element("max", &[element("min", &[all[0].clone(), number(20.0)]), number(-20.0)]);
            let e = element("exp", &[element("product", &[number(2.0), held])]);
            let (less, more) =
                (element("difference", &[e.clone(), one()]), element("sum", &[e, one()]));
            element("quotient", &[less, more])
        }
        Function::Smoothstep => smoothstep(&all[0], &all[1], &all[2]),
        Function::Deadband => {
            let width = element("abs", &[all[1].clone()]);
            let held = element("min", &[all[0].clone(), width.clone()]);
            let low = element("product", &[number(-1.0), width]);
            element("difference", &[all[0].clone(), element("max", &[held, low])])
        }
        // Lags and delays are separate filters. In steady state their output equals their argument.
        Function::Lag | Function::Delay => all[0].clone(),
    }
}

/// Sign function with value 0 at zero. JSBSim's sign function is 1 at zero.
fn sign(x: &str) -> String {
    let above = element("gt", &[x.to_owned(), number(0.0)]);
    let below = element("lt", &[x.to_owned(), number(0.0)]);
    element("difference", &[above, below])
}

fn smoothstep(low: &str, high: &str, x: &str) -> String {
    let from = element("difference", &[x.to_owned(), low.to_owned()]);
    let over = element("difference", &[high.to_owned(), low.to_owned()]);
    let share = element("quotient", &[from, over]);
    let t = element("max", &[element("min", &[share, number(1.0)]), number(0.0)]);
    let rest = element("difference", &[number(3.0), element("product", &[number(2.0), t.clone()])]);
    element("product", &[t.clone(), t, rest])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nested_tables_that_grow_beyond_measure_are_refused() {
        let points: Vec<[f64; 2]> = (0..200).map(|k| [f64::from(k), 0.0]).collect();
        let node = |node| Expression { node, at: 0 };
        let table = |of: Expression| node(Node::Table(Box::new(of), points.clone()));
        let mut writer = Writer { values: &[], filters: Vec::new() };
        let once = table(node(Node::Variable(Variable::Alpha)));
        assert!(writer.xml(&once).unwrap().starts_with("<sum>"));
        let why = writer.xml(&table(once)).unwrap_err();
        assert!(why.contains("inside tables"), "{why}");
    }
}
