//! Any two texts, parted by a line of dashes, are a model of finite cameras or a message with the place.
#![no_main]

use hybank_ibr::camera::colmap::parse_model;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    let (cameras, images) = text.split_once("\n---\n").unwrap_or((text, ""));
    match parse_model(cameras, images, Path::new("fuzz")) {
        Ok(model) => {
            for camera in model.frames.iter().filter_map(|frame| model.camera(frame, (9, 7)).ok()) {
                assert!(camera.camera.matrix().iter().all(|v| v.is_finite()));
            }
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz")),
    }
});
