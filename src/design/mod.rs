//! Designs a bank from a spec. The analog and digital parts become one exactly equivalent discrete-time
//! system ([`LiftedPlant`]); an IIR, H2 or FIR method finds the filters; a certificate proves their error.

pub mod analysis;
mod choices;
pub(crate) mod covariances;
mod designer;
mod error;
mod error_grid;
mod exchange;
pub mod filters;
mod history_errors;
mod least_errors;
mod lifting;
mod limits;
mod merging;
mod methods;
mod normalise;
pub mod plant;
pub mod problem;
mod prove;
pub mod quantise;
mod realise;
mod reduction;
pub mod responses;
pub mod uncertainty;
mod warnings;

pub use analysis::{Analysis, GammaScale, MeanAnalysis, analyze, analyze_mean, noise_gain};
pub(crate) use analysis::{NearestSample, nearest_samples};
pub use choices::latency;
pub use designer::{Design, Options, ProofSearch, design, judge_taps};
pub use error::DesignError;
pub use limits::{Stage, Stop, TIME_LIMIT, remedy};
pub use methods::robust_fir::RobustNorms;
pub use methods::robust_fir::RobustStudy;
pub use methods::scheduled_fir::TrackingStudy;
pub use plant::LiftedPlant;
pub use problem::Problem;
pub use prove::{Certified, certify};
pub use reduction::{OrderErrorPoint, OrderReduction};
pub use responses::error_response;
pub use warnings::warnings;

use crate::bank::{Bank, Proof};
use crate::verify::Verified;
use crate::verify::uncertainty::check_stated;

/// Searches for a proof of the gammas of a bank that was designed elsewhere or earlier. [`design`] also
/// knows the dual solution of its optimum, so it may prove a larger lower bound.
///
/// # Errors
/// As [`analyze`]; [`DesignError::NotCertified`] if no certificate was found; [`DesignError::Verify`] for a
/// worst case that the bank states and that is not proven.
pub fn prove(bank: &Bank) -> Result<(Proof, Verified), DesignError> {
    let found = prove::prove(bank, &bank.gamma, &methods::DualSolution::default(), &Stop::default())?;
    check_stated(bank)?;
    Ok(found)
}
