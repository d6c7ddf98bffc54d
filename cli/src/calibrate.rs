//! `hybank calibrate`: delays, gains, offsets and cut-offs of the channels from captures.

use super::bank_file::{bad_flag, parse_spec, read_kind};
use super::calibrate_report::{CalibrationReport, DriftReport};
use super::capture_args::{CaptureArgs, InterleavedArgs, check_stdin};
use super::capture_file::{CaptureFile, MOST_MEASURED, ReadingRules, start, unread};
use super::file_kind::FileKind;
use super::measure::{ToneArg, tone, tones};
use super::print::{Failure, check_json, explained, failed, is_dash, say_understood, warn};
use super::written::{begin_file, check_together, write_text};
use hybank::calibrate::{
    Acquisition, CalibrateError, Calibration, CalibrationSettings, CalibrationSignal, CalibrationWarning,
    FittedValues, Fitting, Record, Track, applied, calibrate_pooled, track, usual_reference,
};
use hybank::captures::{Captures, Converters};
use hybank::files::commit_all;
use hybank::messages::Quoted;
use hybank::pipeline::matching::{check_channels, check_rate};
use hybank::quantity::{self, WrittenTime};
use hybank::sine_fit::CurveKind;
use hybank::spec::{DesignOverrides, DesignSpec, Method, Spec, leaves_the_design_open};
use hybank::units::FastPeriods;
use std::path::{Path, PathBuf};

/// Most samples of all channels together: 512 MiB as doubles.
const MOST_SAMPLES: usize = 1 << 26;
/// Values of a larger misfit are not written unless asked for: intervals that are widened by more than this
/// no longer describe errors of the values.
const MOST_MISFIT: f64 = 10.0;
/// The same of any signal: what the model gets wrong moves its values by more than the intervals grow.
const MOST_BLIND_MISFIT: f64 = 2.0;

/// Measures delay, gain and offset of each channel from captures, with 95 % intervals
///
/// Fits what the captures say of the channels, relative to a reference channel, and writes the spec with
/// these values and an [uncertainty] table with the half-widths of their intervals. Everything else of the
/// spec is kept. Of converters that take turns (--interleaved) the spec asks for least-squares taps (method
/// h2) where its [design] is empty.
///
/// The captures hold sine tones (--tone, the default), a waveform that is known (--training), or any signal
/// that leaves fewer aliases occupied than there are channels (--blind). Complex captures hold tones.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank calibrate spec.toml tone1.wav tone2.wav -o measured.toml --tone 1.2kHz
  hybank calibrate spec.toml tones1.wav tones2.wav -o measured.toml --tone 1kHz,5kHz,9kHz \\
      --fit delay,gain,offset,cutoff
  hybank calibrate spec.toml z?.csv --interleaved 4 --full-scale 8bits -o measured.toml
  hybank calibrate spec.toml ch1.wav ch2.wav -o measured.toml --training chirp.wav
  hybank calibrate spec.toml ch1.wav ch2.wav -o measured.toml --blind
  hybank calibrate spec.toml ch1.wav ch2.wav -o measured.toml --tone 1.2kHz --drift drift.jsonl")]
