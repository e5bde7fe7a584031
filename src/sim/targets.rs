//! Target attitudes: target files, on which controllers are scored, and the target sequence of a policy training. \[GSFM26\]
//! is the paper by T. Guerin et al., 2026, see `src/lib.rs`.

use std::path::Path;

use rand::RngExt;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

use greylag_control::Target;
use greylag_num::stream;
use greylag_physics::{Airframe, State};

/// Difficulty of a target. Table II of \[GSFM26\] can be read in two ways: the hard targets lie in the corners, or anywhere
/// outside the box of the easy targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// |roll| < 45° with |pitch| < 25°.
    Easy,
    /// |roll| in 45..60° with |pitch| in 25..30°: all four corners.
    HardCorners,
    /// |roll| up to 60° and |pitch| up to 30°, anywhere outside the box of the easy targets.
    HardOutside,
}

/// An attitude to be reached and scored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Index of the target in the file, from 0. It selects the random stream of the flight to the target.
    #[serde(skip)]
    pub number: u32,
    /// Group of the target.
    pub group: Group,
    /// Commanded roll in degrees.
    pub roll_deg: f64,
    /// Commanded pitch in degrees.
    pub pitch_deg: f64,
}

/// Number of bins in roll, and in pitch. Each pair of a roll bin and a pitch bin is used once before any pair is used again
/// (section IV-A of \[GSFM26\]).
const BINS: usize = 5;
/// Id of the random stream of [`Stratified`].
const STRATIFIED: u64 = 241;

/// An infinite sequence of targets within |roll| ≤ 60° and |pitch| ≤ 30°, stratified over 5 × 5 bins.
///
/// The seed and the number of targets drawn so far determine all further targets. A checkpoint can therefore resume it.
#[derive(Clone, Debug, PartialEq)]
pub struct Stratified {
    seed: u64,
    count: u64,
    corners: f64,
    start: f64,
    airspeeds: [f64; 2],
    bins: Vec<usize>,
}

/// Probability of a target at the reference airspeed if other airspeeds are allowed.
const SLOW: f64 = 0.5;
/// Range of the other airspeeds. The smallest is the first number times the envelope's smallest airspeed. The largest is the
/// second number times the cruise airspeed.
const WANTED: [f64; 2] = [1.15, 1.25];

impl Stratified {
    /// The target sequence of `seed` after its first `count` targets. `corners` (0..1) is the probability that a target is drawn
    /// in the hard corners, which cover 4 % of the whole range. The paper uses 0.
    pub fn new(seed: u64, count: u64, corners: f64) -> Stratified {
        let start = State::NEUTRAL.airspeed;
        Stratified { seed, count, corners, start, airspeeds: [start; 2], bins: Vec::new() }
    }

    /// The same attitudes, about half of them at the reference airspeed of `airframe` and half at other airspeeds of its
    /// envelope.
    pub fn at_airspeeds_of(self, airframe: &Airframe) -> Stratified {
        let ([low, high], envelope) = (WANTED, &airframe.envelope);
        let airspeeds = [low * envelope.airspeed_min_mps, high * envelope.airspeed_cruise_mps];
        Stratified { start: airframe.reference.airspeed, airspeeds, ..self }
    }

    /// Moves to the position after the first `count` targets of the sequence.
    pub fn go_on_after(&mut self, count: u64) {
        (self.count, self.bins) = (count, Vec::new());
    }

    /// Position in the sequence: number of targets drawn or skipped so far.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The next target of the sequence.
    pub fn next_target(&mut self) -> Target {
        let (cycle, place) = (self.count / 25, (self.count % 25) as usize);
        if self.bins.is_empty() || place == 0 {
            self.bins = (0..BINS * BINS).collect();
            self.bins.shuffle(&mut stream::stream(self.seed, &[STRATIFIED, 0, cycle]));
        }
        let mut rng = stream::stream(self.seed, &[STRATIFIED, 1, self.count]);
        self.count += 1;
        let mut draw = || rng.random_range(0.0..1.0);
        let within = |k: usize, x: f64| 2.0 * (k as f64 + x) / BINS as f64 - 1.0;
        let bin = self.bins[place];
        let (x, y) = (within(bin % BINS, draw()), within(bin / BINS, draw()));
        let [roll, pitch]: [f64; 2] = if draw() < self.corners {
            [x.signum() * (45.0 + 15.0 * draw()), y.signum() * (25.0 + 5.0 * draw())]
        } else {
            [60.0 * x, 30.0 * y]
        };
        let airspeed = self.airspeed(self.count - 1);
        Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed }
    }

    /// The airspeed of the target with the index `number`, m/s.
    fn airspeed(&self, number: u64) -> f64 {
        let [low, high] = self.airspeeds;
        let mut rng = stream::stream(self.seed, &[STRATIFIED, 2, number]);
        if low >= high || rng.random_range(0.0..1.0) < SLOW {
            return self.start;
        }
        rng.random_range(low..high)
    }
}

