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

/// A sample of a frame.
#[derive(Debug, Clone, Copy)]
struct Place {
    of: FrameSample,
    /// It is missing in the last frame.
    is_missing: bool,
}

/// Fills gaps frame by frame.
///
/// A frame takes O(N + M) operations for filters of any length. A gap takes two passes over the intervals of
/// taps of its channel.
#[derive(Debug, Clone)]
pub(super) struct GapFiller {
    policy: GapPolicy,
    ratio: usize,
    /// `None` for a recursion.
    affected: Option<AffectedOutputs>,
    layout: FrameLayout,
    places: Vec<Place>,
    converters: Vec<Converter>,
    summary: GapSummary,
    frame: u64,
    /// The filled frames of each part of the samples.
    numbers: Vec<Vec<f64>>,
    /// The marks of the outputs of the last frames, and the known marks of later outputs.
    marks: Vec<u8>,
    /// How many of the marks belong to the last frames.
    used: usize,
}

impl GapFiller {
    /// A filler for the channels and taps of a bank, and samples of so many parts. The outputs are
    /// `extra_latency` samples later than those of the definition.
    pub(super) fn new(bank: &Bank, policy: GapPolicy, parts: usize, extra_latency: usize) -> Self {
        let ratio = bank.ratio;
        let converter = |&offset: &f64| Converter { offset, last: [offset; 2], open: None };
        let layout = bank.layout();
        Self {
            policy,
            ratio,
            affected: nonzero_phases(bank).map(|nonzero| AffectedOutputs::new(ratio, &nonzero)),
            places: layout.iter().map(|of| Place { of, is_missing: false }).collect(),
            layout,
            converters: bank.offsets.iter().map(converter).collect(),
            summary: GapSummary::default(),
            frame: 0,
            numbers: vec![Vec::new(); parts],
            marks: vec![0; extra_latency],
            used: 0,
        }
    }

    /// Takes the next frames of all `parts` of the samples. True if [`GapFiller::filled`] has to take their
    /// place; else no sample is missing.
    pub(super) fn fill(&mut self, parts: &[impl Input]) -> bool {
        let frames = parts.first().map_or(0, Input::frames);
        self.marks.drain(..self.used);
        self.used = frames * self.ratio;
        if self.is_at_rest() && parts.iter().all(|part| part.is_finite(0..frames)) {
            self.pass(parts, frames);
            return false;
        }
        let n = self.places.len();
        for (numbers, part) in self.numbers.iter_mut().zip(parts) {
            numbers.resize(frames * n, 0.0);
            part.load_f64(Isa::detect(), 0, numbers);
        }
        for frame in 0..frames {
            (0..n).for_each(|i| self.fill_sample(frame * n + i, i));
            self.mark();
            self.frame += 1;
        }
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

    /// True if the marks no longer change: no gap is open and none affects a later output, or all later
    /// outputs are affected.
    fn is_at_rest(&self) -> bool {
        self.affected.as_ref().is_none_or(|affected| affected.unchanged_from <= self.frame)
            && self.open().next().is_none()
            && !self.places.iter().any(|place| place.is_missing)
    }

    /// Frames without a gap, while at rest: only the last samples matter.
    fn pass(&mut self, parts: &[impl Input], frames: usize) {
        let mark = u8::from(self.affected.is_none() && self.summary.missing > 0);
        self.marks.extend(std::iter::repeat_n(mark, frames * self.ratio));
        self.frame += frames as u64;
        if frames == 0 {
            return;
        }
        for (p, (numbers, part)) in self.numbers.iter_mut().zip(parts).enumerate() {
            numbers.resize(self.places.len(), 0.0);
            part.load_f64(Isa::detect(), frames - 1, numbers);
            // In the order of time, so that the last sample of a converter remains.
            self.places.iter().zip(numbers).for_each(|(place, last)| {
                self.converters[place.of.converter].last[p] = *last;
            });
        }
    }

    /// Sample number `index` of the block, which is sample i of its frame.
    fn fill_sample(&mut self, index: usize, i: usize) {
        let FrameSample { converter, number } = self.places[i].of;
        let was_missing = self.places[i].is_missing;
        if self.numbers.iter().all(|part| part[index].is_finite()) {
            let last = self.converters[converter].last.iter_mut();
            last.zip(&self.numbers).for_each(|(last, part)| *last = part[index]);
            self.places[i].is_missing = false;
            if let (true, Some(affected)) = (was_missing, &mut self.affected) {
                affected.end(i, self.frame);
            }
            return self.end_gap(converter);
        }
        let Converter { offset, last, .. } = self.converters[converter];
        for (part, last) in self.numbers.iter_mut().zip(last) {
            part[index] = if self.policy == GapPolicy::Hold { last } else { offset };
        }
        self.places[i].is_missing = true;
        if let (false, Some(affected)) = (was_missing, &mut self.affected) {
            affected.begin(i, self.frame);
        }
        let first = self.frame * self.layout.samples()[converter] as u64 + number as u64;
        let new = Gap { channel: converter + 1, first, length: 0 };
        self.converters[converter].open.get_or_insert(new).length += 1;
        self.summary.missing += 1;
    }

    fn end_gap(&mut self, converter: usize) {
        let Some(gap) = self.converters[converter].open.take() else { return };
        self.summary.count += 1;
        if self.summary.list.len() < LISTED_GAPS {
            self.summary.list.push(gap);
        }
    }

    /// The M marks of the current frame.
    fn mark(&mut self) {
        match &mut self.affected {
            Some(affected) => affected.mark(self.frame, &mut self.marks),
            None => self.marks.extend(std::iter::repeat_n(u8::from(self.summary.missing > 0), self.ratio)),
        }
    }
}

/// For each channel i and lag j the phases p with f_i[p + jM] != 0; `None` for a recursion.
fn nonzero_phases(bank: &Bank) -> Option<Vec<Vec<Vec<usize>>>> {
    match &bank.filters {
        SynthesisFilters::Fir(taps) => {
            let used = |taps: &[f64]| (0..taps.len()).filter(|&p| taps[p] != 0.0).collect();
            Some(taps.iter().map(|f| f.chunks(bank.ratio).map(used).collect()).collect())
        }
        // Without states only the sample's own frame is affected.
        SynthesisFilters::StateSpace(block) if block.a.is_empty() => {
            let outputs = 0..block.d.len().min(bank.ratio);
            let enters = |i: usize| move |&p: &usize| block.d[p].get(i).is_some_and(|x| *x != 0.0);
            let phases = |i| vec![outputs.clone().filter(enters(i)).collect()];
            Some((0..bank.frame_samples()).map(phases).collect())
        }
        SynthesisFilters::StateSpace(_) => None,
    }
}

/// Lags j with f_i[p + jM] != 0 that follow each other, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Lags {
    first: usize,
    last: usize,
}

