//! The two-parallel fast FIR algorithm: filters of K / 2 taps per phase at half the rate do three quarters
//! of the work.
//!
//! With the lags H[j] of a bank (M by N matrices) and the frames of the stream apart, H0[j] = H[2j],
//! H1[j] = H[2j + 1], u0[n] = x[2n], u1[n] = x[2n + 1], a pair of frames is (Karatsuba's identity; Mou and
//! Duhamel, *Short-length FIR filters and their use in fast nonrecursive filtering*, 1991)
//!
//! ```text
//! y[2n]     = A[n] + B[n - 1]          A = H0 * u0     B = H1 * u1
//! y[2n + 1] = 4 C[n] - A[n] - B[n]     C = (H0 + H1)/2 * (u0 + u1)/2
//! ```
//!
//! three filters for four. Means stand in place of sums, because they are finite wherever the inputs are.
//! The first frame of a pair does not wait for the second one, so that no output is late; pairs are counted
//! from the beginning of the stream, and A, B and C have the same bits however calls are cut (they are made
//! by the [direct algorithm](super::direct)), so outputs have, too.
//!
//! The sums never mix channels, but they mix lags: the error of an output is about that of the direct
//! algorithm for filters |H0| + |H1| and inputs |u0| + |u1|, so relative to the norms of filters and inputs
//! and not of each product: below 6 eps times the sum over channels of the norm of the phase's filter times
//! that of the inputs in its history. For white noise through taps of like size it is 1.0 to 1.4 times that
//! of the direct algorithm. With K odd a lag that is not in the filters enters C and A and cancels up to
//! rounding, and so does any lag whose coefficient is 0.
//!
//! The worst case of a call: inputs are checked and NaN and infinity replaced before filtering, so no frame
//! is filtered twice. Outputs whose sums overflow are computed once more from the definition in f64, N K
//! multiply-adds each.

#[cfg(test)]
mod tests;

use super::direct::Direct;
use super::filter::{Facts, Filter, RecentInput, check_finite, phase_taps, replace_not_finite};
use crate::adapters::{Input, Output};
use crate::aligned::Aligned;
use crate::history::History;
use crate::simd::{Halves, Products, Segment, all_finite, join, split};
use crate::{BuildError, Isa, Sample};

/// Samples of the inputs and products of a block, which should stay in the first-level cache beside the
/// coefficients.
const CACHE_SAMPLES: usize = 6144;
/// Pairs of a block are a multiple of this, and so of most tiles.
const BLOCK_UNIT: usize = 48;
/// Most pairs of a block in these units.
const BLOCK_UNITS: usize = 8;

/// Frames that histories keep beside those of the filters: the second frame of a pair looks back on them
/// from a history that is already past its first one.
const MORE: usize = 1;
/// Frames of a pair.
const PAIR: usize = 2;

/// Coefficients in the order of use.
#[derive(Debug)]
pub(crate) struct FastFir<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K.
    phase_taps: usize,
    /// H0, H1 and (H0 + H1) / 2.
    even: Direct<T>,
    odd: Direct<T>,
    mean: Direct<T>,
    /// The filters as they are given, for outputs that overflow.
    taps: Vec<Vec<T>>,
    /// Frames in a block.
    block: usize,
    isa: Isa,
}

/// What a stream remembers.
#[derive(Debug, Clone)]
pub(crate) struct FastFirState<T: Sample> {
    pairs: Pairs<T>,
    /// One block of input, for those who give another type, and of output, for those who take another type.
    input: Aligned<T>,
    output: Aligned<T>,
}

/// The three filters at work.
#[derive(Debug, Clone)]
struct Pairs<T: Sample> {
    even: HalfRate<T>,
    odd: HalfRate<T>,
    mean: HalfRate<T>,
    /// 1 after the first frame of a pair.
    phase_offset: usize,
    /// The first frame of a pair whose second one is still to come, and room for that one and for the first
    /// again.
    samples: Aligned<T>,
    /// Outputs of a pair.
    outputs: Aligned<T>,
}

