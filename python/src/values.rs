//! Python objects as the tables, lists, numbers and texts of a spec.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyComplex, PyFloat, PyInt, PyMapping, PyString};
use toml::{Table, Value};

/// A mapping as a table; entries that are None are left out. NumPy scalars and arrays count as the numbers
/// and lists that they hold.
pub(crate) fn table(object: &Bound<'_, PyAny>) -> PyResult<Table> {
    match value(object, "")? {
        Some(Value::Table(table)) => Ok(table),
        _ => Err(PyTypeError::new_err(format!(
            "a spec is a path, a TOML text of several lines, a mapping or keywords, not {}",
            type_name(object)
        ))),
    }
}

/// The object at `path` in a spec; `None` for None.
fn value(object: &Bound<'_, PyAny>, path: &str) -> PyResult<Option<Value>> {
    if object.is_none() {
        return Ok(None);
    }
    // NumPy's scalars and arrays, and what resembles them.
    if object.hasattr("tolist")? {
        return value(&object.call_method0("tolist")?, path);
    }
    plain(object, path).map(Some)
}

fn plain(object: &Bound<'_, PyAny>, path: &str) -> PyResult<Value> {
    if object.is_instance_of::<PyBool>() {
        return Ok(Value::Boolean(object.extract()?));
    }
    if object.is_instance_of::<PyString>() {
        return Ok(Value::String(object.extract()?));
    }
    if object.is_instance_of::<PyInt>() {
        return Ok(object.extract().map(Value::Integer).unwrap_or(Value::Float(object.extract()?)));
    }
    if object.is_instance_of::<PyFloat>() {
        return Ok(Value::Float(object.extract()?));
    }
    if let Ok(number) = object.cast::<PyComplex>() {
        return Ok(Value::Array(vec![Value::Float(number.real()), Value::Float(number.imag())]));
    }
    if let Ok(mapping) = object.cast::<PyMapping>() {
        return entries(mapping, path);
    }
    match object.try_iter() {
        Ok(items) => list(items, path),
        // Fractions, decimals and the like.
        Err(_) => {
            object.call_method0("__float__").and_then(|x| x.extract()).map(Value::Float).map_err(|_| {
                PyTypeError::new_err(format!(
                    "{path}: a number, a text, a list or a mapping is needed, not {}",
                    type_name(object)
                ))
            })
        }
    }
}

fn entries(mapping: &Bound<'_, PyMapping>, path: &str) -> PyResult<Value> {
    let mut table = Table::new();
    for item in mapping.items()? {
        let (key, object): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
        let key: String = key.extract().map_err(|_| {
            PyTypeError::new_err(format!(
                "{path}: the keys of a mapping must be texts, not {}",
                type_name(&key)
            ))
        })?;
        let inner = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
        if let Some(value) = value(&object, &inner)? {
            table.insert(key, value);
        }
    }
    Ok(Value::Table(table))
}

fn list<'py>(items: impl Iterator<Item = PyResult<Bound<'py, PyAny>>>, path: &str) -> PyResult<Value> {
    let none =
        |place: &str| PyTypeError::new_err(format!("{place}: None has no meaning in a list; leave it out"));
    let item = |(i, item): (usize, PyResult<Bound<'py, PyAny>>)| {
        let place = format!("{path}[{i}]");
        value(&item?, &place)?.ok_or_else(|| none(&place))
    };
    items.enumerate().map(item).collect::<PyResult<_>>().map(Value::Array)
}

fn type_name(object: &Bound<'_, PyAny>) -> String {
    object.get_type().name().map_or_else(|_| "another object".to_owned(), |name| name.to_string())
}
