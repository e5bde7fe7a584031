//! Tests of what the CEM planner (cross-entropy method) keeps from one control step to the next.

use std::path::Path;

use super::*;
use greylag_physics::{ActuatorState, State};

/// Candidate plans that a failed search has kept must not enter the next search.
#[test]
fn a_search_does_not_start_from_candidates_of_a_failed_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../params/x8/prior.toml");
    let model = GreyBox::load(&path).unwrap();
    let settings = Settings {
        population: WIDTH,
        update: Update::Elites(WIDTH),
        iterations: 1,
        instructions: Instructions::Portable,
        ..Settings::PAPER
    };
    let seen = Observation {
        time: Time::default(),
        state: State::NEUTRAL,
        incidence_sd: [0.0; 2],
        actuators: ActuatorState::default(),
        altitude: 600.0,
        previous: [Command::IDLE; 2],
    };
    let target = Target { roll: 0.5, pitch: 0.1, airspeed: 16.67 };
    let mut fresh = Cem::new("cem", &model, settings, Aids::default());
    let mut failed = fresh.clone();
    // a failed search with critics can leave this many candidates, more than the `WIDTH` lanes of a block
    failed.kept = vec![[[0.9; 3]; HORIZON]; RESCORED];
    assert_eq!(failed.command(&seen, &target), fresh.command(&seen, &target));
}
