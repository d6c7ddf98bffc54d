//! Any bytes are an array of MATLAB or a message, and frames as many as the shape says.
#![no_main]

use hybank::io::open_mat;
use libfuzzer_sys::fuzz_target;
use std::io::{Cursor, Read};

fuzz_target!(|bytes: &[u8]| {
    match open_mat(&mut Cursor::new(bytes), None, "fuzz.mat") {
        Ok(mut array) => {
            let header = array.header();
            let mut frames = Vec::new();
            assert!(array.read_to_end(&mut frames).is_ok());
            assert_eq!(Some(frames.len() as u64), header.promised.map(|n| n * header.frame_bytes() as u64));
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.mat: ")),
    }
});
