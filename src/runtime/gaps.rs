//! Samples that are missing: what stands in for them, where they were, and which outputs they
//! touched.
//!
//! A missing sample is marked by NaN. An output of a FIR bank is touched if one of its taps falls
//! on a missing sample, and it is exact again when the filters have forgotten the gap; a recursion
//! never forgets.

use super::BuildError;
use crate::bank::{Bank, SynthesisFilters};
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use std::borrow::Cow;
use std::collections::VecDeque;

/// Gaps that a report lists one by one; more are only counted, so that memory stays bounded.
const LISTED: usize = 65_536;

/// What stands in for a missing sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GapPolicy {
    /// Zero.
    Zero,
    /// The channel's last good sample (zero before the first).
    Hold,
}

/// A run of missing samples of one channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Gap {
    /// The channel, from 1.
    pub channel: usize,
    /// Tick of its first sample, from 0.
    pub first: u64,
    /// Samples that are missing.
    pub length: u64,
}

/// Fills gaps tick by tick.
#[derive(Debug, Clone)]
pub struct GapFiller {
    policy: GapPolicy,
    ratio: usize,
    /// `touch[i][j]` lists the phases of tick k that x_i[k - j] enters; `None` for a recursion.
    touch: Option<Vec<Vec<Vec<usize>>>>,
    /// Per channel: the last good sample, and the gap that is open.
    channels: Vec<(f64, Option<Gap>)>,
    gaps: Vec<Gap>,
    total: u64,
    missing: u64,
    tick: u64,
    /// Ticks that still matter, the newest first: the channels that were missing.
    recent: VecDeque<Vec<usize>>,
    /// A block as numbers and as bytes.
    numbers: Vec<f64>,
    bytes: Vec<u8>,
}

impl GapFiller {
    /// For the channels and taps of a bank.
    ///
    /// # Errors
    /// [`BuildError::NoRatio`] and [`BuildError::NoChannels`] for a bank without outputs or inputs.
    pub fn new(bank: &Bank, policy: GapPolicy) -> Result<Self, BuildError> {
        let (ratio, channels) = (bank.ratio, bank.channel_count());
        if ratio == 0 {
            return Err(BuildError::NoRatio);
        }
        if channels == 0 {
            return Err(BuildError::NoChannels);
        }
        let touch = match &bank.filters {
            SynthesisFilters::Fir(taps) => Some(taps.iter().map(|f| touched_phases(f, ratio)).collect()),
            // Without states only the sample's own tick is touched.
            SynthesisFilters::StateSpace(block) if block.a.is_empty() => {
                let phases = |i: usize| {
                    (0..block.d.len()).filter(|&p| block.d[p].get(i).is_some_and(|x| *x != 0.0)).collect()
                };
                Some((0..channels).map(|i| vec![phases(i)]).collect())
            }
            SynthesisFilters::StateSpace(_) => None,
        };
        Ok(Self {
            policy,
            ratio,
            touch,
            channels: vec![(0.0, None); channels],
            gaps: Vec::new(),
            total: 0,
            missing: 0,
            tick: 0,
            recent: VecDeque::new(),
            numbers: Vec::new(),
            bytes: Vec::new(),
        })
    }

    /// Replaces what is not finite in whole ticks of N samples, and sets `mask[k M + p]` to 1 where
    /// output p of tick k is touched by a missing sample, to 0 elsewhere.
    pub fn fill(&mut self, ticks: &mut [f64], mask: &mut Vec<u8>) {
        mask.clear();
        for tick in ticks.chunks_exact_mut(self.channels.len()) {
            let missing = self.fill_tick(tick);
            self.mark(missing, mask);
            self.tick += 1;
        }
    }

