//! What a reader of the estimates must know.

use super::error::list;
use super::fit::FittedValues;
use crate::messages::counted;
use crate::spec::Cutoff;
use crate::units::{FastPeriods, Hertz};

/// A property of the captures that limits what the estimates mean.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationWarning {
    /// Clipped samples were left out.
    #[error("clipped samples were left out, per channel: {}", list(counts))]
    Clipped {
        /// One per channel.
        counts: Vec<usize>,
    },
    /// All offsets are near full scale.
    #[error(
        "every channel has an offset near full scale, as offset-binary codes have (0 to 2^B - 1) that are read as signed \
         ones; state their full scale, in the spec of 8 bits as `full_scale = \"u8bits\"`"
    )]
    OffsetBinary,
    /// Offsets of complex captures, which a spec cannot hold.
    #[error(
        "the parts of complex samples have offsets of their own, of which a spec holds one per channel, so they were \
         not written (real, imaginary): {}",
        pairs(offsets)
    )]
    ComplexOffsets {
        /// Of the real and the imaginary part of each channel.
        offsets: Vec<Vec<f64>>,
    },
    /// The cut-offs are those of the spec, and errors of them look like delays.
    #[error(
        "the cut-offs were not fitted: an error of 1 % in one changes its delay by up to {:.2e} fast periods",
        delay.0
    )]
    CutoffAssumed {
        /// By how much the delay of the channel most affected changes per per cent of cut-off.
        delay: FastPeriods,
    },
    /// The cut-offs are relative to one that the tones do not tell.
    #[error(
        "the cut-offs are relative to that of channel {reference}, which the tones do not tell and which keeps the value \
         of the spec; if it is uncertain, state `cutoff` in `[uncertainty]`, and the intervals of the others include it"
    )]
    CutoffsRelative {
        /// From 1.
        reference: usize,
    },
    /// The tones contradict each other by more than their noise, so all intervals were widened.
    #[error(
        "the tones contradict each other {misfit:.1} times as much as their noise explains, and the intervals were \
         widened by that; the front ends may differ from those of the spec, or the noise is so far below a step of the \
         converters that their rounding is none"
    )]
    TonesDisagree {
        /// The factor.
        misfit: f64,
    },
    /// With the cut-off of a part of the front ends the tones agree.
    #[error(
        "a fit of {} agrees with the captures: {fit} together have a misfit of {misfit:.2}; until then the intervals \
         reach to their values",
        part(*fit)
    )]
    CutoffExplains {
        /// What to fit.
        fit: FittedValues,
        /// Square root of chi squared per degree of freedom with it.
        misfit: f64,
    },
    /// An acquisition contradicts the others.
    #[error(
        "{name} contradicts the other captures: with it all differ from the model {misfit:.1} times as much as their \
         noise explains, without it {others:.1} times; leave it out, or find out what was different"
    )]
    Outlying {
        /// What it is called.
        name: String,
        /// Square root of chi squared per degree of freedom with it.
        misfit: f64,
        /// The same without it.
        others: f64,
    },
    /// The captures of any signal differ from the model by more than their noise.
    #[error(
        "the captures differ from the model {misfit:.1} times as much as their noise explains, and the intervals were \
         widened by that; the front ends may differ from those of the spec, the signal may reach beyond its `band`, \
         or the captures began at different times"
    )]
    BandsDisagree {
        /// The factor by which the intervals were widened.
        misfit: f64,
    },
    /// The signal has power at multiples of the slow rate, where it looks like offsets.
    #[error(
        "the signal reaches over multiples of the slow rate, which fold onto 0 Hz, and hides the offsets: they are \
         known to {half_width:.1e} of full scale, and noise alone would leave {noise:.1e}; tones tell them better"
    )]
    OffsetsHidden {
        /// The largest half-width of the offsets.
        half_width: f64,
        /// What the noise alone would leave.
        noise: f64,
    },
    /// What the waveform leaves is not white noise.
    #[error(
        "channel {channel}: what the waveform leaves is not white noise, and the intervals were widened {misfit:.1} \
         times"
    )]
    ResidualNotWhite {
        /// From 1.
        channel: usize,
        /// The factor by which its intervals were widened.
        misfit: f64,
    },
    /// A harmonic falls onto a tone.
    #[error(
        "harmonic {order} of the tone at {tone} falls onto the tone itself, so distortion shifts its delays and \
         gains; choose another frequency"
    )]
    HarmonicOnTone {
        /// The tone.
        tone: Hertz,
        /// Order of the harmonic.
        order: usize,
    },
    /// The samples of a tone have few distinct phases, so quantisation repeats with them.
    #[error(
        "the tone at {tone} is sampled at {phases} distinct phases only, so quantisation is no noise; the intervals \
         were widened by what repeats with the phase, choose another frequency"
    )]
    FewPhases {
        /// The tone.
        tone: Hertz,
        /// Number of phases.
        phases: usize,
    },
    /// A delay is so far from nominal that the next value with the same phases is nearly as close.
    #[error(
        "channel {channel}: the delay is known modulo {:.4} fast periods only, and the value nearest to the spec was \
         taken; a lower tone, or several, would settle it",
        modulus.0
    )]
    DelayModulo {
        /// From 1.
        channel: usize,
        /// The distance to the next value.
        modulus: FastPeriods,
    },
    /// Tones were left out of the fit of delays because they are harmonics of another one.
    #[error("{count} further tones are harmonics, which say nothing of the delays; they were left out")]
    HarmonicsLeftOut {
        /// Their number.
        count: usize,
    },
    /// As many tones were found as are looked for.
    #[error(
        "there may be more than the {most} strongest tones that are looked for, and the others count as noise; name them \
         all, or calibrate blind"
    )]
    MoreTones {
        /// Those looked for.
        most: usize,
    },
    /// All delays, and the latency, were raised so that none is negative.
    #[error(
        "a delay would be negative, so {} were added to all delays and to the latency: the fused file begins that much \
         later than the captures",
        counted(periods, "fast period")
    )]
    Shifted {
        /// Whole fast periods.
        periods: usize,
    },
}

impl CalibrationWarning {
    /// Whether it only says what the estimates mean; the others say that they are doubtful.
    pub fn is_note(&self) -> bool {
        use CalibrationWarning as Warning;
        matches!(
            self,
            Warning::CutoffAssumed { .. }
                | Warning::CutoffsRelative { .. }
                | Warning::HarmonicsLeftOut { .. }
                | Warning::OffsetsHidden { .. }
                | Warning::Shifted { .. }
        )
    }
}

fn part(fit: FittedValues) -> String {
    match fit.cutoff {
        Some(Cutoff::Stage(stage)) => format!("the cut-offs of stage {} of the filters", stage + 1),
        _ => "the cut-offs".to_owned(),
    }
}

fn pairs(offsets: &[Vec<f64>]) -> String {
    let numbers = |parts: &Vec<f64>| parts.iter().map(|x| format!("{x:.3e}")).collect::<Vec<_>>().join(", ");
    offsets.iter().map(|parts| format!("({})", numbers(parts))).collect::<Vec<_>>().join(", ")
}
