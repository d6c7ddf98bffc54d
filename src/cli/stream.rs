//! `hybank stream`: fuses slow samples as they arrive.

use super::capture_args::coding;
use super::file_kind::unreadable;
use super::follow::Follow;
use super::gaps::GapArgs;
use super::interrupt::interrupts;
use super::journal::{Journal, JournalArgs};
use super::output::{begin_samples, check_files, precision};
use super::run::{RunReport, ThreadArgs, algorithms, carried, complete, print_report};
use super::say::say_line;
use super::say::say_understood;
use super::track::TrackArgs;
use super::turns::TurnArgs;
use super::watch::{UNWATCHED, Watch};
use super::{Failure, bank_file, match_bank};
use crate::bank::Bank;
use crate::io::{
    BLOCK_BYTES, Coding, Container, MultiReader, OutputHeader, PcmFormat, Placement, ReadOptions,
    is_self_describing,
};
use crate::pipeline::{Ending, FileOutputs, Pipeline, Settings, Warning, run as run_pipeline};
use crate::runtime::{Algorithm, Options, Plan};
use std::path::{Path, PathBuf};

/// Fuses slow samples as they arrive
///
/// Reads interleaved frames (one sample of each channel, in the order of the bank) from standard input, or
/// the channels of each --input. Writes the M output samples of a frame as soon as its inputs have arrived.
/// The output is causal: it is delayed by the latency of the bank, and nothing is dropped.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Sample formats, as in ffmpeg:
  s8 u8 s16le s16be s24le s24be s32le s32be f32le f32be f64le f64be, and wav; cf32, cs16, cu8, .. are complex

Examples:
  capture | hybank stream bank.json --format s16le > fast.raw
  hybank stream bank.json --input ch1.fifo --input ch2.fifo --format f32le | analyse
  hybank stream bank.json --input ch1.sigmf-meta --input ch2.sigmf-meta -o fast.sigmf-meta
  capture | hybank stream bank.json --format s16le --interleaved 4 > fast.raw
  receive | hybank stream bank.json --format cs16 --output-format cf32 > fast.iq
  sox both.flac -t wav - | hybank stream bank.json --format wav | play -t wav -

An interrupt (Ctrl-C) ends the stream after whole frames; a second one ends it at once.")]
pub(super) struct Args {
    /// The bank (JSON), as `hybank design` writes it
    bank: PathBuf,
    /// Sample format of the input; with c before it for complex samples
    #[arg(long, value_name = "FORMAT", default_value = "f32le", value_parser = coding)]
    format: Coding,
    /// Sample format of the output [default: that of the input]
    #[arg(long, value_name = "FORMAT", value_parser = coding)]
    output_format: Option<Coding>,
    /// A FIFO or file. Give the option once per channel, or once for an input that holds all channels. A
    /// SigMF recording (a name that ends in sigmf-meta) states its own format and channels
    #[arg(long, value_name = "FILE")]
    input: Vec<PathBuf>,
    /// The output file, which appears when it is complete (a SigMF recording if its name ends in
    /// sigmf-meta), or a FIFO; `-` is standard output
    #[arg(short, long, default_value = "-")]
    output: PathBuf,
    /// Algorithm of FIR filters; auto is direct, because overlap-save adds latency (--json says how much)
    #[arg(long, value_parser = algorithms(), default_value_t = Algorithm::Auto)]
    algorithm: Algorithm,
    /// Output the last samples at the end, as many as the latency, with zeros for input
    #[arg(long)]
    flush: bool,
    #[command(flatten)]
    turns: TurnArgs,
    #[command(flatten)]
    gaps: GapArgs,
    #[command(flatten)]
    track: TrackArgs,
    #[command(flatten)]
    threads: ThreadArgs,
    #[command(flatten)]
    journal: JournalArgs,
    /// Make every tolerated fault (an incomplete last frame, unequal lengths, NaN, clipping) an error
    #[arg(long)]
    strict: bool,
    /// Replace an existing output
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output, or on standard error if the samples are there
    #[arg(long)]
    json: bool,
}

