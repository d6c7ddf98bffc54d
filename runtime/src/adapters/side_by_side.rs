//! Several inputs side by side.

use super::{FrameSource, SCRATCH};
use crate::{Isa, Sample};
use std::borrow::Cow;
use std::ops::Range;

/// Inputs whose channels follow each other; frames are those that all of them have.
#[derive(Debug, Clone)]
pub struct SideBySide<'a, I: Clone>(Cow<'a, [I]>);

impl<'a, I: Clone> SideBySide<'a, I> {
    /// The inputs in their order.
    pub fn new(inputs: impl Into<Cow<'a, [I]>>) -> Self {
        Self(inputs.into())
    }
}

impl<I: FrameSource + Clone> FrameSource for SideBySide<'_, I> {
    fn channels(&self) -> usize {
        self.0.iter().map(FrameSource::channels).sum()
    }

    fn frames(&self) -> usize {
        self.0.iter().map(FrameSource::frames).min().unwrap_or(0)
    }

    fn in_memory_f32(&self) -> Option<&[f32]> {
        if let [alone] = &*self.0 { alone.in_memory_f32() } else { None }
    }

    fn in_memory_f64(&self) -> Option<&[f64]> {
        if let [alone] = &*self.0 { alone.in_memory_f64() } else { None }
    }

    fn is_finite(&self, frames: Range<usize>) -> bool {
        self.0.iter().all(|input| input.is_finite(frames.clone()))
    }

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        load_each(&self.0, isa, first, samples);
    }

    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]) {
        load_each(&self.0, isa, first, samples);
    }
}

/// One input after the other, each to its columns of the frames.
fn load_each<T: Sample>(inputs: &[impl FrameSource], isa: Isa, first: usize, samples: &mut [T]) {
    if let [alone] = inputs {
        return (alone as &dyn FrameSource).load(isa, first, samples);
    }
    let n: usize = inputs.iter().map(FrameSource::channels).sum();
    let frames = samples.len() / n.max(1);
    let (mut scratch, mut wide) = ([T::default(); SCRATCH], Vec::new());
    let mut column = 0;
    for input in inputs {
        let channels = input.channels();
        // Only frames of more samples than the scratch holds need memory.
        if channels > SCRATCH {
            wide.resize(channels, T::default());
        }
        let room = if channels > SCRATCH { &mut wide[..] } else { &mut scratch[..] };
        let step = (room.len() / channels.max(1)).max(1);
        for start in (0..frames).step_by(step) {
            let loaded = &mut room[..step.min(frames - start) * channels];
            (input as &dyn FrameSource).load(isa, first + start, loaded);
            for channel in 0..channels {
                let slots = samples[start * n + column + channel..].iter_mut().step_by(n);
                let loaded = loaded[channel..].iter().step_by(channels);
                slots.zip(loaded).for_each(|(slot, sample)| *slot = *sample);
            }
        }
        column += channels;
    }
}
