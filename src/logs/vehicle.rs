//! Type of the vehicle, and the intervals in which a VTOL hovers or is in transition. Both are read from the records of the log.
//!
//! Sources: MAV_TYPE of HEARTBEAT, vtol_state of EXTENDED_SYS_STATE (MAVLink common.xml); vehicle_status and
//! vtol_vehicle_status (PX4 msg/); Q_ENABLE, Q_TILT_MASK, FRAME_CLASS, SERVOn_FUNCTION 33 to 40, the mode numbers 17 to
//! 23 and 25 of ArduPlane, and QTUN's throttle of the lift motors (ArduPilot).

use serde::Serialize;

use super::Format;
use super::topics::Topics;

/// The types of vehicle that are distinguished.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A fixed-wing aircraft, which is always wing-borne in flight.
    FixedWing,
    /// An aircraft that can hover and can fly wing-borne.
    Vtol,
    /// A multicopter, which has no wings.
    Multicopter,
    /// A vehicle without wings: helicopter, rover, boat.
    Other,
}

impl Kind {
    /// The name of the type as shown to the user.
    pub fn name(self) -> &'static str {
        match self {
            Kind::FixedWing => "fixed-wing aircraft",
            Kind::Vtol => "VTOL aircraft, cut to flight on its wings",
            Kind::Multicopter => "multicopter",
            Kind::Other => "not an aircraft with wings",
        }
    }
}

/// A vehicle type, with the record that shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Vehicle {
    /// The type that the record shows.
    pub kind: Kind,
    /// Name of the log's record that shows the type.
    pub by: String,
}

impl Vehicle {
    /// Reason for which a log of this vehicle cannot be studied; `None` for an aircraft with wings.
    pub fn refusal(&self) -> Option<String> {
        let what = match self.kind {
            Kind::FixedWing | Kind::Vtol => return None,
            Kind::Multicopter => "a multicopter",
            Kind::Other => "no aircraft with wings",
        };
        let by = &self.by;
        Some(format!(
            "the vehicle is {what} ({by}): the models here are of aircraft that fly on wings; give a log of one"
        ))
    }
}

/// The vehicle of a log; `None` if no record shows its type.
pub(super) fn vehicle(format: Format, topics: &Topics) -> Option<Vehicle> {
    match format {
        Format::Csv => None,
        Format::Ulog => px4(topics),
        Format::Dataflash => ardupilot(topics),
        Format::Tlog => telemetry(topics),
        Format::Ros => px4(topics).or_else(|| mavros(topics)),
    }
}

fn found(kind: Kind, by: impl Into<String>) -> Option<Vehicle> {
    Some(Vehicle { kind, by: by.into() })
}

/// Type of vehicle with the MAV_TYPE `number`; `None` for numbers of anything else, such as a ground station.
fn by_type(number: f64) -> Option<Kind> {
    Some(match number as i64 {
        1 | 16 | 28 => Kind::FixedWing,
        2 | 13 | 14 | 15 | 29 | 35 => Kind::Multicopter,
        19..=25 => Kind::Vtol,
        3 | 4 | 7..=12 => Kind::Other,
        _ => return None,
    })
}

fn px4(topics: &Topics) -> Option<Vehicle> {
    let last = |field: &str| topics.series("vehicle_status", field)?.1.last().copied();
    let ever = |topic: &str, field: &str, is: f64| {
        topics.series(topic, field).is_some_and(|(_, values)| values.contains(&is))
    };
    if ever("vehicle_status", "is_vtol", 1.0) {
        return found(Kind::Vtol, "vehicle_status.is_vtol");
    }
    for (by, number) in [
        ("vehicle_status.system_type", last("system_type")),
        ("MAV_TYPE", topics.parameter("MAV_TYPE")),
    ] {
        if let Some(kind) = number.and_then(by_type) {
            return found(kind, format!("{by} {}", number.unwrap_or_default()));
        }
    }
    if topics.first("vtol_vehicle_status").is_some() {
        return found(Kind::Vtol, "vtol_vehicle_status");
    }
    match (last("vehicle_type"), last("is_rotary_wing")) {
        (Some(1.0), _) | (None, Some(1.0)) => found(Kind::Multicopter, "vehicle_status"),
        (Some(2.0), _) | (None, Some(0.0)) => found(Kind::FixedWing, "vehicle_status"),
        _ => None,
    }
}

