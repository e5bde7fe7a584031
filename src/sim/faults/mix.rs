//! Draws the random faults of one simulated flight from a seed: their kinds, times and severities. The companion (this program's
//! autopilot) flies the aircraft through a link to a flight controller or to the simulator.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// Earliest start of a fault, s after the start of the flight. By then the companion has taken control.
pub const FIRST_S: f64 = 12.0;
/// Latest end of a fault, s after the start of the flight.
pub const LAST_S: f64 = 42.0;

/// Kind of a simulated fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// Random datagrams of the link, or pieces of its byte stream, are lost.
    Loss,
    /// Random datagrams of the link arrive twice.
    Duplication,
    /// Random datagrams arrive after later ones.
    Reordering,
    /// Random datagrams are delayed by 20 ms to 350 ms.
    Delay,
    /// Bits are flipped in datagrams.
    Corruption,
    /// Random datagrams lose their last bytes.
    Truncation,
    /// Ten batches of noise, incomplete frames or frames of other systems precede each datagram.
    Flood,
    /// The link is down.
    Unplug,
    /// All sensors repeat their last values.
    Frozen,
    /// The pitot tube is blocked.
    Airspeed,
    /// The measured angle of attack has an offset of −0.25 to 0.25 rad.
    Alpha,
    /// The measured pitch rate is NaN.
    NotANumber,
    /// The vehicle's clock jumps forward by up to 10 s.
    Clock,
    /// The vehicle restarts, and its clock starts again.
    Reboot,
    /// The client stops sending commands.
    Client,
    /// The companion is suspended for up to 0.3 s at a time, so that its ticks come late and in bursts.
    Starvation,
    /// The disk is full, and recording ends.
    Disk,
    /// The companion is killed. When the fault ends, another companion starts without the state of the first.
    Killed,
}

impl FaultKind {
    /// The kinds that are drawn at random, by their index in this list. [`Killed`](FaultKind::Killed) is excluded, because a
    /// longer list would change the faults of every seed.
    pub const DRAWN: [FaultKind; 17] = [
        FaultKind::Loss,
        FaultKind::Duplication,
        FaultKind::Reordering,
        FaultKind::Delay,
        FaultKind::Corruption,
        FaultKind::Truncation,
        FaultKind::Flood,
        FaultKind::Unplug,
        FaultKind::Frozen,
        FaultKind::Airspeed,
        FaultKind::Alpha,
        FaultKind::NotANumber,
        FaultKind::Clock,
        FaultKind::Reboot,
        FaultKind::Client,
        FaultKind::Starvation,
        FaultKind::Disk,
    ];

    /// The name in tables and reports.
    pub fn name(self) -> &'static str {
        match self {
            FaultKind::Loss => "loss",
            FaultKind::Duplication => "duplication",
            FaultKind::Reordering => "reordering",
            FaultKind::Delay => "delay spikes",
            FaultKind::Corruption => "corruption",
            FaultKind::Truncation => "truncation",
            FaultKind::Flood => "flood",
            FaultKind::Unplug => "unplug",
            FaultKind::Frozen => "frozen sensors",
            FaultKind::Airspeed => "airspeed blocked",
            FaultKind::Alpha => "alpha jump",
            FaultKind::NotANumber => "NaN rate",
            FaultKind::Clock => "clock jump",
            FaultKind::Reboot => "reboot",
            FaultKind::Client => "client death",
            FaultKind::Starvation => "CPU starvation",
            FaultKind::Disk => "disk full",
            FaultKind::Killed => "companion killed",
        }
    }

    /// Whether [`Fault::strength`] has an effect on a fault of this kind.
    pub fn has_strength(self) -> bool {
        use FaultKind::*;
        !matches!(self, Flood | Unplug | Frozen | NotANumber | Reboot | Client | Disk | Killed)
    }

    /// Whether the fault ends before the flight does. A clock jump and a full disk last until the end of the flight.
    pub fn has_length(self) -> bool {
        !matches!(self, FaultKind::Clock | FaultKind::Disk)
    }
}

/// A fault of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Start of the fault, s.
    pub from_s: f64,
    /// End of the fault, s.
    pub to_s: f64,
    /// Severity of the fault, 0..1.
    #[serde(deserialize_with = "severity")]
    pub strength: f64,
}

/// Reads a severity. A number outside 0..1 is rejected, because it would give a delay or a number of bit errors that cannot be
/// simulated.
fn severity<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    let strength = f64::deserialize(from)?;
    match (0.0..=1.0).contains(&strength) {
        true => Ok(strength),
        false => {
            let why = format!("strength {strength} of a fault; give one from 0 to 1");
            Err(serde::de::Error::custom(why))
        }
    }
}

impl Fault {
    /// Whether the fault is active at the time `now_s` (s).
    pub fn acts(&self, now_s: f64) -> bool {
        (self.from_s..self.to_s).contains(&now_s)
    }
}

/// Draws one to three faults for the flight with the seed `seed`. They may overlap. The first fault has the kind
/// `DRAWN[seed mod N]`, where N is the length of [`DRAWN`](FaultKind::DRAWN).
pub fn draw(seed: u64) -> Vec<Fault> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let count = random.random_range(1..=3);
    let first = FaultKind::DRAWN[seed as usize % FaultKind::DRAWN.len()];
    (0..count)
        .map(|i| {
            let kind = match i {
                0 => first,
                _ => FaultKind::DRAWN[random.random_range(0..FaultKind::DRAWN.len())],
            };
            one(kind, &mut random)
        })
        .collect()
}

/// A fault of `kind` at a random time, of random duration and severity.
pub(super) fn one(kind: FaultKind, random: &mut impl Rng) -> Fault {
    let from_s = random.random_range(FIRST_S..LAST_S - 8.0);
    let length = match kind {
        FaultKind::Unplug => random.random_range(0.1..4.0),
        FaultKind::Reboot => random.random_range(0.5..2.0),
        FaultKind::Clock => 0.01,
        FaultKind::NotANumber | FaultKind::Frozen => random.random_range(0.02..4.0),
        _ => random.random_range(1.0..8.0),
    };
    Fault { kind, from_s, to_s: from_s + length, strength: random.random() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_severity_is_read_between_0_and_1() {
        let read = |strength: &str| {
            let text =
                format!("kind = \"delay\"\nfrom_s = 12.0\nto_s = 13.0\nstrength = {strength}");
            toml::from_str::<Fault>(&text).map(|fault| fault.strength)
        };
        assert_eq!(read("1.0").unwrap(), 1.0);
        for wrong in ["-0.1", "1e30", "nan"] {
            let why = read(wrong).unwrap_err().to_string();
            assert!(why.contains("give one from 0 to 1"), "{why}");
        }
    }
}
