//! Random effects, drawn from two grammars of formulas.

use std::error::Error;

use greylag::num::stream::{Stream, stream};
use greylag::physics::formula::{Written, register};
use rand::RngExt;

/// Ids of the random streams of the two grammars.
const DRAW: u64 = 3100;
const OUTSIDE: u64 = 3101;
/// Variables with their typical size in the test flights.
pub const VARIABLES: [(&str, f64); 8] = [
    ("alpha", 0.1),
    ("beta", 0.06),
    ("p_hat", 0.06),
    ("q_hat", 0.008),
    ("r_hat", 0.03),
    ("aileron", 0.1),
    ("elevator", 0.08),
    ("throttle", 0.4),
];
/// Channels, each with the factor of its force or moment, and a coefficient that is detectable in a few minutes of flight.
pub const CHANNELS: [(&str, &str, f64); 6] = [
    ("drag", "qbar*S", 0.02),
    ("lift", "qbar*S", 0.06),
    ("side", "qbar*S", 0.02),
    ("roll", "qbar*S*b", 0.004),
    ("pitch", "qbar*S*c", 0.01),
    ("yaw", "qbar*S*b", 0.002),
];

/// An effect that is hidden in the aircraft.
pub struct Drawn {
    /// The effect as written.
    pub effect: &'static Written,
    /// Channel on which it acts.
    pub channel: &'static str,
    /// Variables of the formula, in the order of their names.
    pub variables: Vec<&'static str>,
    /// Shape of the formula.
    pub shape: String,
}

/// A shape, its value at the typical size of its variables, and these variables.
type Shape = (String, f64, Vec<&'static str>);

fn pick<'a, T>(random: &mut Stream, all: &'a [T]) -> &'a T {
    &all[random.random_range(0..all.len() as u32) as usize]
}

/// An effect with a shape of one or two variables. The shape is a form of the library of `propose`, or `tanh`, which the
/// library lacks.
pub fn inside(seed: u64) -> Result<Drawn, Box<dyn Error>> {
    let mut random = stream(seed, &[DRAW]);
    let &(channel, factor, size) = pick(&mut random, &CHANNELS);
    let (&(v, v_size), &(w, w_size)) =
        (pick(&mut random, &VARIABLES[..7]), pick(&mut random, &VARIABLES));
    let one = |text: String, full: f64| (text, full, vec![v]);
    let shape = match random.random_range(0..8) {
        0 => one(format!("abs({v})"), v_size),
        1 => one(format!("{v}^2"), v_size * v_size),
        2 => one(format!("{v}*abs({v})"), v_size * v_size),
        3 | 4 if v != w => (format!("{v}*{w}"), v_size * w_size, vec![v, w]),
        5 => one(format!("deadband({v}, {:.3})", 0.5 * v_size), 0.5 * v_size),
        6 => one(format!("tanh({v}/{:.3})", 0.5 * v_size), 1.0),
        7 => one(format!("max({v} - {:.3}, 0)", 0.5 * v_size), 0.5 * v_size),
        _ => ("throttle".into(), 0.4, vec!["throttle"]),
    };
    finished(seed, &mut random, (channel, factor, size), shape)
}

/// An effect with a shape that the library of `propose` lacks. The last two shapes are not among its free forms either.
pub fn outside(seed: u64) -> Result<Drawn, Box<dyn Error>> {
    let mut random = stream(seed, &[OUTSIDE]);
    let &(channel, factor, size) = pick(&mut random, &CHANNELS);
    let &(v, a) = pick(&mut random, &VARIABLES[..7]);
    let others: Vec<(&'static str, f64)> = VARIABLES.into_iter().filter(|x| x.0 != v).collect();
    let &(w, b) = pick(&mut random, &others);
    let third: Vec<(&'static str, f64)> = others.iter().copied().filter(|x| x.0 != w).collect();
    let &(u, c) = pick(&mut random, &third);
    let half = |x: f64| format!("{:.3}", 0.5 * x);
    let shape: Shape = match random.random_range(0..10) {
        0 => (format!("{v}*{w}*{u}"), a * b * c, vec![v, w, u]),
        1 => (format!("{v}/(1 + abs({w})/{})", half(b)), a / 3.0, vec![v, w]),
        2 => (format!("tanh({v}/{})", half(a)), 1.0, vec![v]),
        3 => (format!("(exp({v}/{}) - 1)", half(a)), 6.0, vec![v]),
        4 => (format!("({v} - deadband({v}, {0}))", half(a)), 0.5 * a, vec![v]),
        5 => (format!("{v}^3"), a.powi(3), vec![v]),
        6 => (format!("exp(-({v}/{})^2)", half(a)), 1.0, vec![v]),
        7 => (format!("{v}*{w}^2"), a * b * b, vec![v, w]),
        8 => (format!("sin({v}/{})", half(a)), 1.0, vec![v]),
        _ => (format!("sqrt(abs({v}))"), a.sqrt(), vec![v]),
    };
    finished(seed, &mut random, (channel, factor, size), shape)
}

fn finished(
    seed: u64,
    random: &mut Stream,
    (channel, factor, size): (&'static str, &'static str, f64),
    (shape, full, mut variables): Shape,
) -> Result<Drawn, Box<dyn Error>> {
    let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
    // an effect of the throttle does not depend on dynamic pressure, like that of an offset thrust line
    let (factor, unit, size) = match (shape == "throttle", factor) {
        (false, factor) => (factor, "", size),
        (true, "qbar*S") => ("1", "N", 125.0 * size),
        (true, _) => ("1", "N m", 260.0 * size),
    };
    let k = sign * size / full * random.random_range(1.0..2.0);
    let text = format!(
        "schema = 1\nid = \"hidden_{seed}\"\ndescription = \"Hidden.\"\nsource = \"drawn\"\nstatus = \"accepted\"\n\
         [parameters.k]\nvalue = {k}\nbounds = [-1e6, 1e6]\nunit = \"{unit}\"\nmeaning = \"amount\"\n\
         [[channels]]\nchannel = \"{channel}\"\nfactor = \"{factor}\"\nshape = \"k*{shape}\"\n"
    );
    variables.sort_unstable();
    Ok(Drawn { effect: register::read(&text)?, channel, variables, shape })
}
