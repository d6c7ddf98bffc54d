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
use super::estimates::{Fitted, Tone, contradiction};
use super::fit::{Fit, Kind};
use super::model::{Model, Point};
use super::order::{Distances, other_order};
use super::record::Acquisition;
use super::warning::Warning;
use crate::linalg::{Complex, Mat};
use crate::sine_fit::{self, ChannelFit as SineChannel, Direction, Estimate, alias};
use crate::spec::{Cutoff, Spec};
use crate::units::{Decibels, FastPeriods, Hertz};
use ambiguity::{Alias, modulus, nearest_delay, zone_of};
use channel::{ChannelFit, Solution};
use interference::{is_harmonic, repeating_variances, widen_repeating};
use phasors::{Captures, Measured};
use std::borrow::Cow;

/// What makes the misfit this many times smaller explains it: an acquisition that is left out, or a cut-off
/// that is fitted.
const EXPLAINED: f64 = 4.0;
/// Least acquisitions of which one contradicts the others: of two nobody can tell which one is right.
const OUTLYING_OF: usize = 3;
/// Tones of several acquisitions closer than this share of their frequency are one: they tell nothing of a
/// cut-off together.
const SAME_FREQUENCY: f64 = 1e-2;
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

/// Calibrates from tones near `given`, or from those that are found. Of several acquisitions each holds at
/// least one of the tones.
pub(super) fn fit(
    model: &Model,
    spec: &Spec,
    acquisitions: &[Acquisition<'_>],
    given: &[Hertz],
    settings: Settings,
) -> Result<Fitted, CalibrateError> {
    let layout = spec.layout();
    // Of converters of one rate it is the same model.
    let of_frames = if layout.is_plain() { model.clone() } else { Model::new(&spec.per_sample())? };
    let measure = |one: &Acquisition<'_>| {
        let split = || {
            let records = one.records.iter().zip(layout.samples());
            records.flat_map(|(one, &samples)| one.of_frames(samples)).collect()
        };
        let records = if layout.is_plain() { Cow::Borrowed(one.records) } else { Cow::Owned(split()) };
        let captures = Captures::new(&records, &layout);
        let held = held(model, &captures, given, acquisitions.len() > 1)?;
        Tones::measure(model, &of_frames, &captures, &held, settings.reference)
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
    let mut warnings: Vec<Warning> = Vec::new();
    for warning in all.iter().flat_map(|tones| &tones.warnings) {
        if !warnings.contains(warning) {
            warnings.push(warning.clone());
        }
    }
    let names: Vec<&str> = acquisitions.iter().map(|one| one.name).collect();
    let mut fitted = solve(model, &all, settings, &mut warnings)?;
    if fitted.warnings.iter().any(|warning| matches!(warning, Warning::TonesDisagree { .. })) {
        let outlying = outlying(model, &all, &names, settings);
        let reason =
            if outlying.is_empty() { explained(model, spec, &all, settings, &mut fitted) } else { None };
        fitted.warnings.extend(outlying.into_iter().chain(reason));
    }
    if settings.fit.offset {
        add_offsets(&mut fitted, &all);
    }
    fitted.warnings.extend(warnings);
    fitted.tones = all.into_iter().flat_map(|tones| tones.tones).collect();
    Ok(fitted)
}

/// The tones of one acquisition.
struct Tones {
    frames: usize,
    /// Those of the given ones that it holds.
    given: Vec<Hertz>,
    tones: Vec<Tone>,
    measured: Vec<Measured>,
    /// The constant of each part of each converter.
    constants: Vec<Estimate<f64>>,
    is_complex: bool,
    warnings: Vec<Warning>,
}

impl Tones {
    /// Of tones near `given`, or of those that are found.
    /// `of_frames` is the model of the records, one for each sample of a frame.
    fn measure(
        model: &Model,
        of_frames: &Model,
        captures: &Captures<'_>,
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
        let is_image = |&t: &usize| captures.direction(&sines, t) == Direction::Backward;
        if let Some(t) = (0..sines.tones()).find(is_image) {
            return Err(CalibrateError::OtherSign { tone: sines.frequencies[t].value });
        }
        let measure = |&t: &usize| captures.measured(model, &sines, t, reference);
        let mut measured: Vec<Measured> = used.iter().map(measure).collect();
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
        let tone = |&t: &usize| Tone {
            frequency: sines.frequencies[t],
            zone: (2.0 * (sines.frequencies[t].value / rate).abs()).floor() as usize + 1,
            amplitude: captures.tone(&sines, first, t, Direction::Forward).amplitude,
        };
        Ok(Self {
            frames: captures.frames(),
            given: given.to_vec(),
            tones: used.iter().map(tone).collect(),
            measured,
            constants: captures
                .constants(&sines.channels.iter().zip(repeating).map(constant).collect::<Vec<_>>()),
            is_complex: captures.is_complex,
            warnings,
        })
    }
}

/// The given tones that an acquisition holds: all of them, unless it is one of several. Then those are there
/// whose alias is among the lines.
fn held(
    model: &Model,
    captures: &Captures<'_>,
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

/// Number of different frequencies.
fn distinct<'a>(tones: impl Iterator<Item = &'a Measured>) -> usize {
    let mut all: Vec<f64> = tones.map(|tone| tone.frequency.0).collect();
    all.sort_by(f64::total_cmp);
    all.dedup_by(|a, b| (*a - *b).abs() < SAME_FREQUENCY * b.abs());
    all.len()
}

impl Captures<'_> {
    /// The constant of each part of each converter, from those of the parts of all records.
    fn constants(&self, of_records: &[Estimate<f64>]) -> Vec<Estimate<f64>> {
        let parts = self.parts(0).len();
        let converters = (0..self.converters()).map(|converter| self.parts_of(converter));
        let part = |records: std::ops::Range<usize>, part| {
            mean(records.skip(part).step_by(parts).map(|k| of_records[k]))
        };
        converters.flat_map(|records| (0..parts).map(move |k| part(records.clone(), k))).collect()
    }
}

