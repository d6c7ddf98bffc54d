//! Interior-point methods for linear matrix inequalities. Knows no filter bank.
//!
//! | module      | problem                                                         | size it is made for |
//! |-------------|-----------------------------------------------------------------|---------------------|
//! | [`sampled`] | least worst-case norm of `W - F H` over sampled frequencies     | 1000 taps, 500 points, seconds |
//! | [`kyp`]     | bounded real lemma with outputs affine in the unknowns          | tens of states in under a second, 160 in minutes |
//! | [`general`] | any LMI: dense, sparse and low-rank blocks, linear inequalities | hundreds of unknowns |
//!
//! `sampled` is the engine of design: its optimum is a proven lower bound for the problem on the whole
//! circle, and with the peaks of the norm added as points it meets the true optimum. `kyp` solves the
//! same problem with a Lyapunov certificate instead of a grid, and proves the norm of a given
//! system. `general` is the reference that both are checked against, and the tool for everything else.
//!
//! All three are primal-dual predictor-corrector methods. None of them fails on a hard problem: each
//! returns its best iterate with honest bounds and says in its outcome how far it got. Where rounding
//! errors set the limit: about 1e-9 of the optimum for `sampled` and `general`, 1e-8 for `kyp`.

mod factor;
pub mod general;
pub mod kyp;
pub mod sampled;
mod step;
#[cfg(test)]
mod testbank;

/// A setting out of its range.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("setting {name} = {value} must lie strictly between 0 and {most}")]
pub struct SettingError {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its exclusive upper limit.
    pub most: f64,
}

/// Refuses tolerances and fractions that no iteration can work with.
fn check_settings(settings: &[(&'static str, f64)]) -> Result<(), SettingError> {
    for &(name, value) in settings {
        if !(value > 0.0 && value < 1.0) {
            return Err(SettingError { name, value, most: 1.0 });
        }
    }
    Ok(())
}

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
