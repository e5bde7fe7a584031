//! A tick as a row of `flight.csv`.

use std::io::Write;

use crate::flight::pilot::{Decision, mode_name};
use crate::logs::Sample;
use crate::logs::csv::Rows;

/// One tick: what was seen, what was decided, how long it took.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// The columns of the log format.
    pub sample: Sample,
    /// What was decided.
    pub decision: Decision,
    /// From the arrival of the state frame to the sending of the command, µs.
    pub latency_us: f64,
}

impl Row {
    /// The columns beside those of the log format.
    pub const EXTRA: [&'static str; 6] =
        ["airspeed_target_mps", "mode", "armed", "source", "failsafe", "latency_us"];

    pub(super) fn write<W: Write>(&self, out: &mut Rows<W>) -> std::io::Result<()> {
        let d = &self.decision;
        let digit = |flag: bool| if flag { "1" } else { "0" };
        let airspeed = format!("{}", d.target.airspeed);
        let latency = format!("{:.1}", self.latency_us);
        let extra = [
            &*airspeed,
            mode_name(d.mode),
            digit(d.armed),
            d.source.name(),
            digit(d.failsafe),
            &*latency,
        ];
        out.row(&self.sample, &extra)
    }
}
