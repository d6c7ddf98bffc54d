//! Any bytes are the header of an array of samples or a message.
#![no_main]

use hybank::io::NpyHeader;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match NpyHeader::read(&mut &bytes[..], "fuzz.npy") {
        Ok(header) => {
            assert!(header.channels > 0 && header.offset <= bytes.len() as u64);
            assert_eq!(header.data_bytes() % header.stream_header().frame_bytes() as u64, 0);
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.npy: ")),
    }
});
