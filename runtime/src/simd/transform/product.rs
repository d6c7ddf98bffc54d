//! Rows times a matrix of spectra, frequency by frequency.

use super::super::channels::ChannelVector;
use super::complex::Complex;
use super::{group_lanes, row_samples};

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

#[inline(always)]
pub(super) unsafe fn product<V: ChannelVector, const D: usize>(job: &ProductJob<'_, V::Sample>) {
    let row = row_samples::<V::Sample>();
    let mut spectra = job.spectra;
    for &pair in job.pairs {
        for output in 0..job.outputs {
            for part in (0..group_lanes::<V::Sample>()).step_by(V::LANES) {
                // SAFETY: the caller's.
                unsafe { product_at::<V, D>(job, pair, spectra, output, part) };
            }
            spectra = spectra.wrapping_add(job.channels * row);
        }
    }
}

/// Both frequencies of a pair. Eight sums, so that none of them waits for the one before.
#[inline(always)]
unsafe fn product_at<V: ChannelVector, const D: usize>(
    job: &ProductJob<'_, V::Sample>,
    pair: [u32; 2],
    mut spectra: *const V::Sample,
    output: usize,
    part: usize,
) {
    let row = row_samples::<V::Sample>();
    let imaginary = group_lanes::<V::Sample>();
    // SAFETY: the caller's.
    unsafe {
        let places = pair.map(|place| place as usize * row);
        let zero = V::splat(V::Sample::default());
        // Of each frequency: real by real, imaginary by imaginary, real by imaginary, imaginary by real.
        let mut sums = [[zero; 4]; 2];
        let mut channel = 0;
        let mut input = job.input;
        while channel < job.channels {
            for n in 0..D.min(job.channels - channel) {
                let h = Complex::<V>::load(spectra.add(part));
                for (sums, place) in sums.iter_mut().zip(places) {
                    let re = V::spread::<D>(input.add(place), n, part);
                    let im = V::spread::<D>(input.add(place + imaginary), n, part);
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
        let to = job.output.add(output * job.plane + part);
        let [[rr, ii, ri, ir], [far_rr, far_ii, far_ri, far_ir]] = sums;
        Complex { re: rr.sub(ii), im: ri.add(ir) }.store(to.add(places[0]));
        Complex { re: far_rr.add(far_ii), im: far_ri.sub(far_ir) }.store(to.add(places[1]));
    }
}
