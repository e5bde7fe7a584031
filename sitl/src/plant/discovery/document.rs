//! Reads the property names in the files of an aircraft and sorts them by their use.

use std::collections::BTreeSet;
use std::path::Path;

use crate::aircraft;

/// Names of properties in an aircraft's files.
pub(super) struct Names {
    /// Properties that the systems read but do not write and whose names suggest a command.
    pub commands: Vec<String>,
    /// Properties that the aerodynamic functions read and whose names suggest a position.
    pub read: Vec<String>,
}

/// JSBSim's built-in properties, which exist without an entry in a file.
const USUAL: [&str; 3] = ["fcs/aileron-cmd-norm", "fcs/elevator-cmd-norm", "fcs/rudder-cmd-norm"];

impl Names {
    /// Reads the main document of `aircraft` and those files that it names; a file that cannot be read is left out.
    pub fn read(dir: &Path, aircraft: &str) -> Names {
        let given = (!dir.as_os_str().is_empty()).then_some(dir);
        let main = aircraft::read(given, aircraft).unwrap_or_default();
        let folder = dir.join(aircraft);
        let mut all = main.clone();
        for file in attributes(&main, "file") {
            let places = [
                folder.join(&file),
                folder.join("Systems").join(format!("{file}.xml")),
                folder.join(format!("{file}.xml")),
                dir.join("../systems").join(format!("{file}.xml")),
            ];
            if let Some(text) = places.iter().find_map(|p| std::fs::read_to_string(p).ok()) {
                all.push_str(&text);
            }
        }
        let all = without_comments(&all);
        let (aerodynamics, systems) = parted(&all);
        let written: BTreeSet<String> = written(&systems);
        let mut commands: BTreeSet<String> = USUAL.iter().map(|&n| n.to_owned()).collect();
        commands.extend(elements(&systems, "input"));
        commands.extend(elements(&systems, "property"));
        let command = |name: &String| {
            !written.contains(name)
                && (name.starts_with("fcs/") || name.contains("cmd") || name.contains("command"))
        };
        let read: BTreeSet<String> = elements(&aerodynamics, "property")
            .into_iter()
            .chain(elements(&aerodynamics, "independentVar"))
            .filter(|name| name.starts_with("fcs/") || name.contains("pos"))
            .collect();
        Names {
            commands: commands.into_iter().filter(command).collect(),
            read: read.into_iter().collect(),
        }
    }
}

/// Splits the text into the part within `<aerodynamics>` and the rest.
fn parted(all: &str) -> (String, String) {
    let (mut inside, mut outside, mut rest) = (String::new(), String::new(), all);
    while let Some(from) = rest.find("<aerodynamics") {
        let to = rest[from..].find("</aerodynamics>").map_or(rest.len(), |k| from + k);
        // an element that only refers to a file closes itself and has no end tag
        if rest[from..].find("/>").is_some_and(|k| !rest[from..from + k].contains('>')) {
            outside.push_str(&rest[..from + 1]);
            rest = &rest[from + 1..];
            continue;
        }
        outside.push_str(&rest[..from]);
        inside.push_str(&rest[from..to]);
        rest = &rest[to..];
    }
    outside.push_str(rest);
    (inside, outside)
}

/// Properties that components write: their outputs, and the properties derived from the names of the components.
fn written(systems: &str) -> BTreeSet<String> {
    let mut all: BTreeSet<String> = elements(systems, "output").into_iter().collect();
    for component in attributes(systems, "name") {
        all.insert(component.clone());
        all.insert(format!("fcs/{}", component.to_lowercase().replace(' ', "-")));
    }
    all
}

/// Names within `<tag …>…</tag>`, without their sign.
fn elements(text: &str, tag: &str) -> Vec<String> {
    let after = |part: &str| {
        let (attributes, rest) = part.split_once('>')?;
        // the prefix <input also matches <inputs>, which is another element
        let own = attributes.is_empty() || attributes.starts_with(char::is_whitespace);
        let name = rest.split('<').next()?.trim().trim_start_matches('-');
        (own && !name.is_empty() && !name.contains(char::is_whitespace)).then(|| name.to_owned())
    };
    text.split(&format!("<{tag}")).skip(1).filter_map(after).collect()
}

/// Values of the attribute `name` of all elements.
fn attributes(text: &str, name: &str) -> Vec<String> {
    let open = format!(" {name}=\"");
    text.split(&open).skip(1).filter_map(|part| Some(part.split_once('"')?.0.to_owned())).collect()
}

fn without_comments(text: &str) -> String {
    let mut parts = text.split("<!--");
    let mut out = parts.next().unwrap_or_default().to_owned();
    parts.for_each(|part| out.push_str(part.split_once("-->").map_or("", |(_, rest)| rest)));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_by_their_tags() {
        let text = "<inputs><input>-fcs/a</input> <input type=\"x\"> fcs/b </input><output>fcs/c</output></inputs>";
        let found = elements(text, "input");
        assert_eq!(found, ["fcs/a", "fcs/b"]);
        assert_eq!(without_comments("a<!-- <input>x</input> -->b"), "ab");
        let (inside, outside) = parted("<x/><aerodynamics>in</aerodynamics><y/>");
        assert!(inside.contains("in") && outside.contains("<y/>") && !outside.contains("in<"));
    }
}
