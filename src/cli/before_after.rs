//! `fuse --measure`: the figures of the recording before and after.

use super::capture_file::{CaptureFile, MOST_MEASURED, Reading, Whole, check_files_on_disk};
use super::measure::{ToneArg, tone, tones};
use super::measure_report::column;
use super::plot::PictureFormat;
use super::print::{Failure, is_dash};
use super::spur_chart::before_after;
use super::written::write_bytes;
use crate::bank::{Bank, SynthesisFilters};
use crate::files::{FileError, refuse_overlaps};
use crate::io::{MultiReader, is_pipe};
use crate::measure::{MeasureError, Measurement, Settings, measure};
use crate::messages::Quoted;
use crate::simulate::interleaved;
use crate::units::Hertz;
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};

/// Fast samples at either end that are not measured, beside the latency and the length of the filters: a
/// recursive bank settles in that time.
const MARGIN: usize = 512;
/// Least part of the recording that stays.
const LEAST_PART: usize = 2;

/// The options.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct BeforeAfterArgs {
    /// Measure the recording of a tone before, as plain interleaving of the inputs, and after, as
    /// `hybank measure` does
    #[arg(long)]
    measure: bool,
    /// Tones to measure (9kHz, 1.2GHz, or hertz); auto: the largest one
    #[arg(long, value_name = "F,..", value_delimiter = ',', value_parser = tone, requires = "measure")]
    tone: Vec<ToneArg>,
    /// Write the spectra before and after with their spurs: PNG if the name ends in .png, else SVG
    #[arg(long, value_name = "OUT.svg|.png", requires = "measure")]
    plot: Option<PathBuf>,
}

/// The figures of both.
#[derive(Debug, serde::Serialize)]
pub(super) struct BeforeAfter {
    /// Of plain interleaving: each output sample is the input sample that was taken nearest to it.
    pub(super) before: Measurement,
    pub(super) after: Measurement,
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
        let inputs: Vec<&Path> = inputs.iter().map(PathBuf::as_path).collect();
        refuse_overlaps(&[plot.as_path(), output], &inputs).map_err(Failure::input)?;
        if plot.exists() && !force {
            return Err(Failure::input(FileError::Exists { file: plot.display().to_string() }));
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
        let fused = CaptureFile::read(output, Reading::channel(None, MOST_MEASURED))?;
        let channels = Whole::read(&mut reader, MOST_MEASURED)?.channels;
        let found = BeforeAfter::of(bank, fused.rate, &channels, &fused.samples, tones(&self.tone)?);
        let found = found.map_err(|Unmeasured { which, error }| {
            let output = Quoted(output);
            Failure::Input(format!("{output} is written, but --measure cannot measure {which}: {error}"))
        })?;
        if let Some(path) = &self.plot {
            let (chart, marks) = before_after(&found.before, &found.after);
            let format = PictureFormat::of(path).unwrap_or(PictureFormat::Svg);
            write_bytes(path, &format.file(&chart, &marks).map_err(Failure::input)?, force)?;
        }
        Ok(found)
    }
}

/// Why one of two recordings cannot be measured.
#[derive(Debug)]
pub(super) struct Unmeasured {
    which: &'static str,
    error: MeasureError,
}

impl fmt::Display for Unmeasured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.which, self.error)
    }
}

impl BeforeAfter {
    /// Of captures, and of what `bank` made of them at the fast `rate`, with these tones, or the largest
    /// one.
    pub(super) fn of(
        bank: &Bank,
        rate: Hertz,
        captures: &[Vec<f64>],
        fused: &[f64],
        tones: Vec<Hertz>,
    ) -> Result<Self, Unmeasured> {
        let rails = (f64::NEG_INFINITY, f64::INFINITY);
        let settings = Settings { tones, converters: bank.ratio, rails, ..Settings::default() };
        let of = |which, samples: &[f64]| {
            measure(inner(bank, samples), rate, &settings).map_err(|error| Unmeasured { which, error })
        };
        let plain = interleaved(&bank.sample_delays(), bank.ratio, bank.wait(), captures);
        Ok(Self { before: of("plain interleaving", &plain)?, after: of("the output", fused)? })
    }
}

/// The samples without those at the ends, where the filters lack input.
fn inner<'a>(bank: &Bank, samples: &'a [f64]) -> &'a [f64] {
    let taps = match &bank.filters {
        SynthesisFilters::Fir(taps) => taps.iter().map(Vec::len).max().unwrap_or(0),
        SynthesisFilters::StateSpace(_) => MARGIN,
    };
    let margin = (bank.latency + taps + MARGIN).min(samples.len() / (2 * LEAST_PART));
    &samples[margin..samples.len() - margin]
}

impl BeforeAfter {
    /// Both columns side by side.
    pub(super) fn text(&self) -> String {
        let tone = self.after.tones.first();
        let mut text = tone.map_or_else(String::new, |tone| {
            format!("tone at {:.6}, {:.2} dBFS\n", tone.frequency.value, tone.level.0)
        });
        let _ = writeln!(text, "{:<16} {:>12} {:>12}", "", "interleaved", "fused");
        for (before, after) in column(&self.before).iter().zip(column(&self.after)) {
            let _ =
                writeln!(text, "{:<16} {:>12} {:>12} {}", after.name, before.value, after.value, after.unit);
        }
        text
    }
}
