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
//! per tone; least squares over the tones gives the values of all channels, and the errors of the amplitudes
//! their covariance. Jitter errs along the slope of the tones and not as white noise does, which the
//! covariance takes into account.

mod ambiguity;
mod interference;
mod phasors;
mod ratios;
mod solution;

use super::CalibrationSettings;
use super::error::CalibrateError;
use super::estimates::{CalibrationTone, Fitted, pooled};
use super::model::ChannelModel;
use super::order::{Distances, other_order};
use super::record::Acquisition;
use super::warning::CalibrationWarning;
use crate::linalg::Complex;
use crate::runtime::Nonlinearity;
use crate::sine_fit::{
    self, ChannelFit as SineChannel, CurveFit, CurveKind, Estimate, Sense, SineFit, alias,
};
use crate::spec::Spec;
use crate::units::{Decibels, Hertz};
use ambiguity::{ObservedTone, zone_of};
use interference::{is_harmonic, jitter, repeating_variances, widen_repeating};
use phasors::{TonePhasors, ToneRecords};
use solution::{CUTOFF_TONES, distinct, explained, outlying, solve};

/// Most tones that are looked for, and how far below the largest.
const MOST_TONES: usize = 16;
const TONE_RANGE: Decibels = Decibels(30.0);
/// A given frequency may be off by this share of itself (two clocks) and by this many cycles per record.
const CLOCK_TOLERANCE: f64 = 1e-4;
const SEARCH_CYCLES: f64 = 3.0;
/// Least distance from a multiple of half the slow rate in cycles per record. At half of it the errors of
/// amplitude and phase are already twice those in the middle of a zone.
const LEAST_CYCLES: f64 = 1.0;
/// Parts of a single acquisition, each of which a nonlinearity of the others is judged by.
const PARTS: usize = 8;

/// Calibrates from tones near `given`, or from those that are found. Of several acquisitions each holds at
/// least one of the tones.
pub(super) fn fit(
    model: &ChannelModel,
    spec: &Spec,
    acquisitions: &[Acquisition<'_>],
    given: &[Hertz],
    settings: CalibrationSettings,
) -> Result<Fitted, CalibrateError> {
    let layout = spec.layout();
    // Of converters of one rate it is the same model.
    let of_frames = if layout.is_plain() { model.clone() } else { ChannelModel::new(&spec.per_sample())? };
    let measure = |one: &Acquisition<'_>| -> Result<Tones, CalibrateError> {
        let captures = ToneRecords::new(one.records, &layout);
        let held = held(model, &captures, given, acquisitions.len() > 1)?;
        let mut tones = Tones::measure(model, &of_frames, &captures, &held, settings.reference)?;
        if let Some(kind) = settings.fit.nonlinearity {
            let parts = if acquisitions.len() == 1 { PARTS } else { 1 };
            tones.curves = captures.curves(&tones.sines, kind, parts);
        }
        Ok(tones)
    };
    let count = acquisitions.len();
    let measure = |one: &Acquisition<'_>| measure(one).map_err(|error| error.within(one.name, count));
    let all: Vec<Tones> = acquisitions.iter().map(measure).collect::<Result<_, _>>()?;
    let is_held = |tone: &Hertz| all.iter().any(|tones| tones.given.contains(tone));
    if let Some(&tone) = given.iter().find(|tone| !is_held(tone)) {
        return Err(CalibrateError::ToneNowhere { tone, acquisitions: count });
    }
    let distinct = distinct(all.iter().flat_map(|tones| &tones.measured));
    if settings.fit.cutoff.is_some() && distinct < CUTOFF_TONES {
        return Err(CalibrateError::TooFewTones { tones: distinct });
    }
    let mut warnings: Vec<CalibrationWarning> = Vec::new();
    for warning in all.iter().flat_map(|tones| &tones.warnings) {
        if !warnings.contains(warning) {
            warnings.push(warning.clone());
        }
    }
    let names: Vec<&str> = acquisitions.iter().map(|one| one.name).collect();
    let mut fitted = solve(model, &all, settings, &mut warnings)?;
    if fitted.warnings.iter().any(|warning| matches!(warning, CalibrationWarning::TonesDisagree { .. })) {
        let outlying = outlying(model, &all, &names, settings);
        let reason =
            if outlying.is_empty() { explained(model, spec, &all, settings, &mut fitted) } else { None };
        fitted.warnings.extend(outlying.into_iter().chain(reason));
    }
    if settings.fit.offset {
        add_offsets(&mut fitted, &all);
    }
    fitted.warnings.extend(warnings);
    fitted.curves = (0..model.channels()).filter_map(|i| curve(&all, i)).collect();
    fitted.tones = all.into_iter().flat_map(|tones| tones.tones).collect();
    Ok(fitted)
}

