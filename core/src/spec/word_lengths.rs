//! Word lengths of taps in two's complement.

use serde::{Deserialize, Serialize};

use super::limits::{range, within};
use super::{OneOrEach, SpecProblem};
use crate::messages::Quoted;

/// Most bits of a tap. Such integers are exact in a double and far finer than the error of any bank.
pub const MAX_BITS: u32 = 32;
/// Largest magnitude of `fraction_bits`.
pub const MAX_FRACTION_BITS: i32 = 256;

/// Bits of the taps of a channel as they are stored, sign included.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged, from = "OneOrEach<u32>")]
pub enum WordLengths {
    /// The same for all taps, 2 or more.
    Same(u32),
    /// One for each tap, the same list for every channel. A tap of 0 bits is 0.
    PerTap(Vec<u32>),
}

impl From<OneOrEach<u32>> for WordLengths {
    fn from(bits: OneOrEach<u32>) -> Self {
        match bits {
            OneOrEach::Same(bits) => Self::Same(bits),
            OneOrEach::Each(list) => Self::PerTap(list),
        }
    }
}

impl WordLengths {
    /// Bits of tap `n`; 0 beyond the end of a list.
    pub fn bits(&self, n: usize) -> u32 {
        match self {
            Self::Same(bits) => *bits,
            Self::PerTap(list) => list.get(n).copied().unwrap_or(0),
        }
    }

    /// The least and the largest integer of tap `n`: -2^(b-1) and 2^(b-1) - 1.
    pub fn span(&self, n: usize) -> (i64, i64) {
        match self.bits(n).min(MAX_BITS) {
            0 => (0, 0),
            bits => (-(1 << (bits - 1)), (1 << (bits - 1)) - 1),
        }
    }

    /// The same with `more` bits per tap (fewer if negative), if that is legal.
    #[must_use]
    pub fn widened(&self, more: i32) -> Option<Self> {
        let other = match self {
            Self::Same(bits) => Self::Same(bits.checked_add_signed(more)?),
            Self::PerTap(list) => Self::PerTap(
                list.iter()
                    .map(|&bits| if bits == 0 { Some(0) } else { bits.checked_add_signed(more) })
                    .collect::<Option<_>>()?,
            ),
        };
        other.check(None).is_ok().then_some(other)
    }

    /// Checks the numbers, and the length of a list against that of the filters where it is known.
    pub(crate) fn check(&self, taps: Option<usize>) -> Result<(), SpecProblem> {
        if let Self::PerTap(list) = self {
            check_length(list.len(), taps)?;
        }
        self.check_numbers()
    }

    /// Checks the numbers but not their count.
    pub(super) fn check_numbers(&self) -> Result<(), SpecProblem> {
        let refuse = |bits: u32, rule: String| Err(range(f64::from(bits), "bits", rule));
        match self {
            Self::Same(bits) if !(2..=MAX_BITS).contains(bits) => {
                refuse(*bits, format!("a tap has 2 to {MAX_BITS} bits, its sign among them"))
            }
            Self::Same(_) => Ok(()),
            Self::PerTap(list) => match list.iter().max() {
                Some(&most) if most > MAX_BITS => {
                    refuse(most, format!("a tap has at most {MAX_BITS} bits; 0 leaves it out"))
                }
                Some(&most) if most < 2 => {
                    refuse(most, "at least one tap needs 2 bits or more, its sign among them".into())
                }
                _ => Ok(()),
            },
        }
    }
}

/// The length of a list of bits.
fn check_length(entries: usize, taps: Option<usize>) -> Result<(), SpecProblem> {
    let refuse = |rule: String| Err(range(entries as f64, "entries", rule));
    let each = taps.map_or("each tap".to_owned(), |taps| format!("each of the {taps} taps"));
    if entries == 0 {
        return refuse(format!(
            "the list of bits is empty; give one entry for {each} of a channel, or one number for all"
        ));
    }
    match taps {
        Some(taps) if taps != entries => {
            refuse(format!("a list of bits has one entry for {each} of a channel"))
        }
        _ => Ok(()),
    }
}

