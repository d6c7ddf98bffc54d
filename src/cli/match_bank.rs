//! Do the inputs fit the bank?

use super::Failure;
use crate::bank::Bank;
use std::path::{Path, PathBuf};

/// `-` may be given once.
pub(super) fn check_stdin(bank: &Path, inputs: &[PathBuf]) -> Result<(), Failure> {
    let all = inputs.iter().map(PathBuf::as_path).chain([bank]);
    if all.filter(|path| path.as_os_str() == "-").count() > 1 {
        return Err(Failure::Usage("`-` is given twice; standard input can feed one of them only".into()));
    }
    Ok(())
}

/// The inputs, with name and channels, together have the bank's N channels.
pub(super) fn check_channels<'a>(
    bank: &Bank,
    path: &Path,
    inputs: impl Iterator<Item = (&'a str, usize)>,
) -> Result<(), Failure> {
    let inputs: Vec<_> = inputs.collect();
    let (given, wanted) = (inputs.iter().map(|(_, channels)| channels).sum::<usize>(), bank.channel_count());
    if given == wanted {
        return Ok(());
    }
    let files: Vec<_> = inputs.iter().map(|(name, channels)| format!("{name}: {channels}")).collect();
    Err(Failure::Input(format!(
        "{} wants {wanted} channels, the input has {given} ({}); give one mono recording a channel or one of {wanted} channels",
        path.display(),
        files.join(", ")
    )))
}

/// All inputs, with name and rate where they say it, at the slow rate 1 / (M h), to the hertz that a header
/// can say; at any common rate for a bank in normalised time. Returns that rate.
pub(super) fn check_rates<'a>(
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
    let wanted = 1.0 / bank.slow_period();
    if bank.fast_period != 1.0 && !same_rate(rate, wanted) {
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

/// The rate of the output in hertz: the bank's own, or that of the inputs for a bank in normalised time.
pub(super) fn fast_rate(bank: &Bank, slow_rate: Option<f64>) -> f64 {
    match slow_rate {
        Some(rate) if bank.fast_period == 1.0 => rate * bank.ratio as f64,
        _ => 1.0 / bank.fast_period,
    }
}
