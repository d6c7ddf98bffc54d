//! Overlap-save: FIR filtering by Fourier transforms, for long filters.
//!
//! The F frames up to the end of a block of B = F - (K - 1) frames are transformed, multiplied by the M by N
//! spectra of the filters, and transformed back; the last B of them are outputs of the sum (Oppenheim and
//! Schafer, section 8.7). Channels lie in lanes, and so do S segments of the stream where a vector has room
//! for them, see [`simd`](crate::simd). Two blocks are the two parts of a complex one, so that a *batch* of
//! 2 S B frames is made at once.
//!
//! Batches are counted from the beginning of the stream and not of a call, so that cuts do not change a bit.
//! An output is there when its batch is complete: all are late by 2 S B - 1 frames. The error of an output
//! is about eps log2 F times the norm of its filters times that of the inputs of its two blocks, and not
//! only of those in the filter's history.
//!
//! The worst case of a call: inputs are checked, and NaN and infinity replaced, before filtering. A batch
//! whose transforms overflow is filtered once more with smaller numbers, so no frame is filtered more than
//! twice.

mod shape;
#[cfg(test)]
mod tests;

pub(crate) use shape::Shape;

use super::filter::{Facts, Filter, check_finite, phase_taps};
use crate::adapters::{Input, Output};
use crate::aligned::Aligned;
use crate::simd::{
    OutputFrames, Segments, Spectra, Transform, TransformKernel, all_finite, group_lanes, replace_not_finite,
    row_samples,
};
use crate::state::{Count, Numbers};
use crate::{BuildError, Isa, Sample};
use std::ops::Range;

/// Input that makes a transform overflow is made smaller by this, and its output larger. In between only
/// digits below 2^40 times the smallest number are lost.
const OVERFLOW_SCALE: f64 = (1u64 << 40) as f64;

/// Coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct OverlapSave<T: Sample> {
    pub(crate) shape: Shape,
    transform: Transform<T>,
    /// H(f) / F.
    spectra: Aligned<T>,
    kernel: TransformKernel<T>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct OverlapSaveState<T: Sample> {
    /// K - 1 frames of history, then the batch that is being filled.
    samples: Aligned<T>,
    /// Frames of the batch that are there.
    filled: usize,
    /// Outputs of the batch before.
    output: Aligned<T>,
    work: Work<T>,
}

/// What is known of the frames of a call.
#[derive(Default)]
struct Progress {
    /// From here on, up to the next one, the caller's frames are finite.
    clean: usize,
    /// Up to here the state knows them.
    known: usize,
    /// Up to here outputs are in the output.
    written: usize,
    /// Samples that were not finite.
    replaced: u64,
}

/// Rows of channels and rows of phases.
#[derive(Debug, Clone)]
struct Work<T: Sample> {
    channels: Aligned<T>,
    phases: Aligned<T>,
}

