//! Reader of effect files. An effect file is a TOML file with the formulas of one effect. For each channel (a force or moment)
//! the formula is a `factor` without parameters times a `shape` with parameters. Parameters in which the shapes are linear are
//! coefficients. The other parameters are shape constants.

use std::collections::BTreeMap;

use serde::Deserialize;
use toml::Spanned;

use super::dimension::Dimension;
use super::expression::{Expression, Node};
use super::memory;
use super::parser::{self, Fault};
use super::split;
use super::tape::Tape;
use super::units;
use super::written::{Line, Status, Written};
use super::{corners, variable::Variable};
use crate::Channel;
use crate::actuators::LAGS;
use crate::airframe::{check_schema, toml_error};
use crate::effects::{Coefficient, Description, Entry, Kind, Needs};
use crate::inputs;

/// Largest length of an id and of a parameter's name, bytes.
const LONGEST_NAME: usize = 40;
/// Largest number of parameters of an effect.
const MOST_PARAMETERS: usize = 16;
/// Default prior standard deviation, as a fraction of the range between a parameter's bounds.
const WIDTH: f64 = 0.25;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    id: String,
    description: String,
    source: String,
    status: Status,
    #[serde(default)]
    look_alikes: Vec<String>,
    #[serde(default)]
    separated_by: String,
    parameters: BTreeMap<String, Parameter>,
    channels: Vec<ChannelFile>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parameter {
    value: f64,
    width: Option<f64>,
    bounds: [f64; 2],
    /// Whether the bounds are wider for an aircraft of more than 25 kg or 5 m of span, like the bounds of the catalogue.
    #[serde(default)]
    grows: bool,
    unit: String,
    meaning: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChannelFile {
    channel: String,
    factor: Option<Spanned<String>>,
    shape: Spanned<String>,
}

/// Channels and their names in effect files.
const CHANNELS: [(&str, Channel); 7] = [
    ("drag", Channel::Drag),
    ("lift", Channel::Lift),
    ("side", Channel::Side),
    ("thrust", Channel::BodyX),
    ("roll", Channel::Roll),
    ("pitch", Channel::Pitch),
    ("yaw", Channel::Yaw),
];

/// The name of a channel in effect files. Empty for a channel that effect files cannot use.
pub fn channel_name(channel: Channel) -> &'static str {
    CHANNELS.iter().find(|(_, c)| *c == channel).map_or("", |(name, _)| name)
}

/// Dimension of the contributions to `channel`.
fn measured_in(channel: Channel) -> Dimension {
    match channel {
        Channel::Roll | Channel::Pitch | Channel::Yaw => Dimension::MOMENT,
        _ => Dimension::FORCE,
    }
}

/// Parses the text of an effect file.
///
/// # Errors
/// If the text is not a valid effect file. The error describes the fault with its line, and the remedy.
pub fn parse(text: &str) -> Result<Written, String> {
    let file: File = toml::from_str(text).map_err(|e| toml_error(text, &e))?;
    check_schema(file.schema, 1)?;
    checked_id(&file.id)?;
    let names: Vec<&str> = file.parameters.keys().map(String::as_str).collect();
    for (name, parameter) in &file.parameters {
        checked_parameter(name, parameter)?;
    }
    if names.is_empty() || names.len() > MOST_PARAMETERS {
        return Err(format!(
            "an effect has 1 to {MOST_PARAMETERS} parameters, this one {}; write them under [parameters]",
            names.len()
        ));
    }
    let place = Places { text };
    let lines =
        file.channels.iter().map(|c| line(c, &names, &place)).collect::<Result<Vec<_>, _>>()?;
    if lines.is_empty() {
        return Err("the effect acts on no channel; add [[channels]] with channel and shape".into());
    }
    let shapes: Vec<Expression> = lines.iter().map(|l| l.line.shape.clone()).collect();
    for (k, name) in names.iter().enumerate() {
        if !shapes.iter().any(|s| s.any(&|node| *node == Node::Parameter(k))) {
            return Err(format!("parameters.{name} is in no shape; use it or remove it"));
        }
    }
    let linear = split::linear(&shapes, names.len());
    // every effect has its linear coefficients first, then its shape constants
    let order: Vec<usize> = (0..names.len())
        .filter(|k| linear[*k])
        .chain((0..names.len()).filter(|k| !linear[*k]))
        .collect();
    let written = built(&file, text, &names, &order, &linear, lines)?;
    corners::check(&written)?;
    Ok(written)
}

