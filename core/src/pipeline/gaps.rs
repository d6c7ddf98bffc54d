//! Missing samples: their replacement, their position, and the outputs that they affect.
//!
//! A missing sample is marked by NaN; a complex sample is missing if one of its parts is. An output of an
//! FIR bank is affected if one of its taps falls on a missing sample. Outputs are exact again when the gap
//! has left the history of the filters. A recursive bank has infinite history, so all later outputs count
//! as affected.

use crate::bank::{Bank, FrameLayout, FrameSample, SynthesisFilters};
use crate::runtime::{Input, Isa};
use std::fmt;
use std::ops::Range;

/// Maximum number of gaps that a report lists; further gaps are only counted, so that memory stays bounded.
pub const LISTED_GAPS: usize = 65_536;

/// A run of missing samples of one converter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Gap {
    /// The channel, from 1.
    pub channel: usize,
    /// Number of its first sample among those of the converter, from 0: its frame, for converters of one
    /// rate.
    pub first: u64,
    /// Samples that are missing.
    pub length: u64,
}

impl fmt::Display for Gap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { channel, first, length } = self;
        write!(f, "gap: channel {channel}, sample {first}, {length} missing")
    }
}

/// The gaps of a run.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize)]
pub struct GapSummary {
    /// Number of gaps that have ended.
    pub count: u64,
    /// Number of missing samples.
    pub missing: u64,
    /// The gaps in the order of their ends, at most [`LISTED_GAPS`] of them.
    pub list: Vec<Gap>,
}

/// The replacement of a missing sample. What is replaced are the samples as the converters deliver them, so
/// a converter without a signal delivers its offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum GapPolicy {
    /// Zero after the offset is subtracted: the channel's offset.
    Zero,
    /// The converter's last good sample (as [`GapPolicy::Zero`] before the first).
    Hold,
}

/// The state of a converter.
#[derive(Debug, Clone, Copy)]
struct Converter {
    /// What it delivers without a signal.
    offset: f64,
    /// The last good sample: a real one, or both parts of a complex one.
    last: [f64; 2],
    /// The gap that has not ended.
    open: Option<Gap>,
}

/// Fills gaps frame by frame.
///
/// Output p of frame k is y\[kM + p\] = sum_i sum_j f_i\[p + jM\] x_i\[k - j\], so a missing x_i\[k\]
/// affects y\[kM + n\] if and only if f_i\[n\] is not zero. It marks these outputs at once, which takes less
/// time than filtering it.
#[derive(Debug, Clone)]
pub(super) struct GapFiller {
    policy: GapPolicy,
    ratio: usize,
    /// The runs of nonzero taps of each sample of a frame; `None` for a recursion.
    taps: Option<Vec<Vec<Range<usize>>>>,
    layout: FrameLayout,
    /// The samples of a frame.
    samples: Vec<FrameSample>,
    converters: Vec<Converter>,
    summary: GapSummary,
    frame: u64,
    /// The filled frames of each part of the samples.
    numbers: Vec<Vec<f64>>,
    /// The marks of the outputs of the last frames, and the known marks of later outputs.
    marks: Vec<u8>,
    /// How many of the marks belong to the last frames.
    used: usize,
    /// Samples by which the outputs are later than those of the definition.
    extra_latency: usize,
}

impl GapFiller {
    /// A filler for the channels and taps of a bank, and samples of so many parts. The outputs are
    /// `extra_latency` samples later than those of the definition.
    pub(super) fn new(bank: &Bank, policy: GapPolicy, parts: usize, extra_latency: usize) -> Self {
        let converter = |&offset: &f64| Converter { offset, last: [offset; 2], open: None };
        let layout = bank.layout();
        Self {
            policy,
            ratio: bank.ratio,
            taps: nonzero_taps(bank),
            samples: layout.iter().collect(),
            layout,
            converters: bank.offsets.iter().map(converter).collect(),
            summary: GapSummary::default(),
            frame: 0,
            numbers: vec![Vec::new(); parts],
            marks: Vec::new(),
            used: 0,
            extra_latency,
        }
    }

    /// Takes the next frames of all `parts` of the samples. True if [`GapFiller::filled`] has to take their
    /// place; else no sample is missing.
    pub(super) fn fill(&mut self, parts: &[impl Input]) -> bool {
        let frames = parts.first().map_or(0, Input::frames);
        self.begin_marks(frames);
        if self.open().next().is_none() && parts.iter().all(|part| part.is_finite(0..frames)) {
            self.pass(parts, frames);
            return false;
        }
        let n = self.samples.len();
        for (numbers, part) in self.numbers.iter_mut().zip(parts) {
            numbers.resize(frames * n, 0.0);
            part.load_f64(Isa::detect(), 0, numbers);
        }
        for frame in 0..frames {
            (0..n).for_each(|i| self.fill_sample(frame, i));
        }
        self.frame += frames as u64;
        true
    }

