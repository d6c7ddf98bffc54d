//! When the samples of a recording were taken, on the clock of the reference.

use super::bend::Bend;
use crate::instants::{Clock, Recording};
use crate::sampling::nonuniform::Measured;
use crate::sampling::{Known, LearnedSpline, few_readings, median};
use crate::sine_fit::Estimate;
use crate::units::FastPeriods;
use serde::Serialize;
use std::ops::Range;

/// Samples between two knots of a clock for fusion: its rate is constant over them.
const KNOT_EVERY: usize = 256;
/// Rounds in which the sample of an instant is found.
const INVERSE_ROUNDS: usize = 5;

/// What one piece says of a clock. Samples are those of the recording with its steps mended.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClockReading {
    /// Number of the piece.
    pub(super) piece: usize,
    /// Sample of the recording.
    pub(super) sample: f64,
    /// The sample minus its instant, in samples of the reference.
    pub(super) lag: f64,
    /// Standard deviation of the lag.
    pub(super) deviation: f64,
}

impl ClockReading {
    fn measured(&self) -> Measured {
        Measured { x: self.sample, value: self.lag, error: self.deviation, jitter: 0.0 }
    }
}

/// A place where a recording lacks samples, or has some that the reference has not.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct ClockStep {
    /// Samples of the recording, as given, among which it lies: what they hold belongs to neither side.
    pub samples: Range<usize>,
    /// Samples that are lost; below 0 those that are too many.
    pub lost: i64,
}

/// When the samples of a recording were taken: a smooth course with steps where samples were lost.
///
/// Samples count from the first one of the recording as it was given, instants in samples of the recording
/// of the reference, from its first one. Both may be fractions, and beyond the readings the course goes on
/// as a line.
#[derive(Debug, Clone)]
pub struct ClockCourse {
    /// The lag over the samples with the steps mended. None for the reference.
    smooth: Option<LearnedSpline>,
    /// What the spline lacks of them.
    bend: Bend,
    /// By their samples.
    steps: Vec<ClockStep>,
    /// Those that were not refused, by their pieces.
    readings: Vec<ClockReading>,
}

impl ClockCourse {
    /// Of the reference itself.
    pub(super) fn reference() -> Self {
        Self { smooth: None, bend: Bend::none(), steps: Vec::new(), readings: Vec::new() }
    }

    /// Through readings of a recording with these steps. `None` if no spline goes through them, and with
    /// those of fewer than two samples.
    pub(super) fn new(readings: Vec<ClockReading>, steps: Vec<ClockStep>) -> Option<Self> {
        let bend = Bend::of(&readings);
        let straight = |reading: &ClockReading| {
            ClockReading { lag: reading.lag - bend.at(reading.sample), ..*reading }.measured()
        };
        let all: Vec<Measured> = readings.iter().map(straight).collect();
        let (smooth, kept) = LearnedSpline::through(&all)?;
        let kept = kept.into_iter().map(|k| readings[k]);
        let readings =
            kept.map(|reading| ClockReading { deviation: reading.deviation * smooth.scale(), ..reading });
        Some(Self { readings: readings.collect(), smooth: Some(smooth), bend, steps })
    }

    /// The instant of a sample, in samples of the reference.
    pub fn at(&self, sample: f64) -> f64 {
        let mended = self.mended(sample);
        mended - self.lag(mended)
    }

    /// Standard deviation of the instant of a sample, in samples of the reference.
    pub fn deviation(&self, sample: f64) -> f64 {
        self.known(self.mended(sample)).sigma
    }

    /// Where samples were lost or came in.
    pub fn steps(&self) -> &[ClockStep] {
        &self.steps
    }

