//! What a search for the least gamma, or for the least mean square beside it, left open.

use crate::lmi::Outcome;
use serde::Serialize;
use std::fmt;

/// Multiple of the accuracy that a search aims at beyond which its bounds count as apart.
const NOTICEABLE_ACCURACIES: f64 = 20.0;
/// The same of a mean square, relative to it: 0.04 dB, less than a measured SNR shows.
const NOTICEABLE_SQUARE: f64 = 0.01;

/// A search that ended with its bounds apart, before order reduction and rounding to integers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Unfinished {
    /// What was to be least.
    pub objective: Objective,
    /// Its value for the bank found over the lower bound of the search, minus one; infinite for a bound of
    /// zero.
    pub width: f64,
    /// Why it ended.
    pub reason: EndOfSearch,
}

/// What a search makes small.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Objective {
    /// Gamma; over uncertain channels the largest one.
    Gamma,
    /// The mean square of error and noise, among the banks within the margin of gamma.
    MeanSquare,
}

/// Why a search ended before its bounds met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
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
        (width > NOTICEABLE_ACCURACIES * accuracy).then_some(Self {
            objective: Objective::Gamma,
            width,
            reason,
        })
    }

    /// Of the bounds `lower` and `square` of a search for the least mean square.
    pub(super) fn of_mean_square(lower: f64, square: f64, reason: EndOfSearch) -> Option<Self> {
        let width = square / lower - 1.0;
        (width > NOTICEABLE_SQUARE).then_some(Self { objective: Objective::MeanSquare, width, reason })
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
        let objective = match self.objective {
            Objective::Gamma => "gamma",
            Objective::MeanSquare => "the mean square of error and noise",
        };
        if self.width.is_infinite() {
            return write!(f, "the search found no bound below {objective}; it ended because {reason}");
        }
        let width = 100.0 * self.width;
        write!(
            f,
            "{objective} may lie up to {width:.2e} % above the least; the search ended because {reason}"
        )
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
        assert!(open.to_string().contains("gamma may lie up to 1.00e2 % above the least"), "{open}");
        let square = |lower: f64| Unfinished::of_mean_square(lower, 1.0, EndOfSearch::Rounding);
        assert_eq!(square(0.995), None);
        assert!(
            square(0.5).unwrap().to_string().contains("the mean square of error and noise may lie up to")
        );
    }
}
