//! Order reduction: a bank of few states, by frequency-weighted balanced truncation.
//!
//! The error K = W - F H is affine in the bank F, so replacing F by F_r costs `||(F - F_r) H||`. The states
//! are therefore balanced with the inputs that the plant gives them, and not with white noise: H is the
//! input weight of Enns (*Model reduction with balanced realizations: an error bound and a frequency
//! weighted generalization*, CDC 1984). Without an output weight every truncation is stable.
//!
//! For the recursion that is left, the output matrices C and D are optimised again, which is a convex
//! problem (`plant_samples`). Better poles may exist: the gamma reported is that of the bank found, not the
//! least of all banks of its order.

mod order_search;
mod plant_samples;
mod settings;
mod truncation;

use crate::design::DesignError;
use crate::design::limits::Stop;
use crate::design::plant::LiftedPlant;
use crate::lti::StateSpace;
use hybank_core::spec::Reduction;
use order_search::OrderSearch;

/// The quantity that a reduction minimises.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Aim {
    /// gamma, the H-infinity norm of the error.
    WorstCase,
    /// The H2 norm of the error.
    MeanSquare,
}

/// A bank to be reduced.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ReductionProblem<'a> {
    /// The plant whose error counts.
    pub(crate) plant: &'a LiftedPlant,
    /// The full bank.
    pub(crate) bank: &'a StateSpace,
    /// States of the full bank in the form that is written.
    pub(crate) order: usize,
    /// The quantity that is minimised.
    pub(crate) aim: Aim,
    /// Relative excess of gamma granted to the mean square.
    pub(crate) gamma_margin: f64,
    /// Ends the search with the best banks so far.
    pub(crate) stop: &'a Stop,
}

/// The error of a bank in normalised time (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct ReductionErrors {
    /// gamma = ||K||, the H-infinity norm of the error system.
    pub gamma: f64,
    /// Root mean square of the error per fast sample, `||K||_2 / sqrt(M)`.
    pub rms_error: f64,
}

/// A point of the trade-off between order and error.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OrderErrorPoint {
    /// Number of states.
    pub order: usize,
    /// The error of the best bank found with at most so many states.
    #[serde(flatten)]
    pub figures: ReductionErrors,
    /// Excess over the full bank in decibels of the quantity that the method minimises: gamma (`iir`) or the
    /// mean-square error (`h2`).
    pub loss_db: f64,
}

/// The result of an order search.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct OrderReduction {
    /// The bank of the method, not reduced.
    pub full: OrderErrorPoint,
    /// The bank chosen.
    pub reduced: OrderErrorPoint,
    /// The order/error trade-off: all orders searched, ascending. All orders below the full one where that
    /// is cheap.
    pub orders: Vec<OrderErrorPoint>,
}

/// The reduced bank and the order/error trade-off. No bank is returned if the full one is chosen.
///
/// # Errors
/// [`DesignError`] if the bank is not stable or a decomposition fails.
pub(crate) fn reduce(
    problem: &ReductionProblem<'_>,
    reduction: Reduction,
) -> Result<(Option<StateSpace>, OrderReduction), DesignError> {
    let mut search = OrderSearch::new(problem)?;
    let order = match reduction {
        Reduction::Order(order) => order.min(problem.order),
        Reduction::Loss(db) => search.within(db)?,
    };
    search.around(order)?;
    Ok(search.finish(order))
}

#[cfg(test)]
mod tests;