    /// The frames of one part, filled.
    pub(super) fn filled(&self, part: usize) -> &[f64] {
        &self.numbers[part]
    }

    /// For some of the outputs of the last frames: 1 if a missing sample affects it, else 0.
    pub(super) fn marks(&self, outputs: Range<usize>) -> &[u8] {
        &self.marks[outputs]
    }

    /// The gaps that have ended.
    pub(super) fn summary(&self) -> &GapSummary {
        &self.summary
    }

    /// The gaps that have not ended, with their length so far.
    pub(super) fn open(&self) -> impl Iterator<Item = Gap> {
        self.converters.iter().filter_map(|converter| converter.open)
    }

    /// All gaps, once the input is over: those that are open end there.
    pub(super) fn finish(mut self) -> GapSummary {
        (0..self.converters.len()).for_each(|converter| self.end_gap(converter));
        self.summary
    }

    /// Room for the marks of so many frames. After a missing sample all later outputs of a recursion are
    /// affected.
    fn begin_marks(&mut self, frames: usize) {
        self.marks.drain(..self.used);
        self.used = frames * self.ratio;
        let later = u8::from(self.taps.is_none() && self.summary.missing > 0);
        self.marks.resize(self.marks.len().max(self.used + self.extra_latency), later);
    }

    /// Frames without a gap, while none is open: only the last samples matter.
    fn pass(&mut self, parts: &[impl Input], frames: usize) {
        self.frame += frames as u64;
        if frames == 0 {
            return;
        }
        for (p, (numbers, part)) in self.numbers.iter_mut().zip(parts).enumerate() {
            numbers.resize(self.samples.len(), 0.0);
            part.load_f64(Isa::detect(), frames - 1, numbers);
            self.samples.iter().zip(numbers).for_each(|(sample, last)| {
                self.converters[sample.converter].last[p] = *last;
            });
        }
    }

    /// Sample i of frame `frame` of the block.
    fn fill_sample(&mut self, frame: usize, i: usize) {
        let index = frame * self.samples.len() + i;
        let FrameSample { converter, number } = self.samples[i];
        if self.numbers.iter().all(|part| part[index].is_finite()) {
            let last = self.converters[converter].last.iter_mut();
            last.zip(&self.numbers).for_each(|(last, part)| *last = part[index]);
            return self.end_gap(converter);
        }
        let Converter { offset, last, .. } = self.converters[converter];
        for (part, last) in self.numbers.iter_mut().zip(last) {
            part[index] = if self.policy == GapPolicy::Hold { last } else { offset };
        }
        self.mark(frame, i);
        let per_frame = self.layout.samples()[converter] as u64;
        let first = (self.frame + frame as u64) * per_frame + number as u64;
        let new = Gap { channel: converter + 1, first, length: 0 };
        self.converters[converter].open.get_or_insert(new).length += 1;
        self.summary.missing += 1;
    }

    /// Marks the outputs that sample i of frame `frame` of the block affects.
    fn mark(&mut self, frame: usize, i: usize) {
        let first = frame * self.ratio + self.extra_latency;
        let Some(taps) = &self.taps else { return self.marks[first..].fill(1) };
        for run in &taps[i] {
            let end = first + run.end;
            self.marks.resize(self.marks.len().max(end), 0);
            self.marks[first + run.start..end].fill(1);
        }
    }

    fn end_gap(&mut self, converter: usize) {
        let Some(gap) = self.converters[converter].open.take() else { return };
        self.summary.count += 1;
        if self.summary.list.len() < LISTED_GAPS {
            self.summary.list.push(gap);
        }
    }
}

/// The runs of nonzero taps of each sample of a frame; `None` for a recursion.
fn nonzero_taps(bank: &Bank) -> Option<Vec<Vec<Range<usize>>>> {
    match &bank.filters {
        SynthesisFilters::Fir(taps) => Some(taps.iter().map(|f| nonzero_runs(f.iter().copied())).collect()),
        SynthesisFilters::StateSpace(block) if block.a.is_empty() => {
            let outputs = || block.d.iter().take(bank.ratio);
            let taps = |i: usize| outputs().map(move |row| row.get(i).copied().unwrap_or(0.0));
            Some((0..bank.frame_samples()).map(|i| nonzero_runs(taps(i))).collect())
        }
        SynthesisFilters::StateSpace(_) => None,
    }
}

/// The ranges of numbers that are not zero.
fn nonzero_runs(numbers: impl Iterator<Item = f64>) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (n, _) in numbers.enumerate().filter(|(_, number)| *number != 0.0) {
        match runs.last_mut() {
            Some(run) if run.end == n => run.end += 1,
            _ => runs.push(n..n + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests;
