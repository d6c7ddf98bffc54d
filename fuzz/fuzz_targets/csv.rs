//! Any bytes are a table of samples or a message with a line; the frames are the same for every buffer.
#![no_main]

use hybank::io::CsvReader;
use libfuzzer_sys::fuzz_target;

fn frames(bytes: &[u8], most: usize) -> Option<Vec<u64>> {
    let mut reader = CsvReader::new(bytes, "fuzz.csv").ok()?;
    let (mut all, mut some) = (Vec::new(), Vec::new());
    loop {
        if let Err(error) = reader.fill(&mut some, most) {
            assert!(
                error.to_string().starts_with("fuzz.csv: not a table of samples that can be read: line ")
            );
            return None;
        }
        assert!(some.len() % reader.header().channels == 0 && some.len() <= most * reader.header().channels);
        if some.is_empty() {
            return Some(all);
        }
        all.extend(some.iter().map(|x| x.to_bits()));
    }
}

fuzz_target!(|bytes: &[u8]| assert_eq!(frames(bytes, 1), frames(bytes, 7)));
