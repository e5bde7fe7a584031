//! Result of a comparison for one flight: number of samples, estimated sensor errors, states and controls over time.

use crate::compare::result::{FlightResult, FlightTrace, NuisanceResult};
use crate::flight_path::reconstruction::{Instant, Nuisance, Reconstruction};
use crate::weak_form::prepared::Prepared;

/// The result for `flight`, which was prepared from the reconstruction `from`.
pub fn result(flight: &Prepared, from: &Reconstruction) -> FlightResult {
    let ends = |s: &Vec<Instant>| Some([s.first()?.time_s, s.last()?.time_s]);
    let nuisance = |n: &Nuisance| NuisanceResult {
        name: n.name.clone(),
        value: n.value,
        sd: n.sd,
        unit: n.unit,
        prior: n.prior.map(|p| p.value),
        prior_sd: n.prior.map(|p| p.sd),
        moved_sd: n.prior.map(|_| n.moved()),
    };
    FlightResult {
        name: flight.name.clone(),
        step_s: flight.dt,
        samples: flight.sample_count(),
        segments_s: flight.segments.iter().filter_map(ends).collect(),
        nuisances: from.nuisances.iter().map(nuisance).collect(),
        notes: from.notes.clone(),
        trace: trace(flight),
    }
}

fn trace(flight: &Prepared) -> FlightTrace {
    let mut trace = FlightTrace::default();
    let rows = flight.sample_count() + flight.segments.len();
    trace.time_s.reserve_exact(rows);
    trace.states.iter_mut().chain(&mut trace.controls).for_each(|list| list.reserve_exact(rows));
    for segment in &flight.segments {
        for i in segment {
            let z = i.controls;
            push(&mut trace, i.time_s, i.state.to_array(), [z.aileron, z.elevator, z.throttle]);
        }
        if let Some(last) = segment.last() {
            push(&mut trace, last.time_s + flight.dt, [f64::NAN; 8], [f64::NAN; 3]);
        }
    }
    trace
}

fn push(trace: &mut FlightTrace, time_s: f64, state: [f64; 8], controls: [f64; 3]) {
    trace.time_s.push(time_s);
    trace.states.iter_mut().zip(state).for_each(|(list, x)| list.push(x));
    trace.controls.iter_mut().zip(controls).for_each(|(list, x)| list.push(x));
}
