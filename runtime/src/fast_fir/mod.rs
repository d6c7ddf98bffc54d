//! FIR banks: the fast form, in which filters of K / 2 ticks at half the rate do three quarters of the work.
//!
//! With the lags H[j] of a bank (M by N matrices) and the ticks of the stream apart,
//! H0[j] = H[2j], H1[j] = H[2j + 1], u0[n] = x[2n], u1[n] = x[2n + 1], a pair of ticks is (Karatsuba's identity; Mou and
//! Duhamel, *Short-length FIR filters and their use in fast nonrecursive filtering*, 1991)
//!
//! ```text
//! y[2n]     = A[n] + B[n - 1]          A = H0 * u0     B = H1 * u1
//! y[2n + 1] = 4 C[n] - A[n] - B[n]     C = (H0 + H1)/2 * (u0 + u1)/2
//! ```
//!
//! three filters for four. Means stand in place of sums, because they are finite wherever the inputs are. The first tick of
//! a pair does not wait for the second one, so that no output is late; pairs are counted from the beginning of the
//! stream, and A, B and C have the same bits however calls are cut (they are made by the [direct form](super::fir)), so
//! outputs have, too.
//!
//! The sums never mix channels, but they mix lags: the error of an output is about that of the direct form for filters
//! |H0| + |H1| and inputs |u0| + |u1|, so relative to the norms of filters and inputs and not of each product: below 6 eps
//! times the sum over channels of the norm of the phase's filter times that of the inputs in its memory. For white noise
//! through taps of like size it is 1.0 to 1.4 times that of the direct form. With K odd a lag that is not in the filters enters C and A and cancels
//! up to rounding, and so does any lag whose coefficient is 0. Sums that overflow although the output does not are made
//! again from the definition in f64.

#[cfg(test)]
mod tests;

use super::BuildError;
use super::aligned::Aligned;
use super::fir::{FirPlan, check_finite, replace_not_finite};
use super::form::lags;
use super::sample::Sample;
use super::simd::{Halves, Isa, Products, Segment, all_finite, join, split};
use super::ticks::{FastSink, Interleaved, TickSource};
use super::window::Window;

/// Samples of the inputs and products of a block, which should stay in the first-level cache beside the coefficients.
const CACHE_SAMPLES: usize = 6144;
/// Pairs of a block are a multiple of this, and so of most tiles.
const BLOCK_UNIT: usize = 48;
/// Most pairs of a block in these units.
const BLOCK_UNITS: usize = 8;

/// Ticks that windows keep beside those of the filters: the second tick of a pair looks back on them from a
/// window that is already past its first one.
const MORE: usize = 1;
/// Ticks of a pair.
pub(crate) const PERIOD: usize = 2;

/// Coefficients in the order of use; shared by all streams of a bank.
#[derive(Debug)]
pub(crate) struct FastFirPlan<T: Sample> {
    pub(crate) channels: usize,
    pub(crate) ratio: usize,
    /// K.
    lags: usize,
    /// H0, H1 and (H0 + H1) / 2.
    even: FirPlan<T>,
    odd: FirPlan<T>,
    mean: FirPlan<T>,
    /// The filters as they are given, for outputs that overflow.
    taps: Vec<Vec<T>>,
    /// Ticks in a block.
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
    /// 1 after the first tick of a pair.
    lead: usize,
    /// The frame of a first tick whose second one is still to come, and room for that one and for the first again.
    frames: Aligned<T>,
    /// Outputs of a pair.
    outputs: Aligned<T>,
}

/// One filter at half the rate.
#[derive(Debug, Clone)]
struct HalfRate<T: Sample> {
    window: Window<T>,
    /// One tick, then a block.
    products: Aligned<T>,
    /// Those of the last tick.
    last: Vec<T>,
}

/// How the ticks of a block are first and second ones of pairs.
#[derive(Debug, Clone, Copy)]
struct Parity {
    /// 1 if the first tick of the block is the second one of its pair.
    late: usize,
    evens: usize,
    odds: usize,
}

