//! Frames of channels that are shifted against each other by whole frames.
//!
//! Sample n of channel i was taken at the time n T - D_i, with T the slow period. With the shift s_i, frame
//! k holds sample k + s_i of the channel, which was taken at k T - (D_i - s_i T): the delay is smaller by
//! s_i slow periods. Two clocks that run apart move a delay by slow periods without end, and shifts keep it
//! within one of them.

use crate::io::{PcmFormat, PcmFrames, SampleLayout};
use std::collections::VecDeque;

/// Samples that are kept before those that the next frame needs, for shifts that become smaller.
const KEPT: i64 = 1 << 14;

/// The samples of all channels, and the frames that are made of them.
#[derive(Debug)]
pub(super) struct ShiftedFrames {
    channels: Vec<Channel>,
    /// The next frame.
    position: i64,
    /// No samples come any more.
    is_over: bool,
}

#[derive(Debug)]
struct Channel {
    /// What the converter delivers without a signal: before the first sample and after the last one.
    offset: f64,
    samples: VecDeque<f64>,
    /// Number of the first of `samples`.
    first: i64,
    shift: i64,
}

impl Channel {
    /// Number of the first sample that has not come.
    fn end(&self) -> i64 {
        self.first + self.samples.len() as i64
    }

    fn sample(&self, number: i64) -> f64 {
        let index = usize::try_from(number - self.first).ok();
        index.and_then(|index| self.samples.get(index)).copied().unwrap_or(self.offset)
    }
}

impl ShiftedFrames {
    /// No frames yet, of converters that deliver `offsets` without a signal; without shifts.
    pub(super) fn new(offsets: &[f64]) -> Self {
        let channel = |&offset: &f64| Channel { offset, samples: VecDeque::new(), first: 0, shift: 0 };
        Self { channels: offsets.iter().map(channel).collect(), position: 0, is_over: false }
    }

    /// The number of the next frame.
    pub(super) fn position(&self) -> u64 {
        self.position as u64
    }

    /// By how many frames each channel is shifted.
    pub(super) fn shifts(&self) -> Vec<i64> {
        self.channels.iter().map(|channel| channel.shift).collect()
    }

    /// Shifts the frames from the next one on.
    pub(super) fn shift_by(&mut self, shifts: &[i64]) {
        self.channels.iter_mut().zip(shifts).for_each(|(channel, shift)| channel.shift = *shift);
    }

    /// Takes samples. The channels are those of all `parts`, one part after another.
    pub(super) fn push(&mut self, parts: &[PcmFrames<'_>]) {
        let mut channels = self.channels.iter_mut();
        for part in parts {
            let (format, container) = (part.layout.format, part.layout.container);
            for (c, channel) in channels.by_ref().take(part.channels).enumerate() {
                let frames = part.bytes.chunks_exact(part.frame_bytes());
                channel.samples.extend(frames.map(|frame| format.decode(&frame[c * container..])));
            }
        }
    }

    /// No samples come any more: what frames need beyond the last ones is no signal.
    pub(super) fn end(&mut self) {
        self.is_over = true;
    }

    /// How many frames can be made, with the present shifts and with `others`.
    pub(super) fn ready(&self, others: &[i64]) -> usize {
        let ends = self.channels.iter().zip(others).map(|(channel, other)| {
            let ahead = if self.is_over { 0 } else { channel.shift.max(*other).max(0) };
            channel.end() - ahead
        });
        let end = ends.min().unwrap_or(self.position);
        usize::try_from(end - self.position).unwrap_or(0)
    }

    /// The next frames, interleaved.
    pub(super) fn next(&self, count: usize) -> Vec<u8> {
        self.frames(self.position, count, |sample, _| sample)
    }

    /// The frames before the next one, interleaved, with the present shifts. What is missing counts as no
    /// signal.
    pub(super) fn history(&self, count: usize) -> Vec<u8> {
        let known = |sample: f64, offset: f64| if sample.is_finite() { sample } else { offset };
        self.frames(self.position - count as i64, count, known)
    }

    fn frames(&self, first: i64, count: usize, of: impl Fn(f64, f64) -> f64) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(count * self.channels.len() * size_of::<f64>());
        for frame in first..first + count as i64 {
            for channel in &self.channels {
                let sample = of(channel.sample(frame + channel.shift), channel.offset);
                bytes.extend_from_slice(&sample.to_le_bytes());
            }
        }
        bytes
    }

