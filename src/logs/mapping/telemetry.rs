//! Rules by which the messages of a telemetry log fill the columns of the table.
//!
//! States are read from the MAVLink system and component that sends most attitude messages, commands from any component of this
//! system. The airspeed of VFR_HUD is true airspeed if the simulator sends it (profile `sitl`, the link to the simulator), and
//! equivalent airspeed if ArduPilot or PX4 sends it.

use super::rule::Rule;
use super::servos;
use crate::topics::{Topic, Topics};
use greylag_physics::atmosphere::STANDARD_GRAVITY;
use greylag_physics::mixer::Mixer;

/// The messages that the rules use.
pub const TOPICS: [&str; 16] = [
    "HEARTBEAT",
    "EXTENDED_SYS_STATE",
    "ATTITUDE_QUATERNION",
    "ATTITUDE",
    "HIGHRES_IMU",
    "RAW_IMU",
    "SCALED_IMU",
    "SCALED_PRESSURE",
    "VFR_HUD",
    "AOA_SSA",
    "ACTUATOR_OUTPUT_STATUS",
    "HIL_ACTUATOR_CONTROLS",
    "SERVO_OUTPUT_RAW",
    "GLOBAL_POSITION_INT",
    "LOCAL_POSITION_NED",
    "WIND_COV",
];

/// MAV_AUTOPILOT number of PX4.
pub(crate) const PX4: f64 = 12.0;
/// MAV_AUTOPILOT numbers of ArduPilot and PX4, whose VFR_HUD has equivalent airspeed.
const EQUIVALENT: [f64; 2] = [3.0, PX4];
/// One milli-g in m/s².
const MILLI_G: f64 = STANDARD_GRAVITY / 1000.0;
/// Deflection of the simulator's X8 at a normalised position of 1, rad.
#[expect(clippy::approx_constant, reason = "the simulator's stop is at 0.5235 rad, not at 30°")]
const DEFLECTION: f64 = 0.5235;

/// The rules. If several rules fill the same column, the first one is preferred.
pub fn rules(topics: &Topics, mixer: Option<&Mixer>) -> Vec<Rule> {
    let Some(vehicle) = vehicle(topics) else { return Vec::new() };
    let system = vehicle.to_be_bytes()[0];
    // outputs of a real autopilot are pulses, in another order than that of the sitl profile; it sends HIL_ACTUATOR_CONTROLS to a
    // simulator only
    let real = autopilots(topics, system).any(|a| EQUIVALENT.contains(&a));
    let mut out = states();
    if !real {
        out.extend(deflections(topics, system));
    }
    out.push(airspeed(topics, system));
    for rule in &mut out {
        // if this component does not send a message, another component of the same system is used
        let has = |i: u16| topics.topics.contains_key(&(rule.topic.clone(), i));
        let other =
            topics.instances(&rule.topic).map(|(i, _)| i).find(|i| i.to_be_bytes()[0] == system);
        rule.instance = if has(vehicle) { Some(vehicle) } else { other.or(Some(vehicle)) };
    }
    let mut commands = Vec::new();
    let of_sitl = [
        ("aileron_cmd", "controls0"),
        ("elevator_cmd", "controls1"),
        ("throttle_cmd", "controls2"),
    ];
    for (column, field) in of_sitl.into_iter().filter(|_| !real) {
        commands.push(
            Rule::linear(column, "HIL_ACTUATOR_CONTROLS", field, 1.0)
                .noting("commands are HIL_ACTUATOR_CONTROLS in the order of the sitl profile"),
        );
    }
    if !real && sent_travel(topics, system).is_some_and(|[.., rudder]| rudder > 0.0) {
        commands.push(Rule::linear("rudder_cmd", "HIL_ACTUATOR_CONTROLS", "controls3", 1.0));
    }
    commands.extend(servos::rules(topics, "SERVO_OUTPUT_RAW", mixer, |n| format!("servo{n}_raw")));
    for rule in &mut commands {
        let all = topics.instances(&rule.topic);
        let own = all.filter(|(i, _)| i.to_be_bytes()[0] == system);
        rule.instance = own.max_by_key(|(_, t)| t.time_s.len()).map(|(i, _)| i);
    }
    out.extend(commands);
    out
}

