//! Rows times a matrix of spectra, frequency by frequency, and rows back to frames.
//!
//! Unsafe functions here run in code compiled for the instruction set of V, on slices whose lengths the
//! checked calls of [`TransformKernel`](super::TransformKernel) assert.

use super::dispatch::{Element, Kernel};
use super::passes::Complex;
use super::transform::{OutputFrames, Spectra, Transform, row_samples};
use super::vector::{Vector, group_lanes};
use std::marker::PhantomData;

/// From the rows of the channels to those of the phases.
pub(super) struct ProductJob<'a, T: Element> {
    pub(super) transform: &'a Transform<T>,
    pub(super) spectra: Spectra<'a, T>,
    pub(super) input: &'a [T],
    pub(super) output: &'a mut [T],
}

/// From the last rows of a transform to the frames of the output.
pub(super) struct ScatterJob<'a, T: Element> {
    pub(super) transform: &'a Transform<T>,
    /// Groups of lanes one after another.
    pub(super) rows: &'a [T],
    pub(super) to: OutputFrames<'a, T>,
}

/// The product at all frequencies, with D channels per row.
pub(super) struct Product<T, const D: usize>(PhantomData<T>);

impl<T: Element, const D: usize> Kernel for Product<T, D> {
    type Sample = T;
    type Job<'a> = ProductJob<'a, T>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(job: ProductJob<'_, T>) {
        if const { D > group_lanes::<T>() } {
            unreachable!("segments have a group of lanes at most");
        }
        let ProductJob { transform, spectra: Spectra { channels, rows }, input, output } = job;
        let (plane, input) = (transform.plane(), input.as_ptr());
        let (outputs, output) = (output.len() / plane, output.as_mut_ptr());
        let mut spectra = rows.as_ptr();
        for &pair in &transform.pairs {
            for group in 0..outputs {
                product_at::<V, D>(channels, plane, pair, spectra, input, output.add(group * plane));
                spectra = spectra.wrapping_add(channels * row_samples::<T>());
            }
        }
    }
}

/// Both frequencies of a pair. Eight sums, so that none of them waits for the one before.
#[inline(always)]
unsafe fn product_at<V: Vector, const D: usize>(
    channels: usize,
    plane: usize,
    pair: [u32; 2],
    mut spectra: *const V::Sample,
    mut input: *const V::Sample,
    output: *mut V::Sample,
) {
    let row = row_samples::<V::Sample>();
    let places = pair.map(|place| place as usize * row);
    // Of each frequency: real by real, imaginary by imaginary, real by imaginary, imaginary by real.
    let mut sums = [[V::zero(); 4]; 2];
    let mut channel = 0;
    while channel < channels {
        for n in 0..D.min(channels - channel) {
            let h = Complex::<V>::load(spectra);
            for (sums, place) in sums.iter_mut().zip(places) {
                let re = V::broadcast_lane::<D>(input.add(place), n);
                let im = V::broadcast_lane::<D>(input.add(place + V::GROUP), n);
                sums[0] = h.re.mul_add(re, sums[0]);
                sums[1] = h.im.mul_add(im, sums[1]);
                sums[2] = h.re.mul_add(im, sums[2]);
                sums[3] = h.im.mul_add(re, sums[3]);
            }
            spectra = spectra.add(row);
        }
        channel += D;
        input = input.wrapping_add(plane);
    }
    let [[rr, ii, ri, ir], [far_rr, far_ii, far_ri, far_ir]] = sums;
    Complex { re: rr.sub(ii), im: ri.add(ir) }.store(output.add(places[0]));
    Complex { re: far_rr.add(far_ii), im: far_ri.sub(far_ir) }.store(output.add(places[1]));
}

/// Frames from the rows of D lanes each.
pub(super) struct Scatter<T, const D: usize>(PhantomData<T>);

impl<T: Element, const D: usize> Kernel for Scatter<T, D> {
    type Sample = T;
    type Job<'a> = ScatterJob<'a, T>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(job: ScatterJob<'_, T>) {
        if const { D > group_lanes::<T>() } {
            unreachable!("segments have a group of lanes at most");
        }
        let ScatterJob { transform, rows, to: OutputFrames { samples, stride, count } } = job;
        let plane = transform.plane();
        let groups = rows.len() / plane;
        let rows = rows.as_ptr().add((transform.len - count) * row_samples::<T>());
        let mut out = samples.as_mut_ptr();
        for segment in 0..2 * V::GROUP / D {
            // Real and imaginary parts take turns.
            let mut lanes = rows.wrapping_add(segment % 2 * V::GROUP + segment / 2 * D);
            for _ in 0..count {
                if D < V::GROUP {
                    out.cast::<[T; D]>().write_unaligned(lanes.cast::<[T; D]>().read_unaligned());
                } else {
                    for g in 0..groups {
                        V::load(lanes.add(g * plane)).store(out.add(g * V::GROUP));
                    }
                }
                (lanes, out) = (lanes.wrapping_add(row_samples::<T>()), out.wrapping_add(stride));
            }
        }
    }
}
