//! The layers of `src/lib.rs` as a table: a crate below `src` depends on those above it, and foreign crates stay at home.

use std::fs;
use std::path::{Path, PathBuf};

/// The rooms from the ground up, as `src/lib.rs` declares them.
const LAYERS: &[&str] = &[
    "num",
    "physics",
    "model",
    "control",
    "manoeuvres",
    "link",
    "logs",
    "flight",
    "sysid",
    "sim",
    "learn",
    "campaign",
    "report",
    "workbench",
    "commands",
];

/// Crates with the only rooms that may name them. A room may be narrowed to a folder below it.
const HOMES: &[(&str, &[&str])] = &[
    ("mavlink", &["link"]),
    ("tokio", &["link", "flight/runtime", "workbench/server"]),
    ("tokio_stream", &["workbench/server"]),
    ("axum", &["workbench/server"]),
    ("tokio_serial", &["link"]),
    ("burn", &["learn"]),
    ("clap", &["commands"]),
    ("clap_complete", &["commands"]),
    ("anyhow", &["commands"]),
    ("indicatif", &["commands"]),
    ("ruzstd", &["logs/ros"]),
    ("lz4_flex", &["logs/ros"]),
    ("comfy_table", &["commands"]),
    ("greylag_sitl", &["sim", "commands"]),
    ("nalgebra", &["num", "physics", "model", "control", "logs", "flight", "sysid", "learn"]),
];

/// What the pilot, a function, must not touch.
const PILOT_BANNED: &[&str] = &[
    "std::net",
    "std::time::Instant",
    "Instant::now",
    "SystemTime",
    "std::thread",
    "std::sync",
    "Mutex",
    "std::fs",
    "std::io",
    "crossbeam",
    "tokio",
    "println!",
    "eprintln!",
    "unwrap()",
    "panic!",
];

/// Test programs of one file, each with why it is no module of a room.
const ALONE: &[(&str, &str)] = &[
    ("clients", "an environment of Python programs, made once, and flights in real time"),
    ("interleavings", "the companion's sources with another `crate::threads`"),
    ("logs_mutation", "an allocator of its own, which counts memory"),
    ("stalls", "floods the machine, which no other test bears beside it"),
];

/// Lines of a source file at most.
const FILE_LINES: usize = 400;
/// Files that are longer, each with why it reads better whole.
const LONG_FILES: &[(&str, &str)] = &[
    ("physics/airframe.rs", "one file format: its fields, their checks, the errors that name them"),
    (
        "physics/formula/parser.rs",
        "one recursive descent: each function is one line of the grammar",
    ),
    (
        "physics/formula/file.rs",
        "one file format: its fields, their checks, the errors that name them",
    ),
    ("physics/formula/tape.rs", "one machine: its instructions and the loops that run them"),
];

/// Lines of a function at most.
const FUNCTION_LINES: usize = 60;
/// Functions that are longer, each with why it reads better whole.
const LONG_FUNCTIONS: &[(&str, &str, &str)] = &[
    ("link/wire/logged.rs", "logged", "a table: one arm a message, its fields by name"),
    (
        "control/cem/rollout.rs",
        "rollout",
        "one loop, inlined whole into each instruction set; a second copy of the model takes minutes to compile",
    ),
    (
        "physics/formula/tape.rs",
        "run",
        "a table: one arm an instruction, inlined for the registers",
    ),
    (
        "physics/formula/file.rs",
        "built",
        "the checks of a file in the order in which its reader needs them",
    ),
    (
        "sysid/diagnose/regression/columns.rs",
        "new",
        "one pass over a flight: its columns share what is computed at an instant",
    ),
    (
        "sysid/diagnose/proposal/sentences.rs",
        "sentences",
        "a page of text, in the order in which it is read",
    ),
];

/// Every source file below `src`, with its path below `src`.
fn sources() -> Vec<(String, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut folders = vec![root.clone()];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path: PathBuf = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let name = path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
                files.push((name, fs::read_to_string(&path).unwrap()));
            }
        }
    }
    files.sort();
    files
}

