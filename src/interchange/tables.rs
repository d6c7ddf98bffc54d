//! Text tables: comma-separated values, and memory images of integer taps.

use super::ExportError;
use super::bit_true::IntegerFilters;
use super::layout::PolyphaseTaps;
use crate::bank::{Bank, FixedPoint, SynthesisFilters};
use crate::spec::WordLengths;
use std::fmt::Write;

/// One coefficient a line, with a line of headings.
pub(super) fn csv(bank: &Bank) -> String {
    match &bank.filters {
        SynthesisFilters::Fir(taps) => taps_table(bank, &PolyphaseTaps::new(taps, bank.ratio)),
        SynthesisFilters::StateSpace(block) => {
            let matrices = [("a", &block.a), ("b", &block.b), ("c", &block.c), ("d", &block.d)];
            let mut text = offsets(bank) + "matrix,row,column,value\n";
            for (name, rows) in matrices {
                for (i, row) in rows.iter().enumerate() {
                    let lines =
                        row.iter().enumerate().map(|(j, value)| format!("{name},{i},{j},{value:e}\n"));
                    text.extend(lines);
                }
            }
            text
        }
    }
}

fn taps_table(bank: &Bank, taps: &PolyphaseTaps<f64>) -> String {
    let integers = bank.fixed_point.as_ref().map(|words| PolyphaseTaps::new(&words.integers, bank.ratio));
    let mut text = offsets(bank) + "channel,phase,lag,value";
    text += if integers.is_some() { ",integer\n" } else { "\n" };
    for (i, p, j) in entries(taps) {
        text += &format!("{},{p},{j},{:e}", i + 1, taps.get(i, p, j));
        text += &integers.as_ref().map(|words| format!(",{}", words.get(i, p, j))).unwrap_or_default();
        text.push('\n');
    }
    text
}

/// A comment for each channel whose samples have an offset, which the coefficients do not subtract.
pub(super) fn offsets(bank: &Bank) -> String {
    let line = |(offset, channel): (&f64, usize)| {
        format!("# subtract {offset:e} of full scale from the samples of channel {channel}\n")
    };
    bank.offsets.iter().zip(1..).filter(|(offset, _)| **offset != 0.0).map(line).collect()
}

/// (channel, phase, lag) in the order of all formats.
fn entries<T>(taps: &PolyphaseTaps<T>) -> impl Iterator<Item = (usize, usize, usize)> + use<T> {
    let (channels, ratio, lags) = (taps.channels, taps.ratio, taps.lags);
    (0..channels).flat_map(move |i| (0..ratio).flat_map(move |p| (0..lags).map(move |j| (i, p, j))))
}

/// A coefficient file of Xilinx tools, decimal.
pub(super) fn coe(bank: &Bank, input_bits: Option<u32>) -> Result<String, ExportError> {
    let (words, filters) = integers(bank, "COE", input_bits)?;
    let mut text = String::new();
    for line in description(bank, words, &filters, input_bits) {
        let _ = writeln!(text, "; {line}");
    }
    let numbers: Vec<String> = filters.taps.values.iter().map(i64::to_string).collect();
    text += &format!("radix=10;\ncoefdata=\n{};\n", numbers.join(",\n"));
    Ok(text)
}

/// One two's-complement word a line, hexadecimal, as `$readmemh` reads it.
pub(super) fn mem(bank: &Bank, input_bits: Option<u32>) -> Result<String, ExportError> {
    let (words, filters) = integers(bank, "mem", input_bits)?;
    let width = width(words);
    let mut text = String::new();
    for line in description(bank, words, &filters, input_bits) {
        let _ = writeln!(text, "// {line}");
    }
    let mask = u64::MAX >> (64 - width);
    for value in &filters.taps.values {
        let _ = writeln!(text, "{:0digits$x}", *value as u64 & mask, digits = width.div_ceil(4) as usize);
    }
    Ok(text)
}

fn integers<'a>(
    bank: &'a Bank,
    format: &'static str,
    input_bits: Option<u32>,
) -> Result<(&'a FixedPoint, IntegerFilters), ExportError> {
    let words = bank.fixed_point.as_ref().ok_or(ExportError::NoIntegers { format })?;
    let filters = IntegerFilters::new(bank, words, input_bits)?;
    filters.check_sums(input_bits.unwrap_or(32))?;
    Ok((words, filters))
}

/// Bits of the widest tap.
fn width(words: &FixedPoint) -> u32 {
    match &words.bits {
        WordLengths::Same(bits) => *bits,
        WordLengths::PerTap(bits) => bits.iter().copied().max().unwrap_or(1).max(1),
    }
}

fn description(
    bank: &Bank,
    words: &FixedPoint,
    filters: &IntegerFilters,
    input_bits: Option<u32>,
) -> Vec<String> {
    let PolyphaseTaps { channels, ratio, lags, .. } = filters.taps;
    let mut lines = vec![
        format!(
            "hybank: {channels} channels x {ratio} phases x {lags} lags, lags fastest; latency {} (output samples)",
            bank.latency
        ),
        format!(
            "integers of {} bits times 2^{}, {} not zero",
            width(words),
            -words.fraction_bits,
            filters.taps.nonzero()
        ),
    ];
    if let Some(bits) = input_bits.filter(|_| filters.has_offsets()) {
        let list = |numbers: &[i64]| numbers.iter().map(i64::to_string).collect::<Vec<_>>().join(" ");
        let (constants, resting) = (list(&filters.constants), list(&filters.resting));
        lines.push(format!(
            "offsets, for samples of {bits} bits: subtract from the sums of the phases {constants}"
        ));
        lines.push(format!("and begin with samples of the channels that are {resting}"));
    }
    lines
}
