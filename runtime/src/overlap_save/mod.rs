//! FIR banks: the overlap-save form, for long filters.
//!
//! The F ticks up to the end of a block of B = F - (K - 1) ticks are transformed, multiplied by the M by N spectra of
//! the filters, and transformed back; the last B of them are outputs of the sum (Oppenheim and Schafer,
//! section 8.7). Channels lie in lanes, and so do S segments of the stream where a vector has room for them, see
//! [`simd`](super::simd). Two blocks are the two parts of a complex one, so that a *batch* of 2 S B ticks is made
//! at once.
//!
//! Batches are counted from the beginning of the stream and not of a call, so that cuts do not change a bit. An output
//! is there when its batch is complete: all are late by 2 S B - 1 ticks. The error of an output is about
//! eps log2 F times the norm of its filters times that of the inputs of its two blocks, and not only of those in
//! the filter memory.

#[cfg(test)]
mod tests;

use crate::BuildError;
use crate::aligned::Aligned;
use crate::fir::{check_finite, replace_not_finite};
use crate::form::lags;
use crate::sample::Sample;
use crate::simd::{
    Frames, Isa, Segments, Spectra, Transform, TransformKernel, all_finite, group_lanes, row_samples,
};
use crate::ticks::{FastSink, TickSource};
use std::ops::Range;

/// Samples of all spectra: more would take gigabytes.
const MOST_SPECTRA: f64 = (1u64 << 28) as f64;

/// Input that makes a transform overflow is made smaller by this, and its output larger. In between only
/// digits below 2^40 times the smallest number are lost.
const SCALE: f64 = (1u64 << 40) as f64;

/// How the stream is cut into transforms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shape {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K - 1: ticks that the filters look back.
    pub(crate) history: usize,
    /// F.
    pub(crate) len: usize,
    /// D, lanes of a segment in a group.
    depth: usize,
    /// S, segments in a group.
    segments: usize,
}

impl Shape {
    /// For vectors of `group` lanes; F > K - 1.
    pub(crate) fn new(channels: usize, ratio: usize, history: usize, len: usize, group: usize) -> Self {
        let depth = channels.max(ratio).next_power_of_two().min(group);
        Self { channels, ratio, history, len, depth, segments: group / depth }
    }

    /// B, ticks of a block.
    pub(crate) fn block(&self) -> usize {
        self.len - self.history
    }

    /// Ticks that are made at once.
    pub(crate) fn batch(&self) -> usize {
        2 * self.segments * self.block()
    }

    /// Ticks by which outputs are late.
    pub(crate) fn delay(&self) -> usize {
        self.batch() - 1
    }

    /// Groups of lanes that hold the channels.
    pub(crate) fn inputs(&self) -> usize {
        self.channels.div_ceil(self.depth)
    }

    /// Groups of lanes that hold the phases.
    pub(crate) fn outputs(&self) -> usize {
        self.ratio.div_ceil(self.depth)
    }

    /// Operations on single lanes for each fast sample.
    pub(crate) fn multiply_adds(&self) -> f64 {
        // A level of radix 2 takes 3 multiply-adds and 2 additions for each complex lane of half of the rows, as one
        // half of a pass of radix 4: 17 operations a row in two levels, 8.5 in one.
        let transforms = (self.inputs() + self.outputs()) as f64 * 3.5 * f64::from(self.len.ilog2());
        let products = (4 * self.channels * self.outputs()) as f64;
        let lanes = (self.len * self.depth * self.segments) as f64 * (transforms + products);
        lanes / (self.batch() * self.ratio) as f64
    }

    /// False if the spectra would take gigabytes.
    pub(crate) fn spectra_fit(&self) -> bool {
        let rows = (self.len / 2 + 1) as f64 * (self.outputs() * self.channels) as f64;
        rows * (2 * self.depth * self.segments) as f64 <= MOST_SPECTRA
    }
}

/// Coefficients in the order of use; shared by all streams of a bank.
#[derive(Debug)]
pub(crate) struct OverlapSavePlan<T: Sample> {
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
    /// K - 1 ticks of the past, then the batch that is being filled.
    frames: Aligned<T>,
    /// Ticks of the batch that are there.
    filled: usize,
    /// Outputs of the batch before.
    output: Aligned<T>,
    work: Work<T>,
}

