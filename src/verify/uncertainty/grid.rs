//! The analog side of a bank whose converters may sample at several instants and with several cut-offs: one
//! slow period that holds all these samples together, so that all their Gram matrices are parts of one. The
//! samples that a converter takes in a frame share its errors.

use super::super::VerifyError;
use super::super::front_ends::FrontEnds;
use super::super::slow_period::SlowPeriod;
use super::super::timeline::{SamplingInstant, timeline};
use super::{ErrorBox, ErrorPoint, Side};
use crate::bank::Bank;
use crate::units::Seconds;
use std::ops::Range;

/// The samples of a bank, those of each channel at equidistant delays.
#[derive(Debug, Clone)]
pub(super) struct Grid {
    pub(super) front_ends: FrontEnds,
    /// The M reference samples, then the variants of each sample of a frame.
    pub(super) samples: Vec<SamplingInstant>,
    pub(super) period: SlowPeriod,
    /// One for each sample of a frame.
    pub(super) channels: Vec<ChannelGrid>,
    /// Those of each converter.
    pub(super) converters: Vec<Range<usize>>,
}

/// The variants of one sample of a frame.
#[derive(Debug, Clone)]
pub(super) struct ChannelGrid {
    /// Errors of the delay, ascending; one if the delay is certain.
    pub(super) errors: Vec<Seconds>,
    /// Factors of the cut-off, ascending; one if it is certain.
    pub(super) speeds: Vec<f64>,
    /// Row of the Gram matrix, by the index of the delay error and of the factor.
    pub(super) rows: Vec<Vec<usize>>,
}

/// Halvings of the delay and of the cut-off of a converter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Halvings {
    pub(super) delay: u32,
    pub(super) cutoff: u32,
}

impl Halvings {
    /// The whole box.
    pub(super) fn none(converters: usize) -> Vec<Self> {
        vec![Self { delay: 0, cutoff: 0 }; converters]
    }
}

/// With one side halved once more. The gains have vertices only.
pub(super) fn halved(side: Side, halvings: &[Halvings]) -> Vec<Halvings> {
    let mut finer = halvings.to_vec();
    match side {
        Side::Delay(i) => finer[i].delay += 1,
        Side::Cutoff(i) => finer[i].cutoff += 1,
        Side::Gain(_) => {}
    }
    finer
}

impl Grid {
    /// The box with the delay and the cut-off of each converter cut into 2^k equal parts.
    ///
    /// # Errors
    /// As [`super::super::EnclosedErrorSystem::new`].
    pub(super) fn new(bank: &Bank, errors: &ErrorBox, halvings: &[Halvings]) -> Result<Self, VerifyError> {
        let points = |half: f64, halvings: u32| -> Vec<f64> {
            let parts = 1u32 << halvings;
            let at = |k: u32| half * (2.0 * f64::from(k) / f64::from(parts) - 1.0);
            if half == 0.0 { vec![0.0] } else { (0..=parts).map(at).collect() }
        };
        let channel = |(i, at): (usize, &Halvings)| {
            let delays = points(errors.delays[i].0, at.delay).into_iter().map(Seconds);
            let speeds = points(errors.cutoffs[i], at.cutoff).into_iter().map(|error| 1.0 + error);
            (delays.collect(), speeds.collect())
        };
        Self::of(bank, halvings.iter().enumerate().map(channel).collect())
    }

    /// One point.
    ///
    /// # Errors
    /// As [`Grid::new`].
    pub(super) fn at(bank: &Bank, point: &ErrorPoint) -> Result<Self, VerifyError> {
        let channel = |i: usize| (vec![point.delays[i]], vec![1.0 + point.cutoffs[i]]);
        Self::of(bank, (0..bank.channel_count()).map(channel).collect())
    }

    /// Whether the front ends of the channels `i` and `j` have one transfer function.
    pub(super) fn has_equal_front_ends(&self, i: usize, j: usize) -> bool {
        // The first rows have the least factors of the cut-offs.
        let [a, b] = [i, j].map(|channel| &self.samples[self.channels[channel].rows[0][0]]);
        a.filter == b.filter && FrontEnds::gain(a) == FrontEnds::gain(b)
    }

    fn of(bank: &Bank, variants: Vec<(Vec<Seconds>, Vec<f64>)>) -> Result<Self, VerifyError> {
        let (layout, (mut front_ends, nominal)) = (bank.layout(), FrontEnds::new(bank)?);
        let mut samples: Vec<SamplingInstant> = nominal[..bank.ratio].to_vec();
        let variants = layout.each(&variants);
        let mut channels = Vec::with_capacity(variants.len());
        for ((errors, speeds), sample) in variants.into_iter().zip(&nominal[bank.ratio..]) {
            let filters: Vec<usize> =
                speeds.iter().map(|&speed| front_ends.with_speed(sample.filter, speed)).collect();
            let mut rows = Vec::with_capacity(errors.len());
            for &error in &errors {
                let time = sample.time.moved_by(-error.in_fast_periods(sample.time.fast_period()));
                rows.push(
                    filters
                        .iter()
                        .map(|&filter| {
                            samples.push(SamplingInstant { filter, time, ..*sample });
                            samples.len() - 1
                        })
                        .collect(),
                );
            }
            channels.push(ChannelGrid { errors, speeds, rows });
        }
        front_ends.check_work(samples.len())?;
        let timeline = timeline(&samples, bank.ratio)?;
        let period = SlowPeriod::new(&front_ends, &timeline, &samples);
        Ok(Self { front_ends, samples, period, channels, converters: layout.ranges() })
    }
}