/// The report of a run.
#[derive(Debug, serde::Serialize)]
struct Report<'a> {
    #[serde(flatten)]
    run: &'a RunReport,
    /// Input frames read.
    frames: u64,
    /// True if a signal ended the stream.
    interrupted: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let inputs = args.inputs();
    args.check(&inputs)?;
    let bank = bank_file::load(&args.bank)?;
    say_understood(bank.spec.as_ref());
    args.check_inputs(&inputs, bank.channel_count())?;
    let journal = args.journal.begin(args.force)?;
    stream(args, &inputs, &bank, &journal).inspect_err(|failure| journal.fail(failure))
}

fn stream(args: &Args, inputs: &[PathBuf], bank: &Bank, journal: &Journal) -> Result<(), Failure> {
    let plan = args.plan(bank)?;
    let Some(mut reader) = args.start_reader(inputs, bank, journal)? else { return Ok(()) };
    match_bank::check_channels(bank, &args.bank, &reader)?;
    let rate = match_bank::output_rate(bank, &reader)?;
    let is_complex = reader.is_complex();
    args.check_output(is_complex)?;
    let mut pipeline = args.pipeline(bank, &plan, rate, is_complex)?;
    let mut outputs = args.outputs(rate, is_complex)?;
    let is_watched = !is_complex && !args.track.is_wanted();
    let watch = if is_watched { Watch::new(bank) } else { Watch::idle(UNWATCHED) };
    let mut watch = watch.live(journal.clone());
    let mut follow = Follow::new(journal.clone());
    let ending = run_pipeline(&mut reader, &mut pipeline, &mut outputs, |parts, pipeline| {
        watch.observe(parts);
        follow.step(parts, pipeline);
    });
    let ending = ending.map_err(Failure::running)?;
    pipeline.settle(&mut outputs).map_err(Failure::running)?;
    follow.step(&[], &pipeline);
    let reported = pipeline.warnings().to_vec();
    if args.flush {
        let samples = pipeline.plan().flush_frames() * bank.ratio;
        pipeline.flush(pipeline.samples() + samples as u64, &mut outputs).map_err(Failure::running)?;
    }
    let tolerated = reader.warnings().into_iter().map(Warning::Input).collect();
    let run = RunReport::new(pipeline.finish(), tolerated, "--output-format f32le");
    let run = run.with_reported([reported, watch.finish().warnings].concat());
    let (ratio, shift) = (bank.ratio as u64, plan.latency() as u64);
    let placement = Placement { ratio, shift, samples: run.samples };
    outputs.annotate(carried(&reader, run.gaps(), bank, &args.output, placement)?);
    let (frames, interrupted) = (reader.consumed(), ending == Ending::Stopped);
    let report = Report { run: &run, frames, interrupted };
    complete(outputs, &run, args.strict, journal)?;
    journal.end(&report)?;
    let printed = if args.json { print_report(&report, &args.output) } else { Ok(()) };
    if interrupted && printed.is_ok() {
        say_line(&format!("interrupted after {frames} frames, {} samples written", run.samples));
    }
    printed
}

impl Args {
    fn inputs(&self) -> Vec<PathBuf> {
        if self.input.is_empty() { vec!["-".into()] } else { self.input.clone() }
    }

    /// Refuses impossible combinations of options, before any file is read.
    fn check(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        match_bank::check_stdin(&self.bank, inputs)?;
        self.gaps.check()?;
        self.turns.check(inputs.len())?;
        self.journal.check(&self.output, self.json)?;
        let inputs = inputs.iter().map(PathBuf::as_path).chain([self.bank.as_path()]);
        let inputs: Vec<&Path> = inputs.chain(self.gaps.lost()).chain(self.track.input()).collect();
        self.track.check(self.algorithm)?;
        let others = self.gaps.mask().into_iter().chain(self.journal.report()).chain(self.track.log());
        check_files((&self.output, self.container()), &others.collect::<Vec<&Path>>(), &inputs)
    }

