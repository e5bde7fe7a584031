//! Measures the largest pure input delay at which the pitch and roll loops of each controller remain stable.
//!
//! ```text
//! cargo run --release --ignore-rust-version --no-default-features --features sitl --example delay_margin
//! ```
//!
//! Arguments add LQI designs with other weights, each as `attitude,integral,rate,sideslip,deflection`.
//!
//! JSBSim runs in steps of a millisecond. The controller runs at 100 Hz on the true state. Either its elevator command or its
//! aileron command is delayed. The delay is increased in steps of 2 ms. The path `ardupilot` adds ArduPlane's parts of the
//! loop: a filter of the gyros at 20 Hz, and channels that are read at 50 Hz. A short pulse on the surface excites the
//! loop. A small pulse shows the margin of the linear loop. A pulse of full deflection shows the margin with the slew limit.

use std::collections::VecDeque;
use std::path::Path;

use anyhow::Result;
use greylag::control::lqi::{Lqi, Weights};
use greylag::control::{Controller, ControllerKind, Observation, Target, build};
use greylag::model::GreyBox;
use greylag::physics::actuators::Actuators;
use greylag::physics::airframe::ActuatorFigures;
use greylag::physics::{Command, Controls, State, Time};
use greylag_sitl::plant::{Inputs, Plant, PlantOptions, Start, Truth};

/// Number of plant steps in a cycle of the controller. `SECOND` is the number of plant steps in a second.
const CYCLE: usize = 10;
const SECOND: usize = 1000;
/// Largest change of a surface command (−1..1) in a cycle, from the envelope's limit of 20 per second.
const SLEW: f64 = 0.2;
/// The loop counts as unstable if the body rate oscillates by more than this in the last two seconds, peak to peak, rad/s.
const SWING: f64 = 0.17;
/// Step of the delays, ms. `LONGEST_MS` is the longest delay, ms.
const STEP_MS: usize = 2;
const LONGEST_MS: usize = 200;

/// The axis whose surface command is delayed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Axis {
    Pitch,
    Roll,
}

/// Parts of the loop besides the delay: none, or those of ArduPlane.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Between {
    Direct,
    Ardupilot,
}

fn main() -> Result<()> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8");
    let model = GreyBox::load(&folder.join("jsbsim.toml"))?;
    let figures = model.airframe.actuators;
    let mut controllers: Vec<(String, Box<dyn Controller>)> = Vec::new();
    for kind in [
        ControllerKind::Lqi,
        ControllerKind::LqiDamped,
        ControllerKind::Pid,
        ControllerKind::PidRetuned,
    ] {
        controllers.push((kind.name().into(), build(kind, &model)?));
    }
    for figures in std::env::args().skip(1) {
        let x: Vec<f64> = figures.split(',').map(str::parse).collect::<Result<_, _>>()?;
        let [attitude, integral, rate, sideslip, deflection] = x[..] else {
            anyhow::bail!("weights are attitude,integral,rate,sideslip,deflection: {figures}");
        };
        let weights =
            Weights { attitude, integral, rate, sideslip, deflection, ..Weights::DEFAULT };
        let lqi = Lqi::weighted("lqi", &model, &weights)?;
        controllers.push((figures, Box::new(lqi)));
    }
    println!("least delay (ms) at which the loop swings by itself, at 20 m/s, target 0, 3 deg");
    println!(
        "{:<26}{:>10}{:>8}{:>12}{:>12}{:>12}{:>12}",
        "controller", "path", "error", "pitch,small", "pitch,full", "roll,small", "roll,full"
    );
    for (name, controller) in &mut controllers {
        for path in [Between::Direct, Between::Ardupilot] {
            let error = settled_deg(controller.as_mut(), figures, path)?;
            print!("{name:<26}{:>10}{error:>8.3}", format!("{path:?}").to_lowercase());
            for axis in [Axis::Pitch, Axis::Roll] {
                for pulse in [0.1, 1.0] {
                    let margin = margin_ms(controller.as_mut(), figures, path, axis, pulse)?;
                    print!("{:>12}", margin.map_or("> 200".into(), |ms| ms.to_string()));
                }
            }
            println!();
        }
    }
    Ok(())
}

/// The smallest delay (ms) at which the axis still oscillates in the last two of ten seconds, or at which the aircraft is
/// lost. `None` if there is none up to `LONGEST_MS`.
fn margin_ms(
    controller: &mut dyn Controller,
    figures: ActuatorFigures,
    path: Between,
    axis: Axis,
    pulse: f64,
) -> Result<Option<usize>> {
    for delay in (0..=LONGEST_MS).step_by(STEP_MS) {
        let mut flight = Flight::new(figures, path, axis, delay, pulse)?;
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        let target = Target { roll: 0.0, pitch: 3f64.to_radians(), airspeed: 20.0 };
        let lost = flight.fly(controller, &target, 10 * SECOND, |step, truth| {
            if step >= 8 * SECOND {
                let rate = if axis == Axis::Pitch { truth.q_radps } else { truth.p_radps };
                range = [range[0].min(rate), range[1].max(rate)];
            }
        });
        if lost.is_err() || range[1] - range[0] > SWING {
            return Ok(Some(delay));
        }
    }
    Ok(None)
}

