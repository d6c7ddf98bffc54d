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
//! spectra gives y_a + i y_b: the parts need not be separated. Spectra at f and F - f are conjugate, so
//! both frequencies are made together from one load.
//!
//! Bits: all lanes do the same in the same order, whatever the instruction set.

use super::dispatch::Element;
use super::vector::group_lanes;
use crate::aligned::Aligned;
use std::f64::consts::TAU;

/// The shortest transform: two passes of radix 4.
pub(crate) const SHORTEST_TRANSFORM: usize = 16;

/// Samples of a row: real and imaginary parts.
pub(crate) const fn row_samples<T>() -> usize {
    2 * group_lanes::<T>()
}

/// The length F of a transform, its factors, and which rows belong together.
#[derive(Debug)]
pub(crate) struct Transform<T: Element> {
    pub(super) len: usize,
    /// exp(-2 pi i r j / L), r = 1, 2, 3, for 1 <= j < L / 4, for L = F, F / 4 ... > 4.
    pub(super) factors: Aligned<T>,
    /// Rows of the frequencies f and F - f, for 0 <= f <= F / 2.
    pub(super) pairs: Vec<[u32; 2]>,
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

    /// Samples of the rows of one group of lanes.
    pub(super) fn plane(&self) -> usize {
        self.len * row_samples::<T>()
    }

    /// Counts one transform: a multiply-add for each sample of a row in each level.
    #[cfg(test)]
    pub(super) fn count(&self) {
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
pub(crate) struct OutputFrames<'a, T> {
    pub(crate) samples: &'a mut [T],
    /// M, samples from frame to frame.
    pub(crate) stride: usize,
    /// B, the last rows that are wanted.
    pub(crate) count: usize,
}
