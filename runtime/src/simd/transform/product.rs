//! Rows times a matrix of spectra, frequency by frequency.

use super::super::dispatch::{Element, Kernel};
use super::super::vector::{Vector, group_lanes};
use super::complex::{Complex, row_samples};
use std::marker::PhantomData;

/// From the rows of the channels to those of the phases.
pub(super) struct ProductJob<'a, T> {
    pub(super) pairs: &'a [[u32; 2]],
    pub(super) channels: usize,
    /// Samples of the rows of one group of lanes.
    pub(super) plane: usize,
    pub(super) spectra: *const T,
    pub(super) input: *const T,
    pub(super) output: *mut T,
    /// Groups of phases.
    pub(super) outputs: usize,
}

/// The product at all frequencies, with D channels per row.
pub(super) struct Product<T, const D: usize>(PhantomData<T>);

impl<T: Element, const D: usize> Kernel for Product<T, D> {
    type Sample = T;
    type Job<'a> = &'a ProductJob<'a, T>;
    type Output = ();

    #[inline(always)]
    unsafe fn run<V: Vector<Sample = T>>(job: &ProductJob<'_, T>) {
        if const { D > group_lanes::<T>() } {
            unreachable!("segments have a group of lanes at most");
        }
        let mut spectra = job.spectra;
        for &pair in job.pairs {
            for output in 0..job.outputs {
                // SAFETY: the caller's.
                unsafe { product_at::<V, D>(job, pair, spectra, output) };
                spectra = spectra.wrapping_add(job.channels * row_samples::<T>());
            }
        }
    }
}

/// Both frequencies of a pair. Eight sums, so that none of them waits for the one before.
#[inline(always)]
unsafe fn product_at<V: Vector, const D: usize>(
    job: &ProductJob<'_, V::Sample>,
    pair: [u32; 2],
    mut spectra: *const V::Sample,
    output: usize,
) {
    let row = row_samples::<V::Sample>();
    // SAFETY: the caller's.
    unsafe {
        let places = pair.map(|place| place as usize * row);
        let zero = V::zero();
        // Of each frequency: real by real, imaginary by imaginary, real by imaginary, imaginary by real.
        let mut sums = [[zero; 4]; 2];
        let mut channel = 0;
        let mut input = job.input;
        while channel < job.channels {
            for n in 0..D.min(job.channels - channel) {
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
            input = input.wrapping_add(job.plane);
        }
        let to = job.output.add(output * job.plane);
        let [[rr, ii, ri, ir], [far_rr, far_ii, far_ri, far_ir]] = sums;
        Complex { re: rr.sub(ii), im: ri.add(ir) }.store(to.add(places[0]));
        Complex { re: far_rr.add(far_ii), im: far_ri.sub(far_ir) }.store(to.add(places[1]));
    }
}
