//! Why a calibration is refused.

use crate::analog::AnalogError;
use crate::linalg::least_squares::NoMinimum;
use crate::messages::Quoted;
use crate::sine_fit::SineFitError;
use crate::units::{FastPeriods, Hertz};

/// Why captures do not calibrate a spec.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// Complex samples beside real ones, or without tones.
    #[error(
        "{complex} of {records} captures are complex: such captures are calibrated by tones, and all are complex or none is"
    )]
    ComplexSamples {
        /// Complex records.
        complex: usize,
        /// All records.
        records: usize,
    },
    /// A tone of complex captures at the negative of the frequency given.
    #[error("the tone is not at {tone}, but at minus that: complex samples tell the sign of a frequency")]
    OtherSign {
        /// The frequency given.
        tone: Hertz,
    },
    /// A tone of real captures at a negative frequency.
    #[error("the tone at {tone}: real samples do not tell the sign of a frequency; give it above 0")]
    NegativeTone {
        /// The frequency given.
        tone: Hertz,
    },
    /// A filter of the spec cannot be realised.
    #[error("filter of {place}: {source}")]
    Filter {
        /// A channel or the target.
        place: String,
        /// Why.
        source: Box<AnalogError>,
    },
    /// A stage whose cut-off is to be fitted is none of a channel's filter.
    #[error(
        "channel {channel} has no stage {stage}: its filter has {stages}; fit the cut-off of another one"
    )]
    NoSuchStage {
        /// From 1.
        channel: usize,
        /// From 1.
        stage: usize,
        /// Number of stages of its filter.
        stages: usize,
    },
    /// A stage, or what remains of the filter without it, is no filter that can be realised alone.
    #[error(
        "channel {channel}: stage {stage} cannot be fitted apart from the others: {source}; fit `cutoff`"
    )]
    Stage {
        /// From 1.
        channel: usize,
        /// From 1.
        stage: usize,
        /// Why.
        source: Box<AnalogError>,
    },
    /// Converters with rates of their own, and a signal that is not made of tones.
    #[error("converters with sample rates of their own are calibrated by tones only; capture tones")]
    OwnRates,
    /// A nonlinearity, and a signal that is not made of tones.
    #[error("a nonlinearity is found by tones only; capture tones, or leave it as it is")]
    NonlinearityWithoutTones,
    /// Not one record per channel.
    #[error(
        "captures: {records}, but channels in the spec: {channels}; give one capture per channel, in the order of the spec; \
         of files with several channels, `--channel` takes some"
    )]
    ChannelCount {
        /// Channels of the spec.
        channels: usize,
        /// Captures.
        records: usize,
    },
    /// Nothing to compare with.
    #[error(
        "the spec has one channel; delays and gains are relative to a reference channel, so at least two are needed"
    )]
    OneChannel,
    /// A reference beyond the channels.
    #[error("channel {reference} cannot be the reference: the channels are 1 to {channels}")]
    NoSuchReference {
        /// As given, from 1.
        reference: usize,
        /// Channels of the spec.
        channels: usize,
    },
    /// All values keep those of the spec.
    #[error("nothing is to be fitted; name at least one of delay, gain, offset and cutoff")]
    NothingToFit,
    /// The same samples twice.
    #[error("captures {first} and {second} hold the same samples; give each channel its own recording")]
    Repeated {
        /// From 1.
        first: usize,
        /// From 1.
        second: usize,
    },
    /// The captures belong to other channels than the order says.
    #[error(
        "the captures are in the wrong order: their delays are those of the channels {}; give them in the order of the spec",
        list(.order)
    )]
    WrongOrder {
        /// The channel that each capture belongs to, from 1.
        order: Vec<usize>,
    },
    /// Too few frames in a row that are neither clipped nor lost.
    #[error(
        "{frames} frames in a row are neither clipped nor lost; at least {needed} are needed, record more"
    )]
    TooShort {
        /// Frames of the longest run.
        frames: usize,
        /// Frames needed.
        needed: usize,
    },
    /// No frequency leaves a direction without signal.
    #[error(
        "at every frequency either all {channels} channels are needed to explain the signal or there is none, so a blind fit has \
         nothing to go by; capture a signal of less bandwidth, or use tones or a known waveform"
    )]
    AllAliasesOccupied {
        /// N.
        channels: usize,
    },
    /// Parameters with the same effect on the captures.
    #[error(
        "the captures do not tell the fitted values apart: delay and cut-off have the same effect on these frequencies; fit fewer \
         of them, or use a signal of more bandwidth"
    )]
    NotIdentifiable,
    /// A delay that the captures do not determine.
    #[error(
        "channel {channel}: the captures determine its delay to {:.1e} fast periods only, so they hold no tones that all \
         channels share, or hardly any; name the tones, calibrate by a known waveform or blind, or record more",
        sigma.0
    )]
    DelayUndetermined {
        /// From 1.
        channel: usize,
        /// Standard deviation of the delay.
        sigma: FastPeriods,
    },
    /// A cut-off that the tones do not determine.
    #[error(
        "channel {channel}: the tones determine the cut-off to {sigma:.1e} of itself only, because a change of the cut-off looks like \
         one of the delay there; add tones near and above the cut-off, or do not fit the cut-off"
    )]
    CutoffLooksLikeDelay {
        /// From 1.
        channel: usize,
        /// Relative standard deviation.
        sigma: f64,
    },
    /// Too few tones for a cut-off.
    #[error(
        "a tone gives the delay at its own frequency only, where a change of the cut-off looks like one of the delay; fitting the \
         cut-off needs at least 3 tones, and there are {tones}"
    )]
    TooFewTones {
        /// Number of tones.
        tones: usize,
    },
    /// A tone at a multiple of half the slow rate.
    #[error(
        "the tone at {tone} lies within {cycles:.1} cycles per record of a multiple of half the slow rate ({half}), where sine and \
         cosine (or tone and offset) cannot be told apart; choose another frequency"
    )]
    TonePosition {
        /// The tone.
        tone: Hertz,
        /// Distance in cycles per record.
        cycles: f64,
        /// Half the slow rate.
        half: Hertz,
    },
    /// The Nyquist zone of a tone does not follow from the nominal delays.
    #[error(
        "the tone that appears at {alias} could be at {best} or at {other}: it lies outside of {} to {}, the zone of the band, or \
         the delays of the spec are too far from the true ones, or too symmetric, to tell; give the frequency",
        zone[0], zone[1]
    )]
    AmbiguousZone {
        /// Where it appears, below half the slow rate.
        alias: Hertz,
        /// The best candidate.
        best: Hertz,
        /// The second best.
        other: Hertz,
        /// The ends of the zone of the fast rate that holds the band, in which tones are looked for.
        zone: [Hertz; 2],
    },
    /// One acquisition of several.
    #[error("{}: {source}", Quoted(.name))]
    Acquisition {
        /// What it is called.
        name: String,
        /// What is wrong with it.
        source: Box<CalibrateError>,
    },
    /// Several acquisitions, or none, of a known waveform.
    #[error(
        "{acquisitions} acquisitions: those of a known waveform are not pooled; give the captures of one acquisition"
    )]
    NotPooled {
        /// Their number.
        acquisitions: usize,
    },
    /// An acquisition of several without any of the given tones.
    #[error("it holds none of the tones given; its lines appear at {}", list(lines))]
    NoneOfTheTones {
        /// Where its lines appear, below half the slow rate.
        lines: Vec<Hertz>,
    },
    /// A tone that no acquisition holds.
    #[error("the tone at {tone} is in none of the {acquisitions} acquisitions; leave it out, or check it")]
    ToneNowhere {
        /// The frequency given.
        tone: Hertz,
        /// Number of acquisitions.
        acquisitions: usize,
    },
    /// Captures that are too short to tell how converters change.
    #[error(
        "{frames} frames make {blocks} blocks, and {needed} are needed to follow changes; record more, or take shorter blocks"
    )]
    FewBlocks {
        /// Blocks.
        blocks: usize,
        /// Frames of the captures.
        frames: usize,
        /// Blocks needed.
        needed: usize,
    },
    /// Most blocks of the captures cannot be calibrated.
    #[error(
        "only {measured} of {blocks} blocks of the captures can be calibrated, and half of them must: {reason}; take longer blocks"
    )]
    BlocksNotMeasured {
        /// Blocks that were calibrated.
        measured: usize,
        /// All blocks.
        blocks: usize,
        /// Why the first one was not.
        reason: Box<CalibrateError>,
    },
    /// A sine fit failed.
    #[error(transparent)]
    Tones(#[from] SineFitError),
    /// The iteration did not settle.
    #[error(
        "the fit did not settle within {steps} steps; check the order of the captures, the front ends and the delays of the \
         spec, and without tones or a waveform that the signal leaves frequencies free"
    )]
    NoConvergence {
        /// Steps taken.
        steps: usize,
    },
    /// The waveform is not in the captures.
    #[error(
        "channel {channel}: the training waveform explains only {percent:.0} % of its power; check that this waveform was played, at \
         this rate, and that the front ends are those of the spec"
    )]
    NotTheWaveform {
        /// From 1.
        channel: usize,
        /// Share of the power in per cent.
        percent: f64,
    },
    /// The waveform and the captures overlap too little.
    #[error(
        "the training waveform and the captures have {frames} frames in common; at least {needed} are needed"
    )]
    ShortOverlap {
        /// Common frames.
        frames: usize,
        /// Frames needed.
        needed: usize,
    },
    /// A waveform without samples or spacing.
    #[error(
        "the training waveform has {samples} samples at a spacing of {spacing}; it needs at least 64 finite ones"
    )]
    Waveform {
        /// Number of samples.
        samples: usize,
        /// T.
        spacing: FastPeriods,
    },
}

impl CalibrateError {
    /// Says which of so many acquisitions has this fault, if there are several.
    pub(super) fn within(self, name: &str, acquisitions: usize) -> Self {
        match acquisitions {
            1 => self,
            _ => Self::Acquisition { name: name.to_owned(), source: Box::new(self) },
        }
    }
}

/// Numbers or frequencies in a sentence.
pub(super) fn list(items: &[impl ToString]) -> String {
    items.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

impl From<NoMinimum> for CalibrateError {
    fn from(why: NoMinimum) -> Self {
        match why {
            NoMinimum::WithoutEffect(_) | NoMinimum::Dependent => Self::NotIdentifiable,
            NoMinimum::NoConvergence(steps) => Self::NoConvergence { steps },
        }
    }
}
