//! The library's errors as a Python exception.

use pyo3::PyErr;
use pyo3::exceptions::PyException;

pyo3::create_exception!(
    greylag,
    GreylagError,
    PyException,
    "What greylag cannot do: what was being done, to what, and what to do next."
);

/// A library's error as a Python exception with its message.
pub fn raised(error: impl std::fmt::Display) -> PyErr {
    GreylagError::new_err(error.to_string())
}
