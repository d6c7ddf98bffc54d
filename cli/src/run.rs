//! How `fuse` and `stream` run a bank: their common options, the run from its plan to its files, the report.

use super::capture_args::{InterleavedArgs, check_stdin, output_rate};
use super::choice::{Choice, one_of};
use super::file_kind::unreadable;
use super::gaps::{GapArgs, say_gaps};
use super::interrupt::interrupts;
use super::observer::{ObserverArgs, RunObserver};
use super::output::{begin_samples, check_files};
use super::print::{Failure, InFile, check_strict, failed, stopped, warn, with_remains};
use hybank::bank::Bank;
use hybank::captures::{Converters, FileFormat};
use hybank::io::{
    Arrival, BLOCK_BYTES, Container, MultiReader, OnStall, OutputHeader, OutputNotes, PcmFormat, Placement,
    ReadOptions, RecordedFrames, is_sigmf,
};
use hybank::pipeline::{DroppedLatency, FileOutputs, Outcome, Pipeline, Settings, Warning};
use hybank::runtime::{Algorithm, Options, Plan, Precision, ThreadPool};
use std::path::{Path, PathBuf};

/// Options of the commands that fuse.
#[derive(Debug, clap::Args)]
pub(super) struct RunArgs {
    /// Algorithm of FIR filters; auto is the fastest for the bank, and direct with --gaps and in
    /// `stream`, because overlap-save adds latency (--json says how much)
    #[arg(long, value_parser = one_of(ALGORITHMS), default_value_t = Algorithm::Auto, hide_short_help = true)]
    algorithm: Algorithm,
    #[command(flatten)]
    pub(super) interleaved: InterleavedArgs,
    #[command(flatten)]
    pub(super) gaps: GapArgs,
    /// Threads that filter (FIR banks only), 0 for one per processor. The result has the same bits with any
    /// number. More than one thread helps with many taps or channels; otherwise reading and writing take
    /// longer than filtering
    #[arg(long, value_name = "T", default_value_t = 1, value_parser = clap::value_parser!(u16).range(0..=1024), hide_short_help = true)]
    threads: u16,
    #[command(flatten)]
    pub(super) observer: ObserverArgs,
    /// Make every tolerated fault (unequal lengths, truncation, an incomplete last frame, NaN, clipping) an
    /// error
    #[arg(long, hide_short_help = true)]
    pub(super) strict: bool,
    /// Replace an existing output
    #[arg(long)]
    pub(super) force: bool,
    /// Print a report as one JSON object on standard output, or on standard error if the samples are there
    #[arg(long)]
    pub(super) json: bool,
}

/// What `--algorithm` takes.
const ALGORITHMS: &[Choice<Algorithm>] = &[
    Choice { name: "auto", help: "The fastest algorithm that suits the command", value: Algorithm::Auto },
    Choice { name: "direct", help: "Computes every product; adds no latency", value: Algorithm::Direct },
    Choice {
        name: "overlap-save",
        help: "Fourier transforms of blocks; faster for long filters, adds latency",
        value: Algorithm::OverlapSave,
    },
];

impl RunArgs {
    /// Threads beside the calling one, if it does not do all.
    fn workers(&self) -> Result<Option<ThreadPool>, Failure> {
        let cores = || std::thread::available_parallelism().map_or(1, usize::from);
        let threads = if self.threads == 0 { cores() } else { self.threads.into() };
        if threads == 1 {
            return Ok(None);
        }
        let refused = |error| Failure::Input(format!("--threads {}: {error}; ask for fewer", self.threads));
        ThreadPool::new(threads).map(Some).map_err(refused)
    }

