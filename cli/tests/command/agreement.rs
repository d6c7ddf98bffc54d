//! `fuse` says whether the captures agree with the bank.

use crate::support::{Desk, text, wav};

/// Two converters of 24 kHz, as in README.
const SPEC: &str = "fast_rate = \"48 kS/s\"\nratio = 2\nlatency = 12\n[target]\n\
                    filter = { family = \"butterworth\", order = 4, cutoff = \"9 kHz\" }\n\
                    [[channel]]\ndelay = \"25 us\"\n[[channel]]\ndelay = \"12.5 us\"\n[design]\nmethod = \"fir\"\ntaps = 24\n";

/// With the captures of a chirp of two seconds.
fn desk(length: &str) -> Desk {
    let desk = Desk::with_spec(SPEC);
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    let chirp = format!("chirp:50Hz..8kHz@{length}");
    desk.good(&[
        "simulate",
        "spec.toml",
        "--source",
        &chirp,
        "-o",
        "cap",
        "--noise",
        "1e-3",
        "--gain",
        "0.5",
    ]);
    desk
}

/// Writes the second capture again, and fuses; gives standard output and standard error.
fn fused(desk: &Desk, change: impl Fn(Vec<f32>) -> Vec<f32>) -> (String, String) {
    let (_, samples) = wav::read(&desk.path("cap/ch2.wav"));
    wav::write(desk, "other.wav", 1, 24_000, &change(samples));
    let args = ["fuse", "bank.json", "cap/ch1.wav", "other.wav", "-o", "y.wav", "--force"];
    let output = desk.run(&args, &[]);
    assert!(output.status.success(), "{output:?}");
    (text(&output.stdout), text(&output.stderr))
}

#[test]
fn captures_of_the_bank_agree_and_the_end_says_what_was_written() {
    let desk = desk("2s");
    let out = desk.good(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "y.wav"]);
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines.len(), 2, "{out}");
    assert!(lines[0].starts_with("y.wav: 96000 samples at 48 kS/s = 2 s, peak 0.5"), "{out}");
    assert!(lines[0].ends_with("dBFS), none clipped"), "{out}");
    assert!(lines[1].starts_with("the captures agree with the spec"), "{out}");
    let report = desk.json(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "z.wav", "--json"]);
    assert!((0.5..0.6).contains(&report["peak"].as_f64().unwrap()), "{report}");
    assert!(report["captures"].as_str().unwrap().starts_with("the captures agree"), "{report}");
    // Samples on standard output stay alone.
    let output = desk.run(&["fuse", "bank.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "-"], &[]);
    assert!(output.status.success() && output.stderr.is_empty() && !output.stdout.ends_with(b"power\n"));
}

#[test]
fn silence_polarity_gain_and_starts_are_told_with_their_remedy() {
    let desk = desk("4s");
    let late = |samples: usize| {
        move |mut x: Vec<f32>| {
            x.drain(..samples);
            x
        }
    };
    type Damage<'a> = &'a dyn Fn(Vec<f32>) -> Vec<f32>;
    let cases: [(Damage<'_>, &[&str]); 5] = [
        (&|x| vec![0.0; x.len()], &["channel 2 has no signal", "check its cable"]),
        (&|x| x.iter().map(|x| -x).collect(), &["channel 2 is inverted", "swap its leads"]),
        (&|x| x.iter().map(|x| 0.5 * x).collect(), &["the gain of channel 2 is 0.5", "write `gain = 0.5"]),
        (&late(7), &["channel 2 began 7 samples (291.667 us) after the others", "cut the first 7 samples"]),
        (
            &late(29_520),
            &["channel 2 began 29520 samples (1.23 s) after the others", "of the other channels"],
        ),
    ];
    for (change, words) in cases {
        let (out, warnings) = fused(&desk, change);
        for word in words {
            // The shorter capture is named too.
            assert!(warnings.contains(word), "{words:?}: {warnings}");
        }
        assert!(out.ends_with("see the warning\n"), "{words:?}: {out}");
    }
    let args = ["fuse", "bank.json", "cap/ch1.wav", "other.wav", "-o", "no.wav", "--strict"];
    fused(&desk, |x| x.iter().map(|x| -x).collect());
    desk.refused(1, &args, &["channel 2 is inverted", "because of --strict"]);
}

#[test]
fn captures_that_cannot_tell_are_not_doubted() {
    let desk = desk("2s");
    // Silence everywhere, few frames, and a tone: one may be shifted by whole periods.
    for (source, samples, said) in [
        ("step@10s", "20000", "the captures hold no signal"),
        ("chirp:50Hz..8kHz@2s", "1600", "fewer than 1024 frames"),
        ("tones:1kHz", "20000", "the captures agree"),
        ("tones:23.3kHz", "20000", "the captures"),
        ("tones:440Hz,3.1kHz,9.7kHz", "40000", "the captures agree"),
    ] {
        let simulate =
            ["simulate", "spec.toml", "--source", source, "--samples", samples, "-o", "t", "--force"];
        desk.good(&simulate);
        let out = desk.good(&["fuse", "bank.json", "t/ch1.wav", "t/ch2.wav", "-o", "t.wav", "--force"]);
        assert!(out.contains(said), "{source}: {out}");
    }
}
