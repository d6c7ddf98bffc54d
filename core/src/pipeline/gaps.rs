//! Missing samples: their estimates from the samples around them, and their places.
//!
//! A missing sample is marked by NaN; a complex sample is missing if one of its parts is. It is replaced by
//! its linear estimate of least mean-square error from all samples of the frames around it, its projection
//! on them. The projection of a projection is that of the whole. So a bank whose taps are best for all
//! samples, with estimates for the missing ones, gives the best output for those that remain.

use super::cost::{Cost, Costs};
use crate::bank::{Bank, FrameLayout, FrameSample};
use crate::runtime::{FrameSource, Isa, Plan};
use crate::units::Decibels;
use std::collections::HashMap;
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// Maximum number of gaps that a report lists; further gaps are only counted, so that memory stays bounded.
pub const LISTED_GAPS: usize = 65_536;
/// Patterns of missing samples whose estimates are kept, at most.
const KEPT_PATTERNS: usize = 4096;

/// A run of missing samples of one converter.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Gap {
    /// The channel, from 1.
    pub channel: usize,
    /// Number of its first sample among those of the converter, from 0: its frame, for converters of one
    /// rate.
    pub first: u64,
    /// Samples that are missing.
    pub length: u64,
    /// The predicted signal-to-noise ratio of the worst output during the gap: what the known samples of the
    /// frames around leave unknown. A bank with less latency or fewer taps has errors of its own besides.
    pub snr_db: Decibels,
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { channel, first, length, snr_db } = self;
        write!(f, "gap: channel {channel}, sample {first}, {length} missing, SNR {:.1} dB there", snr_db.0)
    }
}

/// The gaps of a run.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct GapSummary {
    /// Number of gaps that have ended.
    pub count: u64,
    /// Number of missing samples.
    pub missing: u64,
    /// The gaps in the order of their ends, at most [`LISTED_GAPS`] of them.
    pub list: Vec<Gap>,
}

/// Estimates missing samples from those around them.
pub trait GapEstimator: fmt::Debug + Send + Sync {
    /// Frames on either side of a frame from whose samples its missing ones are estimated.
    fn reach(&self) -> usize;

    /// The mean-square error of the outputs where no sample is missing, over the power of the target.
    fn error(&self) -> f64;

    /// The estimates of the missing samples in the middle one of `2 reach + 1` frames. `is_there` says of
    /// each sample of these frames, in their order, whether it is known.
    fn estimate(&self, is_there: &[bool]) -> GapEstimate;
}

/// How the missing samples of a frame follow from those around them.
#[derive(Debug, Clone, PartialEq)]
pub struct GapEstimate {
    /// For each missing sample the weights of all samples of the frames; those of unknown ones are 0.
    pub weights: Vec<Vec<f64>>,
    /// Standard deviation of the error of each, over that of the target.
    pub deviations: Vec<f64>,
    /// What is missing adds this mean-square error to the worst output of the frame, over the power of the
    /// target.
    pub added_error: f64,
}

/// What is known of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Known {
    There,
    Missing,
    /// Before the beginning of the signal, or after its end.
    Outside,
}

/// Replaces missing samples frame by frame.
///
/// Frames come out `reach` frames later than they go in, as the estimates look so far ahead.
#[derive(Debug, Clone)]
pub(super) struct GapFiller {
    estimator: Arc<dyn GapEstimator>,
    layout: FrameLayout,
    /// The samples of a frame.
    samples: Vec<FrameSample>,
    /// What each delivers without a signal.
    offsets: Vec<f64>,
    /// The gap of each converter that has not ended.
    open: Vec<Option<Gap>>,
    summary: GapSummary,
    /// Number of the first frame that has not come out.
    frame: u64,
    /// Frames that came out last; they begin `reach` frames after the beginning of `numbers`.
    out: usize,
    /// The frames around, for each part of the samples, and what is known of them.
    numbers: Vec<Vec<f64>>,
    known: Vec<Known>,
    estimates: HashMap<Vec<bool>, Arc<GapEstimate>>,
    costs: Costs,
}

