//! Fourier transforms across channels, and the product with a matrix of spectra between them.
//!
//! A *row* is a lane group (see [`vector`](super::vector)) of real parts and one of imaginary parts, in
//! structure-of-arrays order; a transform of length F takes F rows to F rows, every lane for itself. That is
//! why it is written here and not taken from a crate: those transform one stream, and frames of N channels
//! would have to be brought into N streams and back. Here they are transformed as they lie.
//!
//! Forward is decimation in frequency, X(f) = sum_t x(t) exp(-2 pi i f t / F), in passes of radix 4 and one
//! of radix 2 if log2 F is odd; it leaves the rows in the order of reversed digits, in which the product is
//! made, and the inverse (decimation in time, without the factor 1 / F) takes them in that order (Gentleman
//! and Sande 1966; Cooley and Tukey 1965).
//!
//! Two real blocks a and b are one complex block a + ib. As the filters are real, the product with their
//! spectra gives y_a + i y_b: the parts need not be told apart. Spectra at f and F - f are conjugate, so
//! both frequencies are made together from one load.
//!
//! Bits: all lanes do the same in the same order, whatever the instruction set.

mod complex;
mod passes;
mod product;
mod scatter;

use super::dispatch::{Element, compiled_narrow};
use super::isa::Isa;
use super::vector::group_lanes;
use crate::aligned::Aligned;
pub(crate) use complex::row_samples;
use passes::{Forward, ForwardJob, Inverse, InverseJob};
use product::{Product, ProductJob};
use scatter::{Scatter, ScatterJob};
use std::f64::consts::TAU;

/// The shortest transform: two passes of radix 4.
pub(crate) const SHORTEST_TRANSFORM: usize = 16;

/// The length F of a transform, its factors, and which rows belong together.
#[derive(Debug)]
pub(crate) struct Transform<T: Element> {
    len: usize,
    /// exp(-2 pi i r j / L), r = 1, 2, 3, for 1 <= j < L / 4, for L = F, F / 4 ... > 4.
    factors: Aligned<T>,
    /// Rows of the frequencies f and F - f, for 0 <= f <= F / 2.
    pairs: Vec<[u32; 2]>,
}

impl<T: Element> Transform<T> {
    /// # Panics
    /// If the length is no power of two from [`SHORTEST_TRANSFORM`] on, or too large for 32-bit places.
    pub(crate) fn new(len: usize, from_f64: impl Fn(f64) -> T) -> Self {
        assert!(len.is_power_of_two() && len >= SHORTEST_TRANSFORM && u32::try_from(len).is_ok());
        let mut factors = Vec::new();
        let mut span = len;
        while span > 4 {
            for (j, r) in (1..span / 4).flat_map(|j| [(j, 1), (j, 2), (j, 3)]) {
                let (sin, cos) = (TAU * (r * j) as f64 / span as f64).sin_cos();
                factors.extend([from_f64(cos), from_f64(-sin)]);
            }
            span /= 4;
        }
        let place = |f: usize| row_of(f, len) as u32;
        let pairs = (0..=len / 2).map(|f| [place(f), place((len - f) % len)]).collect();
        Self { len, factors: Aligned::from_slice(&factors), pairs }
    }

    /// Counts one transform: a multiply-add for each sample of a row in each level.
    #[cfg(test)]
    fn count(&self) {
        super::work::add(self.len * self.len.ilog2() as usize * row_samples::<T>());
    }

    /// The row of each frequency 0 <= f <= F / 2.
    pub(crate) fn half_rows(&self) -> impl Iterator<Item = usize> {
        self.pairs.iter().map(|&[row, _]| row as usize)
    }
}

/// Where the forward transform leaves frequency `f`.
fn row_of(f: usize, len: usize) -> usize {
    match len {
        1 => 0,
        2 => f,
        _ => f % 4 * (len / 4) + row_of(f / 4, len / 4),
    }
}

/// Frames to be transformed, where they lie.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Segments<'a, T> {
    /// From the first frame of the real and of the imaginary parts on.
    pub(crate) parts: [&'a [T]; 2],
    /// Samples from frame to frame.
    pub(crate) stride: usize,
    /// Samples from segment to segment.
    pub(crate) hop: usize,
}

/// N by M spectra: for each pair of frequencies, each group of phases and each channel a row.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spectra<'a, T> {
    pub(crate) channels: usize,
    pub(crate) rows: &'a [T],
}

/// Where rows go: the last rows of each segment's real parts, then of its imaginary parts, segment after
/// segment.
#[derive(Debug)]
pub(crate) struct Frames<'a, T> {
    pub(crate) samples: &'a mut [T],
    /// M, samples from frame to frame.
    pub(crate) stride: usize,
    /// B, the last rows that are wanted.
    pub(crate) count: usize,
}

/// The kernels of one sample type.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TransformKernel<T> {
    /// By log2 D.
    forward: [unsafe fn(&ForwardJob<T>); 4],
    product: [for<'a> unsafe fn(&'a ProductJob<'a, T>); 4],
    inverse: unsafe fn(&InverseJob<T>),
    scatter: [unsafe fn(&ScatterJob<T>); 4],
}

