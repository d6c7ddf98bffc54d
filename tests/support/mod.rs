//! What the tests of the library share with those of the program.
// Each test program uses a part of it.
#![allow(dead_code)]

pub(crate) mod specs;
pub(crate) mod wav_file;

pub(crate) use trials::random;

use hybank::bank::{Bank, StateMatrices, SynthesisFilters};
use hybank::design::{Design, DesignError, DesignOptions};
use hybank::spec::Spec;
use serde_json::Value;

/// A design without a search for its proof.
pub(crate) fn design(spec: &Spec) -> Result<Bank, DesignError> {
    hybank::design::design(spec, &DesignOptions::without_proof()).map(|design| design.bank)
}

pub(crate) fn designed(spec: &Spec) -> Bank {
    design(spec).unwrap_or_else(|error| panic!("{error}"))
}

/// A design with the search for its proof.
pub(crate) fn proven(spec: &Spec) -> Design {
    hybank::design::design(spec, &DesignOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// The matrices of a recursive bank.
pub(crate) fn block(bank: &Bank) -> &StateMatrices {
    let SynthesisFilters::StateSpace(block) = &bank.filters else { panic!("taps") };
    block
}

/// The number at a JSON pointer.
pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    let number = value.pointer(pointer).and_then(Value::as_f64);
    number.unwrap_or_else(|| panic!("{pointer} is no number in {value}"))
}
