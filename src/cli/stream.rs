//! `hybank stream`: slow samples in and fast samples out, as they come.

use super::fusing::{FormArg, Fusing, RunReport, ThreadArgs};
use super::gaps::GapArgs;
use super::interrupt::interrupts;
use super::output::{Container, FastWriter, is_sigmf, precision};
use super::{Failure, bank_file, match_bank};
use crate::bank::Bank;
use crate::io::{Arrival, BLOCK_BYTES, Coding, Feed, FeedOptions, PcmFormat};
use crate::runtime::{Form, Options, Stream};
use std::path::PathBuf;
use std::str::FromStr;

/// Fuses slow samples as they arrive
///
/// Reads interleaved ticks (one sample of each channel, in the order of the bank) from standard input,
/// or from each --input what it holds, and writes the M fast samples of a tick as soon as its inputs
/// are there. The output is causal: it is late by the bank's latency, and nothing is dropped.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sample formats, as in ffmpeg:
  s8 u8 s16le s16be s24le s24be s32le s32be f32le f32be f64le f64be, and wav

Examples:
  capture | hybank stream bank.json --format s16le > fast.raw
  hybank stream bank.json --input ch1.fifo --input ch2.fifo --format f32le | analyse
  hybank stream bank.json --input ch1.sigmf-meta --input ch2.sigmf-meta -o fast.sigmf-meta
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
    /// A FIFO or file with one channel, given once a channel, or with all of them, given once; a SigMF recording
    /// (a name that ends in sigmf-meta) tells its own format and channels
    #[arg(long, value_name = "FILE")]
    input: Vec<PathBuf>,
    /// Where the fast samples go: a file that appears when it is whole (a SigMF recording, if its name ends in
    /// sigmf-meta); standard output if left out
    #[arg(short, long, default_value = "-")]
    output: PathBuf,
    /// Form of FIR filters; auto is the faster one of direct and fast, because overlap-save makes the output later (--json
    /// tells by how much), and direct where gaps are bridged
    #[arg(long, value_enum, default_value_t = FormArg::Auto)]
    form: FormArg,
    /// Bring out the last samples at the end, as many as the latency, with zeros for input
    #[arg(long)]
    flush: bool,
    #[command(flatten)]
    gaps: GapArgs,
    #[command(flatten)]
    threads: ThreadArgs,
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
    #[serde(flatten)]
    run: RunReport,
    /// Slow ticks read.
    ticks: u64,
    /// True if a signal ended the stream.
    interrupted: bool,
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
    args.check_inputs(&inputs, bank.channel_count())?;
    let lost = args.gaps.lost()?;
    let options = FeedOptions {
        coding: args.format,
        channels: bank.channel_count(),
        lost: lost.as_ref(),
        until: args.gaps.until(),
        block_bytes: args.threads.bytes(BLOCK_BYTES),
    };
    let stream = args.start(&bank)?;
    let Some(mut feed) = Feed::start(&inputs, options, interrupts()?).map_err(Failure::input)? else {
        return Ok(());
    };
    let channels = || feed.headers().map(|(name, channels, _)| (name, channels));
    match_bank::check_channels(&bank, &args.bank, channels())?;
    let mut fusing = args.fusing(&bank, &feed, stream)?;
    let interrupted = pump(&mut fusing, &mut feed)?;
    if args.flush {
        let samples = fusing.stream.flush_ticks() * bank.ratio;
        fusing.flush(fusing.writer.samples() + samples as u64)?;
    }
    let run = fusing.report(feed.notes(), "--output-format f32le");
    args.finish(fusing, &Report { run, ticks: feed.ticks(), interrupted })
}

/// Until the input ends (false) or an interrupt comes (true).
fn pump(fusing: &mut Fusing, feed: &mut Feed) -> Result<bool, Failure> {
    loop {
        match feed.wait().map_err(Failure::input)? {
            Arrival::Ticks(ticks) => {
                fusing.fuse(&feed.frames(), u64::MAX)?;
                feed.consume(ticks);
            }
            Arrival::End => return Ok(false),
            Arrival::Stopped => return Ok(true),
        }
    }
}

impl Args {
    fn inputs(&self) -> Vec<PathBuf> {
        if self.input.is_empty() { vec!["-".into()] } else { self.input.clone() }
    }

    /// Raw inputs are one interleaved or one a channel; others say themselves what they hold.
    fn check_inputs(&self, inputs: &[PathBuf], channels: usize) -> Result<(), Failure> {
        let raw = matches!(self.format, Coding::Raw(_)) && !inputs.iter().any(|path| is_sigmf(path));
        if raw && inputs.len() != 1 && inputs.len() != channels {
            return Err(Failure::Usage(format!(
                "--input is given {} times; the bank has {channels} channels, so give it {channels} times, once, or not at all",
                inputs.len()
            )));
        }
        Ok(())
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

    fn start(&self, bank: &Bank) -> Result<Stream, Failure> {
        // Outside of what a gap touched the output is to have the very bits of a whole recording.
        let auto = if self.gaps.are_bridged() { Form::Direct } else { Form::FastestPrompt };
        let form = self.form.form(auto);
        let options = Options { precision: precision(self.output_format()), form, ..Options::default() };
        bank.plan(options)
            .map(|plan| Stream::new(&plan))
            .map_err(|error| Failure::Input(format!("{}: {error}", self.bank.display())))
    }

    /// The run at its beginning.
    fn fusing(&self, bank: &Bank, feed: &Feed, stream: Stream) -> Result<Fusing, Failure> {
        let rates = feed.headers().map(|(name, _, rate)| (name, rate));
        let rate = match_bank::fast_rate(bank, match_bank::check_rates(bank, rates)?);
        let container = if self.output_coding() == Coding::Wav { Container::Wav } else { Container::Raw };
        let gaps = self.gaps.stage(bank, stream.extra_latency(), self.force)?;
        let writer = FastWriter::create(&self.output, container, self.output_format(), rate, self.force)?;
        Fusing::new(stream, gaps, writer, 0, self.threads)
    }

    fn finish(&self, fusing: Fusing, report: &Report) -> Result<(), Failure> {
        report.run.judge(self.strict)?;
        if report.interrupted {
            let (ticks, samples) = (report.ticks, report.run.samples);
            eprintln!("hybank: interrupted after {ticks} ticks, {samples} samples written");
        }
        fusing.finish()?;
        if self.json { super::print_json(report) } else { Ok(()) }
    }
}
