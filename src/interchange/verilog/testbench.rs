//! A self-checking testbench: frames and the outputs that the bit-true model gives for them.

use super::Verilog;
use crate::bank::{Bank, FixedPoint};
use crate::interchange::ExportError;
use crate::interchange::bit_true::BitTrue;
use crate::interchange::layout::PolyphaseTaps;
use crate::interchange::straightening::codes;
use std::fmt::Write;

/// Random frames of a testbench, at most: simulators take minutes for as many.
pub const MOST_RANDOM_FRAMES: u32 = 1_000_000;

/// Names and texts of the files.
pub(super) fn files(verilog: &Verilog, random: u32) -> Result<Vec<(String, String)>, ExportError> {
    if random > MOST_RANDOM_FRAMES {
        return Err(ExportError::Frames { given: random, most: MOST_RANDOM_FRAMES });
    }
    let mut model = verilog.model.clone();
    let taps = model.filters.taps.clone();
    let (mut input, mut expected, mut files) = (String::new(), String::new(), Vec::new());
    let mut add = |model: &mut BitTrue| {
        let mut frames = frames(&model.filters.taps, model.words.input, &model.resting(), random);
        if model.straightening.is_some() {
            frames.extend(codes(model.words.input).flat_map(|code| vec![code as i32; taps.channels]));
        }
        // A line has the frames of a clock.
        let length = taps.channels * verilog.circuit.frames_per_clock;
        for line in frames.chunks(length) {
            let mut line = line.to_vec();
            line.extend(model.resting().iter().cycle().take(length - line.len()));
            write_line(&mut input, &line);
            write_line(&mut expected, &model.filtered(&line));
        }
        input.lines().count()
    };
    let first = add(&mut model);
    let mut lines = first;
    if let Some(load) = &verilog.load {
        let next = Verilog::new(&other_bank(&verilog.bank), &verilog.name, &verilog.options)?;
        // The history stays.
        model.filters = next.model.filters;
        lines = add(&mut model);
        files.push(("load.mem".to_owned(), load.clone()));
        files.extend(next.load.map(|load| ("next.mem".to_owned(), load)));
    }
    files.push((format!("{}_tb.v", verilog.name), bench(verilog, &taps, first, lines)));
    files.extend([("input.txt".to_owned(), input), ("expected.txt".to_owned(), expected)]);
    Ok(files)
}

/// A bank with other taps, of the same bits, and other offsets.
fn other_bank(bank: &Bank) -> Bank {
    let other = |words: &FixedPoint| {
        let tap = |(n, tap): (usize, &i64)| if words.bits.bits(n) == 0 { 0 } else { !tap };
        let integers =
            words.integers.iter().rev().map(|taps| taps.iter().enumerate().map(tap).collect()).collect();
        FixedPoint { integers, ..words.clone() }
    };
    Bank {
        fixed_point: bank.fixed_point.as_ref().map(other),
        offsets: bank.offsets.iter().map(|offset| 0.25 - offset / 2.0).collect(),
        ..bank.clone()
    }
}

fn write_line(text: &mut String, words: &[i32]) {
    for (k, word) in words.iter().enumerate() {
        let _ = write!(text, "{}{word}", if k == 0 { "" } else { " " });
    }
    text.push('\n');
}

/// Impulses, steps, the worst signs of each phase, and random samples.
fn frames(taps: &PolyphaseTaps<i64>, bits: u32, resting: &[i32], random: u32) -> Vec<i32> {
    let (n, lags) = (taps.channels, taps.lags);
    let (least, most) = ((-1_i64 << (bits - 1)) as i32, ((1_i64 << (bits - 1)) - 1) as i32);
    let mut frames = resting.repeat(lags);
    for (i, extreme) in (0..n).flat_map(|i| [(i, most), (i, least)]) {
        let mut impulse = resting.to_vec();
        impulse[i] = extreme;
        frames.extend(&impulse);
        frames.extend(resting.repeat(lags));
        frames.extend(impulse.repeat(lags));
        frames.extend(resting.repeat(lags));
    }
    for extreme in [most, least, most] {
        frames.extend(vec![extreme; n * lags]);
    }
    for (p, is_largest) in (0..taps.ratio).flat_map(|p| [(p, true), (p, false)]) {
        let worst = |i: usize, j: usize| if (taps.get(i, p, j) > 0) == is_largest { most } else { least };
        frames.extend((0..lags).rev().flat_map(|j| (0..n).map(move |i| worst(i, j))));
    }
    let mut state = 1_u64;
    frames.extend((0..random as usize * n).map(|_| {
        // Knuth's multiplier; the high bits are the random ones.
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        ((state as i64) >> (64 - bits)) as i32
    }));
    frames
}