/// A target file. [`TargetFile::generate`] makes 140 easy targets, 100 in the hard corners, and 100 anywhere outside the box
/// of the easy targets.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetFile {
    /// The targets in file order.
    pub rows: Vec<Row>,
}

/// A target file cannot be read.
#[derive(Debug, thiserror::Error)]
#[error(
    "cannot read the target file {path}: {why}. It needs the columns group,roll_deg,pitch_deg; `greylag targets` writes one"
)]
pub struct TargetError {
    path: String,
    why: String,
}

impl Group {
    /// All groups of targets.
    pub const ALL: [Group; 3] = [Group::Easy, Group::HardCorners, Group::HardOutside];

    /// Name in tables and JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Group::Easy => "easy",
            Group::HardCorners => "hard_corners",
            Group::HardOutside => "hard_outside",
        }
    }

    /// Bounds of the group's targets as text.
    const fn rule(self) -> &'static str {
        match self {
            Group::Easy => "easy is |roll| < 45 with |pitch| < 25",
            Group::HardCorners => "hard_corners is |roll| in 45..60 with |pitch| in 25..30",
            Group::HardOutside => "hard_outside is within 60 and 30, outside the easy box",
        }
    }

    /// Whether a target attitude (degrees) belongs to the group.
    pub fn contains(self, roll_deg: f64, pitch_deg: f64) -> bool {
        let (roll, pitch) = (roll_deg.abs(), pitch_deg.abs());
        let easy = roll < 45.0 && pitch < 25.0;
        let hard = roll <= 60.0 && pitch <= 30.0 && !easy;
        match self {
            Group::Easy => easy,
            Group::HardCorners => hard && roll >= 45.0 && pitch >= 25.0,
            Group::HardOutside => hard,
        }
    }
}

impl TargetFile {
    /// The targets of `seed`, rounded to 0.01°. The easy targets are stratified in a 14 × 10 grid of roll and pitch.
    pub fn generate(seed: u64) -> TargetFile {
        let mut rng = stream::stream(seed, &[240]);
        let mut rows = Vec::new();
        let round = |x: f64| (x * 100.0).round() / 100.0;
        let mut push = |group, roll: f64, pitch: f64| {
            let number = rows.len() as u32;
            rows.push(Row { number, group, roll_deg: round(roll), pitch_deg: round(pitch) });
        };
        for i in 0..140 {
            let cell = |k: usize, count: usize, x: f64| (k as f64 + x) / count as f64;
            let roll = -45.0 + 90.0 * cell(i % 14, 14, rng.random_range(0.0..1.0));
            let pitch = -25.0 + 50.0 * cell(i / 14, 10, rng.random_range(0.0..1.0));
            push(Group::Easy, roll.clamp(-44.99, 44.99), pitch.clamp(-24.99, 24.99));
        }
        for i in 0..100 {
            let (right, up) =
                (if i % 2 == 0 { 1.0 } else { -1.0 }, if i / 2 % 2 == 0 { 1.0 } else { -1.0 });
            let (roll, pitch) = (rng.random_range(45.01..60.0), rng.random_range(25.01..30.0));
            push(Group::HardCorners, right * roll, up * pitch);
        }
        for _ in 0..100 {
            let (roll, pitch) = loop {
                let (roll, pitch): (f64, f64) =
                    (rng.random_range(-60.0..60.0), rng.random_range(-30.0..30.0));
                if roll.abs() > 45.01 || pitch.abs() > 25.01 {
                    break (roll, pitch);
                }
            };
            push(Group::HardOutside, roll, pitch);
        }
        TargetFile { rows }
    }

