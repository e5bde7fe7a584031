//! Delay margin of a controller, found by simulation: the smallest delay of the elevator or aileron command at which the
//! closed loop keeps oscillating.

use std::collections::VecDeque;
use std::time::Duration;

use crate::pilot::TICK_S;
use greylag_control::{Controller, Observation, Target};
use greylag_model::{GreyBox, Integrator, Trim, TrimError, Twin};
use greylag_physics::actuators::Actuators;
use greylag_physics::{Command, Time};

/// Step between the simulated delays, ms.
const STEP_MS: usize = 4;
/// Largest simulated delay, ms. A loop that is stable with this delay needs no more margin.
const LONGEST_MS: usize = 120;
/// Length of a simulation in ticks of 10 ms.
const TICKS: usize = 1000;
/// Ticks in which a disturbance acts: a pulse of full deflection that begins after 1 s and lasts 0.1 s.
const PULSE: std::ops::Range<usize> = 100..110;
/// First evaluated tick. The last 2 s of a simulation are evaluated, as `examples/delay_margin.rs` does with JSBSim.
const END: usize = 800;
/// Peak-to-peak roll or pitch rate in the evaluated ticks above which the loop counts as oscillating, rad/s (10 °/s).
const SWING: f64 = 0.17;
/// Control period in ms.
const TICK_MS: usize = 10;

/// The smallest delay at which `model` with `controller` keeps oscillating in pitch or in roll. One of the two surface
/// commands is delayed at a time. Each simulation starts in straight flight at the cruise airspeed and applies a pulse of
/// full deflection. `None` if the loops are stable at all delays up to 0.12 s.
///
/// The controller receives surface positions that are computed from the undelayed commands, because a real flight
/// controller does not report positions. The search takes about a second for a controller that computes its command
/// in microseconds.
///
/// # Errors
/// If the model has no trim at the cruise airspeed. The delay margin is then unknown.
pub fn delay_margin(
    controller: &dyn Controller,
    model: &GreyBox,
) -> Result<Option<Duration>, TrimError> {
    // RK4 is used because Euler steps, as in JSBSim, add a delay of one cycle that an aircraft does not have
    let model = &{
        let mut continuous = model.clone();
        continuous.integrator = Integrator::Rk4;
        continuous
    };
    let trim = Trim::straight(model, model.airframe.envelope.airspeed_cruise_mps, ALTITUDE_M)?;
    let mut delays = (0..=LONGEST_MS).step_by(STEP_MS);
    let swings = |delay: usize| {
        let mut axes = [Axis::Pitch, Axis::Roll].into_iter();
        axes.any(|axis| swings(controller, model, &trim, axis, delay))
    };
    Ok(delays.find(|delay| swings(*delay)).map(|ms| Duration::from_millis(ms as u64)))
}

/// The axis whose surface command is delayed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Axis {
    Pitch,
    Roll,
}

/// Whether the rate about `axis` still oscillates at the end of a simulation from `trim`, if the surface command of `axis`
/// is delayed by `delay_ms`.
fn swings(
    controller: &dyn Controller,
    model: &GreyBox,
    trim: &Trim,
    axis: Axis,
    delay_ms: usize,
) -> bool {
    let envelope = &model.airframe.envelope;
    let airspeed = envelope.airspeed_cruise_mps;
    let mut controller = controller.boxed_clone();
    controller.reset(0);
    let mut twin = Twin::at_rest(trim.state, &trim.controls, ALTITUDE_M);
    let figures = &model.airframe.actuators;
    let level = {
        let [aileron, elevator] = [figures.aileron, figures.elevator].map(|s| s.travel.largest());
        Command {
            aileron: trim.controls.aileron / aileron,
            elevator: trim.controls.elevator / elevator,
            throttle: trim.controls.throttle,
            rudder: 0.0,
        }
    };
    let mut thought = Actuators::at_rest(&trim.controls);
    let step = envelope.surface_slew_per_s * TICK_S;
    let target = Target { roll: 0.0, pitch: trim.state.pitch, airspeed };
    let mut late = VecDeque::from(vec![level; delay_ms / TICK_MS + 2]);
    let mut previous = [level; 2];
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for tick in 0..TICKS {
        let seen = Observation {
            time: Time::from_micros(10_000 * tick as u64),
            state: twin.state,
            incidence_sd: [0.0; 2],
            actuators: thought.observed(figures),
            altitude: twin.altitude,
            previous,
        };
        let wanted = controller.command(&seen, &target).clamped();
        let now = slewed(previous[0], wanted, step);
        previous = [now, previous[0]];
        thought.step(&now, figures);
        late.pop_front();
        late.push_back(now);
        let mut flown = delayed(&late, now, axis, delay_ms);
        if PULSE.contains(&tick) {
            let surface = surface(&mut flown, axis);
            *surface = (*surface + 1.0).clamp(-1.0, 1.0);
        }
        twin.step(model, &flown);
        let rate = if axis == Axis::Pitch { twin.state.q } else { twin.state.p };
        if !rate.is_finite() {
            return true;
        }
        if tick >= END {
            range = [range[0].min(rate), range[1].max(rate)];
        }
    }
    range[1] - range[0] > SWING
}