    /// As [`GapFiller::fill`], for samples as they lie in files and pipes: the channels are those of all
    /// `frames` one after another. Frames without gaps are given back as they are.
    pub fn fill_pcm<'a>(
        &'a mut self,
        frames: &'a [PcmFrames<'a>],
        mask: &mut Vec<u8>,
    ) -> Cow<'a, [PcmFrames<'a>]> {
        let ticks = frames.iter().map(PcmFrames::frames).min().unwrap_or(0);
        if self.is_at_rest() && frames.iter().all(|part| part.range(0..ticks).is_finite()) {
            self.pass(frames, ticks, mask);
            return Cow::Borrowed(frames);
        }
        let mut numbers = std::mem::take(&mut self.numbers);
        numbers.clear();
        (0..ticks).for_each(|k| decode_tick(frames, k, &mut numbers));
        self.fill(&mut numbers, mask);
        self.bytes.clear();
        self.bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        self.numbers = numbers;
        let layout = SampleLayout::packed(PcmFormat::F64Le);
        Cow::Owned(vec![PcmFrames { layout, channels: self.channels.len(), bytes: &self.bytes }])
    }

    /// Closes the gaps that are open at the end.
    pub fn finish(&mut self) {
        for i in 0..self.channels.len() {
            self.close(i);
        }
    }

    /// The gaps in the order of their ends, at most 65,536 of them.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// How many gaps there were.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// How many samples were missing.
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// True if no gap is open and none can touch another output, or every output is touched for ever.
    fn is_at_rest(&self) -> bool {
        self.recent.is_empty() && self.channels.iter().all(|(_, gap)| gap.is_none())
    }

    /// Ticks without a gap, while at rest: only the last samples matter.
    fn pass(&mut self, frames: &[PcmFrames<'_>], ticks: usize, mask: &mut Vec<u8>) {
        let touched = self.touch.is_none() && self.missing > 0;
        mask.clear();
        mask.resize(ticks * self.ratio, u8::from(touched));
        self.tick += ticks as u64;
        let mut last = std::mem::take(&mut self.numbers);
        last.clear();
        (ticks.saturating_sub(1)..ticks).for_each(|k| decode_tick(frames, k, &mut last));
        self.channels.iter_mut().zip(&last).for_each(|(channel, &sample)| channel.0 = sample);
        self.numbers = last;
    }

    /// Fills one tick; returns the channels that were missing.
    fn fill_tick(&mut self, tick: &mut [f64]) -> Vec<usize> {
        let mut missing = Vec::new();
        for (i, sample) in tick.iter_mut().enumerate() {
            if sample.is_finite() {
                self.close(i);
                self.channels[i].0 = *sample;
                continue;
            }
            *sample = if self.policy == GapPolicy::Hold { self.channels[i].0 } else { 0.0 };
            let fresh = Gap { channel: i + 1, first: self.tick, length: 0 };
            self.channels[i].1.get_or_insert(fresh).length += 1;
            self.missing += 1;
            missing.push(i);
        }
        missing
    }

    fn close(&mut self, i: usize) {
        if let Some(gap) = self.channels[i].1.take() {
            self.total += 1;
            if self.gaps.len() < LISTED {
                self.gaps.push(gap);
            }
        }
    }

    /// The M mask bytes of a tick.
    fn mark(&mut self, missing: Vec<usize>, mask: &mut Vec<u8>) {
        let start = mask.len();
        mask.resize(start + self.ratio, 0);
        let Some(touch) = &self.touch else {
            mask[start..].fill(u8::from(self.missing > 0));
            return;
        };
        // Nothing is kept while nothing is missing.
        if !self.recent.is_empty() || !missing.is_empty() {
            self.recent.push_front(missing);
        }
        self.recent.truncate(touch.iter().map(Vec::len).max().unwrap_or(0));
        for (j, channels) in self.recent.iter().enumerate() {
            for phases in channels.iter().filter_map(|&i| touch[i].get(j)) {
                phases.iter().for_each(|&p| mask[start + p] = 1);
            }
        }
        while self.recent.back().is_some_and(Vec::is_empty) {
            self.recent.pop_back();
        }
    }
}

