//! Designs a bank from a spec. The analog and digital parts become one exactly equivalent discrete-time
//! system ([`LiftedPlant`]); an IIR, H2 or FIR method finds the filters; a certificate proves their error.

pub mod analysis;
mod choices;
pub(crate) mod covariances;
mod designer;
mod doubling;
pub mod effort;
mod error;
mod error_grid;
mod error_response;
mod exchange;
pub mod filters;
mod history_errors;
pub mod interleaving;
mod lifting;
mod measurement_units;
mod merging;
mod methods;
mod normalise;
pub mod plant;
mod plausibility;
pub mod problem;
mod prove;
pub mod quantise;
mod realise;
pub mod reduction;
mod resolution;
pub mod responses;
mod scale;
mod smoother;
mod timetable;
pub mod uncertainty;

pub use analysis::{Analysis, MeanAnalysis, analyze, analyze_mean};
pub use choices::latency;
pub use designer::{Design, Options, ProofSearch, design, design_observed, design_with, judge_taps};
pub use effort::{Limits, Stage};
pub use error::DesignError;
pub use error_response::error_response;
pub use methods::robust_fir::RobustStudy;
pub use methods::scenarios::RobustNorms;
pub use methods::scheduled_fir::TrackingStudy;
pub use plant::LiftedPlant;
pub use plausibility::{Implausible, implausible};
pub use problem::Problem;
pub use prove::{Certified, certify};
pub use reduction::{OrderErrorPoint, OrderReduction};
pub use scale::GammaScale;

use crate::bank::{Bank, Proof};
use crate::verify::Verified;

/// Searches for a proof of the gammas of a bank that was designed elsewhere or earlier. [`design`] also
/// knows the dual solution of its optimum, so it may prove a larger lower bound.
///
/// # Errors
/// As [`analyze`]; [`DesignError::NotCertified`] if no certificate was found.
pub fn prove(bank: &Bank) -> Result<(Proof, Verified), DesignError> {
    prove::prove(bank, &[])
}