/// The tones of one acquisition.
struct Tones {
    frames: usize,
    /// Those of the given ones that it holds.
    given: Vec<Hertz>,
    tones: Vec<CalibrationTone>,
    measured: Vec<TonePhasors>,
    /// The variance of the mean instant of each converter that is due to jitter, fast periods squared.
    jitter: Vec<f64>,
    /// What the tones leave of the samples of each converter, in parts; none unless it was asked for.
    curves: Vec<CurveFit>,
    /// The constant of each part of each converter.
    constants: Vec<Estimate<f64>>,
    is_complex: bool,
    warnings: Vec<CalibrationWarning>,
    sines: SineFit,
}

impl Tones {
    /// Of tones near `given`, or of those that are found.
    /// `of_frames` is the model of the records, one for each sample of a frame.
    fn measure(
        model: &ChannelModel,
        of_frames: &ChannelModel,
        captures: &ToneRecords<'_>,
        given: &[Hertz],
        reference: usize,
    ) -> Result<Self, CalibrateError> {
        let rate = model.slow_rate();
        let first = captures.records_of(reference).start;
        let channels = captures.channels();
        let mut warnings = Vec::new();
        let (starts, used) = match given {
            [] => found(of_frames, captures, first, &mut warnings)?,
            _ => (located(captures, rate, given)?, (0..given.len()).collect()),
        };
        let sines = sine_fit::fit(&channels, rate, &starts)?;
        let is_image = |&t: &usize| captures.direction(&sines, t) == Sense::Backward;
        if let Some(t) = (0..sines.tones()).find(is_image) {
            return Err(CalibrateError::OtherSign { tone: sines.frequencies[t].value });
        }
        let measure = |&t: &usize| captures.measured(model, &sines, t, reference);
        let mut measured: Vec<TonePhasors> = used.iter().map(measure).collect();
        let repeating = repeating_variances(&sines, captures);
        for (tone, &t) in measured.iter_mut().zip(&used) {
            warnings.extend(interference::warnings(tone, captures.frames()));
            widen_repeating(tone, t, &sines, captures, reference, &repeating);
        }
        check_order(model, &measured, reference)?;
        let constant = |(channel, repeating): (&SineChannel, f64)| {
            let Estimate { value, sigma } = channel.constant;
            Estimate { value, sigma: sigma.hypot(repeating.sqrt()) }
        };
        let tone = |&t: &usize| CalibrationTone {
            frequency: sines.frequencies[t],
            zone: (2.0 * (sines.frequencies[t].value / rate).abs()).floor() as usize + 1,
            amplitude: captures.tone(&sines, first, t, Sense::Forward).amplitude,
        };
        Ok(Self {
            frames: captures.frames(),
            given: given.to_vec(),
            tones: used.iter().map(tone).collect(),
            measured,
            jitter: jitter(&sines, captures, model.ratio),
            curves: Vec::new(),
            constants: captures
                .constants(&sines.channels.iter().zip(repeating).map(constant).collect::<Vec<_>>()),
            is_complex: captures.is_complex,
            warnings,
            sines,
        })
    }
}

/// The given tones that an acquisition holds: all of them, unless it is one of several. Then those are there
/// whose alias is among the lines.
fn held(
    model: &ChannelModel,
    captures: &ToneRecords<'_>,
    given: &[Hertz],
    is_one_of_several: bool,
) -> Result<Vec<Hertz>, CalibrateError> {
    if !is_one_of_several || given.is_empty() {
        return Ok(given.to_vec());
    }
    let rate = model.slow_rate();
    let lines = sine_fit::find_tones(&captures.channels(), rate, MOST_TONES, TONE_RANGE)?;
    let apart = |tone: Hertz, line: Hertz| match captures.is_complex {
        true => ((tone - line) / rate - ((tone - line) / rate).round()).abs(),
        false => (alias(tone / rate).abs() - alias(line / rate).abs()).abs(),
    };
    let is_held = |tone: &Hertz| {
        let within = search(*tone, rate, captures.frames()) / rate;
        lines.iter().any(|&line| apart(*tone, line) <= within)
    };
    let held: Vec<Hertz> = given.iter().copied().filter(is_held).collect();
    if held.is_empty() { Err(CalibrateError::NoneOfTheTones { lines }) } else { Ok(held) }
}

impl ToneRecords<'_> {
    /// The constant of each part of each converter, from those of the parts of all records.
    fn constants(&self, of_records: &[Estimate<f64>]) -> Vec<Estimate<f64>> {
        let parts = self.parts(0).len();
        let converters = (0..self.converters()).map(|converter| self.parts_of(converter));
        let part = |records: std::ops::Range<usize>, part| {
            pooled(records.skip(part).step_by(parts).map(|k| of_records[k]))
        };
        converters.flat_map(|records| (0..parts).map(move |k| part(records.clone(), k))).collect()
    }
}

/// The nonlinearity of a converter from all acquisitions, if it was asked for.
fn curve(all: &[Tones], converter: usize) -> Option<Nonlinearity> {
    let mut fits = all.iter().map(|tones| tones.curves.get(converter));
    let mut sum = fits.next()??.clone();
    fits.flatten().for_each(|fit| sum.join(fit));
    Some(sum.curve())
}

