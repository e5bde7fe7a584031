//! Every dependency has a licence that `deny.toml` allows.

use std::process::Command;

use serde::Deserialize;

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
    // what was built is there, so nothing has to be fetched
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--workspace", "--all-features", "--locked", "--offline"])
        .args(["--prefix=none", "--format={p}|{l}"])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let Deny { licenses } = toml::from_str(&std::fs::read_to_string("deny.toml").unwrap()).unwrap();
    let listed = String::from_utf8(output.stdout).unwrap();
    let mut count = 0;
    let mut refused = Vec::new();
    // a package that is listed again ends with an asterisk, the packages of a member begin after an empty line
    for line in listed.lines().filter(|line| !line.ends_with("(*)") && !line.is_empty()) {
        let (package, licence) = line.split_once('|').unwrap();
        let name = package.split(' ').next().unwrap();
        let own: Vec<&String> =
            licenses.exceptions.iter().filter(|e| e.name == name).flat_map(|e| &e.allow).collect();
        let allowed = |licence: &str| {
            licenses.allow.iter().chain(own.iter().copied()).any(|other| other == licence)
        };
        // old manifests write / for OR
        if !is_met(&licence.replace('/', " OR "), &allowed) {
            refused.push(line);
        }
        count += 1;
    }
    assert!(count > 100, "{count} packages are not all");
    assert!(refused.is_empty(), "not allowed by deny.toml: {refused:#?}");
}
