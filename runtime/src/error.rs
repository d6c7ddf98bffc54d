//! Why a bank could not be made ready, or a call was refused.

/// A bank that cannot run.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildError {
    /// M is 0.
    #[error("the bank's ratio M is 0; a tick must give at least one fast sample")]
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
        "coefficient {index} of {place} is {value}; coefficients must be finite in the precision of the kernel"
    )]
    NotFinite {
        /// Which filter or matrix.
        place: String,
        /// Position in it.
        index: usize,
        /// The value.
        value: f64,
    },
    /// No transform of this length holds the filters.
    #[error(
        "a transform of {len} ticks does not fit filters of {lags} ticks: overlap-save needs a power of two from {shortest} to 16777216 that is no shorter than the filters; choose another length or the direct form"
    )]
    Transform {
        /// F.
        len: usize,
        /// K.
        lags: usize,
        /// The least F.
        shortest: usize,
    },
    /// The spectra of the filters would take gigabytes.
    #[error(
        "the spectra of {channels} x {ratio} filters over {len} ticks are too large for overlap-save; choose a shorter transform or the direct form"
    )]
    Spectra {
        /// N.
        channels: usize,
        /// M.
        ratio: usize,
        /// F.
        len: usize,
    },
    /// A form of FIR filters was asked for, but the filters never forget.
    #[error("{form} needs FIR filters, and this bank is recursive; leave the form to the plan")]
    Recursive {
        /// The form.
        form: &'static str,
    },
    /// The fast form was asked for, but the filters cannot be halved.
    #[error(
        "the fast form halves filters of at least 2 ticks, and these reach over {lags} (taps / M); choose the direct form"
    )]
    TooShort {
        /// K.
        lags: usize,
    },
    /// The filters together are too long for 32-bit offsets.
    #[error(
        "the filters look back {history} ticks on {channels} channels, more than the runtime can address; shorten them"
    )]
    TooLong {
        /// Ticks of memory.
        history: usize,
        /// N.
        channels: usize,
    },
}

/// A call whose slices do not fit together; nothing was processed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ProcessError {
    /// The input is not a whole number of ticks.
    #[error("the input holds {samples} samples, which is not a multiple of the {channels} channels")]
    CutTick {
        /// Samples given.
        samples: usize,
        /// N.
        channels: usize,
    },
    /// The input has another number of channels.
    #[error("the input has {given} channels, the bank has {wanted}")]
    Channels {
        /// Channels given.
        given: usize,
        /// N.
        wanted: usize,
    },
    /// The output slice is too short.
    #[error("the output has room for {given} samples, {wanted} are needed (M for each tick)")]
    OutputTooShort {
        /// Samples of room.
        given: usize,
        /// Samples needed.
        wanted: usize,
    },
}
