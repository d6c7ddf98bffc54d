//! `hybank import`: filters of other tools, judged like our own.

use super::bank_file::load_spec_or_bank;
use super::design_report::{DesignReport, JudgedBank};
use super::print::{Failure, InFile, failed, failed_at, show, warn};
use super::proof_search::Searched;
use super::written::{check_output, write_text};
use hybank::design::{self, ProofSearch};
use hybank::files::{Bound, read_bytes};
use hybank::interchange::{TapsError, taps_of_csv, taps_of_npy};
use hybank::messages::Quoted;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Largest file of taps: those of the largest bank, written out.
const TAPS_FILE: Bound =
    Bound { bytes: 1 << 31, kind: "a file of taps", remedy: "give the file that was meant" };

/// Makes a bank of FIR filters from another tool, with its gamma and the proof
///
/// The spec gives the front ends, the delays, the rates and the latency; its design settings do not matter.
/// The taps are those of a filter at the fast rate per channel: columns of a CSV file (headings or not), or
/// the rows of a .npy array of the shape (channels, taps).
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank import spec.toml taps.csv -o bank.json
  hybank import spec.toml taps.npy --latency 16 -o bank.json")]
pub(super) struct Args {
    /// The spec (TOML), or a bank (JSON) that carries one
    spec: PathBuf,
    /// The taps (.csv or .npy)
    taps: PathBuf,
    /// The bank file (JSON)
    #[arg(short, long)]
    output: PathBuf,
    /// Latency in fast samples, in place of that of the spec
    #[arg(long)]
    latency: Option<usize>,
    /// Replace an existing bank file
    #[arg(long)]
    force: bool,
    /// Print all figures: gamma with its scale and its bounds, the mean errors, the proof
    #[arg(long, short, conflicts_with = "json")]
    verbose: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    check_output(&args.output, &[&args.spec, &args.taps], args.force)?;
    let mut spec = load_spec_or_bank(&args.spec)?.for_outputs(&[&args.output])?;
    spec.latency = args.latency.or(spec.latency);
    if spec.latency.is_none() {
        let problem = "it gives no latency, which taps from elsewhere have; give --latency, the delay of their output in fast samples";
        return Err(failed_at(&args.spec, problem));
    }
    let taps = read(&args.taps)?;
    let begin = Instant::now();
    let found = design::judge_taps(&spec, taps, ProofSearch::Run).in_file(&args.taps)?;
    let judged = JudgedBank::new(&found.bank).in_file(&args.taps)?;
    judged.warnings(&found.bank).iter().for_each(|warning| warn(warning));
    write_text(&args.output, &found.bank.to_json().map_err(failed)?, args.force)?;
    let seconds = (begin.elapsed() - found.proof_time).as_secs_f64();
    let found = Searched { design: found, cut: None };
    let report = DesignReport::new(args.output.display().to_string(), &found, judged, seconds);
    show(&report, args.json, |report| report.text(args.verbose))
}

/// Reads taps from the bytes of a file.
type Parse = fn(&[u8]) -> Result<Vec<Vec<f64>>, TapsError>;

/// The taps of a file, by its extension.
fn read(path: &Path) -> Result<Vec<Vec<f64>>, Failure> {
    let extension = path.extension().and_then(|extension| extension.to_str()).unwrap_or_default();
    let parse: Parse = match extension.to_ascii_lowercase().as_str() {
        "csv" => taps_of_csv,
        "npy" => taps_of_npy,
        _ => {
            let path = Quoted(path);
            return Err(Failure::Usage(format!("{path}: taps are read from .csv and .npy files")));
        }
    };
    let bytes = read_bytes(path, TAPS_FILE).map_err(failed)?;
    parse(&bytes).in_file(path)
}