/// MAVROS publishes no vehicle type. A `vtol_state` from 1 to 4 shows a VTOL.
fn mavros(topics: &Topics) -> Option<Vehicle> {
    let (_, states) = topics.series("extended_state", "vtol_state")?;
    let vtol = states.iter().any(|state| (1.0..=4.0).contains(state));
    vtol.then(|| Vehicle { kind: Kind::Vtol, by: "extended_state.vtol_state".into() })
}

fn ardupilot(topics: &Topics) -> Option<Vehicle> {
    let on = |name: &str| topics.parameter(name).is_some_and(|x| x > 0.0);
    if on("Q_ENABLE") {
        return found(Kind::Vtol, "Q_ENABLE");
    }
    let firmware = topics.firmware.split_whitespace().next().unwrap_or_default();
    // Only firmware for helicopters has parameters of a swash plate. Their names depend on the version.
    let swash = |name: &String| name.starts_with("H_SV") || name.starts_with("H_SW_");
    let rotor = topics.parameters.keys().any(swash);
    match firmware {
        "ArduPlane" | "APM:Plane" => {
            return found(Kind::FixedWing, format!("firmware {firmware}"));
        }
        "ArduCopter" | "APM:Copter" if !rotor => {
            return found(Kind::Multicopter, format!("firmware {firmware}"));
        }
        "ArduRover" | "ArduSub" | "ArduCopter" | "Rover" | "APMrover2" | "APM:Rover"
        | "APM:Copter" => {
            return found(Kind::Other, format!("firmware {firmware}"));
        }
        _ => {}
    }
    if topics.parameters.contains_key("MOT_SPIN_MIN") && on("FRAME_CLASS") {
        return found(Kind::Multicopter, "FRAME_CLASS");
    }
    None
}

fn telemetry(topics: &Topics) -> Option<Vehicle> {
    let system = topics.system?;
    let own = topics.instances("HEARTBEAT").filter(|(i, _)| i.to_be_bytes()[0] == system);
    let mut kinds: Vec<(Kind, f64)> = Vec::new();
    for (_, topic) in own {
        let (Some(types), Some(autopilots)) = (topic.field("type"), topic.field("autopilot"))
        else {
            continue;
        };
        // MAV_AUTOPILOT_INVALID (8) marks a component without an autopilot, such as a camera or a gimbal.
        let of_autopilot = types.iter().zip(autopilots).filter(|(_, a)| **a != 8.0);
        kinds.extend(of_autopilot.filter_map(|(t, _)| Some((by_type(*t)?, *t))));
    }
    if topics.parameter("Q_ENABLE").is_some_and(|x| x > 0.0) {
        return found(Kind::Vtol, "Q_ENABLE");
    }
    let has = |kind: Kind| kinds.iter().find(|(k, _)| *k == kind).map(|(_, number)| *number);
    if has(Kind::FixedWing).is_some() && has(Kind::Multicopter).is_some() {
        return found(
            Kind::Vtol,
            "HEARTBEAT.type is that of an aeroplane and that of a multicopter",
        );
    }
    if let Some(number) = has(Kind::Vtol) {
        return found(Kind::Vtol, format!("HEARTBEAT.type {number}"));
    }
    let (kind, number) = kinds.last()?;
    found(*kind, format!("HEARTBEAT.type {number}"))
}

/// Mode numbers of ArduPlane in which the aircraft hovers.
const HOVER_MODES: [f64; 8] = [17.0, 18.0, 19.0, 20.0, 21.0, 22.0, 23.0, 25.0];
/// Throttle of the lift motors (0..1) above which they count as carrying the aircraft. A servo pulse must exceed the minimum by
/// three times this fraction of the range of pulses.
const CARRIES: f64 = 0.05;
/// Time for which a QTUN record is taken to hold, s. ArduPlane writes QTUN records while the lift motors may run.
const QTUN_HOLDS_S: f64 = 0.5;

