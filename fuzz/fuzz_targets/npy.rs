//! Any bytes are the header of an array of samples or a message.
#![no_main]

use hybank::io::npy_header;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match npy_header(&mut &bytes[..], "fuzz.npy") {
        Ok(header) => {
            assert!(header.sample_bytes() > 0 && header.offset <= bytes.len() as u64);
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.npy: ")),
    }
});
