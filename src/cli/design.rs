//! `hybank design`: from a spec file to a bank file.

use super::Failure;
use super::bank_file::{is_dash, load_spec, write_text};
use crate::bank::{FixedPoint, SynthesisFilters};
use crate::design::quantise::WordStudy;
use crate::design::{self, Design, DesignError, MeanAnalysis, OrderReduction, OrderWorth};
use crate::spec::{DesignOverrides, Method, Reduction, WordLengths};
use crate::verify::Verified;
use std::path::PathBuf;
use std::time::Instant;

/// Designs the synthesis filters for a spec
///
/// The bank file holds the filters, the spec with all defaults filled in, and gamma: the exact worst-case gain from the
/// analog input to the error (upper), a proven lower bound for any bank of that method and size (lower), and the
/// bound that no latency can beat (noncausal), all in normalised time.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank design spec.toml -o bank.json
  hybank design spec.toml -o iir.json --method iir
  hybank design spec.toml -o fixed.json --taps 64 --bits 14
  hybank design spec.toml -o small.json --method iir --order 6
  hybank design spec.toml -o small.json --method iir --reduction-loss-db 0.5
  hybank design spec.toml -o - --taps 64 | hybank analyze -")]
pub(super) struct Args {
    /// The spec (TOML); `-` is standard input
    spec: PathBuf,
    /// The bank file (JSON); `-` is standard output
    #[arg(short, long)]
    output: PathBuf,
    /// Another method than the spec's
    #[arg(long, value_parser = parse_method)]
    method: Option<Method>,
    /// Another number of taps a channel than the spec's
    #[arg(long)]
    taps: Option<usize>,
    /// Another latency than the spec's, in fast samples
    #[arg(long)]
    latency: Option<usize>,
    /// Relative excess over the optimal gamma that may go into a smaller mean-square error and output noise
    #[arg(long)]
    slack: Option<f64>,
    /// Integer taps of so many bits, sign included; or a list of bits, one for each tap (4,6,8,6,4)
    #[arg(long)]
    bits: Option<WordLengths>,
    /// Integer taps times two to the minus this; chosen for the least gamma if left out
    #[arg(long, allow_negative_numbers = true)]
    fraction_bits: Option<i32>,
    /// At most so many states, with the least error that they allow (methods iir and h2)
    #[arg(long)]
    order: Option<usize>,
    /// As few states as keep the error within so many decibels of the full bank's (methods iir and h2)
    #[arg(long, value_name = "DB", conflicts_with = "order")]
    reduction_loss_db: Option<f64>,
    /// Replace an existing bank file
    #[arg(long)]
    force: bool,
    /// Print a report as one JSON object on standard output
    #[arg(long)]
    json: bool,
}

fn parse_method(text: &str) -> Result<Method, String> {
    let known = Method::ALL.map(Method::name).join(", ");
    Method::ALL
        .into_iter()
        .find(|method| method.name() == text)
        .ok_or_else(|| format!("the methods are {known}"))
}

#[derive(Debug, serde::Serialize)]
struct Report<'a> {
    bank: String,
    method: Method,
    channels: usize,
    ratio: usize,
    latency: usize,
    latency_chosen: bool,
    taps: Option<usize>,
    states: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    reduction: Option<&'a OrderReduction>,
    gamma: &'a crate::bank::Gamma,
    /// For integer taps.
    #[serde(skip_serializing_if = "Option::is_none")]
    words: Option<Words<'a>>,
    #[serde(flatten)]
    mean: MeanAnalysis,
    /// Hertz, at the slow rate to which all frequencies alias.
    peak_hertz: f64,
    iterations: usize,
    seconds: f64,
    #[serde(flatten)]
    proof: ProofReport,
    proof_seconds: f64,
}

/// What integer taps cost.
#[derive(Debug, serde::Serialize)]
struct Words<'a> {
    fraction_bits: i32,
    /// gamma of these integers over that of the real taps, both exact, in decibels.
    loss_db: f64,
    #[serde(flatten)]
    study: &'a WordStudy,
}

