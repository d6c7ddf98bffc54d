//! Integer taps on integer samples, with the words of hardware.

use super::ExportError;
use super::layout::PolyphaseTaps;
use super::straightening::{GUARD_BITS, Straightening};
use crate::bank::{Bank, FixedPoint};

/// Bits of the words. Samples and outputs have the same step, 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WordSizes {
    /// Of the samples, 2 to 32: 2^(input - 1) is full scale.
    pub input: u32,
    /// Of the accumulator, 2 to 64: sums wrap around in two's complement.
    pub accumulator: u32,
    /// Of the outputs, 2 to 32: they saturate.
    pub output: u32,
}

impl WordSizes {
    /// Refuses sizes out of range.
    pub(super) fn check(self) -> Result<(), ExportError> {
        check_word("the samples", self.input, 32)?;
        check_word("the accumulator", self.accumulator, 64)?;
        check_word("the outputs", self.output, 32)
    }
}

/// A bank of integer taps as it runs in hardware, and as the exported C has it with words of 64 and 32 bits.
///
/// With the integer taps q, f fraction bits, offsets o relative to full scale, B bits of the samples, and
/// all sums exact before they wrap,
///
/// ```text
/// c[p]    = sum over j and i of  q_i[p + j M] o_i 2^(B-1)     rounded to the nearest integer
/// s[kM+p] = sum over j and i of  q_i[p + j M] x_i[k - j]  -  c[p]      modulo 2^accumulator
/// y[kM+p] = floor(s 2^-f + 1/2)                               saturated: to the nearest, halves upwards
/// ```
///
/// Nothing but these steps loses bits. The offsets are subtracted from the sums, where they are exact to
/// 2^-f of a step; subtracted from the samples they would be rounded to whole steps. Samples before the
/// first frame are the offsets, rounded to whole steps.
///
/// Where channels have nonlinearities, x_i is the word of a table: the sample without the curve of its
/// channel, rounded to an eighth of a step. Then 8 x_i stands for x_i in the sums, and f + 3 for f.
///
/// ```
/// use hybank::bank::{Bank, FixedPoint, SynthesisFilters};
/// use hybank::interchange::{BitTrue, WordSizes};
/// use hybank::spec::WordLengths;
/// // The taps 0.75 and -0.5 of one channel.
/// let words = FixedPoint { bits: WordLengths::Same(4), fraction_bits: 2, integers: vec![vec![3, -2]] };
/// let bank = Bank::bare(SynthesisFilters::Fir(words.taps()), 2);
/// let bank = Bank { fixed_point: Some(words), ..bank };
/// let mut integer_bank = BitTrue::new(&bank, WordSizes { input: 8, accumulator: 16, output: 8 })?;
/// // 1.5 is rounded upwards.
/// assert_eq!(integer_bank.filtered(&[2]), [2, -1]);
/// assert_eq!(integer_bank.wraps(), 0);
/// # Ok::<(), hybank::interchange::ExportError>(())
/// ```
#[derive(Debug, Clone)]
pub struct BitTrue {
    pub(super) filters: IntegerFilters,
    /// Of the sums.
    pub(super) fraction_bits: i32,
    pub(super) words: WordSizes,
    pub(super) straightening: Option<Straightening>,
    /// The samples of the last `lags` frames, a ring.
    history: Vec<i64>,
    newest: usize,
    wraps: u64,
    saturated: u64,
}

impl BitTrue {
    /// Of a bank with integer taps, before the first frame.
    ///
    /// # Errors
    /// [`ExportError::Words`] for sizes out of range, [`ExportError::NoIntegers`],
    /// [`ExportError::Accumulator`] for taps whose sums may not fit 64 bits, and
    /// [`ExportError::NothingLeft`] for an accumulator that wraps below the steps of the outputs.
    pub fn new(bank: &Bank, words: WordSizes) -> Result<Self, ExportError> {
        let integers = bank.fixed_point.as_ref().ok_or(ExportError::NoIntegers { format: "bit-true" })?;
        words.check()?;
        let straightening = Straightening::new(bank, words.input)?;
        let guard_bits = if straightening.is_some() { GUARD_BITS } else { 0 };
        let mut filters = IntegerFilters::new(bank, integers, Some(words.input + guard_bits))?;
        if let Some(tables) = &straightening {
            let rest = |(i, word): (usize, &mut i64)| *word = tables.word(i, tables.code(i, *word));
            filters.resting.iter_mut().enumerate().for_each(rest);
        }
        let sample_bits = straightening.as_ref().map_or(words.input, |tables| tables.word_bits);
        filters.check_sums(sample_bits)?;
        let (needed, accumulator) = (filters.needed_bits(sample_bits), words.accumulator);
        let fraction_bits = integers.fraction_bits + guard_bits as i32;
        if accumulator < needed && i64::from(accumulator) <= i64::from(fraction_bits) {
            return Err(ExportError::NothingLeft { accumulator, fraction_bits, needed });
        }
        let history = filters.resting.repeat(filters.taps.lags);
        Ok(Self { filters, fraction_bits, words, straightening, history, newest: 0, wraps: 0, saturated: 0 })
    }

