//! Frames of converters with sample rates of their own.
//!
//! A converter takes sample m at m T_i - D_i, with T_i = p_i / q_i fast periods. The pattern of all
//! converters repeats after P fast periods, the least common multiple of the p_i. A frame holds what they
//! take in that time: L_i = P / T_i samples of converter i, from which a bank makes P fast samples. Sample j
//! of a frame is that of a channel of ratio P with the delay D_ij = D_i - j T_i. So a bank for converters of
//! unequal rates is a bank for sum L_i channels of one rate.
//!
//! A frame is complete when its last sample is there. The delays of these channels are D_ij + S, where S is
//! the least whole number of fast periods for which none is negative. So the latency counts from the instant
//! of a sample, the wait for the rest of its frame included. With equal rates L_i = 1, and S = 0 if no
//! delay is negative.

use super::error::At;
use super::limits::{self, range};
use super::{ChannelSpec, Refusal, SpecError, SpecProblem};
use crate::units::{Fraction, GridTime, Hertz, Seconds};
use std::ops::Range;

/// Rounding of a rate and of the fast period in a file, relative to their product.
const RATE_ROUNDING: f64 = 16.0 * f64::EPSILON;

/// How the samples of the converters make frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameLayout {
    ratio: usize,
    samples: Vec<usize>,
}

/// One sample of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameSample {
    /// Its converter, from 0.
    pub converter: usize,
    /// Its number j among the samples of that converter.
    pub number: usize,
}

impl FrameLayout {
    /// Frames of P = `ratio` fast samples, with L_i = `samples[i]` samples of converter i.
    pub fn new(ratio: usize, samples: Vec<usize>) -> Self {
        Self { ratio, samples }
    }

    /// P.
    pub fn ratio(&self) -> usize {
        self.ratio
    }

    /// L_i.
    pub fn samples(&self) -> &[usize] {
        &self.samples
    }

    /// Samples of a frame.
    pub fn count(&self) -> usize {
        self.samples.iter().sum()
    }

    /// Whether a frame has one sample of each converter: all have one rate.
    pub fn is_plain(&self) -> bool {
        self.samples.iter().all(|&samples| samples == 1)
    }

    /// The samples of a frame, converter by converter.
    pub fn iter(&self) -> impl Iterator<Item = FrameSample> + '_ {
        let of = |(converter, &samples): (usize, &usize)| {
            (0..samples).map(move |number| FrameSample { converter, number })
        };
        self.samples.iter().enumerate().flat_map(of)
    }

    /// The samples of each converter among those of a frame.
    pub fn ranges(&self) -> Vec<Range<usize>> {
        let end = |first: &mut usize, samples: &usize| {
            let range = *first..*first + samples;
            *first = range.end;
            Some(range)
        };
        self.samples.iter().scan(0, end).collect()
    }

    /// The converter of each sample of a frame.
    pub fn owners(&self) -> Vec<usize> {
        self.iter().map(|sample| sample.converter).collect()
    }

    /// The value that each sample of a frame has from its converter.
    pub fn each<T: Clone>(&self, of_converters: &[T]) -> Vec<T> {
        self.iter().filter_map(|sample| of_converters.get(sample.converter).cloned()).collect()
    }

    /// D_ij of each sample of a frame, from the delays of the converters.
    pub fn delays(&self, delays: &[GridTime]) -> Vec<GridTime> {
        let of = |FrameSample { converter, number }: FrameSample| {
            // j P / L_i fast periods, exact.
            let (steps, samples) = (number * self.ratio, self.samples[converter]);
            let (whole, part) = (steps / samples, steps % samples);
            let earlier = delays.get(converter)?.later_by(-(whole as f64));
            Some(earlier.earlier_by(Fraction { numerator: part as u32, denominator: samples as u32 }))
        };
        self.iter().filter_map(of).collect()
    }

    /// S, the fast samples from the instant of a frame to that of its last sample.
    pub fn wait(&self, delays: &[GridTime]) -> usize {
        let late = |delay: &GridTime| {
            let ahead = -delay.in_fast_periods().0;
            // A whole number may have been rounded up.
            (ahead - 4.0 * f64::EPSILON * (1.0 + ahead.abs() + self.ratio as f64)).ceil().max(0.0) as usize
        };
        self.delays(delays).iter().map(late).max().unwrap_or(0)
    }

    /// D_ij + S.
    pub fn waited_delays(&self, delays: &[GridTime]) -> Vec<GridTime> {
        let wait = self.wait(delays) as f64;
        self.delays(delays).into_iter().map(|delay| delay.later_by(wait)).collect()
    }
}

/// T = p / q fast periods.
#[derive(Debug, Clone, Copy)]
struct SampleSpacing {
    p: usize,
    q: usize,
}

