//! Checks that the inputs fit the bank.

use super::print::{Failure, is_dash};
use hybank::bank::Bank;
use hybank::io::MultiReader;
use hybank::pipeline::matching;
use std::path::Path;

/// `-` may be given once.
pub(super) fn check_stdin<'a>(inputs: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
    if inputs.filter(|path| is_dash(path)).count() > 1 {
        return Err(Failure::Usage("`-` is given twice; standard input can be only one of them".into()));
    }
    Ok(())
}

/// The inputs together have the channels of the bank in the file `path`; the rate of the output in hertz.
pub(super) fn output_rate(bank: &Bank, path: &Path, reader: &MultiReader) -> Result<f64, Failure> {
    matching::check_channels(bank, &path.display().to_string(), reader).map_err(Failure::input)?;
    matching::output_rate(bank, reader).map_err(Failure::input)
}