impl<'a> Words<'a> {
    fn of(design: &'a Design) -> Option<Self> {
        let (integers, study) = design.bank.fixed_point.as_ref().zip(design.words.as_ref())?;
        let loss_db = study.loss_db(design.bank.gamma.upper?);
        Some(Self { fraction_bits: integers.fraction_bits, loss_db, study })
    }

    fn text(&self) -> String {
        let mut text = format!(
            "integers   times 2^{}; gamma is {:.4} dB above that of the real taps, {}\n",
            -self.fraction_bits,
            self.loss_db,
            number(Some(self.study.real_gamma)),
        );
        for word in &self.study.words {
            text += &format!(
                "           {:>12} times 2^{}: {:.4} dB of gamma lost, {:.2} dB of mean square (each tap rounded: {:.4} dB of gamma)\n",
                word.bits.to_string(),
                -word.fraction_bits,
                word.loss_db,
                word.mean_square_loss_db,
                word.rounded_loss_db,
            );
        }
        text
    }
}

/// What `hybank verify` will say of the file.
#[derive(Debug, Default, serde::Serialize)]
struct ProofReport {
    proven: Option<Verified>,
    /// Why there is no proof in the file.
    #[serde(skip_serializing_if = "Option::is_none")]
    unproven: Option<String>,
}

/// Looks for a proof of the bank's gammas and puts it into the bank; a bank that cannot be proven is a bank all the same.
fn attach_proof(design: &mut Design) -> ProofReport {
    match design::prove(&design.bank, &design.dual) {
        Ok((proof, proven)) => {
            design.bank.proof = Some(proof);
            ProofReport { proven: Some(proven), unproven: None }
        }
        Err(error) => ProofReport { proven: None, unproven: Some(error.to_string()) },
    }
}

impl ProofReport {
    fn text(&self, seconds: f64) -> String {
        match (&self.proven, &self.unproven) {
            (Some(proven), _) => format!(
                "proven     [{}, {}] in {:.1} ms (see hybank verify)\n",
                number(Some(proven.lower)),
                number(Some(proven.upper)),
                seconds * 1e3
            ),
            (_, Some(reason)) => format!("proven     no: {reason}\n"),
            _ => String::new(),
        }
    }
}

fn overrides(args: &Args) -> DesignOverrides {
    DesignOverrides {
        method: args.method,
        taps: args.taps,
        slack: args.slack,
        bits: args.bits.clone(),
        fraction_bits: args.fraction_bits,
        reduction: args.order.map(Reduction::Order).or(args.reduction_loss_db.map(Reduction::Loss)),
    }
}

/// What is said of a bank of zeros.
const SILENT: &str = "all integer taps are zero, the bank's output is silence: no integers of these bits were found that do \
                      better; give more bits or another fraction_bits";

/// Runs the verb.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    if args.json && is_dash(&args.output) {
        return Err(Failure::Usage(
            "--json and `-o -` both want standard output; write the bank to a file".into(),
        ));
    }
    let mut spec = load_spec(&args.spec, overrides(args))?;
    spec.latency = args.latency.or(spec.latency);
    spec.check().map_err(|problem| Failure::Input(format!("{}: {problem}", args.spec.display())))?;
    let named = |error: DesignError| Failure::Input(format!("{}: {error}", args.spec.display()));
    let begin = Instant::now();
    let mut found = design::design(&spec).map_err(named)?;
    let seconds = begin.elapsed().as_secs_f64();
    let mean = design::analyze_mean(&found.bank).map_err(named)?;
    let proving = Instant::now();
    let proof = attach_proof(&mut found);
    let proof_seconds = proving.elapsed().as_secs_f64();
    let text = found.bank.to_json().map_err(Failure::input)?;
    write_text(&args.output, &text, args.force)?;
    if found.bank.fixed_point.as_ref().is_some_and(FixedPoint::is_silent) {
        eprintln!("hybank: warning: {SILENT}");
    }
    let report = Report { proof, proof_seconds, ..Report::new(args, &found, mean, seconds) };
    if args.json {
        super::print_json(&report)
    } else if is_dash(&args.output) {
        eprint!("{}", report.text());
        Ok(())
    } else {
        super::print(&report.text())
    }
}

