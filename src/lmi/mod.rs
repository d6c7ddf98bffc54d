//! Interior-point methods for linear matrix inequalities. Knows no filter bank.

mod factor;
pub mod general;
pub mod kyp;
pub mod sampled;
mod step;
#[cfg(test)]
#[allow(unreachable_pub)]
mod testbank;

/// Why an iteration ended. Bounds, residuals and iterates travel beside it in the solver's result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// The proven gap is within the tolerance.
    Solved,
    /// No further progress, but the proven gap is within the reduced tolerance.
    SolvedInaccurate,
    /// The iteration limit came first; the best iterate and honest bounds are returned.
    IterationLimit,
    /// Rounding errors ended the progress; the best iterate and honest bounds are returned.
    NumericalTrouble,
}

impl Stop {
    /// Whether the result is good to at least the reduced tolerance.
    pub fn is_solved(self) -> bool {
        matches!(self, Self::Solved | Self::SolvedInaccurate)
    }
}