pub(super) struct Args {
    /// The spec (TOML) with the nominal values; `-` is standard input
    spec: PathBuf,
    /// One mono recording per channel (WAV, SigMF, .csv, .npy, .mat, or raw with --format), in the order of
    /// the spec, or one of N channels. Several such sets, one after the other, are pooled: each has tones of
    /// its own
    #[arg(required = true)]
    captures: Vec<PathBuf>,
    /// The calibrated spec; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Frequencies of tones (Hz, kHz, MHz, GHz; hertz if left out) to about 100 ppm, or auto; of complex
    /// samples also negative
    ///
    /// A tone may lie in any Nyquist zone of the slow rate. `auto` finds tones in the zone of the fast rate
    /// that holds the signal's band, or that the target passes, and takes their zones of the slow rate from
    /// the delays of the spec.
    #[arg(long, value_name = "F,..|auto", value_delimiter = ',', value_parser = tone,
          conflicts_with_all = ["training", "blind"])]
    tone: Vec<ToneArg>,
    /// A mono recording of the waveform that was played
    #[arg(long, value_name = "WAV", conflicts_with = "blind")]
    training: Option<PathBuf>,
    /// Use whatever signal the captures hold
    #[arg(long)]
    blind: bool,
    /// The channel to which the others are relative, from 1 [default: that of the spec's uncertainty table,
    /// or 1]
    #[arg(long, value_name = "I", hide_short_help = true)]
    reference: Option<usize>,
    /// What to fit: delay, gain, offset, cutoff [default: `fit` of the spec, or delay,gain,offset]
    ///
    /// cutoff:2 is for the cut-offs of the second stages of the filters' cascades. What is not fitted keeps
    /// the values of the spec.
    #[arg(long, value_name = "VALUE,..", value_delimiter = ',')]
    fit: Vec<Fitting>,
    /// Also find the static nonlinearity of each converter: a polynomial up to this order, or a table
    ///
    /// A table has a value for each code, so it follows the steps of converters by successive approximation
    /// and of pipelines. Either is written where it lowers what the tones leave of samples that it was not
    /// fitted to.
    #[arg(long, value_name = "ORDER|table", value_parser = curve_kind, conflicts_with_all = ["training", "blind"])]
    nonlinearity: Option<CurveKind>,
    /// Also follow how delays, gains and offsets change, for `fuse --track`: lines of JSON
    ///
    /// A tone beside the signal (--tone) or any signal (--blind) tells them; what stays is a constant.
    #[arg(long, value_name = "FILE", conflicts_with = "training")]
    drift: Option<PathBuf>,
    /// Length of the blocks of --drift, each of which is calibrated, as 10ms [default: a 64th of the
    /// captures, 2048 frames or more]
    #[arg(long, value_name = "TIME", value_parser = quantity::time, requires = "drift", hide_short_help = true)]
    block: Option<WrittenTime>,
    /// Other captures of the same converters to check the calibrated spec with
    ///
    /// They hold the same kind of signal.
    #[arg(long, value_name = "HOLDOUT", num_args = 1..)]
    check: Vec<PathBuf>,
    #[command(flatten)]
    reading: CaptureArgs,
    #[command(flatten)]
    interleaved: InterleavedArgs,
    /// Samples of this size and more are clipped and left out [default: the ends of integer formats, 1 for
    /// floats none of which is beyond]
    #[arg(long, value_name = "LEVEL", hide_short_help = true)]
    clip: Option<f64>,
    /// Replace an existing output, and write values that the captures contradict
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

/// The captures of one acquisition.
struct Acquired {
    name: String,
    /// One per sample of a frame.
    records: Vec<Record>,
}

/// A failed calibration; what is wrong with the tones of one acquisition is said of its files.
fn of_captures(captures: &[Acquired], error: CalibrateError) -> Failure {
    match (captures, &error) {
        ([one], CalibrateError::Tones(_)) => Failure::Input(format!("{}: {error}", Quoted(&one.name))),
        _ => failed(error),
    }
}

/// As the library takes them.
fn borrowed(all: &[Acquired]) -> Vec<Acquisition<'_>> {
    all.iter().map(|one| Acquisition { name: &one.name, records: &one.records }).collect()
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check_usage()?;
    let text = read_kind(&args.spec, FileKind::Spec)?;
    let file = parse_spec(&text, &args.spec, DesignOverrides::default())?;
    let spec = file.for_outputs(&[&args.output])?;
    say_understood(Some(&spec));
    let mut warnings = Vec::new();
    let done = args.calibrated(&spec, &mut warnings);
    // What the captures have may explain why they do not fit; a report has these warnings.
    let (calibrated, report, drift) =
        done.inspect_err(|_| warnings.iter().for_each(|warning| warn(warning)))?;
    let calibrated = args.with_method(calibrated, &text);
    let written = file.with_values(&text, &calibrated, &args.output).map_err(|problem| {
        report.warnings.iter().for_each(|warning| warn(warning));
        Failure::Input(format!("the values found make no spec: {problem}; nothing was written"))
    })?;
    args.write(&written, drift.as_ref())?;
    report.print(&args.output, args.drift.as_deref(), args.json)
}

impl Args {
    /// The `calibrated` spec, with the least-squares taps for converters that take turns where the `text`
    /// leaves the design open: circuits take no recursion.
    fn with_method(&self, calibrated: Spec, text: &str) -> Spec {
        let least_squares = Spec { design: DesignSpec::new(Method::H2, None), ..calibrated.clone() };
        let is_default = self.interleaved.is_given() && leaves_the_design_open(text);
        if is_default && least_squares.is_fir() { least_squares } else { calibrated }
    }

    /// Writes the spec and the lines of its drift, which appear together.
    fn write(&self, spec: &str, drift: Option<&Track>) -> Result<(), Failure> {
        let (Some(path), Some(track)) = (&self.drift, drift) else {
            return write_text(&self.output, spec, self.force);
        };
        let lines: String = track.readings.iter().map(|reading| reading.line() + "\n").collect();
        let mut files = vec![begin_file(path, lines.as_bytes(), self.force)?];
        if is_dash(&self.output) {
            write_text(&self.output, spec, self.force)?;
        } else {
            files.push(begin_file(&self.output, spec.as_bytes(), self.force)?);
        }
        commit_all(files).map_err(failed)
    }

