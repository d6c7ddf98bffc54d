//! Delays of one block of samples, by a pilot tone or by any signal.

use super::{DelayMeasurement, Reading};
use crate::calibrate::{CalibrationSignal, Fit, Model, Record, Settings, calibrate};
use crate::sine_fit::{self, Channel, Estimate, ToneFit};
use crate::spec::Spec;
use crate::units::{Decibels, Hertz, Radians, Seconds};
use std::f64::consts::{PI, TAU};

/// A pilot's frequency may be off by this share of itself and by this many cycles per block.
const CLOCK_TOLERANCE: f64 = 1e-4;
const SEARCH_CYCLES: f64 = 2.0;
/// Other tones that are fitted with the pilot, how far below the largest tone, and how many cycles per block
/// apart from it.
const MOST_OTHERS: usize = 8;
const OTHERS_RANGE: Decibels = Decibels(60.0);
const APART: f64 = 3.0;
/// Mean square of a block below which there is silence, relative to full scale.
const SILENCE: f64 = 1e-16;
/// A measurement with a larger standard deviation says nothing, in fast periods.
const WORTHLESS: f64 = 0.25;

/// What the delays are measured by.
#[derive(Debug, Clone, PartialEq)]
pub enum Guide {
    /// A tone near this analog frequency that sounds all the time.
    Pilot(Hertz),
    /// Whatever signal there is, as [`CalibrationSignal::Any`].
    AnySignal,
    /// Measurements that are known beforehand.
    Readings(Vec<Reading>),
}

impl Guide {
    /// The delays of the channels relative to `reference`, which keeps that of `spec`; those of the others
    /// in `spec` are what is expected. `Err` says why nothing was measured.
    pub(super) fn measure(
        &self,
        spec: &Spec,
        reference: usize,
        samples: &[Vec<f64>],
    ) -> Result<Vec<Option<DelayMeasurement>>, String> {
        let records: Vec<Record> = samples.iter().map(|list| Record::new(list.clone())).collect();
        if records.iter().any(is_silent) {
            return Err("silence".to_owned());
        }
        let measured = match self {
            Self::Pilot(pilot) => by_pilot(spec, reference, &records, *pilot)?,
            Self::AnySignal => by_any_signal(spec, reference, &records)?,
            Self::Readings(_) => vec![None; samples.len()],
        };
        let most = WORTHLESS * spec.fast_period.0;
        let useful =
            |m: &DelayMeasurement| m.variance > 0.0 && m.variance.sqrt() <= most && m.delay.0.is_finite();
        let kept: Vec<_> = measured.into_iter().map(|m| m.filter(useful)).collect();
        if kept.iter().all(Option::is_none) {
            return Err("the signal is too faint or too noisy".to_owned());
        }
        Ok(kept)
    }
}

/// Without a change there is nothing to measure by.
fn is_silent(record: &Record) -> bool {
    let kept = || record.samples.iter().zip(&record.keep).filter(|(_, keep)| **keep).map(|(x, _)| *x);
    let count = record.used().max(1) as f64;
    let mean = kept().sum::<f64>() / count;
    kept().map(|x| (x - mean).powi(2)).sum::<f64>() / count < SILENCE
}

/// The phases of a tone at the centre of the block. Each channel is fitted with a frequency of its own: a
/// clock that drifts changes the frequency too, and at the centre the error of the frequency does not enter.
fn by_pilot(
    spec: &Spec,
    reference: usize,
    records: &[Record],
    pilot: Hertz,
) -> Result<Vec<Option<DelayMeasurement>>, String> {
    let model = Model::new(spec).map_err(|error| error.to_string())?;
    let rate = model.slow_rate();
    let frames = records.iter().map(|record| record.samples.len()).min().unwrap_or(0);
    let centre = rate.period() * (0.5 * (frames as f64 - 1.0));
    let channels: Vec<Channel<'_>> = records
        .iter()
        .map(|record| Channel { samples: &record.samples, offset: -centre, keep: Some(&record.keep) })
        .collect();
    let within = pilot * CLOCK_TOLERANCE + rate * (SEARCH_CYCLES / frames as f64);
    let start = sine_fit::locate(&channels, rate, pilot, within).map_err(|error| error.to_string())?;
    let all = with_others(&channels, rate, start, frames);
    let mut tones: Vec<(Hertz, ToneFit)> = Vec::with_capacity(channels.len());
    for channel in &channels {
        let alone = std::slice::from_ref(channel);
        let fitted = sine_fit::fit(alone, rate, &all).or_else(|_| sine_fit::fit(alone, rate, &[start]));
        let fitted = fitted.map_err(|error| error.to_string())?;
        tones.push((fitted.frequencies[0].value, fitted.channels[0].tones[0]));
    }
    let (frequency, of_reference) = tones[reference];
    let w = TAU * frequency.per_fast_period(spec.fast_period).0;
    let expected = |i: usize| (model.nominal(i, w) / model.nominal(reference, w)).arg();
    let measured = |(i, (_, tone)): (usize, &(Hertz, ToneFit))| {
        if i == reference {
            return None;
        }
        let lag = wrapped(tone.phase.value.0 - of_reference.phase.value.0 - expected(i));
        let sigma = |phase: Estimate<Radians>| (phase.sigma.0 / w * spec.fast_period.0).powi(2);
        Some(DelayMeasurement {
            delay: spec.channels[i].delay - spec.fast_period * (lag / w),
            variance: sigma(tone.phase) + sigma(of_reference.phase),
        })
    };
    Ok(tones.iter().enumerate().map(measured).collect())
}

/// The pilot first, and other tones that would count as noise if they were not fitted with it.
fn with_others(channels: &[Channel<'_>], rate: Hertz, pilot: Hertz, frames: usize) -> Vec<Hertz> {
    let folded = |f: Hertz| (f / rate - (f / rate).round()).abs();
    let is_other = |f: &Hertz| (folded(*f) - folded(pilot)).abs() * frames as f64 > APART;
    let found = sine_fit::find_tones(channels, rate, MOST_OTHERS, OTHERS_RANGE).unwrap_or_default();
    std::iter::once(pilot).chain(found.into_iter().filter(is_other)).collect()
}

/// As `hybank calibrate --blind`, from the expected delays.
fn by_any_signal(
    spec: &Spec,
    reference: usize,
    records: &[Record],
) -> Result<Vec<Option<DelayMeasurement>>, String> {
    let fit = Fit { delay: true, gain: true, offset: false, cutoff: false };
    let found = calibrate(spec, records, CalibrationSignal::Any, Settings { fit, reference });
    let found = found.map_err(|error| error.to_string())?;
    let h = spec.fast_period;
    let measured = |estimate: &crate::calibrate::ChannelEstimate| {
        let Estimate { value, sigma } = estimate.delay?;
        let seconds = |periods: f64| Seconds(periods * h.0);
        Some(DelayMeasurement { delay: seconds(value.0), variance: seconds(sigma.0).0.powi(2) })
    };
    let mut measured: Vec<_> = found.channels.iter().map(measured).collect();
    measured[reference] = None;
    Ok(measured)
}

/// An angle in -pi ..= pi.
fn wrapped(angle: f64) -> f64 {
    (angle - TAU * (angle / TAU).round()).clamp(-PI, PI)
}