/// The code of a file: comments, and tests at its end, left out.
fn code(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(text);
    code.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

fn layer(room: &str) -> Option<usize> {
    LAYERS.iter().position(|l| *l == room)
}

/// Whether `word` stands in `text` as a path's first part.
fn names_crate(text: &str, word: &str) -> bool {
    let path = format!("{word}::");
    text.match_indices(&path).any(|(at, _)| {
        let before = text[..at].chars().next_back();
        !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
    })
}

#[test]
fn rooms_are_listed_in_the_order_of_their_layers() {
    let (_, lib) = sources().into_iter().find(|(name, _)| name == "lib.rs").unwrap();
    let listed: Vec<_> = lib
        .lines()
        .filter_map(|l| {
            l.strip_prefix("pub use greylag_")?.split_once(" as ").map(|(room, _)| room)
        })
        .collect();
    let places: Vec<_> = listed
        .iter()
        .map(|m| {
            layer(m).unwrap_or_else(|| panic!("{m} is in lib.rs but not in the table of layers"))
        })
        .collect();
    assert_eq!(places.len() + 1, LAYERS.len(), "all but the commands are crates: {listed:?}");
    assert!(places.is_sorted(), "lib.rs lists {listed:?}, out of the order of the layers");
}

/// Cargo refuses circles of crates; that the order is this one, it cannot know.
#[test]
fn crates_depend_only_on_those_above_them() {
    for (own, room) in LAYERS.iter().enumerate().filter(|(_, room)| **room != "commands") {
        let manifest =
            Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(room).join("Cargo.toml");
        let text = fs::read_to_string(&manifest).unwrap();
        for (place, used) in LAYERS.iter().enumerate() {
            let needed = text.lines().any(|l| {
                l.strip_prefix("greylag-")
                    .and_then(|l| l.strip_prefix(used))
                    .is_some_and(|rest| rest.starts_with(['.', ' ']))
            });
            assert!(
                !needed || place < own,
                "src/{room}/Cargo.toml needs greylag-{used}, a layer below"
            );
        }
    }
}

#[test]
fn crates_stay_at_home() {
    for (file, text) in sources() {
        for (name, homes) in HOMES {
            let home = homes.iter().any(|h| {
                file.strip_prefix(h)
                    .is_some_and(|rest| rest.starts_with('/') || rest.starts_with('.'))
            });
            assert!(
                home || !names_crate(&code(&text), name),
                "src/{file} names {name}, at home in {homes:?}"
            );
        }
    }
}

#[test]
fn the_pilot_is_a_function() {
    let pilot: Vec<_> =
        sources().into_iter().filter(|(name, _)| name.starts_with("flight/pilot")).collect();
    assert!(!pilot.is_empty(), "there is no src/flight/pilot");
    for (file, text) in pilot {
        for banned in PILOT_BANNED {
            assert!(!code(&text).contains(banned), "src/{file} uses {banned}");
        }
    }
}

#[test]
fn only_the_wire_names_messages() {
    for (file, text) in sources() {
        let wire = file == "link/wire.rs" || file.starts_with("link/wire/");
        let text = code(&text);
        assert!(
            wire || !text.contains("MavMessage::") && !text.contains("_DATA {"),
            "src/{file} names MAVLink messages, which only link/wire may"
        );
    }
}

#[test]
fn every_file_says_what_it_is_in_its_first_line() {
    for (file, text) in sources() {
        let first = text.lines().next().unwrap_or_default();
        assert!(first.starts_with("//! "), "src/{file} does not say what it is in its first line");
    }
}

#[test]
fn files_have_at_most_400_lines() {
    for (file, text) in sources() {
        let lines = text.lines().count();
        let excepted = LONG_FILES.iter().any(|(long, _)| *long == file);
        assert!(
            excepted || lines <= FILE_LINES,
            "src/{file} has {lines} lines: cut it where it has a joint, or say in LONG_FILES why it has none"
        );
    }
}

/// Names and lengths of the functions of rustfmt's `code`, signature and braces included.
fn functions(code: &str) -> Vec<(&str, usize)> {
    let lines: Vec<&str> = code.lines().collect();
    let mut found = Vec::new();
    for (first, line) in lines.iter().enumerate() {
        let code = line.trim_start();
        let Some((before, after)) = code.split_once("fn ") else { continue };
        let is_item = before.split_whitespace().all(|word| {
            word.starts_with("pub") || ["const", "async", "unsafe", "extern", "in"].contains(&word)
        });
        if !is_item || !after.starts_with(|c: char| c.is_alphabetic() || c == '_') {
            continue;
        }
        let has_body = lines[first..].iter().find_map(|l| match l.trim_end() {
            l if l.ends_with('{') => Some(true),
            l if l.ends_with(';') || l.ends_with('}') => Some(false),
            _ => None,
        });
        let end = format!("{}}}", &line[..line.len() - code.len()]);
        let length = lines[first..].iter().position(|l| *l == end).map_or(0, |last| last + 1);
        if has_body == Some(true) {
            let name = after.split(|c: char| !c.is_alphanumeric() && c != '_').next();
            found.push((name.unwrap_or_default(), length));
        }
    }
    found
}

#[test]
fn functions_have_at_most_60_lines() {
    for (file, text) in sources().into_iter().filter(|(name, _)| !name.ends_with("tests.rs")) {
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or(&text);
        for (name, lines) in functions(text) {
            let excepted = LONG_FUNCTIONS.iter().any(|long| (long.0, long.1) == (&*file, name));
            assert!(
                excepted || lines <= FUNCTION_LINES,
                "{name} in src/{file} has {lines} lines: cut it, or say in LONG_FUNCTIONS why it is whole"
            );
        }
    }
}

/// Each program links the whole library: a test is a module of its room's program, `tests/ROOM/main.rs`.
#[test]
fn tests_are_modules_of_rooms() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let mut alone: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .filter_map(|entry| {
            let path = entry.unwrap().path();
            let is_program = path.extension().is_some_and(|e| e == "rs");
            is_program.then(|| path.file_stem().unwrap().to_string_lossy().into_owned())
        })
        .collect();
    alone.sort();
    let listed: Vec<&str> = ALONE.iter().map(|(name, _)| *name).collect();
    assert_eq!(alone, listed, "move it into a room, or say in ALONE why it stands alone");
}

#[test]
fn exceptions_are_needed() {
    let sources = sources();
    let text = |file: &str| sources.iter().find(|(name, _)| name == file).map(|(_, text)| text);
    for (file, why) in LONG_FILES {
        let lines = text(file).map_or(0, |text| text.lines().count());
        assert!(lines > FILE_LINES && !why.is_empty(), "src/{file} needs no exception any more");
    }
    for (file, name, why) in LONG_FUNCTIONS {
        let all = text(file).map(|text| functions(text)).unwrap_or_default();
        let long = all.iter().any(|(other, lines)| other == name && *lines > FUNCTION_LINES);
        assert!(long && !why.is_empty(), "{name} in src/{file} needs no exception any more");
    }
}
