//! `hybank fuse`: fuses slow recordings into one fast recording.

use super::Failure;
use super::bank_file::is_dash;
use super::before_after::{BeforeAfter, BeforeAfterArgs};
use super::bit_true::{BitTrueArgs, Job};
use super::capture_args::CaptureArgs;
use super::file_kind::unreadable;
use super::follow::Follow;
use super::gaps::GapArgs;
use super::interrupt::interrupts;
use super::journal::{Journal, JournalArgs};
use super::output::{Bits, begin_samples, check_files, precision};
use super::run::{RunReport, ThreadArgs, algorithms, carried, complete, print_report};
use super::say::say_understood;
use super::track::TrackArgs;
use super::turns::TurnArgs;
use super::watch::{UNWATCHED, Watch};
use super::{bank_file, match_bank};
use crate::bank::Bank;
use crate::io::{BLOCK_BYTES, Container, MultiReader, OutputHeader, PcmFrames, Placement, ReadOptions};
use crate::overview::counted;
use crate::pipeline::{Ending, FileOutputs, Pipeline, Settings, Warning, run as run_pipeline};
use crate::quantity::readable;
use crate::runtime::{Algorithm, Options, Plan};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Fuses slow recordings into one fast recording
///
/// The recordings are one mono WAV file per channel, in the order of the bank, or one N-channel WAV
/// file, or with --interleaved one mono file in which the converters take turns. The output lines up with
/// the time axis of the inputs and has exactly M samples per input frame: the first m0 samples, the latency
/// of the bank, are dropped, and the end is flushed with zeros.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank fuse bank.json left.wav right.wav -o fused.wav
  hybank fuse bank.json both.wav -o fused.wav --bits 24 --force
  hybank fuse bank.json capture.wav -o fused.wav --interleaved 4
  hybank fuse bank.json tone1.wav tone2.wav -o fused.wav --measure
  hybank fuse fixed.json ch1.wav ch2.wav -o fused.wav --bit-true --accumulator 40
  hybank fuse bank.json ch1.wav ch2.wav -o fused.wav --track blind --track-log delays.jsonl
  sox capture.flac -t wav - | hybank fuse bank.json - -o - | play -t wav -")]
pub(super) struct Args {
    /// The bank (JSON), as `hybank design` writes it
    bank: PathBuf,
    /// One mono recording per channel (WAV, SigMF, .csv, .npy, .mat, or raw with --format), or one of N
    /// channels; `-` is standard input
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// The fused WAV file (or SigMF recording, if it ends in sigmf-meta) or a FIFO; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Sample format of the output: integers of 16, 24 or 32 bits, floats of 32 or 64 bits
    #[arg(long, value_enum, default_value_t = Bits::F32)]
    bits: Bits,
    /// Algorithm of FIR filters; auto: the fastest for the bank, and direct with --gaps
    #[arg(long, value_parser = algorithms(), default_value_t = Algorithm::Auto)]
    algorithm: Algorithm,
    /// Keep the bank's latency: the causal output, as `stream` gives it
    #[arg(long)]
    keep_latency: bool,
    #[command(flatten)]
    reading: CaptureArgs,
    #[command(flatten)]
    turns: TurnArgs,
    #[command(flatten)]
    gaps: GapArgs,
    #[command(flatten)]
    track: TrackArgs,
    #[command(flatten)]
    threads: ThreadArgs,
    #[command(flatten)]
    bit_true: BitTrueArgs,
    #[command(flatten)]
    before_after: BeforeAfterArgs,
    #[command(flatten)]
    journal: JournalArgs,
    /// Make every tolerated fault (unequal lengths, truncation, NaN, clipping) an error
    #[arg(long)]
    strict: bool,
    /// Replace an existing output
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output, or on standard error with `-o -`
    #[arg(long)]
    json: bool,
}

/// The report of a run.
#[derive(Debug, serde::Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    run: &'a RunReport,
    /// Hertz of the output, rounded.
    rate: u64,
    /// Input frames read.
    frames: u64,
    /// Samples dropped at the beginning so that the output lines up with the inputs; with --keep-latency
    /// only those that the algorithm adds.
    latency_dropped: u64,
    /// Largest magnitude of the output, of full scale.
    peak: f64,
    /// Whether the captures agree with the spec of the bank.
    captures: &'a str,
    seconds: f64,
    /// The figures of plain interleaving and of the output, with --measure.
    #[serde(skip_serializing_if = "Option::is_none")]
    measure: Option<BeforeAfter>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let bank = bank_file::load(&args.bank)?;
    say_understood(bank.spec.as_ref());
    let journal = args.journal.begin(args.force)?;
    fuse(args, &bank, &journal).inspect_err(|failure| journal.fail(failure))
}

