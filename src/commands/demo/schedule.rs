//! The schedule of the demonstration: attitude targets and their duration.
//!
//! A leg is one commanded attitude. The paper is T. Guerin et al., 2026, whose Table II defines easy and hard targets.

use crate::manoeuvres::Schedule;
use crate::physics::airframe::Envelope;
use crate::report::Difficulty;

/// One attitude of the schedule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Commanded roll angle, degrees.
    pub roll_deg: f64,
    /// Commanded pitch angle, degrees.
    pub pitch_deg: f64,
    /// Class of the target in Table II of the paper.
    pub difficulty: Difficulty,
}

/// Duration of a leg, s. Six legs and the start-up take less than a minute.
pub const LEG_S: f64 = 8.0;

/// Bank limit for which [`LEGS`] is written, degrees: the largest bank of the paper's hard targets.
const BANK_DEG: f64 = 60.0;
/// Pitch limit for which [`LEGS`] is written, up and down, degrees.
const PITCH_DEG: f64 = 30.0;

/// Easy targets, then hard targets. Climbs and dives alternate so that the altitude changes little.
pub const LEGS: [Leg; 6] = [
    leg(20.0, 5.0, Difficulty::Easy),
    leg(-30.0, 12.0, Difficulty::Easy),
    leg(40.0, -10.0, Difficulty::Easy),
    leg(-55.0, -27.0, Difficulty::Hard),
    leg(57.0, 28.0, Difficulty::Hard),
    leg(-58.0, 8.0, Difficulty::Hard),
];

const fn leg(roll_deg: f64, pitch_deg: f64, difficulty: Difficulty) -> Leg {
    Leg { roll_deg, pitch_deg, difficulty }
}

/// Attitude targets that the demonstration's client commands: legs of equal duration.
#[derive(Clone, Debug)]
pub struct Legs {
    /// Attitudes in the order in which they are flown.
    pub legs: Vec<Leg>,
    /// Duration of each leg, s.
    pub seconds: f64,
}

impl Legs {
    /// The legs of the demonstration: [`LEGS`], with roll and pitch scaled down if the limits of `envelope` are narrower than
    /// `BANK_DEG` and `PITCH_DEG`.
    pub fn demonstration(envelope: &Envelope) -> Legs {
        let Envelope { bank_max_deg, pitch_max_deg, pitch_min_deg, .. } = *envelope;
        let within = |l: &Leg| {
            let pitch = if l.pitch_deg > 0.0 { pitch_max_deg } else { -pitch_min_deg };
            Leg {
                roll_deg: l.roll_deg * (bank_max_deg / BANK_DEG).min(1.0),
                pitch_deg: l.pitch_deg * (pitch / PITCH_DEG).min(1.0),
                ..*l
            }
        };
        Legs { legs: LEGS.iter().map(within).collect(), seconds: LEG_S }
    }

    /// A single leg with level wings, during which the companion (Greylag's autopilot) flies `schedule`. The leg ends 2 s after
    /// the schedule.
    pub fn during(schedule: &Schedule) -> Legs {
        Legs { legs: vec![leg(0.0, 0.0, Difficulty::Easy)], seconds: schedule.duration() + 2.0 }
    }
}
