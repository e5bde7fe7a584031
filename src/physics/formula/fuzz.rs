//! Fuzz test of the reader of effect files, which define an effect by a formula. No broken file may cause a panic.

use rand::RngExt;

use super::expression::Function;
use super::file;
use super::variable::Variable;
use greylag_num::stream::{Stream, stream};

/// Id of the random stream from which the files are drawn.
const DRAW: u64 = 31;
/// A valid effect file, from which the broken files are made.
const WHOLE: &str = r#"schema = 1
id = "broken"
description = "d"
source = "s"
status = "proposed"
[parameters.k]
value = 1.0
bounds = [-20.0, 20.0]
unit = "N m/rad²"
meaning = "amount"
[parameters.w]
value = 0.1
width = 0.05
bounds = [0.01, 0.5]
unit = ""
meaning = "width"
[[channels]]
channel = "yaw"
factor = "qbar*S*b"
shape = "k*max(abs(beta) - w, 0)^2 + k*table(alpha; -0.1:0, 0.2:1)"
"#;

/// Reads `count` random files drawn from `seed`. Each is a valid file with a random formula or with random damage. Passes the
/// text of each file and the reader's result to `observe`. Returns the number of valid files.
pub fn run(count: usize, seed: u64, observe: &mut dyn FnMut(&str, &Result<(), String>)) -> usize {
    let mut random = stream(seed, &[DRAW]);
    let mut good = 0;
    for _ in 0..count {
        let text = if random.random::<bool>() { grown(&mut random) } else { damaged(&mut random) };
        let result = file::parse(&text).map(drop);
        good += usize::from(result.is_ok());
        observe(&text, &result);
    }
    good
}

/// `WHOLE` with a random formula in the entries `factor` and `shape`.
fn grown(random: &mut Stream) -> String {
    let depth = random.random_range(0..7);
    let shape = format!("k*({})", term(random, depth));
    let (before, _) = WHOLE.split_once("factor").unwrap_or((WHOLE, ""));
    format!("{before}factor = \"{}\"\nshape = \"{shape} + w*k*0\"\n", term(random, 1))
}

fn term(random: &mut Stream, depth: u32) -> String {
    if depth == 0 {
        return match random.random_range(0..4) {
            0 => format!("{}", random.random_range(-3.0..3.0_f64)),
            1 => "w".into(),
            _ => pick(random, Variable::ALL).name().into(),
        };
    }
    let mut next = || term(random, depth - 1);
    let (a, b, c) = (next(), next(), next());
    match random.random_range(0..9) {
        0 => format!("{a} + {b}"),
        1 => format!("{a}*{b}"),
        2 => format!("({a})/({b})"),
        3 => format!("({a})^{}", random.random_range(-9..10)),
        4 => format!("table({a}; -1:2, 0.5:{})", random.random_range(-9.0..9.0_f64)),
        5 => format!("-{a} - {b}"),
        _ => {
            let function = pick(random, Function::ALL);
            let all = [a, b, c];
            let given = function.count().min(3);
            format!("{}({})", function.name(), all[..given].join(", "))
        }
    }
}

fn pick<T: Copy>(random: &mut Stream, all: &[T]) -> T {
    all[random.random_range(0..all.len() as u32) as usize]
}

/// `WHOLE` with random pieces removed, inserted or copied.
fn damaged(random: &mut Stream) -> String {
    const ODD: [&str; 24] = [
        "(",
        ")",
        "^",
        "²",
        "-",
        "1e308",
        "nan",
        "\"",
        "\n",
        "[",
        "]",
        "δa",
        ";",
        ":",
        ",",
        "/0",
        "{",
        "=",
        "\\",
        "((((((((((",
        "k*k",
        "inf",
        "0",
        "\u{301}",
    ];
    let mut text: Vec<char> = WHOLE.chars().collect();
    for _ in 0..random.random_range(1..5) {
        let from = random.random_range(0..text.len() as u32) as usize;
        let to = (from + random.random_range(0..12) as usize).min(text.len());
        match random.random_range(0..3) {
            0 => drop(text.drain(from..to)),
            1 => drop(text.splice(from..from, pick(random, &ODD).chars())),
            _ => {
                let copy = text[from..to].to_vec();
                let at = random.random_range(0..text.len() as u32) as usize;
                drop(text.splice(at..at, copy));
            }
        }
        if text.is_empty() {
            break;
        }
    }
    text.into_iter().collect()
}
