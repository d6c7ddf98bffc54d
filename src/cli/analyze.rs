//! `hybank analyze`: the error of a bank, with its own delays or with others.

use super::bank_file::{bad_flag, load};
use super::design_report::{against, figure_text};
use super::design_studies::number;
use super::print::{Failure, InFile, is_dash, show};
use super::worst_case::{self, Questions, Sweep};
use super::written::check_outputs;
use crate::bank::Bank;
use crate::design::{self, Analysis, Certified, GammaScale, MeanAnalysis};
use crate::figures::Figures;
use crate::overview::{decibels, frequency, six_digits, understood};
use crate::quantity::{self, Time};
use crate::spec::check_delay_half_width;
use crate::units::Seconds;
use crate::verify::uncertainty::ErrorBox;
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
    errors: Flags,
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
    let errors = args.errors.is_given().then_some(args.errors.error_box(&bank)?);
    let jitter = of_channels("--jitter", &in_seconds(&args.errors.jitter, &bank), bank.channel_count())?;
    let jitter = (!args.errors.jitter.is_empty()).then_some(jitter);
    let questions = Questions { errors, jitter, sensitivity: args.sensitivity, loss: args.accuracy };
    let analysis = design::analyze(&bank, &args.delay_error).in_file(&args.bank)?;
    let certified = args.certify.then(|| design::certify(&bank)).transpose().in_file(&args.bank)?;
    let errors = worst_case::Report::new(&bank, questions).in_file(&args.bank)?;
    if let Some((path, (errors, case))) = args.sweep.as_ref().zip(errors.case()) {
        Sweep::new(&bank, errors, &case.point).in_file(&args.bank)?.write(path, args.force)?;
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
        let asked = self.errors.is_given() || !self.errors.jitter.is_empty() || self.sensitivity;
        if asked && !self.delay_error.is_empty() {
            return usage("a box of errors lies around the delays of the bank; leave out --delay-error");
        }
        for (flag, given) in [("--accuracy", self.accuracy.is_some()), ("--sweep", self.sweep.is_some())] {
            if given && !self.errors.is_given() {
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
    errors: worst_case::Report,
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
            self.errors.text()
        )
    }
}

// Not a doc comment: clap would show it as the text of the whole command.
#[derive(Debug, clap::Args)]
struct Flags {
    /// Prove the worst case over delays that are off by up to this much (10ps, 0.01samples, or seconds): one
    /// value for all channels but the reference, or one per channel
    #[arg(long, value_delimiter = ',', value_parser = time)]
    delay_box: Vec<Time>,
    /// Also gains that are off by up to this share (1%, 500ppm, 0.01); values as for --delay-box
    #[arg(long, value_delimiter = ',', value_parser = share)]
    gain_box: Vec<f64>,
    /// Also cut-offs that are off by up to this share; values as for --delay-box
    #[arg(long, value_delimiter = ',', value_parser = share)]
    cutoff_box: Vec<f64>,
    /// Also bound what instants that jitter by up to this much may add: one value, or one per channel
    #[arg(long, value_delimiter = ',', value_parser = time)]
    jitter: Vec<Time>,
    /// The channel to which delays, gains and cut-offs are relative, from 1, or none if every channel has an
    /// error of its own [default: 1 where one value is given for all channels]
    #[arg(long, value_name = "CHANNEL|none", value_parser = reference)]
    reference: Option<Reference>,
}

/// The reference channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reference {
    None,
    /// From 1.
    Channel(usize),
}

fn reference(text: &str) -> Result<Reference, String> {
    match text.trim() {
        "none" => Ok(Reference::None),
        text => match text.parse::<usize>() {
            Ok(channel) if channel > 0 => Ok(Reference::Channel(channel)),
            _ => Err("the reference is a channel, counted from 1, or none".to_owned()),
        },
    }
}

fn time(text: &str) -> Result<Time, String> {
    let time = quantity::time(text).map_err(|error| error.to_string())?;
    if time.in_seconds(Seconds(1.0)).0 >= 0.0 { Ok(time) } else { Err(NEGATIVE.to_owned()) }
}

fn share(text: &str) -> Result<f64, String> {
    match quantity::relative(text).map_err(|error| error.to_string())? {
        share if (0.0..0.5).contains(&share) => Ok(share),
        share if share < 0.0 => Err(NEGATIVE.to_owned()),
        _ => Err("shares of 50% and more are not supported".to_owned()),
    }
}

const NEGATIVE: &str = "the box reaches as far in both directions; give the positive half-width";

impl Flags {
    /// Whether a box is asked for.
    fn is_given(&self) -> bool {
        !(self.delay_box.is_empty() && self.gain_box.is_empty() && self.cutoff_box.is_empty())
    }

    /// The box for the channels of `bank`.
    ///
    /// # Errors
    /// [`Failure::Usage`] for lists of another length and for a reference that is not there.
    fn error_box(&self, bank: &Bank) -> Result<ErrorBox, Failure> {
        let channels = bank.channel_count();
        if let Some(Reference::Channel(channel)) = self.reference
            && channel > channels
        {
            let message = format!(
                "--reference {channel}: the bank has {channels} channels; give 1 to {channels}, or none"
            );
            return Err(Failure::Usage(message));
        }
        Ok(ErrorBox {
            delays: self.relative("--delay-box", &self.half_widths(bank)?, channels)?,
            gains: self.relative("--gain-box", &self.gain_box, channels)?,
            cutoffs: self.relative("--cutoff-box", &self.cutoff_box, channels)?,
        })
    }

    /// Half-widths of the delays, by the rule for specs.
    fn half_widths(&self, bank: &Bank) -> Result<Vec<Seconds>, Failure> {
        let delays = in_seconds(&self.delay_box, bank);
        let check = |delay: &Seconds| check_delay_half_width(delay.in_fast_periods(bank.fast_period), *delay);
        delays.iter().try_for_each(check).map_err(|problem| bad_flag("delay_box", &problem))?;
        Ok(delays)
    }

    /// Values of all channels, 0 for the reference.
    fn relative<T: Copy + Default>(
        &self,
        flag: &str,
        given: &[T],
        channels: usize,
    ) -> Result<Vec<T>, Failure> {
        let exact = match self.reference {
            Some(Reference::None) => None,
            Some(Reference::Channel(channel)) => Some(channel - 1),
            // A list says itself which channel is exact, and one channel alone is not relative to another.
            None => (given.len() == 1 && channels > 1).then_some(0),
        };
        let mut all = of_channels(flag, given, channels)?;
        if let Some(exact) = exact {
            all[exact] = T::default();
        }
        Ok(all)
    }
}

fn in_seconds(times: &[Time], bank: &Bank) -> Vec<Seconds> {
    times.iter().map(|time| time.in_seconds(bank.fast_period)).collect()
}

/// One value per channel, of one for all or of a list; zeros where none is given.
pub(super) fn of_channels<T: Copy + Default>(
    flag: &str,
    given: &[T],
    channels: usize,
) -> Result<Vec<T>, Failure> {
    match given {
        [] => Ok(vec![T::default(); channels]),
        [all] => Ok(vec![*all; channels]),
        _ if given.len() == channels => Ok(given.to_vec()),
        _ => Err(Failure::Usage(format!(
            "{flag}: {} values are given for {channels} channels; give one for each, or one for all",
            given.len()
        ))),
    }
}
