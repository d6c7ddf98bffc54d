//! Delays at any instant from readings that are known beforehand.

use super::filter::DelayState;
use super::readings::Reading;
use crate::sampling::nonuniform::{Measured, Smoothness};
use crate::sampling::{SamplingError, SmoothingSpline};
use crate::spec::HALF_WIDTH;
use crate::units::Seconds;

/// Readings beyond this many standard deviations of what the others say are refused.
const GATE_SIGMAS: f64 = 5.0;
/// Rounds in which readings are refused, those that contradict the others most in each.
const ROUNDS: usize = 12;
/// Readings on each side of the worst one that are judged again without it.
const BESIDE: usize = 4;
/// Standard deviation of the time of a reading, in frames: it is rounded to a whole frame.
const TIME_ROUNDING: f64 = 0.288_675_134_594_812_9;

/// The delay of one channel over time, from all readings of it: those after an instant count as much as
/// those before it. The rate walks as in a [`super::DelayFilter`], so this is its smoother.
#[derive(Debug, Clone)]
pub(super) struct Timeline {
    spline: SmoothingSpline,
    /// Frames of the readings that were refused.
    refused: Vec<u64>,
}

impl Timeline {
    /// Of channel `i`, with the time of a frame. `None` with readings of fewer than two frames: then the
    /// filter follows them.
    ///
    /// # Errors
    /// [`SamplingError`] if no spline goes through the readings.
    pub(super) fn new(
        readings: &[Reading],
        i: usize,
        frame: Seconds,
        rate_walk: f64,
    ) -> Result<Option<Self>, SamplingError> {
        let of = |reading: &Reading| {
            let (delay, sigma) = reading.delays[i]?;
            let (x, jitter) = (reading.frame as f64 * frame.0, TIME_ROUNDING * frame.0);
            Some((reading.frame, Measured { x, value: delay.0, error: sigma.0, jitter }))
        };
        let mut all: Vec<(u64, Measured)> = readings.iter().filter_map(of).collect();
        let has_two_frames = all.iter().any(|sample| sample.0 != all[0].0);
        if !has_two_frames {
            return Ok(None);
        }
        let mut refused = Vec::new();
        for _ in 0..ROUNDS {
            let spline = spline(&all, rate_walk)?;
            let worst = contradictory(&spline);
            // Without two instants nothing is left to be judged by.
            if worst.is_empty() || all.len() < worst.len() + 2 {
                return Ok(Some(Self { spline, refused }));
            }
            for k in worst.into_iter().rev() {
                refused.push(all.remove(k).0);
            }
        }
        Ok(Some(Self { spline: spline(&all, rate_walk)?, refused }))
    }

    /// What is known at a time.
    pub(super) fn at(&self, time: Seconds) -> DelayState {
        let known = self.spline.at(time.0);
        DelayState {
            delay: Seconds(known.value),
            rate: known.slope,
            delay_variance: known.variance,
            covariance: known.covariance,
            rate_variance: known.slope_variance,
        }
    }

    /// Whether the readings of a frame were refused.
    pub(super) fn refuses(&self, frame: u64) -> bool {
        self.refused.contains(&frame)
    }

    /// By how much the delay errs at most if each reading that was taken is within its 95 % interval and no
    /// rate changes by more than `change` in a second; `None` before the first reading and after the last.
    pub(super) fn bound(&self, time: Seconds, change: f64) -> Option<Seconds> {
        let samples = self.spline.samples();
        let (first, last) = (samples[0].x, samples[samples.len() - 1].x);
        let state = self.at(time);
        let slope = state.rate.abs() + HALF_WIDTH * state.rate_variance.sqrt();
        let limits = Smoothness { slope, curvature: change };
        let is_inside = (first..=last).contains(&time.0);
        is_inside.then(|| Seconds(self.spline.error_bound(time.0, limits, HALF_WIDTH)))
    }
}

fn spline(samples: &[(u64, Measured)], rate_walk: f64) -> Result<SmoothingSpline, SamplingError> {
    SmoothingSpline::new(samples.iter().map(|sample| sample.1).collect(), rate_walk)
}

