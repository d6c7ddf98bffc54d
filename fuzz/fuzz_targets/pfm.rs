//! Any bytes are a float map or a message, and a map is written and read back to the same bits.
#![no_main]

use hybank_ibr::image::pfm;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    match pfm::decode(bytes) {
        Ok(map) => {
            assert_eq!(map.data().len(), map.width() * map.height() * map.channels());
            let back = pfm::decode(&pfm::encode(&map)).expect("a map that was read can be written");
            assert!(map.data().iter().zip(back.data()).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
        Err(reason) => assert!(!reason.is_empty()),
    }
});
