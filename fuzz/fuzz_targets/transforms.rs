//! Any text is a list of finite cameras or a message with the place.
#![no_main]

use hybank_ibr::camera::transforms::parse_transforms;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    match parse_transforms(text, Path::new("fuzz")) {
        Ok(file) => {
            for camera in file.frames.iter().filter_map(|frame| file.camera(frame, (9, 7)).ok()) {
                assert!(camera.camera.matrix().iter().all(|v| v.is_finite()));
            }
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz")),
    }
});
