//! Faults of inputs that are tolerated, as values.

/// A fault that was tolerated; complete when the input has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum InputFault {
    /// The file is shorter than its header says.
    #[error("the file is truncated: {missing_bytes} bytes that its header promises are missing")]
    Truncated {
        /// Number of missing bytes.
        missing_bytes: u64,
    },
    /// The last frame was cut and left out.
    #[error("the last frame is cut ({bytes} bytes of it are there) and was left out")]
    CutFrame {
        /// Number of its bytes that were present.
        bytes: usize,
    },
    /// The input ended before the last sample whose number at the converter is given.
    #[error("it ends before the last of the samples whose number is given")]
    TimestampsBeyondEnd,
    /// A SigMF recording does not state its rate.
    #[error("it states no core:sample_rate; the rate of the bank is assumed")]
    NoRate,
    /// Lines about lost samples came after their samples had been used.
    #[error("{lines} line{} about lost samples came after these samples had been used", if *.lines == 1 { "" } else { "s" })]
    LateLostLines {
        /// Number of lines.
        lines: u64,
    },
    /// The input is longer than the shortest one, which decided where to end.
    #[error(
        "longer than the shortest channel, {}{frames} samples per channel were not used",
        if *.at_least { "at least " } else { "" }
    )]
    Unused {
        /// Frames that were not used.
        frames: u64,
        /// There may be more frames, which were not read.
        at_least: bool,
    },
}

/// A fault with the input that has it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{input}: {fault}")]
pub struct InputWarning {
    /// Name of the input.
    pub input: String,
    /// What is wrong with it.
    pub fault: InputFault,
}
