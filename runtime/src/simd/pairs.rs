//! Frames by twos for two-parallel fast FIR: even frames apart from odd ones, and products together again.
//!
//! Nothing but plain loops, compiled for each instruction set: arithmetic on numbers in a row, and copies of
//! frames, which the compiler would turn into slow shuffles of single numbers if both were one loop. Each
//! number is made by the same few operations, none of which could be fused, so the bits are the same
//! everywhere.

use super::dispatch::{Element, Kernel, compiled_narrow};
use super::isa::Isa;
use super::vector::Vector;
use std::marker::PhantomData;

/// Room for pairs of frames.
pub(crate) struct Halves<'a, T> {
    /// The first frame of each pair.
    pub(crate) even: &'a mut [T],
    /// The second one.
    pub(crate) odd: &'a mut [T],
    /// Their means.
    pub(crate) mean: &'a mut [T],
}

/// Products of the three filters for pairs of frames.
pub(crate) struct Products<'a, T> {
    /// These become the outputs of the first frames.
    pub(crate) even: &'a mut [T],
    /// Those of the pair before come first.
    pub(crate) odd: &'a [T],
    /// These become the outputs of the second frames.
    pub(crate) mean: &'a mut [T],
}

/// Runs `$body` with N or M as a constant if it is small: then a frame is copied by an instruction or two.
macro_rules! with_constant {
    ($count:expr, $COUNT:ident => $body:expr, $other:expr) => {
        with_constant!($count, $COUNT => $body, $other, 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16)
    };
    ($count:expr, $COUNT:ident => $body:expr, $other:expr, $($small:literal)*) => {
        match $count {
            $($small => {
                const $COUNT: usize = $small;
                $body
            })*
            _ => $other,
        }
    };
}

/// Frames of `n` samples apart, for whole pairs; each half has room for them.
pub(crate) fn split<T: Element>(isa: Isa, frames: &[T], n: usize, to: Halves<'_, T>) {
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled_narrow::<Split<T>>(isa)((frames, n, to)) }
}

/// The `m` samples of the first frame of each pair: even + odd of the pair before; those of the second one:
/// 4 mean - even - odd.
pub(crate) fn join<T: Element>(isa: Isa, from: Products<'_, T>, m: usize, out: &mut [T]) {
    // SAFETY: the kernel asks nothing of its job.
    unsafe { compiled_narrow::<Join<T>>(isa)((from, m, out)) }
}

struct Split<T>(PhantomData<T>);

impl<T: Element> Kernel for Split<T> {
    type Sample = T;
    type Job<'a> = (&'a [T], usize, Halves<'a, T>);
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>((x, n, to): Self::Job<'_>) {
        let len = x.len() / 2;
        let (even, odd, mean) = (&mut to.even[..len], &mut to.odd[..len], &mut to.mean[..len]);
        with_constant!(n, N => apart::<T, N>(x, even, odd), apart_any(x, n, even, odd));
        let half = T::from(0.5);
        for ((slot, a), b) in mean.iter_mut().zip(&*even).zip(&*odd) {
            *slot = half * *a + half * *b;
        }
    }
}

struct Join<T>(PhantomData<T>);

impl<T: Element> Kernel for Join<T> {
    type Sample = T;
    type Job<'a> = (Products<'a, T>, usize, &'a mut [T]);
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>((from, m, out): Self::Job<'_>) {
        let len = out.len() / (2 * m) * m;
        let (even, mean) = (&mut from.even[..len], &mut from.mean[..len]);
        let (before, odd) = (&from.odd[..len], &from.odd[m..][..len]);
        let four = T::from(4.0);
        for (((a, c), before), b) in even.iter_mut().zip(&mut *mean).zip(before).zip(odd) {
            (*a, *c) = (*a + *before, four * *c - *a - *b);
        }
        with_constant!(m, M => together::<T, M>(even, mean, out), together_any(even, mean, m, out));
    }
}

