//! Pickles and copies of results: the name of the class and its attributes.

use crate::errors::refused;
use crate::{align, calibrate, ibr, measure, results};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;

/// The result of a class with the attributes of an object.
#[pyfunction]
pub(crate) fn restored<'py>(name: &str, attributes: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    match name {
        "Alignment" => result::<align::Alignment>(attributes),
        "Analysis" => result::<results::Analysis>(attributes),
        "Calibration" => result::<calibrate::Calibration>(attributes),
        "Capture" => result::<results::Capture>(attributes),
        "FuseReport" => result::<results::FuseReport>(attributes),
        "Gamma" => result::<results::Gamma>(attributes),
        "Geometry" => result::<ibr::Geometry>(attributes),
        "Measurement" => result::<measure::Measurement>(attributes),
        "Figures" => result::<results::Figures>(attributes),
        "Verified" => result::<results::Verified>(attributes),
        "View" => result::<ibr::View>(attributes),
        _ => Err(refused(format!("a pickle of {name} is of another version of hybank"))),
    }
}

fn result<'py, T>(attributes: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>>
where
    T: for<'a> FromPyObject<'a, 'py> + IntoPyObject<'py>,
{
    let extracted: Result<T, _> = attributes.extract();
    extracted.map_err(Into::into)?.into_bound_py_any(attributes.py())
}
