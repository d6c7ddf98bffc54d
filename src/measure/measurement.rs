//! The figures of a record with tones.

use super::expected::{Expected, Pattern};
use super::lines::{FoundLine, Lines, fit_lines};
use super::record::{Quadrature, RecordParts, UnsettledEnds};
use super::{Cause, MeasureError, RecordSpectrum, Settings, Window};
use crate::runtime::Nonlinearity;
use crate::sine_fit::SineFitError::{AtEdge, NoTone, TonesCoincide};
use crate::sine_fit::{
    CurveFit, CurveKind, Estimate, Sense, SineFit, ToneFit, find_tones, fit, locate, with_lines,
};
use crate::units::{Decibels, Hertz, Radians};

/// A tone that is given may be this far from the true one, in cycles per sample ..
const NEAR_CYCLES: f64 = 1e-3;
/// .. and at least so many cycles per record.
const NEAR_BINS: f64 = 5.0;
/// Parts of a record, each of which a nonlinearity of the others is judged by.
const CURVE_PARTS: usize = 8;

/// The figures of a record. Decibels of a power or an amplitude that is 0 are infinite.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Measurement {
    /// Samples of the record.
    pub samples: usize,
    /// Samples that are not finite, which are left out.
    pub left_out: usize,
    /// Samples at the rails. They take part.
    pub clipped: usize,
    /// fs.
    #[serde(rename = "rate_hertz")]
    pub rate: Hertz,
    /// M; 1 for a single converter.
    pub converters: usize,
    /// X.
    pub full_scale: f64,
    /// The constant part of the record; of complex records that of the real parts.
    pub offset: Estimate<f64>,
    /// The two parts of a complex record; `None` for a real one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quadrature: Option<Quadrature>,
    /// The tones.
    pub tones: Vec<MeasuredTone>,
    /// Signal over everything else but the constant.
    #[serde(rename = "sinad_db")]
    pub sinad: Decibels,
    /// Effective number of bits from SINAD.
    #[serde(rename = "enob_from_sinad")]
    pub enob: f64,
    /// Effective number of bits of a tone of full scale with the same noise and distortion.
    pub enob_full_scale: f64,
    /// Signal over what no line explains.
    #[serde(rename = "snr_db")]
    pub snr: Decibels,
    /// Harmonics 2 .. H over signal.
    #[serde(rename = "thd_db")]
    pub thd: Decibels,
    /// The same without the static nonlinearity of the converters that the record shows: a curve of the
    /// order H for each. `None` for complex records, and where no curve lowers what the tones leave.
    #[serde(rename = "thd_straightened_db", skip_serializing_if = "Option::is_none")]
    pub thd_straightened: Option<Decibels>,
    /// H.
    pub harmonics: usize,
    /// Interleaving spurs over signal; `None` for a single converter.
    #[serde(rename = "interleaving_db")]
    pub interleaving: Option<Decibels>,
    /// Largest tone over largest line or bin.
    #[serde(rename = "sfdr_db")]
    pub sfdr: Decibels,
    /// The same without lines that only interleaving explains; `None` for a single converter.
    #[serde(rename = "sfdr_without_interleaving_db")]
    pub sfdr_without_interleaving: Option<Decibels>,
    /// Noise per hertz relative to a sine of full scale (dBFS/Hz).
    #[serde(rename = "noise_density_dbfs_per_hertz")]
    pub noise_density: Decibels,
    /// The window of the spectrum and its equivalent noise bandwidth.
    pub window: Window,
    /// Bins.
    pub noise_bandwidth_bins: f64,
    /// All expected lines and the unexpected ones, largest first.
    pub spurs: Vec<Spur>,
    /// Spurs that cannot be seen, because they coincide with a tone, with the constant or with half the
    /// rate.
    pub hidden: Vec<Cause>,
    /// The ends of the record, if they hold most of what no line explains.
    pub unsettled_ends: Option<UnsettledEnds>,
    /// The spectrum of the record without its constant.
    #[serde(skip)]
    pub spectrum: RecordSpectrum,
}

impl Measurement {
    /// The largest line of interleaving, also if it is below the noise; `None` for a single converter.
    pub fn worst_interleaving(&self) -> Option<&Spur> {
        self.spurs.iter().find(|spur| spur.causes.first().is_some_and(|cause| cause.is_interleaving()))
    }
}

/// A fitted tone.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct MeasuredTone {
    /// In its own Nyquist zone; in complex records with its sign.
    #[serde(rename = "frequency_hertz")]
    pub frequency: Estimate<Hertz>,
    /// Where the spectrum shows it.
    #[serde(rename = "alias_hertz")]
    pub alias: Hertz,
    /// In units of the samples.
    pub amplitude: Estimate<f64>,
    /// Relative to full scale.
    #[serde(rename = "level_dbfs")]
    pub level: Decibels,
    /// At the first sample.
    #[serde(rename = "phase_radians")]
    pub phase: Estimate<Radians>,
}

