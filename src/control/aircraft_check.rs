//! Pre-flight check of a model: trim over the envelope, modes, control authority, and stability margins of the LQI
//! (linear-quadratic controller with integral action). A finding is a sentence on something to correct before a flight.

use serde::Serialize;

pub use crate::authority::Authority;
use crate::lqi::{self, LoopMargins, MarginsError, Weights};
use crate::{ControllerKind, SetupError, build};
use greylag_model::modes::{Mode, modes};
use greylag_model::{GreyBox, Trim, TrimError};

/// Number of airspeeds in the trim table.
const SPEEDS: usize = 7;
/// Largest fraction of the elevator's travel that trim may use without a finding. The rest is kept for manoeuvres and gusts.
const MUCH_TRAVEL: f64 = 0.8;
/// Total delay of sensing, link and servo that is typical of a small aircraft, s.
const USUAL_DELAY: f64 = 0.04;
/// Accuracy of the search for the fastest level flight, m/s.
const LEVEL_WITHIN_MPS: f64 = 0.01;
/// Smallest steady roll rate at full aileron without a finding, rad/s (about 20°/s).
const SLOW_ROLL: f64 = 0.35;
/// Pitch acceleration at full elevator below which the elevator has no effect, rad/s².
const NO_PITCH: f64 = 0.01;

/// Steady straight flight at one airspeed. If level flight is not possible, it is a descent at full throttle or at idle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Level {
    /// True airspeed V_a, m/s.
    pub airspeed: f64,
    /// Angle of attack, rad.
    pub alpha: f64,
    /// Elevator command as a fraction of its travel, −1..1.
    pub elevator: f64,
    /// Throttle command as a fraction, 0..1.
    pub throttle: f64,
    /// Flight-path angle, rad, positive above the horizon.
    pub path: f64,
}

impl Level {
    /// Whether elevator and throttle are within their travel, so that the aircraft can fly so.
    pub fn is_possible(&self) -> bool {
        self.elevator.abs() <= 1.0 && (0.0..=1.0).contains(&self.throttle)
    }
}

/// Name of the LQI in the registry of controllers.
const LQI: &str = "lqi";

/// The recommended controller, the LQI or the damped LQI (with other weights), and its margins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Advised {
    /// Name of the controller in the registry.
    pub name: &'static str,
    /// Smallest delay margin of the controller's loops at the cruise airspeed, s.
    pub delay_s: f64,
    /// Stability margins of each loop of the controller at the cruise airspeed.
    pub loops: Vec<LoopMargins>,
}

impl Advised {
    fn new(name: &'static str, loops: Vec<LoopMargins>) -> Advised {
        let delay_s = loops.iter().map(|l| l.delay).fold(f64::INFINITY, f64::min);
        Advised { name, delay_s, loops }
    }
}

/// Results of [`check`] at the model's reference altitude.
#[derive(Clone, Debug, Serialize)]
pub struct AircraftCheck {
    /// Straight flight at equally spaced airspeeds of the envelope. Airspeeds without a trim are left out.
    pub levels: Vec<Level>,
    /// The modes at the cruise airspeed.
    pub modes: Vec<Mode>,
    /// Airspeed of the fastest level flight, m/s. `None` if level flight is possible at the envelope's highest airspeed, or
    /// not even at cruise.
    pub level_up_to: Option<f64>,
    /// The recommended controller and its margin.
    pub controller: Advised,
    /// Control authority at the cruise airspeed.
    pub authority: Authority,
    /// Stability margins of each loop of the LQI with default weights at the cruise airspeed.
    pub loops: Vec<LoopMargins>,
    /// Whether an LQI can be designed over the envelope. If not, no controller is recommended.
    pub designed: bool,
    /// Findings to correct before a flight, most severe first.
    pub findings: Vec<String>,
}

impl AircraftCheck {
    /// The loops of the LQI, then those of the recommended controller if it is another one. Each comes with the name of its
    /// controller. Empty if no controller can be designed.
    pub fn named_loops(&self) -> impl Iterator<Item = (&'static str, &LoopMargins)> {
        let Advised { name, loops, .. } = &self.controller;
        let advised = loops.iter().filter(move |_| *name != LQI).map(move |l| (*name, l));
        self.loops.iter().map(|l| (LQI, l)).chain(advised).filter(move |_| self.designed)
    }
}

