//! The training environments of the Rust policy training: JSBSim, or a model that simulates many aircraft at once.

use std::sync::{Arc, Mutex, MutexGuard};

use greylag::control::Target;
use greylag::control::policy::{ACTIONS, OBSERVATIONS, observe};
use greylag::control::task::Task;
use greylag::model::GreyBox;
use greylag::num::ROW;
use greylag::physics::ActuatorState;
use greylag::physics::servos::Surface;
use greylag::sim::flown::Flown;
use greylag::sim::imagined::{Ended, Imagination, Validity};
use greylag::sim::targets::Stratified;
use greylag::sim::{self, Trouble};
use greylag_sitl::plant::PlantOptions;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

use crate::batch::{gather, scatter};
use crate::error::raised;
use crate::model::Model;

type Inner = Box<dyn sim::world::World + Send>;
/// Result of a step: observations after the restart of ended episodes, rewards, ends (0 not ended, 1 time limit, 2
/// lost), and observations before the restart.
type Steps<'py> = (
    Bound<'py, PyArray2<f32>>,
    Bound<'py, PyArray1<f32>>,
    Bound<'py, PyArray1<u8>>,
    Bound<'py, PyArray2<f32>>,
);

/// Aircraft with one episode each; an episode that ends is restarted with the next target.
#[pyclass(frozen, module = "greylag._greylag")]
pub struct World {
    inner: Mutex<Inner>,
    instances: usize,
    bounds: [[f64; OBSERVATIONS]; 2],
}

/// Result of a step, one row per aircraft, in the order of [`Steps`].
struct Rows {
    now: Vec<f32>,
    reward: Vec<f32>,
    ended: Vec<u8>,
    before: Vec<f32>,
}

#[pymethods]
impl World {
    /// `instances` aircraft that `model` simulates.
    #[staticmethod]
    fn imagined(
        model: &Model,
        instances: usize,
        seed: u64,
        corners: f64,
        airspeeds: &str,
    ) -> PyResult<World> {
        let targets = targets(&model.model, seed, corners, airspeeds)?;
        if instances == 0 {
            return Err(PyValueError::new_err("there are no instances; ask for one or more"));
        }
        let world = Imagination::new(Arc::clone(&model.model), instances, targets);
        Ok(World::new(Box::new(world), instances, &model.model))
    }

    /// One X8 that JSBSim simulates; `model` provides its airframe.
    #[staticmethod]
    fn x8(model: &Model, seed: u64, corners: f64, airspeeds: &str) -> PyResult<World> {
        let targets = targets(&model.model, seed, corners, airspeeds)?;
        let (plant, airframe) = (PlantOptions::default(), &model.model.airframe);
        let world = Flown::new(&plant, airframe, targets).map_err(raised)?;
        Ok(World::new(Box::new(world), 1, &model.model))
    }

    /// Smallest and largest value of each observation while an episode has not ended.
    #[getter]
    fn bounds(&self) -> [[f64; OBSERVATIONS]; 2] {
        self.bounds
    }

    /// Number of targets so far, and number of episodes that ended outside the envelope.
    #[getter]
    fn episodes(&self) -> PyResult<(u64, u64)> {
        let world = self.lock()?;
        Ok((world.targets(), world.lost()))
    }

    /// Restarts all episodes with the next targets.
    fn restart(&self) -> PyResult<()> {
        let mut world = self.lock()?;
        let given = world.targets();
        world.restart(given).map_err(raised)
    }

    /// The present observations, (n, 16).
    fn observe<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let world = self.lock()?;
        let mut seen = vec![0.0; self.instances * OBSERVATIONS];
        for block in 0..self.instances.div_ceil(ROW) {
            scatter(&world.observe(block), &mut seen, block * ROW);
        }
        seen.into_pyarray(py).reshape([self.instances, OBSERVATIONS])
    }

    /// Makes one step of all aircraft with (n, 3) actions.
    fn step<'py>(
        &self,
        py: Python<'py>,
        actions: PyReadonlyArray2<'py, f32>,
    ) -> PyResult<Steps<'py>> {
        let (shape, expected) = (actions.as_array().shape().to_vec(), [self.instances, ACTIONS]);
        if shape != expected {
            let said = format!("actions have the shape {shape:?}, not {expected:?}");
            return Err(PyValueError::new_err(said));
        }
        let actions = actions.as_slice()?;
        if !actions.iter().all(|a| a.is_finite()) {
            return Err(PyValueError::new_err("an action is no number"));
        }
        let Rows { now, reward, ended, before } =
            py.detach(|| self.advance(actions))?.map_err(raised)?;
        let table = |rows: Vec<f32>| rows.into_pyarray(py).reshape([self.instances, OBSERVATIONS]);
        Ok((table(now)?, reward.into_pyarray(py), ended.into_pyarray(py), table(before)?))
    }
}

