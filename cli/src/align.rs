//! `hybank align`: when recordings began, how their clocks drift, their polarities and gains.

use super::bank_file::{parse_spec, read_kind};
use super::calibrate::reference;
use super::calibrate_report::{Interval, interval, level_changes, periods, shown};
use super::capture_args::{CaptureArgs, check_stdin};
use super::capture_file::{start, unread};
use super::file_kind::FileKind;
use super::print::{Failure, check_json, failed, failed_at, is_dash, say_understood, shell_word, show, warn};
use super::written::{Mono, begin_file, begin_recording, check_together, write_text, write_together};
use hybank::align::{AlignError, AlignSettings, Alignment, ClockStep, align};
use hybank::calibrate::{CalibrateError, LevelChange, Record};
use hybank::captures::{Captures, Converters};
use hybank::figures::Alone;
use hybank::io::{Container, PcmFormat, ReadOptions};
use hybank::pipeline::matching::{check_rate, common_rate};
use hybank::quantity::{self, WrittenTime};
use hybank::sine_fit::Estimate;
use hybank::spec::{DesignOverrides, Spec};
use hybank::units::{FastPeriods, Seconds};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Hertz of recordings that state no rate, for a spec in normalised time.
const NORMALISED_RATE: f64 = 48_000.0;

/// Aligns recordings by recorders that were started by hand and have clocks of their own
///
/// Finds by any signal (speech, music, noise) by how many samples each recording began before the others,
/// how its clock drifts, its polarity, gain and offset, and writes the spec with these values; with the band
/// of the signal also its rms and the noise of the recorders. --trim writes the recordings from their first
/// common sample on, and their delays over time.
///
/// All is relative to a reference channel, whose clock is the time. The report says whether one recorder
/// alone would do as well as all together, and which commands come next.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank align spec.toml left.wav right.wav -o aligned.toml --trim aligned
  hybank design aligned.toml -o bank.json
  hybank fuse bank.json aligned/ch1.wav aligned/ch2.wav -o fused.wav
  hybank align spec.toml a.wav b.wav -o aligned.toml --within 50ms --json

Recordings of a tone or a loop agree at many lags; --within says how far apart they began at most.")]
pub(super) struct Args {
    /// The spec (TOML) with the nominal values; `-` is standard input
    spec: PathBuf,
    /// One mono recording per channel (WAV, SigMF, .csv, .npy, .mat, or raw with --format), in the order of
    /// the spec; of any length, and begun at any time
    #[arg(required = true)]
    captures: Vec<PathBuf>,
    /// The spec with the values found; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Write the recordings from their first common sample on into this folder: ch1.wav, ch2.wav, .., with
    /// NaN for lost samples, and drift.jsonl, their delays over time, and gains and offsets that change
    #[arg(long, value_name = "DIR")]
    trim: Option<PathBuf>,
    /// How far apart the recordings began at most, as 50ms or 2s
    #[arg(long, value_name = "TIME", value_parser = quantity::time, hide_short_help = true)]
    within: Option<WrittenTime>,
    /// The channel whose clock is the time, from 1 [default: that of the spec's uncertainty table, or 1]
    #[arg(long, value_name = "I", hide_short_help = true)]
    reference: Option<usize>,
    #[command(flatten)]
    reading: CaptureArgs,
    /// Replace existing outputs
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

/// Paths as words of a command.
fn words(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| shell_word(&path.display().to_string())).collect::<Vec<_>>().join(" ")
}

/// The recordings of all channels.
struct Recordings {
    records: Vec<Record>,
    /// Their formats.
    formats: Vec<PcmFormat>,
    /// Hertz, of all.
    rate: f64,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check_usage()?;
    let text = read_kind(&args.spec, FileKind::Spec)?;
    let file = parse_spec(&text, &args.spec, DesignOverrides::default())?;
    let spec = file.for_outputs(&[&args.output])?;
    let others = args.written(spec.channels.len());
    args.check_outputs(&others)?;
    if !spec.layout().is_plain() {
        // Before the rates of the recordings, which are rightly not that of the frames.
        return Err(failed_at(&args.spec, AlignError::Rates));
    }
    say_understood(Some(&spec));
    let mut warnings = Vec::new();
    let read = args.read(&spec, &mut warnings);
    let found = read.and_then(|recordings| {
        let settings = args.settings(&spec, recordings.rate)?;
        Ok((align(&spec, &recordings.records, settings).map_err(failed)?, recordings))
    });
    // What the recordings have may explain why they do not fit; a report has these warnings.
    let (found, recordings) = found.inspect_err(|_| warnings.iter().for_each(|text| warn(text)))?;
    let alone = found.alone().map_err(failed)?;
    let written = file.with_values(&text, &found.spec, &args.output).map_err(|problem| {
        Failure::Input(format!("the values found make no spec: {problem}; nothing was written"))
    })?;
    args.write(&written, &found, &recordings, &others)?;
    let mut report = AlignReport::new(&spec, &found, alone, warnings);
    report.next = if alone.suffices() { Vec::new() } else { args.next(&found, recordings.rate) };
    report.print(&args.output, &others, args.json)
}

