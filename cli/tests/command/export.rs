//! Exported banks as their users take them: C compiled by the system's compiler, arrays read by NumPy and
//! SciPy.

use crate::support::{Desk, THESIS, number, words};
use hybank::bank::{Bank, SynthesisFilters};
use hybank::interchange::{PolyphaseTaps, sparse_rows};
use std::process::Command;

/// Compiles the header `bank.h` of the desk with a program that pipes samples of `sample` through it.
pub(crate) fn compiled(desk: &Desk, sample: &str, channels: usize, ratio: usize) -> bool {
    let program = format!(
        "#include <stdio.h>\n#include <stdint.h>\n#include \"bank.h\"\n\
         int main(void) {{\n    static bank_state state;\n    {sample} input[{channels}], output[{ratio}];\n    \
         bank_reset(&state);\n    while (fread(input, sizeof *input, {channels}, stdin) == {channels}) {{\n        \
         bank_process(&state, input, output);\n        fwrite(output, sizeof *output, {ratio}, stdout);\n    }}\n    \
         return 0;\n}}\n"
    );
    desk.write("main.c", program);
    let flags = words("-std=c99 -pedantic -Wall -Wextra -Werror -O2 -ffp-contract=off -o run main.c");
    match Command::new("cc").args(flags).current_dir(desk.path("")).output() {
        Ok(output) => {
            assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
            true
        }
        Err(error) => {
            trials::skipped(&format_args!("compiled C code: no C compiler: {error}"));
            false
        }
    }
}

fn piped(desk: &Desk, input: Vec<u8>) -> Vec<u8> {
    desk.write("in.raw", input);
    let stdin = std::fs::File::open(desk.path("in.raw")).unwrap();
    Command::new(desk.path("run")).stdin(stdin).output().unwrap().stdout
}

pub(crate) fn integers_piped(desk: &Desk, input: &[i32]) -> Vec<i32> {
    let output = piped(desk, input.iter().flat_map(|x| x.to_le_bytes()).collect());
    output.chunks_exact(4).map(|b| i32::from_le_bytes(b.try_into().unwrap())).collect()
}

pub(crate) fn bank(desk: &Desk) -> Bank {
    Bank::from_json(&String::from_utf8(desk.read("b.json")).unwrap(), "b.json").unwrap()
}

/// Samples in [-1, 1] without structure.
pub(crate) fn samples(count: usize) -> Vec<f64> {
    (0..count).map(|i| ((i * i * 31 + 7 * i) % 1009) as f64 / 504.5 - 1.0).collect()
}