/// One filter at half the rate.
#[derive(Debug, Clone)]
struct HalfRate<T: Sample> {
    history: History<T>,
    /// One frame, then a block.
    products: Aligned<T>,
    /// The products of the last frame.
    last: Vec<T>,
}

/// How the frames of a block are first and second ones of pairs.
#[derive(Debug, Clone, Copy)]
struct Parity {
    /// 1 if the block begins with the second frame of a pair, else 0.
    begins_odd: usize,
    /// First frames of pairs.
    evens: usize,
    /// Second frames of pairs.
    odds: usize,
}

impl Parity {
    fn new(begins_odd: usize, frames: usize) -> Self {
        let odds = (frames + begins_odd) / 2;
        Self { begins_odd, evens: frames - odds, odds }
    }
}

impl<T: Sample> FastFir<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters of K >= 2 frames.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let channels = taps.len();
        let [even, odd] = [0, 1].map(|parity| half(taps, ratio, parity));
        let mean: Vec<_> = even.iter().zip(&odd).map(|(even, odd)| mean(even, odd)).collect();
        let units = CACHE_SAMPLES / (3 * (channels + ratio)) / BLOCK_UNIT;
        Ok(Self {
            channels,
            ratio,
            phase_taps: phase_taps(taps, ratio),
            even: Direct::new(&even, ratio, isa)?,
            odd: Direct::new(&odd, ratio, isa)?,
            mean: Direct::new(&mean, ratio, isa)?,
            taps: taps.iter().map(|f| f.iter().map(|&tap| T::from_f64(tap)).collect()).collect(),
            block: 2 * BLOCK_UNIT * units.clamp(1, BLOCK_UNITS),
            isa,
        })
    }

    /// Frames after which an input leaves no trace, not even in the rounding: K - 1, and K if that is odd.
    fn history(&self) -> usize {
        self.phase_taps.next_multiple_of(2) - 1
    }

    /// Multiply-adds for each output sample, and the additions of means and products as such.
    fn multiply_adds(&self) -> f64 {
        let filters =
            [&self.even, &self.odd, &self.mean].map(Direct::multiply_adds).iter().sum::<f64>() / 2.0;
        filters + self.channels as f64 / self.ratio as f64 + 2.0
    }

    /// Finite frames, where they lie or in `room`, and how many samples were not.
    fn finite_samples<'a>(
        &self,
        input: &'a (impl Input + ?Sized),
        first: usize,
        frames: usize,
        room: &'a mut [T],
    ) -> (&'a [T], u64) {
        let n = self.channels;
        let outside = input.in_memory::<T>().map(|samples| &samples[first * n..(first + frames) * n]);
        if let Some(samples) = outside.filter(|samples| all_finite(self.isa, samples)) {
            return (samples, 0);
        }
        let room = &mut room[..frames * n];
        input.load(self.isa, first, room);
        let replaced = if all_finite(self.isa, room) { 0 } else { replace_not_finite(room) };
        (room, replaced)
    }

    /// A block of finite frames through all filters.
    fn filter(&self, pairs: &mut Pairs<T>, samples: &[T], out: &mut [T]) {
        let frames = samples.len() / self.channels;
        let parity = Parity::new(pairs.phase_offset, frames);
        self.split(pairs, parity, samples);
        self.join(pairs, parity, out);
        if !all_finite(self.isa, out) {
            self.repair(pairs, parity, out);
        }
        pairs.even.history.advance(parity.evens);
        pairs.odd.history.advance(parity.odds);
        pairs.mean.history.advance(parity.odds);
        pairs.phase_offset = (pairs.phase_offset + frames) % PAIR;
    }

    /// Frames to the histories.
    fn split(&self, pairs: &mut Pairs<T>, parity: Parity, samples: &[T]) {
        let n = self.channels;
        let (head, whole) = (parity.begins_odd * n, parity.odds - parity.begins_odd);
        let (second, samples) = samples.split_at(head);
        let (whole, first) = samples.split_at(2 * whole * n);
        let even = pairs.even.history.room(parity.evens);
        let odd = pairs.odd.history.room(parity.odds);
        let mean = pairs.mean.history.room(parity.odds);
        if !second.is_empty() {
            let (pair, again) = pairs.samples.split_at_mut(2 * n);
            pair[n..].copy_from_slice(second);
            split(self.isa, pair, n, Halves { even: again, odd, mean });
        }
        let halves = Halves { even, odd: &mut odd[head..], mean: &mut mean[head..] };
        split(self.isa, whole, n, halves);
        if !first.is_empty() {
            even[whole.len() / 2..].copy_from_slice(first);
            pairs.samples[..n].copy_from_slice(first);
        }
    }

    /// Products of the frames in the histories to outputs.
    fn join(&self, pairs: &mut Pairs<T>, parity: Parity, out: &mut [T]) {
        let m = self.ratio;
        let head = parity.begins_odd * m;
        let Pairs { even, odd, mean, outputs, .. } = pairs;
        let a = even.filter(&self.even, parity.evens);
        let b = odd.filter(&self.odd, parity.odds);
        let c = &mut mean.filter(&self.mean, parity.odds)[m..];
        let (second, out) = out.split_at_mut(head);
        if !second.is_empty() {
            join(self.isa, Products { even: &mut a[..m], odd: b, mean: c }, m, outputs);
            second.copy_from_slice(&outputs[m..]);
        }
        let products = Products { even: &mut a[m..], odd: &b[head..], mean: &mut c[head..] };
        join(self.isa, products, m, out);
        let whole = out.len() / (2 * m) * m;
        let first = a[m + whole..].iter().zip(&b[head + whole..]);
        for (slot, (&a, &b)) in out[2 * whole..].iter_mut().zip(first) {
            *slot = a + b;
        }
    }

    /// Computes outputs that are not finite once more.
    #[cold]
    fn repair(&self, pairs: &Pairs<T>, parity: Parity, out: &mut [T]) {
        for (frame, out) in (parity.begins_odd..).zip(out.chunks_exact_mut(self.ratio)) {
            for (phase, slot) in out.iter_mut().enumerate().filter(|(_, slot)| !slot.finite()) {
                *slot = T::from_f64(self.definition(pairs, parity, frame, phase));
            }
        }
    }

    /// An output by the definition; frames are counted from the first one of the block's first pair.
    fn definition(&self, pairs: &Pairs<T>, parity: Parity, frame: usize, phase: usize) -> f64 {
        let input = |lag: usize, i: usize| pairs.input(parity, frame as isize - lag as isize, i).to_f64();
        let filter = |(i, f): (usize, &Vec<T>)| {
            let taps = f.iter().skip(phase).step_by(self.ratio).enumerate();
            taps.map(|(lag, tap)| tap.to_f64() * input(lag, i)).sum::<f64>()
        };
        #[cfg(test)]
        crate::simd::work::add(self.channels * self.phase_taps);
        self.taps.iter().enumerate().map(filter).sum()
    }

    /// Frames that a state must know: all histories, and a pair for products that are remembered.
    #[cfg(feature = "rayon")]
    fn history_frames(&self) -> usize {
        let longest = [&self.even, &self.odd, &self.mean].map(Direct::history_frames).into_iter().max();
        PAIR * (longest.unwrap_or(0) + MORE + 1)
    }

    /// Histories before the last whole pair, of which `offset` frames of the next pair have come since.
    fn load_histories(&self, pairs: &mut Pairs<T>, recent: &dyn RecentInput, offset: usize) {
        let first = |pair: usize, i: usize| recent.sample(offset + PAIR + PAIR * pair, i);
        let second = |pair: usize, i: usize| recent.sample(offset + PAIR * pair + 1, i);
        pairs.even.history.fill(|pair, i| T::from_f64(first(pair, i)));
        pairs.odd.history.fill(|pair, i| T::from_f64(second(pair, i)));
        let rounded = |value: f64| T::from_f64(value).to_f64();
        let mean = |pair, i| T::from_f64(0.5 * rounded(first(pair, i)) + 0.5 * rounded(second(pair, i)));
        pairs.mean.history.fill(mean);
    }
}

