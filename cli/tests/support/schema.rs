//! A validator of the keywords of JSON Schema that the schemas here use; any other keyword is a fault of its
//! own.

use serde_json::Value;

/// What says nothing about a document.
const SILENT: [&str; 5] = ["$schema", "$id", "$defs", "title", "description"];

/// What is wrong with `document`, with the path to it.
pub(crate) fn faults(schema: &Value, document: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, schema, schema, document, "", &mut found);
    found
}

/// The schema that a reference means, and the root to which its own references are relative.
fn resolve<'a>(whole: &'a Value, root: &'a Value, reference: &str) -> (&'a Value, &'a Value) {
    match reference.strip_prefix('#') {
        Some(pointer) => (root, root.pointer(pointer).expect("a definition")),
        None => {
            let definitions = whole["$defs"].as_object().expect("definitions");
            let other =
                definitions.values().find(|schema| schema["$id"] == reference).expect("an embedded schema");
            (other, other)
        }
    }
}

fn check(whole: &Value, root: &Value, schema: &Value, value: &Value, path: &str, found: &mut Vec<String>) {
    let fits = |schema: &Value| {
        let mut inner = Vec::new();
        check(whole, root, schema, value, path, &mut inner);
        inner.is_empty()
    };
    for (keyword, rule) in schema.as_object().expect("a schema is an object") {
        let number = |test: fn(f64, f64) -> bool| {
            value.as_f64().zip(rule.as_f64()).is_none_or(|(value, limit)| test(value, limit))
        };
        let length = |test: fn(usize, usize) -> bool| {
            let limit = rule.as_u64().map(|limit| limit as usize);
            value.as_array().map(Vec::len).zip(limit).is_none_or(|(length, limit)| test(length, limit))
        };
        let is_right = match keyword.as_str() {
            word if SILENT.contains(&word) => true,
            "$ref" => {
                let (root, schema) = resolve(whole, root, rule.as_str().expect("a reference"));
                check(whole, root, schema, value, path, found);
                true
            }
            "type" => match rule {
                Value::Array(kinds) => kinds.iter().any(|kind| is_of(kind, value)),
                kind => is_of(kind, value),
            },
            "const" => rule == value,
            "enum" => rule.as_array().expect("a list").contains(value),
            "anyOf" => rule.as_array().expect("a list").iter().any(&fits),
            "oneOf" => rule.as_array().expect("a list").iter().filter(|rule| fits(rule)).count() == 1,
            "minimum" => number(|value, limit| value >= limit),
            "maximum" => number(|value, limit| value <= limit),
            "exclusiveMinimum" => number(|value, limit| value > limit),
            "minItems" => length(|length, limit| length >= limit),
            "maxItems" => length(|length, limit| length <= limit),
            "pattern" => {
                assert_eq!(rule, "[0-9]", "the one pattern that this validator knows");
                value.as_str().is_none_or(|text| text.contains(|c: char| c.is_ascii_digit()))
            }
            "items" => {
                for (k, item) in value.as_array().into_iter().flatten().enumerate() {
                    check(whole, root, rule, item, &format!("{path}/{k}"), found);
                }
                true
            }
            "properties" => {
                for (key, rule) in rule.as_object().expect("an object") {
                    if let Some(value) = value.get(key) {
                        check(whole, root, rule, value, &format!("{path}/{key}"), found);
                    }
                }
                true
            }
            "required" => {
                let has = |key: &Value| value.get(key.as_str().expect("a key")).is_some();
                !value.is_object() || rule.as_array().expect("a list").iter().all(has)
            }
            "additionalProperties" => {
                assert_eq!(rule, false);
                let known = schema["properties"].as_object().expect("properties");
                value.as_object().is_none_or(|value| value.keys().all(|key| known.contains_key(key)))
            }
            _ => false,
        };
        if !is_right {
            found.push(format!("{path}: {keyword}"));
        }
    }
}

fn is_of(kind: &Value, value: &Value) -> bool {
    match kind.as_str().expect("a type") {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "number" => value.is_number(),
        "integer" => value.as_f64().is_some_and(|value| value.fract() == 0.0),
        other => panic!("no type: {other}"),
    }
}
