//! The extension module of the Python package `hybank`: design, banks, streams and proofs of the crate
//! `hybank` for NumPy arrays.
//!
//! Nothing is computed here. These files convert arguments, hold arrays while the interpreter lock is
//! released, and turn errors into exceptions.

#![deny(unsafe_code)]
// The prompts of Python in the documentation are no quotations.
#![allow(clippy::doc_lazy_continuation)]

mod align;
mod arrays;
mod background;
mod bank;
mod calibrate;
mod design;
mod errors;
mod files;
mod formats;
mod fuse;
mod hardware;
mod ibr;
mod measure;
mod merge;
mod outputs;
mod pictures;
mod proofs;
mod recordings;
mod responses;
mod results;
mod running;
mod simulate;
mod sources;
mod stream;
mod values;

use pyo3::prelude::*;

/// Hybrid multirate filter banks: see `hybank`.
#[pymodule]
fn _hybank(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("MOST_PIXELS", hybank_ibr::image::MOST_PIXELS)?;
    module.add("HybankError", py.get_type::<errors::HybankError>())?;
    module.add("SpecError", py.get_type::<errors::SpecError>())?;
    module.add_class::<bank::Bank>()?;
    module.add_class::<stream::Stream>()?;
    module.add_class::<recordings::Recording>()?;
    module.add_function(wrap_pyfunction!(design::design, module)?)?;
    module.add_function(wrap_pyfunction!(design::import_taps, module)?)?;
    module.add_function(wrap_pyfunction!(bank::load, module)?)?;
    module.add_function(wrap_pyfunction!(proofs::verify, module)?)?;
    module.add_function(wrap_pyfunction!(proofs::analyze, module)?)?;
    module.add_function(wrap_pyfunction!(simulate::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(align::align, module)?)?;
    module.add_function(wrap_pyfunction!(merge::merge, module)?)?;
    module.add_function(wrap_pyfunction!(calibrate::calibrate, module)?)?;
    module.add_function(wrap_pyfunction!(measure::measure, module)?)?;
    module.add_function(wrap_pyfunction!(measure::compare, module)?)?;
    module.add_function(wrap_pyfunction!(files::read, module)?)?;
    module.add_function(wrap_pyfunction!(files::turns, module)?)?;
    module.add_function(wrap_pyfunction!(files::numbers, module)?)?;
    module.add_function(wrap_pyfunction!(files::frame_samples, module)?)?;
    module.add_function(wrap_pyfunction!(outputs::encode, module)?)?;
    module.add_function(wrap_pyfunction!(ibr::render_rectified, module)?)?;
    module.add_function(wrap_pyfunction!(ibr::render_calibrated, module)?)?;
    module.add_function(wrap_pyfunction!(ibr::render_uncalibrated, module)?)?;
    Ok(())
}
