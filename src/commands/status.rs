//! Exit statuses that several commands share. In addition, clap ends the program with status 2 after a wrong command line.

/// Done, but the result is incomplete or in doubt. Examples: a log was left out or has a problem, an effect was refused, a fit
/// is no better and was not written, no formula is proposed, cells of a campaign are missing, or an aircraft has implausible values.
pub const IN_DOUBT: u8 = 3;
/// Not done, but a later attempt may succeed. The value is that of `EX_TEMPFAIL` in sysexits.h.
#[cfg(feature = "study")]
pub const TRY_AGAIN: u8 = 75;
/// Exit status after Ctrl-C: 128 plus the number of SIGINT.
pub const INTERRUPTED: u8 = 130;
