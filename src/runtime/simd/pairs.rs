//! Ticks by twos for the fast form: frames apart into those of even and of odd ticks, and products together again.
//!
//! Nothing but plain loops, compiled for each instruction set. Each number is made by the same few operations, none of
//! which could be fused, so the bits are the same everywhere.

use super::Isa;

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
    pub(crate) even: &'a [T],
    /// Those of the pair before come first.
    pub(crate) odd: &'a [T],
    pub(crate) mean: &'a [T],
}

/// Runs `$body` with N or M as a constant if it is small: then the loops have no ends of their own.
macro_rules! with_constant {
    ($count:expr, $COUNT:ident => $body:expr, $other:expr) => {
        with_constant!($count, $COUNT => $body, $other, 1 2 3 4 5 6 7 8 12 16)
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
            match isa {
                #[cfg(target_arch = "x86_64")]
                // SAFETY: the processor was asked.
                Isa::Avx2 | Isa::Avx512 if isa.is_available() => unsafe {
                    $module::split_avx2(frames, n, even, odd, mean)
                },
                _ => $module::split(frames, n, even, odd, mean),
            }
        }

        /// The `m` samples of the first tick of each pair: even + odd of the pair before; those of the second one:
        /// 4 mean - even - odd.
        pub(crate) fn $join(isa: Isa, from: Products<'_, $sample>, m: usize, out: &mut [$sample]) {
            let Products { even, odd, mean } = from;
            match isa {
                #[cfg(target_arch = "x86_64")]
                // SAFETY: the processor was asked.
                Isa::Avx2 | Isa::Avx512 if isa.is_available() => unsafe {
                    $module::join_avx2(even, odd, mean, m, out)
                },
                _ => $module::join(even, odd, mean, m, out),
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
            pub(super) fn join_avx2(even: &Slice, odd: &Slice, mean: &Slice, m: usize, out: &mut Slice) {
                join(even, odd, mean, m, out);
            }

            #[inline(always)]
            pub(super) fn split(x: &Slice, n: usize, even: &mut Slice, odd: &mut Slice, mean: &mut Slice) {
                with_constant!(
                    n,
                    N => split_constant::<N>(x, even, odd, mean),
                    for (pair, x) in x.chunks_exact(2 * n).enumerate() {
                        let (frames, at) = (x.split_at(n), pair * n..(pair + 1) * n);
                        even[at.clone()].copy_from_slice(frames.0);
                        odd[at.clone()].copy_from_slice(frames.1);
                        for ((slot, a), b) in mean[at].iter_mut().zip(frames.0).zip(frames.1) {
                            *slot = 0.5 * a + 0.5 * b;
                        }
                    }
                );
            }

            #[inline(always)]
            fn split_constant<const N: usize>(x: &Slice, even: &mut Slice, odd: &mut Slice, mean: &mut Slice) {
                let pairs = x.as_chunks::<N>().0.as_chunks::<2>().0;
                let (even, odd) = (even.as_chunks_mut::<N>().0, odd.as_chunks_mut::<N>().0);
                let halves = even.iter_mut().zip(odd).zip(mean.as_chunks_mut::<N>().0);
                for ([a, b], ((even, odd), mean)) in pairs.iter().zip(halves) {
                    (*even, *odd) = (*a, *b);
                    *mean = std::array::from_fn(|i| 0.5 * a[i] + 0.5 * b[i]);
                }
            }

            #[inline(always)]
            pub(super) fn join(even: &Slice, odd: &Slice, mean: &Slice, m: usize, out: &mut Slice) {
                with_constant!(
                    m,
                    M => join_constant::<M>(even, odd, mean, out),
                    for (pair, out) in out.chunks_exact_mut(2 * m).enumerate() {
                        let at = pair * m..(pair + 1) * m;
                        let (a, c) = (&even[at.clone()], &mean[at.clone()]);
                        let (before, b) = (&odd[at.clone()], &odd[m..][at]);
                        let (first, second) = out.split_at_mut(m);
                        for p in 0..m {
                            first[p] = a[p] + before[p];
                            second[p] = 4.0 * c[p] - a[p] - b[p];
                        }
                    }
                );
            }

            #[inline(always)]
            fn join_constant<const M: usize>(even: &Slice, odd: &Slice, mean: &Slice, out: &mut Slice) {
                let (before, odd) = (odd.as_chunks::<M>().0, odd[M..].as_chunks::<M>().0);
                let products = even.as_chunks::<M>().0.iter().zip(before).zip(odd).zip(mean.as_chunks::<M>().0);
                for ([first, second], (((a, before), b), c)) in
                    out.as_chunks_mut::<M>().0.as_chunks_mut::<2>().0.iter_mut().zip(products)
                {
                    for p in 0..M {
                        first[p] = a[p] + before[p];
                        second[p] = 4.0 * c[p] - a[p] - b[p];
                    }
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
        for (isa, count) in [Isa::Portable, Isa::detect()].into_iter().flat_map(|isa| (1..20).map(move |n| (isa, n))) {
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
                join_f32(isa, Products { even: &even, odd: &odd, mean: &mean }, count, &mut out);
                for (k, p) in (0..pairs).flat_map(|k| (0..count).map(move |p| (k, p))) {
                    let at = k * count + p;
                    assert_eq!(out[2 * k * count + p], even[at] + odd[at]);
                    assert_eq!(out[(2 * k + 1) * count + p], 4.0 * mean[at] - even[at] - odd[at + count]);
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