    /// The samples of a recording with their instants, without those amid a step. They come once in
    /// `spacing` of those that this course counts, in units of which `ratio` are a sample of the reference.
    pub(crate) fn recording(
        &self,
        mut samples: Vec<f64>,
        channel: usize,
        spacing: f64,
        ratio: f64,
    ) -> Recording {
        let (scaled, count) = (|k: usize| (k as f64 / spacing).round() as usize, samples.len());
        for step in &self.steps {
            let end = scaled(step.samples.end).min(count);
            samples[scaled(step.samples.start).min(end)..end].fill(f64::NAN);
        }
        let beside =
            |step: &ClockStep| [scaled(step.samples.start).saturating_sub(1), scaled(step.samples.end)];
        let all = (0..count).step_by(KNOT_EVERY).chain(self.steps.iter().flat_map(beside)).chain([count]);
        let mut knots: Vec<usize> = all.collect();
        knots.sort_unstable();
        knots.dedup();
        let instant = |k: &usize| (*k as f64, FastPeriods(self.at(*k as f64 * spacing) * ratio));
        let even = || Clock::even(FastPeriods(self.at(0.0) * ratio), FastPeriods(ratio * spacing));
        // Only steps back in time could spoil a clock, and no recorder makes them.
        Recording::new(samples, Clock::through(knots.iter().map(instant)).unwrap_or_else(|_| even()), channel)
    }

    /// The usual deviation of the instants of so many samples: the median, because at the ends a clock is
    /// known far worse than elsewhere.
    pub(crate) fn usual_deviation(&self, count: usize) -> f64 {
        median((0..count).step_by(KNOT_EVERY).map(|k| self.deviation(k as f64)).collect())
    }

    /// The number of a sample had none been lost before it.
    fn mended(&self, sample: f64) -> f64 {
        let before = self.steps.iter().take_while(|step| step.samples.end as f64 <= sample);
        sample + before.map(|step| step.lost as f64).sum::<f64>()
    }

    /// By how much a sample of the mended recording is larger than its instant.
    pub(super) fn lag(&self, mended: f64) -> f64 {
        self.smooth.as_ref().map_or(0.0, |smooth| smooth.value(mended)) + self.bend.at(mended)
    }

    /// The same with its deviation.
    pub(super) fn known(&self, mended: f64) -> Estimate<f64> {
        let Some(smooth) = &self.smooth else { return Estimate { value: 0.0, sigma: 0.0 } };
        let Known { value, deviation } = smooth.at(mended);
        Estimate { value: value + self.bend.at(mended), sigma: deviation }
    }

    /// The sample of the mended recording that was taken at an instant.
    pub(super) fn sample_at(&self, instant: f64) -> f64 {
        // Clocks differ so little that each round gains three digits.
        (0..INVERSE_ROUNDS).fold(instant, |sample, _| instant + self.lag(sample))
    }

    /// By how much the clock is fast: the slope of the line that is closest to the lags. Their first and
    /// last ones alone would say it with the errors of few pieces. The deviation is that of the scatter
    /// around the line.
    pub(super) fn drift(&self) -> Estimate<f64> {
        let weight = |reading: &ClockReading| reading.deviation.powi(-2);
        let sum = |of: &dyn Fn(&ClockReading) -> f64| -> f64 {
            self.readings.iter().map(|reading| weight(reading) * of(reading)).sum()
        };
        let weights = sum(&|_| 1.0);
        let (middle, mean) = (sum(&|one| one.sample) / weights, sum(&|one| one.lag) / weights);
        let squares = sum(&|one| (one.sample - middle).powi(2));
        let slope = sum(&|one| (one.sample - middle) * (one.lag - mean)) / squares;
        let misfit = sum(&|one| (one.lag - mean - slope * (one.sample - middle)).powi(2));
        let freedom = self.readings.len().saturating_sub(2).max(1) as f64;
        let scatter = (misfit / freedom * few_readings(freedom) / squares).sqrt();
        // From samples of the recording to those of the reference.
        Estimate { value: slope / (1.0 - slope), sigma: scatter }
    }