/// A line beside the tones.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Spur {
    /// Where the spectrum shows it.
    #[serde(rename = "frequency_hertz")]
    pub frequency: Hertz,
    /// In units of the samples, of the sine with the power of the line: at half the rate, where a line has
    /// no phase, sqrt 2 times its size.
    pub amplitude: f64,
    /// Power relative to the largest tone.
    #[serde(rename = "level_dbc")]
    pub level: Decibels,
    /// True if noise alone would hardly give this amplitude.
    pub above_noise: bool,
    /// Everything that is expected at this frequency.
    pub causes: Vec<Cause>,
}

/// Measures a record of one or several tones.
///
/// # Errors
/// [`MeasureError`], but not those of a comparison.
pub fn measure(samples: &[f64], rate: Hertz, settings: &Settings) -> Result<Measurement, MeasureError> {
    if let Some(tone) = settings.tones.iter().find(|tone| tone.0 <= 0.0) {
        let rule = "give a frequency above 0, for only complex samples tell its sign";
        return Err(MeasureError::Setting { setting: "a tone of a real record", value: tone.0, rule });
    }
    measured(&RecordParts::real(samples), rate, settings)
}

/// Measures a complex record of one or several tones e^{2 pi j f t}, each with the sign of its frequency.
/// The powers of all figures are those of one part, so that equal converters of both parts have the figures
/// that each has alone.
///
/// # Errors
/// [`MeasureError`], but not those of a comparison.
pub fn measure_complex(
    real: &[f64],
    imaginary: &[f64],
    rate: Hertz,
    settings: &Settings,
) -> Result<Measurement, MeasureError> {
    if real.len() != imaginary.len() {
        let (setting, value) = ("the number of imaginary parts", imaginary.len() as f64);
        return Err(MeasureError::Setting { setting, value, rule: "there is one for each real part" });
    }
    measured(&RecordParts::complex(real, imaginary), rate, settings)
}

fn measured(record: &RecordParts<'_>, rate: Hertz, settings: &Settings) -> Result<Measurement, MeasureError> {
    settings.check()?;
    match figures(record, rate, settings) {
        // A peak that is searched for may be a trend, which no sine fits.
        Err(MeasureError::Fit(TonesCoincide { .. } | AtEdge { .. } | NoTone { .. }))
            if settings.tones.is_empty() =>
        {
            Err(MeasureError::Fit(NoTone { near: None, lines: Vec::new() }))
        }
        result => result,
    }
}

fn figures(record: &RecordParts<'_>, rate: Hertz, settings: &Settings) -> Result<Measurement, MeasureError> {
    let tones = fit_tones(record, rate, settings)?;
    let mut found = figures_of(record, &tones, settings)?;
    let again = |record: &RecordParts<'_>| {
        let tones = fit_tones(record, rate, settings)?;
        figures_of(record, &tones, settings)
    };
    // What has not settled leaks into all lines and is none of them.
    if let Some(ends) = found.unsettled_ends
        && let Ok(settled) = again(&record.without_ends(ends.samples))
    {
        (found.sfdr, found.spurs) = (settled.sfdr, settled.spurs);
        found.sfdr_without_interleaving = settled.sfdr_without_interleaving;
    }
    let straight = straightened(record, &tones, settings).and_then(|straight| again(&straight).ok());
    found.thd_straightened = straight.map(|straight| straight.thd);
    Ok(found)
}

/// The record without the nonlinearities that it shows of its converters, if there are any.
fn straightened(
    record: &RecordParts<'_>,
    tones: &SineFit,
    settings: &Settings,
) -> Option<RecordParts<'static>> {
    let Settings { converters, harmonics, full_scale, .. } = *settings;
    let [samples] = record.parts() else { return None };
    let left = tones.residual(0, samples);
    let curve = |converter: usize| {
        let mut fit = CurveFit::new(CurveKind::Order(harmonics));
        let length = samples.len().div_ceil(CURVE_PARTS);
        for first in (0..samples.len()).step_by(length) {
            let part = (first..samples.len().min(first + length)).filter(|n| n % converters == converter);
            let kept = part.filter(|&n| samples[n].is_finite());
            fit.add(kept.map(|n| (samples[n] / full_scale, left[n] / full_scale)));
        }
        fit.curve()
    };
    let curves: Vec<Nonlinearity> = (0..converters).map(curve).collect();
    let straight = |(n, x): (usize, &f64)| x - full_scale * curves[n % converters].at(x / full_scale);
    let is_bent = curves.iter().any(|curve| !curve.is_straight());
    is_bent.then(|| record.map(|_, part| part.iter().enumerate().map(straight).collect()))
}

