//! `hybank fuse`: slow recordings in, one fast recording out.

use super::Failure;
use super::gaps::{GapArgs, GapReport, GapStage};
use super::output::{Bits, FastWriter, run_warnings};
use super::{bank_file, match_bank};
use crate::bank::Bank;
use crate::io::{Capture, PcmFrames, SampleLayout};
use crate::runtime::{Options, PcmOutput, PlanSummary, Precision, Reconstructor};
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use std::time::Instant;

/// Bytes of a block's larger side: stays in the second-level cache.
const BLOCK_BYTES: usize = 128 << 10;

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
    /// Keep the bank's latency: the causal output, as `stream` gives it
    #[arg(long)]
    keep_latency: bool,
    #[command(flatten)]
    gaps: GapArgs,
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
    /// How the bank ran.
    plan: PlanSummary,
    channels: usize,
    ratio: usize,
    /// Samples a second of the output.
    rate: u32,
    /// Slow ticks read.
    ticks: u64,
    /// Fast samples written.
    samples: u64,
    /// Samples dropped at the beginning so that the output lines up with the inputs.
    latency_dropped: u64,
    /// Output samples that saturated.
    clipped: u64,
    /// Input samples that were NaN or infinite and became 0.
    replaced: u64,
    /// Times that a recursion's state was not finite and began anew.
    state_resets: u64,
    /// Missing samples, if --gaps asked for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    gaps: Option<GapReport>,
    seconds: f64,
    warnings: Vec<String>,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: Args) -> Result<(), Failure> {
    args.check()?;
    let begin = Instant::now();
    let bank = bank_file::load(&args.bank)?;
    let mut capture = Capture::open(&args.inputs).map_err(Failure::input)?;
    let channels = || capture.headers().map(|(name, header)| (name, header.channels));
    match_bank::check_channels(&bank, &args.bank, channels())?;
    let slow_rate =
        match_bank::check_rates(&bank, capture.headers().map(|(name, header)| (name, header.rate)))?;
    let rate = match_bank::fast_rate(&bank, slow_rate)?;
    let stream = args.reconstructor(&bank)?;
    let mut job = Job {
        progress: progress_bar(capture.promised_ticks()),
        writer: FastWriter::create(&args.output, args.bits, rate, args.force)?,
        skip: if args.keep_latency { 0 } else { stream.latency() as u64 },
        flush: !args.keep_latency,
        stream,
        gaps: args.gaps.stage(&bank, args.force)?,
        clipped: 0,
        buffer: Vec::new(),
    };
    job.pump(&mut capture)?;
    let report = job.report(&capture, rate, begin);
    args.finish(job, &report)
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

    fn reconstructor(&self, bank: &Bank) -> Result<Reconstructor, Failure> {
        let precision = if self.bits.needs_double() { Precision::Double } else { Precision::Single };
        let options = Options { precision, ..Options::default() };
        Reconstructor::with_options(bank, options)
            .map_err(|error| Failure::Input(format!("{}: {error}", self.bank.display())))
    }

    /// Judges the run, then gives the output its name.
    fn finish(&self, job: Job, report: &Report) -> Result<(), Failure> {
        if report.ticks == 0 {
            let names: Vec<_> = self.inputs.iter().map(|path| path.display().to_string()).collect();
            return Err(Failure::Input(format!(
                "{}: no samples to fuse (the length is zero)",
                names.join(", ")
            )));
        }
        if let (true, Some(first)) = (self.strict, report.warnings.first()) {
            return Err(Failure::Input(format!("{first} (an error because of --strict)")));
        }
        for warning in &report.warnings {
            eprintln!("hybank: warning: {warning}");
        }
        job.writer.finish()?;
        job.gaps.map_or(Ok(()), GapStage::close)?;
        if self.json {
            println!("{}", serde_json::to_string(report).map_err(Failure::input)?);
        }
        Ok(())
    }
}

/// A run under way.
struct Job {
    stream: Reconstructor,
    gaps: Option<GapStage>,
    writer: FastWriter,
    progress: ProgressBar,
    /// Samples still to be dropped.
    skip: u64,
    flush: bool,
    clipped: u64,
    buffer: Vec<u8>,
}