impl<T: Sample> Filter for FastFir<T> {
    type State = FastFirState<T>;

    fn facts(&self) -> Facts {
        Facts {
            name: "fast-fir",
            history: Some(self.history()),
            delay: 0,
            alignment: PAIR,
            transform: None,
            multiply_adds: Some(self.multiply_adds()),
        }
    }

    fn state(&self) -> FastFirState<T> {
        let (n, m) = (self.channels, self.ratio);
        let [even, odd, mean] =
            [&self.even, &self.odd, &self.mean].map(|filter| HalfRate::new(filter, self.block / 2));
        let (samples, outputs) = (Aligned::new(3 * n), Aligned::new(2 * m));
        FastFirState {
            pairs: Pairs { even, odd, mean, phase_offset: 0, samples, outputs },
            input: Aligned::new(self.block * n),
            output: Aligned::new(self.block * m),
        }
    }

    fn reset(state: &mut FastFirState<T>) {
        let Pairs { even, odd, mean, phase_offset, .. } = &mut state.pairs;
        [even, odd, mean].into_iter().for_each(HalfRate::reset);
        *phase_offset = 0;
    }

    fn process(
        &self,
        state: &mut FastFirState<T>,
        input: &(impl Input + ?Sized),
        output: &mut (impl Output + ?Sized),
    ) -> u64 {
        let (m, mut replaced) = (self.ratio, 0);
        let FastFirState { pairs, input: room, output: block } = state;
        for first in (0..input.frames()).step_by(self.block) {
            let frames = (input.frames() - first).min(self.block);
            let (samples, count) = self.finite_samples(input, first, frames, room);
            replaced += count;
            match output.slots(first * m..(first + frames) * m) {
                Some(slots) => self.filter(pairs, samples, slots),
                None => {
                    let block = &mut block[..frames * m];
                    self.filter(pairs, samples, block);
                    output.store(self.isa, first * m, block);
                }
            }
        }
        replaced
    }

