//! Any text says what was lost, or is refused with its line.
#![no_main]

use hybank::io::LostSamples;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Err(error) = LostSamples::parse(text, "fuzz.jsonl") {
        assert!(error.to_string().starts_with("fuzz.jsonl: line "));
    }
});