    /// Bits of the samples that the filters take.
    fn sample_bits(&self) -> u32 {
        self.straightening.as_ref().map_or(self.words.input, |tables| tables.word_bits)
    }

    /// Bits of an accumulator that no sum can leave.
    pub fn needed_bits(&self) -> u32 {
        self.filters.needed_bits(self.sample_bits())
    }

    /// The sample of each channel where there is no signal.
    pub fn resting(&self) -> Vec<i32> {
        let code = |(i, word): (usize, &i64)| match &self.straightening {
            Some(tables) => tables.code(i, *word) as i32,
            None => *word as i32,
        };
        self.filters.resting.iter().enumerate().map(code).collect()
    }

    /// The M output samples of each of these frames of N samples, one of each channel.
    pub fn filtered(&mut self, frames: &[i32]) -> Vec<i32> {
        let PolyphaseTaps { channels, ratio, .. } = self.filters.taps;
        let mut outputs = vec![0; frames.len() / channels * ratio];
        let each = frames.chunks_exact(channels).zip(outputs.chunks_exact_mut(ratio));
        each.for_each(|(frame, output)| self.process(frame, output));
        outputs
    }

    /// Takes N samples of so many bits, one of each channel, and writes M output samples.
    fn process(&mut self, input: &[i32], output: &mut [i32]) {
        let PolyphaseTaps { channels: n, lags, .. } = self.filters.taps;
        self.newest = self.newest.checked_sub(1).unwrap_or(lags - 1);
        let newest = &mut self.history[self.newest * n..][..n];
        for (i, (slot, x)) in newest.iter_mut().zip(input).enumerate() {
            let code = i64::from(*x);
            *slot = self.straightening.as_ref().map_or(code, |tables| tables.word(i, code));
        }
        for (p, y) in output.iter_mut().enumerate() {
            let sum = self.wrapped(self.sum(p));
            *y = self.saturated(rounded(sum, self.fraction_bits));
        }
    }

