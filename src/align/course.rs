//! The delays over the time that all recordings have in common, and the spec for them.

use super::pieces::PieceEstimate;
use super::timeline::Timeline;
use super::{AlignSettings, AlignWarning, AlignedChannel, Reading, Stretches};
use crate::calibrate::{Calibration, ChannelEstimate, Warning, applied};
use crate::sine_fit::Estimate;
use crate::spec::{HALF_WIDTH, Spec};
use crate::units::{FastPeriods, Seconds};

/// Least standard deviation of a delay in fast periods: what a drift within a piece and the rounding of the
/// fit may do.
const LEAST_DEVIATION: f64 = 1e-6;
/// Instants at which the extremes of a delay are sought.
const INSTANTS: u32 = 128;
/// Half the box of a delay that passes through more than a slow period, in slow periods: all delays of one.
const WHOLE_PERIOD: f64 = 0.5;
/// Median of the absolute values of a normal law, in its deviations.
const MEDIAN_OF_NORMAL: f64 = 0.674_489_750_196_081_7;
/// Misfits on each side that say how far a reading scatters: sounds change after some pieces.
const BESIDE: usize = 6;
/// A misfit counts as at most so many of the usual ones: a reading may be wrong altogether, and is refused
/// later.
const MOST_MISFIT: f64 = 3.0;
/// Fixed taps bear a delay that moves by this, in fast periods.
const NEGLIGIBLE_DELAY_CHANGE: f64 = 0.02;

/// The delays of all channels, with samples that count from that of the reference.
pub(super) struct Course<'a> {
    spec: &'a Spec,
    settings: AlignSettings,
    /// In frames of the whole reference.
    readings: Vec<Reading>,
    /// One per channel, none of the reference.
    timelines: Vec<Option<Timeline>>,
    /// The samples of the reference that all recordings have.
    first: f64,
    end: f64,
}

/// The interval in which a delay stays.
struct Extent {
    middle: Seconds,
    half: Seconds,
}

impl<'a> Course<'a> {
    /// `None` if there are not two delays of each channel.
    pub(super) fn new(
        spec: &'a Spec,
        settings: AlignSettings,
        estimates: &[PieceEstimate],
        stretches: &Stretches,
    ) -> Option<Self> {
        let (h, least) = (spec.fast_period, spec.fast_period * LEAST_DEVIATION);
        let known = |channel: &ChannelEstimate| {
            let Estimate { value, sigma } = channel.delay?;
            let sigma = sigma.in_seconds(h).0.max(least.0);
            Some((value.in_seconds(h), Seconds(sigma)))
        };
        let reading = |estimate: &PieceEstimate| Reading {
            frame: estimate.centre.round() as u64,
            delays: estimate.channels.iter().map(known).collect(),
        };
        let mut readings: Vec<Reading> = estimates.iter().map(reading).collect();
        (0..spec.channels.len()).for_each(|i| widen(&mut readings, i));
        let slow = h * spec.ratio as f64;
        let timeline = |i: usize| match i == settings.reference {
            true => Some(None),
            false => Timeline::new(&readings, i, slow, settings.rate_walk).map(Some),
        };
        let timelines = (0..spec.channels.len()).map(timeline).collect::<Option<_>>()?;
        let &Stretches { first, end, .. } = stretches;
        Some(Self { spec, settings, readings, timelines, first, end })
    }

    pub(super) fn reference(&self) -> usize {
        self.settings.reference
    }

    fn slow_period(&self) -> Seconds {
        self.spec.fast_period * self.spec.ratio as f64
    }

    /// What is known of a delay at a sample of the reference.
    fn at(&self, i: usize, sample: f64) -> Estimate<Seconds> {
        match &self.timelines[i] {
            Some(timeline) => timeline.at(self.slow_period() * sample),
            None => Estimate { value: self.spec.channels[i].delay, sigma: Seconds(0.0) },
        }
    }

    fn extent(&self, i: usize) -> Extent {
        let step = (self.end - self.first) / f64::from(INSTANTS);
        let states = (0..=INSTANTS).map(|k| self.at(i, self.first + step * f64::from(k)));
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for state in states {
            let half = state.sigma.0 * HALF_WIDTH;
            (least, most) = (least.min(state.value.0 - half), most.max(state.value.0 + half));
        }
        Extent { middle: Seconds(0.5 * (least + most)), half: Seconds(0.5 * (most - least)) }
    }

