//! The ways to compute y[kM + p] = sum_i sum_j f_i[p + jM] x_i[k - j], one module each.
//!
//! Each is a pair of values: coefficients in the order of use, which streams share, and the state of one
//! stream.

pub(crate) mod choice;
pub(crate) mod direct;
pub(crate) mod filter;
pub(crate) mod overlap_save;
pub(crate) mod recursive;

pub(crate) use direct::Direct;
pub(crate) use filter::{AlgorithmFacts, Filter};
pub(crate) use overlap_save::OverlapSave;
pub(crate) use recursive::Recursive;
