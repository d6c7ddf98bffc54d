//! Any text is the metadata of a recording or a message; what was read writes and reads back equal.
#![no_main]

use hybank::io::SigmfMeta;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    match SigmfMeta::parse(text, "fuzz.sigmf-meta") {
        Ok(meta) => {
            assert!(meta.format("fuzz.sigmf-meta").is_ok());
            let written = serde_json::to_string(&meta).expect("metadata can be written");
            assert_eq!(SigmfMeta::parse(&written, "written").expect("and read"), meta);
        }
        Err(error) => assert!(error.to_string().starts_with("fuzz.sigmf-meta: ")),
    }
});
