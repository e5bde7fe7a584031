//! Command lines in the fenced blocks of a page.

use std::fmt;

/// One call of the program or of the simulator.
#[derive(Debug)]
pub struct Invocation {
    /// `greylag` or `greylag-sitl`.
    pub program: &'static str,
    /// What follows it.
    pub words: Vec<String>,
}

impl fmt::Display for Invocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.program, self.words.join(" "))
    }
}

impl Invocation {
    /// The long options that are given.
    pub fn options(&self) -> impl Iterator<Item = &str> {
        let names = self.words.iter().filter(|w| w.starts_with("--") && w.len() > 2);
        names.map(|w| w.split('=').next().unwrap_or(w))
    }
}

/// Every call in the shell blocks of a page.
pub fn invocations(text: &str) -> Vec<Invocation> {
    shell_lines(text).iter().flat_map(|line| simple_commands(line)).filter_map(of).collect()
}

/// The lines of blocks marked `sh` or `bash`, continued lines joined.
fn shell_lines(text: &str) -> Vec<String> {
    let (mut lines, mut inside, mut joined) = (Vec::new(), false, String::new());
    for line in text.lines() {
        let trimmed = line.trim();
        if let Some(language) = trimmed.strip_prefix("```") {
            inside = !inside && matches!(language, "sh" | "bash");
            continue;
        }
        if !inside {
            continue;
        }
        match trimmed.strip_suffix('\\') {
            Some(part) => joined += part,
            None => lines.push(std::mem::take(&mut joined) + trimmed),
        }
    }
    lines
}

/// The commands of a line, as words; comments left out.
fn simple_commands(line: &str) -> Vec<Vec<String>> {
    let line = if line.starts_with('#') { "" } else { line.split(" #").next().unwrap_or(line) };
    let parts = line.split([';', '|', '&', '(', ')']);
    parts.map(|part| part.split_whitespace().map(str::to_owned).collect()).collect()
}

fn of(words: Vec<String>) -> Option<Invocation> {
    let leading =
        |w: &String| matches!(w.as_str(), "do" | "time" | "sudo" | "then") || w.contains('=');
    let start = words.iter().position(|w| !leading(w))?;
    let (program, first) = (words[start].as_str(), words.get(start + 1).map(String::as_str));
    let rest = |from: usize| words[from.min(words.len())..].to_vec();
    let (program, words) = match (program.rsplit('/').next()?, first) {
        ("cargo", Some("greylag" | "learn")) => ("greylag", rest(start + 2)),
        ("cargo", Some("demo" | "fly")) => ("greylag", rest(start + 1)),
        ("cargo", Some("sitl")) => ("greylag-sitl", rest(start + 2)),
        ("greylag", _) => ("greylag", rest(start + 1)),
        ("greylag-sitl", _) => ("greylag-sitl", rest(start + 1)),
        _ => return None,
    };
    Some(Invocation { program, words })
}
