//! The cases of the campaign: what is hidden, how much of it, and what the catalogue is robbed of.

use std::collections::BTreeMap;
use std::ops::Range;

use greylag::num::statistics::quantile;
use greylag::num::stream::stream;
use greylag::sim::installation::Installation;
use greylag::sim::missing::{Craft, Missing, MissingKind};
use rand::RngExt;

use crate::record::Record;

/// Amplitudes as multiples of the minimum detectable one.
pub const FACTORS: [f64; 3] = [1.0, 2.0, 5.0];
/// Amplitude of both effects of a pair, and of one that the catalogue lacks, likewise.
const CLEAR: f64 = 5.0;
/// Share of the largest clear amplitude that is taken for the minimum detectable one as long as no
/// null has shown it.
const ASSUMED: f64 = 0.1;

/// One case.
#[derive(Clone, Debug)]
pub struct Case {
    /// `nulls`, `installed`, `probes`, `effects`, `without` or `pairs`.
    pub part: &'static str,
    /// Effects that the model lacks.
    pub missing: Vec<Missing>,
    /// Amplitude as a multiple of the minimum detectable one, as wanted; 0 for nulls.
    pub factor: f64,
    /// The same as it is: what cannot be flown is made smaller, and a delay is a whole number of steps.
    pub reached: f64,
    /// Ids that the catalogue is robbed of.
    pub without: Vec<String>,
    /// Seed of all random draws of the case.
    pub seed: u64,
}

impl Case {
    /// Name of the case in the results.
    pub fn key(&self) -> String {
        let ids: Vec<&str> = self.missing.iter().map(|m| m.id).collect();
        format!("{}/{}/x{}/{}", self.part, ids.join("+"), self.factor, self.seed)
    }

    /// How the instruments are installed, with the name of what is wrong with them; `None` if nothing is.
    pub fn installed(&self) -> Option<(&'static str, Installation)> {
        (self.part == "installed").then(|| Installation::one(self.seed))
    }

    /// The ids that are to be found.
    pub fn truth(&self) -> Vec<String> {
        let acts = |m: &&Missing| m.amplitude != 0.0;
        self.missing.iter().filter(acts).map(|m| m.id.to_owned()).collect()
    }
}

/// The aircraft, with the minimum detectable amplitude of each effect: the median over nulls and probes.
pub struct Seen(BTreeMap<String, f64>, Craft);

impl Seen {
    /// Median minimum detectable amplitudes of the nulls and probes among `records`.
    pub fn of(records: &[Record], craft: &Craft) -> Seen {
        let mut all: BTreeMap<String, Vec<f64>> = BTreeMap::new();
        for record in records.iter().filter(|r| r.part == "nulls" || r.part == "probes") {
            for (id, least) in &record.minimum_detectable {
                all.entry(id.clone()).or_default().push(*least);
            }
        }
        Seen(
            all.into_iter().map(|(id, least)| (id, quantile(&least, 0.5))).collect(),
            craft.clone(),
        )
    }

    /// The amplitude of `factor` times the minimum detectable one, as far as it can be flown, and what
    /// multiple that is; its sign drawn where it may have either.
    fn amplitude(&self, kind: &MissingKind, factor: f64, seed: u64) -> (f64, f64) {
        let [low, high] = kind.clear;
        let (largest, sign) = (low.abs().max(high.abs()), (low + high).signum());
        let least = self.0.get(kind.id).copied().filter(|x| x.is_finite() && *x > 0.0);
        let (size, least) = match kind.id {
            // it cannot be hidden in part
            "lift_stall" | "rudder_linear" | "propeller" => return (1.0, factor),
            // a slower rate is more of it
            "rate_limit" => {
                let least = least.unwrap_or(largest / ASSUMED.sqrt());
                ((least / factor).max(kind.most()), least)
            }
            _ => {
                let least = least.unwrap_or(ASSUMED * largest);
                ((factor * least).min(kind.most()), least)
            }
        };
        let flip = kind.either_sign && stream(seed, &[83]).random::<bool>();
        let amplitude = kind.allowed(if flip { -sign * size } else { sign * size });
        let multiple = amplitude.abs() / least;
        (amplitude, if kind.id == "rate_limit" { multiple.recip() } else { multiple })
    }

