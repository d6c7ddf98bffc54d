//! Delays, gains, offsets and cut-offs from tones in any Nyquist zone of the slow rate.
//!
//! A sine fit with one frequency for all channels gives the complex amplitude a_it of tone t in channel i.
//! With the reference r
//!
//! ```text
//! ln (a_it / a_rt) - ln (nominal ratio) = ln (g_i / nominal) - j w_t (D_i - nominal) + s_it ln c_i
//! ```
//!
//! where s_it is the derivative of ln Phi_i(j w_t / c) by ln c. Real and imaginary part are two equations
//! per tone; least squares over the tones gives the values of the channel, and the errors of the amplitudes
//! their covariance.

mod ambiguity;
mod channel;
mod interference;
mod phasors;
#[cfg(test)]
mod tests;

use super::Settings;
use super::error::CalibrateError;
use super::estimates::{Fitted, Tone};
use super::model::{Model, Point};
use super::order::{Distances, other_order};
use super::record::Record;
use super::warning::Warning;
use crate::linalg::{Complex, Mat};
use crate::sine_fit::{self, Direction, SineFit};
use crate::units::{Decibels, FastPeriods, Hertz};
use ambiguity::{Alias, modulus, nearest_delay, zone_of};
use channel::ChannelFit;
use interference::is_harmonic;
use phasors::{Captures, Measured};

/// Most tones that are looked for, and how far below the largest.
const MOST_TONES: usize = 16;
const TONE_RANGE: Decibels = Decibels(30.0);
/// A given frequency may be off by this share of itself (two clocks) and by this many cycles per record.
const CLOCK_TOLERANCE: f64 = 1e-4;
const SEARCH_CYCLES: f64 = 3.0;
/// Least distance from a multiple of half the slow rate in cycles per record. At half of it the errors of
/// amplitude and phase are already twice those in the middle of a zone.
const LEAST_CYCLES: f64 = 1.0;
/// Tones that a cut-off needs.
const CUTOFF_TONES: usize = 3;
/// A delay farther from nominal than this share of its modulus is doubtful: the next value is three times
/// as far at most.
const DOUBTFUL_SHARE: f64 = 0.25;

/// Calibrates from tones near `given`, or from those that are found.
pub(super) fn fit(
    model: &Model,
    records: &[Record],
    given: &[Hertz],
    settings: Settings,
) -> Result<Fitted, CalibrateError> {
    let (rate, reference) = (model.slow_rate(), settings.reference);
    let captures = Captures::new(records);
    let (channels, frames) = (captures.channels(), captures.frames());
    let mut warnings = Vec::new();
    let (starts, used) = match given {
        [] => found(model, &captures, reference, &mut warnings)?,
        _ => (located(&captures, rate, given)?, (0..given.len()).collect()),
    };
    let sines = sine_fit::fit(&channels, rate, &starts)?;
    let is_image = |&t: &usize| captures.direction(&sines, t) == Direction::Backward;
    if let Some(t) = (0..sines.tones()).find(is_image) {
        return Err(CalibrateError::OtherSign { tone: sines.frequencies[t].value });
    }
    if settings.fit.cutoff && used.len() < CUTOFF_TONES {
        return Err(CalibrateError::TooFewTones { tones: used.len() });
    }
    let mut measured: Vec<Measured> =
        used.iter().map(|&t| captures.measured(model, &sines, t, reference)).collect();
    for (tone, &t) in measured.iter_mut().zip(&used) {
        warnings.extend(interference::warnings(tone, &sines, t, &captures, reference));
    }
    check_order(model, &measured, reference)?;
    let mut fitted = solve(model, &measured, frames, settings, &mut warnings)?;
    if settings.fit.offset {
        add_offsets(&mut fitted, &captures, &sines);
    }
    fitted.warnings.extend(warnings);
    let tone = |&t: &usize| Tone {
        frequency: sines.frequencies[t],
        zone: (2.0 * (sines.frequencies[t].value / rate).abs()).floor() as usize + 1,
        amplitude: captures.tone(&sines, reference, t, Direction::Forward).amplitude,
    };
    fitted.tones = used.iter().map(tone).collect();
    Ok(fitted)
}

/// Adds the offsets of real samples; those of complex ones are only reported.
fn add_offsets(fitted: &mut Fitted, captures: &Captures<'_>, sines: &SineFit) {
    let constants = sines.channels.iter().map(|channel| channel.constant);
    if captures.is_complex {
        let values: Vec<f64> = constants.map(|constant| constant.value).collect();
        let offsets = values.chunks(2).map(<[f64]>::to_vec).collect();
        fitted.warnings.push(Warning::ComplexOffsets { offsets });
    } else {
        fitted.offsets = Some(constants.collect());
    }
}

/// Starts of a fit near given frequencies.
fn located(captures: &Captures<'_>, rate: Hertz, given: &[Hertz]) -> Result<Vec<Hertz>, CalibrateError> {
    let (channels, frames) = (captures.channels(), captures.frames());
    let near = |&tone: &Hertz| {
        check_position(tone, rate, frames)?;
        let within = Hertz(tone.0.abs()) * CLOCK_TOLERANCE + rate * (SEARCH_CYCLES / frames as f64);
        Ok(sine_fit::locate(&channels, rate, tone, within)?)
    };
    given.iter().map(near).collect()
}

