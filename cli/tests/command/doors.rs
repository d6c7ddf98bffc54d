//! What instruments and converters write, in its own scale: element types, codes in wider words, I and Q.

use crate::support::{Desk, wav, words};
use hybank::bank::{Bank, SynthesisFilters};
use serde_json::Value;

/// Codes of 12 bits, many of them, some odd.
fn codes() -> Vec<i64> {
    (0..2000).map(|k| (2047.0 * (0.1 * f64::from(k)).sin()).round() as i64).collect()
}

/// With a bank whose output is its input: one of two converters after the other.
fn desk() -> Desk {
    let desk = Desk::empty();
    let taps = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    desk.write_bank("turns.json", &Bank::bare(SynthesisFilters::Fir(taps), 2));
    desk
}

/// The fused samples of one recording in which both converters take turns, and the warnings.
fn fused(desk: &Desk, more: &[&str]) -> (Vec<f32>, Vec<String>) {
    let report = desk.report(&[&["fuse", "turns.json", "-o", "y.wav", "--interleaved", "2"], more].concat());
    let warnings = report["warnings"].as_array().unwrap().iter().map(Value::to_string).collect();
    (wav::samples(desk, "y.wav"), warnings)
}

fn bytes<const B: usize>(codes: &[i64], of: impl Fn(i64) -> [u8; B]) -> Vec<u8> {
    codes.iter().flat_map(|code| of(*code)).collect()
}

#[test]
fn codes_have_the_full_scale_of_the_converter_in_words_of_every_type() {
    let (desk, codes) = (desk(), codes());
    let want: Vec<f32> = codes.iter().map(|code| *code as f32 / 2048.0).collect();
    for (format, words) in [
        ("s16le", bytes(&codes, |x| (x as i16).to_le_bytes())),
        ("s16be", bytes(&codes, |x| (16 * x as i16).to_be_bytes())),
        ("s32le", bytes(&codes, |x| (x as i32).to_le_bytes())),
        ("s32be", bytes(&codes, |x| ((x as i32) << 20).to_be_bytes())),
        ("s64le", bytes(&codes, |x| x.to_le_bytes())),
        ("u16be", bytes(&codes, |x| ((x + 2048) as u16).to_be_bytes())),
        ("u32le", bytes(&codes, |x| ((x + 2048) as u32).to_le_bytes())),
        ("f32le", bytes(&codes, |x| (x as f32).to_le_bytes())),
    ] {
        desk.write("codes.raw", words);
        let (samples, warnings) = fused(&desk, &["codes.raw", "--format", format, "--full-scale", "12bits"]);
        assert!(samples == want, "{format}");
        assert!(warnings.is_empty(), "{format}: {warnings:?}");
    }
}

#[test]
fn words_with_unused_bits_draw_a_warning_and_codes_beyond_are_refused() {
    let (desk, codes) = (desk(), codes());
    desk.write("codes.raw", bytes(&codes, |x| (x as i16).to_le_bytes()));
    let (samples, warnings) = fused(&desk, &["codes.raw", "--format", "s16le"]);
    assert_eq!(samples[5], codes[5] as f32 / 32768.0);
    assert!(warnings.len() == 1 && warnings[0].contains("12bits of words of 16"), "{warnings:?}");
    let refused = words("fuse turns.json codes.raw -o x.wav --interleaved 2 --format s16le");
    let parts = ["codes.raw: frame", "beyond a full scale of 10bits"];
    desk.refused(1, &[&refused[..], &["--full-scale", "10bits"]].concat(), &parts);
}

#[test]
fn pairs_of_channels_are_complex_samples() {
    let desk = desk();
    let pairs: Vec<f32> = (0..400).map(|k| (k as f32 / 400.0) - 0.5).collect();
    wav::write(&desk, "iq.wav", 2, 48_000, &pairs);
    // Both converters see the same receiver here, so each sample comes out twice.
    desk.good(&["fuse", "turns.json", "iq.wav", "iq.wav", "--iq", "-o", "y.wav"]);
    let want: Vec<f32> = pairs.chunks(2).flat_map(|pair| [pair, pair].concat()).collect();
    assert!(wav::samples(&desk, "y.wav") == want);
    wav::write(&desk, "mono.wav", 1, 48_000, &pairs);
    let refused = ["fuse", "turns.json", "mono.wav", "mono.wav", "--iq", "-o", "z.wav"];
    desk.refused(1, &refused, &["mono.wav: 1 channel, but pairs of I and Q"]);
}

