//! Delays of one block of samples, by a pilot tone or by any signal.

use super::error::NotMeasured;
use super::{DelayMeasurement, Reading, TrackError};
use crate::calibrate::{CalibrationSignal, Fit, Model, Record, Settings, calibrate};
use crate::sine_fit::{self, Channel, Estimate, ToneFit, alias, wrapped};
use crate::spec::Spec;
use crate::units::{Decibels, Hertz, Radians, Seconds};
use std::f64::consts::TAU;

/// A pilot's frequency may be off by this share of itself and by this many cycles per block.
const CLOCK_TOLERANCE: f64 = 1e-4;
const SEARCH_CYCLES: f64 = 2.0;
/// Other tones that are fitted with the pilot, how far below the largest tone, and how many cycles per block
/// apart from it.
const MOST_OTHERS: usize = 8;
const OTHERS_RANGE: Decibels = Decibels(60.0);
const APART_CYCLES: f64 = 3.0;
/// Rms of a block, relative to full scale, below which it holds nothing to measure by: less than half a step
/// of 24 bits and of any converter.
pub(super) const LEAST_LEVEL: f64 = 1e-8;
/// A measurement with a larger standard deviation says nothing, in fast periods: its interval is as wide as
/// the distance of two channels.
pub(super) const LARGEST_DEVIATION: f64 = 0.25;
/// Least distance of a pilot from a multiple of half the slow rate, cycles per block.
const LEAST_CYCLES: f64 = 2.0;

/// What the delays are measured by.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum DelaySource {
    /// A tone near this analog frequency that sounds all the time.
    Pilot(Hertz),
    /// Whatever signal there is, as [`CalibrationSignal::Any`].
    AnySignal,
    /// Measurements that are known beforehand.
    Readings(Vec<Reading>),
}

impl DelaySource {
    /// The delays of the channels relative to `reference`, which keeps that of `spec`; those of the others
    /// in `spec` are what is expected.
    pub(super) fn measure(
        &self,
        spec: &Spec,
        reference: usize,
        samples: &[Vec<f64>],
    ) -> Result<Vec<Option<DelayMeasurement>>, NotMeasured> {
        let records: Vec<Record> = samples.iter().map(|list| Record::new(list.clone())).collect();
        if records.iter().any(|record| record.rms() < LEAST_LEVEL) {
            return Err(NotMeasured::Silence);
        }
        let measured = match self {
            Self::Pilot(pilot) => by_pilot(spec, reference, &records, *pilot)?,
            Self::AnySignal => by_any_signal(spec, reference, &records)?,
            Self::Readings(_) => vec![None; samples.len()],
        };
        let most = LARGEST_DEVIATION * spec.fast_period.0;
        let useful =
            |m: &DelayMeasurement| m.variance > 0.0 && m.variance.sqrt() <= most && m.delay.0.is_finite();
        let kept: Vec<_> = measured.into_iter().map(|m| m.filter(useful)).collect();
        if kept.iter().all(Option::is_none) {
            return Err(NotMeasured::TooNoisy);
        }
        Ok(kept)
    }
}

/// The phases of a tone at the centre of the block. Each channel is fitted with a frequency of its own: a
/// clock that drifts changes the frequency too, and at the centre the error of the frequency does not enter.
fn by_pilot(
    spec: &Spec,
    reference: usize,
    records: &[Record],
    pilot: Hertz,
) -> Result<Vec<Option<DelayMeasurement>>, NotMeasured> {
    let model = Model::new(spec)?;
    let rate = model.slow_rate();
    let frames = records.iter().map(|record| record.samples.len()).min().unwrap_or(0);
    let centre = rate.period() * (0.5 * (frames as f64 - 1.0));
    let channels: Vec<Channel<'_>> =
        records.iter().map(|record| Channel { offset: -centre, ..record.channel() }).collect();
    let within = pilot * CLOCK_TOLERANCE + rate * (SEARCH_CYCLES / frames as f64);
    let start = sine_fit::locate(&channels, rate, pilot, within)?;
    let all = with_others(&channels, rate, start, frames);
    let mut tones: Vec<(Hertz, ToneFit)> = Vec::with_capacity(channels.len());
    for channel in &channels {
        let alone = std::slice::from_ref(channel);
        // Without the others they count as noise, and the interval of the pilot is wider.
        let fitted = sine_fit::fit(alone, rate, &all).or_else(|_| sine_fit::fit(alone, rate, &[start]))?;
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
    let is_other = |f: &Hertz| (alias(*f / rate) - alias(pilot / rate)).abs() * frames as f64 > APART_CYCLES;
    // Tones that are not found count as noise.
    let found = sine_fit::find_tones(channels, rate, MOST_OTHERS, OTHERS_RANGE).unwrap_or_default();
    std::iter::once(pilot).chain(found.into_iter().filter(is_other)).collect()
}

/// As `hybank calibrate --blind`, from the expected delays.
fn by_any_signal(
    spec: &Spec,
    reference: usize,
    records: &[Record],
) -> Result<Vec<Option<DelayMeasurement>>, NotMeasured> {
    let fit = Fit { delay: true, gain: true, offset: false, cutoff: None };
    let found = calibrate(spec, records, &CalibrationSignal::Any, Settings { fit, reference })?;
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

/// Refuses a pilot at a multiple of half the slow rate.
pub(super) fn check_pilot(rate: Hertz, pilot: Hertz, frames: usize) -> Result<(), TrackError> {
    let cycles = sine_fit::distance_to_edge(pilot / rate) * frames as f64;
    if cycles >= LEAST_CYCLES {
        return Ok(());
    }
    Err(TrackError::PilotPosition { pilot, cycles, frames, half: rate * 0.5 })
}