impl SampleSpacing {
    /// The step of a converter of this rate, if it is a fraction of small numbers.
    fn of(rate: Hertz, fast_period: Seconds) -> Option<Self> {
        let step = 1.0 / (rate.0 * fast_period.0);
        let fraction = |q: usize| {
            let (scaled, nearest) = (step * q as f64, (step * q as f64).round());
            let is_near = (scaled - nearest).abs() <= RATE_ROUNDING * scaled && nearest >= 1.0;
            (is_near && nearest <= limits::MAX_RATIO as f64).then_some(Self { p: nearest as usize, q })
        };
        (1..=limits::MAX_CHANNELS).find_map(fraction)
    }
}

/// The frames of converters with these rates.
///
/// # Errors
/// [`SpecProblem::Range`] for a rate that is in no simple ratio to the fast rate, and for frames beyond
/// [`limits::MAX_RATIO`] fast samples or [`limits::MAX_CHANNELS`] samples.
fn layout(fast_period: Seconds, rates: &[Hertz]) -> Result<FrameLayout, SpecError> {
    let step = |(channel, &rate): (usize, &Hertz)| {
        let path = format!("channel[{channel}].rate");
        limits::check_rate(rate).at(&path)?;
        SampleSpacing::of(rate, fast_period).ok_or_else(|| {
            let rule = format!(
                "it is in no simple ratio to the fast rate of {}, so that the instants of the samples do not repeat; \
                 choose one that is",
                fast_period.rate()
            );
            Refusal::new(path, range(rate.0, "Hz", rule))
        })
    };
    let steps: Vec<SampleSpacing> = rates.iter().enumerate().map(step).collect::<Result<_, _>>()?;
    // Factors are at most MAX_RATIO, so that products fit.
    let common = steps.iter().try_fold(1u64, |all, step| {
        let common = all / greatest_common_divisor(all, step.p as u64) * step.p as u64;
        (common <= u64::from(u32::MAX)).then_some(common)
    });
    let ratio = common.unwrap_or(u64::MAX);
    let samples = |step: &SampleSpacing| (ratio / step.p as u64).saturating_mul(step.q as u64);
    let samples: Vec<u64> = steps.iter().map(samples).collect();
    let count = samples.iter().fold(0u64, |sum, &samples| sum.saturating_add(samples));
    if ratio > limits::MAX_RATIO as u64 || count > limits::MAX_CHANNELS as u64 {
        let (longest, most) = (limits::MAX_RATIO, limits::MAX_CHANNELS);
        let rule =
            format!("at most {longest} fast samples and {most} samples of the converters make a frame");
        return Err(Refusal::new("channel", long_frame(ratio, &samples, &rule)));
    }
    let samples = samples.into_iter().map(|samples| samples as usize).collect();
    Ok(FrameLayout::new(ratio as usize, samples))
}

/// Fast samples per frame of channels as they are written. Channels without a rate get that of the `ratio`;
/// where all have one rate, none keeps it.
pub(super) fn common_ratio(
    fast_period: Seconds,
    ratio: Option<usize>,
    channels: &mut [ChannelSpec],
) -> Result<usize, SpecError> {
    let with_rate = channels.iter().filter(|channel| channel.rate.is_some()).count();
    if let (Some(ratio), 0) = (ratio, with_rate) {
        return Ok(ratio);
    }
    if ratio.is_none() && with_rate < channels.len() || channels.is_empty() {
        let remedy = "give M, the number of fast samples per slow sample, or the rate of every channel";
        return Err(Refusal::new("", SpecProblem::MissingKey { key: "ratio", remedy }));
    }
    let common = ratio.map(|ratio| (fast_period * ratio as f64).rate());
    let rates: Vec<Hertz> = channels.iter().filter_map(|channel| channel.rate.or(common)).collect();
    let layout = layout(fast_period, &rates)?;
    for (channel, rate) in channels.iter_mut().zip(rates) {
        channel.rate = (!layout.is_plain()).then_some(rate);
    }
    match ratio.filter(|&ratio| with_rate == channels.len() && ratio != layout.ratio) {
        Some(ratio) => Err(other_ratio(ratio, layout.ratio)),
        None => Ok(layout.ratio),
    }
}

fn other_ratio(written: usize, ratio: usize) -> SpecError {
    let rule = format!(
        "every channel has a rate, and these make frames of {ratio} fast samples; leave ratio out of a file"
    );
    Refusal::new("ratio", range(written as f64, "fast samples", rule))
}

