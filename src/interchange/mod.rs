//! Banks for other tools (C99, Verilog, tables, memory images of FPGAs, MATLAB files), and taps of other
//! tools.
//!
//! The order of FIR taps is the same in every format: channel, then phase p of the output, then lag j in
//! slow periods. Entry (i, p, j) is the tap `f_i[p + j M]`, so
//!
//! ```text
//! y[kM+p] = sum over j and i of  f_i[p + j M] (x_i[k - j] - offset_i).
//! ```
//!
//! ```
//! use hybank::bank::{Bank, SynthesisFilters};
//! use hybank::interchange::{Format, PolyphaseTaps, export, taps_of_csv};
//! let taps = vec![vec![0.5, -0.25, 1.0], vec![0.0, 2.0, -1.5]];
//! let bank = Bank::bare(SynthesisFilters::Fir(taps.clone()), 2);
//! let table = export(&bank, Format::Csv, "bank", None)?;
//! assert!(table.starts_with(b"channel,phase,lag,value\n1,0,0,5e-1\n1,0,1,1e0\n1,1,0,-2.5e-1\n"));
//! let ordered = PolyphaseTaps::new(&taps, bank.ratio);
//! assert_eq!((ordered.get(1, 0, 1), ordered.nonzero()), (-1.5, 5));
//! // The shorter phase is padded with a zero.
//! assert_eq!(taps_of_csv(&table)?[0], [0.5, -0.25, 1.0, 0.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arrays;
mod bit_true;
mod c99;
mod error;
mod layout;
mod read_taps;
mod sections;
mod straightening;
mod tables;
mod verilog;

pub use bit_true::{BitTrue, WordSizes};
pub use error::ExportError;
use error::check_straight;
pub use layout::{PolyphaseTaps, sparse_rows};
pub use read_taps::{TapsError, taps_of_csv, taps_of_npy};
pub use sections::{Section, block_of_sections, sections};
pub use verilog::{Circuit, MOST_RANDOM_FRAMES, Verilog, VerilogOptions};

use crate::bank::Bank;

/// A format of [`export`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// A C99 header with a streaming function.
    C99,
    /// Comma-separated values, one coefficient per line.
    Csv,
    /// A MATLAB file (level 4), which SciPy reads too.
    Mat,
    /// A coefficient file of Xilinx tools.
    Coe,
    /// Hexadecimal words for $readmemh.
    Mem,
    /// Second-order sections (CSV).
    Sos,
    /// A module in Verilog-2001.
    Verilog,
}

/// The bytes of `bank` in `format`. `name` is the prefix of the C identifiers. Integer code subtracts the
/// offsets from samples of `input_bits`, of which 2^(`input_bits` - 1) is full scale; without offsets it may
/// have any bits.
///
/// # Errors
/// [`ExportError`] if the format cannot hold the bank.
pub fn export(
    bank: &Bank,
    format: Format,
    name: &str,
    input_bits: Option<u32>,
) -> Result<Vec<u8>, ExportError> {
    if format != Format::Verilog {
        check_straight(bank)?;
    }
    let is_code = matches!(format, Format::C99 | Format::Coe | Format::Mem | Format::Verilog);
    if input_bits.is_some() && !(is_code && bank.fixed_point.is_some()) {
        return Err(ExportError::NoWords);
    }
    match format {
        Format::C99 => c99::header(bank, name, input_bits).map(String::into_bytes),
        Format::Verilog => {
            let options = VerilogOptions { input_bits, ..VerilogOptions::default() };
            Ok(Verilog::new(bank, name, &options)?.text.into_bytes())
        }
        Format::Csv => Ok(tables::csv(bank).into_bytes()),
        Format::Mat => arrays::mat(bank),
        Format::Coe => tables::coe(bank, input_bits).map(String::into_bytes),
        Format::Mem => tables::mem(bank, input_bits).map(String::into_bytes),
        Format::Sos => {
            let list = sections(bank)?;
            Ok((tables::offsets(bank) + &sections::table(&list)).into_bytes())
        }
    }
}

#[cfg(test)]
mod tests;