    /// Samples to cut off, so that the delays come as near as whole samples bring them to those of the spec:
    /// the middle of the course, or the beginning of one that is longer than a slow period.
    pub(super) fn skips(&self) -> Vec<usize> {
        let slow = self.slow_period();
        let early = |i: usize| {
            let Extent { middle, half } = self.extent(i);
            let is_long = half > slow * WHOLE_PERIOD;
            let delay = if is_long { self.at(i, self.first).value } else { middle };
            ((delay - self.spec.channels[i].delay) / slow).round() as i64
        };
        let early: Vec<i64> = (0..self.spec.channels.len()).map(early).collect();
        let least = early.iter().copied().min().unwrap_or(0);
        early.into_iter().map(|samples| samples.abs_diff(least) as usize).collect()
    }

    /// What the delay is smaller by once these samples are cut off.
    fn cut(&self, i: usize, skips: &[usize]) -> Seconds {
        self.slow_period() * (skips[i] as f64 - skips[self.settings.reference] as f64)
    }

    /// The delay at the first frame after the cut.
    pub(super) fn delay(&self, i: usize, skips: &[usize]) -> Estimate<Seconds> {
        let Estimate { value, sigma } = self.at(i, skips[self.settings.reference] as f64);
        Estimate { value: value - self.cut(i, skips), sigma }
    }

    /// By how much the clock is fast: the slope of the line that is closest to the delays. Their first and
    /// last ones alone would say it with the errors of few pieces. The deviation is that of the scatter
    /// around the line where it is larger.
    pub(super) fn drift(&self, i: usize) -> Estimate<f64> {
        let Some(line) = &self.timelines[i] else { return Estimate { value: 0.0, sigma: 0.0 } };
        let taken = self.readings.iter().filter(|reading| !line.refuses(reading.frame));
        let slow = self.slow_period();
        let weighted = |reading: &Reading| {
            let (delay, sigma) = reading.delays[i]?;
            Some((reading.frame as f64 * slow.0, delay.0, sigma.0.powi(-2)))
        };
        let all: Vec<(f64, f64, f64)> = taken.filter_map(weighted).collect();
        let weights: f64 = all.iter().map(|(_, _, weight)| weight).sum();
        let middle = all.iter().map(|(time, _, weight)| weight * time).sum::<f64>() / weights;
        let squares: f64 = all.iter().map(|(time, _, weight)| weight * (time - middle).powi(2)).sum();
        let product: f64 = all.iter().map(|(time, delay, weight)| weight * (time - middle) * delay).sum();
        let value = product / squares;
        let mean = all.iter().map(|(_, delay, weight)| weight * delay).sum::<f64>() / weights;
        let miss = |(time, delay, weight): &(f64, f64, f64)| {
            weight * (delay - mean - value * (time - middle)).powi(2)
        };
        let misfit = all.iter().map(miss).sum::<f64>() / all.len().saturating_sub(2).max(1) as f64;
        Estimate { value, sigma: (misfit.max(1.0) / squares).sqrt() }
    }

    /// The spec, and the fast periods that all delays were raised by.
    pub(super) fn spec(
        &self,
        channels: &[AlignedChannel],
        warnings: &mut Vec<AlignWarning>,
    ) -> (Spec, usize) {
        let skips: Vec<usize> = channels.iter().map(|channel| channel.skip).collect();
        let h = self.spec.fast_period;
        let channel = |(i, found): (usize, &AlignedChannel)| {
            let is_reference = i == self.settings.reference;
            let [gain, offset] = [found.gain, found.offset].map(|value| (!is_reference).then_some(value));
            let delay = (!is_reference).then(|| self.range(i, &skips));
            ChannelEstimate { delay, gain, offset, cutoff: None }
        };
        let calibration = Calibration {
            reference: self.settings.reference,
            channels: channels.iter().enumerate().map(channel).collect(),
            ..Calibration::default()
        };
        let (spec, notes) = applied(self.spec, &calibration);
        let periods = |note: &Warning| if let Warning::Shifted { periods } = note { *periods } else { 0 };
        let raised = notes.iter().map(periods).sum();
        warnings.extend(notes.into_iter().map(AlignWarning::from));
        let moves = |i: usize| {
            let moved = (self.extent(i).half * 2.0).in_fast_periods(h);
            (moved.0 > NEGLIGIBLE_DELAY_CHANGE).then_some(AlignWarning::FixedTaps { channel: i + 1, moved })
        };
        warnings.extend((0..channels.len()).filter_map(moves));
        (spec, raised)
    }

