//! Text of an error for the user. It states each cause once. If the operating system's error code names a remedy, general
//! remedies are left out.

use std::io::{self, ErrorKind};

use super::one_line::one_line;

/// General remedies that error texts contain. [`text`] replaces them by the remedy of [`cure`], if there is one.
///
/// A text that begins with another one stands before it.
const ANY_CURE: [&str; 6] = [
    ": check the path and its permissions",
    ": check the path",
    "; check that its folder exists, can be written to and has room",
    "; check that it exists and may be read and written",
    "; check that it exists and may be read",
    "; name a file that exists",
];

/// Text of `error` as it is printed, in one line.
pub fn text(error: &anyhow::Error) -> String {
    let text = one_line(error);
    let system = error.chain().find_map(|cause| cause.downcast_ref::<io::Error>());
    match system.and_then(|system| cure(system.kind())) {
        Some(cure) => format!("{}; {cure}", plain(&text)),
        None => without_numbers(text),
    }
}

/// Text of the operating system's error `cause`, for which standard output cannot be written.
pub fn no_output(cause: &str) -> String {
    let full = ["No space left", "quota"].iter().any(|word| cause.contains(word));
    let room = if full { "make room there or " } else { "" };
    let cause = without_numbers(cause.to_owned());
    format!("cannot write to standard output: {cause}; {room}send it elsewhere")
}

/// Remedy for an operating-system error of this kind; `None` if there is none.
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

/// The text without the operating system's error numbers, such as `(os error 28)`.
fn without_numbers(mut text: String) -> String {
    while let Some(from) = text.find(" (os error ") {
        let Some(length) = text[from..].find(')') else { break };
        text.replace_range(from..=from + length, "");
    }
    text
}

/// The text without general remedies, the operating system's error numbers and the path of a temporary file.
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
    fn an_output_that_cannot_be_written_has_a_cure() {
        assert_eq!(
            no_output("No space left on device (os error 28)"),
            "cannot write to standard output: No space left on device; make room there or send it elsewhere"
        );
        assert_eq!(
            no_output("Input/output error (os error 5)"),
            "cannot write to standard output: Input/output error; send it elsewhere"
        );
    }

    #[test]
    fn the_cure_is_the_systems_and_no_temporary_name_is_shown() {
        let text_of = |kind: ErrorKind, code: i32, text: &str| {
            let system = io::Error::from_raw_os_error(code);
            assert_eq!(system.kind(), kind);
            super::text(&anyhow::Error::new(system).context(text.to_owned()))
        };
        // the codes 28, 13 and 2 are ENOSPC, EACCES and ENOENT of Linux
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
        for remedy in [": check the path", "; check that it exists and may be read and written"] {
            let text = format!("cannot use a.csv: No such file or directory (os error 2){remedy}");
            let gone = text_of(ErrorKind::NotFound, 2, &text);
            assert_eq!(gone, "cannot use a.csv: No such file or directory; check the path");
        }
    }
}