/// Altitude of the simulations, m.
const ALTITUDE_M: f64 = 600.0;

fn surface(command: &mut Command, axis: Axis) -> &mut f64 {
    match axis {
        Axis::Pitch => &mut command.elevator,
        Axis::Roll => &mut command.aileron,
    }
}

/// The command at the actuators: `now`, but with the surface command of `axis` delayed by `delay_ms`. `late` holds the latest
/// commands, the newest last. For a delay that is not a multiple of the control period, two of them are interpolated.
fn delayed(late: &VecDeque<Command>, now: Command, axis: Axis, delay_ms: usize) -> Command {
    let (whole, share) = (delay_ms / TICK_MS, (delay_ms % TICK_MS) as f64 / TICK_MS as f64);
    let newest = late.len() - 1;
    let at = |back: usize| *surface(&mut { late[newest - back] }, axis);
    let value = share * at(whole + 1) + (1.0 - share) * at(whole);
    let mut flown = now;
    *surface(&mut flown, axis) = value;
    flown
}

fn slewed(before: Command, wanted: Command, step: f64) -> Command {
    let near = |from: f64, to: f64| to.clamp(from - step, from + step);
    Command {
        aileron: near(before.aileron, wanted.aileron),
        elevator: near(before.elevator, wanted.elevator),
        rudder: near(before.rudder, wanted.rudder),
        throttle: wanted.throttle,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greylag_control::{ControllerKind, build};
    use std::path::Path;

    fn x8() -> GreyBox {
        GreyBox::load(Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../params/x8/jsbsim.toml"
        )))
        .unwrap()
    }

    #[test]
    fn a_model_without_a_trim_has_no_delay_margin_instead_of_a_large_one() {
        let model = x8();
        let lqi = build(ControllerKind::Lqi, &model).unwrap();
        let mut grounded = model.clone();
        // Nothing flies at this airspeed.
        grounded.airframe.envelope.airspeed_cruise_mps = 0.0;
        let error = delay_margin(lqi.as_ref(), &grounded).unwrap_err();
        assert_eq!((error.model, error.airspeed_mps), (model.name.clone(), 0.0));
    }

    #[test]
    fn the_model_says_of_delay_what_the_official_simulator_does() {
        // In JSBSim with steps of 1 ms, the smallest delay with an oscillation after a pulse of full deflection is 46 ms
        // with `lqi` (in pitch) and 104 ms with `lqi-damped` (`examples/delay_margin.rs`).
        let model = x8();
        let margin = |kind| {
            let margin = delay_margin(build(kind, &model).unwrap().as_ref(), &model).unwrap();
            margin.map_or(120, |d| d.as_millis())
        };
        let (lqi, damped) = (margin(ControllerKind::Lqi), margin(ControllerKind::LqiDamped));
        assert!(lqi.abs_diff(46) <= 8 && damped.abs_diff(104) <= 8, "{lqi} {damped}");
    }
}