/// Appends tick k of all parts.
fn decode_tick(frames: &[PcmFrames<'_>], k: usize, numbers: &mut Vec<f64>) {
    for part in frames {
        let frame = part.range(k..k + 1).bytes;
        let samples = frame.chunks_exact(part.layout.container);
        numbers.extend(samples.map(|sample| part.layout.format.decode(sample)));
    }
}

/// For each lag j the phases p with f[p + jM] != 0.
fn touched_phases(f: &[f64], ratio: usize) -> Vec<Vec<usize>> {
    let used = |taps: &[f64]| (0..taps.len()).filter(|&p| taps[p] != 0.0).collect();
    f.chunks(ratio).map(used).collect()
}

#[cfg(test)]
mod tests {
    use super::super::Reconstructor;
    use super::super::tests::{Noise, fir_bank, random_taps};
    use super::*;
    use crate::bank::BlockFilter;

    /// Ticks of N channels with a few runs of NaN.
    fn with_gaps(n: usize, ticks: usize, noise: &mut Noise) -> Vec<f64> {
        let mut samples: Vec<f64> = (0..n * ticks).map(|_| noise.next() + 2.0).collect();
        for (channel, first, length) in [(0, 0, 3), (1, 40, 1), (0, 41, 20), (1, 190, 10)] {
            (first..first + length).for_each(|k| samples[k * n + channel] = f64::NAN);
        }
        samples
    }

    fn run(bank: &crate::bank::Bank, ticks: &[f64]) -> Vec<f64> {
        let mut stream = Reconstructor::new(bank).unwrap();
        let mut out = vec![0.0; ticks.len() / bank.channel_count() * bank.ratio];
        stream.process_f64(ticks, &mut out).unwrap();
        out
    }

    #[test]
    fn gaps_are_found_and_filled() {
        let mut noise = Noise(11);
        let bank = fir_bank(random_taps(2, 7, &mut noise), 3);
        let samples = with_gaps(2, 200, &mut noise);
        for policy in [GapPolicy::Zero, GapPolicy::Hold] {
            let mut filler = GapFiller::new(&bank, policy).unwrap();
            let mut filled = samples.clone();
            // In pieces, so that a gap crosses a border.
            filled.chunks_mut(2 * 45).for_each(|piece| filler.fill(piece, &mut Vec::new()));
            filler.finish();
            let gap = |channel, first, length| Gap { channel, first, length };
            assert_eq!(filler.gaps(), [gap(1, 0, 3), gap(2, 40, 1), gap(1, 41, 20), gap(2, 190, 10)]);
            assert_eq!((filler.total(), filler.missing()), (4, 34));
            for (k, tick) in filled.chunks_exact(2).enumerate() {
                for i in 0..2 {
                    let last = (0..=k).rev().map(|k| samples[2 * k + i]).find(|x| x.is_finite());
                    let held =
                        if samples[2 * k + i].is_nan() && policy == GapPolicy::Zero { None } else { last };
                    assert_eq!(tick[i], held.unwrap_or(0.0), "{policy:?} tick {k} channel {i}");
                }
            }
        }
    }

    #[test]
    fn the_mask_marks_exactly_the_outputs_that_a_missing_sample_can_change() {
        let mut noise = Noise(12);
        for (taps, m) in [(24, 2), (7, 3), (1, 1), (64, 4), (5, 8)] {
            let bank = fir_bank(random_taps(2, taps, &mut noise), m);
            let samples = with_gaps(2, 200, &mut noise);
            let variant = |value: f64| -> Vec<f64> {
                samples.iter().map(|x| if x.is_finite() { *x } else { value }).collect()
            };
            // Two values for all missing samples: an output differs if and only if one of them enters
            // it (random taps do not cancel).
            let differs: Vec<u8> = run(&bank, &variant(100.0))
                .iter()
                .zip(run(&bank, &variant(-77.0)))
                .map(|(a, b)| u8::from(*a != b))
                .collect();
            let mut mask = Vec::new();
            let mut filled = samples.clone();
            GapFiller::new(&bank, GapPolicy::Zero).unwrap().fill(&mut filled, &mut mask);
            assert_eq!(mask, differs, "{taps} taps, M = {m}");
        }
    }

    #[test]
    fn a_bank_without_states_forgets_at_once() {
        let fir = fir_bank(vec![vec![1.0; 2]; 2], 2);
        let d = vec![vec![0.5, 0.0], vec![0.25, 1.0]];
        let filter = BlockFilter { a: vec![], b: vec![], c: vec![vec![], vec![]], d };
        let bank = Bank { filters: SynthesisFilters::StateSpace(filter), ..fir };
        let mut filler = GapFiller::new(&bank, GapPolicy::Zero).unwrap();
        let mut mask = Vec::new();
        filler.fill(&mut [1.0, 1.0, 1.0, f64::NAN, f64::NAN, 1.0, 1.0, 1.0], &mut mask);
        assert_eq!(mask, [0, 0, 0, 1, 1, 1, 0, 0]);
    }

    #[test]
    fn stored_samples_pass_untouched_or_as_the_same_numbers() {
        let mut noise = Noise(13);
        let samples = with_gaps(2, 200, &mut noise);
        let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_be_bytes()).collect();
        let layout = SampleLayout::packed(PcmFormat::F64Be);
        let numbers = |parts: &[PcmFrames<'_>]| {
            let mut numbers = Vec::new();
            (0..parts[0].frames()).for_each(|k| decode_tick(parts, k, &mut numbers));
            numbers
        };
        let fir = fir_bank(random_taps(2, 7, &mut noise), 3);
        let (b, c, d) = Default::default();
        let filter = BlockFilter { a: vec![vec![0.5]], b, c, d };
        let recursion = Bank { filters: SynthesisFilters::StateSpace(filter), ..fir.clone() };
        for bank in [fir, recursion] {
            let mut want = samples.clone();
            let mut want_mask = Vec::new();
            let mut plain = GapFiller::new(&bank, GapPolicy::Hold).unwrap();
            plain.fill(&mut want, &mut want_mask);
            for block in [1, 7, 45, 200] {
                let mut filler = GapFiller::new(&bank, GapPolicy::Hold).unwrap();
                let (mut got, mut got_mask, mut untouched) = (Vec::new(), Vec::new(), 0);
                for piece in bytes.chunks(block * 16) {
                    let frames = [PcmFrames { layout, channels: 2, bytes: piece }];
                    let mut mask = Vec::new();
                    let filled = filler.fill_pcm(&frames, &mut mask);
                    untouched += usize::from(matches!(filled, Cow::Borrowed(_)));
                    got.extend(numbers(&filled));
                    got_mask.extend(mask);
                }
                assert_eq!((got, got_mask), (want.clone(), want_mask.clone()), "blocks of {block}");
                assert_eq!(filler.gaps(), plain.gaps());
                assert!(untouched > 0 || block == 200, "blocks of {block}");
            }
        }
    }
}
