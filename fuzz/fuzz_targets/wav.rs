//! Any bytes are a WAV file or a message; the samples are at most what the header promises, and the same for
//! every buffer.
#![no_main]

use hybank::io::wav::WavReader;
use libfuzzer_sys::fuzz_target;
use std::io::Read;

fn frames(bytes: &[u8], buffer: usize) -> Option<Vec<u8>> {
    let mut reader = match WavReader::new(bytes, "fuzz.wav") {
        Ok(reader) => reader,
        Err(error) => {
            assert!(error.to_string().starts_with("fuzz.wav: "));
            return None;
        }
    };
    let header = reader.header().clone();
    assert!(
        header.channels > 0 && header.rate > 0 && header.layout.container >= header.layout.format.bytes()
    );
    let mut all = Vec::new();
    let mut block = vec![0; header.frame_bytes() * buffer];
    while let Ok(filled @ 1..) = reader.read(&mut block) {
        all.extend_from_slice(&block[..filled]);
    }
    assert!(header.data_bytes.is_none_or(|promised| all.len() as u64 <= promised));
    Some(all)
}

fuzz_target!(|bytes: &[u8]| assert_eq!(frames(bytes, 1), frames(bytes, 7)));
