//! Missing samples on the command line: what stands in for them, the report, the mask file.

use super::Failure;
use super::output::failure;
use crate::bank::Bank;
use crate::io::{AtomicFile, PcmFormat, PcmFrames, SampleLayout};
use crate::runtime::{Gap, GapFiller, GapPolicy};
use std::io::Write;
use std::ops::Range;
use std::path::PathBuf;

/// Gaps that are told one by one on standard error.
const TOLD: usize = 10;

/// Options of the verbs that can bridge gaps.
#[derive(Debug, clap::Args)]
pub(super) struct GapArgs {
    /// Bridge and report missing samples, which NaN marks: by the last good sample, by zero, or by
    /// zero with a mask (which needs --mask)
    #[arg(long, value_enum, value_name = "POLICY")]
    gaps: Option<Policy>,
    /// Write one byte for each output sample: 1 if a missing sample touched it, 0 if not
    #[arg(long, value_name = "FILE", requires = "gaps")]
    mask: Option<PathBuf>,
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
    /// The stage between inputs and filters, if gaps are to be bridged.
    pub(super) fn stage(&self, bank: &Bank, force: bool) -> Result<Option<GapStage>, Failure> {
        let Some(policy) = self.gaps else { return Ok(None) };
        if policy == Policy::Mask && self.mask.is_none() {
            return Err(Failure::Usage("--gaps mask needs --mask FILE for the marks".into()));
        }
        let fill = if policy == Policy::Hold { GapPolicy::Hold } else { GapPolicy::Zero };
        let filler = GapFiller::new(bank, fill).map_err(Failure::input)?;
        let mask = self.mask.as_ref().map(|path| AtomicFile::create(path, force)).transpose();
        Ok(Some(GapStage {
            filler,
            file: mask.map_err(Failure::input)?,
            ticks: Vec::new(),
            bytes: Vec::new(),
            mask: Vec::new(),
        }))
    }
}

/// Fills the gaps of each block before it is fused.
pub(super) struct GapStage {
    filler: GapFiller,
    file: Option<AtomicFile>,
    /// The block as numbers, as bytes, and the marks of its outputs.
    ticks: Vec<f64>,
    bytes: Vec<u8>,
    mask: Vec<u8>,
}

impl GapStage {
    /// The same ticks without gaps.
    pub(super) fn fill(&mut self, frames: &[PcmFrames<'_>]) -> PcmFrames<'_> {
        let channels = frames.iter().map(|part| part.channels).sum();
        decode(frames, &mut self.ticks);
        self.filler.fill(&mut self.ticks, &mut self.mask);
        self.bytes.clear();
        self.bytes.extend(self.ticks.iter().flat_map(|x| x.to_le_bytes()));
        let layout = SampleLayout::packed(PcmFormat::F64Le);
        PcmFrames { layout, channels, bytes: &self.bytes }
    }

    /// Writes the marks of the block's outputs that are written themselves.
    pub(super) fn write_mask(&mut self, samples: Range<usize>) -> Result<(), Failure> {
        let Some(file) = &mut self.file else { return Ok(()) };
        let written = file.write_all(&self.mask[samples]);
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

/// Interleaved ticks of all parts.
fn decode(frames: &[PcmFrames<'_>], ticks: &mut Vec<f64>) {
    ticks.clear();
    let count = frames.iter().map(PcmFrames::frames).min().unwrap_or(0);
    for k in 0..count {
        for part in frames {
            let frame = &part.bytes[k * part.frame_bytes()..(k + 1) * part.frame_bytes()];
            let samples = frame.chunks_exact(part.layout.container);
            ticks.extend(samples.map(|sample| part.layout.format.decode(sample)));
        }
    }
}