impl Parity {
    fn new(late: usize, ticks: usize) -> Self {
        let odds = (ticks + late) / 2;
        Self { late, evens: ticks - odds, odds }
    }
}

impl<T: Sample> FastFirPlan<T> {
    /// `taps[i]` = f_i at the fast rate, M = `ratio` >= 1, N >= 1 filters of K >= 2 ticks.
    pub(crate) fn new(taps: &[Vec<f64>], ratio: usize, isa: Isa) -> Result<Self, BuildError> {
        check_finite::<T>(taps)?;
        let channels = taps.len();
        let [even, odd] = [0, 1].map(|parity| half(taps, ratio, parity));
        let mean: Vec<_> = even.iter().zip(&odd).map(|(even, odd)| mean(even, odd)).collect();
        let units = CACHE_SAMPLES / (3 * (channels + ratio)) / BLOCK_UNIT;
        Ok(Self {
            channels,
            ratio,
            lags: lags(taps, ratio),
            even: FirPlan::new(&even, ratio, isa)?,
            odd: FirPlan::new(&odd, ratio, isa)?,
            mean: FirPlan::new(&mean, ratio, isa)?,
            taps: taps.iter().map(|f| f.iter().map(|&tap| T::from_f64(tap)).collect()).collect(),
            block: 2 * BLOCK_UNIT * units.clamp(1, BLOCK_UNITS),
            isa,
        })
    }

    /// Ticks after which an input leaves no trace, not even in the rounding: K - 1, and K if that is odd.
    pub(crate) fn memory(&self) -> usize {
        self.lags.next_multiple_of(2) - 1
    }

    /// Multiply-adds for each fast sample, and the additions of means and products as such.
    pub(crate) fn multiply_adds(&self) -> f64 {
        let filters =
            [&self.even, &self.odd, &self.mean].map(FirPlan::multiply_adds).iter().sum::<f64>() / 2.0;
        filters + self.channels as f64 / self.ratio as f64 + 2.0
    }

    /// A stream's state before its first tick.
    pub(crate) fn state(&self) -> FastFirState<T> {
        let (n, m) = (self.channels, self.ratio);
        let [even, odd, mean] =
            [&self.even, &self.odd, &self.mean].map(|plan| HalfRate::new(plan, self.block / 2));
        let (frames, outputs) = (Aligned::new(3 * n), Aligned::new(2 * m));
        FastFirState {
            pairs: Pairs { even, odd, mean, lead: 0, frames, outputs },
            input: Aligned::new(self.block * n),
            output: Aligned::new(self.block * m),
        }
    }

    /// All ticks of `source` to `sink`; returns how many samples were not finite.
    pub(crate) fn process(
        &self,
        state: &mut FastFirState<T>,
        source: &(impl TickSource + ?Sized),
        sink: &mut (impl FastSink + ?Sized),
    ) -> u64 {
        let (m, mut replaced) = (self.ratio, 0);
        let FastFirState { pairs, input, output } = state;
        for first in (0..source.ticks()).step_by(self.block) {
            let ticks = (source.ticks() - first).min(self.block);
            let (frames, count) = self.frames(source, first, ticks, input);
            replaced += count;
            let samples = first * m..(first + ticks) * m;
            match sink.slots(samples) {
                Some(slots) => self.filter(pairs, frames, slots),
                None => {
                    let output = &mut output[..ticks * m];
                    self.filter(pairs, frames, output);
                    sink.store(self.isa, first * m, output);
                }
            }
        }
        replaced
    }

