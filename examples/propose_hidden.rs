//! Effects drawn from a grammar, hidden in JSBSim, and what `propose` makes of the flights; and nulls.
//!
//! `cargo run --release --ignore-rust-version --no-default-features --features sitl --example propose_hidden --
//! effects 9000 10 >> results/propose-hidden.jsonl`; `nulls` in place of `effects` hides nothing. One line of JSON a
//! seed; seeds must not be those of earlier runs.

use std::error::Error;

use greylag::control::{ControllerKind, build};
use greylag::logs::Flight;
use greylag::model::GreyBox;
use greylag::num::stream::{Stream, stream};
use greylag::physics::formula::{Written, register};
use greylag::sim::missing::Missing;
use greylag::sim::starting_model::starting_model;
use greylag::sim::trial::Trial;
use greylag::sysid::diagnose::{Options, Proposal, propose};
use greylag::sysid::flight_path::reconstruction::Reconstruction;
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};
use rand::RngExt;

/// Stream of the effects.
const DRAW: u64 = 3100;
/// Variables with the size that they have in the test flights.
const VARIABLES: [(&str, f64); 8] = [
    ("alpha", 0.1),
    ("beta", 0.06),
    ("p_hat", 0.06),
    ("q_hat", 0.008),
    ("r_hat", 0.03),
    ("aileron", 0.1),
    ("elevator", 0.08),
    ("throttle", 0.4),
];
/// Channels with their factor and an amount of it that shows in a few minutes of flight.
const CHANNELS: [(&str, &str, f64); 6] = [
    ("drag", "qbar*S", 0.02),
    ("lift", "qbar*S", 0.06),
    ("side", "qbar*S", 0.02),
    ("roll", "qbar*S*b", 0.004),
    ("pitch", "qbar*S*c", 0.01),
    ("yaw", "qbar*S*b", 0.002),
];

/// A hidden effect.
struct Drawn {
    effect: &'static Written,
    channel: &'static str,
    variables: Vec<&'static str>,
    shape: String,
}

fn pick<'a, T>(random: &mut Stream, all: &'a [T]) -> &'a T {
    &all[random.random_range(0..all.len() as u32) as usize]
}

/// A shape of two variables or one: forms of the library of `propose` and others.
fn drawn(seed: u64) -> Result<Drawn, Box<dyn Error>> {
    let mut random = stream(seed, &[DRAW]);
    let &(channel, factor, size) = pick(&mut random, &CHANNELS);
    let (&(v, v_size), &(w, w_size)) =
        (pick(&mut random, &VARIABLES[..7]), pick(&mut random, &VARIABLES));
    let (shape, full, two) = match random.random_range(0..8) {
        0 => (format!("abs({v})"), v_size, false),
        1 => (format!("{v}^2"), v_size * v_size, false),
        2 => (format!("{v}*abs({v})"), v_size * v_size, false),
        3 | 4 if v != w => (format!("{v}*{w}"), v_size * w_size, true),
        5 => (format!("deadband({v}, {:.3})", 0.5 * v_size), 0.5 * v_size, false),
        6 => (format!("tanh({v}/{:.3})", 0.5 * v_size), 1.0, false),
        7 => (format!("max({v} - {:.3}, 0)", 0.5 * v_size), 0.5 * v_size, false),
        _ => ("throttle".into(), 0.4, false),
    };
    let throttle = shape == "throttle";
    let sign = if random.random::<bool>() { 1.0 } else { -1.0 };
    // throttle acts without the air, as a thrust line beside the centre of gravity does
    let (factor, unit, size) = match (throttle, factor) {
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
    let mut variables = if throttle { vec!["throttle"] } else { vec![v] };
    variables.extend(two.then_some(w));
    variables.sort_unstable();
    Ok(Drawn { effect: register::read(&text)?, channel, variables, shape })
}

fn flights(model: &GreyBox, all: &[Flight]) -> Result<Vec<Reconstruction>, Box<dyn Error>> {
    let one = |f: &Flight| {
        let options = flight_path::Options {
            gravity: model.atmosphere.gravity,
            actuators_clock: ActuatorClock::AsRecorded,
            ..flight_path::Options::new(&f.name, model.airframe.actuators)
        };
        Ok(reconstruct(f, &options)?)
    };
    all.iter().map(one).collect()
}

fn proposal(seed: u64, missing: Vec<Missing>) -> Result<Proposal, Box<dyn Error>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let reference = std::fs::read_to_string(folder.join("jsbsim.toml"))?;
    let exact = GreyBox::load(&folder.join("jsbsim.toml"))?;
    let text = starting_model(&reference, &format!("hidden-{seed}"), seed, &missing)?;
    let model = GreyBox::parse(&text, &folder.join("hidden.toml"))?;
    let logs = Trial { seed, missing, turbulence: None, ..Trial::default() }
        .fly(build(ControllerKind::Lqi, &exact)?.as_ref())?;
    let (search, test) = (flights(&model, &logs.training)?, flights(&model, &logs.testing)?);
    Ok(propose(
        &model,
        &search,
        &test,
        &Options { seed, ..Options::default() },
        &greylag::sysid::progress::unheard,
    )?)
}

