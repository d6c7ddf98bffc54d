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

/// All inputs, with name and rate, at the slow rate 1 / (M h), to the hertz that a header can say; at
/// any common rate for a bank in normalised time. Returns that rate.
pub(super) fn check_rates<'a>(
    bank: &Bank,
    mut inputs: impl Iterator<Item = (&'a str, u32)>,
) -> Result<u32, Failure> {
    let Some((first, rate)) = inputs.next() else {
        return Err(Failure::Usage("no input".into()));
    };
    if let Some((name, other)) = inputs.find(|&(_, other)| other != rate) {
        return Err(Failure::Input(format!(
            "{name}: the sample rate is {other} Hz, but {first} has {rate} Hz; all channels need the same rate"
        )));
    }
    let wanted = 1.0 / bank.slow_period();
    if bank.fast_period != 1.0 && (f64::from(rate) - wanted).abs() > 0.5 {
        return Err(Failure::Input(format!(
            "{first}: the sample rate is {rate} Hz, but the bank is designed for slow channels of {wanted} Hz; \
             record at that rate or design a bank for this one"
        )));
    }
    Ok(rate)
}

/// The rate of the output in hertz.
pub(super) fn fast_rate(bank: &Bank, slow_rate: u32) -> Result<u32, Failure> {
    let rate = if bank.fast_period == 1.0 {
        f64::from(slow_rate) * bank.ratio as f64
    } else {
        (1.0 / bank.fast_period).round().max(1.0)
    };
    if rate > f64::from(u32::MAX) {
        return Err(Failure::Input(format!(
            "the fast rate of {rate} Hz does not fit a WAV header; write raw samples with `hybank stream`"
        )));
    }
    Ok(rate as u32)
}
