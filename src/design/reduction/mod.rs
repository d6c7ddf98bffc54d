//! Order reduction: the bank of few states with as small an error as can be found.
//!
//! The error K = W - F H is affine in the bank F, so what a smaller bank costs is ||(F - F_r) H||: the states are balanced as
//! they are driven *through the front ends* (Enns 1984), not by white noise. Of the response the first samples may stay taps of
//! a line of inputs, each of which costs a state a channel; different splits of the states among line and recursion are tried.
//! Truncation alone loses needlessly. What is read from the states left is therefore optimised anew, a convex problem
//! (`readout`), and the poles are moved downhill with the readout eliminated (`poles`). Only the last step is a local search:
//! the gamma that is reported is that of a bank in hand, not the least of all banks of its order.

mod descent;
mod dynamics;
mod poles;
mod readout;
mod walk;

use super::DesignError;
use super::equivalence::BlockedPlant;
use crate::lti::{StateSpace, TappedRecursion};
use crate::spec::Reduction;

pub use poles::Aim;

/// How good a bank is, h = 1.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Figures {
    /// ||K||.
    pub gamma: f64,
    /// `||K||_2 / sqrt(M)`.
    pub rms_error: f64,
}

/// What a number of states is good for.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OrderWorth {
    /// States.
    pub order: usize,
    /// The best bank found of at most so many.
    #[serde(flatten)]
    pub figures: Figures,
    /// By how many decibels it falls behind the full bank, in what the method minimises: gamma (`iir`) or the mean-square
    /// error (`h2`).
    pub loss_db: f64,
}

/// The record of an order reduction.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct OrderReduction {
    /// The bank as the method makes it.
    pub full: OrderWorth,
    /// The bank that was taken.
    pub reduced: OrderWorth,
    /// All orders that were looked at, ascending. All below the full one where that is cheap.
    pub orders: Vec<OrderWorth>,
}

/// A bank to be reduced.
#[derive(Debug, Clone, Copy)]
pub struct Subject<'a> {
    /// The front ends.
    pub plant: &'a BlockedPlant,
    /// The full bank.
    pub bank: &'a StateSpace,
    /// States of the full bank as it is written.
    pub order: usize,
    /// States that a tick of past inputs costs: the channels of the written bank, which may be more than those of the plant.
    pub width: usize,
    /// What is to be small.
    pub aim: Aim,
    /// Relative excess of gamma that may go into the mean square.
    pub gamma_margin: f64,
}

/// The reduced bank, or `None` if the full one is it, and the record.
///
/// # Errors
/// [`DesignError`] if the bank is not stable or a decomposition fails.
pub fn reduce(
    subject: &Subject<'_>,
    wanted: Reduction,
) -> Result<(Option<TappedRecursion>, OrderReduction), DesignError> {
    let mut walk = walk::Walk::new(subject)?;
    let order = match wanted {
        Reduction::Order(order) => walk.at_most(order)?,
        Reduction::Loss(db) => walk.within(db)?,
    };
    Ok(walk.finish(order))
}

#[cfg(test)]
mod tests;
