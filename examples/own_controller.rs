//! Defines an own controller and flies it in JSBSim, for comparison with the LQI:
//! `cargo run --release --ignore-rust-version --no-default-features --features sitl --example own_controller`.

use std::path::Path;

use anyhow::Context;
use greylag::control::{Controller, ControllerKind, Observation, Target, build};
use greylag::model::GreyBox;
use greylag::physics::Command;
use greylag::sim::{Episode, Simulator};

/// Proportional attitude loops with damping by the body rates. Without an integrator a steady-state error remains.
#[derive(Clone)]
struct Proportional;

impl Controller for Proportional {
    fn name(&self) -> &'static str {
        "proportional"
    }

    fn reset(&mut self, _seed: u64) {}

    fn command(&mut self, seen: &Observation, target: &Target) -> Command {
        // inputs are in rad and rad/s, outputs are fractions of full deflection; a positive elevator pitches down
        let aileron = 1.5 * (target.roll - seen.state.roll) - 0.2 * seen.state.p;
        let elevator = -2.0 * (target.pitch - seen.state.pitch) + 0.3 * seen.state.q;
        let throttle = 0.12 + 0.1 * (target.airspeed - seen.state.airspeed);
        Command { aileron, elevator, throttle, rudder: 0.0 }.clamped()
    }

    fn boxed_clone(&self) -> Box<dyn Controller> {
        Box::new(self.clone())
    }
}

fn main() -> anyhow::Result<()> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/x8/jsbsim.toml");
    let model = GreyBox::load(&path)?;
    let controllers: [Box<dyn Controller>; 2] =
        [Box::new(Proportional), build(ControllerKind::Lqi, &model)?];
    let target = Target { roll: 0.35, pitch: 0.1, airspeed: 16.67 };
    for mut controller in controllers {
        let mut simulator = Simulator::new(&Default::default())?;
        let name = controller.name();
        let episode =
            Episode { environment: &mut simulator, controller: controller.as_mut(), seed: 1 };
        let outcome = episode.fly(&target, |_, _| ()).context("the aircraft was lost")?;
        println!("{name}: {:.3}° settled error", outcome.settled_deg);
    }
    Ok(())
}
