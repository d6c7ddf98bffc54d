//! Missing samples on the command line: what stands in for them, the report, the mask file.

use super::Failure;
use super::output::failure;
use crate::bank::Bank;
use crate::io::{AtomicFile, LostSamples, PcmFrames, Until};
use crate::pipeline::{Gap, GapFiller, GapPolicy};
use std::borrow::Cow;
use std::io::Write;
use std::ops::Range;
use std::path::PathBuf;

/// Gaps that are told one by one on standard error.
const TOLD: usize = 10;

/// Options of the verbs that can bridge gaps.
#[derive(Debug, clap::Args)]
pub(super) struct GapArgs {
    /// Bridge and report missing samples, which NaN, SigMF captures or --lost tell: by the last good sample, by
    /// zero, or by zero with a mask (which needs --mask)
    #[arg(long, value_enum, value_name = "POLICY")]
    gaps: Option<Policy>,
    /// Write one byte for each output sample: 1 if a missing sample touched it, 0 if not
    #[arg(long, value_name = "FILE", requires = "gaps")]
    mask: Option<PathBuf>,
    /// Lines of JSON that tell which samples were left out, {"channel": 1, "sample_start": 5, "global_index": 8}, or
    /// are void, {"channel": 2, "first": 40, "length": 3}
    #[arg(long, value_name = "FILE", requires = "gaps")]
    lost: Option<PathBuf>,
    /// Go on until the last channel ends: what the others lack is missing, and not left out of the result
    #[arg(long, requires = "gaps")]
    longest: bool,
}

/// What stands in for a missing sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Policy {
    /// The channel's last good sample
    Hold,
    /// Zero
    Zero,
    /// Zero, and the touched outputs are marked in the mask file
    Mask,
}

/// What the report says of gaps.
#[derive(Debug, serde::Serialize)]
pub(super) struct GapReport {
    /// Gaps in all.
    count: u64,
    /// Samples that were missing in all.
    missing: u64,
    /// The gaps, at most 65,536 of them.
    list: Vec<Gap>,
}

impl GapArgs {
    /// What is known of lost samples.
    pub(super) fn lost(&self) -> Result<Option<LostSamples>, Failure> {
        self.lost.as_deref().map(LostSamples::read).transpose().map_err(Failure::input)
    }

    /// True if gaps are to be bridged.
    pub(super) fn are_bridged(&self) -> bool {
        self.gaps.is_some()
    }

    /// Which input decides when the run ends.
    pub(super) fn until(&self) -> Until {
        if self.longest { Until::Longest } else { Until::Shortest }
    }

    /// The stage between inputs and filters that are `late` samples late, if gaps are to be bridged.
    pub(super) fn stage(&self, bank: &Bank, late: usize, force: bool) -> Result<Option<GapStage>, Failure> {
        let Some(policy) = self.gaps else { return Ok(None) };
        if policy == Policy::Mask && self.mask.is_none() {
            return Err(Failure::Usage("--gaps mask needs --mask FILE for the marks".into()));
        }
        let fill = if policy == Policy::Hold { GapPolicy::Hold } else { GapPolicy::Zero };
        let filler = GapFiller::new(bank, fill).map_err(Failure::input)?;
        let mask = self.mask.as_ref().map(|path| AtomicFile::create(path, force)).transpose();
        let file = mask.map_err(Failure::input)?;
        Ok(Some(GapStage { filler, file, fresh: Vec::new(), mask: vec![0; late] }))
    }
}

/// Fills the gaps of each block before it is fused.
pub(super) struct GapStage {
    filler: GapFiller,
    file: Option<AtomicFile>,
    /// The marks of the block's ticks.
    fresh: Vec<u8>,
    /// The marks of the block's outputs, and of the later ones that are known already.
    mask: Vec<u8>,
}

impl GapStage {
    /// The same ticks without gaps.
    pub(super) fn fill<'a>(&'a mut self, frames: &'a [PcmFrames<'a>]) -> Cow<'a, [PcmFrames<'a>]> {
        self.filler.fill_pcm(frames, &mut self.fresh)
    }

    /// Writes the marks of the block's outputs that are written themselves.
    pub(super) fn write_mask(&mut self, samples: Range<usize>) -> Result<(), Failure> {
        let Some(file) = &mut self.file else { return Ok(()) };
        self.mask.extend_from_slice(&self.fresh);
        let written = file.write_all(&self.mask[samples]);
        self.mask.drain(..self.fresh.len());
        written.map_err(|error| failure(&file.target().display().to_string(), error))
    }

    /// All gaps; also told on standard error.
    pub(super) fn report(&mut self) -> GapReport {
        self.filler.finish();
        let list = self.filler.gaps().to_vec();
        for gap in list.iter().take(TOLD) {
            eprintln!("hybank: gap: channel {}, sample {}, {} missing", gap.channel, gap.first, gap.length);
        }
        if self.filler.total() > TOLD as u64 {
            eprintln!("hybank: gap: {} in all; --json lists them", self.filler.total());
        }
        GapReport { count: self.filler.total(), missing: self.filler.missing(), list }
    }

    /// Gives the mask file its name.
    pub(super) fn close(self) -> Result<(), Failure> {
        self.file.map_or(Ok(()), |file| file.commit().map_err(Failure::input))
    }
}