/// A line of a formula, with the byte offset of its shape in the file.
struct Placed {
    line: Line,
    shape_at: usize,
}

/// The text of a file, from which line and column of a fault are found.
struct Places<'a> {
    text: &'a str,
}

impl Places<'_> {
    /// Message for the `fault` in the string that begins at byte `start` of the file.
    fn message(&self, start: usize, fault: &Fault) -> String {
        // the value of a string begins after its quotes
        let quotes = self.text[start..].chars().take_while(|c| matches!(c, '"' | '\'')).count();
        let at = (start + if quotes >= 3 { 3 } else { 1 } + fault.at).min(self.text.len());
        let before = self.text.get(..at).unwrap_or(self.text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or_default().chars().count() + 1;
        format!("line {line}, column {column}: {}", fault.why)
    }
}

fn line(file: &ChannelFile, names: &[&str], place: &Places) -> Result<Placed, String> {
    let found = CHANNELS.iter().find(|(name, _)| *name == file.channel);
    let Some((_, channel)) = found else {
        let known: Vec<&str> = CHANNELS.iter().map(|(name, _)| *name).collect();
        return Err(format!(
            "channel {:?} is unknown; there are {}",
            file.channel,
            known.join(", ")
        ));
    };
    let read = |text: &Spanned<String>, names: &[&str]| {
        let start = text.span().start;
        parser::parse(text.get_ref(), names).map_err(|fault| place.message(start, &fault))
    };
    let factor = match &file.factor {
        Some(text) => read(text, &[])?,
        None => Expression::number(1.0),
    };
    let shape = read(&file.shape, names)?;
    Ok(Placed {
        line: Line { channel: *channel, factor, shape },
        shape_at: file.shape.span().start,
    })
}

fn built(
    file: &File,
    text: &str,
    names: &[&str],
    order: &[usize],
    linear: &[bool],
    lines: Vec<Placed>,
) -> Result<Written, String> {
    let coefficients: Vec<&Parameter> =
        order.iter().filter_map(|k| file.parameters.get(names[*k])).collect();
    let count = linear.iter().filter(|l| **l).count();
    if count == 0 {
        return Err(
            "no parameter multiplies the shape, so the effect could not be zero; write k*(…)"
                .into(),
        );
    }
    let mut dimensions = Vec::new();
    for (name, parameter) in &file.parameters {
        let read = Dimension::parse(&parameter.unit);
        dimensions.push(read.map_err(|why| format!("parameters.{name}.unit: {why}"))?);
    }
    let place = Places { text };
    let mut tape = Tape::default();
    let mut needs = Needs::Base;
    let mut shape_places = vec![None; names.len()];
    for (k, parameter) in order[count..].iter().enumerate() {
        shape_places[*parameter] = Some(k as u16);
    }
    let bounds: Vec<[f64; 2]> = file.parameters.values().map(|p| p.bounds).collect();
    for Placed { line, shape_at } in &lines {
        let message = |fault: Fault| place.message(*shape_at, &fault);
        memory::check(&line.shape, &bounds).map_err(message)?;
        memory::check(&line.factor, &[]).map_err(|f| format!("factor: {}", f.why))?;
        let parts = split::parts(&line.shape, linear).map_err(message)?;
        let factor =
            units::dimension(&line.factor, &[]).map_err(|f| format!("factor: {}", f.why))?;
        for (k, part) in &parts {
            balance(line.channel, factor, part, names[*k], dimensions[*k], &dimensions)
                .map_err(message)?;
        }
        let shared = parts.len() > 1 && line.factor.node != Node::Number(1.0);
        if shared {
            tape.keep(&line.factor, &shape_places)?;
        }
        for (k, part) in &parts {
            let index = order.iter().position(|o| o == k).unwrap_or_default() as u16;
            let factor = (!shared).then_some(&line.factor);
            tape.report(part, factor, index, line.channel, &shape_places)?;
        }
        for variable in line.factor.variables().into_iter().chain(line.shape.variables()) {
            needs = needs.max(variable.needs());
        }
    }
    let lags = tape.memories().len();
    if lags > LAGS {
        return Err(format!(
            "the formulas have {lags} different lags and delays, {LAGS} are the most; leave some out"
        ));
    }
    let values: Vec<f64> = coefficients.iter().map(|p| p.value).collect();
    let widths: Vec<f64> = coefficients
        .iter()
        .map(|p| p.width.unwrap_or(WIDTH * (p.bounds[1] - p.bounds[0])))
        .collect();
    let mut lines: Vec<Line> = lines.into_iter().map(|l| l.line).collect();
    lines.iter_mut().for_each(|line| renumber(&mut line.shape, order));
    let about = description(file, names, order, &coefficients, &lines, count, &values, &widths);
    Ok(Written {
        about,
        status: file.status,
        lines,
        values,
        widths,
        text: text.into(),
        tape,
        needs,
    })
}

