//! Any text is a bank or a message, a bank writes and reads back equal, and what is written has its digest.
#![no_main]

use hybank::bank::{Bank, check_digest};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match Bank::from_json(text, "fuzz.json") {
        Ok(bank) => {
            let written = bank.to_json().expect("a bank that was read can be written");
            assert_eq!(Bank::from_json(&written, "written.json").as_ref(), Ok(&bank));
            assert_eq!(check_digest(&written, "written.json"), Ok(true));
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.json: ")),
    }
});