/// Adds the offsets of real samples, weighted by their variances; those of complex ones are only reported.
fn add_offsets(fitted: &mut Fitted, all: &[Tones]) {
    let parts = all.first().map_or(0, |tones| tones.constants.len());
    let constants: Vec<Estimate<f64>> =
        (0..parts).map(|k| mean(all.iter().map(|tones| tones.constants[k]))).collect();
    if all.iter().all(|tones| tones.is_complex) {
        let values: Vec<f64> = constants.iter().map(|constant| constant.value).collect();
        let offsets = values.chunks(2).map(<[f64]>::to_vec).collect();
        fitted.warnings.push(Warning::ComplexOffsets { offsets });
    } else {
        fitted.offsets = Some(constants);
    }
}

/// The weighted mean of estimates of one value. Where they contradict each other by more than chance, its
/// standard deviation is as much larger.
fn mean(all: impl Iterator<Item = Estimate<f64>> + Clone) -> Estimate<f64> {
    let count = all.clone().count();
    if let (1, Some(one)) = (count, all.clone().next()) {
        return one;
    }
    let weight = |one: &Estimate<f64>| one.sigma.powi(2).max(f64::MIN_POSITIVE).recip();
    let weights: f64 = all.clone().map(|one| weight(&one)).sum();
    let value = all.clone().map(|one| weight(&one) * one.value).sum::<f64>() / weights;
    let squares: f64 = all.map(|one| weight(&one) * (one.value - value).powi(2)).sum();
    let widening = contradiction(squares, count - 1).unwrap_or(1.0);
    Estimate { value, sigma: widening / weights.sqrt() }
}

