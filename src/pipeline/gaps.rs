//! Missing samples: their replacement, their position, and the outputs that they affect.
//!
//! A missing sample is marked by NaN. An output of an FIR bank is affected if one of its taps falls on a
//! missing sample. Outputs are exact again when the gap has left the history of the filters. A recursive
//! bank has infinite history, so all later outputs count as affected.

use super::Gap;
use super::touch::Touch;
use crate::bank::{Bank, SynthesisFilters};
use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use crate::runtime::BuildError;
use std::borrow::Cow;

/// Maximum number of gaps that a report lists; further gaps are only counted, so that memory stays bounded.
const LISTED: usize = 65_536;

/// The replacement of a missing sample. What is replaced are the samples as the converters deliver them, so
/// a converter without a signal delivers its offset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum GapPolicy {
    /// Zero after the offset is subtracted: the channel's offset.
    Zero,
    /// The channel's last good sample (as [`GapPolicy::Zero`] before the first).
    Hold,
}

/// The state of a channel.
#[derive(Debug, Clone, Copy)]
struct Channel {
    /// What the converter delivers without a signal.
    offset: f64,
    /// The last good sample.
    last: f64,
    /// The gap that has not ended.
    open: Option<Gap>,
}

/// Fills gaps frame by frame.
///
/// A frame takes O(N + M) operations for filters of any length. A gap takes at most one pass over the taps
/// of its channel, when it ends.
#[derive(Debug, Clone)]
pub struct GapFiller {
    policy: GapPolicy,
    ratio: usize,
    /// Which outputs are affected; `None` for a recursion.
    touch: Option<Touch>,
    channels: Vec<Channel>,
    gaps: Vec<Gap>,
    total: u64,
    missing: u64,
    frame: u64,
    /// A block as numbers and as bytes.
    numbers: Vec<f64>,
    bytes: Vec<u8>,
}

