//! The Kalman filter of one delay and its rate of change, and delays that come together.

use crate::spec::Spec;
use crate::units::Seconds;

/// A delay, its rate of change, and what is known of them: the entries of the symmetric covariance matrix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayState {
    /// The expected delay.
    pub delay: Seconds,
    /// Its expected change, seconds per second (1e-6 is one part per million).
    pub rate: f64,
    /// Variance of the delay, s^2.
    pub delay_variance: f64,
    /// Covariance of delay and rate, s.
    pub covariance: f64,
    /// Variance of the rate.
    pub rate_variance: f64,
}

/// A delay as a block fit gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayMeasurement {
    /// The delay.
    pub delay: Seconds,
    /// Its variance, s^2: the Cramér-Rao bound of an efficient fit.
    pub variance: f64,
}

/// By how much a measurement differs from what was expected.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation {
    /// Measured minus expected delay.
    pub difference: Seconds,
    /// Variance of the difference, s^2.
    pub variance: f64,
}

/// The Kalman filter of a [`DelayState`]: the delay changes by its rate, and the rate walks at random in
/// independent increments, as the frequencies of oscillators do.
///
/// Its covariance matrix is U D U' with U = [1 u; 0 1] and D = diag(d, e), so that no digit is lost to a
/// difference, however much better the measurements are than what was known before (Bierman, 1977).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DelayFilter {
    delay: Seconds,
    rate: f64,
    /// u: the delay that belongs to a rate, s.
    delay_per_rate: f64,
    /// d: variance of the delay for a given rate, s^2.
    own_variance: f64,
    /// e: variance of the rate.
    rate_variance: f64,
    /// Variance by which the rate walks in a second, in (s/s)^2 / s.
    rate_walk: f64,
}

impl DelayState {
    /// A delay with the standard deviation `deviation` in seconds, whose rate is zero with the standard
    /// deviation `rate_deviation`.
    pub fn known(delay: Seconds, deviation: f64, rate_deviation: f64) -> Self {
        Self {
            delay,
            rate: 0.0,
            delay_variance: deviation * deviation,
            covariance: 0.0,
            rate_variance: rate_deviation * rate_deviation,
        }
    }

    /// Standard deviation of the delay.
    pub fn deviation(&self) -> Seconds {
        Seconds(self.delay_variance.sqrt())
    }
}

impl Innovation {
    /// The difference over its standard deviation; infinite if the expectation was certain and wrong.
    pub fn sigmas(&self) -> f64 {
        if self.difference.0 == 0.0 { 0.0 } else { self.difference.0.abs() / self.variance.sqrt() }
    }
}

impl DelayFilter {
    /// A filter that knows `state`, of a rate whose variance grows by `rate_walk` (s/s)^2 in a second.
    pub fn new(state: DelayState, rate_walk: f64) -> Self {
        let DelayState { delay, rate, delay_variance, covariance, rate_variance } = state;
        let delay_per_rate = if rate_variance > 0.0 { covariance / rate_variance } else { 0.0 };
        let own_variance = (delay_variance - delay_per_rate * covariance).max(0.0);
        Self { delay, rate, delay_per_rate, own_variance, rate_variance, rate_walk }
    }

    /// A filter of the same walk that knows `state`.
    pub fn restarted(self, state: DelayState) -> Self {
        Self::new(state, self.rate_walk)
    }

    /// What is known now.
    pub fn state(&self) -> DelayState {
        let covariance = self.delay_per_rate * self.rate_variance;
        DelayState {
            delay: self.delay,
            rate: self.rate,
            delay_variance: self.own_variance + self.delay_per_rate * covariance,
            covariance,
            rate_variance: self.rate_variance,
        }
    }

    /// Lets the time `elapsed` >= 0 pass without a measurement. With T the time, the covariance becomes
    /// F P F' + Q with F = [1 T; 0 1] and Q = rate_walk [T^3/3 T^2/2; T^2/2 T].
    pub fn advance(&mut self, elapsed: Seconds) {
        let t = elapsed.0;
        self.delay += Seconds(self.rate * t);
        // The rate as it was and its walk are independent parts of the new rate, to which the delays u + T
        // and T / 2 belong: their weighted mean is the new u, and their spread belongs to the delay alone.
        let (known, walked) = (self.rate_variance, self.rate_walk * t);
        let apart = self.delay_per_rate + 0.5 * t;
        let share = if known > 0.0 { known / (known + walked) } else { 0.0 };
        self.delay_per_rate = 0.5 * t + share * apart;
        self.own_variance += walked * t * t / 12.0 + share * walked * apart * apart;
        self.rate_variance = known + walked;
    }

    /// By how much a measurement would differ.
    pub fn innovation(&self, measurement: DelayMeasurement) -> Innovation {
        let variance = self.state().delay_variance + measurement.variance;
        Innovation { difference: measurement.delay - self.delay, variance }
    }

