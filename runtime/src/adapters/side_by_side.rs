//! Several inputs side by side.

use super::{FrameSource, MOST_ROWS, SCRATCH, interleave_rows};
use crate::{Isa, Sample};
use std::borrow::Cow;

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

    fn load_f32(&self, isa: Isa, first: usize, samples: &mut [f32]) {
        match &*self.0 {
            [alone] => alone.load_f32(isa, first, samples),
            many if many.len() <= MOST_ROWS && many.iter().all(|input| input.channels() == 1) => {
                interleave_rows(isa, many.len(), samples, |i, start, row| {
                    many[i].load_f32(isa, first + start, row);
                });
            }
            many => load_each(many, isa, first, samples),
        }
    }

    fn load_f64(&self, isa: Isa, first: usize, samples: &mut [f64]) {
        match &*self.0 {
            [alone] => alone.load_f64(isa, first, samples),
            many => load_each(many, isa, first, samples),
        }
    }
}

/// One input after the other, each to its columns of the frames.
fn load_each<T: Sample>(inputs: &[impl FrameSource], isa: Isa, first: usize, samples: &mut [T]) {
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
            let slots = samples[start * n..].chunks_exact_mut(n);
            for (frame, loaded) in slots.zip(loaded.chunks_exact(channels.max(1))) {
                frame[column..column + channels].copy_from_slice(loaded);
            }
        }
        column += channels;
    }
}
