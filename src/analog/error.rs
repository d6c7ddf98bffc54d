//! What can be wrong with an analog filter.

use crate::linalg::LinalgError;
use crate::spec::FilterProblem;

use super::{MAX_NORMALISED_POLE, MIN_DAMPING_RATIO, MIN_NORMALISED_POLE};

/// Why a filter was refused. Poles and zeros are given in rad/s, the unit they were written in, so
/// that the user finds them again.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum AnalogError {
    /// The fast period that time is measured in is not usable.
    #[error("the fast period is {value} s; it must be a positive, finite number of seconds")]
    TimeUnit {
        /// The offending value in seconds.
        value: f64,
    },
    /// The written form breaks a rule that has nothing to do with its poles.
    #[error(transparent)]
    Spec(#[from] FilterProblem),
    /// A pole in the right half plane or on the imaginary axis.
    #[error(
        "the filter is unstable: its pole {re:e} {im:+e}j rad/s must lie in the left half plane, with a negative \
         real part of at least {MIN_DAMPING_RATIO:e} of its modulus; check the signs of the poles or of den"
    )]
    Unstable {
        /// Real part in rad/s.
        re: f64,
        /// Imaginary part in rad/s.
        im: f64,
    },
    /// A pole that is slower or faster than the sampling grid can tell.
    #[error(
        "the pole {re:e} {im:+e}j rad/s is {normalised:e} rad a fast period; between {MIN_NORMALISED_POLE:e} and \
         {MAX_NORMALISED_POLE:e} a pole can be told from an integrator and from a wire. Check the units (rad/s for \
         poles, hertz for cutoffs, seconds for periods) or leave the pole out"
    )]
    PoleOutOfRange {
        /// Real part in rad/s.
        re: f64,
        /// Imaginary part in rad/s.
        im: f64,
        /// Modulus in rad a fast period.
        normalised: f64,
    },
    /// A complex pole or zero without its conjugate.
    #[error(
        "the {what} {re:e} {im:+e}j rad/s has no conjugate partner, so the filter is not real; list both [{re:e}, \
         {im:e}] and its conjugate"
    )]
    NotConjugate {
        /// "pole" or "zero".
        what: &'static str,
        /// Real part in rad/s.
        re: f64,
        /// Imaginary part in rad/s.
        im: f64,
    },
    /// The response vanishes at all frequencies although no coefficient list does.
    #[error("the output of the filter does not depend on its input; check which states b drives and c reads")]
    NoTransmission,
    /// The gain leaves the range of double precision in normalised time.
    #[error(
        "the gain is {value:e} once time is measured in fast periods; check the units of gain, poles and period"
    )]
    GainOutOfRange {
        /// The normalised gain.
        value: f64,
    },
    /// An eigenvalue computation failed.
    #[error("the poles could not be computed: {0}")]
    Numerical(#[from] LinalgError),
}
