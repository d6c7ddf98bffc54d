//! `hybank calibrate`: delays, gains, offsets and cut-offs of the channels from captures.

mod captures;
mod report;

use super::Failure;
use super::bank_file::{is_dash, parse_spec, read_kind, write_text};
use super::capture_args::CaptureArgs;
use super::capture_file::{CaptureFile, MOST_MEASURED, Reading as FileReading};
use super::file_kind::FileKind;
use super::say::name_leftovers;
use super::say::say_understood;
use super::turns::TurnArgs;
use crate::calibrate::{Calibration, Evidence, Fit, Record, Settings, applied, calibrate};
use crate::files;
use crate::quantity;
use crate::spec::{DesignOverrides, Spec};
use crate::units::{FastPeriods, Hertz};
use captures::Reading;
use report::Report;
use std::path::{Path, PathBuf};

/// Measures delay, gain and offset of each channel from captures, with 95 % intervals
///
/// Fits what the captures say of the channels, relative to a reference channel, and writes the spec with
/// these values and an [uncertainty] table with the half-widths of their intervals. Everything else of the
/// spec is kept.
///
/// The captures hold sine tones (--tone, the default), a waveform that is known (--training), or any signal
/// that leaves fewer aliases occupied than there are channels (--blind). Complex captures hold tones.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank calibrate spec.toml tone1.wav tone2.wav -o measured.toml --tone 1.2kHz
  hybank calibrate spec.toml tones1.wav tones2.wav -o measured.toml --tone 1kHz,5kHz,9kHz \\
      --fit delay,gain,offset,cutoff
  hybank calibrate spec.toml adc.wav --interleaved 4 -o measured.toml --check other.wav
  hybank calibrate spec.toml ch1.wav ch2.wav -o measured.toml --training chirp.wav
  hybank calibrate spec.toml ch1.wav ch2.wav -o measured.toml --blind

A tone may lie in any Nyquist zone of the slow rate. `auto` finds tones below half the fast rate and
takes their zones from the delays of the spec.")]
pub(super) struct Args {
    /// The spec (TOML) with the nominal values; `-` is standard input
    spec: PathBuf,
    /// One mono recording per channel (WAV, SigMF, .csv, .npy, .mat, or raw with --format), in the order of
    /// the spec, or one of N channels
    #[arg(required = true)]
    captures: Vec<PathBuf>,
    /// The calibrated spec; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Frequencies of tones (Hz, kHz, MHz, GHz; hertz if left out) to about 100 ppm, or auto; of complex
    /// samples also negative
    #[arg(long, value_name = "F,..|auto", conflicts_with_all = ["training", "blind"], allow_hyphen_values = true)]
    tone: Option<String>,
    /// A mono recording of the waveform that was played
    #[arg(long, value_name = "WAV", conflicts_with = "blind")]
    training: Option<PathBuf>,
    /// Use whatever signal the captures hold
    #[arg(long)]
    blind: bool,
    /// The channel to which the others are relative, from 1 [default: that of the spec's uncertainty table,
    /// or 1]
    #[arg(long, value_name = "I")]
    reference: Option<usize>,
    /// What to fit; the rest keeps the values of the spec
    #[arg(long, value_enum, value_delimiter = ',', default_value = "delay,gain,offset")]
    fit: Vec<Value>,
    /// Captures of the same converters to check the calibrated spec with, of the same kind of signal
    #[arg(long, value_name = "HOLDOUT", num_args = 1..)]
    check: Vec<PathBuf>,
    #[command(flatten)]
    reading: CaptureArgs,
    #[command(flatten)]
    turns: TurnArgs,
    /// Samples of this size and more are clipped and left out [default: the ends of integer formats, 1 for
    /// floats none of which is beyond]
    #[arg(long, value_name = "LEVEL")]
    clip: Option<f64>,
    /// Replace an existing output
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

/// A value of a channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Value {
    /// Delays
    Delay,
    /// Gains
    Gain,
    /// Offsets
    Offset,
    /// Cut-off frequencies of the front ends
    Cutoff,
}

