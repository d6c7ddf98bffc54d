//! What the samples of an input have been so far: their codes, their range, and how many are at the rails.

use super::{UNUSED_BITS, Word};
use crate::io::InputFault;
use crate::io::block::{Block, Numbers, with_numbers};
use crate::quantity::FullScale;
use crate::runtime::Sample;

/// The codes of words so far, from the middle of their range.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Codes {
    pub(super) least: i64,
    pub(super) most: i64,
    /// The bits that any of them has.
    pub(super) used: u64,
}

impl Codes {
    pub(super) const NONE: Self = Self { least: i64::MAX, most: i64::MIN, used: 0 };

    pub(super) fn take(&mut self, block: &Block, begin: usize, word: Word) {
        let unit = word.amplitude();
        for part in &block.parts {
            with_numbers!(part, numbers => for x in &numbers[begin..] {
                let code = (x.to_f64() * unit) as i64;
                *self = Self { least: self.least.min(code), most: self.most.max(code), used: self.used | code as u64 };
            });
        }
    }

    /// True while no code reaches the uppermost bits of the word.
    pub(super) fn may_leave_bits(self, word: Word) -> bool {
        let reach = 1i64 << (word.bits - UNUSED_BITS);
        word.is_unsigned || (self.least >= -reach && self.most < reach)
    }

    /// All are multiples of 2^`bits`.
    pub(super) fn are_multiples(self, bits: u32) -> bool {
        self.used.trailing_zeros() >= bits
    }

    /// That steps of one use far fewer bits than the word has.
    pub(super) fn unused(self, word: Word) -> Option<InputFault> {
        let middle = word.middle();
        let likely = FullScale::of_codes(self.least as f64 + middle, self.most as f64 + middle)?;
        let (FullScale::Signed(bits) | FullScale::Unsigned(bits)) = likely else { return None };
        let is_odd = !self.are_multiples(1) && word.bits.saturating_sub(bits) >= UNUSED_BITS;
        is_odd.then_some(InputFault::UnusedBits { bits: word.bits, likely })
    }
}

/// The samples so far, of full scale.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seen {
    pub(super) least: f64,
    pub(super) most: f64,
    pub(super) are_whole: bool,
    pub(super) count: u64,
    rails: (f64, f64),
    pub(super) at_rails: u64,
}

impl Seen {
    /// None, of a converter with these rails; floats clip at full scale.
    pub(super) fn new(rails: Option<(f64, f64)>) -> Self {
        let rails = rails.unwrap_or((-1.0, 1.0));
        Self { least: 0.0, most: 0.0, are_whole: true, count: 0, rails, at_rails: 0 }
    }

    pub(super) fn peak(&self) -> f64 {
        self.most.max(-self.least)
    }

    pub(super) fn take(&mut self, part: &Numbers, begin: usize) {
        with_numbers!(part, numbers => self.take_numbers(&numbers[begin..]));
    }

    fn take_numbers<T: Sample>(&mut self, numbers: &[T]) {
        let (low, high) = (T::from_f64(self.rails.0), T::from_f64(self.rails.1));
        let (mut least, mut most) = T::extremes(numbers);
        if least <= low || most >= high {
            let finite = || numbers.iter().copied().filter(|x| x.to_f64().is_finite());
            self.at_rails += finite().filter(|x| *x <= low || *x >= high).count() as u64;
            (least, most) = T::extremes(&finite().collect::<Vec<T>>());
        }
        self.least = self.least.min(least.to_f64());
        self.most = self.most.max(most.to_f64());
        self.count += numbers.len() as u64;
        let is_whole = |x: &T| x.to_f64().fract() == 0.0 || x.to_f64().is_nan();
        self.are_whole = self.are_whole && numbers.iter().all(is_whole);
    }
}
