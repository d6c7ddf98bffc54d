//! The analog side of a bank in normalised time: state equations in doubles, which the proof takes as
//! exact.

use super::ball::{self, Ball, Matrix};
use super::timeline::{Instant, SamplingInstant};
use super::{MAX_ANALOG_STATES, MAX_WORK, VerifyError};
use crate::analog::{StableFilter, StrictlyProper, signal};
use crate::arithmetic::Number;
use crate::bank::Bank;
use crate::spec::FilterSpec;
use crate::units::Seconds;

/// The filter W of the signal and the distinct front ends, which it drives, the states of W first:
/// dx/dt = a x + b f. Without a signal the front ends stand side by side, driven by the same input.
#[derive(Debug, Clone)]
pub(super) struct FrontEnds {
    signal: Option<StableFilter>,
    /// Each filter with the index of its first state. Proportional filters count once.
    filters: Vec<(usize, StrictlyProper)>,
    /// The factor of each filter's cut-off, and the filter whose cut-off that is: Phi(s / x) has the state
    /// equations x a, x b, c.
    speeds: Vec<(usize, f64)>,
}

impl FrontEnds {
    /// Realises the filters of the bank's spec, and lists its samples: the M reference samples, then the N
    /// measured ones.
    ///
    /// # Errors
    /// [`VerifyError::NoSpec`], [`VerifyError::FrontEnd`].
    pub(super) fn new(bank: &Bank) -> Result<(Self, Vec<SamplingInstant>), VerifyError> {
        let spec = bank.spec.as_ref().ok_or(VerifyError::NoSpec)?;
        let signal = signal(spec)
            .map_err(|source| VerifyError::FrontEnd { place: "spec.signal.filter".to_owned(), source })?;
        let own = signal.as_ref().map_or(0, StableFilter::order);
        let mut filters: Vec<(usize, StrictlyProper)> = Vec::new();
        let mut index = |filter: &FilterSpec, name: String| {
            let made = StrictlyProper::driven_by(signal.as_ref(), filter, spec.fast_period)
                .map_err(|source| VerifyError::FrontEnd { place: name, source })?;
            let known = filters.iter().enumerate().find_map(|(i, (_, seen))| Some((i, made.ratio_to(seen)?)));
            if let Some(known) = known {
                return Ok(known);
            }
            let start = filters.last().map_or(own, |(start, last)| start + last.order());
            filters.push((start, made));
            Ok((filters.len() - 1, 1.0))
        };
        let (target, gain) = index(&spec.target, "spec.target.filter".to_owned())?;
        let reference = |p: usize| Instant { whole: p as f64 - bank.latency as f64, delay: Seconds(0.0) };
        let mut samples: Vec<SamplingInstant> = (0..bank.ratio)
            .map(|p| SamplingInstant { filter: target, gain, converter_gain: 1.0, time: reference(p) })
            .collect();
        for (i, channel) in spec.channels.iter().enumerate() {
            let (filter, gain) = index(&channel.filter, format!("spec.channel[{i}].filter"))?;
            let time = Instant { whole: 0.0, delay: channel.delay };
            samples.push(SamplingInstant { filter, gain, converter_gain: channel.gain, time });
        }
        let speeds = (0..filters.len()).map(|filter| (filter, 1.0)).collect();
        Ok((Self { signal, speeds, filters }, samples))
    }

    /// Number of states.
    pub(super) fn order(&self) -> usize {
        self.filters.last().map_or(0, |(start, last)| start + last.order())
    }

    /// W, if the spec has a signal.
    pub(super) fn signal(&self) -> Option<&StableFilter> {
        self.signal.as_ref()
    }

    /// The filter with this index; see [`FrontEnds::with_speed`] for the factor of its cut-off.
    pub(super) fn filter(&self, index: usize) -> &StrictlyProper {
        &self.filters[index].1
    }

    /// Gain of a sample over the output of its filter.
    pub(super) fn gain(sample: &SamplingInstant) -> f64 {
        sample.gain * sample.converter_gain
    }

    /// Index of the filter `index` with its cut-off multiplied by `speed`, which is added if it is not
    /// there.
    pub(super) fn with_speed(&mut self, index: usize, speed: f64) -> usize {
        let of = self.speeds[index].0;
        if let Some(known) = self.speeds.iter().position(|&known| known == (of, speed)) {
            return known;
        }
        let start = self.order();
        self.filters.push((start, self.filters[of].1.clone()));
        self.speeds.push((of, speed));
        self.filters.len() - 1
    }

    /// Checks that the matrices of a slow period with `samples` samples are not too large.
    ///
    /// # Errors
    /// [`VerifyError::TooManyFilters`].
    pub(super) fn check_work(&self, samples: usize) -> Result<(), VerifyError> {
        let states = self.order();
        if states > MAX_ANALOG_STATES || samples * states.pow(3) > MAX_WORK {
            return Err(VerifyError::TooManyFilters { states, samples });
        }
        Ok(())
    }

    /// a and b.
    pub(super) fn dynamics<F: Number>(&self) -> (Matrix<F>, Matrix<F>) {
        let order = self.order();
        let (mut a, mut b) = (ball::zeros(order, order), ball::zeros(order, 1));
        if let Some(signal) = &self.signal {
            a.view_mut((0, 0), signal.a().shape()).copy_from(&ball::exact(signal.a()));
            b.rows_mut(0, signal.order()).copy_from(&ball::exact(signal.b()));
        }
        for ((start, filter), &(_, speed)) in self.filters.iter().zip(&self.speeds) {
            let fast = |m| {
                if speed == 1.0 { ball::exact(m) } else { ball::scaled(&ball::exact(m), Ball::from(speed)) }
            };
            let input = fast(filter.b());
            a.view_mut((*start, *start), filter.a().shape()).copy_from(&fast(filter.a()));
            match &self.signal {
                None => b.rows_mut(*start, filter.order()).copy_from(&input),
                Some(signal) => {
                    let (row, direct) = (ball::exact(signal.c()), Ball::from(signal.d()));
                    let shape = (filter.order(), signal.order());
                    a.view_mut((*start, 0), shape).copy_from(&ball::product(&input, &row));
                    b.rows_mut(*start, filter.order()).copy_from(&ball::scaled(&input, direct));
                }
            }
        }
        (a, b)
    }

    /// The row that reads a sample from the joint state.
    pub(super) fn output<F: Number>(&self, sample: &SamplingInstant) -> Matrix<F> {
        let (start, filter) = &self.filters[sample.filter];
        let mut row = ball::zeros(1, self.order());
        row.columns_mut(*start, filter.order()).copy_from(&ball::exact(filter.c()));
        let row = ball::scaled(&row, Ball::from(sample.gain));
        // A factor of one would only widen the enclosure.
        if sample.converter_gain == 1.0 { row } else { ball::scaled(&row, Ball::from(sample.converter_gain)) }
    }
}
