//! Checks that the inputs fit the bank.

use super::print::{Failure, is_dash};
use crate::bank::{Bank, FrameLayout};
use crate::io::{MultiReader, StreamHeader, is_same_rate};
use crate::messages::{Number, Quoted};
use std::path::Path;

/// `-` may be given once.
pub(super) fn check_stdin<'a>(inputs: impl Iterator<Item = &'a Path>) -> Result<(), Failure> {
    if inputs.filter(|path| is_dash(path)).count() > 1 {
        return Err(Failure::Usage("`-` is given twice; standard input can be only one of them".into()));
    }
    Ok(())
}

/// Samples per frame of each of so many inputs, for the reader: those of the converters, where each has an
/// input and a rate of its own.
pub(super) fn samples_per_frame(layout: &FrameLayout, inputs: usize) -> &[usize] {
    if !layout.is_plain() && inputs == layout.samples().len() { layout.samples() } else { &[] }
}

/// Channels of each raw input: one of each converter, or all samples of a frame in a single input.
pub(super) fn channels_of_raw(layout: &FrameLayout, inputs: usize) -> usize {
    if inputs == 1 && samples_per_frame(layout, inputs).is_empty() { layout.count() } else { 1 }
}

/// The inputs together have the bank's N channels.
pub(super) fn check_channels(bank: &Bank, path: &Path, reader: &MultiReader) -> Result<(), Failure> {
    let (given, wanted) = (reader.channels(), bank.frame_samples());
    if given == wanted {
        return Ok(());
    }
    let files: Vec<_> =
        reader.headers().map(|(name, header)| format!("{}: {}", Quoted(name), header.channels)).collect();
    if !bank.layout().is_plain() {
        let converters = bank.channel_count();
        return Err(Failure::Input(format!(
            "{} has {converters} converters with rates of their own and {wanted} samples per frame, but the input has {} ({}); \
             give one mono recording per converter, or one of whole frames with {wanted} channels",
            Quoted(path),
            given,
            files.join(", ")
        )));
    }
    Err(Failure::Input(format!(
        "{} has {wanted} channels, but the input has {given} ({}); give one mono recording per channel or one of {wanted} channels",
        Quoted(path),
        files.join(", ")
    )))
}

/// The rate of the output in hertz: the bank's own, or that of the inputs for a bank in normalised time.
///
/// # Errors
/// Inputs whose rates differ, or are not the bank's 1 / (M h).
pub(super) fn output_rate(bank: &Bank, reader: &MultiReader) -> Result<f64, Failure> {
    match input_rate(bank, reader.headers(), &reader.samples_per_frame())? {
        Some(rate) if bank.is_normalised() => Ok(rate * bank.ratio as f64),
        _ => Ok(1.0 / bank.fast_period.0),
    }
}

/// The common rate of the frames of the inputs, where they state a rate: 1 / (M h), or any for a bank in
/// normalised time. Input i has `samples[i]` samples per frame.
fn input_rate<'a>(
    bank: &Bank,
    inputs: impl Iterator<Item = (&'a str, &'a StreamHeader)>,
    samples: &[usize],
) -> Result<Option<f64>, Failure> {
    let inputs = inputs
        .zip(samples)
        .filter_map(|((name, header), &samples)| Some((name, header, header.rate?, samples)));
    if samples.iter().any(|&samples| samples > 1) {
        return rate_of_frames(bank, inputs);
    }
    let mut inputs = inputs.map(|(name, header, rate, _)| (name, header, rate));
    let Some((first, header, rate)) = inputs.next() else {
        return Ok(None);
    };
    let differs = |other: f64, error: f64| !is_same_rate(other, rate, error.max(header.rate_error));
    if let Some((name, _, other)) = inputs.find(|(_, other, rate)| differs(*rate, other.rate_error)) {
        return Err(Failure::Input(format!(
            "{}: the sample rate is {} Hz, but {} has {} Hz; all channels need the same rate",
            Quoted(name),
            Number(other),
            Quoted(first),
            Number(rate)
        )));
    }
    let wanted = 1.0 / bank.slow_period().0;
    if !bank.is_normalised() && header.other_rate(wanted).is_some() {
        return Err(Failure::Input(format!(
            "{}: the sample rate is {} Hz, but the bank is designed for slow channels of {} Hz; \
             record at that rate or design a bank for this one",
            Quoted(first),
            Number(rate),
            Number(wanted)
        )));
    }
    Ok(Some(rate))
}

/// As [`input_rate`], for converters with rates of their own; each input comes with its samples per frame.
fn rate_of_frames<'a>(
    bank: &Bank,
    inputs: impl Iterator<Item = (&'a str, &'a StreamHeader, f64, usize)>,
) -> Result<Option<f64>, Failure> {
    let mut frames = (!bank.is_normalised()).then(|| 1.0 / bank.slow_period().0);
    for (name, header, rate, samples) in inputs {
        let wanted = *frames.get_or_insert(rate / samples as f64) * samples as f64;
        if header.other_rate(wanted).is_some() {
            return Err(Failure::Input(format!(
                "{}: the sample rate is {} Hz, but the bank takes {} Hz there, {samples} samples per frame; give the \
                 recordings in the order of the converters, record at that rate, or design a bank for this one",
                Quoted(name),
                Number(rate),
                Number(wanted)
            )));
        }
    }
    Ok(frames)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bank::SynthesisFilters;
    use crate::io::{PcmFormat, SampleLayout};
    use crate::units::Seconds;

    #[test]
    fn a_rate_four_percent_off_is_another_rate() {
        let taps = SynthesisFilters::Fir(vec![vec![1.0]; 2]);
        let bank = Bank { fast_period: Seconds(0.05), ..Bank::bare(taps, 2) };
        let header = |rate| StreamHeader {
            rate: Some(rate),
            ..StreamHeader::real(SampleLayout::packed(PcmFormat::F32Le), 1)
        };
        let rate = |a: f64, b: f64| {
            input_rate(&bank, [("a", &header(a)), ("b", &header(b))].into_iter(), &[1, 1]).ok()
        };
        assert_eq!(rate(10.0, 10.0), Some(Some(10.0)));
        for (a, b) in [(10.4, 10.4), (10.0, 10.4), (10.4, 10.0)] {
            assert_eq!(rate(a, b), None, "{a} {b}");
        }
    }
}
