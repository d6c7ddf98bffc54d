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

use super::BuildError;
use super::aligned::Aligned;
use super::fir::{check_finite, replace_not_finite};
use super::sample::Sample;
use super::simd::{Isa, Segments, Spectra, Transform, TransformKernel, group_lanes, row_samples};
use super::ticks::{FastSink, TickSource};

/// Samples of all spectra: more would take gigabytes.
const MOST_SPECTRA: usize = 1 << 28;

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

    /// Samples of all spectra, `None` if they are too many to count.
    fn spectra_samples<T>(&self) -> Option<usize> {
        let rows = (self.len / 2 + 1).checked_mul(self.outputs())?.checked_mul(self.channels)?;
        rows.checked_mul(row_samples::<T>())
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
    /// Work memory: rows of channels, rows of phases.
    channel_rows: Aligned<T>,
    phase_rows: Aligned<T>,
}

impl<T: Sample> OverlapSavePlan<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters, in transforms of length F = `len`, a power
    /// of two from 16 on that is longer than the filters' memory.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, len: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let history = super::form::lags(taps, ratio) - 1;
        let shape = Shape::new(taps.len(), ratio, history, len, group_lanes::<T>());
        shape
            .spectra_samples::<T>()
            .filter(|&samples| samples <= MOST_SPECTRA)
            .ok_or(BuildError::TooLong { history, channels: taps.len() })?;
        Ok(Self {
            shape,
            transform: Transform::new(len, T::from_f64),
            spectra: spectra(taps, &shape, isa),
            kernel: T::transform_kernel(isa),
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
            channel_rows: Aligned::new(shape.inputs() * plane),
            phase_rows: Aligned::new(shape.outputs() * plane),
        }
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut OverlapSaveState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let (m, batch) = (self.shape.ratio, self.shape.batch());
        let (mut replaced, mut first) = (0, 0);
        while first < source.ticks() {
            let ticks = (source.ticks() - first).min(batch - state.filled);
            replaced += self.gather(state, source, first, ticks);
            let complete = state.filled + ticks == batch;
            // The last tick of a batch already takes the first output of it, the others take the next ones.
            let late = ticks - usize::from(complete);
            sink.store(self.isa, first * m, &state.output[(state.filled + 1) * m..][..late * m]);
            state.filled += ticks;
            if complete {
                self.batch(state);
                sink.store(self.isa, (first + late) * m, &state.output[..m]);
            }
            first += ticks;
        }
        replaced
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
        if T::all_finite(self.isa, room) { 0 } else { replace_not_finite(room) }
    }

    /// The outputs of a complete batch; its end becomes the past.
    fn batch(&self, state: &mut OverlapSaveState<T>) {
        let Shape { channels, history, .. } = self.shape;
        self.filter(state);
        if !T::all_finite(self.isa, &state.output) {
            scale(&mut state.frames, 1.0 / SCALE);
            self.filter(state);
            scale(&mut state.output, SCALE);
            scale(&mut state.frames, SCALE);
        }
        let batch = self.shape.batch();
        state.frames.copy_within(batch * channels..(batch + history) * channels, 0);
        state.filled = 0;
    }

    fn filter(&self, state: &mut OverlapSaveState<T>) {
        let Shape { channels, depth, len, .. } = self.shape;
        let plane = len * row_samples::<T>();
        let hop = self.shape.block() * channels;
        for (i, rows) in state.channel_rows.chunks_exact_mut(plane).enumerate() {
            let frames = &state.frames[i * depth..];
            let segments = Segments { parts: [frames, &frames[hop..]], stride: channels, hop: 2 * hop };
            self.kernel.forward(&self.transform, depth, segments, rows);
        }
        let spectra = Spectra { channels, rows: &self.spectra };
        self.kernel.product(&self.transform, depth, spectra, &state.channel_rows, &mut state.phase_rows);
        for rows in state.phase_rows.chunks_exact_mut(plane) {
            self.kernel.inverse(&self.transform, rows);
        }
        match depth {
            1 => self.scatter::<1>(state),
            2 => self.scatter::<2>(state),
            4 => self.scatter::<4>(state),
            _ => self.scatter::<8>(state),
        }
    }

    /// The last B rows of each block to the batch's outputs, tick by tick: the lanes that mean nothing are overwritten by
    /// what comes behind them.
    fn scatter<const D: usize>(&self, state: &mut OverlapSaveState<T>) {
        let Shape { ratio, history, segments, len, .. } = self.shape;
        let (row, group) = (row_samples::<T>(), group_lanes::<T>());
        let mut tick = 0;
        for lane in (0..segments).flat_map(|s| [s * D, group + s * D]) {
            for t in history..len {
                for (o, rows) in state.phase_rows.chunks_exact(len * row).enumerate() {
                    let lanes = &rows[t * row + lane..][..D];
                    state.output[tick * ratio + o * D..][..D].copy_from_slice(lanes);
                }
                tick += 1;
            }
        }
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
    let kernel = f64::transform_kernel(isa);
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
