//! `hybank analyze`: the error of a bank, with its own delays or with others.

use super::bank_file::load;
use super::design_report::{against, figure_text};
use super::design_studies::number;
use super::plot::is_svg;
use super::print::{Failure, InFile, failed, is_dash, show};
use super::written::{check_output, write_bytes};
use hybank::design::uncertainty::{
    Affordable, BoxRule, BoxStudy, BoxWidths, ErrorStudy, JitterStudy, Questions, RefusedBox, Sensitivity,
    Sweep, SweepCurve,
};
use hybank::design::{self, Analysis, Certified, GammaScale, MeanAnalysis};
use hybank::figures::Figures;
use hybank::overview::{decibels, frequency, six_digits, understood};
use hybank::plot::{Chart, Series};
use hybank::quantity::{self, Time, readable};
use hybank::units::Seconds;
use hybank::verify::uncertainty::{ErrorBox, ErrorPoint, WorstCase};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Computes the gamma of a bank, with the delays of its spec or with others
///
/// gamma is the worst-case gain from the signal's source w to the error; without [signal] w is the analog
/// input. The command builds the error system from
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
    /// True delay minus the delay in the bank, one value per channel: 10ps, 1e-11 or "0.01 samples"
    #[arg(long, value_name = "TIMES", value_delimiter = ',', value_parser = quantity::time)]
    delay_error: Vec<Time>,
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

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    args.check()?;
    let bank = load(&args.bank)?;
    let errors = args.errors.error_box(&bank).map_err(|refused| bad_box(&refused))?;
    let jitter = args.errors.jitter_of(&bank).map_err(|refused| bad_box(&refused))?;
    let questions = Questions { errors, jitter, sensitivity: args.sensitivity, loss: args.accuracy };
    let delay_errors: Vec<Seconds> =
        args.delay_error.iter().map(|error| error.in_seconds(bank.fast_period)).collect();
    let analysis = design::analyze(&bank, &delay_errors).in_file(&args.bank)?;
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
        scale: GammaScale::new(&bank, &delay_errors).in_file(&args.bank)?,
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
            Some(sweep) => check_output(sweep, &[&self.bank], self.force),
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
            |bound| format!("{}   computed lower bound for any bank", number(bound)),
        );
        let MeanAnalysis { rms_error, noise_gain, output_noise } = mean;
        format!(
            "{}\n{}\
             gamma        {}   worst-case gain from the signal's source w to the error (h = 1)\n\
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
            worst_case_text(&self.errors)
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

/// Lines for people.
fn worst_case_text(study: &ErrorStudy) -> String {
    let mut text = String::new();
    if let Some(worst) = &study.worst_case {
        write_worst(&mut text, worst);
    }
    if let Some(JitterStudy { added, jitter }) = &study.jitter {
        let most = jitter.iter().map(|x| x.0).fold(0.0, f64::max);
        let what = if added.is_finite() {
            format!(
                "+{}   at most, by instants that are off by up to {}, differently at each sample",
                number(*added),
                time(most)
            )
        } else {
            "unbounded     a front end of relative degree 1 passes steps, whose instant decides the sample"
                .to_owned()
        };
        let _ = writeln!(text, "jitter       {what}");
    }
    if let Some(sensitivity) = &study.sensitivity {
        write_sensitivity(&mut text, sensitivity);
    }
    text
}

fn write_worst(text: &mut String, worst: &BoxStudy) {
    let BoxStudy { case, floor, errors, .. } = worst;
    let width = 100.0 * (case.upper / case.lower - 1.0);
    let _ = writeln!(text, "box          {}", of_box(errors));
    let _ = writeln!(
        text,
        "worst case   {} to {}   both ends proven, {width:.2} % apart",
        number(case.lower),
        number(case.upper)
    );
    let _ = writeln!(text, "attained     {} at {:.6}", of_point(case, errors), worst.peak_hertz);
    if floor.value() > 0.0 {
        let reason = if floor.common_shift >= floor.noncausal.unwrap_or(0.0) {
            "no bank is better: a shift of all channels cannot be seen"
        } else {
            "no bank is better at the worst errors"
        };
        let _ = writeln!(text, "floor        {}   {reason}", number(floor.value()));
    }
    if let Some(Affordable { loss, factor, errors }) = &worst.affordable {
        let share = 100.0 * loss;
        let line = if *factor > 0.0 {
            format!("{} costs at most {share} % of gamma (proven; {factor:.3e} of the box)", of_box(errors))
        } else {
            format!("no part of the box is proven to cost {share} % of gamma or less")
        };
        let _ = writeln!(text, "accuracy     {line}");
    }
}

fn write_sensitivity(text: &mut String, found: &Sensitivity) {
    let Sensitivity { derivatives, slopes, .. } = found;
    let note = if derivatives.simple { "" } else { "; one of several equal peaks" };
    let _ = writeln!(
        text,
        "sensitivity  of gamma to each delay, per fast sample (peak at {:.6}{note})",
        derivatives.peak_hertz
    );
    for (i, (slope, most)) in derivatives.per_fast_period.iter().zip(&slopes.lipschitz).enumerate() {
        let _ = writeln!(text, "  channel {:<3} {slope:+.6}   never more than {most:.6}", i + 1);
    }
}

/// The box, a value per channel for each kind of error.
fn of_box(errors: &ErrorBox) -> String {
    let kinds = kinds(errors, &errors.delays, &errors.gains, &errors.cutoffs);
    let parts: Vec<String> = kinds.map(|(what, values)| format!("{what} ±({values})")).collect();
    if parts.is_empty() { "no errors".to_owned() } else { parts.join(", ") }
}

/// The worst point of a box.
fn of_point(case: &WorstCase, errors: &ErrorBox) -> String {
    let ErrorPoint { delays, gains, cutoffs, .. } = &case.point;
    let parts: Vec<String> = kinds(errors, delays, gains, cutoffs)
        .map(|(what, values)| format!("{what} off by {values}"))
        .collect();
    if parts.is_empty() { "without errors".to_owned() } else { parts.join(", ") }
}

/// Values of the kinds of errors that a box has, with their names.
fn kinds(
    errors: &ErrorBox,
    delays: &[Seconds],
    gains: &[f64],
    cutoffs: &[f64],
) -> impl Iterator<Item = (&'static str, String)> {
    let any = |shares: &[f64]| shares.iter().any(|x| *x > 0.0);
    let delays_differ = errors.delays.iter().any(|x| x.0 > 0.0);
    let all = [
        delays_differ.then(|| ("delays", list(delays, |x| time(x.0)))),
        any(&errors.gains).then(|| ("gains", list(gains, |x| percent(*x)))),
        any(&errors.cutoffs).then(|| ("cut-offs", list(cutoffs, |x| percent(*x)))),
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

/// Writes the file that `path` names: SVG if its extension says so, else CSV.
fn write_sweep(sweep: &Sweep, path: &Path, force: bool) -> Result<(), Failure> {
    let text = if is_svg(path) { chart(sweep).to_svg().map_err(failed)? } else { csv(sweep) };
    write_bytes(path, text.as_bytes(), force)
}

fn csv(sweep: &Sweep) -> String {
    let mut text = String::from("share_of_box");
    for curve in &sweep.curves {
        let _ = write!(text, ",{}", curve.label.replace(", ", " ").replace(' ', "_"));
    }
    text.push('\n');
    for (k, share) in sweep.shares.iter().enumerate() {
        let _ = write!(text, "{share}");
        for curve in &sweep.curves {
            let _ = write!(text, ",{}", curve.gammas[k]);
        }
        text.push('\n');
    }
    text
}

fn chart(sweep: &Sweep) -> Chart {
    let series = |curve: &SweepCurve| Series {
        label: curve.label.clone(),
        points: sweep.shares.iter().copied().zip(curve.gammas.iter().copied()).collect(),
    };
    let widths: Vec<String> = sweep.half_widths.iter().map(|half| format!("{:.3e}", half.0)).collect();
    Chart {
        title: "gamma with delays that are not those of the bank".into(),
        x_label: format!("error, in units of the box ({} s)", widths.join(", ")),
        y_label: "gamma".into(),
        series: sweep.curves.iter().map(series).collect(),
        ..Chart::default()
    }
}