fn greatest_common_divisor(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

/// The frames of the channels of a spec.
///
/// # Errors
/// As [`layout`]; [`SpecProblem::MissingKey`] if some channels have a rate and others have none, and
/// [`SpecProblem::Range`] for a ratio that is not that of the frames.
pub(super) fn checked(
    fast_period: Seconds,
    ratio: usize,
    channels: &[ChannelSpec],
) -> Result<FrameLayout, SpecError> {
    let rates: Vec<Hertz> = channels.iter().filter_map(|channel| channel.rate).collect();
    if rates.is_empty() {
        return Ok(of_channels(fast_period, ratio, channels));
    }
    if rates.len() < channels.len() {
        let remedy = "some channels have a rate of their own; give that of each, or none";
        return Err(Refusal::new("channel", SpecProblem::MissingKey { key: "rate", remedy }));
    }
    let layout = layout(fast_period, &rates)?;
    if layout.ratio == ratio { Ok(layout) } else { Err(other_ratio(ratio, layout.ratio)) }
}

/// A latency is no shorter than the wait S for the last sample of a frame.
pub(super) fn check_latency(latency: Option<usize>, wait: usize) -> Result<(), SpecProblem> {
    let Some(latency) = latency.filter(|&latency| latency < wait) else { return Ok(()) };
    let rule = format!(
        "the last sample of a frame comes {wait} fast samples after its instant, and the latency includes this \
         wait; give {wait} or more"
    );
    Err(range(latency as f64, "fast samples", rule))
}

/// The samples of a frame, of the output and of all converters, that a design takes.
pub(super) fn check_size(layout: &FrameLayout, is_coupled: bool) -> Result<(), SpecProblem> {
    let most = if is_coupled { limits::MAX_COUPLED_FRAME } else { limits::MAX_FRAME };
    let all = layout.ratio + layout.count();
    if all <= most {
        return Ok(());
    }
    let more = if is_coupled { ", and the method h2 with taps takes more" } else { "" };
    let rule =
        format!("this design takes at most {most} fast samples and samples of the converters together{more}");
    if layout.is_plain() {
        return Err(range(all as f64, "samples per frame", rule));
    }
    let samples: Vec<u64> = layout.samples.iter().map(|&samples| samples as u64).collect();
    Err(long_frame(layout.ratio as u64, &samples, &rule))
}

/// Rates whose frames are too long.
fn long_frame(ratio: u64, samples: &[u64], rule: &str) -> SpecProblem {
    let samples = samples.iter().map(u64::to_string).collect::<Vec<_>>().join(" and ");
    let rule = format!(
        "it has {samples} samples of the converters; {rule}; choose rates in ratios of small numbers"
    );
    range(ratio as f64, "fast samples per frame", rule)
}

/// The frames of checked channels.
pub(super) fn of_channels(fast_period: Seconds, ratio: usize, channels: &[ChannelSpec]) -> FrameLayout {
    let samples = |channel: &ChannelSpec| {
        let in_frame = |rate: Hertz| (ratio as f64 * fast_period.0 * rate.0).round().max(1.0) as usize;
        channel.rate.map_or(1, in_frame)
    };
    FrameLayout::new(ratio, channels.iter().map(samples).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::FastPeriods;

    fn made(fast: f64, rates: &[f64]) -> FrameLayout {
        let rates: Vec<Hertz> = rates.iter().copied().map(Hertz).collect();
        layout(Hertz(fast).period(), &rates).unwrap()
    }

    /// Against the definition: the instants of all samples in three frames.
    #[test]
    fn frames_hold_what_the_converters_take_until_the_pattern_repeats() {
        for (fast, rates, ratio, samples) in [
            (48e3, [24e3, 16e3], 6, [3, 2]),
            (300.0, [100.0, 60.0], 15, [5, 3]),
            (96e3, [44.1e3, 48e3], 320, [147, 160]),
            (30.0, [12.0, 10.0], 15, [6, 5]),
            (8.0, [8.0, 12.0], 2, [2, 3]),
            (2.0, [1.0, 1.0], 2, [1, 1]),
        ] {
            let layout = made(fast, &rates);
            assert_eq!(layout, FrameLayout::new(ratio, samples.to_vec()), "{fast} {rates:?}");
            let h = Hertz(fast).period();
            let own = [0.4, 1.7].map(|delay| GridTime::new(FastPeriods(delay).in_seconds(h), h));
            let delays = layout.waited_delays(&own);
            let wait = layout.wait(&own) as f64;
            for (sample, delay) in layout.iter().zip(&delays) {
                let (i, j) = (sample.converter, sample.number as f64);
                let written = [0.4, 1.7][i] - j * fast / rates[i] + wait;
                assert!((delay.in_fast_periods().0 - written).abs() < 1e-12 * ratio as f64, "{written}");
            }
            let least = delays.iter().map(|delay| delay.in_fast_periods().0).fold(f64::INFINITY, f64::min);
            assert!((0.0..1.0).contains(&least) || wait == 0.0, "{least}");
        }
    }

    #[test]
    fn whole_steps_are_exact() {
        let layout = made(300.0, &[100.0, 60.0]);
        let h = Hertz(300.0).period();
        let delays = layout.waited_delays(&[GridTime::fast_sample(0.0, h), GridTime::fast_sample(2.0, h)]);
        let whole: Vec<f64> = delays.iter().map(|delay| delay.whole()).collect();
        assert_eq!(whole, [12.0, 9.0, 6.0, 3.0, 0.0, 14.0, 9.0, 4.0]);
        assert!(delays.iter().all(|delay| delay.rest() == Seconds(0.0)));
    }
}
