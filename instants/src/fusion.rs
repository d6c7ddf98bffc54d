//! Fusion of whole recordings: the target at the instants of a regular grid.

use super::demand::{self, LONGEST_BLOCK, Outputs};
use super::estimator::{Estimator, MeanSquare};
use super::knots::Stretch;
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::LinalgError;
use rayon::prelude::*;
use std::ops::Range;

/// Frames of a block, for which one error is stated.
const FRAMES_PER_BLOCK: usize = 64;
/// Outputs that share a set of samples where instants have no pattern.
const OUTPUTS_OF_SET: usize = 64;
/// Most blocks of a stretch, whose frames share the numbers of their samples.
const MOST_BLOCKS: usize = 64;
/// Periods by which the samples of a stretch may drift.
const MOST_DRIFT: f64 = 1.0 / 16.0;
/// Relative difference up to which clocks have nearly one rate.
const SAME_RATE: f64 = 0.005;
/// Times that samples around an output may lie farther apart than in the mean: stamps come unevenly.
const SLACK: f64 = 1.5;

/// What is wanted of recordings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FusionSettings {
    /// The instant of the first output; the others follow, one in each fast period.
    pub first: FastPeriods,
    /// How many outputs.
    pub count: usize,
    /// Samples of each recording on either side of an output.
    pub reach: usize,
}

impl FusionSettings {
    /// The longest time that the covariances for [`fuse`] should know.
    pub fn longest(&self, recordings: &[Recording]) -> FastPeriods {
        let period = recordings.iter().map(Recording::period).fold(0.0, f64::max);
        FastPeriods(SLACK * 2.0 * (self.reach + 1) as f64 * period) + LONGEST_BLOCK
    }
}

/// The estimate of the target.
#[derive(Debug, Clone, PartialEq)]
pub struct Fused {
    /// The outputs.
    pub samples: Vec<f64>,
    /// The mean of the errors of each block of outputs.
    pub errors: Vec<MeanSquare>,
    /// Outputs of a block; the last one may have less.
    pub block: usize,
}

/// The outputs, in frames of as many as a recorder has fast periods in each of its own.
#[derive(Debug, Clone, Copy)]
pub(super) struct OutputGrid {
    first: FastPeriods,
    pub(super) ratio: usize,
}

impl OutputGrid {
    /// The instant of the first output of a frame.
    pub(super) fn frame(self, frame: usize) -> FastPeriods {
        self.first + FastPeriods((frame * self.ratio) as f64)
    }

    /// The instants of the outputs of a frame, relative to it.
    pub(super) fn phases(self) -> Vec<FastPeriods> {
        (0..self.ratio).map(|p| FastPeriods(p as f64)).collect()
    }

    fn instants(self, frames: Range<usize>) -> Vec<FastPeriods> {
        (frames.start * self.ratio..frames.end * self.ratio)
            .map(|n| self.first + FastPeriods(n as f64))
            .collect()
    }
}

/// Outputs of a stretch, and the errors of its blocks.
struct Part {
    outputs: Vec<f64>,
    errors: Vec<MeanSquare>,
}

/// Estimates the target at every output of a grid.
///
/// Recorders of nearly one rate, that of an integer number of fast periods, share taps over many frames. For
/// all others, and around lost samples, the samples of each block are taken for themselves. An output
/// depends on the instants of the samples around it and on nothing else, so it has the same bits for any
/// number of threads. Samples farther away than half of the [longest](super::Signals::longest) time are left
/// out.
///
/// # Errors
/// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
pub fn fuse(
    estimator: &Estimator,
    recordings: &[Recording],
    settings: FusionSettings,
) -> Result<Fused, LinalgError> {
    let FusionSettings { first, count, reach } = settings;
    let longest = estimator.signals().longest();
    let common = common_ratio(recordings).filter(|ratio| ((2 * reach + 2) * ratio) as f64 <= longest.0);
    let grid = OutputGrid { first, ratio: common.unwrap_or(1) };
    let fusion = KnownInstantFusion { estimator, recordings, grid, reach };
    let frames = count.div_ceil(grid.ratio);
    let length = FRAMES_PER_BLOCK * common.map_or(1, |ratio| blocks_of_stretch(recordings, ratio));
    let stretch = |number: usize| {
        let frames = number * length..frames.min((number + 1) * length);
        let is_even =
            common.is_some() && recordings.iter().all(|recording| fusion.is_even(recording, &frames));
        if is_even { fusion.on_knots(frames) } else { fusion.on_demand(frames) }
    };
    let parts: Vec<Part> =
        (0..frames.div_ceil(length)).into_par_iter().map(stretch).collect::<Result<_, _>>()?;
    let (mut samples, mut errors) = (Vec::with_capacity(frames * grid.ratio), Vec::new());
    for part in parts {
        samples.extend(part.outputs);
        errors.extend(part.errors);
    }
    samples.truncate(count);
    Ok(Fused { samples, errors, block: FRAMES_PER_BLOCK * grid.ratio })
}

