//! Why a bank could not be made ready, a call was refused, or a plan was not taken over.

/// A bank that cannot run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BuildError {
    /// M is 0.
    #[error("the bank's ratio M is 0; a frame must give at least one output sample")]
    NoRatio,
    /// N is 0.
    #[error("the bank has no channels; at least one is needed")]
    NoChannels,
    /// The filters do not fit the channels.
    #[error("the bank has {delays} delays but {filters} filters; each channel needs one of both")]
    FilterCount {
        /// Delays in the bank.
        delays: usize,
        /// Filters in the bank.
        filters: usize,
    },
    /// The offsets do not fit the channels.
    #[error("{offsets} offsets are given for {channels} channels; each channel has one, 0 for none")]
    OffsetCount {
        /// Offsets given.
        offsets: usize,
        /// N.
        channels: usize,
    },
    /// A matrix of the state-space form has the wrong shape.
    #[error(
        "matrix {name} of the state-space filters is {rows} x {cols}; {wanted_rows} x {wanted_cols} is needed (N = {channels} channels, M = {ratio})"
    )]
    Shape {
        /// a, b, c or d.
        name: &'static str,
        /// Rows given.
        rows: usize,
        /// Columns given (of the first row that is wrong).
        cols: usize,
        /// Rows needed.
        wanted_rows: usize,
        /// Columns needed.
        wanted_cols: usize,
        /// N.
        channels: usize,
        /// M.
        ratio: usize,
    },
    /// A coefficient is NaN, infinite, or infinite once rounded to the kernel's precision.
    #[error(
        "coefficient {index} of {location} is {value}; coefficients must be finite in the precision of the kernel"
    )]
    NotFinite {
        /// Which filter or matrix.
        location: String,
        /// Its index there.
        index: usize,
        /// The value.
        value: f64,
    },
    /// The spectra of the filters would take gigabytes.
    #[error(
        "the spectra of {channels} x {ratio} filters of {lags} taps per phase are too large for overlap-save; choose `direct`"
    )]
    Spectra {
        /// N.
        channels: usize,
        /// M.
        ratio: usize,
        /// K.
        lags: usize,
    },
    /// An algorithm for FIR filters was asked for, but the filters are recursive.
    #[error("{algorithm} needs FIR filters, and this bank is recursive (IIR); use `direct` or `auto`")]
    Recursive {
        /// Its name.
        algorithm: &'static str,
    },
    /// The filters together are too long for 32-bit offsets.
    #[error(
        "the filters look back {history} frames on {channels} channels, more than the runtime can address; shorten them"
    )]
    TooLong {
        /// K - 1.
        history: usize,
        /// N.
        channels: usize,
    },
}

/// A call whose slices do not fit together; nothing was processed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ProcessError {
    /// The input is not a whole number of frames.
    #[error("the input holds {samples} samples, which is not a multiple of the {channels} channels")]
    PartialFrame {
        /// Samples given.
        samples: usize,
        /// N.
        channels: usize,
    },
    /// The channels of planar input differ in length.
    #[error(
        "channel {channel} has {samples} samples, channel 0 has {first}; all channels need the same number"
    )]
    UnequalChannels {
        /// Samples of channel 0.
        first: usize,
        /// The first channel that differs, from 0.
        channel: usize,
        /// Samples of that channel.
        samples: usize,
    },
    /// The input has another number of channels.
    #[error("the input has {given} channels, the bank has {wanted}")]
    Channels {
        /// Channels given.
        given: usize,
        /// N.
        wanted: usize,
    },
    /// The input claims more frames than there can be output samples for.
    #[error("the input has {frames} frames, whose {ratio} samples each are more than can be counted")]
    TooManyFrames {
        /// Frames of the input.
        frames: usize,
        /// M.
        ratio: usize,
    },
    /// The output slice is too short.
    #[error("the output has room for {given} samples, {wanted} are needed (M per frame)")]
    OutputTooShort {
        /// Samples of room.
        given: usize,
        /// Samples needed.
        wanted: usize,
    },
}

/// Bytes from which a stream cannot go on; it is as before.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StateError {
    /// Other bytes, part of a state, or a state of another version.
    #[error("these bytes are no state of a stream of this version of hybank; give what `state` returned")]
    NotAState,
    /// Another bank, algorithm or number type.
    #[error(
        "this state belongs to another plan; go on with the bank, the algorithm and the number type that made it"
    )]
    OtherPlan,
    /// The numbers cannot be those of a stream.
    #[error("this state was cut short or changed; its numbers do not fit the plan")]
    Damaged,
}
