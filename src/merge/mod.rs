//! Recordings of one event by ordinary recorders become one at a higher rate.
//!
//! Starts, drifts, polarities and gains come from [`align`](crate::align), or the instants from time stamps.
//! Spectrum and noise are measured from the recordings ([`Model`]); then every output is the linear estimate
//! of least mean-square error from the samples around it. One recording alone, and the mean of all, are such
//! estimates with other taps, so none of them is better by this model.

mod clocks;
mod course;
mod error;
mod phasor;
mod pilot;
mod tracked;

pub use course::PredictedQuality;
pub use error::{MergeError, MergeWarning};
pub use pilot::PilotFusion;
pub use tracked::{DelayTrack, Tracked, TrackedFusion, fuse_stamped};

use crate::align::{ClockStep, lost_zeros};
use crate::calibrate::Record;
use crate::instants::{Fused, FusionSettings, MeanSquare, Model, PASSES, Prior, Recording, fuse};
use crate::sine_fit::Estimate;
use crate::units::{CyclesPerFastPeriod, Decibels, FastPeriods, Hertz, Seconds};
use clocks::Clocked;
use course::ErrorCourse;
use std::ops::Range;

/// Samples of each recording on either side of an output.
const REACH: usize = 24;
/// Outputs below which nothing can be measured.
const LEAST_OUTPUTS: usize = 1024;
/// Most outputs for each sample of all recordings.
const MOST_OUTPUTS: f64 = 64.0;
/// What all recordings must gain over one alone; with less it suffices.
const LEAST_GAIN: Decibels = Decibels(0.5);

/// What one recorder or logger delivered.
#[derive(Debug, Clone, PartialEq)]
pub struct Recorder {
    /// Its name in messages.
    pub name: String,
    /// The samples; of clipped and lost ones nothing is used.
    pub record: Record,
    /// Samples per second.
    pub rate: Hertz,
    /// The step of its numbers; 0 for floats.
    pub step: f64,
    /// When the samples were taken; all sources have stamps or none.
    pub stamps: Option<Vec<Seconds>>,
}

/// How recordings are merged.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeSettings {
    /// Outputs per second. `None` for the largest multiple of the first source's rate that does not exceed
    /// the sum of all rates.
    pub rate: Option<Hertz>,
    /// The end of the signal's band, if it is known.
    pub band: Option<Hertz>,
    /// Whether the spectrum is learned; else it counts as flat over the band.
    pub learn: bool,
    /// How far apart the recordings began at most, if that is known.
    pub within: Option<Seconds>,
}

/// One recording from several.
#[derive(Debug, Clone)]
pub struct Merged {
    /// The samples, on the clock of the first source.
    pub samples: Vec<f64>,
    /// Samples per second.
    pub rate: Hertz,
    /// The sample of the first source at whose instant the first output lies.
    pub first: usize,
    /// Its instant after the first sample of that source.
    pub begin: Seconds,
    /// What was found of each source.
    pub sources: Vec<SourceEstimate>,
    /// The predicted quality.
    pub quality: Quality,
    /// What a reader must know.
    pub warnings: Vec<MergeWarning>,
}

/// What was found of a source.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceEstimate {
    /// When its first sample was taken, after the first one of the first source.
    pub start: Seconds,
    /// By how much its clock is fast; none with stamps.
    pub drift: Option<Estimate<f64>>,
    /// Its gain over that of the first source, negative for the other polarity; none with stamps.
    pub gain: Option<Estimate<f64>>,
    /// Rms of its noise, with all that recorders do not have in common.
    pub noise: f64,
    /// Where it lost samples.
    pub steps: Vec<ClockStep>,
}

/// The predicted signal-to-noise ratios.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Of the whole result.
    pub snr: Decibels,
    /// Of its worst second, against the power of the whole.
    pub worst_second: Decibels,
    /// When that second begins, after the first output.
    pub worst_at: Seconds,
    /// Of each source alone.
    pub alone: Vec<Decibels>,
    /// Of the mean of what the sources give alone.
    pub mean: Decibels,
}

impl Quality {
    /// The source, from 0, that alone is as good as all together.
    pub fn sufficient(&self) -> Option<usize> {
        (0..self.alone.len()).find(|&i| self.alone[i].0 + LEAST_GAIN.0 >= self.snr.0)
    }
}

/// Merges recordings.
///
/// # Errors
/// [`MergeError`].
pub fn merge(sources: &[Recorder], settings: MergeSettings) -> Result<Merged, MergeError> {
    let rate = output_rate(sources, settings)?;
    let ZerosLeftOut { sources, warnings: of_zeros } = without_zeros(sources);
    let sources: &[Recorder] = &sources;
    let Clocked { recordings, found, gains, gain_deviations, delay_deviations, level, mut warnings } =
        clocks::placed(sources, rate, settings.within)?;
    let (first, grid) = grid(sources, &recordings, rate)?;
    check_memory(grid.count)?;
    let step_noise = |source: &Recorder| source.step * source.step / 12.0;
    let prior = Prior {
        band: settings
            .band
            .map(|end| CyclesPerFastPeriod(0.0)..CyclesPerFastPeriod((end.0 / rate.0).min(0.5))),
        front_ends: &[],
        passes: if settings.learn { PASSES } else { 0 },
        gains,
        gain_deviations,
        delay_deviations,
        least_noise: sources.iter().map(step_noise).collect(),
    };
    let model = Model::learn(&recordings, &prior, grid)?;
    let fused = fuse(&model.estimator, &recordings, grid)?;
    let quality = quality(&model, &fused, &recordings, grid, rate)?;
    let noise = |(found, noise): (SourceEstimate, &f64)| SourceEstimate { noise: noise.sqrt(), ..found };
    warnings.extend(of_zeros.into_iter().chain(sources.iter().filter_map(clipped)));
    let sources = found.into_iter().zip(&model.noise).map(noise).collect();
    let samples = fused.samples.iter().map(|x| x + level).collect();
    let begin = Seconds(grid.first.0 / rate.0);
    Ok(Merged { samples, rate, first, begin, sources, quality, warnings })
}

