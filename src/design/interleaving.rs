//! Plain interleaving: each output sample is the slow sample that was taken nearest to its instant.

use crate::units::FastPeriods;

/// The slow sample nearest to the instant of an output phase.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NearestSample {
    /// Index of its channel, from 0.
    pub channel: usize,
    /// Age in slow periods: frame k gives the output sample the slow sample k - lag. Negative for a sample
    /// that is taken after the frame.
    pub lag: i64,
}

/// The nearest sample of each of the M output phases; empty without channels.
///
/// Phase p of frame k belongs to the instant k M + p - m0 in fast periods, and sample l of channel i to
/// l M - D_i. Of equally near samples that of the first channel is taken. No lag is below `least_lag`: 0 for
/// causal interleaving, `i64::MIN` where the whole recording is known.
pub fn nearest_samples(
    delays: &[FastPeriods],
    ratio: usize,
    latency: usize,
    least_lag: i64,
) -> Vec<NearestSample> {
    let period = ratio as f64;
    let nearest = |phase: usize| {
        let instant = phase as f64 - latency as f64;
        let of_channel = |(channel, delay): (usize, &FastPeriods)| {
            let lag = ((-instant - delay.0) / period).round() as i64;
            let lag = lag.max(least_lag);
            let distance = (instant + lag as f64 * period + delay.0).abs();
            (distance, NearestSample { channel, lag })
        };
        let samples = delays.iter().enumerate().map(of_channel);
        samples.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, sample)| sample)
    };
    (0..ratio).filter_map(nearest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn nearest(delays: &[f64], ratio: usize, latency: usize, least_lag: i64) -> Vec<(usize, i64)> {
        let delays: Vec<_> = delays.iter().copied().map(FastPeriods).collect();
        let samples = nearest_samples(&delays, ratio, latency, least_lag);
        samples.into_iter().map(|sample| (sample.channel, sample.lag)).collect()
    }

    #[test]
    fn each_phase_has_the_nearest_sample() {
        // Instants -3 and -2; of the last period the samples at -3.4 and -2.2.
        assert_eq!(nearest(&[1.4, 0.2], 2, 3, 0), [(0, 1), (1, 1)]);
    }

    #[test]
    fn a_causal_bank_has_no_sample_of_the_future() {
        // Instant 1 of frame 0: the nearest sample is taken at 1.5, the next period's.
        assert_eq!(nearest(&[0.5], 2, 0, i64::MIN), [(0, 0), (0, -1)]);
        assert_eq!(nearest(&[0.5], 2, 0, 0), [(0, 0), (0, 0)]);
        assert_eq!(nearest(&[], 2, 0, 0), []);
    }

    proptest! {
        /// Against a search of all samples within ten periods.
        #[test]
        fn no_sample_is_nearer(
            delays in prop::collection::vec(-9.0..9.0, 1..5),
            ratio in 1usize..6,
            latency in 0usize..9,
        ) {
            for (phase, (channel, lag)) in nearest(&delays, ratio, latency, i64::MIN).into_iter().enumerate() {
                let instant = phase as f64 - latency as f64;
                let distance = |i: usize, lag: i64| (instant + (lag * ratio as i64) as f64 + delays[i]).abs();
                let all = (0..delays.len()).flat_map(|i| (-30..30).map(move |lag| (i, lag)));
                let least = all.map(|(i, lag)| distance(i, lag)).fold(f64::INFINITY, f64::min);
                prop_assert!(distance(channel, lag) <= least + 1e-12);
            }
        }
    }
}
