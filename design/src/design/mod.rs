//! Designs a bank from a spec. The analog and digital parts become one exactly equivalent discrete-time
//! system ([`LiftedPlant`]); an IIR, H2 or FIR method finds the filters; a certificate proves their error.

pub mod analysis;
mod band_error;
mod causal_errors;
mod designer;
mod deviations;
mod error;
mod error_grid;
mod exchange;
mod figure_band;
pub mod filters;
mod fir_errors;
mod jitter;
mod known_instants;
mod length;
mod lifting;
mod limits;
mod merging;
mod methods;
mod missing;
mod normalise;
pub mod plant;
mod preparation;
pub mod problem;
mod prove;
mod quadrature;
pub mod quantise;
mod realise;
mod reduction;
pub mod responses;
mod root_covariance;
mod signal;
mod sizing;
mod tones;
pub mod uncertainty;
mod warnings;

pub use analysis::{
    Analysis, GammaScale, MeanAnalysis, analyze, analyze_mean, delay_point, noise_gain, norm_at,
};
pub use analysis::{NearestSample, nearest_samples};
pub use designer::{Design, DesignOptions, ProofSearch, Study, design, judge_taps};
pub(crate) use deviations::Deviations;
pub use error::DesignError;
pub use figure_band::{BandSource, FigureBand};
pub use known_instants::{instants_estimator, learned_model};
pub use length::TargetFigure;
pub use limits::{Stage, Stop, TIME_LIMIT, remedy};
pub(crate) use methods::mean_square_fir::least_squares_taps;
pub use methods::robust_fir::{RobustNorms, RobustStudy};
pub use missing::MissingSamples;
pub use plant::LiftedPlant;
pub use problem::Problem;
pub(crate) use quadrature::{Integrand, QuadratureNode};
pub use reduction::{OrderErrorPoint, OrderReduction};
pub use responses::error_response;
pub(crate) use signal::{AliasColumns, SampledSignal};
pub use sizing::Sizing;
pub use tones::ToneOutput;
pub(crate) use tones::{PeriodicFilters, ToneResponse, Worst};
pub use warnings::warnings;

use hybank_core::bank::{Bank, Proof};
use hybank_verify::verify::{Verified, VerifyError};

/// Searches for a proof of the gamma of a bank that was designed elsewhere or earlier.
///
/// ```
/// use hybank_core::bank::Bank;
/// use hybank_design::design::prove;
/// let bank = Bank::from_json(include_str!("../../../filters/thesis-fir.json"), "thesis-fir.json")?;
/// let (_, proven) = prove(&bank)?;
/// assert!(proven.upper < 0.039933 && proven.upper - proven.attained < 1e-7 * proven.upper);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As [`analyze`]; [`DesignError::NotCertified`] if no certificate was found; [`DesignError::Verify`] for a
/// worst case that the bank states and that is not proven.
pub fn prove(bank: &Bank) -> Result<(Proof, Verified), DesignError> {
    let stop = Stop::default();
    let (proof, verified) = prove::prove(bank, &bank.gamma, &stop)?;
    let Some(stated) = bank.gamma.worst_case else { return Ok((proof, verified)) };
    let mut found = Bank { proof: Some(proof), ..bank.clone() };
    prove::attach_box_proof(&mut found, &stop)?;
    match found.proof.filter(|_| found.gamma.worst_case.is_some_and(|proven| proven <= stated)) {
        Some(proof) => Ok((proof, verified)),
        None => Err(VerifyError::WorstCase { stated }.into()),
    }
}
