//! What can be wrong with an analog filter.

use hybank_core::spec::SpecError;
use hybank_core::units::{RadiansPerFastPeriod, Seconds};
use hybank_linalg::LinalgError;

use super::{MAX_GAIN, MAX_NORMALISED_POLE, MIN_DAMPING_RATIO, MIN_GAIN, MIN_NORMALISED_POLE};

/// Why a filter was refused. Poles and zeros are given in rad/s, as the user wrote them.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnalogError {
    /// The fast period is not positive and finite.
    #[error("the fast period is {value}; it must be a positive, finite number of seconds")]
    FastPeriod {
        /// The offending value.
        value: Seconds,
    },
    /// The written form violates a rule that does not concern its poles.
    #[error(transparent)]
    Spec(#[from] SpecError),
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
    /// A pole so slow or so fast that samples do not distinguish it from an integrator or from a constant
    /// gain.
    #[error(
        "{}; the supported range is {MIN_NORMALISED_POLE:e} to {MAX_NORMALISED_POLE:e}: slower poles look like \
         integrators to the samples, faster ones like a constant gain. Check the units (rad/s for poles, hertz for \
         cutoffs, seconds for periods) or leave the pole out",
        pole(*.re, *.im, *.normalised)
    )]
    PoleOutOfRange {
        /// Real part in rad/s.
        re: f64,
        /// Imaginary part in rad/s.
        im: f64,
        /// Modulus of the normalised pole.
        normalised: RadiansPerFastPeriod,
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
    /// Roots of a polynomial lie too close together to be told apart.
    #[error(
        "the roots of {what} lie so close together that 512 bits do not tell them apart; write the filter as zeros, \
         poles and gain, or as a cascade of smaller filters"
    )]
    RootsNotIsolated {
        /// "num" or "den".
        what: &'static str,
    },
    /// The response is zero at all frequencies although neither b nor c is zero.
    #[error(
        "the output of the filter does not depend on its input; check which states b drives and c observes"
    )]
    NoTransmission,
    /// The gain is so large or small that its square leaves the range of double precision.
    #[error(
        "the gain is {} once time is measured in fast periods; the supported range is {MIN_GAIN:e} to {MAX_GAIN:e}: \
         check num, gain or c, and the units of poles and period",
        gain(*.value)
    )]
    GainOutOfRange {
        /// The normalised gain.
        value: f64,
    },
    /// An eigenvalue computation failed.
    #[error("the poles could not be computed: {0}")]
    Numerical(#[from] LinalgError),
}

/// A gain that may be beyond all numbers.
fn gain(value: f64) -> String {
    if value.is_finite() { format!("{value:e}") } else { "beyond the largest number".to_owned() }
}

/// A pole and its modulus. A first coefficient near the smallest double puts a pole beyond the largest.
fn pole(re: f64, im: f64, normalised: RadiansPerFastPeriod) -> String {
    if re.is_finite() && im.is_finite() {
        return format!("the pole {re:e} {im:+e}j rad/s is {normalised:e}");
    }
    "a pole is beyond the largest number, as if the first coefficient of den were 0".to_owned()
}
