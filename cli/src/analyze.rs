//! `hybank analyze`: the error of a bank, with its own delays or with others.

use super::bank_file::load;
use super::design_report::{against, figure_text};
use super::design_studies::number;
use super::print::{Failure, InFile, is_dash, show};
use super::worst_case::{self, write_sweep};
use super::written::check_outputs;
use hybank::design::uncertainty::{BoxRule, BoxWidths, ErrorStudy, Questions, RefusedBox, Sweep};
use hybank::design::{self, Analysis, Certified, GammaScale, MeanAnalysis};
use hybank::figures::Figures;
use hybank::overview::{decibels, frequency, six_digits, understood};
use hybank::quantity;
use hybank::units::Seconds;
use std::path::PathBuf;

/// Computes the gamma of a bank, with the delays of its spec or with others
///
/// gamma is the worst-case gain from the analog input to the error. The command builds the error system from
/// the coefficients and the spec in the bank file and computes its H-infinity norm (relative error about
/// 1e-9, more where large coefficients of opposite sign cancel). The gammas that the file states are not
/// used.
///
/// With a box of errors the command proves the worst case over all delays, gains and cut-offs in the box,
/// from both sides, and names the floor that no bank beats there.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank analyze bank.json
  hybank analyze bank.json --delay-error 1e-7,-1e-7
  hybank analyze bank.json --certify
  hybank analyze bank.json --delay-box 10ps --accuracy 1%
  hybank analyze bank.json --delay-box 2us --gain-box 0.5% --reference none
  hybank analyze bank.json --sensitivity --jitter 1ps
  hybank analyze bank.json --delay-box 10us --sweep sweep.svg
  hybank analyze bank.json --json | jq .gamma")]
pub(super) struct Args {
    /// The bank (JSON); `-` is standard input
    bank: PathBuf,
    /// True delay minus the delay in the bank, one value per channel, in seconds
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_parser = finite)]
    delay_error: Vec<Seconds>,
    /// Also prove an upper bound of gamma (bounded-real lemma, with every rounding error bounded)
    #[arg(long)]
    certify: bool,
    #[command(flatten)]
    errors: BoxWidths,
    /// Also find the largest part of the box that costs at most this share of gamma (1%)
    #[arg(long, value_name = "LOSS", value_parser = loss)]
    accuracy: Option<f64>,
    /// Also print the derivatives of gamma with respect to the delays
    #[arg(long)]
    sensitivity: bool,
    /// Write gamma against the errors of the delays in the box (CSV, or SVG or PNG by extension); `-` prints
    /// the table in place of the report
    #[arg(long, value_name = "OUT")]
    sweep: Option<PathBuf>,
    /// Replace the file of --sweep if it exists
    #[arg(long)]
    force: bool,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

fn loss(text: &str) -> Result<f64, String> {
    match quantity::relative(text).map_err(|error| error.to_string())? {
        loss if loss > 0.0 && loss <= 100.0 => Ok(loss),
        _ => Err("the loss is a share of gamma above 0, such as 1%".to_owned()),
    }
}

fn finite(text: &str) -> Result<Seconds, String> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(Seconds(value)),
        _ => Err("delay errors are finite numbers, in seconds".to_owned()),
    }
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let bank = load(&args.bank)?;
    let errors = args.errors.error_box(&bank).map_err(|refused| bad_box(&refused))?;
    let jitter = args.errors.jitter_of(&bank).map_err(|refused| bad_box(&refused))?;
    let questions = Questions { errors, jitter, sensitivity: args.sensitivity, loss: args.accuracy };
    let analysis = design::analyze(&bank, &args.delay_error).in_file(&args.bank)?;
    let certified = args.certify.then(|| design::certify(&bank)).transpose().in_file(&args.bank)?;
    let errors = ErrorStudy::new(&bank, questions).in_file(&args.bank)?;
    if let Some((path, worst)) = args.sweep.as_ref().zip(errors.worst_case.as_ref()) {
        let sweep = Sweep::new(&bank, &worst.errors, &worst.case.point).in_file(&args.bank)?;
        write_sweep(&sweep, path, args.force)?;
        // The table alone, so that a program can read it.
        if is_dash(path) {
            return Ok(());
        }
    }
    let own_delays = args.delay_error.is_empty();
    let figures = own_delays.then(|| Figures::new(&bank)).transpose().in_file(&args.bank)?;
    let report = Report {
        understood: bank.spec.as_ref().map(understood).unwrap_or_default(),
        is_normalised: bank.is_normalised(),
        scale: GammaScale::new(&bank).in_file(&args.bank)?,
        analysis,
        certified,
        figures,
        errors,
    };
    show(&report, args.json, Report::text)
}

