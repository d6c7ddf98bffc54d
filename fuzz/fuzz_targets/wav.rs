//! Any bytes are a WAV file or a message; the frames are whole, of the header's size, and the same for every
//! buffer.
#![no_main]

use hybank::io::wav::WavReader;
use libfuzzer_sys::fuzz_target;

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
    let frame = header.frame_bytes();
    let mut all = Vec::new();
    let mut block = vec![0; frame * buffer];
    while let Ok(filled @ 1..) = reader.frames().fill(&mut block) {
        assert_eq!(filled % frame, 0);
        all.extend_from_slice(&block[..filled]);
    }
    assert!(header.data_bytes.is_none_or(|promised| all.len() as u64 <= promised));
    assert!(reader.faults().iter().all(|fault| !fault.to_string().is_empty()));
    Some(all)
}

fuzz_target!(|bytes: &[u8]| assert_eq!(frames(bytes, 1), frames(bytes, 7)));
