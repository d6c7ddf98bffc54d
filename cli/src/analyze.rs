//! `hybank analyze`: the error of a bank, with its own delays or with others.

use super::bank_file::{bad_flag, load};
use super::design_report::{against, figure_text};
use super::design_studies::number;
use super::print::{Failure, InFile, show};
use hybank::bank::Bank;
use hybank::design::uncertainty::{BoxStudy, BoxWidths, ReferenceChannel};
use hybank::design::{self, Analysis, DesignError, GammaScale, MeanAnalysis};
use hybank::figures::{Figures, KeyFigures};
use hybank::overview::{decibels, frequency, key_figures, six_digits, understood};
use hybank::quantity::{self, WrittenTime, readable};
use hybank::spec::{ErrorBox, ErrorPoint};
use hybank::units::Seconds;
use std::path::PathBuf;

/// Computes SNR, images and worst-case error of a bank, with the delays of its spec or with others
///
/// gamma is the worst-case gain from the signal's source w to the error; without [signal] w is the analog
/// input. The command builds the error system from
/// the coefficients and the spec in the bank file and computes its H-infinity norm (relative error about
/// 1e-9, more where large coefficients of opposite sign cancel). The gammas that the file states are not
/// used.
///
/// With other delays the command also computes the signal-to-noise ratio and the largest image that the
/// bank has there. With a box of errors it proves a bound of gamma over all delays, gains and cut-offs in
/// the box, and names the worst errors that a search found.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank analyze bank.json
  hybank analyze bank.json --delay-error 1e-7,-1e-7
  hybank analyze bank.json --delay-box 10ps
  hybank analyze bank.json --delay-box 2us --gain-box 0.5% --reference none
  hybank analyze bank.json --json | jq .gamma")]
pub(super) struct Args {
    /// The bank (JSON); `-` is standard input
    bank: PathBuf,
    /// True delay minus the delay in the bank, one value per channel: 10ps, 1e-11 or "0.01 samples"
    #[arg(long, value_name = "TIMES", value_delimiter = ',', value_parser = quantity::time)]
    delay_error: Vec<WrittenTime>,
    #[command(flatten)]
    errors: BoxArgs,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

/// The box of errors.
#[derive(Debug, clap::Args)]
struct BoxArgs {
    /// Bound the worst case over delays that are off by up to this much (10ps, 0.01samples, or seconds): one
    /// value for all channels but the reference, or one per channel
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::time)]
    delay_box: Vec<WrittenTime>,
    /// Also gains that are off by up to this share (1%, 500ppm, 0.01); values as for --delay-box
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::relative)]
    gain_box: Vec<f64>,
    /// Also cut-offs that are off by up to this share; values as for --delay-box
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_parser = quantity::relative)]
    cutoff_box: Vec<f64>,
    /// The channel to which delays, gains and cut-offs are relative, from 1, or none if every channel has an
    /// error of its own [default: 1 where one value is given for all channels]
    #[arg(long, value_name = "CHANNEL|none")]
    reference: Option<ReferenceChannel>,
}

impl BoxArgs {
    fn widths(&self) -> BoxWidths {
        BoxWidths {
            delay_box: self.delay_box.clone(),
            gain_box: self.gain_box.clone(),
            cutoff_box: self.cutoff_box.clone(),
            reference: self.reference,
        }
    }
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let bank = load(&args.bank)?;
    let errors = args.errors.widths().error_box(&bank);
    let errors = errors.map_err(|refused| bad_flag(refused.path(), refused.problem()))?;
    let delay_errors: Vec<Seconds> =
        args.delay_error.iter().map(|error| error.in_seconds(bank.fast_period)).collect();
    let analysis = design::analyze(&bank, &delay_errors).in_file(&args.bank)?;
    let worst_case = errors.map(|errors| BoxStudy::new(&bank, &errors)).transpose().in_file(&args.bank)?;
    let report = AnalysisReport {
        understood: bank.spec.as_ref().map(understood).unwrap_or_default(),
        is_normalised: bank.is_normalised(),
        scale: GammaScale::new(&bank, &delay_errors).in_file(&args.bank)?,
        analysis,
        figures: Figures::new(&bank).in_file(&args.bank)?,
        with_errors: with_errors(&bank, &delay_errors).in_file(&args.bank)?,
        worst_case,
    };
    show(&report, args.json, AnalysisReport::text)
}

/// The figures with other delays; none without errors.
fn with_errors(bank: &Bank, delay_errors: &[Seconds]) -> Result<Option<KeyFigures>, DesignError> {
    let point = design::delay_point(bank, delay_errors)?;
    (!delay_errors.is_empty()).then(|| KeyFigures::new(&bank.with_errors(&point))).transpose()
}

