//! `fuse` says whether the captures agree with the bank.

use crate::support::{Desk, words};

/// Two converters of 24 kHz, as in README.
const SPEC: &str = "fast_rate = \"48 kS/s\"\nratio = 2\nlatency = 12\n[target]\n\
                    filter = { family = \"butterworth\", order = 4, cutoff = \"9 kHz\" }\n\
                    [[channel]]\ndelay = \"25 us\"\n[[channel]]\ndelay = \"12.5 us\"\n[design]\nmethod = \"fir\"\ntaps = 24\n";

/// With the captures of a chirp of this length.
fn desk(length: &str) -> Desk {
    let desk = Desk::with_spec(SPEC);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    let simulate =
        format!("simulate spec.toml --source chirp:50Hz..8kHz@{length} -o cap --noise 1e-3 --gain 0.5");
    desk.good(&words(&simulate));
    desk
}

#[test]
fn captures_of_the_bank_agree_and_the_end_says_what_was_written() {
    let desk = desk("1s");
    let out = desk.good(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav"]);
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines.len(), 2, "{out}");
    assert!(lines[0].starts_with("y.wav: 48000 samples at 48 kS/s = 1 s, peak 0.5"), "{out}");
    assert!(lines[0].ends_with("dBFS), none clipped"), "{out}");
    assert!(lines[1].starts_with("the captures "), "{out}");
    let report = desk.json(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "z.wav", "--json"]);
    assert!((0.5..0.6).contains(&report["peak"].as_f64().unwrap()), "{report}");
    assert!(report["captures"].as_str().unwrap().starts_with("the captures "), "{report}");
    // Samples on standard output stay alone.
    let output = desk.piped(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "-"], &[]);
    assert!(!output.windows(12).any(|part| part == b"the captures"));
}