impl Args {
    /// Refuses flags that do not go together.
    fn check(&self) -> Result<(), Failure> {
        let usage = |message: &str| Err(Failure::Usage(message.to_owned()));
        if self.certify && !self.delay_error.is_empty() {
            return usage("--certify proves the bank with its own delays; leave out --delay-error");
        }
        let asked = self.errors.has_box() || !self.errors.jitter.is_empty() || self.sensitivity;
        if asked && !self.delay_error.is_empty() {
            return usage("a box of errors lies around the delays of the bank; leave out --delay-error");
        }
        for (flag, given) in [("--accuracy", self.accuracy.is_some()), ("--sweep", self.sweep.is_some())] {
            if given && !self.errors.has_box() {
                return usage(&format!("{flag} needs a box of errors; give --delay-box"));
            }
        }
        match &self.sweep {
            Some(sweep) => check_outputs(&[sweep], &[&self.bank]),
            None => Ok(()),
        }
    }
}

#[derive(Debug, serde::Serialize)]
struct Report {
    /// The spec in units of the user.
    understood: String,
    #[serde(skip)]
    is_normalised: bool,
    scale: GammaScale,
    #[serde(flatten)]
    analysis: Analysis,
    #[serde(skip_serializing_if = "Option::is_none")]
    certified: Option<Certified>,
    /// With the delays of the bank; none where others are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    figures: Option<Figures>,
    #[serde(flatten)]
    errors: ErrorStudy,
}

impl Report {
    fn text(&self) -> String {
        let Analysis { gamma, peak_hertz, noncausal, mean } = self.analysis;
        let proof = self.certified.map_or_else(String::new, |proof| {
            format!(
                "certified    {}   proven upper bound (P of order {}; at least {} is proven as well)\n",
                number(proof.gamma),
                proof.states,
                number(proof.attained)
            )
        });
        let noncausal = noncausal.map_or_else(
            || "unknown       delays of like channels lie closer together than doubles resolve".to_owned(),
            |bound| format!("{}   no bank at all is better", number(bound)),
        );
        let MeanAnalysis { rms_error, noise_gain, output_noise } = mean;
        format!(
            "{}\n{}\
             gamma        {}   worst-case gain from the analog input to the error (h = 1)\n\
             scale        {}, {}\n{proof}\
             worst at     {} modulo the slow rate\n\
             noncausal    {noncausal}\n\
             rms error    {}   for white noise of unit density at the analog input\n\
             SNR          {} for a signal with the spectrum of the target and of [signal]\n\
             noise gain   {:<11}   for independent noise on the slow samples\n\
             output noise {}\n{}",
            self.understood,
            self.figures
                .as_ref()
                .map_or_else(String::new, |figures| figure_text(figures, self.is_normalised)),
            number(gamma),
            against(gamma, self.scale.zero_output, "zero output"),
            against(gamma, self.scale.interleaving, "plain interleaving"),
            frequency(peak_hertz, self.is_normalised),
            number(rms_error),
            decibels(self.scale.rms_reference, rms_error),
            six_digits(noise_gain),
            if output_noise == 0.0 {
                "none: the spec gives the converters no noise".to_owned()
            } else {
                format!("{output_noise:.6e}  of full scale, for the converters' noise in the spec")
            },
            worst_case::text(&self.errors)
        )
    }
}

/// A refusal, with the option that it is about.
fn bad_box(refused: &RefusedBox) -> Failure {
    let message = format!("--{}: {refused}", refused.field.replace('_', "-"));
    match refused.rule {
        BoxRule::Number(_) => Failure::Input(message),
        BoxRule::NoChannel { channel, .. } => Failure::Usage(format!("--reference {channel}: {refused}")),
        _ => Failure::Usage(message),
    }
}
