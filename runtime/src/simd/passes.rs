//! The passes of the transform and of its inverse over rows.
//!
//! Unsafe functions here run in code compiled for the instruction set of V. They read and write rows of the
//! transform, whose number the checked calls of [`TransformKernel`](super::TransformKernel) assert.

use super::dispatch::{Element, Kernel};
use super::transform::{Segments, Transform, row_samples};
use super::vector::{Vector, group_lanes};
use std::marker::PhantomData;

/// From frames to rows.
pub(super) struct ForwardJob<'a, T: Element> {
    pub(super) transform: &'a Transform<T>,
    pub(super) from: Segments<'a, T>,
    pub(super) rows: &'a mut [T],
}

/// In place.
pub(super) struct InverseJob<'a, T: Element> {
    pub(super) transform: &'a Transform<T>,
    pub(super) rows: &'a mut [T],
}

/// Complex numbers in lanes: real parts in one vector, imaginary ones in another.
#[derive(Clone, Copy)]
pub(super) struct Complex<V> {
    pub(super) re: V,
    pub(super) im: V,
}

impl<V: Vector> Complex<V> {
    /// A row.
    ///
    /// # Safety
    /// As for [`Vector`]; the row is there.
    #[inline(always)]
    pub(super) unsafe fn load(row: *const V::Sample) -> Self {
        Self { re: V::load(row), im: V::load(row.add(V::GROUP)) }
    }

    /// # Safety
    /// As for [`Complex::load`].
    #[inline(always)]
    pub(super) unsafe fn store(self, row: *mut V::Sample) {
        self.re.store(row);
        self.im.store(row.add(V::GROUP));
    }

    /// The number at `at` in all lanes.
    ///
    /// # Safety
    /// As for [`Vector`]; the number is there.
    #[inline(always)]
    pub(super) unsafe fn splat(at: *const V::Sample) -> Self {
        Self { re: V::splat(*at), im: V::splat(*at.add(1)) }
    }

    #[inline(always)]
    pub(super) fn add(self, other: Self) -> Self {
        Self { re: self.re.add(other.re), im: self.im.add(other.im) }
    }

    #[inline(always)]
    pub(super) fn sub(self, other: Self) -> Self {
        Self { re: self.re.sub(other.re), im: self.im.sub(other.im) }
    }

    /// self + i other.
    #[inline(always)]
    pub(super) fn add_times_i(self, other: Self) -> Self {
        Self { re: self.re.sub(other.im), im: self.im.add(other.re) }
    }

    /// self - i other.
    #[inline(always)]
    pub(super) fn sub_times_i(self, other: Self) -> Self {
        Self { re: self.re.add(other.im), im: self.im.sub(other.re) }
    }

    #[inline(always)]
    pub(super) fn mul(self, w: Self) -> Self {
        Self {
            re: self.im.neg_mul_add(w.im, self.re.mul(w.re)),
            im: self.re.mul_add(w.im, self.im.mul(w.re)),
        }
    }

    /// self times the conjugate of w.
    #[inline(always)]
    pub(super) fn mul_conjugate(self, w: Self) -> Self {
        Self {
            re: self.im.mul_add(w.im, self.re.mul(w.re)),
            im: self.re.neg_mul_add(w.im, self.im.mul(w.re)),
        }
    }
}

/// The radix-4 butterfly: the transform of length 4, or four times its inverse.
#[inline(always)]
fn butterfly<V: Vector, const INVERSE: bool>([a, b, c, d]: [Complex<V>; 4]) -> [Complex<V>; 4] {
    let (even, odd) = (a.add(c), b.add(d));
    let (even_far, odd_far) = (a.sub(c), b.sub(d));
    let (minus, plus) = (even_far.sub_times_i(odd_far), even_far.add_times_i(odd_far));
    let (first, third) = if INVERSE { (plus, minus) } else { (minus, plus) };
    [even.add(odd), first, even.sub(odd), third]
}

/// Where a pass takes its rows from. No closure: what is not inlined is not compiled for the instruction
/// set.
///
/// # Safety
/// As for [`Vector`], and the rows exist.
trait Rows<V: Vector> {
    unsafe fn row(&self, row: usize) -> Complex<V>;

    /// Four rows, `spacing` apart.
    #[inline(always)]
    unsafe fn four(&self, first: usize, spacing: usize) -> [Complex<V>; 4] {
        [
            self.row(first),
            self.row(first + spacing),
            self.row(first + 2 * spacing),
            self.row(first + 3 * spacing),
        ]
    }
}

/// Frames where they lie, D lanes of each segment.
struct Gathered<'a, V: Vector, const D: usize> {
    from: Segments<'a, V::Sample>,
}