/// The testbench of so many lines of frames, of which the first ones belong to the bank that begins.
fn bench(verilog: &Verilog, taps: &PolyphaseTaps<i64>, first: usize, lines: usize) -> String {
    let (words, circuit) = (verilog.model.words, &verilog.circuit);
    let inputs: Vec<String> =
        (1..=taps.channels * circuit.frames_per_clock).map(|i| format!("x{i}")).collect();
    let outputs: Vec<String> = (0..taps.ratio * circuit.frames_per_clock).map(|p| format!("y{p}")).collect();
    let expected: Vec<String> = outputs.iter().map(|y| format!("expected_{y}")).collect();
    // Not every simulator cuts a number that it reads to the bits of a word.
    let read = |names: &[String], after: &str| {
        let names: Vec<String> = names.iter().map(|name| format!("read_{name}{after}")).collect();
        names.join(", ")
    };
    let cut = |names: &[String], bits: u32| read(names, &format!("[{}:0]", bits - 1));
    let mut ports: String = inputs.iter().chain(&outputs).map(|port| format!(", .{port}({port})")).collect();
    if verilog.load.is_some() {
        ports +=
            ", .load_write(load_write), .load_address(load_address), .load_data(load_data), .commit(commit)";
    }
    let ready = if verilog.has_ready {
        ports += ", .in_ready(in_ready)";
        ""
    } else {
        "    assign in_ready = 1'b1;\n"
    };
    let format_of = |names: &[String]| vec!["%d"; names.len()].join(" ");
    let parts = [
        ("NAME", verilog.name.clone()),
        ("FRAMES", lines.to_string()),
        ("SWITCH", first.to_string()),
        ("WORDS", circuit.load_words.to_string()),
        ("ADDRESS_TOP", circuit.load_words.saturating_sub(1).max(1).ilog2().to_string()),
        ("DATA_TOP", circuit.load_data_bits.saturating_sub(1).to_string()),
        ("LATENCY", circuit.latency_clocks.to_string()),
        ("CLOCKS", circuit.clocks_per_frame.to_string()),
        ("INPUT_TOP", (words.input - 1).to_string()),
        ("OUTPUT_TOP", (words.output - 1).to_string()),
        ("INPUT_FORMAT", format_of(&inputs)),
        ("OUTPUT_FORMAT", format_of(&outputs)),
        ("LINES", format_of(&outputs).replace(' ', "\\n")),
        ("READ", read(&[&inputs[..], &outputs].concat(), "")),
        ("READ_INPUTS", read(&inputs, "")),
        ("READ_OUTPUTS", read(&outputs, "")),
        ("CUT_INPUTS", cut(&inputs, words.input)),
        ("CUT_OUTPUTS", cut(&outputs, words.output)),
        ("INPUTS", inputs.join(", ")),
        ("OUTPUTS", outputs.join(", ")),
        ("EXPECTED", expected.join(", ")),
        ("PORTS", ports),
        ("READY", ready.to_owned()),
    ];
    let fill = |text: String, (key, value): &(&str, String)| text.replace(&format!("@{key}@"), value);
    // Some lines are those of a loadable module.
    let line = |line: &'static str| match line.strip_prefix("@LOAD@") {
        Some(line) => verilog.load.is_some().then(|| format!("{line}\n")),
        None => Some(format!("{line}\n")),
    };
    parts.iter().fold(include_str!("testbench.v").lines().filter_map(line).collect(), fill)
}
