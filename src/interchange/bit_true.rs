//! Integer taps on integer samples, with the words of hardware.

use super::ExportError;
use super::layout::PolyphaseTaps;
use crate::bank::{Bank, FixedPoint};

/// Bits of the words. Samples and outputs have the same step, 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WordSizes {
    /// Of the accumulator, 2 to 64: sums wrap around in two's complement.
    pub accumulator: u32,
    /// Of the outputs, 2 to 32: they saturate.
    pub output: u32,
}

/// A bank of integer taps as it runs in hardware, and as the exported C has it with words of 64 and 32 bits.
///
/// With the integer taps q and f fraction bits, and all sums exact before they wrap,
///
/// ```text
/// s[kM+p] = sum over j and i of  q_i[p + j M] x_i[k - j]      modulo 2^accumulator
/// y[kM+p] = floor(s 2^-f + 1/2)                               saturated: to the nearest, halves upwards
/// ```
///
/// Nothing but these two steps loses bits.
#[derive(Debug, Clone)]
pub struct BitTrue {
    taps: PolyphaseTaps<i64>,
    fraction_bits: i32,
    words: WordSizes,
    /// The samples of the last `lags` frames, a ring.
    history: Vec<i64>,
    newest: usize,
    wraps: u64,
    saturated: u64,
}

impl BitTrue {
    /// Of a bank with integer taps; the history is zero.
    ///
    /// # Errors
    /// [`ExportError::Words`] for sizes out of range, [`ExportError::NoIntegers`], [`ExportError::Offset`],
    /// [`ExportError::Accumulator`] for taps whose sums of 32-bit samples may not fit 64 bits.
    pub fn new(bank: &Bank, words: WordSizes) -> Result<Self, ExportError> {
        let sizes = [("the accumulator", words.accumulator, 64), ("the outputs", words.output, 32)];
        if let Some((word, bits, most)) =
            sizes.into_iter().find(|(_, bits, most)| !(2..=*most).contains(bits))
        {
            return Err(ExportError::Words { word, bits, most });
        }
        let integers = bank.fixed_point.as_ref().ok_or(ExportError::NoIntegers { format: "bit-true" })?;
        let taps = integer_taps(bank, integers)?;
        let history = vec![0; taps.channels * taps.lags];
        let fraction_bits = integers.fraction_bits;
        Ok(Self { taps, fraction_bits, words, history, newest: 0, wraps: 0, saturated: 0 })
    }

    /// Bits of an accumulator that no sum of samples of so many bits can leave.
    pub fn needed_bits(&self, sample_bits: u32) -> u32 {
        sample_bits + growth_bits(&self.taps)
    }

    /// Takes N samples, one of each channel, and writes M output samples. Further values are left alone.
    pub fn process(&mut self, input: &[i32], output: &mut [i32]) {
        let n = self.taps.channels;
        self.newest = self.newest.checked_sub(1).unwrap_or(self.taps.lags - 1);
        let newest = &mut self.history[self.newest * n..][..n];
        newest.iter_mut().zip(input).for_each(|(slot, x)| *slot = i64::from(*x));
        for (p, y) in output.iter_mut().take(self.taps.ratio).enumerate() {
            let sum = self.wrapped(self.sum(p));
            *y = self.saturated(rounded(sum, self.fraction_bits));
        }
    }

    fn sum(&self, phase: usize) -> i64 {
        let PolyphaseTaps { channels, lags, .. } = self.taps;
        let frame = |j: usize| (self.newest + j) % lags * channels;
        let product = |i: usize, j: usize| self.taps.get(i, phase, j) * self.history[frame(j) + i];
        (0..lags).map(|j| (0..channels).map(|i| product(i, j)).sum::<i64>()).sum()
    }

    /// The sum as the accumulator holds it.
    fn wrapped(&mut self, sum: i64) -> i64 {
        let unused = 64 - self.words.accumulator;
        let held = sum << unused >> unused;
        self.wraps += u64::from(held != sum);
        held
    }

    fn saturated(&mut self, value: i128) -> i32 {
        let most = (1 << (self.words.output - 1)) - 1;
        let held = value.clamp(-most - 1, most);
        self.saturated += u64::from(held != value);
        held as i32
    }

    /// Sums that did not fit the accumulator.
    pub fn wraps(&self) -> u64 {
        self.wraps
    }

    /// Output samples that saturated.
    pub fn saturations(&self) -> u64 {
        self.saturated
    }
}

/// floor(sum 2^-f + 1/2).
fn rounded(sum: i64, fraction_bits: i32) -> i128 {
    let sum = i128::from(sum);
    match fraction_bits {
        // The sum has at most 64 bits.
        bits if bits > 64 => 0,
        bits if bits > 0 => (sum + (1 << (bits - 1))) >> bits,
        bits if bits > -62 => sum << -bits,
        _ => sum.signum() << 62,
    }
}

/// The integers by channel, phase and lag, where sums of 32-bit samples fit 64 bits.
///
/// # Errors
/// [`ExportError::Offset`] and [`ExportError::Accumulator`].
pub(super) fn integer_taps(bank: &Bank, words: &FixedPoint) -> Result<PolyphaseTaps<i64>, ExportError> {
    let nonzero = |(_, offset): &(usize, &f64)| **offset != 0.0;
    if let Some((i, &offset)) = bank.offsets.iter().enumerate().find(nonzero) {
        return Err(ExportError::Offset { channel: i + 1, offset });
    }
    let taps = PolyphaseTaps::new(&words.integers, bank.ratio);
    let sum = largest_sum(&taps);
    if sum >= 1 << 31 { Err(ExportError::Accumulator { sum }) } else { Ok(taps) }
}

/// Bits by which a sum is wider than its samples.
pub(super) fn growth_bits(taps: &PolyphaseTaps<i64>) -> u32 {
    u64::BITS - largest_sum(taps).leading_zeros()
}

/// Largest sum of the moduli of the taps of a phase.
fn largest_sum(taps: &PolyphaseTaps<i64>) -> u64 {
    let of_phase = |p: usize| -> u64 {
        let entries = (0..taps.channels).flat_map(|i| (0..taps.lags).map(move |j| (i, j)));
        entries.map(|(i, j)| taps.get(i, p, j).unsigned_abs()).sum()
    };
    (0..taps.ratio).map(of_phase).max().unwrap_or(0)
}
