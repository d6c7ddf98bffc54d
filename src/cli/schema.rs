//! `hybank schema`: what the files may hold, for editors and validators.

use super::Failure;

/// Prints the JSON schema (draft 2020-12) of spec files, bank files or reports
///
/// An editor that knows schemas of TOML files completes keys and marks mistakes with the schema of the spec.
/// The report is that of `hybank design --json` and `hybank import --json`. A schema cannot state every
/// rule: a file that fits it may still be refused, with the reason.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank schema spec > spec.schema.json
  hybank schema bank > bank.schema.json")]
pub(super) struct Args {
    /// What the schema is of
    #[arg(value_enum)]
    of: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Kind {
    /// Spec files (TOML)
    Spec,
    /// Bank files (JSON)
    Bank,
    /// The report of `design --json`
    Report,
}

const SPEC: &str = include_str!("schema/spec.json");
const BANK: &str = include_str!("schema/bank.json");
const REPORT: &str = include_str!("schema/report.json");

/// Runs the command.
///
/// # Errors
/// [`Failure`] if standard output cannot be written.
pub(super) fn run(args: &Args) -> Result<(), Failure> {
    match args.of {
        Kind::Spec => super::print(SPEC),
        Kind::Bank => super::print(&with_spec()?),
        Kind::Report => super::print(REPORT),
    }
}

/// The schema of banks with that of their specs in its definitions, so that it stands alone.
fn with_spec() -> Result<String, Failure> {
    let mut bank: serde_json::Value = serde_json::from_str(BANK).map_err(Failure::input)?;
    bank["$defs"]["spec"] = serde_json::from_str(SPEC).map_err(Failure::input)?;
    Ok(serde_json::to_string_pretty(&bank).map_err(Failure::input)? + "\n")
}
