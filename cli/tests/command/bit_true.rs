//! `fuse --bit-true` against the exported C and against integers without limits.

use crate::export::{bank, compiled, integers_piped, samples, with_wild_integers};
use crate::support::{Desk, THESIS, number, wav};
use hound::WavReader;

/// A desk with a bank of 8-bit taps of wild values, so that sums round and saturate.
fn desk(fraction_bits: i32) -> Desk {
    desk_of(THESIS, fraction_bits)
}

fn desk_of(spec: &str, fraction_bits: i32) -> Desk {
    let desk = Desk::with_spec(spec);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--taps", "22", "--bits", "8"]);
    let designed = with_wild_integers(bank(&desk), fraction_bits);
    desk.write("b.json", designed.to_json().unwrap());
    desk
}

fn captures(desk: &Desk, bits: u16) -> Vec<i32> {
    let most = (1_i64 << (bits - 1)) - 1;
    let mut input: Vec<i32> = samples(2 * 500).iter().map(|x| (x * most as f64) as i32).collect();
    input.extend([most, -most - 1, -most - 1, most, most, most].map(|x| x as i32));
    wav::write_integers(desk, "in.wav", bits, &input);
    input
}

/// What the compiled C gives, in samples of so many bits.
fn by_c(desk: &Desk, input: &[i32], bits: u16) -> Vec<i32> {
    let most = i32::MAX >> (32 - bits);
    integers_piped(desk, input).into_iter().map(|y| y.clamp(-most - 1, most)).collect()
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
        desk.good(&["export", "b.json", "--format", "c", "-o", "bank.h"]);
        if !compiled(&desk, "int32_t", 2, 2) {
            return;
        }
        let c = by_c(&desk, &input, bits);
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

/// Offsets are constants of the sums: the model has the bits of the exported C, and of 128-bit integers.
#[test]
fn offsets_are_subtracted_from_the_sums() {
    let offsets = [0.0123456, -0.2];
    let spec = THESIS.replace("delay = 1.2", &format!("delay = 1.2\noffset = {}", offsets[0]));
    let spec = spec.replace("delay = 0.6", &format!("delay = 0.6\noffset = {}", offsets[1]));
    for (bits, fraction_bits) in [(16, 7), (24, 6), (32, 9)] {
        let desk = desk_of(&spec, fraction_bits);
        let input = captures(&desk, bits);
        let to_c = ["export", "b.json", "--format", "c", "-o", "bank.h"];
        desk.refused(1, &to_c, &["channel 1 has the offset 0.0123456 of full scale", "--input-bits B"]);
        desk.good(&[&to_c[..], &["--input-bits", &bits.to_string()]].concat());
        let report = desk.report(&[&FUSE[..], &["--keep-latency"]].concat());
        let (model, most) = (output(&desk), (1_i128 << (bits - 1)) - 1);
        let words = bank(&desk).fixed_point.unwrap();
        let steps = offsets.map(|offset: f64| offset * (most + 1) as f64);
        let mut want = Vec::new();
        let mut largest = 0;
        for k in 0..input.len() / 2 {
            for p in 0..2 {
                let tap = |i: usize, j: usize| i128::from(words.integers[i][p + 2 * j]);
                let sample = |i: usize, j: usize| match k.checked_sub(j) {
                    Some(k) => i128::from(input[2 * k + i]),
                    None => steps[i].round() as i128,
                };
                let all = || (0..11).flat_map(|j| [(0, j), (1, j)]);
                let constant: f64 = all().map(|(i, j)| tap(i, j) as f64 * steps[i]).sum();
                let sum: i128 = all().map(|(i, j)| tap(i, j) * sample(i, j)).sum();
                let sum = sum - constant.round() as i128;
                largest = largest.max(sum.abs());
                want.push(((sum + (1 << (fraction_bits - 1))) >> fraction_bits).clamp(-most - 1, most) as i32);
            }
        }
        assert!(model == want, "{bits} bits");
        let needed = number(&report, "/needed_accumulator_bits");
        assert!(number(&report, "/wrapped") == 0.0 && 1 + largest.ilog2() < needed as u32, "{report}");
        if compiled(&desk, "int32_t", 2, 2) {
            assert!(by_c(&desk, &input, bits) == want, "{bits} bits");
        }
    }
}

/// M output samples for each frame, also where captures are shorter than a latency that is no multiple of M.
#[test]
fn short_captures_give_as_many_samples_as_without_the_model() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--taps", "22", "--bits", "8", "--latency", "9"]);
    for frames in [1, 2, 5, 40] {
        let input: Vec<i32> = (0..2 * frames).map(|k| k * 7919 % 20_000).collect();
        wav::write_integers(&desk, "in.wav", 16, &input);
        desk.good(&[&FUSE[..], &["--force"]].concat());
        let model = output(&desk);
        desk.good(&["fuse", "b.json", "in.wav", "-o", "out.wav", "--bits", "16", "--force"]);
        let floats = output(&desk);
        assert_eq!((model.len(), floats.len()), (input.len(), input.len()));
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
