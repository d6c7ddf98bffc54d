//! `hybank measure`: the quality of a recording.

use super::capture_args::{CaptureArgs, check_stdin};
use super::capture_file::{CaptureFile, MOST_MEASURED, ReadingRules};
use super::choice::{Choice, one_of};
use super::plot::{check_picture, write_picture};
use super::print::{Failure, InFile, failed_at, is_dash, name, show, warn};
use super::written::check_output;
use hybank::io::is_same_rate;
use hybank::measure::{
    Cause, Comparison, Imbalance, MeasureWarning, Measurement, Quadrature, RecordSpectrum, Settings, Spur,
    Window, compare,
};
use hybank::messages::Quoted;
use hybank::overview::{DrawnRecording, Figure, causes, column, spur_chart};
use hybank::quantity::{self, readable};
use hybank::units::Hertz;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Measures a recording of a tone: SINAD, ENOB, SNR, THD, SFDR, noise density and spurs with their causes
///
/// The figures come from a least-squares fit of the tone (IEEE 1057 and 1241), so the tone need not lie on a
/// bin of the spectrum. Tones of complex samples have a sign, and their image is a spur (I/Q imbalance).
/// With --ref the recording is compared with another one of the same signal: lag, gain, SNR and error.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank measure capture.wav
  hybank measure capture.wav --interleaved 4 --tone 9.7MHz --plot spectrum.svg
  hybank measure fused.wav --skip 200 --json | jq .sinad_db
  hybank measure fused.wav --ref captures/target.wav")]
pub(super) struct Args {
    /// The recording (WAV, SigMF, .csv, .npy, .mat, or raw with --format); `-` is standard input
    file: PathBuf,
    /// Tones of the recording (9kHz, 1.2GHz, or hertz), in any Nyquist zone, to within 0.1 % of the sample
    /// rate, of complex samples also negative; auto: the largest tone [default: auto, or none with --ref]
    #[arg(long, value_name = "F,..", value_delimiter = ',', value_parser = tone)]
    tone: Vec<ToneArg>,
    /// Number of converters that take turns in the recording: tells which spurs are interleaving spurs
    #[arg(long, value_name = "M", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    interleaved: u16,
    /// Window of the spectrum (SFDR, noise density, plot); SINAD, THD and the spurs need none
    #[arg(long, value_parser = one_of(WINDOWS), default_value = "bh7", hide_short_help = true)]
    window: Window,
    /// Highest order of the harmonics in THD
    #[arg(long, value_name = "H", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=1024), hide_short_help = true)]
    harmonics: u16,
    /// A recording of the same signal to compare with, of the same rate; --format and the other options of
    /// the recording hold for it too, unless its name says its format
    #[arg(long = "ref", value_name = "TARGET")]
    reference: Option<PathBuf>,
    #[command(flatten)]
    reading: CaptureArgs,
    /// Sample rate of a recording that states none (48kHz, 1GS/s, or hertz); of a table in place of its
    /// times
    #[arg(long, value_name = "F", value_parser = rate)]
    rate: Option<Hertz>,
    /// Samples at either end that are not measured, such as those before a filter has settled
    #[arg(long, value_name = "SAMPLES", default_value_t = 0, hide_short_help = true)]
    skip: usize,
    /// Write the spectrum with its spurs, as SVG
    #[arg(long, value_name = "OUT.svg")]
    plot: Option<PathBuf>,
    /// Replace an existing plot
    #[arg(long)]
    force: bool,
    /// Print the figures as one JSON object
    #[arg(long)]
    json: bool,
}

/// A tone on the command line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ToneArg {
    /// The largest one.
    Auto,
    /// The one near a frequency.
    Near(Hertz),
}

fn rate(text: &str) -> Result<Hertz, String> {
    match quantity::rate(text) {
        Ok(rate) if rate.0 > 0.0 => Ok(rate),
        Ok(rate) => Err(format!("the rate is {rate}; give one above 0")),
        Err(error) => Err(error.to_string()),
    }
}

/// Reads `auto` or a frequency other than 0.
pub(super) fn tone(text: &str) -> Result<ToneArg, String> {
    if text.trim() == "auto" {
        return Ok(ToneArg::Auto);
    }
    match quantity::frequency(text) {
        Ok(frequency) if frequency.0 != 0.0 => Ok(ToneArg::Near(frequency)),
        Ok(frequency) => Err(format!("the tone is at {frequency}; give a frequency other than 0, or auto")),
        Err(error) => Err(format!("{error}; or auto")),
    }
}