/// The variables of a formula, a rate the same whatever it is divided by.
fn variables(formula: &str) -> Vec<&'static str> {
    let has = |v: &str| {
        let part = |c: char| c.is_alphanumeric() || c == '_';
        formula.split(|c| !part(c)).any(|word| word == v || format!("{word}_hat") == v)
    };
    let mut all: Vec<&str> = VARIABLES.iter().map(|(v, _)| *v).filter(|v| has(v)).collect();
    all.sort_unstable();
    all
}

/// The shape of a formula: what follows its coefficient and the factor of its channel.
fn shape(formula: &str) -> &str {
    let (_, product) = formula.split_once("k*").unwrap_or(("", formula));
    let factors = CHANNELS.iter().filter_map(|(_, factor, _)| {
        product.strip_prefix(factor).and_then(|rest| rest.strip_prefix('*'))
    });
    factors.min_by_key(|rest| rest.len()).unwrap_or(product)
}

/// Whether two shapes are the same up to the order of a product and a fifth of a threshold.
fn same_form(found: &str, hidden: &str) -> bool {
    let parts = |text: &str| {
        let (mut words, mut numbers) = (Vec::new(), Vec::new());
        for word in text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == '.')) {
            match word.parse::<f64>() {
                Ok(number) => numbers.push(number),
                Err(_) => words.push(word.to_owned()),
            }
        }
        words.retain(|w| !w.is_empty());
        words.sort();
        (words, numbers)
    };
    let ((words, numbers), (wanted, thresholds)) = (parts(found), parts(hidden));
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 0.2 * b.abs();
    words == wanted
        && numbers.len() == thresholds.len()
        && numbers.iter().zip(&thresholds).all(near)
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, what, first, count] = &arguments[..] else {
        return Err("write: propose_hidden effects|nulls FIRST_SEED COUNT".into());
    };
    let (first, count): (u64, u64) = (first.parse()?, count.parse()?);
    for seed in first..first + count {
        let hidden = if what == "nulls" { None } else { Some(drawn(seed)?) };
        let missing = hidden.iter().map(|h| Missing::written(h.effect, &h.effect.values));
        let found = match missing.collect::<Result<Vec<_>, _>>() {
            Ok(missing) => proposal(seed, missing),
            Err(why) => Err(why.into()),
        };
        let line = match &found {
            Err(why) => serde_json::json!({ "seed": seed, "failed": why.to_string(),
                "hidden": hidden.as_ref().map(|h| format!("{} {}", h.channel, h.shape)) }),
            Ok(p) => {
                let chosen = p.front.iter().find(|r| r.chosen).map(|r| r.formula.as_str());
                let proposed = p.effect.is_some();
                let one = p
                    .front
                    .first()
                    .filter(|r| r.chosen || p.front.iter().skip(1).any(|r| r.chosen))
                    .map(|r| r.formula.as_str());
                let right = hidden.as_ref().zip(one).map(|(h, formula)| {
                    [
                        formula.starts_with(h.channel),
                        variables(formula) == h.variables,
                        same_form(shape(formula), &h.shape),
                    ]
                });
                serde_json::json!({
                    "seed": seed,
                    "hidden": hidden.as_ref().map(|h| format!("{} {} k={:.4}", h.channel, h.shape, h.effect.values[0])),
                    "verdict": p.verdict, "proposed": proposed, "formula": chosen, "grades": p.grades,
                    "channel_variables_form": right,
                    "refused": p.refused, "found": p.front.first().map(|r| r.formula.as_str()),
                    "held_out_removed": p.held_out.as_ref().map(|h| h.removed),
                    "threshold": p.front.first().map(|r| r.threshold),
                })
            }
        };
        println!("{line}");
    }
    Ok(())
}
