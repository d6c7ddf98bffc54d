//! In what captures contradict a spec, and how another order and other delays are found.
//!
//! The blind estimator looks at the bands that hold one alias each. Something is reported only where the
//! evidence is clear: with the delays found, the signal leaves at most a tenth of the power unexplained
//! that it leaves with those of the spec, whatever Nyquist zone each band may belong to.

use super::blind::Blind;
use super::model::Model;
use super::order::order_of_delays;
use super::parameters::Fit;
use super::record::Record;
use super::result::ChannelEstimate;
use crate::quantity::readable;
use crate::sine_fit::Estimate;
use crate::spec::Spec;
use crate::units::{FastPeriods, Seconds};
use std::fmt;

/// Share of the unexplained power that other delays must take away to count: all but this.
const LEFT: f64 = 0.1;
/// Another order is looked for where the given one leaves more than this share of the power unexplained;
/// delays within a tenth of a fast period leave less.
const UNEXPLAINED: f64 = 0.05;
/// The next best order leaves this many times as much.
const DISTINCT: f64 = 3.0;
/// A delay contradicts when it is this many standard deviations beyond its interval. The interval and its
/// own error are then both exhausted.
const CLEAR: f64 = 6.0;
/// The interval of a delay of which the spec says nothing, in fast periods.
const UNSTATED: f64 = 0.02;
/// Low and high frequencies that disagree by more than this (in units of their noise) do not see a delay.
const WORST_MISFIT: f64 = 3.0;

/// In what captures contradict a spec.
#[derive(Debug, Clone, PartialEq)]
pub enum Contradiction {
    /// Two captures hold the same samples.
    Repeated {
        /// From 1.
        first: usize,
        /// From 1.
        second: usize,
    },
    /// The captures are those of the channels in another order.
    WrongOrder {
        /// The channel that each capture belongs to, from 1.
        order: Vec<usize>,
    },
    /// A capture holds next to nothing.
    Silent {
        /// From 1.
        channel: usize,
        /// Its rms over that of the loudest channel.
        level: f64,
    },
    /// A capture has the other sign.
    Inverted {
        /// From 1.
        channel: usize,
    },
    /// A capture is larger or smaller than the others.
    Gain {
        /// From 1.
        channel: usize,
        /// Its gain over that of the spec, relative to the first of two channels, or to the median of more.
        ratio: f64,
        /// What the gain of the spec would be.
        gain: f64,
    },
    /// A capture began before the others, or after them.
    Start {
        /// From 1.
        channel: usize,
        /// Samples by which it began too early; below 0 if too late.
        early: i64,
        /// The same as a time, unless the spec is in normalised time.
        seconds: Option<Seconds>,
    },
    /// A delay is outside its interval.
    Delay {
        /// From 1.
        channel: usize,
        /// From 1.
        reference: usize,
        /// Found delay minus that of the spec.
        deviation: Estimate<FastPeriods>,
        /// Half-width of the interval of the spec.
        half_width: FastPeriods,
    },
}

impl fmt::Display for Contradiction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Repeated { first, second } => write!(
                f,
                "channels {first} and {second} hold the same samples, but the spec gives them different delays; was one recording given twice?"
            ),
            Self::WrongOrder { order } => {
                let order: Vec<_> = order.iter().map(usize::to_string).collect();
                write!(
                    f,
                    "the channels seem to be in the wrong order: their delays are those of the channels {}",
                    order.join(", ")
                )
            }
            Self::Silent { channel, level } if *level == 0.0 => write!(
                f,
                "channel {channel} is silent: it has no signal at all; check its cable, its converter, and the order of \
                 the captures"
            ),
            Self::Silent { channel, level } => write!(
                f,
                "channel {channel} is silent: its level is {level:.1e} of that of the loudest channel; check its cable, its \
                 converter, and the order of the captures"
            ),
            Self::Inverted { channel } => write!(
                f,
                "channel {channel} is inverted; swap its leads, or give the channel the opposite sign of `gain` in the spec \
                 and design the bank again"
            ),
            Self::Gain { channel, ratio, gain } => write!(
                f,
                "the gain of channel {channel} is {ratio:.4} times that of the spec, relative to the other channels; write \
                 `gain = {gain:.4}` in the spec, or measure it with `hybank calibrate`, and design the bank again"
            ),
            Self::Start { channel, early, seconds } => start(f, *channel, *early, *seconds),
            Self::Delay { channel, reference, deviation, half_width } => write!(
                f,
                "the delay of channel {channel} relative to channel {reference} differs from that of the spec by {:.4} fast periods (± {:.1e}), \
                 more than the {:.1e} that the spec allows; measure it with `hybank calibrate`",
                deviation.value.0,
                2.0 * deviation.sigma.0,
                half_width.0
            ),
        }
    }
}