impl GapFiller {
    /// A filler for samples of so many parts before `plan`, which must be the plan of `bank`.
    pub(super) fn new(bank: &Bank, plan: &Plan, parts: usize, estimator: Arc<dyn GapEstimator>) -> Self {
        let layout = bank.layout();
        let samples: Vec<FrameSample> = layout.iter().collect();
        let offsets = layout.each(&bank.offsets);
        let before = offsets.repeat(estimator.reach());
        Self {
            costs: Costs::new(plan, &offsets, estimator.error()),
            layout,
            open: vec![None; bank.channel_count()],
            summary: GapSummary::default(),
            frame: 0,
            out: 0,
            known: vec![Known::Outside; before.len()],
            numbers: vec![before; parts],
            estimates: HashMap::new(),
            estimator,
            samples,
            offsets,
        }
    }

    /// Takes the next frames of all `parts` of the samples, and returns how many come out.
    pub(super) fn fill(&mut self, parts: &[impl FrameSource]) -> usize {
        let frames = parts.first().map_or(0, FrameSource::frames);
        self.forget();
        let begin = self.known.len();
        let end = begin + frames * self.samples.len();
        for (numbers, part) in self.numbers.iter_mut().zip(parts) {
            numbers.resize(end, 0.0);
            part.load_f64(Isa::detect(), 0, &mut numbers[begin..]);
        }
        self.known.resize(end, Known::There);
        if !parts.iter().all(|part| part.is_finite(0..frames)) {
            (begin..end).for_each(|index| self.find_missing(index));
        }
        self.come_out()
    }

    /// As [`GapFiller::fill`] with frames after the end of the signal.
    pub(super) fn fill_after_end(&mut self, frames: usize) -> usize {
        self.forget();
        let silence = self.offsets.repeat(frames);
        self.known.resize(self.known.len() + silence.len(), Known::Outside);
        self.numbers.iter_mut().for_each(|numbers| numbers.extend_from_slice(&silence));
        self.come_out()
    }

    /// The frames of one part that came out last.
    pub(super) fn filled(&self, part: usize) -> &[f64] {
        let n = self.samples.len();
        let first = self.estimator.reach() * n;
        &self.numbers[part][first..first + self.out * n]
    }

    /// Frames that went in and have not come out.
    pub(super) fn held(&self) -> usize {
        self.known.len() / self.samples.len() - self.estimator.reach() - self.out
    }

    /// For some of the outputs of the frames that came out last: 0 if no missing sample affects it, else its
    /// predicted signal-to-noise ratio in decibels, at least 1 and at most 255.
    pub(super) fn marks(&self, outputs: Range<usize>) -> &[u8] {
        self.costs.marks(outputs)
    }

    /// The gaps that have ended.
    pub(super) fn summary(&self) -> &GapSummary {
        &self.summary
    }

    /// The gaps that have not ended, with their length so far.
    pub(super) fn open(&self) -> impl Iterator<Item = Gap> {
        self.open.iter().copied().flatten()
    }

    /// All gaps, once the input is over: those that are open end there.
    pub(super) fn finish(mut self) -> GapSummary {
        let held = self.held();
        self.fill_after_end(held);
        (0..self.open.len()).for_each(|converter| self.end_gap(converter));
        self.summary
    }

    /// Drops the frames that no later estimate needs.
    fn forget(&mut self) {
        let old = self.out * self.samples.len();
        self.known.drain(..old);
        self.numbers.iter_mut().for_each(|numbers| drop(numbers.drain(..old)));
        self.frame += self.out as u64;
        self.out = 0;
    }