impl World {
    fn new(inner: Inner, instances: usize, model: &GreyBox) -> World {
        World { inner: Mutex::new(inner), instances, bounds: observable(model) }
    }

    fn lock(&self) -> PyResult<MutexGuard<'_, Inner>> {
        let broken = |_| PyRuntimeError::new_err("a step of this environment failed; make it anew");
        self.inner.lock().map_err(broken)
    }

    fn advance(&self, actions: &[f32]) -> PyResult<Result<Rows, Trouble>> {
        let mut world = self.lock()?;
        Ok(advance(world.as_mut(), self.instances, actions))
    }
}

/// Makes one step of every block. A lost aircraft gets the reward that the training gives for a loss. Its last
/// observation is that before the step, because its state may be NaN.
fn advance(
    world: &mut dyn sim::world::World,
    instances: usize,
    actions: &[f32],
) -> Result<Rows, Trouble> {
    let room = || vec![0.0; instances * OBSERVATIONS];
    let mut rows = Rows { now: room(), reward: Vec::new(), ended: Vec::new(), before: room() };
    for block in 0..instances.div_ceil(ROW) {
        let first = block * ROW;
        let earlier = world.observe(block);
        let stepped = world.step(block, &gather::<ACTIONS>(actions, first))?;
        let mut last = stepped.observed;
        for (lane, ended) in stepped.ended.iter().enumerate().take(instances - first) {
            let lost = *ended == Ended::Lost;
            if lost {
                last.iter_mut().zip(&earlier).for_each(|(x, old)| x.0[lane] = old.0[lane]);
            }
            let reward = stepped.reward.0[lane];
            rows.reward.push(if lost { Task::PAPER.of_loss() as f32 } else { reward });
            rows.ended.push(match ended {
                Ended::No => 0,
                Ended::Time => 1,
                Ended::Lost => 2,
            });
        }
        scatter(&last, &mut rows.before, first);
        let begun = stepped.ended.iter().any(|e| *e != Ended::No);
        scatter(&if begun { world.observe(block) } else { last }, &mut rows.now, first);
    }
    Ok(rows)
}

/// The targets of `greylag train policy` (`envelope`), or targets at the airspeed of the start, as in the paper
/// (`start`).
fn targets(model: &GreyBox, seed: u64, corners: f64, airspeeds: &str) -> PyResult<Stratified> {
    if !(0.0..=1.0).contains(&corners) {
        return Err(PyValueError::new_err(format!(
            "corners is {corners}; give a share from 0 to 1"
        )));
    }
    let targets = Stratified::new(seed, 0, corners);
    match airspeeds {
        "envelope" => Ok(targets.at_airspeeds_of(&model.airframe)),
        "start" => Ok(targets),
        other => Err(PyValueError::new_err(format!(
            "airspeeds is {other:?}; give \"envelope\" (as the training) or \"start\" (as the paper)"
        ))),
    }
}

/// Smallest and largest value of each observation. They are at the bounds of the state, because [`observe`] is
/// monotonic in each of its arguments.
fn observable(model: &GreyBox) -> [[f64; OBSERVATIONS]; 2] {
    let [least, most] = Validity::of(&model.airframe).bounds();
    let figures = &model.airframe.actuators;
    let reach = |surface: &Surface| {
        let travel = surface.travel;
        (travel.least, travel.most, (travel.most - travel.least) / figures.step)
    };
    let (aileron, elevator) = (reach(&figures.aileron), reach(&figures.elevator));
    let low = ActuatorState {
        aileron: aileron.0,
        aileron_rate: -aileron.2,
        elevator: elevator.0,
        elevator_rate: -elevator.2,
        ..ActuatorState::default()
    };
    let high = ActuatorState {
        aileron: aileron.1,
        aileron_rate: aileron.2,
        elevator: elevator.1,
        elevator_rate: elevator.2,
        throttle: 1.0,
        ..ActuatorState::default()
    };
    let wanted = |state: &greylag::physics::State| Target {
        roll: state.roll,
        pitch: state.pitch,
        airspeed: state.airspeed,
    };
    let (one, other) =
        (observe(&least, &low, &wanted(&most)), observe(&most, &high, &wanted(&least)));
    // a margin for the rounding to single precision
    let wider = |x: f64| x + 1e-5 * x.abs().max(1.0);
    let pair = |i: usize| (one[i].min(other[i]), one[i].max(other[i]));
    [std::array::from_fn(|i| -wider(-pair(i).0)), std::array::from_fn(|i| wider(pair(i).1))]
}
