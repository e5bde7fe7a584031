//! What the tests of the documentation share.

pub mod cli;
pub mod commands;
pub mod effects;
pub mod markdown;
pub mod sitl;

/// The names between quotes that begin with `prefix` in a source file.
fn quoted(source: &str, keep: impl Fn(&str) -> bool) -> Vec<String> {
    let text = markdown::read(source);
    let code = text.split("#[cfg(test)]").next().unwrap_or_default().to_owned();
    let mut names: Vec<String> =
        code.split('"').skip(1).step_by(2).filter(|s| keep(s)).map(str::to_owned).collect();
    names.sort();
    names.dedup();
    assert!(!names.is_empty(), "{source} holds no such names any more");
    names
}

/// The parameters that clients see.
pub fn parameters() -> Vec<String> {
    let name = |s: &str| s.starts_with("GL_") && !s.contains(' ');
    quoted("src/flight/pilot/parameters.rs", name)
}

/// The columns of the log format.
pub fn log_columns() -> Vec<String> {
    quoted("src/logs/columns.rs", |s| !s.starts_with('_') && !s.is_empty())
}