impl GapFiller {
    /// A filler for the channels and taps of a bank.
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
        Ok(Self {
            policy,
            ratio,
            touch: nonzero_phases(bank).map(|nonzero| Touch::new(ratio, &nonzero)),
            channels: bank
                .offsets
                .iter()
                .map(|&offset| Channel { offset, last: offset, open: None })
                .collect(),
            gaps: Vec::new(),
            total: 0,
            missing: 0,
            frame: 0,
            numbers: Vec::new(),
            bytes: Vec::new(),
        })
    }

    /// Replaces the samples that are not finite in whole frames of N samples, and sets `mask[k M + p]` to 1
    /// where output p of frame k is affected by a missing sample, to 0 elsewhere.
    pub fn fill(&mut self, frames: &mut [f64], mask: &mut Vec<u8>) {
        let n = self.channels.len();
        mask.clear();
        mask.resize(frames.len() / n * self.ratio, 0);
        for (frame, marks) in frames.chunks_exact_mut(n).zip(mask.chunks_exact_mut(self.ratio)) {
            self.fill_frame(frame);
            self.mark(marks);
            self.frame += 1;
        }
    }

    /// As [`GapFiller::fill`], for samples as they lie in files and pipes: the channels are those of all
    /// `parts` one after another. Frames without gaps are returned unchanged.
    pub fn fill_pcm<'a>(
        &'a mut self,
        parts: &'a [PcmFrames<'a>],
        mask: &mut Vec<u8>,
    ) -> Cow<'a, [PcmFrames<'a>]> {
        let frames = parts.iter().map(PcmFrames::frames).min().unwrap_or(0);
        if self.is_at_rest() && parts.iter().all(|part| part.range(0..frames).is_finite()) {
            self.pass(parts, frames, mask);
            return Cow::Borrowed(parts);
        }
        let mut numbers = std::mem::take(&mut self.numbers);
        numbers.clear();
        (0..frames).for_each(|k| decode_frame(parts, k, &mut numbers));
        self.fill(&mut numbers, mask);
        self.bytes.clear();
        self.bytes.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        self.numbers = numbers;
        let layout = SampleLayout::packed(PcmFormat::F64Le);
        Cow::Owned(vec![PcmFrames { layout, channels: self.channels.len(), bytes: &self.bytes }])
    }

    /// Ends the gaps that are open at the end of the input.
    pub fn finish(&mut self) {
        for i in 0..self.channels.len() {
            self.end_gap(i);
        }
    }

    /// The gaps in the order of their ends, at most 65,536 of them.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// The gaps that have not ended, with their length so far.
    pub fn open(&self) -> impl Iterator<Item = Gap> {
        self.channels.iter().filter_map(|channel| channel.open)
    }

    /// How many gaps there were.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// How many samples were missing.
    pub fn missing(&self) -> u64 {
        self.missing
    }

    /// True if the mask no longer changes: no gap is open and none affects a later output, or all later
    /// outputs are affected.
    fn is_at_rest(&self) -> bool {
        self.touch.as_ref().is_none_or(|touch| touch.is_settled(self.frame))
            && self.channels.iter().all(|channel| channel.open.is_none())
    }

    /// Frames without a gap, while at rest: only the last samples matter.
    fn pass(&mut self, parts: &[PcmFrames<'_>], frames: usize, mask: &mut Vec<u8>) {
        let affected = self.touch.is_none() && self.missing > 0;
        mask.clear();
        mask.resize(frames * self.ratio, u8::from(affected));
        self.frame += frames as u64;
        let mut last = std::mem::take(&mut self.numbers);
        last.clear();
        (frames.saturating_sub(1)..frames).for_each(|k| decode_frame(parts, k, &mut last));
        self.channels.iter_mut().zip(&last).for_each(|(channel, &sample)| channel.last = sample);
        self.numbers = last;
    }

    fn fill_frame(&mut self, frame: &mut [f64]) {
        for (i, sample) in frame.iter_mut().enumerate() {
            if sample.is_finite() {
                self.end_gap(i);
                self.channels[i].last = *sample;
                continue;
            }
            let Channel { offset, last, .. } = self.channels[i];
            *sample = if self.policy == GapPolicy::Hold { last } else { offset };
            let new = Gap { channel: i + 1, first: self.frame, length: 0 };
            self.channels[i].open.get_or_insert(new).length += 1;
            self.missing += 1;
        }
    }

    fn end_gap(&mut self, i: usize) {
        let Some(gap) = self.channels[i].open.take() else { return };
        self.total += 1;
        if self.gaps.len() < LISTED {
            self.gaps.push(gap);
        }
        if let Some(touch) = &mut self.touch {
            touch.end(&gap, self.frame);
        }
    }

    /// The M marks of the current frame.
    fn mark(&mut self, marks: &mut [u8]) {
        match &mut self.touch {
            Some(touch) => {
                let open = self.channels.iter().filter_map(|channel| channel.open.as_ref());
                touch.mark(self.frame, open, marks);
            }
            None => marks.fill(u8::from(self.missing > 0)),
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
            Some(
                (0..bank.channel_count())
                    .map(|i| vec![outputs.clone().filter(enters(i)).collect()])
                    .collect(),
            )
        }
        SynthesisFilters::StateSpace(_) => None,
    }
}

