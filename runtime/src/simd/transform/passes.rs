//! The passes of the transform and of its inverse over rows.

use super::super::channels::ChannelVector;
use super::complex::Complex;
use super::{group_lanes, row_samples};

/// From frames to rows.
pub(super) struct ForwardJob<T> {
    pub(super) parts: [*const T; 2],
    pub(super) stride: usize,
    pub(super) hop: usize,
    pub(super) len: usize,
    pub(super) factors: *const T,
    pub(super) rows: *mut T,
}

/// In place.
pub(super) struct InverseJob<T> {
    pub(super) len: usize,
    /// Behind the last one.
    pub(super) factors: *const T,
    pub(super) rows: *mut T,
}

/// The transform of length 4, or four times its inverse.
#[inline(always)]
unsafe fn quarter<V: ChannelVector, const BACK: bool>([a, b, c, d]: [Complex<V>; 4]) -> [Complex<V>; 4] {
    unsafe {
        let (even, odd) = (a.add(c), b.add(d));
        let (even_far, odd_far) = (a.sub(c), b.sub(d));
        let (minus, plus) = (even_far.sub_turned(odd_far), even_far.add_turned(odd_far));
        let (first, third) = if BACK { (plus, minus) } else { (minus, plus) };
        [even.add(odd), first, even.sub(odd), third]
    }
}

/// Where a pass takes its rows from. No closure: what is not inlined is not compiled for the instruction set.
///
/// # Safety
/// As for [`Vector`](super::super::vector::Vector), and the rows exist.
trait Rows<V: ChannelVector> {
    unsafe fn row(&self, row: usize) -> Complex<V>;

    /// Four rows, `quarter` apart.
    #[inline(always)]
    unsafe fn four(&self, first: usize, quarter: usize) -> [Complex<V>; 4] {
        unsafe {
            [
                self.row(first),
                self.row(first + quarter),
                self.row(first + 2 * quarter),
                self.row(first + 3 * quarter),
            ]
        }
    }
}

/// Frames where they lie, D lanes of each segment, from lane `part` on.
struct Gathered<'a, V: ChannelVector, const D: usize> {
    job: &'a ForwardJob<V::Sample>,
    part: usize,
}

impl<V: ChannelVector, const D: usize> Rows<V> for Gathered<'_, V, D> {
    #[inline(always)]
    unsafe fn row(&self, row: usize) -> Complex<V> {
        let ForwardJob { parts: [re, im], stride, hop, .. } = *self.job;
        unsafe {
            Complex {
                re: V::gather::<D>(re.add(row * stride), hop, self.part),
                im: V::gather::<D>(im.add(row * stride), hop, self.part),
            }
        }
    }
}

/// Some lanes of all rows.
#[derive(Clone, Copy)]
struct Work<V: ChannelVector> {
    rows: *mut V::Sample,
    len: usize,
}

impl<V: ChannelVector> Rows<V> for Work<V> {
    #[inline(always)]
    unsafe fn row(&self, row: usize) -> Complex<V> {
        unsafe { Complex::load(self.at(row)) }
    }
}

/// # Safety
/// As for [`Rows`].
impl<V: ChannelVector> Work<V> {
    #[inline(always)]
    unsafe fn at(&self, row: usize) -> *mut V::Sample {
        unsafe { self.rows.add(row * row_samples::<V::Sample>()) }
    }

    #[inline(always)]
    unsafe fn store(&self, first: usize, quarter: usize, [a, b, c, d]: [Complex<V>; 4]) {
        unsafe {
            a.store(self.at(first));
            b.store(self.at(first + quarter));
            c.store(self.at(first + 2 * quarter));
            d.store(self.at(first + 3 * quarter));
        }
    }

    /// The factors of place j >= 1 of a pass.
    #[inline(always)]
    unsafe fn turns(factors: *const V::Sample, j: usize) -> [Complex<V>; 3] {
        unsafe {
            let at = factors.add(6 * (j - 1));
            [Complex::splat(at), Complex::splat(at.add(2)), Complex::splat(at.add(4))]
        }
    }

    /// One pass over `base .. base + span`.
    #[inline(always)]
    unsafe fn forward_pass(&self, from: &impl Rows<V>, base: usize, span: usize, factors: *const V::Sample) {
        let next = span / 4;
        unsafe {
            self.store(base, next, quarter::<V, false>(from.four(base, next)));
            for j in 1..next {
                let [w1, w2, w3] = Self::turns(factors, j);
                let [a, b, c, d] = quarter::<V, false>(from.four(base + j, next));
                self.store(base + j, next, [a, b.mul(w1), c.mul(w2), d.mul(w3)]);
            }
        }
    }

    #[inline(always)]
    unsafe fn inverse_pass(&self, base: usize, span: usize, factors: *const V::Sample) {
        let next = span / 4;
        unsafe {
            self.store(base, next, quarter::<V, true>(self.four(base, next)));
            for j in 1..next {
                let [w1, w2, w3] = Self::turns(factors, j);
                let [a, b, c, d] = self.four(base + j, next);
                let turned = [a, b.mul_conjugate(w1), c.mul_conjugate(w2), d.mul_conjugate(w3)];
                self.store(base + j, next, quarter::<V, true>(turned));
            }
        }
    }

    /// The pass over spans of 4 rows, or of 2.
    #[inline(always)]
    unsafe fn short_spans<const BACK: bool>(&self, span: usize) {
        for base in (0..self.len).step_by(4) {
            unsafe {
                let [a, b, c, d] = self.four(base, 1);
                let done = if span == 4 {
                    quarter::<V, BACK>([a, b, c, d])
                } else {
                    [a.add(b), a.sub(b), c.add(d), c.sub(d)]
                };
                self.store(base, 1, done);
            }
        }
    }

    #[inline(always)]
    unsafe fn forward(&self, from: &impl Rows<V>, mut factors: *const V::Sample) {
        unsafe {
            self.forward_pass(from, 0, self.len, factors);
            let mut span = self.len / 4;
            while span > 4 {
                // Those of the pass before, whose spans were four times as long.
                factors = factors.add(6 * (span - 1));
                for base in (0..self.len).step_by(span) {
                    self.forward_pass(self, base, span, factors);
                }
                span /= 4;
            }
            self.short_spans::<false>(span);
        }
    }

    #[inline(always)]
    unsafe fn inverse(&self, mut factors: *const V::Sample) {
        unsafe {
            let mut span = if self.len.ilog2().is_multiple_of(2) { 4 } else { 2 };
            self.short_spans::<true>(span);
            while span < self.len {
                (factors, span) = (factors.sub(6 * (span - 1)), 4 * span);
                for base in (0..self.len).step_by(span) {
                    self.inverse_pass(base, span, factors);
                }
            }
        }
    }
}

#[inline(always)]
pub(super) unsafe fn forward<V: ChannelVector, const D: usize>(job: &ForwardJob<V::Sample>) {
    for part in (0..group_lanes::<V::Sample>()).step_by(V::LANES) {
        // SAFETY: the caller's.
        unsafe {
            let work = Work::<V> { rows: job.rows.add(part), len: job.len };
            work.forward(&Gathered::<V, D> { job, part }, job.factors);
        }
    }
}

#[inline(always)]
pub(super) unsafe fn inverse<V: ChannelVector>(job: &InverseJob<V::Sample>) {
    for part in (0..group_lanes::<V::Sample>()).step_by(V::LANES) {
        // SAFETY: the caller's.
        unsafe { Work::<V> { rows: job.rows.add(part), len: job.len }.inverse(job.factors) };
    }
}
