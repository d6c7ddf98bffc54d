//! Why a record cannot be measured.

use crate::sine_fit::SineFitError;

/// Why a record cannot be measured.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeasureError {
    /// No tone could be fitted.
    #[error(transparent)]
    Fit(#[from] SineFitError),
    /// A setting that cannot be.
    #[error("{setting} is {value}; {rule}")]
    Setting {
        /// What was set.
        setting: &'static str,
        /// The value.
        value: f64,
        /// What it may be.
        rule: &'static str,
    },
    /// Too few samples for the lines that are looked for.
    #[error(
        "{samples} samples are too few to tell {lines} lines (tones, harmonics, interleaving spurs) apart, which needs {needed}; record longer, or ask for fewer harmonics"
    )]
    TooShort {
        /// Finite samples of the record.
        samples: usize,
        /// Tones, harmonics and spurs together.
        lines: usize,
        /// Samples that are needed.
        needed: usize,
    },
    /// Record and reference have too few samples in common.
    #[error(
        "record ({samples} samples) and reference ({reference}) overlap by {overlap} samples at a lag of {lag}, but the comparison needs {needed}; give longer recordings of one signal"
    )]
    Overlap {
        /// Length of the record.
        samples: usize,
        /// Length of the reference.
        reference: usize,
        /// Samples at which both are known.
        overlap: usize,
        /// Samples by which the record is late.
        lag: i64,
        /// Samples that are needed.
        needed: usize,
    },
    /// A signal without variation, which determines no lag.
    #[error("the {which} is constant, so it determines no lag and no gain; give a recording with a signal")]
    Constant {
        /// Record or reference.
        which: &'static str,
    },
    /// The lag did not settle.
    #[error(
        "the lag of the record did not settle near {lag} samples; the recordings may not be of one signal"
    )]
    NoLag {
        /// The start.
        lag: i64,
    },
}