#[test]
fn an_output_may_be_an_array() {
    let desk = desk();
    let samples: Vec<f32> = (0..100).map(|k| k as f32 / 128.0).collect();
    wav::write(&desk, "x.wav", 1, 48_000, &samples);
    desk.good(&["fuse", "turns.json", "x.wav", "--interleaved", "2", "-o", "y.npy"]);
    let file = desk.read("y.npy");
    let head = String::from_utf8_lossy(&file[..128]);
    assert!(head.contains("'<f4'") && head.contains("(100,)"), "{head}");
    let numbers: Vec<f32> =
        file[128..].chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    assert!(numbers == samples);
    let refused = ["fuse", "turns.json", "x.wav", "--interleaved", "2", "--bits", "24", "-o", "z.npy"];
    desk.refused(1, &refused, &["NumPy has no type for s24le"]);
}

#[test]
fn recordings_that_begin_at_other_times_are_refused() {
    let desk = desk();
    let bext = |samples: u64| {
        let mut content = vec![0u8; 602];
        content[338..346].copy_from_slice(&samples.to_le_bytes());
        content
    };
    let write = |name: &str, begin: u64| {
        wav::write(&desk, name, 1, 48_000, &[0.25; 100]);
        let plain = desk.read(name);
        let chunk = [b"bext".as_slice(), &602u32.to_le_bytes(), &bext(begin)].concat();
        let mut whole = [&plain[..12], &chunk, &plain[12..]].concat();
        let size = (whole.len() - 8) as u32;
        whole[4..8].copy_from_slice(&size.to_le_bytes());
        desk.write(name, whole);
    };
    write("a.wav", 4800);
    write("b.wav", 4800);
    write("late.wav", 9600);
    desk.good(&["fuse", "turns.json", "a.wav", "b.wav", "-o", "y.wav"]);
    let parts = ["late.wav: its times begin 0.1 s after those of a.wav"];
    desk.refused(1, &["fuse", "turns.json", "a.wav", "late.wav", "-o", "z.wav"], &parts);
}

#[test]
fn recordings_that_are_not_decoded_are_refused_with_a_way_out() {
    let desk = desk();
    for name in ["x.aiff", "x.mp3", "x.sigmf"] {
        desk.write(name, "FORM");
        let parts = [name, "not decoded here", "ffmpeg -i"];
        desk.refused(1, &["fuse", "turns.json", name, "--interleaved", "2", "-o", "y.wav"], &parts);
    }
}

/// Stamps of an uneven clock are used where that is asked for; each converter has its own.
#[test]
fn samples_are_fused_at_their_stamps() {
    let desk = Desk::with_spec(
        "fast_rate = 1000\nratio = 2\n[target]\nfilter = { family = \"butterworth\", order = 2, cutoff = 2000 }\n\
         [signal]\nband = 300\n[[channel]]\ndelay = 0\nbits = 16\n[[channel]]\ndelay = \"1ms\"\nbits = 16\n\
         [design]\nmethod = \"h2\"\ntaps = 48\n",
    );
    desk.good(&["design", "spec.toml", "-o", "bank.json"]);
    // What a filter of 2 kHz delays by a quarter of a millisecond, the target does too.
    let value = |t: f64| 0.4 * (1000.0 * t).sin() + 0.3 * (1700.0 * t + 1.0).cos();
    let table = |late: f64| {
        let line = |k: i32| {
            let t = 2e-3 * (f64::from(k) + late + 0.2 * f64::from(k * k % 7) / 7.0);
            format!("{t:.9},{:.9}\n", value(t))
        };
        "time,x\n".to_owned() + &(0..2000).map(line).collect::<String>()
    };
    desk.write("a.csv", table(0.0));
    desk.write("b.csv", table(0.4));
    let report = desk.report(&["fuse", "bank.json", "a.csv", "b.csv", "--stamps", "-o", "y.wav"]);
    let begin = report["begin"].as_f64().unwrap();
    let fused = &wav::samples(&desk, "y.wav")[..3800];
    let wanted: Vec<f32> = (0..3800).map(|n| value(begin + 1e-3 * f64::from(n)) as f32).collect();
    let snr = wav::snr_db(fused, &wanted, 100);
    assert!(snr > 60.0, "{snr}");
    let refused = ["fuse", "bank.json", "a.csv", "--stamps", "-o", "z.wav"];
    desk.refused(1, &refused, &["2 channels, but the tables have 1 column"]);
    let rare: String =
        (0..200).map(|k| format!("{:.3},{:.3}\n", 0.01 * f64::from(k), value(0.01 * f64::from(k)))).collect();
    desk.write("rare.csv", format!("time,x\n{rare}"));
    let refused = ["fuse", "bank.json", "rare.csv", "rare.csv", "--stamps", "-o", "z.wav"];
    desk.refused(1, &refused, &["channel 1 has 100 S/s on average, but the bank is designed for 500 S/s"]);
}