fn bytes(samples: &[f64]) -> Vec<u8> {
    samples.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn doubles(bytes: &[u8]) -> Vec<f64> {
    bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
}

/// y[kM+p] = sum over j and i, in this order.
fn fir_by_definition<T: Copy + Default + PartialEq, S: Copy + Default + std::ops::AddAssign>(
    taps: &PolyphaseTaps<T>,
    input: &[S],
    product: impl Fn(T, S) -> S,
) -> Vec<S> {
    let n = taps.channels;
    let of = |k: usize, p: usize| {
        let mut sum = S::default();
        for j in 0..taps.lags {
            for i in 0..n {
                let x = if j <= k { input[(k - j) * n + i] } else { S::default() };
                sum += product(taps.get(i, p, j), x);
            }
        }
        sum
    };
    (0..input.len() / n).flat_map(|k| (0..taps.ratio).map(move |p| (k, p))).map(|(k, p)| of(k, p)).collect()
}

fn worst_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The output of `hybank stream` in double precision.
fn streamed(desk: &Desk, input: &[f64]) -> Vec<f64> {
    let args = ["stream", "b.json", "--format", "f64le"];
    doubles(&desk.run(&args, &bytes(input)).stdout)
}

#[test]
fn c_of_real_taps_has_the_bits_of_its_definition() {
    let desk = Desk::with_spec(&THESIS.replace("delay = 1.2", "delay = 1.2\noffset = 0.125"));
    desk.good(&["design", "spec.toml", "-o", "b.json", "--taps", "23"]);
    desk.good(&["export", "b.json", "--format", "c", "-o", "bank.h"]);
    if !compiled(&desk, "double", 2, 2) {
        return;
    }
    let input = samples(2 * 700);
    let got = doubles(&piped(&desk, bytes(&input)));
    let SynthesisFilters::Fir(taps) = bank(&desk).filters else { panic!("taps") };
    let centred: Vec<f64> =
        input.iter().enumerate().map(|(i, x)| if i % 2 == 0 { x - 0.125 } else { *x }).collect();
    let want = fir_by_definition(&PolyphaseTaps::new(&taps, 2), &centred, |tap, x| tap * x);
    assert!(got.iter().zip(&want).all(|(a, b)| a.to_bits() == b.to_bits()) && got.len() == want.len());
    assert!(worst_difference(&got, &streamed(&desk, &input)) < 1e-14);
}

/// The bank with 8-bit taps of all sizes, so that sums round and saturate.
pub(crate) fn with_wild_integers(mut bank: Bank, fraction_bits: i32) -> Bank {
    let words = bank.fixed_point.as_mut().unwrap();
    words.fraction_bits = fraction_bits;
    let taps = words.integers.iter_mut().flatten().enumerate();
    taps.for_each(|(k, tap)| *tap = ((k * 37) % 255) as i64 - 127);
    bank.filters = SynthesisFilters::Fir(words.taps());
    (bank.proof, bank.gamma) = (None, Default::default());
    bank
}

/// Sums of integers are exact, so there is one right output: the nearest integer, halves upwards, saturated.
#[test]
fn c_of_integer_taps_has_no_differing_bit() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--taps", "22", "--bits", "8"]);
    let original = bank(&desk);
    for fraction_bits in [6, 0, -2] {
        let designed = with_wild_integers(original.clone(), fraction_bits);
        desk.write("b.json", designed.to_json().unwrap());
        desk.good(&["export", "b.json", "--format", "c", "-o", "bank.h", "--force"]);
        if !compiled(&desk, "int32_t", 2, 2) {
            return;
        }
        let mut input: Vec<i32> = samples(2 * 900).iter().map(|x| (x * f64::from(1 << 23)) as i32).collect();
        input.extend([i32::MAX, i32::MIN, i32::MIN, i32::MAX, i32::MIN, i32::MIN, i32::MIN, 0]);
        let got = integers_piped(&desk, &input);
        let words = designed.fixed_point.unwrap();
        let wide: Vec<i128> = input.iter().map(|&x| i128::from(x)).collect();
        let sums =
            fir_by_definition(&PolyphaseTaps::new(&words.integers, 2), &wide, |tap, x| i128::from(tap) * x);
        let rounded = |sum: i128| match u32::try_from(words.fraction_bits) {
            Ok(0) => sum,
            Ok(bits) => (sum + (1 << (bits - 1))).div_euclid(1 << bits),
            Err(_) => sum << -words.fraction_bits,
        };
        let want: Vec<i32> =
            sums.into_iter().map(|sum| rounded(sum).clamp(i32::MIN.into(), i32::MAX.into()) as i32).collect();
        assert!(got == want, "{fraction_bits}");
        assert!(want.contains(&i32::MAX) || fraction_bits == 6, "{fraction_bits}: nothing saturates");
    }
}

#[test]
fn c_of_recursive_banks_has_the_bits_of_its_definition() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--method", "iir"]);
    desk.good(&["export", "b.json", "--format", "c", "-o", "bank.h", "--name", "bank"]);
    if !compiled(&desk, "double", 2, 2) {
        return;
    }
    let input = samples(2 * 500);
    let got = doubles(&piped(&desk, bytes(&input)));
    let SynthesisFilters::StateSpace(block) = bank(&desk).filters else { panic!("a recursive bank") };
    let (rows, states) = (sparse_rows(&block), block.a.len());
    let mut x = vec![0.0; states];
    let mut want = Vec::new();
    for u in input.chunks_exact(2) {
        let z = [&x[..], u].concat();
        let row = |k: usize| rows[k].iter().fold(0.0, |sum, &(j, value)| sum + value * z[j]);
        want.extend((0..2).map(|p| row(states + p)));
        x = (0..states).map(row).collect();
    }
    assert!(got.iter().zip(&want).all(|(a, b)| a.to_bits() == b.to_bits()) && got.len() == want.len());
    assert!(worst_difference(&got, &streamed(&desk, &input)) < 1e-12);
}