impl Args {
    /// Refuses impossible combinations of options, before any file is read.
    fn check_usage(&self) -> Result<(), Failure> {
        self.reading.check(false)?;
        check_stdin(self.captures.iter().chain([&self.spec]).map(PathBuf::as_path))?;
        check_json(self.json, &self.output, "spec")
    }

    /// Refuses outputs that are inputs or must not be replaced; `others` are those beside the spec.
    fn check_outputs(&self, others: &[PathBuf]) -> Result<(), Failure> {
        let inputs: Vec<&Path> = self.captures.iter().chain([&self.spec]).map(PathBuf::as_path).collect();
        let outputs: Vec<&Path> = others.iter().chain([&self.output]).map(PathBuf::as_path).collect();
        check_together(&outputs, &inputs, self.force)
    }

    /// The outputs beside the spec: the recordings of so many channels, and the delays.
    fn written(&self, channels: usize) -> Vec<PathBuf> {
        let names = (1..=channels).map(|i| format!("ch{i}.wav")).chain(["drift.jsonl".to_owned()]);
        let names: Vec<String> = names.collect();
        self.trim.iter().flat_map(|folder| names.iter().map(|name| folder.join(name))).collect()
    }

    /// The recordings, which have one rate; what was tolerated joins the `warnings`.
    fn read(&self, spec: &Spec, warnings: &mut Vec<String>) -> Result<Recordings, Failure> {
        // Before they are read, which takes long; one may hold several channels.
        let (captures, channels) = (self.captures.len(), spec.channels.len());
        if captures > channels {
            return Err(failed(CalibrateError::ChannelCount { channels, records: captures }));
        }
        let own = self.reading.format().options(captures, channels);
        let scale = Converters::from(spec).scale(own.scale.given);
        let options = ReadOptions { scale, ..own };
        let (mut records, mut formats, mut headers) = (Vec::new(), Vec::new(), Vec::new());
        for path in &self.captures {
            let mut reader = start(std::slice::from_ref(path), options.clone())?;
            check_rate(spec, &reader).map_err(failed)?;
            let Some(header) = reader.headers().next().map(|(_, header)| *header) else { continue };
            headers.push((path.display().to_string(), header));
            let captures = Captures::read(&mut reader, usize::MAX).map_err(unread)?;
            warnings.extend(reader.warnings().iter().map(ToString::to_string));
            records.extend(captures.channels.iter().map(|channel| channel.record(None)));
            formats.resize(records.len(), header.layout.format);
        }
        let stated = common_rate(headers.iter().map(|(name, header)| (name.as_str(), header)));
        let slow = (spec.fast_period * spec.ratio as f64).rate().0;
        let usual = if spec.is_normalised() { NORMALISED_RATE } else { slow };
        Ok(Recordings { records, formats, rate: stated.map_err(failed)?.unwrap_or(usual) })
    }

    fn settings(&self, spec: &Spec, rate: f64) -> Result<AlignSettings, Failure> {
        // A spec in normalised time counts in units that the recordings say.
        let unit = if spec.is_normalised() { 1.0 / (rate * spec.ratio as f64) } else { 1.0 };
        let within = self.within.map(|time| time.in_seconds(spec.fast_period) * (1.0 / unit));
        if within.is_some_and(|time| time < Seconds(0.0)) {
            return Err(Failure::Usage("--within: a time is not negative".into()));
        }
        Ok(AlignSettings { reference: reference(self.reference, spec)?, within })
    }

