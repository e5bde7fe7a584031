//! What a model says of its aircraft before anybody flies it: trim, modes, authority, loops.

use serde::Serialize;

use crate::lqi::{self, LoopMargins, MarginsError, Weights};
use crate::{ControllerKind, build};
use greylag_model::modes::{Mode, modes, rates};
use greylag_model::{GreyBox, Trim, TrimError};

/// Airspeeds of the trim table.
const SPEEDS: usize = 7;
/// Part of a surface's travel above which level flight leaves too little of it: a fifth for everything else.
const MUCH_TRAVEL: f64 = 0.8;
/// Delay that sensing, link and servo of a small aircraft have together, s.
const USUAL_DELAY: f64 = 0.04;
/// Roll rate at full aileron below which an aircraft is slow to roll, rad/s (20°/s).
const SLOW_ROLL: f64 = 0.35;

/// Straight flight at one airspeed: level, or the descent, at full or idle throttle, of an aircraft that cannot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// True airspeed, m/s.
    pub airspeed: f64,
    /// Angle of attack, rad.
    pub alpha: f64,
    /// Elevator in parts of its travel, −1..1.
    pub elevator: f64,
    /// Throttle, which may lie beyond its stops.
    pub throttle: f64,
    /// Angle of the flight path above the horizon, rad: zero, or below in a descent.
    pub path: f64,
}

/// What the surfaces do at full travel in level flight at the cruise airspeed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Authority {
    /// Steady roll rate, rad/s.
    pub roll_rate: f64,
    /// Pitching acceleration, rad/s².
    pub pitch_acceleration: f64,
    /// Yawing acceleration by the rudder, rad/s².
    pub yaw_acceleration: Option<f64>,
}

/// What was found.
#[derive(Clone, Debug, Serialize)]
pub struct AircraftCheck {
    /// Straight flight over the envelope's airspeeds, where there is any.
    pub levels: Vec<Level>,
    /// The modes at the cruise airspeed.
    pub modes: Vec<Mode>,
    /// What the surfaces do there.
    pub authority: Authority,
    /// What each loop of the LQI bears there.
    pub loops: Vec<LoopMargins>,
    /// What should be mended before a flight, worst first.
    pub findings: Vec<String>,
}