/// The instance (system and component) with most attitude messages. If the topics are those of one system's flight, only its
/// instances count.
fn vehicle(topics: &Topics) -> Option<u16> {
    let both = topics.instances("ATTITUDE_QUATERNION").chain(topics.instances("ATTITUDE"));
    let own = both.filter(|(i, _)| topics.system.is_none_or(|s| i.to_be_bytes()[0] == s));
    own.max_by_key(|(_, t)| t.time_s.len()).map(|(i, _)| i)
}

/// The MAV_AUTOPILOT numbers in the heartbeats of a system.
fn autopilots(topics: &Topics, system: u8) -> impl Iterator<Item = f64> {
    let of_system = move |(i, topic): (u16, &Topic)| {
        (i.to_be_bytes()[0] == system).then(|| topic.field("autopilot")?.last().copied())?
    };
    topics.instances("HEARTBEAT").filter_map(of_system)
}

fn airspeed(topics: &Topics, system: u8) -> Rule {
    let rule = Rule::linear("airspeed_mps", "VFR_HUD", "airspeed", 1.0);
    if autopilots(topics, system).any(|a| EQUIVALENT.contains(&a)) {
        rule.equivalent().noting(
            "airspeed is VFR_HUD's of a real autopilot: equivalent airspeed, made true by the air's density",
        )
    } else {
        rule.noting("airspeed is VFR_HUD's, taken as true airspeed (sitl profile)")
    }
}

/// The rules for a table whose columns are named by message and field, such as `ATTITUDE.roll`. The sender is not known. VFR_HUD
/// is therefore assumed to come from a real autopilot, with equivalent airspeed.
pub fn of_table() -> Vec<Rule> {
    let mut out = states();
    out.push(Rule::linear("airspeed_mps", "VFR_HUD", "airspeed", 1.0).equivalent());
    out
}

fn states() -> Vec<Rule> {
    let degree = 1_f64.to_radians();
    let mut out = vec![Rule::quaternion("ATTITUDE_QUATERNION", ["q1", "q2", "q3", "q4"])];
    for (column, topic, field, gain) in [
        ("roll_rad", "ATTITUDE", "roll", 1.0),
        ("pitch_rad", "ATTITUDE", "pitch", 1.0),
        ("yaw_rad", "ATTITUDE", "yaw", 1.0),
        ("p_radps", "ATTITUDE_QUATERNION", "rollspeed", 1.0),
        ("q_radps", "ATTITUDE_QUATERNION", "pitchspeed", 1.0),
        ("r_radps", "ATTITUDE_QUATERNION", "yawspeed", 1.0),
        ("p_radps", "ATTITUDE", "rollspeed", 1.0),
        ("q_radps", "ATTITUDE", "pitchspeed", 1.0),
        ("r_radps", "ATTITUDE", "yawspeed", 1.0),
        ("ax_mps2", "HIGHRES_IMU", "xacc", 1.0),
        ("ay_mps2", "HIGHRES_IMU", "yacc", 1.0),
        ("az_mps2", "HIGHRES_IMU", "zacc", 1.0),
        ("ax_mps2", "RAW_IMU", "xacc", MILLI_G),
        ("ay_mps2", "RAW_IMU", "yacc", MILLI_G),
        ("az_mps2", "RAW_IMU", "zacc", MILLI_G),
        ("ax_mps2", "SCALED_IMU", "xacc", MILLI_G),
        ("ay_mps2", "SCALED_IMU", "yacc", MILLI_G),
        ("az_mps2", "SCALED_IMU", "zacc", MILLI_G),
        ("alpha_rad", "AOA_SSA", "AOA", degree),
        ("beta_rad", "AOA_SSA", "SSA", degree),
        ("vn_mps", "LOCAL_POSITION_NED", "vx", 1.0),
        ("ve_mps", "LOCAL_POSITION_NED", "vy", 1.0),
        ("vd_mps", "LOCAL_POSITION_NED", "vz", 1.0),
        ("vn_mps", "GLOBAL_POSITION_INT", "vx", 0.01),
        ("ve_mps", "GLOBAL_POSITION_INT", "vy", 0.01),
        ("vd_mps", "GLOBAL_POSITION_INT", "vz", 0.01),
        ("altitude_m", "VFR_HUD", "alt", 1.0),
        ("altitude_m", "GLOBAL_POSITION_INT", "alt", 0.001),
    ] {
        out.push(Rule::linear(column, topic, field, gain));
    }
    out.push(Rule::density("HIGHRES_IMU", ("abs_pressure", 100.0), ("temperature", 1.0)));
    out.push(Rule::density("SCALED_PRESSURE", ("press_abs", 100.0), ("temperature", 0.01)));
    out
}