    /// The effect with the multiple of its minimum detectable amplitude that it has.
    fn missing(&self, kind: &MissingKind, factor: f64, seed: u64) -> Option<(Missing, f64)> {
        let (amplitude, reached) = self.amplitude(kind, factor, seed);
        Some((Missing::new(&self.1, kind.id, amplitude).ok()?, reached))
    }
}

/// Flights on which nothing is missing. In every other one aircraft and model both lack an effect that the
/// aircraft has of its own, so that it is a candidate in some.
pub fn nulls(craft: &Craft, seeds: Range<u64>) -> Vec<Case> {
    let absent = |id: &str| Missing::new(craft, id, 0.0).ok();
    seeds
        .map(|seed| {
            let even = seed.is_multiple_of(2);
            nothing("nulls", seed, if even { None } else { absent("drag_elevator_abs") })
        })
        .collect()
}

/// Flights on which nothing of the aircraft is missing, and one instrument is installed or calibrated wrong.
pub fn installed(seeds: Range<u64>) -> Vec<Case> {
    seeds.map(|seed| nothing("installed", seed, None)).collect()
}

/// Flights that show how much of `drag_beta2` is detectable. They are no nulls: the part of it that
/// goes with |β| cannot be taken from the aircraft.
pub fn probes(craft: &Craft, seeds: Range<u64>) -> Vec<Case> {
    let absent = || Missing::new(craft, "drag_beta2", 0.0).ok();
    seeds.map(|seed| nothing("probes", seed, absent())).collect()
}

fn nothing(part: &'static str, seed: u64, absent: Option<Missing>) -> Case {
    let missing = absent.into_iter().collect();
    Case { part, missing, factor: 0.0, reached: 0.0, without: Vec::new(), seed }
}

/// Each effect at each of the amplitudes `factors`.
pub fn effects(
    seeds: Range<u64>,
    factors: &[f64],
    seen: &Seen,
    wanted: impl Fn(&str) -> bool,
) -> Vec<Case> {
    let mut factors = factors.to_vec();
    factors.sort_by(|a, b| b.total_cmp(a));
    let mut all = Vec::new();
    for seed in seeds {
        for kind in seen.1.kinds().iter().filter(|kind| wanted(kind.id)) {
            // the largest first, so that what cannot be larger counts once, under the largest factor
            let mut flown: Vec<f64> = Vec::new();
            for &factor in &factors {
                let Some((missing, reached)) = seen.missing(kind, factor, seed) else { continue };
                if flown.contains(&missing.amplitude) {
                    continue;
                }
                flown.push(missing.amplitude);
                let missing = vec![missing];
                let without = Vec::new();
                all.push(Case { part: "effects", missing, factor, reached, without, seed });
            }
        }
    }
    all
}

/// Each effect, clear to see, with a catalogue that does not have it.
pub fn without(seeds: Range<u64>, seen: &Seen, wanted: impl Fn(&str) -> bool) -> Vec<Case> {
    let robbed = |case: Case| Case { part: "without", without: case.truth(), ..case };
    effects(seeds, &[CLEAR], seen, wanted).into_iter().map(robbed).collect()
}

/// Pairs of effects, as many a seed as there are effects, each with another drawn from the seed.
pub fn pairs(seeds: Range<u64>, seen: &Seen, wanted: impl Fn(&str) -> bool) -> Vec<Case> {
    let mut all = Vec::new();
    for seed in seeds {
        let mut random = stream(seed, &[84]);
        let kinds = seen.1.kinds();
        let by = random.random_range(1..kinds.len() as u32) as usize;
        for (k, kind) in kinds.iter().enumerate().filter(|(_, kind)| wanted(kind.id)) {
            let other = kinds[(k + by) % kinds.len()];
            let both = [kind, &other].map(|kind| seen.missing(kind, CLEAR, seed));
            if let [Some(a), Some(b)] = both {
                all.push(Case {
                    part: "pairs",
                    reached: a.1.min(b.1),
                    missing: vec![a.0, b.0],
                    factor: CLEAR,
                    without: Vec::new(),
                    seed,
                });
            }
        }
    }
    all
}
