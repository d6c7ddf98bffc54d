//! Order reduction: a bank of few states with as small an error as the search finds.
//!
//! The error K = W - F H is affine in the bank F, so replacing F by F_r costs `||(F - F_r) H||`. The states
//! are therefore balanced with the inputs that the plant gives them (frequency-weighted balancing, Enns
//! 1984), not with white noise. The first samples of the response may stay an FIR head, which costs one
//! state per channel and slow period; several splits of the states between head and recursive tail are
//! tried.
//!
//! For given dynamics, the output matrices C and D are optimised again, which is a convex problem
//! (`output_matrices`). The poles are then refined with the output matrices eliminated (`pole_refinement`,
//! variable projection). This last step is a local search: the gamma reported is that of the bank found, not
//! the least of all banks of its order.

mod descent;
mod dynamics;
mod order_search;
mod output_matrices;
mod plant_samples;
mod pole_refinement;
mod problem;
mod trade_off;

pub use problem::{Aim, ReductionProblem};
pub use trade_off::{Figures, OrderErrorPoint, OrderReduction};

use crate::design::DesignError;
use crate::lti::FirWithTail;
use crate::spec::Reduction;
use order_search::OrderSearch;

/// The reduced bank and the order/error trade-off. No bank is returned if the full one is chosen.
///
/// # Errors
/// [`DesignError`] if the bank is not stable or a decomposition fails.
pub fn reduce(
    problem: &ReductionProblem<'_>,
    reduction: Reduction,
) -> Result<(Option<FirWithTail>, OrderReduction), DesignError> {
    let mut search = OrderSearch::new(problem)?;
    let order = match reduction {
        Reduction::Order(order) => search.at_most(order)?,
        Reduction::Loss(db) => search.within(db)?,
    };
    Ok(search.finish(order))
}

#[cfg(test)]
mod tests;
