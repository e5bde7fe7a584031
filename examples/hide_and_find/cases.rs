//! The test cases of the campaign. A case defines the hidden effects, their amplitudes, and the effects that are removed from
//! the catalogue.

use std::collections::BTreeMap;
use std::ops::Range;

use greylag::num::statistics::quantile;
use greylag::num::stream::stream;
use greylag::sim::installation::Installation;
use greylag::sim::missing::{Craft, Missing, MissingKind};
use rand::RngExt;

use crate::record::Record;

/// Amplitudes of single effects, as multiples of the minimum detectable amplitude.
pub const FACTORS: [f64; 3] = [1.0, 2.0, 5.0];
/// Amplitude of the effects of a pair and of an effect that the catalogue lacks, as a multiple of the minimum detectable
/// amplitude.
const CLEAR: f64 = 5.0;
/// Minimum detectable amplitude that is assumed if no flight without hidden effects has given it, as a fraction of the largest
/// amplitude in `MissingKind::clear`.
const ASSUMED: f64 = 0.1;

/// A test case.
#[derive(Clone, Debug)]
pub struct Case {
    /// Part of the campaign: `nulls`, `installed`, `probes`, `effects`, `without` or `pairs`.
    pub part: &'static str,
    /// Effects that the model lacks.
    pub missing: Vec<Missing>,
    /// Requested amplitude as a multiple of the minimum detectable amplitude; 0 if no effect is hidden.
    pub factor: f64,
    /// The same multiple for the amplitude that is used. An amplitude that cannot be flown is reduced, and a delay is rounded
    /// to a whole number of steps.
    pub reached: f64,
    /// Ids of the effects that are removed from the catalogue.
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

    /// The installation of the instruments with the name of its error; `None` if it has no error.
    pub fn installed(&self) -> Option<(&'static str, Installation)> {
        (self.part == "installed").then(|| Installation::one(self.seed))
    }

    /// Ids of the effects that the diagnosis should find.
    pub fn truth(&self) -> Vec<String> {
        let acts = |m: &&Missing| m.amplitude != 0.0;
        self.missing.iter().filter(acts).map(|m| m.id.to_owned()).collect()
    }
}

/// The minimum detectable amplitude of each effect, as the median over nulls and probes, and the aircraft's scale factors.
pub struct Seen(BTreeMap<String, f64>, Craft);

impl Seen {
    /// Median minimum detectable amplitudes over the nulls and probes among `records`.
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

    /// An amplitude of `factor` times the minimum detectable amplitude, limited to what can be flown, and the multiple that it
    /// has. The sign is random if the effect can have either sign.
    fn amplitude(&self, kind: &MissingKind, factor: f64, seed: u64) -> (f64, f64) {
        let [low, high] = kind.clear;
        let (largest, sign) = (low.abs().max(high.abs()), (low + high).signum());
        let least = self.0.get(kind.id).copied().filter(|x| x.is_finite() && *x > 0.0);
        let (size, least) = match kind.id {
            // these effects have no amplitude
            "lift_stall" | "rudder_linear" | "propeller" => return (1.0, factor),
            // a smaller rate limit is a stronger effect
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

    /// The effect with the amplitude of `Seen::amplitude`, and its multiple of the minimum detectable amplitude.
    fn missing(&self, kind: &MissingKind, factor: f64, seed: u64) -> Option<(Missing, f64)> {
        let (amplitude, reached) = self.amplitude(kind, factor, seed);
        Some((Missing::new(&self.1, kind.id, amplitude).ok()?, reached))
    }
}

/// Cases in which no effect is missing from the model. In cases with an odd seed, an effect of the aircraft is removed from
/// both the aircraft and the model. It is then a candidate of the diagnosis.
pub fn nulls(craft: &Craft, seeds: Range<u64>) -> Vec<Case> {
    let absent = |id: &str| Missing::new(craft, id, 0.0).ok();
    seeds
        .map(|seed| {
            let even = seed.is_multiple_of(2);
            nothing("nulls", seed, if even { None } else { absent("drag_elevator_abs") })
        })
        .collect()
}

/// Cases in which no effect is missing from the model, and one instrument is installed or calibrated wrongly.
pub fn installed(seeds: Range<u64>) -> Vec<Case> {
    seeds.map(|seed| nothing("installed", seed, None)).collect()
}

/// Cases that show the minimum detectable amplitude of `drag_beta2`. They are not free of missing effects: the part of the
/// effect that is proportional to |β| cannot be removed from the aircraft.
pub fn probes(craft: &Craft, seeds: Range<u64>) -> Vec<Case> {
    let absent = || Missing::new(craft, "drag_beta2", 0.0).ok();
    seeds.map(|seed| nothing("probes", seed, absent())).collect()
}

fn nothing(part: &'static str, seed: u64, absent: Option<Missing>) -> Case {
    let missing = absent.into_iter().collect();
    Case { part, missing, factor: 0.0, reached: 0.0, without: Vec::new(), seed }
}

/// One case for each effect and each of the amplitudes `factors`. `wanted` selects the effects by id.
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
            // the largest factor comes first; amplitudes that are limited to the same value are then used only once
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

/// One case for each effect at a clear amplitude, with this effect removed from the catalogue.
pub fn without(seeds: Range<u64>, seen: &Seen, wanted: impl Fn(&str) -> bool) -> Vec<Case> {
    let robbed = |case: Case| Case { part: "without", without: case.truth(), ..case };
    effects(seeds, &[CLEAR], seen, wanted).into_iter().map(robbed).collect()
}

/// For each seed, one case for each effect paired with another effect. The pairing is drawn from the seed.
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