    /// The commands that make one recording of these: a bank with its run, or `merge`.
    fn next(&self, found: &Alignment, rate: f64) -> Vec<String> {
        if self.captures.iter().chain([&self.output]).any(|path| is_dash(path)) {
            return Vec::new();
        }
        let Some(inputs) = self.inputs_of_bank(found) else {
            return self.merge_command(found, rate).into_iter().collect();
        };
        let design = format!("hybank design {} -o bank.json", words(std::slice::from_ref(&self.output)));
        vec![design, format!("hybank fuse bank.json {inputs} -o fused.wav")]
    }

    /// What `fuse` reads, if a bank suits these recordings. Delays that move take a table, which needs the
    /// band of a signal. Those that move by more than a slow period pass where the channels sample at one
    /// instant, and a bank takes zeros for samples.
    fn inputs_of_bank(&self, found: &Alignment) -> Option<String> {
        let spec = &found.spec;
        let has_band = spec.signal.as_ref().is_some_and(|signal| signal.band().is_some());
        let suits = |moved: FastPeriods| has_band && moved.0 <= spec.ratio as f64;
        if found.has_lost_zeros() || !found.largest_move().is_none_or(suits) {
            return None;
        }
        if let Some((drift, trimmed)) = self.written(found.channels.len()).split_last() {
            let track = format!(" --track {}", words(std::slice::from_ref(drift)));
            return Some(words(trimmed) + if found.moves() { &track } else { "" });
        }
        let is_whole = found.channels.iter().all(|channel| channel.skip == 0);
        let suffices = is_whole && !found.moves() && self.reading.is_default();
        suffices.then(|| words(&self.captures))
    }

    /// `None` where options that say what the recordings are would have to be said again.
    fn merge_command(&self, found: &Alignment, rate: f64) -> Option<String> {
        if self.captures.len() != found.channels.len() || !self.reading.is_default() {
            return None;
        }
        let rate = rate * found.spec.ratio as f64;
        let seconds = |time: WrittenTime| time.in_seconds(Seconds(1.0 / rate)).0;
        let within = self.within.map(|time| format!(" --within {}s", seconds(time))).unwrap_or_default();
        Some(format!("hybank merge {} -o merged.wav --rate {rate}Hz{within}", words(&self.captures)))
    }

    /// Writes all outputs, which appear together; `others` are those beside the spec.
    fn write(
        &self,
        spec: &str,
        found: &Alignment,
        recordings: &Recordings,
        others: &[PathBuf],
    ) -> Result<(), Failure> {
        let (Some(folder), Some((drift, trimmed))) = (&self.trim, others.split_last()) else {
            return write_text(&self.output, spec, self.force);
        };
        let table: String = found.readings.iter().map(|reading| reading.line() + "\n").collect();
        let is_file = !is_dash(&self.output);
        let texts = [(drift, table.as_str())].into_iter().chain(is_file.then_some((&self.output, spec)));
        let begin_text = |(path, text): (&PathBuf, &str)| begin_file(path, text.as_bytes(), self.force);
        let begin = |channel: Option<usize>| {
            let Some(i) = channel else { return texts.clone().map(begin_text).collect() };
            let (skip, whole) = (found.channels[i].skip, found.mended(i, &recordings.records[i].samples));
            begin_recording(&trimmed[i], recordings.mono(i, &whole[skip..skip + found.frames]), self.force)
        };
        write_together(folder, (0..trimmed.len()).map(Some).chain([None]).map(Ok), begin)?;
        if is_file { Ok(()) } else { write_text(&self.output, spec, self.force) }
    }
}

impl Recordings {
    /// A WAV file of some samples of channel `i` in their own format; lost ones are NaN, which integers have
    /// not.
    fn mono<'a>(&self, i: usize, samples: &'a [f64]) -> Mono<'a> {
        let has_lost = samples.iter().any(|x| x.is_nan());
        let format = match (self.formats[i].is_float(), self.formats[i].bytes()) {
            (true, 4) => PcmFormat::F32Le,
            (false, 1) if !has_lost => PcmFormat::U8,
            (false, 2) if !has_lost => PcmFormat::S16Le,
            (false, 3) if !has_lost => PcmFormat::S24Le,
            (false, 4) if !has_lost => PcmFormat::S32Le,
            _ => PcmFormat::F64Le,
        };
        Mono { samples, imaginary: None, rate: self.rate, format, container: Container::Wav }
    }
}