    /// Estimates what is missing in the frames that have all frames around them.
    fn come_out(&mut self) -> usize {
        let n = self.samples.len();
        let reach = self.estimator.reach();
        self.out = (self.known.len() / n).saturating_sub(2 * reach);
        self.costs.begin(self.out);
        let out = &self.known[reach * n..(reach + self.out) * n];
        if out.contains(&Known::Missing) || self.open().next().is_some() {
            (0..self.out).for_each(|frame| self.pass(frame));
        }
        self.costs.complete();
        self.out
    }

    /// Restores a frame that comes out, and follows its gaps.
    fn pass(&mut self, frame: usize) {
        let n = self.samples.len();
        let first = (frame + self.estimator.reach()) * n;
        let is_missing = self.known[first..first + n].contains(&Known::Missing);
        let snr = is_missing.then(|| self.restore(frame));
        for i in 0..n {
            match snr.filter(|_| self.known[first + i] == Known::Missing) {
                Some(snr) => self.lengthen_gap(frame, i, snr),
                None => self.end_gap(self.samples[i].converter),
            }
        }
    }

    /// Replaces the missing samples of a frame that comes out; returns the predicted ratio of its outputs.
    fn restore(&mut self, frame: usize) -> Decibels {
        let n = self.samples.len();
        let reach = self.estimator.reach();
        let around = frame * n..(frame + 2 * reach + 1) * n;
        let estimate = self.estimate(around.clone());
        let first = around.start + reach * n;
        let missing = (0..n).filter(|i| self.known[first + i] == Known::Missing).collect::<Vec<_>>();
        for (k, &i) in missing.iter().enumerate() {
            for part in 0..self.numbers.len() {
                let value = self.weighted(part, around.clone(), &estimate.weights[k]);
                self.numbers[part][first + i] = self.offsets[i] + value;
            }
            let cost = Cost { deviation: estimate.deviations[k], most: estimate.added_error };
            self.costs.add(frame, i, cost);
        }
        self.costs.snr(estimate.added_error)
    }

    fn estimate(&mut self, around: Range<usize>) -> Arc<GapEstimate> {
        let is_there: Vec<bool> = self.known[around].iter().map(|known| *known == Known::There).collect();
        if let Some(known) = self.estimates.get(&is_there) {
            return Arc::clone(known);
        }
        if self.estimates.len() == KEPT_PATTERNS {
            self.estimates.clear();
        }
        let new = Arc::new(self.estimator.estimate(&is_there));
        self.estimates.insert(is_there, Arc::clone(&new));
        new
    }

    /// The weighted sum of the samples of one part around a frame, without their offsets.
    fn weighted(&self, part: usize, around: Range<usize>, weights: &[f64]) -> f64 {
        let samples = self.numbers[part][around].iter().zip(self.offsets.iter().cycle());
        samples.zip(weights).map(|((x, offset), weight)| weight * (x - offset)).sum()
    }

    /// Notes whether a sample is missing; its weights are 0, so it has to be a number.
    fn find_missing(&mut self, index: usize) {
        if !self.numbers.iter().all(|part| part[index].is_finite()) {
            self.known[index] = Known::Missing;
            self.numbers.iter_mut().for_each(|part| part[index] = 0.0);
        }
    }

    /// Counts sample i of a frame that comes out.
    fn lengthen_gap(&mut self, frame: usize, i: usize, snr: Decibels) {
        let FrameSample { converter, number } = self.samples[i];
        let per_frame = self.layout.samples()[converter] as u64;
        let first = (self.frame + frame as u64) * per_frame + number as u64;
        let new = Gap { channel: converter + 1, first, length: 0, snr_db: snr };
        let gap = self.open[converter].get_or_insert(new);
        gap.length += 1;
        gap.snr_db = Decibels(gap.snr_db.0.min(snr.0));
        self.summary.missing += 1;
    }

    fn end_gap(&mut self, converter: usize) {
        let Some(gap) = self.open[converter].take() else { return };
        self.summary.count += 1;
        if self.summary.list.len() < LISTED_GAPS {
            self.summary.list.push(gap);
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
