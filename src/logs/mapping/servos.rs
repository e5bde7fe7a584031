//! Rules that convert ArduPilot's servo pulses back to commands with the parameters SERVOn_*.

use super::rule::{Rule, Shape, Term};
use crate::topics::Topics;
use greylag_physics::mixer::{Does, Effector, Mixer};

/// Number of channels in the record RCOU.
const CHANNELS: usize = 16;
/// Values of the parameters SERVOn_FUNCTION.
const AILERON: f64 = 4.0;
const ELEVATOR: f64 = 19.0;
const RUDDER: f64 = 21.0;
const THROTTLE: f64 = 70.0;
const ELEVON_LEFT: f64 = 77.0;
const ELEVON_RIGHT: f64 = 78.0;

/// Rules that compute the commands from the servo pulses of `topic`. `field(n)` is the name of the field of channel n, from 1.
///
/// Positive elevator is nose up in ArduPilot, nose down in the log format. Elevons: left = g (elevator − aileron), right = g
/// (elevator + aileron), with g = MIXING_GAIN (0.5 by default).
///
/// If the airframe's `mixer` assigns the channels, its pseudoinverse gives the commands from the pulses. SERVOn_REVERSED is
/// then not applied, because the gains of the mixer refer to the servos themselves.
pub fn rules(
    topics: &Topics,
    topic: &str,
    mixer: Option<&Mixer>,
    field: impl Fn(usize) -> String,
) -> Vec<Rule> {
    if let Some(rules) = mixer.and_then(|mixer| mixed(topics, topic, mixer, &field)) {
        return rules;
    }
    let parameter =
        |n: usize, what: &str| topics.parameters.get(&format!("SERVO{n}_{what}")).copied();
    let channels =
        |function: f64| (1..=CHANNELS).filter(move |n| parameter(*n, "FUNCTION") == Some(function));
    let sign = |n: usize| if parameter(n, "REVERSED") == Some(1.0) { -1.0 } else { 1.0 };
    let surface = |n: usize, gain: f64| {
        let (min, max) =
            (parameter(n, "MIN").unwrap_or(1100.0), parameter(n, "MAX").unwrap_or(1900.0));
        let trim = parameter(n, "TRIM").unwrap_or(1500.0);
        Term { field: field(n), gain: gain * sign(n), shape: Shape::Surface { min, trim, max } }
    };
    let note = |what: &str| {
        format!("{what} taken from servo pulses with SERVOn_MIN, _TRIM, _MAX, _REVERSED")
    };
    let mut out = Vec::new();
    for (column, function, gain) in [
        ("aileron_cmd", AILERON, 1.0),
        ("elevator_cmd", ELEVATOR, -1.0),
        ("rudder_cmd", RUDDER, -1.0),
    ] {
        // Servos with the same function move together, so only the first is used.
        if let Some(n) = channels(function).next() {
            out.push(Rule::sum(column, topic, vec![surface(n, gain)]).noting(note(column)));
        }
    }
    let half =
        0.5 / topics.parameters.get("MIXING_GAIN").copied().filter(|g| *g > 0.0).unwrap_or(0.5);
    if let (Some(left), Some(right)) = (channels(ELEVON_LEFT).next(), channels(ELEVON_RIGHT).next())
    {
        let aileron = vec![surface(right, half), surface(left, -half)];
        let elevator = vec![surface(right, -half), surface(left, -half)];
        out.push(Rule::sum("aileron_cmd", topic, aileron).noting(note("elevons: aileron_cmd")));
        out.push(Rule::sum("elevator_cmd", topic, elevator).noting(note("elevons: elevator_cmd")));
    }
    if let Some(n) = channels(THROTTLE).next() {
        let (a, b) = (parameter(n, "MIN").unwrap_or(1100.0), parameter(n, "MAX").unwrap_or(1900.0));
        let term = Term { field: field(n), gain: sign(n), shape: Shape::Range { min: a, max: b } };
        let reversed = if sign(n) < 0.0 { 1.0 } else { 0.0 };
        out.push(Rule::sum("throttle_cmd", topic, vec![term]).plus(reversed));
    }
    out
}

/// Rules that compute the commands from the pulses by the pseudoinverse of `mixer`. `None` if `mixer` lacks the channel of an
/// effector (surface or motor) that is needed.
fn mixed(
    topics: &Topics,
    topic: &str,
    mixer: &Mixer,
    field: impl Fn(usize) -> String,
) -> Option<Vec<Rule>> {
    let term = |effector: &Effector, gain: f64| {
        let n = usize::from(effector.channel?);
        let read = |what: &str, usual: f64| {
            topics.parameters.get(&format!("SERVO{n}_{what}")).copied().unwrap_or(usual)
        };
        let (min, trim, max) = (read("MIN", 1100.0), read("TRIM", 1500.0), read("MAX", 1900.0));
        let shape = match effector.does {
            Does::Deflects(_) => Shape::Surface { min, trim, max },
            Does::Pulls => Shape::Range { min, max },
        };
        Some(Term { field: field(n), gain, shape })
    };
    let columns = ["aileron_cmd", "elevator_cmd", "rudder_cmd", "throttle_cmd"];
    let both = || mixer.effectors().iter().zip(mixer.command_shares());
    let rules = columns.into_iter().enumerate().map(|(j, column)| {
        let moving = both().filter(|(_, share)| share[j] != 0.0);
        let terms = moving.map(|(e, share)| term(e, share[j])).collect::<Option<Vec<_>>>()?;
        let note = format!(
            "{column} is the least-squares inverse of the airframe's mixer over servo pulses"
        );
        Some(Rule::sum(column, topic, terms).noting(note))
    });
    let rules = rules.collect::<Option<Vec<_>>>()?;
    Some(rules.into_iter().filter(|rule| rule.origin() != format!("{topic}.")).collect())
}