    /// Refuses impossible combinations of options, before any file is read. The command `prints` on standard
    /// output besides.
    pub(super) fn check(
        &self,
        bank: &Path,
        inputs: &[PathBuf],
        output: &Path,
        container: Container,
        prints: bool,
    ) -> Result<(), Failure> {
        check_stdin(inputs.iter().map(PathBuf::as_path).chain([bank]))?;
        self.gaps.check()?;
        self.interleaved.check(inputs.len())?;
        self.observer.check(output, self.json || prints)?;
        let inputs = inputs.iter().map(PathBuf::as_path).chain([bank]);
        let inputs: Vec<&Path> = inputs.chain(self.gaps.lost()).collect();
        let others = self.gaps.mask().into_iter().chain(self.observer.report());
        check_files(output, container, &others.collect::<Vec<&Path>>(), &inputs)
    }
}

/// A run: a bank, and what becomes of the outputs.
pub(super) struct BankRun<'a> {
    pub(super) args: &'a RunArgs,
    pub(super) bank: &'a Bank,
    pub(super) bank_path: &'a Path,
    pub(super) output: &'a Path,
    pub(super) container: Container,
    pub(super) format: PcmFormat,
    pub(super) dropped: DroppedLatency,
    /// Samples are fused as they arrive: no algorithm may add latency, an interrupt ends the run in order,
    /// and warnings come at once.
    pub(super) is_live: bool,
    /// The last samples are brought out by frames without a signal.
    pub(super) flush: bool,
    /// The option that keeps clipped samples.
    pub(super) lossless: &'a str,
}

/// A run whose outputs are written.
pub(super) struct Finished {
    pub(super) report: RunReport,
    /// Input frames read.
    pub(super) frames: u64,
    pub(super) is_interrupted: bool,
    /// Output samples dropped at the beginning.
    pub(super) dropped: usize,
    /// Largest magnitude of the output, of full scale.
    pub(super) peak: f64,
    /// Whether the captures agree with the spec of the bank.
    pub(super) captures: String,
}

