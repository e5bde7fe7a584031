//! Reads parameter files of flight controllers, as ArduPilot and ground stations write them.

use std::path::{Path, PathBuf};

use crate::text_file;

/// Why a parameter file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ParameterFileError {
    /// The file cannot be read.
    #[error("the parameter file {path} {why}", path = path.display())]
    Read {
        /// Path of the parameter file.
        path: PathBuf,
        /// Reason why it cannot be read.
        why: String,
    },
    /// A line has neither of the two accepted forms.
    #[error(
        "{path}, line {line}: {text:?} is no parameter; write NAME VALUE, or as QGroundControl saves it",
        path = path.display()
    )]
    Line {
        /// Path of the parameter file.
        path: PathBuf,
        /// The number of the line, from 1.
        line: usize,
        /// Content of the line.
        text: String,
    },
    /// The flight stack simulates none of the file's parameters.
    #[error(
        "{path} has no parameter that the {stack} personality simulates; give the file of that stack",
        path = path.display()
    )]
    Foreign {
        /// Path of the parameter file.
        path: PathBuf,
        /// Name of the simulated flight stack.
        stack: String,
    },
}

/// Reads the names and values of the file at `path`, in the order of its lines.
///
/// A line has one of two forms. The first is `NAME VALUE`, separated by white space, a comma or `=` (ArduPilot, MAVProxy, Mission
/// Planner). The second is system, component, name, value and type (QGroundControl). A `#` begins a comment.
///
/// # Errors
/// If the file cannot be read, is longer than 1 MiB, or has a line of another form.
pub fn read(path: &Path) -> Result<Vec<(String, f64)>, ParameterFileError> {
    let text = text_file::read(path)
        .map_err(|why| ParameterFileError::Read { path: path.to_owned(), why })?;
    let lines = text.lines().enumerate().map(|(at, line)| (at, uncommented(line)));
    lines
        .filter(|(_, line)| !line.is_empty())
        .map(|(at, line)| {
            parameter(line).ok_or_else(|| ParameterFileError::Line {
                path: path.to_owned(),
                line: at + 1,
                text: line.to_owned(),
            })
        })
        .collect()
}

fn uncommented(line: &str) -> &str {
    line.split('#').next().unwrap_or_default().trim()
}

/// Name and value of a line; `None` if the line has neither accepted form.
fn parameter(line: &str) -> Option<(String, f64)> {
    let between = |c: char| c.is_whitespace() || matches!(c, ',' | '=');
    let words: Vec<&str> = line.split(between).filter(|word| !word.is_empty()).collect();
    let (name, value) = match words[..] {
        [name, value] | [name, value, "@READONLY"] => (name, value),
        [system, component, name, value, kind]
            if [system, component, kind].iter().all(|word| word.parse::<u8>().is_ok()) =>
        {
            (name, value)
        }
        _ => return None,
    };
    let named = name.starts_with(|c: char| c.is_ascii_uppercase())
        && name.len() <= 16
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let value: f64 = value.parse().ok().filter(|value: &f64| value.is_finite())?;
    named.then(|| (name.to_owned(), value))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> Result<Vec<(String, f64)>, ParameterFileError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.parm");
        std::fs::write(&path, text).unwrap();
        read(&path)
    }

    #[test]
    fn files_of_ardupilot_and_of_ground_stations_are_read() {
        let expected = [("RC_OVERRIDE_TIME".to_owned(), 0.5), ("MAV_GCS_SYSID".to_owned(), 1.0)];
        for text in [
            "# a comment\n\nRC_OVERRIDE_TIME 0.5\nMAV_GCS_SYSID 1 # ours\n",
            "RC_OVERRIDE_TIME,0.500000\r\nMAV_GCS_SYSID,1\r\n",
            "RC_OVERRIDE_TIME=0.5\nMAV_GCS_SYSID\t1 @READONLY\n",
            "# Onboard parameters for Vehicle 1\n1\t1\tRC_OVERRIDE_TIME\t0.5\t9\n1\t1\tMAV_GCS_SYSID\t1\t6\n",
        ] {
            assert_eq!(of(text).unwrap(), expected, "{text}");
        }
    }

    #[test]
    fn a_line_of_another_form_is_said_with_its_number() {
        for line in ["RC_OVERRIDE_TIME", "FS_LONG_ACTN RTL", "FS_GCS_ENABL nan", "a b c d", "{"] {
            let said = of(&format!("THR_FAILSAFE 1\n{line}\n")).unwrap_err().to_string();
            assert!(said.contains("line 2") && said.contains("write NAME VALUE"), "{said}");
        }
    }

    #[test]
    fn a_file_of_ten_megabytes_is_refused_before_it_is_taken_in() {
        let said = of(&"THR_FAILSAFE 1\n".repeat(700_000)).unwrap_err().to_string();
        assert!(said.contains("longer than 1024 KiB"), "{said}");
        let none = read(Path::new("no/such.parm")).unwrap_err().to_string();
        assert!(none.contains("name an existing file"), "{none}");
    }
}