fn fuse(args: &Args, bank: &Bank, journal: &Journal) -> Result<(), Failure> {
    let begin = Instant::now();
    let Some(mut reader) = args.start_reader(bank, Some(journal))? else { return Err(interrupted(0)) };
    match_bank::check_channels(bank, &args.bank, &reader)?;
    let rate = match_bank::output_rate(bank, &reader)?;
    if args.bit_true.is_wanted() {
        return args.bit_true.fuse(args.job(bank, rate), &mut reader);
    }
    let plan = args.plan(bank)?;
    let skip = if args.keep_latency { plan.extra_latency() } else { plan.latency() } as u64;
    let is_complex = reader.is_complex();
    let mut pipeline = args.pipeline(bank, &plan, (skip, rate), is_complex)?;
    let mut outputs = args.outputs(rate, is_complex)?;
    let is_watched = !is_complex && !args.track.is_wanted();
    let mut watch = if is_watched { Watch::new(bank) } else { Watch::idle(UNWATCHED) };
    let mut follow = Follow::new(journal.clone());
    run_all(&mut pipeline, &mut reader, &mut outputs, |parts, pipeline| {
        watch.observe(parts);
        follow.step(parts, pipeline);
    })?;
    pipeline.settle(&mut outputs).map_err(Failure::running)?;
    follow.step(&[], &pipeline);
    let reported = pipeline.warnings().to_vec();
    let frames = reader.consumed();
    pipeline.flush(frames * bank.ratio as u64, &mut outputs).map_err(Failure::running)?;
    let run = RunReport::new(pipeline.finish(), args.tolerated(&reader), "--bits 32f");
    let watched = watch.finish();
    let run = run.with_warnings(watched.warnings).with_reported(reported);
    let seconds = begin.elapsed().as_secs_f64();
    let shift = plan.latency() as u64 - skip;
    let placement = Placement { ratio: bank.ratio as u64, shift, samples: run.samples };
    outputs.annotate(carried(&reader, run.gaps(), bank, &args.output, placement)?);
    let peak = outputs.peak().unwrap_or(0.0);
    complete(outputs, &run, args.strict, journal)?;
    let (measure, rate) = (args.measured(bank)?, rate.round() as u64);
    let captures = &watched.verdict;
    let report = Report { run: &run, rate, frames, latency_dropped: skip, peak, captures, seconds, measure };
    journal.end(&report)?;
    if args.json {
        return print_report(&report, &args.output);
    }
    // Where samples or events go to standard output nothing else does.
    let is_taken = [Some(args.output.as_path()), args.journal.report()].into_iter().flatten().any(is_dash);
    if is_taken { Ok(()) } else { super::print(&report.text(&args.output)) }
}

impl Report<'_> {
    /// The figures of --measure; what was written, and whether the captures agree with the bank.
    fn text(&self, output: &Path) -> String {
        let figures = self.measure.as_ref().map_or_else(String::new, BeforeAfter::text);
        let (samples, clipped) = (counted(self.run.samples, "sample"), self.run.clipped);
        let rate = self.rate as f64;
        let length = readable(self.run.samples as f64 / rate, "s");
        let level =
            if self.peak > 0.0 { format!(" ({:.1} dBFS)", 20.0 * self.peak.log10()) } else { String::new() };
        let clipped = if clipped == 0 { "none".to_owned() } else { clipped.to_string() };
        format!(
            "{figures}{}: {samples} at {} = {length}, peak {:.4}{level}, {clipped} clipped\n{}\n",
            output.display(),
            readable(rate, "S/s"),
            self.peak,
            self.captures
        )
    }
}

impl Args {
    /// Refuses impossible combinations of options, before any file is read.
    fn check(&self) -> Result<(), Failure> {
        match_bank::check_stdin(&self.bank, &self.inputs)?;
        self.gaps.check()?;
        self.turns.check(self.inputs.len())?;
        self.reading.check(self.turns.is_given())?;
        self.before_after.check(&self.inputs, &self.output)?;
        self.journal.check(&self.output, self.json || self.before_after.is_wanted())?;
        let inputs = self.inputs.iter().map(PathBuf::as_path).chain([self.bank.as_path()]);
        let inputs: Vec<&Path> = inputs.chain(self.gaps.lost()).chain(self.track.input()).collect();
        self.track.check(self.algorithm)?;
        let others = self.gaps.mask().into_iter().chain(self.journal.report()).chain(self.track.log());
        check_files((&self.output, Container::Wav), &others.collect::<Vec<&Path>>(), &inputs)
    }

