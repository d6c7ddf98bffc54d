//! The captures of all channels in memory.

use super::super::Failure;
use super::super::capture_args::CaptureArgs;
use super::super::capture_file::Whole;
use super::super::file_kind::unreadable;
use super::super::interrupt::interrupts;
use crate::calibrate::Record;
use crate::io::{MultiReader, PcmFormat, ReadOptions, TimeInterleaving};
use crate::spec::Spec;
use std::path::PathBuf;

/// Most samples of all channels together: 512 MiB as doubles.
const MOST_SAMPLES: usize = 1 << 26;

/// How captures are read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading<'a> {
    /// Their format.
    pub(super) captures: CaptureArgs,
    /// The converters that take turns in one file, if they do.
    pub(super) turns: Option<&'a TimeInterleaving>,
    /// Samples of this size and more are clipped.
    pub(super) clip: Option<f64>,
}

/// One record per channel of `spec`, and what was tolerated.
pub(super) fn read(
    paths: &[PathBuf],
    spec: &Spec,
    reading: Reading<'_>,
) -> Result<(Vec<Record>, Vec<String>), Failure> {
    let captures = reading.captures.options(paths.len(), spec.channels.len());
    let options = ReadOptions { interleaving: reading.turns, ..captures };
    let reader = MultiReader::start(paths, options, interrupts()).map_err(unreadable)?;
    let mut reader = reader.ok_or_else(|| Failure::input("interrupted; nothing was written"))?;
    check_channels(spec, &reader)?;
    check_rate(spec, &reader)?;
    let parts = if reader.is_complex() { 2 } else { 1 };
    let most = MOST_SAMPLES / (parts * reader.channels()).max(1);
    let headers = reader.headers();
    let formats =
        headers.flat_map(|(_, header)| std::iter::repeat_n(header.layout.format, parts * header.channels));
    let formats: Vec<PcmFormat> = formats.collect();
    let Whole { channels, is_cut } = Whole::read_parts(&mut reader, most)?;
    let mut warnings: Vec<String> = reader.warnings().iter().map(ToString::to_string).collect();
    if is_cut {
        warnings.push(format!("only the first {most} frames are used"));
    }
    let records = channels.into_iter().zip(formats);
    let mut records = records.map(|(samples, format)| record(samples, format, reading.clip));
    let mut all = Vec::new();
    while let Some(record) = records.next() {
        let imaginary = if parts == 2 { records.next() } else { None };
        all.push(match imaginary {
            Some(imaginary) => Record::complex(record, imaginary),
            None => record,
        });
    }
    Ok((all, warnings))
}

fn check_channels(spec: &Spec, reader: &MultiReader) -> Result<(), Failure> {
    let (wanted, given) = (spec.channels.len(), reader.channels());
    if given == wanted {
        return Ok(());
    }
    let names: Vec<&str> = reader.headers().map(|(name, _)| name).collect();
    Err(Failure::Input(format!(
        "the spec has {wanted} channels, but the captures have {given} ({}); give one mono recording per channel, \
         one of {wanted} channels, or one in which the converters take turns and --interleaved {wanted}",
        names.join(", ")
    )))
}

/// The captures have the slow rate of the spec, as far as they state it; any for a spec in normalised time.
fn check_rate(spec: &Spec, reader: &MultiReader) -> Result<(), Failure> {
    let wanted = (spec.fast_period * spec.ratio as f64).rate().0;
    let wrong = reader.headers().find_map(|(name, header)| Some((name, header.other_rate(wanted)?)));
    match wrong {
        Some((name, rate)) if !spec.is_normalised() => Err(Failure::Input(format!(
            "{name}: the sample rate is {rate} Hz, but the spec says {wanted} Hz; record at that rate or correct the spec"
        ))),
        _ => Ok(()),
    }
}

/// Integers clip at the ends of their range. Floats within +-1 clip there, or at 1 - q if that is their
/// largest value and all are multiples of q, a power of two: the steps of a converter.
fn record(samples: Vec<f64>, format: PcmFormat, clip: Option<f64>) -> Record {
    if let Some(level) = clip {
        return Record::within(samples, -level, level);
    }
    match format {
        _ if !format.is_float() => {
            let step = 2f64.powi(1 - 8 * format.bytes() as i32);
            Record::within(samples, -1.0, 1.0 - step)
        }
        _ if samples.iter().all(|x| x.is_nan() || x.abs() <= 1.0) => {
            let top = samples.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let step = 1.0 - top;
            let is_code = |x: &f64| x.is_nan() || (x / step).fract() == 0.0;
            let is_quantised = step > 0.0 && step.log2().fract() == 0.0 && samples.iter().all(is_code);
            Record::within(samples, -1.0, if is_quantised { top } else { 1.0 })
        }
        _ => Record::new(samples),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_clip_at_the_ends_of_their_range_and_floats_at_one() {
        let clipped = |samples: &[f64], format, clip| record(samples.to_vec(), format, clip).clipped;
        assert_eq!(clipped(&[-1.0, 0.0, 32767.0 / 32768.0, 0.99], PcmFormat::S16Le, None), 2);
        assert_eq!(clipped(&[-1.0, 0.0, 1.0, 0.99], PcmFormat::F32Le, None), 2);
        assert_eq!(clipped(&[-1.0, 0.0, 2047.0 / 2048.0, 0.5], PcmFormat::F32Le, None), 2);
        assert_eq!(clipped(&[-1.0, 0.0, 0.9375, 0.9], PcmFormat::F32Le, None), 1);
        assert_eq!(clipped(&[-1.0, 0.0, 1.5, 0.99], PcmFormat::F32Le, None), 0);
        assert_eq!(clipped(&[-1.0, 0.0, 1.5, 0.99], PcmFormat::F32Le, Some(0.99)), 3);
    }
}