impl BankRun<'_> {
    /// Begins to read inputs of this format.
    pub(super) fn start_reader(
        &self,
        inputs: &[PathBuf],
        format: FileFormat,
        on_stall: OnStall<'_>,
    ) -> Result<MultiReader, Failure> {
        let args = self.args;
        let lost = args.gaps.lost_samples()?;
        let converters = Converters::from(self.bank);
        let interleaving = args.interleaved.interleaving(&converters, self.bank_path)?;
        // Each thread takes about a block at a time, and more threads gain little.
        let block_bytes = if args.threads == 1 { BLOCK_BYTES } else { 8 * BLOCK_BYTES };
        let own = converters.options(format, inputs.len(), interleaving.as_ref());
        let files = args.gaps.read_options(lost.as_ref(), ReadOptions { block_bytes, ..own });
        let started = MultiReader::start(inputs, files, on_stall);
        started.map_err(unreadable)
    }

    fn options(&self) -> Options {
        let asked = self.args.algorithm;
        let adds_none = self.is_live || self.args.gaps.are_wanted();
        let algorithm = if adds_none { asked.without_added_latency() } else { asked };
        Options { precision: Precision::of(self.format), algorithm, ..Options::default() }
    }

    /// The plan of the run.
    pub(super) fn plan(&self) -> Result<Plan, Failure> {
        self.bank.plan(self.options()).in_file(self.bank_path)
    }

    /// The rate of the output in hertz, if the inputs fit the bank.
    pub(super) fn output_rate(&self, reader: &MultiReader) -> Result<f64, Failure> {
        output_rate(self.bank, self.bank_path, reader)
    }

    /// Fuses all frames and writes the outputs; `each` gets the number of frames of a step.
    pub(super) fn run(
        &self,
        plan: &Plan,
        reader: &mut MultiReader,
        observer: &mut RunObserver,
        each: &dyn Fn(u64),
    ) -> Result<Finished, Failure> {
        let (rate, is_complex) = (self.output_rate(reader)?, reader.is_complex());
        let workers = self.args.workers()?;
        let gaps = self.args.gaps.estimator(self.bank, self.bank_path)?;
        let settings = Settings { dropped: self.dropped, gaps, workers: workers.as_ref() };
        let pipeline = Pipeline::new(self.bank, plan, settings, self.format, is_complex);
        let mut outputs = self.outputs(rate, is_complex)?;
        let mut kept = Vec::new();
        if self.is_live {
            // What is recorded live cannot be recorded again.
            kept = outputs.keep();
            reader.stop_at(interrupts());
        }
        observer.check_captures(self.bank, !is_complex);
        let finished = self.record(pipeline, reader, outputs, observer, each);
        finished.map_err(|failure| with_remains(failure, &kept))
    }

    /// From the first frame to the names of the outputs.
    fn record(
        &self,
        mut pipeline: Pipeline<'_>,
        reader: &mut MultiReader,
        mut outputs: FileOutputs,
        observer: &mut RunObserver,
        each: &dyn Fn(u64),
    ) -> Result<Finished, Failure> {
        let is_interrupted = self.all_frames(reader, &mut pipeline, &mut outputs, observer, each)?;
        let latency = pipeline.plan().latency();
        let dropped = self.dropped.samples(pipeline.plan());
        let (outcome, peak) = self.drain(pipeline, reader.consumed(), &mut outputs)?;
        let checked = observer.checked();
        // A frame may hold several samples of a converter.
        let outcome = Outcome { channels: self.bank.channel_count(), ..outcome };
        let report = RunReport::new(outcome, self.tolerated(reader), self.lossless);
        let report = report.with(checked.warnings(), self.is_live);
        let shift = (latency - dropped) as u64;
        let (ratio, samples) = (self.bank.ratio as u64, report.outcome.samples);
        let placement = Placement { ratio, per_frame: 1, shift, samples };
        outputs.annotate(self.notes(reader, &report, placement)?);
        self.complete(outputs, &report, observer)?;
        let frames = reader.consumed();
        let is_clipped = reader.warnings().iter().any(|warning| warning.fault.is_clipping());
        let captures = checked.summary(is_clipped);
        Ok(Finished { report, frames, is_interrupted, dropped, peak, captures })
    }

    /// The outputs at their beginning, of `rate` hertz.
    pub(super) fn outputs(&self, rate: f64, is_complex: bool) -> Result<FileOutputs, Failure> {
        let Self { args, container, format, .. } = *self;
        let mask = args.gaps.begin_mask(args.force)?;
        let header = OutputHeader { container, format, is_complex, rate };
        let samples = begin_samples(self.output, header, args.force).map_err(stopped)?;
        Ok(FileOutputs::new(samples, mask))
    }

    /// Processes all frames; true if an interrupt ended them.
    fn all_frames(
        &self,
        reader: &mut MultiReader,
        pipeline: &mut Pipeline<'_>,
        outputs: &mut FileOutputs,
        observer: &mut RunObserver,
        each: &dyn Fn(u64),
    ) -> Result<bool, Failure> {
        each_block(reader, observer, |observer, recordings| {
            pipeline.push(recordings, &mut |block| outputs.write(block)).map_err(stopped)?;
            observer.step(recordings, pipeline);
            each(frames_of(recordings));
            Ok(())
        })
    }

    /// Brings out the last samples of a run of so many frames; those that frames without a signal bring out
    /// only if they are wanted.
    fn drain(
        &self,
        mut pipeline: Pipeline<'_>,
        frames: u64,
        outputs: &mut FileOutputs,
    ) -> Result<(Outcome, f64), Failure> {
        let so_far = pipeline.samples() + pipeline.pending();
        let samples = match (self.is_live, self.flush) {
            (false, _) => frames * self.bank.ratio as u64,
            (true, true) => so_far + (pipeline.plan().flush_frames() * self.bank.ratio) as u64,
            (true, false) => so_far,
        };
        pipeline.flush(samples, &mut |block| outputs.write(block)).map_err(stopped)?;
        let peak = pipeline.peak();
        Ok((pipeline.finish(), peak))
    }

    fn tolerated(&self, reader: &MultiReader) -> Vec<Warning> {
        let names = || reader.headers().map(|(name, _)| name.to_owned()).collect();
        let is_empty = !self.is_live && reader.consumed() == 0;
        let empty = is_empty.then(|| Warning::Empty(names()));
        reader.warnings().into_iter().map(Warning::Input).chain(empty).collect()
    }

    /// What of the inputs accompanies the output: metadata, gaps as annotations, the bank.
    fn notes(
        &self,
        reader: &MultiReader,
        report: &RunReport,
        placement: Placement,
    ) -> Result<OutputNotes, Failure> {
        let mut notes = reader.notes(placement);
        // Only this kind of output holds the rest.
        if is_sigmf(self.output) {
            notes.record_bank(&self.bank.digest().map_err(failed)?);
            for gap in report.outcome.gaps.iter().flat_map(|gaps| &gaps.list) {
                let comment = format!("channel {}: {} samples missing", gap.channel, gap.length);
                let per_frame = self.bank.samples.get(gap.channel - 1).map_or(1, |&samples| samples as u64);
                let placement = Placement { per_frame, ..placement };
                notes.annotate(placement, gap.first, gap.length, "gap", &comment);
            }
        }
        Ok(notes)
    }

    /// Checks the run, renames the outputs to their final names, and then prints the warnings, so that a
    /// warning that cannot be written loses no output.
    fn complete(
        &self,
        outputs: FileOutputs,
        report: &RunReport,
        observer: &RunObserver,
    ) -> Result<(), Failure> {
        let judged = check_strict(&report.warnings, self.args.strict);
        if judged.is_ok() {
            outputs.finish().map_err(stopped)?;
        }
        let are_said = observer.has_said_gaps();
        report.outcome.gaps.iter().for_each(|gaps| say_gaps(gaps, are_said));
        judged?;
        report.warnings[..report.warnings.len() - report.reported].iter().for_each(|warning| warn(warning));
        Ok(())
    }
}

