//! The Python class of a model: state derivatives, steps and simulated flights of many aircraft at once.

use std::path::PathBuf;
use std::sync::Arc;

use greylag::model::block::Block;
use greylag::model::residual::fingerprint;
use greylag::model::{GreyBox, Memory};
use greylag::num::{ROW, Real};
use greylag::physics::{Controls, State};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::batch::{gather, scatter};
use crate::error::raised;

/// Numbers of columns in a table of states and in a table of controls.
const STATES: usize = 8;
const CONTROLS: usize = 4;

/// A grey-box model of an aircraft.
#[pyclass(frozen, module = "greylag._greylag")]
pub struct Model {
    pub(crate) model: Arc<GreyBox>,
    path: PathBuf,
}

fn controls<R: Copy>([aileron, elevator, throttle, rudder]: [R; CONTROLS]) -> Controls<R> {
    Controls { aileron, elevator, throttle, rudder, lagged: None }
}

/// An error if the table `what` does not have the shape `expected`.
fn check(what: &str, shape: &[usize], expected: &[usize]) -> PyResult<()> {
    if shape == expected {
        return Ok(());
    }
    Err(PyValueError::new_err(format!("{what} has the shape {shape:?}, not {expected:?}")))
}

/// The controls that act when the actuators have been at rest at the positions `measured`.
fn acting<R: Real>(model: &GreyBox, measured: Controls<R>) -> Controls<R> {
    match model.acts_at_once() {
        true => measured,
        false => model.act(&measured, &mut model.at_rest(&measured)),
    }
}

#[pymethods]
impl Model {
    /// Reads a model file.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Model> {
        let model = GreyBox::load(&path).map_err(raised)?;
        Ok(Model { model: Arc::new(model), path })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.model.name
    }

    #[getter]
    fn description(&self) -> &str {
        &self.model.description
    }

    #[getter]
    fn sha256(&self) -> &str {
        &self.model.sha256
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.path.clone()
    }

    #[getter]
    fn airframe(&self) -> &str {
        &self.model.airframe.name
    }

    #[getter]
    fn airframe_sha256(&self) -> String {
        fingerprint(&self.model.airframe)
    }

    #[getter]
    fn altitude(&self) -> f64 {
        self.model.airframe.reference.altitude
    }

    #[getter]
    fn start(&self) -> [f64; STATES] {
        self.model.airframe.start().to_array()
    }

    #[getter]
    fn effects(&self) -> Vec<&'static str> {
        self.model.effects().map(|about| about.id).collect()
    }

    #[getter]
    fn coefficients(&self) -> Vec<(String, f64)> {
        self.model.coefficients().iter().map(|c| (c.name.clone(), c.value)).collect()
    }

    /// Time derivatives of (n, 8) states at (n, 4) controls and the altitude `altitude` (m), in double precision.
    fn derivative<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, f64>,
        controls: PyReadonlyArray2<'py, f64>,
        altitude: f64,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let rows = states.as_array().nrows();
        check("states", states.as_array().shape(), &[rows, STATES])?;
        check("controls", controls.as_array().shape(), &[rows, CONTROLS])?;
        let (states, held) = (states.as_slice()?, controls.as_slice()?);
        let rates = py.detach(|| self.rates(states, held, altitude));
        rates.into_pyarray(py).reshape([rows, STATES])
    }

    /// The (n, 8) states after 0.01 s with constant (n, 4) controls, in single precision.
    fn step<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, f32>,
        controls: PyReadonlyArray2<'py, f32>,
        altitude: f64,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let rows = states.as_array().nrows();
        check("states", states.as_array().shape(), &[rows, STATES])?;
        check("controls", controls.as_array().shape(), &[rows, CONTROLS])?;
        let (states, held) = (states.as_slice()?, controls.as_slice()?);
        let next = py.detach(|| self.steps(states, held, altitude));
        next.into_pyarray(py).reshape([rows, STATES])
    }

    /// Simulated flights from (n, 8) states with (steps, n, 4) controls: (steps + 1, n, 8) states.
    fn rollout<'py>(
        &self,
        py: Python<'py>,
        states: PyReadonlyArray2<'py, f32>,
        controls: PyReadonlyArray3<'py, f32>,
        altitude: f64,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let rows = states.as_array().nrows();
        let steps = controls.as_array().shape()[0];
        check("states", states.as_array().shape(), &[rows, STATES])?;
        check("controls", controls.as_array().shape(), &[steps, rows, CONTROLS])?;
        let (states, held) = (states.as_slice()?, controls.as_slice()?);
        let flown = py.detach(|| self.fly(states, held, steps, altitude));
        flown.into_pyarray(py).reshape([steps + 1, rows, STATES])
    }
}

impl Model {
    fn rates(&self, states: &[f64], held: &[f64], altitude: f64) -> Vec<f64> {
        let mut rates = Vec::with_capacity(states.len());
        let rows = states.as_chunks::<STATES>().0.iter().zip(held.as_chunks::<CONTROLS>().0);
        for (state, row) in rows {
            let acting = acting(&self.model, controls(*row));
            rates.extend(self.model.rate(&State::from_array(*state), &acting, altitude).to_array());
        }
        rates
    }

    fn steps(&self, states: &[f32], held: &[f32], altitude: f64) -> Vec<f32> {
        let mut next = vec![0.0; states.len()];
        for first in (0..states.len() / STATES).step_by(ROW) {
            let acting = acting(&self.model, controls(gather::<CONTROLS>(held, first)));
            let state = State::from_array(gather::<STATES>(states, first));
            let mut memory = Memory::default();
            let later = self.model.step_block(&state, &acting, altitude, &mut memory);
            scatter(&later.to_array(), &mut next, first);
        }
        next
    }

    fn fly(&self, states: &[f32], held: &[f32], steps: usize, altitude: f64) -> Vec<f32> {
        let rows = states.len() / STATES;
        let mut flown = states.to_vec();
        flown.resize((steps + 1) * states.len(), 0.0);
        for first in (0..rows).step_by(ROW) {
            let mut state = State::from_array(gather::<STATES>(states, first));
            let mut memory: Memory<Block> = Memory::default();
            let mut inputs = None;
            for step in 0..steps {
                let now = &held[step * rows * CONTROLS..(step + 1) * rows * CONTROLS];
                let measured = controls(gather::<CONTROLS>(now, first));
                let past = inputs.get_or_insert_with(|| self.model.at_rest(&measured));
                let acting = match self.model.acts_at_once() {
                    true => measured,
                    false => self.model.act(&measured, past),
                };
                state = self.model.step_block(&state, &acting, altitude, &mut memory);
                let place = &mut flown[(step + 1) * states.len()..(step + 2) * states.len()];
                scatter(&state.to_array(), place, first);
            }
        }
        flown
    }
}
