//! The bank to reduce.

use crate::design::plant::LiftedPlant;
use crate::lti::StateSpace;

/// The quantity that a reduction minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aim {
    /// gamma, the H-infinity norm of the error.
    WorstCase,
    /// The H2 norm of the error.
    MeanSquare,
}

/// A bank to be reduced.
#[derive(Debug, Clone, Copy)]
pub struct ReductionProblem<'a> {
    /// The plant whose error counts.
    pub plant: &'a LiftedPlant,
    /// The full bank.
    pub bank: &'a StateSpace,
    /// States of the full bank in the form that is written.
    pub order: usize,
    /// States per slow period of FIR head: the channels of the written bank. The plant may have fewer,
    /// because equal channels are merged.
    pub width: usize,
    /// The quantity that is minimised.
    pub aim: Aim,
    /// Relative excess of gamma granted to the mean square.
    pub gamma_margin: f64,
}