impl<'a> Report<'a> {
    fn new(args: &Args, design: &'a Design, mean: MeanAnalysis, seconds: f64) -> Self {
        let bank = &design.bank;
        let (taps, states) = match &bank.filters {
            SynthesisFilters::Fir(taps) => (taps.first().map(Vec::len), None),
            SynthesisFilters::StateSpace(block) => (None, Some(block.a.len())),
        };
        Self {
            bank: args.output.display().to_string(),
            method: bank.method,
            channels: bank.channel_count(),
            ratio: bank.ratio,
            latency: bank.latency,
            latency_chosen: design.latency_chosen,
            taps,
            states,
            reduction: design.reduction.as_ref(),
            gamma: &bank.gamma,
            words: Words::of(design),
            mean,
            peak_hertz: design.peak_frequency / (std::f64::consts::TAU * bank.slow_period()),
            iterations: design.iterations,
            seconds,
            proof: ProofReport::default(),
            proof_seconds: 0.0,
        }
    }

    fn text(&self) -> String {
        let size = match (self.taps, self.states) {
            (Some(taps), _) => format!("{taps} taps a channel"),
            (_, Some(states)) => format!("{states} states"),
            _ => String::new(),
        };
        let chosen = if self.latency_chosen { " (chosen; set `latency` to change it)" } else { "" };
        format!(
            "{}: {}, {} channels, ratio {}, {size}, latency {}{chosen}\n\
             gamma      {} (exact norm of this bank; worst at {:.4} Hz modulo the slow rate)\n\
             lower      {} ({})\n\
             noncausal  {} (no latency is better)\n\
             H2 error   {} (rms, for white noise of unit density at the analog input)\n\
             noise gain {} (converters' noise at the output: {:.3e} of full scale)\n\
             {}{}designed in {:.1} ms, {} iterations\n{}",
            self.bank,
            self.method.name(),
            self.channels,
            self.ratio,
            self.latency,
            number(self.gamma.upper),
            self.peak_hertz,
            number(self.gamma.lower),
            match self.method {
                Method::Fir => "no bank of this length is better",
                Method::Iir => "no causal bank is better",
                Method::H2 | Method::Sinc | Method::Separation =>
                    "no bank at all is better; this method does not aim at gamma",
            },
            number(self.gamma.noncausal),
            number(Some(self.mean.rms_error)),
            number(Some(self.mean.noise_gain)),
            self.mean.output_noise,
            self.words.as_ref().map(Words::text).unwrap_or_default(),
            self.reduction.map(|reduction| order_text(reduction, self.method)).unwrap_or_default(),
            self.seconds * 1e3,
            self.iterations,
            self.proof.text(self.proof_seconds),
        )
    }
}

/// Rows of the table of orders; all of them are in the report of `--json`.
const TABLE_ROWS: usize = 32;

/// Full and reduced order, and what each state is worth.
fn order_text(reduction: &OrderReduction, method: Method) -> String {
    let OrderReduction { full, reduced, orders } = reduction;
    let lost = if method == Method::H2 { "of H2 error" } else { "of gamma" };
    let mut text = format!(
        "order      {} of {} states: gamma {} instead of {}, {:.4} dB {lost} lost\n",
        reduced.order,
        full.order,
        number(Some(reduced.figures.gamma)),
        number(Some(full.figures.gamma)),
        rounded(reduced.loss_db)
    );
    let row = |worth: &OrderWorth| {
        let OrderWorth { order, figures, loss_db } = worth;
        let (gamma, rms) = (number(Some(figures.gamma)), number(Some(figures.rms_error)));
        format!("{order:>10} {gamma:>14} {rms:>14} {:>10.4} dB\n", rounded(*loss_db))
    };
    if orders.len() <= TABLE_ROWS {
        text += &format!("{:>10} {:>14} {:>14} {:>13}\n", "states", "gamma", "H2 error", "loss");
        text.extend(orders.iter().map(row));
    }
    text
}

/// To the four decimals that are shown, so that no zero has a sign.
fn rounded(db: f64) -> f64 {
    (db * 1e4).round() / 1e4 + 0.0
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(
        || "unknown".to_owned(),
        |v| if v >= 1e-4 { format!("{v:.9}") } else { format!("{v:.6e}") },
    )
}
