//! The model as a monitor in flights of JSBSim's aircraft: quiet when it is healthy, and the right channel when not.

use std::path::Path;

use greylag::control::{Controller, ControllerKind, build};
use greylag::flight::monitor::Monitor;
use greylag::flight::pilot::{Config, Pilot, Plan};
use greylag::link::autopilot::{AttitudeSetpoint, Autopilot, Mode, Verdict};
use greylag::link::vehicle::{Faults, Order, Telemetry, VANE_SD};
use greylag::model::GreyBox;
use greylag::physics::actuators::Actuators;
use greylag::physics::{Controls, State, Time};
use greylag_sitl::air::{Air, Turbulence};
use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start, Truth};

/// Something happens to the aircraft at this time, s.
const FAULT_S: f64 = 20.0;

/// A flight through the pilot, with the surfaces worked out from the commands, as beside a real controller.
struct Flight {
    plant: PlantOptions,
    model: &'static str,
    /// Where the elevator sticks from [`FAULT_S`] on, −1..1.
    stuck: Option<f64>,
}

const ORACLE: &str = "params/x8/jsbsim.toml";
const LEARNED: &str = "params/x8/learned/model.toml";

impl Flight {
    fn of(model: &'static str) -> Self {
        Flight { plant: PlantOptions::default(), model, stuck: None }
    }

    fn hiding(effect: &str) -> Self {
        let mut flight = Flight::of(ORACLE);
        flight.plant.hidden = vec![effect.parse().unwrap()];
        flight
    }

    /// What is said in `seconds` of flight, with the time of each line.
    fn said(&self, seconds: f64) -> Vec<(f64, String)> {
        let model = GreyBox::load(Path::new(self.model)).unwrap();
        let mut lqi = build(ControllerKind::Lqi, &model).unwrap();
        let mut pilot = Pilot::new(Config::for_model(&model).unwrap(), lqi.boxed_clone()).unwrap();
        pilot.monitor_with(Monitor::new(model.clone()));
        let figures = model.airframe.actuators;
        let mut actuators = Actuators::at_rest(&Controls::default()).fitted(&figures);
        let mut plant = Plant::new(&self.plant).unwrap();
        let mut truth = plant.reset(&Start { airspeed_mps: 18.0, ..Start::NEUTRAL }).unwrap();
        let mut said = Vec::new();
        for tick in 1..=(seconds / 0.01) as u64 {
            let now = Time::from_micros(10_000 * tick);
            let frame =
                Telemetry { actuators: actuators.observed(&figures), ..telemetry(now, &truth) };
            let command = fly(&mut pilot, lqi.as_mut(), &frame);
            pilot.monitor(&frame);
            said.extend(
                std::iter::from_fn(|| pilot.take_text()).map(|t| (now.as_secs_f64(), t.words)),
            );
            actuators.step(&command, &figures);
            let elevator = self.stuck.filter(|_| now.as_secs_f64() >= FAULT_S);
            truth = plant
                .step(Inputs {
                    aileron: command.aileron,
                    elevator: elevator.unwrap_or(command.elevator),
                    throttle: command.throttle,
                    rudder: 0.0,
                })
                .unwrap();
        }
        said.retain(|(_, words)| words.contains("deviates from the model"));
        said
    }
}

/// A tick of the pilot in offboard, with a step of roll or pitch every 5 s.
fn fly(
    pilot: &mut Pilot,
    lqi: &mut dyn Controller,
    frame: &Telemetry,
) -> greylag::physics::Command {
    let now = frame.time;
    let leg = (now.as_secs_f64() / 5.0) as usize % 4;
    let (roll, pitch) = [(0.0, 0.03), (0.35, 0.03), (-0.35, 0.08), (0.0, 0.0)][leg];
    let request = pilot.observe(now, frame);
    pilot.attitude_setpoint(now, AttitudeSetpoint { roll, pitch, thrust: None });
    if now.as_micros() == 10_000 {
        assert_eq!(pilot.arm(now, true), Verdict::Accepted);
        assert_eq!(pilot.set_mode(now, Mode::Offboard), Verdict::Accepted);
    }
    let plan = request.map_or(Plan::None, |request| {
        if request.engage {
            lqi.reset(0);
        }
        Plan::Ready(lqi.command(&request.observation, &request.target))
    });
    pilot.decide(plan).command
}

fn telemetry(time: Time, truth: &Truth) -> Telemetry {
    Telemetry {
        time,
        order: Order::Next { lost: 0 },
        faults: Faults::NONE,
        state: State {
            roll: truth.roll_rad,
            pitch: truth.pitch_rad,
            airspeed: truth.airspeed_mps,
            p: truth.p_radps,
            q: truth.q_radps,
            r: truth.r_radps,
            alpha: truth.alpha_rad,
            beta: truth.beta_rad,
        },
        incidence_sd: VANE_SD,
        yaw: truth.yaw_rad,
        rate_hold_s: 0.0,
        specific_force: truth.specific_force_mps2,
        actuators: Default::default(),
        altitude: truth.altitude_m,
        position: [f64::NAN; 2],
        velocity: [f64::NAN; 3],
        wind: [f64::NAN; 3],
    }
}

#[test]
fn a_healthy_minute_is_quiet_in_still_air_and_in_turbulence() {
    for model in [ORACLE, LEARNED] {
        let mut flight = Flight::of(model);
        assert_eq!(flight.said(60.0), [], "{model}");
        let turbulence = Turbulence { wind_20ft_mps: 15.0, severity: 4 };
        flight.plant.air = Air { turbulence: Some(turbulence), ..Air::default() };
        assert_eq!(flight.said(60.0), [], "{model}, moderate turbulence");
    }
}

#[test]
fn an_elevator_that_sticks_is_said_within_ten_seconds() {
    for stuck in [0.04, 0.15] {
        let flight = Flight { stuck: Some(stuck), ..Flight::of(ORACLE) };
        let said = flight.said(40.0);
        let (at, words) = said.first().expect("a warning");
        // 2 s outside the band; before that the next step of pitch has to ask something of the elevator.
        assert!((FAULT_S..FAULT_S + 10.0).contains(at), "{said:?}");
        assert!(words.starts_with("pitching moment") && words.contains("elevator"), "{said:?}");
    }
}

#[test]
fn what_is_hidden_in_the_aircraft_is_said_in_its_channel() {
    for (effect, channel) in [
        // 4 cm aft: 1.3 N m of the lift's 33 N. Ice: 0.022 more drag at the α of cruise, twice the X8's.
        // Twice the mass: half of the lift that is predicted a kilogram, where a third is the band by widths of 15 %.
        ("cg_shift=0.04", "pitching moment"),
        ("drag_alpha2=100", "drag and thrust"),
        ("mass_error=1.0", "lift"),
    ] {
        let said = Flight::hiding(effect).said(12.0);
        let (at, words) = said.first().unwrap_or_else(|| panic!("{effect}: nothing said"));
        assert!(words.starts_with(channel) && *at < 10.0, "{effect}: {said:?}");
    }
}