/// What is known of the ticks of a call.
#[derive(Default)]
struct Progress {
    /// From here on, up to the next one, the caller's frames are finite.
    clean: usize,
    /// Up to here the state knows them.
    known: usize,
    /// Up to here outputs are in the sink.
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

impl<T: Sample> OverlapSavePlan<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters, in transforms of length F = `len`, a power
    /// of two from 16 on that is longer than the filters' memory.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, len: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let history = lags(taps, ratio) - 1;
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

    /// A stream's state before its first tick.
    pub(crate) fn state(&self) -> OverlapSaveState<T> {
        let shape = &self.shape;
        let plane = shape.len * row_samples::<T>();
        // Frames are read and written as whole groups.
        let beyond = group_lanes::<T>();
        OverlapSaveState {
            frames: Aligned::new((shape.history + shape.batch()) * shape.channels + beyond),
            filled: 0,
            output: Aligned::new(shape.batch() * shape.ratio + beyond),
            work: Work {
                channels: Aligned::new(shape.inputs() * plane),
                phases: Aligned::new(shape.outputs() * plane),
            },
        }
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut OverlapSaveState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let mut progress = Progress::default();
        let mut first = 0;
        while first < source.ticks() {
            let end = first + (source.ticks() - first).min(self.shape.batch() - state.filled);
            let outside = self.take(state, source, first..end, &mut progress);
            let complete = state.filled + end - first == self.shape.batch();
            // The last tick of a batch already takes the first output of it, the others take the next ones.
            let late = end - usize::from(complete);
            self.pass_on(state, sink, first, progress.written.max(first)..late);
            state.filled += end - first;
            if complete {
                let behind = source.ticks() - late;
                progress.written = self.complete(state, outside, sink, late, behind);
            }
            first = end;
        }
        self.recall(state, source, first, &progress);
        progress.replaced
    }

