//! What is no array of NumPy: `hybank._inputs` knows files, xarray, dask and pandas.

use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};

/// The packages whose arrays have names or are lazy.
const FOREIGN: [&str; 3] = ["xarray", "pandas", "dask"];

/// Whether `x` is a file or several, recordings that were read, or an array of such a package.
pub(crate) fn is_foreign(x: &Bound<'_, PyAny>) -> PyResult<bool> {
    let first = match (x.cast::<PyList>(), x.cast::<PyTuple>()) {
        (Ok(list), _) => list.get_item(0).ok(),
        (_, Ok(tuple)) => tuple.get_item(0).ok(),
        _ => None,
    };
    let x = first.as_ref().unwrap_or(x);
    let module = x.get_type().module()?;
    let module = module.to_cow()?;
    let package = module.split('.').next().unwrap_or_default();
    let is_path = x.is_instance_of::<PyString>() || x.hasattr("__fspath__")?;
    Ok(is_path || FOREIGN.contains(&package) || module == "hybank._inputs")
}
