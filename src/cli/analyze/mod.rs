//! `hybank analyze`: the error of a bank, with its own delays or with others.

mod error_box;
mod sweep;
mod worst_case;

use super::Failure;
use super::bank_file::{is_dash, load, refuse_overlap};
use super::design::report::{against, figure_text};
use crate::bank::Bank;
use crate::design::{self, Analysis, Certified, DesignError, GammaScale, MeanAnalysis};
use crate::figures::Figures;
use crate::overview::{decibels, frequency, six_digits, understood};
use crate::quantity;
use crate::units::Seconds;
use std::path::PathBuf;
use sweep::Sweep;
use worst_case::Questions;

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
    errors: error_box::Flags,
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

/// Runs the command.
///
/// # Errors
/// [`Failure`] with the one message for the user.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let bank = load(&args.bank)?;
    let named = |error: DesignError| {
        Failure::Input(format!("{}: {}", args.bank.display(), worst_case::explained(&error)))
    };
    let questions = args.questions(&bank)?;
    let analysis = design::analyze(&bank, &args.delay_error).map_err(named)?;
    let certified = if args.certify { Some(design::certify(&bank).map_err(named)?) } else { None };
    let errors = worst_case::Report::new(&bank, questions).map_err(named)?;
    if let Some((path, (errors, case))) = args.sweep.as_ref().zip(errors.case()) {
        Sweep::new(&bank, errors, &case.point).map_err(named)?.write(path, args.force)?;
        // The table alone, so that a program can read it.
        if is_dash(path) {
            return Ok(());
        }
    }
    let own_delays = args.delay_error.is_empty();
    let figures = own_delays.then(|| Figures::new(&bank)).transpose().map_err(named)?;
    let report = Report {
        understood: bank.spec.as_ref().map(understood).unwrap_or_default(),
        is_normalised: bank.is_normalised(),
        scale: GammaScale::new(&bank).map_err(named)?,
        analysis,
        certified,
        figures,
        errors,
    };
    if args.json { super::print_json(&report) } else { super::print(&report.text()) }
}

impl Args {
    /// Refuses flags that do not go together.
    fn check(&self) -> Result<(), Failure> {
        let usage = |message: &str| Err(Failure::Usage(message.to_owned()));
        if self.certify && !self.delay_error.is_empty() {
            return usage("--certify proves the bank with its own delays; leave out --delay-error");
        }
        let asked = self.errors.is_given() || self.errors.has_jitter() || self.sensitivity;
        if asked && !self.delay_error.is_empty() {
            return usage("a box of errors lies around the delays of the bank; leave out --delay-error");
        }
        for (flag, given) in [("--accuracy", self.accuracy.is_some()), ("--sweep", self.sweep.is_some())] {
            if given && !self.errors.is_given() {
                return usage(&format!("{flag} needs a box of errors; give --delay-box"));
            }
        }
        match &self.sweep {
            Some(sweep) => refuse_overlap(sweep, &self.bank),
            None => Ok(()),
        }
    }

    fn questions(&self, bank: &Bank) -> Result<Questions, Failure> {
        let errors = self.errors.error_box(bank)?;
        let jitter = self.errors.jitter(bank)?;
        Ok(Questions {
            errors: self.errors.is_given().then_some(errors),
            jitter: self.errors.has_jitter().then_some(jitter),
            sensitivity: self.sensitivity,
            loss: self.accuracy,
        })
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
    errors: worst_case::Report,
}

impl Report {
    fn text(&self) -> String {
        let Analysis { gamma, peak_hertz, noncausal, mean } = self.analysis;
        let proof = self.certified.map_or_else(String::new, |proof| {
            format!(
                "certified    {:.9}   proven upper bound (P of order {}; at least {:.9} is proven as well)\n",
                proof.gamma, proof.states, proof.attained
            )
        });
        let noncausal = noncausal.map_or_else(
            || "unknown       delays of like channels lie closer together than doubles resolve".to_owned(),
            |bound| format!("{bound:.9}   no bank at all is better"),
        );
        let MeanAnalysis { rms_error, noise_gain, output_noise } = mean;
        format!(
            "{}\n{}\
             gamma        {gamma:.9}   worst-case gain from the analog input to the error (h = 1)\n\
             scale        {}, {}\n{proof}\
             worst at     {} modulo the slow rate\n\
             noncausal    {noncausal}\n\
             rms error    {rms_error:.9}   for white noise of unit density at the analog input\n\
             SNR          {} for a signal with the spectrum of the target and of [signal]\n\
             noise gain   {:<11}   for independent noise on the slow samples\n\
             output noise {}\n{}",
            self.understood,
            self.figures
                .as_ref()
                .map_or_else(String::new, |figures| figure_text(figures, self.is_normalised)),
            against(gamma, self.scale.zero_output, "zero output"),
            against(gamma, self.scale.interleaving, "plain interleaving"),
            frequency(peak_hertz, self.is_normalised),
            decibels(self.scale.rms_reference, rms_error),
            six_digits(noise_gain),
            if output_noise == 0.0 {
                "none: the spec gives the converters no noise".to_owned()
            } else {
                format!("{output_noise:.6e}  of full scale, for the converters' noise in the spec")
            },
            self.errors.text()
        )
    }
}
