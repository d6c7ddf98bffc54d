//! Recorders of nearly one rate: taps for the instants at knots of time, and curves between them.
//!
//! From frame to frame the samples move along with the outputs, only their offsets drift. So a set of taps
//! serves for many frames, and over an interval of frames the taps are on a curve of the fourth degree
//! through five knots. Knots lie at absolute frames, dense where taps change fast: an interval is halved as
//! long as the parabola through three of its knots is much worse at the other two than the best taps there,
//! or the samples next to an output are at one instant within it. There taps change sign within a ten
//! thousandth of a period, which no look at the knots would find.

use super::demand::Outputs;
use super::estimator::{EstimatorTaps, MeanSquare, TimedSample};
use super::fusion::KnownInstantFusion;
use super::recording::Recording;
use hybank_core::units::FastPeriods;
use hybank_linalg::{LinalgError, Mat, add_filtered};
use std::ops::Range;

/// What the error on a parabola through three of the five knots of a curve may be over that of the best taps
/// at the two others. The curve then loses less than 0.1 dB: taps are a function of time whose poles lie
/// outside of 1.25 times the interval around its middle, else the parabola would be worse. So the errors of
/// the taps on the curve are at most 0.2 times those on the parabola, and the loss goes with their square.
const MOST_LOSS: f64 = 1.4;
/// Knots of a curve, and frames of an interval that has one.
const KNOTS_OF_CURVE: usize = 5;

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
        refinement.refine(first, None, &last)?;
        let mut stretch = refinement.stretch;
        stretch.knots.push(last);
        Ok(stretch)
    }

    /// The samples of the recording `i` for a frame.
    fn numbers(&self, i: usize, frame: usize) -> Range<i64> {
        let start = self.starts[i] + frame as i64;
        start..start + self.count as i64
    }

    /// The outputs of some frames of the stretch.
    ///
    /// # Errors
    /// [`LinalgError::NotPositiveDefinite`] for samples that are given twice.
    pub(super) fn outputs(
        &self,
        fusion: &KnownInstantFusion<'_>,
        frames: Range<usize>,
    ) -> Result<Outputs, LinalgError> {
        let begin = |curve: &Curve| self.knots[curve.first].frame;
        let first = self.curves.partition_point(|curve| begin(curve) <= frames.start).max(1) - 1;
        let mut made = Made { outputs: Vec::new(), errors: Vec::with_capacity(frames.len()) };
        for (k, Curve { first, count }) in self.curves.iter().enumerate().skip(first) {
            let start = frames.start + made.errors.len();
            let end = self.curves.get(k + 1).map_or(frames.end, |next| begin(next).min(frames.end));
            let knots: Vec<&Knot> = self.knots[*first..first + count].iter().collect();
            self.on_curve(fusion, &knots, start..end, &mut made)?;
            if end == frames.end {
                break;
            }
        }
        Ok(Outputs { outputs: made.outputs, error: MeanSquare::mean(&made.errors) })
    }

    /// Those of frames on one curve: shares of what the taps of its knots give, and of their errors. Frames
    /// of which a sample is not there have taps of their own.
    fn on_curve(
        &self,
        fusion: &KnownInstantFusion<'_>,
        knots: &[&Knot],
        mut frames: Range<usize>,
        made: &mut Made,
    ) -> Result<(), LinalgError> {
        let Some(of_knots) = self.by_knots(knots, fusion.recordings, frames.clone()) else {
            if frames.len() > 1 {
                return frames.try_for_each(|frame| self.on_curve(fusion, knots, frame..frame + 1, made));
            }
            let Outputs { outputs, error } = fusion.of_set(&fusion.layout.grid.instants(frames))?;
            made.outputs.extend(outputs);
            made.errors.push(error);
            return Ok(());
        };
        let phases = of_knots.ncols() / knots.len();
        let by_knots: Vec<&[f64]> = of_knots.as_slice().chunks(of_knots.nrows()).collect();
        let errors: Vec<MeanSquare> = knots.iter().map(|knot| MeanSquare::mean(&knot.taps.errors)).collect();
        for (row, frame) in frames.enumerate() {
            let begin = made.outputs.len();
            made.outputs.resize(begin + phases, 0.0);
            let mut on_curve = MeanSquare { signal: 0.0, noise: 0.0 };
            for ((share, of_knot), error) in shares(knots, frame).zip(by_knots.chunks(phases)).zip(&errors) {
                let outputs = made.outputs[begin..].iter_mut().zip(of_knot);
                outputs.for_each(|(output, of_knot)| *output += share * of_knot[row]);
                on_curve.signal += share * error.signal;
                on_curve.noise += share * error.noise;
            }
            let MeanSquare { signal, noise } = on_curve;
            made.errors.push(MeanSquare { signal: signal.max(0.0), noise: noise.max(0.0) });
        }
        Ok(())
    }

    /// What the taps of each knot give at some frames (rows), in columns by knots and phases; `None` where a
    /// sample is not there.
    fn by_knots(&self, knots: &[&Knot], recordings: &[Recording], frames: Range<usize>) -> Option<Mat> {
        let phases = knots[0].taps.weights.ncols();
        let mut sums = Mat::zeros(frames.len(), knots.len() * phases);
        for (i, recording) in recordings.iter().enumerate() {
            let samples = self.numbers(i, frames.start).start..self.numbers(i, frames.end - 1).end;
            let samples = recording.whole(samples)?;
            let tap = |row: usize, column: usize| {
                knots[column / phases].taps.weights[(i * self.count + row, column % phases)]
            };
            add_filtered(&mut sums, samples, &Mat::from_fn(self.count, knots.len() * phases, tap));
        }
        Some(sums)
    }
}