/// Mean of the roll and pitch RMSE over the last two of twelve seconds at two attitudes, degrees.
fn settled_deg(
    controller: &mut dyn Controller,
    figures: ActuatorFigures,
    path: Between,
) -> Result<f64> {
    let mut sum = 0.0;
    for (roll, pitch) in [(30f64, 10f64), (-20.0, -5.0)] {
        let target = Target { roll: roll.to_radians(), pitch: pitch.to_radians(), airspeed: 20.0 };
        let mut flight = Flight::new(figures, path, Axis::Pitch, 0, 0.0)?;
        let mut squares = [0.0; 2];
        flight.fly(controller, &target, 12 * SECOND, |step, truth| {
            if step >= 10 * SECOND {
                squares[0] += (truth.roll_rad.to_degrees() - roll).powi(2);
                squares[1] += (truth.pitch_rad.to_degrees() - pitch).powi(2);
            }
        })?;
        sum += squares.iter().map(|s| (s / (2 * SECOND) as f64).sqrt()).sum::<f64>() / 2.0;
    }
    Ok(sum / 2.0)
}

/// One flight with a delayed surface command.
struct Flight {
    plant: Plant,
    figures: ActuatorFigures,
    path: Between,
    axis: Axis,
    pulse: f64,
    /// Commands in transit to the delayed surface.
    late: VecDeque<f64>,
}

impl Flight {
    fn new(
        figures: ActuatorFigures,
        path: Between,
        axis: Axis,
        delay_ms: usize,
        pulse: f64,
    ) -> Result<Flight> {
        let options = PlantOptions { step_s: 1.0 / SECOND as f64, ..PlantOptions::default() };
        let late = std::iter::repeat_n(0.0, delay_ms).collect();
        Ok(Flight { plant: Plant::new(&options)?, figures, path, axis, pulse, late })
    }

    fn fly(
        &mut self,
        controller: &mut dyn Controller,
        target: &Target,
        steps: usize,
        mut see: impl FnMut(usize, &Truth),
    ) -> Result<()> {
        controller.reset(0);
        let mut truth = self.plant.reset(&Start::NEUTRAL)?;
        let mut rates = [truth.p_radps, truth.q_radps, truth.r_radps];
        let mut previous = [Command::IDLE; 2];
        let mut channels = Command::IDLE;
        let mut thought = Actuators::at_rest(&Controls::default());
        for step in 0..steps {
            let filter = if self.path == Between::Direct { 1.0 } else { share(20.0) };
            for (y, x) in rates.iter_mut().zip([truth.p_radps, truth.q_radps, truth.r_radps]) {
                *y += filter * (x - *y);
            }
            if step % CYCLE == 0 {
                // real firmware does not report the surfaces, so the controller sees simulated surfaces without the delay
                thought.step(&previous[0], &self.figures);
                let actuators = thought.observed(&self.figures);
                let seen = Observation { actuators, previous, ..observe(step, &truth, rates) };
                let wanted = controller.command(&seen, target);
                previous = [slewed(previous[0], wanted), previous[0]];
            }
            if self.path == Between::Direct || step % (2 * CYCLE) == 0 {
                channels = previous[0];
            }
            let late = self.delayed(step, channels);
            truth = self.plant.step(late)?;
            see(step, &truth);
        }
        Ok(())
    }

    /// The commands that reach the surfaces. One of them is delayed, and the pulse is added to it after four seconds.
    fn delayed(&mut self, step: usize, command: Command) -> Inputs {
        let Command { mut aileron, mut elevator, throttle, .. } = command;
        let surface = if self.axis == Axis::Pitch { &mut elevator } else { &mut aileron };
        self.late.push_back(*surface);
        *surface = self.late.pop_front().unwrap_or(*surface);
        if (4 * SECOND..4 * SECOND + SECOND / 10).contains(&step) {
            *surface = (*surface + self.pulse).clamp(-1.0, 1.0);
        }
        Inputs { aileron, elevator, throttle, rudder: 0.0 }
    }
}

/// Weight of a new sample in a first-order low-pass filter with the corner frequency `hz`, at 1000 samples per second.
fn share(hz: f64) -> f64 {
    1.0 - (-std::f64::consts::TAU * hz / SECOND as f64).exp()
}

fn slewed(before: Command, wanted: Command) -> Command {
    let near = |from: f64, to: f64| to.clamp(from - SLEW, from + SLEW);
    Command {
        aileron: near(before.aileron, wanted.aileron),
        elevator: near(before.elevator, wanted.elevator),
        throttle: wanted.throttle,
        rudder: 0.0,
    }
    .clamped()
}

fn observe(step: usize, truth: &Truth, [p, q, r]: [f64; 3]) -> Observation {
    Observation {
        time: Time::from_micros(1000 * step as u64),
        incidence_sd: [0.0; 2],
        state: State {
            roll: truth.roll_rad,
            pitch: truth.pitch_rad,
            airspeed: truth.airspeed_mps,
            p,
            q,
            r,
            alpha: truth.alpha_rad,
            beta: truth.beta_rad,
        },
        actuators: Default::default(),
        altitude: truth.altitude_m,
        previous: [Command::IDLE; 2],
    }
}
