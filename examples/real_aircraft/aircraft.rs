//! The real aircraft of `tests/data` with their models from geometry, and the cutting of their flights.

use std::path::Path;

use anyhow::Result;
use greylag::logs;
use greylag::logs::mapping::Mapping;
use greylag::logs::phases::Flying;
use greylag::model::GreyBox;
use greylag::model::textbook::{Measures, Tail};
use greylag::sysid::flight_path::reconstruction::{Reconstruction, Segment};
use greylag::sysid::flight_path::{self, ActuatorClock, reconstruct};

/// A real aircraft with its flights.
pub struct Aircraft {
    /// Name with what is known of aircraft and flights, for a heading.
    pub name: &'static str,
    /// Model from geometry, before any fit.
    pub model: GreyBox,
    /// Reconstructed flights, or parts of one flight. Each is held out in turn.
    pub flights: Vec<Reconstruction>,
}

impl Aircraft {
    /// All flights but number `left`, for the fits, and this flight.
    pub fn held_out(&self, left: usize) -> (Vec<Reconstruction>, Reconstruction) {
        let mut fit = self.flights.clone();
        let test = fit.remove(left);
        (fit, test)
    }
}

/// Reads all aircraft, in the order of the tables.
pub fn all() -> Result<[Aircraft; 4]> {
    Ok([a430()?, dawn_one()?, thor()?, proto()?])
}

/// Cuts `flights`, laid end to end, into `count` pieces with the same number of samples. A piece has the flights, or parts of
/// flights, that lie in it, under the flights' own names.
pub fn pieces(flights: &[Reconstruction], count: usize) -> Vec<Vec<Reconstruction>> {
    let all: usize = flights.iter().map(samples).sum();
    let piece = |k: usize| {
        let mut before = 0;
        let mut piece = Vec::new();
        for flight in flights {
            let [from, to] = [k, k + 1].map(|k| (k * all / count).saturating_sub(before));
            let segments = between(flight, from, to);
            if !segments.is_empty() {
                piece.push(Reconstruction { segments, ..flight.clone() });
            }
            before += samples(flight);
        }
        piece
    };
    (0..count).map(piece).collect()
}

/// All flights of `pieces` in one list. The number of the piece is added to their names, so that no two have the same name.
pub fn numbered(pieces: Vec<Vec<Reconstruction>>) -> Vec<Reconstruction> {
    let mut all = Vec::new();
    for (k, piece) in pieces.into_iter().enumerate() {
        for flight in piece {
            let name = format!("{}, part {}", flight.name, k + 1);
            all.push(Reconstruction { name, ..flight });
        }
    }
    all
}

/// Number of samples of a flight.
fn samples(flight: &Reconstruction) -> usize {
    flight.segments.iter().map(|s| s.instants.len()).sum()
}

/// Duration of all `flights` together, s.
pub fn seconds(flights: &[Reconstruction]) -> f64 {
    flights.iter().map(|f| samples(f) as f64 * f.step_s).sum()
}

/// The samples `from` to `to` (not included) of a flight, counted over its segments.
fn between(flight: &Reconstruction, from: usize, to: usize) -> Vec<Segment> {
    let mut segments = Vec::new();
    let mut before = 0;
    for Segment { instants } in &flight.segments {
        let [first, end] = [from, to].map(|edge| edge.saturating_sub(before).min(instants.len()));
        if first < end {
            segments.push(Segment { instants: instants[first..end].to_vec() });
        }
        before += instants.len();
    }
    segments
}

/// Reads and reconstructs the flight in `path`.
fn read(model: &GreyBox, path: &Path, mapping: Option<&Path>) -> Result<Reconstruction> {
    let mapping = mapping.map(Mapping::load).transpose()?.unwrap_or_default();
    let flies = mapping.flies(Some(Flying::from(model.airframe.envelope.flying_from_mps())));
    let log = logs::load(path, &logs::Options { mapping, flies, ..logs::Options::default() })?;
    let options = flight_path::Options::of(&log.flight.name, model, ActuatorClock::AsRecorded);
    Ok(reconstruct(&log.flight, &options.down_to(log.flies.sustained_s))?)
}

fn a430() -> Result<Aircraft> {
    let data = Path::new("tests/data/a430");
    let model = GreyBox::load(Path::new("params/a430/prior.toml"))?;
    let mut paths: Vec<_> =
        std::fs::read_dir(data)?.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    paths.retain(|p| p.extension().is_some_and(|e| e == "csv"));
    paths.sort();
    let mapping = data.join("mapping.toml");
    let flights = paths.iter().map(|p| read(&model, p, Some(&mapping))).collect::<Result<_>>()?;
    Ok(Aircraft { name: "A430, 0.1 kg, motion capture: 7 flights of 2.5 to 7 s", model, flights })
}

fn dawn_one() -> Result<Aircraft> {
    let thrust = Some([35.0, 20.0]);
    of_halves(
        "Dawn One, 9.5 kg, no vanes: 2 halves of one flight",
        "dawn_one",
        [9.5, 4.0, 1.499],
        thrust,
    )
}

/// Reads the Ultra Stick.
pub fn thor() -> Result<Aircraft> {
    let measures = [1.959, 1.257, 0.3093];
    of_halves("Ultra Stick 25e (thor), 2 kg, vanes: 2 parts of one flight", "thor", measures, None)
}

fn proto() -> Result<Aircraft> {
    of_halves(
        "Proto, mass and area guessed, loiters: 2 parts of one flight",
        "proto",
        [3.0, 2.0, 0.36],
        None,
    )
}

/// An aircraft of which nothing but mass (kg), span (m), area (m²) and perhaps thrust at rest (N) and pitch speed (m/s) are
/// known, with its flights `fit.csv` and `test.csv`.
fn of_halves(
    name: &'static str,
    folder: &str,
    [mass, span, area]: [f64; 3],
    thrust: Option<[f64; 2]>,
) -> Result<Aircraft> {
    let weight = 9.80665 * mass;
    // half the weight, and twice the airspeed of level flight at a lift coefficient of 0.6, as `aircraft new` guesses
    let guess = [0.5 * weight, 2.0 * (2.0 * weight / (1.225 * area * 0.6)).sqrt()];
    let [static_thrust, pitch_speed] = thrust.unwrap_or(guess);
    let travel = 25f64.to_radians();
    let (name_of, tail, rudder) = (folder.to_owned(), Tail::Conventional, Some(travel));
    let measures = Measures {
        name: name_of,
        mass,
        span,
        area,
        tail,
        rudder,
        travel,
        static_thrust,
        pitch_speed,
    };
    let scratch = tempfile::tempdir()?;
    std::fs::write(scratch.path().join("airframe.toml"), measures.airframe())?;
    std::fs::write(scratch.path().join("model.toml"), measures.model())?;
    let model = GreyBox::load(&scratch.path().join("model.toml"))?;
    let data = Path::new("tests/data").join(folder);
    let flights = ["fit.csv", "test.csv"].map(|file| read(&model, &data.join(file), None));
    let flights = flights.into_iter().collect::<Result<_>>()?;
    Ok(Aircraft { name, model, flights })
}
