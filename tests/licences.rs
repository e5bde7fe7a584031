//! Every dependency has a licence that `deny.toml` allows.

use std::process::Command;

use serde::Deserialize;

/// What `cargo metadata` says of the packages that are built for this machine.
#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
}

#[derive(Deserialize)]
struct Package {
    name: String,
    /// An SPDX expression; old manifests write `/` for OR.
    license: Option<String>,
}

/// The part of `deny.toml` about licences.
#[derive(Deserialize)]
struct Deny {
    licenses: Licenses,
}

#[derive(Deserialize)]
struct Licenses {
    allow: Vec<String>,
    exceptions: Vec<Exception>,
}

#[derive(Deserialize)]
struct Exception {
    #[serde(rename = "crate")]
    name: String,
    allow: Vec<String>,
}

/// The parts of `expression` between `word`s that stand in no parentheses.
fn parts<'a>(expression: &'a str, word: &str) -> Vec<&'a str> {
    let (mut parts, mut depth, mut start) = (Vec::new(), 0_i32, 0);
    for (at, letter) in expression.char_indices() {
        depth += i32::from(letter == '(') - i32::from(letter == ')');
        if depth == 0 && at >= start && expression[at..].starts_with(word) {
            parts.push(&expression[start..at]);
            start = at + word.len();
        }
    }
    parts.push(&expression[start..]);
    parts
}

/// Whether an SPDX expression can be met by licences of which `allowed` holds.
fn is_met(expression: &str, allowed: &dyn Fn(&str) -> bool) -> bool {
    let expression = expression.trim();
    let either = parts(expression, " OR ");
    if either.len() > 1 {
        return either.iter().any(|part| is_met(part, allowed));
    }
    let both = parts(expression, " AND ");
    if both.len() > 1 {
        return both.iter().all(|part| is_met(part, allowed));
    }
    match expression.strip_prefix('(').and_then(|inner| inner.strip_suffix(')')) {
        Some(inner) => is_met(inner, allowed),
        None => allowed(expression),
    }
}

#[test]
fn expressions_are_read_as_spdx_has_them() {
    let allowed = |licence: &str| ["MIT", "ISC"].contains(&licence);
    for met in ["MIT", "GPL-3.0-only OR MIT", "MIT AND ISC", "(MIT OR Apache-2.0) AND ISC"] {
        assert!(is_met(met, &allowed), "{met}");
    }
    for open in ["Apache-2.0", "MIT AND NCSA", "(Zlib OR Apache-2.0) AND ISC", "ISC WITH x"] {
        assert!(!is_met(open, &allowed), "{open}");
    }
}

#[test]
fn every_dependency_has_a_licence_that_is_allowed() {
    let platform = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    // what was built is there, so nothing has to be fetched
    let output = Command::new(env!("CARGO"))
        .args(["metadata", "--format-version=1", "--locked", "--offline", "--all-features"])
        .args(["--filter-platform", &platform])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Metadata = serde_json::from_slice(&output.stdout).unwrap();
    let Deny { licenses } = toml::from_str(&std::fs::read_to_string("deny.toml").unwrap()).unwrap();
    let refused: Vec<String> = metadata
        .packages
        .iter()
        .filter(|package| {
            let own = licenses.exceptions.iter().filter(|e| e.name == package.name);
            let own: Vec<&String> = own.flat_map(|e| &e.allow).collect();
            let allowed = |licence: &str| {
                licenses.allow.iter().chain(own.iter().copied()).any(|other| other == licence)
            };
            let expression = package.license.as_deref().unwrap_or_default().replace('/', " OR ");
            !is_met(&expression, &allowed)
        })
        .map(|package| format!("{}: {}", package.name, package.license.as_deref().unwrap_or("-")))
        .collect();
    assert!(refused.is_empty(), "not allowed by deny.toml: {refused:#?}");
}
