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

mod branch;
mod captured;
mod doubts;
mod least_squares;
#[cfg(test)]
mod tests;
mod zones;

use super::error::CalibrateError;
use super::estimates::Fitted;
use super::measured::{Measured, Modulus, Tone};
use super::model::Model;
use super::order::other_order;
use super::parameters::Point;
use super::record::Record;
use super::remark::Remark;
use super::settings::Settings;
use crate::linalg::{Complex, Mat};
use crate::sine_fit::{self, Channel, Direction, SineFit};
use crate::units::{Decibels, FastPeriods, Hertz};
use captured::Captures;
use least_squares::{Equations, Row};
use std::f64::consts::TAU;
use zones::Alias;

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

/// The tones of a fit.
pub(super) struct Found {
    pub(super) tones: Vec<Tone>,
    pub(super) modulus: Modulus,
}

/// Calibrates from tones near `given`, or from those that are found.
pub(super) fn fit(
    model: &Model,
    records: &[Record],
    given: &[Hertz],
    settings: Settings,
) -> Result<(Fitted, Found), CalibrateError> {
    let rate = model.slow_rate();
    let captures = Captures::new(records);
    let (channels, frames) = (captures.channels(), captures.frames());
    let mut remarks = Vec::new();
    let (starts, used) = match given {
        [] => found(model, &captures, settings.reference, &mut remarks)?,
        _ => (located(&channels, rate, given, frames)?, (0..given.len()).collect()),
    };
    let sines = sine_fit::fit(&channels, rate, &starts)?;
    check_signs(&captures, &sines)?;
    if settings.fit.cutoff && used.len() < CUTOFF_TONES {
        return Err(CalibrateError::TooFewTones { tones: used.len() });
    }
    let mut measured: Vec<Measured> =
        used.iter().map(|&t| measure(model, &captures, &sines, t, settings.reference)).collect();
    for (tone, &t) in measured.iter_mut().zip(&used) {
        remarks.extend(doubts::of_tone(tone, &sines, t, &captures, settings.reference));
    }
    check_order(model, &measured, settings.reference)?;
    let modulus = branch::modulus(&measured);
    let mut fitted = solve(model, &measured, &modulus, settings, &mut remarks)?;
    if settings.fit.offset {
        add_offsets(&mut fitted, &captures, &sines);
    }
    fitted.frames = frames;
    fitted.remarks.extend(remarks);
    let tone = |&t: &usize| Tone {
        frequency: sines.frequencies[t],
        zone: (2.0 * (sines.frequencies[t].value / rate).abs()).floor() as usize + 1,
        amplitude: captures.tone(&sines, settings.reference, t, Direction::Forward).amplitude,
    };
    Ok((fitted, Found { tones: used.iter().map(tone).collect(), modulus }))
}

/// Adds the offsets of real samples; those of complex ones are only reported.
fn add_offsets(fitted: &mut Fitted, captures: &Captures<'_>, sines: &SineFit) {
    if captures.is_complex {
        let values = |i| captures.constants(sines, i).map(|constant| constant.value).collect();
        let offsets = (0..captures.records()).map(values).collect();
        fitted.remarks.push(Remark::ComplexOffsets { offsets });
    } else {
        let constants = sines.channels.iter().map(|c| (c.constant.value, c.constant.sigma));
        fitted.offsets = Some(constants.collect());
    }
}