/// Replaces each parameter's index in the file by its index among the coefficients. `order` lists the parameters in the
/// order of the coefficients.
fn renumber(of: &mut Expression, order: &[usize]) {
    match &mut of.node {
        Node::Parameter(k) => *k = order.iter().position(|o| o == k).unwrap_or_default(),
        Node::Call(_, all) => all.iter_mut().for_each(|e| renumber(e, order)),
        Node::Power(base, _) | Node::Table(base, _) => renumber(base, order),
        Node::Number(_) | Node::Variable(_) => (),
    }
}

/// Checks that the term `factor` · `part` · parameter `name` has the dimension of its channel. `unit` is the dimension of this
/// parameter, and `dimensions` are those of all parameters.
fn balance(
    channel: Channel,
    factor: Option<Dimension>,
    part: &Expression,
    name: &str,
    unit: Dimension,
    dimensions: &[Dimension],
) -> Result<(), Fault> {
    let wanted = measured_in(channel);
    let (Some(factor), Some(inside)) = (factor, units::dimension(part, dimensions)?) else {
        let why = "this term is always zero; take it out".into();
        return Err(Fault { at: part.at, why });
    };
    let made = factor.times(inside);
    if made.times(unit) == wanted {
        return Ok(());
    }
    let needed = wanted.per(made);
    Err(Fault {
        at: part.at,
        why: format!(
            "the units do not balance: the {} channel is in {wanted}, the term of {name} comes out in {}; give \
             {name} the unit {needed}, or change the factor",
            channel_name(channel),
            made.times(unit)
        ),
    })
}

fn leaked(text: &str) -> &'static str {
    Box::leak(text.trim().to_owned().into_boxed_str())
}

#[expect(clippy::too_many_arguments, reason = "all that a description is made of")]
fn description(
    file: &File,
    names: &[&str],
    order: &[usize],
    parameters: &[&Parameter],
    lines: &[Line],
    linear: usize,
    values: &[f64],
    widths: &[f64],
) -> Description {
    let sorted: Vec<&str> = order.iter().map(|k| names[*k]).collect();
    let coefficients: Vec<Coefficient> = sorted
        .iter()
        .zip(parameters)
        .map(|(name, p)| Coefficient {
            name: leaked(name),
            meaning: leaked(&p.meaning),
            unit: leaked(&p.unit),
            bounds: (p.bounds[0], p.bounds[1]),
            grows: p.grows,
        })
        .collect();
    let mut channels: Vec<Channel> = Vec::new();
    for line in lines {
        if !channels.contains(&line.channel) {
            channels.push(line.channel);
        }
    }
    let look_alikes: Vec<&'static str> = file.look_alikes.iter().map(|l| leaked(l)).collect();
    let shape = parameters.len() - linear;
    let entry = Entry {
        channels: channels.leak(),
        look_alikes: look_alikes.leak(),
        separated_by: leaked(&file.separated_by),
        example: values.to_vec().leak(),
        starts: starts(parameters, linear, values, widths).leak(),
    };
    Description {
        id: leaked(&file.id),
        description: leaked(&file.description),
        formula: leaked(&formula(lines, &sorted)),
        source: leaked(&file.source),
        coefficients: coefficients.leak(),
        shape,
        table: None,
        grid: None,
        replaces: &[],
        entry: Some(entry),
    }
}

