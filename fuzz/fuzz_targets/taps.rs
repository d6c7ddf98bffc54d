//! Any bytes are taps or a message; the filters are of one length and finite.
#![no_main]

use hybank::interchange::{taps_of_csv, taps_of_npy};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    for taps in [taps_of_csv(bytes), taps_of_npy(bytes)] {
        match taps {
            Ok(taps) => {
                assert!(taps.iter().all(|list| list.len() == taps[0].len()));
                assert!(taps.iter().flatten().all(|tap| tap.is_finite()));
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
});
