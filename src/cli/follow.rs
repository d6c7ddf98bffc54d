//! Tells the journal what a pipeline does, step by step.

use super::journal::{Event, Journal, Span};
use crate::io::PcmFrames;
use crate::pipeline::{Gap, Pipeline};
use std::time::{Duration, Instant};

/// Time after which a gap that goes on is reported.
const PATIENCE: Duration = Duration::from_secs(1);

/// What has been reported of a pipeline.
pub(super) struct Follow {
    journal: Journal,
    frames: u64,
    samples: u64,
    gaps: usize,
    replaced: u64,
    clipped: u64,
    warnings: usize,
    /// The gap of each channel that goes on.
    open: Vec<Open>,
}

/// A gap that goes on.
#[derive(Debug, Clone, Copy)]
struct Open {
    channel: usize,
    first: u64,
    since: Instant,
    is_told: bool,
}

impl Follow {
    pub(super) fn new(journal: Journal) -> Self {
        let open = Vec::new();
        Self { journal, frames: 0, samples: 0, gaps: 0, replaced: 0, clipped: 0, warnings: 0, open }
    }

    /// Tells what happened since the last call, with the frames of this step.
    pub(super) fn step(&mut self, parts: &[PcmFrames<'_>], pipeline: &Pipeline) {
        let frames = self.frames + parts.iter().map(PcmFrames::frames).min().unwrap_or(0) as u64;
        let (samples, replaced, clipped) = (pipeline.samples(), pipeline.replaced(), pipeline.clipped());
        if replaced > self.replaced {
            self.journal.report(Event::Replaced(span(self.frames, frames, replaced - self.replaced)));
        }
        if clipped > self.clipped {
            self.journal.report(Event::Clipped(span(self.samples, samples, clipped - self.clipped)));
        }
        (self.frames, self.samples, self.replaced, self.clipped) = (frames, samples, replaced, clipped);
        let gaps = pipeline.gaps();
        gaps[self.gaps..].iter().for_each(|&gap| self.journal.report(Event::Gap(gap)));
        self.gaps = gaps.len();
        let warnings = pipeline.warnings();
        for text in &warnings[self.warnings..] {
            self.journal.report(Event::Warning { text: text.clone() });
        }
        self.warnings = warnings.len();
        self.follow_open(pipeline);
    }

    fn follow_open(&mut self, pipeline: &Pipeline) {
        let known = std::mem::take(&mut self.open);
        for gap in pipeline.open_gaps() {
            let Gap { channel, first, .. } = gap;
            let is_this = |open: &&Open| (open.channel, open.first) == (channel, first);
            let new = Open { channel, first, since: Instant::now(), is_told: false };
            let mut open = known.iter().find(is_this).copied().unwrap_or(new);
            if !open.is_told && open.since.elapsed() >= PATIENCE {
                self.journal.report(Event::GapGoesOn(gap));
                open.is_told = true;
            }
            self.open.push(open);
        }
    }
}

fn span(begin: u64, end: u64, samples: u64) -> Span {
    Span { first: begin, last: end.saturating_sub(1).max(begin), samples }
}