/// What all stretches of a run share.
struct KnownInstantFusion<'a> {
    estimator: &'a Estimator,
    recordings: &'a [Recording],
    grid: OutputGrid,
    reach: usize,
}

impl KnownInstantFusion<'_> {
    /// Whether the samples around these frames come at nearly the common rate.
    fn is_even(&self, recording: &Recording, frames: &Range<usize>) -> bool {
        let clock = recording.clock();
        let [first, last] = [frames.start, frames.end].map(|frame| clock.sample_at(self.grid.frame(frame)));
        let reach = (self.reach + 1) as f64;
        clock.periods(first - reach..last + reach).all(|period| is_near(period, self.grid.ratio))
    }

    fn on_knots(&self, frames: Range<usize>) -> Result<Part, LinalgError> {
        let Self { estimator, recordings, grid, reach } = *self;
        let stretch = Stretch::new(estimator, recordings, grid, reach, frames.clone())?;
        let (mut outputs, mut errors) = (Vec::with_capacity(frames.len() * grid.ratio), Vec::new());
        for (frame, found) in stretch.frames() {
            let found = match found {
                Some(found) => found,
                None => self.of_set(&grid.instants(frame..frame + 1))?,
            };
            outputs.extend(found.outputs);
            errors.push(found.error);
        }
        let errors = errors.chunks(FRAMES_PER_BLOCK).map(MeanSquare::mean).collect();
        Ok(Part { outputs, errors })
    }

    fn on_demand(&self, frames: Range<usize>) -> Result<Part, LinalgError> {
        let Self { grid, .. } = *self;
        let (mut outputs, mut errors) = (Vec::with_capacity(frames.len() * grid.ratio), Vec::new());
        for block in grid.instants(frames).chunks(FRAMES_PER_BLOCK * grid.ratio) {
            let parts = block.chunks(OUTPUTS_OF_SET).map(|part| self.of_set(part));
            let parts = parts.collect::<Result<Vec<_>, _>>()?;
            errors.push(MeanSquare::mean(&parts.iter().map(|part| part.error).collect::<Vec<_>>()));
            outputs.extend(parts.into_iter().flat_map(|part| part.outputs));
        }
        Ok(Part { outputs, errors })
    }

    fn of_set(&self, instants: &[FastPeriods]) -> Result<Outputs, LinalgError> {
        demand::outputs(self.estimator, self.recordings, self.reach, instants)
    }
}

/// The fast periods in the usual period of all recordings, if that is one integer.
fn common_ratio(recordings: &[Recording]) -> Option<usize> {
    let ratio = recordings.first()?.period().round();
    let is_common =
        ratio >= 1.0 && recordings.iter().all(|recording| is_near(recording.period(), ratio as usize));
    is_common.then_some(ratio as usize)
}

fn is_near(period: f64, ratio: usize) -> bool {
    (period / ratio as f64 - 1.0).abs() < SAME_RATE
}

/// Blocks over which no clock drifts too far; its steps do not count.
fn blocks_of_stretch(recordings: &[Recording], ratio: usize) -> usize {
    let periods = recordings.iter().flat_map(Recording::periods).filter(|period| is_near(*period, ratio));
    let fastest = periods.map(|period| (period / ratio as f64 - 1.0).abs()).fold(0.0, f64::max);
    let blocks = (MOST_DRIFT / (fastest * FRAMES_PER_BLOCK as f64)) as usize;
    1 << blocks.clamp(1, MOST_BLOCKS).ilog2()
}
