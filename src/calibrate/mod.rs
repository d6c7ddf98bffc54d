//! From captures to a spec: delay, gain, offset and cut-off of each channel with their intervals.
//!
//! Channel i delivers g_i (phi_i * f)(k M - D_i) + o_i. What the spec says of D_i, g_i, o_i and of the
//! cut-off of Phi_i is the start; captures of a known kind of signal f correct it:
//!
//! - [`CalibrationSignal::Tones`]: tones in any Nyquist zone of the slow rate, one frequency fitted jointly
//!   over all channels. A tone gives a delay and a gain per channel; three tones or more also give the
//!   cut-off.
//! - [`CalibrationSignal::Waveform`]: a waveform whose samples are known.
//! - [`CalibrationSignal::Any`]: any signal that leaves fewer aliases occupied than there are channels.
//!
//! Complex captures ([`Record::complex`]) are calibrated by tones, whose frequencies then have a sign. Both
//! parts of a channel have its delay, gain and cut-off; what its parts lack of quadrature counts as a gain
//! and a phase of the channel. Each part has an offset of its own, and a spec has one per channel, so those
//! are only noted.
//!
//! A delay and a gain that all channels have in common cannot be observed. One channel is the reference and
//! keeps the values of the spec; its cut-off is fitted where tones tell it, or where the spec says how
//! uncertain it is.
//!
//! # Intervals
//! Every [`Estimate`](crate::sine_fit::Estimate) has its standard deviation: the Cramer-Rao bound for
//! Gaussian noise of the level that the fit leaves. With noise of variance s^2, N samples per channel and
//! SNR = A^2 / (2 s^2)
//!
//! ```text
//! tone:      sigma(D_i - D_r) = sqrt(2 / (N SNR)) / w      sigma(g_i / g_r) = sqrt(2 / (N SNR))
//!            sigma(o_i) = s / sqrt(N)
//! complex:   sigma(D_i - D_r) = sqrt(1 / (N SNR)) / w      sigma(g_i / g_r) = sqrt(1 / (N SNR))
//! waveform:  sigma(D_i)^2 = s^2 / (g^2 sum v'^2), v' without its parts along 1 and v
//! blind:     the inverse of the Fisher information of the Whittle likelihood
//! ```
//!
//! What spoils an estimate and can be recognised is refused ([`CalibrateError`]) or noted
//! ([`CalibrationWarning`]); where the data contradict the model, the intervals are widened by the misfit.

mod agreement;
mod blind;
mod contradiction;
mod delays;
mod error;
mod estimates;
mod fit;
mod lags;
mod model;
mod order;
mod reading;
mod record;
mod starts;
#[cfg(test)]
#[path = "tests/testbench.rs"]
pub(crate) mod testbench;
mod tones;
mod track;
mod warning;
mod waveform;

pub use agreement::{Agreement, ENOUGH_FRAMES, Verdict, agreement, comparable, frames_for_agreement};
pub use contradiction::Contradiction;
pub use error::CalibrateError;
pub use estimates::{Calibration, CalibrationTone, ChannelEstimate, applied};
pub use fit::FittedValues;
pub(crate) use lags::{Correlation, LagLine, interpolated, line, steadied, stretch};
pub(crate) use model::ChannelModel;
pub use reading::{LevelChange, Reading};
pub(crate) use reading::{LevelCourses, by_scatter};
pub(crate) use record::longest_run;
pub use record::{Acquisition, Record};
pub use track::{ChannelChange, Track, track};
pub use warning::CalibrationWarning;

pub use crate::spec::{Cutoff, Fitting, UnknownFitting};

use crate::runtime::Nonlinearity;
use crate::spec::{Spec, UncertaintySpec};
use crate::units::{FastPeriods, Hertz};
use estimates::Fitted;
use std::ops::Range;

/// No converter that is in order has a larger offset, relative to full scale.
const MOST_OFFSET: f64 = 0.1;
/// A delay with a larger standard deviation, in fast periods, is not determined.
const MOST_DELAY_SIGMA: f64 = 0.5;

/// The kind of signal that was captured.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum CalibrationSignal {
    /// Tones near these analog frequencies; an empty list for tones below half the fast rate that are to be
    /// found.
    Tones(Vec<Hertz>),
    /// The samples of a waveform, taken at 0, T, 2 T, .. It is band-limited, and where it lies in the
    /// captures is found.
    Waveform {
        /// The samples.
        samples: Vec<f64>,
        /// T.
        spacing: FastPeriods,
    },
    /// Any signal.
    Any,
}