    /// Raw inputs are one interleaved or one per channel; other formats state their channels.
    fn check_inputs(&self, inputs: &[PathBuf], channels: usize) -> Result<(), Failure> {
        let raw = self.format != Coding::Wav && !inputs.iter().any(|path| is_self_describing(path));
        if raw && inputs.len() != 1 && inputs.len() != channels {
            return Err(Failure::Usage(format!(
                "--input is given {} times; the bank has {channels} channels, so give it {channels} times, once, or not at all",
                inputs.len()
            )));
        }
        Ok(())
    }

    /// `None` if an interrupt came first.
    fn start_reader(
        &self,
        inputs: &[PathBuf],
        bank: &Bank,
        journal: &Journal,
    ) -> Result<Option<MultiReader>, Failure> {
        let lost = self.gaps.live_lost_samples()?;
        let turns = self.turns.turns(bank, &self.bank)?;
        let block_bytes = self.threads.bytes(BLOCK_BYTES);
        let channels = if inputs.len() == 1 { bank.channel_count() } else { 1 };
        let (turns, stalls) = (turns.as_ref(), journal.stall_watch());
        let (coding, stalls) = (self.format, Some(&stalls));
        let raw = ReadOptions { coding, channels, turns, block_bytes, stalls, ..ReadOptions::files() };
        let options = self.gaps.read_options(&lost, raw);
        MultiReader::start(inputs, options, interrupts()).map_err(unreadable)
    }

    fn container(&self) -> Container {
        if self.output_coding() == Coding::Wav { Container::Wav } else { Container::Raw }
    }

    fn output_coding(&self) -> Coding {
        self.output_format.unwrap_or(self.format)
    }

    /// How output samples are stored; a WAV stream has 32-bit floats.
    fn output_format(&self) -> PcmFormat {
        self.output_coding().format().unwrap_or(PcmFormat::F32Le)
    }

    /// Real samples cannot be written as complex ones.
    fn check_output(&self, is_complex: bool) -> Result<(), Failure> {
        match self.output_format {
            Some(format) if format.is_complex() && !is_complex => {
                let message =
                    "--output-format is complex, but the input is real; leave out the c before its name";
                Err(Failure::Usage(message.into()))
            }
            _ => Ok(()),
        }
    }

    fn plan(&self, bank: &Bank) -> Result<Plan, Failure> {
        bank_file::plan(bank, self.options(), &self.bank)
    }

    fn options(&self) -> Options {
        let precision = precision(self.output_format());
        let algorithm = self.algorithm.without_added_latency();
        Options { precision, algorithm, ..Options::default() }
    }

    /// For an output of `rate` hertz.
    fn pipeline(&self, bank: &Bank, plan: &Plan, rate: f64, is_complex: bool) -> Result<Pipeline, Failure> {
        self.track.check_samples(is_complex)?;
        let (format, gaps, workers) = (self.output_format(), self.gaps.policy(), self.threads.workers()?);
        let settings = Settings { format, is_complex, skip: 0, gaps, workers };
        let pipeline = Pipeline::new(bank, plan, settings).map_err(Failure::running)?;
        self.track.followed(pipeline, (bank, &self.bank), self.options(), rate)
    }

    /// The outputs at their beginning, of `rate` hertz.
    fn outputs(&self, rate: f64, is_complex: bool) -> Result<FileOutputs, Failure> {
        let mask = self.gaps.begin_mask(self.force)?;
        let header =
            OutputHeader { container: self.container(), format: self.output_format(), is_complex, rate };
        let samples = begin_samples(&self.output, header, self.force);
        let log = self.track.begin_log(self.force)?;
        Ok(FileOutputs::new(samples.map_err(Failure::running)?, mask).with_log(log))
    }
}
