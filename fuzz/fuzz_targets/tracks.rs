//! Any text is a list of tracks or a message with the place.
#![no_main]

use hybank_ibr::uncalibrated::tracks::Tracks;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|text: &str| {
    match Tracks::parse(text, Path::new("fuzz.txt")) {
        Ok(tracks) => {
            assert!(tracks.columns() > 0 && tracks.rows().iter().all(|row| row.len() == tracks.columns()));
            assert!(tracks.rows().iter().flatten().flatten().all(|p| p.x.is_finite() && p.y.is_finite()));
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.txt:")),
    }
});