#[test]
fn scipy_reads_the_arrays() {
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json", "--method", "iir"]);
    desk.good(&["export", "b.json", "-o", "b.mat"]);
    let script = "\
import json, numpy as np, scipy.io
b = json.load(open('b.json'))['state_space']
m = scipy.io.loadmat('b.mat')
for key in 'abcd':
    assert np.array_equal(m[key], b[key]), key
assert m['ratio'].item() == 2
";
    desk.write("read.py", script);
    let probe = Command::new("python3").args(["-c", "import numpy, scipy"]).output();
    if !probe.is_ok_and(|output| output.status.success()) {
        trials::skipped(&"exported arrays in Python: no python3 with numpy and scipy");
        return;
    }
    let output = Command::new("python3").arg("read.py").current_dir(desk.path("")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// What was exported comes back with the gamma that it had, proven again.
#[test]
fn taps_of_other_tools_are_judged() {
    let desk = Desk::with_spec(THESIS);
    let own = desk.json(&["design", "spec.toml", "-o", "b.json", "--json"]);
    desk.good(&["export", "b.json", "--format", "csv", "-o", "taps.csv"]);
    let foreign = desk.json(&["import", "spec.toml", "taps.csv", "-o", "back.json", "--json"]);
    let gamma = |report: &serde_json::Value| number(report, "/gamma/norm");
    assert!((gamma(&own) / gamma(&foreign) - 1.0).abs() < 1e-9, "{foreign}");
    assert!(desk.good(&["verify", "back.json"]).contains("proven"));
    // Nearest samples, as anyone would interleave two converters: gamma is that of the scale.
    desk.write("plain.csv", "a,b\n1,0\n0,1\n");
    let late = ["--latency", "1", "-o", "plain.json", "--json"];
    let plain = desk.json(&[&["import", "spec.toml", "plain.csv"][..], &late].concat());
    assert!((gamma(&plain) / number(&plain, "/scale/interleaving") - 1.0).abs() < 1e-9, "{plain}");
    desk.refused(1, &["import", "spec.toml", "none.csv", "-o", "x.json"], &["none.csv", "cannot read"]);
    desk.write("wrong.csv", "-9,-9\n9,9\n");
    desk.warned(&["import", "spec.toml", "wrong.csv", "-o", "wrong.json"], &["% of that of zero output"]);
    desk.write("open.toml", THESIS.replace("latency = 10\n", ""));
    desk.refused(1, &["import", "open.toml", "taps.csv", "-o", "x.json"], &["open.toml", "give --latency"]);
    desk.write("three.csv", "1,2,3\n");
    desk.refused(1, &["import", "spec.toml", "three.csv", "-o", "x.json"], &["3 filters", "2 channels"]);
    desk.refused(2, &["import", "spec.toml", "taps.txt", "-o", "x.json"], &["taps.txt", ".csv and .npy"]);
    desk.write("bad.csv", "1,2\n3,four\n");
    desk.refused(1, &["import", "spec.toml", "bad.csv", "-o", "x.json"], &["bad.csv", "line 2, column 2"]);
}

/// The sections as a user runs them: each a recursion of its own, their outputs added.
fn by_sections(table: &str, input: &[f64], channels: usize, ratio: usize) -> Vec<f64> {
    let mut output = vec![0.0; input.len() / channels * ratio];
    for line in table.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())) {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let [channel, phase, delay] = [row[0] as usize - 1, row[1] as usize, row[2] as usize];
        let x = |k: usize| input.get(k * channels + channel).copied().unwrap();
        let mut y: Vec<f64> = Vec::new();
        for k in 0..input.len() / channels {
            let past = |back: usize| k.checked_sub(delay + back).map_or(0.0, x);
            let own = |back: usize| k.checked_sub(back).map_or(0.0, |k| y[k]);
            let value =
                row[3] * past(0) + row[4] * past(1) + row[5] * past(2) - row[7] * own(1) - row[8] * own(2);
            y.push(value / row[6]);
        }
        y.iter().enumerate().for_each(|(k, y)| output[k * ratio + phase] += y);
    }
    output
}

#[test]
fn sections_are_the_bank_and_carry_its_gamma() {
    for (spec, flags) in [
        (THESIS.to_owned(), &["--method", "iir"][..]),
        (THESIS.replace("latency = 10", "latency = 7"), &["--method", "h2", "--order", "4"]),
    ] {
        let desk = Desk::with_spec(&spec.replace("delay = 1.2", "delay = 0.9"));
        desk.good(&[&["design", "spec.toml", "-o", "b.json"], flags].concat());
        desk.good(&["export", "b.json", "--format", "sos", "-o", "s.csv"]);
        let table = String::from_utf8(desk.read("s.csv")).unwrap();
        let input = samples(2 * 500);
        let difference = worst_difference(&by_sections(&table, &input, 2, 2), &streamed(&desk, &input));
        assert!(difference < 1e-11, "{flags:?}: {difference:e}");
        let comment = table.lines().next().unwrap();
        let gammas: Vec<f64> = comment
            .split([' ', ';'])
            .filter_map(|word| word.parse().ok().filter(|gamma| *gamma > 0.0))
            .collect();
        assert!((gammas[0] / gammas[1] - 1.0).abs() < 1e-9, "{comment}");
    }
    let desk = Desk::with_spec(THESIS);
    desk.good(&["design", "spec.toml", "-o", "b.json"]);
    let sections = ["export", "b.json", "--format", "sos", "-o", "s.csv"];
    desk.refused(1, &sections, &["b.json", "no poles", "csv and mat"]);
}
