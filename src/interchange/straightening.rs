//! The nonlinearities of converters taken out of integer samples: a table with a word for each code.

use super::ExportError;
use super::bit_true::Range;
use crate::bank::Bank;
use crate::runtime::Nonlinearity;

/// Bits of a word below a step of the samples. Rounding to them adds 1/64 of the noise of the samples' own
/// rounding, 0.07 dB.
pub(super) const GUARD_BITS: u32 = 3;

/// Most bits of the samples of a model: 65,536 words per converter.
const MOST_BITS: u32 = 16;

/// Most bits of the samples of a circuit: 16,384 words, some blocks of memory of an FPGA.
const MOST_BITS_OF_CIRCUIT: u32 = 14;

/// Words of the samples of a frame without the nonlinearity of their converters.
#[derive(Debug, Clone)]
pub(super) struct Straightening {
    /// Bits of the codes.
    code_bits: u32,
    /// Bits of the words.
    pub(super) word_bits: u32,
    /// The table of each converter, from the least code on; none of a straight one.
    pub(super) tables: Vec<Option<Vec<i64>>>,
    /// The converter of each sample of a frame.
    pub(super) converters: Vec<usize>,
}

impl Straightening {
    /// Of a bank whose samples have so many bits; `None` for straight converters.
    ///
    /// # Errors
    /// [`ExportError::TableBits`] for more bits than a table has.
    pub(super) fn new(bank: &Bank, code_bits: u32) -> Result<Option<Self>, ExportError> {
        if bank.is_straight() {
            return Ok(None);
        }
        check_bits(code_bits, MOST_BITS)?;
        let tables: Vec<Option<Vec<i64>>> = bank
            .nonlinearity
            .iter()
            .map(|curve| (!curve.is_straight()).then(|| table(curve, code_bits)))
            .collect();
        let word_bits =
            |table: &Vec<i64>| table.iter().map(|word| Range::from(i128::from(*word)).bits()).max();
        let widest = tables.iter().flatten().filter_map(word_bits).max().unwrap_or(0);
        let converters = bank.layout().iter().map(|sample| sample.converter).collect();
        Ok(Some(Self { code_bits, word_bits: widest.max(code_bits + GUARD_BITS), tables, converters }))
    }

    /// Refuses more words than a circuit has place for.
    pub(super) fn check_circuit(&self) -> Result<(), ExportError> {
        check_bits(self.code_bits, MOST_BITS_OF_CIRCUIT)
    }

    /// The word of a code of this sample of a frame.
    pub(super) fn word(&self, sample: usize, code: i64) -> i64 {
        match &self.tables[self.converters[sample]] {
            Some(table) => table[(code + (1 << (self.code_bits - 1))) as usize],
            None => code << GUARD_BITS,
        }
    }

    /// The code whose word is nearest to this one.
    pub(super) fn code(&self, sample: usize, word: i64) -> i64 {
        let all = codes(self.code_bits);
        all.min_by_key(|code| (self.word(sample, *code) - word).abs()).unwrap_or(0)
    }

    /// Bits of all tables.
    pub(super) fn bits(&self) -> usize {
        self.tables.iter().flatten().map(|table| table.len() * self.word_bits as usize).sum()
    }
}

fn check_bits(bits: u32, most: u32) -> Result<(), ExportError> {
    if bits <= most { Ok(()) } else { Err(ExportError::TableBits { bits, most }) }
}

/// All codes of so many bits.
pub(super) fn codes(bits: u32) -> std::ops::Range<i64> {
    -1 << (bits - 1)..1 << (bits - 1)
}

fn table(curve: &Nonlinearity, bits: u32) -> Vec<i64> {
    let full_scale = f64::from(bits - 1).exp2();
    let steps = f64::from(GUARD_BITS).exp2() * full_scale;
    let word = |x: f64| ((x - curve.at(x)) * steps).round() as i64;
    codes(bits).map(|code| word(code as f64 / full_scale)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// T_2(x) = 2 x^2 - 1 by hand, of codes of 3 bits in steps of an eighth.
    #[test]
    fn a_word_is_the_code_without_its_curve() {
        let mut bank = super::super::tests::integers(4, vec![vec![1, 2], vec![3, 4]]);
        bank.nonlinearity[1] = Nonlinearity::Polynomial(vec![0.0625]);
        let straight = Straightening::new(&bank, 3).unwrap().unwrap();
        let by_hand = |code: i64| {
            let x = code as f64 / 4.0;
            ((x - 0.0625 * (2.0 * x * x - 1.0)) * 32.0).round() as i64
        };
        assert!(codes(3).all(|code| straight.word(1, code) == by_hand(code)));
        assert!(
            codes(3).all(|code| straight.word(0, code) == 8 * code && straight.code(0, 8 * code) == code)
        );
        // -4 / 4 becomes -1.0625, and does not fit 6 bits.
        assert_eq!((straight.word_bits, straight.bits()), (7, 56));
        assert!(straight.check_circuit().is_ok());
        assert!(Straightening::new(&bank, 15).unwrap().unwrap().check_circuit().is_err());
        assert!(matches!(Straightening::new(&bank, 17), Err(ExportError::TableBits { bits: 17, .. })));
    }
}
