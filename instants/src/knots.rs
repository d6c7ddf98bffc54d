//! Recorders of nearly one rate: taps for the instants at knots of time, and curves between them.
//!
//! From frame to frame the samples move along with the outputs, only their offsets drift. So a set of taps
//! serves for many frames, and between knots the taps are on parabolas. Knots lie at absolute frames, dense
//! where taps change fast: an interval is halved as long as a curve through its ends and the knot beside it
//! is worse in its middle than the best taps there, or the samples next to an output are at one instant
//! within it. There taps change sign within a ten thousandth of a period, which no look at the middle would
//! find.

use super::demand::Outputs;
use super::estimator::{EstimatorTaps, MeanSquare, TimedSample};
use super::fusion::KnownInstantFusion;
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat, dot};
use std::ops::Range;

/// What the error may be over that of the best taps: 0.1 dB.
const MOST_LOSS: f64 = 1.023_292_992_280_754;

/// Periods below which recorders do not drift apart, but differ by the rounding of their instants.
const STANDSTILL: f64 = 1e-9;

/// Taps for the frames of one stretch.
#[derive(Debug)]
pub(super) struct Stretch {
    /// The first of the samples of each recording for frame 0; it need not be there.
    starts: Vec<i64>,
    /// Samples of each recording for a frame.
    count: usize,
    /// Ascending by frame.
    knots: Vec<Knot>,
    /// Ascending by frame, each up to the next one.
    curves: Vec<Curve>,
}

/// Taps of the frames from one knot on, on a curve through this and the next ones.
#[derive(Debug, Clone, Copy)]
struct Curve {
    /// The number of the first knot.
    first: usize,
    /// How many.
    count: usize,
}

/// The best taps of a frame.
#[derive(Debug, Clone)]
struct Knot {
    frame: usize,
    taps: EstimatorTaps,
}

impl Stretch {
    /// For these frames, over which no sample drifts by more than a fraction of its period.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub(super) fn new(fusion: &KnownInstantFusion<'_>, frames: Range<usize>) -> Result<Self, LinalgError> {
        let (grid, reach) = (fusion.layout.grid, fusion.layout.reach);
        let middle = frames.start.midpoint(frames.end);
        let centre = grid.frame(middle) + FastPeriods(0.5 * (grid.ratio - 1) as f64);
        let start = |recording: &Recording| recording.nearest(centre) - middle as i64 - reach as i64 + 1;
        let starts = fusion.recordings.iter().map(start).collect();
        let stretch = Self { starts, count: 2 * reach, knots: Vec::new(), curves: Vec::new() };
        let mut refinement = Refinement { fusion, stretch };
        let (first, last) = (refinement.knot(frames.start)?, refinement.knot(frames.end)?);
        refinement.refine(first, last.clone(), None)?;
        let mut stretch = refinement.stretch;
        stretch.knots.push(last);
        Ok(stretch)
    }

    /// The samples of the recording `i` for a frame.
    fn numbers(&self, i: usize, frame: usize) -> Range<i64> {
        let start = self.starts[i] + frame as i64;
        start..start + self.count as i64
    }

    /// The outputs of a frame of the stretch; `None` where a sample is not there.
    pub(super) fn frame(&self, recordings: &[Recording], frame: usize) -> Option<Outputs> {
        let after = self.curves.partition_point(|curve| self.knots[curve.first].frame <= frame).max(1);
        let Curve { first, count } = self.curves[after - 1];
        let knots: Vec<&Knot> = self.knots[first..first + count].iter().collect();
        let all = recordings.iter().enumerate();
        let slices: Vec<&[f64]> =
            all.map(|(i, recording)| recording.whole(self.numbers(i, frame))).collect::<Option<_>>()?;
        let shares = shares(&knots, frame);
        let output = |p: usize| {
            knots.iter().zip(&shares).map(|(knot, share)| share * knot.output(p, &slices)).sum::<f64>()
        };
        let outputs = (0..knots[0].taps.weights.ncols()).map(output).collect();
        let right = knots.partition_point(|knot| knot.frame <= frame).clamp(1, count - 1);
        Some(Outputs { outputs, error: between(knots[right - 1], knots[right], frame) })
    }
}

/// A stretch whose knots are being made.
struct Refinement<'a> {
    fusion: &'a KnownInstantFusion<'a>,
    stretch: Stretch,
}

