//! The pilot's rules, each with the reason for its number.

use std::path::Path;
use std::sync::OnceLock;
use std::time::Duration;

use greylag::control::{Controller, Observation, Target};
use greylag::flight::pilot::{Answers, Config, Decision, Pilot, Plan, Source, TrimPoint};
use greylag::link::autopilot::{
    AttitudeSetpoint, Autopilot, Mode, ParameterValue, Severity, Sticks, Verdict,
};
use greylag::link::vehicle::{
    Authority, Fault, Faults, Order, Profile, Real, Stack, Telemetry, VANE_SD, Vehicle,
};
use greylag::manoeuvres::{Axis, Excitation, Schedule, Shape, Step};
use greylag::model::GreyBox;
use greylag::physics::{ActuatorState, Airframe, Command, State, Time};

/// A proportional law, enough to see who flies and for what target.
#[derive(Clone)]
struct Proportional;

impl Controller for Proportional {
    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }
    fn name(&self) -> &'static str {
        "proportional"
    }
    fn reset(&mut self, _seed: u64) {}
    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        Command {
            aileron: target.roll - seen.state.roll,
            elevator: seen.state.pitch - target.pitch,
            throttle: 0.1 * (target.airspeed - seen.state.airspeed),
            rudder: 0.0,
        }
    }
}

fn x8() -> Config {
    let airframe = Airframe::load(Path::new("params/x8/airframe.toml")).unwrap();
    let row = |airspeed_mps, pitch_deg, elevator, throttle| TrimPoint {
        airspeed_mps,
        pitch_deg,
        elevator,
        throttle,
    };
    Config::new(
        airframe.envelope,
        vec![row(16.67, 2.283, 0.0354, 0.118), row(20.0, 0.858, 0.1314, 0.185)],
    )
}

/// A law that never gives a number.
#[derive(Clone)]
struct Broken;

impl Controller for Broken {
    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }
    fn name(&self) -> &'static str {
        "broken"
    }
    fn reset(&mut self, _seed: u64) {}
    fn command(&mut self, _: &Observation, _: &Target) -> Command {
        Command { aileron: f64::NAN, elevator: 0.0, throttle: 0.0, rudder: 0.0 }
    }
}

fn frame(time: Time) -> Telemetry {
    // A breath of turbulence, so that the state is not frozen.
    let ripple = (time.as_micros() % 1000 + time.as_micros() / 10_000) as f64 * 1e-6;
    Telemetry {
        state: State { p: ripple, airspeed: 20.0, ..State::NEUTRAL },
        incidence_sd: VANE_SD,
        time,
        order: Order::Next { lost: 0 },
        faults: Faults::NONE,
        yaw: 0.0,
        rate_hold_s: 0.0,
        actuators: ActuatorState::default(),
        specific_force: [0.0, 0.0, -9.81],
        altitude: 600.0,
        position: [f64::NAN; 2],
        velocity: [f64::NAN; 3],
        wind: [f64::NAN; 3],
    }
}

/// A pilot with a clock of 10 ms ticks and a planner that asks for full right aileron.
struct Flight {
    pilot: Pilot,
    now: Time,
    last: Option<Decision>,
    plan: Plan,
}

const RIGHT: Command = Command { aileron: 1.0, elevator: -1.0, throttle: 1.0, rudder: 0.0 };
const LEVEL_SETPOINT: AttitudeSetpoint = AttitudeSetpoint { roll: 0.2, pitch: 0.1, thrust: None };
const TICK: Duration = Duration::from_millis(10);

impl Flight {
    fn new() -> Self {
        Flight::with(Box::new(Proportional))
    }

    fn with(fallback: Box<dyn Controller>) -> Self {
        let pilot = Pilot::new(x8(), fallback).unwrap();
        Flight { pilot, now: Time::from_micros(1_000_000), last: None, plan: Plan::Ready(RIGHT) }
    }

    fn armed() -> Self {
        let mut flight = Flight::new();
        flight.fly(5);
        assert_eq!(flight.pilot.arm(flight.now, false), Verdict::Accepted);
        flight
    }

    fn offboard() -> Self {
        let mut flight = Flight::armed();
        flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
        assert_eq!(flight.pilot.set_mode(flight.now, Mode::Offboard), Verdict::Accepted);
        flight
    }

    fn tick_with(&mut self, frame: Telemetry) -> Decision {
        let request = self.pilot.observe(self.now, &frame);
        let plan = if request.is_some() { self.plan } else { Plan::None };
        let decision = self.pilot.decide(plan);
        let last = self.last.replace(decision);
        check(last.as_ref(), &decision, 0.2, 0.05);
        decision
    }

    fn tick(&mut self) -> Decision {
        self.now = self.now.plus(TICK);
        self.tick_with(frame(self.now))
    }

    fn fly(&mut self, ticks: usize) -> Decision {
        (0..ticks).map(|_| self.tick()).last().unwrap()
    }

    fn texts(&mut self) -> String {
        std::iter::from_fn(|| self.pilot.take_text()).map(|t| t.words + "\n").collect()
    }
}

/// What holds of every decision: finite, in range, slew limited while armed, dead when disarmed.
fn check(last: Option<&Decision>, now: &Decision, surface: f64, throttle: f64) {
    let c = now.command;
    assert!(c.is_finite() && c == c.clamped(), "{now:?}");
    if !now.armed {
        assert_eq!(c, Command::IDLE);
        return;
    }
    let from = last.map_or(Command::IDLE, |d| d.command);
    let near = |a: f64, b: f64, step: f64| (a - b).abs() <= step + 1e-12;
    assert!(
        near(c.aileron, from.aileron, surface)
            && near(c.elevator, from.elevator, surface)
            && near(c.throttle, from.throttle, throttle),
        "step from {from:?} to {c:?}"
    );
}

#[test]
fn disarmed_outputs_are_dead_whatever_the_plan() {
    let mut flight = Flight::new();
    let decision = flight.fly(20);
    assert_eq!((decision.command, decision.source), (Command::IDLE, Source::Disarmed));
}

