//! The analog side of a bank in normalised time: the state equations of the filters as the spec writes them,
//! enclosed.

use super::ball::{self, Ball, Matrix};
use super::timeline::SamplingInstant;
use super::{MAX_ANALOG_STATES, MAX_WORK, VerifyError};
use crate::analog::{Realisation, SignalFilter, StrictlyProper, enclosed, proportion, signal};
use crate::arithmetic::{Float512, Number};
use crate::bank::Bank;
use crate::spec::FilterSpec;
use crate::units::GridTime;

/// State equations of a filter.
pub(super) type Equations = Realisation<Ball<Float512>>;

/// The filter W of the signal and the distinct front ends, which it drives, the states of W first:
/// dx/dt = a x + b f. Without a signal the front ends stand side by side, driven by the same input.
#[derive(Debug, Clone)]
pub(super) struct FrontEnds {
    signal: Option<Equations>,
    /// Filters that are exactly proportional count once.
    filters: Vec<FrontEnd>,
}

/// One filter after that of the signal.
#[derive(Debug, Clone)]
struct FrontEnd {
    /// Index of the first state.
    start: usize,
    equations: Equations,
    /// The filter whose cut-off is multiplied by `speed`: Phi(s / x) has the state equations x a, x b, c.
    of: usize,
    speed: f64,
}

impl FrontEnds {
    /// Encloses the filters of the bank's spec, and lists its samples: the M reference samples, then the N
    /// measured ones.
    ///
    /// # Errors
    /// [`VerifyError::NoSpec`], [`VerifyError::FrontEnd`].
    pub(super) fn new(bank: &Bank) -> Result<(Self, Vec<SamplingInstant>), VerifyError> {
        let spec = bank.spec.as_ref().ok_or(VerifyError::NoSpec)?;
        let h = spec.fast_period;
        let refused = |place: String| move |source| VerifyError::FrontEnd { place, source };
        let checked = signal(spec).map_err(refused("spec.signal.filter".to_owned()))?;
        let written = SignalFilter::of(spec).map(|w| w.filter);
        let signal = written.map(|w| enclosed(None, &w, h)).transpose();
        let signal = signal.map_err(refused("spec.signal.filter".to_owned()))?;
        let mut all = Self { signal, filters: Vec::new() };
        let mut seen: Vec<FilterSpec> = Vec::new();
        let mut index = |filter: &FilterSpec, name: &dyn Fn() -> String| {
            let known = seen.iter().enumerate().find_map(|(i, other)| Some((i, proportion(filter, other)?)));
            if let Some(known) = known {
                return Ok(known);
            }
            StrictlyProper::driven_by(checked.as_ref(), filter, h).map_err(refused(name()))?;
            let equations = enclosed(all.signal.as_ref(), filter, h).map_err(refused(name()))?;
            seen.push(filter.clone());
            all.push(equations, seen.len() - 1, 1.0);
            Ok((seen.len() - 1, Ball::from(1.0)))
        };
        let (target, gain) = index(&spec.target, &|| "spec.target.filter".to_owned())?;
        let reference = |p: usize| GridTime::fast_sample(p as f64 - bank.latency as f64, h);
        let mut samples: Vec<SamplingInstant> = (0..bank.ratio)
            .map(|p| SamplingInstant { filter: target, gain, converter_gain: 1.0, time: reference(p) })
            .collect();
        let mut converters = Vec::with_capacity(spec.channels.len());
        for (i, channel) in spec.channels.iter().enumerate() {
            converters.push(index(&channel.filter, &|| format!("spec.channel[{i}].filter"))?);
        }
        let layout = spec.layout();
        for (converter, delay) in layout.owners().into_iter().zip(layout.waited_delays(&spec.delays())) {
            let ((filter, gain), time) = (converters[converter], delay.negative());
            samples.push(SamplingInstant {
                filter,
                gain,
                converter_gain: spec.channels[converter].gain,
                time,
            });
        }
        Ok((all, samples))
    }

    /// Appends a filter.
    fn push(&mut self, equations: Equations, of: usize, speed: f64) {
        self.filters.push(FrontEnd { start: self.order(), equations, of, speed });
    }

    /// Number of states.
    pub(super) fn order(&self) -> usize {
        let own = self.signal.as_ref().map_or(0, Realisation::order);
        self.filters.last().map_or(own, |last| last.start + last.equations.order())
    }

    /// W, if the spec has a signal.
    pub(super) fn signal(&self) -> Option<&Equations> {
        self.signal.as_ref()
    }

    /// The filter with this index; see [`FrontEnds::with_speed`] for the factor of its cut-off.
    pub(super) fn filter(&self, index: usize) -> &Equations {
        &self.filters[index].equations
    }

    /// Gain of a sample over the output of its filter.
    pub(super) fn gain(sample: &SamplingInstant) -> Ball<Float512> {
        // A factor of one would only widen the enclosure.
        match sample.converter_gain {
            1.0 => sample.gain,
            gain if sample.gain == Ball::from(1.0) => Ball::from(gain),
            gain => sample.gain * Ball::from(gain),
        }
    }

    /// Index of the filter `index` with its cut-off multiplied by `speed`, which is added if it is not
    /// there.
    pub(super) fn with_speed(&mut self, index: usize, speed: f64) -> usize {
        let of = self.filters[index].of;
        if let Some(known) = self.filters.iter().position(|known| known.of == of && known.speed == speed) {
            return known;
        }
        self.push(self.filters[of].equations.clone(), of, speed);
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
            a.view_mut((0, 0), signal.a.shape()).copy_from(&signal.a);
            b.rows_mut(0, signal.order()).copy_from(&signal.b);
        }
        for FrontEnd { start, equations, speed, .. } in &self.filters {
            let fast = |m: &Matrix<Float512>| {
                if *speed == 1.0 { m.clone() } else { ball::scaled(m, Ball::from(*speed)) }
            };
            let input = fast(&equations.b);
            a.view_mut((*start, *start), equations.a.shape()).copy_from(&fast(&equations.a));
            match &self.signal {
                None => b.rows_mut(*start, equations.order()).copy_from(&input),
                Some(signal) => {
                    let shape = (equations.order(), signal.order());
                    a.view_mut((*start, 0), shape).copy_from(&ball::product(&input, &signal.c));
                    b.rows_mut(*start, equations.order()).copy_from(&ball::scaled(&input, signal.d));
                }
            }
        }
        (ball::shortened(&a), ball::shortened(&b))
    }

    /// The row that reads a sample from the joint state.
    pub(super) fn output<F: Number>(&self, sample: &SamplingInstant) -> Matrix<F> {
        let FrontEnd { start, equations, .. } = &self.filters[sample.filter];
        let mut row = ball::zeros(1, self.order());
        let gain = Self::gain(sample);
        let own =
            if gain == Ball::from(1.0) { equations.c.clone() } else { ball::scaled(&equations.c, gain) };
        row.columns_mut(*start, equations.order()).copy_from(&own);
        ball::shortened(&row)
    }
}