impl std::fmt::Display for WordLengths {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Same(bits) => write!(f, "{bits} bits"),
            Self::PerTap(list) => {
                let used = list.iter().filter(|&&bits| bits > 0);
                match (used.clone().min(), used.max()) {
                    (Some(least), Some(most)) if least < most => write!(f, "{least} to {most} bits"),
                    (_, most) => write!(f, "{} bits", most.unwrap_or(&0)),
                }
            }
        }
    }
}

impl std::str::FromStr for WordLengths {
    type Err = String;

    /// `12`, or a list for each tap, `4,6,8,8,6,4`. Ranges are checked with the spec.
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| {
            text.trim().parse::<u32>().map_err(|_| {
                format!("\"{}\" is not a number of bits; give one number, or one for each tap separated by commas", Quoted(text))
            })
        };
        match text.contains(',') {
            true => text.split(',').map(number).collect::<Result<_, _>>().map(Self::PerTap),
            false => number(text).map(Self::Same),
        }
    }
}

/// The exponent of the finest step.
pub(crate) fn check_fraction_bits(fraction_bits: i32) -> Result<(), SpecProblem> {
    let rule = format!(
        "fraction_bits is from -{MAX_FRACTION_BITS} to {MAX_FRACTION_BITS}: taps are integers times 2^-fraction_bits"
    );
    let most = f64::from(MAX_FRACTION_BITS);
    within(fraction_bits.into(), -most..=most, "bits", rule)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_is_that_of_twos_complement() {
        let words = WordLengths::PerTap(vec![0, 1, 2, 8, 32]);
        let spans: Vec<_> = (0..6).map(|n| words.span(n)).collect();
        let i32s = (i64::from(i32::MIN), i64::from(i32::MAX));
        assert_eq!(spans, [(0, 0), (-1, 0), (-2, 1), (-128, 127), i32s, (0, 0)]);
    }

    #[test]
    fn words_are_checked() {
        let list = |list: &[u32]| WordLengths::PerTap(list.to_vec());
        assert!(WordLengths::Same(2).check(None).is_ok() && list(&[0, 32, 1]).check(Some(3)).is_ok());
        for bad in
            [WordLengths::Same(1), WordLengths::Same(33), list(&[1, 0, 1]), list(&[33, 2, 2]), list(&[])]
        {
            assert!(bad.check(None).is_err(), "{bad:?}");
        }
        assert!(list(&[4, 4]).check(Some(3)).is_err());
    }

    #[test]
    fn the_error_of_an_empty_list_states_the_number_of_taps() {
        let problem = |taps| WordLengths::PerTap(vec![]).check(taps).unwrap_err().to_string();
        let (known, open) = (problem(Some(22)), problem(None));
        let parts = ["the list of bits is empty", "each of the 22 taps"];
        assert!(parts.iter().all(|part| known.contains(part)), "{known}");
        assert!(open.contains("the list of bits is empty") && open.contains("each tap"), "{open}");
    }

    #[test]
    fn bits_are_displayed_as_one_number_or_a_range() {
        let text = |list: &[u32]| WordLengths::PerTap(list.to_vec()).to_string();
        assert_eq!(WordLengths::Same(8).to_string(), "8 bits");
        assert_eq!(text(&[8, 8]), "8 bits");
        assert_eq!(text(&[0, 8, 8]), "8 bits");
        assert_eq!(text(&[0, 4, 8]), "4 to 8 bits");
        assert_eq!(text(&[]), "0 bits");
    }

    #[test]
    fn widening_keeps_left_out_taps_out_and_ends_at_the_limits() {
        let words = WordLengths::PerTap(vec![0, 3, 5]);
        assert_eq!(words.widened(-2), Some(WordLengths::PerTap(vec![0, 1, 3])));
        assert_eq!(words.widened(-4), None);
        assert_eq!(WordLengths::Same(31).widened(2), None);
        assert_eq!(WordLengths::Same(3).widened(-1), Some(WordLengths::Same(2)));
    }

    #[test]
    fn a_command_line_gives_one_number_or_a_list() {
        assert_eq!("12".parse(), Ok(WordLengths::Same(12)));
        assert_eq!("4, 6,0".parse(), Ok(WordLengths::PerTap(vec![4, 6, 0])));
        for bad in ["", "x", "4,,5", "-3", "1e3"] {
            assert!(bad.parse::<WordLengths>().is_err(), "{bad}");
        }
    }
}