impl<T: Element> TransformKernel<T> {
    /// Transforms F frames of each segment, of which `depth` samples are lanes, to F rows.
    ///
    /// # Panics
    /// If `depth` is no power of two up to a group, or a slice is too short: the last frame needs `depth`
    /// samples.
    pub(crate) fn forward(
        &self,
        transform: &Transform<T>,
        depth: usize,
        from: Segments<'_, T>,
        rows: &mut [T],
    ) {
        let Segments { parts, stride, hop } = from;
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        let needed = (transform.len - 1) * stride + (group_lanes::<T>() / depth - 1) * hop + depth;
        assert!(parts.iter().all(|part| part.len() >= needed));
        assert!(rows.len() >= transform.len * row_samples::<T>());
        let job = ForwardJob {
            parts: parts.map(<[T]>::as_ptr),
            stride,
            hop,
            len: transform.len,
            factors: transform.factors.as_ptr(),
            rows: rows.as_mut_ptr(),
        };
        #[cfg(test)]
        transform.count();
        // SAFETY: the bounds are asserted above.
        unsafe { self.forward[depth.ilog2() as usize](&job) };
    }

    /// F times the inverse transform, in place.
    ///
    /// # Panics
    /// If there are less than F rows.
    pub(crate) fn inverse(&self, transform: &Transform<T>, rows: &mut [T]) {
        assert!(rows.len() >= transform.len * row_samples::<T>());
        let factors = transform.factors.as_ptr_range().end;
        #[cfg(test)]
        transform.count();
        let job = InverseJob { len: transform.len, factors, rows: rows.as_mut_ptr() };
        // SAFETY: as above.
        unsafe { (self.inverse)(&job) };
    }

    /// Brings rows to where they belong, `depth` lanes to a frame from each of its groups. Each frame is
    /// written as whole lanes and what is too much overwritten by the next one, which also goes for what
    /// follows the last one.
    ///
    /// # Panics
    /// If slices do not fit: the last frame needs whole lanes.
    pub(crate) fn scatter(&self, transform: &Transform<T>, depth: usize, rows: &[T], to: Frames<'_, T>) {
        let plane = transform.len * row_samples::<T>();
        let groups = rows.len() / plane;
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        assert!(groups > 0 && rows.len() == groups * plane && (1..=transform.len).contains(&to.count));
        let frames = 2 * group_lanes::<T>() / depth * to.count;
        assert!((frames - 1) * to.stride + groups * depth <= to.samples.len());
        let job = ScatterJob {
            rows: rows[(transform.len - to.count) * row_samples::<T>()..].as_ptr(),
            plane,
            groups,
            out: to.samples.as_mut_ptr(),
            stride: to.stride,
            count: to.count,
        };
        // SAFETY: as above.
        unsafe { self.scatter[depth.ilog2() as usize](&job) };
    }

    /// Y(f) = H(f) X(f): from F rows for each `depth` channels to F rows for each group of phases.
    ///
    /// # Panics
    /// If slices do not fit.
    pub(crate) fn product(
        &self,
        transform: &Transform<T>,
        depth: usize,
        spectra: Spectra<'_, T>,
        input: &[T],
        output: &mut [T],
    ) {
        let row = row_samples::<T>();
        let plane = transform.len * row;
        let outputs = output.len() / plane;
        assert!(depth.is_power_of_two() && depth <= group_lanes::<T>());
        assert!(input.len() >= spectra.channels.div_ceil(depth) * plane && output.len() == outputs * plane);
        assert!(spectra.rows.len() >= transform.pairs.len() * outputs * spectra.channels * row);
        let job = ProductJob {
            pairs: &transform.pairs,
            channels: spectra.channels,
            plane,
            spectra: spectra.rows.as_ptr(),
            input: input.as_ptr(),
            output: output.as_mut_ptr(),
            outputs,
        };
        #[cfg(test)]
        super::work::add(2 * transform.pairs.len() * outputs * spectra.channels * row);
        // SAFETY: as above; the pairs are rows below F, see `Transform::new`.
        unsafe { self.product[depth.ilog2() as usize](&job) };
    }
}

/// A kernel for D = 1, 2, 4 and 8 lanes per segment.
macro_rules! by_depth {
    ($kernel:ident, $isa:expr) => {
        [
            compiled_narrow::<$kernel<T, 1>>($isa),
            compiled_narrow::<$kernel<T, 2>>($isa),
            compiled_narrow::<$kernel<T, 4>>($isa),
            compiled_narrow::<$kernel<T, 8>>($isa),
        ]
    };
}

impl<T: Element> TransformKernel<T> {
    /// The kernels for an instruction set, in vectors of one group.
    pub(crate) fn new(isa: Isa) -> Self {
        Self {
            forward: by_depth!(Forward, isa),
            product: by_depth!(Product, isa),
            inverse: compiled_narrow::<Inverse<T>>(isa),
            scatter: by_depth!(Scatter, isa),
        }
    }
}