    #[cfg(feature = "rayon")]
    fn process_parallel(
        &self,
        state: &mut FastFirState<T>,
        input: &(impl Input + Sync + ?Sized),
        output: &mut (impl crate::adapters::SplitOutput + ?Sized),
        pool: &crate::ThreadPool,
    ) -> u64 {
        crate::parallel::process(self, state, input, output, pool)
    }

    fn recent_input(state: &FastFirState<T>) -> Option<&dyn RecentInput> {
        Some(&state.pairs)
    }

    /// The last whole pair is filtered again, for the products that the next one needs.
    fn load(&self, state: &mut FastFirState<T>, recent: &dyn RecentInput, position: u64) -> bool {
        let offset = (position % PAIR as u64) as usize;
        let FastFirState { pairs, input, output } = state;
        self.load_histories(pairs, recent, offset);
        pairs.phase_offset = 0;
        let frames = PAIR + offset;
        let samples = &mut input[..frames * self.channels];
        for (frame, slots) in samples.chunks_exact_mut(self.channels).enumerate() {
            let age = frames - frame;
            slots.iter_mut().enumerate().for_each(|(i, slot)| *slot = T::from_f64(recent.sample(age, i)));
        }
        self.filter(pairs, samples, &mut output[..frames * self.ratio]);
        true
    }
}

#[cfg(feature = "rayon")]
impl<T: Sample> crate::parallel::Chunked for FastFir<T> {
    const ALIGNMENT: usize = PAIR;

    fn frame_multiply_adds(&self) -> usize {
        (self.multiply_adds() * self.ratio as f64) as usize
    }

    fn ratio(&self) -> usize {
        self.ratio
    }

    fn history_frames(&self) -> usize {
        self.history_frames()
    }

