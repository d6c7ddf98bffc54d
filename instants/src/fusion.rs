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
pub(super) const FRAMES_PER_BLOCK: usize = 64;
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
    pub(super) first: FastPeriods,
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

    pub(super) fn instants(self, frames: Range<usize>) -> Vec<FastPeriods> {
        (frames.start * self.ratio..frames.end * self.ratio)
            .map(|n| self.first + FastPeriods(n as f64))
            .collect()
    }
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
    let layout = Layout::new(estimator, recordings, settings);
    let fusion = KnownInstantFusion { estimator, recordings, layout };
    let frames = settings.count.div_ceil(layout.grid.ratio);
    let part = |number: usize| {
        let frames = number * layout.length..frames.min((number + 1) * layout.length);
        let stretch = fusion.stretch(frames.clone())?;
        let starts = frames.clone().step_by(FRAMES_PER_BLOCK);
        starts
            .map(|start| fusion.block(stretch.as_ref(), start..frames.end.min(start + FRAMES_PER_BLOCK)))
            .collect::<Result<Vec<Outputs>, _>>()
    };
    let parts =
        (0..frames.div_ceil(layout.length)).into_par_iter().map(part).collect::<Result<Vec<_>, _>>()?;
    let mut fused = layout.fused(parts.into_iter().flatten());
    fused.samples.truncate(settings.count);
    Ok(fused)
}

/// How the outputs of a run are made.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    pub(super) grid: OutputGrid,
    /// Samples of each recording on either side.
    pub(super) reach: usize,
    /// Frames of a stretch.
    pub(super) length: usize,
    /// Whether all recorders have nearly the rate of the frames.
    is_common: bool,
}

impl Layout {
    pub(super) fn new(estimator: &Estimator, recordings: &[Recording], settings: FusionSettings) -> Self {
        let FusionSettings { first, reach, .. } = settings;
        let longest = estimator.signals().longest();
        let common = common_ratio(recordings).filter(|ratio| ((2 * reach + 2) * ratio) as f64 <= longest.0);
        let length = FRAMES_PER_BLOCK * common.map_or(1, |ratio| blocks_of_stretch(recordings, ratio));
        let grid = OutputGrid { first, ratio: common.unwrap_or(1) };
        Self { grid, reach, length, is_common: common.is_some() }
    }

    /// What blocks are together.
    pub(super) fn fused(self, blocks: impl Iterator<Item = Outputs>) -> Fused {
        let mut fused =
            Fused { samples: Vec::new(), errors: Vec::new(), block: FRAMES_PER_BLOCK * self.grid.ratio };
        for block in blocks {
            fused.samples.extend(block.outputs);
            fused.errors.push(block.error);
        }
        fused
    }
}

/// What all stretches of a run share.
pub(super) struct KnownInstantFusion<'a> {
    pub(super) estimator: &'a Estimator,
    pub(super) recordings: &'a [Recording],
    pub(super) layout: Layout,
}

impl KnownInstantFusion<'_> {
    /// The taps of a stretch; `None` if its samples do not come at nearly the common rate. Only the clocks
    /// of the recordings matter.
    pub(super) fn stretch(&self, frames: Range<usize>) -> Result<Option<Stretch>, LinalgError> {
        let is_even = |recording: &Recording| self.is_even(recording, &frames);
        let has_pattern = self.layout.is_common && self.recordings.iter().all(is_even);
        has_pattern.then(|| Stretch::new(self, frames)).transpose()
    }

    /// Whether the samples around these frames come at nearly the common rate.
    fn is_even(&self, recording: &Recording, frames: &Range<usize>) -> bool {
        let (clock, grid) = (recording.clock(), self.layout.grid);
        let [first, last] = [frames.start, frames.end].map(|frame| clock.sample_at(grid.frame(frame)));
        let reach = (self.layout.reach + 1) as f64;
        clock.periods(first - reach..last + reach).all(|period| is_near(period, grid.ratio))
    }

    /// The outputs of the frames of a block, by the taps of its stretch.
    pub(super) fn block(
        &self,
        stretch: Option<&Stretch>,
        frames: Range<usize>,
    ) -> Result<Outputs, LinalgError> {
        if let Some(stretch) = stretch {
            return stretch.outputs(self, frames);
        }
        let instants = self.layout.grid.instants(frames);
        let parts =
            instants.chunks(OUTPUTS_OF_SET).map(|part| self.of_set(part)).collect::<Result<Vec<_>, _>>()?;
        let error = MeanSquare::mean(&parts.iter().map(|part| part.error).collect::<Vec<_>>());
        Ok(Outputs { outputs: parts.into_iter().flat_map(|part| part.outputs).collect(), error })
    }

    /// The outputs at some instants from one set of samples.
    pub(super) fn of_set(&self, instants: &[FastPeriods]) -> Result<Outputs, LinalgError> {
        demand::outputs(self.estimator, self.recordings, self.layout.reach, instants)
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