/// Outputs of frames, and the errors of the frames.
struct Made {
    outputs: Vec<f64>,
    errors: Vec<MeanSquare>,
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

    /// Adds `left` and the knots between it and `right`; the middle one may be known.
    fn refine(&mut self, left: Knot, middle: Option<Knot>, right: &Knot) -> Result<(), LinalgError> {
        let frames = [left.frame, right.frame];
        if frames[1] - frames[0] < 2 {
            self.add([left]);
            return Ok(());
        }
        let frame = frames[0].midpoint(frames[1]);
        let middle = middle.map_or_else(|| self.knot(frame), Ok)?;
        let mut quarters = [None, None];
        if frames[1] - frames[0] >= KNOTS_OF_CURVE && !self.has_coincidence(frames[0], frames[1]) {
            let three = [&left, &middle, right];
            let (first, is_near) = self.beside(frames[0].midpoint(frame), three)?;
            if is_near {
                let (third, is_near) = self.beside(frame.midpoint(frames[1]), three)?;
                if is_near {
                    self.add([left, first, middle, third]);
                    return Ok(());
                }
                quarters[1] = Some(third);
            }
            quarters[0] = Some(first);
        }
        let [first, third] = quarters;
        self.refine(left, first, &middle)?;
        self.refine(middle, third, right)
    }

    /// The knot at a frame, and whether the parabola through others is near to it.
    fn beside(&self, frame: usize, others: [&Knot; 3]) -> Result<(Knot, bool), LinalgError> {
        let samples = self.samples(frame);
        let set = self.fusion.estimator.set(&samples);
        let with_target = set.with_target(&self.fusion.layout.grid.phases());
        let taps = set.taps(&with_target)?;
        let on_parabola = set.errors(&combined(&others, frame), &with_target);
        let mut pairs = on_parabola.iter().zip(&taps.errors);
        let is_near = pairs.all(|(parabola, best)| parabola.total() <= MOST_LOSS * best.total());
        Ok((Knot { frame, taps }, is_near))
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

/// The shares of knots in the taps of a frame on the curve through them.
fn shares(knots: &[&Knot], frame: usize) -> impl Iterator<Item = f64> {
    let share = move |knot: &&Knot| -> f64 {
        let others = knots.iter().filter(|other| other.frame != knot.frame);
        let factor =
            |other: &&Knot| (frame as f64 - other.frame as f64) / (knot.frame as f64 - other.frame as f64);
        others.map(factor).product()
    };
    knots.iter().map(share)
}

/// The taps of a frame on the curve through knots.
fn combined(knots: &[&Knot], frame: usize) -> Mat {
    let parts = knots.iter().zip(shares(knots, frame)).map(|(knot, share)| &knot.taps.weights * share);
    parts.reduce(|sum, part| sum + part).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::super::{Clock, Converter, Estimator, FusionSettings, Signals, Spectrum};
    use super::*;
    use crate::fusion::Layout;
    use hybank_core::units::CyclesPerFastPeriod;
    use hybank_linalg::Complex;

    /// Over a coincidence, and away from one: at frames between the knots the taps of the curves against the
    /// best ones.
    #[test]
    fn curves_lose_less_than_a_tenth_of_a_decibel() {
        let clocks = [(0.0, 2.0), (-0.04, 2.00004)]
            .map(|(first, period)| Clock::even(FastPeriods(first), FastPeriods(period)));
        let recordings =
            [0, 1].map(|i: usize| Recording::new(vec![0.0; 9000], clocks[i].clone(), i)).to_vec();
        let settings = FusionSettings { first: FastPeriods(200.0), count: 0, reach: 24 };
        let (low, middle, high) = (0.0, 0.1, 0.375);
        let band = |low, high| CyclesPerFastPeriod(low)..CyclesPerFastPeriod(high);
        let spectrum = Spectrum::of_pieces(
            [(band(low, middle), 1.0), (band(middle, high), 0.02)],
            settings.longest(&recordings),
        );
        let converters = vec![Converter::exact(0, 1.0, 3e-8), Converter::exact(0, -0.6, 1e-8)];
        let signals = Signals::new(&spectrum, &[&|_| Complex::from(1.0)], 0, converters);
        let estimator = Estimator::new(signals);
        let layout = Layout::new(&estimator, &recordings, settings);
        let fusion = KnownInstantFusion { estimator: &estimator, recordings: &recordings, layout };
        let stretch = Stretch::new(&fusion, 0..4096).unwrap();
        assert!(stretch.knots.len() < 250, "{}", stretch.knots.len());
        let refinement = Refinement { fusion: &fusion, stretch };
        for frame in (3..4096).step_by(37).chain(830..970) {
            let of_frame = |curve: &Curve| refinement.stretch.knots[curve.first].frame <= frame;
            let Curve { first, count } =
                refinement.stretch.curves[refinement.stretch.curves.partition_point(of_frame) - 1];
            let knots: Vec<&Knot> = refinement.stretch.knots[first..first + count].iter().collect();
            let samples = refinement.samples(frame);
            let set = estimator.set(&samples);
            let with_target = set.with_target(&layout.grid.phases());
            let best = set.taps(&with_target).unwrap().errors;
            for (on_curve, best) in set.errors(&combined(&knots, frame), &with_target).iter().zip(best) {
                let loss = 10.0 * (on_curve.total() / best.total()).log10();
                assert!(loss < 0.1, "frame {frame}: {loss} dB");
            }
        }
    }
}