impl<T: Sample> OverlapSave<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters, in transforms of length
    /// F = `len`, a power of two from 16 on that is longer than the filters' memory.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, len: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let history = phase_taps(taps, ratio) - 1;
        let shape = Shape::new(taps.len(), ratio, history, len, group_lanes::<T>());
        if !shape.spectra_fit() {
            return Err(BuildError::Spectra { channels: taps.len(), ratio, len });
        }
        Ok(Self {
            shape,
            transform: Transform::new(len, T::from_f64),
            spectra: spectra(taps, &shape, isa),
            kernel: TransformKernel::new(isa),
            isa,
        })
    }

    /// The next frames of the batch: where they lie in the caller's memory (as a whole batch), or into the
    /// state.
    fn take<'a>(
        &self,
        state: &mut OverlapSaveState<T>,
        input: &'a (impl Input + ?Sized),
        frames: Range<usize>,
        progress: &mut Progress,
    ) -> Option<&'a [T]> {
        let outside =
            input.in_memory::<T>().and_then(|samples| self.in_place(samples, progress.clean, &frames));
        if outside.is_none() {
            self.load_history(state, input, frames.start, progress);
            let count = self.gather(state, input, frames.start, frames.len());
            if count > 0 {
                progress.replaced += count;
                progress.clean = frames.end;
            }
            progress.known = frames.end;
        }
        outside
    }

    /// Makes the state's history that of frame `first` again, if the frames before stayed in the caller's
    /// memory.
    fn load_history(
        &self,
        state: &mut OverlapSaveState<T>,
        input: &(impl Input + ?Sized),
        first: usize,
        progress: &Progress,
    ) {
        let Shape { channels, history, .. } = self.shape;
        if let (true, Some(samples)) = (progress.known < first, input.in_memory::<T>()) {
            let recent = &samples[(first - history) * channels..first * channels];
            state.samples[..recent.len()].copy_from_slice(recent);
        }
    }

    /// Outputs of the batch before to the frames of a call of which `first` is the next one of the batch.
    fn pass_on(
        &self,
        state: &OverlapSaveState<T>,
        output: &mut (impl Output + ?Sized),
        first: usize,
        frames: Range<usize>,
    ) {
        let m = self.shape.ratio;
        if !frames.is_empty() {
            let place = state.filled + 1 + frames.start - first;
            output.store(self.isa, frames.start * m, &state.output[place * m..][..frames.len() * m]);
        }
    }

    /// Makes the batch, whose first output belongs to frame `frame` of the call, `left` frames before its
    /// end. Returns the frame up to which outputs are in the output: all of them, if there is room.
    fn complete(
        &self,
        state: &mut OverlapSaveState<T>,
        outside: Option<&[T]>,
        output: &mut (impl Output + ?Sized),
        frame: usize,
        left: usize,
    ) -> usize {
        let m = self.shape.ratio;
        // Whole lanes are written: somewhat more than the batch, which is still to come.
        let needed = self.shape.batch() + group_lanes::<T>();
        if needed <= left
            && let Some(slots) = output.slots(frame * m..(frame + needed) * m)
        {
            self.batch(state, outside, Some(slots));
            return frame + self.shape.batch();
        }
        self.batch(state, outside, None);
        output.store(self.isa, frame * m, &state.output[..m]);
        frame + 1
    }

    /// The frames of a whole batch with their history as they lie in the caller's memory, if they are all
    /// there and finite.
    fn in_place<'a>(&self, samples: &'a [T], clean: usize, frames: &Range<usize>) -> Option<&'a [T]> {
        let Shape { channels, history, .. } = self.shape;
        let whole = frames.len() == self.shape.batch();
        let from = frames.start.checked_sub(history).filter(|&from| whole && from >= clean)?;
        let x = &samples[from * channels..];
        let len = (history + frames.len()) * channels;
        // Frames are read as whole groups.
        let fits = len + group_lanes::<T>() <= x.len();
        (fits && all_finite(self.isa, &x[history * channels..len + group_lanes::<T>()])).then_some(x)
    }

    /// The next frames of the batch; returns how many samples were not finite and are 0 now.
    fn gather(
        &self,
        state: &mut OverlapSaveState<T>,
        input: &(impl Input + ?Sized),
        first: usize,
        frames: usize,
    ) -> u64 {
        let n = self.shape.channels;
        let room = &mut state.samples[(self.shape.history + state.filled) * n..][..frames * n];
        input.load(self.isa, first, room);
        replace_not_finite(self.isa, room).count
    }

    /// The outputs of a complete batch, whose frames are `outside` or in the state, to `slots` or the state.
    fn batch(&self, state: &mut OverlapSaveState<T>, outside: Option<&[T]>, slots: Option<&mut [T]>) {
        let OverlapSaveState { samples, output, work, filled } = state;
        let Shape { channels, ratio, history, .. } = self.shape;
        let batch = self.shape.batch();
        let output = slots.unwrap_or(output);
        self.filter(work, outside.unwrap_or(samples), output);
        let wanted = &mut output[..batch * ratio];
        if !all_finite(self.isa, wanted) {
            if let Some(outside) = outside {
                let len = samples.len();
                samples.copy_from_slice(&outside[..len]);
            }
            scale(samples, 1.0 / OVERFLOW_SCALE);
            self.filter(work, samples, output);
            scale(&mut output[..batch * ratio], OVERFLOW_SCALE);
            scale(samples, OVERFLOW_SCALE);
        }
        if outside.is_none() {
            samples.copy_within(batch * channels..(batch + history) * channels, 0);
        }
        *filled = 0;
    }

    /// From frames to the outputs of a batch, and to a group of lanes after it.
    fn filter(&self, work: &mut Work<T>, samples: &[T], output: &mut [T]) {
        let Shape { channels, ratio, depth, len, .. } = self.shape;
        let plane = len * row_samples::<T>();
        let block = self.shape.block();
        let hop = block * channels;
        for (i, rows) in work.channels.chunks_exact_mut(plane).enumerate() {
            let samples = &samples[i * depth..];
            let segments = Segments { parts: [samples, &samples[hop..]], stride: channels, hop: 2 * hop };
            self.kernel.forward(&self.transform, depth, segments, rows);
        }
        let spectra = Spectra { channels, rows: &self.spectra };
        self.kernel.product(&self.transform, depth, spectra, &work.channels, &mut work.phases);
        for rows in work.phases.chunks_exact_mut(plane) {
            self.kernel.inverse(&self.transform, rows);
        }
        let to = OutputFrames { samples: output, stride: ratio, count: block };
        self.kernel.scatter(&self.transform, depth, &work.phases, to);
    }
}

impl<T: Sample> Filter for OverlapSave<T> {
    type State = OverlapSaveState<T>;

    fn facts(&self) -> Facts {
        let shape = &self.shape;
        Facts {
            name: "overlap-save",
            history: Some(shape.history),
            delay: shape.delay(),
            alignment: shape.batch(),
            transform: Some((shape.len, shape.block())),
            multiply_adds: Some(shape.multiply_adds()),
        }
    }

