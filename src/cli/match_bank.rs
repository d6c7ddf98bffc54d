//! Checks that the inputs fit the bank.

use super::Failure;
use crate::bank::Bank;
use crate::io::MultiReader;
use std::path::{Path, PathBuf};

/// `-` may be given once.
pub(super) fn check_stdin(bank: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    let all = inputs.iter().map(PathBuf::as_path).chain([bank]);
    if all.filter(|path| path.as_os_str() == "-").count() > 1 {
        return Err(Failure::Usage("`-` is given twice; standard input can be only one of them".into()));
    }
    Ok(())
}

/// The inputs together have the bank's N channels.
pub(super) fn check_channels(bank: &Bank, path: &Path, reader: &MultiReader) -> Result<(), Failure> {
    let (given, wanted) = (reader.channels(), bank.channel_count());
    if given == wanted {
        return Ok(());
    }
    let files: Vec<_> =
        reader.headers().map(|(name, header)| format!("{name}: {}", header.channels)).collect();
    Err(Failure::Input(format!(
        "{} has {wanted} channels, but the input has {given} ({}); give one mono recording per channel or one of {wanted} channels",
        path.display(),
        files.join(", ")
    )))
}

/// The rate of the output in hertz: the bank's own, or that of the inputs for a bank in normalised time.
///
/// # Errors
/// Inputs whose rates differ, or are not the bank's 1 / (M h).
pub(super) fn output_rate(bank: &Bank, reader: &MultiReader) -> Result<f64, Failure> {
    let rates = reader.headers().map(|(name, header)| (name, header.rate));
    match input_rate(bank, rates)? {
        Some(rate) if bank.is_normalised() => Ok(rate * bank.ratio as f64),
        _ => Ok(1.0 / bank.fast_period.0),
    }
}

/// The common rate of the inputs, where they say it: 1 / (M h), to the hertz that a header can say, or any
/// for a bank in normalised time.
fn input_rate<'a>(
    bank: &Bank,
    inputs: impl Iterator<Item = (&'a str, Option<f64>)>,
) -> Result<Option<f64>, Failure> {
    let mut inputs = inputs.filter_map(|(name, rate)| Some((name, rate?)));
    let Some((first, rate)) = inputs.next() else {
        return Ok(None);
    };
    if let Some((name, other)) = inputs.find(|&(_, other)| !same_rate(other, rate)) {
        return Err(Failure::Input(format!(
            "{name}: the sample rate is {other} Hz, but {first} has {rate} Hz; all channels need the same rate"
        )));
    }
    let wanted = 1.0 / bank.slow_period().0;
    if !bank.is_normalised() && !same_rate(rate, wanted) {
        return Err(Failure::Input(format!(
            "{first}: the sample rate is {rate} Hz, but the bank is designed for slow channels of {wanted} Hz; \
             record at that rate or design a bank for this one"
        )));
    }
    Ok(Some(rate))
}

/// Equal to the hertz, or to nine digits.
fn same_rate(a: f64, b: f64) -> bool {
    (a - b).abs() <= f64::max(0.5, 1e-9 * b)
}
