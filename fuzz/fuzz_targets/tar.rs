//! Any bytes are an archive or a message with a byte; the files lie inside.
#![no_main]

use hybank::io::tar_files;
use libfuzzer_sys::fuzz_target;
use std::io::Cursor;

fuzz_target!(|bytes: &[u8]| {
    match tar_files(&mut Cursor::new(bytes), "fuzz.sigmf") {
        Ok(files) => assert!(files.iter().all(|file| file.offset + file.size <= bytes.len() as u64)),
        Err(error) => assert!(error.to_string().contains(": byte ")),
    }
});
