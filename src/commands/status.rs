//! Exit statuses that several commands share. The status 2 of clap means a wrong command line.

/// Done, but in doubt: a log was left out or has a problem that makes the results wrong, an effect was refused, or
/// flights contradict one another.
pub const IN_DOUBT: u8 = 3;
/// Not done, and a later attempt may succeed: `EX_TEMPFAIL` of sysexits.h.
#[cfg(feature = "study")]
pub const TRY_AGAIN: u8 = 75;
/// Exit status after Ctrl-C: 128 plus the number of SIGINT.
pub const INTERRUPTED: u8 = 130;
