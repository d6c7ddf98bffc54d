//! Checks that recordings fit a bank.
//!
//! ```
//! use hybank_core::bank::{Bank, SynthesisFilters};
//! use hybank_core::io::{Coding, MultiReader, PcmFormat, ReadOptions};
//! use hybank_core::pipeline::matching::{InputMismatch, check_channels};
//! let path = std::env::temp_dir().join(format!("hybank-matching-{}.raw", std::process::id()));
//! std::fs::write(&path, [0; 16])?;
//! let options = ReadOptions { coding: Coding::Raw(PcmFormat::S16Le), ..ReadOptions::files() };
//! let reader = MultiReader::start(&[path.clone()], options, &mut |_| {})?;
//! let bank = Bank::bare(SynthesisFilters::Fir(vec![vec![1.0], vec![0.5]]), 2);
//! let refused = check_channels(&bank.layout(), "bank.json", &reader);
//! assert!(matches!(refused, Err(InputMismatch::Channels { wanted: 2, given: 1, .. })));
//! # std::fs::remove_file(path)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::bank::{Bank, FrameLayout};
use crate::io::{MultiReader, StreamHeader, TimeInterleaving, is_same_rate};
use crate::messages::{Number, Quoted, counted};
use crate::spec::Spec;
use crate::units::FastPeriods;

/// The clocks of instruments differ by less.
const MOST_CLOCK_ERROR: f64 = 1e-3;

/// What is said of a table whose first column is no channel.
const LEFT_OUT: &str =
    " without the first column, a steady ramp like a time; if it is a channel, --time-column none";

/// Recordings that do not fit a bank.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InputMismatch {
    /// Another number of channels.
    #[error(
        "{} has {there}, but the input has {given} ({files}); give one mono recording per channel or one of {there}{}",
        Quoted(.name), in_turn(*.given, *.wanted), there = counted(.wanted, "channel")
    )]
    Channels {
        /// The name of the bank or the spec.
        name: String,
        /// Its channels.
        wanted: usize,
        /// Channels of the inputs.
        given: usize,
        /// Those of each input.
        files: String,
    },
    /// Another number of samples per frame.
    #[error(
        "{} has {converters} converters with rates of their own and {wanted} samples per frame, but the input has {given} \
         ({files}); give one mono recording per converter, or one of whole frames with {wanted} channels",
        Quoted(.name)
    )]
    Samples {
        /// The name of the bank or the spec.
        name: String,
        /// Its converters.
        converters: usize,
        /// Samples of a frame.
        wanted: usize,
        /// Channels of the inputs.
        given: usize,
        /// Those of each input.
        files: String,
    },
    /// Two inputs with different rates.
    #[error(
        "{}: the sample rate is {} Hz, but {} has {} Hz; all channels need the same rate",
        Quoted(.input), Number(*.rate), Quoted(.other), Number(*.other_rate)
    )]
    Rates {
        /// One input.
        input: String,
        /// Its rate in hertz.
        rate: f64,
        /// The first input.
        other: String,
        /// Its rate in hertz.
        other_rate: f64,
    },
    /// Two inputs whose times begin more than a sample apart.
    #[error(
        "{}: its times begin {} s {} those of {}; cut the recordings to a common start, or leave out the times (columns, bext chunks) if \
         their clocks have no common zero",
        Quoted(.input), Number(.apart.abs()), if *.apart > 0.0 { "after" } else { "before" }, Quoted(.other)
    )]
    Begins {
        /// One input.
        input: String,
        /// The first input with times.
        other: String,
        /// Seconds from the beginning of the other one to that of this one.
        apart: f64,
    },
    /// A rate that is not the bank's.
    #[error(
        "{}: the sample rate is {} Hz, but the bank is designed for slow channels of {} Hz there; give the recordings in \
         the order of the converters, record at that rate, or design a bank for this one{}",
        Quoted(.input), Number(*.rate), Number(*.wanted), clocks(*.rate / *.wanted)
    )]
    Rate {
        /// The input.
        input: String,
        /// Its rate in hertz.
        rate: f64,
        /// That of the converter in hertz.
        wanted: f64,
    },
    /// A rate that is not that of the spec.
    #[error(
        "{}: the sample rate is {} Hz, but the spec says {} Hz; record at that rate or correct the spec",
        Quoted(.input), Number(*.rate), Number(*.wanted)
    )]
    SpecRate {
        /// The input.
        input: String,
        /// Its rate in hertz.
        rate: f64,
        /// That of the spec in hertz.
        wanted: f64,
    },
}

