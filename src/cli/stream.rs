//! `hybank stream`: slow samples in and fast samples out, as they come.

use super::gaps::{GapArgs, GapReport, GapStage};
use super::output::{failure, open_stdout, run_warnings};
use super::{Failure, bank_file, match_bank};
use crate::bank::Bank;
use crate::io::wav::stream_header;
use crate::io::{Arrival, AtomicFile, Coding, Feed, PcmFormat, PcmFrames, SampleLayout};
use crate::runtime::{Options, PcmOutput, PlanSummary, Precision, Reconstructor};
use crossbeam_channel::{Receiver, bounded};
use std::io::Write;
use std::path::PathBuf;
use std::str::FromStr;

/// Fuses slow samples as they arrive
///
/// Reads interleaved ticks (one sample of each channel, in the order of the bank) from standard input,
/// or one channel from each --input, and writes the M fast samples of a tick as soon as its inputs
/// are there. The output is causal: it is late by the bank's latency, and nothing is dropped.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sample formats, as in ffmpeg:
  s8 u8 s16le s16be s24le s24be s32le s32be f32le f32be f64le f64be, and wav

Examples:
  capture | hybank stream bank.json --format s16le > fast.raw
  hybank stream bank.json --input ch1.fifo --input ch2.fifo --format f32le | analyse
  sox both.flac -t wav - | hybank stream bank.json --format wav | play -t wav -

An interrupt (Ctrl-C) ends the stream after whole ticks; a second one ends it at once.")]
pub(super) struct Args {
    /// The bank: what `hybank design` wrote
    bank: PathBuf,
    /// How the samples are stored
    #[arg(long, value_name = "FORMAT", default_value = "f32le", value_parser = parse_coding)]
    format: Coding,
    /// How the output is stored, if not like the input
    #[arg(long, value_name = "FORMAT", value_parser = parse_coding)]
    output_format: Option<Coding>,
    /// A FIFO or file with one channel; give it once a channel, or once for all interleaved
    #[arg(long, value_name = "FILE")]
    input: Vec<PathBuf>,
    /// Where the fast samples go: a file that appears when it is whole; standard output if left out
    #[arg(short, long, default_value = "-")]
    output: PathBuf,
    /// Bring out the last m0 samples at the end, with zeros for input
    #[arg(long)]
    flush: bool,
    #[command(flatten)]
    gaps: GapArgs,
    /// Make every tolerated fault (a cut frame, unequal lengths, NaN, clipping) an error
    #[arg(long)]
    strict: bool,
    /// Replace an existing output
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output; needs --output
    #[arg(long)]
    json: bool,
}

fn parse_coding(name: &str) -> Result<Coding, String> {
    if name == "wav" {
        return Ok(Coding::Wav);
    }
    PcmFormat::from_str(name).map(Coding::Raw).map_err(|error| format!("{error}, or wav"))
}

/// What happened.
#[derive(Debug, serde::Serialize)]
struct Report {
    /// How the bank ran.
    plan: PlanSummary,
    channels: usize,
    ratio: usize,
    ticks: u64,
    samples: u64,
    clipped: u64,
    replaced: u64,
    state_resets: u64,
    interrupted: bool,
    /// Missing samples, if --gaps asked for them.
    #[serde(skip_serializing_if = "Option::is_none")]
    gaps: Option<GapReport>,
    warnings: Vec<String>,
}