impl<V: Vector, const D: usize> Rows<V> for Gathered<'_, V, D> {
    #[inline(always)]
    unsafe fn row(&self, row: usize) -> Complex<V> {
        let Segments { parts: [re, im], stride, hop } = self.from;
        Complex {
            re: V::segments::<D>(re.as_ptr().add(row * stride), hop),
            im: V::segments::<D>(im.as_ptr().add(row * stride), hop),
        }
    }
}

/// All rows.
#[derive(Clone, Copy)]
struct Work<V: Vector> {
    rows: *mut V::Sample,
    len: usize,
}

impl<V: Vector> Rows<V> for Work<V> {
    #[inline(always)]
    unsafe fn row(&self, row: usize) -> Complex<V> {
        Complex::load(self.at(row))
    }
}

impl<V: Vector> Work<V> {
    #[inline(always)]
    unsafe fn at(&self, row: usize) -> *mut V::Sample {
        self.rows.add(row * row_samples::<V::Sample>())
    }

    #[inline(always)]
    unsafe fn store(&self, first: usize, spacing: usize, [a, b, c, d]: [Complex<V>; 4]) {
        a.store(self.at(first));
        b.store(self.at(first + spacing));
        c.store(self.at(first + 2 * spacing));
        d.store(self.at(first + 3 * spacing));
    }

    /// The twiddle factors of index j >= 1 of a pass.
    #[inline(always)]
    unsafe fn twiddles(factors: *const V::Sample, j: usize) -> [Complex<V>; 3] {
        let at = factors.add(6 * (j - 1));
        [Complex::splat(at), Complex::splat(at.add(2)), Complex::splat(at.add(4))]
    }

    /// One pass over `base .. base + span`.
    #[inline(always)]
    unsafe fn forward_pass(&self, from: &impl Rows<V>, base: usize, span: usize, factors: *const V::Sample) {
        let next = span / 4;
        self.store(base, next, butterfly::<V, false>(from.four(base, next)));
        for j in 1..next {
            let [w1, w2, w3] = Self::twiddles(factors, j);
            let [a, b, c, d] = butterfly::<V, false>(from.four(base + j, next));
            self.store(base + j, next, [a, b.mul(w1), c.mul(w2), d.mul(w3)]);
        }
    }

    #[inline(always)]
    unsafe fn inverse_pass(&self, base: usize, span: usize, factors: *const V::Sample) {
        let next = span / 4;
        self.store(base, next, butterfly::<V, true>(self.four(base, next)));
        for j in 1..next {
            let [w1, w2, w3] = Self::twiddles(factors, j);
            let [a, b, c, d] = self.four(base + j, next);
            let twiddled = [a, b.mul_conjugate(w1), c.mul_conjugate(w2), d.mul_conjugate(w3)];
            self.store(base + j, next, butterfly::<V, true>(twiddled));
        }
    }

    /// The pass over spans of 4 rows, or of 2.
    #[inline(always)]
    unsafe fn short_spans<const INVERSE: bool>(&self, span: usize) {
        for base in (0..self.len).step_by(4) {
            let [a, b, c, d] = self.four(base, 1);
            let done = if span == 4 {
                butterfly::<V, INVERSE>([a, b, c, d])
            } else {
                [a.add(b), a.sub(b), c.add(d), c.sub(d)]
            };
            self.store(base, 1, done);
        }
    }

    #[inline(always)]
    unsafe fn forward(&self, from: &impl Rows<V>, mut factors: *const V::Sample) {
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

    #[inline(always)]
    unsafe fn inverse(&self, mut factors: *const V::Sample) {
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

/// The transform.
pub(super) struct Forward<T, const D: usize>(PhantomData<T>);

impl<T: Element, const D: usize> Kernel for Forward<T, D> {
    type Sample = T;
    type Job<'a> = ForwardJob<'a, T>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(job: ForwardJob<'_, T>) {
        if const { D > group_lanes::<T>() } {
            unreachable!("segments have a group of lanes at most");
        }
        let work = Work::<V> { rows: job.rows.as_mut_ptr(), len: job.transform.len };
        work.forward(&Gathered::<V, D> { from: job.from }, job.transform.factors.as_ptr());
    }
}

/// The inverse times F.
pub(super) struct Inverse<T>(PhantomData<T>);

impl<T: Element> Kernel for Inverse<T> {
    type Sample = T;
    type Job<'a> = InverseJob<'a, T>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(InverseJob { transform, rows }: InverseJob<'_, T>) {
        let work = Work::<V> { rows: rows.as_mut_ptr(), len: transform.len };
        // The last pass uses the factors of the first one.
        work.inverse(transform.factors.as_ptr_range().end);
    }
}