impl Job {
    fn pump(&mut self, capture: &mut Capture) -> Result<(), Failure> {
        let block = self.block_ticks(capture);
        loop {
            let ticks = capture.read(block).map_err(Failure::input)?;
            self.fuse(&capture.frames(), u64::MAX)?;
            self.progress.inc(ticks as u64);
            if ticks < block {
                break;
            }
        }
        if self.flush {
            self.flush(capture.ticks())?;
        }
        self.progress.finish_and_clear();
        Ok(())
    }

    fn block_ticks(&self, capture: &Capture) -> usize {
        let slow = capture.headers().map(|(_, header)| header.frame_bytes()).sum::<usize>();
        let fast = self.stream.ratio() * self.writer.format().bytes();
        (BLOCK_BYTES / slow.max(fast)).clamp(64, 1 << 16)
    }

    /// Fuses a block and writes what is not to be dropped, at most `limit` samples.
    fn fuse(&mut self, frames: &[PcmFrames<'_>], limit: u64) -> Result<(), Failure> {
        let filled = self.gaps.as_mut().map(|stage| [stage.fill(frames)]);
        let frames = filled.as_ref().map_or(frames, |filled| &filled[..]);
        let ticks = frames.iter().map(PcmFrames::frames).min().unwrap_or(0);
        let format = self.writer.format();
        self.buffer.resize(ticks * self.stream.ratio() * format.bytes(), 0);
        let mut output = PcmOutput { format, bytes: &mut self.buffer, clipped: 0 };
        let samples = self.stream.process_pcm(frames, &mut output).map_err(Failure::input)? as u64;
        self.clipped += output.clipped;
        let skip = self.skip.min(samples);
        self.skip -= skip;
        let end = samples.min(skip.saturating_add(limit));
        let range = skip as usize..end as usize;
        if let Some(stage) = &mut self.gaps {
            stage.write_mask(range.clone())?;
        }
        self.writer.write(&self.buffer[range.start * format.bytes()..range.end * format.bytes()])
    }

    /// Zeros until there are M samples for each of `ticks` ticks.
    fn flush(&mut self, ticks: u64) -> Result<(), Failure> {
        let wanted = ticks * self.stream.ratio() as u64;
        let layout = SampleLayout::packed(crate::io::PcmFormat::F32Le);
        let zeros = vec![0; 1024 * self.stream.channels() * 4];
        while self.writer.samples() < wanted {
            let missing = wanted - self.writer.samples();
            let needed = (missing + self.skip).div_ceil(self.stream.ratio() as u64).min(1024) as usize;
            let channels = self.stream.channels();
            let frames = PcmFrames { layout, channels, bytes: &zeros[..needed * channels * 4] };
            self.fuse(&[frames], missing)?;
        }
        Ok(())
    }

    fn report(&mut self, capture: &Capture, rate: u32, begin: Instant) -> Report {
        let mut warnings: Vec<String> = capture.notes().iter().map(ToString::to_string).collect();
        warnings.extend(run_warnings(&self.stream, self.clipped, "--bits 32f"));
        Report {
            plan: self.stream.plan(),
            channels: self.stream.channels(),
            ratio: self.stream.ratio(),
            rate,
            ticks: capture.ticks(),
            samples: self.writer.samples(),
            latency_dropped: if self.flush { self.stream.latency() as u64 } else { 0 },
            clipped: self.clipped,
            replaced: self.stream.replaced(),
            state_resets: self.stream.state_resets(),
            gaps: self.gaps.as_mut().map(GapStage::report),
            seconds: begin.elapsed().as_secs_f64(),
            warnings,
        }
    }
}

/// Drawn on a terminal only.
fn progress_bar(ticks: Option<u64>) -> ProgressBar {
    let bar = ticks.map_or_else(ProgressBar::new_spinner, ProgressBar::new);
    let style = ProgressStyle::with_template("{bar:40} {percent}% {eta}");
    style.map_or(bar.clone(), |style| bar.with_style(style))
}
