//! What a reader of a measurement must know beside its figures.

use super::{Cause, Measurement, Spur, UnsettledEnds};
use crate::quantity::readable;
use crate::units::{Decibels, Hertz};

/// No error of a converter that is in order is larger, relative to the tone.
const LEAST_TONE: Decibels = Decibels(-20.0);

/// Why figures may not say what they seem to say.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MeasureWarning {
    /// Samples at the rails.
    #[error(
        "{clipped} of {samples} samples are at the limits of the range; SINAD and THD contain their distortion, so lower \
         the level if it is not meant"
    )]
    Clipped {
        /// Samples at the rails.
        clipped: usize,
        /// Samples of the record.
        samples: usize,
    },
    /// Samples that are not finite.
    #[error("{left_out} of {samples} samples are NaN or infinite and were left out")]
    LeftOut {
        /// Samples that are not finite.
        left_out: usize,
        /// Samples of the record.
        samples: usize,
    },
    /// Spurs that coincide with a tone, with the constant or with half the rate.
    #[error(
        "these spurs fall on the tone, on the constant or on half the rate and cannot be seen: {}; choose another \
         frequency to see them",
        .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    )]
    Hidden(Vec<Cause>),
    /// Lines of interleaving that coincide with harmonics or products of tones, above the noise.
    #[error(
        "lines of interleaving fall on others, so that their power counts as distortion and may be that of interleaving: {}; \
         choose another frequency to tell them apart",
        .0.iter().map(shared).collect::<Vec<_>>().join("; ")
    )]
    Shared(Vec<Spur>),
    /// Lines that nothing explains and that are nearly as large as the tone.
    #[error(
        "lines nearly as large as the tone count as its distortion: {}; if they were played, name all tones",
        .0.iter().map(|tone| readable(tone.0, "Hz")).collect::<Vec<_>>().join(", ")
    )]
    OtherTones(Vec<Hertz>),
    /// The ends of the record hold most of the noise.
    #[error(
        "the first and the last {} samples raise the noise by {:.1} dB or more: a filter may not have settled there",
        .0.samples, .0.raise.0
    )]
    Unsettled(UnsettledEnds),
}

impl Measurement {
    /// What a reader must know beside the figures.
    pub fn warnings(&self) -> Vec<MeasureWarning> {
        let Self { samples, clipped, left_out, .. } = *self;
        let hidden = (!self.hidden.is_empty()).then(|| MeasureWarning::Hidden(self.hidden.clone()));
        let shared: Vec<Spur> = self.spurs.iter().filter(|spur| is_shared(spur)).cloned().collect();
        let others: Vec<Hertz> =
            self.spurs.iter().filter(|spur| is_tone(spur)).map(|spur| spur.frequency).collect();
        let all = [
            (clipped > 0).then_some(MeasureWarning::Clipped { clipped, samples }),
            (left_out > 0).then_some(MeasureWarning::LeftOut { left_out, samples }),
            hidden,
            (!shared.is_empty()).then_some(MeasureWarning::Shared(shared)),
            (!others.is_empty()).then_some(MeasureWarning::OtherTones(others)),
            self.unsettled_ends.map(MeasureWarning::Unsettled),
        ];
        all.into_iter().flatten().collect()
    }
}

/// Whether a line is more likely another tone than an error of a converter.
fn is_tone(spur: &Spur) -> bool {
    spur.above_noise && spur.level > LEAST_TONE && spur.causes.iter().all(|cause| *cause == Cause::Unknown)
}

/// Whether interleaving may have part in a line that counts as something else.
fn is_shared(spur: &Spur) -> bool {
    spur.above_noise
        && !spur.causes.first().is_some_and(|cause| cause.is_interleaving())
        && spur.causes.iter().any(|cause| cause.is_interleaving())
}

fn shared(spur: &Spur) -> String {
    let causes: Vec<String> = spur.causes.iter().map(ToString::to_string).collect();
    format!("{} of {:.1} dBc ({})", spur.frequency, spur.level.0, causes.join(" and "))
}