/// Which outputs of an FIR bank missing samples affect.
///
/// Output p of frame k is y\[kM + p\] = sum_i sum_j f_i\[p + jM\] x_i\[k - j\], so a missing x_i\[t\]
/// affects it if and only if f_i\[p + (k - t)M\] is not zero. The nonzero lags of one channel and phase are
/// a few intervals, for ordinary filters a single one. A gap x_i\[s\] .. x_i\[e - 1\] affects the frames
/// s + a .. e - 1 + b for each interval a ..= b. So a count changes twice: at the first of these frames,
/// which is known when the gap begins, and after the last, which is known when it ends. A frame takes M
/// additions for filters of any length, and a gap takes two per interval.
#[derive(Debug, Clone)]
struct AffectedOutputs {
    ratio: usize,
    /// `lags[i][p]` in ascending order.
    lags: Vec<Vec<Vec<Lags>>>,
    /// The change of the count at each future frame and phase; a ring buffer of `span` frames.
    changes: Vec<i32>,
    span: usize,
    /// Intervals of gaps that affect output p of the current frame.
    counts: Vec<i32>,
    /// No count changes at this frame or later, as far as gaps are known.
    unchanged_from: u64,
    /// Number of additions so far; tests use it as the measure of work.
    #[cfg(test)]
    additions: u64,
}

impl AffectedOutputs {
    /// For the filters f_i, `nonzero[i][j]` listing the phases p with f_i[p + jM] != 0 in ascending order.
    fn new(ratio: usize, nonzero: &[Vec<Vec<usize>>]) -> Self {
        let span = nonzero.iter().map(Vec::len).max().unwrap_or(0) + 1;
        Self {
            ratio,
            lags: nonzero.iter().map(|channel| intervals(channel, ratio)).collect(),
            changes: vec![0; span * ratio],
            span,
            counts: vec![0; ratio],
            unchanged_from: 0,
            #[cfg(test)]
            additions: 0,
        }
    }

    /// A gap of channel i begins at `frame`, which has not been marked yet.
    fn begin(&mut self, i: usize, frame: u64) {
        self.change(i, 1, |lags| frame + lags.first as u64);
    }

    /// The gap of channel i ended before `frame`, which has not been marked yet.
    fn end(&mut self, i: usize, frame: u64) {
        self.change(i, -1, |lags| frame + lags.last as u64);
    }

    fn change(&mut self, i: usize, change: i32, frame: impl Fn(&Lags) -> u64) {
        for (p, lags) in self.lags[i].iter().enumerate() {
            for frame in lags.iter().map(&frame) {
                self.changes[(frame % self.span as u64) as usize * self.ratio + p] += change;
                self.unchanged_from = self.unchanged_from.max(frame + 1);
            }
            #[cfg(test)]
            {
                self.additions += lags.len() as u64;
            }
        }
    }

    /// Appends the marks of the outputs of `frame`, the next one.
    fn mark(&mut self, frame: u64, marks: &mut Vec<u8>) {
        let slot = (frame % self.span as u64) as usize * self.ratio;
        let changes = &mut self.changes[slot..slot + self.ratio];
        for (count, change) in self.counts.iter_mut().zip(changes) {
            *count += std::mem::take(change);
            marks.push(u8::from(*count > 0));
        }
        #[cfg(test)]
        {
            self.additions += self.ratio as u64;
        }
    }
}

/// For each phase the intervals of its lags.
fn intervals(nonzero: &[Vec<usize>], ratio: usize) -> Vec<Vec<Lags>> {
    let mut phases: Vec<Vec<Lags>> = vec![Vec::new(); ratio];
    for (j, used) in nonzero.iter().enumerate() {
        for &p in used {
            match phases[p].last_mut() {
                Some(lags) if lags.last + 1 == j => lags.last = j,
                _ => phases[p].push(Lags { first: j, last: j }),
            }
        }
    }
    phases
}

#[cfg(test)]
mod tests;
