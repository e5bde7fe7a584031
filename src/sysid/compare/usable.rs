//! The flights that can be compared with models, and notes on the others.

use super::CompareError;
use crate::flight_path::impossible;
use crate::flight_path::reconstruction::Reconstruction;
use crate::weak_form::kernel::KERNEL_S;
use crate::weak_form::prepared::Prepared;

/// What the flights of a comparison show before any model is used.
#[derive(Default)]
pub(super) struct Said {
    /// Reasons for which flights cannot be compared, and what is missing in the others.
    pub notes: Vec<String>,
    /// Physically impossible estimates in the flights that can be compared.
    pub doubtful: Vec<String>,
}

/// The flights that can be compared, the same prepared, and what is said about them.
pub(super) type Usable<'a> = (Vec<&'a Reconstruction>, Vec<Prepared>, Said);
/// The same with the indices of the flights that can be compared.
pub(super) type Emptied = (Vec<usize>, Vec<Prepared>, Said);

/// The flights that can be compared, and notes on the others. An aircraft counts as flying above the airspeed `slowest` (m/s).
pub(super) fn usable(flights: &[Reconstruction], slowest: f64) -> Result<Usable<'_>, CompareError> {
    let (mut used, mut prepared, mut said) = (Vec::new(), Vec::new(), Said::default());
    for flight in flights {
        if let Some(ready) = ready(flight, slowest, &mut said)? {
            used.push(flight);
            prepared.push(ready);
        }
    }
    some(flights, &prepared, &said.notes)?;
    Ok((used, prepared, said))
}

/// As [`usable`], but all of `flights` lose their segments, each once it is prepared.
pub(super) fn emptied(
    flights: &mut [Reconstruction],
    slowest: f64,
) -> Result<Emptied, CompareError> {
    let (mut places, mut prepared, mut said) = (Vec::new(), Vec::new(), Said::default());
    for (place, flight) in flights.iter_mut().enumerate() {
        if let Some(ready) = ready(flight, slowest, &mut said)? {
            places.push(place);
            prepared.push(ready);
        }
        flight.segments = Vec::new();
    }
    some(flights, &prepared, &said.notes)?;
    Ok((places, prepared, said))
}

/// An error if there is no flight, or none that can be compared.
fn some(
    flights: &[Reconstruction],
    prepared: &[Prepared],
    notes: &[String],
) -> Result<(), CompareError> {
    match (flights, prepared) {
        ([], _) => Err(CompareError::NoLog),
        (_, []) => Err(CompareError::NoFlight(notes.join("; "))),
        _ => Ok(()),
    }
}

/// The flight prepared for a comparison; `None` if it cannot be compared. The reason, what is missing and what is impossible in the
/// flight are added to `said`.
fn ready(
    flight: &Reconstruction,
    slowest: f64,
    said: &mut Said,
) -> Result<Option<Prepared>, CompareError> {
    let ready = Prepared::new(flight, slowest)?;
    let notes = &mut said.notes;
    if ready.windows.is_empty() {
        notes.push(why_unusable(flight, slowest));
        return Ok(None);
    }
    if !ready.has_force() {
        notes.push(format!(
            "{}: no accelerometers, so its forces D, L, Y are skipped; the rates of V, α and β stand in for them with less power",
            flight.name
        ));
    }
    if flight.noise.iter().chain(&flight.force_noise).all(|sd| !sd.is_finite()) {
        notes.push(format!(
            "{}: the sensors' noise is not known, so the whole residual counts as unexplained",
            flight.name
        ));
    }
    said.doubtful.extend(impossible::of_flight(flight));
    Ok(Some(ready))
}

fn why_unusable(flight: &Reconstruction, slowest: f64) -> String {
    let speeds = flight.segments.iter().flat_map(|s| &s.instants).map(|i| i.state.airspeed);
    match speeds.filter(|v| v.is_finite()).fold(f64::NAN, f64::max) {
        fastest if fastest.is_nan() => format!("{}: holds no usable sample", flight.name),
        fastest if fastest < slowest => format!(
            "{}: no flight in it, the airspeed never exceeds {fastest:.1} m/s where flying begins at {slowest:.1} m/s",
            flight.name
        ),
        _ => format!(
            "{}: no stretch of {KERNEL_S} s in the air without a gap or a missing actuator",
            flight.name
        ),
    }
}