/// Refuses a tone at a multiple of half the slow rate.
fn check_position(tone: Hertz, rate: Hertz, frames: usize) -> Result<(), CalibrateError> {
    let cycles = sine_fit::distance_to_edge(tone / rate) * frames as f64;
    if cycles >= LEAST_CYCLES {
        return Ok(());
    }
    Err(CalibrateError::TonePosition { tone, cycles, half: rate * 0.5 })
}

/// The tones in the captures, in their zones, and which of them tell something of the delays.
fn found(
    model: &Model,
    captures: &Captures<'_>,
    reference: usize,
    warnings: &mut Vec<Warning>,
) -> Result<(Vec<Hertz>, Vec<usize>), CalibrateError> {
    let (rate, channels, frames) = (model.slow_rate(), captures.channels(), captures.frames());
    let aliases = sine_fit::find_tones(&channels, rate, MOST_TONES, TONE_RANGE)?;
    let sines = sine_fit::fit(&channels, rate, &aliases)?;
    let directions: Vec<Direction> = (0..sines.tones()).map(|t| captures.direction(&sines, t)).collect();
    let signed = sines.frequencies.iter().zip(&directions);
    let cycles: Vec<f64> = signed.map(|(f, direction)| direction.sign() * (f.value / rate)).collect();
    let is_own = |&k: &usize| !(0..k).any(|j| is_harmonic(cycles[k], cycles[j], frames));
    let used: Vec<usize> = (0..cycles.len()).filter(is_own).collect();
    if used.len() < cycles.len() {
        warnings.push(Warning::HarmonicsLeftOut { count: cycles.len() - used.len() });
    }
    let mut starts: Vec<Hertz> = cycles.iter().map(|&cycles| rate * cycles).collect();
    for &t in &used {
        check_position(starts[t], rate, frames)?;
        let phase = |i| captures.tone(&sines, i, t, directions[t]).phase.value.0;
        let phases: Vec<f64> = (0..model.channels()).map(phase).collect();
        let alias = Alias { cycles: cycles[t], is_complex: captures.is_complex };
        starts[t] = rate * zone_of(model, alias, &phases, reference)?;
    }
    Ok((starts, used))
}

/// Refuses captures whose phases are those of the channels in another order.
fn check_order(model: &Model, tones: &[Measured], reference: usize) -> Result<(), CalibrateError> {
    let rms = |phase: &dyn Fn(&Measured) -> Complex<f64>| {
        let squares: f64 = tones.iter().map(|tone| phase(tone).arg().powi(2)).sum();
        (squares / tones.len() as f64).sqrt()
    };
    let distances = Distances {
        channels: model.channels(),
        between: &|i, j| rms(&|tone| model.nominal(i, tone.w) / model.nominal(j, tone.w)),
        // The phase of capture i is that of channel i times its ratio.
        of_capture: &|i, j, r| {
            rms(&|tone| {
                let nominal = |k| model.nominal(k, tone.w);
                tone.ratios[i] * nominal(i) / nominal(reference) / (nominal(j) / nominal(r))
            })
        },
    };
    other_order(&distances, reference).map_or(Ok(()), |order| Err(CalibrateError::WrongOrder { order }))
}

/// Least squares over the tones, channel by channel.
fn solve(
    model: &Model,
    tones: &[Measured],
    frames: usize,
    settings: Settings,
    warnings: &mut Vec<Warning>,
) -> Result<Fitted, CalibrateError> {
    let Settings { fit, reference } = settings;
    let point = Point::nominal(model, fit, reference);
    let (count, parameters) = (fit.kinds().len(), point.parameters.len());
    let mut fitted = Fitted::new(point, Mat::zeros(parameters, parameters), frames);
    fitted.modulus = modulus(tones);
    let (mut squares, mut freedom, mut values) = (0.0, 0, Vec::new());
    for i in model.others(reference) {
        let delay = nearest_delay(tones, i, model.ratio as f64);
        if let Some(modulus) = fitted.modulus.filter(|_| fit.delay)
            && delay.abs() > DOUBTFUL_SHARE * modulus.0
        {
            warnings.push(Warning::DelayModulo { channel: i + 1, modulus });
        }
        let channel = ChannelFit::new(model, i, fit, tones, delay).solve()?;
        let at = (values.len(), values.len());
        fitted.covariance.view_mut(at, (count, count)).copy_from(&channel.covariance);
        values.extend(channel.values);
        squares += channel.squares;
        freedom += channel.freedom;
    }
    fitted.point.advance(&values);
    if fit.delay && !fit.cutoff {
        warnings.push(Warning::CutoffAssumed { delay: cutoff_effect(model, tones, reference) });
    }
    let misfit = fitted.widen(squares, freedom);
    fitted.warnings.extend(misfit.map(|misfit| Warning::TonesDisagree { misfit }));
    Ok(fitted)
}

/// The largest change of a delay per per cent of cut-off: the mean of Im(s_it) / w_t over the tones.
fn cutoff_effect(model: &Model, tones: &[Measured], reference: usize) -> FastPeriods {
    let of = |i: usize| {
        let sum: f64 = tones.iter().map(|tone| model.cutoff_slope(i, tone.w, 0.0).im / tone.w).sum();
        0.01 * (sum / tones.len() as f64).abs()
    };
    FastPeriods(model.others(reference).map(of).fold(0.0, f64::max))
}
