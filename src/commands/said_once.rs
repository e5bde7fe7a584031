//! An error with its causes in one line, each said once.

/// `error` with those of its causes that its text does not hold already.
pub fn said_once(error: &anyhow::Error) -> String {
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
        assert_eq!(said_once(&twice), "cannot load: line 3: no gain");
        let once = anyhow::anyhow!("disk full").context("cannot write a.csv");
        assert_eq!(said_once(&once), "cannot write a.csv: disk full");
    }
}