/// Rules for the actuator positions, whose order is that of the sitl profile. The simulator sends the travels of the surfaces if
/// they differ from those of the X8.
fn deflections(topics: &Topics, system: u8) -> Vec<Rule> {
    let [aileron, elevator, rudder] =
        sent_travel(topics, system).unwrap_or([DEFLECTION, DEFLECTION, 0.0]);
    let note = format!(
        "deflections are ACTUATOR_OUTPUT_STATUS in the order of the sitl profile, {aileron:.4} rad \
         (aileron), {elevator:.4} rad (elevator) at 1; another order needs a mapping"
    );
    [("aileron_rad", "actuator0", aileron), ("elevator_rad", "actuator1", elevator)]
        .into_iter()
        .chain([("throttle", "actuator2", 1.0)])
        .chain((rudder > 0.0).then_some(("rudder_rad", "actuator7", rudder)))
        .map(|(column, field, gain)| {
            Rule::linear(column, "ACTUATOR_OUTPUT_STATUS", field, gain).noting(&note)
        })
        .collect()
}

/// Travels of aileron, elevator and rudder that the vehicle sends, rad. The rudder's is the larger of its two travels, or zero
/// without a rudder. `None` if the vehicle sends no travels.
fn sent_travel(topics: &Topics, system: u8) -> Option<[f64; 3]> {
    let (_, topic) = topics
        .instances("ACTUATOR_OUTPUT_STATUS")
        .find(|(instance, _)| instance.to_be_bytes()[0] == system)?;
    let last = |name| topic.field(name)?.last().copied();
    let active = last("active")?;
    let rudder =
        if active >= 15.0 { last("actuator11")?.abs().max(last("actuator14")?.abs()) } else { 0.0 };
    (active >= 7.0).then_some([last("actuator5")?, last("actuator6")?, rudder])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stretches::Keep;

    #[test]
    fn outputs_of_a_real_autopilot_are_no_deflections() {
        let reads = |autopilot: f64| {
            let mut topics = Topics { system: Some(1), ..Topics::default() };
            for (name, field, value) in [
                ("HEARTBEAT", "autopilot", autopilot),
                ("ATTITUDE", "roll", 0.0),
                ("ACTUATOR_OUTPUT_STATUS", "actuator0", 1500.0),
            ] {
                let mut topic = Topic::new([field], Keep::All);
                topic.push(0.0, &[value]);
                topics.topics.insert((name.to_owned(), 0x0101), topic);
            }
            rules(&topics, None).iter().any(|rule| rule.topic == "ACTUATOR_OUTPUT_STATUS")
        };
        // 8 is that of a simulator, 3 and 12 are those of ArduPilot and PX4
        assert_eq!([8.0, 3.0, 12.0].map(reads), [true, false, false]);
    }
}
