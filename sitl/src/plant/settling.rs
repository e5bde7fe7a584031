//! Lets systems come to rest while the aircraft is held in its state.

use jsbsim::{Error, Fdm, NodeId};

/// A step too short to move the aircraft, s. Filters and kinematics keep the step for which they were discretised.
pub(super) const STILL_S: f64 = 1e-12;

/// Longest time for flaps and gear to reach their held positions, s.
const TRANSIT_S: f64 = 60.0;
/// Time without a change of the aerodynamic loads after which flaps and gear count as at rest, s.
const AT_REST_S: f64 = 0.5;
/// Relative change of a load per frame below which it counts as constant.
const UNCHANGED: f64 = 1e-9;
/// Aerodynamic forces (lbf) and moments (lbf ft), body axes.
const LOADS: [&str; 6] = [
    "forces/fbx-aero-lbs",
    "forces/fby-aero-lbs",
    "forces/fbz-aero-lbs",
    "moments/l-aero-lbsft",
    "moments/m-aero-lbsft",
    "moments/n-aero-lbsft",
];

/// Writes the properties that are held.
pub(super) fn hold(fdm: &mut Fdm, held: &[(NodeId, f64)]) -> Result<(), Error> {
    for (node, value) in held {
        fdm.write_node(*node, *value)?;
    }
    Ok(())
}

/// Evaluates the derivatives in the present air and fills the integrators' histories with them.
///
/// JSBSim's initial condition accepts no vertical wind, so the wind is set after it. Five frames fill the longest history
/// (Adams-Bashforth 3 needs three).
pub(super) fn settle(fdm: &mut Fdm, step_s: f64) -> Result<(), Error> {
    fdm.set_dt(STILL_S);
    for _ in 0..5 {
        fdm.run()?;
    }
    fdm.set_dt(step_s);
    Ok(())
}

/// Holds the properties `held` until flaps, gear and other systems are at rest, for at most 60 s. `step_s` is in s.
pub(super) fn settle_conditions(
    fdm: &mut Fdm,
    held: &[(NodeId, f64)],
    step_s: f64,
) -> Result<(), Error> {
    if held.is_empty() {
        return Ok(());
    }
    fdm.set_dt(STILL_S);
    let came = come_to_rest(fdm, held, step_s);
    fdm.set_dt(step_s);
    came
}

fn come_to_rest(fdm: &mut Fdm, held: &[(NodeId, f64)], step_s: f64) -> Result<(), Error> {
    let frames = |seconds: f64| (seconds / step_s).ceil() as usize;
    let (mut last, mut at_rest) = ([f64::INFINITY; 6], 0);
    for _ in 0..frames(TRANSIT_S) {
        hold(fdm, held)?;
        fdm.run()?;
        let mut now = [0.0; 6];
        for (load, name) in now.iter_mut().zip(LOADS) {
            *load = fdm.get_property(name)?;
        }
        let still = |(a, b): (&f64, &f64)| (a - b).abs() <= UNCHANGED * a.abs();
        at_rest = if now.iter().zip(&last).all(still) { at_rest + 1 } else { 0 };
        if at_rest >= frames(AT_REST_S) {
            break;
        }
        last = now;
    }
    Ok(())
}
