//! The documentation holds: links resolve, commands parse, generated pages are current.
//!
//! `GREYLAG_WRITE_DOCS=1 cargo test --ignore-rust-version --no-default-features --features sitl --test house docs::`
//! writes the generated pages anew.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use greylag::logs::mapping::Mapping;
use greylag::manoeuvres::Schedule;
use greylag::physics::Airframe;

use crate::docs_support::commands::{Invocation, invocations};
use crate::docs_support::markdown::{self, Page, anchors, links, pages, records, root};
use crate::docs_support::{self, cli, effects, sitl};

/// The README is read in ten minutes.
const README_LINES: usize = 150;
/// A validation page is a claim, a table, a command and limits.
const VALIDATION_WORDS: usize = 600;
/// Words of all pages below `docs` that are not generated.
const DOCS_WORDS: usize = 55_000;
/// Words of one conversation, which tell a reader of the repository nothing.
const PRIVATE: [&str; 4] = ["the issue", "(asked:", "/work/", "asked was"];
const AGAIN: &str = "write it anew: GREYLAG_WRITE_DOCS=1 cargo test --ignore-rust-version \
                     --no-default-features --features sitl --test house docs::";

fn fail_with(problems: Vec<String>) {
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}

#[test]
fn every_relative_link_and_anchor_resolves() {
    let mut problems = Vec::new();
    for page in pages().into_iter().chain(records()) {
        let folder = page.path.parent().unwrap();
        for link in links(&page.text) {
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if file.is_empty() { page.path.clone() } else { folder.join(file) };
            if !target.exists() {
                problems.push(format!("{page}: {link} points to no file"));
            } else if !anchor.is_empty() && target.extension().is_some_and(|e| e == "md") {
                let text = fs::read_to_string(&target).unwrap();
                if !anchors(&text).iter().any(|a| a == anchor) {
                    problems.push(format!("{page}: {link} points to no heading"));
                }
            }
        }
    }
    fail_with(problems);
}

#[test]
fn every_page_of_the_book_is_in_its_summary() {
    let summary = markdown::read("docs/SUMMARY.md");
    let listed = links(&summary);
    let docs = root().join("docs");
    let pages = pages();
    let inside = pages.iter().filter_map(|page| page.path.strip_prefix(&docs).ok());
    let missing = inside
        .map(|path| path.to_string_lossy().replace('\\', "/"))
        .filter(|path| path != "SUMMARY.md" && !path.contains("pending-"))
        .filter(|path| !listed.contains(path));
    fail_with(missing.map(|path| format!("docs/SUMMARY.md does not list {path}")).collect());
}

#[test]
fn every_command_of_the_documentation_parses() {
    let sections = cli::sections(&markdown::read(cli::PAGE));
    let mut problems = Vec::new();
    let mut seen = 0;
    for page in pages() {
        for invocation in invocations(&page.text) {
            seen += 1;
            problems.extend(wrong_with(&page, &invocation, &sections));
        }
    }
    // README and tutorials have more than forty: fewer means that the reader has gone blind
    assert!(seen > 40, "only {seen} commands were found");
    fail_with(problems);
}

fn wrong_with(
    page: &Page,
    command: &Invocation,
    sections: &BTreeMap<String, String>,
) -> Vec<String> {
    let at = |why: String| format!("{page}: `{command}`: {why}");
    if command.program == "greylag-sitl" {
        let unknown = command.options().filter(|option| !sitl::has(option));
        return unknown.map(|option| at(format!("the simulator has no {option}"))).collect();
    }
    let (name, help) = match cli::section_of(sections, &command.words) {
        Ok(found) => found,
        Err(why) => return vec![at(why)],
    };
    let unknown = command.options().filter(|option| !cli::offers(help, option));
    unknown.map(|option| at(format!("`{name}` has no {option}"))).collect()
}

