//! Recorders of nearly one rate: taps for the instants at knots of time, and lines between them.
//!
//! From frame to frame the samples move along with the outputs, only their offsets drift. So a set of taps
//! serves for many frames, and between two knots the taps are on lines. Knots lie at absolute frames, dense
//! where taps change fast: an interval is halved as long as a line through its ends is worse in its middle
//! than the best taps there, or two recorders sample at one instant within it. There taps change sign within
//! a ten thousandth of a period, which no look at the middle would find.

use super::demand::Outputs;
use super::estimator::{Estimator, EstimatorTaps, MeanSquare, TimedSample};
use super::fusion::OutputGrid;
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat, dot};
use std::ops::Range;

/// What the error may be over that of the best taps: 0.1 dB.
const MOST_LOSS: f64 = 1.023_292_992_280_754;

/// Periods below which recorders do not drift apart, but differ by the rounding of their instants.
const STANDSTILL: f64 = 1e-9;

/// Taps for the frames of one stretch.
pub(super) struct Stretch<'a> {
    estimator: &'a Estimator,
    recordings: &'a [Recording],
    grid: OutputGrid,
    /// Samples of each recording on either side.
    reach: usize,
    /// The first of the samples of each recording for frame 0; it need not be there.
    starts: Vec<i64>,
    /// Ascending by frame.
    knots: Vec<Knot>,
}

/// The best taps of a frame.
#[derive(Clone)]
struct Knot {
    frame: usize,
    taps: EstimatorTaps,
}

impl<'a> Stretch<'a> {
    /// For these frames, over which no sample drifts by more than a fraction of its period.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub(super) fn new(
        estimator: &'a Estimator,
        recordings: &'a [Recording],
        grid: OutputGrid,
        reach: usize,
        frames: Range<usize>,
    ) -> Result<Self, LinalgError> {
        let middle = frames.start.midpoint(frames.end);
        let centre = grid.frame(middle) + FastPeriods(0.5 * (grid.ratio - 1) as f64);
        let start = |recording: &Recording| recording.nearest(centre) - middle as i64 - reach as i64 + 1;
        let starts = recordings.iter().map(start).collect();
        let mut stretch = Self { estimator, recordings, grid, reach, starts, knots: Vec::new() };
        let (first, last) = (stretch.knot(frames.start)?, stretch.knot(frames.end)?);
        stretch.refine(first, last.clone())?;
        stretch.knots.push(last);
        Ok(stretch)
    }

    /// The samples of the recording `i` for a frame.
    fn numbers(&self, i: usize, frame: usize) -> Range<i64> {
        let start = self.starts[i] + frame as i64;
        start..start + 2 * self.reach as i64
    }

    /// All samples for a frame, with instants relative to it.
    fn samples(&self, frame: usize) -> Vec<TimedSample> {
        let origin = self.grid.frame(frame);
        let of = |i: usize| {
            self.numbers(i, frame).map(move |number| {
                let sample = self.recordings[i].sample(number);
                TimedSample { instant: sample.instant - origin, ..sample }
            })
        };
        (0..self.recordings.len()).flat_map(of).collect()
    }

    fn knot(&self, frame: usize) -> Result<Knot, LinalgError> {
        Ok(Knot { frame, taps: self.estimator.taps(&self.samples(frame), &self.grid.phases())? })
    }

    /// Adds `left` and the knots between it and `right`.
    fn refine(&mut self, left: Knot, right: Knot) -> Result<(), LinalgError> {
        if right.frame - left.frame < 2 {
            self.knots.push(left);
            return Ok(());
        }
        let frame = left.frame.midpoint(right.frame);
        if self.has_coincidence(left.frame, right.frame) {
            let middle = self.knot(frame)?;
            self.refine(left, middle.clone())?;
            return self.refine(middle, right);
        }
        let samples = self.samples(frame);
        let set = self.estimator.set(&samples);
        let with_target = set.with_target(&self.grid.phases());
        let middle = Knot { frame, taps: set.taps(&with_target)? };
        let on_line = set.errors(&halfway(&left, &right), &with_target);
        let mut pairs = on_line.iter().zip(&middle.taps.errors);
        if pairs.all(|(line, best)| line.total() <= MOST_LOSS * best.total()) {
            self.knots.extend([left, middle]);
            return Ok(());
        }
        self.refine(left, middle.clone())?;
        self.refine(middle, right)
    }

    /// Whether two recorders sample at one instant between two frames.
    fn has_coincidence(&self, first: usize, last: usize) -> bool {
        let place = |i: usize, j: usize, frame: usize| {
            let number = self.starts[i] + frame as i64;
            let instant = self.recordings[i].clock().at(number as f64);
            self.recordings[j].clock().sample_at(instant) - frame as f64
        };
        let meet = |i: usize, j: usize| {
            let [before, after] = [first, last].map(|frame| place(i, j, frame));
            before.floor() != after.floor() && (after - before).abs() > STANDSTILL
        };
        let count = self.recordings.len();
        (0..count).any(|i| (0..i).any(|j| meet(i, j)))
    }

    /// The outputs of all frames, in their order; `None` where a sample is not there.
    pub(super) fn frames(&self) -> impl Iterator<Item = (usize, Option<Outputs>)> {
        self.knots.windows(2).flat_map(move |pair| {
            let [left, right] = [&pair[0], &pair[1]];
            (left.frame..right.frame).map(move |frame| (frame, self.frame(left, right, frame)))
        })
    }

    fn frame(&self, left: &Knot, right: &Knot, frame: usize) -> Option<Outputs> {
        let numbers: Vec<Range<i64>> = (0..self.recordings.len()).map(|i| self.numbers(i, frame)).collect();
        if self.recordings.iter().zip(&numbers).any(|(recording, samples)| !recording.is_whole(samples)) {
            return None;
        }
        let slice = |(recording, numbers): (&'a Recording, &Range<i64>)| {
            &recording.samples()[numbers.start as usize..numbers.end as usize]
        };
        let slices: Vec<&[f64]> = self.recordings.iter().zip(&numbers).map(slice).collect();
        let part = (frame - left.frame) as f64 / (right.frame - left.frame) as f64;
        let between = |x: f64, y: f64| x + part * (y - x);
        let output = |p: usize| between(left.output(p, &slices), right.output(p, &slices));
        let [first, second] = [left, right].map(|knot| MeanSquare::mean(&knot.taps.errors));
        let signal = between(first.signal, second.signal);
        let error = MeanSquare { signal, noise: between(first.noise, second.noise) };
        Some(Outputs { outputs: (0..self.grid.ratio).map(output).collect(), error })
    }
}

impl Knot {
    /// The output of a phase from the samples of all recordings.
    fn output(&self, phase: usize, slices: &[&[f64]]) -> f64 {
        let weights = &self.taps.weights;
        let rows = weights.nrows();
        let of_phase = &weights.as_slice()[phase * rows..(phase + 1) * rows];
        of_phase.chunks(rows / slices.len()).zip(slices).map(|(taps, samples)| dot(taps, samples)).sum()
    }
}

fn halfway(left: &Knot, right: &Knot) -> Mat {
    (&left.taps.weights + &right.taps.weights) * 0.5
}
