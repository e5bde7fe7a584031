//! Commands that run an amendment, and what each of them prints about it.

use crate::commands::terminal::print_summary;
use crate::sysid::compare::Answer;

/// Command that runs the amendment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caller {
    /// `greylag amend`.
    Amend,
    /// `greylag aircraft from-log`, which lacks the options of `amend` and prints the next command itself.
    FromLog,
}

impl Caller {
    /// Sentence on a fit that is not written. It names an option only if the command has it.
    pub fn unwritten(self) -> &'static str {
        match self {
            Caller::Amend => "Nothing was written; --accept-anyway writes the fit.",
            Caller::FromLog => "The fit was not written.",
        }
    }

    /// Prints the last lines of the amendment.
    pub fn print_summary(self, answer: &Answer) {
        match self {
            Caller::Amend => print_summary(answer),
            Caller::FromLog => println!("\n{}", answer.summary()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fit_that_is_not_written_names_only_options_of_the_command() {
        assert!(Caller::Amend.unwritten().contains("--accept-anyway"));
        assert!(!Caller::FromLog.unwritten().contains("--"));
    }
}