impl Args {
    /// Refuses flags that do not go together.
    fn check(&self) -> Result<(), Failure> {
        if self.delay_error.is_empty() || !self.errors.widths().has_box() {
            return Ok(());
        }
        let message = "a box of errors lies around the delays of the bank; leave out --delay-error";
        Err(Failure::Usage(message.to_owned()))
    }
}

#[derive(Debug, serde::Serialize)]
struct AnalysisReport {
    /// The spec in units of the user.
    understood: String,
    #[serde(skip)]
    is_normalised: bool,
    scale: GammaScale,
    #[serde(flatten)]
    analysis: Analysis,
    /// With the delays of the bank.
    figures: Figures,
    /// With the delays that are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    with_errors: Option<KeyFigures>,
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_case: Option<BoxStudy>,
}

impl AnalysisReport {
    fn text(&self) -> String {
        let Analysis { gamma, peak_hertz, noncausal, mean } = self.analysis;
        let noncausal = noncausal.map_or_else(
            || "unknown       delays of like channels lie closer together than doubles resolve".to_owned(),
            |bound| format!("{}   computed lower bound for any bank", number(bound)),
        );
        let MeanAnalysis { rms_error, noise_gain, output_noise } = mean;
        format!(
            "{}\n{}{}\
             gamma        {}   worst-case gain from the signal's source w to the error (h = 1)\n\
             scale        {}, {}\n\
             worst at     {} modulo the slow rate\n\
             noncausal    {noncausal}\n\
             rms error    {}   for white noise of unit density at the analog input\n\
             SNR          {} for a signal with the spectrum of the target and of [signal]\n\
             noise gain   {:<11}   for independent noise on the slow samples\n\
             output noise {}\n{}",
            self.understood,
            figure_text(&self.figures, self.is_normalised),
            self.with_errors.map_or_else(String::new, |at| {
                format!("with errors  {} with the delays that are given\n", key_figures(at))
            }),
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
            self.worst_case.as_ref().map_or_else(String::new, worst_case_text)
        )
    }
}

/// Lines for people.
fn worst_case_text(study: &BoxStudy) -> String {
    let BoxStudy { errors, upper, attained, point, peak_hertz } = study;
    format!(
        "box          {}\n\
         worst case   {}   no errors in the box make gamma larger (proven); {:.2} times what is attained\n\
         attained     {}   {} at {:.6}\n",
        of_box(errors),
        number(*upper),
        upper / attained,
        number(*attained),
        of_point(point, errors),
        peak_hertz
    )
}

/// The box, a value per channel for each kind of error.
fn of_box(errors: &ErrorBox<Seconds>) -> String {
    let kinds = kinds(errors, errors);
    let parts: Vec<String> = kinds.map(|(what, values)| format!("{what} ±({values})")).collect();
    if parts.is_empty() { "no errors".to_owned() } else { parts.join(", ") }
}

/// The worst point of a box.
fn of_point(point: &ErrorPoint<Seconds>, errors: &ErrorBox<Seconds>) -> String {
    let parts: Vec<String> =
        kinds(errors, point).map(|(what, values)| format!("{what} off by {values}")).collect();
    if parts.is_empty() { "without errors".to_owned() } else { parts.join(", ") }
}

/// Values of the kinds of errors that a box has, with their names.
fn kinds(
    errors: &ErrorBox<Seconds>,
    values: &ErrorPoint<Seconds>,
) -> impl Iterator<Item = (&'static str, String)> {
    let any = |shares: &[f64]| shares.iter().any(|x| *x > 0.0);
    let delays_differ = errors.delays.iter().any(|x| x.0 > 0.0);
    let all = [
        delays_differ.then(|| ("delays", list(&values.delays, |x| time(x.0)))),
        any(&errors.gains).then(|| ("gains", list(&values.gains, |x| percent(*x)))),
        any(&errors.cutoffs).then(|| ("cut-offs", list(&values.cutoffs, |x| percent(*x)))),
    ];
    all.into_iter().flatten()
}

fn list<T>(values: &[T], text: impl Fn(&T) -> String) -> String {
    values.iter().map(text).collect::<Vec<_>>().join(", ")
}

fn percent(share: f64) -> String {
    format!("{} %", rounded(100.0 * share))
}

/// A time in four significant digits.
fn time(seconds: f64) -> String {
    readable(rounded(seconds), "s")
}

/// Four significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.3e}").parse().unwrap_or(x)
}
