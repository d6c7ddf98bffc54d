//! `hybank fuse`: slow recordings in, one fast recording out.

use super::Failure;
use super::fusing::{FormArg, Fusing, RunReport, ThreadArgs};
use super::gaps::GapArgs;
use super::interrupt::interrupts;
use super::output::{Bits, Container, FastWriter, precision};
use super::{bank_file, match_bank};
use crate::bank::Bank;
use crate::io::{Arrival, BLOCK_BYTES, Feed, FeedOptions};
use crate::runtime::{Form, Options, Stream};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::time::Instant;

/// Fuses slow recordings into one fast recording
///
/// The recordings are one mono WAV file a channel, in the order of the bank, or one N-channel WAV
/// file. The result lines up with their time axis and has exactly M samples for each tick: the
/// first m0 samples are dropped and the end is flushed with zeros.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank fuse bank.json left.wav right.wav -o fused.wav
  hybank fuse bank.json both.wav -o fused.wav --bits 24 --force
  sox capture.flac -t wav - | hybank fuse bank.json - -o - | play -t wav -")]
pub(super) struct Args {
    /// The bank: what `hybank design` wrote
    bank: PathBuf,
    /// One mono WAV file or SigMF recording a channel, or one of N channels; `-` is standard input
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// The fused WAV file (or SigMF recording, if it ends in sigmf-meta); `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Samples of the output: integers of 16, 24 or 32 bits, floats of 32 or 64 bits
    #[arg(long, value_enum, default_value_t = Bits::F32)]
    bits: Bits,
    /// Form of FIR filters; auto: whichever is faster for the bank, and direct with --gaps
    #[arg(long, value_enum, default_value_t = FormArg::Auto)]
    form: FormArg,
    /// Keep the bank's latency: the causal output, as `stream` gives it
    #[arg(long)]
    keep_latency: bool,
    #[command(flatten)]
    gaps: GapArgs,
    #[command(flatten)]
    threads: ThreadArgs,
    /// Make every tolerated fault (unequal lengths, truncation, NaN, clipping) an error
    #[arg(long)]
    strict: bool,
    /// Replace an existing output
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

/// What happened.
#[derive(Debug, serde::Serialize)]
struct Report {
    #[serde(flatten)]
    run: RunReport,
    /// Hertz of the output, rounded.
    rate: u64,
    /// Slow ticks read.
    ticks: u64,
    /// Samples dropped at the beginning so that the output lines up with the inputs; with --keep-latency only those that
    /// are due to the form.
    latency_dropped: u64,
    seconds: f64,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: Args) -> Result<(), Failure> {
    args.check()?;
    let begin = Instant::now();
    let bank = bank_file::load(&args.bank)?;
    let lost = args.gaps.lost()?;
    let options = FeedOptions {
        lost: lost.as_ref(),
        until: args.gaps.until(),
        block_bytes: args.threads.bytes(BLOCK_BYTES),
        ..FeedOptions::files()
    };
    let feed = Feed::start(&args.inputs, options, interrupts()?).map_err(Failure::input)?;
    let mut feed = feed.ok_or_else(|| interrupted(0))?;
    let channels = || feed.headers().map(|(name, channels, _)| (name, channels));
    match_bank::check_channels(&bank, &args.bank, channels())?;
    let slow_rate = match_bank::check_rates(&bank, feed.headers().map(|(name, _, rate)| (name, rate)))?;
    let rate = match_bank::fast_rate(&bank, slow_rate);
    let mut fusing = args.fusing(&bank, rate)?;
    let latency_dropped = fusing.skip;
    pump(&mut fusing, &mut feed)?;
    fusing.flush(feed.ticks() * bank.ratio as u64)?;
    let mut notes = feed.notes();
    notes.extend((feed.ticks() == 0).then(|| args.nothing_to_fuse()));
    let report = Report {
        run: fusing.report(notes, "--bits 32f"),
        rate: rate.round() as u64,
        ticks: feed.ticks(),
        latency_dropped,
        seconds: begin.elapsed().as_secs_f64(),
    };
    args.finish(fusing, &report)
}

impl Args {
    fn check(&self) -> Result<(), Failure> {
        match_bank::check_stdin(&self.bank, &self.inputs)?;
        if self.json && self.output.as_os_str() == "-" {
            let message = "--json and `-o -` both want standard output; write the samples to a file";
            return Err(Failure::Usage(message.into()));
        }
        Ok(())
    }

    /// The run at its beginning, with an output of `rate` hertz.
    fn fusing(&self, bank: &Bank, rate: f64) -> Result<Fusing, Failure> {
        let format = self.bits.format();
        // Outside of what a gap touched the output is to have the very bits of a whole recording.
        let auto = if self.gaps.are_bridged() { Form::Direct } else { Form::Fastest };
        let form = self.form.form(auto);
        let options = Options { precision: precision(format), form, ..Options::default() };
        let stream = bank
            .plan(options)
            .map(|plan| Stream::new(&plan))
            .map_err(|error| Failure::Input(format!("{}: {error}", self.bank.display())))?;
        let extra = stream.extra_latency();
        let gaps = self.gaps.stage(bank, extra, self.force)?;
        let writer = FastWriter::create(&self.output, Container::Wav, format, rate, self.force)?;
        let skip = if self.keep_latency { extra } else { stream.latency() };
        Fusing::new(stream, gaps, writer, skip as u64, self.threads)
    }

    /// What is said of recordings without a tick: the output is as empty as they are.
    fn nothing_to_fuse(&self) -> String {
        let names: Vec<_> = self.inputs.iter().map(|path| path.display().to_string()).collect();
        format!("{}: no samples to fuse (the length is zero), so the output has none", names.join(", "))
    }

    /// Judges the run, then gives the output its name.
    fn finish(&self, fusing: Fusing, report: &Report) -> Result<(), Failure> {
        report.run.judge(self.strict)?;
        fusing.finish()?;
        if self.json { super::print_json(report) } else { Ok(()) }
    }
}

/// All ticks there are.
fn pump(fusing: &mut Fusing, feed: &mut Feed) -> Result<(), Failure> {
    let progress = progress_bar(feed.promised_ticks());
    loop {
        match feed.wait().map_err(Failure::input)? {
            Arrival::Ticks(ticks) => {
                fusing.fuse(&feed.frames(), u64::MAX)?;
                feed.consume(ticks);
                progress.inc(ticks as u64);
            }
            Arrival::End => break,
            Arrival::Stopped => return Err(interrupted(feed.ticks())),
        }
    }
    progress.finish_and_clear();
    Ok(())
}

fn interrupted(ticks: u64) -> Failure {
    Failure::Input(format!("interrupted after {ticks} ticks; nothing was kept, run it again"))
}

/// Drawn on a terminal only.
fn progress_bar(ticks: Option<u64>) -> ProgressBar {
    let bar = ticks.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
    let style = ProgressStyle::with_template("{bar:40} {percent}% {eta}");
    style.map_or(bar.clone(), |style| bar.with_style(style))
}