    /// `None` if an interrupt came first.
    fn start_reader(&self, bank: &Bank, journal: Option<&Journal>) -> Result<Option<MultiReader>, Failure> {
        let lost = self.gaps.lost_samples()?;
        let turns = self.turns.turns(bank, &self.bank)?;
        let block_bytes = self.threads.bytes(BLOCK_BYTES);
        let stalls = journal.map(Journal::stall_watch);
        let (turns, stalls) = (turns.as_ref(), stalls.as_ref());
        let captures = self.reading.options(self.inputs.len(), bank.channel_count());
        let files = ReadOptions { block_bytes, turns, stalls, ..captures };
        let options = self.gaps.read_options(&lost, files);
        MultiReader::start(&self.inputs, options, interrupts()).map_err(unreadable)
    }

    /// Reads the inputs once more, and the output.
    fn measured(&self, bank: &Bank) -> Result<Option<BeforeAfter>, Failure> {
        if !self.before_after.is_wanted() {
            return Ok(None);
        }
        let Some(reader) = self.start_reader(bank, None)? else { return Err(interrupted(0)) };
        self.before_after.measured(bank, reader, &self.output).map(Some)
    }

    fn plan(&self, bank: &Bank) -> Result<Plan, Failure> {
        bank_file::plan(bank, self.options(), &self.bank)
    }

    fn options(&self) -> Options {
        // Outputs that no gap affects must have the same bits as without gaps.
        // Filters that follow delays change at single frames.
        let direct = self.gaps.policy().is_some() || self.track.is_wanted();
        let precision = precision(self.bits.format());
        let algorithm = if direct { self.algorithm.without_added_latency() } else { self.algorithm };
        Options { precision, algorithm, ..Options::default() }
    }

    fn job<'a>(&'a self, bank: &'a Bank, rate: f64) -> Job<'a> {
        Job {
            bank,
            bank_path: &self.bank,
            output: &self.output,
            rate,
            keep_latency: self.keep_latency,
            strict: self.strict,
            force: self.force,
            json: self.json,
        }
    }

    /// That drops `skip` samples of an output of `rate` hertz.
    fn pipeline(
        &self,
        bank: &Bank,
        plan: &Plan,
        (skip, rate): (u64, f64),
        is_complex: bool,
    ) -> Result<Pipeline, Failure> {
        self.track.check_samples(is_complex)?;
        let (format, gaps, workers) = (self.bits.format(), self.gaps.policy(), self.threads.workers()?);
        let settings = Settings { format, is_complex, skip, gaps, workers };
        let pipeline = Pipeline::new(bank, plan, settings).map_err(Failure::running)?;
        self.track.followed(pipeline, (bank, &self.bank), self.options(), rate)
    }

    /// The outputs at their beginning, of `rate` hertz.
    fn outputs(&self, rate: f64, is_complex: bool) -> Result<FileOutputs, Failure> {
        let mask = self.gaps.begin_mask(self.force)?;
        let (container, format) = (Container::Wav, self.bits.format());
        let header = OutputHeader { container, format, is_complex, rate };
        let samples = begin_samples(&self.output, header, self.force);
        let log = self.track.begin_log(self.force)?;
        Ok(FileOutputs::new(samples.map_err(Failure::running)?, mask).with_log(log).with_peak(format))
    }

    fn tolerated(&self, reader: &MultiReader) -> Vec<Warning> {
        let names = || self.inputs.iter().map(|path| path.display().to_string()).collect();
        let empty = (reader.consumed() == 0).then(|| Warning::Empty(names()));
        reader.warnings().into_iter().map(Warning::Input).chain(empty).collect()
    }
}

/// Processes all frames.
fn run_all(
    pipeline: &mut Pipeline,
    reader: &mut MultiReader,
    outputs: &mut FileOutputs,
    mut observe: impl FnMut(&[PcmFrames<'_>], &Pipeline),
) -> Result<(), Failure> {
    let progress = progress_bar(reader.promised_frames());
    let ending = run_pipeline(reader, pipeline, outputs, |parts, pipeline| {
        observe(parts, pipeline);
        progress.inc(parts.iter().map(PcmFrames::frames).min().unwrap_or(0) as u64);
    });
    match ending.map_err(Failure::running)? {
        Ending::Inputs => progress.finish_and_clear(),
        Ending::Stopped => return Err(interrupted(reader.consumed())),
    }
    Ok(())
}

fn interrupted(frames: u64) -> Failure {
    Failure::Input(format!("interrupted after {frames} frames; nothing was kept, run it again"))
}

/// Drawn on a terminal only.
fn progress_bar(frames: Option<u64>) -> ProgressBar {
    let bar = frames.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
    let style = ProgressStyle::with_template("{bar:40} {percent}% {eta}");
    style.map_or(bar.clone(), |style| bar.with_style(style))
}