fn start(f: &mut fmt::Formatter<'_>, channel: usize, early: i64, seconds: Option<Seconds>) -> fmt::Result {
    let count = early.unsigned_abs();
    let samples = if count == 1 { "sample" } else { "samples" };
    let time = seconds.map_or_else(String::new, |time| format!(" ({})", readable(time.0, "s")));
    let (when, whose) =
        if early > 0 { ("before", "of this channel") } else { ("after", "of the other channels") };
    write!(
        f,
        "the capture of channel {channel} began {count} {samples}{time} {when} the others; cut the first {count} {samples} \
         {whose}"
    )
}

/// `None` where the captures do not tell.
pub(super) fn by_delays(spec: &Spec, records: &[Record]) -> Option<Vec<Contradiction>> {
    let uncertainty = spec.uncertainty.clone().unwrap_or_default();
    let reference = uncertainty.reference_channel().unwrap_or(0);
    let fit = Fit { delay: true, gain: true, offset: false, cutoff: false };
    let model = Model::new(spec).ok()?;
    let blind = Blind::of_single_aliases(&model, records).ok()?;
    if let Some(order) = other_order(&blind, records.len()) {
        return Some(vec![Contradiction::WrongOrder { order: order.into_iter().map(|j| j + 1).collect() }]);
    }
    let maximum = blind.maximise(fit, reference).ok()?;
    let (nominal, found) = blind.unexplained(&maximum);
    let is_clear = found <= LEFT * nominal;
    if !is_clear {
        return None;
    }
    let fitted = blind.finish(&maximum, reference, fit).ok()?;
    if fitted.misfit.is_some_and(|misfit| misfit > WORST_MISFIT) {
        return None;
    }
    let nominal: Vec<f64> = model.delays.iter().map(|delay| delay.0).collect();
    if let Some(order) = order_of_delays(&nominal, &fitted.point.delays, reference) {
        return Some(vec![Contradiction::WrongOrder { order: order.into_iter().map(|j| j + 1).collect() }]);
    }
    let half_widths = uncertainty.delays(records.len());
    let channel = |(i, estimate): (usize, ChannelEstimate)| {
        let delay = estimate.delay?;
        let value = FastPeriods(delay.value.0 - nominal[i]);
        let allowed = match uncertainty.delay {
            Some(_) => half_widths[i].in_fast_periods(spec.fast_period),
            None => FastPeriods(UNSTATED),
        };
        let is_clear = value.0.abs() > allowed.0 + CLEAR * delay.sigma.0;
        let (channel, reference) = (i + 1, reference + 1);
        let deviation = Estimate { value, sigma: delay.sigma };
        is_clear.then_some(Contradiction::Delay { channel, reference, deviation, half_width: allowed })
    };
    Some(fitted.channels(&model).into_iter().enumerate().filter_map(channel).collect())
}