#[test]
fn arming_reaches_full_deflection_in_five_ticks_and_no_fewer() {
    // 20 of travel a second is 0.2 a tick.
    let mut flight = Flight::armed();
    let travel: Vec<f64> = (0..6).map(|_| flight.tick().command.aileron).collect();
    for (i, x) in travel.iter().take(5).enumerate() {
        assert!((x - 0.2 * (i + 1) as f64).abs() < 1e-9);
    }
    assert_eq!(travel[5], 1.0);
}

#[test]
fn arming_needs_a_fresh_state_unless_forced() {
    let mut flight = Flight::new();
    assert!(matches!(flight.pilot.arm(flight.now, false), Verdict::Rejected(_)));
    flight.fly(1);
    // 0.5 s old is the limit and still fresh; a microsecond more is not.
    let late = flight.now.plus(Duration::from_micros(500_001));
    assert!(matches!(flight.pilot.arm(late, false), Verdict::Rejected(_)));
    assert_eq!(flight.pilot.arm(late, true), Verdict::Accepted);
}

#[test]
fn arming_is_refused_at_an_absurd_airspeed_or_attitude() {
    for (airspeed, roll, pitch) in [(46.0, 0.0, 0.0), (20.0, 1.2, 0.0), (20.0, 0.0, -1.2)] {
        let mut flight = Flight::new();
        flight.now = flight.now.plus(TICK);
        let mut seen = frame(flight.now);
        seen.state.airspeed = airspeed;
        (seen.state.roll, seen.state.pitch) = (roll, pitch);
        flight.tick_with(seen);
        assert!(matches!(flight.pilot.arm(flight.now, false), Verdict::Rejected(_)));
        assert_eq!(flight.pilot.arm(flight.now, true), Verdict::Accepted);
    }
}

#[test]
fn an_attitude_beyond_the_limits_is_flown_as_the_nearest_within_and_said_once() {
    let mut flight = Flight::offboard();
    flight.fly(5);
    assert!(!flight.texts().contains("limits"));
    let mut ask = |roll_deg: f64, pitch_deg: f64, ticks: usize| {
        let (roll, pitch) = (roll_deg.to_radians(), pitch_deg.to_radians());
        let setpoint = AttitudeSetpoint { roll, pitch, thrust: None };
        for _ in 0..ticks {
            flight.pilot.attitude_setpoint(flight.now, setpoint);
            flight.tick();
        }
        (flight.pilot.status().target.map(|x| x.to_degrees().round()), flight.texts())
    };
    // The X8 may be banked by 60 and pitched by 30 degrees at 20 m/s.
    let (flown, said) = ask(170.0, 89.0, 100);
    assert_eq!(flown, [60.0, 30.0]);
    let words =
        "setpoint beyond the limits: roll 170 deg is flown as 60, pitch 89 deg is flown as 30\n";
    assert_eq!(said, words);
    // However long it is asked for.
    assert_eq!(ask(170.0, 89.0, 1500), ([60.0, 30.0], String::new()));
    // Another one is another line; one within is none.
    let (flown, said) = ask(-170.0, 5.0, 100);
    assert_eq!((flown, said.matches("roll -170 deg is flown as -60\n").count()), ([-60.0, 5.0], 1));
    assert_eq!(ask(40.0, 5.0, 600), ([40.0, 5.0], String::new()));
}

#[test]
fn an_airspeed_that_is_late_is_not_called_wrong_and_a_short_gap_is_not_said() {
    let mut flight = Flight::armed();
    flight.texts();
    let mut late = |ticks: usize| {
        for _ in 0..ticks {
            flight.now = flight.now.plus(TICK);
            let mut seen = frame(flight.now);
            seen.faults.insert(Faults::LATE_AIR);
            flight.tick_with(seen);
        }
        let said = flight.texts();
        flight.fly(600);
        flight.texts();
        said
    };
    // After a gap the first VFR_HUD is 20 ms away.
    assert_eq!(late(40), "");
    let said = late(70);
    assert!(said.contains("vehicle state refused: airspeed and altitude are late"), "{said}");
    assert!(!said.contains("airspeed or altitude"), "{said}");
}

#[test]
fn an_airspeed_that_stays_late_after_a_restart_of_the_clock_is_said() {
    let mut flight = Flight::armed();
    let mut late = |from_us: u64| {
        flight.now = Time::from_micros(from_us);
        for _ in 0..70 {
            flight.now = flight.now.plus(TICK);
            let mut seen = frame(flight.now);
            seen.faults.insert(Faults::LATE_AIR);
            flight.tick_with(seen);
        }
        flight.texts()
    };
    for from_us in [60_000_000, 0] {
        let said = late(from_us);
        assert!(said.contains("airspeed and altitude are late"), "{from_us}: {said}");
    }
}

#[test]
fn disarming_in_the_air_needs_force() {
    let mut flight = Flight::armed();
    let Verdict::Rejected(words) = flight.pilot.disarm(flight.now, false) else { panic!() };
    assert!(words.contains("20.0 m/s"), "{words}");
    assert_eq!(flight.pilot.disarm(flight.now, true), Verdict::Accepted);
    assert_eq!(flight.tick().command, Command::IDLE);
}

#[test]
fn disarming_without_an_airspeed_is_refused_without_naming_one() {
    let mut flight = Flight::new();
    assert_eq!(flight.pilot.arm(flight.now, true), Verdict::Accepted);
    let Verdict::Rejected(words) = flight.pilot.disarm(flight.now, false) else { panic!() };
    assert!(words.contains("airspeed unknown") && !words.contains("NaN"), "{words}");
    assert_eq!(flight.pilot.disarm(flight.now, true), Verdict::Accepted);
}

#[test]
fn return_is_refused_by_name() {
    let mut flight = Flight::armed();
    let Verdict::Denied(words) = flight.pilot.set_mode(flight.now, Mode::Return) else { panic!() };
    assert!(words.contains("RTL"));
}