/// Starts of a fit near given frequencies.
fn located(
    channels: &[Channel<'_>],
    rate: Hertz,
    given: &[Hertz],
    frames: usize,
) -> Result<Vec<Hertz>, CalibrateError> {
    let near = |&tone: &Hertz| {
        check_position(tone, rate, frames)?;
        let within = Hertz(tone.0.abs()) * CLOCK_TOLERANCE + rate * (SEARCH_CYCLES / frames as f64);
        Ok(sine_fit::locate(channels, rate, tone, within)?)
    };
    given.iter().map(near).collect()
}

/// Refuses tones of complex samples whose images are larger.
fn check_signs(captures: &Captures<'_>, sines: &SineFit) -> Result<(), CalibrateError> {
    let is_image = |&t: &usize| captures.direction(sines, t) == Direction::Backward;
    match (0..sines.tones()).find(is_image) {
        Some(t) => Err(CalibrateError::OtherSign { tone: sines.frequencies[t].value }),
        None => Ok(()),
    }
}

/// Refuses a tone at a multiple of half the slow rate.
fn check_position(tone: Hertz, rate: Hertz, frames: usize) -> Result<(), CalibrateError> {
    let halves = 2.0 * (tone / rate);
    let cycles = 0.5 * (halves - halves.round()).abs() * frames as f64;
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
    remarks: &mut Vec<Remark>,
) -> Result<(Vec<Hertz>, Vec<usize>), CalibrateError> {
    let (rate, channels, frames) = (model.slow_rate(), captures.channels(), captures.frames());
    let aliases = sine_fit::find_tones(&channels, rate, MOST_TONES, TONE_RANGE)?;
    let sines = sine_fit::fit(&channels, rate, &aliases)?;
    let directions: Vec<Direction> = (0..sines.tones()).map(|t| captures.direction(&sines, t)).collect();
    let signed = sines.frequencies.iter().zip(&directions);
    let cycles: Vec<f64> = signed.map(|(f, direction)| direction.sign() * (f.value / rate)).collect();
    let is_own = |&k: &usize| !(0..k).any(|j| doubts::is_harmonic(cycles[k], cycles[j], frames));
    let used: Vec<usize> = (0..cycles.len()).filter(is_own).collect();
    if used.len() < cycles.len() {
        remarks.push(Remark::HarmonicsLeftOut { count: cycles.len() - used.len() });
    }
    let mut starts: Vec<Hertz> = cycles.iter().map(|&cycles| rate * cycles).collect();
    for &t in &used {
        check_position(starts[t], rate, frames)?;
        let phase = |i| captures.tone(&sines, i, t, directions[t]).phase.value.0;
        let phases: Vec<f64> = (0..model.channels()).map(phase).collect();
        let alias = Alias { cycles: cycles[t], is_complex: captures.is_complex };
        starts[t] = rate * zones::resolve(model, alias, &phases, reference)?;
    }
    Ok((starts, used))
}

/// The ratios of one tone and their errors.
fn measure(model: &Model, captures: &Captures<'_>, sines: &SineFit, t: usize, reference: usize) -> Measured {
    let frequency = sines.frequencies[t].value;
    let w = TAU * frequency.per_fast_period(model.fast_period).0.abs();
    let amplitude = |i: usize| captures.amplitude(sines, i, t);
    let expected = |i: usize| model.nominal(i, w) / model.nominal(reference, w);
    let ratio = |i: usize| amplitude(i) / amplitude(reference) / expected(i);
    Measured {
        w,
        cycles: frequency / sines.rate,
        frequency,
        ratios: (0..model.channels()).map(ratio).collect(),
        sigmas: (0..model.channels()).map(|i| captures.sigmas(sines, i, reference, t)).collect(),
    }
}

/// Refuses captures whose phases are those of the channels in another order.
fn check_order(model: &Model, tones: &[Measured], reference: usize) -> Result<(), CalibrateError> {
    let rms = |phase: &dyn Fn(&Measured) -> Complex<f64>| {
        let squares: f64 = tones.iter().map(|tone| phase(tone).arg().powi(2)).sum();
        (squares / tones.len() as f64).sqrt()
    };
    // The phase of capture i is that of channel i times its ratio.
    let distance = |i: usize, j: usize, r: usize| {
        rms(&|tone| {
            let nominal = |k| model.nominal(k, tone.w);
            tone.ratios[i] * nominal(i) / nominal(reference) / (nominal(j) / nominal(r))
        })
    };
    let n = model.channels();
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let apart = |(i, j)| rms(&|tone| model.nominal(i, tone.w) / model.nominal(j, tone.w));
    let spacing = pairs.map(apart).fold(f64::INFINITY, f64::min);
    match other_order(n, reference, spacing, distance) {
        Some(order) => Err(CalibrateError::WrongOrder { order: order.into_iter().map(|j| j + 1).collect() }),
        None => Ok(()),
    }
}

/// Least squares over the tones, channel by channel.
fn solve(
    model: &Model,
    tones: &[Measured],
    modulus: &Modulus,
    settings: Settings,
    remarks: &mut Vec<Remark>,
) -> Result<Fitted, CalibrateError> {
    let Settings { fit, reference } = settings;
    let mut point = Point::nominal(model, fit, reference);
    let kinds = fit.kinds();
    let parameters = point.parameters.len();
    let mut covariance = Mat::zeros(parameters, parameters);
    let (mut squares, mut freedom) = (0.0, 0);
    let others = (0..model.channels()).filter(|&i| i != reference);
    for (number, i) in others.enumerate() {
        let nearest = branch::nearest(tones, i, model.ratio as f64);
        doubt_branch(i, nearest, modulus, settings, remarks);
        let row = |tone: &Measured| {
            let ratio = tone.ratios[i];
            let turned = ratio * Complex::from_polar(1.0, tone.w * nearest);
            let phase = turned.arg() - tone.w * nearest;
            Row { w: tone.w, magnitude: ratio.norm().ln(), phase, sigmas: tone.sigmas[i] }
        };
        let equations = Equations { channel: i, rows: tones.iter().map(row).collect(), fit };
        let solution = equations.solve(model)?;
        let first = number * kinds.len();
        covariance.view_mut((first, first), (kinds.len(), kinds.len())).copy_from(&solution.covariance);
        let before = vec![0.0; first];
        point.advance(before.into_iter().chain(solution.values.iter().copied()));
        squares += solution.squares;
        freedom += solution.freedom;
    }
    if fit.delay && !fit.cutoff {
        remarks.push(Remark::CutoffAssumed { delay: cutoff_effect(model, tones, reference) });
    }
    let mut fitted = Fitted::new(point, covariance);
    if let Some(misfit) = fitted.widen(squares, freedom) {
        fitted.remarks.push(Remark::TonesDisagree { misfit });
    }
    Ok(fitted)
}

/// Notes a delay whose next value is nearly as close to nominal.
fn doubt_branch(i: usize, delay: f64, modulus: &Modulus, settings: Settings, remarks: &mut Vec<Remark>) {
    if let Modulus(Some(modulus)) = *modulus
        && settings.fit.delay
        && delay.abs() > 0.25 * modulus.0
    {
        remarks.push(Remark::DelayModulo { channel: i + 1, modulus });
    }
}

/// The largest change of a delay per per cent of cut-off: the mean of Im(s_it) / w_t over the tones.
fn cutoff_effect(model: &Model, tones: &[Measured], reference: usize) -> FastPeriods {
    let of = |i: usize| {
        let sum: f64 = tones.iter().map(|tone| model.cutoff_slope(i, tone.w, 0.0).im / tone.w).sum();
        0.01 * (sum / tones.len() as f64).abs()
    };
    let others = (0..model.channels()).filter(|&i| i != reference);
    FastPeriods(others.map(of).fold(0.0, f64::max))
}