/// The tones for [`Settings::tones`]: none for the largest one.
pub(super) fn tones(given: &[ToneArg]) -> Result<Vec<Hertz>, Failure> {
    let near = given.iter().filter_map(|tone| match tone {
        ToneArg::Auto => None,
        ToneArg::Near(frequency) => Some(*frequency),
    });
    let tones: Vec<Hertz> = near.collect();
    if !tones.is_empty() && tones.len() < given.len() || given.len() > tones.len() + 1 {
        return Err(Failure::Usage("--tone is `auto` or a list of frequencies, not both".into()));
    }
    Ok(tones)
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let capture = CaptureFile::read(&args.file, args.reading())?.trimmed(&args.file, args.skip)?;
    if capture.channel.imaginary.is_some() && args.reference.is_some() {
        let problem = "complex samples, and --ref compares real ones; extract a part of both recordings";
        return Err(failed_at(&args.file, problem));
    }
    let settings = args.settings()?;
    let is_measured = args.reference.is_none() || !args.tone.is_empty();
    let measurement = is_measured.then(|| capture.channel.measured(capture.rate, &settings));
    let measurement = measurement.transpose().in_file(&args.file)?;
    let reference = args.reference.as_ref().map(|path| args.compared(&capture, path)).transpose()?;
    let warnings = measurement.as_ref().map(warnings).unwrap_or_default();
    let report = MeasureReport { file: name(&args.file), measurement, reference, warnings };
    if let Some(path) = &args.plot {
        let comparison = report.reference.as_ref().map(|of| (of.file.as_str(), &of.comparison));
        let drawn =
            DrawnRecording { label: &report.file, measurement: report.measurement.as_ref(), comparison };
        let chart = spur_chart(drawn, &settings, || spectrum(&capture, settings.window));
        write_picture(path, &chart, args.force)?;
    }
    report.warnings.iter().for_each(|warning| warn(&format!("{}: {warning}", Quoted(&report.file))));
    show(&report, args.json, MeasureReport::text)
}

/// What is not finite counts as 0.
fn spectrum(capture: &CaptureFile, window: Window) -> RecordSpectrum {
    let samples = capture.channel.samples.iter();
    let finite: Vec<f64> = samples.map(|x| if x.is_finite() { *x } else { 0.0 }).collect();
    RecordSpectrum::new(&finite, capture.rate, window)
}

/// What `--window` takes.
const WINDOWS: &[Choice<Window>] = &[
    Choice { name: "none", help: "No window", value: Window::None },
    Choice { name: "hann", help: "Two terms", value: Window::Hann },
    Choice { name: "bh4", help: "Four-term Blackman-Harris, side lobes at -92 dB", value: Window::Bh4 },
    Choice { name: "bh7", help: "Seven-term Blackman-Harris, side lobes at -180 dB", value: Window::Bh7 },
];

impl Args {
    /// Refuses impossible combinations of options, before any file is read.
    fn check(&self) -> Result<(), Failure> {
        self.reading.check(false)?;
        let inputs: Vec<&Path> =
            [Some(&self.file), self.reference.as_ref()].into_iter().flatten().map(PathBuf::as_path).collect();
        if let Some(plot) = &self.plot {
            if is_dash(plot) {
                let message = "the figures go to standard output; write the plot to a file";
                return Err(Failure::Usage(format!("--plot -: {message}")));
            }
            check_picture(plot)?;
            check_output(plot, &inputs, self.force)?;
        }
        check_stdin(inputs.into_iter())
    }

    fn reading(&self) -> ReadingRules {
        let mut options = self.reading.format().options(1, 1);
        options.table.is_rate_known = self.rate.is_some();
        ReadingRules { options, rate: self.rate, most: MOST_MEASURED, takes_complex: true }
    }

    fn settings(&self) -> Result<Settings, Failure> {
        Ok(Settings {
            tones: tones(&self.tone)?,
            converters: self.interleaved.into(),
            harmonics: self.harmonics.into(),
            window: self.window,
            ..Settings::default()
        })
    }

    fn compared(&self, capture: &CaptureFile, path: &Path) -> Result<ReferenceReport, Failure> {
        let mut options = self.reading.of_reference(&self.file, path);
        options.table.is_rate_known = self.rate.is_some();
        let reading = ReadingRules { options, takes_complex: false, ..self.reading() };
        let reference = CaptureFile::read(path, reading)?.trimmed(path, self.skip)?;
        let file = Quoted(name(&self.file));
        let (own, other) = (capture.rate, reference.rate);
        if !is_same_rate(other.0, own.0, 0.0) {
            return Err(failed_at(
                path,
                format!(
                    "the sample rate is {other}, but {file} has {own}; a comparison needs one rate, resample one of them"
                ),
            ));
        }
        let comparison = compare(&capture.channel.samples, &reference.channel.samples, own, self.window);
        let comparison = comparison
            .map_err(|error| Failure::Input(format!("{file} against {}: {error}", Quoted(name(path)))))?;
        Ok(ReferenceReport { file: name(path), comparison })
    }
}

/// Spurs that the text lists.
const MOST_SPURS: usize = 20;

/// What the command found.
#[derive(Debug, serde::Serialize)]
struct MeasureReport {
    file: String,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    measurement: Option<Measurement>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reference: Option<ReferenceReport>,
    warnings: Vec<String>,
}

/// The comparison with a reference.
#[derive(Debug, serde::Serialize)]
struct ReferenceReport {
    file: String,
    #[serde(flatten)]
    comparison: Comparison,
}

/// What the user should know beside the figures.
fn warnings(measured: &Measurement) -> Vec<String> {
    let text = |warning: MeasureWarning| match &warning {
        MeasureWarning::Unsettled(ends) => format!("{warning}; --skip {} leaves them out", ends.samples),
        _ => warning.to_string(),
    };
    measured.warnings().into_iter().map(text).collect()
}