#[test]
fn offboard_needs_arming_and_a_fresh_setpoint() {
    let mut flight = Flight::new();
    flight.fly(5);
    flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
    assert!(matches!(flight.pilot.set_mode(flight.now, Mode::Offboard), Verdict::Rejected(_)));
    flight.pilot.arm(flight.now, false);
    assert_eq!(flight.pilot.set_mode(flight.now, Mode::Offboard), Verdict::Accepted);
    let mut flight = Flight::armed();
    assert!(matches!(flight.pilot.set_mode(flight.now, Mode::Offboard), Verdict::Rejected(_)));
    flight
        .pilot
        .attitude_setpoint(flight.now, AttitudeSetpoint { roll: f64::NAN, ..LEVEL_SETPOINT });
    assert!(matches!(flight.pilot.set_mode(flight.now, Mode::Offboard), Verdict::Rejected(_)));
}

#[test]
fn two_setpoints_a_second_are_enough() {
    let mut flight = Flight::offboard();
    for _ in 0..10 {
        flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
        assert_eq!(flight.fly(50).mode, Mode::Offboard);
    }
}

#[test]
fn lost_setpoints_end_offboard_after_one_second_for_good() {
    let mut flight = Flight::offboard();
    let target = flight.tick().target;
    assert_eq!((target.roll, target.pitch), (0.2, 0.1));
    assert_eq!(flight.fly(99).mode, Mode::Offboard);
    let decision = flight.tick();
    assert_eq!((decision.mode, decision.failsafe, decision.target.roll), (Mode::Hold, true, 0.0));
    assert!(flight.texts().contains("setpoints lost for 1.0 s: HOLD"));
    flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
    assert_eq!(flight.tick().mode, Mode::Hold);
    assert_eq!(flight.pilot.set_mode(flight.now, Mode::Offboard), Verdict::Accepted);
    assert!(!flight.tick().failsafe);
}

#[test]
fn the_loss_time_is_a_parameter() {
    let mut flight = Flight::offboard();
    let index = flight.pilot.parameters().iter().position(|p| p.name == "GL_OFFB_LOSS_S").unwrap();
    assert_eq!(flight.pilot.set_parameter(index, ParameterValue::Real(0.25)), Verdict::Accepted);
    assert_eq!(flight.fly(25).mode, Mode::Offboard);
    assert_eq!(flight.tick().mode, Mode::Hold);
}

#[test]
fn hold_is_wings_level_at_cruise_airspeed_and_its_trim_pitch() {
    let target = Flight::armed().tick().target;
    // The X8's cruise airspeed is 20 m/s, where it trims at 0.858° in JSBSim.
    assert!((target.pitch.to_degrees() - 0.858).abs() < 1e-9);
    assert_eq!((target.roll, target.airspeed), (0.0, 20.0));
}

#[test]
fn a_lost_vehicle_is_flagged_after_half_a_second_and_offboard_does_not_come_back() {
    let mut flight = Flight::offboard();
    let gone = flight.now.plus(Duration::from_millis(500));
    flight.pilot.advance(gone);
    assert!(flight.pilot.status().vehicle_alive);
    flight.pilot.advance(gone.plus(Duration::from_micros(2)));
    let status = flight.pilot.status();
    assert_eq!((status.vehicle_alive, status.failsafe, status.mode), (false, true, Mode::Hold));
    assert!(flight.texts().contains("vehicle link lost"));
    flight.now = gone.plus(Duration::from_secs(3));
    flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
    // The first command after the gap starts from the last one sent: checked in every tick.
    let decision = flight.tick();
    assert_eq!((decision.mode, decision.failsafe, decision.target.roll), (Mode::Hold, false, 0.0));
    // It is said once the link has stayed for as long as it must be gone to be lost.
    flight.fly(49);
    assert!(!flight.texts().contains("vehicle link back"));
    flight.fly(2);
    assert!(flight.texts().contains("vehicle link back: flying in HOLD"));
}

/// A stall: for so long nothing was heard, then the newest state.
fn stall(flight: &mut Flight, length: Duration) -> Decision {
    flight.pilot.excuse(length);
    flight.now = flight.now.plus(length);
    flight.tick()
}

#[test]
fn a_companion_that_stood_still_flies_on_in_offboard_on_the_newest_state() {
    for ms in [100, 600, 1200, 5000] {
        let mut flight = Flight::offboard();
        flight.fly(30);
        let decision = stall(&mut flight, Duration::from_millis(ms));
        assert_eq!((decision.mode, decision.source), (Mode::Offboard, Source::Planned), "{ms} ms");
        assert!((decision.target.roll, decision.failsafe) == (0.2, false), "{ms} ms");
        let texts = flight.texts();
        assert!(!texts.contains("lost") && !texts.contains("back"), "{ms} ms: {texts}");
        // The setpoint is as old as it was: 0.3 s, so that it lasts for 0.7 s more.
        assert_eq!(flight.fly(69).mode, Mode::Offboard, "{ms} ms");
        assert_eq!(flight.fly(1).mode, Mode::Hold, "{ms} ms");
    }
}

#[test]
fn a_vehicle_that_died_during_a_stall_is_lost_half_a_second_after_it() {
    let mut flight = Flight::offboard();
    flight.tick();
    flight.pilot.excuse(Duration::from_millis(1200));
    let resumed = flight.now.plus(Duration::from_millis(1200));
    flight.pilot.advance(resumed.plus(Duration::from_millis(500)));
    assert!(!flight.texts().contains("lost"));
    flight.pilot.advance(resumed.plus(Duration::from_millis(501)));
    assert!(flight.texts().contains("vehicle link lost: level, HOLD"));
}

#[test]
fn a_link_that_comes_and_goes_is_one_loss_and_one_return() {
    let mut flight = Flight::offboard();
    let mut texts = String::new();
    for _ in 0..20 {
        // 0.6 s of nothing, then five states.
        flight.now = flight.now.plus(Duration::from_millis(600));
        flight.pilot.advance(flight.now);
        flight.fly(5);
        texts += &flight.texts();
    }
    flight.fly(100);
    texts += &flight.texts();
    assert_eq!(texts.matches("vehicle link lost").count(), 1, "{texts}");
    assert_eq!(texts.matches("vehicle link back").count(), 1, "{texts}");
}

