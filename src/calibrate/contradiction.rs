//! In what captures contradict a spec.

use super::error::list;
use crate::quantity::readable;
use crate::sine_fit::Estimate;
use crate::units::{FastPeriods, Seconds};
use std::fmt;

/// In what captures contradict a spec.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
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
    NoSignal {
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
            Self::WrongOrder { order } => write!(
                f,
                "the channels seem to be in the wrong order: their delays are those of the channels {}",
                list(order)
            ),
            Self::NoSignal { channel, level } => write!(
                f,
                "channel {channel} has no signal: its level is {level:.1e} of that of the strongest channel; check its cable, \
                 its converter, and the order of the captures"
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibrate::testbench::{gaussian, interleaved, tones, with_errors};
    use crate::calibrate::{Record, agreement};
    use crate::random::Random;
    use crate::spec::Spec;
    use crate::units::Hertz;

    fn contradictions(spec: &Spec, records: &[Record]) -> Vec<Contradiction> {
        agreement(spec, records).contradictions
    }

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