    fn sum(&self, phase: usize) -> i64 {
        let taps = &self.filters.taps;
        let frame = |j: usize| (self.newest + j) % taps.lags * taps.channels;
        let product = |i: usize, j: usize| taps.get(i, phase, j) * self.history[frame(j) + i];
        let sum = (0..taps.lags).map(|j| (0..taps.channels).map(|i| product(i, j)).sum::<i64>());
        sum.sum::<i64>() - self.filters.constants[phase]
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

    /// What a user should know: the sums that did not fit, and the outputs that saturated.
    pub fn warnings(&self) -> Vec<String> {
        let (wraps, saturated) = (self.wraps, self.saturated);
        let (accumulator, needed) = (self.words.accumulator, self.needed_bits());
        let sums = (wraps > 0).then(|| {
            format!("{wraps} sums did not fit the accumulator of {accumulator} bits; {needed} always suffice")
        });
        let outputs = (saturated > 0).then(|| format!("{saturated} output samples saturated"));
        sums.into_iter().chain(outputs).collect()
    }
}

/// Refuses bits of a word outside 2 to `most`.
fn check_word(word: &'static str, bits: u32, most: u32) -> Result<(), ExportError> {
    if (2..=most).contains(&bits) { Ok(()) } else { Err(ExportError::Words { word, bits, most }) }
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

/// The integers that run a bank.
#[derive(Debug, Clone)]
pub(super) struct IntegerFilters {
    pub(super) taps: PolyphaseTaps<i64>,
    /// What the offsets add to the sum of each phase.
    pub(super) constants: Vec<i64>,
    /// The sample of each channel where there is no signal.
    pub(super) resting: Vec<i64>,
}

impl IntegerFilters {
    /// Of a bank with offsets only for samples of so many bits.
    ///
    /// # Errors
    /// [`ExportError::Offset`] without these bits, and [`ExportError::Words`].
    pub(super) fn new(bank: &Bank, words: &FixedPoint, input_bits: Option<u32>) -> Result<Self, ExportError> {
        let nonzero = |(_, offset): &(usize, &f64)| **offset != 0.0;
        let full_scale = match (input_bits, bank.offsets.iter().enumerate().find(nonzero)) {
            (None, Some((i, &offset))) => return Err(ExportError::Offset { channel: i + 1, offset }),
            (None, None) => 0.0,
            (Some(bits), _) => {
                check_word("the samples", bits, 32)?;
                2f64.powi(bits as i32 - 1)
            }
        };
        let taps = PolyphaseTaps::new(&words.integers, bank.ratio);
        let steps: Vec<f64> =
            bank.layout().each(&bank.offsets).iter().map(|offset| offset * full_scale).collect();
        // Sums of 62 bits in doubles: their rounding is far below a step of the outputs.
        let constant = |p: usize| {
            let sum: f64 = taps.of_phase(p).map(|(i, tap)| tap as f64 * steps[i]).sum();
            sum.round() as i64
        };
        let constants: Vec<i64> = (0..taps.ratio).map(constant).collect();
        let resting = steps.iter().map(|step| step.round().clamp(-full_scale, (full_scale - 1.0).max(0.0)));
        Ok(Self { resting: resting.map(|x| x as i64).collect(), constants, taps })
    }

    /// Taps with the same sums modulo 2^bits.
    pub(super) fn modulo(&self, bits: u32) -> Self {
        let unused = i64::BITS - bits;
        let mut filters = self.clone();
        filters.taps.values.iter_mut().for_each(|tap| *tap = *tap << unused >> unused);
        filters
    }

    /// The same filters of blocks of frames: a block is one sample of each channel of its first frame, then
    /// those of the next one. A channel of frame r has its impulse response r M fast samples later.
    pub(super) fn of_blocks(&self, frames: usize) -> Self {
        let Self { taps, constants, resting } = self;
        let (ratio, samples) = (taps.ratio, taps.lags * taps.ratio);
        let delayed = |r: usize, i: usize| -> Vec<i64> {
            let own = (0..samples).map(|n| taps.get(i, n % ratio, n / ratio));
            std::iter::repeat_n(0, r * ratio).chain(own).collect()
        };
        let all: Vec<_> = (0..frames).flat_map(|r| (0..taps.channels).map(move |i| delayed(r, i))).collect();
        Self {
            taps: PolyphaseTaps::new(&all, ratio * frames),
            constants: constants.repeat(frames),
            resting: resting.repeat(frames),
        }
    }

    /// Whether the samples have offsets.
    pub(super) fn has_offsets(&self) -> bool {
        self.constants.iter().chain(&self.resting).any(|x| *x != 0)
    }

    /// The least and the largest sum of a phase, of samples of so many bits.
    pub(super) fn sums(&self, phase: usize, sample_bits: u32) -> Range {
        let start = Range::from(-i128::from(self.constants[phase]));
        let product = |(_, tap): (usize, i64)| Range::of_bits(sample_bits).times(tap.into());
        self.taps.of_phase(phase).map(product).fold(start, Range::plus)
    }

    /// Bits of an accumulator that no sum of samples of so many bits can leave.
    pub(super) fn needed_bits(&self, sample_bits: u32) -> u32 {
        (0..self.taps.ratio).map(|p| self.sums(p, sample_bits).bits()).max().unwrap_or(1)
    }

    /// Refuses taps whose sums of samples of so many bits may not fit 64 bits.
    pub(super) fn check_sums(&self, sample_bits: u32) -> Result<(), ExportError> {
        let moduli =
            |p: usize| -> u128 { self.taps.of_phase(p).map(|(_, tap)| u128::from(tap.unsigned_abs())).sum() };
        let of_phase =
            |p: usize| (moduli(p) << (sample_bits - 1)) + u128::from(self.constants[p].unsigned_abs());
        let sum = (0..self.taps.ratio).map(of_phase).max().unwrap_or(0);
        // Rounding adds half of the largest sum at most.
        match sum < 1 << 62 {
            true => Ok(()),
            false => Err(ExportError::Accumulator { sum: (sum >> (sample_bits - 1)) as u64, sample_bits }),
        }
    }
}

/// All values of a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Range {
    pub(super) least: i128,
    pub(super) most: i128,
}

impl Range {
    pub(super) fn of_bits(bits: u32) -> Self {
        Self { least: -(1 << (bits - 1)), most: (1 << (bits - 1)) - 1 }
    }

    /// Bits in two's complement that hold all values.
    pub(super) fn bits(self) -> u32 {
        let magnitude = |x: i128| i128::BITS - (if x < 0 { !x } else { x }).leading_zeros();
        1 + magnitude(self.least).max(magnitude(self.most))
    }

    pub(super) fn plus(self, other: Self) -> Self {
        Self { least: self.least + other.least, most: self.most + other.most }
    }

    pub(super) fn times(self, factor: i128) -> Self {
        let (a, b) = (self.least * factor, self.most * factor);
        Self { least: a.min(b), most: a.max(b) }
    }

    pub(super) fn hull(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), most: self.most.max(other.most) }
    }
}

impl From<i128> for Range {
    fn from(value: i128) -> Self {
        Self { least: value, most: value }
    }
}