/// Frames of which only the time advances.
fn still(now: Time) -> Telemetry {
    Telemetry { state: State::NEUTRAL, ..frame(now) }
}

#[test]
fn a_state_that_does_not_answer_to_the_commands_counts_as_lost_after_a_fifth_of_a_second() {
    let mut flight = Flight::new();
    for _ in 0..200 {
        flight.now = flight.now.plus(TICK);
        flight.tick_with(still(flight.now));
    }
    // A vehicle that waits for its launch stands still with a reason.
    assert_eq!(flight.pilot.arm(flight.now, false), Verdict::Accepted);
    for i in 1..=60 {
        flight.now = flight.now.plus(TICK);
        let decision = flight.tick_with(still(flight.now));
        // The first command leaves with the answer to the first frame; 20 ticks later nothing
        // has come of it.
        assert_eq!(
            decision.source,
            if i <= 21 { Source::Planned } else { Source::Level },
            "tick {i}"
        );
    }
}

#[test]
fn a_simulator_that_has_settled_to_the_bit_is_not_taken_for_a_frozen_sensor() {
    let mut flight = Flight::armed();
    flight.fly(20);
    flight.plan = Plan::Ready(flight.last.unwrap().command);
    flight.tick();
    for _ in 0..1000 {
        flight.now = flight.now.plus(TICK);
        assert_eq!(flight.tick_with(still(flight.now)).source, Source::Planned);
    }
}

#[test]
fn without_a_usable_state_the_command_is_held_for_50_ms_then_surfaces_go_to_trim() {
    let mut flight = Flight::offboard();
    let before = flight.fly(10);
    let bad = |now| Telemetry { state: State { q: f64::NAN, ..State::NEUTRAL }, ..frame(now) };
    for i in 1..=60 {
        flight.now = flight.now.plus(TICK);
        let decision = flight.tick_with(bad(flight.now));
        if i <= 5 {
            assert_eq!(
                (decision.source, decision.command),
                (Source::Held, before.command),
                "tick {i}"
            );
        } else {
            assert_eq!(decision.source, Source::Level, "tick {i}");
        }
        assert_eq!(decision.mode, if i <= 50 { Mode::Offboard } else { Mode::Hold }, "tick {i}");
    }
    let trim = flight.pilot.config().trim_at(20.0);
    let level =
        Command { aileron: 0.0, elevator: trim.elevator, throttle: trim.throttle, rudder: 0.0 };
    assert_eq!(flight.last.unwrap().command, level);
    let said = flight.texts();
    assert_eq!(said.matches("vehicle state refused: body rates").count(), 1, "{said}");
}

#[test]
fn a_late_plan_is_replaced_by_the_fallback_and_logged_as_late() {
    let mut flight = Flight::offboard();
    flight.fly(10);
    flight.plan = Plan::Late;
    let decision = flight.fly(20);
    assert_eq!(decision.source, Source::Late);
    // The proportional law: 0.2 rad of roll are missing.
    assert!((decision.command.aileron - 0.2).abs() < 1e-9);
}

#[test]
fn a_plan_that_is_no_number_is_replaced_and_told_once_in_five_seconds() {
    let mut flight = Flight::offboard();
    flight.plan = Plan::Ready(Command { elevator: f64::INFINITY, ..Command::IDLE });
    assert_eq!(flight.fly(99).source, Source::Fallback);
    assert_eq!(flight.texts().matches("fallback flies").count(), 1);
    flight.plan =
        Plan::Ready(Command { aileron: 1e30, elevator: -1e30, throttle: 1e30, rudder: 0.0 });
    let decision = flight.fly(1);
    assert_eq!(decision.source, Source::Planned);
}

#[test]
fn the_end_of_the_controller_is_told_once_as_critical() {
    let mut flight = Flight::offboard();
    flight.plan = Plan::None;
    assert_eq!(flight.fly(50).source, Source::Fallback);
    let told: Vec<_> = std::iter::from_fn(|| flight.pilot.take_text())
        .filter(|text| text.words.contains("controller has ended"))
        .collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert_eq!(told[0].severity, Severity::Critical);
    // 10 s later it is not said again.
    for _ in 0..1000 {
        flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
        flight.tick();
    }
    assert!(!flight.texts().contains("controller has ended"));
}

#[test]
fn a_fallback_that_is_no_number_either_ends_level_at_trim() {
    let mut flight = Flight::with(Box::new(Broken));
    flight.fly(5);
    flight.pilot.arm(flight.now, false);
    flight.plan = Plan::None;
    let decision = flight.fly(50);
    assert_eq!((decision.source, decision.command.aileron), (Source::Level, 0.0));
    assert!(
        (decision.command.throttle - flight.pilot.config().trim_at(20.0).throttle).abs() < 1e-12
    );
    assert!(flight.texts().contains("level at trim"));
}

#[test]
fn the_planner_is_told_when_it_takes_over() {
    let mut flight = Flight::armed();
    let ask = |flight: &mut Flight| {
        flight.now = flight.now.plus(TICK);
        let engage = flight.pilot.observe(flight.now, &frame(flight.now)).unwrap().engage;
        let command = flight.pilot.decide(flight.plan).command;
        (engage, command)
    };
    assert!(ask(&mut flight).0);
    assert!(!ask(&mut flight).0);
    flight.plan = Plan::Ready(Command { aileron: f64::NAN, ..Command::IDLE });
    ask(&mut flight);
    assert!(ask(&mut flight).0);
}

