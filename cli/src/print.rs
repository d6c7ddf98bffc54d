//! All that the commands say: results on standard output, messages on standard error, and the one message
//! of a failure, with the options of this program that remedy an error of the library. The library itself
//! names keys of the spec and fields, because its errors are also read in Python, in C and in a browser.

use hybank::align::AlignError;
use hybank::calibrate::{CalibrateError, CalibrationWarning};
use hybank::design::DesignError;
use hybank::files::FileError;
use hybank::interchange::ExportError;
use hybank::io::IoError;
use hybank::messages::printable;
use hybank::overview::understood;
use hybank::pipeline::PipelineError;
use hybank::spec::Spec;
use hybank::verify::VerifyError;
pub(super) use hybank_program::{Failure, is_dash, print, print_bytes, say};
use hybank_program::{Program, put};
use std::any::Any;
use std::fmt::Display;
use std::io::IsTerminal;
use std::path::{Path, PathBuf};

/// This program in its messages.
pub(crate) const PROGRAM: Program = Program { name: "hybank", has_bar: false };

/// A failure of the input or the design.
pub(crate) fn failed(problem: impl Display + 'static) -> Failure {
    Failure::Input(explained(&problem))
}

/// A failure of the file at `path`.
pub(super) fn failed_at(path: &Path, problem: impl Display + 'static) -> Failure {
    failed(problem).in_file(name(path).as_ref())
}

/// A failure of a run. A closed output pipe is not reported as an error.
pub(super) fn stopped(error: impl Into<PipelineError>) -> Failure {
    match error.into() {
        error if error.is_closed_pipe() => Failure::ClosedPipe,
        error => failed(error),
    }
}

/// Names what a failed run has left of what cannot be recorded again.
pub(super) fn with_remains(failure: Failure, files: &[PathBuf]) -> Failure {
    let is_something = |file: &&PathBuf| {
        // A link in its place is not what was recorded.
        file.symlink_metadata().is_ok_and(|found| found.is_file() && found.len() > 0)
    };
    let names: Vec<String> =
        files.iter().filter(is_something).map(|file| file.display().to_string()).collect();
    match failure {
        Failure::Input(message) if !names.is_empty() => {
            Failure::Input(format!("{message}; what was recorded is in {}", names.join(" and ")))
        }
        Failure::ClosedPipe if !names.is_empty() => {
            let files = names.join(" and ");
            warn(&format!("the output was closed before the end; what was recorded is in {files}"));
            Failure::ClosedPipe
        }
        other => other,
    }
}

/// Results whose errors are about a file.
pub(super) trait InFile<T> {
    /// Names the file before the error.
    fn in_file(self, path: &Path) -> Result<T, Failure>;
}

impl<T, E: Display + 'static> InFile<T> for Result<T, E> {
    fn in_file(self, path: &Path) -> Result<T, Failure> {
        self.map_err(|error| failed_at(path, error))
    }
}

/// One JSON object on standard output.
pub(super) fn print_json(report: &impl serde::Serialize) -> Result<(), Failure> {
    print(&(serde_json::to_string(report).map_err(failed)? + "\n"))
}

/// Refuses a report and an output of `what` that both go to standard output.
pub(super) fn check_json(json: bool, output: &Path, what: &str) -> Result<(), Failure> {
    if json && is_dash(output) {
        let message = format!("--json and `-o -` both want standard output; write the {what} to a file");
        return Err(Failure::Usage(message));
    }
    Ok(())
}

/// A report: as one JSON object, or as text.
pub(super) fn show<R: serde::Serialize>(
    report: &R,
    json: bool,
    text: impl FnOnce(&R) -> String,
) -> Result<(), Failure> {
    if json { print_json(report) } else { print(&printable(&text(report))) }
}

/// A line on standard error with the program's name before it.
pub(super) fn say_line(line: &str) {
    PROGRAM.say_line(line);
}

/// A warning on standard error.
pub(super) fn warn(warning: &str) {
    PROGRAM.warn(warning);
}

/// With `strict` the first warning is an error.
pub(super) fn check_strict(warnings: &[String], strict: bool) -> Result<(), Failure> {
    match warnings.first() {
        Some(first) if strict => Err(Failure::Input(format!("{first} (an error because of --strict)"))),
        _ => Ok(()),
    }
}

