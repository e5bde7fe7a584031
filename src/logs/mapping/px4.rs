//! Rules that compute the columns of Greylag's log table from the topics of a PX4 log.
//!
//! Pitch torque is positive nose up in PX4, and the elevator column is positive nose down. Of several motors only the
//! first is used. Two topics are not used: `actuator_outputs`, whose pulses can be interpreted only with parameters of the
//! mixer, and `wind`, for which the table has no column.

use super::rule::{Rule, Shape, Term, Tilt};
use crate::Format;
use crate::topics::Topics;
use crate::vehicle::{self, Kind};

/// The topics that the rules use.
pub const TOPICS: [&str; 20] = [
    "vehicle_attitude",
    "vehicle_angular_velocity",
    "vehicle_acceleration",
    "sensor_combined",
    "airspeed_validated",
    "airspeed",
    "airflow_aoa",
    "airflow_slip",
    "vehicle_air_data",
    "vehicle_local_position",
    "vehicle_global_position",
    "vehicle_status",
    "vtol_vehicle_status",
    "actuator_servos",
    "actuator_motors",
    "vehicle_torque_setpoint",
    "vehicle_thrust_setpoint",
    "actuator_controls_0",
    "actuator_controls_1",
    "vehicle_attitude_setpoint",
];

/// Fields that the rules use. A name that ends with a bracket stands for all elements of an array.
const FIELDS: [&str; 25] = [
    "q[",
    "q_d[",
    "xyz[",
    "gyro_rad[",
    "accelerometer_m_s2[",
    "control[",
    "true_airspeed_m_s",
    "aoa_rad",
    "slip_rad",
    "vx",
    "vy",
    "vz",
    "alt",
    "baro_alt_meter",
    "rho",
    "roll_body",
    "pitch_body",
    "is_vtol",
    "system_type",
    "vehicle_type",
    "is_rotary_wing",
    "in_transition_mode",
    "vehicle_vtol_state",
    "vtol_in_rw_mode",
    "vtol_in_trans_mode",
];

/// Whether the rules use a field.
pub fn uses(field: &str) -> bool {
    FIELDS.iter().any(|f| if f.ends_with('[') { field.starts_with(f) } else { field == *f })
}

/// The rules. If several rules give the same column, the preferred one comes first.
pub fn rules(topics: &Topics) -> Vec<Rule> {
    let mut out = vec![Rule::quaternion("vehicle_attitude", ["q[0]", "q[1]", "q[2]", "q[3]"])];
    for (i, (rate, force)) in
        [("p_radps", "ax_mps2"), ("q_radps", "ay_mps2"), ("r_radps", "az_mps2")].iter().enumerate()
    {
        out.push(Rule::linear(rate, "vehicle_angular_velocity", &format!("xyz[{i}]"), 1.0));
        out.push(
            Rule::linear(rate, "sensor_combined", &format!("gyro_rad[{i}]"), 1.0)
                .noting("rates are sensor_combined's, gyro biases not removed"),
        );
        out.push(Rule::linear(force, "vehicle_acceleration", &format!("xyz[{i}]"), 1.0));
        out.push(
            Rule::linear(force, "sensor_combined", &format!("accelerometer_m_s2[{i}]"), 1.0)
                .noting("specific force is sensor_combined's, at the sensor, biases not removed"),
        );
    }
    out.push(Rule::linear("airspeed_mps", "airspeed_validated", "true_airspeed_m_s", 1.0));
    out.push(
        Rule::linear("airspeed_mps", "airspeed", "true_airspeed_m_s", 1.0)
            .noting("airspeed is the sensor's own true airspeed, not the validated one"),
    );
    out.push(Rule::linear("alpha_rad", "airflow_aoa", "aoa_rad", 1.0));
    out.push(Rule::linear("beta_rad", "airflow_slip", "slip_rad", 1.0));
    for (column, field) in [("vn_mps", "vx"), ("ve_mps", "vy"), ("vd_mps", "vz")] {
        out.push(Rule::linear(column, "vehicle_local_position", field, 1.0));
    }
    out.push(Rule::linear("altitude_m", "vehicle_global_position", "alt", 1.0));
    out.push(
        Rule::linear("altitude_m", "vehicle_air_data", "baro_alt_meter", 1.0)
            .noting("altitude is barometric"),
    );
    out.push(Rule::linear("air_density_kgpm3", "vehicle_air_data", "rho", 1.0));
    out.push(Rule::linear("roll_target_rad", "vehicle_attitude_setpoint", "roll_body", 1.0));
    out.push(Rule::linear("pitch_target_rad", "vehicle_attitude_setpoint", "pitch_body", 1.0));
    // Since August 2024 (PX4 commit e008ca24f1) the setpoint has a quaternion instead of Euler angles.
    let q = ["q_d[0]", "q_d[1]", "q_d[2]", "q_d[3]"];
    let setpoint = "vehicle_attitude_setpoint";
    out.push(Rule::tilt("roll_target_rad", setpoint, Tilt::Roll, q));
    out.push(Rule::tilt("pitch_target_rad", setpoint, Tilt::Pitch, q));
    out.extend(commands(topics));
    out
}

