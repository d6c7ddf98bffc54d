//! The delays over the time that all recordings have in common, and the spec for them.

use super::clock::{ClockCourse, ClockReading, ClockStep};
use super::pieces::PieceEstimate;
use super::steps::Lags;
use super::{AlignWarning, AlignedChannel, Stretches};
use crate::calibrate::{Calibration, CalibrationWarning, ChannelEstimate, LevelCourses, Reading, applied};
use crate::sampling::few_readings;
use crate::sine_fit::Estimate;
use crate::spec::{HALF_WIDTH, Spec};
use crate::units::{FastPeriods, Seconds};

/// Instants at which the extremes of a delay are sought.
const INSTANTS: u32 = 128;
/// Half the box of a delay that passes through more than a slow period, in slow periods: all delays of one.
const WHOLE_PERIOD: f64 = 0.5;
/// What a delay may drift within a piece that is thought to be steady, in samples: its reading errs by a
/// fifth of that.
const MOST_DRIFT_OF_PIECE: f64 = 1e-3;
/// Fixed taps bear a delay that moves by this, in fast periods.
const NEGLIGIBLE_DELAY_CHANGE: f64 = 0.02;

/// The delays of all channels.
pub(super) struct Course<'a> {
    spec: &'a Spec,
    reference: usize,
    /// One per channel.
    clocks: Vec<ClockCourse>,
    /// Samples of the reference in the middle of the pieces.
    centres: Vec<f64>,
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
        reference: usize,
        steps: &[Vec<ClockStep>],
        estimates: &[PieceEstimate],
        stretches: &Stretches,
    ) -> Option<Self> {
        let clock = |i: usize| {
            let of = |(piece, estimate): (usize, &PieceEstimate)| {
                let (sample, lag) = estimate.lags[i]?;
                Some(ClockReading { piece, sample, lag: lag.value, deviation: lag.sigma })
            };
            if i == reference {
                return Some(ClockCourse::reference());
            }
            ClockCourse::new(estimates.iter().enumerate().filter_map(of).collect(), steps[i].clone())
        };
        let clocks = (0..spec.channels.len()).map(clock).collect::<Option<_>>()?;
        let centres = estimates.iter().map(|estimate| estimate.centre).collect();
        let &Stretches { first, end, .. } = stretches;
        Some(Self { spec, reference, clocks, centres, first, end })
    }

    pub(super) fn reference(&self) -> usize {
        self.reference
    }

    /// What is known of a delay at a sample of the recording, if both recordings are whole.
    fn at(&self, i: usize, sample: f64) -> Estimate<Seconds> {
        let (known, slow) = (self.clocks[i].known(sample), self.slow_period());
        Estimate {
            value: self.spec.channels[self.reference].delay + slow * known.value,
            sigma: slow * known.sigma,
        }
    }

    fn slow_period(&self) -> Seconds {
        self.spec.fast_period * self.spec.ratio as f64
    }

    fn extent(&self, i: usize) -> Extent {
        let step = (self.end - self.first) / f64::from(INSTANTS);
        let sample = |k: u32| self.clocks[i].sample_at(self.first + step * f64::from(k));
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for known in (0..=INSTANTS).map(|k| self.at(i, sample(k))) {
            let half = known.sigma.0 * HALF_WIDTH;
            (least, most) = (least.min(known.value.0 - half), most.max(known.value.0 + half));
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
            let delay = if is_long { self.at(i, self.clocks[i].sample_at(self.first)).value } else { middle };
            ((delay - self.spec.channels[i].delay) / slow).round() as i64
        };
        let early: Vec<i64> = (0..self.spec.channels.len()).map(early).collect();
        let least = early.iter().copied().min().unwrap_or(0);
        early.into_iter().map(|samples| samples.abs_diff(least) as usize).collect()
    }

    /// What the delay is smaller by once these samples are cut off.
    fn cut(&self, i: usize, skips: &[usize]) -> Seconds {
        self.slow_period() * (skips[i] as f64 - skips[self.reference] as f64)
    }

    /// The delay at the first frame after the cut.
    pub(super) fn delay(&self, i: usize, skips: &[usize]) -> Estimate<Seconds> {
        let Estimate { value, sigma } = self.at(i, skips[i] as f64);
        Estimate { value: value - self.cut(i, skips), sigma }
    }

    /// The lags by these delays over pieces of the reference, if those that were used to measure them
    /// drifted otherwise within a piece: then each delay is that of the loudest part of its piece.
    pub(super) fn lags(&self, used: &[Lags], stretches: &Stretches) -> Option<Vec<Lags>> {
        let (firsts, length) = (stretches.firsts(), stretches.length as f64);
        let ends = || firsts.iter().map(|first| *first as f64).chain([self.end]);
        let by = |(lags, clock): (&Lags, &ClockCourse)| lags.by(clock, ends());
        let found: Vec<Lags> = used.iter().zip(&self.clocks).map(by).collect();
        let apart = |(one, other): (&Lags, &Lags)| {
            let middles = firsts.iter().map(|first| *first as f64 + 0.5 * length);
            let drift = |at: f64| (one.rate_at(at) - other.rate_at(at)).abs() * length;
            middles.map(drift).fold(0.0, f64::max)
        };
        let drifts = used.iter().zip(&found).map(apart).fold(0.0, f64::max);
        (drifts > MOST_DRIFT_OF_PIECE).then_some(found)
    }

    pub(super) fn steps(&self, i: usize) -> &[ClockStep] {
        self.clocks[i].steps()
    }

    pub(super) fn drift(&self, i: usize) -> Estimate<f64> {
        if i == self.reference { Estimate { value: 0.0, sigma: 0.0 } } else { self.clocks[i].drift() }
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
            let is_reference = i == self.reference;
            let [gain, offset] = [found.gain, found.offset].map(|value| (!is_reference).then_some(value));
            let delay = (!is_reference).then(|| self.range(i, &skips));
            ChannelEstimate { delay, gain, offset, cutoff: None }
        };
        let calibration = Calibration {
            reference: self.reference,
            channels: channels.iter().enumerate().map(channel).collect(),
            ..Calibration::default()
        };
        let (spec, notes) = applied(self.spec, &calibration);
        let periods = |note: &CalibrationWarning| {
            if let CalibrationWarning::Shifted { periods } = note { *periods } else { 0 }
        };
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

    /// The delays at the pieces that were measured, and at both ends of so many frames after the cut, all
    /// later by the fast periods that were added, and the levels there.
    pub(super) fn readings(
        &self,
        skips: &[usize],
        frames: usize,
        raised: usize,
        levels: &LevelCourses,
    ) -> Vec<Reading> {
        let added = self.spec.fast_period * raised as f64;
        let reading = |frame: u64| {
            let delay = |i: usize| {
                let Estimate { value, sigma } = self.at(i, (frame + skips[i] as u64) as f64);
                Some((value - self.cut(i, skips) + added, sigma))
            };
            let [gains, offsets] = levels.at(frame as f64);
            Reading { frame, delays: (0..self.clocks.len()).map(delay).collect(), gains, offsets }
        };
        let measured = |(piece, centre): (usize, &f64)| {
            let is_measured = self.clocks.iter().any(|clock| clock.reading(piece).is_some());
            let frame = (centre.round() as u64).checked_sub(skips[self.reference] as u64);
            frame.filter(|_| is_measured)
        };
        let last = frames.saturating_sub(1) as u64;
        let pieces = self.centres.iter().enumerate().filter_map(measured);
        let inner = pieces.filter(|frame| (1..last).contains(frame));
        std::iter::once(0).chain(inner).chain([last]).map(reading).collect()
    }

    /// When the samples were taken.
    pub(super) fn into_clocks(self) -> Vec<ClockCourse> {
        self.clocks
    }
}

/// The weighted mean of estimates; its deviation is that of their scatter, as far as they are enough.
pub(super) fn mean(estimates: impl Iterator<Item = Estimate<f64>>) -> Option<Estimate<f64>> {
    // Without noise a deviation may be 0.
    let weighted = |estimate: Estimate<f64>| (estimate.value, estimate.sigma.max(1e-12).powi(-2));
    let all: Vec<(f64, f64)> = estimates.map(weighted).filter(|(_, weight)| *weight > 0.0).collect();
    let weights: f64 = all.iter().map(|(_, weight)| weight).sum();
    let value = all.iter().map(|(value, weight)| value * weight).sum::<f64>() / weights;
    let squares: f64 = all.iter().map(|(x, weight)| weight * (x - value).powi(2)).sum();
    let freedom = all.len().saturating_sub(1) as f64;
    let misfit = if freedom > 0.0 { squares / freedom * few_readings(freedom) } else { 1.0 };
    value.is_finite().then(|| Estimate { value, sigma: (misfit / weights).sqrt() })
}
