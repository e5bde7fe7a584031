//! The options of the simulator, read from its sources: its program belongs to another package.

use super::markdown::root;

/// Whether an option is declared in the simulator's sources.
pub fn has(option: &str) -> bool {
    let name = option.trim_start_matches("--");
    let field = format!("{}:", name.replace('-', "_"));
    let named = format!("\"{name}\"");
    let mut folders = vec![root().join("sitl/src")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(path).unwrap();
                let declares = |line: &str| line.trim_start().starts_with(&field);
                if text.contains("#[arg") && (text.lines().any(declares) || text.contains(&named)) {
                    return true;
                }
            }
        }
    }
    false
}