fn commands(topics: &Topics) -> Vec<Rule> {
    let mut out = allocated(topics);
    out.extend(motor(topics));
    // The torque setpoints about the three axes and the thrust setpoint serve as commands. In a VTOL, instance 1 of
    // their topics is that of wing-borne flight.
    let kind = vehicle::vehicle(Format::Ulog, topics).map(|v| v.kind);
    let vtol = kind == Some(Kind::Vtol);
    let fixed_wing = if vtol { Some(1) } else { None };
    for (column, field, gain) in [
        ("aileron_cmd", "xyz[0]", 1.0),
        ("elevator_cmd", "xyz[1]", -1.0),
        ("rudder_cmd", "xyz[2]", -1.0),
    ] {
        out.push(
            Rule::linear(column, "vehicle_torque_setpoint", field, gain).preferring(fixed_wing),
        );
    }
    out.push(
        Rule::linear("throttle_cmd", "vehicle_thrust_setpoint", "xyz[0]", 1.0)
            .preferring(fixed_wing),
    );
    let moves = |group: &str| {
        let fields = ["control[0]", "control[1]", "control[2]"];
        topics.first(group).is_some_and(|t| fields.iter().any(|f| t.moves(f)))
    };
    let [hover, wings] = ["actuator_controls_0", "actuator_controls_1"];
    let second = vtol || !moves(hover) && moves(wings);
    let group = if second { wings } else { hover };
    for (column, i, gain) in [
        ("aileron_cmd", 0, 1.0),
        ("elevator_cmd", 1, -1.0),
        ("rudder_cmd", 2, -1.0),
        ("throttle_cmd", 3, 1.0),
    ] {
        let rule = Rule::linear(column, group, &format!("control[{i}]"), gain);
        out.push(rule.noting(format!("commands are {group}'s, before the mixer")));
    }
    out
}

/// Throttle command from the first motor; `None` if the log has no finite command for it.
fn motor(topics: &Topics) -> Option<Rule> {
    let (topic, field) = ("actuator_motors", "control[0]");
    let runs = topics.first(topic)?.field(field)?.iter().any(|x| x.is_finite());
    let term = Term { field: field.into(), gain: 1.0, shape: Shape::Motor };
    runs.then(|| Rule::sum("throttle_cmd", topic, vec![term]))
}

/// Commands of aileron, elevator and rudder as means of the servo outputs. The weights are the torques of the surfaces about
/// the axis (parameters CA_SV_CSn_TRQ_*).
fn allocated(topics: &Topics) -> Vec<Rule> {
    let mut out = Vec::new();
    for (column, axis, sign) in
        [("aileron_cmd", "R", 1.0), ("elevator_cmd", "P", -1.0), ("rudder_cmd", "Y", -1.0)]
    {
        let torque = |n: usize| {
            let t = topics.parameters.get(&format!("CA_SV_CS{n}_TRQ_{axis}")).copied();
            t.filter(|t| t.is_finite() && *t != 0.0).map(|t| (n, t))
        };
        let torques: Vec<(usize, f64)> = (0..8).filter_map(torque).collect();
        let sum: f64 = torques.iter().map(|(_, t)| t.abs()).sum();
        if sum > 0.0 {
            let term = |(n, t): &(usize, f64)| Term {
                field: format!("control[{n}]"),
                gain: sign * t / sum,
                shape: Shape::Linear,
            };
            let rule = Rule::sum(column, "actuator_servos", torques.iter().map(term).collect());
            out.push(rule.noting("commands are actuator_servos' by CA_SV_CSn_TRQ_R, _P, _Y"));
        }
    }
    out
}