/// Intervals (from, to, s) in which a VTOL is not purely wing-borne: it hovers or is in transition.
pub(super) fn hovers(format: Format, topics: &Topics) -> Vec<(f64, f64)> {
    let mut spans = Vec::new();
    match format {
        Format::Csv => {}
        Format::Ulog | Format::Ros => {
            let status = "vtol_vehicle_status";
            let state = held(topics.series(status, "vehicle_vtol_state"), |x| x != 4.0);
            let rotor = held(topics.series(status, "vtol_in_rw_mode"), |x| x != 0.0);
            let change = held(topics.series(status, "vtol_in_trans_mode"), |x| x != 0.0);
            spans = [state, rotor, change].concat();
            if spans.is_empty() {
                let kind = topics.series("vehicle_status", "vehicle_type");
                spans = held(kind, |x| x == 1.0);
                spans.extend(held(topics.series("vehicle_status", "in_transition_mode"), |x| {
                    x != 0.0
                }));
            }
            let state = topics.series("extended_state", "vtol_state");
            spans.extend(held(state, |x| (1.0..=3.0).contains(&x)));
        }
        Format::Dataflash => {
            spans = held(topics.series("MODE", "ModeNum"), |x| HOVER_MODES.contains(&x));
            spans.extend(lift_by_qtun(topics));
            spans.extend(lift_by_pulses(topics));
        }
        Format::Tlog => {
            let system = topics.system.unwrap_or_default();
            let own = |name: &'static str| {
                topics.instances(name).filter(move |(i, _)| i.to_be_bytes()[0] == system)
            };
            for (_, topic) in own("EXTENDED_SYS_STATE") {
                let state = topic.field("vtol_state").map(|v| (&topic.time_s[..], v));
                spans.extend(held(state, |x| (1.0..=3.0).contains(&x)));
            }
            for (_, topic) in own("HEARTBEAT") {
                let ardupilot = topic.field("autopilot").and_then(|a| a.last()) == Some(&3.0);
                let mode = topic.field("custom_mode").filter(|_| ardupilot);
                let mode = mode.map(|v| (&topic.time_s[..], v));
                spans.extend(held(mode, |x| HOVER_MODES.contains(&x)));
            }
        }
    }
    merged(spans)
}

/// Intervals (from, to, s) in which a value satisfies `is`. Each value holds until the next sample.
fn held(series: Option<(&[f64], &[f64])>, is: impl Fn(f64) -> bool) -> Vec<(f64, f64)> {
    let Some((times, values)) = series else { return Vec::new() };
    let ends = times.iter().skip(1).copied().chain([f64::INFINITY]);
    let spans = times.iter().zip(ends).zip(values).filter(|(_, x)| is(**x));
    merged(spans.map(|((from, to), _)| (*from, to)).collect())
}

/// Intervals (from, to, s) in which QTUN records show that the lift motors carry the aircraft.
fn lift_by_qtun(topics: &Topics) -> Vec<(f64, f64)> {
    let Some((times, throttle)) = topics.series("QTUN", "ThO") else { return Vec::new() };
    let carries = times.iter().zip(throttle).filter(|(_, x)| **x > CARRIES);
    merged(carries.map(|(t, _)| (*t, t + QTUN_HOLDS_S)).collect())
}

/// Intervals (from, to, s) in which a lift motor carries the aircraft according to its servo pulse. Motors that can tilt forward
/// are left out.
fn lift_by_pulses(topics: &Topics) -> Vec<(f64, f64)> {
    let tilting = topics.parameter("Q_TILT_MASK").unwrap_or(0.0) as u32;
    let least = topics.parameter("Q_M_PWM_MIN").filter(|x| *x > 0.0).unwrap_or(1000.0);
    let most = topics.parameter("Q_M_PWM_MAX").filter(|x| *x > least).unwrap_or(2000.0);
    let limit = least + 3.0 * CARRIES * (most - least);
    let mut spans = Vec::new();
    for channel in 1..=14 {
        // Motors 1 to 8 are functions 33 to 40.
        let function = topics.parameter(&format!("SERVO{channel}_FUNCTION")).unwrap_or(0.0) as i64;
        let Some(motor) = (33..=40).contains(&function).then(|| function - 33) else { continue };
        if tilting >> motor & 1 == 0 {
            spans.extend(held(topics.series("RCOU", &format!("C{channel}")), |x| x > limit));
        }
    }
    merged(spans)
}

