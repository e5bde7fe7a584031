//! The Python exception for errors of the library.

use pyo3::PyErr;
use pyo3::exceptions::PyException;

pyo3::create_exception!(
    greylag,
    GreylagError,
    PyException,
    "What greylag cannot do: what was being done, to what, and what to do next."
);

/// The Python exception with the message of `error`.
pub fn raised(error: impl std::fmt::Display) -> PyErr {
    GreylagError::new_err(error.to_string())
}
