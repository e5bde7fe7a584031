//! Text of an error with its causes, on one line and without repetition.

/// Joins `error` and its causes in one line. A cause that the text already contains is omitted.
pub fn one_line(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |said, cause| {
        match (said.is_empty(), said.contains(&cause)) {
            (true, _) => cause,
            (false, true) => said,
            (false, false) => format!("{said}: {cause}"),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_that_the_text_holds_is_not_said_again() {
        let twice = anyhow::anyhow!("line 3: no gain").context("cannot load: line 3: no gain");
        assert_eq!(one_line(&twice), "cannot load: line 3: no gain");
        let once = anyhow::anyhow!("disk full").context("cannot write a.csv");
        assert_eq!(one_line(&once), "cannot write a.csv: disk full");
    }
}