fn figures_of(
    record: &RecordParts<'_>,
    tones: &SineFit,
    settings: &Settings,
) -> Result<Measurement, MeasureError> {
    let rate = tones.rate;
    let cycles: Vec<f64> = tones.frequencies.iter().map(|f| f.value / rate).collect();
    let pattern = Pattern {
        tones: &cycles,
        is_complex: record.is_complex(),
        converters: settings.converters,
        harmonics: settings.harmonics,
        resolution: 1.0 / record.len() as f64,
    };
    let expected = Expected::of(&pattern);
    let lines = fit_lines(record, tones, &expected, &pattern)?;
    let rest = spectrum(&lines.rest, rate, settings.window);
    Ok(FigureSources { record, pattern: &pattern, tones, lines: &lines, rest, settings }
        .assemble(expected.hidden))
}

/// The tones and, in complex records, their images. The largest tone of a complex record has the sign of its
/// larger exponential.
fn fit_tones(record: &RecordParts<'_>, rate: Hertz, settings: &Settings) -> Result<SineFit, MeasureError> {
    let channels = record.channels();
    let found = fit(&channels, rate, &starts(record, rate, settings)?)
        .map_err(|error| with_lines(error, &channels, rate))?;
    let size = |direction| record.amplitude(&found, 0, direction);
    let is_given = !settings.tones.is_empty() || !record.is_complex();
    if is_given || size(Sense::Forward) >= size(Sense::Backward) {
        return Ok(found);
    }
    Ok(fit(&channels, rate, &[-found.frequencies[0].value])?)
}

/// Frequencies at which the fit begins.
fn starts(record: &RecordParts<'_>, rate: Hertz, settings: &Settings) -> Result<Vec<Hertz>, MeasureError> {
    let channels = record.channels();
    if settings.tones.is_empty() {
        return Ok(find_tones(&channels, rate, 1, Decibels(0.0))?);
    }
    let within = rate * NEAR_CYCLES.max(NEAR_BINS / record.len().max(1) as f64);
    let start = |tone: &Hertz| Ok(locate(&channels, rate, *tone, within)?);
    settings.tones.iter().map(start).collect()
}

fn spectrum(record: &RecordParts<'_>, rate: Hertz, window: Window) -> RecordSpectrum {
    match record.parts() {
        [real, imaginary] => RecordSpectrum::complex(real, imaginary, rate, window),
        parts => RecordSpectrum::new(&parts[0], rate, window),
    }
}

/// What the figures are computed from.
struct FigureSources<'a> {
    record: &'a RecordParts<'a>,
    pattern: &'a Pattern<'a>,
    tones: &'a SineFit,
    lines: &'a Lines,
    /// The spectrum of what is left without lines.
    rest: RecordSpectrum,
    settings: &'a Settings,
}

