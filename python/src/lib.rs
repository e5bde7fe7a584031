//! The native part of the Python package `greylag`: functions of the library for numpy arrays and JSON.

mod batch;
mod error;
mod long_work;
mod model;
mod policy;
mod study;
mod world;

use std::path::PathBuf;

use pyo3::prelude::*;

use error::GreylagError;

/// Path of a file that the user names or that is installed with the program, found as the commands find it.
#[pyfunction]
fn shipped(path: PathBuf) -> PathBuf {
    greylag::commands::shipped::shipped(&path)
}

#[pymodule]
fn _greylag(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("GreylagError", module.py().get_type::<GreylagError>())?;
    module.add("OBSERVATION_UNITS", greylag::control::policy::observation::UNIT)?;
    module.add("STATE_NAMES", greylag::physics::State::NAMES)?;
    module.add("VERSION", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<model::Model>()?;
    module.add_class::<world::World>()?;
    module.add_class::<policy::Policy>()?;
    module.add_function(wrap_pyfunction!(shipped, module)?)?;
    module.add_function(wrap_pyfunction!(policy::export_policy, module)?)?;
    module.add_function(wrap_pyfunction!(study::load, module)?)?;
    module.add_function(wrap_pyfunction!(study::compare, module)?)?;
    module.add_function(wrap_pyfunction!(study::diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(study::amend, module)?)?;
    Ok(())
}