/// Runs the verb.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let inputs = args.inputs();
    match_bank::check_stdin(&args.bank, &inputs)?;
    if args.json && args.output.as_os_str() == "-" {
        return Err(Failure::Usage("--json needs --output: standard output carries the samples".into()));
    }
    let bank = bank_file::load(&args.bank)?;
    let channels = bank.channel_count();
    if inputs.len() != 1 && inputs.len() != channels {
        return Err(Failure::Usage(format!(
            "--input is given {} times; the bank has {channels} channels, so give it {channels} times, once, or not at all",
            inputs.len()
        )));
    }
    let stream = args.reconstructor(&bank)?;
    let Some(mut feed) =
        Feed::start(&inputs, args.format, channels, interrupts()?).map_err(Failure::input)?
    else {
        return Ok(());
    };
    match_bank::check_channels(
        &bank,
        &args.bank,
        feed.headers().map(|(name, channels, _)| (name, channels)),
    )?;
    let mut job = Job::new(args, &bank, &feed, stream)?;
    let interrupted = job.pump(&mut feed)?;
    if args.flush {
        job.flush()?;
    }
    let report = job.report(&feed, interrupted);
    args.finish(job, &report)
}

impl Args {
    fn inputs(&self) -> Vec<PathBuf> {
        if self.input.is_empty() { vec!["-".into()] } else { self.input.clone() }
    }

    fn output_coding(&self) -> Coding {
        self.output_format.unwrap_or(self.format)
    }

    /// How output samples are stored; a WAV stream has 32-bit floats.
    fn output_format(&self) -> PcmFormat {
        match self.output_coding() {
            Coding::Raw(format) => format,
            Coding::Wav => PcmFormat::F32Le,
        }
    }

    fn reconstructor(&self, bank: &Bank) -> Result<Reconstructor, Failure> {
        use PcmFormat::{F64Be, F64Le, S32Be, S32Le};
        let wide = matches!(self.output_format(), F64Be | F64Le | S32Be | S32Le);
        let precision = if wide { Precision::Double } else { Precision::Single };
        Reconstructor::with_options(bank, Options { precision, ..Options::default() })
            .map_err(|error| Failure::Input(format!("{}: {error}", self.bank.display())))
    }

    fn finish(&self, job: Job, report: &Report) -> Result<(), Failure> {
        if let (true, Some(first)) = (self.strict, report.warnings.first()) {
            return Err(Failure::Input(format!("{first} (an error because of --strict)")));
        }
        report.warnings.iter().for_each(|warning| eprintln!("hybank: warning: {warning}"));
        if report.interrupted {
            eprintln!("hybank: interrupted after {} ticks, {} samples written", report.ticks, report.samples);
        }
        job.close()?;
        if self.json { super::print_json(report) } else { Ok(()) }
    }
}

/// A channel that speaks at the first interrupt; the second one ends the process.
#[cfg(unix)]
fn interrupts() -> Result<Receiver<()>, Failure> {
    use signal_hook::consts::{SIGINT, SIGTERM};
    let (tell, stop) = bounded(1);
    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM]).map_err(Failure::input)?;
    std::thread::spawn(move || {
        for (count, signal) in signals.forever().enumerate() {
            if count > 0 {
                std::process::exit(128 + signal);
            }
            // The receiver lives as long as the stream.
            let _ = tell.send(());
        }
    });
    Ok(stop)
}

#[cfg(not(unix))]
fn interrupts() -> Result<Receiver<()>, Failure> {
    Ok(crossbeam_channel::never())
}

/// Where the samples go.
enum Target {
    Stdout(Box<dyn Write>),
    File(AtomicFile),
}

/// A stream under way.
struct Job {
    stream: Reconstructor,
    gaps: Option<GapStage>,
    target: Target,
    name: String,
    format: PcmFormat,
    ticks: u64,
    samples: u64,
    clipped: u64,
    buffer: Vec<u8>,
}