#[test]
fn the_page_of_commands_is_what_the_program_says() {
    let written = cli::sections(&markdown::read_or_empty(cli::PAGE));
    let current = cli::of_the_program();
    if writing() {
        return markdown::write(cli::PAGE, &cli::page(&written, &current));
    }
    let holds = |name: &str, help: &str| {
        written.get(name).is_some_and(|page| cli::is_current(page, name, help))
    };
    let stale = current.iter().filter(|(name, help)| !holds(name, help));
    fail_with(
        stale.map(|(name, _)| format!("{}: `{name}` is stale; {AGAIN}", cli::PAGE)).collect(),
    );
}

#[test]
fn the_page_of_effects_is_what_the_catalogue_holds() {
    let current = effects::page();
    if writing() {
        return markdown::write(effects::PAGE, &current);
    }
    assert!(
        markdown::read_or_empty(effects::PAGE) == current,
        "{} is stale; {AGAIN}",
        effects::PAGE
    );
}

#[test]
fn the_page_of_parameters_names_each_with_its_default() {
    let page = markdown::read("docs/reference/parameters.md");
    for name in docs_support::parameters() {
        assert!(page.contains(&format!("`{name}`")), "docs/reference/parameters.md lacks {name}");
    }
}

#[test]
fn the_page_of_log_columns_names_each() {
    let page = markdown::read("docs/reference/log-columns.md");
    for name in docs_support::log_columns() {
        assert!(page.contains(&format!("`{name}`")), "docs/reference/log-columns.md lacks {name}");
    }
}

#[test]
fn examples_of_file_formats_are_read() {
    let example = |page: &str| markdown::first_block(&markdown::read(page), "toml");
    Airframe::parse(&example("docs/reference/airframe-file.md")).unwrap();
    Schedule::parse(&example("docs/reference/schedule-file.md")).unwrap();
    Mapping::parse(&example("docs/how-to/map-a-log.md"), Path::new("mapping.toml")).unwrap();
}

#[test]
fn no_page_speaks_of_what_only_its_writer_knows() {
    let mut problems = Vec::new();
    for page in pages() {
        let text = page.text.to_lowercase();
        let said = PRIVATE.iter().filter(|words| text.contains(**words));
        problems.extend(said.map(|words| format!("{page} says {words:?}")));
    }
    fail_with(problems);
}

#[test]
fn the_readme_is_short_and_names_the_two_commands_to_begin_with() {
    let readme = markdown::read("README.md");
    let lines = readme.lines().count();
    assert!(lines <= README_LINES, "README.md has {lines} lines; {README_LINES} is the most");
    for command in ["cargo demo", "cargo verify"] {
        assert!(readme.contains(command), "README.md does not name `{command}`");
    }
}

#[test]
fn what_is_written_by_hand_is_short() {
    let docs = root().join("docs");
    let generated = [root().join(cli::PAGE), root().join(effects::PAGE)];
    let mut problems = Vec::new();
    let mut total = 0;
    for page in pages() {
        if !page.path.starts_with(&docs) || generated.contains(&page.path) {
            continue;
        }
        let words = page.text.split_whitespace().count();
        total += words;
        if page.path.starts_with(docs.join("validation")) && words > VALIDATION_WORDS {
            problems.push(format!(
                "{page} has {words} words; {VALIDATION_WORDS} is the most: what was found on the \
                 way belongs into results/notes"
            ));
        }
    }
    if total > DOCS_WORDS {
        problems.push(format!("docs has {total} words; {DOCS_WORDS} is the most"));
    }
    fail_with(problems);
}

#[test]
fn pictures_are_small() {
    for entry in fs::read_dir(root().join("docs/pictures")).unwrap() {
        let path = entry.unwrap().path();
        let size = fs::metadata(&path).unwrap().len();
        // a clone should stay quick, and a page load too
        assert!(size < 200_000, "{} has {size} bytes", path.display());
    }
}

fn writing() -> bool {
    std::env::var_os("GREYLAG_WRITE_DOCS").is_some()
}

#[test]
fn anchors_are_those_of_the_usual_renderers() {
    let text = "# A `b` (c): d\n## Same\n## Same\n```sh\n# no heading\n```\n";
    assert_eq!(anchors(text), ["a-b-c-d", "same", "same-1"]);
    assert!(Path::new(&root()).join("Cargo.toml").exists());
}
