//! Constants of the sensors' installation that all flights of an aircraft have in common: gains of vanes, gyros and
//! accelerometers, and the roll of the board against the vanes.
//!
//! A flight with strong manoeuvres shows such an error significantly, and another flight does not. If each flight were
//! reconstructed alone, the error would remain in the second one and look like an effect of the aircraft. The estimates of all flights are
//! therefore combined, and the flights are reconstructed again with the result as prior. The combined value is the mean weighted
//! by inverse variances. If the estimates scatter more than their standard deviations state, these are multiplied by the Birge
//! ratio, the root of chi-square per degree of freedom (Birge 1932, Physical Review 40, 207). A flight's prior is what the other
//! flights say, so that its own measurements count once.

use std::f64::consts::PI;

use crate::flight_path::Options;
use crate::flight_path::reconstruction::Reconstruction;
use greylag_physics::sensors::Known;

/// A combined value is used if it exceeds this number of its standard deviations. One flight alone exceeds six, so that flights
/// that agree reach it. Flights that contradict each other do not, because the Birge ratio widens the standard deviation.
const CLEARLY: f64 = 4.0;
/// Probability below which a chi-square shows that estimates contradict each other. It is that of agreeing estimates to scatter as
/// much.
const CONTRADICTION: f64 = 0.01;
/// Factor from a standard deviation to half of a 95 % interval.
const INTERVAL: f64 = 1.96;

/// Name of a constant, and its prior mean and standard deviation in the unit of
/// [`CONSTANTS`](greylag_physics::sensors::CONSTANTS).
pub type Prior = (&'static str, Known);

/// Estimate of a constant of the installation from one flight alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Name of the constant, for example `alpha_gain`.
    pub name: &'static str,
    /// Estimate, in the constant's unit.
    pub value: f64,
    /// Standard deviation, in the constant's unit.
    pub sd: f64,
    /// Whether the flight shows the constant significantly. Otherwise the flight alone is reconstructed without it.
    pub shown: bool,
}

/// The constants of the installation that at least one flight of a set shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Installation {
    common: Vec<Common>,
    unshared: Vec<Unshared>,
}

/// A constant with the estimates of the flights that determine it.
#[derive(Clone, Debug, PartialEq)]
struct Common {
    name: &'static str,
    /// Index of each flight, and its estimate. The standard deviations include the Birge ratio.
    members: Vec<(usize, Estimate)>,
    /// Mean of the estimates.
    mean: Known,
    /// Whether a flight of the set does not show the constant.
    is_lacking: bool,
    /// Flights that could show the constant, do not, and contradict the others. They are left without it.
    apart: Vec<usize>,
}

/// A constant that some flights show, but not the flights together.
#[derive(Clone, Debug, PartialEq)]
struct Unshared {
    name: &'static str,
    /// Indices of the flights that show the constant.
    shown: Vec<usize>,
    chi_square: f64,
    degrees: usize,
    /// Whether a single flight contradicts the others.
    is_apart: bool,
}

impl Installation {
    /// Combines the estimates of a set of flights, one slice for each flight.
    pub fn of(flights: &[&[Estimate]]) -> Installation {
        let mut all = Installation::default();
        let mut names: Vec<&'static str> = Vec::new();
        for estimate in flights.iter().flat_map(|of| of.iter()).filter(|e| e.shown) {
            if !names.contains(&estimate.name) {
                names.push(estimate.name);
            }
        }
        for name in names {
            all.combine(name, flights);
        }
        all
    }

