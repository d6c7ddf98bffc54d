//! What the tests of the library share with those of the program.
// Each test program uses a part of it.
#![allow(dead_code)]

pub(crate) mod specs;
pub(crate) mod wav_file;

pub(crate) use trials::random;

use serde_json::Value;

/// The number at a JSON pointer.
pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    let number = value.pointer(pointer).and_then(Value::as_f64);
    number.unwrap_or_else(|| panic!("{pointer} is no number in {value}"))
}