    /// The next ticks of the batch: where they lie in the caller's memory (as a whole batch), or into the state.
    fn take<'a>(
        &self,
        state: &mut OverlapSaveState<T>,
        source: &'a (impl TickSource + ?Sized),
        ticks: Range<usize>,
        progress: &mut Progress,
    ) -> Option<&'a [T]> {
        let outside = source.frames::<T>().and_then(|frames| self.in_place(frames, progress.clean, &ticks));
        if outside.is_none() {
            self.recall(state, source, ticks.start, progress);
            let count = self.gather(state, source, ticks.start, ticks.len());
            if count > 0 {
                progress.replaced += count;
                progress.clean = ticks.end;
            }
            progress.known = ticks.end;
        }
        outside
    }

    /// The state's past is that of tick `first` again, if the ticks before stayed in the caller's memory.
    fn recall(
        &self,
        state: &mut OverlapSaveState<T>,
        source: &(impl TickSource + ?Sized),
        first: usize,
        progress: &Progress,
    ) {
        let Shape { channels, history, .. } = self.shape;
        if let (true, Some(frames)) = (progress.known < first, source.frames::<T>()) {
            let past = &frames[(first - history) * channels..first * channels];
            state.frames[..past.len()].copy_from_slice(past);
        }
    }

    /// Outputs of the batch before to the ticks of a call of which `first` is the next one of the batch.
    fn pass_on(
        &self,
        state: &OverlapSaveState<T>,
        sink: &mut (impl FastSink + ?Sized),
        first: usize,
        ticks: Range<usize>,
    ) {
        let m = self.shape.ratio;
        if !ticks.is_empty() {
            let place = state.filled + 1 + ticks.start - first;
            sink.store(self.isa, ticks.start * m, &state.output[place * m..][..ticks.len() * m]);
        }
    }

    /// Makes the batch, whose first output belongs to tick `tick` of the call, `behind` ticks before its end. Returns the
    /// tick up to which outputs are in the sink: all of them, if there is room.
    fn complete(
        &self,
        state: &mut OverlapSaveState<T>,
        outside: Option<&[T]>,
        sink: &mut (impl FastSink + ?Sized),
        tick: usize,
        behind: usize,
    ) -> usize {
        let m = self.shape.ratio;
        // Whole lanes are written: somewhat more than the batch, which is still to come.
        let needed = self.shape.batch() + group_lanes::<T>();
        if needed <= behind
            && let Some(slots) = sink.slots(tick * m..(tick + needed) * m)
        {
            self.batch(state, outside, Some(slots));
            return tick + self.shape.batch();
        }
        self.batch(state, outside, None);
        sink.store(self.isa, tick * m, &state.output[..m]);
        tick + 1
    }

    /// The frames of a whole batch with their past as they lie in the caller's memory, if they are all there
    /// and finite.
    fn in_place<'a>(&self, frames: &'a [T], clean: usize, ticks: &Range<usize>) -> Option<&'a [T]> {
        let Shape { channels, history, .. } = self.shape;
        let whole = ticks.len() == self.shape.batch();
        let from = ticks.start.checked_sub(history).filter(|&from| whole && from >= clean)?;
        let x = &frames[from * channels..];
        let len = (history + ticks.len()) * channels;
        // Frames are read as whole groups.
        let fits = len + group_lanes::<T>() <= x.len();
        (fits && all_finite(self.isa, &x[history * channels..len + group_lanes::<T>()])).then_some(x)
    }

    /// The next frames of the batch; returns how many samples were not finite and are 0 now.
    fn gather(
        &self,
        state: &mut OverlapSaveState<T>,
        source: &(impl TickSource + ?Sized),
        first: usize,
        ticks: usize,
    ) -> u64 {
        let n = self.shape.channels;
        let room = &mut state.frames[(self.shape.history + state.filled) * n..][..ticks * n];
        source.gather(self.isa, first, ticks, room);
        if all_finite(self.isa, room) { 0 } else { replace_not_finite(room) }
    }

    /// The outputs of a complete batch, whose frames are `outside` or in the state, to `slots` or the state.
    fn batch(&self, state: &mut OverlapSaveState<T>, outside: Option<&[T]>, slots: Option<&mut [T]>) {
        let OverlapSaveState { frames, output, work, filled } = state;
        let Shape { channels, ratio, history, .. } = self.shape;
        let batch = self.shape.batch();
        let output = slots.unwrap_or(output);
        self.filter(work, outside.unwrap_or(frames), output);
        let wanted = &mut output[..batch * ratio];
        if !all_finite(self.isa, wanted) {
            if let Some(outside) = outside {
                let len = frames.len();
                frames.copy_from_slice(&outside[..len]);
            }
            scale(frames, 1.0 / SCALE);
            self.filter(work, frames, output);
            scale(&mut output[..batch * ratio], SCALE);
            scale(frames, SCALE);
        }
        if outside.is_none() {
            frames.copy_within(batch * channels..(batch + history) * channels, 0);
        }
        *filled = 0;
    }

    /// From frames to the outputs of a batch, and to a group of lanes behind it.
    fn filter(&self, work: &mut Work<T>, frames: &[T], output: &mut [T]) {
        let Shape { channels, ratio, depth, len, .. } = self.shape;
        let plane = len * row_samples::<T>();
        let block = self.shape.block();
        let hop = block * channels;
        for (i, rows) in work.channels.chunks_exact_mut(plane).enumerate() {
            let frames = &frames[i * depth..];
            let segments = Segments { parts: [frames, &frames[hop..]], stride: channels, hop: 2 * hop };
            self.kernel.forward(&self.transform, depth, segments, rows);
        }
        let spectra = Spectra { channels, rows: &self.spectra };
        self.kernel.product(&self.transform, depth, spectra, &work.channels, &mut work.phases);
        for rows in work.phases.chunks_exact_mut(plane) {
            self.kernel.inverse(&self.transform, rows);
        }
        let to = Frames { samples: output, stride: ratio, count: block };
        self.kernel.scatter(&self.transform, depth, &work.phases, to);
    }
}

impl<T: Sample> OverlapSaveState<T> {
    /// As new.
    pub(crate) fn reset(&mut self) {
        self.frames.fill(T::default());
        self.output.fill(T::default());
        self.filled = 0;
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
    let (mut frames, zeros) = (vec![0.0; len * QUAD], vec![0.0; len * QUAD]);
    let mut rows = vec![0.0; len * row_samples::<f64>()];
    for (channel, quad) in (0..channels).flat_map(|i| (0..ratio).step_by(QUAD).map(move |p| (i, p))) {
        let phases = quad..(quad + QUAD).min(ratio);
        for (k, p) in (0..=history).flat_map(|k| phases.clone().map(move |p| (k, p))) {
            let tap = taps[channel].get(p + k * ratio);
            frames[k * QUAD + p - quad] = tap.map_or(0.0, |tap| tap / len as f64);
        }
        let segment = Segments { parts: [&frames, &zeros], stride: QUAD, hop: 0 };
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
