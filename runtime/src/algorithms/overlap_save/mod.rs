//! Overlap-save: FIR filtering by Fourier transforms, for long filters.
//!
//! The F frames up to the end of a block of B = F - (K - 1) frames are transformed, multiplied by the M by N
//! spectra of the filters, and transformed back; the last B of them are outputs of the sum (Oppenheim and
//! Schafer, section 8.7). Channels lie in lane groups, and so do S segments of the stream where there is
//! room for them. Two blocks are the two parts of a complex one: as the filters are real, the product with
//! their spectra gives y_a + i y_b. So a *batch* of 2 S B frames is made at once.
//!
//! Batches are counted from the beginning of the stream and not of a call, so that cuts do not change a bit.
//! Outputs are those of the batch before: all are late by 2 S B frames. The error of an output is about
//! eps log2 F times the norm of its filters times that of the inputs of its two blocks, and not only of
//! those in the filter's history.
//!
//! NaN and infinity are replaced before filtering, and no frame is filtered twice. Sums that overflow leave
//! their batch.

mod shape;

pub(crate) use shape::TransformShape;

use super::filter::{AlgorithmFacts, Filter, check_finite};
use crate::adapters::{FrameSink, FrameSource};
use crate::simd::{Lanes, Product, Row, group_lanes, multiply, replace_not_finite};
use crate::state::{Count, StateNumbers};
use crate::{BuildError, Isa, Sample};
use rustfft::algorithm::Radix4;
use rustfft::algorithm::butterflies::{Butterfly4, Butterfly8};
use rustfft::num_complex::Complex;
use rustfft::num_traits::Zero;
use rustfft::{Fft, FftDirection, FftNum, Length};
use std::fmt;
use std::sync::Arc;

/// Coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct OverlapSave<T: Sample> {
    shape: TransformShape,
    forward: Transform<T::Portable>,
    inverse: Transform<T::Portable>,
    /// H(f) / F for 0 <= f <= F / 2: for each frequency and each group of phases a row for each channel.
    spectra: Vec<Row<T>>,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct OverlapSaveState<T: Sample> {
    /// K - 1 frames of history, then the batch that is being filled.
    samples: Vec<T>,
    /// Frames of the batch that are there.
    filled: usize,
    /// Outputs of the batch before.
    output: Vec<T>,
    /// F rows of each lane group of channels, and of each lane group of phases.
    channels: Vec<Row<T>>,
    phases: Vec<Row<T>>,
    /// F rows on their way.
    rows: Vec<Row<T>>,
}

impl<T: Sample> OverlapSave<T> {
    /// `taps[i]` = f_i at the fast rate, filters that fit `shape`.
    pub(crate) fn new(taps: &[Vec<f64>], shape: TransformShape, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        Ok(Self {
            shape,
            forward: Transform::new(shape.len, FftDirection::Forward),
            inverse: Transform::new(shape.len, FftDirection::Inverse),
            spectra: spectra::<T>(taps, &shape),
            isa,
        })
    }

    /// The outputs of a complete batch, which becomes history.
    fn batch(&self, state: &mut OverlapSaveState<T>) {
        match self.shape.depth {
            1 => self.filter::<1>(state),
            2 => self.filter::<2>(state),
            4 => self.filter::<4>(state),
            _ => self.filter::<8>(state),
        }
        let TransformShape { channels, history, .. } = self.shape;
        let begin = self.shape.batch() * channels;
        state.samples.copy_within(begin..begin + history * channels, 0);
        state.filled = 0;
    }

    fn filter<const D: usize>(&self, state: &mut OverlapSaveState<T>) {
        let OverlapSaveState { samples, output, channels, phases, rows, .. } = state;
        let TransformShape { channels: n, ratio, history, len, .. } = self.shape;
        let block = self.shape.block();
        for (group, channels) in channels.chunks_exact_mut(len).enumerate() {
            gather::<T, D>(&samples[group * D..], [n, block * n], rows);
            self.forward.process(rows, channels);
        }
        multiply::<T>(
            self.isa,
            D,
            Product { channels: n, len, spectra: &self.spectra, input: channels, output: phases },
        );
        // The last group may hold more lanes than there are phases, over which the others write.
        for (group, phases) in phases.chunks_exact_mut(len).enumerate().rev() {
            self.inverse.process(phases, rows);
            scatter::<T, D>(&rows[history..], &mut output[group * D..], [ratio, block * ratio]);
        }
    }
}

impl<T: Sample> Filter for OverlapSave<T> {
    type State = OverlapSaveState<T>;

    fn facts(&self) -> AlgorithmFacts {
        let shape = &self.shape;
        AlgorithmFacts {
            name: "overlap-save",
            history: Some(shape.history),
            delay: shape.batch(),
            alignment: shape.batch(),
            transform: Some((shape.len, shape.block())),
            multiply_adds: Some(shape.multiply_adds()),
        }
    }

