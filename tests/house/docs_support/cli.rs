//! The page of the command line, made of the program's own help.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};

/// Where the page stands.
pub const PAGE: &str = "docs/reference/cli.md";

const HEAD: &str = "# Command line

This page is generated from `greylag --help` and the help of every subcommand. `tests/house/docs.rs` keeps it current.
`cargo greylag …` runs the same program from the repository; `greylag train` is in builds with the feature `learn`
(`cargo learn train …`). What a command returns stands in [exit statuses](exit-statuses.md).
";

/// The help of every command of this build, by its full name.
pub fn of_the_program() -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    let mut open = vec![vec![]];
    while let Some(path) = open.pop() {
        let help = help(&path);
        for name in subcommands(&help) {
            open.push([path.clone(), vec![name]].concat());
        }
        found.insert([vec!["greylag".to_owned()], path].concat().join(" "), help);
    }
    found
}

fn help(path: &[String]) -> String {
    let mut command = Command::new(env!("CARGO_BIN_EXE_greylag"));
    // a terminal of another width would wrap the text elsewhere
    let command = command.args(path).arg("--help").env("COLUMNS", "100").stdin(Stdio::null());
    let output = command.output().unwrap();
    assert!(output.status.success(), "greylag {} --help failed", path.join(" "));
    let text = String::from_utf8(output.stdout).unwrap();
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    lines.join("\n").trim().to_owned()
}

/// The names below `Commands:` in a help text.
fn subcommands(help: &str) -> Vec<String> {
    let list = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let list = list.take_while(|line| line.starts_with("  "));
    let entries = list.filter(|line| !line.starts_with("   "));
    let names = entries.filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").map(str::to_owned).collect()
}

/// Whether the page says what the program does. A build without a feature lacks commands in the list
/// of all of them, and they may stand in the page.
pub fn is_current(page: &str, name: &str, help: &str) -> bool {
    let whole = cfg!(all(feature = "sitl", feature = "learn")) || name != "greylag";
    page == help || (!whole && help.lines().all(|line| page.contains(line)))
}

/// The page: this build's commands, and those that only another build has as they stand.
pub fn page(written: &BTreeMap<String, String>, current: &BTreeMap<String, String>) -> String {
    let mut all = written.clone();
    for (name, help) in current {
        if !written.get(name).is_some_and(|page| is_current(page, name, help)) {
            all.insert(name.clone(), help.clone());
        }
    }
    let sections = all.iter().map(|(name, help)| format!("\n## {name}\n\n```text\n{help}\n```\n"));
    HEAD.to_owned() + &sections.collect::<String>()
}

/// The help texts of a page, by the commands' full names.
pub fn sections(page: &str) -> BTreeMap<String, String> {
    let sections = page.split("\n## ").skip(1);
    let of = |section: &str| {
        let (name, rest) = section.split_once('\n')?;
        let help = rest.trim().strip_prefix("```text\n")?.strip_suffix("\n```")?;
        Some((name.to_owned(), help.to_owned()))
    };
    sections.filter_map(of).collect()
}

/// The longest command that the words begin with, and its help.
pub fn section_of<'a>(
    sections: &'a BTreeMap<String, String>,
    words: &[String],
) -> Result<(String, &'a str), String> {
    let mut name = "greylag".to_owned();
    for word in words {
        let longer = format!("{name} {word}");
        if !sections.contains_key(&longer) {
            break;
        }
        name = longer;
    }
    let help = sections.get(&name).ok_or_else(|| format!("{PAGE} has no `{name}`"))?;
    let option = words.first().is_none_or(|w| w.starts_with('-') || w == "help");
    if help.contains("\nCommands:\n") && !option && words.len() >= name.split(' ').count() {
        let next = &words[name.split(' ').count() - 1];
        if !next.starts_with('-') && next != "…" {
            return Err(format!("`{name}` has no subcommand {next}"));
        }
    }
    Ok((name, help))
}

/// Whether a help text offers a long option.
pub fn offers(help: &str, option: &str) -> bool {
    let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '-');
    let known = help.match_indices(option).any(|(at, _)| ends(&help[at + option.len()..]));
    known || matches!(option, "--help" | "--version")
}
