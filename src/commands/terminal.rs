//! Output on a terminal: tables of limited width, coloured text, and the first and last lines of a command.

use std::fmt::Arguments;
use std::io::{self, IsTerminal, Write};

#[cfg(feature = "study")]
use comfy_table::ColumnConstraint;
use comfy_table::{CellAlignment, ContentArrangement, LineStyle, Table, TableStyle};

use crate::sysid::compare::Answer;

/// Half width of a 95 % interval, in standard deviations. The number after ± is this half width in every output.
#[cfg(feature = "study")]
pub const NORMAL_95: f64 = 1.96;
/// Largest width of tables and texts, characters.
pub const WIDTH: u16 = 100;

/// Names in the first column are kept on one line if the longest of them has at most this number of characters.
#[cfg(feature = "study")]
const NAME: usize = 40;

/// Borders of a table: a line above the header, one below it, and one below the last row.
const LINES: TableStyle = TableStyle::new()
    .top_border(LineStyle::none().fill('─').junction('─'))
    .header_separator(LineStyle::none().fill('─').junction('─'))
    .bottom_border(LineStyle::none().fill('─').junction('─'));

/// A table no wider than [`WIDTH`]. Columns from index `words` on hold numbers and are aligned to the right.
pub fn table<const N: usize>(header: [&str; N], words: usize) -> Table {
    let mut table = Table::new();
    table.load_style(LINES);
    table.set_content_arrangement(ContentArrangement::Dynamic).set_width(WIDTH);
    table.set_header(header);
    for column in table.column_iter_mut().skip(words) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// `table` without line breaks in the names of its first column, if the longest name has at most 40 characters.
#[cfg(feature = "study")]
pub fn whole_names(mut table: Table) -> Table {
    let longest = table
        .row_iter()
        .filter_map(|row| row.cell_iter().next())
        .map(|c| c.content().chars().count());
    if longest.max().is_some_and(|letters| letters <= NAME)
        && let Some(column) = table.column_mut(0)
    {
        column.set_constraint(ColumnConstraint::ContentWidth);
    }
    table
}

/// Meaning of a text, which sets its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// A good result.
    Good,
    /// A bad result.
    Bad,
    /// Neither good nor bad.
    Plain,
}

/// `text` in the colour of `tone` on a terminal. The text is unchanged elsewhere, or if NO_COLOR is set.
pub fn painted(text: &str, tone: Tone) -> String {
    let plain = !io::stdout().is_terminal() || std::env::var_os("NO_COLOR").is_some();
    match tone {
        _ if plain => text.to_owned(),
        Tone::Good => format!("\u{1b}[1;32m{text}\u{1b}[0m"),
        Tone::Bad => format!("\u{1b}[1;31m{text}\u{1b}[0m"),
        Tone::Plain => format!("\u{1b}[1m{text}\u{1b}[0m"),
    }
}

/// `text` in lines of at most [`WIDTH`] characters, broken between words. Continuation lines are indented by two spaces. A
/// longer word has a line to itself.
#[cfg(any(feature = "demo", test))]
pub fn broken(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let line = lines.last_mut().map_or(0, |line| line.chars().count());
        if line > 0 && line + 1 + word.chars().count() > usize::from(WIDTH) {
            lines.push(format!("  {word}"));
        } else if let Some(last) = lines.last_mut() {
            if line > 0 {
                last.push(' ');
            }
            last.push_str(word);
        }
    }
    lines.join("\n")
}

/// Prints a line to standard output and ignores all errors. `println!` would end the program on a full disk, and the flight
/// with it.
pub fn say(line: Arguments<'_>) {
    let _ = writeln!(io::stdout(), "{line}");
}

/// Prints an error of the program to standard error. A closed standard error is ignored, as in [`say`].
pub fn complain(line: Arguments<'_>) {
    let _ = writeln!(io::stderr(), "greylag: {line}");
}

/// Prints the short answer of a command in up to three lines, before its other output. The first line is green if the
/// prediction error falls, and red if it rises or a forecast without aerodynamics is better. It has no colour if a fitted model
/// is hardly better than such a forecast.
pub fn print_answer(answer: &Answer) {
    let tone = match answer.numbers.change_percent {
        _ if answer.behind_baseline() => Tone::Bad,
        p if p <= -0.05 && answer.gains_nothing() => Tone::Plain,
        p if p <= -0.05 => Tone::Good,
        p if p >= 0.05 => Tone::Bad,
        _ => Tone::Plain,
    };
    let mut lines = answer.lines();
    lines.next().into_iter().for_each(|first| println!("{}", painted(first, tone)));
    lines.for_each(|line| println!("{line}"));
    println!();
}

/// The line of a note of a result. It begins with one word of severity.
pub fn noted(note: &str) -> String {
    match ["note: ", "warning: ", "problem: "].iter().any(|word| note.starts_with(*word)) {
        true => note.to_owned(),
        false => format!("note: {note}"),
    }
}

/// Prints the last lines of a command: its summary, and the command to run next.
pub fn print_summary(answer: &Answer) {
    println!("\n{}", answer.summary());
    print_next(&answer.next);
}

/// Prints the command to run next; nothing if it is empty.
pub fn print_next(command: &str) {
    if !command.is_empty() {
        println!("next: {command}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_broken_between_words() {
        let text = "a word ".repeat(40);
        let out = broken(text.trim());
        assert!(out.lines().count() == 3 && out.lines().all(|line| line.chars().count() <= 100));
        assert_eq!(out.replace("\n  ", " "), text.trim());
        assert_eq!(broken("short"), "short");
    }

    #[test]
    fn a_note_has_one_severity() {
        use crate::logs::finding::Finding;
        assert_eq!(noted(&Finding::note("short").noted("a.csv")), "note: a.csv: short");
        assert_eq!(noted(&Finding::problem("short").noted("a.csv")), "problem: a.csv: short");
    }
}
