//! The analog side of a bank in normalised time, as the proof takes it for given: state equations in doubles.

use super::VerifyError;
use super::ball::{self, Ball, Matrix};
use crate::analog::StrictlyProper;
use crate::bank::Bank;
use crate::spec::FilterSpec;

/// The distinct filters side by side, driven by the same input: dx/dt = a x + b f.
#[derive(Debug, Clone)]
pub(super) struct FrontEnds {
    pub(super) a: Matrix,
    pub(super) b: Matrix,
    filters: Vec<(usize, StrictlyProper)>,
}

/// What is sampled, and when: a row of the state at the time `time` (fast periods, relative to the tick).
#[derive(Debug, Clone)]
pub(super) struct Tap {
    /// Index of the filter.
    pub(super) filter: usize,
    pub(super) time: f64,
}

impl FrontEnds {
    /// Realises the filters of the bank's spec, and lists its samples: the M wanted ones, then the N measured ones.
    pub(super) fn new(bank: &Bank) -> Result<(Self, Vec<Tap>), VerifyError> {
        let spec = bank.spec.as_ref().ok_or(VerifyError::NoSpec)?;
        let mut filters: Vec<(usize, StrictlyProper)> = Vec::new();
        let mut place = |filter: &FilterSpec, name: String| {
            let made = StrictlyProper::new(filter, spec.fast_period)
                .map_err(|source| VerifyError::FrontEnd { place: name, source })?;
            if let Some(known) = filters.iter().position(|(_, seen)| *seen == made) {
                return Ok(known);
            }
            let start = filters.last().map_or(0, |(start, last)| start + last.order());
            filters.push((start, made));
            Ok(filters.len() - 1)
        };
        let target = place(&spec.target, "spec.target.filter".to_owned())?;
        let wanted = (0..bank.ratio).map(|p| Tap { filter: target, time: p as f64 - bank.latency as f64 });
        let mut taps: Vec<Tap> = wanted.collect();
        for (i, (channel, delay)) in spec.channels.iter().zip(spec.delays_in_fast_periods()).enumerate() {
            taps.push(Tap {
                filter: place(&channel.filter, format!("spec.channel[{i}].filter"))?,
                time: -delay.0,
            });
        }
        Ok((Self::side_by_side(filters), taps))
    }

    fn side_by_side(filters: Vec<(usize, StrictlyProper)>) -> Self {
        let order = filters.last().map_or(0, |(start, last)| start + last.order());
        let (mut a, mut b) = (ball::zeros(order, order), ball::zeros(order, 1));
        for (start, filter) in &filters {
            a.view_mut((*start, *start), filter.a().shape()).copy_from(&ball::exact(filter.a()));
            b.rows_mut(*start, filter.order()).copy_from(&ball::exact(filter.b()));
        }
        Self { a, b, filters }
    }

    /// Number of states.
    pub(super) fn order(&self) -> usize {
        self.a.nrows()
    }

    /// The row that reads a filter's output from the joint state.
    pub(super) fn readout(&self, filter: usize) -> Matrix {
        let (start, filter) = &self.filters[filter];
        let mut row = ball::zeros(1, self.order());
        row.columns_mut(*start, filter.order()).copy_from(&ball::exact(filter.c()));
        row
    }
}

impl Tap {
    /// How much earlier than `latest` it is taken, exactly.
    pub(super) fn age(&self, latest: f64) -> Ball {
        Ball::difference(latest, self.time)
    }
}
