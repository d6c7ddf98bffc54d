//! How an iteration ended.

/// How an iteration ended. Bounds, residuals and iterates are returned beside it; a hard problem is not an
/// error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The duality gap is within the tolerance.
    Solved,
    /// No further progress, but the duality gap is within the reduced tolerance.
    SolvedInaccurate,
    /// The iteration limit was reached first; the best iterate and its bounds are returned.
    IterationLimit,
    /// Rounding errors stopped the progress; the best iterate and its bounds are returned.
    NumericalTrouble,
}

impl Outcome {
    /// Whether the duality gap is at most the reduced tolerance.
    pub fn is_solved(self) -> bool {
        matches!(self, Self::Solved | Self::SolvedInaccurate)
    }

    /// The outcome of an iteration; `solved` says whether the gap meets the tolerance and the reduced
    /// tolerance.
    pub(super) fn at_end(solved: [bool; 2], limit_reached: bool) -> Self {
        match solved {
            [true, _] => Self::Solved,
            [false, true] => Self::SolvedInaccurate,
            _ if limit_reached => Self::IterationLimit,
            _ => Self::NumericalTrouble,
        }
    }
}
