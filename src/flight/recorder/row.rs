//! One tick of the companion's 100 Hz cycle as a row of `flight.csv`.

use std::io::Write;

use crate::pilot::{Decision, mode_name};
use greylag_link::autopilot::{ESTIMATES, RESIDUALS};
use greylag_link::vehicle::{Faults, Telemetry};
use greylag_logs::Sample;
use greylag_logs::csv::Rows;

/// The recorded data of one tick.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// The columns of the log format.
    pub sample: Sample,
    /// The pilot's decision.
    pub decision: Decision,
    /// Time from the arrival of the state frame to the sending of the command, µs.
    pub latency_us: f64,
    /// Residuals of the model monitor (measured minus predicted accelerations), each divided by two standard deviations of the
    /// prediction, as in `Status::residuals`. NaN if unknown.
    pub residuals: [f64; 6],
    /// Stability and control derivatives estimated in flight, as in `Status::derivatives`. NaN if unknown.
    pub derivatives: [f64; ESTIMATES.len()],
}

impl Row {
    /// Names of the columns in addition to those of the log format.
    pub const EXTRA: [&'static str; 16] = [
        "airspeed_target_mps",
        "mode",
        "armed",
        "source",
        "failsafe",
        "latency_us",
        RESIDUALS[0],
        RESIDUALS[1],
        RESIDUALS[2],
        RESIDUALS[3],
        RESIDUALS[4],
        RESIDUALS[5],
        ESTIMATES[0],
        ESTIMATES[1],
        ESTIMATES[2],
        ESTIMATES[3],
    ];

    /// The row of a tick with this `state`, `decision` and latency (µs), without residuals and derivatives.
    pub fn new(state: &Telemetry, decision: &Decision, latency_us: f64) -> Self {
        Row {
            sample: sample(state, decision),
            decision: *decision,
            latency_us,
            residuals: [f64::NAN; 6],
            derivatives: [f64::NAN; ESTIMATES.len()],
        }
    }

    /// Removes surface commands, deflections and measured throttle from the row. It is called if the companion commands
    /// attitudes to a flight controller. The companion's surface commands are then not sent, and the actuator state is unknown.
    /// The throttle command is sent and therefore kept.
    pub fn without_surfaces(mut self) -> Self {
        let sample = &mut self.sample;
        for column in [
            &mut sample.aileron_rad,
            &mut sample.elevator_rad,
            &mut sample.throttle,
            &mut sample.aileron_cmd,
            &mut sample.elevator_cmd,
            &mut sample.rudder_rad,
            &mut sample.rudder_cmd,
        ] {
            *column = f64::NAN;
        }
        self
    }

    pub(super) fn write<W: Write>(&self, out: &mut Rows<W>) -> std::io::Result<()> {
        let d = &self.decision;
        let digit = |flag: bool| if flag { "1" } else { "0" };
        let airspeed = format!("{}", d.target.airspeed);
        let latency = format!("{:.1}", self.latency_us);
        let text = |value: f64| match value.is_finite() {
            true => format!("{value:.3}"),
            false => String::new(),
        };
        let (residuals, derivatives) = (self.residuals.map(text), self.derivatives.map(text));
        let decided = [
            &*airspeed,
            mode_name(d.mode),
            digit(d.armed),
            d.source.name(),
            digit(d.failsafe),
            &*latency,
        ];
        let mut extra = [""; Row::EXTRA.len()];
        let measured = residuals.iter().chain(&derivatives).map(String::as_str);
        extra.iter_mut().zip(decided.into_iter().chain(measured)).for_each(|(to, from)| *to = from);
        out.row(&self.sample, &extra)
    }
}

fn sample(state: &Telemetry, decision: &Decision) -> Sample {
    let (s, z, c) = (&state.state, &state.actuators, &decision.command);
    // a quantity with a fault keeps its last valid value in `state`; it is left out of the row
    let known = |fault: Faults, x: f64| {
        if state.faults.contains(fault) { f64::NAN } else { x }
    };
    // airspeed and altitude have two fault flags: one for implausible values, one for stale values
    let in_air = |x: f64| known(Faults::LATE_AIR, known(Faults::AIR, x));
    // without a rudder both values are zero, and the rudder columns stay empty
    let rudder =
        if (z.rudder, c.rudder) == (0.0, 0.0) { [f64::NAN; 2] } else { [z.rudder, c.rudder] };
    Sample {
        time_s: state.time.as_secs_f64(),
        attitude_rad: [s.roll, s.pitch, state.yaw].map(|x| known(Faults::ATTITUDE, x)),
        rates_radps: [s.p, s.q, s.r].map(|x| known(Faults::RATES, x)),
        airspeed_mps: in_air(s.airspeed),
        alpha_rad: known(Faults::INCIDENCE, s.alpha),
        beta_rad: known(Faults::INCIDENCE, s.beta),
        specific_force_mps2: state.specific_force.map(|x| known(Faults::SPECIFIC_FORCE, x)),
        velocity_ned_mps: state.velocity,
        altitude_m: in_air(state.altitude),
        aileron_rad: known(Faults::ACTUATORS, z.aileron),
        elevator_rad: known(Faults::ACTUATORS, z.elevator),
        throttle: known(Faults::ACTUATORS, z.throttle),
        aileron_cmd: c.aileron,
        elevator_cmd: c.elevator,
        throttle_cmd: c.throttle,
        rudder_rad: known(Faults::ACTUATORS, rudder[0]),
        rudder_cmd: rudder[1],
        roll_target_rad: decision.target.roll,
        pitch_target_rad: decision.target.pitch,
        rate_hold_s: state.rate_hold_s,
        ..Sample::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pilot::Source;
    use crate::pilot::frames::usable;
    use greylag_control::Target;
    use greylag_link::autopilot::Mode;
    use greylag_physics::{Command, State, Time};

    /// Airspeed (m/s) and altitude (m) in the row of a state with `faults`.
    fn recorded(faults: Faults) -> [f64; 2] {
        let state =
            Telemetry { faults, state: State { airspeed: 20.0, ..State::NEUTRAL }, ..usable() };
        let decision = Decision {
            time: Time::default(),
            command: Command::IDLE,
            source: Source::Disarmed,
            armed: false,
            mode: Mode::Hold,
            target: Target { roll: f64::NAN, pitch: f64::NAN, airspeed: 20.0 },
            failsafe: false,
            refused: None,
        };
        let sample = Row::new(&state, &decision, 0.0).sample;
        [sample.airspeed_mps, sample.altitude_m]
    }

    #[test]
    fn airspeed_and_altitude_that_are_stale_or_implausible_are_omitted() {
        assert_eq!(recorded(Faults::NONE), [20.0, 600.0]);
        for fault in [Faults::LATE_AIR, Faults::AIR] {
            assert!(recorded(fault).iter().all(|x| x.is_nan()), "{fault}");
        }
    }
}