/// What a single recording of one channel may be instead.
fn in_turn(given: usize, wanted: usize) -> String {
    match given {
        1 => format!(", or --interleaved {wanted} if the converters take turns in this one"),
        _ => String::new(),
    }
}

/// What helps where rates differ by no more than clocks do.
fn clocks(ratio: f64) -> String {
    let error = (ratio - 1.0).abs();
    if error > MOST_CLOCK_ERROR {
        return String::new();
    }
    format!(
        ". If it is only the clock that differs, give the recording without its rate (of a table, without the column of \
         time): the delays then drift by {error:.1e} s per second"
    )
}

/// Converters that do not take turns.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NotInTurn {
    /// They have rates of their own.
    #[error(
        "the converters have rates of their own, so they do not sample in turn; give one recording per converter"
    )]
    OwnRates,
    /// Another number of converters.
    #[error("there are {channels} channels, and each of them is one converter; give {channels}")]
    Count {
        /// Channels of the bank or the spec.
        channels: usize,
    },
    /// They sample too far apart.
    #[error(
        "the delays lie {apart} fast periods apart, so converters with a slow period of {ratio} do not sample in turn; \
         give one recording per channel"
    )]
    Apart {
        /// Distance of the delays in fast periods.
        apart: f64,
        /// Fast periods of the slow period.
        ratio: usize,
    },
}

/// The order in which `converters` converters with these delays take turns in one recording.
///
/// # Errors
/// [`NotInTurn`].
pub fn interleaving(
    converters: usize,
    delays: &[FastPeriods],
    layout: &FrameLayout,
) -> Result<TimeInterleaving, NotInTurn> {
    let (channels, ratio) = (delays.len(), layout.ratio());
    if !layout.is_plain() {
        return Err(NotInTurn::OwnRates);
    }
    if channels != converters {
        return Err(NotInTurn::Count { channels });
    }
    let delays: Vec<f64> = delays.iter().map(|delay| delay.0).collect();
    let extreme = |of: fn(f64, f64) -> f64| delays.iter().copied().reduce(of).unwrap_or(0.0);
    let apart = extreme(f64::max) - extreme(f64::min);
    if apart >= ratio as f64 {
        return Err(NotInTurn::Apart { apart, ratio });
    }
    Ok(TimeInterleaving::by_delay(&delays))
}

/// Samples per frame of each of so many inputs, for the reader: those of the converters, where each has an
/// input and a rate of its own.
pub fn samples_per_frame(layout: &FrameLayout, inputs: usize) -> &[usize] {
    if !layout.is_plain() && inputs == layout.samples().len() { layout.samples() } else { &[] }
}

/// Channels of each raw input: one of each converter, or all samples of a frame in a single input.
pub fn channels_of_raw(layout: &FrameLayout, inputs: usize) -> usize {
    if inputs == 1 && samples_per_frame(layout, inputs).is_empty() { layout.count() } else { 1 }
}

/// The inputs together have the N channels of the bank or the spec called `name`, whose frames are these.
///
/// # Errors
/// [`InputMismatch::Channels`] or [`InputMismatch::Samples`].
pub fn check_channels(layout: &FrameLayout, name: &str, reader: &MultiReader) -> Result<(), InputMismatch> {
    let (given, wanted) = (reader.channels(), layout.count());
    if given == wanted {
        return Ok(());
    }
    let left_out = |header: &StreamHeader| if header.is_ramp_left_out { LEFT_OUT } else { "" };
    let file = |(name, header): (&str, &StreamHeader)| {
        format!("{}: {}{}", Quoted(name), header.channels, left_out(header))
    };
    let files: Vec<_> = reader.headers().map(file).collect();
    let (name, files) = (name.to_owned(), files.join(", "));
    if layout.is_plain() {
        return Err(InputMismatch::Channels { name, wanted, given, files });
    }
    let converters = layout.samples().len();
    Err(InputMismatch::Samples { name, converters, wanted, given, files })
}

/// The rate of the output in hertz: the bank's own, or that of the inputs for a bank in normalised time.
///
/// # Errors
/// [`InputMismatch`]: rates that differ, or are not the bank's 1 / (M h), or times that begin apart.
pub fn output_rate(bank: &Bank, reader: &MultiReader) -> Result<f64, InputMismatch> {
    check_begins(reader.headers())?;
    match input_rate(bank, reader.headers(), &reader.samples_per_frame())? {
        Some(rate) if bank.is_normalised() => Ok(rate * bank.ratio as f64),
        _ => Ok(1.0 / bank.fast_period.0),
    }
}

