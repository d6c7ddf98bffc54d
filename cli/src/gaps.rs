//! Missing samples on the command line: their estimates, the report, the mask file.

use super::print::say_line;
use super::print::{Failure, InFile, failed};
use super::written::begin_beside;
use hybank::bank::Bank;
use hybank::design::MissingSamples;
use hybank::files::AtomicFile;
use hybank::io::{LostSamples, MAX_LOST, ReadOptions, Until};
use hybank::messages::Quoted;
use hybank::pipeline::{GapEstimator, GapSummary};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum number of gaps that are listed on standard error.
const REPORTED: usize = 10;

/// Options of the commands that can estimate missing samples.
#[derive(Debug, clap::Args)]
pub(super) struct GapArgs {
    /// Estimate missing samples from all those around them, and report them
    ///
    /// They are NaN, jumps of SigMF `core:global_index`, or in the file of --lost. The bank needs its spec.
    #[arg(long)]
    gaps: bool,
    /// Write one byte per output sample: 0 where no missing sample affects it, else its predicted SNR in
    /// whole decibels, from 1 to 255
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    mask: Option<PathBuf>,
    /// File of JSON lines that name lost samples. {"channel": 1, "sample_start": 5, "global_index": 8}:
    /// sample 5 of the input was number 8 at the converter; the first such line of a channel is about its
    /// sample 0. {"channel": 2, "first": 40, "length": 3}:
    /// samples 40 to 42 are invalid
    #[arg(long, value_name = "FILE", hide_short_help = true)]
    lost: Option<PathBuf>,
    /// The most frames (one sample of each channel of an input) that an input may leave out in all; more are
    /// an error, because a number is probably wrong [default: 67108864]
    #[arg(long, value_name = "FRAMES", hide_short_help = true)]
    max_lost: Option<u64>,
    /// Continue until the last channel ends; the missing ends of the other channels are gaps
    #[arg(long, hide_short_help = true)]
    longest: bool,
}

impl GapArgs {
    /// Refuses impossible combinations of options, before any file is read.
    pub(super) fn check(&self) -> Result<(), Failure> {
        if let (false, Some(option)) = (self.gaps, self.only_with_gaps()) {
            return Err(Failure::Usage(format!(
                "{option} is about missing samples, which nothing estimates without --gaps; give it too, or leave \
                 {option} out"
            )));
        }
        if self.mask().is_some_and(|path| path.as_os_str() == "-") {
            let message = "--mask -: the mask cannot go to standard output; give it a file";
            return Err(Failure::Usage(message.into()));
        }
        Ok(())
    }

    /// An option that is given and means nothing without --gaps.
    fn only_with_gaps(&self) -> Option<&'static str> {
        let given = [
            ("--mask", self.mask.is_some()),
            ("--lost", self.lost.is_some()),
            ("--max-lost", self.max_lost.is_some()),
            ("--longest", self.longest),
        ];
        given.into_iter().find_map(|(option, is_given)| is_given.then_some(option))
    }

    /// Reads the file of lost samples, if one is given.
    pub(super) fn lost_samples(&self) -> Result<Option<LostSamples>, Failure> {
        self.lost().map(LostSamples::read).transpose().map_err(failed)
    }

    /// The file of lost samples.
    pub(super) fn lost(&self) -> Option<&Path> {
        self.lost.as_deref()
    }

    /// The mask file.
    pub(super) fn mask(&self) -> Option<&Path> {
        self.mask.as_deref()
    }

    /// The options of reading that concern gaps; the others are those of `options`.
    pub(super) fn read_options<'a>(
        &self,
        lost: Option<&'a LostSamples>,
        options: ReadOptions<'a>,
    ) -> ReadOptions<'a> {
        let until = if self.longest { Until::Longest } else { Until::Shortest };
        ReadOptions { lost, until, max_lost: self.max_lost.unwrap_or(MAX_LOST), ..options }
    }

    /// Whether missing samples are estimated.
    pub(super) fn are_wanted(&self) -> bool {
        self.gaps
    }

    /// What estimates missing samples of the converters of a bank, if that is wanted.
    pub(super) fn estimator(
        &self,
        bank: &Bank,
        path: &Path,
    ) -> Result<Option<Arc<dyn GapEstimator>>, Failure> {
        if !self.gaps {
            return Ok(None);
        }
        if bank.spec.is_none() {
            return Err(Failure::Input(format!(
                "{}: the bank has no spec, so nothing tells how its samples hang together and --gaps cannot estimate \
                 missing ones; design the bank with hybank, or leave --gaps out, which takes 0 for them",
                Quoted(path)
            )));
        }
        let estimator = MissingSamples::of_bank(bank).in_file(path)?;
        Ok(Some(Arc::new(estimator)))
    }

    /// Begins the mask file.
    pub(super) fn begin_mask(&self, force: bool) -> Result<Option<AtomicFile>, Failure> {
        self.mask().map(|path| begin_beside(path, force)).transpose()
    }
}

/// Reports the gaps on standard error; only how many, if they were said during the run.
pub(super) fn say_gaps(gaps: &GapSummary, are_said: bool) {
    if are_said {
        return say_line(&format!("gap: {} in all, {} samples missing", gaps.count, gaps.missing));
    }
    for gap in gaps.list.iter().take(REPORTED) {
        say_line(&gap.to_string());
    }
    if gaps.count > REPORTED as u64 {
        say_line(&format!("gap: {} in all; --json lists them", gaps.count));
    }
}
