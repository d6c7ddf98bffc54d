//! Quantities as Python writes them: numbers in SI units or texts such as `10ps` and `1%`, one or a list.

use crate::errors::refused;
use hybank::quantity::{self, QuantityError, Time};
use hybank::units::Seconds;
use pyo3::prelude::*;

/// Times in seconds, or texts with a unit; none for None.
pub(crate) fn times(keyword: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Time>> {
    list(keyword, given, quantity::time, |seconds| Time::Seconds(Seconds(seconds)))
}

/// Shares: 0.01, `1%` or `500ppm`.
pub(crate) fn shares(keyword: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    list(keyword, given, quantity::relative, |share| share)
}

/// Frequencies in hertz, or texts with a unit.
pub(crate) fn frequencies(keyword: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    list(keyword, given, |text| quantity::frequency(text).map(|hertz| hertz.0), |hertz| hertz)
}

/// Plain numbers.
pub(crate) fn numbers(given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    given.extract().map(|one: f64| vec![one]).or_else(|_| given.extract())
}

fn list<T>(
    keyword: &str,
    given: Option<&Bound<'_, PyAny>>,
    text: impl Fn(&str) -> Result<T, QuantityError>,
    number: impl Fn(f64) -> T,
) -> PyResult<Vec<T>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    let one = |object: &Bound<'_, PyAny>| match object.extract::<String>() {
        Ok(written) => text(&written).map_err(|error| refused(format!("{keyword}: {error}"))),
        Err(_) => match object.extract::<f64>()? {
            value if value.is_finite() => Ok(number(value)),
            value => Err(refused(format!("{keyword}: {value} is not a finite number"))),
        },
    };
    let is_list = !given.is_instance_of::<pyo3::types::PyString>() && given.extract::<f64>().is_err();
    if is_list { given.try_iter()?.map(|item| one(&item?)).collect() } else { Ok(vec![one(given)?]) }
}
