//! Delays, gains and offsets piece by piece, of recordings whose lags are known to some samples.
//!
//! A piece is so short that no clock drifts by much within it, and what it drifts is taken out. The
//! cross-correlation gives its lag to a part of a sample, and a blind calibration the rest. Each is measured
//! on its own, so no piece is lost where some are zero.

use super::local::{LocalLag, Place};
use super::{AlignError, Stretches};
use crate::calibrate::{
    CalibrateError, CalibrationSignal, ChannelEstimate, LagLine, Record, Settings, calibrate, longest_run,
    steadied,
};
use crate::sine_fit::Estimate;
use crate::spec::Spec;
use crate::units::FastPeriods;

/// A measurement with a larger standard deviation says nothing, in fast periods: its interval is as wide as
/// the distance of two channels.
const LARGEST_DEVIATION: f64 = 0.25;
/// Least standard deviation of a lag in samples: what a drift within a piece and the rounding of the fit may
/// do.
const LEAST_DEVIATION: f64 = 1e-6;
/// Pieces on each side whose lags say where that of a piece is to be.
const BESIDE: usize = 7;
/// Share of the pieces that give delays, at least, each by its level.
const LEAST_SHARE: f64 = 0.5;
/// Samples by which the lag of a piece may differ from what the pieces beside it say.
const NEAR_LAG: f64 = 1.5;
/// The delay of a piece is at most so many slow periods from its lag.
const FARTHEST: f64 = 1.0;

/// The recordings of all channels and where they are compared.
pub(super) struct Pieces<'a> {
    records: &'a [Record],
    settings: Settings,
    stretches: &'a Stretches,
    /// The expected gains are those of the recordings.
    spec: Spec,
    /// By how much the lag of each grows per sample.
    rates: Vec<f64>,
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

/// Whether a lag is the only one that the correlation shows, and the one that the pieces beside it show.
fn says(lag: &LocalLag, beyond: f64) -> bool {
    lag.is_alone && (lag.beyond - beyond).abs() <= NEAR_LAG
}

impl<'a> Pieces<'a> {
    pub(super) fn new(
        spec: &Spec,
        records: &'a [Record],
        settings: Settings,
        stretches: &'a Stretches,
    ) -> Self {
        Self { records, settings, stretches, spec: spec.clone(), rates: vec![0.0; records.len()] }
    }