#[test]
fn sticks_command_surfaces_in_manual_and_attitude_in_stabilized() {
    let mut flight = Flight::armed();
    assert!(matches!(flight.pilot.set_mode(flight.now, Mode::Manual), Verdict::Rejected(_)));
    let sticks = Sticks { roll: 0.5, pitch: -0.5, throttle: 0.6 };
    flight.pilot.sticks(flight.now, sticks);
    assert_eq!(flight.pilot.set_mode(flight.now, Mode::Manual), Verdict::Accepted);
    let decision = flight.fly(15);
    // Stick back is elevator up, which is negative.
    assert_eq!(
        decision.command,
        Command { aileron: 0.5, elevator: -0.5, throttle: 0.6, rudder: 0.0 }
    );
    assert_eq!(decision.source, Source::Sticks);
    flight.pilot.sticks(flight.now, sticks);
    assert_eq!(flight.pilot.set_mode(flight.now, Mode::Stabilized), Verdict::Accepted);
    let decision = flight.fly(15);
    // Half of 60° of bank, half of 30° nose up; the throttle is the stick's.
    assert!((decision.target.roll.to_degrees() - 30.0).abs() < 1e-9);
    assert!((decision.target.pitch.to_degrees() - 15.0).abs() < 1e-9);
    assert!((decision.command.throttle - 0.6).abs() < 1e-12);
    assert_eq!(flight.fly(86).mode, Mode::Hold);
    assert!(flight.texts().contains("sticks lost"));
}

#[test]
fn thrust_of_the_setpoint_is_flown_only_when_the_parameter_says_so() {
    let setpoint = AttitudeSetpoint { thrust: Some(0.3), ..LEVEL_SETPOINT };
    for (source, throttle) in [(0, 1.0), (1, 0.3)] {
        let mut flight = Flight::offboard();
        let index =
            flight.pilot.parameters().iter().position(|p| p.name == "GL_THRUST_SRC").unwrap();
        flight.pilot.set_parameter(index, ParameterValue::Int(source));
        flight.pilot.attitude_setpoint(flight.now, setpoint);
        assert!((flight.fly(30).command.throttle - throttle).abs() < 1e-9);
    }
}

#[test]
fn below_the_minimum_airspeed_the_nose_goes_down_and_the_throttle_opens() {
    let mut flight = Flight::offboard();
    flight.plan = Plan::Ready(Command::IDLE);
    for _ in 0..25 {
        flight.now = flight.now.plus(TICK);
        let mut slow = frame(flight.now);
        slow.state.airspeed = 12.5;
        flight.tick_with(slow);
    }
    let decision = flight.last.unwrap();
    assert!(decision.target.pitch <= -5f64.to_radians() + 1e-9);
    assert_eq!(decision.command.throttle, 1.0);
}

#[test]
fn a_repeated_frame_gets_the_same_command_again() {
    // A lockstep vehicle repeats its frame when an answer was lost; nothing may move meanwhile.
    let mut flight = Flight::offboard();
    let first = flight.tick();
    flight.plan = Plan::Ready(Command::IDLE);
    for _ in 0..5 {
        let again = flight.tick_with(frame(flight.now));
        assert_eq!((again.command, again.time), (first.command, first.time));
    }
}

#[test]
fn a_vehicle_that_starts_again_is_flown_in_hold() {
    let mut flight = Flight::offboard();
    flight.fly(10);
    flight.now = Time::from_micros(0);
    let decision = flight.tick();
    assert_eq!((decision.mode, decision.armed), (Mode::Hold, true));
    assert!(flight.texts().contains("clock jumped back"));
}

/// A 64-bit congruential generator, so that the storm is the same on every machine.
#[derive(Clone)]
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: u64) -> u64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % n
    }
    fn number(&mut self) -> f64 {
        match self.below(12) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => -1e30,
            3 => f64::MIN_POSITIVE,
            _ => self.below(1_000_000) as f64 * 4e-6 - 2.0,
        }
    }
    fn command(&mut self) -> Command {
        Command {
            aileron: self.number(),
            elevator: self.number(),
            throttle: self.number(),
            rudder: 0.0,
        }
    }
}

/// A fallback as bad as everything else in the storm.
#[derive(Clone)]
struct Wild(Dice);

impl Controller for Wild {
    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }
    fn name(&self) -> &'static str {
        "wild"
    }
    fn reset(&mut self, _seed: u64) {}
    fn command(&mut self, _: &Observation, _: &Target) -> Command {
        self.0.command()
    }
}

/// Swings in pitch at 2.6 Hz, the elevator between its stops, for so many ticks of `step`; the largest elevator beyond
/// trim in the last second.
fn swing(flight: &mut Flight, ticks: usize, step: Duration) -> f64 {
    let trim = x8().trim_at(x8().envelope.airspeed_cruise_mps).elevator;
    let mut recent = Vec::new();
    for _ in 0..ticks {
        flight.now = flight.now.plus(step);
        let phase = std::f64::consts::TAU * 2.6 * flight.now.as_secs_f64();
        let mut seen = frame(flight.now);
        seen.state.q = 4.0 * phase.sin();
        let elevator = (-10.0 * (phase + 0.5).sin()).clamp(-1.0, 1.0);
        flight.plan = Plan::Ready(Command { elevator, ..Command::IDLE });
        recent.push((flight.tick_with(seen).command.elevator - trim).abs());
    }
    let second = (1.0 / step.as_secs_f64()) as usize;
    recent.iter().rev().take(second).fold(0.0, |a, b| a.max(*b))
}

#[test]
fn a_loop_that_swings_gets_a_third_of_the_deflections_for_a_while() {
    // each tick, and a starved processor's every third
    for step in [TICK, 3 * TICK] {
        let mut flight = Flight::armed();
        flight.texts();
        let seconds = |s: f64| (s / step.as_secs_f64()) as usize;
        assert!(swing(&mut flight, seconds(0.6), step) > 0.5);
        let eased = swing(&mut flight, seconds(3.0), step);
        // 1.1 beside level trim is asked: a third about the mean, which moves by 0.19 itself, and 0.13 of trim
        assert!(eased < 0.6, "{eased}");
        let texts = flight.texts();
        assert!(texts.contains("oscillates in pitch since "), "{texts}");
        assert!(texts.contains("a third of the deflections for the next 5 s"), "{texts}");
        assert_eq!(flight.last.unwrap().refused, None);
        // calm again, all of them are flown
        flight.plan = Plan::Ready(RIGHT);
        assert!((flight.fly(600).command.elevator - RIGHT.elevator).abs() < 1e-9);
    }
}

