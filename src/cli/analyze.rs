//! `hybank analyze`: the error of a bank, with its own delays or with others.

use super::Failure;
use super::bank_file::load;
use crate::design::{self, Analysis, Certified, DesignError, MeanAnalysis};
use crate::units::Seconds;
use std::path::PathBuf;

/// Computes the gamma of a bank, with the delays of its spec or with others
///
/// gamma is the worst-case gain from the analog input to the error. The command builds the error system from
/// the coefficients and the spec in the bank file and computes its H-infinity norm (relative error about 1e-9, more where large coefficients of opposite sign cancel).
/// The gammas that the file states are not used.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank analyze bank.json
  hybank analyze bank.json --delay-error 1e-7,-1e-7
  hybank analyze bank.json --certify
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
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
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
    let bank = load(&args.bank)?;
    let named = |error: DesignError| Failure::Input(format!("{}: {error}", args.bank.display()));
    if args.certify && !args.delay_error.is_empty() {
        let message = "--certify proves the bank with its own delays; leave out --delay-error";
        return Err(Failure::Usage(message.into()));
    }
    let analysis = design::analyze(&bank, &args.delay_error).map_err(named)?;
    let certified = if args.certify { Some(design::certify(&bank).map_err(named)?) } else { None };
    let report = Report { analysis, certified };
    if args.json { super::print_json(&report) } else { super::print(&report.text()) }
}

#[derive(Debug, serde::Serialize)]
struct Report {
    #[serde(flatten)]
    analysis: Analysis,
    #[serde(skip_serializing_if = "Option::is_none")]
    certified: Option<Certified>,
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
        let MeanAnalysis { rms_error, noise_gain, output_noise } = mean;
        format!(
            "gamma        {gamma:.9}   worst-case gain from the analog input to the error (h = 1)\n{proof}\
             worst at     {peak_hertz:.6} modulo the slow rate\n\
             noncausal    {noncausal:.9}   no bank at all is better\n\
             rms error    {rms_error:.9}   for white noise of unit density at the analog input\n\
             noise gain   {noise_gain:.6}      for independent noise on the slow samples\n\
             output noise {output_noise:.6e}  of full scale, for the converters' noise in the spec\n"
        )
    }
}