/// Appends frame k of all parts.
fn decode_frame(parts: &[PcmFrames<'_>], k: usize, numbers: &mut Vec<f64>) {
    for part in parts {
        let frame = part.range(k..k + 1).bytes;
        let samples = frame.chunks_exact(part.layout.container);
        numbers.extend(samples.map(|sample| part.layout.format.decode(sample)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bank::StateSpace;
    use crate::random::Random;
    use crate::runtime::{Options, Stream};
    use crate::units::Seconds;

    fn fir_bank(taps: Vec<Vec<f64>>, ratio: usize) -> Bank {
        let delays = vec![Seconds(0.0); taps.len()];
        Bank { latency: 3, delays, ..Bank::bare(SynthesisFilters::Fir(taps), ratio) }
    }

    fn random_taps(channels: usize, taps: usize, random: &mut Random) -> Vec<Vec<f64>> {
        (0..channels).map(|_| (0..taps).map(|_| random.sample()).collect()).collect()
    }

    /// Frames of N channels with a few runs of NaN.
    fn with_gaps(n: usize, frames: usize, random: &mut Random) -> Vec<f64> {
        let mut samples: Vec<f64> = (0..n * frames).map(|_| random.sample() + 2.0).collect();
        for (channel, first, length) in [(0, 0, 3), (1, 40, 1), (0, 41, 20), (1, 190, 10)] {
            (first..first + length).for_each(|k| samples[k * n + channel] = f64::NAN);
        }
        samples
    }

    fn run(bank: &crate::bank::Bank, frames: &[f64]) -> Vec<f64> {
        let mut stream = Stream::new(&bank.plan(Options::default()).unwrap());
        let mut out = vec![0.0; frames.len() / bank.channel_count() * bank.ratio];
        stream.process(frames, &mut out).unwrap();
        out
    }

    #[test]
    fn gaps_are_found_and_filled() {
        let mut random = Random(11);
        let bank = fir_bank(random_taps(2, 7, &mut random), 3);
        let samples = with_gaps(2, 200, &mut random);
        for policy in [GapPolicy::Zero, GapPolicy::Hold] {
            let mut filler = GapFiller::new(&bank, policy).unwrap();
            let mut filled = samples.clone();
            // In pieces, so that a gap crosses a border.
            filled.chunks_mut(2 * 45).for_each(|piece| filler.fill(piece, &mut Vec::new()));
            filler.finish();
            let gap = |channel, first, length| Gap { channel, first, length };
            assert_eq!(filler.gaps(), [gap(1, 0, 3), gap(2, 40, 1), gap(1, 41, 20), gap(2, 190, 10)]);
            assert_eq!((filler.total(), filler.missing()), (4, 34));
            for (k, frame) in filled.chunks_exact(2).enumerate() {
                for i in 0..2 {
                    let last = (0..=k).rev().map(|k| samples[2 * k + i]).find(|x| x.is_finite());
                    let held =
                        if samples[2 * k + i].is_nan() && policy == GapPolicy::Zero { None } else { last };
                    assert_eq!(frame[i], held.unwrap_or(0.0), "{policy:?} frame {k} channel {i}");
                }
            }
        }
    }

    #[test]
    fn the_mask_marks_exactly_the_outputs_that_a_missing_sample_can_change() {
        let mut random = Random(12);
        for (taps, m) in [(24, 2), (7, 3), (1, 1), (64, 4), (5, 8)] {
            let bank = fir_bank(random_taps(2, taps, &mut random), m);
            let samples = with_gaps(2, 200, &mut random);
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
    fn a_missing_sample_is_zero_or_held_after_the_offset_is_subtracted() {
        let bank = Bank { offsets: vec![0.5, -0.25], ..fir_bank(vec![vec![1.0]; 2], 1) };
        let frames = [f64::NAN, 1.0, 2.0, f64::NAN, f64::NAN, f64::NAN];
        for (policy, want) in [
            (GapPolicy::Zero, [0.5, 1.0, 2.0, -0.25, 0.5, -0.25]),
            (GapPolicy::Hold, [0.5, 1.0, 2.0, 1.0, 2.0, 1.0]),
        ] {
            let mut filled = frames;
            GapFiller::new(&bank, policy).unwrap().fill(&mut filled, &mut Vec::new());
            assert_eq!(filled, want, "{policy:?}");
        }
    }

    #[test]
    fn a_bank_without_states_forgets_at_once() {
        let fir = fir_bank(vec![vec![1.0; 2]; 2], 2);
        let d = vec![vec![0.5, 0.0], vec![0.25, 1.0]];
        let filter = StateSpace { a: vec![], b: vec![], c: vec![vec![], vec![]], d };
        let bank = Bank { filters: SynthesisFilters::StateSpace(filter), ..fir };
        let mut filler = GapFiller::new(&bank, GapPolicy::Zero).unwrap();
        let mut mask = Vec::new();
        filler.fill(&mut [1.0, 1.0, 1.0, f64::NAN, f64::NAN, 1.0, 1.0, 1.0], &mut mask);
        assert_eq!(mask, [0, 0, 0, 1, 1, 1, 0, 0]);
    }

    #[test]
    fn stored_samples_pass_untouched_or_as_the_same_numbers() {
        let mut random = Random(13);
        let samples = with_gaps(2, 200, &mut random);
        let bytes: Vec<u8> = samples.iter().flat_map(|x| x.to_be_bytes()).collect();
        let layout = SampleLayout::packed(PcmFormat::F64Be);
        let numbers = |parts: &[PcmFrames<'_>]| {
            let mut numbers = Vec::new();
            (0..parts[0].frames()).for_each(|k| decode_frame(parts, k, &mut numbers));
            numbers
        };
        let fir = fir_bank(random_taps(2, 7, &mut random), 3);
        let (b, c, d) = Default::default();
        let filter = StateSpace { a: vec![vec![0.5]], b, c, d };
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

    /// The definition: output p of frame k is affected if f_i[p + jM] is not zero for a missing x_i[k - j].
    fn affected(taps: &[Vec<f64>], m: usize, samples: &[f64]) -> Vec<u8> {
        let n = taps.len();
        let touches = |k: usize, p: usize, i: usize| {
            let lags = (0..=k).take_while(|j| p + j * m < taps[i].len());
            lags.into_iter().any(|j| taps[i][p + j * m] != 0.0 && samples[(k - j) * n + i].is_nan())
        };
        let outputs = (0..samples.len() / n).flat_map(|k| (0..m).map(move |p| (k, p)));
        outputs.map(|(k, p)| u8::from((0..n).any(|i| touches(k, p, i)))).collect()
    }

    #[test]
    fn the_mask_is_that_of_the_definition_for_filters_with_zeros_and_any_gaps() {
        let mut random = Random(14);
        for trial in 0..200 {
            let (n, m, length) = (1 + random.below(3), 1 + random.below(4), 1 + random.below(40));
            let mut taps = random_taps(n, length, &mut random);
            // From none to nearly all taps are zero, in runs too.
            let zeros = random.below(10);
            for tap in taps.iter_mut().flatten() {
                if random.below(10) < zeros {
                    *tap = 0.0;
                }
            }
            let start = random.below(length);
            taps[0][..start].fill(0.0);
            let mut samples: Vec<f64> = (0..n * 150).map(|_| random.sample()).collect();
            for _ in 0..random.below(12) {
                let (i, first, run) = (random.below(n), random.below(150), 1 + random.below(30));
                (first..(first + run).min(150)).for_each(|k| samples[k * n + i] = f64::NAN);
            }
            let mut filler = GapFiller::new(&fir_bank(taps.clone(), m), GapPolicy::Hold).unwrap();
            let (mut got, mut mask) = (Vec::new(), Vec::new());
            let mut rest = &samples[..];
            while !rest.is_empty() {
                let (piece, after) = rest.split_at(rest.len().min(n * (1 + random.below(40))));
                let bytes: Vec<u8> = piece.iter().flat_map(|x| x.to_le_bytes()).collect();
                let layout = SampleLayout::packed(PcmFormat::F64Le);
                filler.fill_pcm(&[PcmFrames { layout, channels: n, bytes: &bytes }], &mut mask);
                got.extend_from_slice(&mask);
                rest = after;
            }
            assert_eq!(got, affected(&taps, m, &samples), "trial {trial}: {taps:?}");
        }
    }

    /// Additions for so many frames with `lost` frames of each channel missing at the start of every period.
    fn work(taps: Vec<Vec<f64>>, frames: usize, period: usize, lost: usize) -> u64 {
        let n = taps.len();
        let mut filler = GapFiller::new(&fir_bank(taps, 2), GapPolicy::Zero).unwrap();
        let mut samples = vec![1.0; n * frames];
        samples.chunks_mut(n * period).for_each(|period| period[..n * lost].fill(f64::NAN));
        filler.fill(&mut samples, &mut Vec::new());
        filler.touch.unwrap().additions
    }

    #[test]
    fn the_work_of_a_frame_does_not_grow_with_the_filters() {
        let dense = |length: usize| vec![vec![1.0; length]; 2];
        for (period, lost) in [(1000, 1), (4000, 3000)] {
            let (short, long) =
                (work(dense(16), 4000, period, lost), work(dense(65_536), 4000, period, lost));
            assert_eq!(short, long);
            assert!(long <= 4000 * (2 + 2 * 2) + 4000 / period as u64 * 2 * 2 * 2, "{long}");
        }
        // Where every other tap of a phase is zero, a gap costs one pass over the taps, however long it is.
        let sparse: Vec<f64> = (0..4096).map(|t| f64::from(u8::from(t % 4 < 2))).collect();
        let gap = |lost| work(vec![sparse.clone()], 4000, 4000, lost);
        assert!(gap(1) <= 4000 * 2 + 2 + 4096, "{}", gap(1));
        assert!(gap(3000) <= 4000 * 2 + 3000 * 2 + 4096, "{}", gap(3000));
    }
}