    /// Takes a measurement of positive variance r. With the innovation's variance S = P11 + r the covariance
    /// becomes P - P h h' P / S, h = (1, 0); the gains are P11 / S and P12 / S.
    pub fn update(&mut self, measurement: DelayMeasurement) -> Innovation {
        let innovation = self.innovation(measurement);
        let DelayState { delay_variance, covariance, .. } = self.state();
        let own = self.own_variance + measurement.variance;
        self.delay += innovation.difference * (delay_variance / innovation.variance);
        self.rate += innovation.difference.0 * (covariance / innovation.variance);
        self.rate_variance *= own / innovation.variance;
        self.delay_per_rate *= measurement.variance / own;
        self.own_variance *= measurement.variance / own;
        innovation
    }
}

/// Delays closer than this share of a fast period are together.
const TOGETHER_DELAY: f64 = 0.05;

/// Two channels that will sample at one instant of the slow period. There they carry one measurement, and no
/// bank recovers what the other one carried: the noncausal bound rises as they come closer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coincidence {
    /// The channels, from 0.
    pub(super) channels: [usize; 2],
    /// Time until their delays are equal modulo the slow period.
    pub(super) after: Seconds,
}

impl Coincidence {
    /// The first pair whose delays come together modulo the slow period of a spec, at their present rates;
    /// `None` if there is none within `horizon`.
    pub(super) fn ahead(states: &[DelayState], spec: &Spec, horizon: Seconds) -> Option<Self> {
        let slow_period = spec.fast_period * spec.ratio as f64;
        Self::within(states, slow_period, spec.fast_period * TOGETHER_DELAY, horizon)
    }

    /// As [`Coincidence::ahead`], where delays within `distance` of each other are together.
    fn within(
        states: &[DelayState],
        slow_period: Seconds,
        distance: Seconds,
        horizon: Seconds,
    ) -> Option<Self> {
        let pairs = (0..states.len()).flat_map(|i| (0..i).map(move |j| [j, i]));
        let meeting = |channels: [usize; 2]| {
            let [a, b] = channels.map(|i| states[i]);
            let apart = (b.delay - a.delay).0.rem_euclid(slow_period.0);
            let after = time_to_meet(apart, b.rate - a.rate, slow_period.0, distance.0)?;
            Some(Self { channels, after: Seconds(after) })
        };
        let ahead = pairs.filter_map(meeting).filter(|meeting| meeting.after <= horizon);
        ahead.min_by(|a, b| a.after.0.total_cmp(&b.after.0))
    }
}

