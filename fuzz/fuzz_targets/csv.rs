//! Any bytes are a table of samples or a message with a line; the frames are the same for every buffer.
#![no_main]

use hybank::io::table::{TableOptions, TableReader};
use libfuzzer_sys::fuzz_target;
use std::io::Read;

/// Bytes of frames that are compared: lines may be missing for a long time.
const MOST: usize = 1 << 20;

fn frames(bytes: &[u8], most: usize) -> Option<Vec<u8>> {
    let mut reader = TableReader::new(bytes, "fuzz.csv", &TableOptions::default()).ok()?;
    let (mut all, mut some) = (Vec::new(), vec![0; most]);
    loop {
        match reader.read(&mut some) {
            Err(error) => {
                let kind = "fuzz.csv: not a table of samples that can be read: line ";
                assert!(error.to_string().starts_with(kind));
                return None;
            }
            Ok(0) => break,
            _ if all.len() > MOST => return None,
            Ok(count) => all.extend(&some[..count]),
        }
    }
    assert!(all.len() % reader.header().frame_bytes() == 0);
    Some(all)
}

fuzz_target!(|bytes: &[u8]| assert_eq!(frames(bytes, 1), frames(bytes, 7)));
