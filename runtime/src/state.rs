//! The state of a stream as bytes, so that another process can go on from there.
//!
//! Little-endian words of 64 bits: format, position and counts of the stream; digest of the plan, place in
//! the alignment, and numbers of the algorithm as f64, which holds f32 exactly. Only what later outputs
//! depend on is written: two states that agree in the second part have the same future.

use crate::error::StateError;

/// Bytes at the beginning of a state that later outputs do not depend on: the format, and what the stream
/// has counted. Streams whose states agree in all bytes after these give the same bits from there on.
#[doc(hidden)]
pub const STATE_COUNTS: usize = 8 * COUNTS;

/// The format: a name and a version.
const FORMAT: u64 = u64::from_le_bytes(*b"hybank\0\x01");
/// Format, position, samples replaced, resets.
const COUNTS: usize = 4;
/// And the digest, and the place in the alignment.
const HEADER: usize = COUNTS + 3;

/// What a state says beside the numbers of the algorithm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct StateHeader {
    /// Frames since the beginning.
    pub(crate) position: u64,
    pub(crate) replaced: u64,
    pub(crate) resets: u64,
    /// Of the plan.
    pub(crate) digest: [u64; 2],
}

/// How many numbers an algorithm keeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Count {
    /// These are inputs, which are finite.
    pub(crate) inputs: usize,
    /// After them: sums, which may have overflowed.
    pub(crate) sums: usize,
}

/// The numbers of a state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StateNumbers<'a>(&'a [[u8; 8]]);

impl StateHeader {
    /// Appends the header; `alignment` is the plan's.
    pub(crate) fn write(&self, alignment: usize, bytes: &mut Vec<u8>) {
        let [one, two] = self.digest;
        let place = self.position % alignment as u64;
        for word in [FORMAT, self.position, self.replaced, self.resets, one, two, place] {
            bytes.extend_from_slice(&word.to_le_bytes());
        }
    }

    /// The header and the numbers of a state, whose plan has this `digest` and `alignment` and keeps
    /// `count(place)` numbers.
    ///
    /// # Errors
    /// [`StateError`] if they are not all there, or of another plan.
    pub(crate) fn read(
        bytes: &[u8],
        digest: [u64; 2],
        alignment: usize,
        count: impl FnOnce(usize) -> Count,
    ) -> Result<(Self, StateNumbers<'_>), StateError> {
        let (words, rest) = bytes.as_chunks::<8>();
        let (Some((header, numbers)), []) = (words.split_first_chunk::<HEADER>(), rest) else {
            return Err(StateError::NotAState);
        };
        let [format, position, replaced, resets, one, two, place] = header.map(u64::from_le_bytes);
        if format != FORMAT {
            return Err(StateError::NotAState);
        }
        if [one, two] != digest {
            return Err(StateError::OtherPlan);
        }
        if place != position % alignment as u64 {
            return Err(StateError::Damaged);
        }
        let (count, numbers) = (count(place as usize), StateNumbers(numbers));
        let fits = numbers.0.len() == count.inputs + count.sums;
        if !fits || !(0..count.inputs).all(|i| numbers.get(i).is_finite()) {
            return Err(StateError::Damaged);
        }
        Ok((Self { position, replaced, resets, digest }, numbers))
    }

    /// Bytes of a state with so many numbers.
    pub(crate) fn bytes(count: Count) -> usize {
        8 * (HEADER + count.inputs + count.sums)
    }
}

impl StateNumbers<'_> {
    /// The number at a place.
    pub(crate) fn get(&self, place: usize) -> f64 {
        f64::from_le_bytes(self.0[place])
    }
}

/// Tells plans apart: two words that depend on every bit of every word added. Not against forgery.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Digest([u64; 2]);

impl Digest {
    /// Of an algorithm in a number type.
    pub(crate) fn new(name: &str, numbers: &str) -> Self {
        let mut digest = Self([0x243f_6a88_85a3_08d3, 0x1319_8a2e_0370_7344]);
        name.bytes().chain([0]).chain(numbers.bytes()).for_each(|byte| digest.add(byte.into()));
        digest
    }

    pub(crate) fn add(&mut self, word: u64) {
        let [a, b] = self.0;
        self.0 = [mix(a ^ word), mix(b.wrapping_add(word.rotate_left(32)) ^ a)];
    }

    /// A list of numbers with its length.
    pub(crate) fn add_list(&mut self, numbers: &[f64]) {
        self.add(numbers.len() as u64);
        numbers.iter().for_each(|number| self.add(number.to_bits()));
    }

    /// A list of lists with its length.
    pub(crate) fn add_lists(&mut self, lists: &[Vec<f64>]) {
        self.add(lists.len() as u64);
        lists.iter().for_each(|list| self.add_list(list));
    }

    pub(crate) fn words(&self) -> [u64; 2] {
        self.0
    }
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood, *Fast splittable pseudorandom number generators*,
/// 2014).
fn mix(word: u64) -> u64 {
    let word = word.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}