/// Why an aircraft cannot be checked: it does not fly at its cruise airspeed.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// It cannot be trimmed there.
    #[error(transparent)]
    Trim(#[from] TrimError),
    /// It cannot be stabilised there.
    #[error(transparent)]
    Margins(#[from] MarginsError),
}

/// Checks the aircraft that `model` describes, at its reference altitude.
///
/// # Errors
/// If it cannot be trimmed or stabilised at the cruise airspeed.
pub fn check(model: &GreyBox) -> Result<AircraftCheck, CheckError> {
    let envelope = model.airframe.envelope;
    let altitude = model.airframe.reference.altitude;
    let cruise = envelope.airspeed_cruise_mps;
    let trim = Trim::straight(model, cruise, altitude)?;
    let span = envelope.airspeed_max_mps - envelope.airspeed_min_mps;
    let speeds =
        (0..SPEEDS).map(|i| envelope.airspeed_min_mps + span * i as f64 / (SPEEDS - 1) as f64);
    let mut check = AircraftCheck {
        levels: speeds.clone().filter_map(|v| level(model, v, altitude)).collect(),
        modes: modes(model, cruise, altitude)?,
        authority: authority(model, &trim, altitude),
        loops: lqi::margins(model, cruise, &Weights::DEFAULT)?,
        findings: Vec::new(),
    };
    check.findings = findings(model, &check, speeds.count());
    Ok(check)
}

fn level(model: &GreyBox, airspeed: f64, altitude: f64) -> Option<Level> {
    let trim = Trim::straight(model, airspeed, altitude).ok()?;
    let elevator = model.airframe.actuators.elevator.travel.part(trim.controls.elevator);
    let (alpha, throttle) = (trim.state.alpha, trim.controls.throttle);
    Some(Level { airspeed, alpha, elevator, throttle, path: trim.path() })
}

fn authority(model: &GreyBox, trim: &Trim, altitude: f64) -> Authority {
    let linear = rates(model, trim, altitude);
    let figures = &model.airframe.actuators;
    let full = |place: usize, column: usize, travel: f64| linear.b[(place, column)] * travel;
    let rudder = figures.rudder.filter(|_| model.has_rudder());
    Authority {
        // rolling settles where damping meets the aileron
        roll_rate: full(3, 0, figures.aileron.travel.smallest()) / -linear.a[(3, 3)],
        pitch_acceleration: full(4, 1, figures.elevator.travel.smallest()),
        yaw_acceleration: rudder.map(|rudder| full(5, 3, rudder.travel.smallest())),
    }
}

/// What is wrong with straight flight at one airspeed.
fn findings_in_level(model: &GreyBox, level: &Level) -> Vec<String> {
    let mut out = Vec::new();
    let Level { airspeed, elevator, throttle, path, .. } = *level;
    if elevator.abs() > MUCH_TRAVEL {
        out.push(format!(
            "straight flight at {airspeed:.1} m/s takes {:.0} % of the elevator's travel: move the \
             centre of gravity or correct Cm0, Cmalpha and Cmde",
            100.0 * elevator.abs()
        ));
    }
    // above the cruise airspeed the envelope allows dives
    let cruises = airspeed <= model.airframe.envelope.airspeed_cruise_mps;
    if cruises && throttle == 1.0 && path < 0.0 {
        out.push(format!(
            "full throttle does not hold level flight at {airspeed:.1} m/s: it descends by {:.1} degrees; correct \
             thrust, drag or the envelope",
            -path.to_degrees()
        ));
    }
    if cruises && !(0.0..=1.0).contains(&throttle) {
        out.push(format!(
            "level flight at {airspeed:.1} m/s takes {:.0} % of throttle: the aircraft climbs or sinks \
             there; correct thrust, drag or the envelope",
            100.0 * throttle
        ));
    }
    out
}

/// What is wrong with the aircraft, in sentences; empty if nothing is.
fn findings(model: &GreyBox, check: &AircraftCheck, speeds: usize) -> Vec<String> {
    let mut out = Vec::new();
    let Authority { roll_rate, pitch_acceleration, yaw_acceleration } = check.authority;
    if roll_rate < 0.0 || pitch_acceleration > 0.0 || yaw_acceleration.is_some_and(|y| y > 0.0) {
        out.push(
            "a surface acts against its sign: positive aileron must roll right, positive elevator pitch \
             down, positive rudder yaw left; correct Clda, Cmde or Cndr"
                .into(),
        );
    }
    let missing = speeds - check.levels.len();
    if missing > 0 {
        out.push(format!(
            "no straight flight at {missing} of {speeds} airspeeds of the envelope: correct \
             airspeed_min_mps and airspeed_max_mps"
        ));
    }
    check.levels.iter().for_each(|level| out.extend(findings_in_level(model, level)));
    if check.authority.roll_rate.abs() < SLOW_ROLL {
        out.push(format!(
            "full aileron rolls at {:.0} deg/s only: correct Clda or Clp",
            check.authority.roll_rate.to_degrees().abs()
        ));
    }
    if let Err(why) = build(ControllerKind::Lqi, model) {
        out.push(format!("{why}; give the envelope less bank or a pitch_min_deg nearer to 0"));
    }
    for LoopMargins { surface, delay, .. } in &check.loops {
        if *delay < USUAL_DELAY {
            out.push(format!(
                "the LQI's {surface} loop bears {:.0} ms of delay, sensors, link and servos have up to \
                 {:.0} ms: use lqi-damped",
                1e3 * delay,
                1e3 * USUAL_DELAY
            ));
        }
    }
    let stray = check
        .modes
        .iter()
        .filter(|m| m.eigenvalue.re > 0.0 && m.time_constant().abs() < 2.0 && m.name != "spiral");
    out.extend(stray.map(|mode| {
        format!(
            "the {} mode grows with a time constant of {:.1} s: correct the model's stability \
             derivatives, or keep a human from flying it by hand",
            mode.name,
            mode.time_constant().abs()
        )
    }));
    let said = model.airframe.actuators.rudder.is_some() && !model.has_rudder();
    if said {
        out.push(
            "the airframe file has a rudder, the model no rudder_linear: turns are flown without it".into(),
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn model(path: &str) -> GreyBox {
        GreyBox::load(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
    }

    #[test]
    fn the_shipped_aircraft_can_be_flown() {
        for path in ["params/x8/jsbsim.toml", "params/aerosonde/jsbsim.toml"] {
            let found = check(&model(path)).unwrap();
            assert!(
                found.loops.iter().all(|l| l.delay > 0.02 && l.gain[1] > 1.5),
                "{:?}",
                found.loops
            );
            assert!(found.authority.roll_rate > SLOW_ROLL);
            // what may be said of them is the delay that the LQI bears
            assert!(found.findings.iter().all(|f| f.contains("of delay")), "{:?}", found.findings);
            assert_eq!(found.modes.iter().filter(|m| m.name == "short period").count(), 1);
        }
    }

    #[test]
    fn a_reversed_surface_and_a_weak_motor_are_said() {
        let mut wrong = model("params/aerosonde/jsbsim.toml");
        assert!(wrong.set_coefficient("roll_linear.Clda", -0.17));
        assert!(wrong.set_coefficient("thrust_table.k", 0.25));
        let said = check(&wrong).unwrap().findings.join("\n");
        assert!(said.contains("Clda") && said.contains("throttle"), "{said}");
    }
}
