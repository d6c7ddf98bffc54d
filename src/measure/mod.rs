//! The quality of a converter from the record of a tone (IEEE Std 1057 and 1241), and the error of a record
//! against a reference.
//!
//! Every figure comes from a least-squares fit and not from the bins of a Fourier transform, so a tone need
//! not lie on a bin and no window enters. With A the fitted amplitude of the tone, r what the fit of tone
//! and constant leaves, and X the amplitude of full scale:
//!
//! ```text
//! SINAD             10 log10( (A^2 / 2) / mean of r^2 )
//! ENOB              (SINAD - 10 log10 1.5) / (20 log10 2)        of this tone
//! ENOB, full scale  ENOB + log2(X / A)                           of full scale in the same noise
//! THD               10 log10( sum of A_h^2 / A^2 ), h = 2 .. H   folded harmonics included
//! interleaving      10 log10( sum of A_s^2 / A^2 )               over the spurs of M converters
//! SNR               10 log10( (A^2 / 2) / variance of what is left without any line )
//! SFDR              20 log10( A / largest line or bin beside the tone )
//! noise density     variance per hertz of what is left, relative to X^2 / 2
//! ```
//!
//! Several tones count with the sum of their powers; SFDR is relative to the largest.
//!
//! # Interleaving spurs
//!
//! M converters in turn with offsets o_m, gains g_m and timing errors d_m (samples, the sample is taken
//! late) give a tone A cos(w n + phi), w radians per sample, the lines (Kurosawa et al., 2001)
//!
//! ```text
//! at k fs / M           2 |(1/M) sum over m of o_m e^{-2 pi j k m / M}|       times 1 / sqrt 2 at fs / 2
//! at |k fs / M +- f|    A |(1/M) sum over m of g_m e^{j w d_m} e^{-2 pi j k m / M}|
//! ```
//!
//! The amplitude of a line is that of a sine of its power; a line at fs / 2 has no phase, and the power a^2
//! of its size a.
//!
//! # Complex records
//!
//! A tone of a complex record ([`measure_complex`]) is A e^{j (w n + phi)}, w from -pi to pi. All powers are
//! means over both parts, so a tone has A^2 / 2 there too, and the noise density is that of fs hertz. Parts
//! that are not alike give an image of the tone at -w: [`Quadrature`]. It counts as neither harmonic nor
//! noise. Spurs of interleaving lie at f + k fs / M, and their images at the negative frequencies.

mod alignment;
mod compare;
mod expected;
mod lines;
mod measurement;
mod record;
mod spectrum;
mod warning;

pub use compare::{Comparison, ErrorBand, compare};
pub use expected::Cause;
pub use measurement::{MeasuredTone, Measurement, Spur, measure, measure_complex};
pub use record::{Imbalance, Quadrature, UnsettledEnds};
pub use spectrum::{RecordSpectrum, Window};
pub use warning::MeasureWarning;

use crate::sine_fit::SineFitError;
use crate::units::Hertz;

/// Most converters in turn and highest order of harmonics: more lines than this take minutes.
const MOST: usize = 1024;

/// What is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The tones, each in its own Nyquist zone and in complex records with its sign; empty for the largest
    /// one.
    pub tones: Vec<Hertz>,
    /// M, converters in turn; 1 for a single one.
    pub converters: usize,
    /// The highest order of harmonics.
    pub harmonics: usize,
    /// The amplitude X of full scale.
    pub full_scale: f64,
    /// The lowest and the highest value of a sample; those that reach them count as clipped.
    pub rails: (f64, f64),
    /// The window of the spectra.
    pub window: Window,
}

impl Default for Settings {
    /// The largest tone, one converter, ten harmonics, a full scale of 1, `bh7`.
    fn default() -> Self {
        Self {
            tones: Vec::new(),
            converters: 1,
            harmonics: 10,
            full_scale: 1.0,
            rails: (-1.0, 1.0),
            window: Window::default(),
        }
    }
}

impl Settings {
    fn check(&self) -> Result<(), MeasureError> {
        let count = |setting, value: usize, rule| match value {
            1..=MOST => Ok(()),
            _ => Err(MeasureError::Setting { setting, value: value as f64, rule }),
        };
        count("the number of converters in turn", self.converters, "it is 1 to 1024")?;
        count("the highest harmonic", self.harmonics, "it is 1 (none) to 1024")?;
        let value = self.full_scale;
        if !(value > 0.0 && value.is_finite()) {
            let rule = "it is a positive number";
            return Err(MeasureError::Setting { setting: "the full scale", value, rule });
        }
        Ok(())
    }
}

/// Why a record cannot be measured.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
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

#[cfg(test)]
mod tests;