    /// What the captures say of changes, if that is asked for. `spec` has the values that were found.
    fn track(
        &self,
        spec: &Spec,
        captures: &[Acquired],
        found: &Calibration,
        settings: CalibrationSettings,
    ) -> Result<Option<Track>, Failure> {
        let (Some(_), [captures]) = (&self.drift, captures) else {
            return match &self.drift {
                Some(_) => Err(Failure::Usage("--drift: give captures that were taken together".into())),
                None => Ok(None),
            };
        };
        let tones = found.tones.iter().map(|tone| tone.frequency.value).collect();
        let signal = if self.blind { CalibrationSignal::Any } else { CalibrationSignal::Tones(tones) };
        let frame = spec.fast_period * spec.ratio as f64;
        let frames = self.block.map(|time| (time.in_seconds(spec.fast_period) / frame).round() as usize);
        track(spec, &captures.records, &signal, settings, frames).map(Some).map_err(failed)
    }

    /// The calibrated spec, the report and what changes. `warnings` are those of the captures.
    fn calibrated(
        &self,
        spec: &Spec,
        warnings: &mut Vec<String>,
    ) -> Result<(Spec, CalibrationReport, Option<Track>), Failure> {
        let (settings, signal) = (self.settings(spec)?, self.signal(spec)?);
        let captures = self.read(&self.captures, spec, warnings)?;
        let found = calibrate_pooled(spec, &borrowed(&captures), &signal, settings);
        let found = found.map_err(|error| of_captures(&captures, error))?;
        let (mut calibrated, more) = applied(spec, &found);
        let drift = self.track(&calibrated, &captures, &found, settings)?;
        // What changes fits no values, but each block fits its own.
        if let Some(drift) = &drift {
            calibrated = applied(&calibrated, &drift.calibration).0;
        }
        let misfit = drift.as_ref().map_or(found.misfit, |drift| drift.calibration.misfit);
        self.check_misfit(&found, misfit, warnings)?;
        let mut report = CalibrationReport::new(spec, &found);
        report.add(&more);
        report.drift = drift.as_ref().map(DriftReport::from);
        if !self.check.is_empty() {
            let captures = self.read(&self.check, spec, warnings)?;
            let held_out = match signal {
                // Held-out tones have other frequencies.
                CalibrationSignal::Tones(_) => CalibrationSignal::Tones(Vec::new()),
                signal => signal,
            };
            let values = FittedValues { nonlinearity: None, ..settings.fit };
            // Delays and gains are compared; a cut-off takes more tones than they do.
            let compared = FittedValues { cutoff: None, ..values };
            let fit = if compared == FittedValues::NOTHING { values } else { compared };
            let settings = CalibrationSettings { fit, ..settings };
            let checked = calibrate_pooled(&calibrated, &borrowed(&captures), &held_out, settings)
                .map_err(|error| Failure::Input(format!("the held-out captures: {error}")))?;
            report.check(&calibrated, &found, &checked);
        }
        report.warnings.splice(0..0, warnings.iter().cloned());
        Ok((calibrated, report, drift))
    }

    /// Refuses values that the captures contradict. What explains that joins the `warnings`.
    fn check_misfit(
        &self,
        found: &Calibration,
        misfit: Option<f64>,
        warnings: &mut Vec<String>,
    ) -> Result<(), Failure> {
        use CalibrationWarning::{BandsDisagree, CutoffExplains, Outlying};
        let most = if self.blind { MOST_BLIND_MISFIT } else { MOST_MISFIT };
        let Some(misfit) = misfit.filter(|&misfit| misfit > most && !self.force) else {
            return Ok(());
        };
        let reasons = |warning: &&CalibrationWarning| {
            matches!(warning, Outlying { .. } | CutoffExplains { .. } | BandsDisagree { .. })
        };
        warnings.extend(found.warnings.iter().filter(reasons).map(explained));
        Err(Failure::Input(format!(
            "the captures contradict the spec: they differ from its model {misfit:.1} times as much as their noise \
             explains, so the values mean nothing and were not written; check the frequencies and their zones, the \
             front ends and the order of the captures, or write them all the same with --force"
        )))
    }

    /// Refuses impossible combinations of options, before any file is read.
    fn check_usage(&self) -> Result<(), Failure> {
        self.reading.check(self.interleaved.is_given())?;
        check_json(self.json, &self.output, "spec")?;
        let inputs = self.captures.iter().chain(&self.check).chain(&self.training).chain([&self.spec]);
        let inputs: Vec<&Path> = inputs.map(PathBuf::as_path).collect();
        check_stdin(inputs.iter().copied())?;
        if let Some(level) = self.clip.filter(|level| level.is_nan() || *level <= 0.0) {
            return Err(Failure::Usage(format!("--clip {level} is not a positive level")));
        }
        let outputs: Vec<&Path> = self.drift.iter().chain([&self.output]).map(PathBuf::as_path).collect();
        check_together(&outputs, &inputs, self.force)
    }

