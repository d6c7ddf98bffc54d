//! `hybank design`: from a spec file to a bank file.

use super::bank_file::{bad_flag, load_spec};
use super::design_report::{Judged, Report};
use super::design_studies::BandHint;
use super::interrupt::{end_at_interrupt, end_with};
use super::print::{
    Failure, InFile, check_json, check_strict, failed, failed_at, is_dash, say, say_line, say_understood,
    show, warn,
};
use super::written::{check_output, write_text};
use crossbeam_channel::{Receiver, RecvTimeoutError, Sender, bounded};
use hybank::design::{self, DesignError, Effort, Limits, Options, Stage};
use hybank::messages::Quoted;
use hybank::spec::{DesignOverrides, Method, Reduction, Spec, WordLengths};
use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// A design is ended between two steps of its searches; so much later it is given up.
const PATIENCE: Duration = Duration::from_secs(60);

/// Designs the synthesis filters for a spec
///
/// The bank file holds the filters, the spec with all defaults filled in, and gamma, the worst-case gain
/// from the analog input to the error. Four values of gamma are stated, in normalised time: the computed
/// norm of this bank, an upper bound of its true norm, a lower bound for all banks of that method and size
/// (lower), and a lower bound for all banks of any latency (noncausal). If a proof of these values was
/// found, the file holds it too, for `hybank verify`.
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
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// Taps per channel, in place of those of the spec
    #[arg(long)]
    taps: Option<usize>,
    /// The fewest taps whose SNR is at least this many decibels, signal against error and noise (methods fir
    /// and h2)
    #[arg(long, value_name = "DB", conflicts_with = "taps")]
    snr: Option<f64>,
    /// Latency in fast samples, in place of that of the spec
    #[arg(long)]
    latency: Option<usize>,
    /// Share by which gamma may exceed its minimum, for a smaller mean-square error and output noise
    #[arg(long)]
    gamma_margin: Option<f64>,
    /// Integer taps of this many bits, sign included; or a list with the bits of each tap (4,6,8,6,4)
    #[arg(long)]
    bits: Option<WordLengths>,
    /// A tap is its integer times 2^-FRACTION_BITS; chosen for the least gamma if left out
    #[arg(long)]
    fraction_bits: Option<i32>,
    /// Integer taps of the fewest bits (of --bits at most), and of the fewest taps of that length, that
    /// lose at most this many decibels of SNR relative to the real taps
    #[arg(long, value_name = "DB", conflicts_with = "fraction_bits")]
    loss_db: Option<f64>,
    /// Delay-scheduled taps, optimal over the delays of the spec's [uncertainty] (method fir)
    #[arg(long, value_parser = ["affine"])]
    tracking: Option<String>,
    /// Use at most this many states (methods iir and h2)
    #[arg(long)]
    order: Option<usize>,
    /// Use the fewest states whose error is at most this many decibels above that of the full bank (methods
    /// iir and h2)
    #[arg(long, value_name = "DB", conflicts_with = "order")]
    reduction_loss_db: Option<f64>,
    /// Design even if the estimate exceeds ten minutes or the memory of the machine
    #[arg(long)]
    no_limit: bool,
    /// Make every warning about the spec and the bank an error
    #[arg(long)]
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

fn overrides(args: &Args) -> DesignOverrides {
    DesignOverrides {
        method: args.method,
        taps: args.taps,
        target_snr_db: args.snr,
        gamma_margin: args.gamma_margin,
        bits: args.bits.clone(),
        fraction_bits: args.fraction_bits,
        loss_db: args.loss_db,
        tracking: args.tracking.is_some(),
        reduction: args.order.map(Reduction::Order).or(args.reduction_loss_db.map(Reduction::Loss)),
    }
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    check_json(args.json, &args.output, "bank")?;
    check_output(&args.output, &[&args.spec], args.force)?;
    let mut spec = load_spec(&args.spec, overrides(args))?.for_outputs(&[&args.output])?;
    spec.latency = args.latency.or(spec.latency);
    // Everything else was checked on reading.
    spec.check().map_err(|problem| bad_flag("latency", &problem))?;
    say_understood(Some(&spec));
    warn_or_refuse(&spec_warnings(&spec, &args.spec), args.strict)?;
    let begin = Instant::now();
    end_at_interrupt();
    let progress = Progress::default();
    let limits = if args.no_limit { Limits::Off } else { Limits::Enforced };
    let options =
        Options { limits, observer: &|stage, effort| progress.note(stage, effort), ..Options::default() };
    let give_up = || give_up(&args.spec, &spec);
    let limit = limits.time().map(|limit| limit + PATIENCE);
    let found = progress.during(limit, give_up, || design::design(&spec, &options)).in_file(&args.spec)?;
    let seconds = (begin.elapsed() - found.proof_time).as_secs_f64();
    let mut judged = Judged::new(&found.bank).in_file(&args.spec)?;
    if !args.force {
        judged.check_useful(&found.bank).in_file(&args.spec)?;
    }
    warn_or_refuse(&judged.warnings(&found.bank), args.strict)?;
    write_text(&args.output, &found.bank.to_json().map_err(failed)?, args.force)?;
    judged.hint = BandHint::new(&found, seconds).in_file(&args.spec)?;
    let report = Report::new(args.output.display().to_string(), &found, judged, seconds);
    if is_dash(&args.output) {
        say(&report.text(args.verbose));
        return Ok(());
    }
    show(&report, args.json, |report| report.text(args.verbose))
}