    /// Reads a file with the columns `group,roll_deg,pitch_deg`.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, has other columns, is empty, or has a row whose roll and pitch are outside its
    /// group's bounds (see [`Group`]).
    pub fn load(path: &Path) -> Result<TargetFile, TargetError> {
        let fail = |why: String| TargetError { path: path.display().to_string(), why };
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .from_path(path)
            .map_err(|e| fail(e.to_string()))?;
        let mut rows: Vec<Row> =
            reader.deserialize().collect::<Result<_, _>>().map_err(|e| fail(e.to_string()))?;
        if rows.is_empty() {
            return Err(fail("it has no rows".into()));
        }
        for (i, row) in rows.iter_mut().enumerate() {
            row.number = i as u32;
            if !row.group.contains(row.roll_deg, row.pitch_deg) {
                let Row { group, roll_deg, pitch_deg, .. } = row;
                let name = group.name();
                let why = format!("row {}: {roll_deg}, {pitch_deg} is not {name}", i + 1);
                return Err(fail(format!("{why}; {}", group.rule())));
            }
        }
        Ok(TargetFile { rows })
    }

    /// The targets as CSV text.
    pub fn to_csv(&self) -> String {
        let row = |r: &Row| format!("{},{:.2},{:.2}\n", r.group.name(), r.roll_deg, r.pitch_deg);
        std::iter::once("group,roll_deg,pitch_deg\n".to_owned())
            .chain(self.rows.iter().map(row))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_file_is_the_one_of_seed_1() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/targets.csv");
        assert_eq!(TargetFile::load(&path).unwrap(), TargetFile::generate(1));
    }

    #[test]
    fn stratified_targets_visit_every_bin_before_any_again_and_go_on_where_they_stood() {
        let mut targets = Stratified::new(3, 0, 0.0);
        let all: Vec<_> = (0..75).map(|_| targets.next_target()).collect();
        for cycle in all.chunks(25) {
            let mut seen = [false; 25];
            for Target { roll, pitch, .. } in cycle {
                let bin = |x: f64, most: f64| ((x.to_degrees() / most + 1.0) * 2.5) as usize;
                assert!(!std::mem::replace(
                    &mut seen[bin(*pitch, 30.0) * 5 + bin(*roll, 60.0)],
                    true
                ));
            }
        }
        let mut later = Stratified::new(3, 31, 0.0);
        assert_eq!(later.next_target(), all[31]);
        let mut hard = Stratified::new(3, 0, 1.0);
        for _ in 0..50 {
            let target = hard.next_target();
            let [roll, pitch] = [target.roll, target.pitch].map(f64::to_degrees);
            assert!(Group::HardCorners.contains(roll, pitch), "{roll} {pitch}");
        }
    }

    #[test]
    fn half_the_targets_want_another_airspeed_of_the_envelope() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/airframe.toml");
        let airframe = Airframe::load(&path).unwrap();
        let mut targets = Stratified::new(3, 0, 0.0).at_airspeeds_of(&airframe);
        let mut plain = Stratified::new(3, 0, 0.0);
        let mut others = 0;
        for _ in 0..400 {
            let (target, same) = (targets.next_target(), plain.next_target());
            assert_eq!([target.roll, target.pitch], [same.roll, same.pitch]);
            assert_eq!(same.airspeed, State::NEUTRAL.airspeed);
            others += usize::from(target.airspeed != same.airspeed);
            assert!((1.15 * 13.0..=25.0).contains(&target.airspeed));
        }
        // expected 200, with a standard deviation of 10
        assert!((160..240).contains(&others), "{others}");
    }

    #[test]
    fn groups_lie_where_their_names_say() {
        let file = TargetFile::generate(7);
        let count = |g| file.rows.iter().filter(|r| r.group == g).count();
        assert_eq!(Group::ALL.map(count), [140, 100, 100]);
        for r in &file.rows {
            assert!(r.group.contains(r.roll_deg, r.pitch_deg), "{r:?}");
        }
        assert!(!Group::Easy.contains(45.0, 0.0) && Group::HardOutside.contains(45.0, 0.0));
        assert!(
            !Group::HardCorners.contains(50.0, 20.0) && Group::HardCorners.contains(-50.0, 26.0)
        );
        assert!(
            !Group::HardOutside.contains(61.0, 0.0) && !Group::HardOutside.contains(f64::NAN, 0.0)
        );
    }
}