    /// Finite frames, where they lie or in `room`, and how many samples were not.
    fn frames<'a>(
        &self,
        source: &'a (impl TickSource + ?Sized),
        first: usize,
        ticks: usize,
        room: &'a mut [T],
    ) -> (&'a [T], u64) {
        let n = self.channels;
        let outside = source.frames::<T>().map(|frames| &frames[first * n..(first + ticks) * n]);
        if let Some(frames) = outside.filter(|frames| all_finite(self.isa, frames)) {
            return (frames, 0);
        }
        let room = &mut room[..ticks * n];
        source.gather(self.isa, first, ticks, room);
        let replaced = if all_finite(self.isa, room) { 0 } else { replace_not_finite(room) };
        (room, replaced)
    }

    /// A block of finite frames through all filters.
    fn filter(&self, pairs: &mut Pairs<T>, frames: &[T], out: &mut [T]) {
        let ticks = frames.len() / self.channels;
        let parity = Parity::new(pairs.lead, ticks);
        self.split(pairs, parity, frames);
        self.join(pairs, parity, out);
        if !all_finite(self.isa, out) {
            self.repair(pairs, parity, out);
        }
        pairs.even.window.advance(parity.evens);
        pairs.odd.window.advance(parity.odds);
        pairs.mean.window.advance(parity.odds);
        pairs.lead = (pairs.lead + ticks) % PERIOD;
    }

    /// Frames to the windows.
    fn split(&self, pairs: &mut Pairs<T>, parity: Parity, frames: &[T]) {
        let n = self.channels;
        let (late, whole) = (parity.late * n, parity.odds - parity.late);
        let (second, frames) = frames.split_at(late);
        let (whole, first) = frames.split_at(2 * whole * n);
        let even = pairs.even.window.room(parity.evens);
        let odd = pairs.odd.window.room(parity.odds);
        let mean = pairs.mean.window.room(parity.odds);
        if !second.is_empty() {
            let (pair, again) = pairs.frames.split_at_mut(2 * n);
            pair[n..].copy_from_slice(second);
            split(self.isa, pair, n, Halves { even: again, odd, mean });
        }
        let halves = Halves { even, odd: &mut odd[late..], mean: &mut mean[late..] };
        split(self.isa, whole, n, halves);
        if !first.is_empty() {
            even[whole.len() / 2..].copy_from_slice(first);
            pairs.frames[..n].copy_from_slice(first);
        }
    }

    /// Products of the frames in the windows to outputs.
    fn join(&self, pairs: &mut Pairs<T>, parity: Parity, out: &mut [T]) {
        let m = self.ratio;
        let late = parity.late * m;
        let Pairs { even, odd, mean, outputs, .. } = pairs;
        let a = even.filter(&self.even, parity.evens);
        let b = odd.filter(&self.odd, parity.odds);
        let c = &mut mean.filter(&self.mean, parity.odds)[m..];
        let (second, out) = out.split_at_mut(late);
        if !second.is_empty() {
            join(self.isa, Products { even: &mut a[..m], odd: b, mean: c }, m, outputs);
            second.copy_from_slice(&outputs[m..]);
        }
        let products = Products { even: &mut a[m..], odd: &b[late..], mean: &mut c[late..] };
        join(self.isa, products, m, out);
        let whole = out.len() / (2 * m) * m;
        let first = a[m + whole..].iter().zip(&b[late + whole..]);
        for (slot, (&a, &b)) in out[2 * whole..].iter_mut().zip(first) {
            *slot = a + b;
        }
    }

    /// Outputs that are not finite, anew.
    #[cold]
    fn repair(&self, pairs: &Pairs<T>, parity: Parity, out: &mut [T]) {
        for (tick, out) in (parity.late..).zip(out.chunks_exact_mut(self.ratio)) {
            for (phase, slot) in out.iter_mut().enumerate().filter(|(_, slot)| !slot.finite()) {
                *slot = T::from_f64(self.definition(pairs, parity, tick, phase));
            }
        }
    }

    /// An output by the definition; ticks are counted from the first one of the block's first pair.
    fn definition(&self, pairs: &Pairs<T>, parity: Parity, tick: usize, phase: usize) -> f64 {
        let input = |lag: usize, i: usize| pairs.input(parity, tick as isize - lag as isize, i).to_f64();
        let filter = |(i, f): (usize, &Vec<T>)| {
            let taps = f.iter().skip(phase).step_by(self.ratio).enumerate();
            taps.map(|(lag, tap)| tap.to_f64() * input(lag, i)).sum::<f64>()
        };
        self.taps.iter().enumerate().map(filter).sum()
    }

    /// Ticks that a state must know: the past of all windows, and a pair for products that are remembered.
    pub(crate) fn reach(&self) -> usize {
        let past = [&self.even, &self.odd, &self.mean].map(FirPlan::reach).into_iter().max();
        2 * past.unwrap_or(0) + (MORE + 1) * PERIOD
    }

    /// A state before tick `first` of `source`, as if all ticks before it had been processed: at least
    /// [`FastFirPlan::reach`] of them, and a pair begins there.
    pub(crate) fn state_at(&self, source: &(impl TickSource + ?Sized), first: usize) -> FastFirState<T> {
        let (n, ticks) = (self.channels, self.reach());
        let mut frames = vec![T::default(); ticks * n];
        source.gather(self.isa, first - ticks, ticks, &mut frames);
        // They are counted where they are processed.
        replace_not_finite(&mut frames);
        let (past, last) = frames.split_at((ticks - PERIOD) * n);
        let mut state = self.state();
        self.recall(&mut state.pairs, past);
        let mut out = vec![T::default(); PERIOD * self.ratio];
        if let Some(last) = Interleaved::new(last, n) {
            self.process(&mut state, &last, &mut out[..]);
        }
        state
    }

    /// The past of all filters, up to the end of a pair.
    fn recall(&self, pairs: &mut Pairs<T>, frames: &[T]) {
        let [mut even, mut odd, mut mean] = [(); 3].map(|()| vec![T::default(); frames.len() / 2]);
        let halves = Halves { even: &mut even, odd: &mut odd, mean: &mut mean };
        split(self.isa, frames, self.channels, halves);
        pairs.even.window.recall(&even);
        pairs.odd.window.recall(&odd);
        pairs.mean.window.recall(&mean);
    }
}