impl ToneRecords<'_> {
    /// The equations of the nonlinearity of each converter, its records cut into so many parts.
    fn curves(&self, sines: &SineFit, kind: CurveKind, parts: usize) -> Vec<CurveFit> {
        let of_converter = |converter: usize| {
            let mut fit = CurveFit::new(kind);
            for (part, i) in self.records_of(converter).flat_map(|i| self.parts(i).map(move |part| (part, i)))
            {
                let record = &self.records[i];
                let samples = record.parts().nth(part - self.parts(i).start).unwrap_or_default();
                let left = sines.residual(part, samples);
                let all: Vec<(f64, f64, bool)> =
                    samples.iter().zip(left).zip(&record.keep).map(|((x, r), keep)| (*x, r, *keep)).collect();
                for piece in all.chunks(all.len().div_ceil(parts).max(1)) {
                    fit.add(piece.iter().filter(|(_, _, keep)| *keep).map(|(x, r, _)| (*x, *r)));
                }
            }
            fit
        };
        (0..self.converters()).map(of_converter).collect()
    }
}

/// Adds the offsets of real samples, weighted by their variances; those of complex ones are only reported.
fn add_offsets(fitted: &mut Fitted, all: &[Tones]) {
    let parts = all.first().map_or(0, |tones| tones.constants.len());
    let constants: Vec<Estimate<f64>> =
        (0..parts).map(|k| pooled(all.iter().map(|tones| tones.constants[k]))).collect();
    if all.iter().all(|tones| tones.is_complex) {
        let values: Vec<f64> = constants.iter().map(|constant| constant.value).collect();
        let offsets = values.chunks(2).map(<[f64]>::to_vec).collect();
        fitted.warnings.push(CalibrationWarning::ComplexOffsets { offsets });
    } else {
        fitted.offsets = Some(constants);
    }
}

/// Starts of a fit near given frequencies.
fn located(captures: &ToneRecords<'_>, rate: Hertz, given: &[Hertz]) -> Result<Vec<Hertz>, CalibrateError> {
    let (channels, frames) = (captures.channels(), captures.frames());
    let near = |&tone: &Hertz| {
        check_position(tone, rate, frames)?;
        Ok(sine_fit::locate(&channels, rate, tone, search(tone, rate, frames))?)
    };
    given.iter().map(near).collect()
}

/// How far a tone may be from the frequency given.
fn search(tone: Hertz, rate: Hertz, frames: usize) -> Hertz {
    Hertz(tone.0.abs()) * CLOCK_TOLERANCE + rate * (SEARCH_CYCLES / frames as f64)
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
    model: &ChannelModel,
    captures: &ToneRecords<'_>,
    reference: usize,
    warnings: &mut Vec<CalibrationWarning>,
) -> Result<(Vec<Hertz>, Vec<usize>), CalibrateError> {
    let (rate, channels, frames) = (model.slow_rate(), captures.channels(), captures.frames());
    let aliases = sine_fit::find_tones(&channels, rate, MOST_TONES, TONE_RANGE)?;
    if aliases.len() == MOST_TONES {
        warnings.push(CalibrationWarning::MoreTones { most: MOST_TONES });
    }
    let sines = sine_fit::fit(&channels, rate, &aliases)?;
    let directions: Vec<Sense> = (0..sines.tones()).map(|t| captures.direction(&sines, t)).collect();
    let signed = sines.frequencies.iter().zip(&directions);
    let cycles: Vec<f64> = signed.map(|(f, direction)| direction.sign() * (f.value / rate)).collect();
    let is_own = |&k: &usize| !(0..k).any(|j| is_harmonic(cycles[k], cycles[j], frames));
    let used: Vec<usize> = (0..cycles.len()).filter(is_own).collect();
    if used.len() < cycles.len() {
        warnings.push(CalibrationWarning::HarmonicsLeftOut { count: cycles.len() - used.len() });
    }
    let mut starts: Vec<Hertz> = cycles.iter().map(|&cycles| rate * cycles).collect();
    for &t in &used {
        check_position(starts[t], rate, frames)?;
        let phase = |i| captures.tone(&sines, i, t, directions[t]).phase.value.0;
        let phases: Vec<f64> = (0..model.channels()).map(phase).collect();
        let alias = ObservedTone { cycles: cycles[t], is_complex: captures.is_complex };
        starts[t] = rate * zone_of(model, alias, &phases, reference)?;
    }
    Ok((starts, used))
}

/// Refuses captures whose phases are those of the channels in another order.
fn check_order(model: &ChannelModel, tones: &[TonePhasors], reference: usize) -> Result<(), CalibrateError> {
    let rms = |phase: &dyn Fn(&TonePhasors) -> Complex<f64>| {
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

#[cfg(test)]
mod tests;
