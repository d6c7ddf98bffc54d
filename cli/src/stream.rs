//! `hybank stream`: fuses slow samples as they arrive.

use super::capture_args::{ScaleArgs, check_channels, coding};
use super::observer::RunObserver;
use super::output::is_wav;
use super::print::{print_report, say_line, say_understood};
use super::run::{BankRun, Finished, RunArgs, RunReport};
use super::table_args::TableArgs;
use super::tracked::{self, TrackArgs};
use super::{Failure, bank_file};
use hybank::bank::Bank;
use hybank::captures::FileFormat;
use hybank::io::{Coding, Container, PcmFormat, is_self_describing};
use hybank::messages::Quoted;
use hybank::pipeline::DroppedLatency;
use hybank::quantity;
use hybank::units::Hertz;
use std::path::PathBuf;

/// Fuses slow samples as they arrive
///
/// Reads interleaved frames (one sample of each channel, in the order of the bank) from standard input, or
/// the channels of each --input. Writes the M output samples of a frame as soon as its inputs have arrived;
/// WAV with 24 valid bits in 32 is looked at for 64 KiB first.
/// The output is causal: it is delayed by the latency of the bank, and nothing is dropped.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  capture | hybank stream bank.json --format s16le > fast.raw
  hybank stream bank.json --input ch1.fifo --input ch2.fifo --format f32le | analyse
  hybank stream bank.json --input ch1.sigmf-meta --input ch2.sigmf-meta -o fast.sigmf-meta
  receive | hybank stream bank.json --format cs16 --output-format cf32 > fast.iq
  sox both.flac -t wav - | hybank stream bank.json --format wav | play -t wav -

An interrupt (Ctrl-C) ends the stream after whole frames; a second one ends it at once.")]
pub(super) struct Args {
    /// The bank (JSON), as `hybank design` writes it
    bank: PathBuf,
    /// Sample format of the input, as in ffmpeg (s16le, f32le, ..), wav or csv
    ///
    /// s8 u8 s16le s16be s24le s24be s32le s32be f32le f32be f64le f64be, also unsigned ones; with c before
    /// it for complex samples: cf32, cs16, cu8.
    #[arg(long, value_name = "FORMAT", default_value = "f32le", value_parser = coding)]
    format: Coding,
    /// Sample format of the output [default: wav for the name x.wav, else that of the input; f32le for
    /// tables]
    #[arg(long, value_name = "FORMAT", value_parser = output_coding, hide_short_help = true)]
    output_format: Option<Coding>,
    #[command(flatten)]
    scale: ScaleArgs,
    #[command(flatten)]
    table: TableArgs,
    /// Interleaved channels of each raw input [default: 1 each, or all in a single input]
    #[arg(long, value_name = "C", value_parser = clap::value_parser!(u16).range(1..), hide_short_help = true)]
    channels: Option<u16>,
    /// A FIFO or file: once per channel, or once for an input that holds all channels
    ///
    /// A SigMF recording (a name that ends in sigmf-meta) states its own format and channels.
    #[arg(long, value_name = "FILE")]
    input: Vec<PathBuf>,
    /// What is given as in `fuse`, without the option.
    #[arg(hide = true)]
    names: Vec<PathBuf>,
    /// The output, a file or a FIFO; `-` is standard output
    ///
    /// A file appears when it is complete. It is a SigMF recording if its name ends in sigmf-meta.
    #[arg(short, long, default_value = "-")]
    output: PathBuf,
    /// Output the last samples at the end, as many as the latency, with zeros for input
    #[arg(long, conflicts_with_all = ["track", "pilot"], hide_short_help = true)]
    flush: bool,
    #[command(flatten)]
    track: TrackArgs,
    /// Follow delays that change by a tone beside the signal, whose frequency is known to 100 ppm
    ///
    /// Its phases in blocks of 2048 frames tell the delays, from those of the bank on; the samples come one
    /// and a half blocks later. Where it is not found the delays stay, and a warning at the end says in how
    /// many blocks. The predicted SNR does not count the errors of these delays.
    #[arg(long, value_name = "F", value_parser = pilot, conflicts_with_all =
          ["track", "algorithm", "gaps", "report", "threads", "lost", "mask", "longest"])]
    pilot: Option<Hertz>,
    #[command(flatten)]
    run: RunArgs,
}

/// The frequency of a pilot.
fn pilot(text: &str) -> Result<Hertz, String> {
    match quantity::frequency(text) {
        Ok(frequency) if frequency.0 > 0.0 => Ok(frequency),
        Ok(frequency) => Err(format!("the pilot is at {frequency}; give a frequency above 0")),
        Err(error) => Err(error.to_string()),
    }
}