impl<T: Sample> FastFirState<T> {
    /// Ticks of an unfinished pair.
    pub(crate) fn lead(&self) -> usize {
        self.pairs.lead
    }

    /// As new.
    pub(crate) fn reset(&mut self) {
        let Pairs { even, odd, mean, lead, .. } = &mut self.pairs;
        [even, odd, mean].into_iter().for_each(HalfRate::reset);
        *lead = 0;
    }
}

impl<T: Sample> Pairs<T> {
    /// The sample of a channel at a tick of the block or before, counted from the first one of the first pair.
    fn input(&self, parity: Parity, tick: isize, channel: usize) -> T {
        let pair = tick.div_euclid(2);
        let (half, frame) = match tick.rem_euclid(2) {
            // The window had it before the block if the block begins after it.
            0 => (&self.even, pair - parity.late as isize),
            _ => (&self.odd, pair),
        };
        let n = (self.frames.len() / 3) as isize;
        let at = half.window.known() as isize + frame * n;
        half.window.view()[at as usize + channel]
    }
}

impl<T: Sample> HalfRate<T> {
    /// For blocks of at most `ticks` ticks.
    fn new(plan: &FirPlan<T>, ticks: usize) -> Self {
        Self {
            window: plan.window(ticks, MORE),
            products: Aligned::new((1 + ticks) * plan.ratio),
            last: vec![T::default(); plan.ratio],
        }
    }

    /// Products of the tick before and of the next `ticks` ones, whose frames are in the window's room.
    fn filter(&mut self, plan: &FirPlan<T>, ticks: usize) -> &mut [T] {
        let m = plan.ratio;
        let products = &mut self.products[..(1 + ticks) * m];
        if ticks > 0 {
            // Whether they are finite is asked of the outputs.
            let x = &self.window.view()[MORE * plan.channels..];
            plan.run(&[Segment { x, first: 0, frames: ticks }], &mut products[m..]);
        }
        products[..m].copy_from_slice(&self.last);
        self.last.copy_from_slice(&products[ticks * m..]);
        products
    }

    fn reset(&mut self) {
        self.window.reset();
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
