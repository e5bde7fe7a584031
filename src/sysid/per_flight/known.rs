//! Correction of flights with the constants that a model's file states for them. The correction rotates measurements to the body
//! axes, removes sensor errors, and adds the trims of the flight (offsets of coefficients) to the model.

use greylag_model::known::{FlightConstants, SENSORS};
use greylag_model::{GreyBox, Known};
use greylag_physics::State;

use crate::flight_path::reconstruction::{Instant, Reconstruction};
use crate::per_flight::askew::{self, Turning};
use crate::per_flight::{PerFlight, trims};
use crate::weak_form::prepared::Prepared;

/// For each sensor error, the index of the state that it changes. The error of the airspeed is a fraction of the airspeed.
const ADDED_TO: [usize; SENSORS.len()] = [AIRSPEED, 3, 4, 5, 6, 7];
const AIRSPEED: usize = 2;

/// A corrected flight, and the model with the trims of this flight.
#[derive(Clone, Debug)]
pub struct KnownFlight {
    /// The model with the trims of the flight, without the constants that its file states for flights.
    pub model: GreyBox,
    /// The flight in body axes, with the sensor errors removed.
    pub flight: Prepared,
    added: Added,
}

impl KnownFlight {
    /// `flight` after correction with the constants that the file of `model` states for it; `None` if the file states none.
    pub fn of(model: &GreyBox, flight: &Prepared) -> Option<KnownFlight> {
        let own = model.known.of(&flight.name)?;
        let added = Added { own: own.clone(), turning: flight.turning };
        let mut flight = flight.clone();
        flight.segments.iter_mut().flatten().for_each(|at| added.take_away(at));
        Some(KnownFlight { model: with_trims(model, &own), flight, added })
    }

    /// Converts a predicted state to the one that the sensors of the flight would measure.
    pub fn as_measured(&self, state: [f64; 8]) -> [f64; 8] {
        let by = self.added.to(&state);
        std::array::from_fn(|k| state[k] + by[k])
    }
}

/// The measurement errors of a flight: misalignment of the axes, and sensor errors.
#[derive(Clone, Debug)]
struct Added {
    own: FlightConstants,
    turning: Turning,
}

impl Added {
    fn to(&self, state: &[f64; 8]) -> [f64; 8] {
        let mut by = [0.0; 8];
        for (place, x) in ADDED_TO.iter().zip(self.own.sensors.unwrap_or_default()) {
            by[*place] += if *place == AIRSPEED { x * state[AIRSPEED] } else { x };
        }
        for (angle, turned) in self.own.axes_rad().iter().zip(askew::state(&self.turning, state)) {
            by.iter_mut().zip(turned).for_each(|(sum, x)| *sum += angle * x);
        }
        by
    }

    fn take_away(&self, at: &mut Instant) {
        let measured = at.state.to_array();
        let by = self.to(&measured);
        at.state = State::from_array(std::array::from_fn(|k| measured[k] - by[k]));
        let turned = askew::vector(at.specific_force);
        for (angle, by) in self.own.axes_rad().iter().zip(turned) {
            at.specific_force.iter_mut().zip(by).for_each(|(f, by)| *f -= angle * by);
        }
    }
}

/// `model` with the trims in `own`, and without the constants that its file states for flights.
fn with_trims(model: &GreyBox, own: &FlightConstants) -> GreyBox {
    let mut bare = model.clone();
    bare.known = Default::default();
    let Some(values) = own.trims else { return bare };
    // if the model has trims already, they are not set here, because a fit is estimating them
    match trims::joined(&bare) {
        Ok(mut with) => {
            trims::set(&mut with, &values);
            with
        }
        Err(_) => bare,
    }
}

/// `flights` after correction for the misalignment of the axes and the sensor errors in `known`, and the names of the flights
/// that were corrected.
pub fn put_right(known: &Known, flights: &[Reconstruction]) -> (Vec<Reconstruction>, Vec<String>) {
    let mut named = Vec::new();
    let one = |flight: &Reconstruction| {
        let own = known.of(&flight.name);
        let Some(own) = own.filter(|o| o.axes_deg.is_some() || o.sensors.is_some()) else {
            return flight.clone();
        };
        let pieces: Vec<Vec<Instant>> =
            flight.segments.iter().map(|s| s.instants.clone()).collect();
        let added = Added { own, turning: Turning::of(flight, &pieces) };
        let mut right = flight.clone();
        let all = right.segments.iter_mut().flat_map(|s| &mut s.instants);
        all.for_each(|at| added.take_away(at));
        named.push(flight.name.clone());
        right
    };
    let right = flights.iter().map(one).collect();
    (right, named)
}

/// Flights after correction with the constants in a model's file.
#[derive(Clone, Debug)]
pub struct Corrected {
    /// The flights in body axes, with the sensor errors removed.
    pub flights: Vec<Reconstruction>,
    /// The constants to be estimated for each flight. They include trims if the file has trims for any of the flights.
    pub per_flight: PerFlight,
    /// Notes on what was used of the file.
    pub notes: Vec<String>,
}

/// Corrects `flights` for the misalignment of the axes and the sensor errors in `known`, for a regression or a fit that estimates
/// the constants `asked` for each flight. If it estimates the misalignment, the flights are not corrected. If `known` has trims
/// for any of `flights`, trims are estimated for every flight.
pub fn corrected(known: &Known, flights: &[Reconstruction], asked: PerFlight) -> Corrected {
    let (mut per_flight, mut notes) = (asked, Vec::new());
    let (flights, named) = match asked.askew_deg {
        Some(_) => (flights.to_vec(), Vec::new()),
        None => put_right(known, flights),
    };
    if !named.is_empty() {
        let names = named.join(", ");
        notes.push(format!("Axes and sensors are used as the model's file has them: {names}."));
    }
    let has = |f: &&Reconstruction| known.of(&f.name).is_some_and(|own| own.trims.is_some());
    let trimmed: Vec<&str> = flights.iter().filter(has).map(|f| f.name.as_str()).collect();
    if !trimmed.is_empty() && asked.trims.is_none() {
        per_flight.trims = Some(1.0);
        notes.push(format!(
            "The model's file has trims of {}, so each flight is given trims of its own.",
            trimmed.join(", ")
        ));
    }
    Corrected { flights, per_flight, notes }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_with_trims_of_one_flight_has_trims_estimated_for_all() {
        let flights = ["a.csv", "b.csv"].map(Reconstruction::empty);
        let own = FlightConstants {
            trims: Some([0.0; trims::TRIMS.len()]),
            ..FlightConstants::default()
        };
        let mut known = Known::default();
        let none = corrected(&known, &flights, PerFlight::default());
        assert_eq!((none.per_flight, none.notes.len()), (PerFlight::default(), 0));
        known.flights.insert("b.csv".into(), own);
        let with = corrected(&known, &flights, PerFlight::default());
        assert_eq!(with.per_flight.trims, Some(1.0));
        assert!(with.notes[0].contains("has trims of b.csv, so"), "{:?}", with.notes);
    }

    #[test]
    fn trims_have_the_same_names_in_files_and_in_fits() {
        assert_eq!(greylag_model::known::TRIMS, trims::TRIMS.map(|t| t.name));
    }
}
