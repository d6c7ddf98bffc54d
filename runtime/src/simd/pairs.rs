//! Ticks by twos for the fast form: frames apart into those of even and of odd ticks, and products together again.
//!
//! Nothing but plain loops, compiled for each instruction set: arithmetic on numbers in a row, and copies of frames, which the
//! compiler would turn into slow shuffles of single numbers if both were one loop. Each number is made by the same few
//! operations, none of which could be fused, so the bits are the same everywhere.

use super::Isa;
use super::isa::Kind;

/// Room for the frames of pairs of ticks.
pub(crate) struct Halves<'a, T> {
    /// Those of the first tick of each pair.
    pub(crate) even: &'a mut [T],
    /// Those of the second one.
    pub(crate) odd: &'a mut [T],
    /// Their means.
    pub(crate) mean: &'a mut [T],
}

/// Products of the three filters for pairs of ticks.
pub(crate) struct Products<'a, T> {
    /// These become the outputs of the first ticks.
    pub(crate) even: &'a mut [T],
    /// Those of the pair before come first.
    pub(crate) odd: &'a [T],
    /// These become the outputs of the second ticks.
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

macro_rules! pairs {
    ($split:ident, $join:ident, $module:ident, $sample:ty) => {
        /// Frames of `n` samples apart, for whole pairs; each half has room for them.
        pub(crate) fn $split(isa: Isa, frames: &[$sample], n: usize, to: Halves<'_, $sample>) {
            let Halves { even, odd, mean } = to;
            match isa.kind() {
                #[cfg(target_arch = "x86_64")]
                // SAFETY: an `Isa` is made only where the processor has it.
                Kind::Avx2 | Kind::Avx512 => unsafe {
                    $module::split_avx2(frames, n, even, odd, mean)
                },
                Kind::Portable => $module::split(frames, n, even, odd, mean),
            }
        }

        /// The `m` samples of the first tick of each pair: even + odd of the pair before; those of the second one:
        /// 4 mean - even - odd.
        pub(crate) fn $join(isa: Isa, from: Products<'_, $sample>, m: usize, out: &mut [$sample]) {
            let Products { even, odd, mean } = from;
            match isa.kind() {
                #[cfg(target_arch = "x86_64")]
                // SAFETY: an `Isa` is made only where the processor has it.
                Kind::Avx2 | Kind::Avx512 => unsafe {
                    $module::join_avx2(even, odd, mean, m, out)
                },
                Kind::Portable => $module::join(even, odd, mean, m, out),
            }
        }

        mod $module {
            type Slice = [$sample];

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            pub(super) fn split_avx2(x: &Slice, n: usize, even: &mut Slice, odd: &mut Slice, mean: &mut Slice) {
                split(x, n, even, odd, mean);
            }

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            pub(super) fn join_avx2(even: &mut Slice, odd: &Slice, mean: &mut Slice, m: usize, out: &mut Slice) {
                join(even, odd, mean, m, out);
            }

            #[inline(always)]
            pub(super) fn split(x: &Slice, n: usize, even: &mut Slice, odd: &mut Slice, mean: &mut Slice) {
                let len = x.len() / 2;
                let (even, odd, mean) = (&mut even[..len], &mut odd[..len], &mut mean[..len]);
                with_constant!(n, N => apart::<N>(x, even, odd), apart_any(x, n, even, odd));
                for ((slot, a), b) in mean.iter_mut().zip(&*even).zip(&*odd) {
                    *slot = 0.5 * a + 0.5 * b;
                }
            }

            #[inline(always)]
            pub(super) fn join(even: &mut Slice, odd: &Slice, mean: &mut Slice, m: usize, out: &mut Slice) {
                let len = out.len() / (2 * m) * m;
                let (even, mean) = (&mut even[..len], &mut mean[..len]);
                let (before, odd) = (&odd[..len], &odd[m..][..len]);
                for (((a, c), before), b) in even.iter_mut().zip(&mut *mean).zip(before).zip(odd) {
                    (*a, *c) = (*a + before, 4.0 * *c - *a - b);
                }
                with_constant!(m, M => together::<M>(even, mean, out), together_any(even, mean, m, out));
            }

            #[inline(always)]
            fn apart<const N: usize>(x: &Slice, even: &mut Slice, odd: &mut Slice) {
                let pairs = x.as_chunks::<N>().0.as_chunks::<2>().0.iter();
                let halves = even.as_chunks_mut::<N>().0.iter_mut().zip(odd.as_chunks_mut::<N>().0);
                for ([first, second], (even, odd)) in pairs.zip(halves) {
                    (*even, *odd) = (*first, *second);
                }
            }

            #[inline(always)]
            fn apart_any(x: &Slice, n: usize, even: &mut Slice, odd: &mut Slice) {
                let halves = even.chunks_exact_mut(n).zip(odd.chunks_exact_mut(n));
                for (pair, (even, odd)) in x.chunks_exact(2 * n).zip(halves) {
                    even.copy_from_slice(&pair[..n]);
                    odd.copy_from_slice(&pair[n..]);
                }
            }

            #[inline(always)]
            fn together<const M: usize>(even: &Slice, odd: &Slice, out: &mut Slice) {
                let halves = even.as_chunks::<M>().0.iter().zip(odd.as_chunks::<M>().0);
                let pairs = out.as_chunks_mut::<M>().0.as_chunks_mut::<2>().0.iter_mut();
                for ([first, second], (even, odd)) in pairs.zip(halves) {
                    (*first, *second) = (*even, *odd);
                }
            }

            #[inline(always)]
            fn together_any(even: &Slice, odd: &Slice, m: usize, out: &mut Slice) {
                let halves = even.chunks_exact(m).zip(odd.chunks_exact(m));
                for (pair, (even, odd)) in out.chunks_exact_mut(2 * m).zip(halves) {
                    pair[..m].copy_from_slice(even);
                    pair[m..].copy_from_slice(odd);
                }
            }
        }
    };
}

pairs!(split_f32, join_f32, single, f32);
pairs!(split_f64, join_f64, double, f64);

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(count: usize, step: f32) -> Vec<f32> {
        (0..count).map(|i| 1.0 + i as f32 * step).collect()
    }

    #[test]
    fn halves_and_outputs_are_in_their_places() {
        for (isa, count) in Isa::available().flat_map(|isa| (1..20).map(move |n| (isa, n))) {
            for pairs in [0, 1, 2, 7, 33] {
                let x = ramp(2 * pairs * count, 0.37);
                let [mut even, mut odd, mut mean] = [(); 3].map(|()| vec![0.0; pairs * count]);
                split_f32(isa, &x, count, Halves { even: &mut even, odd: &mut odd, mean: &mut mean });
                for (k, i) in (0..pairs).flat_map(|k| (0..count).map(move |i| (k, i))) {
                    let (a, b) = (x[2 * k * count + i], x[(2 * k + 1) * count + i]);
                    let at = k * count + i;
                    assert_eq!((even[at], odd[at], mean[at]), (a, b, (a + b) / 2.0), "{count}: pair {k}");
                }
                let odd = [ramp(count, 0.11), odd].concat();
                let mut out = vec![0.0; x.len()];
                let (a, c) = (even.clone(), mean.clone());
                join_f32(isa, Products { even: &mut even, odd: &odd, mean: &mut mean }, count, &mut out);
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
        split_f64(Isa::detect(), &largest, 1, Halves { even: &mut even, odd: &mut odd, mean: &mut mean });
        assert_eq!([even, odd, mean], [[f64::MAX]; 3]);
    }
}
