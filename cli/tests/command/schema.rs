//! The JSON schemas: every example fits them, and a damaged one does not.

use crate::support::{Desk, THESIS, repository, schema};
use serde_json::{Value, json};

fn schema_of(desk: &Desk, kind: &str) -> Value {
    serde_json::from_str(&desk.good(&["schema", kind])).unwrap()
}

/// The examples of the repository with an extension.
fn examples(extension: &str) -> Vec<(String, String)> {
    let root = repository("");
    let folders = ["filters", "examples/calibrate", "examples/recorders"];
    let paths = folders.iter().flat_map(|folder| std::fs::read_dir(root.join(folder)).unwrap());
    let paths = paths.map(|entry| entry.unwrap().path());
    let wanted = paths.filter(|path| path.extension().is_some_and(|found| found == extension));
    wanted.map(|path| (path.display().to_string(), std::fs::read_to_string(&path).unwrap())).collect()
}

fn damaged(document: &Value, pointer: &str, value: Value) -> Value {
    let mut document = document.clone();
    *document.pointer_mut(pointer).unwrap() = value;
    document
}

#[test]
fn specs_fit_their_schema() {
    let desk = Desk::empty();
    let schema = schema_of(&desk, "spec");
    let specs = examples("toml");
    assert!(specs.len() > 6);
    for (name, text) in &specs {
        let spec: Value = toml::from_str(text).unwrap();
        assert_eq!(schema::faults(&schema, &spec), Vec::<String>::new(), "{name}");
    }
    let good: Value = toml::from_str(THESIS).unwrap();
    assert_eq!(schema::faults(&schema, &good), Vec::<String>::new());
    for (pointer, value) in [
        ("/ratio", json!(0)),
        ("/ratio", json!(2.5)),
        ("/latency", json!("ten")),
        ("/target/filter", json!({ "num": [1.0] })),
        ("/target/filter", json!({ "family": "butterword", "order": 4, "cutoff": 9e3 })),
        ("/channel", json!([])),
        ("/channel/0", json!({ "delay": 1.0, "delay_samples": 1.0 })),
        ("/channel/0", json!({ "dellay": 1.0 })),
        ("/design/method", json!("firr")),
    ] {
        assert!(!schema::faults(&schema, &damaged(&good, pointer, value)).is_empty(), "{pointer}");
    }
    let both = good.as_object().unwrap().iter().map(|(key, value)| (key.clone(), value.clone()));
    let both: Value =
        both.chain([("fast_rate".to_owned(), json!(1.0))]).collect::<serde_json::Map<_, _>>().into();
    assert!(!schema::faults(&schema, &both).is_empty());
}

#[test]
fn banks_fit_their_schema() {
    let desk = Desk::with_spec(THESIS);
    let schema = schema_of(&desk, "bank");
    let mut banks: Vec<Value> =
        examples("json").iter().map(|(_, text)| serde_json::from_str(text).unwrap()).collect();
    for flags in [&["--bits", "8"][..], &["--method", "iir"]] {
        desk.good(&[&["design", "--prove", "spec.toml", "-o", "b.json", "--force"], flags].concat());
        banks.push(desk.read_json("b.json"));
    }
    for bank in &banks {
        assert_eq!(schema::faults(&schema, bank), Vec::<String>::new(), "{}", bank["spec"]["name"]);
    }
    let good = banks.pop().unwrap();
    for (pointer, value) in [
        ("/format", json!("bank")),
        ("/version", json!(2)),
        ("/spec/channel/0", json!({ "dellay": 1.0 })),
        ("/channels/1/delay", json!(-1.0)),
        ("/state_space/a", json!([1.0])),
        ("/gamma/norm", json!("small")),
        ("/fast_period", json!(null)),
    ] {
        assert!(!schema::faults(&schema, &damaged(&good, pointer, value)).is_empty(), "{pointer}");
    }
}

#[test]
fn reports_fit_their_schema() {
    let desk = Desk::with_spec(THESIS);
    let schema = schema_of(&desk, "report");
    for flags in [&[][..], &["--bits", "8"], &["--method", "h2", "--order", "4"]] {
        let report =
            desk.json(&[&["design", "spec.toml", "-o", "b.json", "--force", "--json"], flags].concat());
        assert_eq!(schema::faults(&schema, &report), Vec::<String>::new(), "{flags:?}");
        assert!(!schema::faults(&schema, &damaged(&report, "/gamma", json!(1.0))).is_empty());
    }
}
