//! Any text is a measured response or a message; frequencies rise, and small models of it are stable or
//! refused.
#![no_main]

use hybank::analog::fit::{MeasuredResponse, vector_fit};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let text = String::from_utf8_lossy(bytes);
    let read = [
        MeasuredResponse::from_csv(&text),
        MeasuredResponse::from_touchstone(&text, 1, None),
        MeasuredResponse::from_touchstone(&text, 2, Some("S21")),
    ];
    for measured in read {
        match measured {
            Ok(measured) => {
                assert!(measured.points().windows(2).all(|pair| pair[0].0.0 < pair[1].0.0));
                if measured.points().len() < 100 {
                    drop(vector_fit(&measured, 3));
                }
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
});