/// The kind of evidence with its data in memory.
enum Signal {
    Tones(Vec<Hertz>),
    Waveform { samples: Vec<f64>, spacing: FastPeriods },
    Any,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check_usage()?;
    let text = read_kind(&args.spec, FileKind::Spec)?;
    let spec = parse(&args.spec, &text)?;
    say_understood(Some(&spec));
    let settings = args.settings(&spec)?;
    let signal = args.signal(&spec)?;
    let turns = args.turns.by_delay(&spec.delays_in_fast_periods(), spec.ratio, &args.spec)?;
    let reading = Reading { captures: args.reading, turns: turns.as_ref(), clip: args.clip };
    let (records, mut warnings) = captures::read(&args.captures, &spec, reading)?;
    let found = run_on(&spec, &records, &signal, settings)?;
    let (calibrated, remarks) = applied(&spec, &found);
    let mut report = Report::new(&spec, &found);
    report.remark(&remarks);
    if !args.check.is_empty() {
        let (records, tolerated) = captures::read(&args.check, &spec, reading)?;
        warnings.extend(tolerated);
        let held_out = match &signal {
            // Held-out tones have other frequencies.
            Signal::Tones(_) => Signal::Tones(Vec::new()),
            Signal::Waveform { samples, spacing } => {
                Signal::Waveform { samples: samples.clone(), spacing: *spacing }
            }
            Signal::Any => Signal::Any,
        };
        let checked = run_on(&calibrated, &records, &held_out, settings)
            .map_err(|failure| prefixed("the held-out captures", failure))?;
        report.check(&calibrated, &found, &checked);
    }
    report.warnings.splice(0..0, warnings);
    let written = calibrated.to_toml_like(&text).map_err(|problem| {
        Failure::Input(format!("the values found make no spec: {problem}; nothing was written"))
    })?;
    write_text(&args.output, &written, args.force)?;
    report.print(&args.output, args.json)
}

fn parse(path: &Path, text: &str) -> Result<Spec, Failure> {
    parse_spec(text, path, DesignOverrides::default())
}

fn run_on(
    spec: &Spec,
    records: &[Record],
    signal: &Signal,
    settings: Settings,
) -> Result<Calibration, Failure> {
    let evidence = match signal {
        Signal::Tones(list) => Evidence::Tones(list),
        Signal::Waveform { samples, spacing } => Evidence::Waveform { samples, spacing: *spacing },
        Signal::Any => Evidence::AnySignal,
    };
    calibrate(spec, records, evidence, settings).map_err(Failure::input)
}

fn prefixed(what: &str, failure: Failure) -> Failure {
    match failure {
        Failure::Input(message) => Failure::Input(format!("{what}: {message}")),
        other => other,
    }
}

impl Args {
    /// Refuses impossible combinations of options, before any file is read.
    fn check_usage(&self) -> Result<(), Failure> {
        self.turns.check(self.captures.len())?;
        self.reading.check(self.turns.is_given())?;
        if !self.check.is_empty() {
            self.turns.check(self.check.len())?;
        }
        if self.json && is_dash(&self.output) {
            let message = "--json and `-o -` both want standard output; write the spec to a file";
            return Err(Failure::Usage(message.into()));
        }
        let inputs = || self.captures.iter().chain(&self.check).chain(&self.training).map(PathBuf::as_path);
        if inputs().chain([self.spec.as_path()]).filter(|path| is_dash(path)).count() > 1 {
            return Err(Failure::Usage("`-` is given twice; standard input can be only one of them".into()));
        }
        if let Some(level) = self.clip.filter(|level| level.is_nan() || *level <= 0.0) {
            return Err(Failure::Usage(format!("--clip {level} is not a positive level")));
        }
        if is_dash(&self.output) {
            return Ok(());
        }
        let inputs: Vec<&Path> = inputs().chain([self.spec.as_path()]).collect();
        files::refuse_overlaps(&[&self.output], &inputs).map_err(Failure::input)?;
        name_leftovers(&[&self.output]);
        Ok(())
    }

    fn settings(&self, spec: &Spec) -> Result<Settings, Failure> {
        let fits = |value| self.fit.contains(&value);
        let fit = Fit {
            delay: fits(Value::Delay),
            gain: fits(Value::Gain),
            offset: fits(Value::Offset),
            cutoff: fits(Value::Cutoff),
        };
        let known = spec.uncertainty.as_ref().and_then(|table| table.reference_channel());
        let reference = match self.reference {
            Some(0) => return Err(Failure::Usage("--reference 0: channels count from 1".into())),
            Some(channel) => channel - 1,
            None => known.unwrap_or(0),
        };
        Ok(Settings { fit, reference })
    }

    fn signal(&self, spec: &Spec) -> Result<Signal, Failure> {
        if self.blind {
            return Ok(Signal::Any);
        }
        if let Some(path) = &self.training {
            let reading = FileReading::channel(None, MOST_MEASURED);
            let CaptureFile { samples, rate, .. } = CaptureFile::read(path, reading)?.finite(path)?;
            // In normalised time the recording's own rate is the fast rate.
            let spacing = if spec.is_normalised() {
                FastPeriods(1.0)
            } else {
                rate.period().in_fast_periods(spec.fast_period)
            };
            return Ok(Signal::Waveform { samples, spacing });
        }
        match self.tone.as_deref() {
            None | Some("auto") => Ok(Signal::Tones(Vec::new())),
            Some(list) => list.split(',').map(tone).collect::<Result<_, _>>().map(Signal::Tones),
        }
    }
}

fn tone(text: &str) -> Result<Hertz, Failure> {
    let usage = |reason: &dyn std::fmt::Display| Failure::Usage(format!("--tone {text}: {reason}"));
    let frequency = quantity::frequency(text.trim()).map_err(|error| usage(&error))?;
    if frequency.0 != 0.0 { Ok(frequency) } else { Err(usage(&"a tone has a frequency other than 0")) }
}