#[test]
fn an_aircraft_nearly_on_its_back_is_rolled_upright_before_its_nose_is_raised() {
    let trim = x8().trim_at(x8().envelope.airspeed_cruise_mps).elevator;
    let mut flight = Flight::armed();
    // right aileron and up elevator
    flight.plan = Plan::Ready(RIGHT);
    let mut at = |bank_deg: f64| {
        let ticks = (0..15).map(|_| {
            flight.now = flight.now.plus(TICK);
            let mut seen = frame(flight.now);
            seen.state.roll = bank_deg.to_radians();
            flight.tick_with(seen).command
        });
        ticks.last().unwrap()
    };
    let is = |c: Command, aileron: f64, elevator: f64| {
        (c.aileron - aileron).abs() < 1e-9 && (c.elevator - elevator).abs() < 1e-9
    };
    assert!(is(at(85.0), 1.0, -1.0), "a steep bank is the controller's");
    for bank in [130.0, 85.0, 65.0] {
        assert!(is(at(bank), -1.0, trim), "{bank}");
    }
    assert!(is(at(55.0), 1.0, -1.0), "upright, the controller flies");
    assert!(is(at(-100.0), 1.0, trim));
    assert!(is(at(-55.0), 1.0, -1.0));
    assert_eq!(flight.texts().matches("wings level first").count(), 2);
}

#[test]
fn a_loop_that_swings_again_is_given_back_where_a_controller_flies() {
    let given_back = Some(Fault::Oscillation(greylag::link::vehicle::Axis::Pitch));
    for hands_back in [true, false] {
        let mut flight = Flight::armed();
        if hands_back {
            flight.pilot.check_signs();
        }
        swing(&mut flight, 150, TICK);
        assert_eq!(flight.last.unwrap().refused, None, "once");
        flight.plan = Plan::Ready(RIGHT);
        flight.fly(600);
        swing(&mut flight, 150, TICK);
        let expected = given_back.filter(|_| hands_back);
        assert_eq!(flight.last.unwrap().refused, expected, "{hands_back}");
    }
}

#[test]
fn where_a_controller_flies_attitudes_nothing_is_said_of_our_surfaces() {
    let mut flight = Flight::armed();
    let actuators = Airframe::load(Path::new("params/x8/airframe.toml")).unwrap().actuators;
    let profile = Profile { stack: Stack::Px4, authority: Authority::Attitude, actuators };
    flight.pilot.take_on(&Vehicle::Real(Box::new(Real::new(profile))));
    swing(&mut flight, 300, TICK);
    let mut seen = frame(flight.now.plus(TICK));
    seen.state.roll = 2.0;
    flight.now = seen.time;
    flight.tick_with(seen);
    assert_eq!(flight.last.unwrap().refused, None);
    let texts = flight.texts();
    assert!(!texts.contains("oscillates") && !texts.contains("wings level"), "{texts}");
}

fn storm_frame(dice: &mut Dice, now: Time) -> Telemetry {
    let mut seen = frame(now);
    if dice.below(4) == 0 {
        seen.state = State::from_array(std::array::from_fn(|_| dice.number()));
    }
    if dice.below(20) == 0 {
        seen.altitude = dice.number() * 1e6;
    }
    if dice.below(20) == 0 {
        seen.time = Time::from_micros(dice.below(3_000_000));
    }
    seen.state.airspeed += dice.below(30) as f64 - 10.0;
    seen
}

fn storm_request(dice: &mut Dice, pilot: &mut Pilot, now: Time) {
    if dice.below(20) == 0 {
        pilot.engaged(now);
    }
    let modes = [Mode::Manual, Mode::Hold, Mode::Return, Mode::Offboard, Mode::Stabilized];
    match dice.below(12) {
        0..=2 => drop(pilot.arm(now, dice.below(2) == 0)),
        3 if dice.below(10) == 0 => drop(pilot.disarm(now, dice.below(2) == 0)),
        4..=5 => drop(pilot.set_mode(now, modes[dice.below(5) as usize])),
        6..=8 => {
            let thrust = (dice.below(2) == 0).then(|| dice.number());
            pilot.attitude_setpoint(
                now,
                AttitudeSetpoint { roll: dice.number(), pitch: dice.number(), thrust },
            );
        }
        9..=10 => pilot.sticks(
            now,
            Sticks { roll: dice.number(), pitch: dice.number(), throttle: dice.number() },
        ),
        _ => {
            // The two slew limits stay, since the test measures by them.
            let index = [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 12, 13][dice.below(12) as usize];
            let value = match pilot.parameters()[index].value {
                ParameterValue::Int(_) => ParameterValue::Int(dice.below(4) as i32 - 1),
                ParameterValue::Real(_) => ParameterValue::Real(dice.number() as f32 * 30.0),
            };
            let _ = pilot.set_parameter(index, value);
        }
    }
}

/// Ticks of a storm.
const STORM: usize = 20_000;

/// What the X8 answers to its surfaces.
fn model_answers() -> &'static Answers {
    static ANSWERS: OnceLock<Answers> = OnceLock::new();
    let load = || GreyBox::load(Path::new("params/x8/jsbsim.toml")).unwrap();
    ANSWERS.get_or_init(|| Answers::of(&load(), 20.0).unwrap())
}