/// Frames that all recordings have.
pub(super) fn frames_of(recordings: &[RecordedFrames<'_>]) -> u64 {
    recordings.iter().map(RecordedFrames::frames).min().unwrap_or(0) as u64
}

/// Hands over all frames, block by block; true if an interrupt ended them.
pub(super) fn each_block(
    reader: &mut MultiReader,
    observer: &mut RunObserver,
    mut take: impl FnMut(&mut RunObserver, &[RecordedFrames<'_>]) -> Result<(), Failure>,
) -> Result<bool, Failure> {
    loop {
        match reader.wait(&mut |stall| observer.stalled(stall)).map_err(stopped)? {
            Arrival::Frames(count) => {
                take(observer, &reader.frames())?;
                reader.consume(count);
            }
            Arrival::End => return Ok(false),
            Arrival::Stopped => return Ok(true),
        }
    }
}

/// What every command that fuses reports.
#[derive(Debug, serde::Serialize)]
pub(super) struct RunReport {
    #[serde(flatten)]
    pub(super) outcome: Outcome,
    warnings: Vec<String>,
    /// How many of the last warnings were reported during the run.
    #[serde(skip)]
    reported: usize,
}

impl RunReport {
    /// Of an outcome and what was tolerated before; `lossless` is the option that would have kept clipped
    /// samples.
    fn new(outcome: Outcome, tolerated: Vec<Warning>, lossless: &str) -> Self {
        let text = |warning| match warning {
            Warning::Clipped(_) => format!("{warning}; {lossless} keeps them"),
            _ => warning.to_string(),
        };
        let warnings = tolerated.into_iter().chain(outcome.warnings()).map(text).collect();
        Self { outcome, warnings, reported: 0 }
    }

    /// With those of the captures.
    fn with(mut self, captures: Vec<String>, are_reported: bool) -> Self {
        self.reported = if are_reported { captures.len() } else { 0 };
        self.warnings.extend(captures);
        self
    }
}