/// The report of an alignment.
#[derive(Debug, serde::Serialize)]
struct AlignReport {
    /// The reference channel, from 1.
    reference: usize,
    /// Frames that all recordings have.
    frames: usize,
    /// Pieces that were compared, and those of them that gave delays.
    pieces: usize,
    measured: usize,
    channels: Vec<ChannelAlignment>,
    /// What one recorder gives, and all of them together.
    alone: Alone,
    one_suffices: bool,
    /// Whether delays move so much that fixed taps lose by it.
    moves: bool,
    /// The commands that make one recording of all; none where one recorder suffices.
    next: Vec<String>,
    warnings: Vec<String>,
}

#[derive(Debug, serde::Serialize)]
struct ChannelAlignment {
    /// From 1.
    channel: usize,
    /// Samples to cut off at the beginning.
    skip: usize,
    /// Fast periods, at the first frame.
    delay_samples: Interval,
    drift_ppm: Interval,
    gain: Interval,
    offset: Interval,
    /// By how much gain and offset change; 0 where no change stands out of the noise.
    changes: LevelChange,
    /// Where samples were lost or came in.
    steps: Vec<ClockStep>,
}

impl ChannelAlignment {
    fn new(spec: &Spec, i: usize, alignment: &Alignment) -> Self {
        let h = spec.fast_period;
        let found = &alignment.channels[i];
        let Estimate { value, sigma } = found.delay;
        let delay = Estimate { value: value.in_fast_periods(h), sigma: sigma.in_fast_periods(h) };
        let drift = Estimate { value: 1e6 * found.drift.value, sigma: 1e6 * found.drift.sigma };
        Self {
            channel: i + 1,
            skip: found.skip,
            delay_samples: periods(delay),
            drift_ppm: interval(drift),
            gain: interval(found.gain),
            offset: interval(found.offset),
            changes: alignment.changes[i],
            steps: alignment.instants(i).steps().to_vec(),
        }
    }
}

impl AlignReport {
    fn new(spec: &Spec, found: &Alignment, alone: Alone, mut warnings: Vec<String>) -> Self {
        warnings.extend(found.warnings.iter().map(ToString::to_string));
        Self {
            reference: found.reference + 1,
            frames: found.frames,
            pieces: found.pieces,
            measured: found.measured,
            channels: (0..found.channels.len()).map(|i| ChannelAlignment::new(spec, i, found)).collect(),
            alone,
            one_suffices: alone.suffices(),
            moves: found.moves(),
            next: Vec::new(),
            warnings,
        }
    }

    fn print(&self, output: &Path, others: &[PathBuf], json: bool) -> Result<(), Failure> {
        self.warnings.iter().for_each(|warning| warn(warning));
        // Standard output carries the spec.
        if is_dash(output) { Ok(()) } else { show(self, json, |report| report.text(output, others)) }
    }

    fn text(&self, output: &Path, others: &[PathBuf]) -> String {
        let Self { frames, reference, pieces, measured, .. } = self;
        let mut text = format!(
            "{frames} frames in common, {measured} of {pieces} pieces measured, relative to channel {reference}, delays in fast periods:\n  \
             channel    cut off     delay, first frame        drift (ppm)               gain                      offset\n"
        );
        for channel in &self.channels {
            let ChannelAlignment { channel, skip, delay_samples, drift_ppm, gain, offset, .. } = channel;
            let [delay, drift, gain, offset] =
                [delay_samples, drift_ppm, gain, offset].map(|cell| shown(*cell));
            let _ = writeln!(text, "  {channel:<10} {skip:<11} {delay:<25} {drift:<25} {gain:<25} {offset}");
        }
        for channel in &self.channels {
            let changes = level_changes(channel.changes);
            if !changes.is_empty() {
                let _ = writeln!(text, "changes    channel {}: {}", channel.channel, changes.join(", "));
            }
        }
        let Alone { channel, snr_db, together_db } = self.alone;
        let verdict = if self.one_suffices { "one recorder suffices" } else { "fuse them" };
        let _ = writeln!(
            text,
            "alone      channel {channel} gives {:.1} dB at best, all together {:.1} dB: {verdict}",
            snr_db.0, together_db.0
        );
        for path in others.iter().map(PathBuf::as_path).chain([output]) {
            let _ = writeln!(text, "{}", path.display());
        }
        if self.moves {
            text.push_str(
                "its delays are the middle of each course, or those of the given spec where the course is longer than a \
                 slow period; its [uncertainty] holds the course\n",
            );
        }
        for command in &self.next {
            let _ = writeln!(text, "next       {command}");
        }
        text
    }
}
