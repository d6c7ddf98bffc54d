//! Python objects as the tables, lists, numbers and texts of a spec, and as quantities: numbers in SI units
//! or texts such as `10ps` and `1%`, one or a list.

use crate::errors::refused;
use hybank::messages::{Quoted, shown};
use hybank::quantity::{self, QuantityError, WrittenTime};
use hybank::units::Seconds;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyBytes, PyComplex, PyFloat, PyInt, PyMapping, PyString};
use toml::{Table, Value};

/// Deepest nesting: a spec has less, and what contains itself has no end.
const DEEPEST: usize = 32;
/// Longest list: a spec has less, and some iterators have no end.
const LONGEST: usize = 1_000_000;

/// Where an object is in a spec.
#[derive(Clone, Copy)]
struct Place<'a> {
    /// The path of keys.
    path: &'a str,
    /// Containers around it.
    depth: usize,
}

/// A mapping as a table; entries that are None are left out. NumPy scalars and arrays count as the numbers
/// and lists that they hold.
pub(crate) fn table(object: &Bound<'_, PyAny>) -> PyResult<Table> {
    match value(object, Place { path: "", depth: 0 })? {
        Some(Value::Table(table)) => Ok(table),
        _ => Err(PyTypeError::new_err(format!(
            "a spec is a path, a TOML text of several lines, a mapping or keywords, not {}",
            type_name(object)
        ))),
    }
}

/// The object at a place in a spec; `None` for None.
fn value(object: &Bound<'_, PyAny>, place: Place<'_>) -> PyResult<Option<Value>> {
    if object.is_none() {
        return Ok(None);
    }
    if place.depth > DEEPEST {
        return Err(wrong(place, &format!("nested more than {DEEPEST} deep; it seems to contain itself")));
    }
    // NumPy's scalars and arrays, and what resembles them.
    if object.hasattr("tolist")? {
        return value(&object.call_method0("tolist")?, place.inside(place.path));
    }
    plain(object, place).map(Some)
}

fn plain(object: &Bound<'_, PyAny>, place: Place<'_>) -> PyResult<Value> {
    if object.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(object.extract()?));
    }
    if object.is_instance_of::<PyString>() {
        return Ok(Value::String(object.extract()?));
    }
    if object.is_instance_of::<PyInt>() {
        let whole = object.extract().map(Value::Integer).or_else(|_| object.extract().map(Value::Float));
        return whole.map_err(|_| wrong(place, "the number is too large"));
    }
    if object.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(object.extract()?));
    }
    if let Ok(number) = object.cast::<PyComplex>() {
        return Ok(Value::Array(vec![Value::Float(number.real()), Value::Float(number.imag())]));
    }
    if let Ok(mapping) = object.cast::<PyMapping>() {
        return entries(mapping, place);
    }
    match object.try_iter() {
        Ok(items) if !object.is_instance_of::<PyBytes>() => list(items, place),
        // Fractions, decimals and the like.
        _ => number(object, place),
    }
}

fn number(object: &Bound<'_, PyAny>, place: Place<'_>) -> PyResult<Value> {
    object.call_method0("__float__").and_then(|x| x.extract()).map(Value::Float).map_err(|_| {
        let found = type_name(object);
        wrong(place, &format!("a number, a text, a list or a mapping is needed, not {found}"))
    })
}

fn entries(mapping: &Bound<'_, PyMapping>, place: Place<'_>) -> PyResult<Value> {
    let mut table = Table::new();
    for item in mapping.items()? {
        let (key, object): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let key: String = key.extract().map_err(|_| {
            wrong(place, &format!("the keys of a mapping must be texts, not {}", type_name(&key)))
        })?;
        let path = if place.path.is_empty() { key.clone() } else { format!("{}.{key}", place.path) };
        if let Some(value) = value(&object, place.inside(&path))? {
            table.insert(key, value);
        }
    }
    Ok(Value::Table(table))
}

fn list<'py>(items: impl Iterator<Item = PyResult<Bound<'py, PyAny>>>, place: Place<'_>) -> PyResult<Value> {
    let mut list = Vec::new();
    for (i, item) in items.enumerate() {
        if i == LONGEST {
            return Err(wrong(place, &format!("more than {LONGEST} entries")));
        }
        let path = format!("{}[{i}]", place.path);
        let inner = place.inside(&path);
        let none = || wrong(inner, "None has no meaning in a list; leave it out");
        list.push(value(&item?, inner)?.ok_or_else(none)?);
    }
    Ok(Value::Array(list))
}

impl Place<'_> {
    fn inside(self, path: &str) -> Place<'_> {
        Place { path, depth: self.depth + 1 }
    }
}

fn wrong(place: Place<'_>, problem: &str) -> PyErr {
    let path = if place.path.is_empty() { "the spec" } else { place.path };
    PyTypeError::new_err(shown(&format!("{}: {problem}", Quoted(path))))
}

fn type_name(object: &Bound<'_, PyAny>) -> String {
    object.get_type().name().map_or_else(|_| "another object".to_owned(), |name| name.to_string())
}

/// Times in seconds, or texts with a unit; none for None.
pub(crate) fn times(keyword: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<WrittenTime>> {
    quantities(keyword, given, quantity::time, |seconds| WrittenTime::Seconds(Seconds(seconds)))
}

/// Shares: 0.01, `1%` or `500ppm`.
pub(crate) fn shares(keyword: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    quantities(keyword, given, quantity::relative, |share| share)
}

/// Frequencies in hertz, or texts with a unit.
pub(crate) fn frequencies(keyword: &str, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    quantities(keyword, given, |text| quantity::frequency(text).map(|hertz| hertz.0), |hertz| hertz)
}

/// Plain numbers.
pub(crate) fn numbers(given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    given.extract().map(|one: f64| vec![one]).or_else(|_| given.extract())
}

fn quantities<T>(
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
    let is_list = !given.is_instance_of::<PyString>() && given.extract::<f64>().is_err();
    if is_list { given.try_iter()?.map(|item| one(&item?)).collect() } else { Ok(vec![one(given)?]) }
}