impl Job {
    fn new(args: &Args, bank: &Bank, feed: &Feed, stream: Reconstructor) -> Result<Self, Failure> {
        let rates = feed.headers().filter_map(|(name, _, rate)| Some((name, rate?)));
        let rate = match args.format {
            Coding::Wav => match_bank::fast_rate(bank, match_bank::check_rates(bank, rates)?)?,
            // Raw samples carry no rate: the bank's own.
            Coding::Raw(_) => (1.0 / bank.fast_period).round().clamp(1.0, f64::from(u32::MAX)) as u32,
        };
        let target = if args.output.as_os_str() == "-" {
            Target::Stdout(open_stdout().map_err(|error| failure("standard output", error))?)
        } else {
            Target::File(AtomicFile::create(&args.output, args.force).map_err(Failure::input)?)
        };
        let name = if let Target::File(file) = &target {
            file.target().display().to_string()
        } else {
            "standard output".into()
        };
        let format = args.output_format();
        let gaps = args.gaps.stage(bank, args.force)?;
        let mut job =
            Self { stream, gaps, target, name, format, ticks: 0, samples: 0, clipped: 0, buffer: Vec::new() };
        if args.output_coding() == Coding::Wav {
            job.buffer = stream_header(format, 1, rate).map_err(|error| failure(&job.name, error))?;
            job.write()?;
        }
        Ok(job)
    }

    /// Until the input ends (false) or an interrupt comes (true).
    fn pump(&mut self, feed: &mut Feed) -> Result<bool, Failure> {
        loop {
            match feed.wait().map_err(Failure::input)? {
                Arrival::Ticks(ticks) => {
                    self.fuse(&feed.frames())?;
                    feed.consume(ticks);
                    self.ticks += ticks as u64;
                }
                Arrival::End => return Ok(false),
                Arrival::Stopped => return Ok(true),
            }
        }
    }

    fn fuse(&mut self, frames: &[PcmFrames<'_>]) -> Result<(), Failure> {
        let filled = self.gaps.as_mut().map(|stage| [stage.fill(frames)]);
        let frames = filled.as_ref().map_or(frames, |filled| &filled[..]);
        let ticks = frames.iter().map(PcmFrames::frames).min().unwrap_or(0);
        self.buffer.resize(ticks * self.stream.ratio() * self.format.bytes(), 0);
        let mut output = PcmOutput { format: self.format, bytes: &mut self.buffer, clipped: 0 };
        let samples = self.stream.process_pcm(frames, &mut output).map_err(Failure::input)?;
        self.samples += samples as u64;
        self.clipped += output.clipped;
        if let Some(stage) = &mut self.gaps {
            stage.write_mask(0..samples)?;
        }
        self.write()
    }

    /// Zeros until the last m0 samples are out.
    fn flush(&mut self) -> Result<(), Failure> {
        let channels = self.stream.channels();
        let layout = SampleLayout::packed(PcmFormat::F32Le);
        let zeros = vec![0; 256 * channels * 4];
        let mut left = self.stream.flush_ticks();
        while left > 0 {
            let ticks = left.min(256);
            self.fuse(&[PcmFrames { layout, channels, bytes: &zeros[..ticks * channels * 4] }])?;
            left -= ticks;
        }
        Ok(())
    }

    fn write(&mut self) -> Result<(), Failure> {
        let written = match &mut self.target {
            Target::Stdout(stdout) => stdout.write_all(&self.buffer),
            Target::File(file) => file.write_all(&self.buffer),
        };
        written.map_err(|error| failure(&self.name, error))
    }

    fn close(self) -> Result<(), Failure> {
        match self.target {
            Target::Stdout(mut stdout) => stdout.flush().map_err(|error| failure(&self.name, error))?,
            Target::File(file) => file.commit().map_err(Failure::input)?,
        }
        self.gaps.map_or(Ok(()), GapStage::close)
    }

    fn report(&mut self, feed: &Feed, interrupted: bool) -> Report {
        let mut warnings = feed.notes();
        warnings.extend(run_warnings(&self.stream, self.clipped, "--output-format f32le"));
        Report {
            plan: self.stream.plan(),
            channels: self.stream.channels(),
            ratio: self.stream.ratio(),
            ticks: self.ticks,
            samples: self.samples,
            clipped: self.clipped,
            replaced: self.stream.replaced(),
            state_resets: self.stream.state_resets(),
            interrupted,
            gaps: self.gaps.as_mut().map(GapStage::report),
            warnings,
        }
    }
}
