//! The recent input of a stream, as far back as the filters look, in frames as they came.

use crate::aligned::Aligned;
use crate::sample::Sample;
use crate::state::StateNumbers;

/// The last samples before the next frame, then room for frames to come. Short calls move along in the room;
/// only when it is used up are the last samples copied to the front.
#[derive(Debug, Clone)]
pub(crate) struct History<T: Sample> {
    samples: Aligned<T>,
    /// N.
    channels: usize,
    /// Samples before the next frame that must stay.
    len: usize,
    /// Samples that kernels read past the last frame.
    padding: usize,
    /// Where the next frame begins.
    next: usize,
}

impl<T: Sample> History<T> {
    /// Zeros: `len` samples, room for blocks of at most `block` samples, and `padding` after it.
    pub(crate) fn new(channels: usize, len: usize, block: usize, padding: usize) -> Self {
        let samples = Aligned::new(len + block + block / 4 + padding);
        Self { samples, channels, len, padding, next: len }
    }

    /// All zeros, as new.
    pub(crate) fn reset(&mut self) {
        self.samples.fill(T::default());
        self.next = self.len;
    }

    /// Room for the next `frames` frames, at most a block.
    #[inline]
    pub(crate) fn room(&mut self, frames: usize) -> &mut [T] {
        let len = frames * self.channels;
        if self.next + len + self.padding > self.samples.len() {
            self.samples.copy_within(self.next - self.len..self.next, 0);
            self.next = self.len;
        }
        &mut self.samples[self.next..][..len]
    }

    /// The history of the next frame, and what was written after it.
    pub(crate) fn view(&self) -> &[T] {
        &self.samples[self.next - self.len..]
    }

    /// The `frames` frames that were written into the room belong to the history now.
    pub(crate) fn advance(&mut self, frames: usize) {
        self.next += frames * self.channels;
    }

    /// The history is the end of `samples`, which are at least as long.
    pub(crate) fn load(&mut self, samples: &[T]) {
        self.samples[..self.len].copy_from_slice(&samples[samples.len() - self.len..]);
        self.next = self.len;
    }

    /// The history is that of `value(a, i)`, the sample of channel i that came a frames before the next one,
    /// a = 1, 2, ..
    pub(crate) fn fill(&mut self, value: impl Fn(usize, usize) -> T) {
        let n = self.channels;
        for (place, slot) in self.samples[..self.len].iter_mut().rev().enumerate() {
            *slot = value(place / n + 1, n - 1 - place % n);
        }
        self.next = self.len;
    }

    /// The sample of `channel` that came `age` >= 1 frames before the next one; 0 where the history does not
    /// reach.
    pub(crate) fn sample(&self, age: usize, channel: usize) -> T {
        let back = age.saturating_mul(self.channels) - channel;
        if back > self.len { T::default() } else { self.samples[self.next - back] }
    }

    /// Passes the samples of the last `frames` frames to `put`, the last frame first.
    pub(crate) fn save(&self, frames: usize, put: &mut dyn FnMut(f64)) {
        for age in 1..=frames {
            (0..self.channels).for_each(|channel| put(self.sample(age, channel).to_f64()));
        }
    }

    /// The history is what [`History::save`] gave as the first of `numbers`, and zeros before that.
    pub(crate) fn resume(&mut self, frames: usize, numbers: StateNumbers<'_>) {
        let n = self.channels;
        let known =
            |age: usize, channel| if age <= frames { numbers.get((age - 1) * n + channel) } else { 0.0 };
        self.fill(|age, channel| T::from_f64(known(age, channel)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn past_samples_are_found_and_filled_by_their_age() {
        let mut history = History::<f32>::new(2, 5, 4, 0);
        for k in 0..20 {
            history.room(1).copy_from_slice(&[k as f32, -(k as f32)]);
            history.advance(1);
            assert_eq!(history.sample(1, 0), k as f32);
            assert_eq!(history.sample(2, 1), -(f32::from(i16::try_from(k).unwrap()) - 1.0).max(0.0));
        }
        // Five samples: channel 1 reaches one frame further back than channel 0.
        assert_eq!(
            (history.sample(3, 0), history.sample(3, 1), history.sample(usize::MAX, 1)),
            (0.0, -17.0, 0.0)
        );
        let mut copy = History::<f32>::new(2, 5, 8, 3);
        copy.fill(|age, channel| history.sample(age, channel));
        assert_eq!(copy.view()[..5], history.view()[..5]);
    }
}