#[inline(always)]
fn apart<T: Copy, const N: usize>(x: &[T], even: &mut [T], odd: &mut [T]) {
    let pairs = x.as_chunks::<N>().0.as_chunks::<2>().0.iter();
    let halves = even.as_chunks_mut::<N>().0.iter_mut().zip(odd.as_chunks_mut::<N>().0);
    for ([first, second], (even, odd)) in pairs.zip(halves) {
        (*even, *odd) = (*first, *second);
    }
}

#[inline(always)]
fn apart_any<T: Copy>(x: &[T], n: usize, even: &mut [T], odd: &mut [T]) {
    let halves = even.chunks_exact_mut(n).zip(odd.chunks_exact_mut(n));
    for (pair, (even, odd)) in x.chunks_exact(2 * n).zip(halves) {
        even.copy_from_slice(&pair[..n]);
        odd.copy_from_slice(&pair[n..]);
    }
}

#[inline(always)]
fn together<T: Copy, const M: usize>(even: &[T], odd: &[T], out: &mut [T]) {
    let halves = even.as_chunks::<M>().0.iter().zip(odd.as_chunks::<M>().0);
    let pairs = out.as_chunks_mut::<M>().0.as_chunks_mut::<2>().0.iter_mut();
    for ([first, second], (even, odd)) in pairs.zip(halves) {
        (*first, *second) = (*even, *odd);
    }
}

#[inline(always)]
fn together_any<T: Copy>(even: &[T], odd: &[T], m: usize, out: &mut [T]) {
    let halves = even.chunks_exact(m).zip(odd.chunks_exact(m));
    for (pair, (even, odd)) in out.chunks_exact_mut(2 * m).zip(halves) {
        pair[..m].copy_from_slice(even);
        pair[m..].copy_from_slice(odd);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(count: usize, step: f32) -> Vec<f32> {
        (0..count).map(|i| 1.0 + i as f32 * step).collect()
    }

    #[test]
    fn halves_and_outputs_are_in_their_places() {
        // Miri takes a thousand times as long.
        let (counts, lengths): (_, &[usize]) =
            if cfg!(miri) { (1..6, &[1, 9]) } else { (1..20, &[0, 1, 2, 7, 33]) };
        for (isa, count) in Isa::available().flat_map(|isa| counts.clone().map(move |n| (isa, n))) {
            for &pairs in lengths {
                let x = ramp(2 * pairs * count, 0.37);
                let [mut even, mut odd, mut mean] = [(); 3].map(|()| vec![0.0; pairs * count]);
                split(isa, &x, count, Halves { even: &mut even, odd: &mut odd, mean: &mut mean });
                for (k, i) in (0..pairs).flat_map(|k| (0..count).map(move |i| (k, i))) {
                    let (a, b) = (x[2 * k * count + i], x[(2 * k + 1) * count + i]);
                    let at = k * count + i;
                    assert_eq!((even[at], odd[at], mean[at]), (a, b, (a + b) / 2.0), "{count}: pair {k}");
                }
                let odd = [ramp(count, 0.11), odd].concat();
                let mut out = vec![0.0; x.len()];
                let (a, c) = (even.clone(), mean.clone());
                join(isa, Products { even: &mut even, odd: &odd, mean: &mut mean }, count, &mut out);
                for (k, p) in (0..pairs).flat_map(|k| (0..count).map(move |p| (k, p))) {
                    let at = k * count + p;
                    assert_eq!(out[2 * k * count + p], a[at] + odd[at]);
                    assert_eq!(out[(2 * k + 1) * count + p], 4.0 * c[at] - a[at] - odd[at + count]);
                }
            }
        }
    }

    #[test]
    fn the_mean_of_the_largest_numbers_is_finite() {
        let largest = [f64::MAX; 2];
        let [mut even, mut odd, mut mean] = [[0.0]; 3];
        split(Isa::detect(), &largest, 1, Halves { even: &mut even, odd: &mut odd, mean: &mut mean });
        assert_eq!([even, odd, mean], [[f64::MAX]; 3]);
    }
}
