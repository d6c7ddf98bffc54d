//! `hybank fuse`: fuses slow recordings into one fast recording.

use super::bank_file;
use super::before_after::{self, BeforeAfterArgs};
use super::bit_true::BitTrueArgs;
use super::capture_args::CaptureArgs;
use super::choice::one_of;
use super::observer::RunObserver;
use super::output::{WIDTHS, container_of};
use super::print::{Failure, is_dash, print, print_report, say_understood};
use super::run::{BankRun, Finished, RunArgs, RunReport};
use super::tracked::{self, InstantArgs};
use hybank::bank::Bank;
use hybank::io::{MultiReader, OnStall, PcmFormat};
use hybank::messages::{Quoted, counted};
use hybank::overview::BeforeAfter;
use hybank::pipeline::DroppedLatency;
use hybank::quantity::readable;
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
  hybank fuse bank.json tone1.wav tone2.wav -o fused.wav --measure --plot spectra.svg
  hybank fuse fixed.json ch1.wav ch2.wav -o fused.wav --bit-true --accumulator 40
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
    #[arg(long, value_parser = one_of(WIDTHS), default_value = "32f")]
    bits: PcmFormat,
    /// Keep the bank's latency: the causal output, as `stream` gives it
    #[arg(long, conflicts_with = "track")]
    keep_latency: bool,
    #[command(flatten)]
    reading: CaptureArgs,
    #[command(flatten)]
    bit_true: BitTrueArgs,
    #[command(flatten)]
    instants: InstantArgs,
    #[command(flatten)]
    before_after: BeforeAfterArgs,
    #[command(flatten)]
    run: RunArgs,
}

/// The report of a run.
#[derive(Debug, serde::Serialize)]
struct FusionReport<'a> {
    #[serde(flatten)]
    run: &'a RunReport,
    /// Hertz of the output, rounded.
    rate: u64,
    /// Input frames read.
    frames: u64,
    /// Samples dropped at the beginning so that the output lines up with the inputs; with --keep-latency
    /// only those that the algorithm adds.
    latency_dropped: usize,
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
    let mut observer = args.run.observer.begin(&bank, args.run.force, false)?;
    let job = args.job(&bank);
    args.fuse(&job, &mut observer).inspect_err(|failure| observer.fail(failure))
}

impl FusionReport<'_> {
    /// The figures of --measure; what was written, and whether the captures agree with the bank.
    fn text(&self, output: &Path) -> String {
        let figures = self.measure.as_ref().map_or_else(String::new, before_after::text);
        let (samples, clipped) = (counted(self.run.outcome.samples, "sample"), self.run.outcome.clipped);
        let rate = self.rate as f64;
        let length = readable(self.run.outcome.samples as f64 / rate, "s");
        let level =
            if self.peak > 0.0 { format!(" ({:.1} dBFS)", 20.0 * self.peak.log10()) } else { String::new() };
        let clipped = if clipped == 0 { "none".to_owned() } else { clipped.to_string() };
        format!(
            "{figures}{}: {samples} at {} = {length}, peak {:.4}{level}, {clipped} clipped\n{}\n",
            Quoted(output),
            readable(rate, "S/s"),
            self.peak,
            self.captures
        )
    }
}

impl Args {
    /// Refuses impossible combinations of options, before any file is read.
    fn check(&self) -> Result<(), Failure> {
        self.reading.check(self.run.interleaved.is_given())?;
        self.before_after.check(&self.inputs, &self.output, self.run.force)?;
        self.instants.track.check(&self.output)?;
        let prints = self.before_after.is_wanted();
        self.run.check(&self.bank, &self.inputs, &self.output, container_of(&self.output), prints)
    }

    fn job<'a>(&'a self, bank: &'a Bank) -> BankRun<'a> {
        BankRun {
            args: &self.run,
            bank,
            bank_path: &self.bank,
            output: &self.output,
            container: container_of(&self.output),
            format: self.bits,
            dropped: if self.keep_latency { DroppedLatency::Added } else { DroppedLatency::All },
            is_live: false,
            flush: true,
            lossless: "--bits 32f",
        }
    }

    fn fuse(&self, job: &BankRun<'_>, observer: &mut RunObserver) -> Result<(), Failure> {
        let begin = Instant::now();
        if self.instants.stamps {
            return tracked::fuse_stamps(job, &self.inputs, &self.reading.format());
        }
        let track = self.instants.track.file();
        let tracked = track.map(|table| tracked::table_fusion(job, table)).transpose()?;
        let mut reader = self.start_reader(job, &mut |stall| observer.stalled(stall))?;
        if self.bit_true.is_wanted() {
            return self.bit_true.fuse(job, &mut reader, observer, || self.measured(job));
        }
        if let Some(fusion) = tracked {
            return tracked::run(job, fusion, reader, observer);
        }
        let rate = job.output_rate(&reader)?;
        let progress = progress_bar(reader.promised_frames());
        let plan = job.plan()?;
        let finished = job.run(&plan, &mut reader, observer, &|frames| progress.inc(frames))?;
        progress.finish_and_clear();
        let seconds = begin.elapsed().as_secs_f64();
        let measure = self.measured(job)?;
        let Finished { report: run, frames, dropped: latency_dropped, peak, captures, .. } = &finished;
        let (rate, frames, latency_dropped, peak) = (rate.round() as u64, *frames, *latency_dropped, *peak);
        let report = FusionReport { run, rate, frames, latency_dropped, peak, captures, seconds, measure };
        observer.end(&report)?;
        if self.run.json {
            return print_report(&report, &self.output);
        }
        // Where samples or events go to standard output nothing else does.
        let taken = [Some(self.output.as_path()), self.run.observer.report()];
        if taken.into_iter().flatten().any(is_dash) {
            return Ok(());
        }
        print(&report.text(&self.output))
    }

    fn start_reader(&self, job: &BankRun<'_>, on_stall: OnStall<'_>) -> Result<MultiReader, Failure> {
        job.start_reader(&self.inputs, self.reading.format(), on_stall)
    }

    /// Reads the inputs once more, and the output.
    fn measured(&self, job: &BankRun<'_>) -> Result<Option<BeforeAfter>, Failure> {
        if !self.before_after.is_wanted() {
            return Ok(None);
        }
        let reader = self.start_reader(job, &mut |_| {})?;
        self.before_after.measured(job.bank, reader, &self.output, self.run.force).map(Some)
    }
}

/// Drawn on a terminal only.
fn progress_bar(frames: Option<u64>) -> ProgressBar {
    let bar = frames.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
    let style = ProgressStyle::with_template("{bar:40} {percent}% {eta}");
    style.map_or(bar.clone(), |style| bar.with_style(style))
}
