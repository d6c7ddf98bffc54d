//! The bank: synthesis filters with the facts needed to run and judge them, and its file format.
//!
//! [`Bank::from_json`] and [`Bank::to_json`] are the two ends of the file format `hybank-bank`, version 1.
//! Every number reads back to the same bits. Unknown keys are refused by name; the one exception is
//! `meta`, which may hold anything that other programs wish to keep in the file and is not read.
//!
//! A file may carry a [`Proof`] of its gammas and a digest of its content. Reading does not look at the digest, so that a
//! bank can be edited and run; [`check_digest`] compares it.

mod check;
mod digest;
mod error;
mod fixed_point;
mod plan;
mod proof;
mod read;
mod write;

pub use check::MAX_BANK_LATENCY;
pub use error::{BankError, BankProblem};
pub use fixed_point::FixedPoint;
pub use proof::{CausalWitness, Certificate, DualWitness, LowerProof, Proof};
pub use read::check_digest;

use crate::spec::{Method, Spec};
use crate::units::{FastPeriods, Seconds};

/// `format` of a bank file.
pub const FORMAT: &str = "hybank-bank";

/// `version` of the bank files written and read.
pub const VERSION: usize = 1;

/// N synthesis filters for one spec, whole: what `design` makes and every other command reads.
#[derive(Debug, Clone, PartialEq)]
pub struct Bank {
    /// The spec it was designed for, with all defaults filled in; `None` for a bank made elsewhere.
    pub spec: Option<Spec>,
    /// h in seconds.
    pub fast_period: f64,
    /// M.
    pub ratio: usize,
    /// m0 in fast samples.
    pub latency: usize,
    /// How it was designed.
    pub method: Method,
    /// D_i in seconds, one a channel.
    pub delays: Vec<f64>,
    /// F_1 .. F_N.
    pub filters: SynthesisFilters,
    /// The integers that the taps stand for, where they were chosen among these.
    pub fixed_point: Option<FixedPoint>,
    /// How good it is.
    pub gamma: Gamma,
    /// What proves it, where the file carries that.
    pub proof: Option<Proof>,
}

/// The synthesis filters in the form they run in.
#[derive(Debug, Clone, PartialEq)]
pub enum SynthesisFilters {
    /// `taps[i][n]` = `f_i[n]` at the fast rate.
    Fir(Vec<Vec<f64>>),
    /// One block per slow period.
    StateSpace(BlockFilter),
}

/// x+ = a x + b u, y = c x + d u; u the N slow samples of a period, y its M fast samples.
/// Row-major lists of rows.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BlockFilter {
    /// n x n.
    pub a: Vec<Vec<f64>>,
    /// n x N.
    pub b: Vec<Vec<f64>>,
    /// M x n.
    pub c: Vec<Vec<f64>>,
    /// M x N.
    pub d: Vec<Vec<f64>>,
}

/// gamma = ||K|| in normalised time (h = 1), and what bounds it; `None` is what nobody knows.
///
/// `lower <= upper` and `noncausal <= upper` hold wherever both are known.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gamma {
    /// Computed norm of the very coefficients of this bank; its relative error is at most
    /// [`NORM_ACCURACY`](Self::NORM_ACCURACY).
    pub norm: Option<f64>,
    /// An upper bound of the true norm of these coefficients: proven where the bank carries a proof, else the computed norm
    /// raised by its stated error.
    pub upper: Option<f64>,
    /// A lower bound for all banks of this method and size.
    pub lower: Option<f64>,
    /// A lower bound for all banks, of any latency.
    pub noncausal: Option<f64>,
}

impl Gamma {
    /// Relative error of a computed norm.
    pub const NORM_ACCURACY: f64 = 1e-9;

    /// The interval of a bank of computed `norm`, below whose upper end all lower bounds stay.
    pub fn computed(norm: f64, lower: f64, noncausal: f64) -> Self {
        let upper = norm * (1.0 + Self::NORM_ACCURACY);
        Self {
            norm: Some(norm),
            upper: Some(upper),
            lower: Some(lower.min(norm)),
            noncausal: Some(noncausal.min(norm)),
        }
    }
}

impl Bank {
    /// Filters made elsewhere as a bank: h = 1, no latency, no delays, and nothing known of front ends and gammas.
    pub fn bare(filters: SynthesisFilters, ratio: usize) -> Self {
        let (method, channels) = match &filters {
            SynthesisFilters::Fir(taps) => (Method::Fir, taps.len()),
            SynthesisFilters::StateSpace(block) => (Method::Iir, block.d.first().map_or(0, Vec::len)),
        };
        Self {
            spec: None,
            fast_period: 1.0,
            ratio,
            latency: 0,
            method,
            delays: vec![0.0; channels],
            filters,
            fixed_point: None,
            gamma: Gamma::default(),
            proof: None,
        }
    }

    /// N, the number of slow channels.
    pub fn channel_count(&self) -> usize {
        self.delays.len()
    }

    /// The slow period M h in seconds.
    pub fn slow_period(&self) -> f64 {
        self.fast_period * self.ratio as f64
    }

    /// D_i / h of every channel, exactly whole where it is whole up to rounding.
    pub fn delays_in_fast_periods(&self) -> Vec<FastPeriods> {
        let h = Seconds(self.fast_period);
        self.delays.iter().map(|&delay| crate::spec::delay_in_fast_periods(Seconds(delay), h)).collect()
    }
}

#[cfg(test)]
mod tests;