/// An order of the channels that explains bands of one alias, in whatever zone, at least ten times as well
/// as the given one and clearly better than any other: two channels swapped, all rotated, or reversed.
fn other_order(blind: &Blind<'_>, channels: usize) -> Option<Vec<usize>> {
    let bands = blind.single_bands();
    let given: Vec<usize> = (0..channels).collect();
    let left = blind.unexplained_in_order(&bands, &given);
    let is_told = left > UNEXPLAINED;
    if !is_told {
        return None;
    }
    let mut orders: Vec<Vec<usize>> = Vec::new();
    for i in 0..channels {
        let rotated: Vec<usize> = (0..channels).map(|j| (i + j) % channels).collect();
        orders.push(rotated.iter().rev().copied().collect());
        orders.push(rotated);
        orders.extend((0..i).map(|j| {
            let mut swapped = given.clone();
            swapped.swap(i, j);
            swapped
        }));
    }
    orders.sort();
    orders.dedup();
    let weigh = |order: Vec<usize>| (blind.unexplained_in_order(&bands, &order), order);
    let mut weighed: Vec<_> = orders.into_iter().filter(|order| *order != given).map(weigh).collect();
    weighed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let second = weighed.get(1).map_or(f64::INFINITY, |(left, _)| *left);
    let (best, order) = weighed.into_iter().next()?;
    (best <= LEFT * left && DISTINCT * best <= second).then_some(order)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::contradictions;
    use crate::calibrate::testbench::{gaussian, interleaved, tones, with_errors};
    use crate::random::Random;
    use crate::units::Hertz;

    const LIST: [f64; 5] = [11e3, 37e3, 58e3, 83e3, 104e3];

    fn captured(truth: &Spec, list: &[f64], dice: &mut Random) -> Vec<Record> {
        let list: Vec<Hertz> = list.iter().map(|&f| Hertz(f)).collect();
        tones(truth, &list, 4096, 1e-3, dice)
    }

    #[test]
    fn captures_of_the_spec_contradict_nothing_in_any_zone() {
        let (spec, mut dice) = (interleaved(), Random(31));
        for list in [&LIST[..], &[203e3], &[301e3, 467e3, 41e3], &[83e3]] {
            assert_eq!(contradictions(&spec, &captured(&spec, list, &mut dice)), [], "{list:?}");
        }
        let noise = |dice: &mut Random| Record::new((0..4096).map(|_| gaussian(dice)).collect());
        let records: Vec<Record> = (0..4).map(|_| noise(&mut dice)).collect();
        assert_eq!(contradictions(&spec, &records), []);
    }

    #[test]
    fn swapped_channels_repeated_ones_and_wrong_delays_are_told() {
        let (spec, mut dice) = (interleaved(), Random(32));
        let mut records = captured(&spec, &LIST, &mut dice);
        records.swap(1, 3);
        let order = Contradiction::WrongOrder { order: vec![1, 4, 3, 2] };
        assert_eq!(contradictions(&spec, &records), [order]);
        records[2] = records[0].clone();
        assert_eq!(contradictions(&spec, &records), [Contradiction::Repeated { first: 1, second: 3 }]);
        let shift = |delay| [delay, 1.0, 0.0, 1.0];
        let truth = with_errors(&spec, &[shift(0.0), shift(0.0), shift(0.2), shift(0.0)]);
        let found = contradictions(&spec, &captured(&truth, &LIST, &mut dice));
        let [Contradiction::Delay { channel: 3, reference: 1, deviation, .. }] = &found[..] else {
            panic!("{found:?}")
        };
        assert!((deviation.value.0 - 0.2).abs() < 0.01, "{found:?}");
        assert!(found[0].to_string().contains("hybank calibrate"), "{}", found[0]);
    }

    #[test]
    fn swapped_channels_are_told_from_tones_in_any_zone() {
        let (spec, mut dice) = (interleaved(), Random(34));
        for list in [&[203e3, 301e3, 467e3][..], &[37.1e3, 161.3e3, 211.7e3], &[183.1e3, 83e3]] {
            for [i, j] in [[1, 2], [0, 3], [1, 3]] {
                let mut records = captured(&spec, list, &mut dice);
                records.swap(i, j);
                let mut order = vec![1, 2, 3, 4];
                order.swap(i, j);
                assert_eq!(
                    contradictions(&spec, &records),
                    [Contradiction::WrongOrder { order }],
                    "{list:?}"
                );
            }
        }
    }

    #[test]
    fn a_delay_within_its_stated_interval_is_no_contradiction() {
        let (mut spec, mut dice) = (interleaved(), Random(33));
        let shift = |delay| [delay, 1.0, 0.0, 1.0];
        let truth = with_errors(&spec, &[shift(0.0), shift(0.0), shift(0.2), shift(0.0)]);
        let records = captured(&truth, &LIST, &mut dice);
        spec.uncertainty = Some(crate::spec::UncertaintySpec {
            delay: Some(crate::spec::PerChannel::Same(spec.fast_period * 0.3)),
            ..Default::default()
        });
        assert_eq!(contradictions(&spec, &records), []);
    }
}