    /// The reading of a piece, unless it has none or that was refused.
    pub(super) fn reading(&self, piece: usize) -> Option<&ClockReading> {
        self.readings.binary_search_by_key(&piece, |reading| reading.piece).ok().map(|k| &self.readings[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// Readings every `step` samples of a lag.
    fn readings(count: usize, step: usize, deviation: f64, lag: impl Fn(f64) -> f64) -> Vec<ClockReading> {
        let mut random = Random(21);
        let mut normal = || (0..12).map(|_| random.part()).sum::<f64>() - 6.0;
        let reading = |piece| {
            let sample = (piece * step) as f64;
            ClockReading { piece, sample, lag: lag(sample) + deviation * normal(), deviation }
        };
        (0..count).map(reading).collect()
    }

    /// A rate that changes by 2 ppm in a thousand samples: the lags err as the course states.
    #[test]
    fn the_stated_error_is_that_of_the_lags() {
        let lag = |k: f64| 10.0 + 3e-6 * k + 5e-4 * (2e-3 * k).sin();
        let all = readings(400, 20, 2e-5, lag);
        let course = ClockCourse::new(all.clone(), Vec::new()).unwrap();
        let (mut smoothed, mut stated) = (0.0, 0.0);
        for reading in &all[60..340] {
            let k = reading.sample;
            smoothed += (course.at(k) - k + lag(k)).powi(2);
            stated += course.deviation(k).powi(2);
        }
        let ratio = f64::sqrt(smoothed / stated);
        assert!((0.6..1.5).contains(&ratio) && smoothed < 280.0 * 0.25 * 4e-10, "{ratio} {smoothed:e}");
    }

    /// A rate that turns round, as it does by temperature, with lags known far better than they bend between
    /// two readings: none is refused, and the ends are as good as the middle.
    #[test]
    fn a_rate_that_turns_round_is_followed_to_its_ends() {
        let lag = |k: f64| 10.0 + 4e-4 * k * (1.0 - k / 4000.0);
        let course = ClockCourse::new(readings(200, 20, 1e-6, lag), Vec::new()).unwrap();
        assert!((0..200).all(|piece| course.reading(piece).is_some()));
        for k in [0.0, 20.0, 1500.0, 3960.0, 3980.0] {
            let miss = course.at(k) - k + lag(k);
            assert!(miss.abs() < 2e-6, "{k}: {miss:e}");
        }
        let straight = ClockCourse::new(readings(200, 20, 1e-6, |k| 3e-6 * k), Vec::new()).unwrap();
        assert_eq!(straight.bend.at(3000.0), 0.0);
    }

    /// A rate that jumps between two readings: none beside the jump is refused.
    #[test]
    fn a_rate_that_jumps_is_followed_around_its_jump() {
        let lag = |k: f64| 10.0 + 2e-5 * k.min(1567.0) - 1e-5 * (k - 1567.0).max(0.0);
        let course = ClockCourse::new(readings(200, 20, 1e-6, lag), Vec::new()).unwrap();
        assert!((0..200).all(|piece| course.reading(piece).is_some()));
        for k in [0.0, 1540.0, 1560.0, 1567.0, 1574.0, 1590.0, 3980.0] {
            let miss = course.at(k) - k + lag(k);
            assert!(miss.abs() < 1e-6, "{k}: {miss:e}");
        }
    }

    #[test]
    fn false_readings_are_refused() {
        let mut all = readings(200, 20, 2e-5, |k| 10.0 + 3e-6 * k);
        for k in [3, 77, 78, 150] {
            all[k].lag += 1e-3;
        }
        let course = ClockCourse::new(all, Vec::new()).unwrap();
        let refused: Vec<usize> = (0..200).filter(|piece| course.reading(*piece).is_none()).collect();
        assert_eq!(refused, [3, 77, 78, 150]);
        let miss = course.at(1550.0) - (1540.0 - 3e-6 * 1550.0);
        assert!(miss.abs() < 4.0 * course.deviation(1550.0), "{miss:e}");
    }

    #[test]
    fn one_reading_has_no_course() {
        let all = readings(5, 20, 1e-8, |k| k);
        assert!(ClockCourse::new(all[..1].to_vec(), Vec::new()).is_none());
    }

    /// Nor has a reading whose interval is no number.
    #[test]
    fn readings_without_numbers_have_no_course() {
        let mut all = readings(5, 20, 1e-8, |k| k);
        all[2].deviation = f64::NAN;
        assert!(ClockCourse::new(all, Vec::new()).is_none());
    }

    #[test]
    fn lost_samples_are_steps_of_the_course() {
        let steps = vec![ClockStep { samples: 30..32, lost: 7 }, ClockStep { samples: 60..60, lost: -2 }];
        let course = ClockCourse::new(readings(5, 20, 1e-8, |_| 10.0), steps).unwrap();
        let instants = [29.0, 31.0, 32.0, 59.5, 60.0, 61.0].map(|k| course.at(k));
        let want = [19.0, 21.0, 29.0, 56.5, 55.0, 56.0];
        assert!(instants.iter().zip(&want).all(|(a, b)| (a - b).abs() < 1e-6), "{instants:?}");
        assert_eq!(ClockCourse::reference().at(3.25), 3.25);
    }
}