    /// Middle and deviation of the normal law whose 95 % interval is the course of a delay. All delays of
    /// one slow period where the course is longer.
    fn range(&self, i: usize, skips: &[usize]) -> Estimate<FastPeriods> {
        let (h, slow) = (self.spec.fast_period, self.slow_period());
        let Extent { mut middle, mut half } = self.extent(i);
        middle = middle - self.cut(i, skips);
        if half > slow * WHOLE_PERIOD {
            let channels = self.spec.channels.len();
            let stated = self.spec.uncertainty.as_ref().map_or(0.0, |table| table.delays(channels)[i].0);
            (middle, half) = (self.spec.channels[i].delay, Seconds((slow.0 * WHOLE_PERIOD).max(stated)));
        }
        Estimate { value: middle.in_fast_periods(h), sigma: FastPeriods(half / h / HALF_WIDTH) }
    }

    /// The delays as measured, in frames after the cut, all later by the fast periods that were added.
    pub(super) fn readings(&self, skips: &[usize], raised: usize) -> Vec<Reading> {
        let reference = skips[self.settings.reference] as u64;
        let added = self.spec.fast_period * raised as f64;
        let moved = |reading: &Reading| {
            let delay = |(i, delay): (usize, &Option<(Seconds, Seconds)>)| {
                let refused = self.timelines[i].as_ref().is_none_or(|line| line.refuses(reading.frame));
                let (delay, sigma) = delay.filter(|_| !refused)?;
                Some((delay - self.cut(i, skips) + added, sigma))
            };
            let delays: Vec<_> = reading.delays.iter().enumerate().map(delay).collect();
            let frame = reading.frame.checked_sub(reference)?;
            delays.iter().any(Option::is_some).then_some(Reading { frame, delays })
        };
        self.readings.iter().filter_map(moved).collect()
    }
}

/// Widens the intervals of channel i to what the readings beside each scatter. Intervals of pieces are
/// those of the Cramer-Rao bound, which pieces of little or narrow sound miss by up to twice, while the
/// others reach it.
///
/// Misfits are second differences in their stated deviations; overlapping ones are correlated by -2/3 and
/// 1/6. The variance of a reading relative to the stated one has the scaled inverse chi-square law whose
/// prior, of two degrees of freedom, is the stated variance, and whose data are the misfits: its mean is
/// theirs plus 2 over their degrees of freedom.
fn widen(readings: &mut [Reading], i: usize) {
    let of = |reading: &Reading| Some((reading.frame as f64, reading.delays[i]?));
    let all: Vec<(f64, (Seconds, Seconds))> = readings.iter().filter_map(of).collect();
    let misfit = |three: &[(f64, (Seconds, Seconds))]| {
        let [(x, before), (y, own), (z, after)] = [three[0], three[1], three[2]];
        let share = (y - x) / (z - x);
        let miss = own.0.0 - (1.0 - share) * before.0.0 - share * after.0.0;
        miss.abs() / own.1.0.hypot((1.0 - share) * before.1.0).hypot(share * after.1.0)
    };
    let misfits: Vec<f64> = all.windows(3).map(misfit).collect();
    let mut sorted = misfits.clone();
    sorted.sort_by(f64::total_cmp);
    let Some(median) = sorted.get(sorted.len() / 2) else { return };
    let most = MOST_MISFIT * (median / MEDIAN_OF_NORMAL).max(1.0);
    let factor = |number: usize| {
        // The misfit of a reading is one before it, because the first reading has none.
        let beside = number.saturating_sub(BESIDE + 1)..(number + BESIDE).min(misfits.len());
        let freedom = beside.len() as f64 / (1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0));
        let squares: f64 = misfits[beside.clone()].iter().map(|misfit| misfit.min(most).powi(2)).sum();
        (squares / beside.len() as f64 + 2.0 / freedom).max(1.0).sqrt()
    };
    let delays = readings.iter_mut().filter_map(|reading| reading.delays[i].as_mut());
    delays.enumerate().for_each(|(number, delay)| delay.1 = delay.1 * factor(number));
}

/// The weighted mean of estimates; its deviation is that of their scatter where it is larger.
pub(super) fn mean(estimates: impl Iterator<Item = Estimate<f64>>) -> Option<Estimate<f64>> {
    // Without noise a deviation may be 0.
    let weighted = |estimate: Estimate<f64>| (estimate.value, estimate.sigma.max(1e-12).powi(-2));
    let all: Vec<(f64, f64)> = estimates.map(weighted).filter(|(_, weight)| *weight > 0.0).collect();
    let weights: f64 = all.iter().map(|(_, weight)| weight).sum();
    let value = all.iter().map(|(value, weight)| value * weight).sum::<f64>() / weights;
    let squares: f64 = all.iter().map(|(x, weight)| weight * (x - value).powi(2)).sum();
    let misfit = squares / all.len().saturating_sub(1).max(1) as f64;
    value.is_finite().then(|| Estimate { value, sigma: (misfit.max(1.0) / weights).sqrt() })
}
