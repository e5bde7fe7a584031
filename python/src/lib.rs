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

/// Resolves the path of a file as the commands do: an existing path is returned as given, a path below `params/` may be
/// that of a shipped file.
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
