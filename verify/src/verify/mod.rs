//! Proves a bank's gamma from its file alone, in arithmetic that bounds every rounding error.
//!
//! This module uses nothing of the design, its solvers or its norms: it neither searches nor optimises; it
//! checks. It shares front ends, instants and the arithmetic with the designer. The file holds the
//! certificate of the proof ([`Proof`](hybank_core::bank::Proof)). How it was found does not matter.
//!
//! # What is proven
//! For the error system K of the bank's own coefficients (thesis Props. 5.1-5.3), in normalised time (h =
//! 1):
//!
//! - `attained <= ||K|| <= upper`: from below by the gain at one frequency, from above by the bounded-real
//!   lemma with the certificate P = R R'; the same certificate proves that the bank is stable.
//!
//! The norm and the upper end that the file states are compared with these. A file that states more than
//! they prove is refused. The lower bounds for other banks that a file states are computed by the design and
//! not proven.
//!
//! # Assumptions
//! The proof starts from the doubles in the file: the filters as the spec writes them, the delays and the
//! fast period in seconds, the gains of the converters, the latency, and the coefficients. Everything
//! computed from them is enclosed. [`crate::analog`] encloses roots and state equations in 512 bits. Delays
//! in fast periods are quotients that are compared exactly. Exponentials and Gramians are Taylor series with
//! a bound of the remainder. Frequency responses are bounded by a residual. A Cholesky factorisation in
//! double-double arithmetic shows positive definiteness (Rump, 2006). Everything else is computed in
//! intervals of 106 or 512 bits.
//!
//! Not proven: that the spec describes the hardware.
//!
//! ```
//! use hybank_core::bank::Bank;
//! use hybank_verify::verify::verify;
//! let mut bank = Bank::from_json(include_str!("../../../filters/thesis-fir.json"), "thesis-fir.json")?;
//! let proven = verify(&bank)?;
//! assert!(proven.attained <= proven.upper && proven.upper < 0.039933);
//! // A file that states more than is true is refused.
//! bank.gamma.upper = Some(0.99 * proven.attained);
//! assert!(verify(&bank).is_err());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod ball;
pub mod enclosed;
mod error;
mod error_system;
mod front_ends;
mod gain;
mod positive;
mod slow_period;
mod spectrum;
mod state_transition;
mod statements;
mod system;
mod timeline;
mod uncertainty;

pub use self::enclosed::EnclosedErrorSystem;
pub use self::error::VerifyError;
pub use self::statements::{Strictness, ZERO_NORM};
pub use self::system::{EnclosedSystem, Midpoint};
pub use self::uncertainty::{EnclosedBox, worst_case};

use hybank_core::bank::Bank;

/// Maximum number of states of an error system that can be proven: its matrices are dense.
pub const MAX_STATES: usize = 2048;
/// Maximum number of analog states of all distinct front ends together.
pub const MAX_ANALOG_STATES: usize = 128;
/// Maximum of the samples of a slow period times the cube of the analog states: about a minute of
/// computing.
const MAX_WORK: usize = 100_000_000;

/// The proven bounds of a bank, in normalised time (h = 1).
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Verified {
    /// ||K|| of this bank is at most this.
    pub upper: f64,
    /// ||K|| of this bank is at least this.
    pub attained: f64,
    /// Order of P.
    pub states: usize,
}

/// Proves the gamma of a bank with the certificate that it carries.
///
/// # Errors
/// [`VerifyError`] naming what does not fit; [`VerifyError::NoCertificate`] at once for a bank that carries
/// no proof.
pub fn verify(bank: &Bank) -> Result<Verified, VerifyError> {
    let Some(proof) = &bank.proof else {
        return Err(if bank.spec.is_none() { VerifyError::NoSpec } else { VerifyError::NoCertificate });
    };
    let verified = EnclosedErrorSystem::new(bank)?.judge(&bank.gamma, &proof.upper, Strictness::Proven)?;
    uncertainty::check_stated(bank)?;
    Ok(verified)
}

#[cfg(test)]
mod tests;
