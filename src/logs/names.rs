//! Names for the flights of several logs, such that no two flights have the same name.

use std::path::Path;

/// A name for the flight of each log: its file name, or its path as given if another log has the same file name.
pub fn names<P: AsRef<Path>>(logs: &[P]) -> Vec<String> {
    let short = |path: &P| {
        let path = path.as_ref();
        path.file_name().map_or(path.display().to_string(), |n| n.to_string_lossy().into_owned())
    };
    let all: Vec<String> = logs.iter().map(short).collect();
    let alone = |name: &String| all.iter().filter(|n| *n == name).count() == 1;
    let pick = |(path, name): (&P, &String)| match alone(name) {
        true => name.clone(),
        false => path.as_ref().display().to_string(),
    };
    logs.iter().zip(&all).map(pick).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_files_of_one_name_are_called_by_their_paths() {
        let called = names(&["/a/flight.csv", "/b/flight.csv", "/b/other.csv"]);
        assert_eq!(called, ["/a/flight.csv", "/b/flight.csv", "other.csv"]);
    }
}
