//! Rows times spectra, frequency by frequency.

use super::dispatch::{Kernel, compiled_narrow};
use super::isa::Isa;
use super::lanes::{Lanes, Row};
use super::vector::{Vector, group_lanes};
use crate::Sample;
use rustfft::num_complex::Complex;
use std::marker::PhantomData;

/// Y(f) = H(f) X(f) for 0 <= f < F, from N channels to phases, where H(F - f) is the conjugate of H(f).
pub(crate) struct Product<'a, T: Sample> {
    /// N.
    pub(crate) channels: usize,
    /// F.
    pub(crate) len: usize,
    /// For each f <= F / 2 and each vector of phases a row of each channel.
    pub(crate) spectra: &'a [Row<T>],
    /// F rows of each vector of channels.
    pub(crate) input: &'a [Row<T>],
    /// F rows of each vector of phases.
    pub(crate) output: &'a mut [Row<T>],
}

/// The product of rows that hold segments of `depth` lanes.
///
/// # Panics
/// If there are fewer rows than that.
pub(crate) fn multiply<T: Sample>(isa: Isa, depth: usize, product: Product<'_, T>) {
    #[cfg(test)]
    super::work::add(product.len * product.spectra.len());
    let kernel = match depth {
        1 => compiled_narrow::<Multiply<T, 1>>(isa),
        2 => compiled_narrow::<Multiply<T, 2>>(isa),
        4 => compiled_narrow::<Multiply<T, 4>>(isa),
        _ => compiled_narrow::<Multiply<T, 8>>(isa),
    };
    // SAFETY: the kernel asks nothing of its job.
    unsafe { kernel(product) }
}

/// The loops of safe code, compiled for each instruction set.
struct Multiply<T, const D: usize>(PhantomData<T>);

impl<T: Sample, const D: usize> Kernel for Multiply<T, D> {
    type Sample = T;
    type Job<'a> = Product<'a, T>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(product: Product<'_, T>) {
        if const { D > group_lanes::<T>() } {
            unreachable!("segments have a group of lanes at most");
        }
        let Product { channels, len, spectra, input, output } = product;
        let mut spectra = spectra.chunks_exact(channels);
        for f in 0..=len / 2 {
            let mirrored = (len - f) % len;
            for (output, spectra) in output.chunks_exact_mut(len).zip(&mut spectra) {
                let mut sums = [[T::Portable::of(|_| T::default()); 4]; 2];
                for (input, spectra) in input.chunks_exact(len).zip(spectra.chunks(D)) {
                    for (n, h) in spectra.iter().enumerate() {
                        add::<T, D>(&mut sums[0], h, &input[f], n);
                        add::<T, D>(&mut sums[1], h, &input[mirrored], n);
                    }
                }
                let [[rr, ii, ri, ir], [far_rr, far_ii, far_ri, far_ir]] = sums;
                output[f] = Complex::new(rr - ii, ri + ir);
                output[mirrored] = Complex::new(far_rr + far_ii, far_ri - far_ir);
            }
        }
    }
}

/// Adds the parts of h times lane n of each segment: real by real, imaginary by imaginary, real by
/// imaginary, imaginary by real.
#[inline(always)]
fn add<T: Sample, const D: usize>(sums: &mut [T::Portable; 4], h: &Row<T>, x: &Row<T>, n: usize) {
    let all = |x: &T::Portable| T::Portable::of(|l| x.lanes()[l / D * D + n]);
    let (re, im) = (all(&x.re), all(&x.im));
    let products = [h.re * re, h.im * im, h.re * im, h.im * re];
    for (sum, product) in sums.iter_mut().zip(products) {
        *sum = *sum + product;
    }
}
