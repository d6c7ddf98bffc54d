//! Why a bank cannot be exported.

use crate::bank::Bank;
use crate::messages::Quoted;

/// A format that cannot hold a bank.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The format holds integers.
    #[error(
        "{format} files hold integer taps, and this bank has none; design it with method = \"fir\" and bits"
    )]
    NoIntegers {
        /// Name of the format.
        format: &'static str,
    },
    /// Frames share a clock, or clocks a frame.
    #[error(
        "no circuit has {frames} frames per clock and {clocks} clocks per frame; one of them must be 1, and the frames \
         {most} at most"
    )]
    Clocks {
        /// Frames per clock.
        frames: u32,
        /// Clocks per frame.
        clocks: u32,
        /// The most frames per clock.
        most: u32,
    },
    /// A testbench of more random frames than a simulator runs.
    #[error("a testbench of {given} random frames is not written; ask for {most} at most")]
    Frames {
        /// Those asked for.
        given: u32,
        /// At most so many.
        most: u32,
    },
    /// The bank corrects a nonlinearity, for which the format has no place.
    #[error(
        "channel {channel} has a nonlinearity, which only `fuse`, `stream`, Python, the C library and Verilog with \
         constant taps correct; take it out of the spec, design the bank again, and correct the samples before the \
         filters"
    )]
    Nonlinearity {
        /// Number of the channel, from 1.
        channel: usize,
    },
    /// A table of a nonlinearity would have very many words.
    #[error(
        "a nonlinearity is taken out of integers by a table with a word for each code; samples of {bits} bits have too \
         many, {most} bits are the most. Use fewer bits, or take the nonlinearity out of the spec and correct the \
         samples before the filters"
    )]
    TableBits {
        /// Bits of the samples.
        bits: u32,
        /// Most bits.
        most: u32,
    },
    /// Integer code needs the full scale to which an offset is relative.
    #[error(
        "channel {channel} has the offset {offset} of full scale, and integers need the bits of the samples to \
         subtract it; state them"
    )]
    Offset {
        /// Number of the channel, from 1.
        channel: usize,
        /// The offset relative to full scale.
        offset: f64,
    },
    /// Sums could exceed 64 bits.
    #[error(
        "the integer taps of one output phase sum to {sum} in size; sums of {sample_bits}-bit samples may not fit \
         64 bits, give fewer bits"
    )]
    Accumulator {
        /// Largest sum of the moduli of a phase.
        sum: u64,
        /// Bits of the samples.
        sample_bits: u32,
    },
    /// The accumulator wraps around below the step of the outputs.
    #[error(
        "an accumulator of {accumulator} bits holds nothing above the {fraction_bits} fraction bits of the taps; \
         {needed} bits hold all sums"
    )]
    NothingLeft {
        /// Bits of the accumulator.
        accumulator: u32,
        /// Of the taps.
        fraction_bits: i32,
        /// Bits that hold all sums.
        needed: u32,
    },
    /// A word that the model does not have.
    #[error("{bits} bits for {word}; give 2 to {most}")]
    Words {
        /// The word: that of the samples, of the accumulator or of the outputs.
        word: &'static str,
        /// Its bits.
        bits: u32,
        /// The most bits.
        most: u32,
    },
    /// Bits of samples for a format without integers.
    #[error(
        "bits of the samples have no meaning here: only the integer code of a bank with integer taps has words"
    )]
    NoWords,
    /// The bank is no sum of sections.
    #[error("no second-order sections: {0}")]
    NoSections(&'static str),
    /// A name that C or Verilog does not allow.
    #[error(
        "\"{}\" is no {language} identifier; use letters, digits and underscores, a letter first, and no word of \
         the language",
        Quoted(.name)
    )]
    Name {
        /// The name.
        name: String,
        /// C or Verilog.
        language: &'static str,
    },
    /// A module cannot have the name of a port or of a signal in it.
    #[error("\"{}\" is the name of a signal in the module; give the module another name", Quoted(.name))]
    NameOfSignal {
        /// The name.
        name: String,
    },
    /// Code of which the words are the ports needs the bits of the samples.
    #[error("the bits of the samples are the widths of the ports, and no channel of the spec states them")]
    NoInputBits,
    /// MATLAB's files count rows and columns in 32 bits.
    #[error("\"{name}\" has {rows} x {columns} numbers, more than a .mat file can hold; write a table (csv)")]
    TooLarge {
        /// The array.
        name: &'static str,
        /// Its rows.
        rows: usize,
        /// Its columns.
        columns: usize,
    },
}

/// Refuses a bank that corrects nonlinearities.
pub(super) fn check_straight(bank: &Bank) -> Result<(), ExportError> {
    match bank.nonlinearity.iter().position(|curve| !curve.is_straight()) {
        Some(i) => Err(ExportError::Nonlinearity { channel: i + 1 }),
        None => Ok(()),
    }
}
