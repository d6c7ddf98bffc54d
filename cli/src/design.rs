//! `hybank design`: from a spec file to a bank file.

use super::bank_file::{bad_flag, load_spec};
use super::design_report::{DesignReport, JudgedBank};
use super::design_studies::BandHint;
use super::design_watch::DesignWatch;
use super::interrupt::interrupts;
use super::print::{
    Failure, InFile, PROGRAM, check_json, check_strict, failed, failed_at, is_dash, say, say_understood,
    show, warn,
};
use super::proof_search::{ProofLimit, Searched, proved};
use super::written::{check_output, write_text};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use hybank::design::{self, Design, DesignError, DesignOptions, Stop, TIME_LIMIT};
use hybank::messages::Quoted;
use hybank::spec::{DesignOverrides, Method, Spec, WordLengths};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// A design is ended between two steps of its searches; so much later it is given up.
const PATIENCE: Duration = Duration::from_secs(60);

/// Designs the synthesis filters for a spec
///
/// The bank file holds the filters, the spec with all defaults filled in, and gamma, the worst-case gain
/// from the signal's source w to the error; without [signal] w is the analog input. Four values of gamma are
/// stated, in normalised time: the computed norm of this bank, an upper bound of its true norm, and computed
/// lower bounds for all banks of that method and size (lower) and for all banks of any latency (noncausal).
/// The file is written as soon as the bank is finished. Then a proof of the upper bound is searched, for as
/// long as the design took, and for three seconds at least. If one is found, it joins the file, for `hybank
/// verify`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank design spec.toml -o bank.json
  hybank design spec.toml -o iir.json --method iir
  hybank design spec.toml -o bank.json --method h2 --snr 90
  hybank design spec.toml -o fixed.json --taps 64 --bits 14
  hybank design spec.toml -o fixed.json --loss-db 0.1
  hybank design spec.toml -o small.json --method iir --order 6
  hybank design spec.toml -o small.json --method iir --reduction-loss-db 0.5
  hybank design spec.toml -o - --taps 64 | hybank analyze -")]