/// The formula of the effect as text: its lines, separated by semicolons.
fn formula(lines: &[Line], names: &[&str]) -> String {
    let one = |line: &Line| {
        let (factor, shape) = (line.factor.written(names), line.shape.written(names));
        match line.factor.node {
            Node::Number(1.0) => format!("{} = {shape}", channel_name(line.channel)),
            _ => format!("{} = ({factor}) ({shape})", channel_name(line.channel)),
        }
    };
    lines.iter().map(one).collect::<Vec<_>>().join("; ")
}

/// Starting points of a search over shape constants: the values of the file, then each constant in turn one prior standard
/// deviation lower and higher, then the same points with reversed signs of the coefficients.
///
/// A coefficient that is zero in the file starts at its prior standard deviation, because shape constants have no effect if
/// it is zero.
fn starts(
    parameters: &[&Parameter],
    linear: usize,
    values: &[f64],
    widths: &[f64],
) -> Vec<&'static [f64]> {
    if linear == values.len() {
        return Vec::new();
    }
    let mut first = values.to_vec();
    for k in 0..linear {
        if first[k] == 0.0 {
            let [low, high] = parameters[k].bounds;
            // in the direction of the bound that is farther from zero
            first[k] = if high >= -low { widths[k].min(high) } else { (-widths[k]).max(low) };
        }
    }
    let mut all = vec![first.clone()];
    for k in linear..values.len() {
        for side in [-1.0, 1.0] {
            let mut moved = first.clone();
            let [low, high] = parameters[k].bounds;
            moved[k] = (moved[k] + side * widths[k]).clamp(low, high);
            if moved[k] != first[k] {
                all.push(moved);
            }
        }
    }
    // the same starting points with the coefficients' signs reversed
    let mirrored = |start: &Vec<f64>| {
        let mut other = start.clone();
        for k in 0..linear {
            let [low, high] = parameters[k].bounds;
            other[k] = (-other[k]).clamp(low, high);
        }
        (other != *start && other[..linear].iter().all(|x| *x != 0.0)).then_some(other)
    };
    let others: Vec<Vec<f64>> = all.iter().filter_map(mirrored).collect();
    all.extend(others);
    all.into_iter().map(|start| &*start.leak()).collect()
}

fn checked_id(id: &str) -> Result<(), String> {
    checked_name("id", id)?;
    let taken =
        Kind::ALL.iter().any(|k| k.describe().id == id) || inputs::Kind::from_id(id).is_some();
    match taken {
        true => Err(format!("id = {id:?} is an effect of the catalogue; choose another id")),
        false => Ok(()),
    }
}

fn checked_name(key: &str, name: &str) -> Result<(), String> {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    let starts = name.chars().next().is_some_and(|c| c.is_ascii_alphabetic());
    if starts && name.len() <= LONGEST_NAME && name.chars().all(part) {
        return Ok(());
    }
    let short: String = name.chars().take(30).collect();
    Err(format!(
        "{key} = {short:?} must be of letters, digits and _, a letter first, at most {LONGEST_NAME} of them"
    ))
}

fn checked_parameter(name: &str, p: &Parameter) -> Result<(), String> {
    checked_name("the name of a parameter", name)?;
    if Variable::from_name(name).is_some() {
        return Err(format!("parameters.{name} has the name of a variable of flight; rename it"));
    }
    let [low, high] = p.bounds;
    if !((high - low).is_finite() && low < high) {
        return Err(format!("parameters.{name}.bounds must be two numbers, the lower first"));
    }
    if !(low..=high).contains(&p.value) {
        return Err(format!(
            "parameters.{name}.value = {} lies outside its bounds {low} to {high}",
            p.value
        ));
    }
    if p.width.is_some_and(|w| !(w.is_finite() && w > 0.0)) {
        return Err(format!("parameters.{name}.width must be a positive number"));
    }
    if p.meaning.trim().is_empty() {
        return Err(format!("parameters.{name}.meaning is empty; say what it is"));
    }
    Ok(())
}
