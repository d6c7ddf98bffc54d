//! Faults of inputs that are tolerated, as values.

use std::fmt;

/// A fault that was tolerated; complete when the input has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputFault {
    /// The file is shorter than its header says.
    Truncated {
        /// Number of missing bytes.
        missing_bytes: u64,
    },
    /// The last frame was cut and left out.
    CutFrame {
        /// Number of its bytes that were present.
        bytes: usize,
    },
    /// The input ended before the last sample whose number at the converter is given.
    TimestampsBeyondEnd,
    /// A SigMF recording does not state its rate.
    NoRate,
    /// Lines about lost samples came after their samples had been used.
    LateLostLines {
        /// Number of lines.
        lines: u64,
    },
    /// The input is longer than the shortest one, which decided where to end.
    Unused {
        /// Frames that were not used.
        frames: u64,
        /// There may be more frames, which were not read.
        at_least: bool,
    },
}

impl fmt::Display for InputFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated { missing_bytes } => {
                write!(f, "the file is truncated: {missing_bytes} bytes that its header promises are missing")
            }
            Self::CutFrame { bytes } => {
                write!(f, "the last frame is cut ({bytes} bytes of it are there) and was left out")
            }
            Self::TimestampsBeyondEnd => {
                write!(f, "it ends before the last of the samples whose number is given")
            }
            Self::NoRate => write!(f, "it states no core:sample_rate; the rate of the bank is assumed"),
            Self::LateLostLines { lines } => {
                let ending = if *lines == 1 { "" } else { "s" };
                write!(f, "{lines} line{ending} about lost samples came after these samples had been used")
            }
            Self::Unused { frames, at_least } => {
                let at_least = if *at_least { "at least " } else { "" };
                write!(
                    f,
                    "longer than the shortest channel, {at_least}{frames} samples per channel were not used"
                )
            }
        }
    }
}

/// A fault with the input that has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputWarning {
    /// Name of the input.
    pub input: String,
    /// What is wrong with it.
    pub fault: InputFault,
}

impl fmt::Display for InputWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.input, self.fault)
    }
}