/// What to fit, and relative to what.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct CalibrationSettings {
    /// The values that are fitted.
    pub fit: FittedValues,
    /// The reference channel, from 0.
    pub reference: usize,
}

/// The reference channel, from 0, where none is named: that of the spec's uncertainty, or the first.
pub fn usual_reference(spec: &Spec) -> usize {
    spec.uncertainty.as_ref().and_then(UncertaintySpec::reference_channel).unwrap_or(0)
}

/// Calibrates the channels of `spec` by `records`, one per channel in the order of the spec, whose samples
/// of one index belong to one frame; of a converter with several samples per frame one for each of them.
///
/// # Errors
/// [`CalibrateError`].
pub fn calibrate(
    spec: &Spec,
    records: &[Record],
    signal: &CalibrationSignal,
    settings: CalibrationSettings,
) -> Result<Calibration, CalibrateError> {
    calibrate_pooled(spec, &[Acquisition { name: "the captures", records }], signal, settings)
}

/// Calibrates the channels of `spec` by several acquisitions of the same converters, each with tones of its
/// own. One value of each channel fits all of them, and the offsets are their weighted means.
///
/// # Errors
/// [`CalibrateError`], for a known waveform also if there is more than one acquisition.
pub fn calibrate_pooled(
    spec: &Spec,
    acquisitions: &[Acquisition<'_>],
    signal: &CalibrationSignal,
    settings: CalibrationSettings,
) -> Result<Calibration, CalibrateError> {
    for Acquisition { name, records } in acquisitions {
        check(spec, records, settings)
            .and_then(|()| check_parts(records, signal))
            .map_err(|error| error.within(name, acquisitions.len()))?;
    }
    calibrate_with(ChannelModel::new(spec)?, spec, acquisitions, signal, settings)
}

/// The same with the model of `spec`, of captures that fit the spec.
pub(crate) fn calibrate_with(
    mut model: ChannelModel,
    spec: &Spec,
    acquisitions: &[Acquisition<'_>],
    signal: &CalibrationSignal,
    settings: CalibrationSettings,
) -> Result<Calibration, CalibrateError> {
    let reference = settings.reference;
    if let Some(part) = settings.fit.cutoff {
        model = model.scaling(part, spec)?;
    }
    let fit = |spec: &Spec, order| {
        let records: Vec<Vec<Record>> =
            acquisitions.iter().map(|one| record::straightened(spec, one.records)).collect();
        let straight = acquisitions.iter().zip(&records);
        let straight: Vec<_> = straight.map(|(one, records)| Acquisition { records, ..*one }).collect();
        let settings =
            CalibrationSettings { fit: FittedValues { nonlinearity: order, ..settings.fit }, ..settings };
        fitted(&model, spec, &straight, signal, settings)
    };
    let order = settings.fit.nonlinearity;
    let mut fitted = match order {
        None => fit(spec, None)?,
        // The tones of samples as they are tell the curves, and those of straight samples the values.
        Some(_) => {
            let bent = with_nonlinearity(spec, vec![Nonlinearity::default(); spec.channels.len()]);
            let curves = fit(&bent, order)?.curves;
            Fitted { curves: curves.clone(), ..fit(&with_nonlinearity(spec, curves), None)? }
        }
    };
    // Tones compare phases, which they do before they take whole periods off a delay.
    if fitted.tones.is_empty()
        && settings.fit.delay
        && let Some(order) = order::order_of_delays(&model.delays, &fitted.point.delays, reference)
    {
        return Err(CalibrateError::WrongOrder { order });
    }
    let clipped_in = |samples: Range<usize>| {
        acquisitions.iter().flat_map(|one| &one.records[samples.clone()]).map(|record| record.clipped).sum()
    };
    let clipped: Vec<usize> = spec.layout().ranges().into_iter().map(clipped_in).collect();
    if clipped.iter().any(|&count| count > 0) {
        fitted.warnings.push(CalibrationWarning::Clipped { counts: clipped.clone() });
    }
    let channels = fitted.channels(&model);
    // Given tones may be contradicted, which widens the intervals and is said elsewhere.
    let are_found = matches!(signal, CalibrationSignal::Tones(given) if given.is_empty());
    if let Some((channel, sigma)) = undetermined(&channels).filter(|_| are_found) {
        return Err(CalibrateError::DelayUndetermined { channel, sigma });
    }
    let is_near_one = |value: f64| (value - 1.0).abs() < MOST_OFFSET;
    if channels.iter().all(|channel| channel.offset.is_some_and(|offset| is_near_one(offset.value))) {
        fitted.warnings.push(CalibrationWarning::OffsetBinary);
    }
    let Fitted { tones, modulus, misfit, frames, warnings, curves, .. } = fitted;
    let (cutoff, nonlinearity) = (settings.fit.cutoff, order.map(|_| curves));
    Ok(Calibration {
        reference,
        channels,
        cutoff,
        nonlinearity,
        tones,
        modulus,
        frames,
        clipped,
        misfit,
        warnings,
    })
}

/// `spec` with other nonlinearities.
fn with_nonlinearity(spec: &Spec, curves: Vec<Nonlinearity>) -> Spec {
    let mut new = spec.clone();
    new.channels.iter_mut().zip(curves).for_each(|(channel, curve)| channel.nonlinearity = curve);
    new
}

/// What the signal says.
fn fitted(
    model: &ChannelModel,
    spec: &Spec,
    acquisitions: &[Acquisition<'_>],
    signal: &CalibrationSignal,
    settings: CalibrationSettings,
) -> Result<Fitted, CalibrateError> {
    match (signal, acquisitions) {
        (CalibrationSignal::Tones(frequencies), _) => {
            tones::fit(model, spec, acquisitions, frequencies, settings)
        }
        _ if !spec.layout().is_plain() => Err(CalibrateError::OwnRates),
        _ if settings.fit.nonlinearity.is_some() => Err(CalibrateError::NonlinearityWithoutTones),
        (CalibrationSignal::Waveform { samples, spacing }, [Acquisition { records, .. }]) => {
            waveform::Training::new(model, records, samples, *spacing, settings)?.fit()
        }
        (CalibrationSignal::Any, _) => blind::Blind::new(model, acquisitions, usize::MAX)?.fit(settings),
        _ => Err(CalibrateError::NotPooled { acquisitions: acquisitions.len() }),
    }
}

/// The first channel, from 1, whose delay is not determined, with its standard deviation.
fn undetermined(channels: &[ChannelEstimate]) -> Option<(usize, FastPeriods)> {
    let sigma = |(i, channel): (usize, &ChannelEstimate)| Some((i + 1, channel.delay?.sigma));
    channels.iter().enumerate().filter_map(sigma).find(|(_, sigma)| sigma.0 > MOST_DELAY_SIGMA)
}

/// All records are real, or all are complex and hold tones.
pub(crate) fn check_parts(records: &[Record], signal: &CalibrationSignal) -> Result<(), CalibrateError> {
    let complex = records.iter().filter(|record| record.imaginary.is_some()).count();
    match signal {
        CalibrationSignal::Tones(_) if complex == records.len() => Ok(()),
        CalibrationSignal::Tones(tones) if complex == 0 => match tones.iter().find(|tone| tone.0 < 0.0) {
            Some(&tone) => Err(CalibrateError::NegativeTone { tone }),
            None => Ok(()),
        },
        _ if complex == 0 => Ok(()),
        _ => Err(CalibrateError::ComplexSamples { complex, records: records.len() }),
    }
}

/// Refuses records and settings that do not belong to a spec.
pub(crate) fn check(
    spec: &Spec,
    records: &[Record],
    settings: CalibrationSettings,
) -> Result<(), CalibrateError> {
    let (channels, needed) = (spec.channels.len(), spec.layout().count());
    if records.len() != needed {
        return Err(CalibrateError::ChannelCount { channels: needed, records: records.len() });
    }
    if channels < 2 {
        return Err(CalibrateError::OneChannel);
    }
    if settings.reference >= channels {
        return Err(CalibrateError::NoSuchReference { reference: settings.reference + 1, channels });
    }
    if settings.fit == FittedValues::NOTHING {
        return Err(CalibrateError::NothingToFit);
    }
    match record::repeated(records) {
        Some((first, second)) => Err(CalibrateError::Repeated { first: first + 1, second: second + 1 }),
        None => Ok(()),
    }
}
