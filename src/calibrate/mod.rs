//! From captures to a spec: delay, gain, offset and cut-off of each channel with their intervals.
//!
//! Channel i delivers g_i (phi_i * f)(k M - D_i) + o_i. What the spec says of D_i, g_i, o_i and of the
//! cut-off of Phi_i is the start; captures of a known kind of signal f correct it:
//!
//! - [`Evidence::Tones`]: tones in any Nyquist zone of the slow rate, one frequency fitted jointly over all
//!   channels. A tone gives a delay and a gain per channel; three tones or more also give the cut-off.
//! - [`Evidence::Waveform`]: a waveform whose samples are known.
//! - [`Evidence::AnySignal`]: any signal that leaves fewer aliases occupied than there are channels.
//!
//! Complex captures ([`Record::complex`]) are calibrated by tones, whose frequencies then have a sign. Both
//! parts of a channel have its delay, gain and cut-off; what its parts lack of quadrature counts as a gain
//! and a phase of the channel. Each part has an offset of its own, and a spec has one per channel, so those
//! are only noted.
//!
//! A delay, a gain and a cut-off that all channels have in common cannot be observed. One channel is the
//! reference and keeps the values of the spec.
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
//! What spoils an estimate and can be recognised is refused ([`CalibrateError`]) or noted ([`Remark`]);
//! where the data contradict the model, the intervals are widened by the misfit.

mod agreement;
mod apply;
mod blind;
mod contradiction;
mod error;
mod estimates;
mod measured;
mod model;
mod order;
mod parameters;
mod record;
mod remark;
mod result;
mod settings;
mod starts;
#[cfg(test)]
mod testbench;
mod tones;
mod waveform;

pub use agreement::{
    Agreement, ENOUGH_FRAMES, LEAST_FRAMES, Verdict, agreement, contradictions, frames_for_agreement,
};
pub use apply::applied;
pub use contradiction::Contradiction;
pub use error::CalibrateError;
pub use measured::{Modulus, Tone};
pub use model::Model;
pub use parameters::Fit;
pub use record::Record;
pub use remark::Remark;
pub use result::{Calibration, ChannelEstimate};
pub use settings::{Evidence, Settings};

use crate::spec::Spec;
use estimates::Fitted;

/// Calibrates the channels of `spec` by `records`, one per channel in the order of the spec, whose samples
/// of one index belong to one frame.
///
/// # Errors
/// [`CalibrateError`].
pub fn calibrate(
    spec: &Spec,
    records: &[Record],
    evidence: Evidence<'_>,
    settings: Settings,
) -> Result<Calibration, CalibrateError> {
    check(spec, records, settings)?;
    check_parts(records, evidence)?;
    let model = Model::new(spec)?;
    let Settings { fit, reference } = settings;
    let mut tones = None;
    let mut fitted = match evidence {
        Evidence::Tones(frequencies) => {
            let (fitted, found) = tones::fit(&model, records, frequencies, settings)?;
            tones = Some(found);
            fitted
        }
        Evidence::Waveform { samples, spacing } => {
            waveform::fit(&model, &spec.channels, records, waveform::Training { samples, spacing }, settings)?
        }
        Evidence::AnySignal => blind::fit(&model, records, fit, reference)?,
    };
    if tones.is_none() && fit.delay {
        order::check_delays(&model, &fitted.point, reference)?;
    }
    let clipped: Vec<usize> = records.iter().map(|record| record.clipped).collect();
    if clipped.iter().any(|&count| count > 0) {
        fitted.remarks.push(Remark::Clipped { counts: clipped.clone() });
    }
    let (tones, modulus) = tones.map_or((Vec::new(), None), |found| (found.tones, Some(found.modulus)));
    let channels = fitted.channels(&model);
    let Fitted { misfit, frames, remarks, .. } = fitted;
    Ok(Calibration { reference, channels, tones, modulus, frames, clipped, misfit, remarks })
}

/// All records are real, or all are complex and hold tones.
fn check_parts(records: &[Record], evidence: Evidence<'_>) -> Result<(), CalibrateError> {
    let complex = records.iter().filter(|record| record.imaginary.is_some()).count();
    match evidence {
        Evidence::Tones(_) if complex == records.len() => Ok(()),
        Evidence::Tones(tones) if complex == 0 => match tones.iter().find(|tone| tone.0 < 0.0) {
            Some(&tone) => Err(CalibrateError::NegativeTone { tone }),
            None => Ok(()),
        },
        _ if complex == 0 => Ok(()),
        _ => Err(CalibrateError::ComplexSamples { complex, records: records.len() }),
    }
}

fn check(spec: &Spec, records: &[Record], settings: Settings) -> Result<(), CalibrateError> {
    let channels = spec.channels.len();
    if records.len() != channels {
        return Err(CalibrateError::ChannelCount { channels, records: records.len() });
    }
    if channels < 2 {
        return Err(CalibrateError::OneChannel);
    }
    if settings.reference >= channels {
        return Err(CalibrateError::NoSuchReference { reference: settings.reference + 1, channels });
    }
    let Fit { delay, gain, offset, cutoff } = settings.fit;
    if !(delay || gain || offset || cutoff) {
        return Err(CalibrateError::NothingToFit);
    }
    match record::repeated(records) {
        Some((first, second)) => Err(CalibrateError::Repeated { first: first + 1, second: second + 1 }),
        None => Ok(()),
    }
}