    /// Interleaved frames as [`ShiftedFrames::next`] gives them.
    pub(super) fn packed<'a>(&self, bytes: &'a [u8]) -> PcmFrames<'a> {
        PcmFrames { layout: SampleLayout::packed(PcmFormat::F64Le), channels: self.channels.len(), bytes }
    }

    /// The samples of some frames by channel, with the given shifts.
    pub(super) fn block(&self, first: u64, count: usize, shifts: &[i64]) -> Vec<Vec<f64>> {
        let of = |(channel, shift): (&Channel, &i64)| {
            let first = first as i64 + shift;
            (first..first + count as i64).map(|number| channel.sample(number)).collect()
        };
        self.channels.iter().zip(shifts).map(of).collect()
    }

    /// Moves on by `count` frames; frames from number `kept` on are still needed.
    pub(super) fn advance(&mut self, count: usize, kept: u64) {
        self.position += count as i64;
        for channel in &mut self.channels {
            let first = (kept as i64).min(self.position) + channel.shift.min(0) - KEPT;
            let past = usize::try_from(first - channel.first).unwrap_or(0);
            // In large steps, so that the samples are seldom moved.
            if past > KEPT as usize {
                let past = past.min(channel.samples.len());
                channel.samples.drain(..past);
                channel.first += past as i64;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(samples: &[[f64; 2]]) -> Vec<u8> {
        samples.iter().flatten().flat_map(|x| x.to_le_bytes()).collect()
    }

    fn decoded(bytes: &[u8]) -> Vec<[f64; 2]> {
        let numbers: Vec<f64> =
            bytes.chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect();
        numbers.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect()
    }

    /// Sample n of channel i is 100 i + n; without a signal the channels deliver -1 and -2.
    fn shifted() -> ShiftedFrames {
        let mut shifted = ShiftedFrames::new(&[-1.0, -2.0]);
        let samples: Vec<[f64; 2]> = (0..6).map(|n| [f64::from(n), f64::from(100 + n)]).collect();
        let bytes = frames(&samples);
        shifted.push(&[shifted.packed(&bytes)]);
        shifted
    }

    #[test]
    fn a_frame_holds_the_sample_that_lies_a_shift_further() {
        let mut shifted = shifted();
        assert_eq!(shifted.ready(&[0, 0]), 6);
        shifted.shift_by(&[0, 2]);
        assert_eq!((shifted.ready(&[0, 0]), shifted.ready(&[0, 3])), (4, 3));
        assert_eq!(decoded(&shifted.next(2)), [[0.0, 102.0], [1.0, 103.0]]);
        shifted.advance(2, 0);
        shifted.shift_by(&[0, -1]);
        assert_eq!(decoded(&shifted.next(1)), [[2.0, 101.0]]);
        assert_eq!(decoded(&shifted.history(3)), [[-1.0, -2.0], [0.0, -2.0], [1.0, 100.0]]);
        assert_eq!(shifted.block(1, 2, &[0, 1]), [[1.0, 2.0], [102.0, 103.0]]);
        assert_eq!(shifted.ready(&[0, 0]), 4);
    }

    #[test]
    fn beyond_the_end_there_is_no_signal() {
        let mut shifted = shifted();
        shifted.shift_by(&[0, 2]);
        shifted.advance(4, 4);
        assert_eq!(shifted.ready(&[0, 0]), 0);
        shifted.end();
        assert_eq!(shifted.ready(&[0, 0]), 2);
        assert_eq!(decoded(&shifted.next(2)), [[4.0, -2.0], [5.0, -2.0]]);
    }

    #[test]
    fn what_is_missing_is_no_signal_in_the_history_only() {
        let mut shifted = ShiftedFrames::new(&[0.0, 0.5]);
        let bytes = frames(&[[1.0, f64::NAN], [2.0, f64::NAN]]);
        shifted.push(&[shifted.packed(&bytes)]);
        shifted.advance(1, 0);
        assert_eq!(decoded(&shifted.history(1)), [[1.0, 0.5]]);
        assert!(decoded(&shifted.next(1))[0][1].is_nan());
    }

    /// A long stream does not grow.
    #[test]
    fn old_samples_are_forgotten() {
        let mut shifted = ShiftedFrames::new(&[0.0]);
        let block: Vec<u8> = (0..4096).flat_map(|n| f64::from(n).to_le_bytes()).collect();
        for number in 0..40 {
            shifted.push(&[shifted.packed(&block)]);
            shifted.advance(4096, number * 4096);
        }
        assert!(shifted.channels[0].samples.len() < 4 * KEPT as usize);
        let recent = shifted.history(2);
        let numbers: Vec<f64> =
            recent.chunks_exact(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect();
        assert_eq!(numbers, [4094.0, 4095.0]);
    }
}
