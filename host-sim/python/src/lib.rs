//! The part of the Python package `quadlab` that is compiled: `quadlab._quadlab`.
//!
//! Commands run as the program runs them, with the same options, sentences and documents; `generate.py` makes the functions of
//! `quadlab.commands` from what `describe` tells of them. Flights become NumPy arrays without copies. Long work runs beside the
//! interpreter: its lock is released, and Ctrl-C stops it.

#![forbid(unsafe_code)]

mod commands;
mod craft;
mod flights;
mod simulation;
mod waiting;

use pyo3::prelude::*;

pyo3::create_exception!(
    quadlab,
    QuadlabError,
    pyo3::exceptions::PyValueError,
    "What the program says in one line."
);

/// Functions and classes as Python sees them.
#[pymodule]
mod _quadlab {
    use super::{Bound, PyModule, PyModuleMethods as _, PyResult};

    #[pymodule_export]
    use super::QuadlabError;
    #[pymodule_export]
    use super::commands::{check_model, describe, run};
    #[pymodule_export]
    use super::craft::Crafts;
    #[pymodule_export]
    use super::flights::{read, residuals};
    #[pymodule_export]
    use super::simulation::simulate;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        super::commands::listen();
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