/// Joins intervals of hover that are separated by at most `shortest_s` (s), because wing-borne flight lasts longer.
pub(super) fn joined(hovers: Vec<(f64, f64)>, shortest_s: f64) -> Vec<(f64, f64)> {
    let longer = hovers.into_iter().map(|(from, to)| (from, to + shortest_s)).collect();
    merged(longer).into_iter().map(|(from, to)| (from, to - shortest_s)).collect()
}

/// Sorts the intervals and joins those that touch or overlap.
fn merged(mut spans: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    spans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut out: Vec<(f64, f64)> = Vec::new();
    for (from, to) in spans {
        match out.last_mut() {
            Some(last) if from <= last.1 => last.1 = last.1.max(to),
            _ => out.push((from, to)),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stretches::Keep;
    use crate::topics::Topic;

    fn topics(name: &str, field: &str, values: &[(f64, f64)]) -> Topics {
        let mut topic = Topic::new([field], Keep::All);
        for (t, x) in values {
            topic.time_s.push(*t);
            topic.values[0].push(*x);
        }
        let mut out = Topics::default();
        out.topics.insert((name.to_owned(), 0), topic);
        out
    }

    #[test]
    fn a_vtol_of_px4_flies_on_its_wings_in_state_4_only() {
        let values = [(0.0, 3.0), (10.0, 1.0), (15.0, 4.0), (60.0, 2.0), (65.0, 3.0)];
        let log = topics("vtol_vehicle_status", "vehicle_vtol_state", &values);
        assert_eq!(hovers(Format::Ulog, &log), [(0.0, 15.0), (60.0, f64::INFINITY)]);
        assert_eq!(vehicle(Format::Ulog, &log).unwrap().kind, Kind::Vtol);
    }

    #[test]
    fn arduplane_hovers_in_its_q_modes_and_while_its_lift_motors_carry() {
        let mut log = topics("MODE", "ModeNum", &[(0.0, 17.0), (20.0, 5.0)]);
        let motors = topics("RCOU", "C5", &[(0.0, 1500.0), (25.0, 1000.0)]);
        log.topics.extend(motors.topics);
        let parameters = [("Q_ENABLE", 1.0), ("SERVO5_FUNCTION", 33.0)];
        log.parameters.extend(parameters.map(|(n, x)| (n.to_owned(), x)));
        assert_eq!(vehicle(Format::Dataflash, &log).unwrap().kind, Kind::Vtol);
        assert_eq!(hovers(Format::Dataflash, &log), [(0.0, 25.0)]);
        // A tilting motor also pulls in forward flight, so its pulses do not show hover.
        log.parameters.insert("Q_TILT_MASK".to_owned(), 1.0);
        assert_eq!(hovers(Format::Dataflash, &log), [(0.0, 20.0)]);
    }

    #[test]
    fn what_lies_between_two_hovers_is_flight_only_if_it_lasts() {
        let hovers = vec![(0.0, 10.0), (10.3, 20.0), (60.0, f64::INFINITY)];
        assert_eq!(joined(hovers, 2.0), [(0.0, 20.0), (60.0, f64::INFINITY)]);
    }

    #[test]
    fn a_copter_is_named_and_a_plane_is_not_refused() {
        let copter = Topics { firmware: "ArduCopter V4.5.7".into(), ..Topics::default() };
        let said = vehicle(Format::Dataflash, &copter).unwrap().refusal().unwrap();
        assert!(said.contains("multicopter") && said.contains("ArduCopter"), "{said}");
        let old = Topics { firmware: "APM:Copter V3.4-dev (03e93cb6)".into(), ..Topics::default() };
        assert_eq!(vehicle(Format::Dataflash, &old).unwrap().kind, Kind::Multicopter);
        let plane = Topics { firmware: "ArduPlane V4.6.0".into(), ..Topics::default() };
        assert_eq!(vehicle(Format::Dataflash, &plane).unwrap().refusal(), None);
    }
}
