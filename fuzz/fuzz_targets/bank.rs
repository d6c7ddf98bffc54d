//! Any text is a bank or a message, and a bank writes and reads back equal.
#![no_main]

use hybank::bank::Bank;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match Bank::from_json(text, "fuzz.json") {
        Ok(bank) => {
            let written = bank.to_json().expect("a bank that was read can be written");
            assert_eq!(Bank::from_json(&written, "written.json").as_ref(), Ok(&bank));
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.json: ")),
    }
});
