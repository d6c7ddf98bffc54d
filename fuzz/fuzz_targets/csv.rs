//! Any bytes are a table of samples or a message with a line.
#![no_main]

use hybank::io::table::{TableOptions, TableReader};
use libfuzzer_sys::fuzz_target;

/// Frames that are read: lines may be missing for a long time.
const MOST: usize = 1 << 16;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut reader) = TableReader::new(bytes, "fuzz.csv", &TableOptions::default()) else { return };
    let channels = reader.header().channels;
    for _ in 0..MOST {
        match reader.next_frame() {
            Ok(Some(frame)) => assert_eq!(frame.len(), channels),
            Ok(None) => break,
            Err(error) => {
                let kind = "fuzz.csv: not a table of samples that can be read: line ";
                assert!(error.to_string().starts_with(kind));
                break;
            }
        }
    }
});
