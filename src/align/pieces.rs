//! Delays, gains and offsets piece by piece, of recordings whose lags are known to some samples.
//!
//! A piece is so short that no clock drifts by much within it, and what it drifts is taken out. The
//! cross-correlation gives its lag to a part of a sample, and a blind calibration the rest. Each is measured
//! on its own, so no piece is lost where some are zero.

use super::steps::Lags;
use super::{AlignError, Stretches};
use crate::calibrate::{
    Acquisition, CalibrateError, CalibrationSettings, CalibrationSignal, ChannelEstimate, ChannelModel,
    Record, calibrate_with, check, longest_run, steadied,
};
use crate::sine_fit::Estimate;
use crate::spec::Spec;
use crate::units::FastPeriods;
use rayon::prelude::*;

/// A measurement with a larger standard deviation says nothing, in fast periods: its interval is as wide as
/// the distance of two channels.
const LARGEST_DEVIATION: f64 = 0.25;
/// Least standard deviation of a lag in samples: what a drift within a piece and the rounding of the fit may
/// do.
const LEAST_DEVIATION: f64 = 1e-6;
/// Share of the pieces that give delays, at least, each by its level.
const LEAST_SHARE: f64 = 0.5;
/// The delay of a piece is at most so many slow periods from its lag.
const FARTHEST: f64 = 1.0;

/// The recordings of all channels and where they are compared.
pub(super) struct Pieces<'a> {
    records: &'a [Record],
    lags: &'a [Lags],
    settings: CalibrationSettings,
    stretches: &'a Stretches,
    /// The expected gains are those of the recordings.
    spec: Spec,
    model: ChannelModel,
}

/// What a piece says of all channels.
pub(super) struct PieceEstimate {
    /// Sample of the reference at its middle.
    pub(super) centre: f64,
    /// One per channel: gains and offsets.
    pub(super) channels: Vec<ChannelEstimate>,
    /// One per channel: a sample of it, and by how much that is larger than its instant in samples of the
    /// reference.
    pub(super) lags: Vec<Option<(f64, Estimate<f64>)>>,
}

impl<'a> Pieces<'a> {
    /// Of recordings that lie beside the reference with these lags.
    pub(super) fn new(
        spec: &Spec,
        records: &'a [Record],
        lags: &'a [Lags],
        settings: CalibrationSettings,
        stretches: &'a Stretches,
    ) -> Result<Self, CalibrateError> {
        let mut spec = spec.clone();
        let (own, gain) = (records[settings.reference].rms(), spec.channels[settings.reference].gain);
        for ((channel, record), lags) in spec.channels.iter_mut().zip(records).zip(lags) {
            channel.gain = (gain * record.rms() / own).copysign(gain * lags.sign);
        }
        let model = ChannelModel::new(&spec)?;
        Ok(Self { records, lags, settings, stretches, spec, model })
    }

    /// What each piece says, where it says anything; else why the last one does not.
    pub(super) fn measure(&self) -> Result<Vec<PieceEstimate>, AlignError> {
        let firsts = self.stretches.firsts();
        let (mut found, mut reason, mut said, mut all) = (Vec::new(), None, 0.0, 0.0);
        let estimates: Vec<_> = firsts.par_iter().map(|first| self.estimate(*first)).collect();
        for (first, estimate) in firsts.iter().zip(estimates) {
            let level = self.level(*first);
            all += level;
            match estimate {
                Ok(Some(estimate)) => {
                    found.push(estimate);
                    said += level;
                }
                Ok(None) => {}
                // Lost samples speak neither for nor against the others.
                Err(CalibrateError::TooShort { .. }) => all -= level,
                Err(error) => reason = Some(error),
            }
        }
        match found.is_empty() || said < LEAST_SHARE * all {
            true => Err(AlignError::NotMeasured { measured: found.len(), pieces: firsts.len(), reason }),
            false => Ok(found),
        }
    }

    /// How loud a piece is.
    fn level(&self, first: usize) -> f64 {
        self.records[self.settings.reference].part(first..first + self.stretches.length).rms()
    }

    /// What a piece says; `None` where it does not say enough.
    fn estimate(&self, first: usize) -> Result<Option<PieceEstimate>, CalibrateError> {
        let (mut spec, length) = (self.spec.clone(), self.stretches.length);
        let (h, slow) = (spec.fast_period, spec.fast_period * spec.ratio as f64);
        let own = spec.channels[self.settings.reference].delay;
        let (mut shifts, mut parts) = (Vec::new(), Vec::new());
        let middle = 0.5 * (length as f64 - 1.0);
        for ((record, lags), channel) in self.records.iter().zip(self.lags).zip(&mut spec.channels) {
            let (lag, rate) = (lags.at(first as f64 + middle), lags.rate_at(first as f64 + middle));
            let last = record.samples.len().saturating_sub(length) as i64;
            let begin = (first as i64 + lag.round() as i64).clamp(0, last);
            let shift = (begin - first as i64) as f64;
            channel.delay = own + slow * (lag - shift);
            shifts.push(shift);
            parts.push(steadied(record, begin as usize, length, rate));
        }
        let (begin, frames) = longest_run(&parts);
        let parts: Vec<Record> = parts.iter().map(|part| part.part(begin..begin + frames)).collect();
        check(&spec, &parts, self.settings)?;
        let all = [Acquisition { name: "the recordings", records: &parts }];
        let model = self.model.with_delays(&spec);
        let found = calibrate_with(model, &spec, &all, &CalibrationSignal::Any, self.settings)?;
        // Steadied recordings agree with their own clocks in the middle of the piece.
        let beside = begin as f64 + 0.5 * (frames as f64 - 1.0) - middle;
        let centre = first as f64 + middle + beside;
        let mut all = Vec::new();
        for (i, channel) in found.channels.iter().enumerate() {
            let Some(delay) = channel.delay else {
                all.push(None);
                continue;
            };
            let moved = (delay.value - spec.channels[i].delay.in_fast_periods(h)).0.abs();
            let is_known = delay.sigma.0 <= LARGEST_DEVIATION && moved <= FARTHEST * spec.ratio as f64;
            if !is_known {
                return Ok(None);
            }
            let in_samples = |periods: FastPeriods| periods.0 / spec.ratio as f64;
            let later = in_samples(delay.value - own.in_fast_periods(h));
            let rate = self.lags[i].rate_at(first as f64 + middle);
            let sample = first as f64 + shifts[i] + middle + (1.0 + rate) * beside;
            let bend = self.lags[i].bend_over(first as f64 + middle, frames as f64);
            let lag = Estimate {
                value: sample - centre + later - bend,
                sigma: in_samples(delay.sigma).max(LEAST_DEVIATION),
            };
            all.push(Some((sample, lag)));
        }
        Ok(Some(PieceEstimate { centre, channels: found.channels, lags: all }))
    }
}