pub(super) struct Args {
    /// The spec (TOML); `-` is standard input
    spec: PathBuf,
    /// The bank file (JSON); `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Design method, in place of that of the spec
    #[arg(long, value_parser = methods())]
    method: Option<Method>,
    /// Taps per channel, in place of those of the spec
    #[arg(long)]
    taps: Option<usize>,
    /// The fewest taps whose SNR is at least this many decibels, signal against error and noise (methods fir
    /// and h2)
    #[arg(long, value_name = "DB", conflicts_with = "taps")]
    snr: Option<f64>,
    /// The fewest taps whose images of a tone all lie at least this many decibels below it (methods fir and
    /// h2)
    #[arg(long, value_name = "DB", conflicts_with_all = ["taps", "snr"])]
    sfdr: Option<f64>,
    /// Latency in fast samples, in place of that of the spec
    #[arg(long)]
    latency: Option<usize>,
    /// Share by which gamma may exceed its minimum, for a smaller mean-square error and output noise
    #[arg(long, hide_short_help = true)]
    gamma_margin: Option<f64>,
    /// Integer taps of this many bits, sign included; or a list with the bits of each tap (4,6,8,6,4)
    #[arg(long)]
    bits: Option<WordLengths>,
    /// A tap is its integer times 2^-FRACTION_BITS; chosen for the least gamma if left out
    #[arg(long, hide_short_help = true)]
    fraction_bits: Option<i32>,
    /// Integer taps of the fewest bits (of --bits at most), and of the fewest taps of that length, that
    /// lose at most this many decibels of SNR relative to the real taps
    #[arg(long, value_name = "DB", conflicts_with = "fraction_bits", hide_short_help = true)]
    loss_db: Option<f64>,
    /// Use at most this many states (methods iir and h2)
    #[arg(long, hide_short_help = true)]
    order: Option<usize>,
    /// Use the fewest states whose error is at most this many decibels above that of the full bank (methods
    /// iir and h2)
    #[arg(long, value_name = "DB", conflicts_with = "order", hide_short_help = true)]
    reduction_loss_db: Option<f64>,
    /// Design for longer than ten minutes. By default a design ends then, as at the first Ctrl-C, with the
    /// best bank so far
    #[arg(long, hide_short_help = true)]
    no_limit: bool,
    /// Search for the proof until it is found or there is none, however long that takes
    #[arg(long, conflicts_with = "no_proof", hide_short_help = true)]
    prove: bool,
    /// Do not search for a proof
    #[arg(long, hide_short_help = true)]
    no_proof: bool,
    /// Make every warning about the spec and the bank an error
    #[arg(long, hide_short_help = true)]
    strict: bool,
    /// Replace an existing bank file, and write a bank that is of no use: its gamma above 0.9 of that of
    /// zero output, or less than 10 dB of the signal's SNR
    #[arg(long)]
    force: bool,
    /// Print all figures: gamma with its scale and its bounds, the mean errors, word lengths, order,
    /// robustness and the proof
    #[arg(long, short, conflicts_with = "json")]
    verbose: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

/// Reads `--method`.
fn methods() -> impl TypedValueParser<Value = Method> {
    let names = Method::ALL.map(|method| {
        PossibleValue::new(method.name()).help(match method {
            Method::Fir => "Finite impulse responses of given length, least gamma",
            Method::Iir => "State-space filters, least gamma",
            Method::H2 => {
                "State-space filters, or finite impulse responses with `taps`, least mean-square error"
            }
            Method::Sinc => {
                "Papoulis/Yen interpolation of recurrent nonuniform samples, truncated (for comparison)"
            }
            Method::Separation => {
                "First a fractional-delay filter per channel, then a bank for integer delays (for comparison)"
            }
        })
    });
    let method = |name: String| Method::ALL.into_iter().find(|method| method.name() == name);
    PossibleValuesParser::new(names).try_map(move |name| method(name).ok_or("no method"))
}

fn overrides(args: &Args) -> DesignOverrides {
    DesignOverrides {
        method: args.method,
        taps: args.taps,
        target_snr_db: args.snr,
        target_sfdr_db: args.sfdr,
        gamma_margin: args.gamma_margin,
        bits: args.bits.clone(),
        fraction_bits: args.fraction_bits,
        loss_db: args.loss_db,
        order: args.order,
        reduction_loss_db: args.reduction_loss_db,
        noise: None,
    }
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    check_json(args.json, &args.output, "bank")?;
    check_output(&args.output, &[&args.spec], args.force)?;
    let mut spec = load_spec(&args.spec, overrides(args))?.for_outputs(&[&args.output])?;
    spec.latency = args.latency.or(spec.latency);
    // Everything else was checked on reading.
    spec.check().map_err(|error| bad_flag("latency", error.problem()))?;
    say_understood(Some(&spec));
    warn_or_refuse(&spec_warnings(&spec, &args.spec), args.strict)?;
    let begin = Instant::now();
    let found = designed(args, &spec)?;
    let time = begin.elapsed();
    let mut judged = JudgedBank::new(&found.bank).in_file(&args.spec)?;
    if !args.force {
        judged.check_useful(&found.bank).in_file(&args.spec)?;
    }
    let is_ended = found.proof == Err(DesignError::Stopped);
    let ended = is_ended.then(|| format!("{}: {}", Quoted(&args.spec), DesignError::Stopped));
    let warnings: Vec<String> = judged.warnings(&found.bank).into_iter().chain(ended).collect();
    warn_or_refuse(&warnings, args.strict)?;
    let found = written(args, found, time)?;
    if !is_ended {
        judged.hint = BandHint::new(&found.design, time.as_secs_f64()).in_file(&args.spec)?;
    }
    let report = DesignReport::new(args.output.display().to_string(), &found, judged, time.as_secs_f64());
    if is_dash(&args.output) {
        say(&report.text(args.verbose));
        return Ok(());
    }
    show(&report, args.json, |report| report.text(args.verbose))
}

/// Writes the bank, and once more if the search for its proof changes it, so that an interrupt loses no
/// bank; standard output gets it once.
fn written(args: &Args, design: Design, time: Duration) -> Result<Searched, Failure> {
    let text = |design: &Design| design.bank.to_json().map_err(failed);
    let (finished, once) = (text(&design)?, is_dash(&args.output));
    if !once {
        write_text(&args.output, &finished, args.force)?;
    }
    let limit = match design.proof {
        Err(DesignError::Stopped) => ProofLimit::Ended,
        _ => ProofLimit::new(args.prove, args.no_proof, time),
    };
    let found = proved(design, limit)?;
    let searched = text(&found.design)?;
    if once || searched != finished {
        write_text(&args.output, &searched, true)?;
    }
    Ok(found)
}

/// The design of a spec. Its time limit and the first interrupt end it with what it has.
fn designed(args: &Args, spec: &Spec) -> Result<Design, Failure> {
    let time_limit = (!args.no_limit).then_some(TIME_LIMIT);
    let watch = DesignWatch {
        stop: Stop::default(),
        interrupts: interrupts(),
        at_interrupt: "interrupted: the design ends with the best bank so far",
        limit: time_limit.map(|limit| limit + PATIENCE),
        give_up: &|| give_up(&args.spec, spec),
        stage: Mutex::default(),
    };
    let observer = |stage| watch.note(stage);
    let stop = watch.stop.clone();
    let options = DesignOptions { time_limit, observer: &observer, stop, ..DesignOptions::without_proof() };
    watch.during(|| design::design(spec, &options)).in_file(&args.spec)
}

/// Ends a design that its time limit cannot end, because one step of it takes too long.
fn give_up(path: &Path, spec: &Spec) {
    let error = DesignError::StoppedWithoutBank { remedy: design::remedy(spec) };
    std::process::exit(i32::from(PROGRAM.fail(failed_at(path, error))));
}

/// What in the spec is probably not meant. A spec that is wrong is refused by the design.
fn spec_warnings(spec: &Spec, path: &Path) -> Vec<String> {
    let found = design::warnings(spec).unwrap_or_default();
    found.iter().map(|problem| format!("{}: {problem}", Quoted(path))).collect()
}

/// Prints the warnings; with `strict` the first one is an error.
fn warn_or_refuse(warnings: &[String], strict: bool) -> Result<(), Failure> {
    check_strict(warnings, strict)?;
    warnings.iter().for_each(|warning| warn(warning));
    Ok(())
}