/// What was understood from a spec, where a person reads it.
pub(super) fn say_understood(spec: Option<&Spec>) {
    if std::io::stderr().is_terminal() {
        spec.iter().for_each(|spec| say(&format!("{}\n", understood(spec))));
    }
}

/// The name of a file in messages.
pub(super) fn name(path: &Path) -> String {
    if is_dash(path) { "standard input".to_owned() } else { path.display().to_string() }
}

/// A word as a shell takes it: quoted where it has a character that means something there.
pub(super) fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./,:=@%+".contains(c);
    if text.chars().all(is_plain) { text.to_owned() } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// The text of an error or a warning, followed by the option that remedies it.
pub(super) fn explained(error: &(impl Display + 'static)) -> String {
    option(error).map_or_else(|| error.to_string(), |option| format!("{error}; {option}"))
}

fn option(error: &dyn Any) -> Option<&'static str> {
    let of_file = |error: &FileError| match error {
        FileError::Exists { .. } => Some("--force replaces it"),
        FileError::Special { .. } => Some("or write to `-` and redirect"),
        _ => None,
    };
    None.or_else(|| of_file(error.downcast_ref()?))
        .or_else(|| match error.downcast_ref()? {
            IoError::File(error) => of_file(error),
            _ => None,
        })
        .or_else(|| match error.downcast_ref()? {
            PipelineError::File(error) | PipelineError::Io(IoError::File(error)) => of_file(error),
            _ => None,
        })
        .or_else(|| of_design(error.downcast_ref()?))
        .or_else(|| of_proof(error.downcast_ref()?))
        .or_else(|| of_calibration(error.downcast_ref()?))
        .or_else(|| match error.downcast_ref()? {
            CalibrationWarning::CutoffExplains { .. } => Some("--fit takes that list"),
            CalibrationWarning::MoreTones { .. } => Some("--blind does that"),
            CalibrationWarning::OffsetBinary => Some("--full-scale u8bits does the same"),
            _ => None,
        })
        .or_else(|| match error.downcast_ref()? {
            ExportError::NoIntegers { .. } => Some("`hybank design --bits B` designs them"),
            ExportError::Offset { .. } => Some("--input-bits B does"),
            ExportError::NoInputBits => Some("--input-bits B does"),
            ExportError::NoWords => Some("leave out --input-bits"),
            _ => None,
        })
        .or_else(|| match error.downcast_ref()? {
            AlignError::Ambiguous { .. } => Some("--within says so"),
            AlignError::Spec(error) => of_calibration(error),
            _ => None,
        })
}

fn of_design(error: &DesignError) -> Option<&'static str> {
    match error {
        DesignError::StoppedWithoutBank { .. } => {
            Some("its limit is ten minutes of the clock, and --no-limit runs it to its end")
        }
        DesignError::Verify(error) => of_proof(error),
        _ => None,
    }
}

fn of_proof(error: &VerifyError) -> Option<&'static str> {
    match error {
        VerifyError::NoCertificate => {
            Some("`hybank design` writes one, and `hybank verify --search` searches for one")
        }
        _ => None,
    }
}

fn of_calibration(error: &CalibrateError) -> Option<&'static str> {
    match error {
        CalibrateError::ComplexSamples { .. } => Some("--tone names them, or finds them with `auto`"),
        CalibrateError::AmbiguousZone { .. } => Some("--tone takes it"),
        CalibrateError::NotIdentifiable | CalibrateError::CutoffLooksLikeDelay { .. } => {
            Some("--fit takes what is fitted")
        }
        _ => None,
    }
}

/// The report as one JSON object: on standard output, or on standard error where samples go to standard
/// output.
pub(super) fn print_report(report: &impl serde::Serialize, samples: &Path) -> Result<(), Failure> {
    if !is_dash(samples) {
        return print_json(report);
    }
    put(&(serde_json::to_string(report).map_err(failed)? + "\n"));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn a_shell_reads_a_word_as_it_is() {
        for path in ["a/b.wav", "two words.wav", "it's $HOME; `ls` \"x\" \\ *", "größe.wav", "-o", "#1"] {
            let script = format!("printf %s {}", shell_word(path));
            let output = std::process::Command::new("sh").args(["-c", &script]).output().unwrap();
            assert_eq!(String::from_utf8(output.stdout).unwrap(), path);
        }
        assert_eq!(shell_word("a/b.wav"), "a/b.wav");
    }
}