    /// Combines the estimates of the constant `name`.
    fn combine(&mut self, name: &'static str, flights: &[&[Estimate]]) {
        let of = |(k, own): (usize, &&[Estimate])| {
            let own = own.iter().find(|e| e.name == name)?;
            (own.value.is_finite() && own.sd.is_finite() && own.sd > 0.0).then_some((k, *own))
        };
        let mut members: Vec<(usize, Estimate)> =
            flights.iter().enumerate().filter_map(of).collect();
        let Some(mean) = weighted(members.iter().map(|(_, e)| e)) else { return };
        let squares = members.iter().map(|(_, e)| ((e.value - mean.value) / e.sd).powi(2));
        let (chi_square, degrees) = (squares.sum::<f64>(), members.len() - 1);
        let apart = apart(&members);
        let birge = (chi_square / degrees.max(1) as f64).sqrt().max(1.0);
        members.iter_mut().for_each(|(_, e)| e.sd *= birge);
        let mean = Known { sd: mean.sd * birge, ..mean };
        let shown: Vec<usize> = members.iter().filter(|(_, e)| e.shown).map(|(k, _)| *k).collect();
        let lacking = flights.len() - shown.len();
        let is_taken = lacking == 0 || apart.len() < lacking;
        if mean.value.abs() > CLEARLY * mean.sd && is_taken {
            self.common.push(Common { name, members, mean, is_lacking: lacking > 0, apart });
        } else if degrees > 0 {
            let is_apart = !apart.is_empty();
            self.unshared.push(Unshared { name, shown, chi_square, degrees, is_apart });
        }
    }

    /// Priors for a flight from the other flights of the set. `member` is the flight's index in the set, or `None` for a flight
    /// outside the set. A constant that all flights of the set show is left to each of them, and none is given to a flight that
    /// contradicts it.
    pub fn priors(&self, member: Option<usize>) -> Vec<Prior> {
        let of = |common: &Common| {
            if member.is_some_and(|k| !common.is_lacking || common.apart.contains(&k)) {
                return None;
            }
            let others = common.members.iter().filter(|(k, _)| Some(*k) != member);
            Some((common.name, weighted(others.map(|(_, e)| e))?))
        };
        self.common.iter().filter_map(of).collect()
    }

    /// A sentence for each constant that some flights show and others do not, and for each one that they do not show together.
    /// `names` are the names of the flights of the set.
    pub fn sentences(&self, names: &[&str]) -> Vec<String> {
        let shared = self.common.iter().filter(|common| common.is_lacking).map(|common| {
            let shown = common.members.iter().filter(|(_, e)| e.shown);
            let shown = listed(names, shown.map(|(k, _)| *k));
            let apart = match listed(names, common.apart.iter().copied()) {
                apart if apart.is_empty() => String::new(),
                apart => format!(", but not {apart}, whose own data contradict it"),
            };
            format!(
                "{}, as {shown} shows ({}); the other flights are reconstructed with it too{apart}.",
                error(common.name, common.mean),
                common.name,
            )
        });
        shared.chain(self.unshared.iter().map(|of| of.sentence(names))).collect()
    }
}

impl Unshared {
    /// Why each flight keeps its own estimate.
    fn sentence(&self, names: &[&str]) -> String {
        let shown = listed(names, self.shown.iter().copied());
        let plural = if self.degrees == 1 { "" } else { "s" };
        let together = chi_square_tail(self.chi_square, self.degrees) < CONTRADICTION;
        let why = match (together, self.is_apart) {
            (true, _) => format!(
                "the flights contradict each other (chi-square {:.1} with {} degree{plural} of freedom)",
                self.chi_square, self.degrees
            ),
            (false, true) => "the data of the other flights contradict it".to_owned(),
            (false, false) => "the flights together do not determine it".to_owned(),
        };
        format!("{} is shown by {shown}, but {why}: each keeps its own estimate.", self.name)
    }
}

/// The flights that do not show a constant although they determine it well enough for that, and whose estimates contradict those of
/// the others.
fn apart(members: &[(usize, Estimate)]) -> Vec<usize> {
    let contradicts = |(k, own): &(usize, Estimate)| {
        let others = weighted(members.iter().filter(|(j, _)| j != k).map(|(_, e)| e))?;
        let square = (own.value - others.value).powi(2) / (own.sd.powi(2) + others.sd.powi(2));
        let determines = others.value.abs() > CLEARLY * own.sd;
        (!own.shown && determines && chi_square_tail(square, 1) < CONTRADICTION).then_some(*k)
    };
    members.iter().filter_map(contradicts).collect()
}