/// Time until a distance that lies in 0 .. `period` and grows by `rate` is within `near` of 0 or of the
/// period.
fn time_to_meet(apart: f64, rate: f64, period: f64, near: f64) -> Option<f64> {
    if apart <= near || apart >= period - near {
        return Some(0.0);
    }
    let way = if rate > 0.0 { period - near - apart } else { apart - near };
    (rate != 0.0).then(|| way / rate.abs())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    /// A normal number by the sum of twelve uniform ones (variance 1).
    fn normal(random: &mut Random) -> f64 {
        (0..12).map(|_| random.part()).sum::<f64>() - 6.0
    }

    /// The filter after many updates at the distance `t`, just after an update.
    fn stationary(rate_walk: f64, t: f64, r: f64) -> DelayFilter {
        let mut filter = DelayFilter::new(DelayState::known(Seconds(0.0), 1.0, 1.0), rate_walk);
        for _ in 0..20_000 {
            filter.advance(Seconds(t));
            filter.update(DelayMeasurement { delay: Seconds(0.0), variance: r });
        }
        filter
    }

    /// The second difference of the measurements is a moving average of the innovations,
    /// e[k] + b e[k-1] + c e[k-2] with b = alpha + beta - 2 and c = 1 - alpha (alpha and beta / T are the
    /// gains). Its autocovariances are those of second differences of white noise, r (6, -4, 1), and of a
    /// delay whose rate walks, q T^3 (2/3, 1/6, 0).
    #[test]
    fn a_rate_that_walks_gives_the_gains_of_the_spectral_factor() {
        for (q, t, r) in [(1.0, 1.0, 1.0), (1e-18, 0.01, 1e-24), (1e-20, 0.1, 1e-22), (5.0, 2.0, 0.1)] {
            let mut filter = stationary(q, t, r);
            filter.advance(Seconds(t));
            let state = filter.state();
            let s = state.delay_variance + r;
            let (alpha, beta) = (state.delay_variance / s, state.covariance / s * t);
            let (b, c) = (alpha + beta - 2.0, 1.0 - alpha);
            let walk = q * t.powi(3);
            for (found, want) in [
                (s * (1.0 + b * b + c * c), 6.0 * r + 2.0 / 3.0 * walk),
                (s * b * (1.0 + c), -4.0 * r + walk / 6.0),
                (s * c, r),
            ] {
                assert!((found / want - 1.0).abs() < 1e-6, "{q} {t} {r}: {found:e} {want:e}");
            }
        }
    }

    /// Errors of many runs have the variance that the filter states, and innovations are white.
    #[test]
    fn errors_have_the_variance_that_the_filter_states() {
        let mut random = Random(11);
        let (t, r, rate_walk) = (0.1, 4.0, 3.0);
        let mut filter = stationary(rate_walk, t, r);
        let (mut delay, mut rate) = (0.0, 0.0);
        let count = 60_000;
        let (mut square, mut product, mut sum, mut last) = (0.0, 0.0, 0.0, 0.0);
        for _ in 0..count {
            // Exact increments: the integral of the rate's walk has the variance q t^3 / 3 and the
            // correlation sqrt(3) / 2 with the walk itself.
            let (a, b) = (normal(&mut random), normal(&mut random));
            let step = f64::sqrt(rate_walk * t);
            delay += rate * t + step * t * (0.5 * a + b / 12f64.sqrt());
            rate += step * a;
            filter.advance(Seconds(t));
            let measured = Seconds(delay + r.sqrt() * normal(&mut random));
            let innovation = filter.update(DelayMeasurement { delay: measured, variance: r });
            square += (filter.state().delay.0 - delay).powi(2);
            let white = innovation.difference.0 / innovation.variance.sqrt();
            product += white * last;
            sum += white * white;
            last = white;
        }
        let count = f64::from(count);
        // Errors are correlated over some ten steps, so that their variance is known to 2 %.
        assert!((square / count / filter.state().delay_variance - 1.0).abs() < 0.06, "{}", square / count);
        assert!((sum / count - 1.0).abs() < 0.03 && (product / count).abs() < 0.02);
    }

    /// A clock whose rate changes by 10 ppm in each second, measured at 60 dB: the lag of the filter at
    /// the acceleration a is a T^2 (1 - alpha) / beta, and with a matching walk the error is that of the
    /// prediction.
    #[test]
    fn a_steady_change_of_the_rate_is_followed_within_the_prediction() {
        let mut random = Random(12);
        let (t, deviation, acceleration) = (0.4e-3, 6e-15, 1e-5);
        // The rate moves by a t between two measurements.
        let rate_walk = acceleration * acceleration * t;
        let mut filter = DelayFilter::new(DelayState::known(Seconds(0.0), 1e-12, 1e-6), rate_walk);
        let (mut square, mut predicted) = (0.0, 0.0);
        for block in 1..=5000 {
            let now = f64::from(block) * t;
            let delay = 0.5 * acceleration * now * now;
            filter.advance(Seconds(t));
            let measured = Seconds(delay + deviation * normal(&mut random));
            filter.update(DelayMeasurement { delay: measured, variance: deviation * deviation });
            if block > 500 {
                square += (filter.state().delay.0 - delay).powi(2);
                predicted += filter.state().delay_variance;
            }
        }
        let ratio = f64::sqrt(square / predicted);
        assert!(ratio < 1.5, "{ratio}");
    }

    #[test]
    fn silence_lets_the_variance_grow_as_the_walk_says() {
        let mut filter = DelayFilter::new(DelayState::known(Seconds(1.0), 0.5, 2.0), 6.0);
        // In any number of steps.
        for part in [0.25, 0.5, 1.25] {
            filter.advance(Seconds(part));
        }
        let state = filter.state();
        let t = 2.0f64;
        assert!((state.delay_variance - (0.25 + 4.0 * t * t + 6.0 * t.powi(3) / 3.0)).abs() < 1e-12);
        assert!((state.covariance - (4.0 * t + 3.0 * t * t)).abs() < 1e-12);
        assert!((state.rate_variance - (4.0 + 6.0 * t)).abs() < 1e-12);
        assert_eq!((state.delay, state.rate), (Seconds(1.0), 0.0));
    }

    fn states(list: &[(f64, f64)]) -> Vec<DelayState> {
        let state =
            |&(delay, rate): &(f64, f64)| DelayState { rate, ..DelayState::known(Seconds(delay), 0.0, 0.0) };
        list.iter().map(state).collect()
    }

    fn ahead(list: &[(f64, f64)], horizon: f64) -> Option<([usize; 2], f64)> {
        let found = Coincidence::within(&states(list), Seconds(4.0), Seconds(0.25), Seconds(horizon));
        found.map(|found| (found.channels, found.after.0))
    }

    #[test]
    fn the_first_meeting_modulo_the_slow_period_is_found() {
        // 1 and 0 part, but meet again around the period: 4 - 0.25 - 1 at a rate of 0.5.
        assert_eq!(ahead(&[(0.0, 0.0), (1.0, 0.5)], 10.0), Some(([0, 1], 5.5)));
        assert_eq!(ahead(&[(0.0, 0.0), (1.0, 0.5)], 5.0), None);
        assert_eq!(ahead(&[(0.0, 0.0), (1.0, -0.5)], 10.0), Some(([0, 1], 1.5)));
        assert_eq!(ahead(&[(0.0, 0.0), (2.0, 0.0), (3.0, -0.5)], 10.0), Some(([1, 2], 1.5)));
        // Delays of whole periods more are the same.
        assert_eq!(ahead(&[(8.0, 0.0), (1.0, -0.5)], 10.0), Some(([0, 1], 1.5)));
        assert_eq!(ahead(&[(0.0, 0.0), (3.9, 0.0)], 0.0), Some(([0, 1], 0.0)));
        assert_eq!(ahead(&[(0.0, 0.0), (2.0, 0.0)], f64::INFINITY), None);
    }
}