fn storm(seed: u64) -> (Vec<Command>, [usize; 8]) {
    let mut dice = Dice(seed);
    let answers = Some(model_answers().clone());
    let config = Config { answers, ..x8() };
    let mut pilot = Pilot::new(config, Box::new(Wild(Dice(seed ^ 1)))).unwrap();
    let mut now = Time::from_micros(1_000_000);
    let mut last: Option<Decision> = None;
    let (mut commands, mut seen) = (Vec::new(), [0; 8]);
    for tick in 0..STORM {
        // From the middle on beside a real controller: whoever arms waits for it, and is checked.
        if tick == STORM / 2 {
            pilot.check_signs();
        }
        now = match dice.below(200) {
            0 => Time::from_micros(dice.below(100_000_000)),
            1 => now.plus(Duration::from_millis(dice.below(3000))),
            _ => now.plus(TICK),
        };
        storm_request(&mut dice, &mut pilot, now);
        let frame = storm_frame(&mut dice, now);
        if let Some(request) = pilot.observe(now, &frame) {
            assert!(request.observation.state.is_finite());
            assert!(
                [request.target.roll, request.target.pitch, request.target.airspeed]
                    .iter()
                    .all(|x| x.is_finite())
            );
        }
        let plans = [Plan::Ready(dice.command()), Plan::Late, Plan::Busy, Plan::None];
        let plan = plans[dice.below(4) as usize];
        let decision = pilot.decide(plan);
        check(last.as_ref(), &decision, 0.2, 0.05);
        last = Some(decision);
        seen[decision.source as usize] += 1;
        commands.push(decision.command);
        while pilot.take_text().is_some() {}
    }
    (commands, seen)
}

#[test]
fn no_storm_of_input_makes_a_command_that_is_not_finite_in_range_and_slew_limited() {
    for seed in 0..10 {
        let (_, seen) = storm(seed);
        // The storm must have visited every source, or it has shown nothing.
        assert!(seen.iter().all(|n| *n > 0), "seed {seed}: {seen:?}");
    }
}

#[test]
fn the_same_input_gives_the_same_commands_to_the_bit() {
    assert_eq!(storm(7).0, storm(7).0);
}

#[test]
fn a_schedule_is_flown_inside_the_limits_for_as_long_as_offboard_lasts() {
    let kick = Excitation::new(Axis::Elevator, 0.5, 0.5, Shape::Step { width: 0.5 });
    let steep = Step::hold(2.0, 70.0, 5.0, 5.0).with(kick);
    let mut flight = Flight::offboard();
    flight.pilot.follow(Schedule::new("steep", "", vec![steep]).unwrap());
    flight.plan = Plan::Ready(Command { aileron: 0.0, elevator: -0.1, throttle: 0.3, rudder: 0.0 });
    fn fly(flight: &mut Flight, ticks: usize) -> Decision {
        let one = |_| {
            flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
            flight.tick()
        };
        (0..ticks).map(one).last().unwrap()
    }
    let begun = fly(&mut flight, 40);
    // 70° and 5 m/s are asked for; 60° and 13 m/s are the envelope's
    assert!((begun.target.roll.to_degrees() - 60.0).abs() < 1e-9, "{begun:?}");
    assert_eq!((begun.target.airspeed, begun.command.elevator), (13.0, -0.1));
    // 0.5 s after the start the kick comes in, 0.2 a tick
    let kicked = fly(&mut flight, 30);
    assert!((kicked.command.elevator - 0.4).abs() < 1e-9, "{kicked:?}");
    assert_eq!(fly(&mut flight, 60).command.elevator, -0.1);
    let over = fly(&mut flight, 100);
    assert_eq!((over.target.roll, over.target.pitch), (0.0, 0.0));
    let told = flight.texts();
    assert!(
        told.contains("schedule steep begins") && told.contains("schedule steep is over"),
        "{told}"
    );
    // without setpoints offboard ends as ever; on the next entry the schedule begins anew
    flight.fly(120);
    assert_eq!(flight.fly(1).mode, Mode::Hold);
    flight.pilot.attitude_setpoint(flight.now, LEVEL_SETPOINT);
    assert_eq!(flight.pilot.set_mode(flight.now, Mode::Offboard), Verdict::Accepted);
    assert!((fly(&mut flight, 20).target.roll.to_degrees() - 60.0).abs() < 1e-9);
    assert!(flight.texts().contains("schedule steep begins"));
}

#[test]
fn arming_at_the_limits_themselves_is_allowed() {
    let mut flight = Flight::new();
    flight.now = flight.now.plus(TICK);
    let mut seen = frame(flight.now);
    (seen.state.airspeed, seen.state.roll) = (45.0, 60f64.to_radians());
    flight.tick_with(seen);
    assert_eq!(flight.pilot.arm(flight.now, false), Verdict::Accepted);
}

#[test]
fn disarming_ends_offboard() {
    // Who arms next must not fly a setpoint that was meant for another flight.
    let mut flight = Flight::offboard();
    assert_eq!(flight.pilot.disarm(flight.now, true), Verdict::Accepted);
    assert_eq!(flight.pilot.status().mode, Mode::Hold);
}

#[test]
fn offboard_needs_a_fresh_state_of_the_vehicle() {
    let mut flight = Flight::armed();
    // A microsecond and the tolerance of half a one after the 0.5 s.
    let late = flight.now.plus(Duration::from_micros(500_002));
    flight.pilot.attitude_setpoint(late, LEVEL_SETPOINT);
    let Verdict::Rejected(words) = flight.pilot.set_mode(late, Mode::Offboard) else { panic!() };
    assert!(words.contains("no fresh vehicle state"), "{words}");
}

#[test]
fn a_planner_is_shown_the_last_two_commands_in_force() {
    let mut flight = Flight::armed();
    let [first, second] = [(); 2].map(|()| flight.tick().command);
    assert_ne!(first, second);
    // A frame that is repeated moves nothing.
    flight.tick_with(frame(flight.now));
    flight.now = flight.now.plus(TICK);
    let request = flight.pilot.observe(flight.now, &frame(flight.now)).unwrap();
    assert_eq!(request.observation.previous, [second, first]);
}

#[test]
fn a_clock_that_falls_back_by_more_than_a_second_is_a_new_start() {
    let said = "clock jumped back";
    for (back_us, restarted) in [(20_000, false), (1_000_000, false), (1_000_001, true)] {
        // The clock of the frames alone.
        let mut flight = Flight::armed();
        flight.fly(300);
        let then = Time::from_micros(flight.now.as_micros() - back_us);
        flight.now = flight.now.plus(TICK);
        flight.tick_with(Telemetry { time: then, ..frame(flight.now) });
        assert_eq!(flight.texts().contains(said), restarted, "frame, {back_us} us");
        // The clock while no frames come.
        let mut flight = Flight::armed();
        flight.fly(300);
        flight.pilot.advance(Time::from_micros(flight.now.as_micros() - back_us));
        assert_eq!(flight.texts().contains(said), restarted, "clock, {back_us} us");
    }
}