/// Sources without zeros in long rows, and what was left out.
struct ZerosLeftOut {
    sources: Vec<Recorder>,
    warnings: Vec<MergeWarning>,
}

/// Takes zeros in long rows for lost samples.
fn without_zeros(sources: &[Recorder]) -> ZerosLeftOut {
    let records: Vec<&Record> = sources.iter().map(|source| &source.record).collect();
    let rates: Vec<f64> = sources.iter().map(|source| source.rate.0).collect();
    let (mut left, mut warnings) = (Vec::new(), Vec::new());
    for (source, rows) in sources.iter().zip(lost_zeros(&records, &rates)) {
        let zeros = rows.iter().map(Range::len).sum();
        let warning = || MergeWarning::Zeros { name: source.name.clone(), zeros };
        warnings.extend((zeros > 0).then(warning));
        left.push(Recorder { record: source.record.without(&rows), ..source.clone() });
    }
    ZerosLeftOut { sources: left, warnings }
}

fn clipped(source: &Recorder) -> Option<MergeWarning> {
    let clipped = source.record.clipped;
    (clipped > 0).then(|| MergeWarning::Clipped { name: source.name.clone(), clipped })
}

fn output_rate(sources: &[Recorder], settings: MergeSettings) -> Result<Hertz, MergeError> {
    let first = sources.first().ok_or(MergeError::NoSources)?.rate;
    let sum: f64 = sources.iter().map(|source| source.rate.0).sum();
    // Stated rates are rounded.
    let usual = first * (sum / first.0 + 1e-3).floor();
    let rate = settings.rate.unwrap_or(usual);
    if rate.0 > 0.0 && rate.0 <= MOST_OUTPUTS * sum {
        Ok(rate)
    } else {
        Err(MergeError::Rate { rate, most: Hertz(MOST_OUTPUTS * sum) })
    }
}

/// The first sample of the first source that all have in common, and the outputs from there on.
fn grid(
    sources: &[Recorder],
    recordings: &[Recording],
    rate: Hertz,
) -> Result<(usize, FusionSettings), MergeError> {
    let own = recordings[0].clock();
    let begin = recordings.iter().map(|one| one.span().start.0).fold(f64::NEG_INFINITY, f64::max);
    let end = recordings.iter().map(|one| one.span().end.0).fold(f64::INFINITY, f64::min);
    // A sample at the very beginning counts, whatever the rounding.
    let first = (own.sample_at(FastPeriods(begin)) - 1e-6).ceil().max(0.0);
    let begin = own.at(first);
    let count = (end - begin.0 + 1.0).max(0.0) as usize;
    if count < LEAST_OUTPUTS {
        let most = sources.iter().map(|source| source.record.samples.len()).max().unwrap_or(0);
        return Err(MergeError::Overlap { seconds: count as f64 / rate.0, samples: most });
    }
    Ok((first as usize, FusionSettings { first: begin, count, reach: REACH }))
}

/// Refuses a result for which there is no memory, before the work.
fn check_memory(samples: usize) -> Result<(), MergeError> {
    let mut room: Vec<f64> = Vec::new();
    room.try_reserve_exact(samples).map_err(|_| MergeError::Memory { samples })
}

/// Errors of the signal count by its power around, those of the noise as they are.
///
/// The best estimate of a signal of power P has the power P less that of its error: what the estimate lacks
/// is expected to have the mean power of the signal.
fn quality(
    model: &Model,
    fused: &Fused,
    recordings: &[Recording],
    grid: FusionSettings,
    rate: Hertz,
) -> Result<Quality, MergeError> {
    let mean_power = |block: &[f64]| block.iter().map(|x| x * x).sum::<f64>() / block.len() as f64;
    let blocks = || fused.samples.chunks(fused.block).zip(&fused.errors);
    let signal = |block: &[f64], error: &MeanSquare| mean_power(block) + error.total() * model.power;
    let errors: Vec<f64> = blocks()
        .map(|(block, error)| {
            (error.signal * signal(block, error) + error.noise * model.power) * block.len() as f64
        })
        .collect();
    let total: f64 = blocks().map(|(block, error)| signal(block, error) * block.len() as f64).sum();
    let per_sample = total / fused.samples.len() as f64;
    let mut course = ErrorCourse::new(rate.0 / fused.block as f64);
    errors.iter().for_each(|error| course.add(*error));
    let worst = course.worst();
    let of_worst = worst.mean / fused.block as f64;
    let ways = model.ways(recordings, grid)?;
    let ratio = |error: f64| Decibels::of_power(1.0 / error.max(f64::MIN_POSITIVE));
    Ok(Quality {
        snr: ratio(errors.iter().sum::<f64>() / total),
        worst_second: ratio(of_worst / per_sample),
        worst_at: Seconds((worst.first * fused.block) as f64 / rate.0),
        alone: ways.alone.iter().map(|error| ratio(error.total())).collect(),
        mean: ratio(ways.mean.total()),
    })
}

#[cfg(test)]
mod tests;
