//! How converters change while captures are taken: blocks of the captures are calibrated one after another,
//! and smooth courses go through what they say.

use super::estimates::{Calibration, ChannelEstimate};
use super::reading::{LevelChange, LevelCourses, Reading, course, extremes, range};
use super::record::Record;
use super::{CalibrateError, CalibrationSettings, CalibrationSignal, FittedValues, calibrate};
use crate::sampling::{Known, LearnedCourse, median};
use crate::sine_fit::Estimate;
use crate::spec::Spec;
use crate::units::{FastPeriods, Seconds};
use rayon::prelude::*;

/// Most blocks where none are asked for, and the frames of each of them, at least.
const USUAL_BLOCKS: usize = 64;
const USUAL_FRAMES: usize = 2048;
/// Blocks that say how a course bends, at least.
const LEAST_BLOCKS: usize = 8;
/// Share of the blocks that are measured, at least.
const LEAST_SHARE: f64 = 0.5;

/// Delays, gains and offsets over the time of some captures.
#[derive(Debug, Clone)]
pub struct Track {
    /// Blocks of the captures, and those of them that could be calibrated.
    pub blocks: usize,
    /// Of these.
    pub measured: usize,
    /// At the first frame, in the middle of each measured block, and at the last frame.
    pub readings: Vec<Reading>,
    /// By how much each channel changes.
    pub changes: Vec<ChannelChange>,
    /// The middle of each course, with intervals that hold it, and the median of the misfits of the blocks.
    pub calibration: Calibration,
}

/// By how much a converter changes; 0 where no change stands out of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChannelChange {
    /// Largest less least delay.
    pub delay: FastPeriods,
    /// Gain and offset.
    pub levels: LevelChange,
}

/// What a block says.
struct Block {
    /// The frame in its middle.
    middle: f64,
    found: Calibration,
}

/// Follows the delays, gains and offsets of the channels of `spec`, which has their mean values, over
/// `records` that are calibrated by `signal`: those of them that `settings` fit. A block has
/// `frames_per_block` frames, or as many as make 64 blocks.
///
/// # Errors
/// [`CalibrateError::FewBlocks`] for fewer than eight blocks, [`CalibrateError::BlocksNotMeasured`] if most
/// of them cannot be calibrated, [`CalibrateError::OwnRates`].
pub fn track(
    spec: &Spec,
    records: &[Record],
    signal: &CalibrationSignal,
    settings: CalibrationSettings,
    frames_per_block: Option<usize>,
) -> Result<Track, CalibrateError> {
    if !spec.layout().is_plain() {
        return Err(CalibrateError::OwnRates);
    }
    let frames = records.iter().map(|record| record.samples.len()).min().unwrap_or(0);
    let usual = frames.div_ceil(USUAL_BLOCKS).max(USUAL_FRAMES);
    let length = frames_per_block.unwrap_or(usual).max(1);
    let blocks = frames / length;
    if blocks < LEAST_BLOCKS {
        return Err(CalibrateError::FewBlocks { blocks, frames, needed: LEAST_BLOCKS });
    }
    let fit = FittedValues { cutoff: None, nonlinearity: None, ..settings.fit };
    let settings = CalibrationSettings { fit, ..settings };
    let block = |number: usize| {
        let first = number * length;
        let parts: Vec<Record> = records.iter().map(|record| record.part(first..first + length)).collect();
        let middle = first as f64 + 0.5 * (length as f64 - 1.0);
        calibrate(spec, &parts, signal, settings).map(|found| Block { middle, found })
    };
    let all: Vec<_> = (0..blocks).into_par_iter().map(block).collect();
    let reason = all.iter().find_map(|block| block.as_ref().err().cloned());
    let found: Vec<Block> = all.into_iter().flatten().collect();
    let measured = found.len();
    match reason {
        Some(reason) if measured == 0 || (measured as f64) < LEAST_SHARE * blocks as f64 => {
            Err(CalibrateError::BlocksNotMeasured { measured, blocks, reason: Box::new(reason) })
        }
        _ => Ok(Track { blocks, ..tracked(spec, &found, frames) }),
    }
}

