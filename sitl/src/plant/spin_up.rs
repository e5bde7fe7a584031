//! Spins up propellers that are at rest after the start of their engines.
//!
//! JSBSim's electric engine is a source of constant power: its torque is the power divided by the propeller's speed,
//! for which JSBSim uses at least 1 rad/s. The first frame therefore adds P·dt/J (power, step, inertia) to the speed of
//! a propeller at rest. For a model aircraft in steps of 10 ms this is 130,000 rpm, and the state is NaN 0.1 s later
//! (`findings/jsbsim-electric-standstill.sh`). In steps of a hundredth of that length, the propeller accelerates
//! correctly. Once it windmills, the usual step is stable at full throttle (`sitl/tests/plant/electric.rs`).

use jsbsim::NodeId;

use super::lookup::look;
use super::settling::{STILL_S, settle};
use super::{Inputs, Plant, PlantError, jsbsim};

/// Speed below which a propeller counts as at rest, rpm.
const AT_REST_RPM: f64 = 1.0;
/// Throttle for the spin-up, 0..1.
const THROTTLE: f64 = 0.1;
/// Length of the frames of the spin-up, as a fraction of the plant's step.
const FINE: f64 = 0.01;
/// Largest number of frames of the spin-up.
const FRAMES: usize = 3000;
/// Relative change of a propeller's speed per frame below which its speed counts as steady.
const STEADY: f64 = 2e-3;
/// Number of frames in which the throttle closes again; a slower throttle is still partly open at the start.
const CLOSING: usize = 200;

impl Plant {
    /// Spins up the propellers at rest, with the aircraft held in its state, and closes the throttle again.
    ///
    /// # Errors
    /// [`PlantError::Jsbsim`] if JSBSim fails.
    pub(super) fn spin_up(&mut self) -> Result<(), PlantError> {
        let at_rest = self.propellers_at_rest().map_err(jsbsim("reading the propellers"))?;
        if at_rest.is_empty() {
            return Ok(());
        }
        let step_s = self.options.step_s;
        self.held(|plant| {
            plant.fdm.set_dt(FINE * step_s);
            let turned = plant.turn(&at_rest);
            // in steps this short, the filters of the throttle settle while the propellers keep their speed
            plant.fdm.set_dt(STILL_S);
            let closed = turned.and_then(|()| plant.run_at(0.0, CLOSING));
            plant.fdm.set_dt(step_s);
            closed.map_err(jsbsim("bringing the propellers to speed"))
        })?;
        settle(&mut self.fdm, step_s).map_err(jsbsim("setting the start"))
    }

    /// Properties of the speeds of the propellers at rest.
    fn propellers_at_rest(&mut self) -> Result<Vec<NodeId>, jsbsim::Error> {
        let name = |engine: usize| format!("propulsion/engine[{engine}]/propeller-rpm");
        let all: Vec<NodeId> = (0..).map_while(|engine| look(&self.fdm, &name(engine))).collect();
        let mut found = Vec::new();
        for node in all {
            if self.fdm.read_node(node)? < AT_REST_RPM {
                found.push(node);
            }
        }
        Ok(found)
    }

    /// Opens the throttle until the speeds of the propellers are steady; `speeds` are their properties.
    fn turn(&mut self, speeds: &[NodeId]) -> Result<(), jsbsim::Error> {
        let mut last = vec![0.0; speeds.len()];
        for _ in 0..FRAMES {
            self.run_at(THROTTLE, 1)?;
            let mut steady = true;
            for (last, node) in last.iter_mut().zip(speeds) {
                let now = self.fdm.read_node(*node)?;
                steady &= now > 0.0 && (now - *last).abs() < STEADY * now;
                *last = now;
            }
            if steady {
                break;
            }
        }
        Ok(())
    }

    fn run_at(&mut self, throttle: f64, frames: usize) -> Result<(), jsbsim::Error> {
        for _ in 0..frames {
            self.nodes.command(&mut self.fdm, &Inputs { throttle, ..Inputs::default() })?;
            self.fdm.run()?;
        }
        Ok(())
    }
}