/// The coding of the output; tables are only read.
fn output_coding(name: &str) -> Result<Coding, String> {
    match coding(name)? {
        Coding::Csv => Err("csv is a format of inputs; write wav or a raw format such as f64le".into()),
        coding => Ok(coding),
    }
}

/// The report of a run.
#[derive(Debug, serde::Serialize)]
struct StreamReport<'a> {
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
    if let Some(name) = args.names.first() {
        let message = format!("{}: give each input after --input, or none for standard input", Quoted(name));
        return Err(Failure::Usage(message));
    }
    let inputs = args.inputs();
    check_channels(args.channels, args.format)?;
    args.run.check(&args.bank, &inputs, &args.output, args.container(), false)?;
    args.track.check(&args.output)?;
    let bank = bank_file::load(&args.bank)?;
    say_understood(bank.spec.as_ref());
    args.check_inputs(&inputs, bank.channel_count())?;
    let mut observer = args.run.observer.begin(&bank, args.run.force, true)?;
    let job = args.job(&bank);
    args.stream(&job, &inputs, &mut observer).inspect_err(|failure| observer.fail(failure))
}

impl Args {
    fn job<'a>(&'a self, bank: &'a Bank) -> BankRun<'a> {
        BankRun {
            args: &self.run,
            bank,
            bank_path: &self.bank,
            output: &self.output,
            container: self.container(),
            // A WAV stream has 32-bit floats.
            format: self.output_coding().format().unwrap_or(PcmFormat::F32Le),
            dropped: DroppedLatency::Nothing,
            is_live: true,
            flush: self.flush,
            lossless: "--output-format f32le",
        }
    }

    fn stream(
        &self,
        job: &BankRun<'_>,
        inputs: &[PathBuf],
        observer: &mut RunObserver,
    ) -> Result<(), Failure> {
        // Before the inputs come; their headers may say complex samples.
        let plan = job.plan()?;
        let by_table = self.track.file().map(|table| tracked::table_fusion(job, table));
        let moving =
            by_table.or_else(|| self.pilot.map(|tone| tracked::pilot_fusion(job, tone))).transpose()?;
        let channels = self.channels.map(usize::from);
        let format = FileFormat {
            coding: self.format,
            channels,
            only: None,
            is_iq: false,
            full_scale: self.scale.full_scale,
            table: self.table.options(),
        };
        let mut reader = job.start_reader(inputs, format, &mut |stall| observer.stalled(stall))?;
        self.check_output(reader.is_complex())?;
        if let Some(fusion) = moving {
            return tracked::run(job, fusion, reader, observer);
        }
        let finished = job.run(&plan, &mut reader, observer, &|_| {})?;
        let Finished { report: run, frames, is_interrupted, .. } = &finished;
        let report = StreamReport { run, frames: *frames, interrupted: *is_interrupted };
        observer.end(&report)?;
        let printed = if self.run.json { print_report(&report, &self.output) } else { Ok(()) };
        if *is_interrupted && printed.is_ok() {
            say_line(&format!("interrupted after {frames} frames, {} samples written", run.outcome.samples));
        }
        printed
    }

    fn inputs(&self) -> Vec<PathBuf> {
        if self.input.is_empty() { vec!["-".into()] } else { self.input.clone() }
    }

    /// Raw inputs are one interleaved or one per channel, or have --channels each; other formats state
    /// theirs.
    fn check_inputs(&self, inputs: &[PathBuf], channels: usize) -> Result<(), Failure> {
        let raw = self.format.format().is_some() && !inputs.iter().any(|path| is_self_describing(path));
        if raw && self.channels.is_none() && inputs.len() != 1 && inputs.len() != channels {
            return Err(Failure::Usage(format!(
                "--input is given {} times; the bank has {channels} channels, so give it {channels} times, once, \
                 or not at all, or say with --channels how many each input holds",
                inputs.len()
            )));
        }
        Ok(())
    }

    fn container(&self) -> Container {
        if self.output_coding() == Coding::Wav { Container::Wav } else { Container::Raw }
    }

    fn output_coding(&self) -> Coding {
        let of_input = match self.format {
            _ if is_wav(&self.output) => Coding::Wav,
            Coding::Csv => Coding::Raw(PcmFormat::F32Le),
            format => format,
        };
        self.output_format.unwrap_or(of_input)
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
}
