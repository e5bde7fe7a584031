//! Summary of a flight as text.

use std::fmt;
use std::fs::File;
use std::io::Write;
use std::path::PathBuf;

use super::timing::Timing;
use crate::recorder::Written;
use greylag_link::autopilot::ESTIMATES;
use greylag_link::client::ClientCounts;
use greylag_link::signing::SigningCounts;
use greylag_link::vehicle::VehicleCounts;

/// Counters and timing of a finished flight.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Duration of the flight by the host's clock, s.
    pub duration_s: f64,
    /// Counters of the vehicle link.
    pub vehicle: VehicleCounts,
    /// Counters of the traffic with clients, which are ground stations and offboard programs.
    pub clients: ClientCounts,
    /// Signing counters; `None` without signing.
    pub signing: Option<SigningCounts>,
    /// Timing of the control loop.
    pub timing: Timing,
    /// Aerodynamic derivatives estimated in flight, in the order of `ESTIMATES`; NaN if unknown.
    pub derivatives: [f64; ESTIMATES.len()],
    /// Path of the recording and its counters; `None` without a recording.
    pub recording: Option<(PathBuf, Written)>,
}

impl Summary {
    /// Writes `summary.txt` into the recording's folder. An existing file is not overwritten. Errors are ignored, because
    /// the caller can print the same text.
    pub(super) fn save(&self) {
        if let Some((folder, _)) = &self.recording
            && let Ok(mut file) = File::create_new(folder.join("summary.txt"))
        {
            let _ = writeln!(file, "{self}");
        }
    }
}

/// Quantities and units of the derivatives, in the order of `ESTIMATES`.
const QUANTITIES: [(&str, &str); ESTIMATES.len()] = [
    ("roll acceleration at full aileron", "rad/s2"),
    ("L_p", "1/s"),
    ("pitch acceleration at full elevator", "rad/s2"),
    ("M_alpha", "1/s2"),
];

impl Summary {
    /// Writes a line with the known derivatives; writes nothing if all are unknown.
    fn write_derivatives(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let all = QUANTITIES.iter().zip(self.derivatives).filter(|(_, value)| value.is_finite());
        let known: Vec<String> =
            all.map(|((what, unit), value)| format!("{what} {value:.2} {unit}")).collect();
        match known.is_empty() {
            true => Ok(()),
            false => writeln!(f, "estimated in flight, at cruise airspeed: {}", known.join(", ")),
        }
    }

    /// Writes a line with the signing counters; writes nothing without signing.
    fn write_signatures(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(s) = &self.signing else { return Ok(()) };
        write!(
            f,
            "\nsignatures: {} made, {} right; refused: {} frames without one, {} false, {} used before",
            s.signed, s.believed, s.unsigned, s.forged, s.replayed
        )?;
        match s.unsignable {
            0 => Ok(()),
            n => write!(f, "; not sent: {n} MAVLink 1 frames, which cannot be signed"),
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (v, c, t) = (&self.vehicle, &self.clients, &self.timing);
        writeln!(
            f,
            "flew {:.1} s: {} states, {} lost, {} with faults",
            self.duration_s, v.states, v.lost, v.faulty
        )?;
        if t.latency.count() > 0 {
            writeln!(
                f,
                "state to command: p50 {:.0}, p99 {:.0}, p99.9 {:.0}, longest {:.0} microseconds; {} cycles missed",
                t.latency.quantile_us(0.5),
                t.latency.quantile_us(0.99),
                t.latency.quantile_us(0.999),
                t.latency.max_us(),
                t.missed
            )?;
        }
        if t.interval.count() > 0 {
            writeln!(
                f,
                "between states: p50 {:.2}, p99 {:.2}, longest {:.2} ms; {} plans late",
                t.interval.quantile_us(0.5) / 1000.0,
                t.interval.quantile_us(0.99) / 1000.0,
                t.interval.max_us() / 1000.0,
                t.late_plans
            )?;
        }
        if t.stalls > 0 {
            writeln!(
                f,
                "this computer stalled {} times, for at most {:.1} s; {} states overtaken by newer ones",
                t.stalls,
                t.longest_stall.as_secs_f64(),
                t.overtaken
            )?;
        }
        self.write_derivatives(f)?;
        write!(
            f,
            "clients: {} frames, {} bad, {} setpoints refused, {} for others",
            c.frames.good,
            c.frames.bad(),
            c.refused_setpoints,
            c.for_others
        )?;
        self.write_signatures(f)?;
        if let Some((folder, w)) = &self.recording {
            write!(f, "\nrecorded {} rows, {} frames in {}", w.rows, w.frames, folder.display())?;
            if w.unknown > 0 {
                write!(f, "; {} frames of unknown messages left out", w.unknown)?;
            }
            if w.dropped > 0 {
                write!(f, "; {} dropped", w.dropped)?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_were_not_sent_for_want_of_a_signature_are_counted() {
        let text = |unsignable| {
            let summary = Summary {
                duration_s: 1.0,
                vehicle: VehicleCounts::default(),
                clients: ClientCounts::default(),
                signing: Some(SigningCounts { unsignable, ..SigningCounts::default() }),
                timing: Timing::default(),
                derivatives: [f64::NAN; ESTIMATES.len()],
                recording: None,
            };
            summary.to_string()
        };
        assert!(text(3).contains("not sent: 3 MAVLink 1 frames"), "{}", text(3));
        assert!(!text(0).contains("not sent"), "{}", text(0));
    }
}