/// The probability that a chi-square with `degrees` degrees of freedom exceeds `x`.
///
/// It is exp(−x/2) for two degrees and erfc √(x/2) for one. Two more degrees add (x/2)^(d/2) exp(−x/2) / Γ(d/2 + 1) to that of d
/// (Abramowitz and Stegun, 26.4.8).
fn chi_square_tail(x: f64, degrees: usize) -> f64 {
    let half = 0.5 * x;
    let (mut tail, mut term, mut d) = match degrees {
        0 => return if x > 0.0 { 0.0 } else { 1.0 },
        odd if odd % 2 == 1 => {
            (libm::erfc(half.sqrt()), 2.0 * (half / PI).sqrt() * (-half).exp(), 1)
        }
        _ => ((-half).exp(), half * (-half).exp(), 2),
    };
    while d < degrees {
        tail += term;
        d += 2;
        term *= half / (0.5 * d as f64);
    }
    tail
}

/// The names at the indices `places`, with commas between them.
fn listed(names: &[&str], places: impl Iterator<Item = usize>) -> String {
    let of: Vec<&str> = places.filter_map(|k| names.get(k).copied()).collect();
    of.join(", ")
}

/// Mean weighted by inverse variances, with its standard deviation; `None` without an estimate.
fn weighted<'a>(estimates: impl Iterator<Item = &'a Estimate>) -> Option<Known> {
    let (mut sum, mut weights) = (0.0, 0.0);
    for estimate in estimates {
        let weight = estimate.sd.powi(-2);
        (sum, weights) = (sum + weight * estimate.value, weights + weight);
    }
    (weights > 0.0).then(|| Known { value: sum / weights, sd: weights.sqrt().recip() })
}

/// The error `known` of the constant `name`, with its 95 % interval, in words.
fn error(name: &str, known: Known) -> String {
    let [size, half] = [known.value.abs(), INTERVAL * known.sd];
    if name == "board_roll" {
        let side = if known.value > 0.0 { "right" } else { "left" };
        let [size, half] = [size, half].map(f64::to_degrees);
        return format!(
            "The board is rolled to the {side} by {size:.2} ± {half:.2}° (95 %) against the vanes"
        );
    }
    let [size, half] = [size, half].map(|x| 100.0 * x);
    let much = if known.value > 0.0 { "much" } else { "little" };
    format!("{} reads {size:.1} ± {half:.1} % (95 %) too {much}", instrument(name))
}

/// The instrument to which the gain `name` belongs, in words.
fn instrument(name: &str) -> &'static str {
    match name {
        "alpha_gain" => "The angle-of-attack vane",
        "beta_gain" => "The sideslip vane",
        "gyro_gain_p" => "The roll gyro",
        "gyro_gain_q" => "The pitch gyro",
        "gyro_gain_r" => "The yaw gyro",
        "accelerometer_gain_x" => "The forward accelerometer",
        "accelerometer_gain_y" => "The rightward accelerometer",
        _ => "The downward accelerometer",
    }
}

/// Gives `flights`, the reconstructed flights of one aircraft, the constants of the installation that only some of them show.
/// `again` reconstructs the flight with an index once more, with these priors. It is called at most once for each flight, and
/// not at all if all flights show the same constants. Returns the constants.
///
/// # Errors
/// The error of `again`.
pub fn share<E>(
    flights: &mut [Reconstruction],
    mut again: impl FnMut(usize, &[Prior]) -> Result<Reconstruction, E>,
) -> Result<Installation, E> {
    let alone: Vec<&[Estimate]> = flights.iter().map(|f| f.installation.as_slice()).collect();
    let installation = Installation::of(&alone);
    for (k, flight) in flights.iter_mut().enumerate() {
        let priors = installation.priors(Some(k));
        if !priors.is_empty() {
            *flight = again(k, &priors)?;
        }
    }
    Ok(installation)
}

impl Options {
    /// These options with priors that other flights of the aircraft give. What the aircraft's files state takes precedence.
    pub fn expecting(mut self, priors: &[Prior]) -> Options {
        for (name, known) in priors.iter().copied() {
            self.sensors.expect(name, known);
        }
        self
    }
}

#[cfg(test)]
mod tests;