impl MeasureReport {
    fn text(&self) -> String {
        let mut text = String::new();
        if let Some(measured) = &self.measurement {
            write_measurement(&mut text, measured);
        }
        if let Some(reference) = &self.reference {
            write_comparison(&mut text, &reference.file, &reference.comparison);
        }
        text
    }
}

fn write_measurement(text: &mut String, measured: &Measurement) {
    for tone in &measured.tones {
        let _ = writeln!(
            text,
            "tone             {:.6} ± {:.2e} Hz, amplitude {:.6} ({:.2} dBFS)",
            tone.frequency.value.0,
            tone.frequency.half_width().0,
            tone.amplitude.value,
            tone.level.0
        );
        if (tone.alias - tone.frequency.value).0.abs() > 0.5 * measured.rate.0 / measured.samples as f64 {
            let _ = writeln!(text, "                 seen at {:.6}", tone.alias);
        }
    }
    let _ = writeln!(
        text,
        "offset           {} ± {:.2e}",
        six_decimals(measured.offset.value),
        measured.offset.half_width()
    );
    if let Some(quadrature) = &measured.quadrature {
        write_quadrature(text, quadrature);
    }
    for Figure { name, value, unit, meaning } in column(measured) {
        let _ = writeln!(text, "{name:<16} {value:>9} {unit:<7}   {meaning}");
    }
    if let Some(thd) = measured.thd_straightened {
        let meaning = "THD without the nonlinearity that `calibrate --nonlinearity` would take out";
        let _ = writeln!(text, "{:<16} {:>9.2} {:<7}   {meaning}", "THD, straight", thd.0, "dB");
    }
    write_spurs(text, measured);
}

/// Of complex recordings.
fn write_quadrature(text: &mut String, quadrature: &Quadrature) {
    let Quadrature { offset, imbalances } = quadrature;
    let _ = writeln!(text, "offset, imag.    {} ± {:.2e}", six_decimals(offset.value), offset.half_width());
    for Imbalance { gain, phase, image_rejection } in imbalances {
        let _ = writeln!(
            text,
            "I/Q imbalance    gain {:.6} ± {:.1e}, phase {:.4} ± {:.1e} degrees, image rejection {:.2} dB",
            gain.value,
            gain.half_width(),
            phase.value.0.to_degrees(),
            phase.half_width().0.to_degrees(),
            image_rejection.0
        );
    }
}

/// Those above the noise, and the largest bin of the noise where that decides SFDR.
fn write_spurs(text: &mut String, measured: &Measurement) {
    let is_listed = |spur: &&Spur| spur.above_noise || spur.causes == [Cause::Noise];
    let listed: Vec<&Spur> = measured.spurs.iter().filter(is_listed).collect();
    let _ = match listed.iter().any(|spur| spur.above_noise) {
        false => writeln!(text, "no spur above the noise"),
        true => writeln!(text, "\nspurs above the noise (Hz, dBc, cause):"),
    };
    for spur in listed.iter().take(MOST_SPURS) {
        let _ = writeln!(text, "{:>18.3} {:>8.2}   {}", spur.frequency.0, spur.level.0, causes(spur));
    }
    if listed.len() > MOST_SPURS {
        let _ = writeln!(text, "  and {} smaller ones (--json lists all)", listed.len() - MOST_SPURS);
    }
}

/// Six digits after the point; a zero has no sign.
fn six_decimals(value: f64) -> String {
    let text = format!("{value:.6}");
    if text == "-0.000000" { "0.000000".to_owned() } else { text }
}

fn write_comparison(text: &mut String, file: &str, found: &Comparison) {
    let _ = writeln!(
        text,
        "{}against {}, {} samples:",
        if text.is_empty() { "" } else { "\n" },
        Quoted(file),
        found.compared
    );
    if let Some(ends) = &found.unsettled_ends {
        let _ = writeln!(
            text,
            "ends             {} more samples at either end are left out: something has not settled there, and they \
             raise the error by {:.1} dB",
            ends.samples, ends.raise.0
        );
    }
    let _ = writeln!(
        text,
        "lag              {} ± {:.1e} samples ({})",
        six_decimals(found.lag_samples.value),
        found.lag_samples.half_width(),
        readable(found.lag.0 + 0.0, "s")
    );
    let _ = writeln!(text, "gain             {:.8} ± {:.1e}", found.gain.value, found.gain.half_width());
    let _ = writeln!(text, "offset           {:.3e} ± {:.1e}", found.offset.value, found.offset.half_width());
    let _ = writeln!(
        text,
        "SNR              {:.2} dB   reference over error, lag, gain and offset taken out",
        found.snr.0
    );
    let _ = writeln!(
        text,
        "SNR, unaligned   {:.2} dB   sample by sample, nothing taken out",
        found.snr_unaligned.0
    );
    let _ = writeln!(
        text,
        "error            {:.3e} rms, at most {:.3e} (sample {})",
        found.error_rms, found.largest_error, found.largest_error_at
    );
}