/// The courses through what blocks say, over so many frames.
fn tracked(spec: &Spec, blocks: &[Block], frames: usize) -> Track {
    let nominal = spec.delays_in_fast_periods();
    let delay = |i: usize| {
        let of = |block: &Block| {
            let Estimate { value, sigma } = block.found.channels[i].delay?;
            Some((block.middle, Estimate { value: value.0, sigma: sigma.0 }))
        };
        course(blocks.iter().filter_map(of), nominal[i].0)
    };
    let delays: Vec<LearnedCourse> = (0..nominal.len()).map(delay).collect();
    let pieces = blocks.iter().map(|block| (block.middle, block.found.channels.as_slice()));
    let levels = LevelCourses::new(spec, pieces);
    let middles = blocks.iter().map(|block| block.middle.round());
    let at: Vec<f64> = std::iter::once(0.0).chain(middles).chain([frames as f64 - 1.0]).collect();
    let in_seconds = |Known { value, deviation }: Known| {
        let of = |periods: f64| -> Seconds { FastPeriods(periods).in_seconds(spec.fast_period) };
        Some((of(value), of(deviation)))
    };
    let reading = |x: &f64| {
        let [gains, offsets] = levels.at(*x);
        let delays = delays.iter().map(|course| in_seconds(course.at(*x))).collect();
        Reading { frame: *x as u64, delays, gains, offsets }
    };
    let moved = |course: &LearnedCourse| {
        let (most, least) = extremes(course, &at);
        FastPeriods(most - least)
    };
    let changes = delays.iter().zip(levels.changes(&at));
    let misfits: Vec<f64> = blocks.iter().filter_map(|block| block.found.misfit).collect();
    let channel = |(i, course): (usize, &LearnedCourse)| {
        let fitted = &blocks[0].found.channels[i];
        let Estimate { value, sigma } = range(course, &at);
        let delay = Estimate { value: FastPeriods(value), sigma: FastPeriods(sigma) };
        let [gain, offset] = levels.ranges(i, &at);
        ChannelEstimate {
            delay: fitted.delay.map(|_| delay),
            gain: fitted.gain.map(|_| gain),
            offset: fitted.offset.map(|_| offset),
            cutoff: None,
        }
    };
    let calibration = Calibration {
        reference: blocks[0].found.reference,
        channels: delays.iter().enumerate().map(channel).collect(),
        misfit: (!misfits.is_empty()).then(|| median(misfits)),
        ..Calibration::default()
    };
    Track {
        blocks: blocks.len(),
        measured: blocks.len(),
        readings: at.iter().map(reading).collect(),
        changes: changes.map(|(delay, levels)| ChannelChange { delay: moved(delay), levels }).collect(),
        calibration,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::testbench::{assert_holds, gaussian, interleaved, tones};
    use crate::random::Random;
    use crate::units::Hertz;

    const FRAMES: usize = 32_768;

    /// By how much gain and offset of channel i differ from 1 and 0 at a share of the captures.
    fn levels(i: usize, share: f64) -> [f64; 2] {
        let bent = (3.0 * share).sin();
        [[0.0, 0.0], [0.01 * share, 0.005 * bent], [-0.01 * bent, 0.0], [0.004, -0.005 * share]][i]
    }

    /// Tones through converters whose levels change, with noise.
    fn captures(spec: &Spec, frequencies: &[Hertz], dice: &mut Random) -> Vec<Record> {
        let level = 0.25 / (frequencies.len() as f64).sqrt();
        let channel = |(i, record): (usize, Record)| {
            let sample = |(k, x): (usize, &f64)| {
                let [gain, offset] = levels(i, k as f64 / FRAMES as f64);
                (1.0 + gain) * level * x + offset + 1e-3 * gaussian(dice)
            };
            Record::new(record.samples.iter().enumerate().map(sample).collect())
        };
        tones(spec, frequencies, FRAMES, 0.0, &mut Random(5)).into_iter().enumerate().map(channel).collect()
    }

    fn assert_followed(frequencies: &[Hertz], signal: &CalibrationSignal, what: &str) {
        let spec = interleaved();
        let (mut scaled, draws, mut dice) = (Vec::new(), 12, Random(17));
        for _ in 0..draws {
            let records = captures(&spec, frequencies, &mut dice);
            let found = track(&spec, &records, signal, CalibrationSettings::default(), None).unwrap();
            assert_eq!((found.blocks, found.measured), (16, 16));
            for reading in [3, 8, 14].map(|k| &found.readings[k]) {
                let gains = reading.gains.as_ref().unwrap();
                let offsets = reading.offsets.as_ref().unwrap();
                for i in 1..4 {
                    let [gain, offset] = levels(i, reading.frame as f64 / FRAMES as f64);
                    let (miss, missed) = (gains[i].value - 1.0 - gain, offsets[i].value - offset);
                    scaled.extend([miss / gains[i].deviation, missed / offsets[i].deviation]);
                    assert!(miss.abs() < 1e-3 && missed.abs() < 1e-3, "{what}: {miss} {missed}");
                }
            }
            let moved = found.changes.iter().map(|change| change.delay.0);
            assert!(moved.fold(0.0, f64::max) < 1e-2, "{:?}", found.changes);
            let seen = &found.changes[1].levels;
            assert!((seen.gain - 0.01).abs() < 1e-3 && (seen.offset - 0.005).abs() < 1e-3, "{seen:?}");
        }
        assert_holds(&scaled, draws, what);
    }

    #[test]
    fn a_tone_tells_how_levels_change() {
        let pilot = [Hertz(81_234.5)];
        assert_followed(&pilot, &CalibrationSignal::Tones(pilot.to_vec()), "by a tone");
    }

    /// Of a band that covers no multiple of the slow rate of 250 kHz but 0.
    #[test]
    fn any_signal_tells_how_levels_change() {
        let mut dice = Random(3);
        let frequencies: Vec<Hertz> = (0..60).map(|_| Hertz(2e4 + 2e5 * dice.part())).collect();
        assert_followed(&frequencies, &CalibrationSignal::Any, "by any signal");
    }

    #[test]
    fn short_captures_are_refused() {
        let spec = interleaved();
        let pilot = [Hertz(81_234.5)];
        let records = captures(&spec, &pilot, &mut Random(1));
        let signal = CalibrationSignal::Tones(pilot.to_vec());
        let refused = |frames| track(&spec, &records, &signal, CalibrationSettings::default(), Some(frames));
        let few = CalibrateError::FewBlocks { blocks: 6, frames: FRAMES, needed: 8 };
        assert_eq!(refused(5000).unwrap_err(), few);
        let none = refused(4).unwrap_err();
        assert!(matches!(none, CalibrateError::BlocksNotMeasured { measured: 0, .. }), "{none:?}");
    }
}