impl FigureSources<'_> {
    fn assemble(&self, hidden: Vec<Cause>) -> Measurement {
        let Settings { converters, harmonics, full_scale, rails, window, .. } = *self.settings;
        let own = &self.tones.channels[0];
        let signal = self.signal_power();
        let sinad = Decibels::of_power(signal / self.other_power());
        let enob = (sinad.0 - 10.0 * 1.5f64.log10()) / (20.0 * 2f64.log10());
        let is_turned = converters > 1;
        let total = |counts: &dyn Fn(&Cause) -> bool| {
            let counted = self.lines.found.iter().filter(|line| line.causes.first().is_some_and(counts));
            Decibels::of_power(counted.map(|line| 0.5 * line.amplitude.powi(2)).sum::<f64>() / signal)
        };
        Measurement {
            samples: self.record.len(),
            left_out: own.left_out,
            clipped: self.clipped(rails.0, rails.1),
            rate: self.tones.rate,
            converters,
            full_scale,
            offset: own.constant,
            quadrature: self.record.is_complex().then(|| Quadrature::of(self.tones)),
            tones: self.tones(),
            sinad,
            enob,
            enob_full_scale: enob + 0.5 * (0.5 * full_scale * full_scale / signal).log2(),
            snr: Decibels::of_power(signal / self.lines.noise_power),
            thd: total(&|cause| matches!(cause, Cause::Harmonic { .. })),
            thd_straightened: None,
            harmonics,
            interleaving: is_turned.then(|| total(&|cause| cause.is_interleaving())),
            sfdr: self.sfdr(|_| true),
            sfdr_without_interleaving: is_turned
                .then(|| self.sfdr(|line| !line.causes.iter().all(|cause| cause.is_interleaving()))),
            noise_density: self.noise_density(),
            window,
            noise_bandwidth_bins: window.noise_bandwidth(),
            spurs: self.spurs(),
            hidden,
            unsettled_ends: UnsettledEnds::of(&self.lines.rest.size()),
            spectrum: spectrum(&self.completed(), self.tones.rate, window),
        }
    }

    /// Samples with a part at the rails.
    fn clipped(&self, lowest: f64, highest: f64) -> usize {
        let is_clipped = |part: &[f64], n: usize| part[n] <= lowest || part[n] >= highest;
        (0..self.record.len()).filter(|&n| self.record.parts().iter().any(|part| is_clipped(part, n))).count()
    }

    /// The tone k: the sine, or the exponential of a complex record.
    fn tone(&self, k: usize) -> ToneFit {
        self.tones.phasor(self.record.wave(Sense::Forward), k)
    }

    fn amplitudes(&self) -> impl Iterator<Item = f64> {
        (0..self.tones.tones()).map(|k| self.tone(k).amplitude.value)
    }

    /// The mean square of what tones and constant leave; the images of the tones are part of it.
    fn other_power(&self) -> f64 {
        let parts = self.tones.channels.iter().map(|part| part.residual_rms.powi(2));
        let rest = parts.sum::<f64>() / self.tones.channels.len() as f64;
        let image = |k| 0.5 * self.record.amplitude(self.tones, k, Sense::Backward).powi(2);
        let images = (0..self.tones.tones()).filter(|_| self.record.is_complex()).map(image);
        rest + images.sum::<f64>()
    }

    /// Sum of A^2 / 2.
    fn signal_power(&self) -> f64 {
        self.amplitudes().map(|a| 0.5 * a * a).sum()
    }

    fn largest_tone(&self) -> f64 {
        self.amplitudes().fold(0.0, f64::max)
    }

    fn tones(&self) -> Vec<MeasuredTone> {
        let rate = self.tones.rate;
        let tone = |(k, frequency): (usize, &Estimate<Hertz>)| {
            let ToneFit { amplitude, phase } = self.tone(k);
            MeasuredTone {
                frequency: *frequency,
                alias: rate * self.pattern.seen(frequency.value / rate),
                amplitude,
                level: Decibels::of_amplitude(amplitude.value / self.settings.full_scale),
                phase,
            }
        };
        self.tones.frequencies.iter().enumerate().map(tone).collect()
    }

    /// The largest tone over the largest line that counts, or the largest bin of the rest.
    fn sfdr(&self, counts: impl Fn(&FoundLine) -> bool) -> Decibels {
        let (_, floor) = self.rest.largest();
        let counted = self.lines.found.iter().filter(|line| counts(line));
        let largest = counted.fold(floor, |most, line| most.max(line.amplitude));
        Decibels::of_amplitude(self.largest_tone() / largest)
    }

    fn noise_density(&self) -> Decibels {
        let (used, all) = (self.tones.channels[0].used as f64, self.record.len() as f64);
        let power = self.lines.rest.energy() / all;
        // Lines and missing samples took a share of the noise with them.
        let share = if power > 0.0 { self.lines.noise_power / power } else { all / used };
        Decibels::of_power(self.rest.density() * share / (0.5 * self.settings.full_scale.powi(2)))
    }

    fn spurs(&self) -> Vec<Spur> {
        let largest = self.largest_tone();
        let spur = |line: &FoundLine| Spur {
            frequency: line.frequency,
            amplitude: line.amplitude,
            level: Decibels::of_amplitude(line.amplitude / largest),
            above_noise: line.amplitude > self.lines.threshold && line.causes != [Cause::Noise],
            causes: line.causes.clone(),
        };
        let (frequency, amplitude) = self.rest.largest();
        let mut spurs: Vec<Spur> = self.lines.found.iter().map(spur).collect();
        if spurs.iter().all(|spur| spur.amplitude < amplitude) {
            spurs.push(spur(&FoundLine { frequency, amplitude, causes: vec![Cause::Noise] }));
        }
        spurs.sort_by(|a, b| b.amplitude.total_cmp(&a.amplitude));
        spurs
    }

    /// The samples without their constant; the fitted tones where one is missing.
    fn completed(&self) -> RecordParts<'static> {
        self.record.map(|i, part| {
            let offset = self.tones.channels[i].constant.value;
            if part.iter().all(|x| x.is_finite()) {
                return part.iter().map(|x| x - offset).collect();
            }
            let fitted = self.tones.residual(i, &vec![offset; part.len()]);
            let value = |(x, tones): (&f64, &f64)| if x.is_finite() { x - offset } else { -tones };
            part.iter().zip(&fitted).map(value).collect()
        })
    }
}
