//! The ready specs and banks in `filters/`: each spec designs, each bank keeps its promise.

use crate::support::designed;
use hybank::bank::{Bank, Gamma};
use hybank::design::{self, GammaScale, analyze, analyze_mean, prove};
use hybank::figures::Figures;
use hybank::overview;
use hybank::spec::Spec;
use hybank::verify::verify;
use std::fs;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("filters")
}

/// Every spec in the folder with the bank beside it.
fn pairs() -> Vec<(String, Spec, Bank)> {
    let mut specs: Vec<PathBuf> = fs::read_dir(folder())
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "toml"))
        .collect();
    specs.sort();
    assert!(specs.len() >= 6, "specs are missing: {specs:?}");
    specs
        .iter()
        .map(|path| {
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            let spec = Spec::from_toml(&fs::read_to_string(path).unwrap(), &name).unwrap();
            let text = fs::read_to_string(path.with_extension("json")).unwrap();
            let bank = Bank::from_json(&text, &name).unwrap();
            (name, spec, bank)
        })
        .collect()
}

#[test]
fn each_bank_keeps_the_gamma_in_its_file() {
    let is_searched = trials::is_slow("proofs of the ready banks, searched afresh");
    for (name, spec, bank) in pairs() {
        let promised = bank.gamma.norm.unwrap();
        let gamma = analyze(&bank, &[]).unwrap().gamma;
        assert!((gamma / promised - 1.0).abs() < 1e-9, "{name}: {gamma} instead of {promised}");
        let proved = if is_searched { prove(&bank).unwrap().1 } else { verify(&bank).unwrap() }.upper;
        assert!(proved >= gamma && proved <= promised * (1.0 + 1e-6), "{name}: {proved}, {promised}");
        // The bank is the spec's, whatever defaults were filled in.
        let carried = bank.spec.as_ref().unwrap();
        assert_eq!(carried.design, spec.design, "{name}");
        assert_eq!(carried.channels, spec.channels, "{name}");
        assert_eq!((bank.ratio, Some(bank.latency)), (spec.ratio, spec.latency), "{name}");
    }
}

/// As `hybank design --strict` wants it.
#[test]
fn nothing_is_warned_of() {
    for (name, spec, bank) in pairs() {
        let (mean, scale) = (analyze_mean(&bank).unwrap(), GammaScale::new(&bank, &[]).unwrap());
        let of_bank = overview::warnings(&bank, &mean, &scale, &Figures::new(&bank).unwrap());
        let of_spec = design::warnings(&spec).unwrap();
        assert!(of_bank.is_empty() && of_spec.is_empty(), "{name}: {of_bank:?} {of_spec:?}");
    }
}

#[test]
fn a_fresh_design_agrees() {
    for (name, spec, bank) in pairs() {
        // `verify` proves the bounds of the files. The search for a proof of one of them takes 15 s.
        let designed = designed(&spec).gamma;
        let values = [(designed.norm, bank.gamma.norm), (designed.noncausal, bank.gamma.noncausal)];
        let (norm, lower) = (bank.gamma.norm.unwrap(), designed.lower.unwrap());
        assert!(designed.upper.unwrap() >= norm, "{name}: {designed:?}");
        // Without a proof it has the accuracy of a norm.
        assert!(lower <= norm * (1.0 + Gamma::NORM_ACCURACY), "{name}: {designed:?}");
        for (now, then) in values {
            let (now, then) = (now.unwrap(), then.unwrap());
            assert!((now / then - 1.0).abs() < 1e-6, "{name}: {now} instead of {then}");
        }
    }
}

#[test]
fn each_spec_is_in_the_table() {
    let table = fs::read_to_string(folder().join("README.md")).unwrap();
    for (name, _, bank) in pairs() {
        let row = table.lines().find(|line| line.starts_with(&format!("| `{name}`"))).unwrap_or_else(|| {
            panic!("{name} is not in filters/README.md");
        });
        let gamma = format!("{:.4e}", bank.gamma.norm.unwrap());
        assert!(row.contains(&gamma), "{name}: {gamma} is not in `{row}`");
    }
}
