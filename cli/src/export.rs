//! `hybank export`: a bank for other tools.

use super::bank_file::load;
use super::choice::{Choice, named, one_of};
use super::print::{Failure, InFile, check_json, failed, is_dash, print_json, warn};
use super::written::{begin_file, check_output, check_outputs, write_bytes, write_together};
use hybank::bank::{Bank, SynthesisFilters};
use hybank::design::analyze;
use hybank::interchange::{Circuit, Format, Verilog, VerilogOptions, block_of_sections, export, sections};
use hybank::messages::Quoted;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};

/// Writes a bank for other tools: C99, Verilog, CSV, NumPy, MATLAB, FPGA memory
///
/// The order of FIR taps is the same in every format: channel, then phase of the output, then lag in slow
/// periods. coe and mem hold integer taps (`hybank design --bits`), and with offsets the constants that
/// their sums need, as comments. sos is a table of the second-order sections of a recursive bank at the
/// slow rate: the filter from a channel to a phase of the output is the sum of its sections z^-delay (b0 +
/// b1 z^-1 + b2 z^-2) / (a0 + a1 z^-1 + a2 z^-2). Its first line is a comment with the gamma of the
/// sections as they are written.
///
/// verilog is a module with the bits of `fuse --bit-true`: words as wide as their values need, or an
/// --accumulator that wraps. Its header and --json say what it takes.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank export bank.json --format c -o bank.h
  hybank export bank.json -o bank.mat
  hybank export fixed.json -o core.v --input-bits 12 --output-bits 14 --testbench test
  hybank export fixed.json -o core.v --input-bits 12 --clocks-per-frame 8
  hybank export fixed.json -o core.v --input-bits 12 --loadable --testbench test
  hybank export other.json -o other.mem --input-bits 12 --loadable
  hybank export recursive.json --format sos -o sections.csv")]
pub(super) struct Args {
    /// The bank (JSON); `-` is standard input
    bank: PathBuf,
    /// The format [default: that of the output's extension: h, v, csv, mat, coe or mem]
    #[arg(long, value_parser = one_of(FORMATS))]
    format: Option<Format>,
    /// The file to write; `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Bits of the samples that integer code takes: offsets are relative to their full scale (c, coe, mem,
    /// verilog; there those of the spec's converters if left out)
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u32).range(2..=32))]
    input_bits: Option<u32>,
    /// Prefix of the C identifiers, or the Verilog module [default: bank; of a module the name of its file]
    #[arg(long)]
    name: Option<String>,
    /// Print what was written as one JSON object on standard output
    #[arg(long)]
    json: bool,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    verilog: VerilogArgs,
}

impl Args {
    fn chosen_format(&self) -> Result<Format, Failure> {
        let extension = self.output.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
        let extension = extension.to_ascii_lowercase();
        // A header is the only C that is written, and a table of sections has the ending of any CSV.
        let meant = match extension.as_str() {
            "h" => Some(Format::C99),
            "v" => Some(Format::Verilog),
            name => named(FORMATS, name).filter(|format| !matches!(format, Format::C99 | Format::Sos)),
        };
        self.format.or(meant).ok_or_else(|| {
            let message = "the name does not say which format it is to have; give --format c, verilog, csv, mat, coe, mem or sos";
            Failure::Usage(format!("{}: {message}", Quoted(&self.output)))
        })
    }
}

/// What `--format` takes.
const FORMATS: &[Choice<Format>] = &[
    Choice { name: "c", help: "A C99 header with a streaming function", value: Format::C99 },
    Choice { name: "csv", help: "Comma-separated values, one coefficient per line", value: Format::Csv },
    Choice { name: "mat", help: "A MATLAB file (level 4), which SciPy reads too", value: Format::Mat },
    Choice { name: "coe", help: "A coefficient file of Xilinx tools", value: Format::Coe },
    Choice { name: "mem", help: "Hexadecimal words for $readmemh", value: Format::Mem },
    Choice { name: "sos", help: "Second-order sections (CSV)", value: Format::Sos },
    Choice { name: "verilog", help: "A module in Verilog-2001", value: Format::Verilog },
];

/// The circuit of a Verilog module.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Verilog")]
struct VerilogArgs {
    /// Bits of the outputs, which saturate [default: those of the samples]
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u32).range(2..=32), hide_short_help = true)]
    output_bits: Option<u32>,
    /// Bits of the accumulator; sums that do not fit wrap around [default: as many as no sum can leave]
    #[arg(long, value_name = "B", value_parser = clap::value_parser!(u32).range(2..=64), hide_short_help = true)]
    accumulator: Option<u32>,
    /// Clocks between two frames: with C of them, each multiplier serves C taps [default: 1]
    #[arg(long, value_name = "C")]
    clocks_per_frame: Option<NonZeroU32>,
    /// Frames that a clock takes: sample x(i + N r) and output y(p + M r) belong to the frame r of the clock
    /// [default: 1]
    #[arg(long, value_name = "P", hide_short_help = true)]
    frames_per_clock: Option<NonZeroU32>,
    /// Taps and offsets are written through a port, so that one synthesis serves every bank of this size;
    /// with --format mem the words of such a port
    #[arg(long)]
    loadable: bool,
    /// Levels of adders between two registers [default: 1]
    #[arg(long, value_name = "LEVELS", hide_short_help = true)]
    pipeline: Option<NonZeroU32>,
    /// Write a self-checking testbench into this folder too, with its frames and the outputs of the
    /// bit-true model
    #[arg(long, value_name = "DIR")]
    testbench: Option<PathBuf>,
    /// Random frames of the testbench, after those of the worst signs [default: 1000]
    #[arg(long, value_name = "FRAMES", requires = "testbench", hide_short_help = true)]
    random_frames: Option<u32>,
}

