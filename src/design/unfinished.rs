//! What a search for the least gamma left open.

use crate::lmi::Outcome;
use serde::Serialize;
use std::fmt;

/// Multiple of the accuracy that a search aims at beyond which its bounds count as apart.
const NOTICEABLE: f64 = 20.0;

/// A search for the least gamma that ended with its bounds apart, before order reduction and rounding to
/// integers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unfinished {
    /// Gamma of the bank found over the lower bound of the search, minus one; infinite for a bound of zero.
    pub width: f64,
    /// Why it ended.
    pub reason: EndOfSearch,
}

/// Why a search ended before its bounds met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EndOfSearch {
    /// Every round that it may take was taken.
    Rounds,
    /// The interior-point method took every step that it may take.
    Steps,
    /// Rounding errors stopped the interior-point method.
    Rounding,
    /// No peak was left that is not among the frequencies already.
    NoPeak,
    /// The peaks of the error lay between the frequencies that are looked at, again and again.
    MissedPeaks,
    /// Riccati equations at smaller gammas could not be solved.
    Riccati,
}

impl EndOfSearch {
    /// The end of a search whose last problem ended so and has no peak to add.
    pub(super) fn of(outcome: Outcome) -> Self {
        match outcome {
            Outcome::Solved => Self::NoPeak,
            Outcome::IterationLimit => Self::Steps,
            Outcome::SolvedInaccurate | Outcome::NumericalTrouble => Self::Rounding,
        }
    }
}

impl Unfinished {
    /// Of the bounds `lower` and `gamma` of a search for this relative accuracy; `None` if they met.
    pub(super) fn of(lower: f64, gamma: f64, accuracy: f64, reason: EndOfSearch) -> Option<Self> {
        let width = gamma / lower - 1.0;
        (width > NOTICEABLE * accuracy).then_some(Self { width, reason })
    }
}

impl fmt::Display for Unfinished {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = match self.reason {
            EndOfSearch::Rounds => "it took all the rounds that it may take",
            EndOfSearch::Steps => "its interior-point method took all the steps that it may take",
            EndOfSearch::Rounding => "rounding errors stopped its interior-point method",
            EndOfSearch::NoPeak => "no frequency was left to add",
            EndOfSearch::MissedPeaks => "peaks of the error kept lying between its frequencies",
            EndOfSearch::Riccati => "Riccati equations at smaller gammas could not be solved",
        };
        if self.width.is_infinite() {
            return write!(f, "the search found no bound below gamma; it ended because {reason}");
        }
        let width = 100.0 * self.width;
        write!(f, "gamma may lie up to {width:.2e} % above the least; the search ended because {reason}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_that_met_leave_nothing_open() {
        let of = |lower: f64| Unfinished::of(lower, 1.0, 1e-7, EndOfSearch::Rounds);
        assert_eq!(of(1.0), None);
        assert_eq!(of(1.0 - 1e-6), None);
        let open = of(0.5).unwrap();
        assert_eq!((open.width, open.reason), (1.0, EndOfSearch::Rounds));
        assert!(open.to_string().contains("1.00e2 % above the least"), "{open}");
    }
}
