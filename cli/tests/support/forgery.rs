//! Bank files with changed numbers and a digest that fits them.
// Each test program uses a part of it.
#![allow(dead_code)]

use super::random::Random;
use hybank::bank::{Bank, check_digest};
use serde_json::Value;

/// Every number in a document, in its order.
pub(crate) fn numbers(value: &mut Value) -> Vec<&mut Value> {
    match value {
        Value::Number(_) => vec![value],
        Value::Array(items) => items.iter_mut().flat_map(numbers).collect(),
        Value::Object(members) => members.values_mut().flat_map(numbers).collect(),
        _ => Vec::new(),
    }
}

/// The parts of a file that hold numbers; gamma, spec and coefficients would be rare among the numbers of
/// the proof.
pub(crate) fn parts(document: &mut Value) -> Vec<&mut Value> {
    let mut parts = Vec::new();
    for (key, value) in document.as_object_mut().unwrap() {
        if key == "proof" && value.is_object() {
            parts.extend(value.as_object_mut().unwrap().values_mut());
        } else {
            parts.push(value);
        }
    }
    parts.retain_mut(|part| !numbers(part).is_empty());
    parts
}

/// Another number, near or far.
pub(crate) fn forged(dice: &mut Random, value: &Value) -> Value {
    if let Some(whole) = value.as_u64() {
        return match dice.below(3) {
            0 => (whole + 1).into(),
            1 => whole.saturating_sub(1).into(),
            _ => (whole * 2).into(),
        };
    }
    let x = value.as_f64().unwrap();
    let near = 10f64.powf(-16.0 * dice.part()) * dice.of(&[-1.0, 1.0]);
    let y = match dice.below(8) {
        0 => 0.0,
        1 => -x,
        2 => 50.0 * x,
        3 => x.next_up(),
        _ => x * (1.0 + near),
    };
    y.into()
}

/// The text of the forged document with the digest of its content; `None` if it is no bank.
pub(crate) fn sealed(document: &Value) -> Option<String> {
    let text = Bank::from_json(&document.to_string(), "forged").ok()?.to_json().ok()?;
    check_digest(&text, "forged").unwrap();
    Some(text)
}
