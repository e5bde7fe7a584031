//! Markdown files of the repository: their links, their headings.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

/// A Markdown file.
pub struct Page {
    pub path: PathBuf,
    pub text: String,
}

impl fmt::Display for Page {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.path.strip_prefix(root()).unwrap_or(&self.path).display())
    }
}

/// The repository.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// A file of the repository.
pub fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// A file of the repository; nothing if it is not there yet.
pub fn read_or_empty(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_default()
}

/// Writes a file of the repository.
pub fn write(path: &str, text: &str) {
    fs::write(root().join(path), text).unwrap();
}

/// Every page: at the top, and below the folders that hold sources.
pub fn pages() -> Vec<Page> {
    let mut paths = markdown_in(&root());
    for folder in ["docs", "sitl", "params", "src", "tests", "examples"] {
        below(&root().join(folder), &mut paths);
    }
    read_all(paths)
}

/// Pages of the dated notebook and of campaigns' tables. Their commands are those of their day, so only their links must hold.
pub fn records() -> Vec<Page> {
    let mut paths = Vec::new();
    below(&root().join("results"), &mut paths);
    read_all(paths)
}

fn read_all(mut paths: Vec<PathBuf>) -> Vec<Page> {
    paths.sort();
    paths.into_iter().map(|path| Page { text: fs::read_to_string(&path).unwrap(), path }).collect()
}

fn markdown_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.filter(|path| path.is_file() && path.extension().is_some_and(|e| e == "md")).collect()
}

fn below(folder: &Path, paths: &mut Vec<PathBuf>) {
    paths.extend(markdown_in(folder));
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !name.starts_with("target") && !name.starts_with('.') && name != "book"
        {
            below(&path, paths);
        }
    }
}

/// The text of the first fenced block of a language.
pub fn first_block(text: &str, language: &str) -> String {
    let (_, rest) = text.split_once(&format!("```{language}\n")).unwrap();
    rest.split("```").next().unwrap_or_default().to_owned()
}

/// The lines outside of fenced blocks.
fn prose(text: &str) -> impl Iterator<Item = &str> {
    let mut inside = false;
    text.lines().filter(move |line| {
        let fence = line.trim_start().starts_with("```");
        inside ^= fence;
        !fence && !inside
    })
}

/// The targets of links and pictures that stand relative to the page.
pub fn links(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for line in prose(text) {
        let line = without_code(line);
        for part in line.split("](").skip(1) {
            let target = part.split([')', ' ']).next().unwrap_or_default();
            let absolute = target.contains("://") || target.starts_with("mailto:");
            if !absolute && !target.is_empty() {
                found.push(target.to_owned());
            }
        }
    }
    found
}

/// A line without its inline code, which may hold brackets that are no link.
fn without_code(line: &str) -> String {
    line.split('`').step_by(2).collect::<Vec<_>>().join("``")
}

/// The anchors of the headings, as GitHub and mdBook make them.
pub fn anchors(text: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for line in prose(text) {
        let hashes = line.chars().take_while(|c| *c == '#').count();
        if !(1..=6).contains(&hashes) || !line[hashes..].starts_with(' ') {
            continue;
        }
        let slug = slug(line[hashes..].trim());
        let again = found.iter().filter(|a| {
            a.rsplit_once('-').map_or(**a == slug, |(s, n)| {
                **a == slug || (s == slug && n.parse::<usize>().is_ok())
            })
        });
        let count = again.count();
        found.push(if count == 0 { slug } else { format!("{slug}-{count}") });
    }
    found
}

fn slug(heading: &str) -> String {
    let kept = heading.to_lowercase();
    let kept = kept.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}
