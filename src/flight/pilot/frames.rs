//! A frame of telemetry for tests, which each of them changes where its subject needs other values.

use greylag_link::vehicle::{Faults, Order, Telemetry, VANE_SD};
use greylag_physics::{ActuatorState, State, Time};

/// The first frame of a vehicle at 600 m with right sensors and vanes in the neutral state, without position, velocity over ground
/// and wind.
pub(crate) fn usable() -> Telemetry {
    Telemetry {
        time: Time::default(),
        order: Order::First,
        faults: Faults::NONE,
        state: State::NEUTRAL,
        incidence_sd: VANE_SD,
        yaw: 0.0,
        rate_hold_s: 0.0,
        specific_force: [0.0, 0.0, -9.81],
        actuators: ActuatorState::default(),
        altitude: 600.0,
        position: [f64::NAN; 2],
        velocity: [f64::NAN; 3],
        wind: [f64::NAN; 3],
    }
}

/// The frame of [`usable`], `k` hundredths of a second later.
pub(crate) fn usable_at(k: u64) -> Telemetry {
    Telemetry { time: Time::from_micros(10_000 * k), ..usable() }
}