/// Ends a design that its time limit cannot end, because one step of it takes too long.
fn give_up(path: &Path, spec: &Spec) {
    let error = DesignError::StoppedWithoutBank { remedy: design::remedy(spec) };
    let Failure::Input(message) = failed_at(path, error) else { return };
    end_with(&message);
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

/// Shorter designs say nothing on a terminal.
const SILENCE: Duration = Duration::from_secs(1);
/// Time between two updates of the display on a terminal.
const REDRAW_INTERVAL: Duration = Duration::from_millis(125);
/// Time between two lines where stderr is no terminal.
const LINE: Duration = Duration::from_secs(30);

/// What a design does now, and the estimate of all of it.
#[derive(Default)]
struct Progress {
    now: Mutex<Option<(Stage, Effort)>>,
}

impl Progress {
    /// The step that begins.
    fn note(&self, stage: Stage, effort: Effort) {
        *self.now.lock().unwrap_or_else(PoisonError::into_inner) = Some((stage, effort));
    }

    /// Runs `work` and shows meanwhile what it does; calls `give_up` if it has not ended by the `limit`.
    /// Without threads for that, nothing is shown and nothing limited.
    fn during<T>(
        &self,
        limit: Option<Duration>,
        give_up: impl FnOnce() + Send,
        work: impl FnOnce() -> T,
    ) -> T {
        thread::scope(|scope| {
            let (done_sender, done): (Sender<()>, _) = bounded(0);
            let end = done.clone();
            let overdue = move || {
                if limit.is_some_and(|limit| wait(&end, limit)) {
                    give_up()
                }
            };
            // A thread that cannot be started is no reason to fail.
            let begin = |name: &str| thread::Builder::new().name(name.into());
            let display = begin("progress").spawn_scoped(scope, move || self.report(&done));
            let limiter = begin("limit").spawn_scoped(scope, overdue);
            let result = work();
            drop((done_sender, display, limiter));
            result
        })
    }

    fn report(&self, done: &Receiver<()>) {
        let begin = Instant::now();
        if std::io::stderr().is_terminal() {
            self.draw(begin, done);
        } else {
            while wait(done, LINE) {
                self.text(begin).iter().for_each(|line| say_line(line));
            }
        }
    }

    fn draw(&self, begin: Instant, done: &Receiver<()>) {
        if !wait(done, SILENCE) {
            return;
        }
        let bar = ProgressBar::new_spinner();
        let bar = ProgressStyle::with_template("{spinner} {msg}")
            .map_or(bar.clone(), |style| bar.with_style(style));
        while wait(done, REDRAW_INTERVAL) {
            bar.set_message(self.text(begin).unwrap_or_default());
            bar.tick();
        }
        bar.finish_and_clear();
    }

    fn text(&self, begin: Instant) -> Option<String> {
        let (stage, effort) = (*self.now.lock().unwrap_or_else(PoisonError::into_inner))?;
        Some(line(stage, begin.elapsed(), effort))
    }
}

/// Whether the time is over; false if the work is done.
fn wait(done: &Receiver<()>, time: Duration) -> bool {
    done.recv_timeout(time) == Err(RecvTimeoutError::Timeout)
}

fn line(stage: Stage, elapsed: Duration, effort: Effort) -> String {
    let seconds = elapsed.as_secs();
    if effort.longest > elapsed.as_secs_f64() {
        format!("{stage}: {seconds} s of about {}", effort.time())
    } else {
        format!("{stage}: {seconds} s, more than expected")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_says_the_step_and_the_time_that_is_expected() {
        let said = |shortest, longest| {
            let effort = Effort { shortest, longest, bytes: 1e6 };
            line(Stage::Latency { designs: 7 }, Duration::from_secs(31), effort)
        };
        let step = "choosing the latency (7 designs compared): 31 s";
        assert_eq!(said(119.0, 120.4), format!("{step} of about 2.0 minutes"));
        assert_eq!(said(0.08, 120.4), format!("{step} of about 80 ms to 2.0 minutes"));
        assert_eq!(said(15.0, 20.0), format!("{step}, more than expected"));
    }

    #[test]
    fn the_result_of_the_work_comes_back() {
        assert_eq!(Progress::default().during(None, || (), || 7), 7);
    }

    #[test]
    fn work_that_does_not_end_in_time_is_given_up() {
        let (given_up, done) = bounded(1);
        let waited = || done.recv_timeout(Duration::from_secs(60));
        let waited = Progress::default().during(Some(Duration::ZERO), || given_up.send(()).unwrap(), waited);
        assert_eq!(waited, Ok(()));
        Progress::default().during(Some(Duration::from_secs(60)), || panic!("in time"), || ());
    }
}