/// The samples that contradict the others, each the worst of those beside it.
fn contradictory(spline: &SmoothingSpline) -> Vec<usize> {
    let found: Vec<f64> = spline.contradictions().collect();
    let is_worst = |k: &usize| {
        let beside = k.saturating_sub(BESIDE)..(k + BESIDE + 1).min(found.len());
        found[*k] > GATE_SIGMAS && beside.into_iter().all(|j| j == *k || found[j] < found[*k])
    };
    (0..found.len()).filter(is_worst).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;
    use crate::track::{DelayFilter, DelayMeasurement};

    const FRAME: Seconds = Seconds(1e-3);

    /// Readings of one channel every `step` frames, of a delay in seconds.
    fn readings(count: u64, step: u64, sigma: f64, delay: impl Fn(f64) -> f64) -> Vec<Reading> {
        let mut random = Random(21);
        let mut normal = || (0..12).map(|_| random.part()).sum::<f64>() - 6.0;
        let reading = |k| {
            let frame = k * step;
            let value = delay(frame as f64 * FRAME.0) + sigma * normal();
            Reading { frame, delays: vec![Some((Seconds(value), Seconds(sigma)))] }
        };
        (0..count).map(reading).collect()
    }

    const RATE_WALK: f64 = 1e-12;

    /// A rate that changes by 2 ppm in each second: the root mean square error of the smoother is half that
    /// of the filter, and less than the delays two readings ahead that a filter gives to the taps.
    #[test]
    fn readings_on_both_sides_halve_the_error_of_the_filter() {
        let (sigma, delay) = (2e-8, |t: f64| 1e-5 + 3e-6 * t + 5e-7 * (2.0 * t).sin());
        let all = readings(400, 20, sigma, delay);
        let timeline = Timeline::new(&all, 0, FRAME, RATE_WALK).unwrap().unwrap();
        let mut filter = DelayFilter::new(DelayState::known(Seconds(1e-5), 1e-7, 1e-4), RATE_WALK);
        let (mut smoothed, mut filtered, mut predicted, mut stated) = (0.0, 0.0, 0.0, 0.0);
        for reading in &all {
            let time = FRAME * reading.frame as f64;
            let (measured, sigma) = reading.delays[0].unwrap();
            filter.update(DelayMeasurement { delay: measured, variance: sigma.0 * sigma.0 });
            let state = filter.state();
            let ahead = FRAME * 40.0;
            if (60..340).contains(&(reading.frame / 20)) {
                let known = timeline.at(time);
                smoothed += (known.delay.0 - delay(time.0)).powi(2);
                stated += known.delay_variance;
                filtered += (state.delay.0 - delay(time.0)).powi(2);
                predicted += (state.delay.0 + state.rate * ahead.0 - delay((time + ahead).0)).powi(2);
            }
            filter.advance(FRAME * 20.0);
        }
        let ratio = |a: f64, b: f64| f64::sqrt(a / b);
        assert!(ratio(smoothed, filtered) < 0.6, "{}", ratio(smoothed, filtered));
        assert!(ratio(smoothed, predicted) < 0.45, "{}", ratio(smoothed, predicted));
        assert!((0.6..1.5).contains(&ratio(smoothed, stated)), "{}", ratio(smoothed, stated));
    }

    #[test]
    fn false_readings_are_refused() {
        let mut all = readings(200, 20, 2e-8, |t| 1e-5 + 3e-6 * t);
        for k in [3, 77, 78, 150] {
            all[k].delays[0].as_mut().unwrap().0 += Seconds(1e-6);
        }
        let timeline = Timeline::new(&all, 0, FRAME, RATE_WALK).unwrap().unwrap();
        let refused: Vec<u64> = (0..200).filter(|k| timeline.refuses(20 * k)).collect();
        assert_eq!(refused, [3, 77, 78, 150]);
        let known = timeline.at(Seconds(1.55));
        assert!((known.delay.0 - 1e-5 - 3e-6 * 1.55).abs() < 4.0 * known.deviation().0, "{known:?}");
    }

    /// Between two exact readings at the distance T the error of a parabola is |f''| a b / 2.
    #[test]
    fn the_bound_between_two_readings_is_that_of_a_parabola() {
        let delay = |t: f64| Some((Seconds(0.5e-6 * t * t), Seconds(1e-14)));
        let all: Vec<Reading> =
            [0, 4000].map(|f| Reading { frame: f, delays: vec![delay(1e-3 * f as f64)] }).into();
        let timeline = Timeline::new(&all, 0, FRAME, RATE_WALK).unwrap().unwrap();
        for t in [1.0, 2.0, 3.0] {
            let miss = timeline.at(Seconds(t)).delay.0 - 0.5e-6 * t * t;
            let bound = timeline.bound(Seconds(t), 1e-6).unwrap().0;
            assert!((miss - 0.5e-6 * t * (4.0 - t)).abs() < 1e-10, "{miss:e}");
            // Readings are rounded to whole frames, in which the delay moves by up to 3 ns.
            assert!(miss < bound && bound < miss + 4e-9, "{t}: {miss:e} {bound:e}");
        }
        assert_eq!(timeline.bound(Seconds(4.1), 1e-6), None);
    }

    #[test]
    fn one_reading_is_left_to_the_filter() {
        let all = readings(5, 20, 1e-8, |t| t);
        assert!(Timeline::new(&all[..1], 0, FRAME, RATE_WALK).unwrap().is_none());
    }

    /// A reading whose interval is no number leaves no spline, which is an error and not a missing timeline.
    #[test]
    fn readings_without_a_spline_are_an_error() {
        let mut all = readings(5, 20, 1e-8, |t| t);
        all[2].delays[0].as_mut().unwrap().1 = Seconds(f64::NAN);
        let refused = Timeline::new(&all, 0, FRAME, RATE_WALK).unwrap_err();
        assert!(matches!(refused, SamplingError::NotFinite { .. }), "{refused}");
    }
}