/// Starts of a fit near given frequencies.
fn located(captures: &Captures<'_>, rate: Hertz, given: &[Hertz]) -> Result<Vec<Hertz>, CalibrateError> {
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

/// Least squares over the tones of all acquisitions, channel by channel.
fn solve(
    model: &Model,
    all: &[Tones],
    settings: Settings,
    warnings: &mut Vec<Warning>,
) -> Result<Fitted, CalibrateError> {
    let Settings { fit, reference } = settings;
    let tones: Vec<&Measured> = all.iter().flat_map(|tones| &tones.measured).collect();
    let frames = all.iter().map(|tones| tones.frames).sum();
    let point = Point::nominal(model, fit, reference);
    let (count, parameters) = (fit.kinds().len(), point.parameters.len());
    let mut fitted = Fitted::new(point, Mat::zeros(parameters, parameters), frames);
    fitted.modulus = modulus(&tones);
    let channels = solve_channels(model, &tones, settings)?;
    for (k, i) in model.others(reference).enumerate() {
        let delay = nearest_delay(&tones, i, model.ratio as f64);
        if let Some(modulus) = fitted.modulus.filter(|_| fit.delay)
            && delay.abs() > DOUBTFUL_SHARE * modulus.0
        {
            warnings.push(Warning::DelayModulo { channel: i + 1, modulus });
        }
        let at = (k * count, k * count);
        fitted.covariance.view_mut(at, (count, count)).copy_from(&channels[k].covariance);
    }
    let values: Vec<f64> = channels.iter().flat_map(|channel| channel.values.iter().copied()).collect();
    fitted.point.advance(&values);
    if fit.delay && fit.cutoff.is_none() {
        warnings.push(Warning::CutoffAssumed { delay: cutoff_effect(model, &tones, reference) });
    }
    let squares = channels.iter().map(|channel| channel.squares).sum();
    let misfit = fitted.widen(squares, channels.iter().map(|channel| channel.freedom).sum());
    fitted.warnings.extend(misfit.map(|misfit| Warning::TonesDisagree { misfit }));
    Ok(fitted)
}

/// The fits of all channels but the reference.
fn solve_channels(
    model: &Model,
    tones: &[&Measured],
    Settings { fit, reference }: Settings,
) -> Result<Vec<Solution>, CalibrateError> {
    let solve = |i| {
        let delay = nearest_delay(tones, i, model.ratio as f64);
        ChannelFit::new(model, i, fit, tones, delay).solve()
    };
    model.others(reference).map(solve).collect()
}

/// Square root of chi squared per degree of freedom of all channels, if there are any.
fn misfit(channels: &[Solution]) -> Option<f64> {
    let squares: f64 = channels.iter().map(|channel| channel.squares).sum();
    let freedom: usize = channels.iter().map(|channel| channel.freedom).sum();
    (freedom > 0).then(|| (squares / freedom as f64).sqrt())
}

/// The acquisitions without which the others agree: the one that explains most of the misfit of all, then
/// among the others as long as at least [`OUTLYING_OF`] are left.
fn outlying(model: &Model, all: &[Tones], names: &[&str], settings: Settings) -> Vec<Warning> {
    // Tones that no longer determine the values tell nothing of their agreement.
    let misfit_of = |list: &[usize]| {
        let tones: Vec<&Measured> = list.iter().flat_map(|&k| &all[k].measured).collect();
        misfit(&solve_channels(model, &tones, settings).ok()?)
    };
    let (mut left, mut warnings): (Vec<usize>, _) = ((0..all.len()).collect(), Vec::new());
    while left.len() >= OUTLYING_OF
        && let Some(misfit) = misfit_of(&left)
    {
        let without = |k: usize| left.iter().copied().filter(|&other| other != k).collect::<Vec<_>>();
        let best = left.iter().filter_map(|&k| Some((k, misfit_of(&without(k))?)));
        let best = best.min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, others)) = best.filter(|(_, others)| misfit > EXPLAINED * others.max(1.0)) else {
            break;
        };
        warnings.push(Warning::Outlying { name: names[k].to_owned(), misfit, others });
        left = without(k);
    }
    warnings
}

/// The part of the front ends whose cut-offs, if they were fitted too, would make the tones agree. The
/// intervals are widened so that they reach to the values of that fit.
fn explained(
    model: &Model,
    spec: &Spec,
    all: &[Tones],
    settings: Settings,
    fitted: &mut Fitted,
) -> Option<Warning> {
    let tones: Vec<&Measured> = all.iter().flat_map(|tones| &tones.measured).collect();
    if distinct(tones.iter().copied()) < CUTOFF_TONES {
        return None;
    }
    let stages = spec.channels.iter().map(|channel| channel.filter.stages().len()).min().unwrap_or(0);
    let parts = (0..stages).filter(|_| stages > 1).map(Cutoff::Stage).chain([Cutoff::Whole]);
    // A part that cannot be fitted explains nothing.
    let candidate = |part: Cutoff| {
        let fit = Fit { cutoff: Some(part), ..settings.fit };
        let channels = solve_channels(&model.scaling(part, spec).ok()?, &tones, Settings { fit, ..settings });
        let channels = channels.ok()?;
        Some((fit, misfit(&channels)?, channels))
    };
    let all = parts.filter(|&part| settings.fit.cutoff != Some(part)).filter_map(candidate);
    let (fit, misfit, channels) = all.min_by(|a, b| a.1.total_cmp(&b.1))?;
    if fitted.misfit? < EXPLAINED * misfit.max(1.0) {
        return None;
    }
    let own = solve_channels(model, &tones, settings).ok()?;
    for ((i, own), other) in model.others(settings.reference).zip(own).zip(channels) {
        for (kind, own) in settings.fit.kinds().into_iter().zip(own.values) {
            let other = fit.kinds().into_iter().zip(&other.values).find(|(other, _)| *other == kind);
            // Factors of different filters do not compare.
            if let Some((_, other)) = other.filter(|_| kind != Kind::Cutoff) {
                fitted.reach(i, kind, other - own);
            }
        }
    }
    Some(Warning::CutoffExplains { fit, misfit })
}

/// The largest change of a delay per per cent of cut-off: the mean of Im(s_it) / w_t over the tones.
fn cutoff_effect(model: &Model, tones: &[&Measured], reference: usize) -> FastPeriods {
    let of = |i: usize| {
        let sum: f64 = tones.iter().map(|tone| model.cutoff_slope(i, tone.w, 0.0).im / tone.w).sum();
        0.01 * (sum / tones.len() as f64).abs()
    };
    FastPeriods(model.others(reference).map(of).fold(0.0, f64::max))
}
