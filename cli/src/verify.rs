//! `hybank verify`: proves a bank's gamma from its file alone.

use super::bank_file::read_kind;
use super::file_kind::FileKind;
use super::print::{Failure, InFile, failed, name, show};
use hybank::bank::{Bank, FixedPoint, check_digest};
use hybank::design;
use hybank::messages::Quoted;
use hybank::verify::{Verified, verify};
use std::path::PathBuf;

/// Proves the worst-case error of a bank, from its file alone
///
/// Rebuilds the error system from the spec and the coefficients in the file. It uses nothing of the design,
/// its solvers or its norms, and bounds every rounding error. It proves that gamma is at most gamma.upper,
/// with the certificate in the file, and at least the bank's own gain at one frequency. A file with an
/// altered coefficient, norm, upper end or matrix is refused: its digest does not match, or the proof fails.
/// A bank without a proof is refused at once; --search looks for one. Lower bounds for other banks,
/// gamma.lower and gamma.noncausal, are computed by the design and not proven.
///
/// The front ends are the filters as the spec writes them: their roots and state equations are enclosed.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank verify bank.json
  hybank design spec.toml -o - | hybank verify -
  hybank verify bank.json --json | jq '[.attained, .upper]'
  hybank verify elsewhere.json --search

Exit codes: 0 proven; 1 refused, with the reason; 2 wrong usage.")]
pub(super) struct Args {
    /// The bank (JSON); `-` is standard input
    bank: PathBuf,
    /// Look for a proof if the file has none; a gamma that this proof neither reaches nor refutes is
    /// accepted
    #[arg(long)]
    search: bool,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

#[derive(Debug, serde::Serialize)]
struct VerifyReport {
    bank: String,
    #[serde(flatten)]
    verified: Verified,
    /// The file has a digest, and it matches.
    digest: bool,
    /// The certificate came with the file; otherwise it was found now.
    certificate_in_file: bool,
    /// Word lengths of integer taps.
    #[serde(skip)]
    words: String,
    /// No errors within the spec's uncertainty make gamma larger.
    #[serde(skip_serializing_if = "Option::is_none")]
    worst_case: Option<f64>,
}

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let file = name(&args.bank);
    let text = read_kind(&args.bank, FileKind::Bank)?;
    let bank = Bank::from_json(&text, &file).map_err(failed)?;
    let digest = check_digest(&text, &file).map_err(failed)?;
    let certificate_in_file = bank.proof.is_some();
    let verified = if args.search && !certificate_in_file {
        design::prove(&bank).in_file(&args.bank)?.1
    } else {
        verify(&bank).in_file(&args.bank)?
    };
    let report = VerifyReport {
        words: words(&bank),
        worst_case: bank.gamma.worst_case,
        bank: file,
        verified,
        digest,
        certificate_in_file,
    };
    show(&report, args.json, VerifyReport::text)
}

/// The word lengths as text; reading has checked them.
fn words(bank: &Bank) -> String {
    let line = |words: &FixedPoint| {
        format!("taps       integers of {} times 2^{}\n", words.bits, -words.fraction_bits)
    };
    bank.fixed_point.as_ref().map(line).unwrap_or_default()
}

impl VerifyReport {
    fn text(&self) -> String {
        let Verified { upper, attained, states } = self.verified;
        let origin = if self.certificate_in_file { "from the file" } else { "found now, the file has none" };
        let digest =
            if self.digest { "matches" } else { "the file has none: only what breaks the proof shows" };
        let width = if upper > 0.0 { (upper - attained) / upper } else { 0.0 };
        format!(
            "{}: proven, gamma in [{}, {}] (h = 1), relative width {width:.1e}\n\
             upper      {}   bounded-real lemma, P of order {states} {origin}\n\
             attained   {}   this bank's own gain at one frequency\n\
             {}{}digest     {digest}\n",
            Quoted(&self.bank),
            number(attained),
            number(upper),
            number(upper),
            number(attained),
            self.worst_case.map_or_else(String::new, |bound| {
                format!(
                    "worst case {}   no errors within the spec's uncertainty make gamma larger\n",
                    number(bound)
                )
            }),
            self.words,
        )
    }
}

/// All digits, because rounding would change a bound.
fn number(value: f64) -> String {
    if value >= 1e-4 || value == 0.0 { format!("{value}") } else { format!("{value:e}") }
}
