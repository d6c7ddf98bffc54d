//! The commands that hand out texts: `init`, `help`, `schema`, `completions` and `man`.

use super::print::{failed, print};
use super::written::{begin_file, check_outputs, write_text, write_together};
use super::{Cli, Failure};
use clap::CommandFactory;
use clap_complete::Shell;
use hybank::messages::Quoted;
use std::path::{Path, PathBuf};

/// Writes a commented spec to begin with
///
/// The spec is complete: `hybank design` accepts it as it is. `hybank help spec` explains every key.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank init -o spec.toml
  hybank init --example ti-adc -o spec.toml")]
pub(super) struct InitArgs {
    /// What the spec describes
    #[arg(long, value_enum, default_value_t = Example::Audio2x)]
    example: Example,
    /// The spec (TOML); `-` is standard output
    #[arg(short, long, default_value = "-")]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Example {
    /// Two audio converters of 24 kHz, one a fraction of a sample late, into 48 kHz
    #[value(name = "audio-2x")]
    Audio2x,
    /// Four time-interleaved converters with a few picoseconds of skew
    TiAdc,
    /// Fewer slow sensor samples than output samples
    SensorArray,
    /// Two inertial sensors with rates of their own, 100 Hz and 60 Hz, into 300 Hz
    Inertial,
    /// More converters than needed: three for a ratio of two
    Oversampled,
    /// The example of the thesis, in normalised time
    Thesis,
}

impl Example {
    fn text(self) -> &'static str {
        match self {
            Self::TiAdc => include_str!("../filters/interleaved-4x250M.toml"),
            Self::Audio2x => include_str!("../filters/speech-2x.toml"),
            Self::SensorArray => include_str!("../filters/vibration-3x.toml"),
            Self::Inertial => include_str!("../examples/inertial/spec.toml"),
            Self::Oversampled => include_str!("../filters/oversampled-3for2.toml"),
            Self::Thesis => include_str!("../filters/thesis-fir.toml"),
        }
    }
}

pub(super) fn init(args: &InitArgs) -> Result<(), Failure> {
    write_text(&args.output, args.example.text(), args.force)
}

/// The reference of spec files.
const SPEC_REFERENCE: &str = include_str!("../docs/spec.md");

/// Shows the help of a command, or the reference of spec files
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank help spec
  hybank help design")]
pub(super) struct HelpArgs {
    /// `spec` for the reference of spec files, or a command
    topic: Option<String>,
}

pub(super) fn help(args: &HelpArgs) -> Result<(), Failure> {
    let mut program = Cli::command();
    program.build();
    match args.topic.as_deref() {
        None => print(&program.render_long_help().to_string()),
        Some("spec") => print(SPEC_REFERENCE),
        Some(name) => match program.find_subcommand_mut(name) {
            Some(command) => print(&command.render_long_help().to_string()),
            None => Err(Failure::Usage(unknown(name))),
        },
    }
}

fn unknown(name: &str) -> String {
    let program = Cli::command();
    let commands: Vec<&str> = program.get_subcommands().map(|command| command.get_name()).collect();
    format!("there is no help on \"{}\"; the topics are spec, {}", Quoted(name), commands.join(", "))
}

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
pub(super) struct SchemaArgs {
    /// What the schema is of
    #[arg(value_enum)]
    of: TextKind,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TextKind {
    /// Spec files (TOML)
    Spec,
    /// Bank files (JSON)
    Bank,
    /// The report of `design --json`
    Report,
}

const SPEC_SCHEMA: &str = include_str!("schema/spec.json");
const BANK_SCHEMA: &str = include_str!("schema/bank.json");
const REPORT_SCHEMA: &str = include_str!("schema/report.json");

pub(super) fn schema(args: &SchemaArgs) -> Result<(), Failure> {
    match args.of {
        TextKind::Spec => print(SPEC_SCHEMA),
        TextKind::Bank => print(&with_spec()?),
        TextKind::Report => print(REPORT_SCHEMA),
    }
}

/// The schema of banks with that of their specs in its definitions, so that it stands alone.
fn with_spec() -> Result<String, Failure> {
    let mut bank: serde_json::Value = serde_json::from_str(BANK_SCHEMA).map_err(failed)?;
    bank["$defs"]["spec"] = serde_json::from_str(SPEC_SCHEMA).map_err(failed)?;
    Ok(serde_json::to_string_pretty(&bank).map_err(failed)? + "\n")
}

/// Prints completions for a shell
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank completions bash > ~/.local/share/bash-completion/completions/hybank
  hybank completions fish > ~/.config/fish/completions/hybank.fish")]
pub(super) struct CompletionsArgs {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

pub(super) fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "hybank", &mut script);
    print(&String::from_utf8_lossy(&script))
}

/// Writes the manual pages: hybank.1 and one per command
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Examples:
  hybank man ~/.local/share/man/man1
  man hybank-design")]
pub(super) struct ManArgs {
    /// The folder; created if missing
    folder: PathBuf,
    /// Replace existing pages
    #[arg(long)]
    force: bool,
}

pub(super) fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut program = Cli::command();
    // Gives the commands their full names.
    program.build();
    let commands = program.get_subcommands().cloned();
    let pages = std::iter::once(program.clone()).chain(commands).map(|command| page(command, &args.folder));
    let pages = pages.collect::<Result<Vec<_>, _>>()?;
    check_outputs(&pages.iter().map(|(path, _)| path.as_path()).collect::<Vec<_>>(), &[])?;
    write_together(&args.folder, pages.into_iter().map(Ok), |(path, text)| {
        Ok(vec![begin_file(&path, &text, args.force)?])
    })
}

/// A page in this folder: its file and its text.
fn page(command: clap::Command, folder: &Path) -> Result<(PathBuf, Vec<u8>), Failure> {
    let mut text = Vec::new();
    let man = clap_mangen::Man::new(command.version(env!("CARGO_PKG_VERSION")));
    man.render(&mut text).map_err(failed)?;
    Ok((folder.join(man.get_filename()), text))
}