    fn state(&self) -> OverlapSaveState<T> {
        let shape = &self.shape;
        let rows = |groups: usize| vec![Row::<T>::zero(); groups * shape.len];
        OverlapSaveState {
            // The last frames are read and written as whole groups.
            samples: vec![T::default(); (shape.history + shape.batch()) * shape.channels + shape.depth],
            filled: 0,
            output: vec![T::default(); shape.batch() * shape.ratio + shape.depth],
            channels: rows(shape.inputs()),
            phases: rows(shape.outputs()),
            rows: rows(1),
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
        input: &dyn FrameSource,
        output: &mut dyn FrameSink,
    ) -> u64 {
        let TransformShape { channels: n, ratio: m, history, .. } = self.shape;
        let (mut replaced, mut first) = (0, 0);
        while first < input.frames() {
            let frames = (input.frames() - first).min(self.shape.batch() - state.filled);
            let room = &mut state.samples[(history + state.filled) * n..][..frames * n];
            input.load(self.isa, first, room);
            replaced += replace_not_finite(self.isa, room).count;
            output.store(self.isa, first * m, &state.output[state.filled * m..][..frames * m]);
            (state.filled, first) = (state.filled + frames, first + frames);
            if state.filled == self.shape.batch() {
                self.batch(state);
            }
        }
        replaced
    }

    /// The history and the frames of the batch, and the outputs of the batch before that are still to come.
    fn count(&self, filled: usize) -> Count {
        let shape = &self.shape;
        let inputs = (shape.history + filled) * shape.channels;
        Count { inputs, sums: (shape.batch() - filled) * shape.ratio }
    }

    fn save(&self, state: &OverlapSaveState<T>, put: &mut dyn FnMut(f64)) {
        let Count { inputs, sums } = self.count(state.filled);
        let (inputs, waiting) =
            (&state.samples[..inputs], &state.output[state.filled * self.shape.ratio..][..sums]);
        inputs.iter().chain(waiting).for_each(|value| put(value.to_f64()));
    }

    fn resume(&self, state: &mut OverlapSaveState<T>, filled: usize, numbers: StateNumbers<'_>) {
        Self::reset(state);
        state.filled = filled;
        let Count { inputs, sums } = self.count(filled);
        let inputs = &mut state.samples[..inputs];
        let waiting = &mut state.output[filled * self.shape.ratio..][..sums];
        for (place, slot) in inputs.iter_mut().chain(waiting).enumerate() {
            *slot = T::from_f64(numbers.get(place));
        }
    }
}

/// From D samples of each frame to rows: samples of neighbouring frames and blocks are so far apart.
fn gather<T: Sample, const D: usize>(samples: &[T], [frame, block]: [usize; 2], rows: &mut [Row<T>]) {
    for (t, row) in rows.iter_mut().enumerate() {
        let parts = row.re.lanes_mut().chunks_exact_mut(D).zip(row.im.lanes_mut().chunks_exact_mut(D));
        for (segment, (re, im)) in parts.enumerate() {
            let at = t * frame + 2 * segment * block;
            re.copy_from_slice(&samples[at..][..D]);
            im.copy_from_slice(&samples[at + block..][..D]);
        }
    }
}

/// From rows to D samples of each frame.
fn scatter<T: Sample, const D: usize>(rows: &[Row<T>], samples: &mut [T], [frame, block]: [usize; 2]) {
    for segment in 0..group_lanes::<T>() / D {
        for (t, row) in rows.iter().enumerate() {
            let at = t * frame + 2 * segment * block;
            samples[at..][..D].copy_from_slice(&row.re.lanes()[segment * D..][..D]);
        }
        for (t, row) in rows.iter().enumerate() {
            let at = t * frame + (2 * segment + 1) * block;
            samples[at..][..D].copy_from_slice(&row.im.lanes()[segment * D..][..D]);
        }
    }
}

/// The spectra of all filters over F, made in f64, in the order of use.
fn spectra<T: Sample>(taps: &[Vec<f64>], shape: &TransformShape) -> Vec<Row<T>> {
    let TransformShape { channels, ratio, len, depth, segments, .. } = *shape;
    let forward = Transform::new(len, FftDirection::Forward);
    let mut spectra = vec![Row::<T>::zero(); (len / 2 + 1) * shape.outputs() * channels];
    let (mut filter, mut spectrum) = (vec![Complex::zero(); len], vec![Complex::zero(); len]);
    for (channel, phase) in (0..channels).flat_map(|i| (0..ratio).map(move |p| (i, p))) {
        filter.fill(Complex::zero());
        for (slot, tap) in filter.iter_mut().zip(taps[channel].iter().skip(phase).step_by(ratio)) {
            slot.re = tap / len as f64;
        }
        forward.process(&mut filter, &mut spectrum);
        for (frequency, value) in spectrum[..=len / 2].iter().enumerate() {
            let row = &mut spectra[(frequency * shape.outputs() + phase / depth) * channels + channel];
            for lane in (0..segments).map(|segment| segment * depth + phase % depth) {
                row.re.lanes_mut()[lane] = T::from_f64(value.re);
                row.im.lanes_mut()[lane] = T::from_f64(value.im);
            }
        }
    }
    spectra
}

/// A transform without the factor 1 / F.
struct Transform<N: FftNum>(Radix4<N>);

impl<N: FftNum> Transform<N> {
    /// Of a length that is a power of two from 8 on. Longer butterflies would need more groups than there
    /// are registers for.
    fn new(len: usize, direction: FftDirection) -> Self {
        let levels = len.ilog2();
        Self(match levels % 2 {
            0 => Radix4::new_with_base(levels / 2 - 1, Arc::new(Butterfly4::new(direction))),
            _ => Radix4::new_with_base(levels / 2 - 1, Arc::new(Butterfly8::new(direction))),
        })
    }

    /// F numbers, which are lost, to F others.
    fn process(&self, from: &mut [Complex<N>], to: &mut [Complex<N>]) {
        // Of powers of two, transforms out of place need no other memory.
        self.0.process_outofplace_with_scratch(from, to, &mut []);
    }
}

impl<N: FftNum> fmt::Debug for Transform<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Transform({})", self.0.len())
    }
}

#[cfg(test)]
mod tests;