impl VerilogArgs {
    fn is_given(&self) -> bool {
        let numbers = [self.output_bits, self.accumulator, self.random_frames].iter().any(Option::is_some);
        let circuit = [self.clocks_per_frame, self.frames_per_clock, self.pipeline];
        numbers || circuit.iter().any(Option::is_some) || self.testbench.is_some() || self.loadable
    }

    fn options(&self, input_bits: Option<u32>) -> VerilogOptions {
        let plain = VerilogOptions::default();
        VerilogOptions {
            input_bits,
            output_bits: self.output_bits,
            accumulator_bits: self.accumulator,
            clocks_per_frame: self.clocks_per_frame.unwrap_or(plain.clocks_per_frame),
            frames_per_clock: self.frames_per_clock.unwrap_or(plain.frames_per_clock),
            pipeline: self.pipeline.unwrap_or(plain.pipeline),
            is_loadable: self.loadable,
        }
    }
}

/// What was written.
#[derive(Debug, serde::Serialize)]
struct ExportReport {
    output: String,
    /// The folder of a testbench.
    #[serde(skip_serializing_if = "Option::is_none")]
    testbench: Option<String>,
    /// What a Verilog module takes.
    #[serde(flatten)]
    circuit: Option<Circuit>,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let format = args.chosen_format()?;
    let is_load = format == Format::Mem && args.verilog.loadable && args.verilog.testbench.is_none();
    if format != Format::Verilog && args.verilog.is_given() && !is_load {
        let message = "these options describe a circuit; give --format verilog, or leave out --output-bits, --accumulator, \
             --clocks-per-frame, --frames-per-clock, --loadable, --pipeline and --testbench";
        return Err(Failure::Usage(message.to_owned()));
    }
    check_json(args.json, &args.output, "code")?;
    check_output(&args.output, &[&args.bank], args.force)?;
    let bank = load(&args.bank)?;
    let circuit = match format {
        Format::Verilog => Some(write_verilog(args, &bank)?),
        _ => {
            let name = args.name.as_deref().unwrap_or("bank");
            let mut bytes = match is_load {
                true => {
                    let options = args.verilog.options(args.input_bits);
                    let words = Verilog::new(&bank, name, &options).in_file(&args.bank)?.load;
                    words.unwrap_or_default().into_bytes()
                }
                false => export(&bank, format, name, args.input_bits).in_file(&args.bank)?,
            };
            if format == Format::Sos {
                bytes.splice(0..0, gamma_of_sections(&bank).in_file(&args.bank)?.bytes());
            }
            write_bytes(&args.output, &bytes, args.force)?;
            None
        }
    };
    match args.json {
        true => {
            let testbench = args.verilog.testbench.as_ref().map(|folder| folder.display().to_string());
            print_json(&ExportReport { output: args.output.display().to_string(), testbench, circuit })
        }
        false => Ok(()),
    }
}

/// Writes the module, and the testbench with it.
fn write_verilog(args: &Args, bank: &Bank) -> Result<Circuit, Failure> {
    let options = args.verilog.options(args.input_bits);
    // Linters want a module to have the name of its file.
    let stem = args.output.file_stem().and_then(|stem| stem.to_str());
    let name = args.name.as_deref().or(stem.filter(|_| !is_dash(&args.output))).unwrap_or("bank");
    let verilog = Verilog::new(bank, name, &options).in_file(&args.bank)?;
    warn_of_words(&verilog.circuit, &options);
    let Some(folder) = &args.verilog.testbench else {
        write_bytes(&args.output, verilog.text.as_bytes(), args.force)?;
        return Ok(verilog.circuit);
    };
    let bench = verilog.testbench(args.verilog.random_frames.unwrap_or(1000)).map_err(failed)?;
    let mut files: Vec<_> = bench.into_iter().map(|(name, text)| (folder.join(name), text)).collect();
    let circuit = verilog.circuit;
    files.push((args.output.clone(), verilog.text));
    let paths: Vec<&Path> = files.iter().map(|(path, _)| path.as_path()).collect();
    check_outputs(&paths, &[&args.bank])?;
    let begin = |(path, text): &(PathBuf, String)| Ok(vec![begin_file(path, text.as_bytes(), args.force)?]);
    write_together(folder, files.iter().map(Ok), begin)?;
    Ok(circuit)
}

/// Says where the circuit is another one than a user may expect of his options.
fn warn_of_words(circuit: &Circuit, options: &VerilogOptions) {
    let Circuit { accumulator_bits, needed_accumulator_bits, clocks_per_frame, .. } = *circuit;
    if accumulator_bits < needed_accumulator_bits {
        warn(&format!(
            "sums wrap around in the accumulator of {accumulator_bits} bits; {needed_accumulator_bits} would hold all"
        ));
    }
    let asked = options.clocks_per_frame.get();
    if clocks_per_frame < asked as usize {
        warn(&format!(
            "no more than {clocks_per_frame} clocks have work in a frame, so in_ready is there after as many, and not \
             after {asked}"
        ));
    }
}

/// A line with the gamma of the numbers that were written; empty where the front ends are unknown.
fn gamma_of_sections(bank: &Bank) -> Result<String, Box<dyn std::error::Error>> {
    if bank.spec.is_none() {
        return Ok(String::new());
    }
    let block = block_of_sections(&sections(bank)?, bank.frame_samples(), bank.ratio);
    let written = Bank { filters: SynthesisFilters::StateSpace(block), ..bank.clone() };
    let gamma = analyze(&written, &[])?.gamma;
    let bank = bank.gamma.norm.map_or_else(String::new, |gamma| format!("; of the bank {gamma:e}"));
    Ok(format!("# gamma of these sections {gamma:e}{bank}; z^-1 is one slow period\n"))
}
