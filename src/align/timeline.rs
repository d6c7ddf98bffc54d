//! Delays at any instant from readings that are known beforehand.

use super::reading::Reading;
use crate::sampling::SmoothingSpline;
use crate::sampling::nonuniform::Measured;
use crate::sine_fit::Estimate;
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
/// those before it. The rate walks at random.
#[derive(Debug, Clone)]
pub(super) struct Timeline {
    spline: SmoothingSpline,
    /// Frames of the readings that were refused.
    refused: Vec<u64>,
}

impl Timeline {
    /// Of channel `i`, with the time of a frame. `None` if no spline goes through the readings, and with
    /// those of fewer than two frames.
    pub(super) fn new(readings: &[Reading], i: usize, frame: Seconds, rate_walk: f64) -> Option<Self> {
        let of = |reading: &Reading| {
            let (delay, sigma) = reading.delays[i]?;
            let (x, jitter) = (reading.frame as f64 * frame.0, TIME_ROUNDING * frame.0);
            Some((reading.frame, Measured { x, value: delay.0, error: sigma.0, jitter }))
        };
        let mut all: Vec<(u64, Measured)> = readings.iter().filter_map(of).collect();
        let has_two_frames = all.iter().any(|sample| sample.0 != all[0].0);
        if !has_two_frames {
            return None;
        }
        let mut refused = Vec::new();
        for _ in 0..ROUNDS {
            let spline = spline(&all, rate_walk)?;
            let worst = contradictory(&spline);
            // Without two instants nothing is left to be judged by.
            if worst.is_empty() || all.len() < worst.len() + 2 {
                return Some(Self { spline, refused });
            }
            for k in worst.into_iter().rev() {
                refused.push(all.remove(k).0);
            }
        }
        Some(Self { spline: spline(&all, rate_walk)?, refused })
    }

    /// The delay at a time.
    pub(super) fn at(&self, time: Seconds) -> Estimate<Seconds> {
        let known = self.spline.at(time.0);
        Estimate { value: Seconds(known.value), sigma: Seconds(known.variance.sqrt()) }
    }

    /// Whether the readings of a frame were refused.
    pub(super) fn refuses(&self, frame: u64) -> bool {
        self.refused.contains(&frame)
    }
}

fn spline(samples: &[(u64, Measured)], rate_walk: f64) -> Option<SmoothingSpline> {
    SmoothingSpline::new(samples.iter().map(|sample| sample.1).collect(), rate_walk).ok()
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

    /// A rate that changes by 2 ppm in each second: the delays err as the spline states.
    #[test]
    fn the_stated_error_is_that_of_the_delays() {
        let delay = |t: f64| 1e-5 + 3e-6 * t + 5e-7 * (2.0 * t).sin();
        let all = readings(400, 20, 2e-8, delay);
        let timeline = Timeline::new(&all, 0, FRAME, RATE_WALK).unwrap();
        let (mut smoothed, mut stated) = (0.0, 0.0);
        for reading in &all[60..340] {
            let time = FRAME * reading.frame as f64;
            let known = timeline.at(time);
            smoothed += (known.value.0 - delay(time.0)).powi(2);
            stated += known.sigma.0.powi(2);
        }
        let ratio = f64::sqrt(smoothed / stated);
        assert!((0.6..1.5).contains(&ratio) && smoothed < 280.0 * 0.25 * 4e-16, "{ratio} {smoothed:e}");
    }

    #[test]
    fn false_readings_are_refused() {
        let mut all = readings(200, 20, 2e-8, |t| 1e-5 + 3e-6 * t);
        for k in [3, 77, 78, 150] {
            all[k].delays[0].as_mut().unwrap().0 += Seconds(1e-6);
        }
        let timeline = Timeline::new(&all, 0, FRAME, RATE_WALK).unwrap();
        let refused: Vec<u64> = (0..200).filter(|k| timeline.refuses(20 * k)).collect();
        assert_eq!(refused, [3, 77, 78, 150]);
        let known = timeline.at(Seconds(1.55));
        assert!((known.value.0 - 1e-5 - 3e-6 * 1.55).abs() < 4.0 * known.sigma.0, "{known:?}");
    }

    #[test]
    fn one_reading_has_no_spline() {
        let all = readings(5, 20, 1e-8, |t| t);
        assert!(Timeline::new(&all[..1], 0, FRAME, RATE_WALK).is_none());
    }

    /// Nor has a reading whose interval is no number.
    #[test]
    fn readings_without_numbers_have_no_spline() {
        let mut all = readings(5, 20, 1e-8, |t| t);
        all[2].delays[0].as_mut().unwrap().1 = Seconds(f64::NAN);
        assert!(Timeline::new(&all, 0, FRAME, RATE_WALK).is_none());
    }
}