impl Refinement<'_> {
    /// All samples for a frame, with instants relative to it.
    fn samples(&self, frame: usize) -> Vec<TimedSample> {
        let origin = self.fusion.layout.grid.frame(frame);
        let of = |(i, recording): (usize, &'_ Recording)| {
            self.stretch
                .numbers(i, frame)
                .map(|number| {
                    let sample = recording.sample(number);
                    TimedSample { instant: sample.instant - origin, ..sample }
                })
                .collect::<Vec<_>>()
        };
        self.fusion.recordings.iter().enumerate().flat_map(of).collect()
    }

    fn knot(&self, frame: usize) -> Result<Knot, LinalgError> {
        let phases = self.fusion.layout.grid.phases();
        Ok(Knot { frame, taps: self.fusion.estimator.taps(&self.samples(frame), &phases)? })
    }

    /// Adds `left` and the knots between it and `right`; `beside` is another one near to both, without a
    /// coincidence between them.
    fn refine(&mut self, left: Knot, right: Knot, beside: Option<&Knot>) -> Result<(), LinalgError> {
        if right.frame - left.frame < 2 {
            self.add([left]);
            return Ok(());
        }
        let frame = left.frame.midpoint(right.frame);
        if self.has_coincidence(left.frame, right.frame) {
            let middle = self.knot(frame)?;
            self.refine(left, middle.clone(), None)?;
            return self.refine(middle, right, None);
        }
        let samples = self.samples(frame);
        let set = self.fusion.estimator.set(&samples);
        let with_target = set.with_target(&self.fusion.layout.grid.phases());
        let middle = Knot { frame, taps: set.taps(&with_target)? };
        let known: Vec<&Knot> = [&left, &right].into_iter().chain(beside).collect();
        let on_curve = set.errors(&combined(&known, frame), &with_target);
        let mut pairs = on_curve.iter().zip(&middle.taps.errors);
        if pairs.all(|(curve, best)| curve.total() <= MOST_LOSS * best.total()) {
            self.add([left, middle]);
            return Ok(());
        }
        self.refine(left.clone(), middle.clone(), Some(&right))?;
        self.refine(middle, right, Some(&left))
    }

    /// Adds knots whose curve goes on to the knot that comes next.
    fn add<const COUNT: usize>(&mut self, knots: [Knot; COUNT]) {
        let Stretch { knots: all, curves, .. } = &mut self.stretch;
        curves.push(Curve { first: all.len(), count: COUNT + 1 });
        all.extend(knots);
    }

    /// Whether two recorders sample at one instant, in the middle of their samples, between two frames.
    fn has_coincidence(&self, first: usize, last: usize) -> bool {
        let recordings = self.fusion.recordings;
        let place = |i: usize, j: usize, frame: usize| {
            let Range { start, end } = self.stretch.numbers(i, frame);
            let instant = recordings[i].clock().at(0.5 * (start + end) as f64);
            recordings[j].clock().sample_at(instant) - frame as f64
        };
        let meet = |i: usize, j: usize| {
            let [before, after] = [first, last].map(|frame| place(i, j, frame));
            before.floor() != after.floor() && (after - before).abs() > STANDSTILL
        };
        let count = recordings.len();
        (0..count).any(|i| (0..i).any(|j| meet(i, j)))
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

/// The shares of knots in the taps of a frame on the curve through them.
fn shares(knots: &[&Knot], frame: usize) -> Vec<f64> {
    let share = |knot: &&Knot| {
        let others = knots.iter().filter(|other| other.frame != knot.frame);
        let factor =
            |other: &&Knot| (frame as f64 - other.frame as f64) / (knot.frame as f64 - other.frame as f64);
        others.map(factor).product()
    };
    knots.iter().map(share).collect()
}

/// The taps of a frame on the curve through knots.
fn combined(knots: &[&Knot], frame: usize) -> Mat {
    let parts = knots.iter().zip(shares(knots, frame)).map(|(knot, share)| &knot.taps.weights * share);
    parts.reduce(|sum, part| sum + part).unwrap_or_default()
}

/// The error at a frame, on a line between those of two knots.
fn between(left: &Knot, right: &Knot, frame: usize) -> MeanSquare {
    let [first, second] = [left, right].map(|knot| MeanSquare::mean(&knot.taps.errors));
    let part = (frame - left.frame) as f64 / (right.frame - left.frame) as f64;
    let on_line = |x: f64, y: f64| x + part * (y - x);
    MeanSquare { signal: on_line(first.signal, second.signal), noise: on_line(first.noise, second.noise) }
}