/// Reason why a model cannot be checked.
#[derive(Debug, thiserror::Error)]
pub enum CheckError {
    /// No trim exists at the cruise airspeed.
    #[error(transparent)]
    Trim(#[from] TrimError),
    /// No LQI gain stabilises the aircraft at the cruise airspeed.
    #[error(transparent)]
    Margins(#[from] MarginsError),
}

/// Checks the aircraft that `model` describes, at its reference altitude.
///
/// # Errors
/// If no trim or no stabilising LQI gain exists at the cruise airspeed.
pub fn check(model: &GreyBox) -> Result<AircraftCheck, CheckError> {
    let envelope = model.airframe.envelope;
    let altitude = model.airframe.reference.altitude;
    let cruise = envelope.airspeed_cruise_mps;
    let trim = Trim::straight(model, cruise, altitude)?;
    let span = envelope.airspeed_max_mps - envelope.airspeed_min_mps;
    let speeds =
        (0..SPEEDS).map(|i| envelope.airspeed_min_mps + span * i as f64 / (SPEEDS - 1) as f64);
    let loops = lqi::margins(model, cruise, &Weights::DEFAULT)?;
    let design = build(ControllerKind::Lqi, model).map(drop);
    let mut check = AircraftCheck {
        levels: speeds.clone().filter_map(|v| level(model, v, altitude)).collect(),
        modes: modes(model, cruise, altitude)?,
        level_up_to: fastest_level(model),
        controller: advised(model, &loops)?,
        authority: Authority::at(model, &trim, altitude),
        loops,
        designed: design.is_ok(),
        findings: Vec::new(),
    };
    check.findings = findings(model, &check, speeds.count());
    if let Err(why) = design {
        check.findings.insert(0, undesigned(&why));
    }
    Ok(check)
}

/// Recommends the LQI, which has the margins `loops`, if its delay margin is at least [`USUAL_DELAY`]. Otherwise recommends the one
/// of LQI and damped LQI that has the larger delay margin.
fn advised(model: &GreyBox, loops: &[LoopMargins]) -> Result<Advised, CheckError> {
    let plain = Advised::new(LQI, loops.to_vec());
    if plain.delay_s >= USUAL_DELAY {
        return Ok(plain);
    }
    let cruise = model.airframe.envelope.airspeed_cruise_mps;
    let damped = Advised::new("lqi-damped", lqi::margins(model, cruise, &Weights::DAMPED)?);
    Ok(if damped.delay_s > plain.delay_s { damped } else { plain })
}

/// Whether a throttle within 0..1 holds level flight at `airspeed`, m/s.
fn flies_level(model: &GreyBox, airspeed: f64) -> bool {
    let trim = Trim::level(model, airspeed, model.airframe.reference.altitude);
    trim.is_ok_and(|t| (0.0..=1.0).contains(&t.controls.throttle))
}

/// Returns the highest airspeed (m/s) of level flight, between the cruise airspeed and the envelope's highest airspeed.
/// `None` if level flight is possible at the envelope's highest airspeed, or not even at cruise.
pub fn fastest_level(model: &GreyBox) -> Option<f64> {
    let envelope = model.airframe.envelope;
    let (mut slow, mut fast) = (envelope.airspeed_cruise_mps, envelope.airspeed_max_mps);
    if flies_level(model, fast) || !flies_level(model, slow) {
        return None;
    }
    while fast - slow > LEVEL_WITHIN_MPS {
        let middle = 0.5 * (slow + fast);
        if flies_level(model, middle) { slow = middle } else { fast = middle }
    }
    Some(slow)
}

fn level(model: &GreyBox, airspeed: f64, altitude: f64) -> Option<Level> {
    let trim = Trim::straight(model, airspeed, altitude).ok()?;
    let elevator = model.airframe.actuators.elevator.travel.part(trim.controls.elevator);
    let (alpha, throttle) = (trim.state.alpha, trim.controls.throttle);
    Some(Level { airspeed, alpha, elevator, throttle, path: trim.path() })
}

/// The smallest and the largest of `values` with `places` decimal places, or the only one.
fn range(values: impl Iterator<Item = f64> + Clone, places: usize) -> String {
    let least = format!("{:.places$}", values.clone().fold(f64::INFINITY, f64::min));
    let most = format!("{:.places$}", values.fold(f64::NEG_INFINITY, f64::max));
    if least == most { least } else { format!("{least} to {most}") }
}

/// The airspeeds of `levels`, m/s, as text.
fn airspeeds<'a>(levels: impl Iterator<Item = &'a Level>) -> String {
    levels.map(|l| format!("{:.1}", l.airspeed)).collect::<Vec<_>>().join(", ")
}

/// Findings on straight flight over the airspeeds, one for each cause.
fn findings_in_levels(model: &GreyBox, levels: &[Level]) -> Vec<String> {
    let mut out = Vec::new();
    let strained = levels.iter().filter(|l| l.elevator.abs() > MUCH_TRAVEL);
    if strained.clone().next().is_some() {
        out.push(format!(
            "straight flight at {} m/s takes {} % of the elevator's travel: move the centre of gravity or correct Cm0, \
             Cmalpha and Cmde",
            airspeeds(strained.clone()),
            range(strained.map(|l| 100.0 * l.elevator.abs()), 0)
        ));
    }
    // above the cruise airspeed, a descent at full throttle is no fault
    let cruise = model.airframe.envelope.airspeed_cruise_mps;
    let sinks = |l: &&Level| l.airspeed <= cruise && l.throttle == 1.0 && l.path < 0.0;
    let sinking = levels.iter().filter(sinks);
    if sinking.clone().next().is_some() {
        out.push(format!(
            "full throttle does not hold level flight at {} m/s: it descends by {} degrees; correct thrust, drag or the \
             envelope",
            airspeeds(sinking.clone()),
            range(sinking.map(|l| -l.path.to_degrees()), 1)
        ));
    }
    let braked = levels.iter().filter(|l| !(0.0..=1.0).contains(&l.throttle));
    if braked.clone().next().is_some() {
        out.push(format!(
            "straight flight at {} m/s takes {} % of throttle, which is impossible: correct thrust and drag",
            airspeeds(braked.clone()),
            range(braked.map(|l| 100.0 * l.throttle), 0)
        ));
    }
    out
}

/// Finding on the surfaces that act against their sign; `None` if there are none.
fn reversed(authority: &Authority) -> Option<String> {
    let Authority { roll_rate, pitch_acceleration, yaw_acceleration } = *authority;
    let surfaces = [
        (roll_rate < 0.0, "positive aileron must roll right (Clda)"),
        (pitch_acceleration > 0.0, "positive elevator must pitch down (Cmde)"),
        (yaw_acceleration.is_some_and(|y| y > 0.0), "positive rudder must yaw left (Cndr)"),
    ];
    let said: Vec<&str> = surfaces.iter().filter(|(wrong, _)| *wrong).map(|(_, s)| *s).collect();
    let verb = if said.len() > 1 {
        "surfaces act against their sign"
    } else {
        "a surface acts against its sign"
    };
    (!said.is_empty()).then(|| format!("{verb}: {}; correct the sign", said.join(", ")))
}

/// Finding that no LQI can be designed for the reason `why`.
fn undesigned(why: &SetupError) -> String {
    let by_envelope = matches!(why, SetupError::Design { .. });
    let remedy = "; give the envelope less bank or a pitch_min_deg nearer to 0";
    format!("{why}{}", if by_envelope { remedy } else { "" })
}

/// All findings except on the design of the LQI as sentences, with the most severe first.
fn findings(model: &GreyBox, check: &AircraftCheck, speeds: usize) -> Vec<String> {
    let mut out: Vec<String> = reversed(&check.authority).into_iter().collect();
    let missing = speeds - check.levels.len();
    if missing > 0 {
        out.push(format!(
            "no straight flight at {missing} of {speeds} airspeeds of the envelope: correct \
             airspeed_min_mps and airspeed_max_mps"
        ));
    }
    out.extend(findings_in_levels(model, &check.levels));
    if check.authority.pitch_acceleration.abs() < NO_PITCH {
        out.push("the elevator has no effect: correct Cmde".into());
    }
    if check.authority.roll_rate.abs() < SLOW_ROLL {
        out.push(format!(
            "full aileron rolls at {:.0} deg/s only: correct Clda or Clp",
            check.authority.roll_rate.to_degrees().abs()
        ));
    }
    let Advised { name, delay_s, .. } = check.controller;
    if check.designed && delay_s < USUAL_DELAY {
        out.push(format!(
            "the loops of {name} tolerate {:.0} ms of delay, sensors, link and servos have up to {:.0} ms: make the link \
             faster, or correct Clda, Cmde or the inertia",
            1e3 * delay_s,
            1e3 * USUAL_DELAY
        ));
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