    fn phase_offset(state: &FastFirState<T>) -> usize {
        state.pairs.phase_offset
    }

    fn state_at(&self, input: &(impl Input + ?Sized), first: usize) -> FastFirState<T> {
        let mut samples = vec![T::default(); self.history_frames() * self.channels];
        input.load(self.isa, first - self.history_frames(), &mut samples);
        // They are counted where they are processed.
        replace_not_finite(&mut samples);
        let mut state = self.state();
        // A pair begins at `first`, wherever the stream is.
        self.load(&mut state, &Frames { samples: &samples, channels: self.channels }, 0);
        state
    }
}

/// Frames in memory, the last one just before the next.
#[cfg(feature = "rayon")]
struct Frames<'a, T> {
    samples: &'a [T],
    channels: usize,
}

#[cfg(feature = "rayon")]
impl<T: Sample> RecentInput for Frames<'_, T> {
    fn sample(&self, age: usize, channel: usize) -> f64 {
        let place = self.samples.len().checked_sub(age * self.channels);
        place.map_or(0.0, |place| self.samples[place + channel].to_f64())
    }
}

impl<T: Sample> RecentInput for Pairs<T> {
    fn sample(&self, age: usize, channel: usize) -> f64 {
        // Frames since the end of the last whole pair; the first frame of the next one is among the even
        // ones already.
        let back = age - self.phase_offset;
        let half = if back.is_multiple_of(2) {
            self.even.history.sample(self.phase_offset + back / 2, channel)
        } else {
            self.odd.history.sample(back.div_ceil(2), channel)
        };
        half.to_f64()
    }
}

impl<T: Sample> Pairs<T> {
    /// The sample of a channel at a frame of the block or before, counted from the first one of the first
    /// pair.
    fn input(&self, parity: Parity, frame: isize, channel: usize) -> T {
        let pair = frame.div_euclid(2);
        let (half, frame) = match frame.rem_euclid(2) {
            // The history had it before the block if the block begins after it.
            0 => (&self.even, pair - parity.begins_odd as isize),
            _ => (&self.odd, pair),
        };
        let n = (self.samples.len() / 3) as isize;
        let at = half.history.len() as isize + frame * n;
        half.history.view()[at as usize + channel]
    }
}

impl<T: Sample> HalfRate<T> {
    /// For blocks of at most `frames` frames.
    fn new(filter: &Direct<T>, frames: usize) -> Self {
        Self {
            history: filter.history(frames, MORE),
            products: Aligned::new((1 + frames) * filter.ratio),
            last: vec![T::default(); filter.ratio],
        }
    }

    /// Products of the frame before and of the next `frames` ones, whose frames are in the history's room.
    fn filter(&mut self, filter: &Direct<T>, frames: usize) -> &mut [T] {
        let m = filter.ratio;
        let products = &mut self.products[..(1 + frames) * m];
        if frames > 0 {
            // Whether they are finite is asked of the outputs.
            let x = &self.history.view()[MORE * filter.channels..];
            filter.run(&[Segment { x, first: 0, frames }], &mut products[m..]);
        }
        products[..m].copy_from_slice(&self.last);
        self.last.copy_from_slice(&products[frames * m..]);
        products
    }

    fn reset(&mut self) {
        self.history.reset();
        self.last.fill(T::default());
    }
}

/// The lags of one parity, one after another.
fn half(taps: &[Vec<f64>], ratio: usize, parity: usize) -> Vec<Vec<f64>> {
    let lags = |f: &Vec<f64>| f.chunks(ratio).skip(parity).step_by(2).flatten().copied().collect();
    taps.iter().map(lags).collect()
}

/// (H0 + H1) / 2 of a channel.
fn mean(even: &[f64], odd: &[f64]) -> Vec<f64> {
    let tap = |f: &[f64], t: usize| f.get(t).copied().unwrap_or(0.0);
    (0..even.len().max(odd.len())).map(|t| 0.5 * tap(even, t) + 0.5 * tap(odd, t)).collect()
}
