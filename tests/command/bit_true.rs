//! `fuse --bit-true` against the exported C and against integers without limits.

use crate::export::{bank, compiled, piped, samples, with_wild_integers};
use crate::support::{Desk, THESIS, number};
use hound::{SampleFormat, WavReader, WavSpec, WavWriter};

/// A desk with a bank of 8-bit taps of wild values, so that sums round and saturate.
fn desk(fraction_bits: i32) -> Desk {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--taps", "22", "--bits", "8"]);
    let designed = with_wild_integers(bank(&desk), fraction_bits);
    desk.write("b.json", designed.to_json().unwrap());
    desk
}

fn captures(desk: &Desk, bits: u16) -> Vec<i32> {
    let most = (1_i64 << (bits - 1)) - 1;
    let mut input: Vec<i32> = samples(2 * 500).iter().map(|x| (x * most as f64) as i32).collect();
    input.extend([most, -most - 1, -most - 1, most, most, most].map(|x| x as i32));
    let spec =
        WavSpec { channels: 2, sample_rate: 8000, bits_per_sample: bits, sample_format: SampleFormat::Int };
    let mut wav = WavWriter::create(desk.path("in.wav"), spec).unwrap();
    input.iter().for_each(|x| wav.write_sample(*x).unwrap());
    wav.finalize().unwrap();
    input
}

fn output(desk: &Desk) -> Vec<i32> {
    WavReader::open(desk.path("out.wav")).unwrap().into_samples::<i32>().map(Result::unwrap).collect()
}

const FUSE: [&str; 6] = ["fuse", "b.json", "in.wav", "-o", "out.wav", "--bit-true"];

#[test]
fn the_model_has_the_bits_of_the_exported_c() {
    for (bits, fraction_bits) in [(16, 7), (24, 6), (32, 9)] {
        let desk = desk(fraction_bits);
        let input = captures(&desk, bits);
        desk.good(&["export", "b.json", "--to", "c", "-o", "bank.h"]);
        if !compiled(&desk, "int32_t", 2, 2) {
            return;
        }
        let c = piped(&desk, input.iter().flat_map(|x| x.to_le_bytes()).collect());
        let most = (1_i64 << (bits - 1)) - 1;
        let c: Vec<i32> = c
            .chunks_exact(4)
            .map(|b| i64::from(i32::from_le_bytes(b.try_into().unwrap())).clamp(-most - 1, most) as i32)
            .collect();
        let report = desk.report(&[&FUSE[..], &["--keep-latency"]].concat());
        assert!(output(&desk) == c, "{bits} bits");
        assert!(number(&report, "/saturated") > 0.0 && number(&report, "/wrapped") == 0.0, "{report}");
        assert_eq!(number(&report, "/bits"), f64::from(bits));
        // The output that is in time with the captures is the same, and goes on with zeros for captures.
        desk.report(&FUSE);
        let shifted = output(&desk);
        assert!(shifted.len() == c.len() && shifted[..c.len() - 10] == c[10..]);
    }
}

/// M output samples for each frame, also where captures are shorter than a latency that is no multiple of M.
#[test]
fn short_captures_give_as_many_samples_as_without_the_model() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--taps", "22", "--bits", "8", "--latency", "9"]);
    for frames in [1, 2, 5, 40] {
        let spec =
            WavSpec { channels: 2, sample_rate: 8000, bits_per_sample: 16, sample_format: SampleFormat::Int };
        let mut wav = WavWriter::create(desk.path("in.wav"), spec).unwrap();
        (0..2 * frames).for_each(|k| wav.write_sample((k * 7919 % 20_000) as i16).unwrap());
        wav.finalize().unwrap();
        desk.good(&[&FUSE[..], &["--force"]].concat());
        let model = output(&desk);
        desk.good(&["fuse", "b.json", "in.wav", "-o", "out.wav", "--bits", "16", "--force"]);
        let floats = output(&desk);
        assert_eq!((model.len(), floats.len()), (2 * frames, 2 * frames));
        assert!(model.iter().zip(&floats).all(|(a, b)| (a - b).abs() <= 1), "{model:?} {floats:?}");
    }
}

/// The sums wrap exactly where they leave the accumulator.
#[test]
fn a_narrow_accumulator_wraps() {
    let desk = desk(0);
    let input = captures(&desk, 16);
    let report = desk.report(&[&FUSE[..], &["--keep-latency", "--accumulator", "20"]].concat());
    let words = bank(&desk).fixed_point.unwrap();
    let mut wrapped = 0;
    let mut want = Vec::new();
    for k in 0..input.len() / 2 {
        for p in 0..2 {
            let term = |i: usize, j: usize| words.integers[i][p + 2 * j] * i64::from(input[2 * (k - j) + i]);
            let sum: i64 = (0..=k.min(10)).flat_map(|j| [term(0, j), term(1, j)]).sum();
            let held = (sum + (1 << 19)).rem_euclid(1 << 20) - (1 << 19);
            wrapped += u32::from(held != sum);
            want.push(held.clamp(-32768, 32767) as i32);
        }
    }
    assert!(output(&desk) == want && wrapped > 10);
    assert_eq!(number(&report, "/wrapped"), f64::from(wrapped));
    // With the bits that the report asks for none wraps, and with one less the worst samples would.
    let largest = (0..2)
        .map(|p| {
            words.integers.iter().map(|q| q.iter().skip(p).step_by(2).map(|q| q.abs()).sum::<i64>()).sum()
        })
        .max()
        .map_or(0, |sum: i64| sum);
    let needed = number(&report, "/needed_accumulator_bits") as u32;
    assert!(largest << 15 <= 1 << (needed - 1) && largest << 15 > 1 << (needed - 2), "{needed}: {largest}");
}

#[test]
fn what_has_no_integers_is_refused() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json"]);
    captures(&desk, 16);
    desk.refused(1, &FUSE, &["b.json", "method = \"fir\" and bits"]);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--bits", "12", "--force"]);
    desk.good(&["simulate", "b.json", "--source", "tones:0.3", "--samples", "100", "-o", "cap"]);
    let floats = ["fuse", "b.json", "cap/ch1.wav", "cap/ch2.wav", "-o", "x.wav", "--bit-true"];
    desk.refused(1, &floats, &["cap/ch1.wav", "f32le", "16, 24 or 32 bits"]);
    desk.refused(2, &[&FUSE[..], &["--bits", "16"]].concat(), &["--bit-true", "--bits"]);
    desk.refused(2, &["fuse", "b.json", "in.wav", "-o", "x.wav", "--accumulator", "40"], &["--bit-true"]);
}