    fn state(&self) -> OverlapSaveState<T> {
        let shape = &self.shape;
        let plane = shape.len * row_samples::<T>();
        // Frames are read and written as whole groups.
        let padding = group_lanes::<T>();
        OverlapSaveState {
            samples: Aligned::new((shape.history + shape.batch()) * shape.channels + padding),
            filled: 0,
            output: Aligned::new(shape.batch() * shape.ratio + padding),
            work: Work {
                channels: Aligned::new(shape.inputs() * plane),
                phases: Aligned::new(shape.outputs() * plane),
            },
        }
    }

    fn reset(state: &mut OverlapSaveState<T>) {
        state.samples.fill(T::default());
        state.output.fill(T::default());
        state.filled = 0;
    }

    fn process(
        &self,
        state: &mut OverlapSaveState<T>,
        input: &(impl Input + ?Sized),
        output: &mut (impl Output + ?Sized),
    ) -> u64 {
        let mut progress = Progress::default();
        let mut first = 0;
        while first < input.frames() {
            let end = first + (input.frames() - first).min(self.shape.batch() - state.filled);
            let outside = self.take(state, input, first..end, &mut progress);
            let complete = state.filled + end - first == self.shape.batch();
            // The frame that completes a batch already takes an output of it; those before take outputs of
            // the batch before.
            let before = end - usize::from(complete);
            self.pass_on(state, output, first, progress.written.max(first)..before);
            state.filled += end - first;
            if complete {
                let left = input.frames() - before;
                progress.written = self.complete(state, outside, output, before, left);
            }
            first = end;
        }
        self.load_history(state, input, first, &progress);
        progress.replaced
    }

    /// The history and the frames of the batch, and the outputs of the batch before that are still to come.
    fn count(&self, filled: usize) -> Count {
        let shape = &self.shape;
        let inputs = (shape.history + filled) * shape.channels;
        Count { inputs, sums: (shape.delay() - filled) * shape.ratio }
    }

    fn save(&self, state: &OverlapSaveState<T>, put: &mut dyn FnMut(f64)) {
        let Count { inputs, sums } = self.count(state.filled);
        let waiting = &state.output[(state.filled + 1) * self.shape.ratio..][..sums];
        state.samples[..inputs].iter().chain(waiting).for_each(|value| put(value.to_f64()));
    }

    fn resume(&self, state: &mut OverlapSaveState<T>, filled: usize, numbers: Numbers<'_>) {
        let Count { inputs, sums } = self.count(filled);
        Self::reset(state);
        state.filled = filled;
        let waiting = &mut state.output[(filled + 1) * self.shape.ratio..][..sums];
        for (place, slot) in state.samples[..inputs].iter_mut().chain(waiting).enumerate() {
            *slot = T::from_f64(numbers.get(place));
        }
    }
}

fn scale<T: Sample>(samples: &mut [T], factor: f64) {
    samples.iter_mut().for_each(|x| *x = T::from_f64(x.to_f64() * factor));
}

/// Phases that are transformed together: the lanes of a group of f64.
const QUAD: usize = group_lanes::<f64>();

/// The spectra of all filters over F, made in f64 by the same transform, in the order of use.
fn spectra<T: Sample>(taps: &[Vec<f64>], shape: &Shape, isa: Isa) -> Aligned<T> {
    let Shape { channels, ratio, history, len, depth, segments } = *shape;
    let (row, group) = (row_samples::<T>(), group_lanes::<T>());
    let transform = Transform::new(len, |x: f64| x);
    let kernel = TransformKernel::<f64>::new(isa);
    let mut spectra = Aligned::new((len / 2 + 1) * shape.outputs() * channels * row);
    let (mut samples, zeros) = (vec![0.0; len * QUAD], vec![0.0; len * QUAD]);
    let mut rows = vec![0.0; len * row_samples::<f64>()];
    for (channel, quad) in (0..channels).flat_map(|i| (0..ratio).step_by(QUAD).map(move |p| (i, p))) {
        let phases = quad..(quad + QUAD).min(ratio);
        for (k, p) in (0..=history).flat_map(|k| phases.clone().map(move |p| (k, p))) {
            let tap = taps[channel].get(p + k * ratio);
            samples[k * QUAD + p - quad] = tap.map_or(0.0, |tap| tap / len as f64);
        }
        let segment = Segments { parts: [&samples, &zeros], stride: QUAD, hop: 0 };
        kernel.forward(&transform, QUAD, segment, &mut rows);
        for (pair, from) in transform.half_rows().enumerate() {
            let from = &rows[from * row_samples::<f64>()..];
            for p in phases.clone() {
                let place = ((pair * shape.outputs() + p / depth) * channels + channel) * row;
                for lane in (0..segments).map(|s| s * depth + p % depth) {
                    spectra[place + lane] = T::from_f64(from[p - quad]);
                    spectra[place + group + lane] = T::from_f64(from[QUAD + p - quad]);
                }
            }
        }
    }
    spectra
}
