//! A proof in floating point that a bank keeps a gamma: the bounded-real LMI with its P.

use super::equivalence::BlockedPlant;
use super::{DesignError, analysis, error_system};
use crate::bank::Bank;
use crate::lmi::kyp::{self, Refusal};

/// Relative excesses over the computed norm at which a proof is tried, smallest first.
const EXCESSES: [f64; 6] = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3];
/// States of the error system that matter less than this share of the most important one are left out of the
/// coordinates; they are not reachable.
const REACHABLE: f64 = 1e-13;

/// A gamma that is proven, not only computed.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Certified {
    /// ||K|| is at most this.
    pub gamma: f64,
    /// The least eigenvalue of the LMI's matrix is at least this (after all rounding errors).
    pub margin: f64,
    /// Order of P.
    pub states: usize,
}

/// Proves an upper bound of the bank's gamma: P from a bounded-real Riccati equation in
/// coordinates where the controllability Gramian is the identity, the LMI by one Cholesky factorisation
/// that charges every rounding error (Rump, BIT 46, 2006; thesis 5.4 for the LMI).
///
/// # Errors
/// As [`super::analyze`]; [`DesignError::NotCertified`] if no proof was found.
pub fn certify(bank: &Bank) -> Result<Certified, DesignError> {
    let plant = BlockedPlant::new(&analysis::bank_problem(bank)?);
    let filters = error_system::block_system(&bank.filters, bank.ratio)?;
    let error = error_system::error_system(&plant, &filters)?;
    let norm = crate::lti::peak::hinf_norm(&error)?.gain;
    let k = kyp::gramian_coordinates(error.a(), error.b(), REACHABLE)?;
    let c = error.c() * &k.basis;
    let mut last = Refusal::Riccati { gamma: norm };
    for excess in EXCESSES {
        match kyp::certificate(&k.a, &k.b, &c, error.d(), norm * (1.0 + excess)) {
            Ok(proof) => {
                return Ok(Certified { gamma: proof.gamma, margin: proof.margin, states: k.a.nrows() });
            }
            Err(refusal) => last = refusal,
        }
    }
    Err(DesignError::NotCertified(last))
}
