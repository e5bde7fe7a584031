//! Text of an error for the user: each cause once, and only a remedy that applies.

use std::io::{self, ErrorKind};

use super::one_line::one_line;

/// General remedies in error texts. A remedy for the actual cause replaces them.
const ANY_CURE: [&str; 4] = [
    ": check the path and its permissions",
    "; check that its folder exists, can be written to and has room",
    "; check that it exists and may be read",
    "; name a file that exists",
];

/// Text of `error` as it is printed.
pub fn text(error: &anyhow::Error) -> String {
    let text = one_line(error);
    let system = error.chain().find_map(|cause| cause.downcast_ref::<io::Error>());
    match system.and_then(|system| cure(system.kind())) {
        Some(cure) => format!("{}; {cure}", plain(&text)),
        None => without_numbers(text),
    }
}

/// Remedy for an error of the operating system; `None` if the system's text must suffice.
fn cure(kind: ErrorKind) -> Option<&'static str> {
    match kind {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            Some("make room there, or write to another disk")
        }
        ErrorKind::PermissionDenied => {
            Some("change its permissions, or name a place that is yours")
        }
        ErrorKind::ReadOnlyFilesystem => Some("nothing can be written there: name another place"),
        ErrorKind::NotFound => Some("check the path"),
        ErrorKind::IsADirectory => Some("it is a folder: name a file"),
        _ => None,
    }
}

/// The text without the numbers that the system gives its errors.
fn without_numbers(mut text: String) -> String {
    while let Some(from) = text.find(" (os error ") {
        let Some(length) = text[from..].find(')') else { break };
        text.replace_range(from..=from + length, "");
    }
    text
}

/// The text without general remedies, error numbers of the system and names of temporary files.
fn plain(text: &str) -> String {
    let mut text = ANY_CURE.iter().fold(text.to_owned(), |text, any| text.replace(any, ""));
    text = without_numbers(text);
    if let Some(from) = text.find(" at path \"") {
        let end = text[from + 10..].find('"').map_or(text.len(), |end| from + 11 + end);
        text.replace_range(from..end, "");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cure_is_the_systems_and_no_temporary_name_is_shown() {
        let text_of = |kind: ErrorKind, code: i32, text: &str| {
            let system = io::Error::from_raw_os_error(code);
            assert_eq!(system.kind(), kind);
            super::text(&anyhow::Error::new(system).context(text.to_owned()))
        };
        // ENOSPC, EACCES, ENOENT
        let full = text_of(
            ErrorKind::StorageFull,
            28,
            "writing a.json: No space left on device (os error 28); check that its folder exists, can be written to and has room",
        );
        assert_eq!(
            full,
            "writing a.json: No space left on device; make room there, or write to another disk"
        );
        let denied = text_of(ErrorKind::PermissionDenied, 13, "cannot read a.csv");
        assert!(denied.starts_with("cannot read a.csv: Permission denied; change its"), "{denied}");
        let gone = text_of(ErrorKind::NotFound, 2, "making a folder at path \"/proc/.tmpEHi2\"");
        assert_eq!(gone, "making a folder: No such file or directory; check the path");
    }
}