    /// What each piece says, where it says anything, of recordings on these lines; else why the last one
    /// does not.
    pub(super) fn measure(mut self, lines: &[Option<LagLine>]) -> Result<Vec<PieceEstimate>, AlignError> {
        let firsts = self.stretches.firsts();
        let mut lags: Vec<Vec<f64>> = vec![vec![0.0; lines.len()]; firsts.len()];
        for (i, line) in lines.iter().enumerate() {
            let Some(line) = line else { continue };
            let local: Vec<LocalLag> = firsts.iter().map(|first| self.local_lag(*first, i, line)).collect();
            self.expect_gain(i, local.iter().map(|lag| lag.height).sum());
            let beyond: Vec<f64> = (0..local.len()).map(|number| likely(&local, number)).collect();
            let weight = |agrees: bool| -> f64 {
                let of_kind = |(lag, beyond): &(&LocalLag, &f64)| says(lag, **beyond) == agrees;
                local.iter().zip(&beyond).filter(of_kind).map(|(lag, _)| lag.height.powi(2)).sum()
            };
            if weight(false) > weight(true) {
                return Err(AlignError::Narrow { reference: self.settings.reference + 1, channel: i + 1 });
            }
            self.rates[i] = line.rate + slope(&firsts, &beyond);
            for ((first, beyond), lags) in firsts.iter().zip(&beyond).zip(&mut lags) {
                lags[i] = line.lag_at(self.centre(*first)) + beyond;
            }
        }
        let (mut found, mut reason, mut said, mut all) = (Vec::new(), None, 0.0, 0.0);
        for (first, lags) in firsts.iter().zip(&lags) {
            let level = self.level(*first);
            all += level;
            match self.estimate(*first, lags) {
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

    fn centre(&self, first: usize) -> f64 {
        first as f64 + 0.5 * (self.stretches.length as f64 - 1.0)
    }

    /// The lag of recording i as it correlates with the reference.
    fn local_lag(&self, first: usize, i: usize, line: &LagLine) -> LocalLag {
        let &Stretches { length, margin, .. } = self.stretches;
        let place = Place { first, length, expected: line.lag_at(self.centre(first)), margin };
        LocalLag::new(&self.records[self.settings.reference], &self.records[i], place)
    }

    /// Expects that recording i has its level, and the polarity with which it `correlates`.
    fn expect_gain(&mut self, i: usize, correlates: f64) {
        let (own, reference) = (&self.records[i], &self.records[self.settings.reference]);
        let gain = self.spec.channels[self.settings.reference].gain * own.rms() / reference.rms();
        self.spec.channels[i].gain = gain * 1f64.copysign(correlates);
    }

    /// What a piece says if the recordings have these lags there; `None` where it does not say enough.
    fn estimate(&self, first: usize, lags: &[f64]) -> Result<Option<PieceEstimate>, CalibrateError> {
        let (mut spec, length) = (self.spec.clone(), self.stretches.length);
        let (h, slow) = (spec.fast_period, spec.fast_period * spec.ratio as f64);
        let own = spec.channels[self.settings.reference].delay;
        let (mut shifts, mut parts) = (Vec::new(), Vec::new());
        for (((record, lag), rate), channel) in
            self.records.iter().zip(lags).zip(&self.rates).zip(&mut spec.channels)
        {
            let last = record.samples.len().saturating_sub(length) as i64;
            let begin = (first as i64 + lag.round() as i64).clamp(0, last);
            let shift = (begin - first as i64) as f64;
            channel.delay = own + slow * (lag - shift);
            shifts.push(shift);
            parts.push(steadied(record, begin as usize, length, *rate));
        }
        let (begin, frames) = longest_run(&parts);
        let parts: Vec<Record> = parts.iter().map(|part| part.part(begin..begin + frames)).collect();
        let found = calibrate(&spec, &parts, &CalibrationSignal::Any, self.settings)?;
        // Steadied recordings agree with their own clocks in the middle of the piece.
        let middle = 0.5 * (length as f64 - 1.0);
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
            let sample = first as f64 + shifts[i] + middle + (1.0 + self.rates[i]) * beside;
            let lag = Estimate {
                value: sample - centre + later,
                sigma: in_samples(delay.sigma).max(LEAST_DEVIATION),
            };
            all.push(Some((sample, lag)));
        }
        Ok(Some(PieceEstimate { centre, channels: found.channels, lags: all }))
    }
}

/// By how much the lag of a piece is beyond the line. A lag far from the median of those beside it is that
/// of chance, and the median is taken.
fn likely(local: &[LocalLag], number: usize) -> f64 {
    let beside = &local[number.saturating_sub(BESIDE)..(number + BESIDE + 1).min(local.len())];
    let (usual, own) = (weighted_median(beside.to_vec()), local[number].beyond);
    if (own - usual).abs() <= NEAR_LAG { own } else { usual }
}

/// By how much the lags of pieces that begin at these samples grow per sample: by least squares.
fn slope(firsts: &[usize], lags: &[f64]) -> f64 {
    let middle = firsts.iter().sum::<usize>() as f64 / firsts.len() as f64;
    let from = |first: &usize| *first as f64 - middle;
    let squares: f64 = firsts.iter().map(|first| from(first).powi(2)).sum();
    firsts.iter().zip(lags).map(|(first, lag)| from(first) * lag).sum::<f64>() / squares
}

/// The median, with the squares of the correlations as weights.
fn weighted_median(mut lags: Vec<LocalLag>) -> f64 {
    lags.sort_by(|a, b| a.beyond.total_cmp(&b.beyond));
    let mut left = 0.5 * lags.iter().map(|lag| lag.height.powi(2)).sum::<f64>();
    let middle = lags.iter().find(|lag| {
        left -= lag.height.powi(2);
        left <= 0.0
    });
    middle.map_or(0.0, |middle| middle.beyond)
}
