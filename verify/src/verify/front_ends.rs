//! The analog side of a bank in normalised time: the state equations of the filters as the spec writes them,
//! enclosed.

use super::ball::{self, Ball, Matrix};
use super::timeline::SamplingInstant;
use super::{MAX_ANALOG_STATES, MAX_WORK, VerifyError};
use crate::analog::{Realisation, SignalFilter, StrictlyProper, enclosed, signal};
use crate::arithmetic::{Float, LongBall};
use hybank_core::bank::Bank;
use hybank_core::spec::FilterSpec;
use hybank_core::units::GridTime;

/// State equations of a filter.
pub(super) type Equations = Realisation<LongBall>;

/// The filter W of the signal and the distinct front ends, which it drives, the states of W first:
/// dx/dt = a x + b f. Without a signal the front ends stand side by side, driven by the same input.
#[derive(Debug, Clone)]
pub(super) struct FrontEnds {
    signal: Option<Equations>,
    /// Filters that are written alike count once.
    filters: Vec<FrontEnd>,
}

/// One filter after that of the signal.
#[derive(Debug, Clone)]
struct FrontEnd {
    /// Index of the first state.
    start: usize,
    equations: Equations,
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
        let mut all = Self::driven_by(signal);
        let mut seen: Vec<FilterSpec> = Vec::new();
        let mut index = |filter: &FilterSpec, name: &dyn Fn() -> String| {
            if let Some(known) = seen.iter().position(|other| other == filter) {
                return Ok(known);
            }
            StrictlyProper::driven_by(checked.as_ref(), filter, h).map_err(refused(name()))?;
            let equations = enclosed(all.signal.as_ref(), filter, h).map_err(refused(name()))?;
            seen.push(filter.clone());
            Ok(all.push(equations))
        };
        let target = index(&spec.target, &|| "spec.target.filter".to_owned())?;
        let reference = |p: usize| GridTime::fast_sample(p as f64 - bank.latency as f64, h);
        let mut samples: Vec<SamplingInstant> = (0..bank.ratio)
            .map(|p| SamplingInstant { filter: target, gain: Ball::from(1.0), time: reference(p) })
            .collect();
        let mut converters = Vec::with_capacity(spec.channels.len());
        for (i, channel) in spec.channels.iter().enumerate() {
            converters.push(index(&channel.filter, &|| format!("spec.channel[{i}].filter"))?);
        }
        let layout = spec.layout();
        for (converter, delay) in layout.owners().into_iter().zip(layout.waited_delays(&spec.delays())) {
            let gain = Ball::from(spec.channels[converter].gain);
            samples.push(SamplingInstant { filter: converters[converter], gain, time: delay.negative() });
        }
        Ok((all, samples))
    }

    /// No filters after that of the signal.
    pub(super) fn driven_by(signal: Option<Equations>) -> Self {
        Self { signal, filters: Vec::new() }
    }

    /// Appends a filter, and returns its index.
    pub(super) fn push(&mut self, equations: Equations) -> usize {
        self.filters.push(FrontEnd { start: self.order(), equations });
        self.filters.len() - 1
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

    /// The filter with this index.
    pub(super) fn filter(&self, index: usize) -> &Equations {
        &self.filters[index].equations
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
    pub(super) fn dynamics<F: Float>(&self) -> (Matrix<F>, Matrix<F>) {
        let order = self.order();
        let (mut a, mut b) = (ball::zeros(order, order), ball::zeros(order, 1));
        if let Some(signal) = &self.signal {
            a.view_mut((0, 0), signal.a.shape()).copy_from(&signal.a);
            b.rows_mut(0, signal.order()).copy_from(&signal.b);
        }
        for FrontEnd { start, equations } in &self.filters {
            let input = &equations.b;
            a.view_mut((*start, *start), equations.a.shape()).copy_from(&equations.a);
            match &self.signal {
                None => b.rows_mut(*start, equations.order()).copy_from(input),
                Some(signal) => {
                    let shape = (equations.order(), signal.order());
                    a.view_mut((*start, 0), shape).copy_from(&ball::product(input, &signal.c));
                    b.rows_mut(*start, equations.order()).copy_from(&ball::scaled(input, signal.d));
                }
            }
        }
        (ball::shortened(&a), ball::shortened(&b))
    }

    /// The row that reads a sample from the joint state.
    pub(super) fn output<F: Float>(&self, sample: &SamplingInstant) -> Matrix<F> {
        let FrontEnd { start, equations } = &self.filters[sample.filter];
        let mut row = ball::zeros(1, self.order());
        // A factor of one would only widen the enclosure.
        let own = match sample.gain {
            gain if gain == Ball::from(1.0) => equations.c.clone(),
            gain => ball::scaled(&equations.c, gain),
        };
        row.columns_mut(*start, equations.order()).copy_from(&own);
        ball::shortened(&row)
    }
}