    /// The acquisitions in these files, each with one record per channel of `spec`; what was tolerated joins
    /// the `warnings`.
    fn read(
        &self,
        paths: &[PathBuf],
        spec: &Spec,
        warnings: &mut Vec<String>,
    ) -> Result<Vec<Acquired>, Failure> {
        let files = self.files_of_one(paths, spec)?;
        let most = MOST_SAMPLES / paths.len().div_ceil(files);
        paths.chunks(files).map(|files| self.read_one(files, spec, most, warnings)).collect()
    }

    /// How many files are one acquisition: as many as have the channels of the spec.
    fn files_of_one(&self, paths: &[PathBuf], spec: &Spec) -> Result<usize, Failure> {
        let [first, _, ..] = paths else { return Ok(1) };
        if self.interleaved.is_given() {
            return Ok(1);
        }
        // What is no file cannot be read twice.
        if !first.is_file() {
            return Ok(paths.len());
        }
        let reader = start(std::slice::from_ref(first), self.reading.format().options(2, 1))?;
        let files = spec.channels.len() / reader.channels().max(1);
        Ok(if files > 0 && paths.len().is_multiple_of(files) { files } else { paths.len() })
    }

    /// The captures of one acquisition, at most `most` samples of all channels.
    fn read_one(
        &self,
        paths: &[PathBuf],
        spec: &Spec,
        most: usize,
        warnings: &mut Vec<String>,
    ) -> Result<Acquired, Failure> {
        let converters = Converters::from(spec);
        let interleaving = self.interleaved.interleaving(&converters, &self.spec)?;
        let options = converters.options(self.reading.format(), paths.len(), interleaving.as_ref());
        let mut reader = start(paths, options)?;
        check_channels(converters.layout(), "the spec", &reader).map_err(failed)?;
        check_rate(spec, &reader).map_err(failed)?;
        let parts = if reader.is_complex() { 2 } else { 1 };
        let most = most / (parts * reader.channels()).max(1);
        let captures = Captures::read(&mut reader, most).map_err(unread)?;
        warnings.extend(reader.warnings().iter().map(ToString::to_string));
        if captures.is_cut {
            warnings.push(format!("{}: only the first {most} frames are used", Quoted(&captures.name)));
        }
        Ok(Acquired { records: captures.records(self.clip), name: captures.name })
    }

    fn settings(&self, spec: &Spec) -> Result<CalibrationSettings, Failure> {
        Spec { fit: self.fit.clone(), ..spec.clone() }
            .check()
            .map_err(|error| bad_flag("fit", error.problem()))?;
        let given = if self.fit.is_empty() { &spec.fit } else { &self.fit };
        let fit = if given.is_empty() { FittedValues::default() } else { given.iter().copied().collect() };
        let fit = FittedValues { nonlinearity: self.nonlinearity, ..fit };
        let reference = reference(self.reference, spec)?;
        Ok(CalibrationSettings { fit, reference })
    }

    fn signal(&self, spec: &Spec) -> Result<CalibrationSignal, Failure> {
        if self.blind {
            return Ok(CalibrationSignal::Any);
        }
        if let Some(path) = &self.training {
            let reading = ReadingRules::channel(None, MOST_MEASURED);
            let training = CaptureFile::read(path, reading)?;
            let (rate, samples) = (training.rate, training.finite(path)?);
            // In normalised time the recording's own rate is the fast rate.
            let spacing = if spec.is_normalised() {
                FastPeriods(1.0)
            } else {
                rate.period().in_fast_periods(spec.fast_period)
            };
            return Ok(CalibrationSignal::Waveform { samples, spacing });
        }
        tones(&self.tone).map(CalibrationSignal::Tones)
    }
}

fn curve_kind(text: &str) -> Result<CurveKind, String> {
    let order = text.parse().ok().filter(|order| (2..=32).contains(order)).map(CurveKind::Order);
    let kind = order.or_else(|| (text == "table").then_some(CurveKind::Table));
    kind.ok_or_else(|| "give an order from 2 to 32, or table".to_owned())
}

/// The reference channel, from 0: the `given` one, from 1, or that of the spec.
pub(super) fn reference(given: Option<usize>, spec: &Spec) -> Result<usize, Failure> {
    match given {
        Some(0) => Err(Failure::Usage("--reference 0: channels count from 1".into())),
        Some(channel) => Ok(channel - 1),
        None => Ok(usual_reference(spec)),
    }
}
