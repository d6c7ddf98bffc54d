//! Any text is a scene or a message, and a scene without its files is refused, never a panic.
#![no_main]

use hybank_ibr::scene::{LoadOptions, load, parse};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    // No file lies in a folder of this name, so that nothing of the machine is read.
    let path = Path::new("/nonexistent-folder-of-the-fuzzer/fuzz.toml");
    match parse(text, path) {
        Ok(spec) if text.contains("..") || text.contains('/') => drop(spec),
        Ok(spec) => {
            let missing = load(&spec, path, &LoadOptions::default()).expect_err("no file");
            assert!(!missing.to_string().is_empty());
        }
        Err(error) => assert!(error.to_string().contains("fuzz.toml")),
    }
});