/// The inputs have the slow rates of the spec, as far as they state them; any for a spec in normalised time.
///
/// # Errors
/// [`InputMismatch::SpecRate`].
pub fn check_rate(spec: &Spec, reader: &MultiReader) -> Result<(), InputMismatch> {
    let frames = (spec.fast_period * spec.ratio as f64).rate().0;
    let wrong = reader.headers().zip(reader.samples_per_frame()).find_map(|((name, header), samples)| {
        let wanted = frames * samples as f64;
        Some((name, header.other_rate(wanted)?, wanted))
    });
    match wrong {
        Some((name, rate, wanted)) if !spec.is_normalised() => {
            Err(InputMismatch::SpecRate { input: name.to_owned(), rate, wanted })
        }
        _ => Ok(()),
    }
}

/// Frames of one index belong together, so inputs that state their times begin within a sample of each
/// other.
fn check_begins<'a>(inputs: impl Iterator<Item = (&'a str, &'a StreamHeader)>) -> Result<(), InputMismatch> {
    let mut timed = inputs.filter_map(|(name, header)| Some((name, header.begin?, header.rate?)));
    let Some((other, begin, rate)) = timed.next() else { return Ok(()) };
    let mut apart = timed.map(|(name, at, own_rate)| (name, at - begin, own_rate.min(rate)));
    match apart.find(|(_, apart, rate)| apart.abs() * rate > 1.0) {
        Some((input, apart, _)) => {
            Err(InputMismatch::Begins { input: input.to_owned(), other: other.to_owned(), apart })
        }
        None => Ok(()),
    }
}

/// The common rate of the frames of the inputs, where they state a rate: 1 / (M h), or any for a bank in
/// normalised time. Input i has `samples[i]` samples per frame.
fn input_rate<'a>(
    bank: &Bank,
    inputs: impl Iterator<Item = (&'a str, &'a StreamHeader)>,
    samples: &[usize],
) -> Result<Option<f64>, InputMismatch> {
    let rated =
        inputs.zip(samples).filter_map(|((name, header), &of)| Some((name, header, header.rate?, of)));
    let rated: Vec<_> = rated.collect();
    if samples.iter().all(|&samples| samples == 1) {
        let common = common_rate(rated.iter().map(|&(name, header, ..)| (name, header)))?;
        if common.is_none() || bank.is_normalised() {
            return Ok(common);
        }
    }
    let mut frames = (!bank.is_normalised()).then(|| 1.0 / bank.slow_period().0);
    for (name, header, rate, samples) in rated {
        let wanted = *frames.get_or_insert(rate / samples as f64) * samples as f64;
        if header.other_rate(wanted).is_some() {
            // Without the rounding of the periods: it would be shown.
            let wanted = format!("{wanted:.11e}").parse().unwrap_or(wanted);
            return Err(InputMismatch::Rate { input: name.to_owned(), rate, wanted });
        }
    }
    Ok(frames)
}

/// The rate of the inputs that state one.
///
/// # Errors
/// [`InputMismatch::Rates`].
pub fn common_rate<'a>(
    inputs: impl Iterator<Item = (&'a str, &'a StreamHeader)>,
) -> Result<Option<f64>, InputMismatch> {
    let mut rated = inputs.filter_map(|(name, header)| Some((name, header, header.rate?)));
    let Some((first, of_first, common)) = rated.next() else { return Ok(None) };
    let error = |header: &StreamHeader| header.rate_error.max(of_first.rate_error);
    match rated.find(|&(_, header, rate)| !is_same_rate(rate, common, error(header))) {
        Some((input, _, rate)) => {
            let (input, other) = (input.to_owned(), first.to_owned());
            Err(InputMismatch::Rates { input, rate, other, other_rate: common })
        }
        None => Ok(Some(common)),
    }
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
        let header = header(10.0002);
        let error = input_rate(&bank, [("a", &header)].into_iter(), &[1, 1]).unwrap_err().to_string();
        assert!(error.ends_with("the delays then drift by 2.0e-5 s per second"), "{error}");
    }

    #[test]
    fn recordings_whose_times_begin_a_second_apart_are_refused() {
        let header = |begin| StreamHeader {
            rate: Some(10.0),
            begin,
            ..StreamHeader::real(SampleLayout::packed(PcmFormat::F64Le), 1)
        };
        let check = |a, b| check_begins([("a", &header(a)), ("b", &header(b))].into_iter());
        for (a, b) in [(None, Some(5.0)), (Some(5.0), Some(5.0)), (Some(5.05), Some(5.0))] {
            assert_eq!(check(a, b), Ok(()));
        }
        let error = check(Some(5.0), Some(4.0)).unwrap_err().to_string();
        assert!(error.starts_with("b: its times begin 1 s before those of a;"), "{error}");
    }
}