#[test]
fn each_half_of_the_pitch_stick_reaches_its_own_limit() {
    for (stick, pitch_deg) in [(0.5, -10.0), (-0.5, 15.0)] {
        let mut flight = Flight::armed();
        let index =
            flight.pilot.parameters().iter().position(|p| p.name == "GL_PITCH_MIN_DEG").unwrap();
        let set = flight.pilot.set_parameter(index, ParameterValue::Real(-20.0));
        assert_eq!(set, Verdict::Accepted);
        let sticks = Sticks { roll: 0.0, pitch: stick, throttle: 0.5 };
        flight.pilot.sticks(flight.now, sticks);
        assert_eq!(flight.pilot.set_mode(flight.now, Mode::Stabilized), Verdict::Accepted);
        // Half of 20° nose down with the stick forward, half of 30° nose up with it back.
        let pitch = flight.fly(2).target.pitch.to_degrees();
        assert!((pitch - pitch_deg).abs() < 1e-9, "{pitch}");
    }
}

#[test]
fn what_a_controller_is_given_the_aircraft_back_for() {
    // Level at trim because nothing else is left: the controller flies better, failsafe or not.
    let mut flight = Flight::with(Box::new(Broken));
    flight.fly(5);
    flight.pilot.arm(flight.now, false);
    flight.plan = Plan::None;
    let decision = flight.fly(2);
    assert_eq!((decision.source, decision.failsafe), (Source::Level, false));
    assert_eq!(decision.demand().fault, Some(Fault::State));
    let mut flight = Flight::offboard();
    assert_eq!(flight.fly(50).demand().fault, None);
    let lost = flight.fly(60);
    assert_eq!((lost.source, lost.failsafe), (Source::Planned, true));
    assert_eq!(lost.demand().fault, Some(Fault::Lost));
    // Nobody has an aircraft to give back.
    flight.pilot.disarm(flight.now, true);
    assert_eq!(flight.tick().demand().fault, None);
}

#[test]
fn a_planner_begins_anew_after_a_state_that_could_not_be_used() {
    let mut flight = Flight::armed();
    flight.fly(3);
    let mut ask = |bad: bool| {
        flight.now = flight.now.plus(TICK);
        let mut seen = frame(flight.now);
        if bad {
            seen.state.q = f64::NAN;
        }
        let request = flight.pilot.observe(flight.now, &seen);
        flight.pilot.decide(request.map_or(Plan::None, |_| Plan::Ready(RIGHT)));
        request.map(|request| request.engage)
    };
    assert_eq!([ask(false), ask(true), ask(false)], [Some(false), None, Some(true)]);
}

#[test]
fn residuals_that_nobody_computes_are_not_zero() {
    assert!(Flight::armed().pilot.status().residuals.iter().all(|share| share.is_nan()));
}

#[test]
fn a_target_is_shown_only_while_somebody_flies_for_it() {
    let shown = |flight: &Flight| flight.pilot.status().target;
    let mut flight = Flight::new();
    flight.fly(5);
    assert!(shown(&flight).iter().all(|x| x.is_nan()), "disarmed");
    let mut flight = Flight::offboard();
    flight.fly(5);
    assert_eq!(shown(&flight), [0.2, 0.1]);
    flight.pilot.sticks(flight.now, Sticks { roll: 0.5, pitch: 0.0, throttle: 0.5 });
    assert_eq!(flight.pilot.set_mode(flight.now, Mode::Manual), Verdict::Accepted);
    flight.fly(5);
    assert!(shown(&flight).iter().all(|x| x.is_nan()), "by sticks");
    // A lockstep vehicle repeats its frame: what was wanted before the disarming is over all the same.
    let mut flight = Flight::offboard();
    flight.fly(5);
    flight.pilot.disarm(flight.now, true);
    assert_eq!(flight.tick_with(frame(flight.now)).source, Source::Disarmed);
    assert!(shown(&flight).iter().all(|x| x.is_nan()), "disarmed in flight");
}

#[test]
fn the_system_id_is_said_to_be_fixed() {
    let mut flight = Flight::new();
    let index = flight.pilot.parameters().iter().position(|p| p.name == "SYSID_THISMAV").unwrap();
    let same = flight.pilot.set_parameter(index, ParameterValue::Int(1));
    assert_eq!(same, Verdict::Accepted);
    let Verdict::Denied(words) = flight.pilot.set_parameter(index, ParameterValue::Int(7)) else {
        panic!()
    };
    assert!(words.contains("SYSID_THISMAV is fixed at 1"), "{words}");
}

#[test]
fn until_the_signs_are_checked_the_aircraft_is_held_level_with_its_trim_throttle() {
    let config = Config { answers: Some(model_answers().clone()), ..x8() };
    let pilot = Pilot::new(config, Box::new(Proportional)).unwrap();
    let mut flight = Flight { pilot, ..Flight::new() };
    flight.pilot.check_signs();
    flight.fly(5);
    assert_eq!(flight.pilot.arm(flight.now, false), Verdict::Accepted);
    let decision = flight.fly(20);
    let trim = flight.pilot.config().trim_at(20.0);
    let level =
        Command { aileron: 0.0, elevator: trim.elevator, throttle: trim.throttle, rudder: 0.0 };
    assert_eq!((decision.source, decision.command), (Source::Check, level));
    assert!(flight.pilot.status().target.iter().all(|x| x.is_nan()), "nobody has a target yet");
}

#[test]
fn a_schedule_says_once_that_it_begins() {
    let mut flight = Flight::offboard();
    flight.pilot.follow(Schedule::new("flat", "", vec![Step::hold(2.0, 0.0, 0.0, 20.0)]).unwrap());
    flight.fly(50);
    let texts = flight.texts();
    assert_eq!(texts.matches("schedule flat begins").count(), 1, "{texts}");
}
