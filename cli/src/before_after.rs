//! `fuse --measure`: the figures of the recording before and after.

use super::capture_file::{CaptureFile, MOST_MEASURED, ReadingRules, check_files_on_disk, unread};
use super::measure::{ToneArg, tone, tones};
use super::plot::{check_picture, write_picture};
use super::print::{Failure, failed, is_dash};
use hybank::bank::Bank;
use hybank::captures::Captures;
use hybank::files::{FileError, refuse_overlaps};
use hybank::io::{MultiReader, check_real, is_pipe};
use hybank::messages::Quoted;
use hybank::overview::{BeforeAfter, Unmeasured, before_after, column};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// The options.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct BeforeAfterArgs {
    /// Measure the recording of a tone before, as plain interleaving of the inputs, and after, as
    /// `hybank measure` does
    #[arg(long, conflicts_with = "track")]
    measure: bool,
    /// Tones to measure (9kHz, 1.2GHz, or hertz); auto: the largest one
    #[arg(long, value_name = "F,..", value_delimiter = ',', value_parser = tone, requires = "measure")]
    tone: Vec<ToneArg>,
    /// Write the spectra before and after with their spurs, as SVG
    #[arg(long, value_name = "OUT.svg", requires = "measure")]
    plot: Option<PathBuf>,
}

impl BeforeAfterArgs {
    /// Refuses what cannot be read twice, and a plot that cannot be written, before any file is read.
    pub(super) fn check(&self, inputs: &[PathBuf], output: &Path, force: bool) -> Result<(), Failure> {
        if !self.measure {
            return Ok(());
        }
        tones(&self.tone)?;
        if is_dash(output) {
            let message = "--measure reads the output once more; write it to a file";
            return Err(Failure::Usage(message.into()));
        }
        check_files_on_disk(inputs, "--measure")?;
        if is_pipe(output) {
            let message =
                format!("--measure reads the output once more, which {} cannot give", Quoted(output));
            return Err(Failure::Usage(message));
        }
        let Some(plot) = &self.plot else { return Ok(()) };
        if is_dash(plot) {
            let message = "--plot -: the figures go to standard output; write the plot to a file";
            return Err(Failure::Usage(message.into()));
        }
        check_picture(plot)?;
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        refuse_overlaps(&[plot.as_path(), output], &inputs).map_err(failed)?;
        if plot.exists() && !force {
            return Err(failed(FileError::Exists { file: plot.display().to_string() }));
        }
        Ok(())
    }

    /// True if something is to be measured.
    pub(super) fn is_wanted(&self) -> bool {
        self.measure
    }

    /// Measures the inputs, which `reader` reads once more, and the finished output.
    pub(super) fn measured(
        &self,
        bank: &Bank,
        mut reader: MultiReader,
        output: &Path,
        force: bool,
    ) -> Result<BeforeAfter, Failure> {
        let fused = CaptureFile::read(output, ReadingRules::channel(None, MOST_MEASURED))?;
        check_real(&reader).map_err(failed)?;
        let captures = Captures::read(&mut reader, MOST_MEASURED).map_err(unread)?;
        let channels: Vec<_> = captures.channels.into_iter().map(|channel| channel.samples).collect();
        let fused_samples = &fused.channel.samples;
        let found = BeforeAfter::of(bank, fused.rate, &channels, fused_samples, tones(&self.tone)?);
        let found = found.map_err(|Unmeasured { which, error }| {
            let output = Quoted(output);
            Failure::Input(format!("{output} is written, but --measure cannot measure {which}: {error}"))
        })?;
        if let Some(path) = &self.plot {
            write_picture(path, &before_after(&found.before, &found.after), force)?;
        }
        Ok(found)
    }
}

/// Both columns side by side.
pub(super) fn text(measured: &BeforeAfter) -> String {
    let tone = measured.after.tones.first();
    let mut text = tone.map_or_else(String::new, |tone| {
        format!("tone at {:.6}, {:.2} dBFS\n", tone.frequency.value, tone.level.0)
    });
    let _ = writeln!(text, "{:<16} {:>12} {:>12}", "", "interleaved", "fused");
    for (before, after) in column(&measured.before).iter().zip(column(&measured.after)) {
        let _ = writeln!(text, "{:<16} {:>12} {:>12} {}", after.name, before.value, after.value, after.unit);
    }
    text
}
