//! Any text is a calibration of finite numbers or a message with the place.
#![no_main]

use hybank_ibr::camera::middlebury::parse_calibration;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    match parse_calibration(text, Path::new("fuzz")) {
        Ok(found) => assert!(found.focal > 0.0 && found.offset.is_finite() && found.baseline > 0.0),
        Err(error) => assert!(error.to_string().starts_with("fuzz")),
    }
});
